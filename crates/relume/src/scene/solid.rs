//! Which patches are the faces of convex solids.
//!
//! What reaches such a face from behind has come through a face from the front: seen from outside, the
//! faces that look away hide nothing that the others do not. Must not know light transport.

use std::collections::BTreeMap;

use glam::DVec3;

use super::weld::Weld;
use super::{BodyId, Scene};

/// Corners closer together than this share of a body's coordinates are one, and this much a corner may
/// lie in front of a face: a few roundings of 32-bit numbers.
const WELDED: f64 = 1e-6;

/// Faces beyond which nobody looks whether a solid is convex.
const FACES_MAX: usize = 1_024;

impl Scene {
    /// For each patch the convex solid whose face it is, if it is one's: a closed, convex group of
    /// one-sided patches of one body that look outwards and meet along whole sides.
    pub fn solids(&self) -> Vec<Option<u32>> {
        let mut of_patch = vec![None; self.patches.len()];
        let mut next = 0;
        for body in (0..self.bodies.len() as u32).map(BodyId) {
            for faces in self.solids_of(body) {
                faces.iter().for_each(|&patch| of_patch[patch as usize] = Some(next));
                next += 1;
            }
        }
        of_patch
    }

    fn solids_of(&self, body: BodyId) -> Vec<Vec<u32>> {
        let one_sided = || self.patches_of(body).filter(|(_, patch)| patch.twin.is_none());
        let coordinates = |reach: f64, p: DVec3| reach.max(p.abs().max_element());
        let reach = one_sided().flat_map(|(_, p)| p.corners_in_body()).fold(0.0, coordinates);
        let mut weld = Weld::new(WELDED * reach);
        let face = |(id, patch): (super::PatchId, &super::Patch)| {
            let corners = patch.corners_in_body().map(|c| weld.vertex(c)).collect();
            Face { patch: id.0, corners, normal: patch.frame.normal, origin: patch.frame.origin }
        };
        let faces: Vec<Face> = one_sided().map(face).collect();
        let groups = closed(&faces);
        let is_convex = |group: &Vec<usize>| {
            let mut corners: Vec<u32> =
                group.iter().flat_map(|&f| faces[f].corners.iter().copied()).collect();
            corners.sort_unstable();
            corners.dedup();
            group.iter().map(|&f| &faces[f]).all(|face| {
                let above = |&c: &u32| (weld.points[c as usize] - face.origin).dot(face.normal);
                corners.iter().all(|c| above(c) <= weld.tolerance)
            })
        };
        let convex = groups.into_iter().filter(|g| g.len() <= FACES_MAX && is_convex(g));
        convex.map(|group| group.into_iter().map(|f| faces[f].patch).collect()).collect()
    }
}

struct Face {
    patch: u32,
    /// Welded.
    corners: Vec<u32>,
    normal: DVec3,
    origin: DVec3,
}

impl Face {
    fn sides(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let n = self.corners.len();
        (0..n).map(move |k| (self.corners[k], self.corners[(k + 1) % n]))
    }
}

/// Groups of faces that hang together, each side of which is run by exactly one face each way.
fn closed(faces: &[Face]) -> Vec<Vec<usize>> {
    let mut runs: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (f, face) in faces.iter().enumerate() {
        face.sides().for_each(|side| runs.entry(side).or_default().push(f));
    }
    let mut seen = vec![false; faces.len()];
    let mut out = Vec::new();
    for first in 0..faces.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let (mut group, mut is_closed) = (vec![first], true);
        let mut looked_at = 0;
        while looked_at < group.len() {
            for (start, end) in faces[group[looked_at]].sides() {
                let other = runs.get(&(end, start)).map_or(&[][..], Vec::as_slice);
                is_closed &= other.len() == 1 && runs[&(start, end)].len() == 1;
                for &neighbour in other {
                    if !std::mem::replace(&mut seen[neighbour], true) {
                        group.push(neighbour);
                    }
                }
            }
            looked_at += 1;
        }
        if is_closed {
            group.sort_unstable();
            out.push(group);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::super::SceneBuilder;
    use super::*;

    /// For a body made by `build`: how many of its patches are faces of solids, and of how many.
    fn found(build: impl Fn(&mut SceneBuilder, super::super::NodeId)) -> (usize, usize) {
        let mut b = SceneBuilder::new("solids");
        let node = b.node("body", None, DVec3::new(0.1, 0.2, 0.3), DQuat::from_rotation_y(0.3));
        build(&mut b, node);
        let solids = b.build().unwrap().solids();
        let mut names: Vec<u32> = solids.iter().flatten().copied().collect();
        let faces = names.len();
        names.sort_unstable();
        names.dedup();
        (faces, names.len())
    }

    #[test]
    fn boxes_are_solids_and_rooms_and_open_or_two_sided_boxes_are_not() {
        let half = DVec3::new(0.5, 0.25, 1.0);
        let far = DVec3::new(5.0, 0.0, 0.0);
        let two = |b: &mut SceneBuilder, node| {
            let grey = b.material("grey", [0.5; 3], [0.0; 3]);
            b.cuboid(node, "one", grey, -half, half);
            b.cuboid(node, "other", grey, far - half, far + half);
        };
        assert_eq!(found(two), (12, 2));
        let room = |b: &mut SceneBuilder, node| {
            let grey = b.material("grey", [0.5; 3], [0.0; 3]);
            b.cuboid_inward(node, "room", grey, -half, half);
        };
        assert_eq!(found(room), (0, 0));
        let thin = |b: &mut SceneBuilder, node| {
            let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
            b.cuboid(node, "thin", thin, -half, half);
        };
        assert_eq!(found(thin), (0, 0));
    }

    #[test]
    fn a_tetrahedron_is_one_and_none_without_a_face_or_with_a_dent() {
        let corners = [
            DVec3::ZERO,
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::new(0.0, 1.0, 0.0),
            DVec3::new(0.0, 0.0, 1.0),
        ];
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let build = |count: usize, dent: Option<DVec3>| {
            found(move |b, node| {
                let grey = b.material("grey", [0.5; 3], [0.0; 3]);
                for face in &faces[..count] {
                    let [p, q, r] = face.map(|k: usize| corners[k]);
                    match dent {
                        Some(inner) if *face == [1, 2, 3] => {
                            for [p, q] in [[p, q], [q, r], [r, p]] {
                                b.polygon(node, "dent", grey, &[p, q, inner]);
                            }
                        }
                        _ => b.polygon(node, "face", grey, &[p, q, r]),
                    }
                }
            })
        };
        assert_eq!(build(4, None), (4, 1));
        assert_eq!(build(3, None), (0, 0));
        assert_eq!(build(4, Some(DVec3::splat(0.2))), (0, 0));
        assert_eq!(build(4, Some(DVec3::splat(0.4))), (6, 1));
    }
}
