//! Sums over links that do not depend on their order.

use rayon::prelude::*;

use crate::pair::Link;

use super::Factors;
use super::fragments::Spread;

/// Exchange areas as whole numbers, so that their sums do not depend on an order: X V in 65,535ths,
/// times a power of two that leaves room for the sum over the whole scene.
pub(super) struct Fixed {
    pub(super) scale: f64,
}

impl Fixed {
    pub(super) const VISIBLE: f64 = 65_535.0;

    pub(super) fn of(area_m2: f64) -> Fixed {
        let mut scale = 1.0;
        // Rows of links that err may sum to more than 1: a factor of 8 to spare.
        let room = (1_u64 << 60) as f64;
        while area_m2 * Fixed::VISIBLE * scale > room {
            scale *= 0.5;
        }
        while area_m2 * Fixed::VISIBLE * scale * 2.0 < room {
            scale *= 2.0;
        }
        Fixed { scale }
    }

    fn whole(&self, area_m2: f64) -> u64 {
        (area_m2 * Fixed::VISIBLE * self.scale).round() as u64
    }

    fn area_m2(&self, whole: u64) -> f64 {
        whole as f64 / (Fixed::VISIBLE * self.scale)
    }
}

/// Numbers of (row, column) with row <= column, bucketed by row.
struct Buckets {
    starts: Vec<usize>,
    entries: Vec<(u32, u64)>,
}

/// Sums by row, then by ascending column from the row's own on; without zeros.
pub(super) type Upper = Vec<Vec<(u32, u64)>>;

/// Links that one task looks at.
const LINKS_AT_ONCE: usize = 64;

/// Whether links are added to sums or taken out of them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sign {
    /// Added.
    Plus,
    /// Taken out; they must have been added.
    Minus,
}

/// What every link adds; light within a group counts in both directions.
fn contributions(
    groups: usize,
    links: &[Link],
    spread: &Spread<'_>,
    (fixed, sign): (&Fixed, Sign),
) -> Buckets {
    let of_links = |links: &[Link]| {
        let mut found: Vec<(u32, u32, u64)> = Vec::with_capacity(links.len());
        for link in links {
            spread.spread(link, &mut |a, b, area_m2| {
                let both = if a == b { 2 } else { 1 };
                let whole = both * fixed.whole(area_m2);
                let signed = if sign == Sign::Minus { whole.wrapping_neg() } else { whole };
                found.push((a.min(b), a.max(b), signed));
            });
        }
        found
    };
    let found: Vec<Vec<(u32, u32, u64)>> = links.par_chunks(LINKS_AT_ONCE).map(of_links).collect();
    let mut starts = vec![0; groups + 1];
    for (row, ..) in found.iter().flatten() {
        starts[*row as usize + 1] += 1;
    }
    for row in 1..starts.len() {
        starts[row] += starts[row - 1];
    }
    let mut next = starts.clone();
    let mut entries = vec![(0, 0); *starts.last().expect("one more than rows")];
    for (row, column, value) in found.iter().flatten() {
        entries[next[*row as usize]] = (*column, *value);
        next[*row as usize] += 1;
    }
    Buckets { starts, entries }
}

/// Sums to which those of links are added; zeros vanish.
pub(super) fn plus(
    before: &Upper,
    links: &[Link],
    spread: &Spread<'_>,
    how: (&Fixed, Sign),
) -> Upper {
    merged(before, &contributions(before.len(), links, spread, how))
}

/// Rows that one task sums.
const ROWS_AT_ONCE: usize = 64;

/// Sums of the entries of each row by column, with those there were before.
fn merged(before: &Upper, buckets: &Buckets) -> Upper {
    let rows: Vec<usize> = (0..before.len()).collect();
    let sum_rows = |rows: &[usize]| {
        let mut sums = vec![0_u64; before.len()];
        let mut met = vec![false; before.len()];
        let mut touched = Vec::new();
        let mut sum_row = |row: usize| {
            let added = &buckets.entries[buckets.starts[row]..buckets.starts[row + 1]];
            if added.is_empty() {
                return before[row].clone();
            }
            for &(column, value) in before[row].iter().chain(added) {
                let at = column as usize;
                if !std::mem::replace(&mut met[at], true) {
                    touched.push(column);
                }
                sums[at] = sums[at].wrapping_add(value);
            }
            touched.sort_unstable();
            let take = |c: &u32| {
                met[*c as usize] = false;
                (*c, std::mem::take(&mut sums[*c as usize]))
            };
            let out = touched.iter().map(take).filter(|(_, sum)| *sum > 0).collect();
            touched.clear();
            out
        };
        rows.iter().map(|&row| sum_row(row)).collect::<Vec<_>>()
    };
    rows.par_chunks(ROWS_AT_ONCE).flat_map_iter(sum_rows).collect()
}

/// Both triangles of a symmetric matrix whose upper one is given.
pub(super) fn mirrored(area_m2: Vec<f64>, upper: &[Vec<(u32, u64)>], fixed: &Fixed) -> Factors {
    let groups = area_m2.len();
    let mut offsets = vec![0; groups + 1];
    for (row, entries) in upper.iter().enumerate() {
        for &(column, _) in entries {
            offsets[row + 1] += 1;
            if column as usize != row {
                offsets[column as usize + 1] += 1;
            }
        }
    }
    for row in 1..=groups {
        offsets[row] += offsets[row - 1];
    }
    let mut next = offsets.clone();
    let mut columns = vec![0; offsets[groups]];
    let mut exchange_m2 = vec![0.0; offsets[groups]];
    let mut put = |row: usize, column: u32, value: f64| {
        (columns[next[row]], exchange_m2[next[row]]) = (column, value);
        next[row] += 1;
    };
    // Row by row, so that columns ascend: what is left of the diagonal comes from rows above.
    for (row, entries) in upper.iter().enumerate() {
        for &(column, whole) in entries {
            let value = fixed.area_m2(whole);
            put(row, column, value);
            if column as usize != row {
                put(column as usize, row as u32, value);
            }
        }
    }
    let inverse = |a: &f64| if *a > 0.0 { 1.0 / a } else { 0.0 };
    let left = area_m2.iter().map(inverse).collect();
    Factors { area_m2, offsets, columns, exchange_m2, left, right: vec![1.0; groups] }
}
