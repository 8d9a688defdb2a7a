//! Objects that turn their backs to the air of the room that they enclose or stand in: walls of separate objects, thick or thin,
//! and bodies that are closed by themselves and inside out.
//!
//! Air is where lamps and cameras are, and half the way from there to what is seen, if rays from there meet something nearly
//! everywhere and mostly fronts. An object of which only backs are seen from the air, and before whose own fronts no front of anything
//! else is, faces the wrong way: what stands free shows its front to some of the air or has something lit before it. Where most of what
//! is around faces away nothing is said. Must not know light transport, nor which objects join.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::note;
use super::world::{Face, World, spread};
use crate::scene::tuning::{
    AIR_FRONTS_MIN, AIR_MET_MIN, AIR_RAYS, AIR_TRIALS, BACKS_OF_ALL, BACKS_SEEN_MIN,
    FRONTS_BEFORE_MAX, WALL_RAYS,
};
use crate::scene::{Note, Patch, PatchId, Scene, Severity};

/// Places that are looked from first, and rays of each whose middles are looked from, too.
const PLACES: (usize, u32) = (12, 24);
/// Share of the scene's diagonal by which one looks from before a lamp.
const BEFORE_LAMP: f64 = 1e-3;
/// Share of the scene's diagonal within which what touches is met at once.
const TOUCHES: f64 = 1e-5;
/// Share of the outline's distance from its middle out to which rays start.
const WITHIN: f64 = 0.9;

/// Adds objects that face away from the air, but for those of which it is said.
pub(super) fn enclosing(scene: &Scene, notes: &mut Vec<Note>) {
    let said: BTreeSet<String> =
        notes.iter().filter(|n| n.code == "flipped-normals").map(|n| n.subject.clone()).collect();
    let world = World::of(scene, 0.0);
    let mut objects: BTreeMap<&str, Vec<&Face>> = BTreeMap::new();
    for face in &world.faces {
        objects.entry(object(&world, face)).or_default().push(face);
    }
    let seen = seen_from_air(&world);
    let is_turned = |name: &str, faces: &[&Face]| {
        let of = seen.get(name).copied().unwrap_or_default();
        let rules_out = |f: &&Face| f.two_sided || scene.patch_emits(patch(&world, f));
        of.backs >= BACKS_SEEN_MIN
            && f64::from(of.backs) >= BACKS_OF_ALL * f64::from(of.backs + of.fronts)
            && !faces.iter().any(rules_out)
    };
    let mut turned: BTreeMap<&str, &[&Face]> = objects
        .iter()
        .filter(|(name, faces)| is_turned(name, faces))
        .map(|(name, faces)| (*name, faces.as_slice()))
        .collect();
    // What has something before it is not turned, and may itself be before another.
    let mut left = AIR_TRIALS / (1 + world.faces.len() * WALL_RAYS as usize);
    loop {
        let names: BTreeSet<&str> = turned.keys().copied().collect();
        left = left.saturating_sub(names.len());
        if left == 0 {
            return;
        }
        turned.retain(|name, faces| !has_fronts_before(&world, name, faces, &names));
        if turned.len() == names.len() {
            break;
        }
    }
    for (name, faces) in turned.iter().filter(|(name, _)| !said.contains(**name)) {
        let message = "only its backs are seen from where the light is, and nothing is before its fronts, so it is black there; flip its \
                       normals (in Blender: Mesh > Normals > Flip) or make the material double-sided";
        let warning = Severity::Warning;
        notes.push(note(warning, "flipped-normals", name, faces.len(), message.to_owned()));
    }
}

/// Rays from the air that meet an object, by side.
#[derive(Clone, Copy, Default)]
struct Seen {
    fronts: u32,
    backs: u32,
}

/// What is seen of each object from the air.
fn seen_from_air<'a>(world: &World<'a>) -> BTreeMap<&'a str, Seen> {
    let mut out: BTreeMap<&str, Seen> = BTreeMap::new();
    let mut left = AIR_TRIALS / (1 + world.faces.len() * AIR_RAYS as usize);
    let mut waiting: Vec<(DVec3, bool)> =
        places(world).into_iter().map(|place| (place, true)).collect();
    while let Some((from, is_first)) = waiting.pop() {
        left = left.saturating_sub(1);
        if left == 0 {
            return BTreeMap::new();
        }
        let mut of_place: BTreeMap<&str, Seen> = BTreeMap::new();
        let mut all = Seen::default();
        let mut middles = Vec::new();
        for k in 0..AIR_RAYS {
            let direction = all_round(k);
            let Some(hit) = world.first(from, direction, [None, None]) else { continue };
            let of_object = of_place.entry(object(world, hit.face)).or_default();
            for of in [of_object, &mut all] {
                of.fronts += u32::from(hit.front);
                of.backs += u32::from(!hit.front);
            }
            if k < PLACES.1 {
                middles.push((from + direction * (0.5 * hit.distance_m), false));
            }
        }
        let met = f64::from(all.fronts + all.backs);
        let is_air = met >= AIR_MET_MIN * f64::from(AIR_RAYS)
            && f64::from(all.fronts) >= AIR_FRONTS_MIN * met;
        if !is_air {
            continue;
        }
        for (name, seen) in of_place {
            let of = out.entry(name).or_default();
            of.fronts += seen.fronts;
            of.backs += seen.backs;
        }
        if is_first {
            waiting.extend(middles);
        }
    }
    out
}

/// Where lamps, lights and cameras are.
fn places(world: &World) -> Vec<DVec3> {
    let scene = world.scene;
    let off = BEFORE_LAMP * world.bounds.diagonal();
    let lamps = world.faces.iter().filter(|face| scene.patch_emits(patch(world, face)));
    let mut out: Vec<DVec3> =
        lamps.map(|face| at(face, middle(patch(world, face))) + face.normal * off).collect();
    let nodes = scene.lights.iter().map(|l| l.node).chain(scene.cameras.iter().map(|c| c.node));
    let poses = nodes.filter_map(|node| scene.motion.pose(node, world.time_s));
    out.extend(poses.map(|pose| pose.translation));
    let step = out.len().div_ceil(PLACES.0).max(1);
    out.into_iter().step_by(step).collect()
}

/// Whether rays from an object's fronts meet fronts of others, but for some that are named.
fn has_fronts_before(world: &World, name: &str, faces: &[&Face], but: &BTreeSet<&str>) -> bool {
    let mut fronts = 0_u32;
    let own = World { faces: faces.iter().map(|&face| face.clone()).collect(), ..world.clone() };
    let touching = TOUCHES * world.bounds.diagonal();
    for k in 0..WALL_RAYS {
        let face = faces[k as usize % faces.len()];
        let outline = &patch(world, face).corners;
        let centre = middle(patch(world, face));
        let corner = outline[(k / 7) as usize % outline.len()];
        let from = at(face, centre + (corner - centre) * (WITHIN * f64::from(k % 7) / 6.0));
        let [share, turn] = spread(k);
        let (s, c) = libm::sincos(turn);
        let flat = face.axes[0] * (c * share.sqrt()) + face.axes[1] * (s * share.sqrt());
        let direction = flat + face.normal * (1.0 - share).max(0.0).sqrt();
        let start: [Option<PatchId>; 2] = [Some(face.patch), None];
        let Some(hit) = world.first(from, direction, start) else { continue };
        let met = object(world, hit.face);
        // What touches it from outside is not before it.
        let is_behind_own = || {
            let of_own = own.first(from, direction, start);
            of_own.is_some_and(|own| own.distance_m <= hit.distance_m + touching)
        };
        fronts += u32::from(hit.front && met != name && !but.contains(met) && !is_behind_own());
    }
    f64::from(fronts) > FRONTS_BEFORE_MAX * f64::from(WALL_RAYS)
}

/// The k-th of directions that fill the sphere evenly.
fn all_round(k: u32) -> DVec3 {
    let [share, turn] = spread(k);
    let height = 1.0 - 2.0 * share;
    let (s, c) = libm::sincos(turn);
    let flat = (1.0 - height * height).max(0.0).sqrt();
    DVec3::new(c * flat, height, s * flat)
}

fn patch<'a>(world: &World<'a>, face: &Face) -> &'a Patch {
    &world.scene.patches[face.patch.0 as usize]
}

fn object<'a>(world: &World<'a>, face: &Face) -> &'a str {
    &world.scene.surfaces[face.surface.0 as usize].object
}

fn middle(patch: &Patch) -> DVec2 {
    patch.corners.iter().sum::<DVec2>() / patch.corners.len() as f64
}

fn at(face: &Face, point: DVec2) -> DVec3 {
    face.origin + face.axes[0] * point.x + face.axes[1] * point.y
}

#[cfg(test)]
mod tests;
