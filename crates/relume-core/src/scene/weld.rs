//! One number for all points at about one place, and sets of what hangs together. Pure geometry.

use std::collections::BTreeMap;

use glam::DVec3;

/// Corners closer together than this share of a body's coordinates are one, and this much a corner may lie in front of a
/// face: a few roundings of 32-bit numbers.
const WELDED: f64 = 1e-6;

/// Gives points the number of the first one within a tolerance.
pub(super) struct Weld {
    /// Metres.
    pub(super) tolerance: f64,
    /// In the order in which they came.
    pub(super) points: Vec<DVec3>,
    cells: BTreeMap<[i64; 3], Vec<u32>>,
}

impl Weld {
    pub(super) fn new(tolerance: f64) -> Weld {
        Weld { tolerance, points: Vec::new(), cells: BTreeMap::new() }
    }

    /// With a tolerance that fits the coordinates of corners in the frame of their body.
    pub(super) fn of_corners(corners: impl Iterator<Item = DVec3>) -> Weld {
        let reach = corners.fold(0.0_f64, |reach, p| reach.max(p.abs().max_element()));
        Weld::new(WELDED * reach)
    }

    /// The number of a point.
    pub(super) fn vertex(&mut self, p: DVec3) -> u32 {
        // Large cells, so that a point seldom has to look into a neighbouring one.
        let size = (1024.0 * self.tolerance).max(f64::MIN_POSITIVE);
        let cell = |q: DVec3| (q / size).floor().to_array().map(|x| x as i64);
        let reach = DVec3::splat(self.tolerance);
        let (low, high) = (cell(p - reach), cell(p + reach));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let near = self.cells.get(&[x, y, z]).into_iter().flatten();
                    for &v in near {
                        if self.points[v as usize].distance(p) <= self.tolerance {
                            return v;
                        }
                    }
                }
            }
        }
        let v = self.points.len() as u32;
        self.points.push(p);
        self.cells.entry(cell(p)).or_default().push(v);
        v
    }
}

/// Numbers in sets that are joined one by one; each set goes by its smallest number.
#[derive(Default)]
pub(super) struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// Makes a set of its own of each number below `len` that is in none.
    pub(super) fn extend(&mut self, len: usize) {
        self.parent.extend(self.parent.len() as u32..len as u32);
    }

    /// The smallest number of the set that a number is in.
    pub(super) fn root(&mut self, mut of: u32) -> u32 {
        while self.parent[of as usize] != of {
            // The next one may skip a step.
            self.parent[of as usize] = self.parent[self.parent[of as usize] as usize];
            of = self.parent[of as usize];
        }
        of
    }

    /// Makes the sets of two numbers one.
    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
