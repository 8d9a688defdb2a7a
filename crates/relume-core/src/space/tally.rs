//! The counters and balances of a frame.

use crate::element::ElementId;
use crate::follow::{Balance, Energy, RowSumError, balance_of};
use crate::scene::{LightId, LightKind};
use crate::solver::{Surfaces, row_sums};

use super::Solved;
use super::state::SpaceState;
use super::surfaces::LitForest;
use super::tuning::UNBALANCED;

/// Row sums and energies: a pass over all links and elements.
pub(super) fn balance(solved: &Solved) -> Balance {
    let (rows, energy) = flux(solved);
    let is_off = energy.unbalanced() > UNBALANCED || solved.radiosity.loses_light();
    Balance { rows, energy, suspects: if is_off { suspects(solved) } else { Vec::new() } }
}

fn flux(solved: &Solved) -> (RowSumError, Energy) {
    let SpaceState { scene, forest, view, .. } = &solved.space;
    let surfaces = solved.space.surfaces().with_places();
    let present = |facet: &ElementId| {
        let patch = forest.patch(*facet).expect("has a patch");
        view.is_present(scene.patches[patch.0 as usize].body)
    };
    // What lies wholly on or under something sends nothing to anyone, whatever it emits.
    let counts = |facet: &ElementId| present(facet) && !forest.is_wholly_covered(*facet);
    let facets = forest.near_facets().iter().copied().filter(counts);
    let is_surface = |id: u32| forest.receives(ElementId(id));
    let Solved { links, radiosity, .. } = solved;
    let (rows, mut energy) = balance_of(&surfaces, links, radiosity, facets, &is_surface);
    let lights = lights_flux(solved);
    energy.emitted_w += lights.emitted_w + from_outside_w(&surfaces, solved);
    energy.escaped_w += lights.emitted_w - lights.arriving_w;
    (rows, energy)
}

/// Flux that arrives from what is distant, W: it emits what arrives.
fn from_outside_w(surfaces: &LitForest<'_>, solved: &Solved) -> f64 {
    let SpaceState { forest, groups, .. } = &solved.space;
    let mut sum = 0.0;
    for link in solved.tree.links() {
        for end in [link.a, link.b].into_iter().filter(|&end| forest.is_distant(end)) {
            let exchange = match groups.between([link.a.0, link.b.0]) {
                Some(over_group) => groups.exchange_area_m2(over_group),
                None if [link.a, link.b].iter().any(|&id| forest.group(id).is_some()) => 0.0,
                None => f64::from(link.carried.exchange_area_past_occluders_m2()),
            };
            let exitance = surfaces.material(surfaces.facet_of(end.0)).exitance;
            sum += exchange * exitance.iter().copied().map(f64::from).sum::<f64>();
        }
    }
    sum
}

/// Flux of the punctual lights.
#[derive(Default)]
struct LightsFlux {
    /// All of it, W. A directional light emits what arrives.
    emitted_w: f64,
    /// The part that arrives, W.
    arriving_w: f64,
}

fn lights_flux(solved: &Solved) -> LightsFlux {
    let SpaceState { scene, forest, view, world, .. } = &solved.space;
    if scene.lights.is_empty() {
        return LightsFlux::default();
    }
    let mut arriving = vec![0.0; scene.lights.len()];
    for link in solved.tree.links() {
        for end in [link.a, link.b] {
            if let Some(light) = forest.light(end) {
                arriving[light] += f64::from(link.carried.exchange_area_past_occluders_m2());
            }
        }
    }
    let mut sums = LightsFlux::default();
    for (k, light) in scene.lights.iter().enumerate() {
        if view.light(k).is_none() {
            continue;
        }
        let intensity: f64 = world.intensity(LightId(k as u32)).iter().sum();
        let all = match light.kind {
            LightKind::Point => 4.0 * std::f64::consts::PI,
            LightKind::Spot { inner, outer } => spot_sr(inner, outer),
            LightKind::Directional => arriving[k],
        };
        sums.emitted_w += intensity * all;
        sums.arriving_w += intensity * arriving[k];
    }
    sums
}

/// Solid angle of a spot weighted with its falloff: full inside, ((c - co)/(ci - co))^2 between.
fn spot_sr(inner: f64, outer: f64) -> f64 {
    let (ci, co) = (libm::cos(inner), libm::cos(outer));
    2.0 * std::f64::consts::PI * ((1.0 - ci) + (ci - co) / 3.0)
}

/// Names of the two surfaces that receive most light over rows that sum to more than 1.
pub(super) fn suspects(solved: &Solved) -> Vec<String> {
    let SpaceState { scene, forest, .. } = &solved.space;
    let mut excess = vec![0.0; scene.surfaces.len()];
    for (id, sum) in row_sums_of(solved) {
        let patch = forest.patch(id).expect("elements have patches");
        let surface = scene.patches[patch.0 as usize].surface.0 as usize;
        let b: f32 = solved.radiosity.radiosity(id.0).iter().sum();
        // Of what grew beyond all numbers only the rows can be told.
        let b = if b.is_finite() { f64::from(b) } else { 1.0 };
        excess[surface] += (sum - 1.0).max(0.0) * forest.area_m2(id) * b;
    }
    let mut order: Vec<usize> = (0..excess.len()).filter(|&k| excess[k] > 0.0).collect();
    order.sort_by(|&one, &other| excess[other].total_cmp(&excess[one]));
    order.iter().take(2).map(|&k| scene.surfaces[k].name.clone()).collect()
}

/// Row sums of all leaves.
pub(crate) fn row_sums_of(solved: &Solved) -> Vec<(ElementId, f64)> {
    let forest = &solved.space.forest;
    let surfaces = solved.space.surfaces();
    let is_surface = |id: u32| forest.receives(ElementId(id));
    let mut out = Vec::with_capacity(forest.counts().leaves as usize);
    for facet in forest.near_facets() {
        let linear = solved.radiosity.is_linear();
        row_sums(&surfaces, &solved.links, linear, &is_surface, facet.0, &mut |id, sum| {
            out.push((ElementId(id), f64::from(sum.mean)));
        });
    }
    out
}
