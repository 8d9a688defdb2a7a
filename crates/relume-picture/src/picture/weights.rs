//! How much each corner of a convex polygon counts at a point of it.

use glam::DVec2;

/// Wachspress' coordinates of a point in a convex polygon; all zero where they are not determined.
pub(super) fn weights(corners: &[DVec2], point: DVec2) -> Vec<f64> {
    let n = corners.len();
    let corner = |k: usize| corners[k % n];
    let twice = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a).max(0.0);
    let of_edge: Vec<f64> = (0..n).map(|k| twice(point, corner(k), corner(k + 1))).collect();
    let most = of_edge.iter().fold(f64::MIN_POSITIVE, |most, &a| most.max(a));
    let weight = |k: usize| {
        let before = (k + n - 1) % n;
        let others = (0..n).filter(|&edge| edge != k && edge != before);
        let rest: f64 = others.map(|edge| of_edge[edge] / most).product();
        twice(corner(before), corner(k), corner(k + 1)) * rest
    };
    let weights: Vec<f64> = (0..n).map(weight).collect();
    let whole: f64 = weights.iter().sum();
    let share = |w: f64| if whole > 0.0 { w / whole } else { 0.0 };
    weights.into_iter().map(share).collect()
}
