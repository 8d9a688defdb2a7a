//! Whether a convex thing comes near the convex hull of others.

use glam::DVec3;

use super::bounds::Aabb;

/// A convex set that is known by how far it reaches in any direction.
pub trait Convex {
    /// One of its points that lie farthest along `direction`.
    fn farthest(&self, direction: DVec3) -> DVec3;
}

/// The hull of some points, of which there must be one.
impl Convex for [DVec3] {
    #[inline]
    fn farthest(&self, direction: DVec3) -> DVec3 {
        let mut best = (f64::NEG_INFINITY, self[0]);
        for &p in self {
            let along = direction.dot(p);
            best = if along > best.0 { (along, p) } else { best };
        }
        best.1
    }
}

impl Convex for Aabb {
    #[inline]
    fn farthest(&self, direction: DVec3) -> DVec3 {
        DVec3::select(direction.cmpge(DVec3::ZERO), self.hi, self.lo)
    }
}

/// The hull of both.
impl<A: Convex + ?Sized, B: Convex + ?Sized> Convex for (&A, &B) {
    #[inline]
    fn farthest(&self, direction: DVec3) -> DVec3 {
        let (a, b) = (self.0.farthest(direction), self.1.farthest(direction));
        if direction.dot(a) >= direction.dot(b) { a } else { b }
    }
}

/// Steps after which two sets that were not found apart count as near: a hull of eight points and a polygon are
/// settled within ten.
const STEPS: usize = 48;

/// Share of the distance below which a step brings nothing.
const SETTLED: f64 = 1e-9;

/// A distance that two convex sets are at least apart, metres: more than `margin_m` if they are, else 0. Never too large, up to
/// rounding (some 1e-16 of their coordinates).
///
/// `towards` points from `b` to `a`; the better it points across the gap, the fewer steps.
/// Source: Gilbert, Johnson & Keerthi 1988; each step looks at the two from another direction, the shortest difference known,
/// and ends if there is a gap. Some 20 ns where the first direction shows one, 300 ns where the two meet.
#[inline]
pub fn gap_m<A: Convex + ?Sized, B: Convex + ?Sized>(
    a: &A,
    b: &B,
    towards: DVec3,
    margin_m: f64,
) -> f64 {
    let mut simplex = Simplex { points: [DVec3::ZERO; 4], len: 0 };
    let mut shortest = towards;
    for _ in 0..STEPS {
        let length2 = shortest.length_squared();
        let next = a.farthest(-shortest) - b.farthest(shortest);
        let along = shortest.dot(next);
        if along > 0.0 && along * along > margin_m * margin_m * length2 {
            return along / length2.sqrt();
        }
        if simplex.len > 0 && length2 - along <= SETTLED * length2 {
            return 0.0;
        }
        match simplex.with(next) {
            Some(closest) if closest.length_squared() > margin_m * margin_m => shortest = closest,
            _ => return 0.0,
        }
    }
    0.0
}

/// Up to four differences of points.
struct Simplex {
    points: [DVec3; 4],
    len: usize,
}

impl Simplex {
    /// Adds a point and leaves only those that span the closest point to the origin, which is returned; `None` if the
    /// origin is inside.
    fn with(&mut self, point: DVec3) -> Option<DVec3> {
        self.points[self.len] = point;
        self.len += 1;
        let [p, q, r, s] = self.points;
        let nearest = match self.len {
            1 => Nearest::at(p),
            2 => on_segment(p, q),
            3 => on_triangle(p, q, r),
            _ => on_tetrahedron([p, q, r, s])?,
        };
        (self.points, self.len) = (nearest.of, nearest.len);
        Some(nearest.point)
    }
}

/// The point of a simplex nearest to the origin, with the corners that span it.
#[derive(Clone, Copy)]
struct Nearest {
    point: DVec3,
    of: [DVec3; 4],
    len: usize,
}

impl Nearest {
    fn at(p: DVec3) -> Nearest {
        Nearest { point: p, of: [p, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO], len: 1 }
    }
}

fn on_segment(p: DVec3, q: DVec3) -> Nearest {
    let d = q - p;
    let (t, whole) = (-p.dot(d), d.length_squared());
    if t <= 0.0 || whole <= 0.0 {
        return Nearest::at(p);
    }
    if t >= whole {
        return Nearest::at(q);
    }
    Nearest { point: p + d * (t / whole), of: [p, q, DVec3::ZERO, DVec3::ZERO], len: 2 }
}

/// Ericson 2005, section 5.1.5: regions of the corners, of the sides, of the face.
fn on_triangle(p: DVec3, q: DVec3, r: DVec3) -> Nearest {
    let (pq, pr) = (q - p, r - p);
    let (d1, d2) = (-pq.dot(p), -pr.dot(p));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Nearest::at(p);
    }
    let (d3, d4) = (-pq.dot(q), -pr.dot(q));
    if d3 >= 0.0 && d4 <= d3 {
        return Nearest::at(q);
    }
    let (d5, d6) = (-pq.dot(r), -pr.dot(r));
    if d6 >= 0.0 && d5 <= d6 {
        return Nearest::at(r);
    }
    let across_r = d1 * d4 - d3 * d2;
    if across_r <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on_segment(p, q);
    }
    let across_q = d5 * d2 - d1 * d6;
    if across_q <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on_segment(p, r);
    }
    let across_p = d3 * d6 - d5 * d4;
    if across_p <= 0.0 && d4 >= d3 && d5 >= d6 {
        return on_segment(q, r);
    }
    let whole = across_p + across_q + across_r;
    if whole <= 0.0 {
        // A triangle without width.
        let sides = [on_segment(p, q), on_segment(p, r), on_segment(q, r)];
        return shortest(sides);
    }
    // By the normal, not by weights of the corners, which lose digits on slivers.
    let n = pq.cross(pr);
    let point = n * (n.dot(p) / n.length_squared());
    Nearest { point, of: [p, q, r, DVec3::ZERO], len: 3 }
}

/// `None` if the origin is inside.
fn on_tetrahedron([p, q, r, s]: [DVec3; 4]) -> Option<Nearest> {
    let mut best: Option<Nearest> = None;
    for (x, y, z, opposite) in [(p, q, r, s), (p, q, s, r), (p, r, s, q), (q, r, s, p)] {
        let n = (y - x).cross(z - x);
        let (inner, outer) = (n.dot(opposite - x), -n.dot(x));
        // On the other side than the fourth corner, or that lies in the plane.
        if inner * outer <= 0.0 {
            let found = on_triangle(x, y, z);
            best = Some(best.map_or(found, |best| shortest([best, found, found])));
        }
    }
    best
}

fn shortest(of: [Nearest; 3]) -> Nearest {
    let [p, q, r] = of;
    let nearer = |p: Nearest, q: Nearest| {
        if q.point.length_squared() < p.point.length_squared() { q } else { p }
    };
    nearer(nearer(p, q), r)
}
