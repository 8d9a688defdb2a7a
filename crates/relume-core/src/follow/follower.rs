//! A solved state, whatever it is of.

use crate::pair::{LinkEvent, PairHash, PairTree};
use crate::predict::Ticks;
use crate::solver::{Links, Radiosity};

use super::report::FrameReport;

/// A solved state: the pairs of a space at one instant, their links by receiver, and the light over them.
pub struct Follower<S> {
    /// Time of the clip, seconds.
    pub(crate) time_s: f64,
    /// Where everything is.
    pub(crate) space: S,
    pub(crate) tree: PairTree,
    pub(crate) hash: PairHash,
    pub(crate) links: Links,
    pub(crate) radiosity: Radiosity,
    /// What happened to links in the last frame, where that is kept.
    pub(crate) events: Vec<LinkEvent>,
    pub(crate) report: FrameReport,
    /// By which certificates expire.
    pub(super) ticks: Ticks,
    /// Mean radiosity when no link was extrapolated last, W/m2.
    pub(super) last_exact_mean_w_m2: f64,
    /// Whether something moved that no motion foresaw.
    pub(super) is_broken: bool,
    /// Whether the radiosities say nothing.
    pub(super) is_unsolved: bool,
}

/// Why there is no solution.
#[derive(Clone, Debug)]
pub(crate) enum Why {
    /// There is no memory for more pairs.
    OutOfMemory,
    /// The frame was called off.
    Cancelled,
    /// Light does not settle.
    Unsettled {
        /// What the last sweep left, relative to the mean radiosity.
        residual: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
    /// What is absorbed and lost is not what is emitted.
    Unbalanced {
        /// Share of what is emitted.
        share: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
}

/// What is said of a solution.
#[derive(Clone)]
pub(crate) struct Said {
    pub(crate) report: FrameReport,
    pub(super) events: Vec<LinkEvent>,
}

impl<S> Follower<S> {
    /// Whether nothing is extrapolated.
    pub(crate) fn is_settled(&self) -> bool {
        self.tree.live_count() == 0
    }

    /// Is told that something moved that no motion foresaw.
    pub(crate) fn break_promise(&mut self) {
        self.tree.forget_certificates();
        self.is_broken = true;
    }

    /// What is said of this solution.
    pub(crate) fn said(&self) -> Said {
        Said { report: self.report.clone(), events: self.events.clone() }
    }
}
