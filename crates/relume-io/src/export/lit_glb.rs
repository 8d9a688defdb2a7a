//! A lit scene as binary glTF whose light plays: vertex colours that morph from instant to instant, beside the scene's own motion.
//!
//! Knows nothing of how light was found. What viewers need of such a file was tried; [`lit_glb`] says it.

use std::collections::BTreeMap;

use relume_core::geometry::Pose;
use relume_core::scene::{BodyId, MaterialId, NodeId, Scene};
use serde_json::{Value, json};

use super::glb::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, ExportError, FLOAT, UNSIGNED_INT, Writer};
use super::lit::{Lit, LitPart, Tone};

const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;

/// Bytes that viewers keep for a point and an instant that it morphs to: three texels of four floats.
const MORPH_BYTES: u64 = 48;

/// The bytes that a viewer keeps for the colours of `lit` while it plays, as three.js does.
pub fn morph_bytes(lit: &Lit) -> u64 {
    let moving = lit.parts.iter().filter(|part| part.changes());
    let points: usize = moving.map(|part| part.points.len()).sum();
    MORPH_BYTES * points as u64 * lit.times_s.len().saturating_sub(1) as u64
}

/// A lit scene as the bytes of a binary glTF 2.0 file.
///
/// Colours are display values of an exposed radiance, linear, fixed over the clip, on unlit materials. The base is the first
/// instant, 16 bits unsigned; each further instant is a target with 16-bit signed differences to it, whose weight is 1 at its
/// time and falls to 0 at its neighbours' (hat functions). COLOR_0 has four components and every target a POSITION of nothing
/// but zeros, since viewers draw black or end otherwise. Surfaces whose light does not change have no targets. A file of one
/// instant shows bodies where they are then, and has radiosities (W/m2, `_RADIOSITY`) beside the colours.
///
/// Error: half a step of 16 bits in the base, and half of one in a difference.
pub fn lit_glb(lit: &Lit, tone: Tone<'_>, note: Value) -> Result<Vec<u8>, ExportError> {
    let scene = &*lit.scene;
    let mut writer = Writer::new(scene);
    writer.used.push("KHR_materials_unlit");
    writer.extras = Some(json!({ "relume": note }));
    if lit.times_s.len() == 1 {
        place(&mut writer, scene, lit.times_s[0]);
    }
    let mut meshes = Meshes {
        lit,
        tone,
        zeros: BTreeMap::new(),
        materials: BTreeMap::new(),
        morphed: Vec::new(),
    };
    meshes.write(&mut writer);
    writer.cameras();
    if lit.times_s.len() > 1 {
        writer.motion();
        meshes.weights(&mut writer);
    }
    writer.finish()
}

/// A material that shows the colours of its vertices as they are.
fn unlit(name: &str) -> Value {
    json!({
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0
        },
        "extensions": { "KHR_materials_unlit": {} }
    })
}

/// Puts nodes that move where they are at a time.
fn place(writer: &mut Writer<'_>, scene: &Scene, time_s: f64) {
    let motion = &scene.motion;
    for (k, node) in motion.nodes.iter().enumerate().filter(|(_, node)| node.animated()) {
        let above = node.parent.map_or(Some(Pose::IDENTITY), |parent| motion.pose(parent, time_s));
        // What is absent has no mesh.
        let (Some(own), Some(above)) = (motion.pose(NodeId(k as u32), time_s), above) else {
            continue;
        };
        let local = above.inverse() * own;
        let rotation = glam::DQuat::from_mat3(&local.rotation).normalize();
        writer.nodes[k].insert("translation".into(), json!(local.translation.to_array()));
        writer.nodes[k].insert("rotation".into(), json!(rotation.to_array()));
    }
}

/// What becomes one mesh: a body, an object of it, and whether the light on it changes.
type Group<'a> = (BodyId, &'a str, bool);

/// The meshes as they are written.
struct Meshes<'a> {
    lit: &'a Lit,
    tone: Tone<'a>,
    /// Accessors of nothing but zeros by the number of points.
    zeros: BTreeMap<usize, usize>,
    /// Numbers of materials in the file.
    materials: BTreeMap<MaterialId, usize>,
    /// Nodes whose meshes have targets.
    morphed: Vec<usize>,
}

impl Meshes<'_> {
    fn write(&mut self, writer: &mut Writer<'_>) {
        let lit = self.lit;
        // Few objects a body, so a list does.
        let mut groups: Vec<(Group<'_>, Vec<&LitPart>)> = Vec::new();
        let is_there = |part: &&LitPart| lit.times_s.len() > 1 || lit.pose(part, 0).is_some();
        for part in lit.parts.iter().filter(is_there) {
            let surface = &lit.scene.surfaces[part.surface.0 as usize];
            let key = (surface.body, surface.object.as_str(), part.changes());
            match groups.iter_mut().find(|(of, _)| *of == key) {
                Some((_, parts)) => parts.push(part),
                None => groups.push((key, vec![part])),
            }
        }
        for ((body, object, changes), parts) in groups {
            // A second mesh of an object gets a node of its own.
            let (node, body_from_object) = writer.object_node(body, object);
            let mut primitives = Vec::new();
            for of_surface in parts.chunk_by(|a, b| a.surface == b.surface) {
                primitives.push(self.primitive(writer, of_surface, changes, body_from_object));
            }
            writer.nodes[node].insert("mesh".into(), json!(writer.meshes.len()));
            let mut mesh = json!({ "name": object, "primitives": primitives });
            if changes {
                mesh["weights"] = json!(vec![0.0; lit.times_s.len() - 1]);
                self.morphed.push(node);
            }
            writer.meshes.push(mesh);
        }
    }

    /// The parts of one surface.
    fn primitive(
        &mut self,
        writer: &mut Writer<'_>,
        parts: &[&LitPart],
        changes: bool,
        body_from_object: Pose,
    ) -> Value {
        let (mut points, mut indices): (Vec<[f32; 3]>, Vec<u32>) = (Vec::new(), Vec::new());
        for part in parts {
            let first = points.len() as u32;
            points.extend(part.points.iter().map(|p| {
                let in_body = glam::Vec3::from_array(*p).as_dvec3();
                body_from_object.inverse_point(in_body).as_vec3().to_array()
            }));
            indices.extend(part.triangles.as_flattened().iter().map(|k| first + k));
        }
        let position = writer.vec3_accessor(&points, Some(ARRAY_BUFFER), true);
        let base = self.quantised(parts, 0);
        let bytes =
            base.iter().flat_map(|c| [c[0], c[1], c[2], u16::MAX]).flat_map(u16::to_le_bytes);
        let view = writer.view(bytes, ARRAY_BUFFER);
        let colour = writer.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_SHORT, "normalized": true,
            "count": points.len(), "type": "VEC4"
        }));
        let view = writer.view(indices.iter().flat_map(|i| i.to_le_bytes()), ELEMENT_ARRAY_BUFFER);
        let index = writer.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(),
            "type": "SCALAR"
        }));
        let surface = &self.lit.scene.surfaces[parts[0].surface.0 as usize];
        let mut primitive = json!({
            "attributes": { "POSITION": position, "COLOR_0": colour },
            "indices": index,
            "material": self.material(writer, surface.material)
        });
        if changes {
            primitive["targets"] = self.targets(writer, parts, &base);
        }
        if self.lit.times_s.len() == 1 {
            let radiosity = parts.iter().flat_map(|part| part.radiosity(0));
            let radiosity: Vec<[f32; 3]> = radiosity.map(|b| b.map(|b| b as f32)).collect();
            let accessor = writer.vec3_accessor(&radiosity, Some(ARRAY_BUFFER), false);
            primitive["attributes"]["_RADIOSITY"] = json!(accessor);
        }
        primitive
    }

    /// The material of the file that stands for one of the scene.
    fn material(&mut self, writer: &mut Writer<'_>, of: MaterialId) -> usize {
        *self.materials.entry(of).or_insert_with(|| {
            writer.materials.push(unlit(&self.lit.scene.materials[of.0 as usize].name));
            writer.materials.len() - 1
        })
    }

    /// Colours of an instant, as 16 bits.
    fn quantised(&self, parts: &[&LitPart], instant: usize) -> Vec<[u16; 3]> {
        let bits = |x: f64| ((self.tone)(x).clamp(0.0, 1.0) * 65535.0).round() as u16;
        parts.iter().flat_map(|part| self.lit.exposed(part, instant)).map(|c| c.map(bits)).collect()
    }

    /// Differences of the further instants to the first.
    fn targets(&mut self, writer: &mut Writer<'_>, parts: &[&LitPart], base: &[[u16; 3]]) -> Value {
        let count = base.len();
        let zeros = *self.zeros.entry(count).or_insert_with(|| {
            writer.accessor(json!({
                "componentType": FLOAT, "count": count, "type": "VEC3",
                "min": [0.0, 0.0, 0.0], "max": [0.0, 0.0, 0.0]
            }))
        });
        let targets = (1..self.lit.times_s.len()).map(|instant| {
            let step = |x: f64, base: u16| {
                let display = (self.tone)(x).clamp(0.0, 1.0);
                ((display - f64::from(base) / 65535.0) * 32767.0).round() as i16
            };
            let colours = parts.iter().flat_map(|part| self.lit.exposed(part, instant));
            let steps: Vec<[i16; 4]> = colours
                .zip(base)
                .map(|(c, b)| [step(c[0], b[0]), step(c[1], b[1]), step(c[2], b[2]), 0])
                .collect();
            let bytes = steps.as_flattened().iter().flat_map(|s| s.to_le_bytes());
            let view = writer.view(bytes, ARRAY_BUFFER);
            let colour = writer.accessor(json!({
                "bufferView": view, "componentType": SHORT, "normalized": true,
                "count": count, "type": "VEC4"
            }));
            json!({ "POSITION": zeros, "COLOR_0": colour })
        });
        targets.collect()
    }

    /// The weights of all targets over time: one sampler for all nodes, sparse, since at each time one weight is not 0.
    fn weights(&self, writer: &mut Writer<'_>) {
        if self.morphed.is_empty() {
            return;
        }
        let instants = self.lit.times_s.len() as u32;
        let input = writer.times(&self.lit.times_s);
        let places = (1..instants).map(|k| k * (instants - 1) + k - 1);
        let indices = writer.view(places.flat_map(u32::to_le_bytes), None);
        let values = writer.view((1..instants).flat_map(|_| 1.0_f32.to_le_bytes()), None);
        let output = writer.accessor(json!({
            "componentType": FLOAT, "count": instants * (instants - 1), "type": "SCALAR",
            "sparse": {
                "count": instants - 1,
                "indices": { "bufferView": indices, "componentType": UNSIGNED_INT },
                "values": { "bufferView": values }
            }
        }));
        let sampler = writer.sampler([input, output], "LINEAR");
        for node in &self.morphed {
            writer.channel_of(json!({ "node": node, "path": "weights" }), sampler);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DQuat, DVec3};
    use relume_core::scene::SceneBuilder;

    use super::*;

    /// Two squares at five instants: the light on the first stays as it is, the second reflects nothing but glows more and more, or
    /// does not.
    fn lit(glows: bool) -> Lit {
        let mut b = SceneBuilder::new("two");
        let (grey, black) =
            (b.material("grey", [0.5; 3], [0.0; 3]), b.material("black", [0.0; 3], [1.0; 3]));
        let node = b.node("all", None, DVec3::ZERO, DQuat::IDENTITY);
        let square = |z: f64| {
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z))
        };
        b.polygon(node, "one", grey, &square(0.0));
        b.polygon(node, "other", black, &square(1.0));
        let scene = Arc::new(b.build().unwrap());
        let times_s: Vec<f64> = (0..5).map(f64::from).collect();
        let part = |surface: u32, of: &dyn Fn(f64) -> (f32, f64)| LitPart {
            surface: scene.patches[surface as usize].surface,
            points: square(f64::from(surface)).map(|p| p.as_vec3().to_array()).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            irradiance: times_s.iter().map(|&t| vec![[of(t).0; 3]; 4]).collect(),
            exitance: times_s.iter().map(|&t| [of(t).1; 3]).collect(),
            reflectance: scene.reflectance(&scene.patches[surface as usize]),
        };
        let parts =
            vec![part(0, &|_| (1.0, 0.0)), part(1, &|t| (t as f32, if glows { t } else { 1.0 }))];
        Lit { scene, times_s, parts, exposure: 0.25 }
    }

    #[test]
    fn surfaces_whose_light_stays_as_it_is_have_no_targets() {
        let whole = |x: f64| x;
        let targets = |lit: &Lit| {
            let file = lit_glb(lit, &whole, json!({})).unwrap();
            let text = String::from_utf8_lossy(&file).into_owned();
            (text.matches("\"targets\"").count(), text.matches("\"weights\"").count() > 0)
        };
        // What falls on what reflects nothing is not seen.
        assert_eq!((targets(&lit(false)), morph_bytes(&lit(false))), ((0, false), 0));
        assert_eq!((targets(&lit(true)), morph_bytes(&lit(true))), ((1, true), 48 * 4 * 4));
    }

    #[test]
    fn fewer_instants_keep_the_first_and_the_last() {
        let thin = lit(true).every(3);
        assert_eq!(thin.times_s, [0.0, 3.0, 4.0]);
        assert_eq!(
            thin.parts[1].exitance.iter().map(|m| m[0]).collect::<Vec<_>>(),
            [0.0, 3.0, 4.0]
        );
        assert_eq!(thin.parts[1].irradiance[1], vec![[3.0; 3]; 4]);
        assert_eq!(morph_bytes(&thin), 48 * 4 * 2);
    }
}
