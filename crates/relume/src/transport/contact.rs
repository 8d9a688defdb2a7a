//! What lies in one plane: which of two coincident surfaces hides the other, and what surfaces in contact exchange.
//!
//! The rule. A closed body touches what it stands on: where its face lies in the plane of another surface and
//! looks at it, each hides the other from everything else, and they exchange all that leaves the overlap. Of two
//! surfaces in one plane that face the same way, the smaller shows and hides the larger (a rug on a floor); of
//! equal ones the first. Two rooms that share a wall's plane are back to back: neither wall hides the other.

use crate::element::{Forest, OccluderPolygon, WorldElement, WorldView};
use crate::geometry::{ConvexPolygon, Plane, no_smaller};
use crate::scene::{Enclosure, PatchId};

/// How a polygon in the plane of an end lies to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InPlane {
    /// It faces the end, or its other side does, and touches it.
    Touches,
    /// It faces the same way and shows in the end's place.
    Covers,
    /// It hides nothing of the end.
    Apart,
}

/// How a patch that lies in the plane of an end of patch `end` lies to it; `opposed` if it faces the other way.
pub fn in_plane(
    forest: &Forest,
    view: &WorldView,
    patch: PatchId,
    end: PatchId,
    opposed: bool,
) -> InPlane {
    let twins = [patch, end].map(|p| view.patch(p).twin);
    if twins[0] == Some(end) {
        return InPlane::Apart;
    }
    let [of_patch, of_end] = [patch, end].map(|p| forest.enclosure(p));
    let shows =
        || if shows_first(forest, view, patch, end) { InPlane::Covers } else { InPlane::Apart };
    match twins.map(|twin| twin.is_some()) {
        [false, false] if !opposed => shows(),
        [false, false] if of_patch == Enclosure::Space && of_end == Enclosure::Space => {
            InPlane::Apart
        }
        [false, false] => InPlane::Touches,
        // A body is on the side of a two-sided surface that its face looks at.
        [false, true] if of_patch == Enclosure::Body => {
            if opposed {
                InPlane::Touches
            } else {
                InPlane::Apart
            }
        }
        [false, true] if opposed => InPlane::Apart,
        [true, false] if of_end == Enclosure::Body => InPlane::Touches,
        _ => shows(),
    }
}

/// Whether of two coincident patches that face the same way, or whose other sides do, the first shows.
fn shows_first(forest: &Forest, view: &WorldView, one: PatchId, other: PatchId) -> bool {
    let area = |p| forest.area_m2(forest.patch_root(p));
    let first = |p: PatchId| view.patch(p).twin.map_or(p, |twin| twin.min(p));
    match (no_smaller(area(one), area(other)), no_smaller(area(other), area(one))) {
        (true, true) => first(one) < first(other),
        (one_is_larger, _) => !one_is_larger,
    }
}

/// Whether a polygon lies in an end's plane, up to `within_m`, and if so whether it faces the other way.
pub fn lies_in(polygon: &OccluderPolygon<'_>, plane: &Plane, within_m: f64) -> Option<bool> {
    let cosine = polygon.plane.normal.dot(plane.normal);
    let is_near =
        cosine.abs() > 0.5 && polygon.corners.iter().all(|&c| plane.distance(c).abs() <= within_m);
    is_near.then_some(cosine < 0.0)
}

/// Area that two elements in one plane have in common, without what `covers` takes away, m2.
///
/// Exact up to rounding. Cost: grows with the pieces that covering polygons leave.
pub fn overlap_m2<'a>(
    a: &WorldElement,
    b: &WorldElement,
    covers: impl Iterator<Item = OccluderPolygon<'a>>,
) -> f64 {
    let mut common = ConvexPolygon::new(&a.corners[..a.len]);
    for plane in sides(b) {
        common = common.split(&plane).0;
    }
    let mut pieces = vec![common];
    for cover in covers {
        let before = std::mem::take(&mut pieces);
        for mut rest in before {
            for edge in cover.edges {
                let (inside, outside) = rest.split(edge);
                pieces.push(outside);
                rest = inside;
            }
        }
        pieces.retain(|p| p.corners().len() >= 3);
    }
    pieces.iter().map(ConvexPolygon::area).sum()
}

/// Planes through the sides of an element, across its own; inside is in front.
fn sides(e: &WorldElement) -> impl Iterator<Item = Plane> + '_ {
    (0..e.len).map(|k| {
        let (p, q) = (e.corners[k], e.corners[(k + 1) % e.len]);
        Plane::through(p, e.plane.normal.cross(q - p).normalize_or_zero())
    })
}
