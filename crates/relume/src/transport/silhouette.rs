//! The shadow of a convex solid: its sides run through the edges between faces that a point sees and
//! faces that it does not.

use glam::DVec3;

use crate::scene::Solid;

/// A solid in some frame, made ready to be looked at from points of one plane, the near one.
pub(super) struct Silhouette {
    corners: Vec<DVec3>,
    faces: Vec<Face>,
    edges: Vec<Edge>,
}

struct Face {
    normal: DVec3,
    /// One of its corners.
    corner: usize,
    /// It lies in the near plane, or behind it: no point of the plane sees it.
    is_low: bool,
}

/// An edge that is not wholly in the near plane or behind it: those bound nothing in front.
struct Edge {
    ends: [usize; 2],
    /// It runs counter-clockwise about the first, clockwise about the second.
    faces: [usize; 2],
}

impl Silhouette {
    /// Corners and normals by `place` and `turn` to the frame; `is_low` says of a corner in the frame
    /// whether it is in the near plane or behind it.
    pub(super) fn new(
        solid: &Solid,
        place: impl Fn(DVec3) -> DVec3,
        turn: impl Fn(DVec3) -> DVec3,
        is_low: impl Fn(DVec3) -> bool,
    ) -> Silhouette {
        let corners: Vec<DVec3> = solid.corners.iter().map(|&c| place(c)).collect();
        let low: Vec<bool> = corners.iter().map(|&c| is_low(c)).collect();
        let mut faces: Vec<Face> = solid
            .faces
            .iter()
            .map(|f| Face { normal: turn(f.normal), corner: f.corner as usize, is_low: true })
            .collect();
        let mut edges = Vec::with_capacity(solid.edges.len());
        for edge in &solid.edges {
            let (ends, of) = (edge.ends.map(|c| c as usize), edge.faces.map(|f| f as usize));
            if !ends.iter().all(|&c| low[c]) {
                of.iter().for_each(|&f| faces[f].is_low = false);
                edges.push(Edge { ends, faces: of });
            }
        }
        Silhouette { corners, faces, edges }
    }

    /// About the solid angle that it hides from a point.
    pub(super) fn size(&self, from: DVec3) -> f64 {
        let away = self.corners.iter().sum::<DVec3>() / self.corners.len() as f64 - from;
        let about = |c: &DVec3| (*c - from - away).length_squared();
        let radius2 = self.corners.iter().map(about).fold(0.0, f64::max);
        radius2 / away.length_squared().max(f64::MIN_POSITIVE)
    }

    /// Calls `side` with the outward-to-inward normal of each plane through the point that bounds the
    /// shadow, until it returns false; false then. A point inside, or under a face, has no such plane:
    /// everything is in the shadow.
    pub(super) fn cast(
        &self,
        point: DVec3,
        seen: &mut Vec<bool>,
        mut side: impl FnMut(DVec3) -> bool,
    ) -> bool {
        let is_seen = |f: &Face| !f.is_low && f.normal.dot(point - self.corners[f.corner]) > 0.0;
        seen.clear();
        seen.extend(self.faces.iter().map(is_seen));
        self.edges.iter().all(|edge| {
            let [left, right] = edge.faces.map(|f| seen[f]);
            if left == right {
                return true;
            }
            let [p, q] = edge.ends.map(|c| self.corners[c] - point);
            side(if left { q.cross(p) } else { p.cross(q) })
        })
    }
}
