//! How far the bodies of the plane can get within an interval of time: bounds that hold at every instant
//! of it.

use glam::DVec2;

use crate::geometry::Aabb;
use crate::predict::KnownMotion;
use crate::scene::{BodyId, Drift};

use super::plane::in_space;
use super::scene::{FlatScene, Motion};

/// Rounding of poses, relative to their coordinates: bounds are widened by this.
const ROUNDING: f64 = 1e-12;

impl Motion {
    /// Where the points within `radius_m` of a body's origin can get between two times, `from_s <= to_s`.
    ///
    /// Places go straight from key to key, so the box of those at the ends and at the keys between
    /// them is exact; a turn by d moves a point by at most 2 sin(d / 2) of its distance from the origin.
    pub fn drift(&self, radius_m: f64, [from_s, to_s]: [f64; 2]) -> Drift {
        let keys = self.keys();
        let Some(last) = keys.len().checked_sub(1) else { return Drift::Rests };
        // Those inside and the nearest on either side.
        let start = keys.partition_point(|k| k.time_s <= from_s).saturating_sub(1);
        let end = keys.partition_point(|k| k.time_s < to_s).min(last);
        let around = &keys[start..=end];
        let turns = around.iter().any(|k| k.angle != around[0].angle);
        if !turns && around.iter().all(|k| k.place == around[0].place) {
            return Drift::Rests;
        }
        let [first, last] = [from_s, to_s].map(|t| self.at(t).expect("there are keys"));
        let inside = around.iter().filter(|k| (from_s..=to_s).contains(&k.time_s));
        let (mut by, mut angle, mut size) = (Aabb::of([]), 0.0_f64, radius_m);
        for key in inside.chain([&first, &last]) {
            by = by.with(in_space(key.place - first.place));
            angle = angle.max((key.angle - first.angle).abs());
            // An angle that is rounded displaces as well.
            size = size.max(key.place.abs().max_element()).max(key.angle.abs() * radius_m);
        }
        let by = by.grown(ROUNDING * size);
        if turns {
            let chord = 2.0 * libm::sin(0.5 * angle.min(std::f64::consts::PI)) * radius_m;
            Drift::Turns(by.grown(chord))
        } else {
            Drift::Slides(by)
        }
    }
}

impl KnownMotion for FlatScene {
    fn body_count(&self) -> usize {
        self.bodies().len()
    }

    fn moves(&self, body: BodyId) -> bool {
        let keys = self.bodies()[body.0 as usize].motion.keys();
        keys.iter().any(|k| k.place != keys[0].place || k.angle != keys[0].angle)
    }

    fn drift(&self, body: BodyId, span_s: [f64; 2]) -> Drift {
        let body = &self.bodies()[body.0 as usize];
        let walls = &self.walls()[body.walls.start as usize..body.walls.end as usize];
        let corners = walls.iter().flat_map(|w| [w.local.start, w.local.end]);
        let radius_m = corners.map(DVec2::length).fold(0.0, f64::max);
        body.motion.drift(radius_m, span_s)
    }

    fn light_drifts(&self, _: [f64; 2]) -> Vec<Drift> {
        Vec::new()
    }

    fn next_presence_change_s(&self, _: f64) -> f64 {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::scene::Key;
    use super::*;

    prop_compose! {
        /// Keys some of which repeat the one before, in place, in angle or in both.
        fn motion()(
            steps in prop::collection::vec((0.05..1.0f64, -1.0..1.0f64, -1.0..1.0f64, -4.0..4.0f64, 0..4u8), 0..6),
        ) -> Motion {
            let mut key = Key { time_s: 0.0, place: DVec2::ZERO, angle: 0.0 };
            let keys = steps.into_iter().map(|(wait, x, y, angle, what)| {
                key.time_s += wait;
                if what & 1 > 0 {
                    key.place = DVec2::new(x, y);
                }
                if what & 2 > 0 {
                    key.angle = angle;
                }
                key
            });
            Motion::new(keys.collect())
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        /// Brute force over time: no point of the body gets out of its bound.
        #[test]
        fn no_point_drifts_further_than_said(
            motion in motion(), from in -0.5..3.5f64, length in 0.0..2.0f64,
            x in -1.0..1.0f64, y in -1.0..1.0f64,
        ) {
            let p = DVec2::new(x, y);
            let drift = motion.drift(p.length(), [from, from + length]);
            let start = motion.pose(from);
            for k in 0..=100 {
                let pose = motion.pose(from + length * f64::from(k) / 100.0);
                let by = in_space(pose.point(p) - start.point(p));
                match drift {
                    Drift::Rests => prop_assert_eq!(pose, start),
                    Drift::Slides(_) => prop_assert_eq!(pose.turn, start.turn),
                    Drift::Turns(_) => {}
                }
                let reach = drift.reach();
                prop_assert!(by.cmpge(reach.lo).all() && by.cmple(reach.hi).all(), "{by} {reach:?}");
            }
        }
    }

    #[test]
    fn a_straight_slide_is_bounded_by_its_ends() {
        let key = |time_s, x| Key { time_s, place: DVec2::new(x, 0.0), angle: 0.5 };
        let motion = Motion::new(vec![key(0.0, 0.0), key(10.0, 10.0)]);
        let Drift::Slides(by) = motion.drift(5.0, [2.0, 4.0]) else { panic!() };
        assert!((by.hi.x - 2.0).abs() < 1e-9 && by.lo.length() < 1e-9, "{by:?}");
        assert_eq!(motion.drift(5.0, [10.0, 40.0]), Drift::Rests);
        assert_eq!(Motion::default().drift(5.0, [0.0, 1.0]), Drift::Rests);
    }
}
