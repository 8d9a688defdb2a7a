//! The frame of a polygon that is looked at.

use glam::{DVec2, DVec3};

use crate::element::WorldElement;

/// The frame of a target: the first two axes in its plane, the third towards its front.
pub(super) struct TargetFrame {
    origin: DVec3,
    axes: [DVec3; 3],
}

impl TargetFrame {
    pub(super) fn of(e: &WorldElement) -> TargetFrame {
        TargetFrame { origin: e.centre, axes: [e.axes[0], e.axes[1], e.plane.normal] }
    }

    /// Frame of a planar polygon with three or more corners.
    pub(super) fn of_polygon(c: &[DVec3]) -> TargetFrame {
        let fan = |k: usize| (c[k] - c[0]).cross(c[k + 1] - c[0]);
        let up = (1..c.len() - 1).map(fan).sum::<DVec3>().normalize_or_zero();
        let along = (c[1] - c[0]).normalize_or_zero();
        TargetFrame { origin: c[0], axes: [along, up.cross(along), up] }
    }

    pub(super) fn direction(&self, d: DVec3) -> DVec3 {
        DVec3::new(d.dot(self.axes[0]), d.dot(self.axes[1]), d.dot(self.axes[2]))
    }

    pub(super) fn place(&self, p: DVec3) -> DVec3 {
        self.direction(p - self.origin)
    }

    /// A point of the target's plane.
    pub(super) fn point(&self, p: DVec2) -> DVec3 {
        self.origin + self.axes[0] * p.x + self.axes[1] * p.y
    }

    /// Corners of the target within its plane.
    pub(super) fn flat(&self, corners: &[DVec3]) -> Vec<DVec2> {
        corners.iter().map(|&c| self.place(c).truncate()).collect()
    }
}
