//! View from points of one end of a pair to the other end, past occluders: exact from each point.
//!
//! The part of a polygon that a point sees is a set of convex fragments ([`super::clip`]), whose form factors
//! are known in closed form. What does not depend on the point is made ready once for many.

use std::cell::Cell;

use glam::{DVec2, DVec3};

use super::clip::{Cutter, FRAGMENTS_MAX, Occluders, keep_front};
use super::kernel::{G, Simd};
use super::point::{EdgeBundles, form_factor_from_point};
use super::share::Visibility;
use super::silhouette::Silhouette;
use super::tuning::{
    CELLS_MAX, ERROR_KINKED, ERROR_SMOOTH, FACING, HALVINGS, MOTION_RATIO, OVERLOOKED, UNSEEN,
    UNSEEN_KINKED, UNSEEN_SMOOTH,
};
use crate::element::WorldElement;
use crate::geometry::{Aabb, ConvexPolygon, Plane, Pose, no_smaller};
use crate::scene::Solid;
use crate::transport::tuning::{DRAWN_IN, SEEN_SLIVER};

/// Share of a form factor below which what is left of it is rounding.
const NOTHING: f64 = 1e-12;

/// Edges whose form factors are evaluated together.
const EDGES_AT_ONCE: usize = 512;

/// Blockers between two ends, in one frame: convex polygons, and solids that some of them are faces of.
#[derive(Default)]
pub(super) struct Between<'a> {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
    /// Unit normals, and the convex solids whose faces they are.
    faces: Vec<(DVec3, Option<u32>)>,
    solids: Vec<PlacedSolid<'a>>,
}

/// A solid, and its way into the frame.
pub(super) struct PlacedSolid<'a> {
    pub(super) number: u32,
    pub(super) solid: &'a Solid,
    pub(super) pose: Pose,
}

impl<'a> Between<'a> {
    /// Adds a polygon with its unit normal and the convex solid whose face it is.
    pub(super) fn push(
        &mut self,
        corners: impl Iterator<Item = DVec3>,
        normal: DVec3,
        solid: Option<u32>,
    ) {
        self.corners.extend(corners);
        self.ends.push(self.corners.len());
        self.faces.push((normal, solid));
    }

    /// Adds a solid, two or more of whose faces were or will be pushed: its silhouette may replace them.
    pub(super) fn push_solid(&mut self, solid: PlacedSolid<'a>) {
        self.solids.push(solid);
    }

    /// Those that hide something from an end: where it is wholly in front of one face of a solid, it is
    /// outside, and faces that it is wholly behind hide nothing that others do not. `without` the faces of some solids.
    fn facing<'b>(
        &'b self,
        observer: &'b WorldElement,
        slack: f64,
        without: &'b [u32],
    ) -> impl Iterator<Item = &'b [DVec3]> + 'b {
        let span = move |(corners, (normal, _)): (&[DVec3], &(DVec3, Option<u32>))| {
            observer.span(&Plane::through(corners[0], *normal))
        };
        let all = || self.iter().zip(&self.faces);
        let is_outside = move |solid: u32| {
            all().any(|(corners, face)| face.1 == Some(solid) && span((corners, face)).lo > slack)
        };
        let hides = move |(corners, face): &(&[DVec3], &(DVec3, Option<u32>))| match face.1 {
            Some(solid) if without.contains(&solid) => false,
            Some(solid) => span((corners, face)).hi >= -slack || !is_outside(solid),
            None => true,
        };
        all().filter(hides).map(|(corners, _)| corners)
    }

    fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        (0..self.ends.len()).map(|k| {
            let start = if k == 0 { 0 } else { self.ends[k - 1] };
            &self.corners[start..self.ends[k]]
        })
    }

    /// As they are seen from points of the observer's plane: parts in front of both ends' planes, in the
    /// other's frame.
    fn seen(
        &self,
        observer: &WorldElement,
        other: &WorldElement,
        frame: &TargetFrame,
        slack: f64,
    ) -> Occluders {
        let from = frame.place(observer.centre);
        let raised = |p: &Plane| Plane { normal: p.normal, offset: p.offset + slack };
        let planes = [raised(&observer.plane), raised(&other.plane)];
        let mut out = Occluders::default();
        let mut whole = Vec::new();
        // The near plane in the frame.
        let up = frame.direction(observer.plane.normal);
        let is_low = |c: DVec3| up.dot(c - from) <= slack;
        let [a, b, c, d] = &observer.corners;
        let corners = [frame.place(*a), frame.place(*b), frame.place(*c), frame.place(*d)];
        for PlacedSolid { number, solid, pose } in &self.solids {
            // What reaches behind the other's plane hides less than its silhouette.
            if solid.corners.iter().all(|&c| other.plane.distance(pose.point(c)) >= -slack) {
                let place = |c: DVec3| frame.place(pose.point(c));
                let turn = |d: DVec3| frame.direction(pose.direction(d));
                let silhouette = Silhouette::new(solid, (place, turn), &corners, is_low);
                out.push_solid(silhouette, from);
                whole.push(*number);
            }
        }
        let (mut part, mut rest) = (Vec::new(), Vec::new());
        for corners in self.facing(observer, slack, &whole) {
            part.clear();
            part.extend_from_slice(corners);
            for plane in &planes {
                keep_front(&mut part, &mut rest, plane);
            }
            if part.len() >= 3 {
                out.push(part.iter().map(|&c| frame.place(c)), from);
            }
        }
        out.largest_first();
        out
    }
}

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
    normal: DVec3,
    scratch: Scratch,
}

/// Buffers of a view: made once a thread, since most views are used for a few points only.
#[derive(Default)]
struct Scratch {
    cutter: Cutter,
    views: PointViews,
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
        self.look(part, cells).visibility()
    }

    /// Visibility of the other from the middle of each of some parts of the observer, in [0, 1]; 0 where a
    /// middle does not face the other.
    pub fn from_middles<'a>(&mut self, parts: impl Iterator<Item = &'a WorldElement>) -> Vec<f64> {
        self.scratch.views.start();
        parts.for_each(|part| self.look_from(part, part.point(0.5, 0.5)));
        self.scratch.views.evaluate(self.simd, self.normal);
        let share = |&(all, clear): &(f64, f64)| if all > 0.0 { clear / all } else { 0.0 };
        self.scratch.views.points.iter().map(|point| share(point).clamp(0.0, 1.0)).collect()
    }

    /// Whether the other end, in parts of each of which one occluder hides all, is hidden from all of the observer, its
    /// rim aside.
    fn is_hidden(&mut self, observer: &WorldElement) -> bool {
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

    fn look(&mut self, part: &WorldElement, cells: u32) -> &Sums {
        self.scratch.views.start();
        let at = |k: u32| (f64::from(k / 2) + G[k as usize & 1]) / f64::from(cells);
        for k in 0..4 * cells * cells {
            self.look_from(part, part.point(at(k % (2 * cells)), at(k / (2 * cells))));
        }
        self.scratch.views.evaluate(self.simd, self.normal);
        &self.scratch.views.sums
    }

    fn look_from(&mut self, part: &WorldElement, point: DVec3) {
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

/// A pair that is partly hidden, made ready to be clipped as seen from one of its ends: the smaller, unless
/// what blocks is very near it or more of the other is in front.
pub struct Clipping<'a> {
    observer: &'a WorldElement,
    other: &'a WorldElement,
    a_looks: bool,
    prepare_view: PreparedView,
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
        Visibility {
            value,
            gradient_a,
            gradient_b,
            spread_a,
            spread_b,
            segments: 4 * cells * cells,
        }
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

    /// Visibility from four points, and how far it may be off: about its root mean square.
    ///
    /// V is smooth over an end while part of the other is seen, and has kinks where that begins and ends. So
    /// four points that all see a part are nearly exact; four that see all of it, or nothing, may have
    /// overlooked something. Where all four are behind the other's plane there are more. Measured on 47,000
    /// links of three scenes (docs/exchange.md).
    ///
    /// Where all points see nothing though it is not proven that occluders hide all of the other end, there are more of
    /// them too, while what they may overlook is above `error_max`, in V.
    pub fn first_look(&mut self, error_max: f64) -> (Visibility, f64) {
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
        (v, doubt)
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

/// Share of a polygon below which what is left of it is a gap between shadows that rounding made.
const HIDDEN: f64 = 1e-8;

fn twice_area(c: &[DVec2]) -> f64 {
    let fan = |k: usize| (c[k] - c[0]).perp_dot(c[k + 1] - c[0]);
    (1..c.len().saturating_sub(1)).map(fan).sum::<f64>().abs()
}

/// The frame of a target: the first two axes in its plane, the third towards its front.
struct TargetFrame {
    origin: DVec3,
    axes: [DVec3; 3],
}

impl TargetFrame {
    fn of(e: &WorldElement) -> TargetFrame {
        TargetFrame { origin: e.centre, axes: [e.axes[0], e.axes[1], e.plane.normal] }
    }

    /// Frame of a planar polygon with three or more corners.
    fn of_polygon(c: &[DVec3]) -> TargetFrame {
        let fan = |k: usize| (c[k] - c[0]).cross(c[k + 1] - c[0]);
        let up = (1..c.len() - 1).map(fan).sum::<DVec3>().normalize_or_zero();
        let along = (c[1] - c[0]).normalize_or_zero();
        TargetFrame { origin: c[0], axes: [along, up.cross(along), up] }
    }

    fn direction(&self, d: DVec3) -> DVec3 {
        DVec3::new(d.dot(self.axes[0]), d.dot(self.axes[1]), d.dot(self.axes[2]))
    }

    fn place(&self, p: DVec3) -> DVec3 {
        self.direction(p - self.origin)
    }

    /// A point of the target's plane.
    fn point(&self, p: DVec2) -> DVec3 {
        self.origin + self.axes[0] * p.x + self.axes[1] * p.y
    }

    /// Corners of the target within its plane.
    fn flat(&self, corners: &[DVec3]) -> Vec<DVec2> {
        corners.iter().map(|&c| self.place(c).truncate()).collect()
    }
}

/// Views from points of the observer, with form factors evaluated many edges at a time.
#[derive(Default)]
struct PointViews {
    sums: Sums,
    /// Form factors from each point, of the target and of what is clear of it.
    points: Vec<(f64, f64)>,
    /// If first moments are wanted, the observer's normal.
    moments: Option<DVec3>,
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
            let sums = &mut self.sums;
            if let What::Target { .. } = seen.what {
                self.points.push((f, 0.0));
                sums.all += f;
                if self.moments.is_some() {
                    sums.at_observer += seen.at * f;
                    sums.at_other += seen.middle * f;
                }
            }
            let clear = match seen.what {
                What::Target { clear: true } | What::Clear => f,
                What::Target { clear: false } => continue,
                What::Dark => -f,
            };
            self.points.last_mut().expect("a target comes first").1 += clear;
            if self.moments.is_some() {
                sums.at_observer_clear += seen.at * clear;
                sums.at_other_clear += seen.middle * clear;
            }
        }
        for (all, clear) in &mut self.points[first..] {
            // What is hidden by several is taken off in several parts.
            if *clear <= NOTHING * *all {
                *clear = 0.0;
            }
            self.sums.finish_point(*all, *clear);
        }
        self.seen.clear();
        self.edges.clear();
    }
}

/// Form factors from the points, of all and of what is clear, with first moments on both ends.
#[derive(Default)]
struct Sums {
    all: f64,
    clear: f64,
    at_observer: DVec2,
    at_observer_clear: DVec2,
    at_other: DVec2,
    at_other_clear: DVec2,
    /// Sum over the points of their clear part squared over all.
    clear2: f64,
}

impl Sums {
    fn finish_point(&mut self, all: f64, clear: f64) {
        self.clear += clear;
        self.clear2 += clear * clear / all.max(f64::MIN_POSITIVE);
    }

    /// The clear part of all.
    fn visibility(&self) -> f64 {
        if self.all > 0.0 { (self.clear / self.all).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Standard deviations of visibility over the observer (between its points) and over the
    /// other end (within what each point sees: there it is 0 or 1).
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

/// Contribution of occlusion to the relative gradient over an element: the shift of the centre of what
/// passes, against the element's second moment.
fn gradient(e: &WorldElement, at: DVec2, at_clear: DVec2, all: f64, clear: f64) -> DVec2 {
    if clear <= NOTHING * all {
        return DVec2::ZERO;
    }
    // A sliver's middle is the difference of two estimates: it is within the element all the same.
    e.gradient_of_shift((at_clear / clear - at / all).clamp_length_max(e.radius))
}

/// The middle of what a polygon sends to a point with a normal: of its triangles, each with the kernel at its
/// middle.
fn middle_of_sent(c: &[DVec2], from: DVec3, normal: DVec3) -> DVec2 {
    let (mut sum, mut weight) = (DVec2::ZERO, 0.0);
    for k in 1..c.len() - 1 {
        let twice = (c[k] - c[0]).perp_dot(c[k + 1] - c[0]);
        let middle = (c[0] + c[k] + c[k + 1]) / 3.0;
        let way = middle.extend(0.0) - from;
        let r2 = way.length_squared();
        let sent = twice * normal.dot(way).max(0.0) / (r2 * r2);
        sum += middle * sent;
        weight += sent;
    }
    if weight != 0.0 { sum / weight } else { c[0] }
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
            Clipping::new(Simd::detect(), (&a, &b), &polygons).first_look(0.0).0
        };
        let hidden = look([strip(-9.0, 0.1), strip(-0.1, 9.0)]);
        assert_eq!((hidden.value, hidden.segments), (0.0, 4));
        // A slit that no point looks through.
        let slit = look([strip(-9.0, -1e-7), strip(1e-7, 9.0)]);
        assert!(slit.segments > 4, "{slit:?}");
    }
}
