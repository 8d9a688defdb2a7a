//! How far animated nodes can get within an interval of time: bounds that hold at every instant of it.

use glam::{DMat3, DQuat, DVec3};

use super::motion::{Interpolation, Motion, Node, NodeId, RotationTrack, Track};
use super::{BodyId, Scene};
use crate::geometry::Aabb;

/// Where the points of something rigid can get, seen from where they are at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drift {
    /// Nowhere: its pose has the same bits all the time.
    Rests,
    /// Each point is displaced by a vector of this box, metres, the same for all points: nothing turns.
    Slides(Aabb),
    /// Each point is displaced by some vector of this box, metres.
    Turns(Aabb),
}

impl Drift {
    /// The box of all displacements.
    pub fn reach(&self) -> Aabb {
        match *self {
            Drift::Rests => NOWHERE,
            Drift::Slides(by) | Drift::Turns(by) => by,
        }
    }
}

const NOWHERE: Aabb = Aabb { lo: DVec3::ZERO, hi: DVec3::ZERO };

/// Rounding of poses, relative to their coordinates: bounds are widened by this.
const ROUNDING: f64 = 1e-12;

impl Scene {
    /// Where the points of a body can get between two times, `from_s <= to_s`. Says nothing about its
    /// presence.
    pub(crate) fn drift(&self, body: BodyId, [from_s, to_s]: [f64; 2]) -> Drift {
        if !self.moves(body) {
            return Drift::Rests;
        }
        let points = self.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
        let radius = points.map(|p| p.length()).fold(0.0, f64::max);
        self.motion.drift(self.bodies[body.0 as usize].node, radius, [from_s, to_s])
    }

    /// The first time after `time_s` at which a body or a light appears or vanishes; infinite if none
    /// does any more.
    pub(crate) fn next_presence_change_s(&self, time_s: f64) -> f64 {
        let changes = self.motion.nodes.iter().flat_map(|n| &n.presence).map(|key| key.0);
        changes.filter(|&t| t > time_s).fold(f64::INFINITY, f64::min)
    }
}

impl Motion {
    /// Where points within `radius_m` of a node's origin can get between two times, `from_s <= to_s`.
    pub fn drift(&self, node: NodeId, radius_m: f64, [from_s, to_s]: [f64; 2]) -> Drift {
        let interval = [from_s, to_s];
        let (mut by, mut reach, mut rests, mut turns) = (NOWHERE, radius_m, true, false);
        for n in self.upward(node) {
            let slides = n.slides(interval);
            let angle = n.turns_by(interval);
            rests &= slides.is_none() && angle == 0.0;
            if angle > 0.0 {
                turns = true;
                let size = longest(&by) + 2.0 * libm::sin(0.5 * angle.min(PI)) * reach;
                by = NOWHERE.grown(size);
            } else {
                by = rotated(&by, n.local_pose(from_s).rotation);
            }
            let at = n.local_pose(from_s).translation;
            let shift = slides.unwrap_or(NOWHERE);
            by = Aabb { lo: by.lo + shift.lo, hi: by.hi + shift.hi };
            reach += at.length() + longest(&shift);
        }
        if rests {
            return Drift::Rests;
        }
        let by = by.grown(ROUNDING * (reach + longest(&by)));
        if turns { Drift::Turns(by) } else { Drift::Slides(by) }
    }
}

const PI: f64 = std::f64::consts::PI;

/// The largest length of a vector of a box that holds 0.
fn longest(by: &Aabb) -> f64 {
    by.lo.abs().max(by.hi.abs()).length()
}

/// The box around a turned box.
fn rotated(by: &Aabb, rotation: DMat3) -> Aabb {
    let (middle, half) = (rotation * by.centre(), by.extent() * 0.5);
    let abs = DMat3::from_cols(rotation.x_axis.abs(), rotation.y_axis.abs(), rotation.z_axis.abs());
    let half = abs * half;
    Aabb { lo: middle - half, hi: middle + half }
}

impl Node {
    /// Displacements of the origin within an interval; `None` if there is none at all.
    fn slides(&self, [from_s, to_s]: [f64; 2]) -> Option<Aabb> {
        let track = self.translation_track.as_ref()?;
        let keys = keys_around(&track.times_s, [from_s, to_s]);
        if track.is_constant(keys.clone()) {
            return None;
        }
        let at = track.at(from_s);
        let mut reach = Aabb::of([at, track.at(to_s)]);
        match track.interpolation {
            Interpolation::Linear | Interpolation::Step => {
                let inside = keys.filter(|&k| (from_s..=to_s).contains(&track.times_s[k]));
                reach = inside.fold(reach, |b, k| b.with(track.values[k]));
            }
            Interpolation::CubicSpline => {
                for k in keys.clone().skip(1) {
                    reach =
                        track.controls(k - 1, [from_s, to_s]).into_iter().fold(reach, Aabb::with);
                }
            }
        }
        Some(Aabb { lo: reach.lo - at, hi: reach.hi - at })
    }

    /// An angle that the rotation from that at the start never exceeds, radians; 0 only if it never
    /// changes.
    fn turns_by(&self, [from_s, to_s]: [f64; 2]) -> f64 {
        let Some(track) = &self.rotation_track else { return 0.0 };
        let keys = keys_around(&track.times_s, [from_s, to_s]);
        if track.is_constant(keys.clone()) {
            return 0.0;
        }
        if track.interpolation == Interpolation::CubicSpline {
            return PI;
        }
        let start = track.at(from_s);
        let mut angle = between(start, track.at(to_s));
        let mut before = start;
        let mut length = 0.0;
        for k in keys.filter(|&k| (from_s..=to_s).contains(&track.times_s[k])) {
            // Along the way: from key to key at constant speed, each the shorter way round.
            length += between(before, track.values[k]);
            before = track.values[k];
            angle = angle.max(length);
        }
        // The length of the way bounds the angle at every instant of it.
        length += between(before, track.at(to_s));
        (angle.max(length) + 1e-12).min(PI)
    }
}

/// The keys whose values count within an interval: those inside and the nearest on either side.
fn keys_around(times_s: &[f64], [from_s, to_s]: [f64; 2]) -> std::ops::Range<usize> {
    let first = times_s.partition_point(|&t| t <= from_s).saturating_sub(1);
    let last = times_s.partition_point(|&t| t < to_s).min(times_s.len() - 1);
    first..last + 1
}

impl Track {
    fn is_constant(&self, keys: std::ops::Range<usize>) -> bool {
        let first = keys.start;
        match self.interpolation {
            Interpolation::CubicSpline => keys.clone().all(|k| {
                let [into, value, out] = [0, 1, 2].map(|i| self.values[3 * k + i]);
                let tangents = keys.len() == 1 || (into == DVec3::ZERO && out == DVec3::ZERO);
                value == self.values[3 * first + 1] && tangents
            }),
            _ => keys.clone().all(|k| self.values[k] == self.values[first]),
        }
    }

    /// Control points (Bezier) of the part of a cubic segment that lies within an interval.
    fn controls(&self, key: usize, [from_s, to_s]: [f64; 2]) -> [DVec3; 4] {
        let (start, end) = (self.times_s[key], self.times_s[key + 1]);
        let third = (end - start) / 3.0;
        let (p, q) = (self.values[3 * key + 1], self.values[3 * key + 4]);
        let (out, into) = (self.values[3 * key + 2], self.values[3 * key + 3]);
        let corners = [p, p + out * third, q - into * third, q];
        let share = |t: f64| ((t - start) / (end - start)).clamp(0.0, 1.0);
        let (s, t) = (share(from_s), share(to_s));
        [[s, s, s], [s, s, t], [s, t, t], [t, t, t]].map(|at| blossom(corners, at))
    }
}

/// The polar form of a cubic in Bezier form.
fn blossom(mut c: [DVec3; 4], at: [f64; 3]) -> DVec3 {
    for (level, s) in at.into_iter().enumerate() {
        for k in 0..3 - level {
            c[k] = c[k].lerp(c[k + 1], s);
        }
    }
    c[0]
}

impl RotationTrack {
    fn is_constant(&self, keys: std::ops::Range<usize>) -> bool {
        let first = keys.start;
        match self.interpolation {
            Interpolation::CubicSpline => {
                let zero = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
                keys.clone().all(|k| {
                    let [into, value, out] = [0, 1, 2].map(|i| self.values[3 * k + i]);
                    let tangents = keys.len() == 1 || (into == zero && out == zero);
                    value == self.values[3 * first + 1] && tangents
                })
            }
            _ => keys.clone().all(|k| self.values[k] == self.values[first]),
        }
    }
}

/// The angle of the rotation from one unit quaternion to another, radians, rounded up a little.
fn between(p: DQuat, q: DQuat) -> f64 {
    let dot = p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w;
    let q = if dot < 0.0 { q * -1.0 } else { q };
    let d = [p.x - q.x, p.y - q.y, p.z - q.z, p.w - q.w];
    let chord = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]).sqrt();
    4.0 * libm::asin((0.5 * chord).min(1.0)) * (1.0 + 1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(v: [f64; 4]) -> DQuat {
        crate::scene::motion::unit(DQuat::from_xyzw(v[0], v[1], v[2], v[3] + 2.0))
    }

    fn vector() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from)
    }

    fn interpolation() -> impl Strategy<Value = Interpolation> {
        prop::sample::select(vec![
            Interpolation::Linear,
            Interpolation::Step,
            Interpolation::CubicSpline,
        ])
    }

    prop_compose! {
        fn node()(
            kind in interpolation(), turning in interpolation(),
            slides in prop::collection::vec(vector(), 12),
            turns in prop::collection::vec(prop::array::uniform4(-1.0..1.0f64), 12),
            repeat in 0..3usize, moves in 0..4u8,
        ) -> Node {
            let times_s = vec![0.0, 1.0, 1.5, 3.0];
            let count = |kind| if kind == Interpolation::CubicSpline { 12 } else { 4 };
            let mut values: Vec<DVec3> = slides[..count(kind)].to_vec();
            if kind != Interpolation::CubicSpline {
                values[repeat + 1] = values[repeat];
            }
            let turned = turns[..count(turning)].iter().map(|&q| unit(q)).collect();
            Node {
                name: "n".into(),
                parent: None,
                translation: DVec3::X,
                rotation: unit([0.1, -0.4, 0.3, 0.0]),
                translation_track: (moves & 1 > 0).then(|| Track {
                    times_s: times_s.clone(), values, interpolation: kind,
                }),
                rotation_track: (moves & 2 > 0).then_some(RotationTrack {
                    times_s, values: turned, interpolation: turning,
                }),
                presence: vec![],
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        /// Brute force over time: no point of the body gets out of its bound.
        #[test]
        fn no_point_drifts_further_than_said(
            nodes in prop::collection::vec(node(), 1..4),
            from in -0.5..3.5f64, length in 0.0..2.0f64, p in vector(),
        ) {
            let mut motion = Motion::default();
            for (k, mut n) in nodes.into_iter().enumerate() {
                n.parent = k.checked_sub(1).map(|k| NodeId(k as u32));
                motion.nodes.push(n);
            }
            let node = NodeId(motion.nodes.len() as u32 - 1);
            let drift = motion.drift(node, p.length(), [from, from + length]);
            let start = motion.pose(node, from).unwrap();
            let mut first = None;
            for k in 0..=100 {
                let pose = motion.pose(node, from + length * f64::from(k) / 100.0).unwrap();
                let by = pose.point(p) - start.point(p);
                match drift {
                    Drift::Rests => prop_assert_eq!(pose, start),
                    Drift::Slides(reach) => {
                        prop_assert_eq!(pose.rotation, start.rotation);
                        let other = pose.point(DVec3::ONE) - start.point(DVec3::ONE);
                        prop_assert!((other - by).length() < 1e-12);
                        prop_assert!(by.cmpge(reach.lo).all() && by.cmple(reach.hi).all());
                    }
                    Drift::Turns(reach) => {
                        prop_assert!(by.cmpge(reach.lo).all() && by.cmple(reach.hi).all());
                    }
                }
                first.get_or_insert(by);
            }
        }
    }

    #[test]
    fn a_straight_slide_is_bounded_by_its_ends() {
        let track = Track {
            times_s: vec![0.0, 10.0],
            values: vec![DVec3::ZERO, DVec3::X * 10.0],
            interpolation: Interpolation::Linear,
        };
        let mut motion = Motion::default();
        motion.nodes.push(Node {
            name: "n".into(),
            parent: None,
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            translation_track: Some(track),
            rotation_track: None,
            presence: vec![],
        });
        let Drift::Slides(by) = motion.drift(NodeId(0), 5.0, [2.0, 4.0]) else { panic!() };
        assert!((by.hi - DVec3::X * 2.0).length() < 1e-9 && by.lo.length() < 1e-9, "{by:?}");
        assert_eq!(motion.drift(NodeId(0), 5.0, [10.0, 40.0]), Drift::Rests);
    }
}
