//! Which patches are the faces of convex solids.
//!
//! What reaches such a face from behind has come through a face from the front: seen from outside, the
//! faces that look away hide nothing that the others do not. Must not know light transport.

use std::collections::BTreeMap;

use glam::DVec3;

use super::shell::{self, Effort};
use super::topology::Polygon;
use super::weld::Weld;
use super::{BodyId, Patch, PatchId, Scene};
use crate::scene::tuning::SOLID_FACES_MAX;

/// A closed convex solid, in its body's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// What it is part of.
    pub body: BodyId,
    /// Its corners, metres.
    pub corners: Vec<DVec3>,
    /// Its faces: patches in one plane are one.
    pub faces: Vec<SolidFace>,
    /// Its edges: straight ones, between two faces.
    pub edges: Vec<SolidEdge>,
}

/// A face of a [`Solid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidFace {
    /// Outward unit normal.
    pub normal: DVec3,
    /// One of the solid's corners that lie on it.
    pub corner: u32,
}

/// An edge of a [`Solid`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolidEdge {
    /// The corners it runs from and to.
    pub ends: [u32; 2],
    /// The faces about which it runs counter-clockwise and clockwise, seen from outside.
    pub faces: [u32; 2],
}

/// What the closed surface that a patch belongs to encloses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Enclosure {
    /// Nothing: the patch is two-sided, or the surface has a border.
    Open,
    /// Matter: the surface looks outwards, as that of a crate does.
    Body,
    /// Space: the surface looks inwards, as that of a room does.
    Space,
}

/// The convex solids of a scene.
#[derive(Clone, Debug, Default)]
pub struct Solids {
    /// For each patch what its surface encloses.
    pub enclosures: Vec<Enclosure>,
    /// For each patch the solid whose face it is, if it is one's.
    pub of_patch: Vec<Option<u32>>,
    /// For each patch the closed convex part of its body, of one side or of two, whose face it is, if it is one's: numbers of their own.
    pub convex_parts: Vec<Option<u32>>,
    /// How many of these parts there are.
    convex_part_count: u32,
    /// The solids.
    pub list: Vec<Solid>,
}

/// How far behind each face of a solid its furthest corner is at least, in weld tolerances.
const THICK: f64 = 16.0;

impl Scene {
    /// Its convex solids: closed, convex groups of one-sided patches of one body that look outwards
    /// and meet along whole sides.
    pub(crate) fn solids(&self) -> Solids {
        let mut out = Solids {
            enclosures: vec![Enclosure::Open; self.patches.len()],
            of_patch: vec![None; self.patches.len()],
            convex_parts: vec![None; self.patches.len()],
            convex_part_count: 0,
            list: Vec::new(),
        };
        for body in (0..self.bodies.len() as u32).map(BodyId) {
            self.add_solids(body, &mut out);
            // Of two-sided polygons either side may be that which looks outwards.
            self.add_two_sided(body, |id, twin| id < twin, &mut out);
            self.add_two_sided(body, |id, twin| id > twin, &mut out);
        }
        self.open_let_in_lamps(&mut out.enclosures);
        out
    }

    /// Faces of bodies that emit, lie flush in a closed double-sided surface and look into it (a lamp let into a ceiling) count as
    /// lone sheets there: by the rule for bodies that rest on sheets they would be hidden, and the room dark. What rests with it.
    fn open_let_in_lamps(&self, enclosures: &mut [Enclosure]) {
        let is_lamp = |&id: &u32| {
            let patch = &self.patches[id as usize];
            enclosures[id as usize] == Enclosure::Body && self.patch_emits(patch)
        };
        let lamps: Vec<u32> = (0..self.patches.len() as u32).filter(is_lamp).collect();
        if lamps.is_empty() {
            return;
        }
        let mut effort = Effort::new();
        for body in (0..self.bodies.len() as u32).map(BodyId) {
            if self.patches_of(body).all(|(_, patch)| patch.twin.is_none()) {
                continue;
            }
            for shell in self.shells(body, &mut effort) {
                for &lamp in &lamps {
                    let patch = &self.patches[lamp as usize];
                    let other = patch.body;
                    let rests = other == body || !(self.moves(body) || self.moves(other));
                    if rests && shell.is_looked_into(patch) {
                        enclosures[lamp as usize] = Enclosure::Open;
                    }
                }
            }
        }
    }

    fn add_solids(&self, body: BodyId, out: &mut Solids) {
        let (weld, faces) = self.faces(body, |_, patch| patch.twin.is_none());
        let polygon = |f: &Face| Polygon {
            patch: PatchId(f.patch),
            two_sided: false,
            corners: f.corners.clone(),
        };
        let polygons: Vec<Polygon> = faces.iter().map(polygon).collect();
        for group in shell::closed(&weld, &polygons) {
            if group.iter().all(|m| !m.turned) {
                let members = group.iter().map(|m| &faces[m.polygon as usize]);
                let volume = members.clone().map(|face| face.cone(&weld)).sum::<f64>();
                let enclosure = if volume > 0.0 { Enclosure::Body } else { Enclosure::Space };
                members.for_each(|f| out.enclosures[f.patch as usize] = enclosure);
            }
        }
        for group in closed(&faces) {
            let group: Vec<&Face> = group.into_iter().map(|f| &faces[f]).collect();
            let volume = group.iter().map(|face| face.cone(&weld)).sum::<f64>();
            let enclosure = if volume > 0.0 { Enclosure::Body } else { Enclosure::Space };
            group.iter().for_each(|f| out.enclosures[f.patch as usize] = enclosure);
            if group.len() <= SOLID_FACES_MAX
                && is_convex(&group, &weld)
                && let Some(solid) = solid(body, &group, &weld)
            {
                let number = out.list.len() as u32;
                group.iter().for_each(|f| out.of_patch[f.patch as usize] = Some(number));
                out.list.push(solid);
                out.add_convex_part(group.iter().map(|f| f.patch));
            }
        }
    }

    /// Adds closed convex parts of those sides of two-sided polygons that `is_wanted` (of their patch and its twin).
    fn add_two_sided(
        &self,
        body: BodyId,
        is_wanted: impl Fn(PatchId, PatchId) -> bool,
        out: &mut Solids,
    ) {
        let (weld, faces) =
            self.faces(body, |id, patch| patch.twin.is_some_and(|twin| is_wanted(id, twin)));
        for group in closed(&faces) {
            let group: Vec<&Face> = group.into_iter().map(|f| &faces[f]).collect();
            if group.len() <= SOLID_FACES_MAX && is_convex(&group, &weld) {
                let twin = |f: &&Face| self.patches[f.patch as usize].twin.map(|twin| twin.0);
                let both = group.iter().flat_map(|f| [Some(f.patch), twin(f)]);
                out.add_convex_part(both.flatten());
            }
        }
    }

    /// Some patches of a body as faces, with their corners welded.
    fn faces(&self, body: BodyId, is_one: impl Fn(PatchId, &Patch) -> bool) -> (Weld, Vec<Face>) {
        let patches = || self.patches_of(body).filter(|&(id, patch)| is_one(id, patch));
        let mut weld = Weld::of_corners(patches().flat_map(|(_, p)| p.corners_in_body()));
        let face = |(id, patch): (PatchId, &Patch)| {
            let mut corners: Vec<u32> = patch.corners_in_body().map(|c| weld.vertex(c)).collect();
            corners.dedup();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            Face { patch: id.0, corners, normal: patch.frame.normal, origin: patch.frame.origin }
        };
        // What is thinner than the tolerance has no sides to meet others along.
        let faces = patches().map(face).filter(|f| f.corners.len() > 2).collect();
        (weld, faces)
    }
}

impl Solids {
    /// Adds a closed convex part of these faces.
    fn add_convex_part(&mut self, faces: impl Iterator<Item = u32>) {
        faces.for_each(|patch| self.convex_parts[patch as usize] = Some(self.convex_part_count));
        self.convex_part_count += 1;
    }
}

/// Whether no corner is in front of a face, and some are clearly behind each: two polygons back to back
/// close nothing in.
fn is_convex(group: &[&Face], weld: &Weld) -> bool {
    let mut corners: Vec<u32> = group.iter().flat_map(|f| f.corners.iter().copied()).collect();
    corners.sort_unstable();
    corners.dedup();
    group.iter().all(|face| {
        let above = |c: &u32| face.above(weld, *c);
        corners.iter().all(|c| above(c) <= weld.tolerance)
            && corners.iter().any(|c| above(c) < -THICK * weld.tolerance)
    })
}

/// Cosine of the angle between normals up to which patches may be one face.
const ALIKE: f64 = 1.0 - 1e-10;

/// A closed convex group, with faces in one plane made one and edges on one line too; `None` if a face is
/// left without edges.
fn solid(body: BodyId, group: &[&Face], weld: &Weld) -> Option<Solid> {
    let mut planes: Vec<&Face> = Vec::new();
    let plane_of = |face: &Face, planes: &[&Face]| {
        let is_same = |plane: &&Face| {
            plane.normal.dot(face.normal) > ALIKE
                && face.corners.iter().all(|&c| plane.above(weld, c).abs() <= weld.tolerance)
        };
        planes.iter().position(is_same)
    };
    let of_face: Vec<usize> = group
        .iter()
        .map(|face| {
            plane_of(face, &planes).unwrap_or_else(|| {
                planes.push(face);
                planes.len() - 1
            })
        })
        .collect();
    let sides =
        group.iter().zip(&of_face).flat_map(|(f, &plane)| f.sides().map(move |s| (s, plane)));
    let left_of: BTreeMap<(u32, u32), usize> = sides.collect();
    // Between two planes, what runs about the first counter-clockwise.
    let mut runs: BTreeMap<[usize; 2], Vec<u32>> = BTreeMap::new();
    for (&(start, end), &left) in &left_of {
        let right = left_of[&(end, start)];
        if left < right {
            runs.entry([left, right]).or_default().extend([start, end]);
        }
    }
    let mut used = Vec::new();
    let mut number = |c: u32| match used.iter().position(|&u| u == c) {
        Some(at) => at as u32,
        None => {
            used.push(c);
            used.len() as u32 - 1
        }
    };
    let mut edges = Vec::new();
    for (faces, corners) in runs {
        let at = |c: u32| weld.points[c as usize];
        let along = at(corners[1]) - at(corners[0]);
        let order =
            |one: &&u32, other: &&u32| at(**one).dot(along).total_cmp(&at(**other).dot(along));
        let ends = [corners.iter().min_by(order), corners.iter().max_by(order)];
        let ends = ends.map(|c| number(*c.expect("a run has two ends")));
        edges.push(SolidEdge { ends, faces: faces.map(|f| f as u32) });
    }
    let face = |(k, plane): (usize, &&Face)| {
        let edge = edges.iter().find(|e| e.faces.contains(&(k as u32)))?;
        Some(SolidFace { normal: plane.normal, corner: edge.ends[0] })
    };
    let faces = planes.iter().enumerate().map(face).collect::<Option<_>>()?;
    let corners = used.iter().map(|&c| weld.points[c as usize]).collect();
    Some(Solid { body, corners, faces, edges })
}

struct Face {
    patch: u32,
    /// Welded.
    corners: Vec<u32>,
    normal: DVec3,
    origin: DVec3,
}

impl Face {
    /// How far a corner is in front of it, metres.
    fn above(&self, weld: &Weld, corner: u32) -> f64 {
        (weld.points[corner as usize] - self.origin).dot(self.normal)
    }

    /// Six times the signed volume of the cone from the first corner of all to the face, m3.
    fn cone(&self, weld: &Weld) -> f64 {
        let at = |k: usize| weld.points[self.corners[k] as usize] - weld.points[0];
        (1..self.corners.len() - 1).map(|k| at(0).dot(at(k).cross(at(k + 1)))).sum()
    }

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
        let mut names: Vec<u32> = solids.of_patch.iter().flatten().copied().collect();
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
    fn sheets_and_needles_are_not_solids() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let back = [square[3], square[2], square[1], square[0]];
        let sheet = |b: &mut SceneBuilder, node| {
            let grey = b.material("grey", [0.5; 3], [0.0; 3]);
            b.polygon(node, "front", grey, &square);
            b.polygon(node, "back", grey, &back);
        };
        assert_eq!(found(sheet), (0, 0));
        let far = DVec3::splat(100.0);
        let needle = |b: &mut SceneBuilder, node| {
            let grey = b.material("grey", [0.5; 3], [0.0; 3]);
            b.polygon(node, "wall", grey, &square.map(|c| far + c * 0.5));
            b.polygon(node, "needle", grey, &[DVec3::ZERO, DVec3::Y * 5e-5, DVec3::X]);
        };
        assert_eq!(found(needle), (0, 0));
    }

    #[test]
    fn boxes_of_one_side_or_two_are_convex_parts_wound_either_way_and_open_ones_are_not() {
        let half = DVec3::new(0.5, 0.25, 1.0);
        let bodies = |build: &dyn Fn(&mut SceneBuilder, super::super::NodeId)| {
            let mut b = SceneBuilder::new("bodies");
            let node = b.node("body", None, DVec3::ZERO, DQuat::IDENTITY);
            build(&mut b, node);
            let scene = b.build().unwrap();
            let solids = scene.solids();
            let mut numbers: Vec<u32> = solids.convex_parts.iter().flatten().copied().collect();
            let faces = numbers.len();
            numbers.dedup();
            (faces, numbers, scene.patches.len())
        };
        let both = |b: &mut SceneBuilder| b.double_sided_material("both", [0.5; 3], [0.0; 3]);
        let one = bodies(&|b, node| {
            let grey = b.material("grey", [0.5; 3], [0.0; 3]);
            b.cuboid(node, "box", grey, -half, half);
        });
        assert_eq!(one, (6, vec![0], 6));
        // With a lamp in it a two-sided box keeps its inner sides.
        for inward in [false, true] {
            let two = bodies(&|b, node| {
                let material = both(b);
                match inward {
                    true => b.cuboid_inward(node, "box", material, -half, half),
                    false => b.cuboid(node, "box", material, -half, half),
                };
                let lamp = b.material("lamp", [0.0; 3], [1.0; 3]);
                b.cuboid(node, "lamp", lamp, -0.1 * half, 0.1 * half);
            });
            assert_eq!((two.0, two.2), (18, 18), "{two:?}");
        }
        let open = bodies(&|b, node| {
            let material = both(b);
            let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
            b.polygon(
                node,
                "floor",
                material,
                &[p(0., 0., 0.), p(1., 0., 0.), p(1., 1., 0.), p(0., 1., 0.)],
            );
            b.polygon(
                node,
                "wall",
                material,
                &[p(0., 0., 0.), p(0., 1., 0.), p(0., 1., 1.), p(0., 0., 1.)],
            );
        });
        assert_eq!((open.0, open.2), (0, 4));
    }

    #[test]
    fn cells_of_a_box_make_six_faces_and_twelve_edges() {
        let mut b = SceneBuilder::new("cells");
        let node = b.node("box", None, DVec3::ZERO, DQuat::IDENTITY);
        for k in 0..2 {
            // Two halves of a box side by side, without what is between them.
            let grey = b.material(["grey", "gray"][k], [0.5; 3], [0.0; 3]);
            let x = |at: f64| k as f64 + at;
            let p = |at: f64, y: f64, z: f64| DVec3::new(x(at), y, z);
            let quads = [
                [p(0., 0., 0.), p(0., 1., 0.), p(1., 1., 0.), p(1., 0., 0.)],
                [p(0., 0., 1.), p(1., 0., 1.), p(1., 1., 1.), p(0., 1., 1.)],
                [p(0., 0., 0.), p(1., 0., 0.), p(1., 0., 1.), p(0., 0., 1.)],
                [p(0., 1., 0.), p(0., 1., 1.), p(1., 1., 1.), p(1., 1., 0.)],
            ];
            quads.iter().for_each(|quad| b.polygon(node, "side", grey, quad));
            let at = k as f64;
            let mut end = [p(at, 0., 0.), p(at, 0., 1.), p(at, 1., 1.), p(at, 1., 0.)];
            if k == 1 {
                end.reverse();
            }
            b.polygon(node, "end", grey, &end);
        }
        let solids = b.build().unwrap().solids();
        assert_eq!(solids.of_patch, vec![Some(0); 10]);
        let [solid] = &solids.list[..] else { panic!("{solids:?}") };
        assert_eq!((solid.corners.len(), solid.faces.len(), solid.edges.len()), (8, 6, 12));
        for edge in &solid.edges {
            let [p, q] = edge.ends.map(|c| solid.corners[c as usize]);
            let [left, right] = edge.faces.map(|f| solid.faces[f as usize].normal);
            assert!(left.cross(right).dot(q - p) > 0.0, "{edge:?}");
        }
    }

    #[test]
    fn bodies_whose_parts_meet_along_parts_of_sides_enclose_matter_and_such_rooms_space() {
        let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        for inward in [false, true] {
            let mut b = SceneBuilder::new("step");
            let grey = b.material("grey", [0.5; 3], [0.0; 3]);
            let node = b.node("step", None, DVec3::ZERO, DQuat::IDENTITY);
            let mut add = |mut corners: [DVec3; 4]| {
                if inward {
                    corners.reverse();
                }
                b.polygon(node, "step", grey, &corners);
            };
            // An L: the longer of the two parts of an end meets the shorter along half of its side.
            let outline = [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]];
            let at = |k: usize, z: f64| p(outline[k % 6][0], outline[k % 6][1], z);
            (0..6).for_each(|k| add([at(k, 0.), at(k + 1, 0.), at(k + 1, 1.), at(k, 1.)]));
            for (z, turned) in [(0., true), (1., false)] {
                for mut end in [
                    [p(0., 0., z), p(1., 0., z), p(1., 2., z), p(0., 2., z)],
                    [p(1., 0., z), p(2., 0., z), p(2., 1., z), p(1., 1., z)],
                ] {
                    if turned {
                        end.reverse();
                    }
                    add(end);
                }
            }
            let wanted = if inward { Enclosure::Space } else { Enclosure::Body };
            assert_eq!(b.build().unwrap().solids().enclosures, vec![wanted; 10]);
        }
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
