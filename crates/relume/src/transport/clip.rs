//! Partial visibility by clipping: exact from each of a few points of the smaller end.
//!
//! Seen from a point, an occluding polygon hides a pyramid. What is left of the larger end after
//! all pyramids are cut off is a set of convex fragments, whose form factors are known in closed
//! form. Overlapping occluders need no special care.

use glam::{DVec2, DVec3};

use super::kernel::G;
use super::point::form_factor_from_point;
use super::visibility::Visibility;
use crate::element::WorldElement;
use crate::geometry::{ConvexPolygon, Plane};

/// Fragments after which what is left is taken as it is: a guard, never met with few occluders.
const FRAGMENTS_MAX: usize = 256;

/// Visibility of `a` and `b` past convex occluders, all in one frame: from 2 x 2 Gauss points in
/// each of `cells` x `cells` parts of the smaller end.
pub(super) fn clipped_visibility(
    a: &WorldElement,
    b: &WorldElement,
    occluders: &[Vec<DVec3>],
    cells: u32,
) -> Visibility {
    let slack = a.rounding_m + b.rounding_m;
    let a_looks = a.area <= b.area;
    let (small, large) = if a_looks { (a, b) } else { (b, a) };
    let target = ConvexPolygon::new(&large.corners[..large.len]).clipped(&small.plane, slack);
    let between: Vec<ConvexPolygon> = occluders
        .iter()
        .map(|o| clip_between(o, small, large, slack))
        .filter(|o| o.corners().len() >= 3)
        .collect();
    let mut sums = Sums::default();
    let side = 2 * cells;
    let at = |k: u32| (f64::from(k / 2) + G[k as usize & 1]) / f64::from(cells);
    for k in 0..side * side {
        let point = small.point(at(k % side), at(k / side));
        if large.plane.distance(point) > 0.0 && target.corners().len() >= 3 {
            sums.look(point, small, large, &target, &between);
        }
    }
    let over_small = gradient(small, sums.at_small, sums.at_small_clear, sums.all, sums.clear);
    let over_large = gradient(large, sums.at_large, sums.at_large_clear, sums.all, sums.clear);
    let value = if sums.all > 0.0 { (sums.clear / sums.all).clamp(0.0, 1.0) } else { 0.0 };
    let (gradient_a, gradient_b) =
        if a_looks { (over_small, over_large) } else { (over_large, over_small) };
    let (of_small, of_large) = sums.spreads(value);
    let (spread_a, spread_b) = if a_looks { (of_small, of_large) } else { (of_large, of_small) };
    Visibility { value, gradient_a, gradient_b, spread_a, spread_b, segments: side * side }
}

/// Form factor from a point to the part of a convex polygon (wholly in front of the point's tangent
/// plane) that convex occluders leave visible; exact up to rounding. Occluders must have been
/// clipped to between the two.
pub fn visible_form_factor(
    point: DVec3,
    normal: DVec3,
    target: &ConvexPolygon,
    occluders: &[ConvexPolygon],
) -> f64 {
    let mut cutter = Cutter::default();
    cutter.cut(point, target, occluders);
    cutter.left.iter().map(|f| form_factor_from_point(point, normal, f.corners())).sum()
}

/// The part of an occluder in front of both ends' planes.
fn clip_between(
    occluder: &[DVec3],
    a: &WorldElement,
    b: &WorldElement,
    slack: f64,
) -> ConvexPolygon {
    // Beyond its room a polygon is cut short, which only large n-gons meet.
    let whole = ConvexPolygon::new(&occluder[..occluder.len().min(ConvexPolygon::START_MAX)]);
    let raised = |p: &Plane| Plane { normal: p.normal, offset: p.offset + slack };
    whole.clipped(&raised(&a.plane), 0.0).clipped(&raised(&b.plane), 0.0)
}

/// Form factors from the points, of all and of what is clear, with first moments on both ends.
#[derive(Default)]
struct Sums {
    all: f64,
    clear: f64,
    at_small: DVec2,
    at_small_clear: DVec2,
    at_large: DVec2,
    at_large_clear: DVec2,
    /// Sum over the points of their clear part squared over all.
    clear2: f64,
    cutter: Cutter,
}

impl Sums {
    fn look(
        &mut self,
        point: DVec3,
        small: &WorldElement,
        large: &WorldElement,
        target: &ConvexPolygon,
        occluders: &[ConvexPolygon],
    ) {
        let normal = small.plane.normal;
        let all = form_factor_from_point(point, normal, target.corners());
        self.cutter.cut(point, target, occluders);
        let at = small.offset(point);
        self.all += all;
        self.at_small += at * all;
        self.at_large += large.offset(centroid(target)) * all;
        let before = self.clear;
        for fragment in &self.cutter.left {
            let f = form_factor_from_point(point, normal, fragment.corners());
            self.clear += f;
            self.at_small_clear += at * f;
            self.at_large_clear += large.offset(centroid(fragment)) * f;
        }
        let clear = self.clear - before;
        self.clear2 += clear * clear / all.max(f64::MIN_POSITIVE);
    }

    /// Standard deviations of visibility over the smaller end (between its points) and over the
    /// larger (within what each point sees: there it is 0 or 1).
    fn spreads(&self, value: f64) -> (f64, f64) {
        if self.all <= 0.0 {
            return (0.0, 0.0);
        }
        let mean_square = self.clear2 / self.all;
        let between = (mean_square - value * value).max(0.0).sqrt();
        let within = (value - mean_square).max(0.0).sqrt();
        (between, within)
    }
}

/// What occlusion adds to the relative gradient over an element: the shift of the centre of what
/// passes, against the element's second moment.
fn gradient(e: &WorldElement, at: DVec2, at_clear: DVec2, all: f64, clear: f64) -> DVec2 {
    if clear <= 1e-12 * all {
        return DVec2::ZERO;
    }
    e.gradient_of_shift(at_clear / clear - at / all)
}

/// Cuts pyramids out of a polygon; its buffers serve many points.
#[derive(Default)]
struct Cutter {
    /// The fragments that are left.
    left: Vec<ConvexPolygon>,
    next: Vec<ConvexPolygon>,
    planes: Vec<Plane>,
}

impl Cutter {
    /// Leaves what is seen of `target` from `point` past the occluders.
    fn cut(&mut self, point: DVec3, target: &ConvexPolygon, occluders: &[ConvexPolygon]) {
        self.left.clear();
        self.left.push(*target);
        for occluder in occluders {
            if self.left.is_empty() || self.left.len() > FRAGMENTS_MAX {
                return;
            }
            if self.raise_pyramid(point, occluder) && !self.misses(target) {
                self.cut_pyramid();
            }
        }
    }

    /// The sides of the pyramid from `point` over `occluder`, its inside in front of all; false
    /// where the occluder is seen edge on.
    fn raise_pyramid(&mut self, point: DVec3, occluder: &ConvexPolygon) -> bool {
        let corners = occluder.corners();
        let facing = occluder.area_vector2().dot(corners[0] - point);
        self.planes.clear();
        let mut p = corners[corners.len() - 1] - point;
        for &corner in corners {
            let q = corner - point;
            // Unit length does not matter: only signs and ratios are used.
            self.planes.push(Plane::through(point, p.cross(q) * facing.signum()));
            p = q;
        }
        facing != 0.0
    }

    fn misses(&self, polygon: &ConvexPolygon) -> bool {
        let outside = |plane: &Plane| polygon.corners().iter().all(|&c| plane.distance(c) <= 0.0);
        self.planes.iter().any(outside)
    }

    fn cut_pyramid(&mut self) {
        self.next.clear();
        for k in 0..self.left.len() {
            if self.misses(&self.left[k]) {
                self.next.push(self.left[k]);
                continue;
            }
            let mut rest = self.left[k];
            for plane in &self.planes {
                if rest.corners().iter().all(|&c| plane.distance(c) >= 0.0) {
                    continue;
                }
                let (inside, beyond) = rest.split(plane);
                if beyond.corners().len() >= 3 {
                    self.next.push(beyond);
                }
                rest = inside;
                if rest.corners().len() < 3 {
                    break;
                }
            }
        }
        std::mem::swap(&mut self.left, &mut self.next);
    }
}

fn centroid(polygon: &ConvexPolygon) -> DVec3 {
    let c = polygon.corners();
    let (mut sum, mut area) = (DVec3::ZERO, 0.0);
    for k in 1..c.len() - 1 {
        let twice = (c[k] - c[0]).cross(c[k + 1] - c[0]).length();
        sum += (c[0] + c[k] + c[k + 1]) * (twice / 3.0);
        area += twice;
    }
    if area > 0.0 { sum / area } else { c[0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;

    fn square(z: f64, lo: f64, hi: f64, up: bool) -> WorldElement {
        let mut corners =
            [(lo, lo), (hi, lo), (hi, hi), (lo, hi)].map(|(x, y)| DVec3::new(x, y, z));
        if !up {
            corners.reverse();
        }
        let normal = if up { DVec3::Z } else { DVec3::NEG_Z };
        let centre = corners.iter().sum::<DVec3>() / 4.0;
        WorldElement {
            corners,
            len: 4,
            plane: Plane::through(corners[0], normal),
            axes: [DVec3::X, normal.cross(DVec3::X)],
            centre,
            radius: (corners[0] - centre).length(),
            area: (hi - lo) * (hi - lo),
            bounds: Aabb::of(corners),
            rounding_m: 1e-12,
        }
    }

    fn blocker(z: f64, lo: f64, hi: f64) -> Vec<DVec3> {
        square(z, lo, hi, true).corners.to_vec()
    }

    #[test]
    fn half_of_a_small_pair_is_hidden_by_a_half_plane() {
        let (a, b) = (square(0.0, -0.01, 0.01, true), square(1.0, -0.01, 0.01, false));
        let half: Vec<DVec3> = [(0.0, -9.0), (9.0, -9.0), (9.0, 9.0), (0.0, 9.0)]
            .map(|(x, y)| DVec3::new(x, y, 0.5))
            .into();
        let v = clipped_visibility(&a, &b, &[half], 1);
        assert!((v.value - 0.5).abs() < 1e-3, "{v:?}");
        // Points further from the half plane see more.
        assert!(v.gradient_a.x < 0.0 && v.gradient_a.y.abs() < 1e-6, "{v:?}");
    }

    #[test]
    fn overlapping_occluders_hide_their_union() {
        let (a, b) = (square(0.0, 0.0, 1.0, true), square(2.0, 0.0, 1.0, false));
        let one = clipped_visibility(&a, &b, &[blocker(1.0, 0.2, 0.6)], 1).value;
        let twice =
            clipped_visibility(&a, &b, &[blocker(1.0, 0.2, 0.6), blocker(1.0, 0.3, 0.5)], 1).value;
        assert!((one - twice).abs() < 1e-12);
        let more = clipped_visibility(&a, &b, &[blocker(1.0, 0.2, 0.6), blocker(0.5, 0.3, 0.8)], 1);
        assert!(more.value < one - 0.01);
    }

    #[test]
    fn an_occluder_over_everything_hides_everything_and_one_beside_nothing() {
        let (a, b) = (square(0.0, 0.0, 1.0, true), square(2.0, 0.0, 1.0, false));
        assert_eq!(clipped_visibility(&a, &b, &[blocker(1.0, -9.0, 9.0)], 1).value, 0.0);
        assert_eq!(clipped_visibility(&a, &b, &[blocker(1.0, 2.0, 3.0)], 1).value, 1.0);
        assert_eq!(clipped_visibility(&a, &b, &[blocker(2.5, 0.0, 1.0)], 1).value, 1.0);
    }
}
