//! The fixed sample segments of a pair: sixteen at a time, in vector registers.

use std::f64::consts::FRAC_1_PI;

use fearless_simd::dispatch;
use glam::DVec3;

use super::kernel::Simd;
use crate::element::{OccluderPolygon, WorldElement, bilinear_area};
use crate::geometry::Aabb;

/// Segments in a bundle.
pub const SEGMENTS: usize = 16;

/// Sixteen segments from one element to another with the kernel that each stands for.
#[derive(Clone, Copy, Debug)]
pub struct SegmentBundle {
    px: [f64; SEGMENTS],
    py: [f64; SEGMENTS],
    pz: [f64; SEGMENTS],
    dx: [f64; SEGMENTS],
    dy: [f64; SEGMENTS],
    dz: [f64; SEGMENTS],
    /// Kernel times area elements: the share of the exchange that each segment carries, unscaled.
    pub weight: [f64; SEGMENTS],
    /// Quadrant of the first element each segment starts in, 0 to 3.
    pub quadrant_a: [u8; SEGMENTS],
    /// Quadrant of the second element each segment ends in, 0 to 3.
    pub quadrant_b: [u8; SEGMENTS],
}

/// How far polygons reach over their edges, in slacks: neighbours leave no gap between them.
pub(super) const EDGE_OVERLAP: f64 = 1e-5;

/// Bits of the points of the [`NET`].
const NET_BITS: u32 = 6;

/// The (0, 6, 2)-net of van der Corput and Sobol, as integers of 6 bits.
const NET: [[u8; 2]; 1 << NET_BITS] = {
    // Direction numbers of the second Sobol dimension: Pascal's triangle modulo 2.
    const SECOND: [u8; NET_BITS as usize] = [1, 3, 5, 15, 17, 51];
    let mut net = [[0; 2]; 1 << NET_BITS];
    let mut k = 0;
    while k < net.len() {
        let mut bit = 0;
        while bit < SECOND.len() {
            if k >> bit & 1 == 1 {
                net[k][0] ^= 1 << (SECOND.len() - 1 - bit);
                net[k][1] ^= SECOND[bit] << (SECOND.len() - 1 - bit);
            }
            bit += 1;
        }
        k += 1;
    }
    net
};

/// The k-th of the first `2^bits` points of the net, which are a net too, as integers of so many bits: 6 at most.
#[inline]
fn net_point(k: u32, bits: u32) -> (u32, u32) {
    let [x, y] = NET[k as usize];
    (u32::from(x) >> (NET_BITS - bits), u32::from(y) >> (NET_BITS - bits))
}

impl SegmentBundle {
    /// Segments of no length that carry nothing.
    const NOTHING: SegmentBundle = SegmentBundle {
        px: [0.0; SEGMENTS],
        py: [0.0; SEGMENTS],
        pz: [0.0; SEGMENTS],
        dx: [0.0; SEGMENTS],
        dy: [0.0; SEGMENTS],
        dz: [0.0; SEGMENTS],
        weight: [0.0; SEGMENTS],
        quadrant_a: [0; SEGMENTS],
        quadrant_b: [0; SEGMENTS],
    };

    /// Segments `16 block .. 16 block + 16` of the `2^log2_count` of the pair.
    ///
    /// Both ends run through a (0, m, 2)-net, joined in bit-reversed order and scrambled by
    /// `key`, which must depend on nothing but the pair's names.
    pub fn new(
        a: &WorldElement,
        b: &WorldElement,
        key: u64,
        log2_count: u32,
        block: u32,
    ) -> SegmentBundle {
        let mut out = SegmentBundle::NOTHING;
        let mask = (1_u32 << log2_count) - 1;
        let scramble = |shift: u32| (key >> shift) as u32 & mask;
        let step = 1.0 / f64::from(1_u32 << log2_count);
        let unit = |v: u32| (f64::from(v) + 0.5) * step;
        for k in 0..SEGMENTS {
            let index = block * SEGMENTS as u32 + k as u32;
            let (ax, ay) = net_point(index, log2_count);
            let (bx, by) = net_point(index.reverse_bits() >> (32 - log2_count), log2_count);
            let (ax, ay) = (ax ^ scramble(0), ay ^ scramble(8));
            let (bx, by) = (bx ^ scramble(16), by ^ scramble(24));
            let half = log2_count - 1;
            out.quadrant_a[k] = ((ax >> half) | (ay >> half) << 1) as u8;
            out.quadrant_b[k] = ((bx >> half) | (by >> half) << 1) as u8;
            out.set(k, a, (unit(ax), unit(ay)), b, (unit(bx), unit(by)));
        }
        out
    }

    /// Segments between given ends, which carry nothing.
    pub fn of_ends(ends: &[[DVec3; 2]; SEGMENTS]) -> SegmentBundle {
        let mut out = SegmentBundle::NOTHING;
        for (k, [p, q]) in ends.iter().enumerate() {
            let d = q - p;
            (out.px[k], out.py[k], out.pz[k]) = (p.x, p.y, p.z);
            (out.dx[k], out.dy[k], out.dz[k]) = (d.x, d.y, d.z);
        }
        out
    }

    fn set(
        &mut self,
        k: usize,
        a: &WorldElement,
        (sa, ta): (f64, f64),
        b: &WorldElement,
        (sb, tb): (f64, f64),
    ) {
        let (p, q) = (a.point(sa, ta), b.point(sb, tb));
        let d = q - p;
        (self.px[k], self.py[k], self.pz[k]) = (p.x, p.y, p.z);
        (self.dx[k], self.dy[k], self.dz[k]) = (d.x, d.y, d.z);
        let r2 = d.length_squared();
        let ca = a.plane.normal.dot(d).max(0.0);
        let cb = (-b.plane.normal.dot(d)).max(0.0);
        let kernel = ca * cb * FRAC_1_PI / (r2 * r2).max(f64::MIN_POSITIVE);
        self.weight[k] = kernel * jacobian(a, sa, ta) * jacobian(b, sb, tb);
    }

    /// Segments from points of an element to a light: `end` tells where the one from a point ends,
    /// `weigh` what it stands for (irradiance of a unit light there).
    pub fn to_light(
        e: &WorldElement,
        key: u64,
        end: impl Fn(DVec3) -> DVec3,
        weigh: impl Fn(DVec3) -> f64,
    ) -> SegmentBundle {
        let mut out = SegmentBundle::new(e, e, key, 4, 0);
        for k in 0..SEGMENTS {
            let p = DVec3::new(out.px[k], out.py[k], out.pz[k]);
            let d = end(p) - p;
            (out.dx[k], out.dy[k], out.dz[k]) = (d.x, d.y, d.z);
            out.weight[k] = weigh(p);
        }
        out
    }

    /// Both ends of a segment.
    #[inline]
    pub fn ends(&self, k: usize) -> (DVec3, DVec3) {
        let p = DVec3::new(self.px[k], self.py[k], self.pz[k]);
        (p, p + DVec3::new(self.dx[k], self.dy[k], self.dz[k]))
    }

    /// One bit for each segment that meets a box grown by a margin. Conservative.
    pub fn that_meet(&self, simd: Simd, bounds: &Aabb, margin_m: f64) -> u16 {
        dispatch!(simd.level(), _simd => self.meeting(bounds, margin_m))
    }

    /// By separating axes: those of the box, and its edges' with the segment.
    #[inline(always)]
    fn meeting(&self, bounds: &Aabb, margin_m: f64) -> u16 {
        let (centre, half) = (bounds.centre(), 0.5 * bounds.extent() + margin_m);
        // Kept as numbers so that the loop stays free of branches: >= 0 means that no axis separates.
        let mut room = [0.0_f64; SEGMENTS];
        for k in 0..SEGMENTS {
            let (ex, ey, ez) = (0.5 * self.dx[k], 0.5 * self.dy[k], 0.5 * self.dz[k]);
            let (x, y, z) = (
                self.px[k] + ex - centre.x,
                self.py[k] + ey - centre.y,
                self.pz[k] + ez - centre.z,
            );
            let (ax, ay, az) = (ex.abs(), ey.abs(), ez.abs());
            let by_box =
                (half.x + ax - x.abs()).min(half.y + ay - y.abs()).min(half.z + az - z.abs());
            let across_x = half.y * az + half.z * ay - (ey * z - ez * y).abs();
            let across_y = half.z * ax + half.x * az - (ez * x - ex * z).abs();
            let across_z = half.x * ay + half.y * ax - (ex * y - ey * x).abs();
            room[k] = by_box.min(across_x).min(across_y).min(across_z);
        }
        let mut mask = 0;
        for (k, &room) in room.iter().enumerate() {
            mask |= u16::from(room >= 0.0) << k;
        }
        mask
    }

    /// One bit for each segment that crosses the polygon, boundary included.
    ///
    /// A segment that comes no closer than `slack_m` to the other side of the plane does not
    /// cross it. Edges are shared to the last bit but one: a segment through a shared edge is
    /// blocked by at least one of the two polygons (they overlap by a 100,000th of the slack).
    pub fn blocked_by(&self, simd: Simd, polygon: &OccluderPolygon<'_>, slack_m: f64) -> u16 {
        dispatch!(simd.level(), _simd => self.blocked(polygon, slack_m))
    }

    #[inline(always)]
    fn blocked(&self, polygon: &OccluderPolygon<'_>, slack_m: f64) -> u16 {
        let n = polygon.plane.normal;
        let mut t = [0.0; SEGMENTS];
        // Kept as numbers so that the loops stay free of branches: >= 0 means blocked so far.
        let mut inside = [0.0_f64; SEGMENTS];
        for k in 0..SEGMENTS {
            let s0 = n.x * self.px[k] + n.y * self.py[k] + n.z * self.pz[k] - polygon.plane.offset;
            let along = n.x * self.dx[k] + n.y * self.dy[k] + n.z * self.dz[k];
            let s1 = s0 + along;
            let low = s0.min(s1);
            let high = s0.max(s1);
            inside[k] = (-slack_m - low).min(high - slack_m);
            t[k] = if inside[k] > 0.0 { -s0 / along } else { 0.0 };
        }
        if inside.iter().all(|&v| v <= 0.0) {
            return 0;
        }
        for edge in polygon.edges {
            let m = edge.normal;
            let give = EDGE_OVERLAP * slack_m;
            for k in 0..SEGMENTS {
                let x = self.px[k] + t[k] * self.dx[k];
                let y = self.py[k] + t[k] * self.dy[k];
                let z = self.pz[k] + t[k] * self.dz[k];
                let d = m.x * x + m.y * y + m.z * z - edge.offset + give;
                inside[k] = inside[k].min(d);
            }
            if inside.iter().all(|&v| v <= 0.0) {
                return 0;
            }
        }
        let mut mask = 0;
        for (k, &v) in inside.iter().enumerate() {
            mask |= u16::from(v > 0.0) << k;
        }
        mask
    }
}

#[inline]
fn jacobian(e: &WorldElement, s: f64, t: f64) -> f64 {
    bilinear_area(&e.corners, s, t).dot(e.plane.normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nets_have_one_point_in_every_elementary_box() {
        for bits in [4, 6] {
            let n = 1 << bits;
            for split in 0..=bits {
                let mut seen = vec![false; n as usize];
                for k in 0..n {
                    let (x, y) = net_point(k, bits);
                    seen[((x >> (bits - split)) << (bits - split) | y >> split) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "bits {bits} split {split}");
            }
        }
    }
}
