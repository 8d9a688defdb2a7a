//! The elements of a solved state, in space or in the plane, as comparisons see them.

use std::ops::Range;

use crate::element::{ElementId, ElementKey, Kind};
use crate::follow::Follower;
use crate::space::{Solved, SpaceState};

use super::coarse_values::{CoarseValue, coarse_values};
use super::names::{ElementName, name_of};

/// Elements of a solved state by id and by name.
pub trait Elements {
    /// Roots of the trees of elements, ascending.
    fn facets(&self) -> &[ElementId];
    /// Ids of elements are below this.
    fn id_limit(&self) -> u32;
    /// Whether this is an element that carries radiosity.
    fn is_element(&self, id: ElementId) -> bool;
    /// Ids of the children; empty for a leaf.
    fn children(&self, id: ElementId) -> Range<u32>;
    /// The name of an element or light, which does not depend on history.
    fn key(&self, id: ElementId) -> ElementKey;
    /// Name of an element or light for a user.
    fn name_of(&self, key: ElementKey) -> ElementName;
    /// Area of an element, m2.
    fn area_m2(&self, id: ElementId) -> f64;
    /// Whether the body of an element is there at present.
    fn is_present(&self, id: ElementId) -> bool;
    /// Largest error of a radiosity over the largest residual of any: 1.
    fn error_growth(solved: &Follower<Self>) -> f64
    where
        Self: Sized;
    /// Values of the coarse solution and of groups, in the order of their quantities and names; none in the plane.
    fn coarse_values(&self) -> Vec<CoarseValue> {
        Vec::new()
    }
    /// Whether keys have one meaning in both states.
    fn is_of_the_scene_of(&self, other: &Self) -> bool;
}

/// All leaves by name, ascending.
pub(super) fn named_leaves<S: Elements>(solved: &Follower<S>) -> Vec<(ElementKey, ElementId)> {
    let elements = &solved.space;
    let ids = (0..elements.id_limit()).map(ElementId);
    let leaf = |id: &ElementId| elements.is_element(*id) && elements.children(*id).is_empty();
    let mut out: Vec<_> = ids.filter(leaf).map(|id| (elements.key(id), id)).collect();
    out.sort_unstable_by_key(|leaf| leaf.0);
    out
}

impl Elements for SpaceState {
    fn facets(&self) -> &[ElementId] {
        self.forest.facets()
    }

    fn id_limit(&self) -> u32 {
        self.forest.len() as u32
    }

    fn is_element(&self, id: ElementId) -> bool {
        self.forest.kind(id) == Kind::Element
    }

    fn children(&self, id: ElementId) -> Range<u32> {
        self.forest.children(id)
    }

    fn key(&self, id: ElementId) -> ElementKey {
        self.forest.key(id)
    }

    fn name_of(&self, key: ElementKey) -> ElementName {
        name_of(&self.scene, &self.forest, key)
    }

    fn area_m2(&self, id: ElementId) -> f64 {
        self.forest.area_m2(id)
    }

    fn is_present(&self, id: ElementId) -> bool {
        let SpaceState { forest, view, .. } = self;
        forest.patch(id).is_some_and(|p| view.is_present(view.patch(p).body))
    }

    fn error_growth(solved: &Solved) -> f64 {
        solved.radiosity.growth(&solved.space.surfaces().with_places(), &solved.links)
    }

    fn coarse_values(&self) -> Vec<CoarseValue> {
        coarse_values(self)
    }

    fn is_of_the_scene_of(&self, other: &SpaceState) -> bool {
        let (a, b) = (&self.scene, &other.scene);
        let (one, two) = (&self.forest, &other.forest);
        let alike = a.patches.len() == b.patches.len() && a.lights.len() == b.lights.len();
        // The forest's fixed part is a function of the scene.
        alike && one.fixed_len() == two.fixed_len() && one.facets() == two.facets()
    }
}
