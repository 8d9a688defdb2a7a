//! What is covered of patches at one instant by bodies that move, or of them by others. Pure geometry.
//!
//! A crate that slides over a floor covers another part of it in every frame, and a drawer is covered as far as it is in.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::DVec3;

use super::covered::{Face, Hull, Stands, dark_in_gaps, hulls_of};
use super::gap::{open_sides, widest_m};
use super::placed::{IN_PLANE, Placed, reach_m};
use super::{BodyId, Covered, Patch, PatchId, Scene};
use crate::geometry::{Aabb, BoxTree, Pose};
use crate::scene::tuning::{COVERING_CUTS_MAX, GAP_PAIRS_MAX};

/// Bodies that may cover or be covered where one of them is moved.
#[derive(Clone, Debug, Default)]
pub struct Covering {
    /// Found where anything moves first.
    bodies: OnceLock<Bodies>,
}

/// What is known of bodies in their own frames.
#[derive(Clone, Debug)]
struct Bodies {
    /// Boxes around them; by body.
    bounds: Vec<Aabb>,
    /// What may cover, by body; polygons by their number in the body.
    hulls: Vec<Vec<Hull>>,
    /// Which sides of polygons are open, by body and by their number there.
    open: Vec<Vec<u64>>,
}

/// A scene at one instant.
pub struct Instant<'a> {
    /// Poses of the bodies, `None` while absent; by body.
    pub poses: &'a [Option<Pose>],
    /// Where punctual lights are.
    pub lights: Vec<Aabb>,
    /// Whether a patch emits at any time, by patch.
    pub glows: &'a [bool],
}

/// A body that is there.
struct Present {
    body: BodyId,
    pose: Pose,
    bounds: Aabb,
    is_moved: bool,
}

impl Bodies {
    fn of(scene: &Scene) -> Bodies {
        let bodies = || (0..scene.bodies.len() as u32).map(BodyId);
        let bounds = |body: BodyId| {
            Aabb::of(scene.patches_of(body).flat_map(|(_, patch)| patch.corners_in_body()))
        };
        let hulls = |body: BodyId| {
            let mut out = Vec::new();
            if !scene.is_distant(body) {
                hulls_of(scene, (&placed(scene, body, &Pose::IDENTITY), 0), &mut out);
            }
            out
        };
        let open = |body: BodyId| open_sides(&placed(scene, body, &Pose::IDENTITY));
        Bodies {
            bounds: bodies().map(bounds).collect(),
            hulls: bodies().map(hulls).collect(),
            open: bodies().map(open).collect(),
        }
    }
}

impl Covering {
    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        let hull = |hull: &Hull| {
            let lists = (hull.polygons.capacity() + hull.twins.capacity()) * size_of::<usize>();
            size_of::<Hull>() + lists + size_of_val(&hull.border[..])
        };
        self.bodies.get().map_or(0, |bodies| {
            let hulls = bodies.hulls.iter().flatten().map(hull).sum::<usize>();
            let open = bodies.open.iter().map(|sides| size_of_val(&sides[..])).sum::<usize>();
            hulls + open + bodies.bounds.capacity() * size_of::<Aabb>()
        })
    }

    /// What of patches is covered at an instant, with what is always covered of them (`rest`, by patch): of a moving body by others, of
    /// others by it. By the rules of `Scene::covered`, with lamps where they are now.
    pub fn at(
        &self,
        scene: &Scene,
        rest: &[Covered],
        now: &Instant<'_>,
    ) -> BTreeMap<PatchId, Covered> {
        let mut out = BTreeMap::new();
        let is_moved = |body: BodyId| {
            let pose = now.poses[body.0 as usize];
            let elsewhere = pose.is_some_and(|pose| pose != Pose::IDENTITY);
            !scene.is_distant(body) && pose.is_some() && (scene.moves(body) || elsewhere)
        };
        if !(0..scene.bodies.len() as u32).map(BodyId).any(is_moved) {
            return out;
        }
        let known = self.bodies.get_or_init(|| Bodies::of(scene));
        let Bodies { bounds, hulls, .. } = known;
        let present: Vec<Present> = (0..scene.bodies.len() as u32)
            .map(BodyId)
            .filter(|&body| !scene.is_distant(body) && bounds[body.0 as usize] != Aabb::EMPTY)
            .filter_map(|body| {
                let pose = now.poses[body.0 as usize]?;
                let bounds = moved(&bounds[body.0 as usize], &pose);
                Some(Present { body, pose, bounds, is_moved: is_moved(body) })
            })
            .collect();
        let mut left = COVERING_CUTS_MAX;
        for one in present.iter().filter(|one| !hulls[one.body.0 as usize].is_empty()) {
            let meets = |other: &&Present| {
                let reach = one.bounds.union(other.bounds);
                let slack_m = IN_PLANE * reach_m(&reach);
                other.body != one.body
                    && (one.is_moved || other.is_moved)
                    && one.bounds.grown(slack_m).meets(&other.bounds)
            };
            let others: Vec<&Present> = present.iter().filter(meets).collect();
            if others.is_empty() {
                continue;
            }
            let polygons = placed(scene, one.body, &one.pose);
            for other in others {
                let there = Pair { scene, now, polygons: &polygons, bodies: [one, other] };
                let hulls = &hulls[one.body.0 as usize];
                Covering::cover(&there, (hulls, &present), rest, (&mut out, &mut left));
            }
        }
        narrow(scene, (now, rest), (known, &present), (&mut out, &mut left));
        for covered in out.values_mut() {
            covered.contacts.sort_unstable();
            covered.contacts.dedup();
        }
        out.retain(|patch, covered| *covered != rest[patch.0 as usize]);
        out
    }

    /// What the first body of a pair covers of the second.
    fn cover(
        pair: &Pair<'_>,
        (hulls, present): (&[Hull], &[Present]),
        rest: &[Covered],
        (out, left): (&mut BTreeMap<PatchId, Covered>, &mut usize),
    ) {
        let Pair { scene, polygons, bodies: [one, other], .. } = *pair;
        let patches = placed(scene, other.body, &other.pose);
        let boxes = BoxTree::new(patches.iter().map(|patch| patch.bounds));
        for hull in hulls {
            let bounds = moved(&hull.bounds, &one.pose);
            let slack_m = IN_PLANE * reach_m(&bounds);
            let near = boxes.meeting(&bounds.grown(slack_m));
            if near.is_empty() {
                continue;
            }
            let border = hull.border.iter().map(|&c| one.pose.point(c)).collect();
            let hull = Hull { border, bounds, ..hull.clone() };
            if Covering::may_hold_light(pair, &hull, present, slack_m) {
                continue;
            }
            let near: Vec<&Placed> = near.into_iter().map(|k| &patches[k]).collect();
            let mut stands = Stands::new(scene, (polygons, &hull), &near, slack_m);
            for patch in &near {
                let covered =
                    out.entry(patch.id).or_insert_with(|| rest[patch.id.0 as usize].clone());
                stands.on((patch, false), covered, left);
            }
        }
    }

    /// Whether a lamp may be among the polygons of a hull, whose border and box are those in the world.
    fn may_hold_light(pair: &Pair<'_>, hull: &Hull, present: &[Present], slack_m: f64) -> bool {
        let Pair { scene, now, polygons, bodies: [one, _] } = *pair;
        let glows = |id: PatchId| now.glows[id.0 as usize];
        let is_two_sided = !hull.twins.is_empty();
        let within = |what: &Aabb, touching: bool| {
            let [by, before] = if touching { [4.0, 2.0] } else { [2.0, 4.0] };
            let what = what.grown(by * slack_m);
            let inner = hull.bounds.hi.min(what.hi) - 3.0 * slack_m;
            hull.bounds.lo.max(what.lo).cmplt(inner).all()
                && !hull.is_before(polygons, &what, before * slack_m)
        };
        let shines_in =
            |lamp: &Placed| within(&lamp.bounds, false) || hull.is_lit_by(polygons, lamp, slack_m);
        let own = |(k, polygon): (usize, &Placed)| match hull.holds(k) {
            true => is_two_sided && glows(polygon.id),
            false => glows(polygon.id) && shines_in(polygon),
        };
        polygons.iter().enumerate().any(own)
            || now.lights.iter().any(|light| within(light, is_two_sided))
            || present.iter().filter(|third| third.body != one.body).any(|third| {
                let shines = |(id, patch): (PatchId, &Patch)| {
                    glows(id) && shines_in(&Placed::new(id, patch, &third.pose))
                };
                within(&third.bounds, is_two_sided) && scene.patches_of(third.body).any(shines)
            })
    }
}

/// Adds what of patches lies in narrow gaps between two bodies of which one is moved.
fn narrow(
    scene: &Scene,
    (now, rest): (&Instant<'_>, &[Covered]),
    (known, present): (&Bodies, &[Present]),
    (out, left): (&mut BTreeMap<PatchId, Covered>, &mut usize),
) {
    let mut lamps: Option<BoxTree> = None;
    for (k, one) in present.iter().enumerate() {
        for other in present[k + 1..].iter().filter(|other| one.is_moved || other.is_moved) {
            let size = |b: &Present| widest_m((b.bounds.hi - b.bounds.lo).max_element());
            let reach_m = size(one).min(size(other));
            if !one.bounds.grown(reach_m).meets(&other.bounds) {
                continue;
            }
            let slack_m = IN_PLANE * reach_m_of(&[one, other]);
            let near = |of: &Present, by: &Present| -> Vec<(usize, Placed)> {
                let by = by.bounds.grown(reach_m);
                let all = placed(scene, of.body, &of.pose).into_iter().enumerate();
                all.filter(|(_, face)| face.bounds.meets(&by)).collect()
            };
            let (of_one, of_other) = (near(one, other), near(other, one));
            if of_one.len() * of_other.len() > GAP_PAIRS_MAX {
                continue;
            }
            let open = |of: &Present, at: usize| known.open[of.body.0 as usize][at];
            let mut may_hold_lamp = |bounds: &Aabb| {
                let lamps = lamps.get_or_insert_with(|| lamps_of(scene, now, present));
                now.lights.iter().any(|lamp| lamp.meets(bounds)) || lamps.any(bounds, |_| true)
            };
            for (i, p) in &of_one {
                let face = Face { placed: p, open: open(one, *i) };
                let others =
                    of_other.iter().map(|(j, q)| Face { placed: q, open: open(other, *j) });
                for part in dark_in_gaps(face, others, slack_m, false, &mut may_hold_lamp) {
                    let covered = out
                        .entry(part.patch)
                        .or_insert_with(|| rest[part.patch.0 as usize].clone());
                    part.add_to(scene, covered, left);
                }
            }
        }
    }
}

/// Boxes around what emits at any time, where it is.
fn lamps_of(scene: &Scene, now: &Instant<'_>, present: &[Present]) -> BoxTree {
    let of_body = |of: &Present| {
        let glowing = scene.patches_of(of.body).filter(|(id, _)| now.glows[id.0 as usize]);
        glowing.map(|(id, patch)| Placed::new(id, patch, &of.pose).bounds).collect::<Vec<_>>()
    };
    BoxTree::new(present.iter().flat_map(of_body))
}

/// Largest coordinate of bodies, metres.
fn reach_m_of(bodies: &[&Present]) -> f64 {
    bodies.iter().map(|of| reach_m(&of.bounds)).fold(0.0, f64::max)
}

/// Two bodies, of which the first may cover the second.
#[derive(Clone, Copy)]
struct Pair<'a> {
    scene: &'a Scene,
    now: &'a Instant<'a>,
    /// The polygons of the first, in the world.
    polygons: &'a [Placed],
    bodies: [&'a Present; 2],
}

/// The patches of a body at a pose.
fn placed(scene: &Scene, body: BodyId, pose: &Pose) -> Vec<Placed> {
    scene.patches_of(body).map(|(id, patch)| Placed::new(id, patch, pose)).collect()
}

/// A box around a box of a body's frame, in the world.
fn moved(bounds: &Aabb, pose: &Pose) -> Aabb {
    let pick =
        |k: usize, axis: usize| if k >> axis & 1 == 0 { bounds.lo[axis] } else { bounds.hi[axis] };
    let corner = |k: usize| DVec3::new(pick(k, 0), pick(k, 1), pick(k, 2));
    Aabb::of((0..8).map(|k| pose.point(corner(k))))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::geometry::Moments;
    use crate::scene::{Inside, Interpolation, SceneBuilder, Track};

    /// What of a floor of 4 x 4 m and of a beam through them two crates of 1 x 1 m cover, of which one moves, as it lies at `at`; with a
    /// lamp in the moving one or not. The parts of the floor, those of the side of the beam that looks along y.
    fn covered(at: DVec3, lamp: bool) -> (f64, Vec<Inside>) {
        let mut b = SceneBuilder::new("crates");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let glow = b.material("glow", [0.0; 3], [1.0; 3]);
        let floor = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
        let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)];
        b.polygon(floor, "floor", grey, &corners.map(|(x, y)| DVec3::new(x, y, 0.0)));
        let (lo, hi) = (DVec3::new(-0.5, -0.5, -0.5), DVec3::new(0.5, 0.5, 0.5));
        let rests = b.node("rests", None, DVec3::new(3.0, 3.0, 0.5), DQuat::IDENTITY);
        b.cuboid(rests, "rests", grey, lo, hi);
        let moves = b.node("moves", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid(moves, "moves", grey, lo, hi);
        if lamp {
            let small = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1)];
            b.polygon(moves, "lamp", glow, &small.map(|(x, y)| DVec3::new(x, y, 0.1)));
        }
        let (times_s, values) = (vec![0.0, 1.0], vec![DVec3::ZERO, DVec3::X]);
        let interpolation = Interpolation::Linear;
        b.animate_translation(moves, Track { times_s, values, interpolation });
        let scene = b.build().unwrap();
        let rest = scene.covered(&scene.solids(), &|_| false);
        let covering = Covering::default();
        let body = |name: &str| scene.bodies.iter().position(|body| body.name == name).unwrap();
        let mut poses = vec![Some(Pose::IDENTITY); scene.bodies.len()];
        poses[body("moves")] = Some(Pose::translation(at));
        let glows: Vec<bool> = scene.patches.iter().map(|p| scene.patch_emits(p)).collect();
        let now = Instant { poses: &poses, lights: Vec::new(), glows: &glows };
        let found = covering.at(&scene, &rest, &now);
        let floor = found.get(&PatchId(0)).unwrap_or(&rest[0]);
        let area_m2 = floor.parts.iter().map(|(part, _)| Moments::of(part).area).sum();
        let is_moving =
            |id: &PatchId| scene.patches[id.0 as usize].body == BodyId(body("moves") as u32);
        let of_moving = found.iter().filter(|(id, _)| is_moving(id));
        (area_m2, of_moving.flat_map(|(_, covered)| covered.inside.clone()).collect())
    }

    #[test]
    fn a_crate_covers_what_it_stands_on_now_and_overlaps_count_once() {
        let off = |found: f64, truth: f64| (found - truth).abs() < 1e-6;
        // Far away, on the floor, half over its edge, sunk in, on the crate that rests, half within that.
        for (at, area_m2) in [
            (DVec3::new(1.0, 1.0, 5.0), 1.0),
            (DVec3::new(1.0, 1.0, 0.5), 2.0),
            (DVec3::new(0.0, 1.0, 0.5), 1.5),
            (DVec3::new(1.0, 1.0, 0.2), 2.0),
            (DVec3::new(3.0, 3.0, 1.5), 1.0),
            (DVec3::new(2.5, 3.0, 0.5), 1.5),
        ] {
            let (found, _) = covered(at, false);
            assert!(off(found, area_m2), "{at}: {found}");
        }
        assert!(off(covered(DVec3::new(1.0, 1.0, 0.5), true).0, 1.0), "a lamp in it");
    }

    #[test]
    fn of_crates_through_each_other_parts_lie_inside() {
        let (_, inside) = covered(DVec3::new(2.5, 3.2, 0.7), false);
        assert!(!inside.is_empty() && inside.iter().all(|part| !part.is_own));
        assert!(covered(DVec3::new(1.0, 1.0, 0.5), false).1.is_empty());
    }
}
