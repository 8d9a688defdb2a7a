//! Visible form factors without sampling: what a point sees of a polygon past others, by cutting
//! away what each hides; and its mean over a polygon, adaptively.

use glam::DVec3;

use crate::exact::lambert;
use crate::polygon::{Quad, Side, area_vector, on_quad, quads_of};

/// Part of the scene's lengths below which something counts as touching.
const TOUCH: f64 = 1e-9;

/// Form factor from a point with a unit `normal` to the visible part of the front of a convex
/// polygon, past convex `blockers` that hide on both sides; exact up to rounding.
///
/// Blockers that touch the source's plane, or lie behind it or below the point's horizon, hide nothing
/// there. Cost: grows with the square of the number of blockers that overlap.
pub fn form_factor_from_point(
    point: DVec3,
    normal: DVec3,
    source: &[DVec3],
    blockers: &[&[DVec3]],
) -> f64 {
    let front = plane(source);
    let size = source.iter().map(|c| c.distance(point)).fold(0.0, f64::max);
    if front.height(point) <= TOUCH * size {
        return 0.0;
    }
    let horizon = Side { through: point, normal };
    let seen = horizon.cut(source, 0.0);
    if seen.is_empty() {
        return 0.0;
    }
    let cone = sides_from(point, &seen);
    let mut parts = vec![seen];
    for blocker in blockers {
        if cone.iter().any(|s| blocker.iter().all(|&c| s.height(c) <= TOUCH * size)) {
            continue;
        }
        let between = front.cut(&horizon.cut(blocker, TOUCH * size), TOUCH * size);
        if between.is_empty() || plane(blocker).height(point).abs() <= TOUCH * size {
            continue;
        }
        parts = hidden_by(parts, &sides_from(point, &between));
    }
    parts.iter().map(|p| lambert(point, normal, p)).sum()
}

/// Mean over a convex polygon of what its points see of another: the form factor from receiver to
/// source past the blockers, to about `error_max` (an estimate, not a bound).
///
/// Both must be one-sided plane polygons; parts behind the other's plane count nothing. Adaptive:
/// 3 x 3 Gauss points against those of the four quarters, at most nine levels deep.
pub fn form_factor(
    receiver: &[DVec3],
    source: &[DVec3],
    blockers: &[&[DVec3]],
    error_max: f64,
) -> f64 {
    let area = area_vector(receiver);
    let seen = plane(source).cut(receiver, 0.0);
    if seen.is_empty() {
        return 0.0;
    }
    let normal = area.normalize();
    let at = |p: DVec3| form_factor_from_point(p, normal, source, blockers);
    let quads = quads_of(&seen);
    let share = error_max * area.length() / quads.len() as f64;
    quads.iter().map(|q| refined(q, gauss(q, &at), share, 9, &at)).sum::<f64>() / area.length()
}

fn plane(polygon: &[DVec3]) -> Side {
    Side { through: polygon[0], normal: area_vector(polygon).normalize() }
}

/// The planes through a point and the edges of a polygon, the polygon in front of each.
fn sides_from(point: DVec3, polygon: &[DVec3]) -> Vec<Side> {
    let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
    let side = |k: usize| {
        let across = (polygon[k] - point).cross(polygon[(k + 1) % polygon.len()] - point);
        let normal = across.try_normalize()?;
        let side = Side { through: point, normal };
        Some(if side.height(middle) < 0.0 { side.flipped() } else { side })
    };
    (0..polygon.len()).filter_map(side).collect()
}

/// What is left of some polygons outside a pyramid.
fn hidden_by(parts: Vec<Vec<DVec3>>, pyramid: &[Side]) -> Vec<Vec<DVec3>> {
    let mut left = Vec::new();
    for part in parts {
        let mut inside = part;
        for side in pyramid {
            let out = side.flipped().cut(&inside, 0.0);
            if !out.is_empty() {
                left.push(out);
            }
            inside = side.cut(&inside, 0.0);
            if inside.is_empty() {
                break;
            }
        }
    }
    left
}

/// Three Gauss-Legendre points on [0, 1] and their weights.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Integral over a quadrilateral by 3 x 3 points.
fn gauss(q: &Quad, at: &impl Fn(DVec3) -> f64) -> f64 {
    let mut sum = 0.0;
    for (s, ws) in GAUSS {
        for (t, wt) in GAUSS {
            let (p, area) = on_quad(q, s, t);
            sum += ws * wt * area * at(p);
        }
    }
    sum
}

fn refined(q: &Quad, whole: f64, error_max: f64, levels: u32, at: &impl Fn(DVec3) -> f64) -> f64 {
    let quarters = quarters(q);
    let values = quarters.map(|part| gauss(&part, at));
    let sum: f64 = values.iter().sum();
    if levels == 0 || (sum - whole).abs() <= error_max {
        return sum;
    }
    // Halved, not quartered: the errors of the parts have different signs.
    let parts = quarters.iter().zip(values);
    parts.map(|(part, value)| refined(part, value, error_max / 2.0, levels - 1, at)).sum()
}

fn quarters(q: &Quad) -> [Quad; 4] {
    let p = |s: f64, t: f64| on_quad(q, s, t).0;
    let part = |s: f64, t: f64| [p(s, t), p(s + 0.5, t), p(s + 0.5, t + 0.5), p(s, t + 0.5)];
    [part(0.0, 0.0), part(0.5, 0.0), part(0.5, 0.5), part(0.0, 0.5)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact;

    fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    fn floor(lo: f64, hi: f64, z: f64) -> Quad {
        [v(lo, lo, z), v(hi, lo, z), v(hi, hi, z), v(lo, hi, z)]
    }

    fn lid(lo: f64, hi: f64, z: f64) -> Quad {
        let mut q = floor(lo, hi, z);
        q.reverse();
        q
    }

    #[test]
    fn free_pairs_agree_with_the_catalogue() {
        let near = |f: f64, e: f64| assert!((f - e).abs() < 1e-7, "{f} {e}");
        near(form_factor(&floor(0., 1., 0.), &lid(0., 1., 1.), &[], 1e-8), 0.199_824_895_698);
        let wall = [v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)];
        near(form_factor(&floor(0., 1., 0.), &wall, &[], 1e-8), 0.200_043_776_075);
        let disc = |r: f64, z: f64| -> Vec<DVec3> {
            let at = |k: u32| (f64::from(k) / 96.0 * std::f64::consts::TAU).sin_cos();
            (0..96).map(|k| v(r * at(k).1, r * at(k).0, z)).collect()
        };
        let mut above = disc(1.0, 1.0);
        above.reverse();
        let f = form_factor(&disc(1.0, 0.0), &above, &[], 1e-6);
        assert!((f - exact::coaxial_discs(1.0, 1.0, 1.0)).abs() < 1e-3, "{f}");
    }

    #[test]
    fn the_blocked_pair_is_exact() {
        let half = floor(0.0, 0.5, 0.5);
        let (a, b) = (floor(0., 1., 0.), lid(0., 1., 1.));
        let f = form_factor(&a, &b, &[&half], 1e-6);
        assert!((f - 0.149_868_671_774).abs() < 1e-6, "{f}");
        // The same blocker twice, and one in pieces, hide no more.
        let pieces = [
            floor(0.0, 0.3, 0.5),
            [v(0.3, 0., 0.5), v(0.5, 0., 0.5), v(0.5, 0.5, 0.5), v(0.3, 0.5, 0.5)],
            [v(0., 0.2, 0.5), v(0.3, 0.2, 0.5), v(0.3, 0.5, 0.5), v(0., 0.5, 0.5)],
        ];
        let point = v(0.2, 0.4, 0.0);
        let whole = form_factor_from_point(point, DVec3::Z, &b, &[&half, &half]);
        let parts: Vec<&[DVec3]> = pieces.iter().map(|p| &p[..]).collect();
        let in_parts = form_factor_from_point(point, DVec3::Z, &b, &parts);
        assert!((whole - in_parts).abs() < 1e-12, "{whole} {in_parts}");
        assert!(whole > 0.01);
    }

    #[test]
    fn what_is_not_between_hides_nothing() {
        let (point, source) = (DVec3::ZERO, lid(-1., 1., 1.));
        let free = form_factor_from_point(point, DVec3::Z, &source, &[]);
        for z in [-0.5, 0.0, 1.0, 1.5] {
            let plate = floor(-0.3, 0.3, z);
            let f = form_factor_from_point(point, DVec3::Z, &source, &[&plate]);
            assert!((f - free).abs() < 1e-12, "a plate at {z}: {f} {free}");
        }
        let upright = [v(0., -9., -9.), v(0., 9., -9.), v(0., 9., 9.), v(0., -9., 9.)];
        let f = form_factor_from_point(v(0.1, 0.0, 0.0), DVec3::Z, &source, &[&upright]);
        let half = [v(0., 1., 1.), v(1., 1., 1.), v(1., -1., 1.), v(0., -1., 1.)];
        assert!((f - lambert(v(0.1, 0., 0.), DVec3::Z, &half)).abs() < 1e-8);
    }
}
