//! Takes the scales out of a node tree: what is left moves rigidly, and each node keeps a constant
//! matrix that shapes its own polygons.
//!
//! With residual L of the parent, a child of translation T, rotation R and scale S places a point
//! at L (T + R S x) = L T + R (R^-1 L R S) x. So the child's rigid translation is L T, and its own
//! residual R^-1 L R S, which must not depend on time. A rotation that moves is written D R0 with R0
//! its first key: L D R0 S = (L D L^-1) R0 (R0^-1 L R0 S), which is rigid where L D L^-1 is a rotation:
//! of any D if L is a similarity (a mirror among them), and of turns about one axis if L looks the same
//! all around it.

use glam::{DMat3, DQuat, DVec3};

use super::draft::{Draft, DraftNode};
use super::limits::{COORDINATE_MAX_M, is_place};
use super::motion::unit;
use super::{Interpolation, Node, NodeId, RotationTrack, SceneError, Track};
use crate::scene::tuning::UNEVEN_MAX;

/// What is left of a draft's nodes without their scales.
pub(super) struct Rigid {
    /// Names as given.
    pub(super) nodes: Vec<Node>,
    /// What shapes the polygons of each node.
    pub(super) residuals: Vec<DMat3>,
    /// Nodes whose rotation would shear what is shown on them or below: it keeps the shape it has at the start.
    pub(super) held: Vec<usize>,
}

/// The rigid nodes of a draft and each node's residual matrix.
pub(super) fn without_scales(draft: &Draft) -> Result<Rigid, SceneError> {
    let mut nodes = Vec::with_capacity(draft.nodes.len());
    let mut residuals: Vec<DMat3> = Vec::with_capacity(draft.nodes.len());
    let mut shears = vec![false; draft.nodes.len()];
    for (index, node) in draft.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|p| p < index), "parents come before children");
        let above = node.parent.map_or(DMat3::IDENTITY, |p| residuals[p]);
        let mut rigid = rigid_node(node, above)?;
        let residual;
        (residual, shears[index]) = residual_of(node, &mut rigid, above)?;
        residuals.push(residual);
        nodes.push(rigid);
    }
    let held = held(draft, &shears);
    Ok(Rigid { nodes, residuals, held })
}

/// The nodes that shear something that is shown.
fn held(draft: &Draft, shears: &[bool]) -> Vec<usize> {
    let mut shows: Vec<bool> =
        draft.nodes.iter().map(|n| n.surfaces.iter().any(|s| !s.polygons.is_empty())).collect();
    for (index, node) in draft.nodes.iter().enumerate().rev() {
        if let (Some(parent), true) = (node.parent, shows[index]) {
            shows[parent] = true;
        }
    }
    (0..shears.len()).filter(|&n| shears[n] && shows[n]).collect()
}

/// The node without its scale, below a parent of residual `above`; constant tracks are folded.
fn rigid_node(node: &DraftNode, above: DMat3) -> Result<Node, SceneError> {
    let bend = |t: DVec3| if above == DMat3::IDENTITY { t } else { above * t };
    let placed = |v: DVec3| finite(node, "translation", bend(finite(node, "translation", v)?));
    let mut translation = placed(node.translation)?;
    let mut translation_track = None;
    if let Some(track) = &node.translation_track {
        check_track(&node.name, &track.times_s, track.values.len(), track.interpolation)?;
        let values: Result<Vec<DVec3>, _> = track.values.iter().map(|&v| placed(v)).collect();
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

/// The matrix that shapes what hangs on the node, whose rotation is turned round where the scale above mirrors; and
/// whether no rigid motion does what the file says, so that it is the shape at the start.
fn residual_of(
    node: &DraftNode,
    rigid: &mut Node,
    above: DMat3,
) -> Result<(DMat3, bool), SceneError> {
    let scale = node.shape;
    for column in [scale.x_axis, scale.y_axis, scale.z_axis] {
        finite(node, "scale", column)?;
    }
    let isotropic = above == DMat3::from_diagonal(DVec3::splat(above.x_axis.x));
    if isotropic && above.x_axis.x >= 0.0 {
        return Ok((above * scale, false));
    }
    let shaped = |rotation: DQuat| {
        let rotation = DMat3::from_quat(rotation);
        rotation.transpose() * above * rotation * scale
    };
    let Some(track) = &mut rigid.rotation_track else { return Ok((shaped(rigid.rotation), false)) };
    if let Some(turn) = of_similarity(above) {
        if turn != DMat3::IDENTITY {
            track.values.iter_mut().for_each(|q| *q = turned(turn, *q));
        }
        return Ok((above * scale, false));
    }
    let first = track.values[usize::from(track.interpolation == Interpolation::CubicSpline)];
    let since: Vec<DQuat> = track.values.iter().map(|&q| q * first.conjugate()).collect();
    if let Some(turn) = about_one_axis(&since, above) {
        for (value, since) in track.values.iter_mut().zip(since) {
            *value = turned(turn, since) * first;
        }
        return Ok((shaped(first), false));
    }
    if track.interpolation == Interpolation::CubicSpline {
        track.interpolation = Interpolation::Linear;
        track.values = track.values.chunks(3).map(|key| key[1]).collect();
    }
    for value in &mut track.values {
        *value = nearest_turn(above, *value * first.conjugate()) * first;
    }
    Ok((shaped(first), true))
}

/// The rotation nearest to L D L^-1 (its polar factor, by Newton's iteration: Higham, Computing the polar
/// decomposition, 1986); none where L is singular.
fn nearest_turn(above: DMat3, turn: DQuat) -> DQuat {
    let mut nearest = above * DMat3::from_quat(turn) * above.inverse();
    for _ in 0..32 {
        nearest = (nearest + nearest.inverse().transpose()) * 0.5;
    }
    let found = DQuat::from_mat3(&nearest).normalize();
    let orthogonal = largest(nearest.transpose() * nearest - DMat3::IDENTITY) < 1e-9;
    if orthogonal && found.is_finite() { found } else { DQuat::IDENTITY }
}

/// The quaternion of L D L^-1, D being that of `q`: `turn` is what L makes of its axis.
fn turned(turn: DMat3, q: DQuat) -> DQuat {
    let v = turn * DVec3::new(q.x, q.y, q.z);
    DQuat::from_xyzw(v.x, v.y, v.z, q.w)
}

/// What a matrix makes of the axes of rotations that it is conjugated with (det Q times Q, with Q its
/// orthogonal part), if it is a similarity up to [`UNEVEN_MAX`].
fn of_similarity(above: DMat3) -> Option<DMat3> {
    let size = above.determinant().abs().cbrt();
    let is_near = |q: DMat3| largest(above - q * size) <= UNEVEN_MAX * size;
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    // Mirrors along axes are exact, whatever their rounding.
    let signs = DVec3::new(above.x_axis.x, above.y_axis.y, above.z_axis.z).map(f64::signum);
    let along_axes = DMat3::from_diagonal(signs);
    let q = if is_near(along_axes) {
        along_axes
    } else {
        let x = above.x_axis.normalize();
        let y = (above.y_axis - x * above.y_axis.dot(x)).normalize();
        DMat3::from_cols(x, y, x.cross(y) * above.determinant().signum())
    };
    is_near(q).then(|| q * q.determinant().round())
}

/// The same for rotations about one axis, if the matrix looks the same all around that.
fn about_one_axis(turns: &[DQuat], above: DMat3) -> Option<DMat3> {
    let axes = || turns.iter().map(|q| DVec3::new(q.x, q.y, q.z));
    let axis =
        axes().fold(DVec3::ZERO, |best, v| if v.length() > best.length() { v } else { best });
    let axis = axis.normalize_or_zero();
    if axis == DVec3::ZERO {
        return Some(DMat3::IDENTITY);
    }
    if axes().any(|v| v.cross(axis).length() > UNEVEN_MAX) {
        return None;
    }
    // L [a]x L^-1 must be [b]x, b of unit length: then every turn about a becomes one about b.
    let cross = |a: DVec3| {
        DMat3::from_cols(
            DVec3::new(0.0, a.z, -a.y),
            DVec3::new(-a.z, 0.0, a.x),
            DVec3::new(a.y, -a.x, 0.0),
        )
    };
    let k = above * cross(axis) * above.inverse();
    let b =
        0.5 * DVec3::new(k.y_axis.z - k.z_axis.y, k.z_axis.x - k.x_axis.z, k.x_axis.y - k.y_axis.x);
    let is_turn = largest(k - cross(b)) <= UNEVEN_MAX && (b.length() - 1.0).abs() <= UNEVEN_MAX;
    let outer = |b: DVec3| DMat3::from_cols(b * axis.x, b * axis.y, b * axis.z);
    is_turn.then(|| outer(b.normalize()))
}

/// The largest entry.
fn largest(m: DMat3) -> f64 {
    m.to_cols_array().iter().fold(0.0, |a: f64, x| a.max(x.abs()))
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

/// An error unless key times are finite, not negative, strictly ascending, and as many as the values allow (three for each
/// key of a cubic spline).
pub fn check_track(
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

/// The vector, if its components are numbers to compute with.
fn finite(node: &DraftNode, which: &str, v: DVec3) -> Result<DVec3, SceneError> {
    if is_place(&v.to_array()) {
        return Ok(v);
    }
    let what = match v.is_finite() {
        false => format!("its {which} is not finite ({}, {}, {})", v.x, v.y, v.z),
        true => format!(
            "its {which} is ({:e}, {:e}, {:e}), more than {COORDINATE_MAX_M:e}",
            v.x, v.y, v.z
        ),
    };
    Err(SceneError::Geometry {
        subject: format!("node `{}`", node.name),
        what,
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
