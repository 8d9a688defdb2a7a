//! What is exposed of elements at one instant.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::{ElementId, Forest, Kind, exposed_m2, overlap};
use crate::geometry::{Aabb, Moments, common};
use crate::scene::{BodyId, Covered, Inside, Instant, LightId, PatchId, Scene, World};

/// Part of an element that lies within a body.
pub struct PartInside {
    /// The body, a number of what of it hangs together, and whether places are in its own frame.
    pub of: ((BodyId, u32), bool),
    /// Corners of a convex polygon, counter-clockwise as seen from its front, metres.
    pub corners: Vec<DVec3>,
    /// Unit normal.
    pub normal: DVec3,
    /// Whether it is all of the element.
    pub is_whole: bool,
}

/// Share of an element from which a part is all of it: rounding.
const WHOLE: f64 = 1.0 - 1e-6;

/// Elements of a patch of which something else is covered.
enum Which {
    All,
    /// Those that meet one of these boxes.
    Within(Vec<[DVec2; 2]>),
}

impl Forest {
    /// Finds what of patches is covered in a world. The elements of which another part is exposed than before, or that touch others;
    /// ascending.
    pub fn cover(&mut self, scene: &Scene, world: &World) -> Vec<ElementId> {
        let lights = (0..scene.lights.len() as u32).map(LightId);
        let lights = lights.filter_map(|light| world.light_pose(light));
        let now = Instant {
            poses: world.poses(),
            lights: lights.map(|pose| Aabb::of([pose.translation])).collect(),
            glows: &self.fixed.glowing.at_all,
        };
        let now = self.fixed.covering.at(scene, &self.fixed.covered, &now);
        self.set_covered_now(now)
    }

    /// Forgets what is covered only now. The elements of which another part is exposed than before, or that touched others; ascending.
    pub fn uncover(&mut self) -> Vec<ElementId> {
        self.set_covered_now(BTreeMap::new())
    }

    fn set_covered_now(&mut self, now: BTreeMap<PatchId, Covered>) -> Vec<ElementId> {
        if now.is_empty() && self.covered_now.is_empty() {
            return Vec::new();
        }
        let was = std::mem::replace(&mut self.covered_now, now);
        let patches: BTreeSet<PatchId> =
            was.keys().chain(self.covered_now.keys()).copied().collect();
        let mut changed = Vec::new();
        for patch in patches {
            let before = was.get(&patch).unwrap_or(&self.fixed.covered[patch.0 as usize]);
            let after = self.covered_of(patch);
            if before == after {
                continue;
            }
            let which = match before.contacts == after.contacts {
                true => Which::Within(changed_parts(before, after)),
                false => Which::All,
            };
            self.expose_anew(self.patch_root(patch), &which, &mut changed);
        }
        changed.sort_unstable();
        changed
    }

    /// Parts of an element that lie within bodies, as polygons in space with their normals.
    pub fn parts_inside(&self, id: ElementId) -> Vec<PartInside> {
        let shape = self.shape(id);
        let own = &shape.corners[..shape.len];
        let mut out = Vec::new();
        for part in self.inside_near(id) {
            let [origin, u, v] = part.plane;
            let outline = common(&part.outline, own);
            if outline.len() > 2 {
                let corners = outline.iter().map(|p| origin + u * p.x + v * p.y).collect();
                let is_whole = Moments::of(&outline).area >= WHOLE * shape.area();
                let (of, normal) = ((part.of, part.is_own), u.cross(v));
                out.push(PartInside { of, corners, normal, is_whole });
            }
        }
        out
    }

    /// Whether parts of two elements may lie within the same body. Conservative; cheaper than
    /// [`Forest::parts_inside`].
    pub fn may_be_inside_alike(&self, a: ElementId, b: ElementId) -> bool {
        let has_some = |id: ElementId| {
            self.patch(id).is_some_and(|patch| !self.covered_of(patch).inside.is_empty())
        };
        has_some(a) && has_some(b) && {
            let of_b: Vec<&Inside> = self.inside_near(b).collect();
            let is_alike =
                |one: &Inside| of_b.iter().any(|two| one.of == two.of && one.is_own == two.is_own);
            !of_b.is_empty() && self.inside_near(a).any(is_alike)
        }
    }

    /// Those parts of the patch of an element within bodies that the box around it meets.
    fn inside_near(&self, id: ElementId) -> impl Iterator<Item = &Inside> {
        let bounds = self.shape(id).bounds();
        self.covered(id).inside.iter().filter(move |part| overlap(&bounds, &part.bounds))
    }

    /// Finds anew what is exposed of elements of a patch, given its root; adds them.
    fn expose_anew(&mut self, root: ElementId, which: &Which, changed: &mut Vec<ElementId>) {
        let mut stack = vec![root];
        while let Some(id) = stack.pop() {
            if self.kind(id) != Kind::Element {
                stack.extend(self.children(id).map(ElementId));
                continue;
            }
            let shape = self.shape(id);
            if let Which::Within(parts) = which
                && !parts.iter().any(|bounds| shape.meets(bounds))
            {
                continue;
            }
            // Below what is not covered nothing is.
            let may_be = self.parent(id).is_none_or(|parent| {
                self.kind(parent) != Kind::Element || self.exposed.contains_key(&parent.0)
            });
            let area_m2 = self.nodes[id.0 as usize].area_m2;
            let is_m2 = if may_be { exposed_m2(&shape, self.covered(id)) as f32 } else { area_m2 };
            match is_m2 < area_m2 {
                true => drop(self.exposed.insert(id.0, is_m2)),
                false => drop(self.exposed.remove(&id.0)),
            }
            changed.push(id);
            stack.extend(self.children(id).map(ElementId));
        }
    }
}

/// Boxes around what one list of parts has and the other has not.
fn changed_parts(before: &Covered, after: &Covered) -> Vec<[DVec2; 2]> {
    let mut out = Vec::new();
    difference(&before.parts, &after.parts, |(_, bounds)| *bounds, &mut out);
    difference(&before.inside, &after.inside, |part| part.bounds, &mut out);
    out
}

/// Adds the boxes of what only one of two lists has; what does not change comes first in both.
fn difference<T: PartialEq>(
    one: &[T],
    two: &[T],
    bounds: impl Fn(&T) -> [DVec2; 2],
    out: &mut Vec<[DVec2; 2]>,
) {
    let alike = one.iter().zip(two).take_while(|(p, q)| p == q).count();
    let (one, two) = (&one[alike..], &two[alike..]);
    out.extend(one.iter().filter(|part| !two.contains(part)).map(&bounds));
    out.extend(two.iter().filter(|part| !one.contains(part)).map(&bounds));
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::scene::SceneBuilder;

    /// A room with two boxes, each sunk into the floor and into one of two walls that face each other.
    fn room() -> Scene {
        let mut b = SceneBuilder::new("sunk");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid_inward(room, "room", grey, DVec3::ZERO, DVec3::new(4.0, 2.0, 3.0));
        for (name, x) in [("left", 0.1), ("right", 3.8)] {
            let node = b.node(name, None, DVec3::new(x, 0.1, 1.0), DQuat::IDENTITY);
            b.cuboid(node, name, grey, DVec3::splat(-0.5), DVec3::splat(0.5));
        }
        b.build().unwrap()
    }

    /// Elements of the side of the room that looks along `normal`, divided `depth` times.
    fn elements(forest: &mut Forest, scene: &Scene, normal: DVec3, depth: u32) -> Vec<ElementId> {
        let is = |p: &PatchId| scene.patches[p.0 as usize].frame.normal.dot(normal) > 0.9;
        let area_m2 = |p: &PatchId| scene.patches[p.0 as usize].area_m2();
        let patches = (0..scene.patches.len() as u32).map(PatchId).filter(is);
        let root = patches.max_by(|p, q| area_m2(p).total_cmp(&area_m2(q))).unwrap();
        let (mut stack, mut all) = (vec![(forest.patch_root(root), depth)], Vec::new());
        while let Some((id, depth)) = stack.pop() {
            let parts = match forest.kind(id) {
                Kind::Element if depth == 0 => {
                    all.push(id);
                    continue;
                }
                Kind::Element => (forest.split(id).0, depth - 1),
                // A patch that is cut along lines of contact: facets.
                _ => (forest.children(id), depth),
            };
            stack.extend(parts.0.map(|id| (ElementId(id), parts.1)));
        }
        all
    }

    #[test]
    fn only_elements_that_reach_into_one_body_may_be_inside_alike() {
        let scene = room();
        let mut forest = Forest::new(&scene);
        let mut of = |normal| elements(&mut forest, &scene, normal, 2);
        let (floor, left, right) = (of(DVec3::Y), of(DVec3::X), of(DVec3::NEG_X));
        let bodies = |id: ElementId| -> Vec<_> {
            forest.parts_inside(id).into_iter().map(|part| part.of.0).collect()
        };
        let mut counts = [0; 2];
        let pairs = |with: &[ElementId]| -> Vec<(ElementId, ElementId)> {
            floor.iter().flat_map(|a| with.iter().map(|b| (*a, *b))).collect()
        };
        for (a, b) in [pairs(&left), pairs(&right)].concat() {
            let may = forest.may_be_inside_alike(a, b);
            assert_eq!(may, forest.may_be_inside_alike(b, a));
            let of_b = bodies(b);
            let is = bodies(a).iter().any(|of| of_b.contains(of));
            assert!(may || !is, "{a:?} and {b:?} share a body");
            counts[usize::from(may)] += 1;
        }
        // Few parts of the floor and of a wall are near one box.
        assert!(counts[1] > 0 && 4 * counts[1] < counts[0], "{counts:?}");
        let near = |all: &[ElementId]| -> Vec<ElementId> {
            all.iter().copied().filter(|id| !bodies(*id).is_empty()).collect()
        };
        let (left, right) = (near(&left), near(&right));
        assert!(!left.is_empty() && !right.is_empty());
        let across = left.iter().any(|a| right.iter().any(|b| forest.may_be_inside_alike(*a, *b)));
        assert!(!across, "they lie in different boxes");
    }
}
