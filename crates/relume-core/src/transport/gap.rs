//! Gaps: where one surface lies close over another, light comes in at the edge and gets no deeper than some widths. A pure query about
//! shapes and places.

use crate::element::{OccluderPolygon, WorldElement};

use super::tuning::{GAP_BESIDE, GAP_WIDTH};

/// Standard deviation over an element of the radiosity reflected towards a polygon that lies close over a part of it, over its mean:
/// 1 where the polygon ends over the element or so close beside it that light is uneven there; 0 elsewhere.
pub fn in_gap(e: &WorldElement, over: &OccluderPolygon<'_>) -> f64 {
    let size_m = e.area.sqrt();
    let is_close = |p: glam::DVec3| over.plane.distance(p).abs() < GAP_WIDTH * size_m;
    if e.plane.normal.dot(over.plane.normal) > -OPPOSED || !e.corners.iter().all(|&c| is_close(c)) {
        return 0.0;
    }
    let reach_m = GAP_BESIDE * size_m;
    let mut is_inside = true;
    for edge in over.edges {
        let heights = || e.corners.iter().map(|&c| edge.distance(c));
        if heights().all(|h| h < -reach_m) {
            return 0.0;
        }
        is_inside &= heights().all(|h| h > reach_m);
    }
    if is_inside { 0.0 } else { 1.0 }
}

/// Least cosine between the normals of two surfaces that lie over each other.
const OPPOSED: f64 = 0.9;
