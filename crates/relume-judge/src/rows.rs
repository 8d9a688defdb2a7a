//! Whole rows of form factors by rays: what of that which leaves some polygons reaches each other one.
//!
//! Rays start on the polygons by area, leave by the cosine, and end at the first polygon that they meet, so
//! that occlusion, gaps and crossings need no treatment of their own, and a row sums to 1 to the last ray.
//! Lengths are compared with nothing but the ray's own rounding: gaps may be as narrow as 1e-9 of the scene.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use crate::polygon::area_vector;
use crate::{Random, World};

/// Form factors from some polygons (or a point) to every polygon, each with its standard error.
#[derive(Clone, Debug)]
pub struct Row {
    /// Share that reaches the front of each polygon of the world.
    pub factors: Vec<f64>,
    /// Standard errors of [`Row::factors`].
    pub errors: Vec<f64>,
    /// Share that reaches the black back of each polygon.
    pub backs: Vec<f64>,
    /// Share that ends at no front: in the open or on black backs.
    pub lost: f64,
    /// Standard error of [`Row::lost`].
    pub lost_error: f64,
}

impl Row {
    /// Share that reaches the fronts of some polygons together.
    ///
    /// The error is at most the sum of the parts' errors; where only one is reached it is that one's.
    pub fn to(&self, polygons: &[usize]) -> (f64, f64) {
        let factor = polygons.iter().map(|&k| self.factors[k]).sum();
        (factor, polygons.iter().map(|&k| self.errors[k].powi(2)).sum::<f64>().sqrt())
    }
}

/// Independently shifted sets of rays, whose spread is the standard error.
const SETS: u32 = 32;

/// The additive recurrence of four dimensions (Roberts 2018): powers of 1 / x with x^5 = x + 1.
const STEP: f64 = 1.167_303_978_261_418_7;

/// Where rays start.
enum Start<'a> {
    /// Triangles with the running sum of their areas, and the polygon each belongs to.
    Polygons(Vec<(f64, [DVec3; 3], usize)>),
    Point(DVec3, &'a DVec3),
}

/// The row of some polygons taken together, by `rays` rays (rounded up to 32 sets); the same bits on any number of
/// threads.
///
/// Error: standard errors are found from 32 independently shifted sets of points with low discrepancy, and so
/// uncertain by an eighth themselves. A polygon never meets itself or its twin.
pub fn row(world: &World, from: &[usize], rays: u32, seed: u64) -> Row {
    let mut triangles = Vec::new();
    let mut sum = 0.0;
    for &k in from {
        let corners = &world.polygons()[k].corners;
        for pair in corners[1..].windows(2) {
            let triangle = [corners[0], pair[0], pair[1]];
            sum += area_vector(&triangle).length();
            triangles.push((sum, triangle, k));
        }
    }
    triangles.iter_mut().for_each(|t| t.0 /= sum);
    shot(world, &Start::Polygons(triangles), rays, seed)
}

/// What a point with a unit normal sees: the share of its irradiance's directions, weighed by the cosine, that
/// each polygon takes up.
pub fn row_of_point(world: &World, point: DVec3, normal: DVec3, rays: u32, seed: u64) -> Row {
    shot(world, &Start::Point(point, &normal), rays, seed)
}

/// How many rays of a set end at the front and at the back of each polygon.
struct Counts {
    fronts: Vec<u32>,
    backs: Vec<u32>,
}

fn set(world: &World, start: &Start, rays: u32, random: &mut Random) -> Counts {
    let n = world.polygons().len();
    let (mut fronts, mut backs) = (vec![0_u32; n], vec![0_u32; n]);
    let shift: [f64; 4] = std::array::from_fn(|_| random.unit());
    let steps: [f64; 4] = std::array::from_fn(|k| STEP.powi(-(k as i32) - 1));
    for ray in 0..rays {
        let x: [f64; 4] = std::array::from_fn(|k| (shift[k] + f64::from(ray) * steps[k]).fract());
        let (at, normal, except) = match start {
            Start::Point(at, normal) => (*at, **normal, None),
            Start::Polygons(triangles) => {
                let k = triangles.partition_point(|t| t.0 <= x[0]).min(triangles.len() - 1);
                let before = if k == 0 { 0.0 } else { triangles[k - 1].0 };
                let (sum, [a, b, c], polygon) = triangles[k];
                let s = ((x[0] - before) / (sum - before)).clamp(0.0, 1.0).sqrt();
                let at = a + (b - a) * (s * (1.0 - x[1])) + (c - a) * (s * x[1]);
                (at, world.normal(polygon), Some(polygon))
            }
        };
        let (u, v) = normal.any_orthonormal_pair();
        let (r, up) = (x[2].sqrt(), (1.0 - x[2]).sqrt());
        let (sine, cosine) = (2.0 * PI * x[3]).sin_cos();
        let d = u * (r * cosine) + v * (r * sine) + normal * up;
        if let Some(hit) = world.first_hit(at, d, except) {
            let side = if hit.front { &mut fronts } else { &mut backs };
            side[hit.polygon] += 1;
        }
    }
    Counts { fronts, backs }
}

fn shot(world: &World, start: &Start, rays: u32, seed: u64) -> Row {
    let each = rays.div_ceil(SETS).max(1);
    let one = |k: u32| set(world, start, each, &mut Random::of_part(seed, u64::from(k)));
    let sets: Vec<Counts> = (0..SETS).into_par_iter().map(one).collect();
    let share = |count: u32| f64::from(count) / f64::from(each);
    let mean_of = |value: &dyn Fn(&Counts) -> f64| {
        let n = f64::from(SETS);
        let mean = sets.iter().map(value).sum::<f64>() / n;
        let squares = sets.iter().map(|s| (value(s) - mean).powi(2)).sum::<f64>();
        (mean, (squares / (n * (n - 1.0))).sqrt())
    };
    let polygons = 0..world.polygons().len();
    let found: Vec<(f64, f64)> =
        polygons.clone().map(|k| mean_of(&|s| share(s.fronts[k]))).collect();
    let backs = polygons.map(|k| mean_of(&|s| share(s.backs[k])).0).collect();
    let (lost, lost_error) = mean_of(&|s| 1.0 - share(s.fronts.iter().sum()));
    Row {
        factors: found.iter().map(|f| f.0).collect(),
        errors: found.iter().map(|f| f.1).collect(),
        backs,
        lost,
        lost_error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Polygon, exact, seen};

    fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    fn flat([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64, up: bool) -> Polygon {
        let mut corners = vec![v(x0, y0, z), v(x1, y0, z), v(x1, y1, z), v(x0, y1, z)];
        if !up {
            corners.reverse();
        }
        Polygon::black(corners)
    }

    /// The sides of a box, seen from inside or outside.
    fn cuboid(lo: DVec3, hi: DVec3, inward: bool) -> Vec<Polygon> {
        let corner = |bits: usize| {
            let pick = |axis: usize| if bits >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
            v(pick(0), pick(1), pick(2))
        };
        let sides =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let polygon = |s: [usize; 4]| {
            let mut corners = s.map(corner).to_vec();
            if inward {
                corners.reverse();
            }
            Polygon::black(corners)
        };
        sides.map(polygon).to_vec()
    }

    /// Compares a factor with its exact value.
    fn near(what: &str, (found, error): (f64, f64), exact: f64, error_max: f64) {
        println!("{what}: {found:.6} +- {error:.1e}, exactly {exact:.6}");
        // An error found to be zero is that of a factor that no ray misses.
        let bound = 4.0 * error + 1e-9 + if error == 0.0 { 1e-5 } else { 0.0 };
        assert!((found - exact).abs() <= bound, "{what}: {found} +- {error}, not {exact}");
        assert!(error <= error_max, "{what}: +- {error}");
    }

    #[test]
    fn open_pairs_agree_with_closed_forms_down_to_narrow_gaps() {
        let (a, b) = ([[0.0, 1.4], [0.2, 0.9]], [[0.5, 2.0], [0.0, 0.6]]);
        for gap in [1.0, 0.1, 1e-3, 1e-5] {
            let world = World::new(vec![flat(a[0], a[1], 0.0, true), flat(b[0], b[1], gap, false)]);
            let r = row(&world, &[0], 1 << 17, 1);
            let exact = exact::parallel_rectangles(a, b, gap);
            near(&format!("gap {gap}"), r.to(&[1]), exact, 1e-3);
            assert!((r.lost + r.to(&[1]).0 - 1.0).abs() < 1e-12);
        }
        let wall = Polygon::black(vec![v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 2.), v(0., 0., 2.)]);
        let world = World::new(vec![flat([0.0, 0.5], [0.0, 1.0], 0.0, true), wall]);
        let exact = exact::rectangles_at_right_angles(0.5, 2.0, 1.0);
        near("a common edge", row(&world, &[0], 1 << 17, 2).to(&[1]), exact, 1e-3);
    }

    #[test]
    fn a_closed_room_with_a_slab_at_any_gap_loses_nothing() {
        for gap in [0.3, 1e-3, 1e-5, 1e-7] {
            let mut all = cuboid(DVec3::ZERO, v(4., 3., 2.5), true);
            all.extend(cuboid(v(1., 0.7, gap), v(2.06, 1.32, gap + 0.08), false));
            let world = World::new(all);
            for from in 0..12 {
                let r = row(&world, &[from], 1 << 12, 3);
                assert_eq!(r.lost, 0.0, "gap {gap}, from {from}: {:?}", r.backs);
            }
            let (bottom, floor) = ([[1.0, 2.06], [0.7, 1.32]], [[0.0, 4.0], [0.0, 3.0]]);
            let exact = exact::parallel_rectangles(bottom, floor, gap);
            let r = row(&world, &[10], 1 << 16, 4);
            near(&format!("gap {gap}"), r.to(&[4]), exact, 1e-3);
        }
    }

    #[test]
    fn blockers_and_polygons_taken_together_agree_with_what_is_cut() {
        let floor = flat([0.0, 1.0], [0.0, 1.0], 0.0, true);
        let lid = flat([0.0, 1.0], [0.0, 1.0], 1.0, false);
        let plate = Polygon::black(vec![v(0.1, 0.2, 0.4), v(0.8, 0.3, 0.5), v(0.3, 0.9, 0.45)]);
        let exact = seen::form_factor(&floor.corners, &lid.corners, &[&plate.corners], 1e-6);
        let halves =
            [flat([0.0, 0.3], [0.0, 1.0], 0.0, true), flat([0.3, 1.0], [0.0, 1.0], 0.0, true)];
        let world = World::new([halves.to_vec(), vec![lid, plate]].concat());
        let r = row(&world, &[0, 1], 1 << 17, 5);
        near("past a triangle", r.to(&[2]), exact, 1e-3);
        assert!(r.backs[3] > 0.1 && r.factors[3] == 0.0 && r.lost > r.backs[3]);
        let at = v(0.3, 0.4, 0.0);
        let one = row_of_point(&world, at, DVec3::Z, 1 << 17, 6);
        let (lid, plate) = (&world.polygons()[2].corners, &world.polygons()[3].corners[..]);
        let exact = seen::form_factor_from_point(at, DVec3::Z, lid, &[plate]);
        near("from a point", one.to(&[2]), exact, 1e-3);
    }

    #[test]
    fn standard_errors_are_honest() {
        let world = World::new(cuboid(DVec3::ZERO, DVec3::ONE, true));
        let exact = exact::rectangles_at_right_angles(1.0, 1.0, 1.0);
        let off = |seed: u64| {
            let (f, e) = row(&world, &[0], 1 << 12, seed).to(&[2]);
            (f - exact) / e
        };
        let squares: f64 = (0..100).map(|seed| off(seed).powi(2)).sum();
        assert!((50.0..180.0).contains(&squares), "chi squared of 100: {squares}");
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let world = World::new(cuboid(DVec3::ZERO, DVec3::ONE, true));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| row(&world, &[0], 5000, 9).factors)
        };
        assert_eq!(on(1), on(3));
    }
}
