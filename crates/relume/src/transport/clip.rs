//! Partial visibility by clipping: exact from each of a few points of one end, the looker.
//!
//! Seen from a point, an occluding polygon hides a pyramid. What is left of the other end after
//! all pyramids are cut off is a set of convex fragments, whose form factors are known in closed
//! form. Overlapping occluders need no special care.

use glam::{DVec2, DVec3};

use super::kernel::{G, Simd};
use super::point::{EdgeBundles, form_factor_from_point};
use super::visibility::Visibility;
use crate::element::WorldElement;
use crate::geometry::{Aabb, ConvexPolygon, Plane};

/// Fragments after which what is left is taken as it is: a guard, never met with few occluders.
const FRAGMENTS_MAX: usize = 256;

/// Distance from a line, over the target's size, below which a corner counts as on it: faces of
/// one body share their outline but for rounding, and would leave slivers.
const ON_LINE: f64 = 1e-10;

/// Edges whose form factors are evaluated together.
const EDGES_AT_ONCE: usize = 512;

/// Convex polygons in space, one after the other.
#[derive(Default)]
pub(super) struct Polygons {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
    /// Unit normals, and the convex solids whose faces they are.
    faces: Vec<(DVec3, Option<u32>)>,
}

impl Polygons {
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

    /// Those that hide something from an end: where it is wholly in front of one face of a solid, it is
    /// outside, and faces that it is wholly behind hide nothing that others do not.
    fn facing<'a>(
        &'a self,
        looker: &'a WorldElement,
        slack: f64,
    ) -> impl Iterator<Item = &'a [DVec3]> + 'a {
        let span = move |(corners, (normal, _)): (&[DVec3], &(DVec3, Option<u32>))| {
            looker.span(&Plane::through(corners[0], *normal))
        };
        let all = || self.iter().zip(&self.faces);
        let is_outside = move |solid: u32| {
            all().any(|(corners, face)| face.1 == Some(solid) && span((corners, face)).0 > slack)
        };
        let hides = move |(corners, face): &(&[DVec3], &(DVec3, Option<u32>))| match face.1 {
            Some(solid) => span((corners, face)).1 >= -slack || !is_outside(solid),
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
}

/// The end of a pair that the other is looked at from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looker {
    /// The smaller, unless what blocks is very near it.
    Best,
    /// The first.
    A,
    /// The second.
    B,
}

/// Visibility of `a` and `b` past convex occluders, all in one frame: from 2 x 2 Gauss points in
/// each of `cells` x `cells` parts of the looker; from its middle alone if `cells` is 0.
pub(super) fn clipped_visibility(
    simd: Simd,
    (a, b): (&WorldElement, &WorldElement),
    occluders: &Polygons,
    (looker, cells): (Looker, u32),
) -> Visibility {
    let slack = a.rounding_m + b.rounding_m;
    let a_looks = match looker {
        Looker::Best => looks_best(a, b, occluders),
        Looker::A => true,
        Looker::B => false,
    };
    let (looker, other) = if a_looks { (a, b) } else { (b, a) };
    let frame = TargetFrame::of(other);
    let facing = ConvexPolygon::new(&other.corners[..other.len]).clipped(&looker.plane, slack);
    let target = frame.flat(facing.corners());
    let between = Occluders::between(occluders.facing(looker, slack), looker, other, &frame, slack);
    let normal = frame.direction(looker.plane.normal);
    let mut looks = Looks { sums: Sums::default(), edges: EdgeBundles::default(), seen: vec![] };
    let mut cutter = Cutter::default();
    let side = (2 * cells).max(1);
    let at = |k: u32| match cells {
        0 => 0.5,
        _ => (f64::from(k / 2) + G[k as usize & 1]) / f64::from(cells),
    };
    for k in 0..side * side {
        let point = looker.point(at(k % side), at(k / side));
        if other.plane.distance(point) > 0.0 && target.len() >= 3 {
            let from = frame.place(point);
            cutter.cut(from, &target, &between);
            looks.push(from, looker.offset(point), &target, &cutter);
            if looks.edges.len() >= EDGES_AT_ONCE {
                looks.evaluate(simd, normal);
            }
        }
    }
    looks.evaluate(simd, normal);
    let sums = looks.sums;
    let over_looker = gradient(looker, sums.at_looker, sums.at_looker_clear, sums.all, sums.clear);
    let over_other = gradient(other, sums.at_other, sums.at_other_clear, sums.all, sums.clear);
    let value = if sums.all > 0.0 { (sums.clear / sums.all).clamp(0.0, 1.0) } else { 0.0 };
    let (gradient_a, gradient_b) =
        if a_looks { (over_looker, over_other) } else { (over_other, over_looker) };
    let (of_looker, of_other) = sums.spreads(value);
    let (spread_a, spread_b) = if a_looks { (of_looker, of_other) } else { (of_other, of_looker) };
    Visibility {
        value,
        gradient_a,
        gradient_b,
        spread_a,
        spread_b,
        from_a: a_looks,
        segments: side * side,
    }
}

/// How many times as much shadows move over the other end for the larger to be looked from.
const MUCH: f64 = 16.0;

/// Whether the first end is the one to look from: the smaller, unless shadows move much more for it.
///
/// As a point of an end moves over it, a shadow on the other end moves by as much, times the distance of
/// the occluder from the other by that from the end: the end is best on which that is little against
/// the size of the other. What nearly touches an end is to be looked at from the other.
fn looks_best(a: &WorldElement, b: &WorldElement, occluders: &Polygons) -> bool {
    let around = Aabb::of(occluders.iter().flatten().copied());
    let (by_a, by_b) =
        (a.radius * around.distance(&b.bounds), b.radius * around.distance(&a.bounds));
    match a.area <= b.area {
        true => by_a <= MUCH * by_b,
        false => by_b > MUCH * by_a,
    }
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
    let occluders = occluders.iter().map(ConvexPolygon::corners);
    form_factor_past(point, normal, target.corners(), occluders).factor
}

/// A form factor past occluders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorPast {
    /// Form factor from the point to what it sees.
    pub factor: f64,
    /// Exact up to rounding; else the target fell into too many pieces, and `factor` counts some
    /// of what is hidden.
    pub is_exact: bool,
}

/// [`visible_form_factor`] for any number of occluders of any number of corners.
pub fn form_factor_past<'a>(
    point: DVec3,
    normal: DVec3,
    target: &[DVec3],
    occluders: impl Iterator<Item = &'a [DVec3]>,
) -> FactorPast {
    let frame = TargetFrame::of_polygon(target);
    let from = frame.place(point);
    let mut between = Occluders::default();
    for occluder in occluders {
        between.push(occluder.iter().map(|&c| frame.place(c)), from);
    }
    between.largest_first();
    let mut cutter = Cutter::default();
    cutter.cut(from, &frame.flat(target), &between);
    let normal = frame.direction(normal);
    let mut solid = Vec::new();
    let mut factor = |piece: &[DVec2]| {
        solid.clear();
        solid.extend(piece.iter().map(|c| c.extend(0.0)));
        form_factor_from_point(from, normal, &solid)
    };
    FactorPast {
        factor: (0..cutter.left.len()).map(|k| factor(cutter.left.get(k))).sum(),
        is_exact: cutter.left.len() <= FRAGMENTS_MAX,
    }
}

/// The part of a polygon in front of a plane, in place (Sutherland & Hodgman 1974); for polygons of
/// any number of corners. What is left is convex where the polygon was.
pub fn keep_in_front(polygon: &mut Vec<DVec3>, plane: &Plane) {
    keep_front(polygon, &mut Vec::new(), plane);
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

    /// Of a planar polygon with three or more corners.
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

    /// Corners of the target within its plane.
    fn flat(&self, corners: &[DVec3]) -> Vec<DVec2> {
        corners.iter().map(|&c| self.place(c).truncate()).collect()
    }
}

/// Occluders in the target's frame.
#[derive(Default)]
struct Occluders {
    corners: Vec<DVec3>,
    list: Vec<Occluder>,
}

/// One of the [`Occluders`].
struct Occluder {
    range: std::ops::Range<usize>,
    /// Twice its vector area.
    area: DVec3,
    /// About the solid angle that it hides, seen from the middle of the looking end.
    size: f64,
}

impl Occluders {
    /// The parts of occluders in front of both ends' planes.
    fn between<'a>(
        occluders: impl Iterator<Item = &'a [DVec3]>,
        looker: &WorldElement,
        other: &WorldElement,
        frame: &TargetFrame,
        slack: f64,
    ) -> Occluders {
        let from = frame.place(looker.centre);
        let raised = |p: &Plane| Plane { normal: p.normal, offset: p.offset + slack };
        let planes = [raised(&looker.plane), raised(&other.plane)];
        let mut out = Occluders::default();
        let (mut part, mut rest) = (Vec::new(), Vec::new());
        for occluder in occluders {
            part.clear();
            part.extend_from_slice(occluder);
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

    fn push(&mut self, corners: impl Iterator<Item = DVec3>, from: DVec3) {
        let start = self.corners.len();
        self.corners.extend(corners);
        let c = &self.corners[start..];
        let fan = |k: usize| (c[k] - c[0]).cross(c[k + 1] - c[0]);
        let area: DVec3 = (1..c.len() - 1).map(fan).sum();
        let away = c.iter().sum::<DVec3>() / c.len() as f64 - from;
        let r2 = away.length_squared().max(f64::MIN_POSITIVE);
        let size = area.dot(away).abs() / (r2 * r2.sqrt());
        self.list.push(Occluder { range: start..self.corners.len(), area, size });
    }

    /// Those that hide most come first: they leave less to cut for those behind them.
    fn largest_first(&mut self) {
        self.list.sort_by(|one, other| other.size.total_cmp(&one.size));
    }
}

/// Cuts away what is behind a plane (Sutherland & Hodgman 1974).
fn keep_front(polygon: &mut Vec<DVec3>, scratch: &mut Vec<DVec3>, plane: &Plane) {
    if polygon.iter().all(|&c| plane.distance(c) >= 0.0) {
        return;
    }
    scratch.clear();
    let Some(&last) = polygon.last() else { return };
    let (mut p, mut dp) = (last, plane.distance(last));
    for &q in polygon.iter() {
        let dq = plane.distance(q);
        if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
            scratch.push(p + (q - p) * (dp / (dp - dq)));
        }
        if dq >= 0.0 {
            scratch.push(q);
        }
        (p, dp) = (q, dq);
    }
    std::mem::swap(polygon, scratch);
}

/// What points of the looker see, with form factors evaluated many edges at a time.
struct Looks {
    sums: Sums,
    edges: EdgeBundles,
    seen: Vec<Seen>,
}

/// A polygon that a point looks at.
struct Seen {
    what: What,
    /// The point, within its element.
    at: DVec2,
    /// The polygon's centroid.
    centroid: DVec2,
    /// Where its edges end in the list of edges.
    edges_end: usize,
}

#[derive(PartialEq)]
enum What {
    /// The whole target; a new point starts. All of it is clear, or pieces follow.
    Target { clear: bool },
    /// What is clear of it.
    Piece,
}

impl Looks {
    fn push(&mut self, from: DVec3, at: DVec2, target: &[DVec2], cutter: &Cutter) {
        let clear = cutter.is_clear;
        self.push_polygon(What::Target { clear }, from, at, target);
        if !clear {
            for k in 0..cutter.left.len() {
                self.push_polygon(What::Piece, from, at, cutter.left.get(k));
            }
        }
    }

    fn push_polygon(&mut self, what: What, from: DVec3, at: DVec2, c: &[DVec2]) {
        let mut p = c[c.len() - 1];
        for &q in c {
            self.edges.push(p.extend(0.0) - from, q.extend(0.0) - from);
            p = q;
        }
        let edges_end = self.edges.len();
        self.seen.push(Seen { what, at, centroid: centroid(c), edges_end });
    }

    /// Adds up what was pushed since the last call.
    fn evaluate(&mut self, simd: Simd, normal: DVec3) {
        let shares = self.edges.shares(simd, normal);
        let mut start = 0;
        let mut whole = 0.0;
        let mut clear_of_point = 0.0;
        for seen in &self.seen {
            let f = shares.form_factor(start..seen.edges_end);
            start = seen.edges_end;
            let sums = &mut self.sums;
            if let What::Target { .. } = seen.what {
                sums.finish_point(whole, clear_of_point);
                (whole, clear_of_point) = (f, 0.0);
                sums.all += f;
                sums.at_looker += seen.at * f;
                sums.at_other += seen.centroid * f;
            }
            if seen.what != (What::Target { clear: false }) {
                clear_of_point += f;
                sums.clear += f;
                sums.at_looker_clear += seen.at * f;
                sums.at_other_clear += seen.centroid * f;
            }
        }
        self.sums.finish_point(whole, clear_of_point);
        self.seen.clear();
        self.edges.clear();
    }
}

/// Form factors from the points, of all and of what is clear, with first moments on both ends.
#[derive(Default)]
struct Sums {
    all: f64,
    clear: f64,
    at_looker: DVec2,
    at_looker_clear: DVec2,
    at_other: DVec2,
    at_other_clear: DVec2,
    /// Sum over the points of their clear part squared over all.
    clear2: f64,
}

impl Sums {
    fn finish_point(&mut self, all: f64, clear: f64) {
        self.clear2 += clear * clear / all.max(f64::MIN_POSITIVE);
    }

    /// Standard deviations of visibility over the looker (between its points) and over the
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

/// What occlusion adds to the relative gradient over an element: the shift of the centre of what
/// passes, against the element's second moment.
fn gradient(e: &WorldElement, at: DVec2, at_clear: DVec2, all: f64, clear: f64) -> DVec2 {
    if clear <= 1e-12 * all {
        return DVec2::ZERO;
    }
    e.gradient_of_shift(at_clear / clear - at / all)
}

/// Convex polygons in the target's plane, one after the other.
#[derive(Default)]
struct Pieces {
    corners: Vec<DVec2>,
    ends: Vec<usize>,
}

impl Pieces {
    fn len(&self) -> usize {
        self.ends.len()
    }

    fn get(&self, k: usize) -> &[DVec2] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.corners[start..self.ends[k]]
    }

    fn push(&mut self, piece: &[DVec2]) {
        self.corners.extend_from_slice(piece);
        self.ends.push(self.corners.len());
    }

    /// Forgets all but the first `len`.
    fn truncate(&mut self, len: usize) {
        self.ends.truncate(len);
        self.corners.truncate(self.ends.last().copied().unwrap_or(0));
    }
}

/// A line in the target's plane; shade is where `a x + b y + c` is positive.
#[derive(Clone, Copy)]
struct Line {
    a: f64,
    b: f64,
    c: f64,
    /// Below this, a corner is on the line.
    slack: f64,
}

impl Line {
    #[inline]
    fn side(&self, p: DVec2) -> f64 {
        let d = self.a * p.x + self.b * p.y + self.c;
        if d.abs() <= self.slack { 0.0 } else { d }
    }
}

/// A polygon to look at, with its bounds.
struct Target<'a> {
    corners: &'a [DVec2],
    middle: DVec2,
    half: DVec2,
    /// Distance below which a corner counts as on a line.
    on_line: f64,
}

impl Target<'_> {
    fn new(corners: &[DVec2]) -> Target<'_> {
        let lo = corners.iter().copied().fold(corners[0], DVec2::min);
        let hi = corners.iter().copied().fold(corners[0], DVec2::max);
        let (middle, half) = ((lo + hi) * 0.5, (hi - lo) * 0.5);
        Target { corners, middle, half, on_line: ON_LINE * half.max_element() }
    }

    /// Smallest and largest signed distance from a line, or of the bounds where these do not meet it.
    #[inline]
    fn span(&self, line: &Line) -> (f64, f64) {
        let at = line.a * self.middle.x + line.b * self.middle.y + line.c;
        let reach = line.a.abs() * self.half.x + line.b.abs() * self.half.y;
        if at.abs() >= reach {
            return (at - reach, at + reach);
        }
        let sides = self.corners.iter().map(|&t| line.side(t));
        sides.fold((0.0, 0.0), |(low, high), d| (d.min(low), d.max(high)))
    }
}

/// Cuts shadows out of a polygon; its buffers serve many points.
#[derive(Default)]
struct Cutter {
    /// What is left.
    left: Pieces,
    /// Nothing was cut off.
    is_clear: bool,
    next: Pieces,
    /// The edges of the present shadow that cross the target.
    lines: Vec<Line>,
    rest: Vec<DVec2>,
    inside: Vec<DVec2>,
    sides: Vec<f64>,
}

impl Cutter {
    /// Leaves what is seen of `target` from `point` past the occluders.
    fn cut(&mut self, point: DVec3, target: &[DVec2], occluders: &Occluders) {
        self.left.truncate(0);
        self.left.push(target);
        self.is_clear = true;
        let target = &Target::new(target);
        for occluder in &occluders.list {
            if self.left.len() == 0 || self.left.len() > FRAGMENTS_MAX {
                return;
            }
            let corners = &occluders.corners[occluder.range.clone()];
            if !self.cast(point, corners, occluder.area, target) {
                continue;
            }
            if self.lines.is_empty() {
                self.is_clear = false;
                self.left.truncate(0);
                return;
            }
            self.cut_shadow();
        }
    }

    /// Finds the edges of an occluder's shadow that cross the target; false where it falls beside
    /// the target or the occluder is seen edge on.
    fn cast(&mut self, point: DVec3, corners: &[DVec3], area: DVec3, target: &Target<'_>) -> bool {
        let facing = area.dot(corners[0] - point);
        if facing == 0.0 {
            return false;
        }
        self.lines.clear();
        let sign = facing.signum();
        let mut p = corners[corners.len() - 1] - point;
        for &corner in corners {
            let q = corner - point;
            // The plane through the point and the edge; only signs and ratios are used.
            let n = p.cross(q) * sign;
            let slack = target.on_line * (n.x.abs() + n.y.abs());
            let line = Line { a: n.x, b: n.y, c: -n.dot(point), slack };
            let (low, high) = target.span(&line);
            if high <= 0.0 {
                return false;
            }
            if low < 0.0 {
                self.lines.push(line);
            }
            p = q;
        }
        true
    }

    fn cut_shadow(&mut self) {
        self.next.truncate(0);
        let mut cut = false;
        for k in 0..self.left.len() {
            let before = self.next.len();
            if self.cut_piece(k) {
                cut = true;
            } else {
                // In one piece: what the lines cut off along the way belongs together.
                self.next.truncate(before);
                self.next.push(self.left.get(k));
            }
        }
        if cut {
            self.is_clear = false;
            std::mem::swap(&mut self.left, &mut self.next);
        }
    }

    /// Appends what is outside the shadow of a piece, in convex parts; false if all of it is.
    fn cut_piece(&mut self, k: usize) -> bool {
        self.rest.clear();
        self.rest.extend_from_slice(self.left.get(k));
        for line in &self.lines {
            self.sides.clear();
            let (mut low, mut high) = (0.0_f64, 0.0_f64);
            for &c in &self.rest {
                let d = line.side(c);
                (low, high) = (low.min(d), high.max(d));
                self.sides.push(d);
            }
            if high <= 0.0 {
                return false;
            }
            if low < 0.0 {
                self.inside.clear();
                split(&self.rest, &self.sides, &mut self.inside, &mut self.next.corners);
                self.next.ends.push(self.next.corners.len());
                std::mem::swap(&mut self.rest, &mut self.inside);
            }
        }
        true
    }
}

/// Splits a polygon by the line that its corners have signed distances from.
fn split(polygon: &[DVec2], sides: &[f64], front: &mut Vec<DVec2>, back: &mut Vec<DVec2>) {
    let last = polygon.len() - 1;
    let (mut p, mut dp) = (polygon[last], sides[last]);
    for (&q, &dq) in polygon.iter().zip(sides) {
        if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
            let x = p + (q - p) * (dp / (dp - dq));
            front.push(x);
            back.push(x);
        }
        if dq >= 0.0 {
            front.push(q);
        }
        if dq <= 0.0 {
            back.push(q);
        }
        (p, dp) = (q, dq);
    }
}

fn centroid(c: &[DVec2]) -> DVec2 {
    let (mut sum, mut area) = (DVec2::ZERO, 0.0);
    for k in 1..c.len() - 1 {
        let twice = (c[k] - c[0]).perp_dot(c[k + 1] - c[0]);
        sum += (c[0] + c[k] + c[k + 1]) * (twice / 3.0);
        area += twice;
    }
    if area != 0.0 { sum / area } else { c[0] }
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
        let mut polygons = Polygons::default();
        for occluder in occluders {
            polygons.push(occluder.iter().copied(), DVec3::Z, None);
        }
        clipped_visibility(Simd::detect(), (a, b), &polygons, (Looker::Best, 1))
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
}
