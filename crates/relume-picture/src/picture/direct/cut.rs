//! What a point sees of a polygon past others, in closed form: what each hides is cut away.
//!
//! Must not know patches or light.

use glam::DVec3;
use relume_core::geometry::{ConvexPolygon, Plane};
use relume_core::transport::form_factor_from_point;

/// Pieces of a polygon, more than it begins with, beyond which what is left is taken at fixed points of it.
const PIECES_MAX: usize = 24;

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

/// Planes through the origin.
struct Cone {
    inward: [DVec3; ConvexPolygon::CAPACITY],
    len: usize,
}

impl Cone {
    /// Of a polygon whose corners are relative to the point, which is before it (1.0) or behind it (-1.0).
    fn new(corners: impl Iterator<Item = DVec3> + Clone, side: f64) -> Cone {
        let mut cone = Cone { inward: [DVec3::ZERO; ConvexPolygon::CAPACITY], len: 0 };
        let mut next = corners.clone().skip(1).chain(corners.clone().take(1));
        for corner in corners.take(ConvexPolygon::CAPACITY) {
            let Some(after) = next.next() else { break };
            cone.inward[cone.len] = after.cross(corner) * side;
            cone.len += 1;
        }
        cone
    }

    fn planes(&self) -> &[DVec3] {
        &self.inward[..self.len]
    }

    /// Whether a plane has all corners outside.
    fn is_beside(&self, mut corners: impl Iterator<Item = DVec3> + Clone) -> bool {
        let corners = corners.by_ref();
        self.planes().iter().any(|n| corners.clone().all(|c| n.dot(c) <= 0.0))
    }
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
        let cone = Cone::new(self.corners.iter().map(|&c| c - point), off.signum());
        let to = target.iter().map(|&c| c - point);
        if cone.is_beside(to.clone()) {
            return Hides::Nothing;
        }
        let within = cone.planes().iter().all(|n| to.clone().all(|c| n.dot(c) >= 0.0));
        if within { Hides::All } else { Hides::Some }
    }

    /// Whether it is on the way from a point to another.
    pub(super) fn is_between(&self, point: DVec3, end: DVec3) -> bool {
        let (one, other) = (self.plane.distance(point), self.plane.distance(end));
        if one * other >= 0.0 {
            return false;
        }
        let way = end - point;
        let cone = Cone::new(self.corners.iter().map(|&c| c - point), one.signum());
        cone.planes().iter().all(|n| n.dot(way) > 0.0)
    }
}

/// Cuts polygons; its buffers serve many points.
#[derive(Default)]
pub(super) struct Cutter {
    whole: Vec<DVec3>,
    pieces: Vec<ConvexPolygon>,
    next: Vec<ConvexPolygon>,
    parts: Vec<ConvexPolygon>,
}

impl Cutter {
    /// Form factor from a point with a unit normal to what it sees of the front of a polygon past blockers: exact but for rounding, and
    /// good to some 1/200 of the whole where these cut it into very many pieces. The polygon is before the point's horizon.
    pub(super) fn factor(
        &mut self,
        (point, normal): (DVec3, DVec3),
        target: &[DVec3],
        blockers: &[Blocker],
        near_m: f64,
    ) -> f64 {
        self.whole.clear();
        self.whole.extend(target.iter().map(|&corner| corner - point));
        let seen = Cone::new(self.whole.iter().copied(), 1.0);
        self.pieces.clear();
        // A sun has more corners than there is room for.
        push_parts(&self.whole, ConvexPolygon::START_MAX, &mut self.pieces);
        let pieces_max = PIECES_MAX + self.pieces.len();
        for (k, blocker) in blockers.iter().enumerate() {
            let off = blocker.plane.distance(point);
            if off.abs() <= near_m {
                continue;
            }
            let corners = blocker.corners.iter().map(|&c| c - point);
            if seen.is_beside(corners.clone()) {
                continue;
            }
            self.cut(&Cone::new(corners, off.signum()));
            if self.pieces.is_empty() {
                return 0.0;
            }
            if self.pieces.len() > pieces_max {
                let left = (point, &blockers[k..]);
                return at_points(normal, &self.whole, left, near_m, &self.pieces);
            }
        }
        let factor =
            |piece: &ConvexPolygon| form_factor_from_point(DVec3::ZERO, normal, piece.corners());
        self.pieces.iter().map(factor).sum()
    }

    /// Takes away what is in a cone.
    fn cut(&mut self, cone: &Cone) {
        let is_beside = |piece: &ConvexPolygon| cone.is_beside(piece.corners().iter().copied());
        // Most hide nothing of what is left.
        if self.pieces.iter().all(is_beside) {
            return;
        }
        self.next.clear();
        let room = ConvexPolygon::CAPACITY.saturating_sub(cone.planes().len()).max(3);
        let mut k = 0;
        while k < self.pieces.len() {
            let piece = self.pieces[k];
            k += 1;
            if is_beside(&piece) {
                self.next.push(piece);
                continue;
            }
            if piece.corners().len() > room {
                // Each plane may add a corner.
                push_parts(piece.corners(), room, &mut self.pieces);
                continue;
            }
            self.parts.clear();
            let mut rest = piece;
            for &normal in cone.planes() {
                let [inside, outside] = rest.split(&Plane { normal, offset: 0.0 });
                if outside.corners().len() >= 3 {
                    self.parts.push(outside);
                }
                rest = inside;
                if rest.corners().len() < 3 {
                    break;
                }
            }
            match rest.corners().len() {
                0..3 => self.next.push(piece),
                _ => self.next.append(&mut self.parts),
            }
        }
        std::mem::swap(&mut self.pieces, &mut self.next);
    }
}

/// A convex polygon as several of at most so many corners.
fn push_parts(corners: &[DVec3], corners_max: usize, out: &mut Vec<ConvexPolygon>) {
    if corners.len() <= corners_max {
        out.push(ConvexPolygon::new(corners));
        return;
    }
    let half = corners.len() / 2;
    push_parts(&corners[..=half], corners_max, out);
    push_parts(&[&corners[half..], &corners[..1]].concat(), corners_max, out);
}

/// Points on a polygon that stand for it.
const POINTS: u32 = 128;

/// The form factor to what is left of a polygon past further blockers, at fixed points of its pieces.
fn at_points(
    normal: DVec3,
    whole: &[DVec3],
    (point, blockers): (DVec3, &[Blocker]),
    near_m: f64,
    pieces: &[ConvexPolygon],
) -> f64 {
    let target = Cone::new(whole.iter().copied(), 1.0);
    let cones: Vec<Cone> = blockers
        .iter()
        .filter_map(|blocker| {
            let off = blocker.plane.distance(point);
            let corners = blocker.corners.iter().map(|&c| c - point);
            let counts = off.abs() > near_m && !target.is_beside(corners.clone());
            counts.then(|| Cone::new(corners, off.signum()))
        })
        .collect();
    let is_seen = |at: DVec3| {
        let hides = |cone: &Cone| cone.planes().iter().all(|n| n.dot(at) > 0.0);
        !cones.iter().any(hides)
    };
    let all = form_factor_from_point(DVec3::ZERO, normal, whole);
    let area: f64 = pieces.iter().map(ConvexPolygon::area).sum();
    let mut sum = 0.0;
    for piece in pieces {
        let count = (f64::from(POINTS) * piece.area() / area.max(f64::MIN_POSITIVE)).ceil() as u32;
        let seen = (0..count).filter(|&k| is_seen(in_polygon(piece.corners(), k, count))).count();
        let factor = form_factor_from_point(DVec3::ZERO, normal, piece.corners());
        sum += factor * seen as f64 / f64::from(count.max(1));
    }
    sum.min(all)
}

/// One of so many points spread over a convex polygon (Hammersley 1960).
fn in_polygon(corners: &[DVec3], k: u32, count: u32) -> DVec3 {
    let x = (f64::from(k) + 0.5) / f64::from(count);
    let y = f64::from(k.reverse_bits()) / 4_294_967_296.0;
    let fan = |i: usize| (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]).length();
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
