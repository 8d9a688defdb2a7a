//! `--max-memory`: a limit on what the whole process holds, from the first file that is read.
//!
//! Memory is counted before it is asked for where that can be known: by the engine for its pairs
//! and elements, by the reader for files and images, by [`ask`] for pictures. What nobody counts is
//! watched from here, by what the system says the process holds, and ends the run. Where the system
//! does not say, the counts are all there is.

use std::fmt::Display;
use std::fs::File;
use std::io::Read;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use indicatif::HumanBytes;

use crate::failure::Failure;
use crate::interrupt;

/// What the program itself holds beside what is counted, bytes. A quarter of what a process may be above its
/// limit: the rest is for what it takes between two looks, on a machine whose cores are taken.
const OWN_BYTES: u64 = 8 << 20;
/// Shortest and longest time between two looks.
const INTERVAL: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(50));
/// What one core can take of memory in a second, bytes: fresh pages are zeroed first.
const CORE_BYTES_S: f64 = 3e9;

static LIMIT: OnceLock<u64> = OnceLock::new();
/// What is under way, for messages.
static NOW: Mutex<String> = Mutex::new(String::new());

/// Sets the limit of the process, bytes, before anything is read, and starts to watch it.
pub(crate) fn keep_below(limit: Option<u64>) {
    let Some(bytes) = limit else { return };
    if LIMIT.set(bytes).is_err() || held_bytes().is_none() {
        return;
    }
    // No work of the engine: its results do not depend on it.
    #[allow(clippy::disallowed_methods)]
    std::thread::spawn(move || watch(bytes));
}

/// Ends the process with a message once it holds more than allowed.
fn watch(limit_bytes: u64) {
    let most = limit_bytes.saturating_add(OWN_BYTES);
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let rate = CORE_BYTES_S * cores.min(16) as f64;
    while let Some(held) = held_bytes() {
        let Some(left) = most.checked_sub(held) else {
            interrupt::end(&exceeded(&interrupt::locked(&NOW)));
        };
        // Never longer than it takes to use up what is left.
        let soonest = Duration::from_secs_f64(left as f64 / rate);
        std::thread::sleep(soonest.clamp(INTERVAL.0, INTERVAL.1));
    }
}

/// The limit, bytes, if there is one.
pub(crate) fn limit_bytes() -> Option<u64> {
    LIMIT.get().copied()
}

/// The limit for one of several, bytes, where the others hold so many.
pub(crate) fn left_beside(bytes: u64) -> Option<u64> {
    left_of(limit_bytes(), bytes)
}

fn left_of(limit_bytes: Option<u64>, others_bytes: u64) -> Option<u64> {
    limit_bytes.map(|limit| limit.saturating_sub(others_bytes))
}

/// Says what is under way: `frame 3`, ``reading `room.glb` ``.
pub(crate) fn at(what: impl Display) {
    if LIMIT.get().is_some() {
        *interrupt::locked(&NOW) = what.to_string();
    }
}

/// The message of a run that needs more than allowed: at once if `what` needs this many bytes more.
pub(crate) fn ask(bytes: u64, what: impl Display) -> Result<(), Failure> {
    let Some(limit) = limit_bytes() else { return Ok(()) };
    let held = held_bytes().unwrap_or(0);
    if held.saturating_add(bytes) <= limit.saturating_add(OWN_BYTES) {
        return Ok(());
    }
    let (bytes, held) = (HumanBytes(bytes), HumanBytes(held));
    Err(exceeded(&format!("{what} ({bytes} beside {held} that are held)")))
}

/// The message of something that needs more than allowed.
pub(crate) fn exceeded(what: &str) -> Failure {
    let limit = HumanBytes(limit_bytes().unwrap_or(u64::MAX));
    let what = if what.is_empty() { "this".to_owned() } else { what.to_owned() };
    Failure::out_of_memory(format_args!("{what} needs more than the {limit} of memory allowed")).help(
        "raise --max-memory, or ask for less: a coarser tolerance or epsilon, smaller pictures, fewer threads, a \
         simpler scene; what is finished stays",
    )
}

/// What this process holds now, bytes; `None` where the system does not say.
fn held_bytes() -> Option<u64> {
    status("VmRSS:")
}

/// Most memory this process has held, bytes, as the system counts it; `None` where it does not say.
pub(crate) fn peak_bytes() -> Option<u64> {
    status("VmHWM:")
}

/// A size from what the system says of this process, bytes. Without asking the allocator for more.
fn status(name: &str) -> Option<u64> {
    let mut buffer = [0; 4096];
    let mut length = 0;
    let mut file = File::open("/proc/self/status").ok()?;
    loop {
        match file.read(buffer.get_mut(length..)?).ok()? {
            0 => break,
            read => length += read,
        }
    }
    let text = std::str::from_utf8(&buffer[..length]).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_side_by_side_have_one_limit() {
        assert_eq!(left_of(None, 7), None);
        assert_eq!(left_of(Some(10), 7), Some(3));
        assert_eq!(left_of(Some(10), 12), Some(0));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_the_process_holds_is_known() {
        let held = held_bytes().unwrap();
        assert!(held > 100_000 && peak_bytes().unwrap() >= held / 2);
    }
}
