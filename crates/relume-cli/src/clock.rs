//! Wall-clock time, and how many frames are finished. Must not know who watches.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

static DONE: AtomicU64 = AtomicU64::new(0);
static WANTED: AtomicU64 = AtomicU64::new(0);

/// Wall-clock time, for summaries and measurements; no result of the engine uses it.
pub(crate) fn now() -> Instant {
    Instant::now()
}

/// Begins to count: frames wanted, and those that are finished already.
pub(crate) fn begin(wanted: u64, done: u64) {
    DONE.store(done, Ordering::SeqCst);
    WANTED.store(wanted, Ordering::SeqCst);
}

/// Counts a frame more; frames finished, and wanted.
pub(crate) fn finish_one() -> (u64, u64) {
    let done = DONE.fetch_add(1, Ordering::SeqCst) + 1;
    (done, WANTED.load(Ordering::SeqCst))
}

/// Frames finished, and wanted, whether or not anybody watches.
pub(crate) fn finished() -> (u64, u64) {
    (DONE.load(Ordering::SeqCst), WANTED.load(Ordering::SeqCst))
}
