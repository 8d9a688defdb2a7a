//! What the solver asks of the hierarchy: quadtrees over facets.

use std::ops::Range;

use crate::element::ElementId;

use super::field::Linear;
use super::groups::GroupLinks;

/// Reflectance and exitance of one material, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lit {
    /// Reflectance rho.
    pub reflectance: [f32; 3],
    /// Exitance M, W/m2.
    pub exitance: [f32; 3],
}

impl Lit {
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

/// Where an element lies in its patch's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Centroid, metres.
    pub centroid: [f32; 2],
    /// Largest distance of a corner from the centroid, metres.
    pub radius: f32,
    /// Mean of (x x, x y, y y) about the centroid, m2.
    pub moment: [f32; 3],
}

impl Place {
    /// From a gradient (per radius) the first moments that it makes, relative to those over a square of this radius.
    ///
    /// Radiosities keep these in place of gradients: the mean of the product of two linear functions over a source
    /// is that of their means and `moment` times one's first moments times the other's gradient, for any shape.
    pub(super) fn first_moments(&self, [x, y]: [f32; 2], moment: f32) -> [f32; 2] {
        let scale = 1.0 / (self.radius * self.radius * moment);
        let [xx, xy, yy] = self.moment.map(|m| m * scale);
        [xx * x + xy * y, xy * x + yy * y]
    }

    /// The gradient (per radius) that makes these first moments.
    pub(crate) fn gradient(&self, [x, y]: [f32; 2], moment: f32) -> [f32; 2] {
        let [xx, xy, yy] = self.moment.map(f64::from);
        let scale = f64::from(self.radius * self.radius * moment)
            / (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        let (x, y) = (f64::from(x), f64::from(y));
        [((x * yy - y * xy) * scale) as f32, ((y * xx - x * xy) * scale) as f32]
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
    fn lit(&self, facet: u32) -> &Lit;
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
