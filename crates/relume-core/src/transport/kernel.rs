//! The kernel of the radiosity equation on small grids of points, in vector registers.
//!
//! Every instruction set computes the same bits: no fused multiply-add, no reordering.

use std::f64::consts::FRAC_1_PI;

use fearless_simd::{Level, dispatch};
use glam::DVec3;

use crate::element::{WorldElement, bilinear_area};

/// The instruction set chosen at run time.
#[derive(Clone, Copy, Debug)]
pub struct Simd(Level);

impl Simd {
    /// The widest this machine has.
    pub fn detect() -> Simd {
        Simd(Level::new())
    }

    /// The level, for `dispatch!`.
    #[inline]
    pub(crate) fn level(self) -> Level {
        self.0
    }
}

/// Parameters of the two Gauss-Legendre points on [0, 1].
pub(super) const G: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// The 2 x 2 Gauss points of an element and their shares of its area.
#[derive(Clone, Copy, Debug)]
pub(super) struct GaussPoints {
    x: [f64; 4],
    y: [f64; 4],
    z: [f64; 4],
    /// Shares of the area; they sum to 1.
    pub(super) share: [f64; 4],
}

impl GaussPoints {
    pub(super) fn point(&self, k: usize) -> DVec3 {
        DVec3::new(self.x[k], self.y[k], self.z[k])
    }

    pub(super) fn of(e: &WorldElement) -> GaussPoints {
        let mut out = GaussPoints { x: [0.0; 4], y: [0.0; 4], z: [0.0; 4], share: [0.25; 4] };
        let c = &e.corners;
        // Parallelograms have a constant Jacobian.
        let skew = (c[0] - c[1]) + (c[2] - c[3]);
        let even = skew.length_squared() <= 1e-24 * e.radius * e.radius;
        let mut sum = 0.0;
        for k in 0..4 {
            let (s, t) = (G[k & 1], G[k >> 1]);
            let p = e.point(s, t);
            (out.x[k], out.y[k], out.z[k]) = (p.x, p.y, p.z);
            if !even {
                out.share[k] = bilinear_area(c, s, t).dot(e.plane.normal);
                sum += out.share[k];
            }
        }
        if !even {
            out.share = out.share.map(|w| w / sum);
        }
        out
    }
}

/// Mean kernel seen from each point of both sides.
#[derive(Clone, Copy, Debug)]
pub(super) struct KernelGrid {
    /// Mean over b's points of the kernel at each of a's points, 1/m2.
    pub(super) from_a: [f64; 4],
    /// Mean over a's points of the kernel at each of b's points, 1/m2.
    pub(super) from_b: [f64; 4],
    /// Mean over all, 1/m2.
    pub(super) mean: f64,
    /// Gauss points of both sides.
    pub(super) points: (GaussPoints, GaussPoints),
}

/// cos cos / (pi r^2) at all 16 pairs of Gauss points; cosines below 0 count as 0.
pub(super) fn kernel_grid(simd: Simd, a: &WorldElement, b: &WorldElement) -> KernelGrid {
    let (pa, pb) = (GaussPoints::of(a), GaussPoints::of(b));
    let mut out = KernelGrid { from_a: [0.0; 4], from_b: [0.0; 4], mean: 0.0, points: (pa, pb) };
    let (na, nb) = (a.plane.normal, b.plane.normal);
    dispatch!(simd.level(), _simd => fill_grid(&pa, &pb, na, nb, &mut out));
    out
}

#[inline(always)]
fn fill_grid(a: &GaussPoints, b: &GaussPoints, na: DVec3, nb: DVec3, out: &mut KernelGrid) {
    for i in 0..4 {
        let mut k = [0.0; 4];
        for j in 0..4 {
            let (dx, dy, dz) = (b.x[j] - a.x[i], b.y[j] - a.y[i], b.z[j] - a.z[i]);
            let r2 = dx * dx + dy * dy + dz * dz;
            let ca = (na.x * dx + na.y * dy + na.z * dz).max(0.0);
            let cb = (-(nb.x * dx + nb.y * dy + nb.z * dz)).max(0.0);
            k[j] = ca * cb * FRAC_1_PI / (r2 * r2).max(f64::MIN_POSITIVE);
        }
        let mut row = 0.0;
        for j in 0..4 {
            row += b.share[j] * k[j];
            out.from_b[j] += a.share[i] * k[j];
        }
        out.from_a[i] = row;
        out.mean += a.share[i] * row;
    }
}
