//! Exact form factors: closed forms of the catalogue (J. R. Howell, A Catalog of Radiation Transfer
//! Configuration Factors; its numbers in brackets), and a graded Gauss rule over Lambert's contour sum.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::polygon::Quad;

/// Form factor from a point with unit `normal` to a polygon in front of it (Lambert 1760), by
/// angles from `atan2`: the polygon is facing the point if the sum is positive.
pub fn lambert(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    for (k, &corner) in polygon.iter().enumerate() {
        let (p, q) = (corner - point, polygon[(k + 1) % polygon.len()] - point);
        let cross = p.cross(q);
        let sine = cross.length();
        if sine > 0.0 {
            sum += sine.atan2(p.dot(q)) * normal.dot(cross) / sine;
        }
    }
    -sum / (2.0 * PI)
}

/// Four Gauss-Legendre points on [0, 1] and their weights.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Points and weights on [0, 1], graded towards both ends by halves.
fn graded() -> Vec<(f64, f64)> {
    let mut cuts = vec![0.0];
    cuts.extend((1..28).rev().map(|k| 0.5_f64.powi(k)));
    cuts.extend((2..28).map(|k| 1.0 - 0.5_f64.powi(k)));
    cuts.push(1.0);
    let cells = cuts.windows(2);
    cells.flat_map(|c| GAUSS.map(|(x, w)| (c[0] + x * (c[1] - c[0]), w * (c[1] - c[0])))).collect()
}

/// Form factor from a parallelogram to a polygon wholly in front of it, to about 1e-9 even where
/// they share an edge.
pub fn parallelogram_to_polygon(receiver: &Quad, source: &[DVec3]) -> f64 {
    let (e, f) = (receiver[1] - receiver[0], receiver[3] - receiver[0]);
    let normal = e.cross(f).normalize();
    let rule = graded();
    let mut sum = 0.0;
    for &(s, ws) in &rule {
        for &(t, wt) in &rule {
            sum += ws * wt * lambert(receiver[0] + e * s + f * t, normal, source);
        }
    }
    sum
}

/// Directly opposed equal rectangles a x b at distance c (Howell C-11).
pub fn opposed_rectangles(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (x1, y1) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let log = ((x1 * y1).powi(2) / (1.0 + x * x + y * y)).sqrt().ln();
    2.0 / (PI * x * y)
        * (log + x * y1 * (x / y1).atan() + y * x1 * (y / x1).atan() - x * x.atan() - y * y.atan())
}

/// From a rectangle `w` wide across a common edge of length `l` to one `h` high at a right angle
/// to it (Howell C-14).
pub fn rectangles_at_right_angles(w: f64, h: f64, l: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (w2, h2) = (w * w, h * h);
    let hyp = (h2 + w2).sqrt();
    let log = ((1.0 + w2) * (1.0 + h2) / (1.0 + w2 + h2)).ln()
        + w2 * (w2 * (1.0 + w2 + h2) / ((1.0 + w2) * (w2 + h2))).ln()
        + h2 * (h2 * (1.0 + w2 + h2) / ((1.0 + h2) * (w2 + h2))).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - hyp * (1.0 / hyp).atan() + log / 4.0) / (PI * w)
}

/// Coaxial parallel discs of radii `receiver` and `source` at distance `h` (Howell C-41).
pub fn coaxial_discs(receiver: f64, source: f64, h: f64) -> f64 {
    let (r1, r2) = (receiver / h, source / h);
    let x = 1.0 + (1.0 + r2 * r2) / (r1 * r1);
    (x - (x * x - 4.0 * (r2 / r1).powi(2)).sqrt()) / 2.0
}

/// From a point to a parallel rectangle a x b at distance c, a corner of it above the point
/// (Howell B-4).
pub fn point_to_parallel_rectangle(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (x1, y1) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / x1 * (y / x1).atan() + y / y1 * (x / y1).atan()) / (2.0 * PI)
}

/// From a point to a rectangle at a right angle to its plane: `b` along the edge nearest to the
/// point, which starts straight ahead at distance `c`, and `a` high (Howell B-5).
pub fn point_to_upright_rectangle(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / b, c / b);
    let root = (x * x + y * y).sqrt();
    ((1.0 / y).atan() - y / root * (1.0 / root).atan()) / (2.0 * PI)
}

/// Solid angle of a triangle seen from the origin (Van Oosterom, Strackee 1983), sr.
fn triangle_sr(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).abs().atan2(below)
}

/// Solid angle of a quadrilateral seen from a point, sr.
pub fn quad_sr(from: DVec3, quad: &Quad) -> f64 {
    let [a, b, c, d] = quad.map(|p| p - from);
    triangle_sr(a, b, c) + triangle_sr(a, c, d)
}

/// Two infinitely long plates of equal `width`, face to face at `distance` (Howell C-1).
pub fn opposed_strips(width: f64, distance: f64) -> f64 {
    let h = distance / width;
    (1.0 + h * h).sqrt() - h
}

/// Two infinitely long plates of equal width that share an edge and open at `angle` (Howell C-5).
pub fn strips_in_a_wedge(angle: f64) -> f64 {
    1.0 - (angle / 2.0).sin()
}

/// Two infinitely long plates of widths `w` and `h` at a right angle along a common edge, from the
/// first (Howell C-3).
pub fn strips_at_right_angles(w: f64, h: f64) -> f64 {
    let r = h / w;
    (1.0 + r - (1.0 + r * r).sqrt()) / 2.0
}

/// Exchange length of two segments in the plane, seen freely: half of what the crossed strings are
/// longer than the uncrossed ones (Hottel). `a` and `b` run in such a sense that the strings from the
/// first end of `a` to the first of `b`, and from last to last, do not cross. Form factors are it over
/// the length of the sender.
pub fn crossed_strings(a: [DVec2; 2], b: [DVec2; 2]) -> f64 {
    let crossed = a[0].distance(b[1]) + a[1].distance(b[0]);
    let uncrossed = a[0].distance(b[0]) + a[1].distance(b[1]);
    (crossed - uncrossed) / 2.0
}

/// Between rectangles in parallel planes at distance `c`, from the first; each is its range along
/// x and its range along y (Howell C-13).
pub fn parallel_rectangles(first: [[f64; 2]; 2], second: [[f64; 2]; 2], c: f64) -> f64 {
    // The function of which the kernel c^2 / (pi r^4) is the fourth derivative, twice along x and
    // twice along y: from C-11 with all its four differences written out.
    let g = |x: f64, y: f64| {
        let (rx, ry) = ((x * x + c * c).sqrt(), (y * y + c * c).sqrt());
        let log = (1.0 + (x * x + y * y) / (c * c)).ln();
        (x * ry * (x / ry).atan() + y * rx * (y / rx).atan() - c * c / 2.0 * log) / (2.0 * PI)
    };
    let mut sum = 0.0;
    for bits in 0..16_usize {
        let [i, j, k, l] = [bits & 1, bits >> 1 & 1, bits >> 2 & 1, bits >> 3];
        let sign = if (i + j + k + l) % 2 == 0 { 1.0 } else { -1.0 };
        sum += sign * g(first[0][i] - second[0][j], first[1][k] - second[1][l]);
    }
    sum / ((first[0][1] - first[0][0]) * (first[1][1] - first[1][0]))
}

/// Between rectangles at right angles, from the first, which lies in the plane z = 0 over its ranges of x
/// and y; the second stands in the plane x = 0 over its ranges of y and z (Howell C-15; Ehlert and Smith 1993).
/// Neither may reach to the other side of the other's plane: x > 0 or x = 0, and the same of z.
pub fn perpendicular_rectangles(first: [[f64; 2]; 2], second: [[f64; 2]; 2]) -> f64 {
    // The kernel x z / (pi r^4) integrated once along each of x, z and the two y.
    let g = |x: f64, y: f64, z: f64| {
        let root = (x * x + z * z).sqrt();
        let turned = if root > 0.0 { y * root * (y / root).atan() } else { 0.0 };
        let square = x * x + z * z + y * y;
        let log = if square > 0.0 { (x * x + z * z - y * y) * square.ln() / 4.0 } else { 0.0 };
        (turned - log) / (2.0 * PI)
    };
    let mut sum = 0.0;
    for bits in 0..16_usize {
        let [i, j, k, l] = [bits & 1, bits >> 1 & 1, bits >> 2 & 1, bits >> 3];
        let sign = if (i + j + k + l) % 2 == 0 { 1.0 } else { -1.0 };
        sum += sign * g(first[0][i], first[1][j] - second[0][k], second[1][l]);
    }
    sum / ((first[0][1] - first[0][0]) * (first[1][1] - first[1][0]))
}

/// From any plane surface to an endless plane on one side of it; `tilt` is the angle between their normals'
/// opposites: 0 where they are face to face, pi / 2 at right angles, pi where both face the same way.
pub fn to_an_endless_plane(tilt: f64) -> f64 {
    (1.0 + tilt.cos()) / 2.0
}

/// Between concentric spheres of radii `inner` < `outer`, from the outer to itself; holds for any convex
/// body in a closed one, with areas in place of squares.
pub fn concentric_spheres_outer_to_itself(inner: f64, outer: f64) -> f64 {
    1.0 - (inner / outer).powi(2)
}

/// From a sphere to a coaxial disc of radius `r`, their centres `h` apart: the share of the directions
/// that the disc takes up, whatever the sphere's radius.
pub fn sphere_to_disc(r: f64, h: f64) -> f64 {
    (1.0 - 1.0 / (1.0 + (r / h).powi(2)).sqrt()) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    fn floor([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64) -> Quad {
        [v(x0, y0, z), v(x1, y0, z), v(x1, y1, z), v(x0, y1, z)]
    }

    fn lid(x: [f64; 2], y: [f64; 2], z: f64) -> Quad {
        let mut q = floor(x, y, z);
        q.reverse();
        q
    }

    fn near(a: f64, b: f64, e: f64) {
        assert!((a - b).abs() < e, "{a} {b}");
    }

    #[test]
    fn rectangles_at_right_angles_anywhere_agree_with_those_at_an_edge_and_with_the_contour() {
        let f = perpendicular_rectangles([[0.0, 0.7], [0.2, 1.5]], [[0.2, 1.5], [0.0, 2.0]]);
        near(f, rectangles_at_right_angles(0.7, 2.0, 1.3), 1e-12);
        let f = perpendicular_rectangles([[0.1, 0.7], [0.2, 1.5]], [[-0.4, 1.0], [0.3, 2.0]]);
        let wall = [v(0., -0.4, 0.3), v(0., 1., 0.3), v(0., 1., 2.), v(0., -0.4, 2.)];
        near(f, parallelogram_to_polygon(&floor([0.1, 0.7], [0.2, 1.5], 0.0), &wall), 1e-8);
        // The strips of issue 16: 4 mm standing on a floor, and its mirror on the other side of it.
        let strip = [[0.0, 0.004], [0.7, 2.3]];
        let floor = |lo: f64, hi: f64| perpendicular_rectangles(strip, [[0.0, 3.0], [lo, hi]]);
        near(floor(0.0, 2.2), 0.499_357, 1e-6);
        near(floor(0.0, 1e4), to_an_endless_plane(PI / 2.0), 1e-3);
    }

    #[test]
    fn the_exact_values_agree_with_each_other_and_with_print() {
        let unit = [0.0, 1.0];
        near(opposed_rectangles(1.0, 1.0, 1.0), 0.199_824_895_698, 1e-12);
        near(opposed_rectangles(1.0, 1.0, 2.0), 0.068_590, 5e-7);
        near(rectangles_at_right_angles(1.0, 1.0, 1.0), 0.200_043_776_075, 1e-12);
        let wall = [v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)];
        let f = parallelogram_to_polygon(&floor(unit, unit, 0.0), &wall);
        near(f, 0.200_043_776_075, 1e-9);
        let above = lid([0.0, 2.0], [0.0, 3.0], 0.7);
        let f = lambert(DVec3::ZERO, DVec3::Z, &above);
        near(f, point_to_parallel_rectangle(2.0, 3.0, 0.7), 1e-14);
        let upright = [v(0.5, 0., 0.), v(0.5, 0., 2.), v(0.5, 3., 2.), v(0.5, 3., 0.)];
        let f = lambert(DVec3::ZERO, DVec3::Z, &upright).abs();
        near(f, point_to_upright_rectangle(2.0, 3.0, 0.5), 1e-14);
        let seen = quad_sr(DVec3::Z, &floor([-1., 1.], [-1., 1.], 0.0));
        near(seen, PI * 2.0 / 3.0, 1e-12);
    }

    #[test]
    fn parallel_rectangles_agree_with_the_equal_ones_and_with_quadrature() {
        let square = [[0.0, 1.0]; 2];
        near(parallel_rectangles(square, square, 1.0), 0.199_824_895_698, 1e-12);
        let (x, y) = ([0.4, 1.7], [-0.8, 0.3]);
        let f = parallelogram_to_polygon(&floor(square[0], square[1], 0.0), &lid(x, y, 0.6));
        near(parallel_rectangles(square, [x, y], 0.6), f, 1e-9);
    }

    #[test]
    fn strips_are_crossed_strings() {
        let at = DVec2::new;
        let (a, b) = ([at(0., 0.), at(1., 0.)], [at(0., 0.7), at(1., 0.7)]);
        near(crossed_strings(a, b), opposed_strips(1.0, 0.7), 1e-14);
        let wall = [at(0., 0.), at(0., 0.4)];
        near(crossed_strings(a, wall), strips_at_right_angles(1.0, 0.4), 1e-14);
        let (s, c) = 0.8_f64.sin_cos();
        near(crossed_strings(a, [at(0., 0.), at(c, s)]), strips_in_a_wedge(0.8), 1e-14);
        // Very long plates come near to them.
        near(opposed_rectangles(1.0, 1e5, 0.7), opposed_strips(1.0, 0.7), 1e-5);
        near(rectangles_at_right_angles(1.0, 0.4, 1e5), strips_at_right_angles(1.0, 0.4), 1e-5);
    }

    #[test]
    fn spheres_agree_with_what_they_are_in_the_limit() {
        near(sphere_to_disc(1e9, 1.0), 0.5, 1e-8);
        // Far away: the disc's area over that of the sphere around.
        near(sphere_to_disc(1.0, 100.0) * 4.0 * 1e4, 1.0, 1e-4);
        near(concentric_spheres_outer_to_itself(1.0, 2.0), 0.75, 1e-15);
    }
}
