//! From a loop of points in space to a convex polygon in the frame of its plane.
//!
//! Pure geometry; must not know nodes, materials or files.

use glam::{DVec2, DVec3};

use super::Frame;

/// Largest share of a polygon's extent by which a corner may leave its plane or a straight side:
/// above the rounding of 32-bit coordinates, far below any angle that is modelled on purpose.
pub const FLATNESS: f64 = 1e-5;

/// Why a loop of points is not a convex polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// No area relative to its extent.
    Degenerate,
    /// Corners off the plane.
    NonPlanar,
    /// A corner turns inward, or sides cross.
    NotConvex,
}

/// The frame and corners of a loop, counter-clockwise seen from the front, relative tolerance
/// [`FLATNESS`]; doubled and collinear corners are removed.
pub fn flatten(points: &[DVec3]) -> Result<(Frame, Vec<DVec2>), Flaw> {
    let frame = frame_of(points).ok_or(Flaw::Degenerate)?;
    let extent = extent_of(points);
    if points.iter().any(|&p| (p - frame.origin).dot(frame.normal).abs() > FLATNESS * extent) {
        return Err(Flaw::NonPlanar);
    }
    let plane =
        |p: &DVec3| DVec2::new((p - frame.origin).dot(frame.u), (p - frame.origin).dot(frame.v));
    let corners = without_collinear(points.iter().map(plane).collect(), 0.2 * FLATNESS * extent);
    if corners.len() < 3 {
        return Err(Flaw::Degenerate);
    }
    if !is_convex(&corners) {
        return Err(Flaw::NotConvex);
    }
    Ok((frame, corners))
}

/// The same polygon seen from behind, with exactly the same points.
pub fn seen_from_behind(frame: &Frame, corners: &[DVec2]) -> (Frame, Vec<DVec2>) {
    let behind = Frame { origin: frame.origin, u: frame.v, v: frame.u, normal: -frame.normal };
    (behind, corners.iter().rev().map(|c| DVec2::new(c.y, c.x)).collect())
}

/// Newell's vector: twice the area times the normal. Exact up to rounding for planar loops.
pub fn area_vector(points: &[DVec3]) -> DVec3 {
    let o = points[0];
    (1..points.len() - 1).map(|i| (points[i] - o).cross(points[i + 1] - o)).sum()
}

/// Largest distance from the first point.
fn extent_of(points: &[DVec3]) -> f64 {
    points.iter().map(|p| p.distance(points[0])).fold(0.0, f64::max)
}

/// A frame with its first axis along the longest side, or `None` where there is no area.
fn frame_of(points: &[DVec3]) -> Option<Frame> {
    if points.len() < 3 {
        return None;
    }
    let area = area_vector(points);
    let extent = extent_of(points);
    // Scaled before squaring lengths, so that very small polygons are not taken for empty ones.
    let scaled = area / (extent * extent);
    if !scaled.is_finite() || scaled.length() < 1e-9 {
        return None;
    }
    let normal = scaled.normalize();
    let n = points.len();
    let side = |i: usize| (points[(i + 1) % n] - points[i]) / extent;
    let longest =
        (0..n).fold(0, |best, i| if side(i).length() > side(best).length() { i } else { best });
    let along = side(longest) - normal * side(longest).dot(normal);
    let u = along.normalize();
    Some(Frame { origin: points[longest], u, v: normal.cross(u), normal })
}

/// Removes corners closer than `tolerance` to the line through their neighbours.
fn without_collinear(corners: Vec<DVec2>, tolerance: f64) -> Vec<DVec2> {
    let straight = |a: DVec2, b: DVec2, c: DVec2| {
        let chord = c - a;
        a.distance(b) <= tolerance || chord.perp_dot(b - a).abs() <= tolerance * chord.length()
    };
    // Once along the loop, then round it until nothing changes: linear, where few are left to do.
    let mut kept: Vec<DVec2> = Vec::with_capacity(corners.len());
    for c in corners {
        while let [.., a, b] = kept[..]
            && straight(a, b, c)
        {
            kept.pop();
        }
        kept.push(c);
    }
    let mut i = 0;
    let mut good_in_a_row = 0;
    while kept.len() >= 3 && good_in_a_row < kept.len() {
        let n = kept.len();
        i %= n;
        if straight(kept[(i + n - 1) % n], kept[i], kept[(i + 1) % n]) {
            kept.remove(i);
            good_in_a_row = 0;
            // The neighbours' angles changed: look at the one before again.
            i += n - 2;
        } else {
            good_in_a_row += 1;
            i += 1;
        }
    }
    kept
}

/// Whether all corners turn left, once around in all.
fn is_convex(corners: &[DVec2]) -> bool {
    let n = corners.len();
    let side = |i: usize| corners[(i + 1) % n] - corners[i % n];
    let turns_left = (0..n).all(|i| side(i).perp_dot(side(i + 1)) > 0.0);
    let upward = |i: usize| side(i).y > 0.0 || (side(i).y == 0.0 && side(i).x > 0.0);
    let reversals = (0..n).filter(|&i| upward(i) != upward(i + 1)).count();
    turns_left && reversals == 2
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loop_of(points: &[[f64; 3]]) -> Vec<DVec3> {
        points.iter().map(|&p| DVec3::from_array(p)).collect()
    }

    #[test]
    fn a_square_with_a_corner_on_a_side_is_four_corners() {
        let square =
            loop_of(&[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [2., 2., 0.], [0., 2., 0.]]);
        let (frame, corners) = flatten(&square).unwrap();
        assert_eq!(frame.normal, DVec3::Z);
        assert_eq!(corners.len(), 4);
        let area: f64 =
            (0..4).map(|i| corners[i].perp_dot(corners[(i + 1) % 4])).sum::<f64>() / 2.0;
        assert_eq!(area, 4.0);
    }

    #[test]
    fn seen_from_behind_has_the_same_points_and_the_other_normal() {
        let (frame, corners) =
            flatten(&loop_of(&[[0., 0., 1.], [3., 0., 1.], [3., 1., 2.], [0., 1., 2.]])).unwrap();
        let (back, back_corners) = seen_from_behind(&frame, &corners);
        assert_eq!(back.normal, -frame.normal);
        assert!(back.u.cross(back.v).distance(back.normal) < 1e-15);
        let front: Vec<DVec3> = corners.iter().map(|&c| frame.point(c)).collect();
        for (p, q) in back_corners.iter().map(|&c| back.point(c)).zip(front.iter().rev()) {
            assert!(p.distance(*q) < 1e-15);
        }
    }

    #[test]
    fn flaws_have_names_at_every_scale() {
        for scale in [1e-6, 1.0, 1e6] {
            let check = |points: &[[f64; 3]]| {
                let scaled: Vec<DVec3> =
                    points.iter().map(|&p| DVec3::from_array(p) * scale).collect();
                flatten(&scaled).err()
            };
            assert_eq!(check(&[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.]]), Some(Flaw::Degenerate));
            assert_eq!(
                check(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.1], [0., 1., 0.]]),
                Some(Flaw::NonPlanar)
            );
            let dart = [[0., 0., 0.], [2., 0., 0.], [0.5, 0.5, 0.], [0., 2., 0.]];
            assert_eq!(check(&dart), Some(Flaw::NotConvex));
            assert_eq!(check(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]), None);
        }
    }

    #[test]
    fn a_star_that_winds_twice_is_not_convex() {
        let star: Vec<DVec3> = (0..5)
            .map(|i| {
                let a = 2.0 * std::f64::consts::TAU * f64::from(i) / 5.0;
                DVec3::new(a.cos(), a.sin(), 0.0)
            })
            .collect();
        assert_eq!(flatten(&star).err(), Some(Flaw::NotConvex));
    }
}
