//! Exchange areas past boxes by brute force: rays, and boxes as slabs. The plainest judge of all; it
//! shares nothing with the others here either.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use crate::{Quad, Random};

/// A box that blocks.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Middle, m.
    pub centre: DVec3,
    /// Half of its edges, m.
    pub half: DVec3,
    /// World from the box's own axes.
    pub turn: DQuat,
}

impl Block {
    /// Whether the segment meets the box: slabs, in the box's own axes.
    pub fn blocks(&self, p: DVec3, q: DVec3) -> bool {
        let back = self.turn.conjugate();
        let (o, d) = (back * (p - self.centre), back * (q - p));
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (t0, t1) =
                ((-self.half[axis] - o[axis]) / d[axis], (self.half[axis] - o[axis]) / d[axis]);
            from = from.max(t0.min(t1));
            to = to.min(t0.max(t1));
        }
        from < to
    }
}

/// Exchange area of two parallelograms past the boxes and its standard error, m2: rays from the
/// first with a cosine distribution, as many as hit the front of the second unblocked.
///
/// 40^4 rays, stratified in all four dimensions; the standard error is that of as many independent
/// rays, and so too large if anything. The same seed gives the same bits.
pub fn exchange_area(a: &Quad, b: &Quad, blocks: &[Block], seed: u64) -> (f64, f64) {
    const CELLS: u32 = 40;
    let mut random = Random(seed);
    let mut part = |k: u32| (f64::from(k) + random.unit()) / f64::from(CELLS);
    let (e, f, be, bf) = (a[1] - a[0], a[3] - a[0], b[1] - b[0], b[3] - b[0]);
    let (area, normal, bn) = (e.cross(f).length(), e.cross(f).normalize(), be.cross(bf));
    let (u, w) = (e.normalize(), normal.cross(e.normalize()));
    let mut hits = 0_u32;
    for index in 0..CELLS.pow(4) {
        let cell = |axis: u32| index / CELLS.pow(axis) % CELLS;
        let p = a[0] + e * part(cell(0)) + f * part(cell(1));
        let (square, turn) = (part(cell(2)), 2.0 * PI * part(cell(3)));
        let (r, up) = (square.sqrt(), (1.0 - square).sqrt());
        let d = u * (r * turn.cos()) + w * (r * turn.sin()) + normal * up;
        if bn.dot(d) >= 0.0 {
            continue;
        }
        let x = p + d * (bn.dot(b[0] - p) / bn.dot(d));
        let inside = |side: DVec3| (0.0..side.length_squared()).contains(&(x - b[0]).dot(side));
        let ahead = (x - p).dot(d) > 0.0;
        if ahead && inside(be) && inside(bf) && !blocks.iter().any(|o| o.blocks(p, x)) {
            hits += 1;
        }
    }
    let share = f64::from(hits) / f64::from(CELLS.pow(4));
    (area * share, area * (share * (1.0 - share) / f64::from(CELLS.pow(4))).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_agrees_with_the_exact_values() {
        let v = DVec3::new;
        let floor = [v(0., 0., 0.), v(1., 0., 0.), v(1., 1., 0.), v(0., 1., 0.)];
        let mut lid = floor.map(|p| p + DVec3::Z);
        lid.reverse();
        let (x, se) = exchange_area(&floor, &lid, &[], 1);
        assert!((x - 0.199_824_895_698).abs() < 4.0 * se && se < 3e-4, "{x} +- {se}");
        let half = v(0.25, 0.25, 1e-9);
        let plate = Block { centre: v(0.25, 0.25, 0.5), half, turn: DQuat::IDENTITY };
        let (x, se) = exchange_area(&floor, &lid, &[plate], 2);
        assert!((x - 0.149_868_671_774).abs() < 4.0 * se && se < 3e-4, "{x} +- {se}");
    }
}
