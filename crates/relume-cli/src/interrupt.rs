//! Ctrl-C and SIGTERM: the run ends at once, and what is finished is kept.
//!
//! A run looks between its frames whether it should stop. One in the middle of a long frame cannot
//! look; it is ended from here, once what it has finished is in its place.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use relume::export::settle_unfinished;

use crate::clock;
use crate::failure::Failure;
use crate::text;

/// How long a run may take to notice by itself.
const GRACE: Duration = Duration::from_millis(600);

/// Puts what a run has finished into its place.
type Keep = Box<dyn Fn() -> Result<(), Failure> + Send>;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static WRITING: Mutex<()> = Mutex::new(());
static KEEP: Mutex<Option<Keep>> = Mutex::new(None);

/// Starts to listen.
pub(crate) fn listen() -> Result<(), Failure> {
    ctrlc::set_handler(|| {
        REQUESTED.store(true, Ordering::SeqCst);
        std::thread::sleep(GRACE);
        let (done, wanted) = clock::finished();
        end(&Failure::interrupted(format_args!(
            "stopped: {} of {} finished, the one under way is left out",
            text::count(done),
            text::counted(wanted as usize, "frame")
        )));
    })
    .map_err(|error| Failure::new(format_args!("cannot listen for Ctrl-C: {error}")))
}

/// Ends the process with a message, from any thread and in the middle of anything but a file, once
/// what is finished is kept.
pub(crate) fn end(why: &Failure) -> ! {
    if let Some(keep) = &*locked(&KEEP)
        && let Err(failure) = keep()
    {
        text::complain(&failure.to_string());
    }
    // Not in the middle of a file.
    let _guard = writing();
    settle_unfinished();
    text::complain(&format!("\n{why}"));
    std::process::exit(i32::from(why.exit_code()));
}

/// Ends the process at once where memory ran out, so that the rows kept so far stay as they do when a run is
/// stopped; hands any other failure on.
pub(crate) fn keeping_rows(failure: Failure) -> Failure {
    if failure.is_out_of_memory() {
        end(&failure);
    }
    failure
}

/// Says how what is finished is kept when the run is ended in the middle of a frame.
pub(crate) fn keep_with(keep: impl Fn() -> Result<(), Failure> + Send + 'static) {
    *locked(&KEEP) = Some(Box::new(keep));
}

/// Whether the run should stop.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// While this is held, the process is not ended.
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    locked(&WRITING)
}

/// What a lock guards, also after a panic elsewhere.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
