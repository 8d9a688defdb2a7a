//! A clock of even ticks by which certificates expire.

use super::tuning::{AHEAD, STEP_RATIO_MAX};

/// Number of a tick; 0 is before all of them.
pub type Tick = u16;

/// Even ticks over the times that steps ask for.
///
/// What holds until tick k holds at every time up to [`Ticks::time_s`] of k, whether or not a step
/// falls on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ticks {
    start_s: f64,
    length_s: f64,
    now: Tick,
}

impl Ticks {
    /// Goes on from one time to another. Whether all certificates are void: time went back, jumped or
    /// begins only now, and the numbers start anew.
    pub fn go(&mut self, from_s: f64, to_s: f64) -> bool {
        match self.tick_at(from_s, to_s) {
            Some(now) => {
                self.now = now;
                false
            }
            None => {
                // Ticks of length 0 lead nowhere: nothing is certified then.
                let length_s = (to_s - from_s).max(0.0);
                *self = Ticks { start_s: to_s - length_s, length_s, now: 1 };
                true
            }
        }
    }

    /// Whether the clock goes on from one time to another, and predictions hold.
    pub fn goes_on(&self, from_s: f64, to_s: f64) -> bool {
        self.tick_at(from_s, to_s).is_some()
    }

    fn tick_at(&self, from_s: f64, to_s: f64) -> Option<Tick> {
        let step = to_s - from_s;
        if step <= 0.0
            || step > STEP_RATIO_MAX * self.length_s
            || step * STEP_RATIO_MAX < self.length_s
        {
            return None;
        }
        let mut now = u32::from(self.now);
        while now <= u32::from(Tick::MAX / 2) && self.at(now) < to_s {
            now += 1;
        }
        (now <= u32::from(Tick::MAX / 2)).then_some(now as Tick)
    }

    fn at(&self, tick: u32) -> f64 {
        self.start_s + self.length_s * f64::from(tick)
    }

    /// The first tick at or after the present time.
    pub fn now(&self) -> Tick {
        self.now
    }

    /// Time of a tick, seconds.
    pub fn time_s(&self, tick: Tick) -> f64 {
        self.at(u32::from(tick))
    }

    /// From tick to tick, seconds.
    pub fn length_s(&self) -> f64 {
        self.length_s
    }

    /// From now to the last tick that anything is certified for, seconds.
    pub fn horizon_s(&self) -> f64 {
        self.length_s * f64::from(AHEAD[AHEAD.len() - 1])
    }

    /// Whether time goes on at all.
    pub fn runs(&self) -> bool {
        self.length_s > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_steps_are_ticks() {
        let mut ticks = Ticks::default();
        assert!(ticks.go(0.0, 0.1) && ticks.runs());
        let first = ticks.now();
        for k in 1..1000 {
            let t = 0.1 * f64::from(k + 1);
            assert!(!ticks.go(0.1 * f64::from(k), t));
            assert!(ticks.time_s(ticks.now()) >= t && ticks.time_s(ticks.now() - 1) < t);
            assert!(ticks.now() - first <= k as Tick + 1);
        }
    }

    #[test]
    fn going_back_or_far_starts_anew() {
        let mut ticks = Ticks::default();
        ticks.go(0.0, 0.1);
        assert!(!ticks.go(0.1, 0.2));
        assert!(ticks.go(0.2, 0.1), "back");
        assert!(!ticks.runs());
        assert!(ticks.go(0.1, 0.2) && ticks.runs());
        assert!(!ticks.go(0.2, 0.55));
        assert!(ticks.go(0.55, 9.0), "far");
        assert!(ticks.time_s(ticks.now()) >= 9.0);
    }

    #[test]
    fn a_long_run_starts_anew_before_numbers_run_out() {
        let mut ticks = Ticks::default();
        ticks.go(0.0, 1.0);
        let voids = (1..100_000).filter(|&k| ticks.go(f64::from(k), f64::from(k + 1))).count();
        assert!((1..10).contains(&voids), "{voids}");
    }
}
