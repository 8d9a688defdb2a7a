//! The counters and balances of a frame.

use crate::element::{ElementId, Forest, Kind};
use crate::pair::{PairHash, State, Work};
use crate::scene::{LightKind, Scene};

use super::Solved;
use super::report::{Energy, FrameReport, PairCounts, RowSumError};
use super::surfaces::LitForest;
use crate::solver::Surfaces;

/// Fills in everything but the times.
pub(super) fn fill(report: &mut FrameReport, scene: &Scene, solved: &Solved, work: &Work) {
    let forest = &solved.forest;
    let mut hash = PairHash::default();
    let mut counts = PairCounts::default();
    for pair in solved.tree.pairs() {
        match pair.state {
            State::Active => {
                counts.active += 1;
                hash.add(forest, pair);
            }
            State::Refined => counts.refined += 1,
            State::Culled(_) => counts.culled += 1,
        }
    }
    report.hash = hash.to_string();
    report.links = counts.active;
    report.pairs = counts;
    report.examined = work.examined;
    report.reevaluated = work.examined;
    report.segments = work.segments;
    report.elements_made = work.elements_made;
    (report.elements, report.leaves) = element_counts(forest);
    report.sweeps = solved.radiosity.sweeps;
    report.residual = solved.radiosity.residual;
    (report.row_sum_error, report.energy) = balance(scene, forest, solved);
    report.dynamic_links = dynamic_links(report, scene, forest, solved);
}

fn element_counts(forest: &Forest) -> (u64, u64) {
    let elements =
        (0..forest.len() as u32).map(ElementId).filter(|&id| forest.kind(id) == Kind::Element);
    elements.fold((0, 0), |(all, leaves), id| {
        (all + 1, leaves + u64::from(forest.children(id).is_empty()))
    })
}

fn dynamic_links(report: &FrameReport, scene: &Scene, forest: &Forest, solved: &Solved) -> u64 {
    if report.moved.is_empty() {
        return 0;
    }
    let moved: Vec<bool> = scene.bodies.iter().map(|b| report.moved.contains(&b.name)).collect();
    let moves = |id: ElementId| {
        forest.patch(id).is_some_and(|p| moved[scene.patches[p.0 as usize].body.0 as usize])
    };
    solved.tree.links().filter(|p| moves(p.a) || moves(p.b)).count() as u64
}

fn balance(scene: &Scene, forest: &Forest, solved: &Solved) -> (RowSumError, Energy) {
    let surfaces = LitForest::new(scene, forest);
    let mut rows = RowSumError::default();
    let mut energy = Energy::default();
    let mut area = 0.0;
    for id in 0..forest.len() as u32 {
        let element = ElementId(id);
        if forest.kind(element) != Kind::Element || !forest.children(element).is_empty() {
            continue;
        }
        let patch = &scene.patches[forest.patch(element).expect("has a patch").0 as usize];
        if !solved.view.is_present(patch.body) {
            continue;
        }
        let a = forest.area_m2(element);
        let off = f64::from(solved.radiosity.row_sum(id)) - 1.0;
        rows.rms += a * off * off;
        rows.max = rows.max.max(off.abs());
        area += a;
        let lit = surfaces.lit(id).expect("elements are lit");
        let (h, b) = (solved.radiosity.irradiance(id), solved.radiosity.radiosity(id));
        for c in 0..3 {
            energy.emitted_w += a * f64::from(lit.exitance[c]);
            energy.absorbed_w += a * f64::from((1.0 - lit.reflectance[c]) * h[c]);
            energy.escaped_w -= off * a * f64::from(b[c]);
        }
    }
    rows.rms = if area > 0.0 { (rows.rms / area).sqrt() } else { 0.0 };
    let lights = lights_w(scene, forest, solved);
    energy.emitted_w += lights.0;
    energy.escaped_w += lights.0 - lights.1;
    (rows, energy)
}

/// Flux of the punctual lights and the part of it that arrives, W. A directional light emits what
/// arrives.
fn lights_w(scene: &Scene, forest: &Forest, solved: &Solved) -> (f64, f64) {
    let mut arriving = vec![0.0; scene.lights.len()];
    for pair in solved.tree.links() {
        for end in [pair.a, pair.b] {
            if let Some(light) = forest.light(end) {
                arriving[light] += f64::from(pair.exchange_area_m2 * pair.visibility);
            }
        }
    }
    let mut sums = (0.0, 0.0);
    for (k, light) in scene.lights.iter().enumerate() {
        if solved.view.light(k).is_none() {
            continue;
        }
        let intensity: f64 = light.intensity.iter().sum();
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
