//! Options of a session.

use crate::follow::Update;
use crate::pair::RefinementCriterion;
pub use crate::space::Aim;
use crate::space::Bedding;

use super::tuning::LINK_SHARE;

/// Options of a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Relative error of irradiance aimed at (RMS), in (0, 1). Default 0.02.
    pub tolerance: f64,
    /// What the tolerance is about, with the error oracle.
    pub aim: Aim,
    /// Criterion by which a pair becomes a link.
    pub oracle: Oracle,
    /// Strategy by which the pair tree follows motion.
    pub update: Update,
    /// Whether groups of small patches of one rigid body may be ends of links, where there are many such patches: with the
    /// error oracle alone. Default true. Tables of form factors go without.
    pub groups: bool,
    /// Whether every step measures row sums and energies: a pass over all links, whatever moved.
    pub balance: bool,
    /// Whether every step keeps the events of its links, for [`Frame::events`](super::Frame::events).
    pub events: bool,
    /// Limit on the engine's memory, bytes; `None` for no limit.
    pub max_memory_bytes: Option<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            tolerance: 0.02,
            aim: Aim::Mesh,
            oracle: Oracle::Error,
            update: Update::Certificate,
            groups: true,
            balance: true,
            events: false,
            max_memory_bytes: None,
        }
    }
}

/// Oracle: the criterion by which a pair becomes a link.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Oracle {
    /// Estimated irradiance error that a link causes on its receivers: the default.
    Error,
    /// Form factor, as in Forsyth, Yang and Teo 1995: a pair becomes a link where its form factor is below `epsilon`; elements
    /// are never smaller than `min_area_m2`.
    FormFactor {
        /// Largest form factor of a link.
        epsilon: f64,
        /// Elements below this area are not refined, m2.
        min_area_m2: f64,
    },
}

impl Options {
    /// Checks every range.
    pub(super) fn validate(&self) -> Result<(), super::SessionError> {
        let fail = |text: String| Err(super::SessionError::Option(text));
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return fail(format!(
                "tolerance {} is not between 0 and 1: it is a relative error, such as 0.02",
                self.tolerance
            ));
        }
        self.update.check().or_else(fail)?;
        if let Oracle::FormFactor { epsilon, min_area_m2 } = self.oracle
            && !(epsilon > 0.0 && epsilon < 1.0 && min_area_m2 >= 0.0)
        {
            return fail(format!(
                "form-factor oracle: the form factor {epsilon} must lie between 0 and 1, and the area {min_area_m2} m2 must not be negative"
            ));
        }
        Ok(())
    }

    /// What builds start with.
    pub(super) fn bedding(&self) -> Bedding {
        let weighs = self.oracle == Oracle::Error;
        Bedding { groups: weighs && self.groups, coarse: weighs }
    }

    /// Criterion by which the pair tree refines.
    pub(super) fn refinement_criterion(&self) -> RefinementCriterion {
        match self.oracle {
            Oracle::Error => RefinementCriterion::Error { threshold: self.tolerance * LINK_SHARE },
            Oracle::FormFactor { epsilon, min_area_m2 } => {
                RefinementCriterion::FormFactor { epsilon, min_area_m2 }
            }
        }
    }
}
