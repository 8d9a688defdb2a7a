//! Exchange area of two polygons as a double integral along their outlines.
//!
//! Exact where all edges of one are parallel or perpendicular to those of the other; elsewhere one integral is in
//! closed form and the other adaptive. Its cost does not depend on how close or how slender the polygons
//! are, where points on one that look at the other would have to be as dense as the gap is narrow.

use std::f64::consts::PI;

use fearless_simd::dispatch;
use glam::DVec3;

use super::kernel::Simd;
use super::logarithm::logarithm;
use super::point::angle;
use crate::geometry::ConvexPolygon;

/// Exchange area of two convex polygons, each wholly in front of the other's plane and with corners
/// anticlockwise as seen from its front, m2:
///
/// X = 1/(2 pi) sum over edges e of `a` and f of `b` of (e . f) int_0^1 int_0^1 ln |e(s) - f(t)| ds dt
///
/// Error: `error_max_m2`, an estimate; and rounding, some 1e-15 of the product of the outlines' lengths.
/// Cost: 1 microsecond for two rectangles that are aligned, 3 to 30 where the adaptive integral is needed.
///
/// Source: the contour form is Sparrow's (1963); the closed forms are derived in docs/exchange.md.
pub(super) fn exchange_along_outlines(
    simd: Simd,
    a: &[DVec3],
    b: &[DVec3],
    error_max_m2: f64,
) -> f64 {
    // Any unit of length will do, as the outlines are closed; one near the distances loses fewest digits.
    let unit = a.iter().map(|&p| p.distance(b[0])).fold(0.0, f64::max);
    if unit <= 0.0 {
        return 0.0;
    }
    let mut corners = [DVec3::ZERO; ConvexPolygon::CAPACITY];
    corners.iter_mut().zip(b).for_each(|(to, &from)| *to = from / unit);
    let corners = &corners[..b.len()];
    let mut sum = 0.0;
    let mut p = a[a.len() - 1] / unit;
    for &corner in a {
        let q = corner / unit;
        sum += over_edge(
            simd,
            &Edge { from: p, along: q - p },
            corners,
            error_max_m2 / (unit * unit * a.len() as f64),
        );
        p = q;
    }
    (sum / (2.0 * PI)).max(0.0) * unit * unit
}

/// A directed edge, in units of the pair.
struct Edge {
    from: DVec3,
    along: DVec3,
}

impl Edge {
    fn at(&self, s: f64) -> DVec3 {
        self.from + self.along * s
    }
}

/// Squared sine of the angle up to which edges count as parallel: the closed form is off by about the sine.
const PARALLEL: f64 = 1e-18;

/// Cosine of the angle below which edges count as perpendicular.
const PERPENDICULAR: f64 = 1e-12;

/// The double integral over an edge and the whole outline with some `corners`.
fn over_edge(simd: Simd, e: &Edge, corners: &[DVec3], error_max: f64) -> f64 {
    let length2 = e.along.length_squared();
    let line = Stretch { start: e.from, direction: e.along.normalize(), length: e.along.length() };
    let mut sum = 0.0;
    // Corners where edges begin that are at an angle to `e`.
    let mut tilted = [false; ConvexPolygon::CAPACITY];
    let mut any = false;
    let ends = corners.iter().skip(1).chain(corners.first());
    for (k, (&from, &to)) in corners.iter().zip(ends).enumerate() {
        let along = to - from;
        let both2 = length2 * along.length_squared();
        let dot = e.along.dot(along);
        if dot * dot <= PERPENDICULAR * PERPENDICULAR * both2 {
            continue;
        }
        if e.along.cross(along).length_squared() <= PARALLEL * both2 {
            sum += of_parallels(simd, &line, &Edge { from, along });
        } else {
            (tilted[k], any) = (true, true);
        }
    }
    if any {
        let integrand = |places: &Points| dispatch!(simd.level(), _simd => tilted_means(e, places, corners, &tilted));
        sum += adaptive(&integrand, (0.0, 1.0), error_max.max(ROUNDING), LEVELS);
    }
    sum
}

/// Points of the adaptive rule: Kronrod's seven, and one more to fill a register.
const POINTS: usize = 8;

/// A number for each of them.
type Points = [f64; POINTS];

/// Sum over those edges f of an outline that are `tilted` of (e . f) times the mean of ln |e(s) - f(t)| over t, at some places s.
#[inline(always)]
fn tilted_means(e: &Edge, places: &Points, corners: &[DVec3], tilted: &[bool]) -> Points {
    let mut sums = [0.0; POINTS];
    let ways: [[f64; 3]; POINTS] = std::array::from_fn(|k| e.at(places[k]).to_array());
    let seen = |corner: DVec3| {
        let c = corner.to_array();
        let to: [Points; 3] = std::array::from_fn(|i| std::array::from_fn(|k| c[i] - ways[k][i]));
        let [x, y, z] = &to;
        (to, std::array::from_fn(|k| half_logarithm(x[k] * x[k] + y[k] * y[k] + z[k] * z[k])))
    };
    let last = corners.len() - 1;
    let mut start = corners[last];
    let (mut from, mut from_logarithm): ([Points; 3], Points) = seen(start);
    let mut before = last;
    for (k, &end) in corners.iter().enumerate() {
        let (to, to_logarithm) = seen(end);
        if tilted[before] {
            let along = end - start;
            let (weight, shorter) = (e.along.dot(along), 1.0 / along.length_squared());
            for k in 0..POINTS {
                let p = [from[0][k], from[1][k], from[2][k]];
                let q = [to[0][k], to[1][k], to[2][k]];
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                // Places along the edge, and the distance from its line times its length.
                let (x, y) = (dot(p, along.to_array()), dot(q, along.to_array()));
                let cross = [
                    p[1] * q[2] - p[2] * q[1],
                    p[2] * q[0] - p[0] * q[2],
                    p[0] * q[1] - p[1] * q[0],
                ];
                let sine = dot(cross, cross).sqrt();
                let turn = sine * angle(sine, dot(p, q));
                let mean = (y * to_logarithm[k] - x * from_logarithm[k] + turn) * shorter - 1.0;
                sums[k] += weight * mean;
            }
        }
        (start, from, from_logarithm, before) = (end, to, to_logarithm, k);
    }
    sums
}

/// Logarithm of a distance from its square; of no distance 0, as it is only met times 0.
#[inline(always)]
fn half_logarithm(r2: f64) -> f64 {
    if r2 <= f64::MIN_POSITIVE { 0.0 } else { 0.5 * logarithm(r2.max(f64::MIN_POSITIVE)) }
}

/// A stretch of a line, in units of the pair: an [`Edge`] made ready for those that are parallel to it.
struct Stretch {
    start: DVec3,
    /// Of length 1.
    direction: DVec3,
    length: f64,
}

/// (e . f) times the double integral of ln r over two parallel edges.
///
/// With z the difference of places along the edges and h their distance, ln r is the second derivative of
/// P(z) = (z2 - h2)/4 ln(z2 + h2) + h z atan(z/h) - 3/4 z2.
fn of_parallels(
    simd: Simd,
    &Stretch { start, direction: u, length: s1 }: &Stretch,
    f: &Edge,
) -> f64 {
    let t1 = f.along.dot(u);
    let away = f.from - start;
    let t0 = away.dot(u);
    let h = (away - u * t0).length();
    // Places on e run from 0 to s1, on f from t0 to t0 + t1 (t1 < 0 where they run against each other).
    let ends = [t0 + t1, t0 + t1 - s1, t0, t0 - s1];
    let p = dispatch!(simd.level(), _simd => primitives(&ends, h));
    p[0] - p[1] - p[2] + p[3]
}

/// P at four places.
#[inline(always)]
fn primitives(places: &[f64; 4], h: f64) -> [f64; 4] {
    let mut out = [0.0; 4];
    for (z, out) in places.iter().zip(&mut out) {
        let r2 = z * z + h * h;
        let value = 0.25 * (z * z - h * h) * logarithm(r2.max(f64::MIN_POSITIVE))
            + h * z * arctangent(*z, h)
            - 0.75 * z * z;
        *out = if r2 <= f64::MIN_POSITIVE { 0.0 } else { value };
    }
    out
}

/// atan(z / h) for h >= 0.
#[inline(always)]
fn arctangent(z: f64, h: f64) -> f64 {
    let magnitude = angle(z.abs(), h);
    if z < 0.0 { -magnitude } else { magnitude }
}

/// Halvings of an edge at most: kinks where edges touch or cross err by a quarter as much with each.
const LEVELS: u32 = 14;

/// Errors below this are rounding, in squares of the unit.
const ROUNDING: f64 = 1e-15;

/// Integral over an interval: Gauss and Kronrod with 3 and 7 points, halved where they differ.
fn adaptive(
    f: &dyn Fn(&Points) -> Points,
    (lo, hi): (f64, f64),
    error_max: f64,
    levels: u32,
) -> f64 {
    let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
    let values = f(&std::array::from_fn(|k| middle + half * KRONROD[k.min(6)].0));
    let kronrod: f64 = (0..7).map(|k| KRONROD[k].1 * values[k]).sum();
    let gauss: f64 = (0..3).map(|k| GAUSS[k] * values[2 * k + 1]).sum();
    let varies: f64 = (0..7).map(|k| KRONROD[k].1 * (values[k] - 0.5 * kronrod).abs()).sum();
    // Where the integrand is smooth, Kronrod's error is of the order of the square of Gauss's.
    let differs = (kronrod - gauss).abs();
    let error = half * differs * (SMOOTH * differs / varies.max(f64::MIN_POSITIVE)).min(1.0);
    if levels == 0 || error <= error_max {
        return kronrod * half;
    }
    // The errors of parts hardly add up: most of what is left is in the one with the kink.
    adaptive(f, (lo, middle), 0.7 * error_max, levels - 1)
        + adaptive(f, (middle, hi), 0.7 * error_max, levels - 1)
}

/// How many times the squared relative difference of both rules Kronrod's relative error may be.
const SMOOTH: f64 = 10.0;

/// Places and weights of Kronrod's 7 points on [-1, 1].
const KRONROD: [(f64, f64); 7] = [
    (-0.960_491_268_708_020_3, 0.104_656_226_026_467_27),
    (-0.774_596_669_241_483_4, 0.268_488_089_868_333_44),
    (-0.434_243_749_346_802_56, 0.401_397_414_775_962_2),
    (0.0, 0.450_916_538_658_474_14),
    (0.434_243_749_346_802_56, 0.401_397_414_775_962_2),
    (0.774_596_669_241_483_4, 0.268_488_089_868_333_44),
    (0.960_491_268_708_020_3, 0.104_656_226_026_467_27),
];

/// Weights of Gauss's 3 points among them.
const GAUSS: [f64; 3] = [5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0];
