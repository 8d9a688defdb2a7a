//! What a point sees of a polygon past others, in closed form: what each hides is cut away.
//!
//! Must not know patches or light.

use std::ops::Range;

use glam::{DMat3, DVec2, DVec3};
use relume_core::geometry::{Plane, polygon_area};
use relume_core::transport::form_factor_from_point;

/// Pieces of a polygon beyond which what is left is taken at fixed points of it.
const PIECES_MAX: usize = 25;

/// Corners of a blocker at most, so that there is room for those that it cuts into a piece.
pub(super) const CORNERS_MAX: usize = 8;

/// A convex polygon that hides what is behind it, from both sides.
#[derive(Clone, Debug)]
pub(super) struct Blocker {
    pub(super) corners: Vec<DVec3>,
    pub(super) plane: Plane,
}

/// How much of a polygon is hidden.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Hides {
    Nothing,
    Some,
    All,
}

/// Normals of the planes through the origin and each edge of a polygon, whose corners are relative to a point before it (1.0) or behind
/// it (-1.0): inwards.
fn cone(corners: impl Iterator<Item = DVec3> + Clone, side: f64) -> impl Iterator<Item = DVec3> {
    let next = corners.clone().skip(1).chain(corners.clone().take(1));
    corners.zip(next).map(move |(corner, after)| after.cross(corner) * side)
}

impl Blocker {
    /// A convex polygon as one of few corners, or several that have its area together.
    pub(super) fn parts(corners: &[DVec3]) -> impl Iterator<Item = Vec<DVec3>> {
        let step = CORNERS_MAX - 2;
        (1..corners.len().saturating_sub(1)).step_by(step).map(move |from| {
            let end = corners.len().min(from + step + 1);
            [&corners[..1], &corners[from..end]].concat()
        })
    }

    /// How much it hides of a polygon from a point, which is further than `near_m` off its plane or sees it edge on.
    pub(super) fn hides(&self, point: DVec3, target: &[DVec3], near_m: f64) -> Hides {
        let off = self.plane.distance(point);
        if off.abs() <= near_m {
            return Hides::Nothing;
        }
        let mut all = true;
        for n in cone(self.corners.iter().map(|&c| c - point), off.signum()) {
            let mut to = target.iter().map(|&c| n.dot(c - point));
            if to.clone().all(|off| off <= 0.0) {
                return Hides::Nothing;
            }
            all &= to.all(|off| off >= 0.0);
        }
        if all { Hides::All } else { Hides::Some }
    }

    /// Whether it is on the way from a point to another.
    pub(super) fn is_between(&self, point: DVec3, end: DVec3) -> bool {
        let (one, other) = (self.plane.distance(point), self.plane.distance(end));
        if one * other >= 0.0 {
            return false;
        }
        let way = end - point;
        cone(self.corners.iter().map(|&c| c - point), one.signum()).all(|n| n.dot(way) > 0.0)
    }
}

/// A blocker in the axes of a lamp, of which the third is normal to it.
pub(super) struct Screen {
    corners: Vec<DVec3>,
    plane: Plane,
    /// A ball around it.
    centre: DVec3,
    radius: f64,
}

impl Screen {
    /// The same polygon in the axes that `turn` goes over to.
    pub(super) fn new(blocker: &Blocker, turn: &DMat3) -> Screen {
        let corners: Vec<DVec3> = blocker.corners.iter().map(|&c| *turn * c).collect();
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let radius = corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max);
        let plane = Plane { normal: *turn * blocker.plane.normal, offset: blocker.plane.offset };
        Screen { corners, plane, centre, radius }
    }
}

/// A polygon as a point sees it, in axes of which the third is normal to it; the point's foot on its plane is 0.
#[derive(Default)]
struct Target {
    corners: Vec<DVec2>,
    /// Of the polygon over the point: negative, as it faces it.
    height_m: f64,
    /// Normals of the planes through the point and its edges, inwards, and their lengths.
    cone: Vec<(DVec3, f64)>,
}

impl Target {
    fn set(&mut self, point: DVec3, corners: &[DVec3]) {
        self.height_m = corners[0].z - point.z;
        self.corners.clear();
        self.corners.extend(corners.iter().map(|&c| (c - point).truncate()));
        let height_m = self.height_m;
        let corners = self.corners.iter().map(move |c| c.extend(height_m));
        self.cone.clear();
        self.cone.extend(cone(corners, 1.0).map(|n| (n, n.length())));
    }

    /// The lines along which a screen cuts the polygon, as `(a, b, c)`: `a x + b y + c` is positive behind the screen. None where it
    /// hides nothing.
    fn lines_of(&self, screen: &Screen, point: DVec3, near_m: f64, lines: &mut Vec<DVec3>) -> bool {
        let off = screen.plane.distance(point);
        let centre = screen.centre - point;
        let is_far = |&(n, length): &(DVec3, f64)| n.dot(centre) <= -screen.radius * length;
        if off.abs() <= near_m || self.cone.iter().any(is_far) {
            return false;
        }
        let corners = screen.corners.iter().map(|&c| c - point);
        if self.cone.iter().any(|(n, _)| corners.clone().all(|c| n.dot(c) <= 0.0)) {
            return false;
        }
        lines.clear();
        let line = |n: DVec3| n.with_z(n.z * self.height_m);
        lines.extend(cone(corners, off.signum()).map(line));
        let is_beside = |line: &DVec3| self.corners.iter().all(|&c| off_line(line, c) <= 0.0);
        !lines.iter().any(is_beside)
    }

    /// Form factor of a part of it.
    fn factor(&self, normal: DVec3, part: &[DVec2], in_space: &mut Vec<DVec3>) -> f64 {
        in_space.clear();
        in_space.extend(part.iter().map(|c| c.extend(self.height_m)));
        form_factor_from_point(DVec3::ZERO, normal, in_space)
    }
}

/// Where a place lies to a line: positive on one side.
#[inline]
fn off_line(line: &DVec3, at: DVec2) -> f64 {
    line.x * at.x + line.y * at.y + line.z
}

/// What is left of a polygon: convex pieces.
#[derive(Default)]
struct Pieces {
    /// Corners of all, and of such as are no more.
    corners: Vec<DVec2>,
    list: Vec<Range<usize>>,
    next: Vec<Range<usize>>,
    rest: Vec<DVec2>,
    inside: Vec<DVec2>,
}

impl Pieces {
    fn set(&mut self, whole: &[DVec2]) {
        self.corners.clear();
        self.corners.extend_from_slice(whole);
        self.list.clear();
        self.list.push(0..whole.len());
    }

    /// Takes away what is on the positive side of all lines. What is not cut is not copied.
    fn cut(&mut self, lines: &[DVec3]) {
        let Pieces { corners, list, next, rest, inside } = self;
        let is_beside = |piece: &[DVec2]| {
            lines.iter().any(|line| piece.iter().all(|&c| off_line(line, c) <= 0.0))
        };
        // Most hide nothing of what is left.
        let Some(first) = list.iter().position(|piece| !is_beside(&corners[piece.clone()])) else {
            return;
        };
        next.clear();
        next.extend_from_slice(&list[..first]);
        for piece in &list[first..] {
            if is_beside(&corners[piece.clone()]) {
                next.push(piece.clone());
                continue;
            }
            let (before, corners_before) = (next.len(), corners.len());
            rest.clear();
            rest.extend_from_slice(&corners[piece.clone()]);
            for line in lines {
                let from = corners.len();
                inside.clear();
                split(rest, line, inside, corners);
                match corners.len() - from {
                    0..3 => corners.truncate(from),
                    _ => next.push(from..corners.len()),
                }
                std::mem::swap(rest, inside);
                if rest.len() < 3 {
                    break;
                }
            }
            if rest.len() < 3 {
                next.truncate(before);
                corners.truncate(corners_before);
                next.push(piece.clone());
            }
        }
        std::mem::swap(list, next);
    }
}

/// Adds the parts of a convex polygon on both sides of a line to `inside`, the positive one, and `outside`.
fn split(polygon: &[DVec2], line: &DVec3, inside: &mut Vec<DVec2>, outside: &mut Vec<DVec2>) {
    let Some(&last) = polygon.last() else { return };
    let (mut p, mut dp) = (last, off_line(line, last));
    for &q in polygon {
        let dq = off_line(line, q);
        if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
            let x = p + (q - p) * (dp / (dp - dq));
            inside.push(x);
            outside.push(x);
        }
        if dq >= 0.0 {
            inside.push(q);
        }
        if dq <= 0.0 {
            outside.push(q);
        }
        (p, dp) = (q, dq);
    }
}

/// Points that stand for what is left, as columns: several are looked at with one instruction.
#[derive(Default)]
struct Points {
    x: Vec<f64>,
    y: Vec<f64>,
    /// The form factor that each stands for.
    share: Vec<f64>,
    /// How far within all lines.
    within: Vec<f64>,
}

impl Points {
    fn clear(&mut self) {
        [&mut self.x, &mut self.y, &mut self.share].into_iter().for_each(Vec::clear);
    }

    fn push(&mut self, at: DVec2, share: f64) {
        self.x.push(at.x);
        self.y.push(at.y);
        self.share.push(share);
    }

    /// Takes away those on the positive side of all lines.
    fn hide(&mut self, lines: &[DVec3]) {
        self.within.clear();
        self.within.resize(self.x.len(), f64::INFINITY);
        for line in lines {
            let mut any = false;
            for ((within, &x), &y) in self.within.iter_mut().zip(&self.x).zip(&self.y) {
                let off = off_line(line, DVec2::new(x, y));
                *within = if off < *within { off } else { *within };
                any |= *within > 0.0;
            }
            if !any {
                return;
            }
        }
        let mut kept = 0;
        for k in 0..self.x.len() {
            if self.within[k] <= 0.0 {
                (self.x[kept], self.y[kept]) = (self.x[k], self.y[k]);
                self.share[kept] = self.share[k];
                kept += 1;
            }
        }
        let columns = [&mut self.x, &mut self.y, &mut self.share];
        columns.into_iter().for_each(|column| column.truncate(kept));
    }
}

/// Cuts polygons; its buffers serve many points.
///
/// All that is left of a polygon lies in its plane, which a cone cuts along lines: corners are two numbers.
#[derive(Default)]
pub(super) struct Cutter {
    target: Target,
    pieces: Pieces,
    lines: Vec<DVec3>,
    in_space: Vec<DVec3>,
    points: Points,
}

impl Cutter {
    /// Form factor from a point with a unit normal to what it sees of the front of a polygon past screens: exact but for rounding, and
    /// good to some 1/200 of the whole where these cut it into very many pieces. The polygon is before the point's horizon. All are in the
    /// axes of the polygon.
    pub(super) fn factor(
        &mut self,
        (point, normal): (DVec3, DVec3),
        target: &[DVec3],
        screens: &[Screen],
        near_m: f64,
    ) -> f64 {
        self.target.set(point, target);
        self.pieces.set(&self.target.corners);
        for (k, screen) in screens.iter().enumerate() {
            if !self.target.lines_of(screen, point, near_m, &mut self.lines) {
                continue;
            }
            self.pieces.cut(&self.lines);
            if self.pieces.list.is_empty() {
                return 0.0;
            }
            if self.pieces.list.len() > PIECES_MAX {
                return self.at_points((point, normal), &screens[k..], near_m);
            }
        }
        let Cutter { target, pieces, in_space, .. } = self;
        let factor =
            |piece: &Range<usize>| target.factor(normal, &pieces.corners[piece.clone()], in_space);
        pieces.list.iter().map(factor).sum()
    }

    /// The form factor to what is left past further screens, at fixed points of the pieces.
    fn at_points(
        &mut self,
        (point, normal): (DVec3, DVec3),
        screens: &[Screen],
        near_m: f64,
    ) -> f64 {
        let Cutter { target, pieces, lines, in_space, points } = self;
        let pieces = || pieces.list.iter().map(|piece| &pieces.corners[piece.clone()]);
        let area: f64 = pieces().map(polygon_area).sum();
        let count = |piece: &[DVec2]| {
            let share = polygon_area(piece) / area.max(f64::MIN_POSITIVE);
            (f64::from(POINTS) * share).ceil() as u32
        };
        points.clear();
        for piece in pieces() {
            // Each stands for as much of the form factor as all others on its piece.
            let count = count(piece);
            let share = target.factor(normal, piece, in_space) / f64::from(count.max(1));
            (0..count).for_each(|k| points.push(in_polygon(piece, k, count), share));
        }
        for screen in screens {
            if target.lines_of(screen, point, near_m, lines) {
                points.hide(lines);
            }
        }
        let sum: f64 = points.share.iter().sum();
        sum.min(target.factor(normal, &target.corners, in_space))
    }
}

/// Points on a polygon that stand for it.
const POINTS: u32 = 128;

/// One of so many points spread over a convex polygon (Hammersley 1960).
fn in_polygon(corners: &[DVec2], k: u32, count: u32) -> DVec2 {
    let x = (f64::from(k) + 0.5) / f64::from(count);
    let y = f64::from(k.reverse_bits()) / 4_294_967_296.0;
    let fan = |i: usize| (corners[i] - corners[0]).perp_dot(corners[i + 1] - corners[0]).abs();
    let whole: f64 = (1..corners.len() - 1).map(fan).sum();
    let mut left = x * whole;
    for i in 1..corners.len() - 1 {
        let own = fan(i);
        if left <= own || i + 2 == corners.len() {
            let s = (left / own.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0).sqrt();
            let (a, b) = (corners[i] - corners[0], corners[i + 1] - corners[0]);
            return corners[0] + (a * (1.0 - y) + b * y) * s;
        }
        left -= own;
    }
    corners[0]
}
