//! View from a single point to a convex polygon past convex occluders.

use glam::{DVec2, DVec3};

use super::clip::{Cutter, FRAGMENTS_MAX, Occluders};
use super::point::{form_factor_from_point, middle_of_sent};
use super::target_frame::TargetFrame;

/// Share of a polygon below which what is left of it is a gap between shadows that rounding made.
const HIDDEN: f64 = 1e-8;

/// A form factor past occluders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorPast {
    /// Form factor from the point to what it sees.
    pub factor: f64,
    /// The middle of what it sees, weighed as it arrives; of no meaning where it sees nothing.
    pub middle: DVec3,
    /// Exact up to rounding; else the target fell into too many pieces, and `factor` counts some
    /// of what is hidden.
    pub is_exact: bool,
}

/// View from a single point to a convex polygon past convex occluders.
struct PointView {
    frame: TargetFrame,
    /// The point, and the polygon, in it.
    from: DVec3,
    flat: Vec<DVec2>,
    cutter: Cutter,
}

impl PointView {
    fn new<'a>(
        point: DVec3,
        target: &[DVec3],
        occluders: impl Iterator<Item = &'a [DVec3]>,
    ) -> PointView {
        let frame = TargetFrame::of_polygon(target);
        let from = frame.place(point);
        let mut between = Occluders::default();
        for occluder in occluders {
            between.push(occluder.iter().map(|&c| frame.place(c)), from);
        }
        between.largest_first();
        let mut cutter = Cutter::default();
        let flat = frame.flat(target);
        cutter.cut(from, &flat, &between);
        PointView { frame, from, flat, cutter }
    }
}

/// Form factor from a point to the part of a convex polygon (wholly in front of the point's tangent
/// plane) that convex occluders leave visible; exact up to rounding. Occluders must have been
/// clipped to between the two.
pub fn form_factor_past<'a>(
    point: DVec3,
    normal: DVec3,
    target: &[DVec3],
    occluders: impl Iterator<Item = &'a [DVec3]>,
) -> FactorPast {
    let PointView { frame, from, flat, cutter } = PointView::new(point, target, occluders);
    let normal = frame.direction(normal);
    let mut solid = Vec::new();
    let (mut factor, mut moment) = (0.0, DVec2::ZERO);
    let mut add = |piece: &[DVec2], sign: f64| {
        solid.clear();
        solid.extend(piece.iter().map(|c| c.extend(0.0)));
        let sent = sign * form_factor_from_point(from, normal, &solid);
        factor += sent;
        moment += middle_of_sent(piece, from, normal) * sent;
    };
    cutter.left.iter().for_each(|piece| add(piece, 1.0));
    cutter.dark.iter().for_each(|piece| add(piece, -1.0));
    // A sliver's middle is the difference of two estimates: it is on the target all the same.
    let low = flat.iter().copied().fold(flat[0], DVec2::min);
    let high = flat.iter().copied().fold(flat[0], DVec2::max);
    let middle = frame.point((moment / factor.max(f64::MIN_POSITIVE)).clamp(low, high));
    FactorPast { factor, middle, is_exact: cutter.left.len() <= FRAGMENTS_MAX }
}

/// Whether convex occluders hide all of a convex polygon from a point. Occluders must have been clipped to between
/// the two.
pub(super) fn is_hidden<'a>(
    point: DVec3,
    target: &[DVec3],
    occluders: impl Iterator<Item = &'a [DVec3]>,
) -> bool {
    let PointView { flat, cutter, .. } = PointView::new(point, target, occluders);
    let left: f64 = cutter.left.iter().map(twice_area).sum();
    let dark: f64 = cutter.dark.iter().map(twice_area).sum();
    left - dark <= HIDDEN * twice_area(&flat)
}

fn twice_area(c: &[DVec2]) -> f64 {
    let fan = |k: usize| (c[k] - c[0]).perp_dot(c[k + 1] - c[0]);
    (1..c.len().saturating_sub(1)).map(fan).sum::<f64>().abs()
}
