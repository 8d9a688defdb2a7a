//! How a quadrilateral or triangle is split into well-shaped children.

use glam::{DVec2, DVec3};

/// Corners of an element in its patch's frame, metres, and whether there are three or four; a
/// triangle repeats its last corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Corners, counter-clockwise.
    pub corners: [DVec2; 4],
    /// Three or four.
    pub len: usize,
}

/// Side ratio above which an element is halved across its long side instead of quartered.
const ELONGATED: f64 = 1.5;

/// Longest edge squared : area above which a triangle is halved (right isosceles: 4).
const SLENDER: f64 = 6.0;

impl Shape {
    /// A shape from three or four corners.
    pub fn new(corners: &[DVec2]) -> Shape {
        let last = corners[corners.len() - 1];
        let corner = |k: usize| corners.get(k).copied().unwrap_or(last);
        Shape { corners: [corner(0), corner(1), corner(2), corner(3)], len: corners.len() }
    }

    /// Area, m2: half the cross product of the diagonals, which holds for a triangle with its last
    /// corner repeated too.
    pub fn area(&self) -> f64 {
        let c = &self.corners;
        (c[2] - c[0]).perp_dot(c[3] - c[1]) * 0.5
    }

    /// Centroid, metres.
    pub fn centroid(&self) -> DVec2 {
        let [a, b, c, d] = self.corners;
        let (one, two) = ((b - a).perp_dot(c - a), (c - a).perp_dot(d - a));
        a + ((b - a) + (c - a)) * (one / (3.0 * (one + two)))
            + ((c - a) + (d - a)) * (two / (3.0 * (one + two)))
    }

    /// Mean of (x x, x y, y y) about the centroid, m2: exact for parallelograms and triangles.
    pub fn second_moment(&self) -> [f64; 3] {
        let [a, b, c, d] = self.corners;
        if self.len == 3 {
            let m = self.centroid();
            let sum = |f: fn(DVec2) -> f64| (f(a - m) + f(b - m) + f(c - m)) / 12.0;
            return [sum(|v| v.x * v.x), sum(|v| v.x * v.y), sum(|v| v.y * v.y)];
        }
        let (e, f) = ((b + c - a - d) * 0.5, (c + d - a - b) * 0.5);
        [e.x * e.x + f.x * f.x, e.x * e.y + f.x * f.y, e.y * e.y + f.y * f.y].map(|v| v / 12.0)
    }

    /// Largest distance of a corner from the centroid, metres.
    pub fn radius(&self) -> f64 {
        let m = self.centroid();
        self.corners.iter().map(|c| (*c - m).length_squared()).fold(0.0, f64::max).sqrt()
    }

    /// The two or four children, tiling this shape, in canonical order.
    pub fn children(&self) -> Vec<Shape> {
        if self.len == 3 { self.triangle_children() } else { self.quad_children() }
    }

    fn quad_children(&self) -> Vec<Shape> {
        let [a, b, c, d] = self.corners;
        let (ab, bc, cd, da) = ((a + b) * 0.5, (b + c) * 0.5, (c + d) * 0.5, (d + a) * 0.5);
        let along = (bc - da).length();
        let across = (cd - ab).length();
        let quad = |p, q, r, s| Shape { corners: [p, q, r, s], len: 4 };
        if along > ELONGATED * across {
            vec![quad(a, ab, cd, d), quad(ab, b, c, cd)]
        } else if across > ELONGATED * along {
            vec![quad(a, b, bc, da), quad(da, bc, c, d)]
        } else {
            let m = (ab + cd) * 0.5;
            vec![quad(a, ab, m, da), quad(ab, b, bc, m), quad(m, bc, c, cd), quad(da, m, cd, d)]
        }
    }

    fn triangle_children(&self) -> Vec<Shape> {
        let [a, b, c, _] = self.corners;
        let tri = |p, q, r| Shape { corners: [p, q, r, r], len: 3 };
        let edges = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
        let longest = (0..3).fold(0, |m, k| if edges[k] > edges[m] { k } else { m });
        if edges[longest] > SLENDER * self.area() {
            let v = [a, b, c];
            let (p, q, r) = (v[longest], v[(longest + 1) % 3], v[(longest + 2) % 3]);
            let m = (p + q) * 0.5;
            return vec![tri(p, m, r), tri(m, q, r)];
        }
        let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
        vec![tri(a, ab, ca), tri(ab, b, bc), tri(ca, bc, c), tri(bc, ca, ab)]
    }
}

/// The point of a quadrilateral at parameters `(s, t)` in the unit square.
#[inline]
pub fn bilinear(c: &[DVec3; 4], s: f64, t: f64) -> DVec3 {
    c[0] * ((1.0 - s) * (1.0 - t))
        + c[1] * (s * (1.0 - t))
        + c[2] * (s * t)
        + c[3] * ((1.0 - s) * t)
}

/// Area vector of a quadrilateral's surface element at `(s, t)`: its length is the Jacobian of
/// [`bilinear`], m2, and it points to the front.
#[inline]
pub fn bilinear_area(c: &[DVec3; 4], s: f64, t: f64) -> DVec3 {
    let ds = (c[1] - c[0]) * (1.0 - t) + (c[2] - c[3]) * t;
    let dt = (c[3] - c[0]) * (1.0 - s) + (c[2] - c[1]) * s;
    ds.cross(dt)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_tiling(shape: Shape, count: usize) {
        let children = shape.children();
        assert_eq!(children.len(), count);
        let sum: f64 = children.iter().map(Shape::area).sum();
        assert!((sum - shape.area()).abs() < 1e-14 * shape.area());
        assert!(children.iter().all(|c| c.area() > 0.0));
    }

    #[test]
    fn children_tile_their_parent() {
        let v = DVec2::new;
        check_tiling(Shape::new(&[v(0., 0.), v(1., 0.), v(1.1, 1.), v(0., 0.9)]), 4);
        check_tiling(Shape::new(&[v(0., 0.), v(3., 0.), v(3., 1.), v(0., 1.)]), 2);
        check_tiling(Shape::new(&[v(0., 0.), v(1., 0.), v(1., 3.), v(0., 3.)]), 2);
        check_tiling(Shape::new(&[v(0., 0.), v(1., 0.), v(0., 1.)]), 4);
        check_tiling(Shape::new(&[v(0., 0.), v(5., 0.), v(0., 0.5)]), 2);
    }

    #[test]
    fn slender_shapes_become_rounder() {
        let v = DVec2::new;
        let mut needle = Shape::new(&[v(0., 0.), v(20., 0.), v(20., 1.), v(0., 1.)]);
        for _ in 0..5 {
            needle = needle.children()[0];
        }
        let [a, b, _, d] = needle.corners;
        assert!((b - a).length() / (d - a).length() < 2.0);
    }
}
