//! Ctrl-C and SIGTERM: the run ends at once, and what is finished is kept.
//!
//! A run looks between its frames whether it should stop. One in the middle of a long frame cannot
//! look; it is ended from here, once what it has finished is in its place.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError, mpsc};
use std::time::Duration;

use relume::export::settle_unfinished;

use crate::clock;
use crate::failure::Failure;
use crate::lock;
use crate::text;

/// How long a run may take to notice by itself.
const GRACE: Duration = Duration::from_millis(600);

/// How long a file that is being written may take before the process ends without it: a pipe that nobody
/// reads never takes what is written.
const FILE_GRACE: Duration = Duration::from_secs(2);

/// Time between two looks whether a file is written.
const BETWEEN_LOOKS: Duration = Duration::from_millis(10);

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
    // Not in the middle of a file, if that gets done.
    let is_kept = keep_within(FILE_GRACE);
    let _guard = is_kept.then(|| try_locked_for(&WRITING, FILE_GRACE));
    settle_unfinished();
    lock::leave();
    text::complain(&format!("\n{why}"));
    std::process::exit(i32::from(why.exit_code()));
}

/// Puts what the run has finished into its place, if that takes no longer; whether it is done.
fn keep_within(patience: Duration) -> bool {
    let (kept, wait) = mpsc::channel();
    // No work of the engine: its results do not depend on it.
    #[allow(clippy::disallowed_methods)]
    std::thread::spawn(move || {
        let failure = locked(&KEEP).as_ref().and_then(|keep| keep().err());
        // Nobody waits any more: as good.
        let _ = kept.send(failure);
    });
    match wait.recv_timeout(patience) {
        Ok(failure) => {
            failure.into_iter().for_each(|failure| text::complain(&failure.to_string()));
            true
        }
        Err(_) => {
            text::complain("the report could not be written in time");
            false
        }
    }
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

/// What a lock guards, or `None` if it is not let go of in so long a time.
fn try_locked_for<T>(mutex: &Mutex<T>, patience: Duration) -> Option<MutexGuard<'_, T>> {
    let mut looks = patience.as_millis() / BETWEEN_LOOKS.as_millis();
    loop {
        match mutex.try_lock() {
            Ok(guard) => return Some(guard),
            Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) if looks == 0 => return None,
            Err(TryLockError::WouldBlock) => {
                looks -= 1;
                std::thread::sleep(BETWEEN_LOOKS);
            }
        }
    }
}

/// What a lock guards, also after a panic elsewhere.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
