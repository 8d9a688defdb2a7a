//! Surfaces with parts: what is left of a base when they are cut out, in convex pieces.

use glam::DVec3;

use super::read::{RawSurface, Wrong};
use relume_core::geometry::part_in_front;
use relume_core::scene::flatten::area_vector;

/// How far a part may be off the plane of its base, or beside it, relative to the base's size: as
/// much as View3D allows.
const WITHIN: f64 = 3e-5;

/// The convex polygons of a surface that no part of it covers.
pub(super) fn what_is_left(
    surfaces: &[RawSurface],
    index: usize,
) -> Result<Vec<Vec<DVec3>>, Wrong> {
    let base = &surfaces[index];
    let mut pieces = vec![base.corners.clone()];
    for part in surfaces.iter().filter(|part| part.base == Some(index)) {
        check(base, part, index)?;
        let normal = area_vector(&base.corners);
        pieces = pieces.iter().flat_map(|piece| outside(piece, &part.corners, normal)).collect();
    }
    Ok(pieces)
}

fn check(base: &RawSurface, part: &RawSurface, index: usize) -> Result<(), Wrong> {
    let normal = area_vector(&base.corners).normalize();
    let origin = base.corners[0];
    let size = base.corners.iter().map(|c| c.distance(origin)).fold(0.0, f64::max);
    let n = base.corners.len();
    let inwards = |k: usize| {
        let (from, to) = (base.corners[k], base.corners[(k + 1) % n]);
        (from, normal.cross(to - from).normalize())
    };
    let off = |c: &DVec3| (*c - origin).dot(normal).abs() > WITHIN * size;
    let beside = |c: &DVec3| {
        (0..n).map(inwards).any(|(from, inward)| (*c - from).dot(inward) < -WITHIN * size)
    };
    let what = if part.corners.iter().any(off) {
        "is not in the plane of its base"
    } else if part.corners.iter().any(beside) {
        "reaches beyond its base"
    } else {
        return Ok(());
    };
    Err(Wrong {
        line: part.line,
        what: format!("the surface {what}, surface {}", index + 1),
        remedy: "move it into its base, or write 0 as its base".into(),
    })
}

/// What of a convex polygon is outside a convex hole in its plane: at most a piece for each side.
fn outside(polygon: &[DVec3], hole: &[DVec3], normal: DVec3) -> Vec<Vec<DVec3>> {
    // Null surfaces face the other way round.
    let sign = area_vector(hole).dot(normal).signum();
    let least = 1e-9 * area_vector(polygon).length();
    let mut out = Vec::new();
    let mut rest = polygon.to_vec();
    for k in 0..hole.len() {
        let (from, to) = (hole[k], hole[(k + 1) % hole.len()]);
        let inward = normal.cross(to - from) * sign;
        let side = |c: DVec3| (c - from).dot(inward);
        let beyond = part_in_front(&rest, |c| -side(c));
        if beyond.len() >= 3 && area_vector(&beyond).length() > least {
            out.push(beyond);
        }
        rest = part_in_front(&rest, side);
        if rest.len() < 3 || area_vector(&rest).length() <= least {
            // The hole is beside the polygon.
            return vec![polygon.to_vec()];
        }
    }
    out
}
