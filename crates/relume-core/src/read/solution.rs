//! A solved state of either space as comparisons see it.

use std::ops::Range;

use crate::element::{ElementId, ElementKey, Kind};
use crate::follow::FrameReport;
use crate::pair::PairTree;
use crate::space::{Solved, SpaceState};

use super::names::{ElementName, name_of};

/// What comparisons ask of a solution, in space or in the plane.
pub trait Solution {
    /// The pair tree.
    fn tree(&self) -> &PairTree;
    /// What the last step reported.
    fn report(&self) -> &FrameReport;
    /// What has parts, but is no part of anything, ascending.
    fn facets(&self) -> &[ElementId];
    /// Ids of elements are below this.
    fn id_limit(&self) -> u32;
    /// Whether this is an element that carries radiosity.
    fn is_element(&self, id: ElementId) -> bool;
    /// Ids of the children; empty for a leaf.
    fn children(&self, id: ElementId) -> Range<u32>;
    /// The name of an element or light, which does not depend on history.
    fn key(&self, id: ElementId) -> ElementKey;
    /// The same for a user.
    fn name_of(&self, key: ElementKey) -> ElementName;
    /// Area of an element, m2.
    fn area_m2(&self, id: ElementId) -> f64;
    /// Whether the body of an element is there at present.
    fn is_present(&self, id: ElementId) -> bool;
    /// Radiosity of an element, W/m2.
    fn radiosity(&self, id: ElementId) -> [f32; 3];
    /// The largest reflectance of all materials and channels in use.
    fn reflectance_max(&self) -> f64;
    /// Whether keys mean the same in another solution.
    fn is_of_the_scene_of(&self, other: &Self) -> bool;
}

/// All leaves by name, ascending.
pub(super) fn named_leaves(solution: &impl Solution) -> Vec<(ElementKey, ElementId)> {
    let ids = (0..solution.id_limit()).map(ElementId);
    let leaf = |id: &ElementId| solution.is_element(*id) && solution.children(*id).is_empty();
    let mut out: Vec<_> = ids.filter(leaf).map(|id| (solution.key(id), id)).collect();
    out.sort_unstable_by_key(|leaf| leaf.0);
    out
}

impl Solution for Solved {
    fn tree(&self) -> &PairTree {
        &self.tree
    }

    fn report(&self) -> &FrameReport {
        &self.report
    }

    fn facets(&self) -> &[ElementId] {
        self.space.forest.facets()
    }

    fn id_limit(&self) -> u32 {
        self.space.forest.len() as u32
    }

    fn is_element(&self, id: ElementId) -> bool {
        self.space.forest.kind(id) == Kind::Element
    }

    fn children(&self, id: ElementId) -> Range<u32> {
        self.space.forest.children(id)
    }

    fn key(&self, id: ElementId) -> ElementKey {
        self.space.forest.key(id)
    }

    fn name_of(&self, key: ElementKey) -> ElementName {
        name_of(&self.space.scene, &self.space.forest, key)
    }

    fn area_m2(&self, id: ElementId) -> f64 {
        self.space.forest.area_m2(id)
    }

    fn is_present(&self, id: ElementId) -> bool {
        let SpaceState { forest, view, .. } = &self.space;
        forest.patch(id).is_some_and(|p| view.is_present(view.patch(p).body))
    }

    fn radiosity(&self, id: ElementId) -> [f32; 3] {
        self.radiosity.radiosity(id.0)
    }

    fn reflectance_max(&self) -> f64 {
        let SpaceState { scene, world, .. } = &self.space;
        let all = scene.patches.iter().flat_map(|patch| world.reflectance(scene, patch));
        all.fold(0.0, f64::max)
    }

    fn is_of_the_scene_of(&self, other: &Solved) -> bool {
        let (a, b) = (&self.space.scene, &other.space.scene);
        let (one, two) = (&self.space.forest, &other.space.forest);
        let alike = a.patches.len() == b.patches.len() && a.lights.len() == b.lights.len();
        // The forest's fixed part is a function of the scene.
        alike && one.fixed_len() == two.fixed_len() && one.facets() == two.facets()
    }
}
