//! Spots: how unevenly a lamp lights an element close to it. A pure query about shapes and places; must not know how bright
//! the lamp is.

use crate::element::{OccluderPolygon, WorldElement};
use crate::geometry::Plane;

use super::clip::keep_in_front;
use super::point::form_factor_from_point;

/// Standard deviation over an element of the irradiance from a lamp, over the mean irradiance if all that the lamp (of area
/// `lamp_m2`) emits arrives evenly on the surface around the element (of area `around_m2`): 1.
///
/// Over an element narrower than the spot by the form factors from its corners and its middle, over a larger one as if the spot were
/// lit evenly and all else dark. A spot is as large as the lamp and the way to it together. Cost: 0.2 us.
pub(super) fn spot(
    e: &WorldElement,
    around_m2: f64,
    (lamp, lamp_m2): (&OccluderPolygon<'_>, f64),
) -> f64 {
    let first = lamp.corners[0];
    let length_m = lamp.corners.iter().map(|c| c.distance(first)).fold(0.0, f64::max);
    let away_m = (lamp.distance(e.centre) - e.radius).max(0.0);
    let (long_m, wide_m) = (length_m + away_m, lamp_m2 / length_m + away_m);
    let size_m = e.area.sqrt();
    if size_m > wide_m {
        let share = (wide_m * size_m.min(long_m) / e.area).min(0.5);
        return around_m2 / (long_m * wide_m) * deviation(share, share);
    }
    let (mut sum, mut squares) = (0.0, 0.0);
    // Exact for what is linear, and aware of a spot that ends at the side of the element.
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|at| (at, 1.0 / 12.0));
    for ((s, t), weight) in corners.into_iter().chain([((0.5, 0.5), 2.0 / 3.0)]) {
        let point = e.point(s, t);
        let mut corners = lamp.corners.to_vec();
        keep_in_front(&mut corners, &Plane::through(point, e.plane.normal));
        let factor = match corners.len() {
            0..3 => 0.0,
            _ => form_factor_from_point(point, e.plane.normal, &corners),
        };
        (sum, squares) = (sum + weight * factor, squares + weight * factor * factor);
    }
    around_m2 / lamp_m2 * deviation(sum, squares)
}

/// Standard deviation of what has a mean and a mean square.
fn deviation(mean: f64, square: f64) -> f64 {
    (square - mean * mean).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Aabb, ConvexPolygon};
    use glam::{DVec3, dvec3};

    /// A square facing down at a height, about a place.
    fn ceiling(x: f64, size: f64) -> WorldElement {
        let h = 0.5 * size;
        let corners = [
            dvec3(x - h, -h, 0.1),
            dvec3(x - h, h, 0.1),
            dvec3(x + h, h, 0.1),
            dvec3(x + h, -h, 0.1),
        ];
        WorldElement {
            corners,
            len: 4,
            plane: Plane::through(corners[0], DVec3::NEG_Z),
            axes: [DVec3::Y, DVec3::X],
            centre: dvec3(x, 0.0, 0.1),
            radius: h * 2.0_f64.sqrt(),
            area: ConvexPolygon::new(&corners).area(),
            bounds: Aabb::of(corners),
            rounding_m: 1e-12,
        }
    }

    fn of(e: &WorldElement) -> f64 {
        let lamp = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
        let corners = lamp.map(|(x, y)| dvec3(x, y, 0.0));
        let edges = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y]
            .map(|n| Plane { normal: n, offset: 0.5 });
        let plane = Plane::through(corners[0], DVec3::Z);
        spot(e, 16.0, (&OccluderPolygon { plane, corners: &corners, edges: &edges }, 1.0))
    }

    #[test]
    fn a_lamp_close_to_a_ceiling_throws_a_spot_with_an_edge() {
        // Inside it is even, across its edge as uneven as can be: from 1 to 0.
        let (inside, across, beside) = (ceiling(0.0, 0.2), ceiling(0.5, 0.4), ceiling(3.0, 0.4));
        assert!(of(&inside) < 0.2, "{}", of(&inside));
        // Exact: 5.34. Five points find a step across the middle a quarter too small, and one at a side at all.
        assert!((3.8..6.9).contains(&of(&across)), "{}", of(&across));
        assert!(of(&beside) < 0.1, "{}", of(&beside));
        // Four square metres, of which one is lit, on average by a sixteenth of what is around.
        let large = of(&ceiling(0.0, 2.0));
        let exact = 16.0 * (0.25_f64 * 0.75).sqrt();
        assert!((large - exact).abs() < 0.5 * exact, "{large}, not {exact}");
    }
}
