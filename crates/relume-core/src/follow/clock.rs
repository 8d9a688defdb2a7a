//! Wall-clock time of the phases; it labels reports and decides nothing.

use std::time::Instant;

/// A stop watch.
pub(super) struct Clock {
    start: Instant,
    lap: Instant,
}

// Phases are timed for the report; no result uses it.
#[allow(clippy::disallowed_methods)]
impl Clock {
    pub(super) fn start() -> Clock {
        let now = Instant::now();
        Clock { start: now, lap: now }
    }

    /// Seconds since the last lap.
    pub(super) fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = (now - self.lap).as_secs_f64();
        self.lap = now;
        seconds
    }

    /// Seconds since the start.
    pub(super) fn total(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
