//! A scene as binary glTF 2.0: geometry, materials, motion, cameras and lights, without any light
//! solution.
//!
//! What is read back is the same scene: patches and poses to the precision of the 32-bit floats
//! that glTF stores, names exactly. Polygons are written as triangle fans (they are convex) and a
//! reader merges them again; of a double-sided polygon one side is written.

use std::f64::consts::PI;
use std::io;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use relume_core::geometry::Pose;
use relume_core::scene::{
    BodyId, Glow, Interpolation, Light, LightKind, Material, Node, NodeId, Patch, Projection,
    Scene, SurfaceId, Track,
};
use serde_json::{Map, Value, json};

use super::write_atomically;
use crate::photometry::PEAK_LUMENS_PER_WATT;

/// Near plane written for cameras, metres: glTF demands one and a [`Scene`] has none.
const CAMERA_NEAR_M: f64 = 0.01;
/// Far plane written for orthographic cameras, metres.
const CAMERA_FAR_M: f64 = 1000.0;

pub(super) const FLOAT: u32 = 5126;
pub(super) const UNSIGNED_INT: u32 = 5125;
pub(super) const ARRAY_BUFFER: u32 = 34962;
pub(super) const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Error of writing a scene.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: String,
        /// Why not.
        source: io::Error,
    },
    /// A binary glTF file holds at most 4 GiB.
    #[error(
        "the scene {name} does not fit into one .glb file ({bytes} bytes; the format ends at 4 GiB)"
    )]
    TooLarge {
        /// Name of the scene.
        name: String,
        /// Size it would have, bytes.
        bytes: usize,
    },
}

/// Writes `scene` to `path` as binary glTF; the file appears whole or not at all.
pub fn write_glb(scene: &Scene, path: &Path) -> Result<(), ExportError> {
    let bytes = glb(scene)?;
    write_atomically(path, &bytes)
        .map_err(|source| ExportError::Write { path: path.display().to_string(), source })
}

/// `scene` as the bytes of a binary glTF 2.0 file.
///
/// Emission is written as radiance L = M / pi (W/m2/sr) in `emissiveFactor`, with
/// KHR_materials_emissive_strength where a channel is above 1. Punctual lights are written in the
/// photometric units of KHR_lights_punctual at 683 lm/W.
pub fn glb(scene: &Scene) -> Result<Vec<u8>, ExportError> {
    let mut writer = Writer::new(scene);
    writer.meshes();
    writer.cameras();
    writer.lights();
    writer.changing_emission();
    writer.motion();
    writer.materials = scene.materials.iter().map(material).collect();
    if writer.materials.iter().any(|m| m.get("extensions").is_some()) {
        writer.used.push("KHR_materials_emissive_strength");
    }
    writer.finish()
}

/// The file around the two chunks, each padded to four bytes.
fn container(name: &str, json: Value, mut binary: Vec<u8>) -> Result<Vec<u8>, ExportError> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let bytes = 12 + 8 + text.len() + if binary.is_empty() { 0 } else { 8 + binary.len() };
    let too_large = || ExportError::TooLarge { name: name.to_owned(), bytes };
    let total = u32::try_from(bytes).map_err(|_| too_large())?;
    let mut file = Vec::with_capacity(bytes);
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(total.to_le_bytes());
    // Both chunks are shorter than the file, whose length fits.
    file.extend((text.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(&text);
    if !binary.is_empty() {
        file.extend((binary.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(&binary);
    }
    Ok(file)
}

/// The JSON document and the buffer as they grow.
pub(super) struct Writer<'a> {
    scene: &'a Scene,
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    pub(super) meshes: Vec<Value>,
    pub(super) nodes: Vec<Map<String, Value>>,
    children: Vec<Vec<usize>>,
    roots: Vec<usize>,
    pub(super) materials: Vec<Value>,
    cameras: Vec<Value>,
    lights: Vec<Value>,
    channels: Vec<Value>,
    samplers: Vec<Value>,
    /// Extensions in use.
    pub(super) used: Vec<&'static str>,
    /// What is said of the scene beside what the format has words for.
    pub(super) extras: Option<Value>,
}

impl<'a> Writer<'a> {
    /// Starts with the node tree of the scene, index for index.
    pub(super) fn new(scene: &'a Scene) -> Writer<'a> {
        let mut writer = Writer {
            scene,
            binary: Vec::new(),
            views: Vec::new(),
            accessors: Vec::new(),
            meshes: Vec::new(),
            nodes: Vec::new(),
            children: Vec::new(),
            roots: Vec::new(),
            cameras: Vec::new(),
            materials: Vec::new(),
            lights: Vec::new(),
            channels: Vec::new(),
            samplers: Vec::new(),
            used: Vec::new(),
            extras: None,
        };
        for node in &scene.motion.nodes {
            let index = writer.add_node(node.parent.map(|p| p.0 as usize), &node.name);
            let placement = placement(node, writer.above(node));
            writer.nodes[index].extend(placement);
        }
        writer
    }

    /// What the place of a node is told from: the origin of the file, for one that hangs on no other.
    fn above(&self, node: &Node) -> DVec3 {
        if node.parent.is_none() { self.scene.origin } else { DVec3::ZERO }
    }

    pub(super) fn add_node(&mut self, parent: Option<usize>, name: &str) -> usize {
        let index = self.nodes.len();
        self.nodes.push(Map::from_iter([("name".to_owned(), json!(name))]));
        self.children.push(Vec::new());
        match parent {
            Some(parent) => self.children[parent].push(index),
            None => {
                self.roots.push(index);
                self.nodes[index].extend(translated(self.scene.origin));
            }
        }
        index
    }

    /// The node `preferred` if it does not carry `key` yet, else a new child of it.
    fn free_node(&mut self, preferred: usize, key: &str, name: &str) -> usize {
        if self.nodes[preferred].contains_key(key) {
            self.add_node(Some(preferred), name)
        } else {
            preferred
        }
    }

    /// One mesh for each object of each body, one primitive for each of its surfaces.
    fn meshes(&mut self) {
        let scene = self.scene;
        // (body, object) -> surfaces; few objects a body, so a sorted list does.
        let mut objects: Vec<(BodyId, &str, Vec<SurfaceId>)> = Vec::new();
        for (index, surface) in scene.surfaces.iter().enumerate() {
            let id = SurfaceId(index as u32);
            match objects.iter_mut().find(|o| o.0 == surface.body && o.1 == surface.object) {
                Some(object) => object.2.push(id),
                None => objects.push((surface.body, &surface.object, vec![id])),
            }
        }
        let mut by_surface: Vec<Vec<&Patch>> = vec![Vec::new(); scene.surfaces.len()];
        for (index, patch) in scene.patches.iter().enumerate() {
            let written_by_twin = patch.twin.is_some_and(|twin| (twin.0 as usize) < index);
            if !written_by_twin {
                by_surface[patch.surface.0 as usize].push(patch);
            }
        }
        for (body, object, surfaces) in objects {
            let (node, body_from_object) = self.object_node(body, object);
            let primitives: Vec<Value> = surfaces
                .iter()
                .filter(|s| !by_surface[s.0 as usize].is_empty())
                .map(|s| {
                    let material = scene.surfaces[s.0 as usize].material.0;
                    self.primitive(&by_surface[s.0 as usize], material, body_from_object)
                })
                .collect();
            if !primitives.is_empty() {
                self.nodes[node].insert("mesh".into(), json!(self.meshes.len()));
                self.meshes.push(json!({ "name": object, "primitives": primitives }));
            }
        }
    }

    /// The node that carries an object's mesh, and the constant map from it to the body's frame.
    ///
    /// The object's own node; where there is none of its name (a scene put together by hand), a
    /// new one at the origin of the body's frame.
    pub(super) fn object_node(&mut self, body: BodyId, object: &str) -> (usize, Pose) {
        let motion = &self.scene.motion;
        let body_node = self.scene.bodies[body.0 as usize].node;
        let carrier = motion.anchor(body_node);
        let own = motion.nodes.iter().position(|n| n.name == object);
        if let Some(own) = own {
            let rides = motion.anchor(NodeId(own as u32)) == carrier;
            if rides && !self.nodes[own].contains_key("mesh") {
                return (own, body_from_node(&motion.nodes, own));
            }
        }
        (self.add_node(carrier.map(|node| node.0 as usize), object), Pose::IDENTITY)
    }

    /// Polygons of one surface as triangles with flat normals.
    fn primitive(&mut self, patches: &[&Patch], material: u32, body_from_object: Pose) -> Value {
        let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
        for patch in patches {
            let first = positions.len() as u32;
            let normal = body_from_object.inverse_direction(patch.frame.normal).normalize();
            for corner in patch.corners_in_body() {
                positions.push(body_from_object.inverse_point(corner).as_vec3().to_array());
                normals.push(normal.as_vec3().to_array());
            }
            for corner in 1..patch.corners.len() as u32 - 1 {
                indices.extend([first, first + corner, first + corner + 1]);
            }
        }
        let position = self.vec3_accessor(&positions, Some(ARRAY_BUFFER), true);
        let normal = self.vec3_accessor(&normals, Some(ARRAY_BUFFER), false);
        let view = self.view(indices.iter().flat_map(|i| i.to_le_bytes()), ELEMENT_ARRAY_BUFFER);
        let index = self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(),
            "type": "SCALAR"
        }));
        json!({
            "attributes": { "POSITION": position, "NORMAL": normal },
            "indices": index,
            "material": material
        })
    }

    pub(super) fn view(
        &mut self,
        bytes: impl IntoIterator<Item = u8>,
        target: impl Into<Option<u32>>,
    ) -> usize {
        let offset = self.binary.len();
        self.binary.extend(bytes);
        let mut view =
            json!({ "buffer": 0, "byteOffset": offset, "byteLength": self.binary.len() - offset });
        if let Some(target) = target.into() {
            view["target"] = json!(target);
        }
        self.views.push(view);
        self.views.len() - 1
    }

    pub(super) fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    pub(super) fn vec3_accessor(
        &mut self,
        values: &[[f32; 3]],
        target: Option<u32>,
        bounds: bool,
    ) -> usize {
        let bytes = values.iter().flatten().flat_map(|x| x.to_le_bytes());
        let view = self.view(bytes, target);
        let mut accessor = json!({
            "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": "VEC3"
        });
        if bounds {
            let fold = |start: f32, pick: fn(f32, f32) -> f32| {
                values.iter().fold([start; 3], |a, v| std::array::from_fn(|k| pick(a[k], v[k])))
            };
            accessor["min"] = json!(fold(f32::INFINITY, f32::min));
            accessor["max"] = json!(fold(f32::NEG_INFINITY, f32::max));
        }
        self.accessor(accessor)
    }

    pub(super) fn cameras(&mut self) {
        for camera in &self.scene.cameras {
            let mut value = match camera.projection {
                Projection::Perspective { yfov, aspect } => {
                    let mut lens = json!({ "yfov": yfov, "znear": CAMERA_NEAR_M });
                    if let Some(aspect) = aspect {
                        lens["aspectRatio"] = json!(aspect);
                    }
                    json!({ "type": "perspective", "perspective": lens })
                }
                Projection::Orthographic { xmag, ymag } => json!({
                    "type": "orthographic",
                    "orthographic": {
                        "xmag": xmag, "ymag": ymag, "znear": CAMERA_NEAR_M, "zfar": CAMERA_FAR_M
                    }
                }),
            };
            value["name"] = json!(camera.name);
            let node = self.free_node(camera.node.0 as usize, "camera", &camera.name);
            self.nodes[node].insert("camera".into(), json!(self.cameras.len()));
            self.cameras.push(value);
        }
    }

    fn lights(&mut self) {
        for light in &self.scene.lights {
            let node = self.free_node(light.node.0 as usize, "extensions", &light.name);
            let reference = json!({ "KHR_lights_punctual": { "light": self.lights.len() } });
            self.nodes[node].insert("extensions".into(), reference);
            self.lights.push(punctual(light));
        }
    }

    /// One more channel of the animation, with a sampler of its own.
    fn channel(&mut self, target: Value, [input, output]: [usize; 2], interpolation: &str) {
        let sampler = self.sampler([input, output], interpolation);
        self.channel_of(target, sampler);
    }

    pub(super) fn sampler(&mut self, [input, output]: [usize; 2], interpolation: &str) -> usize {
        self.samplers
            .push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        self.samplers.len() - 1
    }

    pub(super) fn channel_of(&mut self, target: Value, sampler: usize) {
        self.channels.push(json!({ "sampler": sampler, "target": target }));
    }

    /// Tracks of emissions.
    fn changing_emission(&mut self) {
        for (pointer, track, is_colour) in self.glows() {
            let input = self.times(&track.times_s);
            let values: Vec<[f32; 3]> =
                track.values.iter().map(|v| v.as_vec3().to_array()).collect();
            let output = match is_colour {
                true => self.vec3_accessor(&values, None, false),
                false => self.scalars(values.into_iter().map(|[v, ..]| v)),
            };
            let extensions = json!({ "KHR_animation_pointer": { "pointer": pointer } });
            let target = json!({ "path": "pointer", "extensions": extensions });
            self.channel(target, [input, output], name(track.interpolation));
        }
    }

    /// Tracks of nodes.
    pub(super) fn motion(&mut self) {
        let scene = self.scene;
        for (index, node) in scene.motion.nodes.iter().enumerate() {
            let target = |path: &str| json!({ "node": index, "path": path });
            if let Some(track) = &node.translation_track {
                let input = self.times(&track.times_s);
                let from = self.above(node);
                let is_cubic = track.interpolation == Interpolation::CubicSpline;
                let place = |(k, v): (usize, &DVec3)| {
                    let is_value = !is_cubic || k % 3 == 1;
                    let place = if is_value { from + *v } else { *v };
                    place.as_vec3().to_array()
                };
                let values: Vec<_> = track.values.iter().enumerate().map(place).collect();
                let output = self.vec3_accessor(&values, None, false);
                self.channel(target("translation"), [input, output], name(track.interpolation));
            }
            if let Some(track) = &node.rotation_track {
                let input = self.times(&track.times_s);
                let values = track.values.iter().flat_map(|q| q.as_quat().to_array());
                let view = self.view(values.flat_map(f32::to_le_bytes), None);
                let output = self.accessor(json!({
                    "bufferView": view, "componentType": FLOAT, "count": track.values.len(),
                    "type": "VEC4"
                }));
                self.channel(target("rotation"), [input, output], name(track.interpolation));
            }
            if !node.presence.is_empty() {
                let times: Vec<f64> = node.presence.iter().map(|key| key.0).collect();
                let input = self.times(&times);
                let values: Vec<[f32; 3]> =
                    node.presence.iter().map(|key| [f32::from(u8::from(key.1)); 3]).collect();
                let output = self.vec3_accessor(&values, None, false);
                self.channel(target("scale"), [input, output], name(Interpolation::Step));
            }
        }
    }

    /// Tracks of emissions with their pointers, and whether they are colours.
    fn glows(&self) -> Vec<(String, Track, bool)> {
        let mut out = Vec::new();
        let mut add = |lamp: Lamp, [colour, strength]: [String; 2]| {
            out.extend(lamp.colour_track.map(|track| (colour, track, true)));
            out.extend(lamp.strength_track.map(|track| (strength, track, false)));
        };
        for (k, material) in self.scene.materials.iter().enumerate() {
            let at = format!("/materials/{k}");
            let strength =
                format!("{at}/extensions/KHR_materials_emissive_strength/emissiveStrength");
            add(Lamp::of_material(material), [format!("{at}/emissiveFactor"), strength]);
        }
        for (k, light) in self.scene.lights.iter().enumerate() {
            let at = format!("/extensions/KHR_lights_punctual/lights/{k}");
            add(Lamp::of_light(light), [format!("{at}/color"), format!("{at}/intensity")]);
        }
        out
    }

    fn scalars(&mut self, values: impl ExactSizeIterator<Item = f32>) -> usize {
        let count = values.len();
        let view = self.view(values.flat_map(f32::to_le_bytes), None);
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": count, "type": "SCALAR"
        }))
    }

    pub(super) fn times(&mut self, times_s: &[f64]) -> usize {
        let times: Vec<f32> = times_s.iter().map(|t| *t as f32).collect();
        let view = self.view(times.iter().flat_map(|t| t.to_le_bytes()), None);
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": times.len(), "type": "SCALAR",
            "min": [times.first()], "max": [times.last()]
        }))
    }

    /// The bytes of the file.
    pub(super) fn finish(mut self) -> Result<Vec<u8>, ExportError> {
        for (node, children) in self.nodes.iter_mut().zip(&self.children) {
            if !children.is_empty() {
                node.insert("children".into(), json!(children));
            }
        }
        let mut used = self.used;
        if self.channels.iter().any(|channel| channel["target"]["path"] == "pointer") {
            used.push("KHR_animation_pointer");
        }
        let mut document = Map::new();
        document.insert(
            "asset".into(),
            json!({ "version": "2.0", "generator": concat!("relume ", env!("CARGO_PKG_VERSION")) }),
        );
        document.insert("scene".into(), json!(0));
        let mut scene = json!({ "name": self.scene.name });
        if !self.roots.is_empty() {
            scene["nodes"] = json!(self.roots);
        }
        if let Some(extras) = self.extras {
            scene["extras"] = extras;
        }
        document.insert("scenes".into(), json!([scene]));
        if !self.lights.is_empty() {
            used.push("KHR_lights_punctual");
            document.insert(
                "extensions".into(),
                json!({ "KHR_lights_punctual": { "lights": self.lights } }),
            );
        }
        if !self.binary.is_empty() {
            document.insert("buffers".into(), json!([{ "byteLength": self.binary.len() }]));
        }
        let is_still = self.channels.is_empty();
        // glTF has no empty arrays.
        let mut list = |key: &str, values: Vec<Value>| {
            if !values.is_empty() {
                document.insert(key.into(), Value::Array(values));
            }
        };
        list("nodes", self.nodes.into_iter().map(Value::Object).collect());
        list("meshes", self.meshes);
        list("materials", self.materials);
        list("cameras", self.cameras);
        let of_motion = self.scene.motion.animation.as_deref().unwrap_or("animation");
        let animation = json!({
            "name": of_motion, "channels": self.channels, "samplers": self.samplers
        });
        list("animations", if is_still { Vec::new() } else { vec![animation] });
        list("accessors", self.accessors);
        list("bufferViews", self.views);
        list("extensionsUsed", used.into_iter().map(Value::from).collect());
        container(&self.scene.name, Value::Object(document), self.binary)
    }
}

/// `translation`, unless it is none.
fn translated(by: DVec3) -> Option<(String, Value)> {
    (by != DVec3::ZERO).then(|| ("translation".to_owned(), json!(by.to_array())))
}

/// `rotation`, `translation` of a node that differ from the identity, from a place on.
fn placement(node: &Node, from: DVec3) -> Map<String, Value> {
    let mut map = Map::from_iter(translated(from + node.translation));
    if node.rotation != DQuat::IDENTITY {
        map.insert("rotation".into(), json!(node.rotation.normalize().to_array()));
    }
    map
}

fn material(material: &Material) -> Value {
    let [r, g, b] = material.reflectance;
    let mut value = json!({
        "name": material.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0
        }
    });
    let Lamp { colour, strength, strength_track, .. } = Lamp::of_material(material);
    if material.emits() {
        value["emissiveFactor"] = json!(colour);
    }
    if strength > 1.0 || strength_track.is_some() {
        value["extensions"] =
            json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
    }
    if material.double_sided {
        value["doubleSided"] = json!(true);
    }
    value
}

/// An emission as glTF states it: a colour in [0, 1] times a strength.
struct Lamp {
    colour: [f64; 3],
    strength: f64,
    colour_track: Option<Track>,
    strength_track: Option<Track>,
}

impl Lamp {
    fn of_material(material: &Material) -> Lamp {
        Lamp::new(material.exitance, material.glow.as_ref(), 1.0 / PI)
    }

    fn of_light(light: &Light) -> Lamp {
        Lamp::new(light.intensity, light.glow.as_ref(), PEAK_LUMENS_PER_WATT)
    }

    /// Of an emission in a unit that is `per_unit` of the file's.
    fn new(value: [f64; 3], glow: Option<&Glow>, per_unit: f64) -> Lamp {
        let Some(Glow { scale, tracks }) = glow else {
            let (colour, strength) = colour_and_strength(value.map(|v| v * per_unit));
            return Lamp { colour, strength, colour_track: None, strength_track: None };
        };
        // Of several tracks the first is the colour, and the others are strengths of all channels.
        let scale = DVec3::from_array(*scale) * per_unit;
        let [colour, strengths @ ..] = tracks.as_slice() else { unreachable!("a glow has tracks") };
        let times = |track: &Track, by: DVec3| {
            let values = track.values.iter().map(|&v| v * by).collect();
            Track { values, ..track.clone() }
        };
        let whole = times(colour, scale);
        let largest = whole.values.iter().fold(0.0_f64, |most, v| most.max(v.max_element()));
        let most = if strengths.is_empty() { largest.max(1.0) } else { largest };
        let colour_track = times(&whole, DVec3::splat(1.0 / most.max(f64::MIN_POSITIVE)));
        let strength_track = strengths.first().map(|track| times(track, DVec3::splat(most)));
        let strength = strength_track.as_ref().map_or(most, |track| track.at(0.0).x);
        let colour = colour_track.at(0.0).to_array();
        Lamp { colour, strength, colour_track: Some(colour_track), strength_track }
    }
}

/// `value = factor * strength` with each factor in [0, 1]; strength 1 where that is possible.
fn colour_and_strength(value: [f64; 3]) -> ([f64; 3], f64) {
    let largest = value.into_iter().fold(0.0, f64::max);
    if largest <= 0.0 {
        ([0.0; 3], 0.0)
    } else if largest <= 1.0 {
        (value, 1.0)
    } else {
        (value.map(|v| v / largest), largest)
    }
}

fn punctual(light: &Light) -> Value {
    let Lamp { colour, strength, .. } = Lamp::of_light(light);
    let mut value = json!({ "name": light.name, "color": colour, "intensity": strength });
    match light.kind {
        LightKind::Point => value["type"] = json!("point"),
        LightKind::Directional => value["type"] = json!("directional"),
        LightKind::Spot { inner, outer } => {
            value["type"] = json!("spot");
            value["spot"] = json!({ "innerConeAngle": inner, "outerConeAngle": outer });
        }
    }
    value
}

fn name(interpolation: Interpolation) -> &'static str {
    match interpolation {
        Interpolation::Linear => "LINEAR",
        Interpolation::Step => "STEP",
        Interpolation::CubicSpline => "CUBICSPLINE",
    }
}

/// Where a node sits in the frame of the body that it rides on: relative to the nearest animated
/// node at or above it, or to the world.
fn body_from_node(nodes: &[Node], node: usize) -> Pose {
    let get = |i: usize| &nodes[i];
    std::iter::successors(Some(get(node)), |n| n.parent.map(|p| get(p.0 as usize)))
        .take_while(|n| !n.animated())
        .fold(Pose::IDENTITY, |pose, n| {
            let local = Pose { rotation: DMat3::from_quat(n.rotation), translation: n.translation };
            local * pose
        })
}
