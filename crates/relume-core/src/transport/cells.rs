//! Grids of cells over an end of a pair, of 2 x 2 Gauss points each, from which the other end is looked at.

use super::kernel::G;

/// A grid of cells over the unit square.
///
/// *Shifted* grids end in cells that are narrower, wherever the name of the pair puts them. V has kinks where a shadow
/// begins, and along the edge of a long blade that begins in one place on all of its elements: with even cells the errors of all
/// of their links have one sign. Shifted ones err by as much, each link in its own way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    /// Cells along a side.
    count: u32,
    /// Width of the first cell along each axis over that of one in the middle, 1; `None` if all are as wide.
    shift: Option<[f64; 2]>,
}

impl Cells {
    /// Cells of one size, so many along a side.
    pub(super) fn even(count: u32) -> Cells {
        Cells { count, shift: None }
    }

    /// Two or more cells along a side, shifted by bits of `key`, which must depend on nothing but the pair's names.
    pub(super) fn shifted(count: u32, key: u64) -> Cells {
        let unit = |shift: u32| (f64::from((key >> shift) as u16) + 0.5) / f64::from(1 << 16);
        Cells { count, shift: (count > 1).then(|| [unit(8), unit(32)]) }
    }

    /// Points of all cells.
    pub(super) fn len(self) -> u32 {
        4 * self.count * self.count
    }

    /// Points in the unit square, with weights of mean 1.
    pub(super) fn points(self) -> impl Iterator<Item = ([f64; 2], f64)> {
        let side = 2 * self.count;
        (0..side * side).map(move |k| {
            let [(s, width), (t, height)] = [self.along(0, k % side), self.along(1, k / side)];
            ([s, t], width * height)
        })
    }

    /// Place of point `k` along an axis, and the width of its cell over the mean.
    fn along(self, axis: usize, k: u32) -> (f64, f64) {
        let (cell, gauss, count) = (f64::from(k / 2), G[k as usize & 1], f64::from(self.count));
        let Some(shift) = self.shift else {
            return ((cell + gauss) / count, 1.0);
        };
        let wide = count - 1.0;
        let border = |cell: f64| ((cell + shift[axis] - 1.0) / wide).clamp(0.0, 1.0);
        let (lo, hi) = (border(cell), border(cell + 1.0));
        (lo + gauss * (hi - lo), count * (hi - lo))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integral over the unit square.
    fn integral(cells: Cells, of: impl Fn([f64; 2]) -> f64) -> f64 {
        let sum: f64 = cells.points().map(|(point, weight)| weight * of(point)).sum();
        sum / f64::from(cells.len())
    }

    fn keys() -> impl Iterator<Item = u64> {
        (1..400_u64).map(|k| k.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    #[test]
    fn cells_integrate_cubics_exactly() {
        let cubic = |[s, t]: [f64; 2]| s * s * s + 2.0 * t * t + s * t;
        for key in keys() {
            for count in 1..5 {
                let found = [Cells::even(count), Cells::shifted(count, key)]
                    .map(|cells| integral(cells, cubic));
                let right = 0.25 + 2.0 / 3.0 + 0.25;
                assert!(found.iter().all(|x| (x - right).abs() < 1e-9), "{count}: {found:?}");
            }
        }
    }

    #[test]
    fn shifted_cells_see_what_begins_at_one_edge_better_on_average() {
        for count in 2..5 {
            let (mut even, mut shifted) = (0.0, 0.0);
            for lit in (1..20).map(|k| 0.015 * f64::from(k)) {
                let is_lit = |[_, t]: [f64; 2]| f64::from(u8::from(t < lit));
                even += (integral(Cells::even(count), is_lit) - lit).abs();
                let of = |key| integral(Cells::shifted(count, key), is_lit);
                shifted += (keys().map(of).sum::<f64>() / keys().count() as f64 - lit).abs();
            }
            assert!(1.5 * shifted < even, "{count}: {shifted} and {even}");
        }
    }
}
