//! The progress bar: on stderr, and only where that is a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{HumanBytes, HumanCount, ProgressBar, ProgressStyle};

/// A bar over frames; does nothing where nobody watches.
pub(crate) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar over `frames` frames, of which `done` are finished already.
    pub(crate) fn new(frames: usize, done: usize, quiet: bool) -> Progress {
        if quiet || !std::io::stderr().is_terminal() {
            return Progress { bar: ProgressBar::hidden() };
        }
        let style = "{bar:24} {pos}/{len} {msg}, {elapsed} gone, {eta} left";
        let bar = ProgressBar::new(frames as u64)
            .with_style(ProgressStyle::with_template(style).unwrap_or_else(|_| {
                // The template is a constant; a bar of another look is no reason to fail.
                ProgressStyle::default_bar()
            }))
            .with_position(done as u64)
            .with_message("starting");
        // The time left is that of the frames still to do.
        bar.reset_eta();
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar }
    }

    /// A frame is being computed.
    pub(crate) fn start(&self, frame: u32, links: u64, memory_bytes: u64) {
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
        self.bar.inc(1);
    }

    /// Does something, such as printing a line, with the bar out of the way.
    pub(crate) fn suspend<T>(&self, action: impl FnOnce() -> T) -> T {
        self.bar.suspend(action)
    }

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
