//! The state of all that may change in a scene, at one instant, as a plain value.
//!
//! The clip of a file is one source of worlds ([`Scene::at`]); a hand that takes hold of bodies, materials and
//! lights is another ([`Held`]). Must not know who asks for a world, or what is made of it.

use std::collections::BTreeMap;

use super::{BodyId, LightId, MaterialId, Patch, Scene};
use crate::geometry::Pose;

/// Poses of bodies, reflectance and exitance of materials, poses and intensities of lights.
///
/// What light does in a scene is a function of the scene and of this value alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct World {
    poses: Vec<Option<Pose>>,
    materials: Vec<MaterialNow>,
    lights: Vec<LightNow>,
}

/// A material at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MaterialNow {
    /// In place of what the scene says of its patches.
    reflectance: Option<[f64; 3]>,
    exitance: [f64; 3],
}

/// A punctual light at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LightNow {
    pose: Option<Pose>,
    intensity: [f64; 3],
}

/// Values set by commands in place of the clip's; none at first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Held {
    /// World poses of bodies; the punctual lights on a body move with it.
    pub poses: BTreeMap<BodyId, Pose>,
    /// Whether bodies are there; the punctual lights on a body come and go with it.
    pub presence: BTreeMap<BodyId, bool>,
    /// Reflectances of materials, each channel in [0, 1); in place of their textures too.
    pub reflectances: BTreeMap<MaterialId, [f64; 3]>,
    /// Exitances of materials, W/m2; textures of emission still weigh them.
    pub exitances: BTreeMap<MaterialId, [f64; 3]>,
    /// Intensities of punctual lights, W/sr (directional: W/m2).
    pub intensities: BTreeMap<LightId, [f64; 3]>,
}

impl Scene {
    /// The world at a time of the clip, seconds.
    pub fn at(&self, time_s: f64) -> World {
        self.at_but(time_s, &Held::default())
    }

    /// The world at a time of the clip, seconds, but for what is held by hand.
    pub fn at_but(&self, time_s: f64, held: &Held) -> World {
        let pose = |k: u32| {
            let body = BodyId(k);
            let of_clip = || self.pose(body, time_s);
            if self.is_removed(body) {
                return None;
            }
            match held.presence.get(&body) {
                Some(false) => None,
                // What the clip has taken away is where it would be.
                Some(true) => {
                    held.poses.get(&body).copied().or_else(|| Some(self.place(body, time_s)))
                }
                None => of_clip().map(|pose| held.poses.get(&body).copied().unwrap_or(pose)),
            }
        };
        let poses: Vec<Option<Pose>> = (0..self.bodies.len() as u32).map(pose).collect();
        let materials = (0..).zip(&self.materials).map(|(k, material)| MaterialNow {
            reflectance: held.reflectances.get(&MaterialId(k)).copied(),
            exitance: match held.exitances.get(&MaterialId(k)) {
                Some(exitance) => *exitance,
                None => material.exitance_at(time_s),
            },
        });
        let lights = (0..).zip(&self.lights).map(|(k, light)| LightNow {
            pose: self.light_pose(LightId(k), time_s, held, &poses),
            intensity: match held.intensities.get(&LightId(k)) {
                Some(intensity) => *intensity,
                None => light.intensity_at(time_s),
            },
        });
        World { materials: materials.collect(), lights: lights.collect(), poses }
    }

    /// Where a body is, or would be if it were present.
    fn place(&self, body: BodyId, time_s: f64) -> Pose {
        if !self.moves(body) {
            return Pose::IDENTITY;
        }
        self.motion.place(self.bodies[body.0 as usize].node, time_s)
    }

    /// The body that a light hangs on: it moves with it.
    pub fn carrier(&self, light: LightId) -> Option<BodyId> {
        let above = self.motion.ids_upward(self.lights[light.0 as usize].node);
        let mut carried = above.filter_map(|node| self.bodies.iter().position(|b| b.node == node));
        carried.next().map(|body| BodyId(body as u32))
    }

    fn light_pose(
        &self,
        light: LightId,
        time_s: f64,
        held: &Held,
        poses: &[Option<Pose>],
    ) -> Option<Pose> {
        let node = self.lights[light.0 as usize].node;
        let of_clip = self.motion.pose(node, time_s);
        let is_held = |b: &BodyId| held.poses.contains_key(b) || held.presence.contains_key(b);
        match self.carrier(light).filter(is_held) {
            None => of_clip,
            Some(body) => {
                let now = poses[body.0 as usize]?;
                let carrier = self.bodies[body.0 as usize].node;
                // The frame of a body that no clip moves is the world's.
                let on_body = match self.moves(body) {
                    true => self.motion.place_on(carrier, node, time_s),
                    false => self.motion.place(node, time_s),
                };
                Some(now * on_body)
            }
        }
    }
}

impl World {
    /// World pose of a body, `None` while absent.
    #[inline]
    pub fn pose(&self, body: BodyId) -> Option<Pose> {
        self.poses[body.0 as usize]
    }

    /// The same world of other bodies: each is where one of this world's is, or absent.
    pub(crate) fn of_bodies(&self, from: &[Option<BodyId>]) -> World {
        let poses = from.iter().map(|body| body.and_then(|body| self.pose(body))).collect();
        World { poses, ..self.clone() }
    }

    /// World poses of all bodies, by [`BodyId`].
    pub fn poses(&self) -> &[Option<Pose>] {
        &self.poses
    }

    /// Exitance of a material, W/m2, linear RGB; of its patches see [`World::exitance`].
    pub fn material_exitance(&self, material: MaterialId) -> [f64; 3] {
        self.materials[material.0 as usize].exitance
    }

    /// Exitance of a patch, W/m2, linear RGB, whether its body is there or not.
    pub fn exitance(&self, scene: &Scene, patch: &Patch) -> [f64; 3] {
        let (exitance, share) =
            (self.material_exitance(patch.material), scene.emission_share(patch));
        [0, 1, 2].map(|c| exitance[c] * share[c])
    }

    /// Diffuse reflectance of a patch, linear RGB, each channel in [0, 1).
    pub fn reflectance(&self, scene: &Scene, patch: &Patch) -> [f64; 3] {
        let held = self.materials[patch.material.0 as usize].reflectance;
        held.unwrap_or_else(|| scene.reflectance(patch))
    }

    /// World pose of a punctual light, `None` while absent.
    pub fn light_pose(&self, light: LightId) -> Option<Pose> {
        self.lights[light.0 as usize].pose
    }

    /// Intensity of a punctual light, W/sr (directional: W/m2), linear RGB, whether it is there or not.
    pub fn intensity(&self, light: LightId) -> [f64; 3] {
        self.lights[light.0 as usize].intensity
    }

    /// Whether exitance or reflectance of a material differ from those in another world.
    pub fn is_relit(&self, other: &World, material: MaterialId) -> bool {
        let k = material.0 as usize;
        self.materials[k] != other.materials[k]
    }

    /// Whether the intensity of any punctual light differs from that in another world.
    pub fn lights_differ(&self, other: &World) -> bool {
        let intensities = self.lights.iter().zip(&other.lights);
        intensities.into_iter().any(|(one, two)| one.intensity != two.intensity)
    }

    /// Whether any exitance, reflectance or intensity differs from that in another world.
    pub fn any_relit(&self, other: &World) -> bool {
        self.materials != other.materials || self.lights_differ(other)
    }
}

impl Held {
    /// Whether bodies move as they do with this in hand.
    pub(crate) fn promises_as(&self, other: &Held) -> bool {
        self.poses == other.poses && self.presence == other.presence
    }
}
