//! Exact form factors, by other means than the engine's: the catalogue's closed forms, and a
//! graded Gauss rule over Lambert's contour sum.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Quad, v};

/// Form factor from a point with unit `normal` to a polygon in front of it (Lambert 1760), by
/// angles from `atan2`: the polygon is facing the point if the sum is positive.
pub(crate) fn lambert(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
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
pub(crate) fn parallelogram_to_polygon(receiver: &Quad, source: &[DVec3]) -> f64 {
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
pub(crate) fn opposed_rectangles(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (x1, y1) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let log = ((x1 * y1).powi(2) / (1.0 + x * x + y * y)).sqrt().ln();
    2.0 / (PI * x * y)
        * (log + x * y1 * (x / y1).atan() + y * x1 * (y / x1).atan() - x * x.atan() - y * y.atan())
}

/// From a rectangle `w` wide across a common edge of length `l` to one `h` high at a right angle
/// to it (Howell C-14).
pub(crate) fn rectangles_at_right_angles(w: f64, h: f64, l: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (w2, h2) = (w * w, h * h);
    let hyp = (h2 + w2).sqrt();
    let log = ((1.0 + w2) * (1.0 + h2) / (1.0 + w2 + h2)).ln()
        + w2 * (w2 * (1.0 + w2 + h2) / ((1.0 + w2) * (w2 + h2))).ln()
        + h2 * (h2 * (1.0 + w2 + h2) / ((1.0 + h2) * (w2 + h2))).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - hyp * (1.0 / hyp).atan() + log / 4.0) / (PI * w)
}

/// Coaxial parallel discs of radii `receiver` and `source` at distance `h` (Howell C-41).
pub(crate) fn coaxial_discs(receiver: f64, source: f64, h: f64) -> f64 {
    let (r1, r2) = (receiver / h, source / h);
    let x = 1.0 + (1.0 + r2 * r2) / (r1 * r1);
    (x - (x * x - 4.0 * (r2 / r1).powi(2)).sqrt()) / 2.0
}

/// From a point to a parallel rectangle a x b at distance c, a corner of it above the point
/// (Howell B-4).
pub(crate) fn point_to_parallel_rectangle(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (x1, y1) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / x1 * (y / x1).atan() + y / y1 * (x / y1).atan()) / (2.0 * PI)
}

/// From a point to a rectangle at a right angle to its plane: `b` along the edge nearest to the
/// point, which starts straight ahead at distance `c`, and `a` high (Howell B-5).
pub(crate) fn point_to_upright_rectangle(a: f64, b: f64, c: f64) -> f64 {
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
pub(crate) fn quad_sr(from: DVec3, quad: &Quad) -> f64 {
    let [a, b, c, d] = quad.map(|p| p - from);
    triangle_sr(a, b, c) + triangle_sr(a, c, d)
}

#[test]
fn the_exact_values_agree_with_each_other_and_with_print() {
    let near = |a: f64, b: f64, e: f64| assert!((a - b).abs() < e, "{a} {b}");
    near(opposed_rectangles(1.0, 1.0, 1.0), 0.199_824_895_698, 1e-12);
    near(opposed_rectangles(1.0, 1.0, 2.0), 0.068_590, 5e-7);
    near(rectangles_at_right_angles(1.0, 1.0, 1.0), 0.200_043_776_075, 1e-12);
    let floor = super::facing_up([0.0, 1.0], [0.0, 1.0], 0.0);
    let wall = [v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)];
    near(parallelogram_to_polygon(&floor, &wall), 0.200_043_776_075, 1e-9);
    let lid = super::flipped(super::facing_up([0.0, 2.0], [0.0, 3.0], 0.7));
    near(lambert(DVec3::ZERO, DVec3::Z, &lid), point_to_parallel_rectangle(2.0, 3.0, 0.7), 1e-14);
    let upright = [v(0.5, 0., 0.), v(0.5, 0., 2.), v(0.5, 3., 2.), v(0.5, 3., 0.)];
    let f = lambert(DVec3::ZERO, DVec3::Z, &upright).abs();
    near(f, point_to_upright_rectangle(2.0, 3.0, 0.5), 1e-14);
    near(
        quad_sr(DVec3::Z * 1.0, &super::facing_up([-1., 1.], [-1., 1.], 0.0)),
        PI * 2.0 / 3.0,
        1e-12,
    );
}
