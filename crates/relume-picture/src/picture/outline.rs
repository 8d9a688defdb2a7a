//! The edges of polygons as a view sees them, for line drawings.
//!
//! Must not know what the polygons are, nor hide any behind others.

use glam::{DVec2, DVec3};

use super::camera::View;
use super::project::{Projector, clip_to_pixels};

/// Depth that is cut off, as a share of the distance to a polygon's farthest corner.
const NEAR: f64 = 1e-6;

/// A view with the size of its picture.
#[derive(Clone, Copy, Debug)]
pub struct Outlines {
    projector: Projector,
    size: DVec2,
}

impl Outlines {
    /// As in a picture of `width` x `height` pixels.
    pub fn new(view: &View, width: u32, height: u32) -> Outlines {
        let size = DVec2::new(f64::from(width), f64::from(height));
        Outlines { projector: Projector::new(view, width, height), size }
    }

    /// Where the view is taken from, metres.
    pub fn eye(&self) -> DVec3 {
        self.projector.eye()
    }

    /// Whether the front of a convex polygon faces the view; its corners (world, metres) go
    /// counter-clockwise seen from there.
    pub fn faces(&self, corners: &[DVec3]) -> bool {
        let sides = corners.windows(2).map(|e| (e[0] - corners[0]).cross(e[1] - corners[0]));
        self.projector.faces(corners[0], sides.sum())
    }

    /// The parts of a convex polygon's edges that are in the picture, from end to end in pixels from the
    /// upper left corner.
    pub fn edges(&self, corners: &[DVec3]) -> Vec<[DVec2; 2]> {
        let far = corners.iter().map(|p| p.distance(self.eye())).fold(0.0, f64::max);
        let seen: Vec<_> = corners.iter().map(|&p| self.projector.project(p)).collect();
        let mut out = Vec::new();
        clip_to_pixels(&seen, NEAR * far, &mut out);
        let pairs = (0..out.len()).map(|k| [out[k], out[(k + 1) % out.len()]]);
        pairs.filter_map(|edge| self.within(edge)).collect()
    }

    /// The part of a line that is in the picture.
    fn within(&self, [from, to]: [DVec2; 2]) -> Option<[DVec2; 2]> {
        let along = to - from;
        let (mut begin, mut end) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            for (speed, room) in
                [(along[axis], self.size[axis] - from[axis]), (-along[axis], from[axis])]
            {
                if speed > 0.0 {
                    end = end.min(room / speed);
                } else if speed < 0.0 {
                    begin = begin.max(room / speed);
                } else if room < 0.0 {
                    return None;
                }
            }
        }
        (begin < end).then(|| [from + along * begin, from + along * end])
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;
    use relume_core::geometry::Pose;
    use relume_core::scene::Projection;

    use super::*;

    #[test]
    fn a_square_in_front_is_seen_where_it_is_and_cut_at_the_frame() {
        let world_from_camera = Pose { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
        // Half a unit of slope up and down.
        let yfov = 2.0 * libm::atan(0.5);
        let projection = Projection::Perspective { yfov, aspect: None };
        let outlines = Outlines::new(&View { world_from_camera, projection }, 200, 100);
        let square = |x: f64| {
            [(0., 0.), (1., 0.), (1., 1.), (0., 1.)].map(|(u, v)| DVec3::new(x + u, v - 0.5, -2.0))
        };
        assert!(outlines.faces(&square(0.0)));
        let mut turned = square(0.0);
        turned.reverse();
        assert!(!outlines.faces(&turned));
        let edges = outlines.edges(&square(0.0));
        assert_eq!(edges.len(), 4);
        // 100 pixels for a slope of 1: from the middle to half of that, 25 up and 25 down.
        let near = |p: DVec2, x: f64, y: f64| p.distance(DVec2::new(x, y)) < 1e-9;
        assert!(near(edges[0][0], 100.0, 75.0) && near(edges[0][1], 150.0, 75.0), "{edges:?}");
        // Half outside: one edge is gone and two are cut.
        let cut = outlines.edges(&square(1.5));
        assert_eq!(cut.len(), 3);
        assert!(cut.iter().flatten().all(|p| p.x <= 200.0 + 1e-9));
    }
}
