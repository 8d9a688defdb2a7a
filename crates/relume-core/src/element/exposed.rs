//! What is exposed of an element: all of it but what rests on it.

use glam::DVec2;

use super::split::{Extent, Shape, overlap};
use crate::geometry::{Moments, common};
use crate::scene::Covered;

/// Where less than this share is covered, nothing is: rounding.
const ROUNDING: f64 = 1e-6;

/// Area of what is exposed, m2; of what is covered wholly a millionth.
pub(super) fn exposed_m2(shape: &Shape, covered: &Covered) -> f64 {
    let area = shape.area();
    if covered.parts.is_empty() {
        return area;
    }
    let rest = exposed(shape, covered).area;
    if rest >= area * (1.0 - ROUNDING) { area } else { rest.max(ROUNDING * area) }
}

/// Centroid and second moment of what is exposed; the radius is that of the whole.
pub(super) fn exposed_extent(shape: &Shape, whole: Extent, covered: &Covered) -> Extent {
    let (centroid, second_moment) = exposed(shape, covered).about_centroid();
    Extent { centroid: whole.centroid + centroid, second_moment, ..whole }
}

/// About the centroid of the whole.
fn exposed(shape: &Shape, covered: &Covered) -> Moments {
    let own = &shape.corners[..shape.len];
    let centroid = shape.centroid();
    let about = |p: &[DVec2]| {
        let moved: Vec<DVec2> = p.iter().map(|&c| c - centroid).collect();
        Moments::of(&moved)
    };
    let bounds = shape.bounds();
    let near = covered.parts.iter().filter(|(_, of_part)| overlap(&bounds, of_part));
    near.fold(about(own), |rest, (part, _)| rest.without(&about(&common(own, part))))
}
