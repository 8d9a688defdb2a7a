//! Progress and cancellation of a step under way.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Counters of a step under way: written after each block of pairs, so that watching costs nothing. No result
/// depends on them.
#[derive(Debug, Default)]
pub struct Watch {
    pairs: AtomicU64,
    bytes: AtomicU64,
    cancelled: AtomicBool,
}

impl Watch {
    pub(super) fn see(&self, pairs: u64, bytes: u64) {
        self.pairs.store(pairs, Ordering::Relaxed);
        self.bytes.store(bytes, Ordering::Relaxed);
    }

    /// Calls off the step under way, or the next one if none is: within some milliseconds it goes back to the last solution,
    /// which takes as long as a frame at most if there is one, and ends with
    /// [`SessionError::Cancelled`](crate::session::SessionError::Cancelled).
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Whether a step was called off; no other is then.
    pub(crate) fn take_cancelled(&self) -> bool {
        self.cancelled.swap(false, Ordering::Relaxed)
    }

    /// Pairs that there are so far.
    pub fn pairs(&self) -> u64 {
        self.pairs.load(Ordering::Relaxed)
    }

    /// Memory that they and what is made of them take, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }
}
