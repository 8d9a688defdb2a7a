//! How good a solution is, measured by itself: the residual of the rendering equation with exact visibility, at points.
//!
//! Where light arrives at a point of a surface, what the leaves send there can be gathered with visibility found at that
//! point. What a leaf sends differs from what is gathered there by its residual; what the solution is off by is that
//! residual, plus the error of what it gathers, times the reflectance: a Neumann series, of which terms are sampled by walks
//! from point to point (residual Monte Carlo: Halton 1994). Residuals are small, so few walks tell much. Walks follow
//! fixed sequences: the same solution is always told the same.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::element::{ElementId, Forest, Shape, WorldElement};
use crate::follow::Accuracy;
use crate::scene::PatchId;
use crate::space::Solved;

use super::gather::{Look, Purpose, Sensor, Source, at_share, spread};
use super::snapshot::{self, Leaf};

/// Walks from each point.
const WALKS: usize = 8;

/// Points that a walk comes to at most: what is left after six reflections weighs little beside the residuals before.
const STEPS: usize = 6;

/// Weight below which a walk ends.
const LITTLE: f64 = 0.02;

/// Irradiance below which a surface counts as dark, relative to the mean: errors there are relative to it.
const DARK: f64 = 1e-3;

/// What one point says: relative errors (sum of channels).
struct Found {
    at: DVec3,
    /// Of a sensor, by each walk.
    sensor: [f64; WALKS],
    /// Of the mesh, by each walk.
    mesh: Option<[f64; WALKS]>,
}

/// A point and the irradiance that the mesh says is there, W/m2, sum of channels.
struct Place {
    sensor: Sensor,
    mesh: Option<f64>,
}

/// Errors of a solution, estimated at so many points. Cost: of each point some fifty sensors.
pub(super) fn accuracy(solved: &Solved, points: usize) -> Accuracy {
    let meter = Meter { solved };
    let (places, mean) = meter.places(points);
    accuracy_of(&meter.all(places, DARK * mean))
}

/// Errors of a solution at sensors, relative to what arrives at each; where none does, there is none. Cost: of each some
/// fifty sensors.
pub(super) fn accuracy_at(solved: &Solved, sensors: &[Sensor]) -> Accuracy {
    let meter = Meter { solved };
    let places = sensors.iter().map(|&sensor| Place { sensor, mesh: None }).collect();
    accuracy_of(&meter.all(places, 0.0))
}

fn accuracy_of(found: &[Found]) -> Accuracy {
    let squares = |of: &dyn Fn(&Found) -> Option<[f64; WALKS]>| -> Vec<f64> {
        found.iter().filter_map(of).map(|e| mean_square(&e)).collect()
    };
    let mean_of = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let sensors = squares(&|f| Some(f.sensor));
    let scatter: Vec<f64> = found.iter().map(|f| f.variance_of_square()).collect();
    let resolved = (2.0 * scatter.iter().sum::<f64>().sqrt() / found.len().max(1) as f64).sqrt();
    let mesh = squares(&|f| f.mesh);
    let rms = |squares: &[f64]| mean_of(squares).max(0.0).sqrt();
    let mean = |f: &Found| f.sensor.iter().sum::<f64>() / WALKS as f64;
    let worst = found.iter().max_by(|a, b| mean(a).abs().total_cmp(&mean(b).abs()));
    Accuracy {
        points: found.len() as u32,
        rms: rms(&sensors),
        resolved,
        mean: mean_of(&found.iter().map(mean).collect::<Vec<f64>>()),
        largest: worst.map_or(0.0, mean),
        largest_at: worst.map_or([0.0; 3], |f| f.at.to_array()),
        mesh_rms: (!mesh.is_empty()).then(|| rms(&mesh)),
    }
}

impl Found {
    /// Variance that `mean_square` has of a sensor without error, from the scatter of its walks.
    fn variance_of_square(&self) -> f64 {
        let mean = self.sensor.iter().sum::<f64>() / WALKS as f64;
        let variance =
            self.sensor.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (WALKS - 1) as f64;
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

/// Measures a solution.
struct Meter<'a> {
    solved: &'a Solved,
}

impl Meter<'_> {
    fn all(&self, places: Vec<Place>, dark: f64) -> Vec<Found> {
        let one = |(k, place): (usize, Place)| self.errors(k, &place, dark);
        places.into_par_iter().enumerate().filter_map(one).collect()
    }

    /// Places spread evenly over what is lit, and the mean irradiance of the mesh, W/m2 (sum of channels).
    fn places(&self, points: usize) -> (Vec<Place>, f64) {
        let mesh = snapshot::take(self.solved, &self.solved.links, &self.solved.radiosity);
        let arrives = |leaf: &Leaf| leaf.irradiance.iter().map(|&h| f64::from(h)).sum::<f64>();
        let patches = (0..self.solved.space.scene.patches.len() as u32).map(PatchId);
        let leaves: Vec<(PatchId, Leaf, f64)> = patches
            .flat_map(|patch| mesh.leaves_of(patch).iter().map(move |leaf| (patch, *leaf)))
            .map(|(patch, leaf)| (patch, leaf, Shape { corners: leaf.corners, len: 4 }.area()))
            .collect();
        let area_m2 = leaves.iter().map(|leaf| leaf.2).sum::<f64>().max(f64::MIN_POSITIVE);
        let mean = leaves.iter().map(|(_, leaf, area)| area * arrives(leaf)).sum::<f64>() / area_m2;
        let is_lit = |(_, leaf, _): &&(PatchId, Leaf, f64)| arrives(leaf) > DARK * mean;
        let lit_m2: f64 = leaves.iter().filter(is_lit).map(|leaf| leaf.2).sum();
        let mut lit = leaves.iter().filter(is_lit);
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
            let [a, b, c, d] = leaf.corners;
            let p = point_of([a, b, c, d].map(|p| p.extend(0.0)), [spread(k, 1), spread(k, 2)]);
            let p = DVec2::new(p.x, p.y);
            let at = self.solved.space.view.patch(*patch).world.point(p);
            let mesh = Some(leaf.irradiance_at(p).iter().map(|&h| f64::from(h)).sum());
            places.push(Place { sensor: self.sensor(*patch, at), mesh });
        }
        (places, mean)
    }

    fn sensor(&self, patch: PatchId, at: DVec3) -> Sensor {
        Sensor { at, normal: self.solved.space.view.occluder(patch).plane.normal }
    }

    /// Relative errors at one place; `None` where it is dark: covered, most likely.
    fn errors(&self, k: usize, place: &Place, dark: f64) -> Option<Found> {
        let look = |purpose| Look::new(self.solved, &place.sensor, purpose);
        let (by_lines, sources) = look(Purpose::Listing).by_source();
        let all = |e: [f64; 3]| e.iter().sum::<f64>();
        if all(by_lines) <= dark {
            return None;
        }
        let read = all(look(Purpose::Sensor).irradiance());
        let (mut sensor, mut mesh) = ([0.0; WALKS], place.mesh.map(|_| [0.0; WALKS]));
        // Relative to what leaves say: a divisor that walks scatter would bend their mean.
        let scale = all(by_lines);
        for walk in 0..WALKS {
            let right = all(by_lines) + all(self.error_of_sources(&sources, k * WALKS + walk));
            sensor[walk] = (read - right) / scale;
            if let (Some(mesh), Some(said)) = (&mut mesh, place.mesh) {
                mesh[walk] = (said - right) / scale;
            }
        }
        Some(Found { at: place.sensor.at, sensor, mesh })
    }

    /// How much more arrives from some sources than their leaves say, W/m2, by one walk.
    fn error_of_sources(&self, sources: &[Source], walk: usize) -> [f64; 3] {
        let (mut error, mut weight) = ([0.0; 3], [1.0; 3]);
        let mut sources = std::borrow::Cow::Borrowed(sources);
        for step in 0..STEPS {
            let number = |dimension: usize| spread(walk, 3 + 4 * step + dimension);
            let seen: f64 = sources.iter().map(|s| s.factor).sum();
            let Some(chosen) = at_share(sources.iter().map(|s| s.factor), number(0)) else { break };
            let drawn = [number(1), number(2), number(3)];
            let Some((leaf, at)) = self.place_in(&sources[chosen], drawn) else { break };
            let patch = self.solved.space.forest.patch(leaf).expect("an element has a patch");
            let sensor = self.sensor(patch, at);
            let look = Look::new(self.solved, &sensor, Purpose::Listing);
            let (arrives, next) = look.by_source();
            let e =
                WorldElement::new(&self.solved.space.view, &self.solved.space.forest, leaf, false);
            let said = look.radiosity_at(&e, leaf, at);
            let (scene, world) = (&self.solved.space.scene, &self.solved.space.world);
            let patch = &scene.patches[patch.0 as usize];
            let (m, rho) = (world.exitance(scene, patch), world.reflectance(scene, patch));
            for c in 0..3 {
                weight[c] *= seen;
                error[c] += weight[c] * (m[c] + rho[c] * arrives[c] - f64::from(said[c]));
                weight[c] *= rho[c];
            }
            if weight.iter().all(|&w| w < LITTLE) {
                break;
            }
            sources = std::borrow::Cow::Owned(next);
        }
        error
    }

    /// A place on a leaf of a source, drawn by three numbers; `None` on what only shines.
    fn place_in(
        &self,
        source: &Source,
        [mut which, one, two]: [f64; 3],
    ) -> Option<(ElementId, DVec3)> {
        let forest: &Forest = &self.solved.space.forest;
        let mut leaf = source.element;
        if forest.is_distant(leaf) {
            return None;
        }
        if let Some(at) = source.at {
            return Some((leaf, at));
        }
        while !forest.children(leaf).is_empty() {
            let children: Vec<ElementId> = forest.children(leaf).map(ElementId).collect();
            let areas: Vec<f64> = children.iter().map(|&id| forest.exposed_m2(id)).collect();
            let chosen = at_share(areas.iter().copied(), which)?;
            let before: f64 = areas[..chosen].iter().sum::<f64>() / areas.iter().sum::<f64>();
            let share = areas[chosen] / areas.iter().sum::<f64>();
            which = ((which - before) / share).clamp(0.0, 1.0 - f64::EPSILON);
            leaf = children[chosen];
        }
        let e = WorldElement::new(&self.solved.space.view, forest, leaf, false);
        Some((leaf, point_of(e.corners, [one, two])))
    }
}

/// A point of a quadrilateral, or a triangle that repeats its last corner, evenly distributed if both numbers are.
fn point_of([a, b, c, d]: [DVec3; 4], [one, two]: [f64; 2]) -> DVec3 {
    let halves = [(b - a).cross(c - a).length(), (c - a).cross(d - a).length()];
    let share = halves[0] / (halves[0] + halves[1]).max(f64::MIN_POSITIVE);
    let (one, [q, r]) = match one < share {
        true => (one / share, [b, c]),
        false => ((one - share) / (1.0 - share).max(f64::MIN_POSITIVE), [c, d]),
    };
    let along = one.clamp(0.0, 1.0).sqrt();
    a * (1.0 - along) + (q * (1.0 - two) + r * two) * along
}
