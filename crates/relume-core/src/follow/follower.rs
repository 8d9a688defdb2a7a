//! The solved state of a space.

use crate::pair::{LinkEvent, PairHash, PairTree};
use crate::predict::Ticks;
use crate::solver::{Links, Radiosity};

use super::report::FrameReport;

/// A solved state: the pairs of a space at one instant, their links by receiver, and the light over them.
pub struct Follower<S> {
    /// Time of the clip, seconds.
    pub(crate) time_s: f64,
    /// Elements and their places.
    pub(crate) space: S,
    pub(crate) tree: PairTree,
    pub(crate) hash: PairHash,
    pub(crate) links: Links,
    pub(crate) radiosity: Radiosity,
    /// Events of links in the last frame, if they are kept.
    pub(crate) events: Vec<LinkEvent>,
    pub(crate) report: FrameReport,
    /// Clock of the certificates.
    pub(crate) ticks: Ticks,
    /// Mean radiosity of the last solution without extrapolated links, W/m2.
    pub(super) last_exact_mean_w_m2: f64,
    /// Whether a body moved otherwise than predicted.
    pub(super) is_broken: bool,
    /// Whether there is no solution yet to start the solver from.
    pub(super) is_unsolved: bool,
}

/// Reason why a frame has no solution.
#[derive(Clone, Debug)]
pub(crate) enum Why {
    /// There is no memory for more pairs.
    OutOfMemory,
    /// The frame was called off.
    Cancelled,
    /// Light does not settle.
    Unsettled {
        /// Residual of the last sweep, relative to the mean radiosity.
        residual: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
    /// Absorbed and escaped flux differ from the emitted flux.
    Unbalanced {
        /// Difference as a share of the emitted flux, 1.
        share: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
}

/// Report and events of a solution.
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

    /// Voids all certificates: a body moved otherwise than predicted.
    pub(crate) fn break_promise(&mut self) {
        self.tree.forget_certificates();
        self.is_broken = true;
    }

    /// Report and events of this solution.
    pub(crate) fn said(&self) -> Said {
        Said { report: self.report.clone(), events: self.events.clone() }
    }
}
