//! The coarse solution that the error oracle weighs by: a fixed set of coarse elements, all pairs
//! of them linked, a fixed number of sweeps from the emission. A pure function of the scene at one
//! instant.

use crate::element::{ElementId, Forest, Kind};
use crate::pair::{Brightness, Frontier, Light, PairTree};
use crate::scene::{PatchId, Scene};
use crate::solver::{Radiosity, Stop, Surfaces};

use super::surfaces::{LitForest, links_of};

/// Coarse elements are no larger than this share of the scene's area.
const COARSE_SHARE: f64 = 1.0 / 64.0;

/// An element of this share of the scene's area weighs 1 in the error norm.
const REFERENCE_SHARE: f64 = 1.0 / 512.0;

/// Sweeps of the coarse solution: five bounces bring every closed room within 10 % or so.
const SWEEPS: u32 = 8;

/// Errors on dark receivers are measured against at least this share of the mean irradiance.
const DARK_FLOOR: f64 = 0.1;

/// Splits facets down to coarse elements and numbers them; returns their ids by number.
pub(super) fn number(scene: &Scene, forest: &mut Forest) -> Vec<u32> {
    let largest = forest.area_m2(Forest::ROOT) * COARSE_SHARE;
    let mut out = Vec::new();
    for patch in 0..scene.patches.len() as u32 {
        let mut stack = vec![forest.patch_root(PatchId(patch))];
        while let Some(id) = stack.pop() {
            let whole = forest.kind(id) == Kind::Element
                && (forest.area_m2(id) <= largest || !forest.can_split(id));
            if whole {
                forest.set_coarse(id, out.len());
                out.push(id.0);
                continue;
            }
            let children = match forest.kind(id) {
                Kind::Element => forest.split(id).0,
                _ => forest.children(id),
            };
            stack.extend(children.rev().map(ElementId));
        }
    }
    out
}

/// Solves over the held pairs; the solution and what the oracle may know of it.
pub(super) fn solve(
    scene: &Scene,
    forest: &Forest,
    tree: &PairTree,
    held: &Frontier,
    coarse: &[u32],
) -> (Radiosity, Brightness) {
    let surfaces = LitForest::new(scene, forest);
    let links = links_of(forest, held.pairs().map(|id| tree.pair(id)));
    let solved = Radiosity::solve(&surfaces, &links, None, Stop::Sweeps(SWEEPS));
    let total_area = forest.area_m2(Forest::ROOT);
    let mean = |v: [f32; 3]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / 3.0;
    let arriving: f64 =
        coarse.iter().map(|&id| surfaces.area_m2(id) * mean(solved.irradiance(id))).sum();
    let floor = arriving / total_area * DARK_FLOOR;
    let light_of = |&id: &u32| {
        let emitted = surfaces.lit(id).map_or(0.0, |lit| mean(lit.exitance));
        let radiosity = mean(solved.radiosity(id));
        Light {
            radiosity,
            reflected: (radiosity - emitted).max(0.0),
            irradiance: mean(solved.irradiance(id)) + floor,
        }
    };
    let lights = scene.lights.iter().map(|l| l.intensity.iter().sum::<f64>() / 3.0).collect();
    let known = if arriving > 0.0 {
        coarse.iter().map(light_of).collect()
    } else {
        // Nothing emits: every surface weighs the same, and errors are relative to row sums.
        vec![Light::UNIFORM; coarse.len()]
    };
    (solved, Brightness::new(known, lights, total_area * REFERENCE_SHARE))
}

/// The coarse solution as a first guess for an element; exitance where there is none.
pub(super) fn radiosity_at(
    forest: &Forest,
    solved: &Radiosity,
    coarse: &[u32],
    id: u32,
    surfaces: &LitForest<'_>,
) -> [f32; 3] {
    match forest.coarse(ElementId(id)) {
        Some(number) => solved.radiosity(coarse[number]),
        None => surfaces.lit(id).map_or([0.0; 3], |lit| lit.exitance),
    }
}
