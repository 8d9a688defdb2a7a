//! What can be seen of a step from outside while it is under way.

use std::sync::atomic::{AtomicU64, Ordering};

/// Counters of a step under way: written after each block of pairs, so that watching costs nothing. No result
/// depends on them.
#[derive(Debug, Default)]
pub struct Watch {
    pairs: AtomicU64,
    bytes: AtomicU64,
}

impl Watch {
    pub(super) fn see(&self, pairs: u64, bytes: u64) {
        self.pairs.store(pairs, Ordering::Relaxed);
        self.bytes.store(bytes, Ordering::Relaxed);
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
