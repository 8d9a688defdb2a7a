//! Narrow gaps between faces: dark but for a strip along their edges. Pure geometry.
//!
//! A panel a millimetre above a floor lets light in as far as some widths of the gap. An element of the floor that lies partly under it
//! would hand to that part what arrives beside it, and between white faces none of that would get out again.

use glam::{DVec2, DVec3};

use super::placed::{IN_PLANE, Placed};
use super::tuning::{GAP_BEND, GAP_LEAST, GAP_STRIP};
use super::weld::Weld;
use crate::geometry::{Aabb, Moments, Plane, common, part_in_front};

/// Least cosine between the normals of two faces, one turned about, between which a gap is.
pub(super) const PARALLEL: f64 = 0.998;

/// The part of two faces between which next to no light gets.
pub(super) struct Gap {
    /// In the frame of each face, convex, counter-clockwise, metres.
    pub(super) outlines: [Vec<DVec2>; 2],
    /// Around the gap and the strips along its open sides.
    pub(super) bounds: Aabb,
}

/// Largest width of a gap that a face of a size (m) may be at.
pub(super) fn widest_m(size_m: f64) -> f64 {
    // Where strips of all sides meet: 2 (GAP_STRIP + GAP_BEND h / w) h = w.
    let h = ((GAP_STRIP * GAP_STRIP + 2.0 * GAP_BEND).sqrt() - GAP_STRIP) / (2.0 * GAP_BEND);
    h * size_m
}

/// Box around a face within which whatever it has a gap with lies, at least in part.
pub(super) fn gap_reach(face: &Aabb) -> Aabb {
    face.grown(widest_m((face.hi - face.lo).max_element()))
}

/// The gap between two faces that look at each other; of each of their sides whether it is `open`, from the lowest bit up.
///
/// It ends a strip before open sides that is some widths of the gap wide: as wide as the light is that gets in, if the strip is lit as
/// what is around; of gaps that are wide for their length more, for light gets in from all sides. What is small beside the scene has none.
pub(super) fn between(faces: [&Placed; 2], open: [u64; 2], slack_m: f64) -> Option<Gap> {
    let [p, q] = faces;
    if p.normal.dot(q.normal) > -PARALLEL {
        return None;
    }
    let whole = p.outline();
    let over = common(&whole, &turned(q, p));
    if over.len() < 3 {
        return None;
    }
    let planes = faces.map(|face| Plane::through(face.corners[0], face.normal));
    let heights = || over.iter().map(|&c| planes[1].distance(p.point(c)));
    let (least, h) = heights().fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
    if least <= slack_m {
        return None;
    }
    let border: f64 = (0..over.len()).map(|k| over[k].distance(over[(k + 1) % over.len()])).sum();
    let size_m = 4.0 * Moments::of(&over).area / border;
    if size_m < GAP_LEAST * slack_m / IN_PLANE {
        return None;
    }
    let strip_m = (GAP_STRIP + GAP_BEND * h / size_m) * h;
    let kept = [inset(p, open[0], strip_m), inset(q, open[1], strip_m)];
    if kept.iter().any(|k| k.len() < 3) {
        return None;
    }
    let [by_p, by_q] = &kept;
    let points = |face: &Placed, outline: &[DVec2]| -> Vec<DVec3> {
        outline.iter().map(|&c| face.point(c)).collect()
    };
    let seen = |on: &Placed, of: &[DVec3]| -> Vec<DVec2> {
        of.iter().rev().map(|&c| on.in_frame(c)).collect()
    };
    let on_p = common(by_p, &seen(p, &points(q, by_q)));
    let on_q = common(by_q, &seen(q, &points(p, by_p)));
    if on_p.len() < 3 || on_q.len() < 3 {
        return None;
    }
    // A lamp in the strip lights the rest of the gap many times as much as what is beside the gap does.
    let below = |c: &DVec2| p.point(*c) - q.normal * planes[1].distance(p.point(*c));
    let bounds = Aabb::of(points(p, &over).into_iter().chain(over.iter().map(below)));
    Some(Gap { outlines: [on_p, on_q], bounds })
}

/// The other face as seen in the frame of one.
fn turned(face: &Placed, in_frame_of: &Placed) -> Vec<DVec2> {
    face.corners.iter().rev().map(|&c| in_frame_of.in_frame(c)).collect()
}

/// What of a face is further than `strip_m` from its open sides.
fn inset(face: &Placed, open: u64, strip_m: f64) -> Vec<DVec2> {
    let whole = face.outline();
    let mut rest = whole.clone();
    for k in (0..whole.len()).filter(|&k| k >= 64 || open >> k & 1 == 1) {
        let (from, to) = (whole[k], whole[(k + 1) % whole.len()]);
        let inward = (to - from).perp().normalize_or_zero() * strip_m;
        rest = part_in_front(&rest, |c| (to - from).perp_dot(c - from - inward));
        if rest.len() < 3 {
            return Vec::new();
        }
    }
    rest
}

/// Which sides of faces are open, from the lowest bit up: those that no other face goes on from in the same plane. Faces of one body.
pub(super) fn open_sides(faces: &[Placed]) -> Vec<u64> {
    let mut weld = Weld::of_corners(faces.iter().flat_map(|f| f.corners.iter().copied()));
    let corners: Vec<Vec<u32>> =
        faces.iter().map(|f| f.corners.iter().map(|&c| weld.vertex(c)).collect()).collect();
    let mut sides: Vec<(u32, u32, usize)> = Vec::new();
    for (face, ends) in corners.iter().enumerate() {
        sides.extend((0..ends.len()).map(|k| (ends[k], ends[(k + 1) % ends.len()], face)));
    }
    sides.sort_unstable();
    let goes_on = |from: u32, to: u32, face: usize| {
        let first = sides.partition_point(|side| (side.0, side.1) < (to, from));
        let same = sides[first..].iter().take_while(|side| (side.0, side.1) == (to, from));
        same.into_iter().any(|side| faces[side.2].normal.dot(faces[face].normal) > FLAT)
    };
    let of_face = |(face, ends): (usize, &Vec<u32>)| {
        let is_open = |k: &usize| !goes_on(ends[*k], ends[(k + 1) % ends.len()], face);
        (0..ends.len().min(64)).filter(is_open).fold(0, |bits, k| bits | 1 << k)
    };
    corners.iter().enumerate().map(of_face).collect()
}

/// Least cosine between the normals of two faces that go on from each other in one plane.
const FLAT: f64 = 1.0 - 1e-6;

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::geometry::Pose;
    use crate::scene::{BodyId, SceneBuilder};

    /// What a gap of `height_m` hides of a floor of 4 x 4 m under a plate of 1 x 1 m, of one polygon or two; m2.
    fn hidden_m2(height_m: f64, triangles: bool, faces_down: bool, tilt: f64) -> f64 {
        let mut b = SceneBuilder::new("gap");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let square =
            |r: f64| [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(x, y)| DVec3::new(x, y, 0.0));
        let floor = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
        b.polygon(floor, "floor", grey, &square(2.0));
        let at = DVec3::new(0.0, 0.0, height_m);
        let node = b.node("plate", None, at, DQuat::from_rotation_x(tilt));
        let mut plate = square(0.5);
        if faces_down {
            plate.reverse();
        }
        let [p, q, r, s] = plate;
        match triangles {
            true => {
                b.polygon(node, "one", grey, &[p, q, r]);
                b.polygon(node, "two", grey, &[p, r, s]);
            }
            false => b.polygon(node, "plate", grey, &plate),
        }
        let scene = b.build().unwrap();
        let placed: Vec<Placed> = [0, 1]
            .into_iter()
            .flat_map(|body| scene.patches_of(BodyId(body)))
            .map(|(id, patch)| Placed::new(id, patch, &Pose::IDENTITY))
            .collect();
        let open = open_sides(&placed);
        let on_floor = |k: usize| {
            let gap = between([&placed[k], &placed[0]], [open[k], open[0]], 1e-6);
            gap.map_or(0.0, |gap| Moments::of(&gap.outlines[1]).area)
        };
        (1..placed.len()).map(on_floor).sum()
    }

    #[test]
    fn a_strip_along_the_open_sides_of_a_narrow_gap_is_lit() {
        let strip = (2.0 + 400.0 * 0.001) * 0.001;
        let exact = (1.0_f64 - 2.0 * strip).powi(2);
        let found = hidden_m2(0.001, false, true, 0.0);
        assert!((found - exact).abs() < 1e-6, "{found}, not {exact}");
        // Two triangles: no strip between them; their sizes are smaller, their strips a little wider.
        let of_two = hidden_m2(0.001, true, true, 0.0);
        assert!(of_two < exact && of_two > exact - 0.01, "{of_two}");
    }

    #[test]
    fn what_is_far_touches_leans_or_looks_away_leaves_no_gap() {
        assert_eq!(hidden_m2(0.04, false, true, 0.0), 0.0);
        assert_eq!(hidden_m2(0.0, false, true, 0.0), 0.0);
        assert_eq!(hidden_m2(0.06, false, true, 0.1), 0.0);
        assert_eq!(hidden_m2(0.001, false, false, 0.0), 0.0);
        // Wider gaps hide less, down to nothing.
        let of = |h: f64| hidden_m2(h, false, true, 0.0);
        assert!(
            of(0.02) < of(0.01) && of(0.03) < 0.05 && of(0.03) > 0.0,
            "{} {}",
            of(0.02),
            of(0.03)
        );
    }
}
