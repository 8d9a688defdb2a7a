//! The node tree and its keyframes: poses as pure functions of time.

use glam::{DMat3, DQuat, DVec3};

use crate::geometry::Pose;

/// Index of a [`Node`] in [`Motion::nodes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

/// The node tree of a scene with its animation. Parents come before children.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// All nodes, parents before children.
    pub nodes: Vec<Node>,
    /// Name of the animation(s) that play, if any.
    pub animation: Option<String>,
    /// Length of the animation, seconds; 0 where nothing moves.
    pub duration_s: f64,
}

/// One node: a placement relative to its parent, constant or animated.
#[derive(Clone, Debug)]
pub struct Node {
    /// Unique name.
    pub name: String,
    /// The node it hangs on.
    pub parent: Option<NodeId>,
    /// Constant translation, metres; replaced by `translation_track` where there is one.
    pub translation: DVec3,
    /// Constant rotation, unit quaternion.
    pub rotation: DQuat,
    /// Keyframes of the translation.
    pub translation_track: Option<Track>,
    /// Keyframes of the rotation.
    pub rotation_track: Option<RotationTrack>,
    /// Keyframes of presence: at or after each time (seconds, ascending) the node and all below it
    /// are present or not. Before the first key: as the first key says. Empty: always present.
    pub presence: Vec<(f64, bool)>,
}

/// Interpolation between keyframes, as in glTF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight (spherical for rotations) between keys.
    Linear,
    /// Holds the last key.
    Step,
    /// Cubic Hermite with in and out tangents.
    CubicSpline,
}

/// Keyframes of a translation, or of a colour (linear RGB).
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Key times, seconds, strictly ascending.
    pub times_s: Vec<f64>,
    /// Values; one a key, or in-tangent, value, out-tangent for cubic splines.
    pub values: Vec<DVec3>,
    /// How to go from key to key.
    pub interpolation: Interpolation,
}

/// Keyframes of a rotation.
#[derive(Clone, Debug)]
pub struct RotationTrack {
    /// Key times, seconds, strictly ascending.
    pub times_s: Vec<f64>,
    /// Values; one a key, or in-tangent, value, out-tangent for cubic splines.
    pub values: Vec<DQuat>,
    /// How to go from key to key.
    pub interpolation: Interpolation,
}

impl Motion {
    /// World pose of a node at `time_s`, or `None` while it or an ancestor is absent.
    ///
    /// A pure function of time: nothing is accumulated, and times outside the keys are clamped.
    /// The same bits on every machine (no platform transcendental), and the same bits at any two
    /// times between which no key of the node or of its ancestors changes.
    pub fn pose(&self, node: NodeId, time_s: f64) -> Option<Pose> {
        let mut pose = Pose::IDENTITY;
        for n in self.upward(node) {
            if !n.present(time_s) {
                return None;
            }
            pose = n.local_pose(time_s) * pose;
        }
        Some(pose)
    }

    /// Where a node is at `time_s`, or would be if it were present.
    pub(super) fn place(&self, node: NodeId, time_s: f64) -> Pose {
        self.upward(node).fold(Pose::IDENTITY, |pose, n| n.local_pose(time_s) * pose)
    }

    /// Where a node is in the frame of one above it.
    pub(super) fn place_on(&self, above: NodeId, node: NodeId, time_s: f64) -> Pose {
        let between = self.ids_upward(node).take_while(|&id| id != above);
        let locals = between.map(|id| self.nodes[id.0 as usize].local_pose(time_s));
        locals.fold(Pose::IDENTITY, |pose, local| local * pose)
    }

    /// The times between which anything moves: nothing does before the first and after the last.
    pub(super) fn span_s(&self) -> [f64; 2] {
        let slides = self.nodes.iter().filter_map(|n| n.translation_track.as_ref());
        let turns = self.nodes.iter().filter_map(|n| n.rotation_track.as_ref());
        let times = slides.flat_map(|t| &t.times_s).chain(turns.flat_map(|t| &t.times_s));
        times.fold([0.0, self.duration_s], |[from, to], &t| [t.min(from), t.max(to)])
    }

    /// The node, its parent, and so on up to the root.
    pub(super) fn upward(&self, node: NodeId) -> impl Iterator<Item = &Node> + '_ {
        self.ids_upward(node).map(|id| &self.nodes[id.0 as usize])
    }

    /// The ids of these.
    pub(super) fn ids_upward(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        std::iter::successors(Some(node), |n| self.nodes[n.0 as usize].parent)
    }

    /// Whether the node or one of its ancestors is animated.
    pub fn moves(&self, node: NodeId) -> bool {
        self.anchor(node).is_some()
    }

    /// The nearest animated node at or above `node`: the one whose body it rides on. `None` where
    /// nothing above it is animated.
    pub fn anchor(&self, node: NodeId) -> Option<NodeId> {
        let parent = |id: &NodeId| self.nodes[id.0 as usize].parent;
        std::iter::successors(Some(node), parent).find(|n| self.nodes[n.0 as usize].animated())
    }
}

impl Node {
    /// Whether the node itself has keyframes of any kind.
    pub fn animated(&self) -> bool {
        self.translation_track.is_some()
            || self.rotation_track.is_some()
            || !self.presence.is_empty()
    }

    /// Whether the node itself is present at `time_s`, its ancestors aside.
    fn present(&self, time_s: f64) -> bool {
        let after = self.presence.partition_point(|key| key.0 <= time_s);
        self.presence.get(after.saturating_sub(1)).is_none_or(|key| key.1)
    }

    /// Pose relative to the parent.
    pub(super) fn local_pose(&self, time_s: f64) -> Pose {
        let translation =
            self.translation_track.as_ref().map_or(self.translation, |t| t.at(time_s));
        let rotation = self.rotation_track.as_ref().map_or(self.rotation, |t| t.at(time_s));
        Pose { rotation: DMat3::from_quat(rotation), translation }
    }
}

/// Where a time lies among keys.
enum Place {
    /// At a key, or clamped to the first or the last.
    Key(usize),
    /// Between this key and the next: share of the way in (0, 1), and the interval in seconds.
    After(usize, f64, f64),
}

/// Finds the keys around `time_s`; `times_s` ascends and is not empty.
fn place(times_s: &[f64], time_s: f64) -> Place {
    let after = times_s.partition_point(|&t| t <= time_s);
    if after == 0 || after == times_s.len() || times_s[after - 1] == time_s {
        return Place::Key(after.saturating_sub(1));
    }
    let interval = times_s[after] - times_s[after - 1];
    Place::After(after - 1, (time_s - times_s[after - 1]) / interval, interval)
}

impl Track {
    /// The value at `time_s`, clamped outside the keys. Exactly the key at a key and between equal
    /// ones (with zero tangents).
    pub fn at(&self, time_s: f64) -> DVec3 {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let value = |key: usize| self.values[if cubic { 3 * key + 1 } else { key }];
        let (key, s, interval) = match place(&self.times_s, time_s) {
            Place::Key(key) => return value(key),
            Place::After(key, s, interval) => (key, s, interval),
        };
        match self.interpolation {
            Interpolation::Step => value(key),
            Interpolation::Linear => value(key) + (value(key + 1) - value(key)) * s,
            Interpolation::CubicSpline => {
                let (out, into) = (self.values[3 * key + 2], self.values[3 * key + 3]);
                let h = Hermite::at(s, interval);
                // Written around the first key, so that equal keys with no tangents give exactly it.
                value(key)
                    + (value(key + 1) - value(key)) * h.to_next
                    + out * h.out_tangent
                    + into * h.in_tangent
            }
        }
    }
}

impl RotationTrack {
    /// The unit quaternion at `time_s`, clamped outside the keys; the shorter way round between
    /// keys. Exactly the key at a key and between equal ones (with zero tangents).
    pub fn at(&self, time_s: f64) -> DQuat {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let value = |key: usize| self.values[if cubic { 3 * key + 1 } else { key }];
        let (key, s, interval) = match place(&self.times_s, time_s) {
            Place::Key(key) => return value(key),
            Place::After(key, s, interval) => (key, s, interval),
        };
        match self.interpolation {
            Interpolation::Step => value(key),
            Interpolation::Linear => slerp(value(key), value(key + 1), s),
            Interpolation::CubicSpline => {
                let (out, into) = (self.values[3 * key + 2], self.values[3 * key + 3]);
                let zero = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
                if value(key) == value(key + 1) && out == zero && into == zero {
                    return value(key);
                }
                let h = Hermite::at(s, interval);
                let step = (value(key + 1) - value(key)) * h.to_next;
                unit(value(key) + step + out * h.out_tangent + into * h.in_tangent)
            }
        }
    }
}

/// Weights of a cubic Hermite segment, written as a step from its first value.
struct Hermite {
    to_next: f64,
    out_tangent: f64,
    in_tangent: f64,
}

impl Hermite {
    fn at(s: f64, interval: f64) -> Hermite {
        let (s2, s3) = (s * s, s * s * s);
        Hermite {
            to_next: 3.0 * s2 - 2.0 * s3,
            out_tangent: interval * (s3 - 2.0 * s2 + s),
            in_tangent: interval * (s3 - s2),
        }
    }
}

/// Spherical interpolation the shorter way round, of unit quaternions, s in (0, 1).
///
/// Own code over `libm`: the standard library's sine and arc cosine differ between platforms.
fn slerp(a: DQuat, b: DQuat, s: f64) -> DQuat {
    let cosine = dot(a, b);
    let (b, cosine) = if cosine < 0.0 { (b * -1.0, -cosine) } else { (b, cosine) };
    if a == b {
        return a;
    }
    // The chord, not the arc cosine: accurate for small angles too.
    let chord = (b - a) * 0.5;
    let half = libm::asin(dot(chord, chord).sqrt().min(1.0));
    let angle = 2.0 * half;
    let sine = libm::sin(angle);
    if cosine > 1.0 - 1e-12 || sine == 0.0 {
        return unit(a + (b - a) * s);
    }
    unit(a * (libm::sin((1.0 - s) * angle) / sine) + b * (libm::sin(s * angle) / sine))
}

/// Dot product in a fixed order of additions.
fn dot(a: DQuat, b: DQuat) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w
}

/// The quaternion divided by its length.
pub(super) fn unit(q: DQuat) -> DQuat {
    let length = dot(q, q).sqrt();
    DQuat::from_xyzw(q.x / length, q.y / length, q.z / length, q.w / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(parent: Option<NodeId>) -> Node {
        Node {
            name: "n".into(),
            parent,
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            translation_track: None,
            rotation_track: None,
            presence: vec![],
        }
    }

    fn about_z(angle: f64) -> DQuat {
        DQuat::from_xyzw(0.0, 0.0, libm::sin(angle / 2.0), libm::cos(angle / 2.0))
    }

    fn spins(keys: &[(f64, DQuat)]) -> RotationTrack {
        RotationTrack {
            times_s: keys.iter().map(|k| k.0).collect(),
            values: keys.iter().map(|k| k.1).collect(),
            interpolation: Interpolation::Linear,
        }
    }

    #[test]
    fn linear_slides_clamps_and_holds_exactly() {
        let a = DVec3::new(0.1, 0.2, 0.3);
        let b = DVec3::new(1.1, 0.2, -0.7);
        let track = Track {
            times_s: vec![1.0, 2.0, 3.0],
            values: vec![a, b, b],
            interpolation: Interpolation::Linear,
        };
        assert_eq!(track.at(-5.0), a);
        assert_eq!(track.at(1.0), a);
        assert!(track.at(1.5).distance((a + b) / 2.0) < 1e-15);
        for t in [2.0, 2.1, 2.7, 3.0, 99.0] {
            assert_eq!(track.at(t), b);
        }
        let step = Track { interpolation: Interpolation::Step, ..track };
        assert_eq!(step.at(1.999), a);
        assert_eq!(step.at(2.0), b);
    }

    #[test]
    fn cubic_splines_follow_their_tangents() {
        // x = t^2 on [0, 2]: slopes 0 and 4.
        let (zero, x) = (DVec3::ZERO, DVec3::X);
        let track = Track {
            times_s: vec![0.0, 2.0],
            values: vec![zero, zero, zero, x * 4.0, x * 4.0, zero],
            interpolation: Interpolation::CubicSpline,
        };
        for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
            assert!((track.at(t).x - t * t).abs() < 1e-14, "{t}");
        }
    }

    #[test]
    fn rotations_go_the_shorter_way_round_at_constant_speed() {
        let quarter = about_z(std::f64::consts::FRAC_PI_2);
        for end in [quarter, quarter * -1.0] {
            let track = spins(&[(0.0, DQuat::IDENTITY), (1.0, end)]);
            for s in [0.1, 0.5, 0.9] {
                let got = track.at(s) * DVec3::X;
                let angle = s * std::f64::consts::FRAC_PI_2;
                assert!(got.distance(DVec3::new(angle.cos(), angle.sin(), 0.0)) < 1e-14);
            }
        }
        let tiny = spins(&[(0.0, DQuat::IDENTITY), (1.0, about_z(1e-9))]);
        assert!((tiny.at(0.5).z - 0.25e-9).abs() < 1e-20);
    }

    #[test]
    fn a_rotation_that_holds_still_keeps_its_bits() {
        let q = unit(DQuat::from_xyzw(0.3, -0.1, 0.7, 0.2));
        let mut motion =
            Motion { nodes: vec![node(None), node(Some(NodeId(0)))], ..Motion::default() };
        motion.nodes[0].rotation_track =
            Some(spins(&[(0.0, DQuat::IDENTITY), (1.0, q), (2.0, q * -1.0), (3.0, q)]));
        motion.nodes[1].translation = DVec3::new(1.0, 2.0, 3.0);
        let held = motion.pose(NodeId(1), 1.0);
        for t in [1.3, 2.0, 2.6, 3.0, 7.0] {
            assert_eq!(motion.pose(NodeId(1), t), held);
        }
        assert_ne!(motion.pose(NodeId(1), 0.9), held);
    }

    #[test]
    fn the_bits_of_a_pose_are_these_on_every_machine() {
        let track =
            spins(&[(0.0, DQuat::IDENTITY), (1.0, unit(DQuat::from_xyzw(0.3, -0.1, 0.7, 0.2)))]);
        let q = track.at(0.3);
        let bits = [q.x, q.y, q.z, q.w].map(f64::to_bits);
        assert_eq!(bits, GOLDEN, "{bits:#x?}");
    }

    const GOLDEN: [u64; 4] =
        [0x3fc33ab60f77667b, 0xbfa9a39d69f488a4, 0x3fd66f29bcb5f78f, 0x3fed89bf72a2e57c];

    #[test]
    fn absence_is_inherited() {
        let mut motion =
            Motion { nodes: vec![node(None), node(Some(NodeId(0)))], ..Motion::default() };
        motion.nodes[0].presence = vec![(1.0, false), (2.0, true)];
        let present = |t| motion.pose(NodeId(1), t).is_some();
        assert_eq!([0.0, 1.0, 1.9, 2.0, 3.0].map(present), [false, false, false, true, true]);
    }

    #[test]
    fn children_ride_on_their_parents() {
        let mut motion =
            Motion { nodes: vec![node(None), node(Some(NodeId(0)))], ..Motion::default() };
        motion.nodes[0].rotation = about_z(std::f64::consts::FRAC_PI_2);
        motion.nodes[0].translation = DVec3::Z;
        motion.nodes[1].translation = DVec3::X;
        let got = motion.pose(NodeId(1), 0.0).unwrap().point(DVec3::X);
        assert!(got.distance(DVec3::new(0.0, 2.0, 1.0)) < 1e-15);
    }
}
