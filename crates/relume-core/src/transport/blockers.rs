//! Blockers of a pair made ready to be clipped: lifted off the ends that they lie on, in one frame, solids as wholes where that is
//! cheaper.

use glam::DVec3;

use crate::geometry::{Plane, Pose, is_outside_hull};
use crate::scene::PatchId;

use super::between::{Between, PlacedSolid};
use super::clip::keep_in_front;
use super::clipping::Clipping;
use super::kernel::Simd;
use super::point_view::is_hidden;
use super::prepared_view::PreparedView;
use super::shaft::{Shaft, TestFrame};
use super::side::Side;
use super::tuning::GRAZED;

impl<'a> Shaft<'a> {
    /// Whether none of some blockers of two elements reaches into the convex hull of the two, which holds all segments between
    /// them: boxes hold more.
    pub fn is_beside(&self, blockers: &[PatchId]) -> bool {
        let (slack, mut corners) = (self.slack(), Vec::new());
        blockers.iter().all(|&patch| {
            let TestFrame { a, b, .. } = self.frame_of(patch);
            corners.clear();
            corners.extend(self.lifted(patch).1.corners());
            let ends = (&a.corners[..a.len], &b.corners[..b.len]);
            is_outside_hull(ends, &corners, slack, GRAZED)
        })
    }

    /// Number of occluders that blockers make up: solids that hide with their silhouettes count as one for every
    /// eight of their faces, which may have to be clipped one by one after all.
    pub fn occluders(&self, blockers: &[PatchId]) -> usize {
        let whole = self.whole_solids(blockers);
        let faces: usize = whole.iter().map(|(_, faces)| faces).sum();
        blockers.len() - faces + whole.iter().map(|(_, faces)| 1 + faces / 8).sum::<usize>()
    }

    /// The solids that hide more cheaply with their silhouettes than with those of their faces that are
    /// among some blockers, and how many those are. Not an end's own, of which no face is in the way.
    fn whole_solids(&self, blockers: &[PatchId]) -> Vec<(u32, usize)> {
        // With how many faces there are, and corners of those.
        let mut solids: Vec<(u32, usize, usize)> = Vec::new();
        for &patch in blockers {
            let Some(solid) = self.forest.solid(patch) else { continue };
            let count = self.view.occluder(patch).corners.len();
            match solids.iter_mut().find(|found| found.0 == solid) {
                Some((_, faces, corners)) => (*faces, *corners) = (*faces + 1, *corners + count),
                None => solids.push((solid, 1, count)),
            }
        }
        let ends = [self.forest.solid(self.patches.0), self.forest.solid(self.patches.1)];
        let is_cheaper = |&(solid, faces, corners): &(u32, usize, usize)| {
            // A single face is as good, and a few of a ball are better.
            let edges = self.forest.solid_shape(solid).edges.len();
            faces >= 2 && edges <= 2 * corners && !ends.contains(&Some(solid))
        };
        solids.into_iter().filter(is_cheaper).map(|(solid, faces, _)| (solid, faces)).collect()
    }

    /// Blockers in one frame: that of the pair's body if it has one of its own.
    fn between(&self, blockers: &[PatchId]) -> Between<'a> {
        let mut out = Between::default();
        let own =
            self.own.map(|(own, _, _)| self.view.poses()[own.0 as usize].unwrap_or(Pose::IDENTITY));
        for &patch in blockers {
            let (rides, lifted) = self.lifted(patch);
            let (corners, normal) = (lifted.corners(), lifted.polygon.plane.normal);
            let solid = self.forest.solid(patch);
            match own {
                Some(pose) if !rides => {
                    let normal = pose.rotation.transpose() * normal;
                    out.push(corners.map(|c| pose.inverse_point(c)), normal, solid);
                }
                _ => out.push(corners, normal, solid),
            }
        }
        for (number, _) in self.whole_solids(blockers) {
            let solid = self.forest.solid_shape(number);
            let pose = self.view.poses()[solid.body.0 as usize].unwrap_or(Pose::IDENTITY);
            let pose = match (own, self.own) {
                (Some(_), Some((body, _, _))) if body == solid.body => Pose::IDENTITY,
                (Some(own), _) => own.inverse() * pose,
                _ => pose,
            };
            out.push_solid(PlacedSolid { number, solid, pose });
        }
        out
    }

    /// Whether the blockers hide all of the first end from a point in front of it.
    pub(super) fn is_hidden_from(&self, from: DVec3, blockers: &[PatchId]) -> bool {
        let (plane, slack) = (&self.a.plane, self.slack());
        // Only what is between the end's plane and the point's hides anything.
        let height = plane.distance(from);
        let above = Plane { offset: plane.offset + slack, ..*plane };
        let below = Plane { normal: -plane.normal, offset: -(plane.offset + height - slack) };
        let between = |&patch: &PatchId| {
            let mut corners: Vec<DVec3> = self.lifted(patch).1.corners().collect();
            keep_in_front(&mut corners, &above);
            keep_in_front(&mut corners, &below);
            (corners.len() >= 3).then_some(corners)
        };
        let between: Vec<Vec<DVec3>> = blockers.iter().filter_map(between).collect();
        is_hidden(from, &self.a.corners[..self.a.len], between.iter().map(Vec::as_slice))
    }
}

/// A pair made ready to be clipped past its blockers ([`Shaft::occluders`] says how many that are): in the
/// frame of the body that both ends ride on, if they do.
pub fn clipping<'a>(simd: Simd, shaft: &Shaft<'a>, blockers: &[PatchId]) -> Clipping<'a> {
    let TestFrame { a, b, .. } = shaft.own_frame();
    Clipping::new(simd, (a, b), &shaft.between(blockers))
}

/// View from one end of a pair to the other past blockers, prepared for many points; in the frame of the body that both
/// ride on, if they do.
pub fn prepare_view(
    simd: Simd,
    shaft: &Shaft<'_>,
    blockers: &[PatchId],
    observer: Side,
) -> PreparedView {
    let TestFrame { a, b, .. } = shaft.own_frame();
    let (observer, other) = if observer == Side::B { (b, a) } else { (a, b) };
    PreparedView::new(simd, observer, other, &shaft.between(blockers))
}
