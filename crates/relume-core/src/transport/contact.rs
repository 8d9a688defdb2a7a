//! Coplanar surfaces: which of two coincident surfaces hides the other ([`Sheet::lies_to`] has the rule), and the exchange of
//! surfaces in contact, which is everything that leaves their overlap.

use crate::element::{Forest, OccluderPolygon, WorldElement, WorldView};
use crate::geometry::{ConvexPolygon, Interval, Plane};
use crate::scene::{InPlane, Lying, PatchId, Sheet};

/// Relation of a patch in the plane of an end of patch `end` to that end.
pub fn in_plane(
    forest: &Forest,
    view: &WorldView,
    patch: PatchId,
    end: PatchId,
    lying: Lying,
) -> InPlane {
    let sheet = |patch: PatchId| Sheet {
        patch,
        twin: view.patch(patch).twin,
        enclosure: forest.enclosure(patch),
        lying_m2: view.patch(patch).lying_m2,
        rounding_m: view.patch(patch).rounding_m,
    };
    sheet(patch).lies_at(&sheet(end), lying)
}

/// How a polygon lies in an end's plane, if it does up to `within_m`.
pub fn lies_in(polygon: &OccluderPolygon<'_>, plane: &Plane, within_m: f64) -> Option<Lying> {
    let cosine = polygon.plane.normal.dot(plane.normal);
    if cosine.abs() <= 0.5 {
        return None;
    }
    let height_m = Interval::of(polygon.corners.iter().map(|&c| plane.distance(c)));
    let is_near = height_m.lo >= -within_m && height_m.hi <= within_m;
    is_near.then_some(Lying { opposed: cosine < 0.0, height_m })
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
        [common, _] = common.split(&plane);
    }
    let mut pieces = vec![common];
    for cover in covers {
        let before = std::mem::take(&mut pieces);
        for mut rest in before {
            for edge in cover.edges {
                let [inside, outside] = rest.split(edge);
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
