//! Planes in space and the texture coordinates on them.
//!
//! Pure geometry; must not know images.

use glam::{DVec2, DVec3};

/// By how much texture coordinates may leave a plane that they share, relative to their extent.
const ON_PLANE: f64 = 1e-3;

/// The same relative to how far away they are: what 32-bit corners of a small triangle leave.
const ROUNDING: f64 = 1e-4;

/// How the places of a plane in space and in an image belong together.
pub(crate) struct Chart {
    origin: DVec3,
    /// Space per unit of each texture coordinate.
    along: [DVec3; 2],
    /// Texture coordinate per unit of space, and that of the origin.
    across: [DVec3; 2],
    at_origin: DVec2,
    extent: f64,
}

impl Chart {
    /// The chart of a triangle; `None` where its texture coordinates have no area, or it has none.
    pub(crate) fn new(points: [DVec3; 3], places: [DVec2; 3]) -> Option<Chart> {
        let (p, q) = (points[1] - points[0], points[2] - points[0]);
        let (s, t) = (places[1] - places[0], places[2] - places[0]);
        let turn = s.perp_dot(t);
        let extent = s.abs().max(t.abs()).max_element();
        let normal = p.cross(q);
        let is_wide = turn.abs() > 1e-9 * extent * extent;
        if !is_wide || normal.length_squared() == 0.0 {
            return None;
        }
        let along = [(p * t.y - q * s.y) / turn, (q * s.x - p * t.x) / turn];
        // The dual basis within the plane.
        let (one, other) = (q.cross(normal), normal.cross(p));
        let (one, other) = (one / one.dot(p), other / other.dot(q));
        let across = [one * s.x + other * t.x, one * s.y + other * t.y];
        Some(Chart { origin: points[0], along, across, at_origin: places[0], extent })
    }

    pub(crate) fn place(&self, point: DVec3) -> DVec2 {
        let d = point - self.origin;
        self.at_origin + DVec2::new(self.across[0].dot(d), self.across[1].dot(d))
    }

    pub(crate) fn point(&self, place: DVec2) -> DVec3 {
        let d = place - self.at_origin;
        self.origin + self.along[0] * d.x + self.along[1] * d.y
    }

    /// Whether a corner with this texture coordinate goes on in the same way.
    pub(crate) fn holds(&self, point: DVec3, place: DVec2) -> bool {
        let far = (place - self.at_origin).abs().max_element();
        let off = (self.place(point) - place).abs().max_element();
        off <= ON_PLANE * self.extent + ROUNDING * far
    }
}
