//! Points, directed segments and rigid motion of the plane: pure functions.

use glam::{DVec2, DVec3};

use crate::geometry::Aabb;

/// A directed segment, metres; its front is on its left, seen from start to end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it begins.
    pub start: DVec2,
    /// Where it ends.
    pub end: DVec2,
}

/// Share of the coordinates' size that counts as rounding.
pub(super) const ROUNDING: f64 = 1e-12;

impl Segment {
    /// From two points.
    pub fn new(start: DVec2, end: DVec2) -> Segment {
        Segment { start, end }
    }

    /// From start to end.
    #[inline]
    pub fn along(&self) -> DVec2 {
        self.end - self.start
    }

    /// Length, m.
    #[inline]
    pub fn length(&self) -> f64 {
        self.along().length()
    }

    /// Midpoint.
    pub fn centre(&self) -> DVec2 {
        0.5 * (self.start + self.end)
    }

    /// Unit normal of the front.
    pub fn normal(&self) -> DVec2 {
        self.along().perp() / self.length()
    }

    /// The segment from end to start: its front is this one's back.
    pub fn reversed(&self) -> Segment {
        Segment { start: self.end, end: self.start }
    }

    /// Signed distance of a point from the segment's line, positive in front.
    #[inline]
    pub fn distance(&self, point: DVec2) -> f64 {
        self.along().perp_dot(point - self.start) / self.length()
    }

    /// The point at a share of the way from start to end.
    pub fn at(&self, share: f64) -> DVec2 {
        self.start + self.along() * share
    }

    /// The half with number 0 or 1.
    pub fn half(&self, number: u32) -> Segment {
        match number {
            0 => Segment { start: self.start, end: self.centre() },
            _ => Segment { start: self.centre(), end: self.end },
        }
    }

    /// The part in front of the line of `other` by more than `least`, if there is one.
    pub fn in_front_of(&self, other: &Segment, least: f64) -> Option<Segment> {
        let (d0, d1) = (other.distance(self.start) - least, other.distance(self.end) - least);
        match (d0 > 0.0, d1 > 0.0) {
            (true, true) => Some(*self),
            (false, false) => None,
            (front, _) => {
                let cut = self.at(d0 / (d0 - d1));
                Some(match front {
                    true => Segment { start: self.start, end: cut },
                    false => Segment { start: cut, end: self.end },
                })
            }
        }
    }

    /// The box around it.
    pub(super) fn bounds(&self) -> Aabb {
        Aabb::of([in_space(self.start), in_space(self.end)])
    }

    /// Largest coordinate, m: what rounding is relative to.
    pub fn size(&self) -> f64 {
        self.start.abs().max(self.end.abs()).max_element()
    }
}

/// The plane in space: that of z = 0.
pub(super) fn in_space(v: DVec2) -> DVec3 {
    v.extend(0.0)
}

/// What counts as rounding between two segments, m.
pub(super) fn rounding(a: &Segment, b: &Segment) -> f64 {
    ROUNDING * a.size().max(b.size())
}

/// Rigid placement of a body in the plane: world = rotation x local + translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanePose {
    /// Cosine and sine of the angle.
    pub turn: DVec2,
    /// World position of the body's origin, metres.
    pub origin: DVec2,
}

impl PlanePose {
    /// Where everything is as it was made.
    pub const IDENTITY: PlanePose = PlanePose { turn: DVec2::X, origin: DVec2::ZERO };

    /// From an angle in radians, counter-clockwise, and the place of the body's origin.
    pub fn new(angle: f64, origin: DVec2) -> PlanePose {
        let (sin, cos) = libm::sincos(angle);
        PlanePose { turn: DVec2::new(cos, sin), origin }
    }

    /// World coordinates of a point of the body.
    #[inline]
    pub fn point(&self, local: DVec2) -> DVec2 {
        self.turn.rotate(local) + self.origin
    }

    /// Body coordinates of a point of the world.
    #[inline]
    pub fn back(&self, world: DVec2) -> DVec2 {
        (self.turn * DVec2::new(1.0, -1.0)).rotate(world - self.origin)
    }

    /// World coordinates of a segment of the body.
    pub fn segment(&self, local: &Segment) -> Segment {
        Segment { start: self.point(local.start), end: self.point(local.end) }
    }

    /// Body coordinates of a segment of the world.
    pub fn segment_back(&self, world: &Segment) -> Segment {
        Segment { start: self.back(world.start), end: self.back(world.end) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_on_the_left() {
        let floor = Segment::new(DVec2::ZERO, DVec2::new(2.0, 0.0));
        assert_eq!(floor.normal(), DVec2::Y);
        assert_eq!(floor.distance(DVec2::new(5.0, 3.0)), 3.0);
        let wall = Segment::new(DVec2::new(1.0, -1.0), DVec2::new(1.0, 3.0));
        let above = wall.in_front_of(&floor, 0.0).unwrap();
        assert_eq!(above, Segment::new(DVec2::new(1.0, 0.0), DVec2::new(1.0, 3.0)));
        assert_eq!(floor.in_front_of(&floor, 0.0), None);
    }

    #[test]
    fn a_pose_and_its_inverse_cancel() {
        let pose = PlanePose::new(0.7, DVec2::new(3.0, -2.0));
        let p = DVec2::new(0.3, 0.9);
        assert!((pose.back(pose.point(p)) - p).length() < 1e-15 * 8.0);
    }
}
