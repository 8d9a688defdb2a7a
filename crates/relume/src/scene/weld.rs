//! One number for all points at about one place. Pure geometry.

use std::collections::BTreeMap;

use glam::DVec3;

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
