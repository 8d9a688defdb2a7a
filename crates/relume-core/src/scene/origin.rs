//! Scenes far from the origin: map coordinates. What counts as one plane or one point is a share of the largest coordinate, so that
//! such a scene is moved to the origin before anything is made of it. Must not know light transport.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::draft::{Draft, DraftNode};
use super::limits::COORDINATE_MAX_M;
use super::tuning::{FAR, FAR_CORNERS};
use super::{Interpolation, Note, Severity};

/// Where the polygons of a draft are at the start.
struct Extent {
    low: DVec3,
    high: DVec3,
    /// Largest coordinate of a corner in the frame of its node, if all are as 32-bit numbers hold them, metres.
    corner_m: f64,
}

/// Moves a draft that lies far away so that its middle is about the origin, if it asks for that ([`Draft::near_origin`]); returns where
/// its origin lies then, metres. What is far and stays there has notes that say so.
pub(super) fn bring_near(draft: &mut Draft, notes: &mut Vec<Note>) -> DVec3 {
    let Some(Extent { low, high, corner_m }) = extent(draft) else { return DVec3::ZERO };
    let size_m = low.distance(high);
    // Neither nothing nor beyond all numbers.
    if !(size_m.is_normal() && size_m < f64::MAX) {
        return DVec3::ZERO;
    }
    if corner_m > FAR_CORNERS * size_m {
        notes.push(coarse(&draft.name, corner_m, size_m));
    }
    let middle = low.midpoint(high);
    let far_m = middle.abs().max_element();
    // What is further out than any scene may be is refused for that, not moved.
    if far_m <= FAR * size_m || far_m > COORDINATE_MAX_M {
        return DVec3::ZERO;
    }
    if !draft.near_origin {
        notes.push(far(&draft.name, far_m, size_m));
        return DVec3::ZERO;
    }
    // Coordinates of 32 bits less whole units of a power of two round nothing.
    let unit = libm::exp2(libm::ceil(libm::log2(size_m)));
    let origin = (middle / unit).round() * unit;
    for node in draft.nodes.iter_mut().filter(|node| node.parent.is_none()) {
        shift(node, -origin);
    }
    notes.push(moved(&draft.name, origin));
    origin
}

/// Moves a node that hangs on no other.
fn shift(node: &mut DraftNode, by: DVec3) {
    node.translation += by;
    if let Some(track) = &mut node.translation_track {
        let is_cubic = track.interpolation == Interpolation::CubicSpline;
        let mut values = track.values.iter_mut().enumerate();
        // Of three numbers of a cubic key the second is the value.
        values.by_ref().filter(|(k, _)| !is_cubic || k % 3 == 1).for_each(|(_, v)| *v += by);
    }
}

fn extent(draft: &Draft) -> Option<Extent> {
    let mut world_from_node: Vec<DAffine3> = Vec::with_capacity(draft.nodes.len());
    let (mut bounds, mut corner_m, mut is_32_bit) = (None, 0.0_f64, true);
    for node in &draft.nodes {
        let own = start(node);
        let world = node.parent.map_or(own, |parent| world_from_node[parent] * own);
        for &corner in node.surfaces.iter().flat_map(|s| &s.polygons).flatten() {
            corner_m = corner_m.max(corner.abs().max_element());
            is_32_bit &= corner == corner.as_vec3().as_dvec3();
            let p = world.transform_point3(corner);
            let (low, high) = bounds.unwrap_or((p, p));
            bounds = Some((low.min(p), high.max(p)));
        }
        world_from_node.push(world);
    }
    let (low, high) = bounds?;
    Some(Extent { low, high, corner_m: if is_32_bit { corner_m } else { 0.0 } })
}

/// Where a node is in the frame of its parent at the start.
fn start(node: &DraftNode) -> DAffine3 {
    let translation = node.translation_track.as_ref().filter(|t| !t.times_s.is_empty());
    let translation = translation.map_or(node.translation, |track| track.at(0.0));
    let rotation = node.rotation_track.as_ref().filter(|t| !t.times_s.is_empty());
    let rotation: DQuat = rotation.map_or(node.rotation, |track| track.at(0.0));
    let turn = if rotation.length() > 0.0 {
        DMat3::from_quat(rotation.normalize())
    } else {
        DMat3::IDENTITY
    };
    DAffine3::from_mat3_translation(turn * node.shape, translation)
}

fn told(severity: Severity, code: &'static str, subject: &str, message: String) -> Note {
    Note { severity, code, subject: subject.to_owned(), count: 1, message }
}

fn moved(subject: &str, DVec3 { x, y, z }: DVec3) -> Note {
    let message = format!(
        "it lies far from the origin and is computed about ({x}, {y}, {z}) m: places that are given and told are those of the file"
    );
    told(Severity::Info, "far-origin", subject, message)
}

fn far(subject: &str, far_m: f64, size_m: f64) -> Note {
    let message = format!(
        "it is {size_m:.3} m large and lies {far_m:.3e} m from the origin, where what is close by counts as one: move it to the origin, \
         or read it with `near_origin`"
    );
    told(Severity::Warning, "far-origin", subject, message)
}

fn coarse(subject: &str, corner_m: f64, size_m: f64) -> Note {
    let step_m = corner_m * f64::from(f32::EPSILON);
    let message = format!(
        "corners of its meshes have coordinates of {corner_m:.3e} m in 32-bit numbers, which are {step_m:.1e} m apart there, and it is \
         {size_m:.3} m large: surfaces may not meet; move the meshes to the origin before they are exported, and the nodes back"
    );
    told(Severity::Warning, "coarse-corners", subject, message)
}
