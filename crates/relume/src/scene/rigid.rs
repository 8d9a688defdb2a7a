//! Takes the scales out of a node tree: what is left moves rigidly, and each node keeps a constant
//! matrix that shapes its own polygons.
//!
//! With residual L of the parent, a child of translation T, rotation R and scale S places a point
//! at L (T + R S x) = L T + R (R^-1 L R S) x. So the child's rigid translation is L T, and its own
//! residual R^-1 L R S, which must not depend on time: R may only move where L does not mind.

use glam::{DMat3, DQuat, DVec3};

use super::draft::{Draft, DraftNode};
use super::motion::unit;
use super::{Interpolation, Node, NodeId, RotationTrack, SceneError, Track};

/// The rigid nodes of a draft (names as given) and each node's residual matrix.
pub(super) fn without_scales(draft: &Draft) -> Result<(Vec<Node>, Vec<DMat3>), SceneError> {
    let mut nodes = Vec::with_capacity(draft.nodes.len());
    let mut residuals: Vec<DMat3> = Vec::with_capacity(draft.nodes.len());
    for (index, node) in draft.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|p| p < index), "parents come before children");
        let above = node.parent.map_or(DMat3::IDENTITY, |p| residuals[p]);
        let rigid = rigid_node(node, above)?;
        residuals.push(residual(node, &rigid, above)?);
        nodes.push(rigid);
    }
    Ok((nodes, residuals))
}

/// The node without its scale, below a parent of residual `above`; constant tracks are folded.
fn rigid_node(node: &DraftNode, above: DMat3) -> Result<Node, SceneError> {
    let bend = |t: DVec3| if above == DMat3::IDENTITY { t } else { above * t };
    let mut translation = bend(finite(node, "translation", node.translation)?);
    let mut translation_track = None;
    if let Some(track) = &node.translation_track {
        check_track(&node.name, &track.times_s, track.values.len(), track.interpolation)?;
        let values: Result<Vec<DVec3>, _> =
            track.values.iter().map(|&v| Ok(bend(finite(node, "translation", v)?))).collect();
        let track = Track {
            times_s: track.times_s.clone(),
            values: values?,
            interpolation: track.interpolation,
        };
        match constant(&track.values, track.interpolation, DVec3::ZERO) {
            Some(value) => translation = value,
            None => translation_track = Some(track),
        }
    }
    let mut rotation = normalised(node, node.rotation)?;
    let mut rotation_track = None;
    if let Some(track) = &node.rotation_track {
        let track = checked_rotation(node, track)?;
        match constant(&track.values, track.interpolation, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)) {
            Some(value) => rotation = value,
            None => rotation_track = Some(track),
        }
    }
    Ok(Node {
        name: node.name.clone(),
        parent: node.parent.map(|p| NodeId(p as u32)),
        translation,
        rotation,
        translation_track,
        rotation_track,
        presence: checked_presence(node)?,
    })
}

/// The matrix that shapes what hangs on the node.
fn residual(node: &DraftNode, rigid: &Node, above: DMat3) -> Result<DMat3, SceneError> {
    let scale = node.shape;
    for column in [scale.x_axis, scale.y_axis, scale.z_axis] {
        finite(node, "scale", column)?;
    }
    let isotropic = above == DMat3::from_diagonal(DVec3::splat(above.x_axis.x));
    if isotropic {
        return Ok(above * scale);
    }
    if let Some(track) = &rigid.rotation_track {
        if !turns_within(track, above) {
            return Err(SceneError::NotRigid {
                node: node.name.clone(),
                what:
                    "it rotates below a parent of non-uniform scale, which would shear it in time"
                        .into(),
                remedy: "apply the parent's scale to its mesh (in Blender: Object > Apply > Scale)"
                    .into(),
            });
        }
        return Ok(above * scale);
    }
    let rotation = DMat3::from_quat(rigid.rotation);
    Ok(rotation.transpose() * above * rotation * scale)
}

/// Whether all rotations of the track turn about one axis and `shape` looks the same all around it.
fn turns_within(track: &RotationTrack, shape: DMat3) -> bool {
    let axes = || track.values.iter().map(|q| DVec3::new(q.x, q.y, q.z));
    let axis =
        axes().fold(DVec3::ZERO, |best, v| if v.length() > best.length() { v } else { best });
    let axis = axis.normalize_or_zero();
    let one_axis = axes().all(|v| v.cross(axis).length() <= 1e-9);
    let quarter = DMat3::from_quat(unit(DQuat::from_xyzw(axis.x, axis.y, axis.z, 1.0)));
    let change = quarter * shape - shape * quarter;
    let size = |m: DMat3| m.to_cols_array().iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    one_axis && size(change) <= 1e-9 * size(shape)
}

/// The one value of a track that never changes, if it is one: for cubic splines with tangents
/// equal to `still`.
fn constant<V: PartialEq + Copy>(
    values: &[V],
    interpolation: Interpolation,
    still: V,
) -> Option<V> {
    if interpolation != Interpolation::CubicSpline {
        return values.iter().all(|v| *v == values[0]).then_some(values[0]);
    }
    let keys = values.len() / 3;
    let flat = (0..keys).all(|k| {
        let inner_tangents =
            (k == 0 || values[3 * k] == still) && (k + 1 == keys || values[3 * k + 2] == still);
        values[3 * k + 1] == values[1] && inner_tangents
    });
    flat.then_some(values[1])
}

/// A rotation track with unit values (tangents stay as they are).
fn checked_rotation(node: &DraftNode, track: &RotationTrack) -> Result<RotationTrack, SceneError> {
    check_track(&node.name, &track.times_s, track.values.len(), track.interpolation)?;
    let cubic = track.interpolation == Interpolation::CubicSpline;
    let value = |(i, &q): (usize, &DQuat)| match cubic && i % 3 != 1 {
        true if q.is_finite() => Ok(q),
        _ => normalised(node, q),
    };
    let values: Result<Vec<DQuat>, _> = track.values.iter().enumerate().map(value).collect();
    Ok(RotationTrack {
        times_s: track.times_s.clone(),
        values: values?,
        interpolation: track.interpolation,
    })
}

/// The presence keys, or none where they say nothing but "present".
fn checked_presence(node: &DraftNode) -> Result<Vec<(f64, bool)>, SceneError> {
    let times: Vec<f64> = node.presence.iter().map(|k| k.0).collect();
    if node.presence.iter().all(|k| k.1) {
        return Ok(Vec::new());
    }
    check_track(&node.name, &times, times.len(), Interpolation::Step)?;
    Ok(node.presence.clone())
}

/// Key times must be finite, not negative, strictly ascending, and match the values.
pub(super) fn check_track(
    of: &str,
    times_s: &[f64],
    values: usize,
    interpolation: Interpolation,
) -> Result<(), SceneError> {
    let a_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let fail = |what: String| {
        Err(SceneError::Animation {
            animation: of.to_owned(),
            what,
            remedy: "export the animation again, one value for each of the ascending key times"
                .into(),
        })
    };
    if times_s.is_empty() {
        return fail("an animated property has no keys".into());
    }
    if values != times_s.len() * a_key {
        return fail(format!(
            "{} key times need {} values, not {values}",
            times_s.len(),
            times_s.len() * a_key
        ));
    }
    if let Some(bad) = times_s.iter().find(|t| !t.is_finite() || **t < 0.0) {
        return fail(format!("a key time is {bad} s"));
    }
    match times_s.windows(2).find(|w| w[0] >= w[1]) {
        Some(w) => fail(format!("key times do not ascend ({} s, then {} s)", w[0], w[1])),
        None => Ok(()),
    }
}

/// The vector, if all its components are finite.
fn finite(node: &DraftNode, which: &str, v: DVec3) -> Result<DVec3, SceneError> {
    if v.is_finite() {
        return Ok(v);
    }
    Err(SceneError::Geometry {
        subject: format!("node `{}`", node.name),
        what: format!("its {which} is not finite ({}, {}, {})", v.x, v.y, v.z),
        remedy: "repair the transform or the keyframes and export again".into(),
    })
}

/// The quaternion at unit length.
fn normalised(node: &DraftNode, q: DQuat) -> Result<DQuat, SceneError> {
    let q = unit(q);
    if q.is_finite() {
        return Ok(q);
    }
    Err(SceneError::Geometry {
        subject: format!("node `{}`", node.name),
        what: "its rotation is not a rotation (a quaternion of length 0 or not finite)".into(),
        remedy: "repair the transform or the keyframes and export again".into(),
    })
}
