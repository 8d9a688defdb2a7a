//! Ctrl-C: the first asks the run to stop after the present frame, the second stops at once.
//!
//! SIGTERM counts as well, so a scheduler that takes a job down leaves finished frames too.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::failure::Failure;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static WRITING: Mutex<()> = Mutex::new(());

/// Starts to listen.
pub(crate) fn listen() -> Result<(), Failure> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            // Not in the middle of a file.
            let _guard = writing();
            std::process::exit(130);
        }
        let hint = "\nstopping after this frame (Ctrl-C again to stop at once)\n";
        let _ = std::io::Write::write_all(&mut std::io::stderr(), hint.as_bytes());
    })
    .map_err(|error| Failure::new(format_args!("cannot listen for Ctrl-C: {error}")))
}

/// Whether the run should stop.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// While this is held, a second Ctrl-C waits.
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}
