//! Polygons to triangles.
//!
//! Must not know files.

use glam::{DVec2, DVec3};

use relume_core::scene::flatten::area_vector;

/// Corners of a polygon that is not convex, at most: cutting ears is quadratic.
const CORNERS_MAX: usize = 1024;

/// The triangles of a polygon, by its corners' indices into `points`, wound as it is: a fan where it is convex,
/// otherwise by cutting ears (Meisters 1975). `None` where it has too many corners for that.
pub(super) fn triangles(points: &[DVec3], corners: &[u32]) -> Option<Vec<[u32; 3]>> {
    let fan = || (2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]).collect();
    if corners.len() < 4 {
        return Some(fan());
    }
    let places: Vec<DVec3> = corners.iter().map(|&c| points[c as usize]).collect();
    let flat = projected(&places);
    let n = flat.len();
    let convex = (0..n).all(|k| turn(flat[k], flat[(k + 1) % n], flat[(k + 2) % n]) >= 0.0);
    if convex || n == 4 && is_fan(&flat) {
        return Some(fan());
    }
    (n <= CORNERS_MAX).then(|| {
        let ears = ears(&flat);
        ears.into_iter().map(|t| t.map(|k| corners[k])).collect()
    })
}

/// The corners in the plane that the polygon is nearest to, counter-clockwise.
fn projected(places: &[DVec3]) -> Vec<DVec2> {
    let normal = area_vector(places).normalize_or_zero();
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    places.iter().map(|p| *p - places[0]).map(|p| DVec2::new(p.dot(u), p.dot(v))).collect()
}

/// Twice the area of a triangle, positive counter-clockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether both triangles of a quadrilateral from its first corner are wound like itself.
fn is_fan(flat: &[DVec2]) -> bool {
    turn(flat[0], flat[1], flat[2]) > 0.0 && turn(flat[0], flat[2], flat[3]) > 0.0
}

/// Cuts corners off that hold no other; where none does (sides that cross) the next one.
fn ears(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    let mut cut = Vec::new();
    while left.len() > 3 {
        let n = left.len();
        let corner = |k: usize| [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
        let is_ear = |k: &usize| {
            let [a, b, c] = corner(*k);
            let within = |p: usize| {
                let sides = [(a, b), (b, c), (c, a)];
                sides.iter().all(|&(from, to)| turn(flat[from], flat[to], flat[p]) >= 0.0)
            };
            let same = |p: usize| [a, b, c].iter().any(|&k| flat[k] == flat[p]);
            turn(flat[a], flat[b], flat[c]) > 0.0 && !left.iter().any(|&p| !same(p) && within(p))
        };
        let ear = (0..n).find(is_ear).unwrap_or(0);
        cut.push(corner(ear));
        left.remove(ear);
    }
    cut.push([left[0], left[1], left[2]]);
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The area of what a polygon in the plane z = x is cut into.
    fn area(outline: &[[f64; 2]]) -> f64 {
        let points: Vec<DVec3> = outline.iter().map(|p| DVec3::new(p[0], p[1], p[0])).collect();
        let corners: Vec<u32> = (0..points.len() as u32).collect();
        let cut = triangles(&points, &corners).unwrap();
        assert_eq!(cut.len(), outline.len() - 2);
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| points[k as usize]);
            0.5 * (b - a).cross(c - a).dot(area_vector(&points).normalize()) / 2.0_f64.sqrt()
        };
        assert!(cut.iter().all(|t| of(t) >= 0.0), "{cut:?}");
        cut.iter().map(of).sum()
    }

    #[test]
    fn polygons_of_any_outline_are_covered_once() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(area(&[[0., 0.], [2., 0.], [2., 1.], [0., 1.]]), 2.0));
        // An arrow, from each of its corners.
        let arrow = [[0., 0.], [2., 2.], [0., 1.], [-2., 2.]];
        for first in 0..4 {
            let turned: Vec<[f64; 2]> = (0..4).map(|k| arrow[(first + k) % 4]).collect();
            assert!(near(area(&turned), 2.0));
        }
        // A comb, both ways round.
        let comb = [
            [0., 0.],
            [5., 0.],
            [5., 2.],
            [4., 2.],
            [4., 1.],
            [3., 1.],
            [3., 2.],
            [2., 2.],
            [2., 1.],
            [1., 1.],
            [1., 2.],
            [0., 2.],
        ];
        assert!(near(area(&comb), 8.0));
        let mut back = comb;
        back.reverse();
        assert!(near(area(&back), 8.0));
    }

    #[test]
    fn too_many_corners_are_not_cut() {
        let star = |n: u32| {
            let points: Vec<DVec3> = (0..n)
                .map(|k| {
                    (f64::from(k) * std::f64::consts::TAU / f64::from(n), 1.0 + f64::from(k % 2))
                })
                .map(|(a, r)| DVec3::new(r * a.cos(), r * a.sin(), 0.0))
                .collect();
            triangles(&points, &(0..n).collect::<Vec<u32>>())
        };
        assert_eq!(star(64).unwrap().len(), 62);
        assert!(star(1026).is_none());
    }
}
