//! The radiosity of constant elements by a dense matrix and elimination: no hierarchy, no links, no
//! iteration.

use glam::DVec3;
use rayon::prelude::*;

use crate::polygon::{Polygon, area_vector};
use crate::seen::form_factor;

/// A piece of a polygon, with one radiosity.
#[derive(Clone, Debug)]
pub struct Element {
    /// The polygon it is part of.
    pub polygon: usize,
    /// Its corners, counter-clockwise seen from the front, convex, m.
    pub corners: Vec<DVec3>,
}

impl Element {
    /// Area, m2.
    pub fn area_m2(&self) -> f64 {
        area_vector(&self.corners).length()
    }
}

/// Exchange areas of all elements with all, occlusion by the polygons included: symmetric, row by row,
/// m2. Each is A F of the smaller end, F to about `error_max` of itself.
///
/// Cost: the square of the number of elements times the number of polygons.
pub fn exchange_areas(polygons: &[Polygon], elements: &[Element], error_max: f64) -> Vec<f64> {
    let n = elements.len();
    let areas: Vec<f64> = elements.iter().map(Element::area_m2).collect();
    let between = |i: usize, k: usize| {
        let (small, large) = if areas[i] <= areas[k] { (i, k) } else { (k, i) };
        let ends = [&elements[small], &elements[large]];
        if ends[0].polygon == ends[1].polygon {
            return 0.0;
        }
        let own =
            |f: usize| ends.iter().any(|e| e.polygon == f || polygons[e.polygon].twin == Some(f));
        let others = (0..polygons.len()).filter(|f| !own(*f));
        let blockers: Vec<&[DVec3]> = others.map(|f| &polygons[f].corners[..]).collect();
        areas[small] * form_factor(&ends[0].corners, &ends[1].corners, &blockers, error_max)
    };
    let rows: Vec<Vec<f64>> =
        (0..n).into_par_iter().map(|i| (0..=i).map(|k| between(i, k)).collect()).collect();
    let mut out = vec![0.0; n * n];
    for (i, row) in rows.iter().enumerate() {
        for (k, &x) in row.iter().enumerate() {
            out[i * n + k] = x;
            out[k * n + i] = x;
        }
    }
    out
}

/// Radiosities of all elements, W/m2, linear RGB: B = M + rho F B by elimination with pivots.
pub fn radiosities(
    polygons: &[Polygon],
    elements: &[Element],
    exchange_areas: &[f64],
) -> Vec<[f64; 3]> {
    let n = elements.len();
    let mut out = vec![[0.0; 3]; n];
    for c in 0..3 {
        let mut matrix = vec![0.0; n * n];
        for (i, e) in elements.iter().enumerate() {
            let share = polygons[e.polygon].reflectance[c] / e.area_m2();
            for k in 0..n {
                matrix[i * n + k] = -share * exchange_areas[i * n + k];
            }
            matrix[i * n + i] += 1.0;
        }
        let right = elements.iter().map(|e| polygons[e.polygon].exitance[c]).collect();
        for (b, x) in out.iter_mut().zip(solved(matrix, right)) {
            b[c] = x;
        }
    }
    out
}

/// Solves a system of linear equations by Gaussian elimination with partial pivoting.
fn solved(mut a: Vec<f64>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for column in 0..n {
        let size = |row: &usize| a[row * n + column].abs();
        let pivot = (column..n).max_by(|p, q| size(p).total_cmp(&size(q))).expect("not empty");
        if pivot != column {
            (0..n).for_each(|k| a.swap(pivot * n + k, column * n + k));
            b.swap(pivot, column);
        }
        let (above, below) = a.split_at_mut((column + 1) * n);
        let top = &above[column * n..];
        let known = b[column];
        let rows = below.chunks_mut(n).zip(&mut b[column + 1..]);
        for (row, right) in rows {
            let share = row[column] / top[column];
            (column..n).for_each(|k| row[k] -= share * top[k]);
            *right -= share * known;
        }
    }
    for row in (0..n).rev() {
        let known: f64 = (row + 1..n).map(|k| a[row * n + k] * b[k]).sum();
        b[row] = (b[row] - known) / a[row * n + row];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elimination_solves_with_a_pivot_of_zero() {
        let a = vec![0.0, 2.0, 1.0, 1.0, -1.0, 0.5, 3.0, 0.0, 1.0];
        let x = [1.0, -2.0, 0.25];
        let b = (0..3).map(|r| (0..3).map(|k| a[r * 3 + k] * x[k]).sum()).collect();
        for (got, want) in solved(a, b).into_iter().zip(x) {
            assert!((got - want).abs() < 1e-14, "{got} {want}");
        }
    }

    #[test]
    fn the_furnace_of_a_box_in_a_room_is_exact() {
        let v = DVec3::new;
        let sides = |lo: DVec3, hi: DVec3, inward: bool| {
            let corner = |bits: usize| {
                v([lo.x, hi.x][bits & 1], [lo.y, hi.y][bits >> 1 & 1], [lo.z, hi.z][bits >> 2])
            };
            let quads = [
                [0, 2, 6, 4],
                [1, 5, 7, 3],
                [0, 4, 5, 1],
                [2, 3, 7, 6],
                [0, 1, 3, 2],
                [4, 6, 7, 5],
            ];
            quads.map(|mut q| {
                if !inward {
                    q.reverse();
                }
                let polygon = Polygon::black(q.map(corner).to_vec());
                Polygon { reflectance: [0.5; 3], exitance: [1.0; 3], ..polygon }
            })
        };
        let mut polygons = sides(DVec3::ZERO, DVec3::ONE, true).to_vec();
        polygons.extend(sides(DVec3::splat(0.3), v(0.6, 0.5, 0.7), false));
        let elements: Vec<Element> = polygons
            .iter()
            .enumerate()
            .map(|(polygon, f)| Element { polygon, corners: f.corners.clone() })
            .collect();
        let x = exchange_areas(&polygons, &elements, 1e-5);
        for (k, e) in elements.iter().enumerate() {
            let row: f64 = x[k * 12..(k + 1) * 12].iter().sum();
            assert!((row / e.area_m2() - 1.0).abs() < 2e-4, "row sum {}", row / e.area_m2());
        }
        for b in radiosities(&polygons, &elements, &x) {
            assert!((b[0] - 2.0).abs() < 1e-3, "{b:?}");
        }
    }
}
