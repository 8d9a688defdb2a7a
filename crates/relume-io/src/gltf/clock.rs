//! When keys are: 32-bit key times of files against frames at k / fps.
//!
//! A file holds 1/24 as the nearest 32-bit number; frame 1 of 24 a second is asked for as the nearest
//! 64-bit one, a little earlier or later. Between keys that makes no difference to speak of, but what is
//! switched there would be a whole frame late. Must not know what the keys are of.

use relume_core::scene::check_track;
use relume_core::scene::{Interpolation, SceneError};

/// The largest share of a key's time by which exporters that count in 32 bits (k times a rounded 1 / fps)
/// are off: two roundings, doubled.
const EXPORTERS_ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// Key times of one sampler, in order.
pub(super) struct Keys {
    /// As the file has them, as nearly as 32 bits say: of a frame at a usual rate exactly its time.
    pub(super) times_s: Vec<f64>,
    /// As the file has them.
    stored_s: Vec<f64>,
    pub(super) interpolation: Interpolation,
}

impl Keys {
    /// Checks the times, finite, not negative, ascending; `of` names what they move.
    pub(super) fn new(
        of: &str,
        stored_s: Vec<f64>,
        interpolation: Interpolation,
    ) -> Result<Keys, SceneError> {
        check_track(of, &stored_s, stored_s.len(), Interpolation::Step)?;
        let times_s = stored_s.iter().map(|&t| frame_time_s(t)).collect();
        Ok(Keys { times_s, stored_s, interpolation })
    }

    /// The time of the last key.
    pub(super) fn end_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// The times for a track: what is held from key to key changes at [`Keys::onsets_s`].
    pub(super) fn into_times_s(self) -> Vec<f64> {
        match self.interpolation {
            Interpolation::Step => self.onsets_s(),
            Interpolation::Linear | Interpolation::CubicSpline => self.times_s,
        }
    }

    /// The earliest time that counts as each key's, strictly ascending: everything that 32 bits round to the
    /// key, and what exporters that count in 32 bits lose, but for that never more than a quarter of the way to
    /// the key before. So frame k shows key k wherever keys are one a frame and 32 bits tell them apart.
    pub(super) fn onsets_s(&self) -> Vec<f64> {
        let onset = |k: usize| {
            let time_s = self.stored_s[k];
            let rounding = 0.5 * (time_s - f64::from((time_s as f32).next_down()));
            let gap = if k == 0 { 0.0 } else { time_s - self.stored_s[k - 1] };
            let early = rounding.max((EXPORTERS_ROUNDING * time_s).min(0.25 * gap));
            (time_s - early).max(0.0)
        };
        (0..self.stored_s.len()).map(onset).collect()
    }
}

/// The time of a frame as a 64-bit number, where the 32-bit `time_s` is a rounded one.
fn frame_time_s(time_s: f64) -> f64 {
    let as_frame = |fps: f64| (time_s * fps).round() / fps;
    let rates = [1.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 90.0, 100.0, 120.0, 144.0, 1000.0];
    let of_television = [24000.0 / 1001.0, 30000.0 / 1001.0, 60000.0 / 1001.0];
    let mut exact = rates.into_iter().chain(of_television).map(as_frame);
    exact.find(|&t| t as f32 == time_s as f32).unwrap_or(time_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(times_s: impl Iterator<Item = f32>) -> Keys {
        Keys::new("a", times_s.map(f64::from).collect(), Interpolation::Step).unwrap()
    }

    #[test]
    fn frame_times_are_found_again() {
        for frame in 0..5000 {
            for fps in [24.0, 25.0, 30.0, 60.0] {
                let exact = f64::from(frame) / fps;
                assert_eq!(frame_time_s(f64::from(exact as f32)), exact);
            }
        }
        let odd = f64::from(0.123_456_79_f32);
        assert_eq!(frame_time_s(odd), odd);
    }

    /// The key that a time shows.
    fn shown(onsets_s: &[f64], time_s: f64) -> usize {
        onsets_s.partition_point(|&t| t <= time_s).saturating_sub(1)
    }

    #[test]
    fn a_frame_shows_its_own_key_at_any_rate_and_any_count() {
        let television = [24_000.0 / 1001.0, 30_000.0 / 1001.0, 60_000.0 / 1001.0, 23.976, 29.97];
        let odd = (1..12).map(|k| 7.3 + 25.13 * f64::from(k));
        let some = |from: u32| from..from + 3_000;
        for fps in [24.0, 25.0, 72.0, 90.0, 144.0, 240.0].into_iter().chain(television).chain(odd) {
            for from in [0, 30_000, 200_000] {
                let exact = keys(some(from).map(|k| (f64::from(k) / fps) as f32)).onsets_s();
                for (key, k) in some(from).enumerate() {
                    assert_eq!(shown(&exact, f64::from(k) / fps), key, "{fps}");
                }
            }
            // Exporters that multiply or divide in 32 bits.
            let (step, rate) = ((1.0 / fps) as f32, fps as f32);
            for from in [0, 30_000, 100_000] {
                for sloppy in [
                    keys(some(from).map(|k| k as f32 * step)).onsets_s(),
                    keys(some(from).map(|k| k as f32 / rate)).onsets_s(),
                ] {
                    for (key, k) in some(from).enumerate() {
                        assert_eq!(shown(&sloppy, f64::from(k) / fps), key, "{fps}");
                    }
                }
            }
        }
    }

    #[test]
    fn times_that_do_not_ascend_are_refused_with_the_name_of_what_they_move() {
        for times in [vec![], vec![1.0, 1.0], vec![f64::NAN], vec![-1.0], vec![f64::INFINITY]] {
            let error = Keys::new("walk", times, Interpolation::Linear).err().unwrap().to_string();
            assert!(error.contains("`walk`"), "{error}");
        }
    }
}
