//! Lights that light nothing, because something is in their way.
//!
//! A few rays from each light, in fixed directions, until one meets a front that the light is meant for.
//! Only where none does is there something to say. Must not know light transport: rays are tried against
//! one polygon after another, and nothing is measured.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::world::{World, spread};
use super::{listed, note};
use crate::geometry::{Aabb, Pose};
use crate::scene::tuning::{
    LAMP_POLYGONS, LAMP_RAYS, LIGHT_INSTANTS, LIGHT_RAYS, LIGHT_TRIALS, RIGHT_BEFORE, SHADE,
    SUN_RAYS,
};
use crate::scene::{LightKind, NodeId, Note, PatchId, Scene, Severity, SurfaceId};

/// Adds the lights that light nothing at any time of the animation.
pub(super) fn blind(scene: &Scene, notes: &mut Vec<Note>) {
    let sources = sources(scene);
    let mut left = LIGHT_TRIALS;
    let start = World::of(scene, 0.0);
    let mut blind: Vec<(&Source, Stopped)> = Vec::new();
    for source in &sources {
        match start.try_light(source, &mut left) {
            Tried::Stopped(stopped) => blind.push((source, stopped)),
            Tried::Lights | Tried::Spent => {}
        }
    }
    let instants = if scene.bodies.iter().any(|b| scene.motion.moves(b.node))
        || scene.lights.iter().any(|l| scene.motion.moves(l.node))
    {
        LIGHT_INSTANTS
    } else {
        0
    };
    for k in 1..=instants {
        if blind.is_empty() {
            return;
        }
        let later = World::of(scene, scene.motion.duration_s * f64::from(k) / f64::from(instants));
        blind.retain(|(source, _)| matches!(later.try_light(source, &mut left), Tried::Stopped(_)));
    }
    for (source, stopped) in blind {
        // What is closed around a light may be a room with nothing in it.
        let severity = match stopped.only_shades() {
            true => Severity::Info,
            false => Severity::Warning,
        };
        notes.push(note(severity, "light-lost", source.name, 1, stopped.message(scene)));
    }
}

/// What sends light out.
struct Source<'a> {
    name: &'a str,
    kind: SourceKind<'a>,
}

enum SourceKind<'a> {
    Light(LightKind, NodeId),
    /// The patches of one object that emit.
    Lamp(Vec<PatchId>, &'a str),
}

/// Every light and every object that emits at some time.
fn sources(scene: &Scene) -> Vec<Source<'_>> {
    let shines = |most: [f64; 3]| most.iter().any(|&m| m > 0.0);
    let lights = scene.lights.iter().filter(|l| shines(l.most_intensity()));
    let mut sources: Vec<Source> =
        lights.map(|l| Source { name: &l.name, kind: SourceKind::Light(l.kind, l.node) }).collect();
    let mut lamps: BTreeMap<&str, Vec<PatchId>> = BTreeMap::new();
    for (number, patch) in scene.patches.iter().enumerate() {
        if scene.patch_emits(patch) {
            let object = scene.surfaces[patch.surface.0 as usize].object.as_str();
            lamps.entry(object).or_default().push(PatchId(number as u32));
        }
    }
    sources.extend(
        lamps.into_iter().map(|(name, of)| Source { name, kind: SourceKind::Lamp(of, name) }),
    );
    sources
}

enum Tried {
    Lights,
    Stopped(Stopped),
    /// No more rays are tried, or the light is absent.
    Spent,
}

/// What the rays of a light that lights nothing ended on.
#[derive(Default)]
struct Stopped {
    /// Black backs.
    backs: BTreeSet<SurfaceId>,
    /// What lies right before the lamp, and how far from it at least, metres.
    before: BTreeSet<SurfaceId>,
    gap_m: f64,
    /// What is closed around the light and holds nothing else.
    shades: BTreeSet<SurfaceId>,
    /// What is closed around all else.
    shells: BTreeSet<SurfaceId>,
}

impl Stopped {
    fn only_shades(&self) -> bool {
        !self.shades.is_empty() && self.before.is_empty() && self.shells.is_empty()
    }

    fn message(&self, scene: &Scene) -> String {
        let named = |of: &BTreeSet<SurfaceId>| {
            let objects = of.iter().map(|s| scene.surfaces[s.0 as usize].object.as_str());
            listed(&objects.collect())
        };
        if !self.before.is_empty() {
            return format!(
                "it lights nothing but {}, which lies {:.2e} m in front of it and keeps its light from all else; \
                 move the light to the other side, or a little away from it if they are meant to be apart",
                named(&self.before),
                self.gap_m
            );
        }
        if !self.shells.is_empty() {
            return format!(
                "it lights only the outer side of {}, which is closed around all else; move the light inside, or \
                 delete what is in its way",
                named(&self.shells)
            );
        }
        if !self.shades.is_empty() {
            return format!(
                "it lights only the inside of {}, which is closed around it; open that, delete it, or let it emit \
                 instead of the light",
                named(&self.shades)
            );
        }
        if !self.backs.is_empty() {
            return format!(
                "it lights nothing: its rays end on the backs of {}, which are black; move the light, delete what \
                 is in its way, flip its normals or make its material double-sided",
                named(&self.backs)
            );
        }
        "it lights nothing: none of its rays meets a surface; turn or move it, or delete it"
            .to_owned()
    }
}

impl World<'_> {
    fn try_light(&self, source: &Source, left: &mut usize) -> Tried {
        let mut stopped = Stopped { gap_m: f64::INFINITY, ..Stopped::default() };
        let mut cast = 0_usize;
        let mut try_ray = |ray: &Ray| {
            if *left < self.faces.len() {
                return Some(Tried::Spent);
            }
            *left -= self.faces.len();
            cast += 1;
            self.reaches(ray, source, &mut stopped).then_some(Tried::Lights)
        };
        let ended = match &source.kind {
            SourceKind::Light(kind, node) => {
                let Some(pose) = self.scene.motion.pose(*node, self.time_s) else {
                    return Tried::Spent;
                };
                self.rays_of_light(*kind, pose).find_map(|ray| try_ray(&ray))
            }
            SourceKind::Lamp(patches, _) => {
                let step = patches.len().div_ceil(LAMP_POLYGONS).max(1);
                let some: Vec<PatchId> = patches.iter().copied().step_by(step).collect();
                (0..LAMP_RAYS)
                    .flat_map(|k| some.iter().map(move |&p| (k, p)))
                    .filter_map(|(k, patch)| self.ray_of_patch(patch, k))
                    .find_map(|ray| try_ray(&ray))
            }
        };
        match ended {
            Some(tried) => tried,
            None if cast == 0 => Tried::Spent,
            None => Tried::Stopped(stopped),
        }
    }

    fn rays_of_light(&self, kind: LightKind, pose: Pose) -> Box<dyn Iterator<Item = Ray> + '_> {
        let axis = pose.direction(DVec3::NEG_Z);
        let across = [pose.direction(DVec3::X), pose.direction(DVec3::Y)];
        let along = move |cosine: f64, turn: f64| {
            let (sine, (s, c)) = ((1.0 - cosine * cosine).max(0.0).sqrt(), libm::sincos(turn));
            axis * cosine + (across[0] * c + across[1] * s) * sine
        };
        let from = |origin: DVec3, direction: DVec3| Ray { origin, direction, lamp: None };
        match kind {
            LightKind::Directional => {
                let (centre, radius) = (self.bounds.centre(), self.bounds.diagonal() * 0.5);
                Box::new((0..SUN_RAYS).map(move |k| {
                    let [share, turn] = spread(k);
                    let (s, c) = libm::sincos(turn);
                    let off = (across[0] * c + across[1] * s) * (share.sqrt() * radius);
                    from(centre + off - axis * (2.0 * radius), axis)
                }))
            }
            LightKind::Point | LightKind::Spot { .. } => {
                let lowest = match kind {
                    LightKind::Spot { outer, .. } => libm::cos(outer),
                    _ => -1.0,
                };
                Box::new((0..LIGHT_RAYS).map(move |k| {
                    let [share, turn] = spread(k);
                    from(pose.translation, along(1.0 - share * (1.0 - lowest), turn))
                }))
            }
        }
    }

    /// A ray from the front of a patch, `None` while that is absent. Directions by Lambert's law; points
    /// from the middle outwards.
    fn ray_of_patch(&self, id: PatchId, k: u32) -> Option<Ray> {
        let patch = &self.scene.patches[id.0 as usize];
        let pose = self.scene.pose(patch.body, self.time_s)?;
        let corners = &patch.corners;
        let middle = corners.iter().sum::<DVec2>() / corners.len() as f64;
        let corner = corners[k as usize % corners.len()];
        let point = middle + (corner - middle) * (0.9 * f64::from(k % 7) / 6.0);
        let [share, turn] = spread(k);
        let (s, c) = libm::sincos(turn);
        let flat = patch.frame.u * (c * share.sqrt()) + patch.frame.v * (s * share.sqrt());
        let direction = pose.direction(flat + patch.frame.normal * (1.0 - share).max(0.0).sqrt());
        let bounds = Aabb::of(patch.corners_in_body());
        let width_m = patch.area_m2() / bounds.diagonal().max(f64::MIN_POSITIVE);
        let lamp = Some(OfLamp {
            patches: [Some(id), patch.twin],
            normal: pose.direction(patch.frame.normal),
            width_m,
        });
        Some(Ray { origin: pose.point(patch.frame.point(point)), direction, lamp })
    }

    /// Whether a ray meets a front that the light is meant for; if not, notes what it met.
    fn reaches(&self, ray: &Ray, source: &Source, stopped: &mut Stopped) -> bool {
        let own = ray.lamp.as_ref().map_or([None; 2], |lamp| lamp.patches);
        let Some(hit) = self.first(ray.origin, ray.direction, own) else { return false };
        let surface = hit.face.surface;
        if !hit.front {
            stopped.backs.insert(surface);
            return false;
        }
        if let Some(lamp) = &ray.lamp {
            let gap_m = hit.distance_m * ray.direction.dot(lamp.normal);
            let parallel = hit.normal.dot(lamp.normal) < -0.99;
            if parallel && gap_m < RIGHT_BEFORE * lamp.width_m {
                stopped.before.insert(surface);
                stopped.gap_m = stopped.gap_m.min(gap_m);
                return false;
            }
        }
        let object = self.scene.surfaces[surface.0 as usize].object.as_str();
        if matches!(source.kind, SourceKind::Lamp(_, own) if own == object) {
            return true;
        }
        if self.is_shell(object)
            && hit.normal.dot(hit.face.origin - self.objects[object].centre()) > 0.0
        {
            stopped.shells.insert(surface);
            return false;
        }
        if self.is_shade(object, source, ray.origin) {
            stopped.shades.insert(surface);
            return false;
        }
        true
    }

    /// Whether an object spans all others.
    fn is_shell(&self, object: &str) -> bool {
        let around = self.objects[object];
        let solid = around.extent().min_element() > 0.0;
        let within = |b: &Aabb| b.lo.cmpge(around.lo).all() && b.hi.cmple(around.hi).all();
        solid && self.objects.len() > 1 && self.objects.values().all(within)
    }

    /// Whether an object stands around a light and around nothing else.
    fn is_shade(&self, object: &str, source: &Source, light: DVec3) -> bool {
        let around = self.objects[object];
        let inside = |p: DVec3| p.cmpgt(around.lo).all() && p.cmplt(around.hi).all();
        let own = match source.kind {
            SourceKind::Lamp(_, own) => own,
            SourceKind::Light(..) => object,
        };
        let cameras = self.scene.cameras.iter();
        let mut cameras = cameras.filter_map(|c| self.scene.motion.pose(c.node, self.time_s));
        inside(light)
            && around.diagonal() < SHADE * self.bounds.diagonal()
            && !cameras.any(|pose| inside(pose.translation))
            && !self
                .objects
                .iter()
                .any(|(&name, b)| name != object && name != own && inside(b.centre()))
    }
}

struct Ray {
    origin: DVec3,
    direction: DVec3,
    lamp: Option<OfLamp>,
}

/// What a ray starts on.
struct OfLamp {
    /// The patch and its twin.
    patches: [Option<PatchId>; 2],
    normal: DVec3,
    /// The shorter of its sides, roughly, metres.
    width_m: f64,
}
