//! What arrives on a user's own things, and what of it stays there.

use rayon::prelude::*;

use super::factors::Grouping;
use crate::element::{ElementId, Kind};
use crate::scene::PatchId;
use crate::solver::Surfaces;
use crate::space::{Solved, SpaceState};

/// Light on a group of patches. Fluxes in W, linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Flux {
    /// Area that is exposed, m2: without what other bodies cover.
    pub area_m2: f64,
    /// Flux emitted.
    pub emitted_w: [f64; 3],
    /// Flux that arrives; over the area it is the mean irradiance.
    pub arriving_w: [f64; 3],
    /// Flux absorbed: what arrives and is not reflected.
    pub absorbed_w: [f64; 3],
}

impl Flux {
    /// Mean irradiance, W/m2, linear RGB; 0 where nothing is exposed.
    pub fn irradiance(&self) -> [f64; 3] {
        self.arriving_w.map(|w| if self.area_m2 > 0.0 { w / self.area_m2 } else { 0.0 })
    }

    fn add(&mut self, other: &Flux) {
        self.area_m2 += other.area_m2;
        let pairs = [
            (&mut self.emitted_w, &other.emitted_w),
            (&mut self.arriving_w, &other.arriving_w),
            (&mut self.absorbed_w, &other.absorbed_w),
        ];
        for (sum, w) in pairs {
            (0..3).for_each(|c| sum[c] += w[c]);
        }
    }
}

/// Fluxes of the groups of a grouping that fits: of patches that are present.
pub(super) fn fluxes(solved: &Solved, grouping: &Grouping) -> Vec<Flux> {
    let scene = &solved.space.scene;
    let of_patch = |k: usize| match grouping.of_patch[k] {
        Some(_) => of_patch(solved, PatchId(k as u32)),
        None => Flux::default(),
    };
    let by_patch: Vec<Flux> = (0..scene.patches.len()).into_par_iter().map(of_patch).collect();
    let mut out = vec![Flux::default(); grouping.names.len()];
    for (group, flux) in grouping.of_patch.iter().zip(&by_patch) {
        if let Some(group) = group {
            out[*group as usize].add(flux);
        }
    }
    out
}

fn of_patch(solved: &Solved, patch: PatchId) -> Flux {
    let SpaceState { scene, forest, view, .. } = &solved.space;
    let surfaces = solved.space.surfaces();
    let body = scene.patches[patch.0 as usize].body;
    let mut flux = Flux::default();
    if !view.is_present(body) || scene.is_distant(body) {
        return flux;
    }
    let mut stack = vec![forest.patch_root(patch)];
    while let Some(id) = stack.pop() {
        if forest.kind(id) == Kind::Polygon {
            stack.extend(forest.children(id).rev().map(ElementId));
            continue;
        }
        let material = surfaces.material(id.0);
        solved.radiosity.irradiances(&surfaces, id.0, &mut |leaf, h| {
            let area_m2 = surfaces.area_m2(leaf);
            flux.area_m2 += area_m2;
            for c in 0..3 {
                let arriving = area_m2 * f64::from(h.mean[c].max(0.0));
                flux.emitted_w[c] += area_m2 * f64::from(material.exitance[c]);
                flux.arriving_w[c] += arriving;
                flux.absorbed_w[c] += arriving * f64::from(1.0 - material.reflectance[c]);
            }
        });
    }
    flux
}
