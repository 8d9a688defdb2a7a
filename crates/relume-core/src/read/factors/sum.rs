//! Sums over links that do not depend on their order.

use std::ops::Range;

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

impl Buckets {
    fn row(&self, row: usize) -> &[(u32, u64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }
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

/// Adds those of links to sums; zeros vanish.
pub(super) fn add(to: &mut Upper, links: &[Link], spread: &Spread<'_>, how: (&Fixed, Sign)) {
    let added = contributions(to.len(), links, spread, how);
    to.par_chunks_mut(ROWS_AT_ONCE).enumerate().for_each(|(task, rows)| {
        let mut merger = Merger::new(added.starts.len() - 1);
        for (k, row) in rows.iter_mut().enumerate() {
            let number = task * ROWS_AT_ONCE + k;
            if !added.row(number).is_empty() {
                *row = merger.merged(number, row, added.row(number));
            }
        }
    });
}

/// The same sums with those of links.
pub(super) fn plus(
    before: &Upper,
    links: &[Link],
    spread: &Spread<'_>,
    how: (&Fixed, Sign),
) -> Upper {
    let added = contributions(before.len(), links, spread, how);
    let merge = |(task, rows): (usize, &[Vec<(u32, u64)>])| {
        let mut merger = Merger::new(before.len());
        let row = |(k, row): (usize, &Vec<(u32, u64)>)| {
            let number = task * ROWS_AT_ONCE + k;
            merger.merged(number, row, added.row(number))
        };
        rows.iter().enumerate().map(row).collect::<Vec<_>>()
    };
    before.par_chunks(ROWS_AT_ONCE).enumerate().flat_map_iter(merge).collect()
}

/// Rows that one task sums.
const ROWS_AT_ONCE: usize = 64;

/// Of so many columns one must have been met for going through all to be quicker than sorting.
const DENSE: usize = 16;

/// Sums up the entries of a row by column.
struct Merger {
    sums: Vec<u64>,
    met: Vec<bool>,
    touched: Vec<u32>,
}

impl Merger {
    fn new(columns: usize) -> Merger {
        Merger { sums: vec![0; columns], met: vec![false; columns], touched: Vec::new() }
    }

    fn merged(
        &mut self,
        row: usize,
        before: &[(u32, u64)],
        added: &[(u32, u64)],
    ) -> Vec<(u32, u64)> {
        if added.is_empty() {
            return before.to_vec();
        }
        let Merger { sums, met, touched } = self;
        for &(column, value) in before.iter().chain(added) {
            let at = column as usize;
            if !std::mem::replace(&mut met[at], true) {
                touched.push(column);
            }
            sums[at] = sums[at].wrapping_add(value);
        }
        if touched.len() * DENSE > met.len() {
            touched.clear();
            touched.extend((row as u32..met.len() as u32).filter(|&c| met[c as usize]));
        } else {
            touched.sort_unstable();
        }
        let mut out = Vec::with_capacity(touched.len());
        for column in touched.drain(..) {
            met[column as usize] = false;
            let sum = std::mem::take(&mut sums[column as usize]);
            if sum > 0 {
                out.push((column, sum));
            }
        }
        out
    }
}

/// Room that a table had: pages that are there already are half the price of filling one.
#[derive(Default)]
pub(super) struct Buffers {
    columns: Vec<u32>,
    exchange_m2: Vec<f64>,
}

impl From<Factors> for Buffers {
    fn from(factors: Factors) -> Buffers {
        Buffers { columns: factors.columns, exchange_m2: factors.exchange_m2 }
    }
}

/// Both triangles of a symmetric matrix whose upper one is given.
pub(super) fn mirrored(
    area_m2: Vec<f64>,
    upper: &[Vec<(u32, u64)>],
    fixed: &Fixed,
    room: Buffers,
) -> Factors {
    let groups = area_m2.len();
    let offsets = row_offsets(groups, upper);
    // Every entry is written below.
    let Buffers { mut columns, mut exchange_m2 } = room;
    columns.resize(offsets[groups], 0);
    exchange_m2.resize(offsets[groups], 0.0);
    let (mut columns_left, mut values_left) = (&mut columns[..], &mut exchange_m2[..]);
    let mut tasks = Vec::new();
    for first in (0..groups).step_by(ROWS_AT_ONCE) {
        let rows = first..(first + ROWS_AT_ONCE).min(groups);
        let len = offsets[rows.end] - offsets[rows.start];
        let (columns, values);
        (columns, columns_left) = columns_left.split_at_mut(len);
        (values, values_left) = values_left.split_at_mut(len);
        tasks.push((rows, columns, values));
    }
    tasks.into_par_iter().for_each(|(rows, columns, values)| {
        let start = offsets[rows.start];
        let mut next: Vec<usize> = offsets[rows.clone()].iter().map(|o| o - start).collect();
        for_each_entry(upper, rows.clone(), &mut |row, column, whole| {
            let next = &mut next[row - rows.start];
            (columns[*next], values[*next]) = (column as u32, fixed.area_m2(whole));
            *next += 1;
        });
    });
    let inverse = |a: &f64| if *a > 0.0 { 1.0 / a } else { 0.0 };
    let left = area_m2.iter().map(inverse).collect();
    Factors { area_m2, offsets, columns, exchange_m2, left, right: vec![1.0; groups] }
}

/// Where the entries of each row begin in a symmetric matrix whose upper triangle is given, and where the last ends.
fn row_offsets(groups: usize, upper: &[Vec<(u32, u64)>]) -> Vec<usize> {
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
    offsets
}

/// The entries (row, column, value) of some rows of a symmetric matrix whose upper triangle is given; in each row columns
/// ascend.
fn for_each_entry(
    upper: &[Vec<(u32, u64)>],
    rows: Range<usize>,
    put: &mut dyn FnMut(usize, usize, u64),
) {
    // Row by row: what is left of the diagonal comes from rows above.
    for (row, entries) in upper[..rows.end].iter().enumerate() {
        let of_tasks = entries.partition_point(|e| (e.0 as usize) < rows.start);
        for &(column, whole) in &entries[of_tasks..] {
            let column = column as usize;
            if column >= rows.end {
                break;
            }
            if column != row {
                put(column, row, whole);
            }
        }
        if rows.contains(&row) {
            entries.iter().for_each(|&(column, whole)| put(row, column as usize, whole));
        }
    }
}
