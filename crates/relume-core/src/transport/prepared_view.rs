//! View from points of one end of a pair to the other end, past occluders: exact from each point.
//!
//! The part of a polygon that a point sees is a set of convex fragments ([`super::clip`]), whose form factors
//! are known in closed form. What does not depend on the point is made ready once for many.

use std::cell::Cell;

use glam::{DVec2, DVec3};

use super::between::Between;
use super::cells::Cells;
use super::clip::{Cutter, Occluders};
use super::kernel::Simd;
use super::point::{EdgeBundles, middle_of_sent};
use super::target_frame::TargetFrame;
use super::tuning::HALVINGS;
use crate::element::WorldElement;
use crate::geometry::{ConvexPolygon, Plane};
use crate::transport::tuning::DRAWN_IN;

/// Share of a form factor below which what is left of it is rounding.
pub(super) const NOTHING: f64 = 1e-12;

/// Edges whose form factors are evaluated together.
const EDGES_AT_ONCE: usize = 512;

/// View from one end of a pair, the observer, to the other end: data that does not depend on the point.
pub struct PreparedView {
    simd: Simd,
    frame: TargetFrame,
    /// The other's plane.
    other: Plane,
    /// The part of the other that faces the observer's plane.
    target: Vec<DVec2>,
    between: Occluders,
    /// The observer's, in the frame.
    pub(super) normal: DVec3,
    pub(super) scratch: Scratch,
}

/// Buffers of a view: made once a thread, since most views are used for a few points only.
#[derive(Default)]
pub(super) struct Scratch {
    cutter: Cutter,
    pub(super) views: PointViews,
}

thread_local! {
    static SCRATCH: Cell<Scratch> = Cell::default();
}

impl Drop for PreparedView {
    fn drop(&mut self) {
        SCRATCH.set(std::mem::take(&mut self.scratch));
    }
}

impl PreparedView {
    pub(super) fn new(
        simd: Simd,
        observer: &WorldElement,
        other: &WorldElement,
        between: &Between<'_>,
    ) -> PreparedView {
        let slack = observer.rounding_m + other.rounding_m;
        let frame = TargetFrame::of(other);
        let facing = ConvexPolygon::part(&other.corners[..other.len], &observer.plane, slack);
        let scratch = SCRATCH.take();
        PreparedView {
            simd,
            other: other.plane,
            target: frame.flat(facing.corners()),
            between: between.seen(observer, other, &frame, slack),
            normal: frame.direction(observer.plane.normal),
            frame,
            scratch: Scratch { views: PointViews { moments: None, ..scratch.views }, ..scratch },
        }
    }

    /// Visibility of the other from a part of the observer, in [0, 1]: from 2 x 2 Gauss points in each of
    /// `cells` x `cells` parts of that.
    ///
    /// Error: exact from each point; over the part it falls with the square of `cells`, as V has kinks.
    pub fn visibility(&mut self, part: &WorldElement, cells: u32) -> f64 {
        self.look(part, Cells::even(cells)).visibility()
    }

    /// Visibility of the other from the middle of each of some parts of the observer, in [0, 1]; 0 where a
    /// middle does not face the other.
    pub fn from_middles<'a>(&mut self, parts: impl Iterator<Item = &'a WorldElement>) -> Vec<f64> {
        self.scratch.views.start();
        parts.for_each(|part| self.look_from(part, part.point(0.5, 0.5), 1.0));
        self.scratch.views.evaluate(self.simd, self.normal);
        let share = |&(all, clear): &(f64, f64)| if all > 0.0 { clear / all } else { 0.0 };
        self.scratch.views.points.iter().map(|point| share(point).clamp(0.0, 1.0)).collect()
    }

    /// Whether the other end, in parts of each of which one occluder hides all, is hidden from all of the observer, its
    /// rim aside.
    pub(super) fn is_hidden(&mut self, observer: &WorldElement) -> bool {
        let corners = ConvexPolygon::part(&observer.corners[..observer.len], &self.other, 0.0);
        let corners = corners.corners();
        if corners.len() < 3 || self.target.len() < 3 {
            return false;
        }
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let drawn_in = |&c: &DVec3| self.frame.place(c.lerp(middle, DRAWN_IN));
        let points: Vec<DVec3> = corners.iter().map(drawn_in).collect();
        self.scratch.cutter.hides_from_all(&points, &self.target, &self.between, HALVINGS)
    }

    pub(super) fn look(&mut self, part: &WorldElement, cells: Cells) -> &Sums {
        self.scratch.views.start();
        for ([s, t], weight) in cells.points() {
            self.look_from(part, part.point(s, t), weight);
        }
        self.scratch.views.evaluate(self.simd, self.normal);
        &self.scratch.views.sums
    }

    /// Looks from a point that counts `weight` times in sums.
    fn look_from(&mut self, part: &WorldElement, point: DVec3, weight: f64) {
        self.scratch.views.weights.push(weight);
        if self.other.distance(point) > 0.0 && self.target.len() >= 3 {
            let from = self.frame.place(point);
            self.scratch.cutter.cut(from, &self.target, &self.between);
            let at =
                if self.scratch.views.moments.is_some() { part.offset(point) } else { DVec2::ZERO };
            self.scratch.views.push(from, at, &self.target, &self.scratch.cutter);
        } else {
            self.scratch.views.push_nothing();
        }
        if self.scratch.views.edges.len() >= EDGES_AT_ONCE {
            self.scratch.views.evaluate(self.simd, self.normal);
        }
    }
}

/// Views from points of the observer, with form factors evaluated many edges at a time.
#[derive(Default)]
pub(super) struct PointViews {
    sums: Sums,
    /// Form factors from each point, of the target and of what is clear of it.
    pub(super) points: Vec<(f64, f64)>,
    /// How much each point counts in the sums, 1.
    weights: Vec<f64>,
    /// If first moments are wanted, the observer's normal.
    pub(super) moments: Option<DVec3>,
    edges: EdgeBundles,
    seen: Vec<Seen>,
}

/// A polygon that a point looks at.
struct Seen {
    what: What,
    /// The point, within its element.
    at: DVec2,
    /// The middle of what the polygon sends.
    middle: DVec2,
    /// End of its edges in the list of edges.
    edges_end: usize,
}

#[derive(PartialEq)]
enum What {
    /// The whole target; a new point starts. All of it is clear, or pieces that are follow.
    Target { clear: bool },
    /// A piece that is clear.
    Clear,
    /// A part of what is clear that is not.
    Dark,
}

impl PointViews {
    fn start(&mut self) {
        self.sums = Sums::default();
        self.points.clear();
        self.weights.clear();
        self.edges.clear();
        self.seen.clear();
    }

    /// For a point that does not see the target's plane.
    fn push_nothing(&mut self) {
        let edges_end = self.edges.len();
        let what = What::Target { clear: true };
        self.seen.push(Seen { what, at: DVec2::ZERO, middle: DVec2::ZERO, edges_end });
    }

    fn push(&mut self, from: DVec3, at: DVec2, target: &[DVec2], cutter: &Cutter) {
        self.push_polygon(What::Target { clear: cutter.is_whole }, from, at, target);
        if !cutter.is_whole {
            cutter.left.iter().for_each(|c| self.push_polygon(What::Clear, from, at, c));
        }
        cutter.dark.iter().for_each(|c| self.push_polygon(What::Dark, from, at, c));
    }

    fn push_polygon(&mut self, what: What, from: DVec3, at: DVec2, c: &[DVec2]) {
        let mut p = c[c.len() - 1];
        for &q in c {
            self.edges.push(p.extend(0.0) - from, q.extend(0.0) - from);
            p = q;
        }
        let edges_end = self.edges.len();
        let middle = self.moments.map_or(DVec2::ZERO, |normal| middle_of_sent(c, from, normal));
        self.seen.push(Seen { what, at, middle, edges_end });
    }

    /// Adds up what was pushed since the last call.
    fn evaluate(&mut self, simd: Simd, normal: DVec3) {
        let shares = self.edges.shares(simd, normal);
        let mut start = 0;
        let first = self.points.len();
        for seen in &self.seen {
            let f = shares.form_factor(start..seen.edges_end);
            start = seen.edges_end;
            let is_target = matches!(seen.what, What::Target { .. });
            if is_target {
                self.points.push((f, 0.0));
            }
            let counts = self.weights[self.points.len() - 1] * f;
            let sums = &mut self.sums;
            if is_target {
                sums.all += counts;
                if self.moments.is_some() {
                    sums.at_observer += seen.at * counts;
                    sums.at_other += seen.middle * counts;
                }
            }
            let sign = match seen.what {
                What::Target { clear: true } | What::Clear => 1.0,
                What::Target { clear: false } => continue,
                What::Dark => -1.0,
            };
            self.points.last_mut().expect("a target comes first").1 += sign * f;
            if self.moments.is_some() {
                sums.at_observer_clear += seen.at * (sign * counts);
                sums.at_other_clear += seen.middle * (sign * counts);
            }
        }
        for ((all, clear), weight) in self.points[first..].iter_mut().zip(&self.weights[first..]) {
            // What is hidden by several is taken off in several parts.
            if *clear <= NOTHING * *all {
                *clear = 0.0;
            }
            self.sums.finish_point(weight * *all, weight * *clear);
        }
        self.seen.clear();
        self.edges.clear();
    }
}

/// Form factors from the points, of all and of what is clear, with first moments on both ends.
#[derive(Default)]
pub(super) struct Sums {
    pub(super) all: f64,
    pub(super) clear: f64,
    pub(super) at_observer: DVec2,
    pub(super) at_observer_clear: DVec2,
    pub(super) at_other: DVec2,
    pub(super) at_other_clear: DVec2,
    /// Sum over the points of their clear part squared over all.
    clear2: f64,
}

impl Sums {
    fn finish_point(&mut self, all: f64, clear: f64) {
        self.clear += clear;
        self.clear2 += clear * clear / all.max(f64::MIN_POSITIVE);
    }

    /// The clear part of all.
    pub(super) fn visibility(&self) -> f64 {
        if self.all > 0.0 { (self.clear / self.all).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Standard deviations of visibility over the observer (between its points) and over the
    /// other end (within what each point sees: there it is 0 or 1).
    pub(super) fn spreads(&self, value: f64) -> (f64, f64) {
        if self.all <= 0.0 {
            return (0.0, 0.0);
        }
        let mean_square = self.clear2 / self.all;
        let between = (mean_square - value * value).max(0.0).sqrt();
        let within = (value - mean_square).max(0.0).sqrt();
        (between, within)
    }
}
