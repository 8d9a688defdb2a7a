//! What of a patch is covered, as disjoint parts of it, and what of it lies in the dark. Pure geometry.

use glam::{DVec2, DVec3};

use crate::geometry::{Moments, common, difference};
use crate::scene::tuning::{COVERED_PARTS_MAX, COVERED_WHOLLY};
use crate::scene::{BodyId, PatchId, Scene};

/// Parts of less than this share of a patch are rounding.
const SLIVER: f64 = 1e-9;

/// Part of a patch that lies within a body, or in a narrow gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Inside {
    /// The body, and a number of what of it hangs together; of a gap numbers that no body has.
    pub of: (BodyId, u32),
    /// Whether the patch is one of the same body's, which moves; then places are in that body's frame, else in the world.
    pub is_own: bool,
    /// Convex polygon in the patch's frame, counter-clockwise, metres.
    pub outline: Vec<DVec2>,
    /// Lowest and highest coordinates of the outline.
    pub bounds: [DVec2; 2],
    /// Origin of the patch's frame, and its axes.
    pub plane: [DVec3; 3],
}

/// What of a patch is covered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Covered {
    /// Disjoint convex polygons in the patch's frame, counter-clockwise, with boxes around them (low, high); metres.
    pub parts: Vec<(Vec<DVec2>, [DVec2; 2])>,
    /// What of it lies within bodies or narrow gaps: what that exchanges with what lies within the same one, no light does. Of one disjoint.
    pub inside: Vec<Inside>,
    /// Whether one thing covers it but for a thousandth, or all of it: then nothing is said of parts.
    pub is_wholly: bool,
    /// Patches that touch it, and inner sides of what stands on it: what they exchange leaves neither. Ascending.
    pub contacts: Vec<PatchId>,
}

/// Adds to what is covered of a patch what other polygons in its frame cover; whether they cover any of it.
pub(super) fn add(
    scene: &Scene,
    patch: PatchId,
    by: Vec<Vec<DVec2>>,
    (covered, left): (&mut Covered, &mut usize),
) -> bool {
    let whole = &scene.patches[patch.0 as usize].corners;
    let whole_m2 = Moments::of(whole).area;
    let wide = |p: &[DVec2]| p.len() > 2 && Moments::of(p).area > SLIVER * whole_m2;
    let mut fresh: Vec<Vec<DVec2>> = by.iter().map(|p| common(p, whole)).collect();
    fresh.retain(|p| wide(p));
    let fresh_m2: f64 = fresh.iter().map(|p| Moments::of(p).area).sum();
    if fresh.is_empty() || fresh_m2 > COVERED_WHOLLY * whole_m2 {
        covered.is_wholly |= !fresh.is_empty();
        return !fresh.is_empty();
    }
    for (part, bounds) in &covered.parts {
        let mut rest = Vec::with_capacity(fresh.len());
        for piece in fresh {
            if *left > 0 && meet(&around(&piece), bounds) {
                *left -= 1;
                difference(&piece, part, &mut rest);
            } else {
                rest.push(piece);
            }
        }
        fresh = rest;
    }
    fresh.retain(|p| wide(p));
    if *left == 0 || covered.parts.len() + fresh.len() > COVERED_PARTS_MAX {
        // Without the cuts parts would count twice.
        covered.parts.clear();
    } else {
        covered.parts.extend(fresh.into_iter().map(|p| {
            let bounds = around(&p);
            (p, bounds)
        }));
    }
    true
}

/// Lowest and highest coordinates.
pub(super) fn around(polygon: &[DVec2]) -> [DVec2; 2] {
    polygon
        .iter()
        .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[lo, hi], &p| [lo.min(p), hi.max(p)])
}

fn meet(a: &[DVec2; 2], b: &[DVec2; 2]) -> bool {
    a[0].cmplt(b[1]).all() && b[0].cmplt(a[1]).all()
}
