//! How good a solution is, measured by itself: the residual of the rendering equation with exact visibility, at points.
//!
//! Where light arrives at a point of a surface, what leaves send there can be gathered with visibility found at that point:
//! of lamps exactly, of all else along rays. What a leaf sends differs from what is gathered there by its residual; what
//! the solution is off by is that residual, plus the error of what it gathers, times the reflectance: a Neumann series, of
//! which terms are sampled by walks from point to point (residual Monte Carlo: Halton 1994). Residuals are small, so few
//! walks tell much. Directions follow fixed sequences: the same solution is always told the same.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::element::Shape;
use crate::follow::Accuracy;
use crate::scene::PatchId;
use crate::space::{Sensor, Solved};
use crate::transport::{Hit, Rays};

use super::gather::{Look, Purpose};
use crate::geometry::spread;

use super::sensors::irradiance;
use super::snapshot::{self, Leaf};
use super::tuning::{ACCURACY_RAYS, BRIGHT, DARK, LAMPS, STEPS, WALK_LEAST, WALKS};

/// What one point says: errors (sum of channels), relative to what arrives, by each walk.
struct Found {
    at: DVec3,
    error: [f64; WALKS],
}

/// A point, and the irradiance that is said to be there, W/m2, sum of channels.
struct Place {
    sensor: Sensor,
    said: f64,
}

/// Errors of what the mesh says, estimated at so many points.
pub(super) fn accuracy(solved: &Solved, points: usize) -> Accuracy {
    let leaves = Leaves::new(solved);
    let meter = Meter::new(solved, &leaves);
    accuracy_of(&meter.all(&leaves.places(solved, points), DARK * leaves.mean))
}

/// Errors of what sensors read, relative to what arrives at each; where none does, there is none.
pub(super) fn accuracy_at(solved: &Solved, sensors: &[Sensor]) -> Accuracy {
    let meter = Meter::new(solved, &Leaves::new(solved));
    let read = |&sensor: &Sensor| {
        let said = all(irradiance(solved, &sensor));
        Place { sensor, said }
    };
    let places: Vec<Place> = sensors.par_iter().map(read).collect();
    accuracy_of(&meter.all(&places, 0.0))
}

fn accuracy_of(found: &[Found]) -> Accuracy {
    let mean_of = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let squares: Vec<f64> = found.iter().map(|f| mean_square(&f.error)).collect();
    let scatter: Vec<f64> = found.iter().map(Found::variance_of_square).collect();
    let resolved = (2.0 * scatter.iter().sum::<f64>().sqrt() / found.len().max(1) as f64).sqrt();
    let worst = found.iter().max_by(|a, b| a.mean().abs().total_cmp(&b.mean().abs()));
    Accuracy {
        points: found.len() as u32,
        rms: mean_of(&squares).max(0.0).sqrt(),
        nine_tenths: nine_tenths(found.iter().map(|f| (f.mean().abs(), 1.0)).collect()),
        resolved,
        mean: mean_of(&found.iter().map(Found::mean).collect::<Vec<f64>>()),
        largest: worst.map_or(0.0, Found::mean),
        largest_at: worst.map_or([0.0; 3], |f| f.at.to_array()),
    }
}

impl Found {
    fn mean(&self) -> f64 {
        self.error.iter().sum::<f64>() / WALKS as f64
    }

    /// Variance that `mean_square` has of a point without error, from the scatter of its walks.
    fn variance_of_square(&self) -> f64 {
        let mean = self.mean();
        let variance =
            self.error.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (WALKS - 1) as f64;
        2.0 * variance * variance / (WALKS * (WALKS - 1)) as f64
    }
}

/// Square of the mean that samples have: the mean of the products of two different ones, in which their scatter does not
/// count.
fn mean_square(samples: &[f64; WALKS]) -> f64 {
    let sum: f64 = samples.iter().sum();
    let squares: f64 = samples.iter().map(|x| x * x).sum();
    (sum * sum - squares) / (WALKS * (WALKS - 1)) as f64
}

/// The size that nine tenths of some errors, by what they stand for, do not exceed.
pub(super) fn nine_tenths(mut sizes: Vec<(f64, f64)>) -> f64 {
    sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = 0.9 * sizes.iter().map(|size| size.1).sum::<f64>();
    let found = sizes.iter().find(|size| {
        left -= size.1;
        left <= 0.0
    });
    found.map_or(0.0, |size| size.0)
}

pub(super) fn all(e: [f64; 3]) -> f64 {
    e.iter().sum()
}

/// The leaves of a solution, with their areas, m2.
struct Leaves {
    leaves: Vec<(PatchId, Leaf, f64)>,
    /// Mean irradiance, W/m2, sum of channels.
    mean: f64,
    /// Mean radiosity, W/m2, sum of channels.
    radiosity: f64,
}

impl Leaves {
    fn new(solved: &Solved) -> Leaves {
        let mesh = snapshot::take(solved, &solved.links, &solved.radiosity);
        let patches = (0..solved.space.scene.patches.len() as u32).map(PatchId);
        let leaves: Vec<(PatchId, Leaf, f64)> = patches
            .flat_map(|patch| mesh.leaves_of(patch).iter().map(move |leaf| (patch, *leaf)))
            .map(|(patch, leaf)| (patch, leaf, Shape { corners: leaf.corners, len: 4 }.area()))
            .collect();
        let area_m2 = leaves.iter().map(|leaf| leaf.2).sum::<f64>().max(f64::MIN_POSITIVE);
        let mean = |of: &dyn Fn(&Leaf) -> f64| {
            leaves.iter().map(|(_, leaf, area)| area * of(leaf)).sum::<f64>() / area_m2
        };
        let (irradiance, radiosity) =
            (mean(&arrives), mean(&|leaf| all(leaf.radiosity.map(f64::from))));
        Leaves { leaves, mean: irradiance, radiosity }
    }

    /// Places spread evenly over what is lit.
    fn places(&self, solved: &Solved, points: usize) -> Vec<Place> {
        let is_lit = |(_, leaf, _): &&(PatchId, Leaf, f64)| arrives(leaf) > DARK * self.mean;
        let lit_m2: f64 = self.leaves.iter().filter(is_lit).map(|leaf| leaf.2).sum();
        let mut lit = self.leaves.iter().filter(is_lit);
        let (mut now, mut before_m2) = (lit.next(), 0.0);
        let mut places = Vec::with_capacity(points);
        for k in 0..points {
            let target_m2 = (k as f64 + spread(k, 0)) / points as f64 * lit_m2;
            while let Some((_, _, area)) = now
                && before_m2 + area < target_m2
            {
                before_m2 += area;
                now = lit.next();
            }
            let Some((patch, leaf, _)) = now else { break };
            let p = point_of(leaf.corners, [spread(k, 1), spread(k, 2)]);
            let at = solved.space.view.patch(*patch).world.point(p);
            let said = all(leaf.irradiance_at(p).map(f64::from));
            places.push(Place { sensor: sensor_on(solved, *patch, at), said });
        }
        places
    }
}

fn arrives(leaf: &Leaf) -> f64 {
    all(leaf.irradiance.map(f64::from))
}

pub(super) fn sensor_on(solved: &Solved, patch: PatchId, at: DVec3) -> Sensor {
    Sensor { at, normal: solved.space.view.occluder(patch).plane.normal }
}

/// Measures a solution.
struct Meter<'a> {
    solved: &'a Solved,
    rays: Rays<'a>,
    /// What is gathered exactly, ascending.
    lamps: Vec<PatchId>,
    /// How far from their surfaces rays begin, metres.
    lift_m: f64,
}

impl<'a> Meter<'a> {
    fn new(solved: &'a Solved, leaves: &Leaves) -> Meter<'a> {
        let space = &solved.space;
        let exitance = |&patch: &PatchId| {
            all(space.world.exitance(&space.scene, &space.scene.patches[patch.0 as usize]))
        };
        let patches = (0..space.scene.patches.len() as u32).map(PatchId);
        let is_present = |patch: &PatchId| space.view.is_present(space.view.patch(*patch).body);
        let mut lamps: Vec<PatchId> = patches
            .filter(|patch| exitance(patch) > BRIGHT * leaves.radiosity)
            .filter(is_present)
            .collect();
        lamps.sort_by(|a, b| exitance(b).total_cmp(&exitance(a)));
        lamps.truncate(LAMPS);
        lamps.sort_unstable();
        let lift_m = 1e-9 * space.view.far_m();
        Meter { solved, rays: Rays::new(&space.view, &space.forest), lamps, lift_m }
    }

    fn all(&self, places: &[Place], dark: f64) -> Vec<Found> {
        let one = |(k, place): (usize, &Place)| self.errors(k, place, dark);
        places.par_iter().enumerate().filter_map(one).collect()
    }

    /// Relative errors at one place; `None` where it is dark: covered, most likely.
    fn errors(&self, k: usize, place: &Place, dark: f64) -> Option<Found> {
        let lamps = Look::new(self.solved, &place.sensor, Purpose::Beyond).direct(&self.lamps);
        let (mut right, mut arrives) = ([0.0; WALKS], 0.0);
        for (walk, right) in right.iter_mut().enumerate() {
            let walk = k * WALKS + walk;
            let (by_leaves, hits) = self.look_around(&place.sensor, lamps, (walk, 0));
            *right = all(by_leaves) + all(self.error_of_hits(hits, walk));
            arrives += all(by_leaves) / WALKS as f64;
        }
        // Relative to what leaves send: a divisor of its own for each walk would bend their mean.
        (arrives > dark).then(|| Found {
            at: place.sensor.at,
            error: right.map(|right| (place.said - right) / arrives),
        })
    }

    /// What arrives at a point if leaves are taken at their word, W/m2, by rays in all directions and what comes from lamps;
    /// and the leaves that were met, in an order that the number of the walk and the step decides.
    fn look_around(
        &self,
        sensor: &Sensor,
        lamps: [f64; 3],
        (walk, step): (usize, usize),
    ) -> ([f64; 3], Vec<Option<Hit>>) {
        let (one, two) = sensor.normal.any_orthonormal_pair();
        let from = sensor.at + sensor.normal * self.lift_m;
        let side = ACCURACY_RAYS.isqrt();
        let shift = [spread(walk, 3 * step + 3), spread(walk, 3 * step + 4)];
        let hits: Vec<Option<Hit>> = (0..ACCURACY_RAYS)
            .map(|k| {
                // As many rays as the cosine weighs.
                let [u, v] = [(k / side, shift[0]), (k % side, shift[1])]
                    .map(|(cell, shift)| (cell as f64 + shift) / side as f64);
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * v);
                let across = u.sqrt();
                let up = (1.0 - u).max(0.0).sqrt();
                self.rays
                    .first(from, one * (across * cos) + two * (across * sin) + sensor.normal * up)
            })
            .collect();
        let mut sum = lamps;
        for hit in hits.iter().flatten() {
            let sent = self.said_by(hit);
            let is_lamp = self.lamps.binary_search(&hit.patch).is_ok();
            let counted = if is_lamp { self.emitted_by(hit) } else { [0.0; 3] };
            (0..3).for_each(|c| sum[c] += (sent[c] - counted[c]) / ACCURACY_RAYS as f64);
        }
        (sum, hits)
    }

    /// How much more arrives from some leaves than they say, W/m2, by one walk.
    fn error_of_hits(&self, mut hits: Vec<Option<Hit>>, walk: usize) -> [f64; 3] {
        let (mut error, mut weight) = ([0.0; 3], [1.0; 3]);
        for step in 0..STEPS {
            let chosen = (spread(walk, 3 * step + 5) * ACCURACY_RAYS as f64) as usize;
            let Some(hit) = hits[chosen.min(ACCURACY_RAYS - 1)] else { break };
            if self.solved.space.forest.is_distant(hit.leaf) {
                break;
            }
            let sensor = sensor_on(self.solved, hit.patch, hit.at);
            let lamps = Look::new(self.solved, &sensor, Purpose::Beyond).direct(&self.lamps);
            let (arrives, next) = self.look_around(&sensor, lamps, (walk, step + 1));
            let (said, m) = (self.said_by(&hit), self.emitted_by(&hit));
            let space = &self.solved.space;
            let rho =
                space.world.reflectance(&space.scene, &space.scene.patches[hit.patch.0 as usize]);
            for c in 0..3 {
                error[c] += weight[c] * (m[c] + rho[c] * arrives[c] - said[c]);
                weight[c] *= rho[c];
            }
            if weight.iter().all(|&w| w < WALK_LEAST) {
                break;
            }
            hits = next;
        }
        error
    }

    /// Radiosity that a leaf has by its word where it was met, W/m2.
    fn said_by(&self, hit: &Hit) -> [f64; 3] {
        let place = self.rays.place(hit.leaf);
        super::gather::radiosity_at(self.solved, &place, hit.leaf, hit.at).map(f64::from)
    }

    /// Exitance where a leaf was met, W/m2.
    fn emitted_by(&self, hit: &Hit) -> [f64; 3] {
        let space = &self.solved.space;
        space.world.exitance(&space.scene, &space.scene.patches[hit.patch.0 as usize])
    }
}

/// A point of a quadrilateral, or a triangle that repeats its last corner, evenly distributed if both numbers are.
pub(super) fn point_of([a, b, c, d]: [DVec2; 4], [one, two]: [f64; 2]) -> DVec2 {
    let halves = [(b - a).perp_dot(c - a), (c - a).perp_dot(d - a)].map(f64::abs);
    let share = halves[0] / (halves[0] + halves[1]).max(f64::MIN_POSITIVE);
    let (one, [q, r]) = match one < share {
        true => (one / share, [b, c]),
        false => ((one - share) / (1.0 - share).max(f64::MIN_POSITIVE), [c, d]),
    };
    let along = one.clamp(0.0, 1.0).sqrt();
    a * (1.0 - along) + (q * (1.0 - two) + r * two) * along
}
