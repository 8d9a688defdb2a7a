//! What the solver asks of the hierarchy: quadtrees over facets.

use std::ops::Range;

use crate::element::ElementId;

use super::field::Linear;
use super::groups::GroupLinks;
use super::place::Place;

/// Reflectance and exitance of one material, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetMaterial {
    /// Reflectance rho.
    pub reflectance: [f32; 3],
    /// Exitance M, W/m2.
    pub exitance: [f32; 3],
}

impl FacetMaterial {
    /// By how much a change of irradiance (gradients per metre) changes radiosities at most, up to a distance from
    /// where it has its mean, in each of their numbers; W/m2.
    pub(super) fn most(&self, change: &Linear, radius_m: f32) -> f32 {
        let mut out = 0.0_f32;
        for c in 0..3 {
            let [x, y] = [0, 1].map(|axis| change.gradient[axis][c]);
            let most = change.mean[c].abs() + radius_m * (x * x + y * y).sqrt();
            out = out.max(self.reflectance[c] * most);
        }
        out
    }
}

/// Mean of x^2 / radius^2 over a square.
pub const SQUARE_MOMENT: f32 = 1.0 / 6.0;

/// The hierarchy as the solver sees it: quadtrees over facets.
pub trait Surfaces: Sync {
    /// Room for elements: ids are below this.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The roots of the quadtrees.
    fn facets(&self) -> &[ElementId];

    /// How many of them, the first ones, share the work of a sweep out among its batches: what a sweep finds on them does not
    /// depend on how many others there are.
    fn first_facets(&self) -> usize {
        self.facets().len()
    }
    /// Root of the quadtree that an element is in.
    fn facet_of(&self, id: u32) -> u32;
    /// Parent of an element within its quadtree; `None` for a facet.
    fn parent(&self, id: u32) -> Option<u32>;
    /// Children of an element within its quadtree.
    fn children(&self, id: u32) -> Range<u32>;
    /// Whether a source is a surface, not a punctual light: only those count in row sums.
    fn is_surface(&self, _id: u32) -> bool {
        true
    }
    /// Area, m2.
    fn area_m2(&self, id: u32) -> f64;
    /// Whether light cannot reach an element at all, because something rests on it.
    fn is_covered(&self, _id: u32) -> bool {
        false
    }
    /// Where an element lies.
    fn place(&self, id: u32) -> Place;
    /// What a facet is made of.
    fn material(&self, facet: u32) -> &FacetMaterial;
    /// Links that end on groups of facets, if there are any.
    fn groups(&self) -> Option<&GroupLinks> {
        None
    }
    /// Mean of x^2 / radius^2 over an element, for the product of two gradients: 1/6 for a square.
    fn source_moment(&self) -> f32 {
        SQUARE_MOMENT
    }
}

pub(super) fn for_each_below(surfaces: &impl Surfaces, id: u32, visit: &mut dyn FnMut(u32)) {
    visit(id);
    for child in surfaces.children(id) {
        for_each_below(surfaces, child, visit);
    }
}
