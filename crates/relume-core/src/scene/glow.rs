//! Emission that changes: keyframes of a material's exitance or of a light's intensity. In files: KHR_animation_pointer.

use glam::DVec3;

use super::limits::emission;
use super::{Interpolation, Light, Material, Track};

/// How an emission changes over time: `scale` times the values of all tracks, channel by channel, and never below 0
/// (a cubic spline may swing there).
#[derive(Clone, Debug, PartialEq)]
pub struct Glow {
    /// The emission where every track is 1: W/m2 of a material, W/sr or W/m2 of a light; linear RGB.
    pub scale: [f64; 3],
    /// Keyframes, of a colour or of one strength for all channels.
    pub tracks: Vec<Track>,
}

impl Glow {
    /// The emission at `time_s`; outside the keys that of the first or last.
    pub fn at(&self, time_s: f64) -> [f64; 3] {
        let scale = DVec3::from_array(self.scale);
        let value = self.tracks.iter().fold(scale, |value, track| value * track.at(time_s));
        emission(value.max(DVec3::ZERO).to_array())
    }

    /// The most that each channel may be at any time: a bound, which cubic splines need not reach.
    pub fn most(&self) -> [f64; 3] {
        let scale = DVec3::from_array(self.scale);
        let (low, high) = self.tracks.iter().fold((scale, scale), |(low, high), track| {
            let (from, to) = range(track);
            let ends = [low * from, low * to, high * from, high * to];
            let pick = |f: fn(DVec3, DVec3) -> DVec3| ends.into_iter().reduce(f).expect("four");
            (pick(DVec3::min), pick(DVec3::max))
        });
        high.max(low).max(DVec3::ZERO).to_array()
    }

    /// The time of the last key, seconds.
    pub(super) fn end_s(&self) -> f64 {
        let ends = self.tracks.iter().filter_map(|track| track.times_s.last());
        ends.fold(0.0, |end, &t| end.max(t))
    }
}

/// The smallest and largest value of each component at any time, or what bounds them.
fn range(track: &Track) -> (DVec3, DVec3) {
    let mut reached = Vec::new();
    if track.interpolation == Interpolation::CubicSpline {
        // A Hermite segment stays within the hull of its Bezier points.
        for (k, key) in track.values.chunks_exact(3).enumerate() {
            let third = |from: usize, to: usize| (track.times_s[to] - track.times_s[from]) / 3.0;
            reached.push(key[1]);
            if k > 0 {
                reached.push(key[1] - key[0] * third(k - 1, k));
            }
            if k + 1 < track.times_s.len() {
                reached.push(key[1] + key[2] * third(k, k + 1));
            }
        }
    } else {
        reached.extend_from_slice(&track.values);
    }
    let fold =
        |f: fn(DVec3, DVec3) -> DVec3| reached.iter().copied().reduce(f).unwrap_or(DVec3::ZERO);
    (fold(DVec3::min), fold(DVec3::max))
}

impl Material {
    /// Exitance at `time_s`, W/m2.
    pub fn exitance_at(&self, time_s: f64) -> [f64; 3] {
        self.glow.as_ref().map_or(self.exitance, |glow| glow.at(time_s))
    }

    /// Upper bound of the exitance over all time, W/m2.
    pub fn most_exitance(&self) -> [f64; 3] {
        self.glow.as_ref().map_or(self.exitance, Glow::most)
    }

    /// Whether it emits at any time.
    pub fn emits(&self) -> bool {
        self.most_exitance().iter().any(|&m| m > 0.0)
    }
}

impl Light {
    /// Intensity at `time_s`, in the unit of [`Light::intensity`].
    pub fn intensity_at(&self, time_s: f64) -> [f64; 3] {
        self.glow.as_ref().map_or(self.intensity, |glow| glow.at(time_s))
    }

    /// Upper bound of the intensity over all time, in the unit of [`Light::intensity`].
    pub fn most_intensity(&self) -> [f64; 3] {
        self.glow.as_ref().map_or(self.intensity, Glow::most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(values: &[f64], interpolation: Interpolation) -> Track {
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let times_s = (0..values.len() / per_key).map(|k| k as f64).collect();
        Track { times_s, values: values.iter().map(|&v| DVec3::splat(v)).collect(), interpolation }
    }

    #[test]
    fn colour_and_strength_multiply_and_never_go_below_nothing() {
        let mut colour = track(&[0.0, 1.0], Interpolation::Linear);
        colour.values[1] = DVec3::new(1.0, 0.5, -1.0);
        let strength = track(&[4.0, 8.0], Interpolation::Step);
        let glow = Glow { scale: [1.0, 2.0, 1.0], tracks: vec![colour, strength] };
        assert_eq!(glow.at(0.5), [2.0, 2.0, 0.0]);
        assert_eq!(glow.at(1.0), [8.0, 8.0, 0.0]);
        assert_eq!((glow.at(-1.0), glow.at(9.0)), ([0.0; 3], [8.0, 8.0, 0.0]));
        assert_eq!(glow.most(), [8.0, 8.0, 0.0]);
        assert_eq!(glow.end_s(), 1.0);
    }

    #[test]
    fn nothing_is_brighter_than_the_most_it_may_be() {
        let spline =
            track(&[0.0, 1.0, 9.0, -3.0, 2.0, -5.0, 1.0, 0.5, 0.0], Interpolation::CubicSpline);
        let glow = Glow { scale: [1.0, 0.5, 2.0], tracks: vec![spline.clone(), spline] };
        let most = glow.most();
        for k in 0..=200 {
            let now = glow.at(f64::from(k) / 100.0);
            assert!((0..3).all(|c| now[c] <= most[c]), "{now:?} {most:?}");
        }
    }
}
