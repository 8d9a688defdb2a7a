//! Path-traced irradiance with its standard error: every bounce, no bias.
//!
//! At each vertex of a path one emitter is sampled by area and one direction by its cosine; what both
//! can find is weighted by the balance heuristic (Veach 1997). Paths end by Russian roulette.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use crate::polygon::area_vector;
use crate::{Random, World};

/// Where irradiance is wanted: at a point, or in the mean over a parallelogram.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// The point, or a corner of the parallelogram, m.
    pub origin: DVec3,
    /// Unit normal of the side that receives.
    pub normal: DVec3,
    /// First side of the parallelogram; zero for a point.
    pub u: DVec3,
    /// Second side of the parallelogram; zero for a point.
    pub v: DVec3,
}

impl Site {
    /// A point, on a surface or off any.
    pub fn point(origin: DVec3, normal: DVec3) -> Site {
        Site { origin, normal, u: DVec3::ZERO, v: DVec3::ZERO }
    }

    /// The mean over a parallelogram that faces `u x v`.
    pub fn mean(origin: DVec3, u: DVec3, v: DVec3) -> Site {
        Site { origin, normal: u.cross(v).normalize(), u, v }
    }
}

/// Irradiance with its standard error, W/m2, linear RGB.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    /// Mean over the samples.
    pub irradiance: [f64; 3],
    /// Standard error of that mean, from the spread between batches.
    pub standard_error: [f64; 3],
}

/// Paths in a batch: stratified 8 x 8 in the first direction, in the first point on an emitter, and
/// over the site.
pub const BATCH: u32 = 64;

/// Points start this far off their surface, in sizes of the scene: given in six decimals, they may lie
/// a little behind it.
const LIFT: f64 = 1e-6;

/// Irradiance at each site from `batches` (two or more) batches of 64 paths; the same bits on any number
/// of threads.
pub fn irradiance(world: &World, sites: &[Site], batches: u32, seed: u64) -> Vec<Estimate> {
    let tracer = Tracer::new(world);
    let at = |(k, site): (usize, &Site)| {
        let mut random = Random::of_part(seed, k as u64);
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for _ in 0..batches {
            let mean = tracer.batch(site, &mut random);
            for c in 0..3 {
                sum[c] += mean[c];
                squares[c] += mean[c] * mean[c];
            }
        }
        let n = f64::from(batches);
        let spread = |c: usize| (squares[c] / n - (sum[c] / n).powi(2)).max(0.0) / (n - 1.0);
        Estimate {
            irradiance: sum.map(|s| s / n),
            standard_error: [0, 1, 2].map(|c| spread(c).sqrt()),
        }
    };
    sites.par_iter().enumerate().map(at).collect()
}

/// Irradiance at points by particles: they leave the emitters by area and cosine, and from every place that
/// one comes to, what it sends straight to each site is counted. The better way round where what is bright is small,
/// such as a ceiling close above a lamp; unbounded in spread where a site lies close to other surfaces.
///
/// `batches` (two or more) of 64 particles; the same bits on any number of threads.
pub fn irradiance_by_particles(
    world: &World,
    sites: &[Site],
    batches: u32,
    seed: u64,
) -> Vec<Estimate> {
    let tracer = Tracer::new(world);
    let one = |index: u32| {
        let mut random = Random::of_part(seed, u64::from(index));
        let mut sums = vec![[0.0; 3]; sites.len()];
        let shift = random.bits() as u32 % BATCH;
        for k in 0..BATCH {
            let mut cell = |k: u32| in_cell(k, &mut random);
            let (from, way) = (cell(k), cell((k * 29 + shift) % BATCH));
            tracer.particle(sites, from, way, &mut random, &mut sums);
        }
        sums.iter().map(|s| s.map(|x| x / f64::from(BATCH))).collect::<Vec<[f64; 3]>>()
    };
    let found: Vec<Vec<[f64; 3]>> = (0..batches).into_par_iter().map(one).collect();
    let n = f64::from(batches);
    let of = |site: usize| {
        let mean = [0, 1, 2].map(|c| found.iter().map(|f| f[site][c]).sum::<f64>() / n);
        let spread = |c: usize| {
            let squares: f64 = found.iter().map(|f| (f[site][c] - mean[c]).powi(2)).sum();
            (squares / (n * (n - 1.0))).sqrt()
        };
        Estimate { irradiance: mean, standard_error: [0, 1, 2].map(spread) }
    };
    (0..sites.len()).map(of).collect()
}

/// Flux that arrives at each polygon, W, with its standard error, by particles from the emitters: all of them from one set of
/// paths. In place of irradiance, W.
///
/// `batches` (two or more) of 64 particles; the same bits on any number of threads.
pub fn arriving(world: &World, batches: u32, seed: u64) -> Vec<Estimate> {
    let tracer = Tracer::new(world);
    let count = world.polygons().len();
    let one = |index: u32| {
        let mut random = Random::of_part(seed, u64::from(index));
        let mut sums = vec![[0.0; 3]; count];
        let shift = random.bits() as u32 % BATCH;
        for k in 0..BATCH {
            let mut cell = |k: u32| in_cell(k, &mut random);
            let (from, way) = (cell(k), cell((k * 29 + shift) % BATCH));
            let mut arrive = |polygon: usize, flux: &[f64; 3]| {
                (0..3).for_each(|c| sums[polygon][c] += flux[c] / f64::from(BATCH));
            };
            tracer.follow(from, way, &mut random, &mut |_, _, _| (), &mut arrive);
        }
        sums
    };
    let add = |mut a: [Vec<[f64; 3]>; 2], b: [Vec<[f64; 3]>; 2]| {
        for (a, b) in a.iter_mut().zip(b) {
            for (a, b) in a.iter_mut().zip(b) {
                (0..3).for_each(|c| a[c] += b[c]);
            }
        }
        a
    };
    // In parts of which each is summed in order.
    let part = |part: u32| {
        let mut sums = [vec![[0.0; 3]; count], vec![[0.0; 3]; count]];
        for index in (part..batches).step_by(PARTS as usize) {
            let found = one(index);
            let squares = found.iter().map(|f| f.map(|x| x * x)).collect();
            sums = add(sums, [found, squares]);
        }
        sums
    };
    let parts: Vec<[Vec<[f64; 3]>; 2]> = (0..PARTS).into_par_iter().map(part).collect();
    let zero = [vec![[0.0; 3]; count], vec![[0.0; 3]; count]];
    let [sums, squares] = parts.into_iter().fold(zero, add);
    let n = f64::from(batches);
    let estimate = |(sum, square): (&[f64; 3], &[f64; 3])| {
        let spread = |c: usize| (square[c] / n - (sum[c] / n).powi(2)).max(0.0) / (n - 1.0);
        Estimate {
            irradiance: sum.map(|s| s / n),
            standard_error: [0, 1, 2].map(|c| spread(c).sqrt()),
        }
    };
    sums.iter().zip(&squares).map(estimate).collect()
}

/// A point in a cell of the unit square in 8 x 8.
fn in_cell(k: u32, random: &mut Random) -> [f64; 2] {
    [(k % 8, random.unit()), (k / 8, random.unit())]
        .map(|(cell, within)| (f64::from(cell) + within) / 8.0)
}

/// Parts of batches that are followed beside each other.
const PARTS: u32 = 64;

struct Tracer<'a> {
    world: &'a World,
    /// Polygons that emit, with the running sum of their shares of the flux.
    emitters: Vec<(f64, usize)>,
    /// Density of sampled points on each polygon, 1/m2; 0 for those that do not emit.
    density: Vec<f64>,
}

/// A place a path passes, or starts from.
#[derive(Clone, Copy)]
struct Vertex {
    at: DVec3,
    normal: DVec3,
    polygon: Option<usize>,
}

impl<'a> Tracer<'a> {
    fn new(world: &'a World) -> Tracer<'a> {
        let flux: Vec<f64> =
            world.polygons().iter().map(|f| f.exitance.iter().sum::<f64>() * f.area_m2()).collect();
        let all: f64 = flux.iter().sum();
        let mut emitters = Vec::new();
        let mut sum = 0.0;
        for (k, &w) in flux.iter().enumerate().filter(|f| *f.1 > 0.0) {
            sum += w / all;
            emitters.push((sum, k));
        }
        let areas = world.polygons().iter().map(|f| f.area_m2());
        let density = flux.iter().zip(areas).map(|(w, a)| if *w > 0.0 { w / all / a } else { 0.0 });
        Tracer { world, density: density.collect(), emitters }
    }

    /// Mean over a batch.
    fn batch(&self, site: &Site, random: &mut Random) -> [f64; 3] {
        let mut sum = [0.0; 3];
        // Which cells of the three squares go together differs from batch to batch.
        let shifts = [random.bits(), random.bits()].map(|b| b as u32 % BATCH);
        let lift = site.normal * (LIFT * self.world.size_m());
        for k in 0..BATCH {
            let mut cell = |k: u32| in_cell(k, random);
            let (way, lamp, place) =
                (cell(k), cell((k + shifts[0]) % BATCH), cell((k * 29 + shifts[1]) % BATCH));
            let at = site.origin + site.u * place[0] + site.v * place[1] + lift;
            let start = Vertex { at, normal: site.normal, polygon: None };
            let found = self.path(start, way, lamp, random);
            (0..3).for_each(|c| sum[c] += found[c] / f64::from(BATCH));
        }
        sum
    }

    /// Irradiance that one path finds.
    fn path(&self, start: Vertex, way: [f64; 2], lamp: [f64; 2], random: &mut Random) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let mut share = [1.0; 3];
        let (mut here, mut way, mut lamp) = (start, way, lamp);
        for depth in 0_u32.. {
            self.add_lamp(&here, lamp, &share, &mut sum);
            let (d, cosine) = around(here.normal, way);
            let Some(hit) = self.world.first_hit(here.at, d, here.polygon) else { return sum };
            if !hit.front {
                return sum;
            }
            let polygon = &self.world.polygons()[hit.polygon];
            let normal = self.world.normal(hit.polygon);
            if self.density[hit.polygon] > 0.0 {
                let by_area = self.density[hit.polygon] * hit.distance.powi(2) / -normal.dot(d);
                let by_cosine = cosine / PI;
                let weight = by_cosine / (by_cosine + by_area);
                (0..3).for_each(|c| sum[c] += share[c] * polygon.exitance[c] * weight);
            }
            (0..3).for_each(|c| share[c] *= polygon.reflectance[c]);
            let most = share.iter().fold(0.0_f64, |m, s| m.max(*s));
            let survives = if depth < 3 && most > 0.0 { 1.0 } else { most.min(0.95) };
            if random.unit() >= survives {
                return sum;
            }
            share = share.map(|s| s / survives);
            here = Vertex { at: here.at + d * hit.distance, normal, polygon: Some(hit.polygon) };
            way = [random.unit(), random.unit()];
            lamp = [random.unit(), random.unit()];
        }
        unreachable!("a path ends by roulette")
    }

    /// Adds what a sampled point of an emitter sends to a vertex.
    fn add_lamp(&self, here: &Vertex, lamp: [f64; 2], share: &[f64; 3], sum: &mut [f64; 3]) {
        let Some((polygon, point)) = self.on_emitter(lamp) else { return };
        let way = point - here.at;
        let square = way.length_squared();
        let d = way / square.sqrt();
        let (receives, sends) = (here.normal.dot(d), -self.world.normal(polygon).dot(d));
        if receives <= 0.0 || sends <= 0.0 || here.polygon == Some(polygon) {
            return;
        }
        let by_area = self.density[polygon] * square / sends;
        let arrives = receives / PI / (by_area + receives / PI);
        if self.world.clear(here.at, point, [here.polygon, Some(polygon)]) {
            let exitance = &self.world.polygons()[polygon].exitance;
            (0..3).for_each(|c| sum[c] += share[c] * exitance[c] * arrives);
        }
    }

    /// Follows a particle from an emitter until it is absorbed or lost, and adds what it sends to each site.
    fn particle(
        &self,
        sites: &[Site],
        from: [f64; 2],
        way: [f64; 2],
        random: &mut Random,
        sums: &mut [[f64; 3]],
    ) {
        let mut send = |at: DVec3, polygon: usize, flux: &[f64; 3]| {
            let normal = self.world.normal(polygon);
            for (site, sum) in sites.iter().zip(sums.iter_mut()) {
                let place = site.origin + site.normal * (LIFT * self.world.size_m());
                let to = place - at;
                let square = to.length_squared();
                let (sends, receives) = (normal.dot(to), -site.normal.dot(to));
                if sends > 0.0
                    && receives > 0.0
                    && self.world.clear(at, place, [Some(polygon), None])
                {
                    let share = sends * receives / (PI * square * square);
                    (0..3).for_each(|c| sum[c] += flux[c] * share);
                }
            }
        };
        self.follow(from, way, random, &mut send, &mut |_, _| ());
    }

    /// Follows a particle from an emitter until it is absorbed or lost: what leaves each place (with its polygon, W), and what arrives at
    /// polygons, W.
    fn follow(
        &self,
        from: [f64; 2],
        way: [f64; 2],
        random: &mut Random,
        send: &mut dyn FnMut(DVec3, usize, &[f64; 3]),
        arrive: &mut dyn FnMut(usize, &[f64; 3]),
    ) {
        let Some((mut polygon, mut at)) = self.on_emitter(from) else { return };
        let exitance = self.world.polygons()[polygon].exitance;
        let mut flux = exitance.map(|m| m / self.density[polygon]);
        let mut way = way;
        for depth in 0_u32.. {
            send(at, polygon, &flux);
            let (d, _) = around(self.world.normal(polygon), way);
            let Some(hit) = self.world.first_hit(at, d, Some(polygon)) else { return };
            if !hit.front {
                return;
            }
            (at, polygon) = (at + d * hit.distance, hit.polygon);
            arrive(polygon, &flux);
            let reflectance = self.world.polygons()[polygon].reflectance;
            (0..3).for_each(|c| flux[c] *= reflectance[c]);
            let most = reflectance.iter().fold(0.0_f64, |m, s| m.max(*s));
            let survives = if depth < 3 && most > 0.0 { 1.0 } else { most.min(0.95) };
            if random.unit() >= survives {
                return;
            }
            flux = flux.map(|f| f / survives);
            way = [random.unit(), random.unit()];
        }
    }

    /// A point on an emitter from a point of the unit square.
    fn on_emitter(&self, [mut s, t]: [f64; 2]) -> Option<(usize, DVec3)> {
        let k =
            self.emitters.partition_point(|e| e.0 <= s).min(self.emitters.len().checked_sub(1)?);
        let before = if k == 0 { 0.0 } else { self.emitters[k - 1].0 };
        let (sum, polygon) = self.emitters[k];
        s = ((s - before) / (sum - before)).clamp(0.0, 1.0);
        Some((polygon, on_polygon(&self.world.polygons()[polygon].corners, s, t)))
    }
}

/// A direction with a cosine distribution about a normal, and its cosine.
fn around(normal: DVec3, [s, t]: [f64; 2]) -> (DVec3, f64) {
    let (u, v) = normal.any_orthonormal_pair();
    let (r, up) = (s.sqrt(), (1.0 - s).sqrt());
    let (sine, cosine) = (2.0 * PI * t).sin_cos();
    (u * (r * cosine) + v * (r * sine) + normal * up, up)
}

/// Uniform on a convex polygon, from a point of the unit square.
fn on_polygon(corners: &[DVec3], s: f64, t: f64) -> DVec3 {
    if let &[a, b, c, d] = corners
        && (a + c - b - d).length_squared() <= 1e-18 * (c - a).length_squared()
    {
        return a + (b - a) * s + (d - a) * t;
    }
    let whole = area_vector(corners).length();
    let mut left = s * whole;
    for k in 1..corners.len() - 1 {
        let triangle = [corners[0], corners[k], corners[k + 1]];
        let area = area_vector(&triangle).length();
        if left <= area || k == corners.len() - 2 {
            let root = (left / area).min(1.0).sqrt();
            return triangle[0].lerp(triangle[1].lerp(triangle[2], t), root);
        }
        left -= area;
    }
    corners[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Polygon;

    fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    /// The sides of a box, seen from inside.
    fn room(reflectance: f64, exitance: f64) -> Vec<Polygon> {
        let corner = |bits: usize| v((bits & 1) as f64, (bits >> 1 & 1) as f64, (bits >> 2) as f64);
        let sides =
            [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
        let polygon = |s: [usize; 4]| Polygon {
            reflectance: [reflectance; 3],
            exitance: [exitance, 2.0 * exitance, 0.0],
            ..Polygon::black(s.map(corner).to_vec())
        };
        sides.map(polygon).to_vec()
    }

    #[test]
    fn the_furnace_is_exact_without_noise_from_lamps_alone() {
        let world = World::new(room(0.5, 1.0));
        let sites = [
            Site::point(v(0.0, 0.3, 0.6), DVec3::X),
            Site::mean(v(0.2, 0.1, 0.0), v(0.3, 0.0, 0.0), v(0.0, 0.5, 0.0)),
            Site::point(v(0.5, 0.5, 0.5), v(1.0, 2.0, 3.0).normalize()),
        ];
        for e in irradiance(&world, &sites, 200, 1) {
            for (c, exact) in [2.0, 4.0, 0.0].into_iter().enumerate() {
                let off = (e.irradiance[c] - exact).abs();
                assert!(off <= 4.0 * e.standard_error[c] && off < 0.02, "{e:?}");
            }
        }
    }

    #[test]
    fn direct_light_of_a_lamp_behind_a_plate_agrees_with_the_cut_polygon() {
        let lamp = [v(0.2, 0.2, 1.0), v(0.2, 0.9, 1.0), v(0.9, 0.9, 1.0), v(0.9, 0.2, 1.0)];
        let plate = [v(0.1, 0.1, 0.5), v(0.6, 0.1, 0.5), v(0.5, 0.5, 0.5)];
        let mut polygons = vec![Polygon::black(lamp.to_vec()), Polygon::black(plate.to_vec())];
        polygons[0].exitance = [3.0; 3];
        let world = World::new(polygons);
        let point = v(0.3, 0.4, 0.0);
        let e = irradiance(&world, &[Site::point(point, DVec3::Z)], 400, 2)[0];
        let f = crate::seen::form_factor_from_point(point, DVec3::Z, &lamp, &[&plate]);
        let free = crate::seen::form_factor_from_point(point, DVec3::Z, &lamp, &[]);
        assert!(f < 0.9 * free && f > 0.1 * free, "{f} {free}");
        let off = e.irradiance[0] - 3.0 * f;
        assert!(off.abs() < 4.0 * e.standard_error[0] && off.abs() < 5e-3, "{e:?} {f}");
    }

    #[test]
    fn particles_find_what_paths_find() {
        let mut polygons = room(0.6, 0.0);
        let up = [v(0.3, 0.4, 0.9), v(0.6, 0.4, 0.9), v(0.6, 0.5, 0.9), v(0.3, 0.5, 0.9)];
        polygons.push(Polygon { exitance: [9.0, 3.0, 1.0], ..Polygon::black(up.to_vec()) });
        let world = World::new(polygons);
        let sites = [
            Site::point(v(0.4, 0.5, 0.0), DVec3::Z),
            Site::point(v(0.0, 0.5, 0.4), DVec3::X),
            Site::point(v(0.5, 0.5, 0.5), v(1.0, 2.0, 3.0).normalize()),
        ];
        let paths = irradiance(&world, &sites, 1000, 4);
        let particles = irradiance_by_particles(&world, &sites, 1000, 5);
        for (a, b) in paths.iter().zip(&particles) {
            for c in 0..3 {
                let error = a.standard_error[c].hypot(b.standard_error[c]);
                let off = (a.irradiance[c] - b.irradiance[c]).abs();
                assert!(off <= 4.0 * error && error < 0.02 * b.irradiance[c], "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn what_arrives_at_sides_is_their_mean_irradiance_times_their_area() {
        let mut polygons = room(0.6, 0.0);
        let up = [v(0.3, 0.4, 0.9), v(0.6, 0.4, 0.9), v(0.6, 0.5, 0.9), v(0.3, 0.5, 0.9)];
        polygons.push(Polygon { exitance: [9.0, 3.0, 1.0], ..Polygon::black(up.to_vec()) });
        let world = World::new(polygons);
        let found = arriving(&world, 2000, 5);
        let sides = [
            (5, Site::mean(v(1.0, 0.0, 1.0), -DVec3::X, DVec3::Y)),
            (0, Site::mean(DVec3::ZERO, DVec3::Y, DVec3::Z)),
        ];
        for (k, side) in sides {
            let mean = irradiance(&world, &[side], 2000, 4)[0];
            for c in 0..3 {
                let error = mean.standard_error[c].hypot(found[k].standard_error[c]);
                let off = (mean.irradiance[c] - found[k].irradiance[c]).abs();
                assert!(
                    off <= 4.0 * error && error < 0.02 * mean.irradiance[c],
                    "{k}: {mean:?} {found:?}"
                );
            }
        }
        // Nothing gets out: what is absorbed was emitted.
        let absorbed: f64 =
            found[..6].iter().map(|e| 0.4 * e.irradiance[0]).sum::<f64>() + found[6].irradiance[0];
        assert!((absorbed / (9.0 * 0.03) - 1.0).abs() < 0.02, "{absorbed}");
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let world = World::new(room(0.8, 0.5));
        let sites: Vec<Site> =
            (0..20).map(|k| Site::point(v(0.0, 0.5, f64::from(k) / 20.0), DVec3::X)).collect();
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| irradiance(&world, &sites, 4, 9));
            found.iter().map(|e| e.irradiance.map(f64::to_bits)).collect::<Vec<_>>()
        };
        assert_eq!(on(1), on(3));
    }
}
