//! The forest as the solver sees it.

use std::ops::Range;

use rayon::prelude::*;

use super::inner::exchange_inside_m2;
use super::tuning::COVERED;
use crate::element::{ElementId, Forest, Kind, WorldView};
use crate::follow::Receivers;
use crate::scene::{PatchId, Scene, World};
use crate::solver::{FacetMaterial, GroupLinks, Place, Surfaces};

/// A forest with its materials at one instant.
pub(crate) struct LitForest<'a> {
    forest: &'a Forest,
    patch_materials: Vec<FacetMaterial>,
    /// Places of all elements and their exposed areas, m2, where they were worth computing ahead.
    places: Vec<(Place, f32)>,
    groups: Option<&'a GroupLinks>,
}

impl<'a> LitForest<'a> {
    pub(crate) fn new(scene: &Scene, forest: &'a Forest, now: &World) -> LitForest<'a> {
        let single = |v: [f64; 3]| v.map(|x| x as f32);
        let of_patch = |(id, patch): (PatchId, &crate::scene::Patch)| {
            // What lies wholly on or under something sends nothing to anyone, whatever it emits.
            let exitance = match forest.is_wholly_covered(forest.patch_root(id)) {
                true => [0.0; 3],
                false => single(now.exitance(scene, patch)),
            };
            FacetMaterial { reflectance: single(now.reflectance(scene, patch)), exitance }
        };
        let patches = (0..).map(PatchId).zip(&scene.patches);
        let patch_materials = patches.map(of_patch).collect();
        LitForest { forest, patch_materials, places: Vec::new(), groups: None }
    }

    /// Black, with other exitances: by patch, W/m2.
    pub(crate) fn emitting(mut self, exitance: &[[f32; 3]]) -> LitForest<'a> {
        for (lit, exitance) in self.patch_materials.iter_mut().zip(exitance) {
            *lit = FacetMaterial { reflectance: [0.0; 3], exitance: *exitance };
        }
        self
    }

    /// With links that end on groups.
    pub(crate) fn with_groups(mut self, groups: &'a GroupLinks) -> LitForest<'a> {
        self.groups = (!groups.is_empty()).then_some(groups);
        self
    }

    /// Absent bodies emit nothing: they do not count in the mean that residuals are relative to.
    pub(super) fn present_in(mut self, view: &WorldView) -> LitForest<'a> {
        for (patch, lit) in self.patch_materials.iter_mut().enumerate() {
            if !view.is_present(view.patch(PatchId(patch as u32)).body) {
                lit.exitance = [0.0; 3];
            }
        }
        self
    }

    /// Whether no surface emits anything.
    pub(super) fn is_dark(&self) -> bool {
        self.patch_materials.iter().all(|lit| lit.exitance == [0.0; 3])
    }

    /// With all places and areas computed ahead: for several sweeps over all of the forest.
    pub(crate) fn with_places(mut self) -> LitForest<'a> {
        let forest = self.forest;
        let ids = (0..forest.len() as u32).into_par_iter().map(ElementId);
        self.places = ids.map(|id| (place_of(forest, id), forest.exposed_m2(id) as f32)).collect();
        self
    }
}

pub(crate) fn place_of(forest: &Forest, id: ElementId) -> Place {
    if forest.kind(id) != Kind::Element {
        return Place { centroid: [0.0; 2], radius: 1.0, moment: [1.0, 0.0, 1.0] };
    }
    let extent = forest.exposed_extent(id);
    Place {
        centroid: [extent.centroid.x as f32, extent.centroid.y as f32],
        radius: extent.radius as f32,
        moment: extent.second_moment.map(|m| m as f32),
    }
}

impl Surfaces for LitForest<'_> {
    fn len(&self) -> usize {
        self.forest.len()
    }

    fn facets(&self) -> &[ElementId] {
        self.forest.near_facets()
    }

    fn first_facets(&self) -> usize {
        self.facets().partition_point(|&facet| self.forest.is_made(facet))
    }

    fn is_surface(&self, id: u32) -> bool {
        self.forest.receives(ElementId(id))
    }

    fn facet_of(&self, id: u32) -> u32 {
        self.forest.fixed(ElementId(id)).0
    }

    fn parent(&self, id: u32) -> Option<u32> {
        let parent = self.forest.parent(ElementId(id))?;
        (self.forest.kind(parent) == Kind::Element).then_some(parent.0)
    }

    fn children(&self, id: u32) -> Range<u32> {
        self.forest.children(ElementId(id))
    }

    fn area_m2(&self, id: u32) -> f64 {
        match self.places.get(id as usize) {
            // Areas have single precision.
            Some((_, area)) => f64::from(*area),
            None => self.forest.exposed_m2(ElementId(id)),
        }
    }

    fn is_covered(&self, id: u32) -> bool {
        self.area_m2(id) < COVERED * self.forest.area_m2(ElementId(id))
    }

    fn place(&self, id: u32) -> Place {
        match self.places.get(id as usize) {
            Some((place, _)) => *place,
            None => place_of(self.forest, ElementId(id)),
        }
    }

    fn material(&self, facet: u32) -> &FacetMaterial {
        let patch = self.forest.patch(ElementId(facet)).expect("elements have patches");
        &self.patch_materials[patch.0 as usize]
    }

    fn groups(&self) -> Option<&GroupLinks> {
        self.groups
    }
}

/// The coarse elements as the coarse solution sees them: groups as facets, of the mean material of their patches.
pub(super) struct CoarseSurfaces<'a> {
    lit: LitForest<'a>,
    /// Facets that are in no group, and groups that are in no other; ascending.
    facets: Vec<ElementId>,
    /// By place in [`Forest::groups`]' roots.
    means: Vec<FacetMaterial>,
}

impl<'a> CoarseSurfaces<'a> {
    pub(super) fn new(lit: LitForest<'a>) -> CoarseSurfaces<'a> {
        let forest = lit.forest;
        let groups = forest.groups();
        let roots = groups.roots().iter();
        let is_free = |facet: &&ElementId| !forest.is_in_group(**facet);
        let free = forest.near_facets().iter().filter(is_free).copied();
        let mut facets: Vec<ElementId> = free.chain(roots.clone().copied()).collect();
        facets.sort_unstable();
        let mean_of = |root: &ElementId| {
            let group = forest.group(*root).expect("a root is a group");
            let mut sum = FacetMaterial { reflectance: [0.0; 3], exitance: [0.0; 3] };
            let leaves = groups.leaves_of(group);
            let area: f64 = leaves.iter().map(|leaf| leaf.area_m2).sum();
            for leaf in leaves {
                let (own, share) = (lit.material(leaf.facet.0), (leaf.area_m2 / area) as f32);
                for c in 0..3 {
                    sum.reflectance[c] += share * own.reflectance[c];
                    sum.exitance[c] += share * own.exitance[c];
                }
            }
            sum
        };
        let means = roots.clone().map(mean_of).collect();
        CoarseSurfaces { lit, facets, means }
    }
}

impl Surfaces for CoarseSurfaces<'_> {
    fn len(&self) -> usize {
        self.lit.len()
    }

    fn facets(&self) -> &[ElementId] {
        &self.facets
    }

    fn first_facets(&self) -> usize {
        self.facets.partition_point(|&facet| self.lit.forest.is_made(facet))
    }

    fn is_surface(&self, id: u32) -> bool {
        self.lit.is_surface(id)
    }

    fn facet_of(&self, id: u32) -> u32 {
        self.lit.facet_of(id)
    }

    fn parent(&self, id: u32) -> Option<u32> {
        self.lit.parent(id)
    }

    fn children(&self, id: u32) -> Range<u32> {
        match self.lit.forest.group(ElementId(id)) {
            Some(_) => 0..0,
            None => self.lit.children(id),
        }
    }

    fn area_m2(&self, id: u32) -> f64 {
        self.lit.area_m2(id)
    }

    fn place(&self, id: u32) -> Place {
        self.lit.place(id)
    }

    fn material(&self, facet: u32) -> &FacetMaterial {
        match self.lit.forest.groups().root_number(ElementId(facet)) {
            Some(number) => &self.means[number],
            None => self.lit.material(facet),
        }
    }
}

/// Who receives in the coarse solution: groups too.
pub(super) struct CoarseReceivers<'a>(pub(super) &'a Forest);

impl Receivers for CoarseReceivers<'_> {
    fn room(&self) -> usize {
        self.0.len()
    }

    fn receives(&self, id: ElementId) -> bool {
        self.0.receives(id) || self.0.group(id).is_some()
    }

    fn receiving_area_m2(&self, id: ElementId) -> f64 {
        self.0.area_m2(id)
    }
}

impl Receivers for Forest {
    fn room(&self) -> usize {
        self.len()
    }

    fn receives(&self, id: ElementId) -> bool {
        Forest::receives(self, id)
    }

    fn receiving_area_m2(&self, id: ElementId) -> f64 {
        self.receiving_m2(id)
    }

    fn rest_in_contact(&self, a: ElementId, b: ElementId) -> bool {
        self.are_in_contact(a, b)
    }

    fn dark_exchange_m2(&self, a: ElementId, b: ElementId, exchange_m2: f32) -> f32 {
        exchange_inside_m2(self, (a, b), f64::from(exchange_m2)) as f32
    }

    fn is_apart(&self, id: ElementId) -> bool {
        self.group(id).is_some()
    }
}
