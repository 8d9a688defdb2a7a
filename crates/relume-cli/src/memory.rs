//! `--max-memory`, kept whatever the memory is held for.
//!
//! The engine counts what it is about to hold and stops by itself, with the number of its pairs. What
//! it does not count (tables, pictures, scratch of many threads) is watched from here, by what the
//! system says the process holds. Where the system does not say, the engine's count is all there is.

use std::fs;
use std::sync::Once;
use std::time::Duration;

use indicatif::HumanBytes;

use crate::failure::Failure;
use crate::interrupt;

/// Between two looks.
const INTERVAL: Duration = Duration::from_millis(10);
/// What the program itself and its allocator hold before anything is solved, bytes.
const OWN_BYTES: u64 = 32 << 20;

/// Ends the process with a message once it holds more than `limit_bytes` and what it held before.
pub(crate) fn keep_below(limit_bytes: u64) {
    static ONCE: Once = Once::new();
    let (Some(limit), Some(_)) = (limit_bytes.checked_add(OWN_BYTES), held_bytes()) else { return };
    ONCE.call_once(|| {
        // No work of the engine: its results do not depend on it.
        #[allow(clippy::disallowed_methods)]
        std::thread::spawn(move || {
            loop {
                if held_bytes().is_some_and(|held| held > limit) {
                    interrupt::end(
                        &Failure::new(format_args!(
                            "more than the {} of memory allowed is needed",
                            HumanBytes(limit_bytes)
                        ))
                        .help(
                            "raise --max-memory or the tolerance; with many threads, use fewer; what is \
                             finished stays",
                        ),
                    );
                }
                std::thread::sleep(INTERVAL);
            }
        });
    });
}

/// What this process holds now, bytes; `None` where the system does not say.
fn held_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}
