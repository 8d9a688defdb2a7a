//! Clipping: visibility of a pair that is partly hidden, from points of the end that is the better one to look from, with its doubt.

use glam::DVec2;

use super::between::Between;
use super::cells::Cells;
use super::kernel::Simd;
use super::prepared_view::{NOTHING, PreparedView};
use super::share::Visibility;
use super::tuning::{
    CELLS_MAX, ERROR_KINKED, ERROR_SMOOTH, FACING, MOTION_RATIO, OVERLOOKED, UNSEEN, UNSEEN_KINKED,
    UNSEEN_SMOOTH,
};
use crate::element::WorldElement;
use crate::geometry::{Aabb, ConvexPolygon, Plane, no_smaller};
use crate::transport::tuning::SEEN_SLIVER;

/// A pair that is partly hidden, made ready to be clipped as seen from one of its ends: the smaller, unless
/// what blocks is very near it or more of the other is in front.
pub struct Clipping<'a> {
    observer: &'a WorldElement,
    other: &'a WorldElement,
    a_looks: bool,
    prepare_view: PreparedView,
}

/// Visibility at a first look.
#[derive(Clone, Copy, Debug)]
pub struct FirstLook {
    /// The visibility.
    pub v: Visibility,
    /// How far it may be off, about its root mean square, 1.
    pub doubt: f64,
    /// Cells along a side of the observer that it was found from.
    pub cells: u32,
}

impl<'a> Clipping<'a> {
    /// Clipping of two elements past convex occluders, all in one frame.
    pub(super) fn new(
        simd: Simd,
        (a, b): (&'a WorldElement, &'a WorldElement),
        between: &Between<'_>,
    ) -> Clipping<'a> {
        let a_looks = looks_best(a, b, between);
        let (observer, other) = if a_looks { (a, b) } else { (b, a) };
        let mut prepare_view = PreparedView::new(simd, observer, other, between);
        prepare_view.scratch.views.moments = Some(prepare_view.normal);
        Clipping { observer, other, a_looks, prepare_view }
    }

    /// Visibility, exact from 2 x 2 Gauss points in each of `cells` x `cells` parts of the observer. Each point
    /// counts as a segment.
    pub fn visibility(&mut self, cells: u32) -> Visibility {
        self.look(Cells::even(cells))
    }

    /// Visibility, exact from 2 x 2 Gauss points in each of `cells` x `cells` parts of the observer whose borders are shifted by
    /// `key`, which must depend on nothing but the pair's names: links along the edge of one shadow do not err in one sense.
    pub fn visibility_of(&mut self, key: u64, cells: u32) -> Visibility {
        self.look(Cells::shifted(cells, key))
    }

    fn look(&mut self, cells: Cells) -> Visibility {
        let Clipping { observer, other, a_looks, ref mut prepare_view } = *self;
        let sums = prepare_view.look(observer, cells);
        let value = sums.visibility();
        let over_observer =
            gradient(observer, sums.at_observer, sums.at_observer_clear, sums.all, sums.clear);
        let over_other = gradient(other, sums.at_other, sums.at_other_clear, sums.all, sums.clear);
        let (of_observer, of_other) = sums.spreads(value);
        let (gradient_a, gradient_b) =
            if a_looks { (over_observer, over_other) } else { (over_other, over_observer) };
        let (spread_a, spread_b) =
            if a_looks { (of_observer, of_other) } else { (of_other, of_observer) };
        Visibility { value, gradient_a, gradient_b, spread_a, spread_b, segments: cells.len() }
    }

    /// Whether no point sees more of the other end than slivers that rounding leaves between shadows.
    fn sees_next_to_nothing(&self) -> bool {
        self.prepare_view
            .scratch
            .views
            .points
            .iter()
            .all(|&(all, clear)| clear <= SEEN_SLIVER * all)
    }

    /// Visibility from four points, and how far it may be off.
    ///
    /// V is smooth over an end while part of the other is seen, and has kinks where that begins and ends. So
    /// four points that all see a part are nearly exact; four that see all of it, or nothing, may have
    /// overlooked something. Where all four are behind the other's plane there are more. Measured on 47,000
    /// links of three scenes (docs/exchange.md).
    ///
    /// Where all points see nothing though it is not proven that occluders hide all of the other end, there are more of
    /// them too, while what they may overlook is above `error_max`, in V.
    pub fn first_look(&mut self, error_max: f64) -> FirstLook {
        let mut v = self.visibility(1);
        let mut cells = 1;
        let mut is_hidden = None;
        while cells < CELLS_MAX && self.sees_next_to_nothing() {
            // A sliver of each in front of the other: V is not nothing because no point lies in it.
            let is_behind = self.prepare_view.scratch.views.points.iter().all(|p| p.0 <= 0.0);
            let overlooked = OVERLOOKED / f64::from(cells * cells);
            if !is_behind
                && (overlooked <= error_max
                    || *is_hidden.get_or_insert_with(|| self.prepare_view.is_hidden(self.observer)))
            {
                break;
            }
            cells *= 2;
            let again = self.visibility(cells);
            v = Visibility { segments: v.segments + again.segments, ..again };
        }
        let spread = if self.a_looks { v.spread_a } else { v.spread_b };
        let points = &self.prepare_view.scratch.views.points;
        let sees_nothing = |&(_, clear): &(f64, f64)| clear <= 0.0;
        let sees_all = |&(all, clear): &(f64, f64)| clear > 0.0 && clear >= all * (1.0 - NOTHING);
        let doubt = if points.iter().all(sees_nothing) || points.iter().all(sees_all) {
            UNSEEN
        } else if points.iter().any(|p| sees_nothing(p) || sees_all(p)) {
            (ERROR_KINKED * spread).max(UNSEEN_KINKED)
        } else {
            ERROR_SMOOTH * spread + UNSEEN_SMOOTH
        };
        FirstLook { v, doubt, cells }
    }
}

/// Whether the first end is the one to look from: the smaller, unless shadows move much more for it, or one faces
/// the other with a part only: points behind the other's plane see nothing.
///
/// As a point of an end moves over it, a shadow on the other end moves by as much, times the distance of
/// the occluder from the other by that from the end: the end is best on which that is little against
/// the size of the other. What nearly touches an end is to be looked at from the other.
fn looks_best(a: &WorldElement, b: &WorldElement, between: &Between<'_>) -> bool {
    let slack = a.rounding_m + b.rounding_m;
    let facing = |e: &WorldElement, plane: &Plane| match e.span(plane).lo >= -slack {
        true => 1.0,
        false => ConvexPolygon::part(&e.corners[..e.len], plane, slack).area() / e.area,
    };
    let (of_a, of_b) = (facing(a, &b.plane), facing(b, &a.plane));
    let alike = no_smaller(of_a, of_b) && no_smaller(of_b, of_a);
    if of_a.min(of_b) < FACING && !alike {
        return of_a > of_b;
    }
    let around = Aabb::of(between.iter().flatten().copied());
    let (by_a, by_b) =
        (a.radius * around.distance(&b.bounds), b.radius * around.distance(&a.bounds));
    match no_smaller(b.area, a.area) {
        true => by_a <= MOTION_RATIO * by_b,
        false => by_b > MOTION_RATIO * by_a,
    }
}

/// Contribution of occlusion to the relative gradient over an element: the shift of the centre of what
/// passes, against the element's second moment.
fn gradient(e: &WorldElement, at: DVec2, at_clear: DVec2, all: f64, clear: f64) -> DVec2 {
    if clear <= NOTHING * all {
        return DVec2::ZERO;
    }
    // A sliver's middle is the difference of two estimates: it is within the element all the same.
    e.gradient_of_shift((at_clear / clear - at / all).clamp_length_max(e.radius))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

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

    fn visibility(a: &WorldElement, b: &WorldElement, occluders: &[Vec<DVec3>]) -> Visibility {
        let mut polygons = Between::default();
        for occluder in occluders {
            polygons.push(occluder.iter().copied(), DVec3::Z, None);
        }
        Clipping::new(Simd::detect(), (a, b), &polygons).visibility(1)
    }

    #[test]
    fn half_of_a_small_pair_is_hidden_by_a_half_plane() {
        let (a, b) = (square(0.0, -0.01, 0.01, true), square(1.0, -0.01, 0.01, false));
        let half: Vec<DVec3> = [(0.0, -9.0), (9.0, -9.0), (9.0, 9.0), (0.0, 9.0)]
            .map(|(x, y)| DVec3::new(x, y, 0.5))
            .into();
        let v = visibility(&a, &b, &[half]);
        assert!((v.value - 0.5).abs() < 1e-3, "{v:?}");
        // Points further from the half plane see more.
        assert!(v.gradient_a.x < 0.0 && v.gradient_a.y.abs() < 1e-6, "{v:?}");
    }

    #[test]
    fn overlapping_occluders_hide_their_union() {
        let (a, b) = (square(0.0, 0.0, 1.0, true), square(2.0, 0.0, 1.0, false));
        let one = visibility(&a, &b, &[blocker(1.0, 0.2, 0.6)]).value;
        let twice = visibility(&a, &b, &[blocker(1.0, 0.2, 0.6), blocker(1.0, 0.3, 0.5)]).value;
        assert!((one - twice).abs() < 1e-12);
        let more = visibility(&a, &b, &[blocker(1.0, 0.2, 0.6), blocker(0.5, 0.3, 0.8)]);
        assert!(more.value < one - 0.01);
    }

    #[test]
    fn an_occluder_over_everything_hides_everything_and_one_beside_nothing() {
        let (a, b) = (square(0.0, 0.0, 1.0, true), square(2.0, 0.0, 1.0, false));
        assert_eq!(visibility(&a, &b, &[blocker(1.0, -9.0, 9.0)]).value, 0.0);
        assert_eq!(visibility(&a, &b, &[blocker(1.0, 2.0, 3.0)]).value, 1.0);
        assert_eq!(visibility(&a, &b, &[blocker(2.5, 0.0, 1.0)]).value, 1.0);
    }

    #[test]
    fn what_two_occluders_hide_together_is_proven_hidden_without_more_points() {
        let (a, b) = (square(0.0, -0.5, 0.5, true), square(2.0, -0.5, 0.5, false));
        // Either hides some more than half of the other end from all of this one.
        let strip = |lo: f64, hi: f64| {
            [(lo, -9.0), (hi, -9.0), (hi, 9.0), (lo, 9.0)].map(|(x, y)| DVec3::new(x, y, 1.9))
        };
        let look = |strips: [[DVec3; 4]; 2]| {
            let mut polygons = Between::default();
            strips.iter().for_each(|c| polygons.push(c.iter().copied(), DVec3::Z, None));
            Clipping::new(Simd::detect(), (&a, &b), &polygons).first_look(0.0).v
        };
        let hidden = look([strip(-9.0, 0.1), strip(-0.1, 9.0)]);
        assert_eq!((hidden.value, hidden.segments), (0.0, 4));
        // A slit that no point looks through.
        let slit = look([strip(-9.0, -1e-7), strip(1e-7, 9.0)]);
        assert!(slit.segments > 4, "{slit:?}");
    }
}
