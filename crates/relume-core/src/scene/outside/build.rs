//! Light from outside made into bodies of a scene.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::dome::{self, Cell};
use super::sun::from_zenith;
use super::{Outside, OutsideNow, SunKey};
use crate::geometry::Aabb;
use crate::scene::flatten::flatten;
use crate::scene::limits::COORDINATE_MAX_M;
use crate::scene::names::Names;
use crate::scene::tuning::{EXTENT_INSTANTS, OUTSIDE_FAR};
use crate::scene::{
    Body, BodyId, Glow, Interpolation, Material, MaterialId, Node, NodeId, Patch, RotationTrack,
    Scene, SceneError, Surface, SurfaceId, Track,
};

impl Scene {
    /// The same scene lit from outside. A day lengthens the animation where it takes longer.
    ///
    /// # Errors
    /// What [`Outside::check`] finds, and a scene too large to be outside of.
    pub fn with_outside(mut self, outside: Outside) -> Result<Scene, SceneError> {
        outside.check()?;
        let Aabb { lo: low, hi: high } = self.extent();
        let (centre, far_m) = (0.5 * (low + high), OUTSIDE_FAR * (high - low).length());
        if (far_m + centre.length()) * 2.0 > COORDINATE_MAX_M {
            return Err(SceneError::Geometry {
                subject: format!("scene `{}`", self.name),
                what: format!(
                    "with an extent of {:e} m there is no place outside it",
                    far_m / OUTSIDE_FAR
                ),
                remedy: "scale it to metres".into(),
            });
        }
        let times_s = outside.key_times_s();
        let keys = times_s.iter().map(|&t| outside.at(t)).collect::<Result<Vec<_>, _>>()?;
        let mut adding = Adding::new(&mut self, centre, far_m, times_s);
        adding.add_sky(&outside, &keys);
        adding.add_sun(&outside, &keys);
        if let Some(day) = outside.day {
            self.motion.duration_s = self.motion.duration_s.max(day.over_s);
        }
        (self.outside, self.outside_m) = (Some(Arc::new(outside)), far_m);
        Ok(self)
    }

    /// Bounds over the animation.
    fn extent(&self) -> Aabb {
        let [from, to] = self.motion.span_s();
        let time = |k: u32| from + (to - from) * f64::from(k) / f64::from(EXTENT_INSTANTS);
        // Where nothing moves one instant is as good as many.
        let instants = if to > from { EXTENT_INSTANTS } else { 0 };
        let bounds = (0..=instants).filter_map(|k| self.bounds(time(k)));
        let all = bounds.reduce(Aabb::union);
        // Nothing is there at any of these instants: any place will do.
        all.unwrap_or(Aabb { lo: DVec3::ZERO, hi: DVec3::ONE })
    }
}

/// A scene to which bodies are added that are far away.
struct Adding<'a> {
    scene: &'a mut Scene,
    centre: DVec3,
    far_m: f64,
    times_s: Vec<f64>,
    bodies: Names,
    surfaces: Names,
    materials: Names,
}

impl<'a> Adding<'a> {
    fn new(scene: &'a mut Scene, centre: DVec3, far_m: f64, times_s: Vec<f64>) -> Adding<'a> {
        fn taken<'b>(names: impl Iterator<Item = &'b String>) -> Names {
            let mut out = Names::default();
            names.for_each(|name| {
                out.unique(name);
            });
            out
        }
        let bodies = taken(scene.motion.nodes.iter().map(|n| &n.name));
        let surfaces = taken(scene.surfaces.iter().map(|s| &s.name));
        let materials = taken(scene.materials.iter().map(|m| &m.name));
        Adding { scene, centre, far_m, times_s, bodies, surfaces, materials }
    }

    /// The sky, and the ground below the horizon.
    fn add_sky(&mut self, outside: &Outside, keys: &[OutsideNow]) {
        let skies: Vec<_> = keys.iter().filter_map(|key| key.sky.clone()).collect();
        let all_round = outside.sky.as_ref().is_some_and(super::Sky::is_all_round);
        let mut lit: Vec<(&str, Cell, Vec<[f64; 3]>)> = Vec::new();
        if !skies.is_empty() {
            let facets = dome::facets(&skies, all_round, outside.fineness);
            lit.extend(facets.into_iter().map(|f| ("sky", f.cell, f.radiance)));
        }
        let ground: Vec<[f64; 3]> = keys.iter().map(|key| key.ground).collect();
        if ground.iter().flatten().any(|&l| l > 0.0) {
            lit.extend(
                Cell::below().into_iter().map(|cell| ("ground beyond", cell, ground.clone())),
            );
        }
        if lit.is_empty() {
            return;
        }
        let body = self.begin_body("sky", self.still("sky"));
        for (k, (name, cell, radiance)) in lit.iter().enumerate() {
            let exitance: Vec<DVec3> =
                radiance.iter().map(|l| PI * DVec3::from_array(*l)).collect();
            let corners = cell.corners().map(|c| self.centre + self.far_m * c);
            self.add_polygon(body, &format!("{name}/{k}"), &corners, &exitance);
        }
        self.end_body();
    }

    fn add_sun(&mut self, outside: &Outside, keys: &[OutsideNow]) {
        let Some(sun) = &outside.sun else { return };
        let of_key = |key: &OutsideNow| {
            let (towards, _, radiance) = key.sun.expect("a sun has a place");
            let exitance = PI * DVec3::from_array(radiance);
            let is_up = exitance != DVec3::ZERO;
            SunKey { rotation: from_zenith(towards), exitance, is_up }
        };
        let keys: Vec<SunKey> = keys.iter().map(of_key).collect();
        if keys.iter().all(|key| !key.is_up) {
            return;
        }
        let exitance: Vec<DVec3> = keys.iter().map(|key| key.exitance).collect();
        let still = keys.len() < 2;
        let mut node = self.still("sun");
        if !still {
            node.translation = self.centre;
            node.rotation_track = Some(RotationTrack {
                times_s: self.times_s.clone(),
                values: keys.iter().map(|key| key.rotation).collect(),
                interpolation: Interpolation::Linear,
            });
        }
        let body = self.begin_body("sun", node);
        let pose = match still {
            true => (self.centre, keys[0].rotation),
            false => (DVec3::ZERO, DQuat::IDENTITY),
        };
        let place = |c: &DVec3| pose.0 + pose.1 * (self.far_m * *c);
        let corners: Vec<DVec3> = sun.corners().iter().map(place).collect();
        self.add_polygon(body, "sun", &corners, &exitance);
        self.end_body();
    }

    fn still(&self, name: &str) -> Node {
        Node {
            name: name.into(),
            parent: None,
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            translation_track: None,
            rotation_track: None,
            presence: Vec::new(),
        }
    }

    fn begin_body(&mut self, name: &str, node: Node) -> BodyId {
        let name = self.bodies.unique(name);
        self.scene.motion.nodes.push(Node { name: name.clone(), ..node });
        let node = NodeId(self.scene.motion.nodes.len() as u32 - 1);
        let start = self.scene.patches.len() as u32;
        self.scene.bodies.push(Body {
            name,
            node,
            patches: start..start,
            distant: true,
            again: false,
        });
        BodyId(self.scene.bodies.len() as u32 - 1)
    }

    fn end_body(&mut self) {
        let end = self.scene.patches.len() as u32;
        self.scene.bodies.last_mut().expect("a body was begun").patches.end = end;
    }

    /// A polygon of a surface and a material of its own, with its exitance at each key.
    fn add_polygon(&mut self, body: BodyId, name: &str, corners: &[DVec3], exitance: &[DVec3]) {
        let Ok((frame, corners)) = flatten(corners) else { return };
        let material = self.add_material(name, exitance);
        let name = self.surfaces.unique(name);
        self.scene.surfaces.push(Surface { name: name.clone(), object: name, body, material });
        let surface = SurfaceId(self.scene.surfaces.len() as u32 - 1);
        self.scene.patches.push(Patch {
            body,
            surface,
            material,
            frame,
            corners,
            twin: None,
            tint: None,
            print: None,
        });
    }

    fn add_material(&mut self, name: &str, exitance: &[DVec3]) -> MaterialId {
        let changes = exitance.iter().any(|m| *m != exitance[0]);
        let glow = changes.then(|| Glow {
            scale: [1.0; 3],
            tracks: vec![Track {
                times_s: self.times_s.clone(),
                values: exitance.to_vec(),
                interpolation: Interpolation::Linear,
            }],
        });
        self.scene.materials.push(Material {
            name: self.materials.unique(name),
            reflectance: [0.0; 3],
            exitance: exitance[0].to_array(),
            glow,
            double_sided: false,
        });
        MaterialId(self.scene.materials.len() as u32 - 1)
    }
}
