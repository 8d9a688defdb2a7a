//! The session owns all mutable state and runs the phases of a frame; snapshots come out.

use std::sync::Arc;

use crate::scene::Scene;

mod options;
mod report;
mod snapshot;

pub use options::{Options, Oracle, Update};
pub use report::{Energy, FrameReport, PairCounts, RowSumError, Seconds};
pub use snapshot::{Leaf, Snapshot};

/// Why a frame could not be computed.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The links of this tolerance do not fit into the memory allowed.
    #[error(
        "frame {frame} at tolerance {tolerance} needs more than the {limit_bytes} bytes of memory allowed ({links} links so far): raise --max-memory or the tolerance"
    )]
    OutOfMemory {
        /// The frame being computed.
        frame: u32,
        /// The tolerance asked for.
        tolerance: f64,
        /// The limit, bytes.
        limit_bytes: u64,
        /// Links made when the limit was met.
        links: u64,
    },
    /// An option is out of its range.
    #[error("{0}")]
    Option(String),
}

/// One scene being solved, frame by frame.
pub struct Session {
    scene: Arc<Scene>,
    options: Options,
}

impl Session {
    /// Prepares a scene for solving; the links are built by the first [`Session::step`].
    pub fn new(scene: Arc<Scene>, options: Options) -> Result<Session, SessionError> {
        Ok(Session { scene, options })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The options it is solved with.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Brings the solution to `time_s` (seconds of the animation); `frame` only labels the report.
    pub fn step(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        Ok(FrameReport { frame, time_s, ..FrameReport::default() })
    }

    /// The present solution as an immutable value.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn snapshot(&self) -> Snapshot {
        unimplemented!("filled in by the solver")
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory_bytes(&self) -> u64 {
        0
    }
}
