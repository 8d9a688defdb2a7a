//! Scale keys: a body has one size, so they come to that and to when there is anything of it.
//!
//! Must not know what has the size.

use glam::DVec3;

use super::clock::Keys;
use crate::tuning::{SAME_SCALE, SWITCH_S};
use relume_core::scene::Interpolation;

/// What scale keys come to.
pub(super) struct Sizes {
    /// The one size, or the one that is held.
    pub(super) scale: DVec3,
    /// When there is anything of it.
    pub(super) presence: Vec<(f64, bool)>,
    /// How the size changes, if it is not only switched.
    pub(super) growth: Option<String>,
}

/// The one size among scale keys, and when the node has it; or, of a size that changes otherwise, the first one, the
/// largest if that is nothing.
pub(super) fn sizes(when: &Keys, values: &[DVec3]) -> Sizes {
    let per_key = if when.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let keys: Vec<DVec3> = values.chunks(per_key).map(|v| v[per_key / 2]).collect();
    let size = |v: &DVec3| v.abs().max_element();
    let larger = |best: DVec3, v: DVec3| if size(&v) > size(&best) { v } else { best };
    let full = keys.iter().copied().fold(DVec3::ZERO, larger);
    let present = |v: &DVec3| size(v) > SAME_SCALE * size(&full);
    let differs = |v: &DVec3| size(&(*v - full)) > SAME_SCALE * size(&full);
    let other = keys.iter().find(|v| present(v) && differs(v));
    let scale = if other.is_some() && present(&keys[0]) { keys[0] } else { full };
    let shown: Vec<bool> = keys.iter().map(present).collect();
    let (presence, slow) = switched(when, &shown);
    let held = format!("it is held at the size {:?}", scale.to_array());
    let growth = match (other, slow) {
        (Some(_), _) => Some(format!("its scale changes over time: {held}")),
        (None, Some((from_s, to_s))) => Some(format!(
            "it grows or shrinks between {from_s} s and {to_s} s: {held}, from halfway on or till then"
        )),
        (None, None) => None,
    };
    Sizes { scale, presence, growth }
}

/// Two times between which something slowly appears or vanishes.
type Ramp = (f64, f64);

/// When what is shown at these keys is there, and between which keys it slowly becomes so or ceases to be.
fn switched(when: &Keys, shown: &[bool]) -> (Vec<(f64, bool)>, Option<Ramp>) {
    let (times_s, onsets_s) = (&when.times_s, when.onsets_s());
    let mut presence = vec![(onsets_s[0], shown[0])];
    let mut slow = None;
    for k in (1..shown.len()).filter(|&k| shown[k] != shown[k - 1]) {
        let (from_s, to_s) = (times_s[k - 1], times_s[k]);
        let ramps = when.interpolation != Interpolation::Step && to_s - from_s > SWITCH_S;
        presence.push((if ramps { 0.5 * (from_s + to_s) } else { onsets_s[k] }, shown[k]));
        slow = slow.or(ramps.then_some((from_s, to_s)));
    }
    (presence, slow)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keyed(keys: &[(f64, DVec3)], interpolation: Interpolation) -> Sizes {
        let times: Vec<f64> = keys.iter().map(|k| k.0).collect();
        let values: Vec<DVec3> = keys.iter().map(|k| k.1).collect();
        sizes(&Keys::new("a", times, interpolation).unwrap(), &values)
    }

    #[test]
    fn scale_switches_are_presence_and_growth_is_held() {
        let (o, s) = (DVec3::ZERO, DVec3::splat(2.0));
        let blink = [(0.0, s), (1.0, o), (2.0, o), (3.0, s)];
        let stepped = keyed(&blink, Interpolation::Step);
        assert_eq!((stepped.scale, stepped.growth), (s, None));
        for (found, meant) in stepped.presence.iter().zip([(0.0, true), (1.0, false), (3.0, true)])
        {
            assert!(found.1 == meant.1 && (found.0 - meant.0).abs() <= 1e-6 * meant.0);
        }
        assert_eq!(stepped.presence.len(), 3);
        let ramped = keyed(&blink, Interpolation::Linear);
        assert_eq!(ramped.presence, [(0.0, true), (0.5, false), (2.5, true)]);
        assert!(ramped.growth.unwrap().contains("between 0 s and 1 s"));
        assert!(keyed(&[(0.0, s), (1.0, s), (1.04, o)], Interpolation::Linear).growth.is_none());
        let grown = keyed(&[(0.0, s), (1.0, s * 1.5)], Interpolation::Step);
        assert_eq!((grown.scale, grown.presence), (s, vec![(0.0, true)]));
        assert!(grown.growth.unwrap().contains("scale changes"));
        // What is nothing at first is held at its largest.
        let born = keyed(&[(0.0, o), (1.0, s), (2.0, s * 2.0)], Interpolation::Linear);
        assert_eq!((born.scale, born.presence), (s * 2.0, vec![(0.0, false), (0.5, true)]));
        assert_eq!(keyed(&[(0.0, s)], Interpolation::Linear).presence, [(0.0, true)]);
        assert_eq!(keyed(&[(0.0, o)], Interpolation::Linear).scale, o);
    }
}
