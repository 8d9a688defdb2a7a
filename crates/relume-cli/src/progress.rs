//! The progress bar: on stderr, and only where that is a terminal.

use std::io::IsTerminal;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::{HumanBytes, HumanCount, HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use relume::session::Watch;

use crate::clock::{self, now};
use crate::interrupt;
use crate::memory;
use crate::output;

/// What is known of the time left once `done` frames of this run took `elapsed` and `left` remain;
/// nothing before the first is finished.
fn time_left(done: u64, left: u64, elapsed: Duration) -> String {
    match (u32::try_from(done), u32::try_from(left)) {
        (Ok(done), Ok(left)) if done > 0 && left > 0 => {
            format!(", about {} left", HumanDuration((elapsed / done * left).max(SECOND)))
        }
        _ => String::new(),
    }
}

const SECOND: Duration = Duration::from_secs(1);

/// A bar over frames; does nothing where nobody watches.
pub(crate) struct Progress {
    bar: ProgressBar,
    started: Instant,
    /// Frames finished before this run.
    before: u64,
    /// What is seen of a frame that is built from nothing, and how many pairs it is likely to have.
    watched: Watched,
}

/// Shared with the bar, which looks at each of its ticks.
type Watched = Arc<Mutex<Option<(Arc<Watch>, f64)>>>;

/// What there is of a frame under way; nothing before there is any.
fn so_far(pairs: u64, expected: f64, bytes: u64) -> String {
    if pairs == 0 {
        return String::new();
    }
    let share = match pairs as f64 / expected.max(1.0) {
        share if share <= 1.0 => format!("about {:.0} %", 100.0 * share),
        _ => "more than estimated".to_owned(),
    };
    format!(", {} pairs so far ({share}), {}", HumanCount(pairs), HumanBytes(bytes))
}

impl Progress {
    /// A bar over `frames` frames, of which `done` are finished already.
    pub(crate) fn new(frames: usize, done: usize, quiet: bool) -> Progress {
        clock::begin(frames as u64, done as u64);
        let (started, before, watched) = (now(), done as u64, Watched::default());
        if quiet || !std::io::stderr().is_terminal() {
            return Progress { bar: ProgressBar::hidden(), started, before, watched };
        }
        let style = "{bar:24} {pos}/{len} {msg}{sofar}, {elapsed} gone{prefix}";
        let seen = Arc::clone(&watched);
        let sofar = move |_: &ProgressState, out: &mut dyn std::fmt::Write| {
            if let Some((watch, expected)) = &*interrupt::locked(&seen) {
                // A line that cannot be shown is no reason to stop.
                let _ = out.write_str(&so_far(watch.pairs(), *expected, watch.bytes()));
            }
        };
        let bar = ProgressBar::new(frames as u64)
            .with_style(
                ProgressStyle::with_template(style)
                    .unwrap_or_else(|_| {
                        // The template is a constant; a bar of another look is no reason to fail.
                        ProgressStyle::default_bar()
                    })
                    .with_key("sofar", sofar),
            )
            .with_position(done as u64)
            .with_message("starting");
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar, started, before, watched }
    }

    /// Shows what is seen of the next frame, which is built from nothing, and is likely to have so many pairs.
    pub(crate) fn watch(&self, watch: Arc<Watch>, expected: f64) {
        *interrupt::locked(&self.watched) = Some((watch, expected));
    }

    /// A frame is being computed.
    pub(crate) fn start(&self, frame: u32, links: u64, memory_bytes: u64) {
        memory::at(format_args!("frame {frame}"));
        let mut message = format!("frame {frame}");
        if links > 0 {
            message += &format!(", {} links", HumanCount(links));
        }
        if memory_bytes > 0 {
            message += &format!(", {}", HumanBytes(memory_bytes));
        }
        self.bar.set_message(message);
    }

    /// A frame is finished.
    pub(crate) fn finish_frame(&self) {
        let (done, wanted) = clock::finish_one();
        *interrupt::locked(&self.watched) = None;
        self.bar.inc(1);
        let left = wanted.saturating_sub(done);
        self.bar.set_prefix(time_left(done - self.before, left, self.started.elapsed()));
    }

    /// Does something, such as printing a line, with the bar out of the way.
    pub(crate) fn suspend<T>(&self, action: impl FnOnce() -> T) -> T {
        self.bar.suspend(action)
    }

    /// Says lines with the bar out of the way, from any thread.
    pub(crate) fn aside(&self) -> impl Fn(&str) + Send + 'static {
        let bar = self.bar.clone();
        move |line| bar.suspend(|| output::complain(line))
    }

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_there_is_of_a_frame_is_said() {
        assert_eq!(so_far(0, 1e6, 0), "");
        assert_eq!(so_far(250_000, 1e6, 3 << 20), ", 250,000 pairs so far (about 25 %), 3.00 MiB");
        assert_eq!(so_far(5, 0.0, 1), ", 5 pairs so far (more than estimated), 1 B");
    }

    #[test]
    fn nothing_is_said_of_the_time_left_before_a_frame_is_finished() {
        let minutes = Duration::from_secs(300);
        assert_eq!(time_left(0, 9, minutes), "");
        assert_eq!(time_left(2, 4, minutes), ", about 10 minutes left");
        assert_eq!(time_left(9, 1, Duration::from_millis(9)), ", about 1 second left");
        assert_eq!(time_left(9, 0, minutes), "");
    }
}
