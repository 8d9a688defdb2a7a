//! What elements exchange within bodies and narrow gaps, where no light is.
//!
//! A box that is sunk into a floor and a wall covers a part of both, and these parts see each other within it. Exchange areas have that
//! in them; light is carried by the rest.

use crate::element::{ElementId, Forest, PartInside};
use crate::transport::exchange_of_polygons;

/// Exchange area of what of two elements lies within the same bodies or narrow gaps, m2; of all of both `exchange_m2`.
pub(super) fn exchange_inside_m2(
    forest: &Forest,
    (a, b): (ElementId, ElementId),
    exchange_m2: f64,
) -> f64 {
    if !forest.may_be_inside_alike(a, b) {
        return 0.0;
    }
    let (of_a, of_b) = (forest.parts_inside(a), forest.parts_inside(b));
    let both = |one: &PartInside, two: &PartInside| match one.of == two.of {
        true if one.is_whole && two.is_whole => exchange_m2,
        true => exchange_of_polygons((&one.corners, one.normal), (&two.corners, two.normal)),
        false => 0.0,
    };
    of_a.iter().map(|one| of_b.iter().map(|two| both(one, two)).sum::<f64>()).sum()
}
