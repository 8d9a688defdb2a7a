//! Coplanar neighbouring patches joined into larger ones, of which the old ones are parts: a wall of
//! 400 named cells is one patch to be solved.
//!
//! For form factors, where all surfaces weigh the same: what joins may differ in name, surface,
//! material and (where nothing moves) body. Must not know elements or what is asked of the parts.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::flatten::{flatten, seen_from_behind};
use super::merge::merge;
use super::weld::Weld;
use super::{BodyId, Patch, PatchId, Scene};

/// A scene with fewer, larger patches, and where those of the scene it was made of are.
#[derive(Clone, Debug)]
pub struct Joined {
    /// The scene to be solved. Names, surfaces and materials are those of the first patch of several.
    pub scene: Scene,
    /// The parts of each of its patches, by `PatchId`: they tile it, up to rounding.
    pub parts: Vec<Vec<Part>>,
}

/// A part of a joined patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The patch of the first scene that it is, or is a triangle of.
    pub patch: PatchId,
    /// Corners in the frame of the joined patch, counter-clockwise, metres.
    pub corners: Vec<DVec2>,
}

impl Scene {
    /// Joins coplanar patches that share whole sides, face the same way and move together into
    /// convex polygons. A patch without such neighbours stays as it is, bit for bit.
    pub fn joined(&self) -> Joined {
        let mut joins = Joins { of_patch: vec![None; self.patches.len()], polygons: Vec::new() };
        for members in self.groups().values() {
            joins.add(self, members);
        }
        joins.scene(self)
    }

    /// Fronts of patches that may be joined, by what they have in common.
    fn groups(&self) -> BTreeMap<Alike, Vec<PatchId>> {
        let mut groups: BTreeMap<_, Vec<PatchId>> = BTreeMap::new();
        for (id, patch) in (0..).map(PatchId).zip(&self.patches) {
            if patch.twin.is_none_or(|twin| twin > id) {
                let carrier = self.moves(patch.body).then_some(patch.body);
                let obstructs = self.obstructions.contains(&patch.surface);
                let alike = Alike { carrier, two_sided: patch.twin.is_some(), obstructs };
                groups.entry(alike).or_default().push(id);
            }
        }
        groups
    }
}

/// What patches have in common that are joined.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Alike {
    /// The body that they move with, where they move.
    carrier: Option<BodyId>,
    two_sided: bool,
    /// Whether they are mere obstructions.
    obstructs: bool,
}

/// Polygons that several patches make up.
struct Joins {
    /// The polygon that a patch is a part of, or that its first triangle is in.
    of_patch: Vec<Option<usize>>,
    polygons: Vec<Polygon>,
}

struct Polygon {
    outline: Vec<DVec3>,
    /// Loops in the body's frame, by the patch they are of.
    parts: Vec<(PatchId, Vec<DVec3>)>,
}

impl Joins {
    fn add(&mut self, scene: &Scene, members: &[PatchId]) {
        let loops: Vec<Vec<DVec3>> = members
            .iter()
            .map(|id| scene.patches[id.0 as usize].corners_in_body().collect())
            .collect();
        let mut weld = Weld::of_corners(loops.iter().flatten().copied());
        let mut number = |corners: &Vec<DVec3>| corners.iter().map(|&c| weld.vertex(c)).collect();
        let welded: Vec<Vec<u32>> = loops.iter().map(&mut number).collect();
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        let mut of: Vec<usize> = Vec::new();
        for (k, corners) in welded.iter().enumerate() {
            let mut sorted = corners.clone();
            sorted.sort_unstable();
            sorted.dedup();
            if sorted.len() == corners.len() {
                for i in 1..corners.len() - 1 {
                    triangles.push([corners[0], corners[i], corners[i + 1]]);
                    of.push(k);
                }
            }
        }
        let merged = merge(&weld.points, &triangles);
        let mut within: Vec<BTreeMap<usize, Vec<usize>>> =
            vec![BTreeMap::new(); merged.polygons.len()];
        let mut whole = vec![true; loops.len()];
        let mut first = vec![None; loops.len()];
        for (t, polygon) in merged.polygon_of.iter().enumerate() {
            let Some(polygon) = *polygon else {
                whole[of[t]] = false;
                continue;
            };
            within[polygon as usize].entry(of[t]).or_default().push(t);
            whole[of[t]] &= *first[of[t]].get_or_insert(polygon) == polygon;
        }
        // What has lost a triangle, or would share one with a polygon that is no better, stays alone.
        for (outline, parts) in merged.polygons.into_iter().zip(within) {
            if parts.len() < 2 || !parts.keys().all(|&k| whole[k]) || flatten(&outline).is_err() {
                continue;
            }
            for &k in parts.keys() {
                self.of_patch[members[k].0 as usize] = Some(self.polygons.len());
            }
            let parts = parts.keys().map(|&k| (members[k], loops[k].clone())).collect();
            self.polygons.push(Polygon { outline, parts });
        }
    }

    fn scene(self, scene: &Scene) -> Joined {
        let mut out = Joined { scene: scene.clone(), parts: Vec::new() };
        out.scene.patches.clear();
        let mut done = vec![false; self.polygons.len()];
        for body in 0..scene.bodies.len() {
            let start = out.scene.patches.len() as u32;
            for (id, patch) in scene.patches_of(BodyId(body as u32)) {
                let front = patch.twin.map_or(id, |twin| twin.min(id));
                match self.of_patch[front.0 as usize] {
                    None => out.keep(scene, id),
                    Some(k) if !std::mem::replace(&mut done[k], true) => {
                        out.put(patch, &self.polygons[k]);
                    }
                    Some(_) => {}
                }
            }
            out.scene.bodies[body].patches = start..out.scene.patches.len() as u32;
        }
        out
    }
}

impl Joined {
    fn keep(&mut self, scene: &Scene, id: PatchId) {
        let patch = &scene.patches[id.0 as usize];
        let next = self.scene.patches.len() as u32;
        let twin = patch.twin.map(|twin| PatchId(if twin > id { next + 1 } else { next - 1 }));
        self.scene.patches.push(Patch { twin, ..patch.clone() });
        self.parts.push(vec![Part { patch: id, corners: patch.corners.clone() }]);
    }

    /// A joined polygon, and its other side where it has one.
    fn put(&mut self, first: &Patch, polygon: &Polygon) {
        let (frame, corners) = flatten(&polygon.outline).expect("it was tried");
        let place = |p: &DVec3| {
            let d = *p - frame.origin;
            DVec2::new(d.dot(frame.u), d.dot(frame.v))
        };
        let part = |(patch, outline): &(PatchId, Vec<DVec3>)| Part {
            patch: *patch,
            corners: outline.iter().map(place).collect(),
        };
        let parts: Vec<Part> = polygon.parts.iter().map(part).collect();
        let front = PatchId(self.scene.patches.len() as u32);
        let back = PatchId(front.0 + 1);
        if first.twin.is_some() {
            let (behind, seen) = seen_from_behind(&frame, &corners);
            let turned = |part: &Part| Part {
                patch: PatchId(part.patch.0 + 1),
                corners: part.corners.iter().rev().map(|c| DVec2::new(c.y, c.x)).collect(),
            };
            let backs = parts.iter().map(turned).collect();
            self.scene.patches.push(Patch { frame, corners, twin: Some(back), ..first.clone() });
            self.scene.patches.push(Patch {
                frame: behind,
                corners: seen,
                twin: Some(front),
                ..first.clone()
            });
            self.parts.extend([parts, backs]);
        } else {
            self.scene.patches.push(Patch { frame, corners, ..first.clone() });
            self.parts.push(parts);
        }
    }
}

#[cfg(test)]
mod tests;
