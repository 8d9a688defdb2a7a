//! Patches where they lie in one frame. Pure geometry.

use glam::{DVec2, DVec3};

use super::{Frame, Patch, PatchId};
use crate::geometry::{Aabb, Pose};

/// What lies this close to a plane, as a share of the largest coordinate, lies in it: a few roundings of 32-bit numbers.
pub(super) const IN_PLANE: f64 = 1e-6;

/// Largest coordinate of a box, metres.
pub(super) fn reach_m(bounds: &Aabb) -> f64 {
    bounds.lo.abs().max(bounds.hi.abs()).max_element()
}

/// A patch in the frame of its group.
pub(super) struct Placed {
    pub(super) id: PatchId,
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
    pub(super) bounds: Aabb,
    /// Origin and axes of its plane.
    pub(super) origin: DVec3,
    pub(super) axes: [DVec3; 2],
}

impl Placed {
    /// A patch of a body that is at a pose.
    pub(super) fn new(id: PatchId, patch: &Patch, pose: &Pose) -> Placed {
        let corners: Vec<DVec3> = patch.corners_in_body().map(|c| pose.point(c)).collect();
        let bounds = Aabb::of(corners.iter().copied());
        let Frame { origin, u, v, normal } = patch.frame;
        let [u, v, normal] = [u, v, normal].map(|d| pose.direction(d));
        Placed { id, corners, normal, bounds, origin: pose.point(origin), axes: [u, v] }
    }

    /// Its corners in its own frame.
    pub(super) fn outline(&self) -> Vec<DVec2> {
        self.corners.iter().map(|&c| self.in_frame(c)).collect()
    }

    /// A point of its own frame in the group's.
    pub(super) fn point(&self, p: DVec2) -> DVec3 {
        self.origin + self.axes[0] * p.x + self.axes[1] * p.y
    }

    /// A point of the group's frame in the patch's own.
    pub(super) fn in_frame(&self, p: DVec3) -> DVec2 {
        let d = p - self.origin;
        DVec2::new(d.dot(self.axes[0]), d.dot(self.axes[1]))
    }
}
