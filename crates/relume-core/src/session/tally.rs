//! The counters and balances of a frame.

use crate::element::{ElementId, Forest};
use crate::pair::PairTree;
use crate::scene::{BodyId, LightId, LightKind, Scene};
use crate::solver::{Links, Radiosity, Surfaces, row_sums};

use super::Solved;
use super::report::{Energy, FrameReport, PairCounts, RowSumError};
use super::surfaces::LitForest;

/// Fills in what the solution says of itself.
pub(super) fn fill(report: &mut FrameReport, solved: &Solved) {
    let counts = solved.tree.counts();
    report.hash = solved.hash.to_string();
    report.links = counts.active;
    report.pairs =
        PairCounts { active: counts.active, refined: counts.refined, culled: counts.culled };
    report.link_kinds = super::groups::kinds(&solved.forest, &solved.tree);
    (report.elements, report.leaves) =
        (solved.forest.counts().elements, solved.forest.counts().leaves);
    report.sweeps = solved.radiosity.sweeps;
    report.gathers = solved.radiosity.gathers;
    report.residual = solved.radiosity.residual;
}

/// Fills in row sums and energies: a pass over all links and elements.
pub(super) fn fill_balance(report: &mut FrameReport, scene: &Scene, solved: &Solved) {
    let (rows, energy) = balance(scene, solved);
    (report.row_sum_error, report.energy) = (Some(rows), Some(energy));
    if energy.unbalanced() > UNBALANCED || solved.radiosity.is_bounded() {
        report.suspects = suspects(scene, solved);
    }
}

/// Share of what is emitted that may be unaccounted for before surfaces are named.
const UNBALANCED: f64 = 0.01;

/// Links between bodies (or lights) of which at least one is among those that moved.
pub(super) fn dynamic_links(
    scene: &Scene,
    forest: &Forest,
    tree: &PairTree,
    moved: &dyn Fn(BodyId) -> bool,
    light_moved: &dyn Fn(usize) -> bool,
) -> u64 {
    let body = |id| match forest.patch(id) {
        Some(patch) => Some(scene.patches[patch.0 as usize].body),
        None => forest.cluster_body(id),
    };
    let moves = |id| match forest.light(id) {
        Some(light) => light_moved(light),
        None => body(id).is_some_and(moved),
    };
    let dynamic = |a: ElementId, b: ElementId| body(a) != body(b) && (moves(a) || moves(b));
    tree.links().filter(|l| dynamic(l.a, l.b)).count() as u64
}

fn balance(scene: &Scene, solved: &Solved) -> (RowSumError, Energy) {
    let forest = &solved.forest;
    let surfaces = LitForest::new(scene, forest, &solved.world).with_groups(&solved.groups);
    let present = |facet: &ElementId| {
        let patch = forest.patch(*facet).expect("has a patch");
        solved.view.is_present(scene.patches[patch.0 as usize].body)
    };
    let facets = forest.near_facets().iter().copied().filter(present);
    let is_surface = |id: u32| forest.receives(ElementId(id));
    let lit = (&solved.links, &solved.radiosity);
    let (rows, mut energy) = balance_of(&surfaces, lit, facets, &is_surface);
    let lights = lights_w(scene, solved);
    energy.emitted_w += lights.0 + from_outside_w(&surfaces, solved);
    energy.escaped_w += lights.0 - lights.1;
    (rows, energy)
}

/// Row sums and energies of some facets.
pub(crate) fn balance_of(
    surfaces: &impl Surfaces,
    (links, radiosity): (&Links, &Radiosity),
    facets: impl Iterator<Item = ElementId>,
    is_surface: &dyn Fn(u32) -> bool,
) -> (RowSumError, Energy) {
    let mut rows = RowSumError::default();
    let mut energy = Energy::default();
    let mut area = 0.0;
    let mut sums = Vec::new();
    let linear = !radiosity.is_bounded();
    for facet in facets {
        let lit = surfaces.lit(facet.0);
        sums.clear();
        row_sums(surfaces, (links, linear), is_surface, facet.0, &mut |_, sum| sums.push(sum));
        let mut next = sums.iter();
        radiosity.irradiances(surfaces, facet.0, &mut |id, h| {
            let a = surfaces.area_m2(id);
            let off = f64::from(*next.next().expect("the same leaves")) - 1.0;
            rows.rms += a * off * off;
            if !surfaces.is_covered(id) {
                rows.max = rows.max.max(off.abs());
            }
            area += a;
            let b = radiosity.radiosity(id);
            for c in 0..3 {
                energy.emitted_w += a * f64::from(lit.exitance[c]);
                energy.absorbed_w += a * f64::from((1.0 - lit.reflectance[c]) * h.mean[c].max(0.0));
                energy.escaped_w -= off * a * f64::from(b[c]);
            }
        });
    }
    rows.rms = if area > 0.0 { (rows.rms / area).sqrt() } else { 0.0 };
    (rows, energy)
}

/// Flux that arrives from what is distant, W: it emits what arrives.
fn from_outside_w(surfaces: &LitForest<'_>, solved: &Solved) -> f64 {
    let forest = &solved.forest;
    let mut sum = 0.0;
    for link in solved.tree.links() {
        let exchange = f64::from(link.carried.exchange_area_past_occluders_m2());
        for end in [link.a, link.b].into_iter().filter(|&end| forest.is_distant(end)) {
            let exitance = surfaces.lit(surfaces.facet_of(end.0)).exitance;
            sum += exchange * exitance.iter().copied().map(f64::from).sum::<f64>();
        }
    }
    sum
}

/// Flux of the punctual lights and the part of it that arrives, W. A directional light emits what
/// arrives.
fn lights_w(scene: &Scene, solved: &Solved) -> (f64, f64) {
    if scene.lights.is_empty() {
        return (0.0, 0.0);
    }
    let mut arriving = vec![0.0; scene.lights.len()];
    for link in solved.tree.links() {
        for end in [link.a, link.b] {
            if let Some(light) = solved.forest.light(end) {
                arriving[light] += f64::from(link.carried.exchange_area_past_occluders_m2());
            }
        }
    }
    let mut sums = (0.0, 0.0);
    for (k, light) in scene.lights.iter().enumerate() {
        if solved.view.light(k).is_none() {
            continue;
        }
        let intensity: f64 = solved.world.intensity(LightId(k as u32)).iter().sum();
        let all = match light.kind {
            LightKind::Point => 4.0 * std::f64::consts::PI,
            LightKind::Spot { inner, outer } => spot_sr(inner, outer),
            LightKind::Directional => arriving[k],
        };
        sums.0 += intensity * all;
        sums.1 += intensity * arriving[k];
    }
    sums
}

/// Solid angle of a spot weighted with its falloff: full inside, ((c - co)/(ci - co))^2 between.
fn spot_sr(inner: f64, outer: f64) -> f64 {
    let (ci, co) = (libm::cos(inner), libm::cos(outer));
    2.0 * std::f64::consts::PI * ((1.0 - ci) + (ci - co) / 3.0)
}

/// Names of the two surfaces that receive most light over rows that sum to more than 1.
pub(super) fn suspects(scene: &Scene, solved: &Solved) -> Vec<String> {
    let mut excess = vec![0.0; scene.surfaces.len()];
    for (id, sum) in row_sums_of(scene, solved) {
        let patch = solved.forest.patch(id).expect("elements have patches");
        let surface = scene.patches[patch.0 as usize].surface.0 as usize;
        let b: f32 = solved.radiosity.radiosity(id.0).iter().sum();
        // Of what grew beyond all numbers only the rows can be told.
        let b = if b.is_finite() { f64::from(b) } else { 1.0 };
        excess[surface] += (sum - 1.0).max(0.0) * solved.forest.area_m2(id) * b;
    }
    let mut order: Vec<usize> = (0..excess.len()).filter(|&k| excess[k] > 0.0).collect();
    order.sort_by(|&one, &other| excess[other].total_cmp(&excess[one]));
    order.iter().take(2).map(|&k| scene.surfaces[k].name.clone()).collect()
}

/// Row sums of all leaves.
pub(super) fn row_sums_of(scene: &Scene, solved: &Solved) -> Vec<(ElementId, f64)> {
    let forest = &solved.forest;
    let surfaces = LitForest::new(scene, forest, &solved.world).with_groups(&solved.groups);
    let is_surface = |id: u32| forest.receives(ElementId(id));
    let mut out = Vec::with_capacity(forest.counts().leaves as usize);
    for facet in forest.near_facets() {
        let links = (&solved.links, !solved.radiosity.is_bounded());
        row_sums(&surfaces, links, &is_surface, facet.0, &mut |id, sum| {
            out.push((ElementId(id), f64::from(sum)));
        });
    }
    out
}
