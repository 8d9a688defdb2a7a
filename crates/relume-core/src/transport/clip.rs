//! Shadows cut out of a polygon.
//!
//! Seen from a point, an occluder hides a cone with plane sides. What is left of a polygon after all
//! cones are cut off is a set of convex fragments. Overlapping occluders need no special care.

use glam::{DVec2, DVec3};

use super::silhouette::Silhouette;
use crate::geometry::{Interval, Plane};

/// Fragments after which what is left is taken as it is: a guard, never met with few occluders.
pub(super) const FRAGMENTS_MAX: usize = 256;

/// Distance from a line, over the target's size, below which a corner counts as on it: faces of
/// one body share their outline but for rounding, and would leave slivers.
const ON_LINE: f64 = 1e-10;

/// The part of a polygon in front of a plane, in place (Sutherland & Hodgman 1974); for polygons of
/// any number of corners. What is left is convex where the polygon was.
pub fn keep_in_front(polygon: &mut Vec<DVec3>, plane: &Plane) {
    keep_front(polygon, &mut Vec::new(), plane);
}

/// Occluders in the target's frame.
#[derive(Default)]
pub(super) struct Occluders {
    corners: Vec<DVec3>,
    list: Vec<Occluder>,
}

/// One of the [`Occluders`].
struct Occluder {
    kind: Kind,
    /// About the solid angle that it hides, seen from the middle of the looking end.
    size: f64,
}

enum Kind {
    /// Its corners, and twice its vector area.
    Polygon(std::ops::Range<usize>, DVec3),
    Solid(Silhouette),
}

impl Occluders {
    /// Adds a convex polygon; `from` is the middle of the looking end.
    pub(super) fn push(&mut self, corners: impl Iterator<Item = DVec3>, from: DVec3) {
        let start = self.corners.len();
        self.corners.extend(corners);
        let c = &self.corners[start..];
        let fan = |k: usize| (c[k] - c[0]).cross(c[k + 1] - c[0]);
        let area: DVec3 = (1..c.len() - 1).map(fan).sum();
        let away = c.iter().sum::<DVec3>() / c.len() as f64 - from;
        let r2 = away.length_squared().max(f64::MIN_POSITIVE);
        let size = area.dot(away).abs() / (r2 * r2.sqrt());
        self.list.push(Occluder { kind: Kind::Polygon(start..self.corners.len(), area), size });
    }

    /// Adds a convex solid.
    pub(super) fn push_solid(&mut self, solid: Silhouette, from: DVec3) {
        let size = solid.size(from);
        self.list.push(Occluder { kind: Kind::Solid(solid), size });
    }

    /// Sorts the occluders by the solid angle that they hide, largest first: they leave less to cut for the others.
    pub(super) fn largest_first(&mut self) {
        self.list.sort_by(|one, other| other.size.total_cmp(&one.size));
    }
}

/// Cuts away what is behind a plane (Sutherland & Hodgman 1974).
pub(super) fn keep_front(polygon: &mut Vec<DVec3>, scratch: &mut Vec<DVec3>, plane: &Plane) {
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

/// Convex polygons in the target's plane, one after the other.
#[derive(Default)]
pub(super) struct Pieces {
    corners: Vec<DVec2>,
    ends: Vec<usize>,
}

impl Pieces {
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    fn get(&self, k: usize) -> &[DVec2] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.corners[start..self.ends[k]]
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[DVec2]> {
        (0..self.len()).map(|k| self.get(k))
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

    /// Adds the side of a shadow if it crosses the target: the plane through `point` with the normal
    /// `n` into the shadow, of any length. False if the target is wholly outside.
    #[inline]
    fn add_side(&self, point: DVec3, n: DVec3, lines: &mut Vec<Line>) -> bool {
        // Only signs and ratios are used.
        let slack = self.on_line * (n.x.abs() + n.y.abs());
        let line = Line { a: n.x, b: n.y, c: -n.dot(point), slack };
        let span = self.span(&line);
        if span.hi > 0.0 && span.lo < 0.0 {
            lines.push(line);
        }
        span.hi > 0.0
    }

    /// Signed distances from a line, or of the bounds where these do not meet it.
    #[inline]
    fn span(&self, line: &Line) -> Interval {
        let at = line.a * self.middle.x + line.b * self.middle.y + line.c;
        let reach = line.a.abs() * self.half.x + line.b.abs() * self.half.y;
        if at.abs() >= reach {
            return Interval { lo: at - reach, hi: at + reach };
        }
        let sides = self.corners.iter().map(|&t| line.side(t));
        sides.fold(Interval::ZERO, |all, d| Interval { lo: d.min(all.lo), hi: d.max(all.hi) })
    }
}

/// Cuts shadows out of a polygon; its buffers serve many points.
#[derive(Default)]
pub(super) struct Cutter {
    /// Fragments left by all shadows but the last.
    pub(super) left: Pieces,
    /// It is the whole polygon.
    pub(super) is_whole: bool,
    /// The parts of it that are in the last shadow: for who adds up what is seen, that is less to do than
    /// what the last shadow leaves.
    pub(super) dark: Pieces,
    next: Pieces,
    /// The edges of shadows that cross the target.
    lines: Vec<Line>,
    /// End of each shadow's lines in `lines`.
    shadows: Vec<usize>,
    rest: Vec<DVec2>,
    inside: Vec<DVec2>,
    sides: Vec<f64>,
    /// Faces of a solid that the present point sees.
    seen: Vec<bool>,
}

impl Cutter {
    /// Leaves what is seen of `target` from `point` past the occluders.
    pub(super) fn cut(&mut self, point: DVec3, target: &[DVec2], occluders: &Occluders) {
        self.left.truncate(0);
        self.left.push(target);
        self.dark.truncate(0);
        self.is_whole = true;
        self.lines.clear();
        self.shadows.clear();
        let target = &Target::new(target);
        for occluder in &occluders.list {
            let start = self.lines.len();
            let is_met = self.cast_any(point, occluder, occluders, target);
            if !is_met {
                self.lines.truncate(start);
            } else if self.lines.len() == start {
                self.is_whole = false;
                return self.left.truncate(0);
            } else {
                self.shadows.push(self.lines.len());
            }
        }
        let Some(last) = self.shadows.len().checked_sub(1) else { return };
        for shadow in 0..last {
            if self.left.len() > FRAGMENTS_MAX {
                return;
            }
            self.cut_shadow(shadow);
        }
        if self.left.len() <= FRAGMENTS_MAX {
            (0..self.left.len()).for_each(|k| self.darken(last, k));
        }
    }

    /// Whether `target` falls into parts, by `halvings` halvings at most, each of which one occluder hides from all of
    /// the points.
    ///
    /// The points from which a convex occluder hides a convex part are a convex set: what is hidden from the
    /// corners of an end is hidden from all of it.
    pub(super) fn hides_from_all(
        &mut self,
        points: &[DVec3],
        target: &[DVec2],
        occluders: &Occluders,
        halvings: u32,
    ) -> bool {
        let bounds = Target::new(target);
        let hides = |occluder: &Occluder| {
            points.iter().all(|&point| {
                self.lines.clear();
                self.cast_any(point, occluder, occluders, &bounds) && self.lines.is_empty()
            })
        };
        if occluders.list.iter().any(hides) {
            return true;
        }
        if halvings == 0 {
            return false;
        }
        let across = if bounds.half.x > bounds.half.y { DVec2::X } else { DVec2::Y };
        let middle = bounds.middle.dot(across);
        self.sides.clear();
        self.sides.extend(target.iter().map(|p| p.dot(across) - middle));
        let (mut one, mut other) = (Vec::new(), Vec::new());
        split(target, &self.sides, &mut one, |p| other.push(p));
        [one, other].iter().all(|half| {
            half.len() < 3 || self.hides_from_all(points, half, occluders, halvings - 1)
        })
    }

    /// Finds the edges of an occluder's shadow that cross the target; false where it falls beside it.
    fn cast_any(
        &mut self,
        point: DVec3,
        occluder: &Occluder,
        all: &Occluders,
        target: &Target<'_>,
    ) -> bool {
        match &occluder.kind {
            Kind::Polygon(range, area) => {
                self.cast(point, &all.corners[range.clone()], *area, target)
            }
            Kind::Solid(solid) => self.cast_solid(point, solid, target),
        }
    }

    fn lines_of(&self, shadow: usize) -> std::ops::Range<usize> {
        let start = if shadow == 0 { 0 } else { self.shadows[shadow - 1] };
        start..self.shadows[shadow]
    }

    /// Finds the edges of an occluder's shadow that cross the target; false where it falls beside
    /// the target or the occluder is seen edge on.
    fn cast(&mut self, point: DVec3, corners: &[DVec3], area: DVec3, target: &Target<'_>) -> bool {
        let facing = area.dot(corners[0] - point);
        if facing == 0.0 {
            return false;
        }
        let sign = facing.signum();
        let mut p = corners[corners.len() - 1] - point;
        for &corner in corners {
            let q = corner - point;
            if !target.add_side(point, p.cross(q) * sign, &mut self.lines) {
                return false;
            }
            p = q;
        }
        true
    }

    /// Finds the edges of a convex solid's shadow that cross the target; false where it falls beside it.
    fn cast_solid(&mut self, point: DVec3, solid: &Silhouette, target: &Target<'_>) -> bool {
        let Cutter { lines, seen, .. } = self;
        solid.cast(point, seen, |n| target.add_side(point, n, lines))
    }

    fn cut_shadow(&mut self, shadow: usize) {
        self.next.truncate(0);
        let mut cut = false;
        for k in 0..self.left.len() {
            let before = self.next.len();
            if self.cut_piece(shadow, k) {
                cut = true;
            } else {
                // In one piece: what the lines cut off along the way belongs together.
                self.next.truncate(before);
                self.next.push(self.left.get(k));
            }
        }
        if cut {
            self.is_whole = false;
            std::mem::swap(&mut self.left, &mut self.next);
        }
    }

    /// Appends what is outside a shadow of a piece, in convex parts; false if all of it is.
    fn cut_piece(&mut self, shadow: usize, k: usize) -> bool {
        self.rest.clear();
        self.rest.extend_from_slice(self.left.get(k));
        for at in self.lines_of(shadow) {
            let sides = self.find_sides(at);
            if sides.hi <= 0.0 {
                return false;
            }
            if sides.lo < 0.0 {
                self.inside.clear();
                let outside = |p| self.next.corners.push(p);
                split(&self.rest, &self.sides, &mut self.inside, outside);
                self.next.ends.push(self.next.corners.len());
                std::mem::swap(&mut self.rest, &mut self.inside);
            }
        }
        true
    }

    /// Appends what is inside a shadow of a piece.
    fn darken(&mut self, shadow: usize, k: usize) {
        self.rest.clear();
        self.rest.extend_from_slice(self.left.get(k));
        for at in self.lines_of(shadow) {
            let sides = self.find_sides(at);
            if sides.hi <= 0.0 {
                return;
            }
            if sides.lo < 0.0 {
                self.inside.clear();
                split(&self.rest, &self.sides, &mut self.inside, |_| {});
                std::mem::swap(&mut self.rest, &mut self.inside);
            }
        }
        self.dark.push(&self.rest);
    }

    /// Finds on which side of a line the corners of the rest are; the interval of their distances and 0.
    fn find_sides(&mut self, line: usize) -> Interval {
        let line = self.lines[line];
        let mut all = Interval::ZERO;
        self.sides.clear();
        self.sides.extend(self.rest.iter().map(|&c| {
            let d = line.side(c);
            all = all.with(d);
            d
        }));
        all
    }
}

/// Splits a polygon by the line that its corners have signed distances from.
fn split(polygon: &[DVec2], sides: &[f64], front: &mut Vec<DVec2>, mut back: impl FnMut(DVec2)) {
    let last = polygon.len() - 1;
    let (mut p, mut dp) = (polygon[last], sides[last]);
    for (&q, &dq) in polygon.iter().zip(sides) {
        if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
            let x = p + (q - p) * (dp / (dp - dq));
            front.push(x);
            back(x);
        }
        if dq >= 0.0 {
            front.push(q);
        }
        if dq <= 0.0 {
            back(q);
        }
        (p, dp) = (q, dq);
    }
}
