//! The forest of the plane as the solver sees it.

use std::ops::Range;

use crate::element::ElementId;
use crate::follow::Receivers;
use crate::solver::{FacetMaterial, Place, Surfaces};

use super::forest::FlatForest;
use super::scene::{FlatScene, Wall};

impl Receivers for FlatForest {
    fn room(&self) -> usize {
        self.len()
    }

    fn receives(&self, id: ElementId) -> bool {
        self.is_element(id)
    }

    fn receiving_area_m2(&self, id: ElementId) -> f64 {
        self.length(id)
    }
}

/// The forest of the plane as the solver sees it: an area is a length, and nothing varies across.
pub(crate) struct LitPlane<'a> {
    forest: &'a FlatForest,
    lit: Vec<FacetMaterial>,
}

impl<'a> LitPlane<'a> {
    pub(super) fn new(scene: &FlatScene, forest: &'a FlatForest) -> LitPlane<'a> {
        let single = |v: [f64; 3]| v.map(|x| x as f32);
        let of = |wall: &Wall| FacetMaterial {
            reflectance: single(wall.material.reflectance),
            exitance: single(wall.material.exitance),
        };
        LitPlane { forest, lit: scene.walls().iter().map(of).collect() }
    }

    pub(super) fn is_dark(&self) -> bool {
        self.lit.iter().all(|lit| lit.exitance == [0.0; 3])
    }
}

impl Surfaces for LitPlane<'_> {
    fn len(&self) -> usize {
        self.forest.len()
    }

    fn facets(&self) -> &[ElementId] {
        self.forest.facets()
    }

    fn facet_of(&self, id: u32) -> u32 {
        self.forest.facet(ElementId(id)).0
    }

    fn parent(&self, id: u32) -> Option<u32> {
        self.forest.parent(ElementId(id)).map(|parent| parent.0)
    }

    fn children(&self, id: u32) -> Range<u32> {
        self.forest.children(ElementId(id))
    }

    fn area_m2(&self, id: u32) -> f64 {
        self.forest.length(ElementId(id))
    }

    fn place(&self, id: u32) -> Place {
        let id = ElementId(id);
        if !self.forest.is_element(id) {
            return Place { centroid: [0.0; 2], radius: 1.0, moment: [1.0, 0.0, 1.0] };
        }
        let length = self.forest.length(id);
        let whole = self.forest.local(self.forest.facet(id));
        let middle = (self.forest.local(id).centre() - whole.start).length();
        Place {
            centroid: [middle as f32, 0.0],
            radius: (0.5 * length) as f32,
            // The second axis is that of the symmetry: anything but 0.
            moment: [(length * length / 12.0) as f32, 0.0, 1.0],
        }
    }

    fn source_moment(&self) -> f32 {
        1.0 / 3.0
    }

    fn material(&self, facet: u32) -> &FacetMaterial {
        &self.lit[self.forest.wall(ElementId(facet)).0.0 as usize]
    }
}
