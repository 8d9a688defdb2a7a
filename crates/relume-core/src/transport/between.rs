//! Blockers between two ends, and what of them an observer sees against the other end.

use glam::DVec3;

use super::clip::{Occluders, keep_front};
use super::silhouette::Silhouette;
use super::target_frame::TargetFrame;
use crate::element::WorldElement;
use crate::geometry::{Plane, Pose};
use crate::scene::Solid;

/// Blockers between two ends, in one frame: convex polygons, and solids that some of them are faces of.
#[derive(Default)]
pub(super) struct Between<'a> {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
    /// Unit normals, and the convex solids whose faces they are.
    faces: Vec<(DVec3, Option<u32>)>,
    solids: Vec<PlacedSolid<'a>>,
}

/// A solid, and its way into the frame.
pub(super) struct PlacedSolid<'a> {
    pub(super) number: u32,
    pub(super) solid: &'a Solid,
    pub(super) pose: Pose,
}

impl<'a> Between<'a> {
    /// Adds a polygon with its unit normal and the convex solid whose face it is.
    pub(super) fn push(
        &mut self,
        corners: impl Iterator<Item = DVec3>,
        normal: DVec3,
        solid: Option<u32>,
    ) {
        self.corners.extend(corners);
        self.ends.push(self.corners.len());
        self.faces.push((normal, solid));
    }

    /// Adds a solid, two or more of whose faces were or will be pushed: its silhouette may replace them.
    pub(super) fn push_solid(&mut self, solid: PlacedSolid<'a>) {
        self.solids.push(solid);
    }

    /// Those that hide something from an end: where it is wholly in front of one face of a solid, it is
    /// outside, and faces that it is wholly behind hide nothing that others do not. `without` the faces of some solids.
    fn facing<'b>(
        &'b self,
        observer: &'b WorldElement,
        slack: f64,
        without: &'b [u32],
    ) -> impl Iterator<Item = &'b [DVec3]> + 'b {
        let span = move |(corners, (normal, _)): (&[DVec3], &(DVec3, Option<u32>))| {
            observer.span(&Plane::through(corners[0], *normal))
        };
        let all = || self.iter().zip(&self.faces);
        let is_outside = move |solid: u32| {
            all().any(|(corners, face)| face.1 == Some(solid) && span((corners, face)).lo > slack)
        };
        let hides = move |(corners, face): &(&[DVec3], &(DVec3, Option<u32>))| match face.1 {
            Some(solid) if without.contains(&solid) => false,
            Some(solid) => span((corners, face)).hi >= -slack || !is_outside(solid),
            None => true,
        };
        all().filter(hides).map(|(corners, _)| corners)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        (0..self.ends.len()).map(|k| {
            let start = if k == 0 { 0 } else { self.ends[k - 1] };
            &self.corners[start..self.ends[k]]
        })
    }

    /// As they are seen from points of the observer's plane: parts in front of both ends' planes, in the
    /// other's frame.
    pub(super) fn seen(
        &self,
        observer: &WorldElement,
        other: &WorldElement,
        frame: &TargetFrame,
        slack: f64,
    ) -> Occluders {
        let from = frame.place(observer.centre);
        let raised = |p: &Plane| Plane { normal: p.normal, offset: p.offset + slack };
        let planes = [raised(&observer.plane), raised(&other.plane)];
        let mut out = Occluders::default();
        let mut whole = Vec::new();
        // The near plane in the frame.
        let up = frame.direction(observer.plane.normal);
        let is_low = |c: DVec3| up.dot(c - from) <= slack;
        let [a, b, c, d] = &observer.corners;
        let corners = [frame.place(*a), frame.place(*b), frame.place(*c), frame.place(*d)];
        for PlacedSolid { number, solid, pose } in &self.solids {
            // What reaches behind the other's plane hides less than its silhouette.
            if solid.corners.iter().all(|&c| other.plane.distance(pose.point(c)) >= -slack) {
                let place = |c: DVec3| frame.place(pose.point(c));
                let turn = |d: DVec3| frame.direction(pose.direction(d));
                let silhouette = Silhouette::new(solid, (place, turn), &corners, is_low);
                out.push_solid(silhouette, from);
                whole.push(*number);
            }
        }
        let (mut part, mut rest) = (Vec::new(), Vec::new());
        for corners in self.facing(observer, slack, &whole) {
            part.clear();
            part.extend_from_slice(corners);
            for plane in &planes {
                keep_front(&mut part, &mut rest, plane);
            }
            if part.len() >= 3 {
                out.push(part.iter().map(|&c| frame.place(c)), from);
            }
        }
        out.largest_first();
        out
    }
}
