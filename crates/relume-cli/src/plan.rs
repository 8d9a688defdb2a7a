//! What `relume bench` measures, from the command line.

use std::path::Path;

use crate::args::{MeasureFlags, UpdateChoice};

/// What is measured, and what becomes of it.
pub(crate) struct Plan<'a> {
    /// How the links follow the motion.
    pub(crate) update: UpdateChoice,
    /// Of this many frames one is built from scratch too.
    pub(crate) every: usize,
    /// All strategies instead.
    pub(crate) compare: bool,
    /// File for the numbers.
    pub(crate) json: Option<&'a Path>,
    /// Neither tables nor a progress bar.
    pub(crate) quiet: bool,
}

impl<'a> Plan<'a> {
    /// From the command line.
    pub(crate) fn new(flags: &'a MeasureFlags, update: UpdateChoice, quiet: bool) -> Plan<'a> {
        let MeasureFlags { every, compare, json } = flags;
        Plan { update, every: *every, compare: *compare, json: json.as_deref(), quiet }
    }
}
