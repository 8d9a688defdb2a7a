//! Form factors between a user's own things, summed from links of mixed levels.

use crate::pair::Link;
use crate::scene::Scene;
use crate::space::{Solved, SpaceState};

use super::pieces::Sharing;

mod fragments;
mod grouping;
mod parts;
mod sum;

pub use grouping::{Grouping, GroupingError};
pub use parts::PartFactors;

use crate::read::tuning::CLOSED_WITHIN;
use fragments::{Fragments, Spread};
use sum::{Buffers, Fixed, Sign, mirrored, plus};

/// What is done to form factors so that rows sum to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Closure {
    /// Nothing: form factors stay as the links have them.
    None,
    /// Each row is divided by its sum; reciprocity no longer holds, by as much as the sums differed.
    Rows,
    /// Exchange areas are scaled by a factor for each of their two ends until every row sums to 1:
    /// reciprocity is kept.
    Reciprocal,
}

/// Error: a row sum differs from 1 by more than links err; closure needs a closed scene.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Open {
    /// The row furthest from 1.
    pub group: u32,
    /// Its sum.
    pub row_sum: f64,
}

/// Largest distance of a row sum from 1 that [`Closure::Reciprocal`] leaves.
const BALANCED_WITHIN: f64 = 1e-13;

/// Steps after which [`Closure::Reciprocal`] ends, however far it came.
const BALANCE_STEPS: usize = 10_000;

/// Form factors between groups at one instant: a sparse matrix.
///
/// F(g -> h) = X(g, h) / A(g), where the exchange area X(g, h) is the sum of X V over all links
/// between g and h, at whatever level, and the same number in both directions: reciprocity holds to
/// rounding. The sum does not depend on the order of the links, so that entries without a changed
/// link keep their bits from frame to frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Factors {
    /// Area of each group, m2: of its patches that are present; 0 while none is.
    pub area_m2: Vec<f64>,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    /// Exchange areas, m2.
    exchange_m2: Vec<f64>,
    /// A factor is an exchange area times the left one of its row and the right one of its column.
    left: Vec<f64>,
    right: Vec<f64>,
}

impl Factors {
    /// Number of groups.
    pub fn len(&self) -> usize {
        self.area_m2.len()
    }

    /// Whether there is no group.
    pub fn is_empty(&self) -> bool {
        self.area_m2.is_empty()
    }

    /// Factors above 0 stored, over all rows.
    pub fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Factors above 0 from a group, by ascending group that they lead to.
    pub fn row(&self, from: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let left = self.left[from as usize];
        self.range(from).map(move |k| {
            let to = self.columns[k];
            (to, self.exchange_m2[k] * left * self.right[to as usize])
        })
    }

    /// Sum of the factors from a group; 1 where nothing escapes, up to the errors of the links.
    pub fn row_sum(&self, from: u32) -> f64 {
        self.row(from).fold(0.0, |sum, (_, factor)| sum + factor)
    }

    /// Share of a group's flux that escapes, 1 minus its row sum: into the open, onto black backs of single-sided polygons, and
    /// onto patches of no group. Off by as much as the row sum is, and so perhaps below 0. `None` while the group is absent.
    pub fn escapes(&self, from: u32) -> Option<f64> {
        (self.area_m2[from as usize] > 0.0).then(|| 1.0 - self.row_sum(from))
    }

    fn range(&self, row: u32) -> std::ops::Range<usize> {
        self.offsets[row as usize]..self.offsets[row as usize + 1]
    }

    /// Makes rows sum to 1.
    ///
    /// # Errors
    /// Where the scene is open: a row sum of a group that is present differs from 1 by more than 0.1.
    pub fn close(&mut self, closure: Closure) -> Result<(), Open> {
        if closure == Closure::None {
            return Ok(());
        }
        let sums: Vec<f64> = (0..self.len() as u32).map(|g| self.row_sum(g)).collect();
        let mut worst: Option<Open> = None;
        for (group, &row_sum) in (0..).zip(&sums) {
            let off = (row_sum - 1.0).abs();
            let present = self.area_m2[group as usize] > 0.0;
            if present && off > worst.map_or(CLOSED_WITHIN, |w| (w.row_sum - 1.0).abs()) {
                worst = Some(Open { group, row_sum });
            }
        }
        if let Some(open) = worst {
            return Err(open);
        }
        match closure {
            Closure::None => {}
            Closure::Rows => {
                let divide = |(left, sum): (&mut f64, &f64)| {
                    if *sum > 0.0 {
                        *left /= sum;
                    }
                };
                self.left.iter_mut().zip(&sums).for_each(divide);
            }
            Closure::Reciprocal => self.balance(),
        }
        Ok(())
    }

    /// Finds d with sum over h of d_g X_gh d_h = A_g: d_g moves to the root of d_g A_g / (X d)_g,
    /// which converges for symmetric matrices without negative entries where a solution exists.
    /// Source: Knight, Ruiz, Ucar 2014, on the symmetric scaling of Sinkhorn and Knopp 1967.
    fn balance(&mut self) {
        let mut d = vec![1.0; self.len()];
        for _ in 0..BALANCE_STEPS {
            let mut off = 0.0_f64;
            let mut next = d.clone();
            for g in 0..self.len() {
                let sum: f64 = self
                    .range(g as u32)
                    .map(|k| self.exchange_m2[k] * d[self.columns[k] as usize])
                    .sum();
                if sum > 0.0 {
                    off = off.max((d[g] * sum / self.area_m2[g] - 1.0).abs());
                    next[g] = (d[g] * self.area_m2[g] / sum).sqrt();
                }
            }
            if off <= BALANCED_WITHIN {
                break;
            }
            d = next;
        }
        for g in 0..self.len() {
            self.left[g] *= d[g];
            self.right[g] *= d[g];
        }
    }

    /// Calls `visit` with (from, to, factor) for every entry whose factor has other bits than in
    /// `before`, with 0 for those that are gone; `to` is `None` for what escapes. Groups that are
    /// absent now have no entries.
    ///
    /// # Panics
    /// If the two are of different groupings.
    pub fn changed_since(
        &self,
        before: Option<&Factors>,
        visit: &mut dyn FnMut(u32, Option<u32>, f64),
    ) {
        for from in (0..self.len() as u32).filter(|&g| self.area_m2[g as usize] > 0.0) {
            let escapes = self.escapes(from);
            let Some(before) = before else {
                self.row(from).for_each(|(to, factor)| visit(from, Some(to), factor));
                escapes.iter().for_each(|&e| visit(from, None, e));
                continue;
            };
            let mut old = before.row(from).peekable();
            let mut new = self.row(from).peekable();
            loop {
                let (was, is) = (old.peek().copied(), new.peek().copied());
                let to = match (was, is) {
                    (None, None) => break,
                    (Some((to, _)), None) | (None, Some((to, _))) => to,
                    (Some((one, _)), Some((other, _))) => one.min(other),
                };
                let was = old.next_if(|(column, _)| *column == to).map_or(0.0, |(_, f)| f);
                let is = new.next_if(|(column, _)| *column == to).map_or(0.0, |(_, f)| f);
                if was != is {
                    visit(from, Some(to), is);
                }
            }
            if let Some(e) = escapes.filter(|_| escapes != before.escapes(from)) {
                visit(from, None, e);
            }
        }
    }
}

impl Factors {
    /// Form factors between the groups of a grouping that fits.
    pub(super) fn of(solved: &Solved, grouping: &Grouping) -> Factors {
        let SpaceState { scene, forest, .. } = &solved.space;
        let fragments = Fragments::whole(forest, grouping);
        let fixed = Fixed::of(scene.area_m2());
        let links: Vec<Link> = solved.tree.links().collect();
        let spread = Spread { sharing: Sharing::new(solved), fragments: &fragments };
        let none = vec![Vec::new(); grouping.names.len()];
        let upper = plus(&none, &links, &spread, (&fixed, Sign::Plus));
        mirrored(areas(solved, scene, grouping), &upper, &fixed, Buffers::default())
    }
}

/// Area of each group, m2: of its patches that are present.
fn areas(solved: &Solved, scene: &Scene, grouping: &Grouping) -> Vec<f64> {
    let mut areas = vec![0.0; grouping.names.len()];
    for (patch, group) in scene.patches.iter().zip(&grouping.of_patch) {
        if let Some(group) = group
            && solved.space.view.is_present(patch.body)
        {
            areas[*group as usize] += patch.area_m2();
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three groups of 1, 2 and 4 m2 with these exchange areas, in rows.
    fn factors(rows: [[f64; 3]; 3]) -> Factors {
        let fixed = Fixed::of(7.0);
        let whole = |x: f64| (x * Fixed::VISIBLE * fixed.scale).round() as u64;
        let upper: Vec<Vec<(u32, u64)>> = (0..3)
            .map(|r| (r..3).map(|c| (c as u32, whole(rows[r][c]))).filter(|e| e.1 > 0).collect())
            .collect();
        mirrored(vec![1.0, 2.0, 4.0], &upper, &fixed, Buffers::default())
    }

    /// Rows sum to 1.02, 0.97 and 0.995.
    const NEARLY: [[f64; 3]; 3] = [[0.0, 0.5, 0.52], [0.5, 0.0, 1.44], [0.52, 1.44, 2.02]];

    fn matrix(f: &Factors) -> Vec<Vec<(u32, f64)>> {
        (0..3).map(|g| f.row(g).collect()).collect()
    }

    #[test]
    fn both_directions_carry_the_same_exchange_area() {
        let f = factors(NEARLY);
        assert_eq!(f.entries(), 7);
        let m = matrix(&f);
        assert!((m[0][0].1 - 0.5).abs() < 1e-12 && (m[1][0].1 - 0.25).abs() < 1e-12);
        assert_eq!(m[1].iter().map(|e| e.0).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(f.area_m2[1] * m[1][1].1, f.area_m2[2] * m[2][1].1);
        assert!((f.escapes(0).unwrap() + 0.02).abs() < 1e-12);
    }

    #[test]
    fn closures_make_rows_sum_to_one_and_one_keeps_reciprocity() {
        for closure in [Closure::Rows, Closure::Reciprocal] {
            let mut f = factors(NEARLY);
            f.close(closure).unwrap();
            let m = matrix(&f);
            for g in 0..3 {
                assert!((f.row_sum(g) - 1.0).abs() < 1e-12, "{closure:?} {}", f.row_sum(g));
            }
            let off = (f.area_m2[1] * m[1][1].1 / (f.area_m2[2] * m[2][1].1) - 1.0).abs();
            assert_eq!(off < 1e-12, closure == Closure::Reciprocal, "{closure:?} {off}");
        }
        let mut f = factors(NEARLY);
        f.close(Closure::None).unwrap();
        assert_eq!(f, factors(NEARLY));
    }

    #[test]
    fn an_open_scene_is_not_closed() {
        let mut rows = NEARLY;
        (rows[0][1], rows[1][0]) = (0.1, 0.1);
        let open = factors(rows).close(Closure::Rows).unwrap_err();
        assert!(open.group == 0 && (open.row_sum - 0.62).abs() < 1e-9, "{open:?}");
    }

    #[test]
    fn only_what_differs_is_visited_and_what_is_gone_is_zero() {
        let visited = |now: &Factors, before: Option<&Factors>| {
            let mut out = Vec::new();
            now.changed_since(before, &mut |from, to, f| out.push((from, to, f)));
            out
        };
        let one = factors(NEARLY);
        assert_eq!(visited(&one, None).len(), 7 + 3);
        assert_eq!(visited(&one, Some(&one)), []);
        let mut rows = NEARLY;
        (rows[0][1], rows[1][0]) = (0.0, 0.0);
        let other = factors(rows);
        let found = visited(&other, Some(&one));
        let ends: Vec<_> = found.iter().map(|v| (v.0, v.1)).collect();
        assert_eq!(ends, [(0, Some(1)), (0, None), (1, Some(0)), (1, None)]);
        assert_eq!((found[0].2, found[2].2), (0.0, 0.0));
        assert_eq!(visited(&one, Some(&other)).len(), 4);
    }

    #[test]
    fn whole_numbers_have_room_for_the_sum_at_any_scale() {
        for area in [1e-12, 1.0, 6.6, 1e12] {
            let fixed = Fixed::of(area);
            let all = area * Fixed::VISIBLE * fixed.scale;
            assert!(all <= (1_u64 << 60) as f64 && all > (1_u64 << 58) as f64, "{area}");
        }
    }
}
