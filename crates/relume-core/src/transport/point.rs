//! The form factor from points to a polygon, in closed form.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use fearless_simd::dispatch;
use glam::{DVec2, DVec3};

use super::kernel::Simd;

/// Points handled at once.
pub(super) const LANES: usize = 16;

/// Sixteen points of one plane, by coordinate.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PointBundle {
    pub(super) x: [f64; LANES],
    pub(super) y: [f64; LANES],
    pub(super) z: [f64; LANES],
}

impl PointBundle {
    pub(super) fn point(&self, k: usize) -> DVec3 {
        DVec3::new(self.x[k], self.y[k], self.z[k])
    }
}

/// The sum over lanes, in an order that is the same for every instruction set.
#[inline(always)]
pub(super) fn sum_of_lanes(lanes: [f64; LANES]) -> f64 {
    let halves: [f64; 8] = std::array::from_fn(|k| lanes[k] + lanes[k + 8]);
    let quarters: [f64; 4] = std::array::from_fn(|k| halves[k] + halves[k + 4]);
    (quarters[0] + quarters[2]) + (quarters[1] + quarters[3])
}

/// atan(t) / t for t in [0, tan(pi/8)] as a polynomial in t^2; error below 1e-15 (Chebyshev fit).
const ATAN: [f64; 10] = [
    0.999_999_999_999_999,
    -0.333_333_333_332_214_3,
    0.199_999_999_783_926_62,
    -0.142_857_126_616_847_94,
    0.111_110_488_512_537,
    -0.090_895_299_565_623_07,
    0.076_735_354_281_832_86,
    -0.065_059_829_671_708_4,
    0.050_247_621_189_401_28,
    -0.025_316_479_573_776_476,
];

/// The angle of (x, y) for y >= 0, in [0, pi]; error below 1e-15. The system's atan2 differs from
/// machine to machine; this one is plain arithmetic, and has no branches.
#[inline(always)]
pub(super) fn angle(y: f64, x: f64) -> f64 {
    let ax = x.abs();
    let (low, high) = (ax.min(y), ax.max(y));
    // Above tan(pi/8): atan t = pi/4 + atan((t - 1) / (t + 1)), with t = low / high.
    let wide = low > 0.414_213_562_373_095_03 * high;
    let over = if wide { low - high } else { low };
    let under = if wide { low + high } else { high };
    let u = over / under.max(f64::MIN_POSITIVE);
    let u2 = u * u;
    let mut p = ATAN[9];
    for k in (0..9).rev() {
        p = p * u2 + ATAN[k];
    }
    let small = u * p + if wide { FRAC_PI_4 } else { 0.0 };
    let first = if y > ax { FRAC_PI_2 - small } else { small };
    if x < 0.0 { PI - first } else { first }
}

/// One edge's share of Lambert's sum, seen from the origin; p and q are its ends.
#[inline(always)]
fn edge(p: [f64; 3], q: [f64; 3], n: [f64; 3]) -> f64 {
    let cx = p[1] * q[2] - p[2] * q[1];
    let cy = p[2] * q[0] - p[0] * q[2];
    let cz = p[0] * q[1] - p[1] * q[0];
    let sine = (cx * cx + cy * cy + cz * cz).sqrt();
    let cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    // A point on the edge's line has sine 0 and a cross product of 0: it adds nothing.
    let scale = angle(sine, cosine) / sine.max(f64::MIN_POSITIVE);
    scale * (n[0] * cx + n[1] * cy + n[2] * cz)
}

/// Form factor from a point with unit `normal` to a planar polygon wholly in front of the
/// point's tangent plane: Lambert's contour sum, exact up to rounding; the orientation of the
/// corners does not matter. About 10 ns a corner.
///
/// Source: Lambert 1760; Baum, Rushmeier, Winget 1989, equation 6.
pub fn form_factor_from_point(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    let mut p = corners[corners.len() - 1] - point;
    for &corner in corners {
        let q = corner - point;
        sum += edge(p.to_array(), q.to_array(), normal.to_array());
        p = q;
    }
    sum.abs() / (2.0 * PI)
}

/// [`form_factor_from_point`] for sixteen points of one plane.
pub(super) fn form_factors_from_points(
    simd: Simd,
    points: &PointBundle,
    normal: DVec3,
    corners: &[DVec3],
) -> [f64; LANES] {
    dispatch!(simd.level(), _simd => bundle_sums(points, normal, corners))
}

/// [`form_factors_from_points`] within vector code.
#[inline(always)]
pub(super) fn bundle_sums(points: &PointBundle, normal: DVec3, corners: &[DVec3]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    let n = normal.to_array();
    let mut from = corners[corners.len() - 1];
    for &to in corners {
        for k in 0..LANES {
            let (x, y, z) = (points.x[k], points.y[k], points.z[k]);
            let p = [from.x - x, from.y - y, from.z - z];
            let q = [to.x - x, to.y - y, to.z - z];
            sums[k] += edge(p, q, n);
        }
        from = to;
    }
    // Written out, here and where elements are placed: mapping an array is a call for each number.
    for sum in &mut sums {
        *sum = sum.abs() / (2.0 * PI);
    }
    sums
}

/// Edges of many polygons, each as seen from its own point, evaluated sixteen at a time.
#[derive(Default)]
pub(super) struct EdgeBundles {
    bundles: Vec<EdgeBundle>,
    len: usize,
}

/// Sixteen edges by coordinate: from `p` to `q`.
#[derive(Clone, Copy, Default)]
struct EdgeBundle {
    p: [[f64; LANES]; 3],
    q: [[f64; LANES]; 3],
    share: [f64; LANES],
}

impl EdgeBundles {
    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn clear(&mut self) {
        self.bundles.clear();
        self.len = 0;
    }

    /// Adds an edge from `p` to `q`, seen from the origin.
    pub(super) fn push(&mut self, p: DVec3, q: DVec3) {
        let lane = self.len % LANES;
        if lane == 0 {
            self.bundles.push(EdgeBundle::default());
        }
        let bundle = &mut self.bundles[self.len / LANES];
        for k in 0..3 {
            (bundle.p[k][lane], bundle.q[k][lane]) = (p[k], q[k]);
        }
        self.len += 1;
    }

    /// Each edge's share of Lambert's sum over a plane with unit `normal`.
    pub(super) fn shares(&mut self, simd: Simd, normal: DVec3) -> &Self {
        dispatch!(simd.level(), _simd => fill_shares(&mut self.bundles, normal.to_array()));
        self
    }

    /// The form factor of the polygon with the given edges, whose shares are known.
    pub(super) fn form_factor(&self, edges: std::ops::Range<usize>) -> f64 {
        let share = |k: usize| self.bundles[k / LANES].share[k % LANES];
        edges.map(share).sum::<f64>().abs() / (2.0 * PI)
    }
}

#[inline(always)]
fn fill_shares(bundles: &mut [EdgeBundle], n: [f64; 3]) {
    for bundle in bundles {
        for k in 0..LANES {
            let at = |c: &[[f64; LANES]; 3]| [c[0][k], c[1][k], c[2][k]];
            bundle.share[k] = edge(at(&bundle.p), at(&bundle.q), n);
        }
    }
}

/// The middle of what a polygon sends to a point with a normal: of its triangles, each with the kernel at its
/// middle.
pub(super) fn middle_of_sent(c: &[DVec2], from: DVec3, normal: DVec3) -> DVec2 {
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

    #[test]
    fn angles_agree_with_the_library() {
        for k in 0..=4000 {
            let a = PI * f64::from(k) / 4000.0;
            for r in [1e-9, 1.0, 3e7] {
                let (s, c) = a.sin_cos();
                assert!((angle(r * s.abs(), r * c) - a).abs() < 1e-14, "{a}");
            }
        }
        assert_eq!(angle(0.0, 0.0), 0.0);
    }

    #[test]
    fn a_square_above_a_point_has_the_catalogue_value() {
        // Howell B-4 four times: differential to parallel rectangle a = b = c, through a corner.
        let corner = |x: f64, y: f64| DVec3::new(x, y, 1.0);
        let square = [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
        let f = form_factor_from_point(DVec3::ZERO, DVec3::Z, &square);
        let r = 1.0 / 2f64.sqrt();
        let quarter = 2.0 * r * r.atan() / (2.0 * PI);
        assert!((f - 4.0 * quarter).abs() < 1e-14);
        let many =
            form_factors_from_points(Simd::detect(), &PointBundle::default(), DVec3::Z, &square);
        assert_eq!(many, [f; LANES]);
    }

    #[test]
    fn half_of_the_hemisphere_is_a_half() {
        // A very tall wall at an edge of which the point lies.
        let h = 1e9;
        let wall = [
            DVec3::new(1e-3, -h, 0.0),
            DVec3::new(1e-3, h, 0.0),
            DVec3::new(1e-3, h, h),
            DVec3::new(1e-3, -h, h),
        ];
        assert!((form_factor_from_point(DVec3::ZERO, DVec3::Z, &wall) - 0.5).abs() < 1e-9);
    }
}
