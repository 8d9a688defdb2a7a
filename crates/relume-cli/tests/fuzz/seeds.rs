//! Valid files to begin with: one of each format, which between them use whatever is read.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::glb::{pack, unpack};

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Format {
    Glb,
    Gltf,
    View3d,
    Flat,
    Svg,
    Sensors,
    Obj,
    Stl,
    Ply,
}

impl Format {
    pub(crate) fn ending(self) -> &'static str {
        match self {
            Format::Glb => "glb",
            Format::Gltf => "gltf",
            Format::View3d => "vs3",
            Format::Flat => "flat",
            Format::Svg => "svg",
            Format::Sensors => "txt",
            Format::Obj => "obj",
            Format::Stl => "stl",
            Format::Ply => "ply",
        }
    }
}

/// A valid file.
pub(crate) struct Seed {
    pub(crate) name: &'static str,
    pub(crate) format: Format,
    pub(crate) content: Content,
}

/// What it holds.
pub(crate) enum Content {
    Text(String),
    Tree { json: Value, bin: Vec<u8> },
}

impl Seed {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        match &self.content {
            Content::Text(text) => text.clone().into_bytes(),
            Content::Tree { json, bin } => written(self.format, json, bin),
        }
    }
}

/// glTF as one file, with its bytes inside.
pub(crate) fn written(format: Format, json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.clone();
    let first = json.get_mut("buffers").and_then(|b| b.get_mut(0)).and_then(Value::as_object_mut);
    match (format, first) {
        (Format::Gltf, Some(buffer)) => {
            buffer.insert("uri".into(), json!(format!("data:;base64,{}", STANDARD.encode(bin))));
            serde_json::to_vec(&json).unwrap()
        }
        _ => pack(&json, bin),
    }
}

/// Buffers in the making.
#[derive(Default)]
struct Packed {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Packed {
    fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let (byte_offset, byte_length) = (self.bin.len(), bytes.len());
        self.bin.extend(bytes);
        self.views.push(json!({"buffer": 0, "byteOffset": byte_offset, "byteLength": byte_length}));
        self.views.len() - 1
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let parts = [("SCALAR", 1), ("VEC2", 2), ("VEC3", 3), ("VEC4", 4), ("MAT4", 16)];
        let parts = parts.iter().find(|p| p.0 == kind).unwrap().1;
        let count = values.len() / parts;
        self.accessors
            .push(json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    fn bytes(&mut self, kind: &str, count: usize, values: &[u8]) -> usize {
        let view = self.view(values);
        self.accessors
            .push(json!({"bufferView": view, "componentType": 5121, "count": count, "type": kind}));
        self.accessors.len() - 1
    }
}

/// Corners of a box, four for each side, counter-clockwise from outside.
fn cuboid([x, y, z]: [f32; 3]) -> Vec<f32> {
    let sides =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let corner = |c: u8| [f32::from(c & 1) * x, f32::from(c >> 1 & 1) * y, f32::from(c >> 2) * z];
    sides.iter().flatten().flat_map(|&c| corner(c)).collect()
}

fn indices(inward: bool) -> Vec<u8> {
    let order = if inward { [0, 2, 1, 0, 3, 2] } else { [0, 1, 2, 0, 2, 3] };
    (0..6).flat_map(|s| order.map(|k| 4 * s + k)).collect()
}

/// A small picture with alpha.
fn picture() -> Vec<u8> {
    let pixel =
        |x: u32, y: u32| image::Rgba([(x * 40) as u8, (y * 50) as u8, 99, (x * y * 20) as u8]);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbaImage::from_fn(6, 5, pixel);
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A room with a lamp and a box that use all that is read of glTF.
// Over 60 lines: one document, which says less in parts.
fn room() -> (Value, Vec<u8>) {
    let mut p = Packed::default();
    let (inner, outer) =
        (p.bytes("SCALAR", 36, &indices(true)), p.bytes("SCALAR", 36, &indices(false)));
    let room = p.floats("VEC3", &cuboid([2.0, 2.0, 2.0]));
    let crate_ = p.floats("VEC3", &cuboid([0.5, 0.5, 0.5]));
    let lift = p.floats("VEC3", &[0.0, 0.25, 0.0].repeat(24));
    let lamp = p.floats("VEC3", &[0., 0., 0., 0.5, 0., 0., 0.5, 0., 0.5, 0., 0., 0.5]);
    let places = p.floats("VEC2", &[0.1, 0.2, 2.5, 0.2, 2.5, -0.6, 0.1, 0.9]);
    let fan =
        json!({"attributes": {"POSITION": lamp, "TEXCOORD_1": places}, "mode": 6, "material": 1});
    let sides = p.floats("VEC2", &[0., 0., 1., 0., 1., 1., 0., 1.].repeat(6));
    let colours = p.floats("VEC4", &[1.0, 0.5, 0.2, 1.0, 0.3, 1.0, 0.9, 0.8].repeat(12));
    let image = p.view(&picture());
    let joints = p.bytes("VEC4", 24, &[0; 96]);
    let weights = p.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(24));
    let bind = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    let bind = p.floats("MAT4", &bind);
    let times = p.floats("SCALAR", &[0.0, 0.5, 1.0]);
    let slide = p.floats("VEC3", &[1.2, 0.1, 0.2, 1.2, 0.1, 0.6, 1.2, 0.1, 1.2]);
    let h = std::f32::consts::FRAC_1_SQRT_2;
    let turn = p.floats("VEC4", &[0., 0., 0., 1., 0., h, 0., h, 0., 1., 0., 0.]);
    let blink = p.floats("VEC3", &[1., 1., 1., 0., 0., 0., 1., 1., 1.]);
    let still = p.floats("SCALAR", &[0.5; 3]);
    let glow = p.floats("VEC3", &[1., 1., 1., 0.5, 0.5, 0., 1., 1., 1.]);
    let rows = p.floats("VEC3", &[0., 0., 0., 0.3, 0., 0.]);
    let place = p.view(&[0]);
    let far = p.view(&[0_f32, 0.0, 0.4].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    p.accessors
        .push(json!({"componentType": 5126, "count": 2, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": place, "componentType": 5121}, "values": {"bufferView": far}}}));
    let sparse = p.accessors.len() - 1;
    let solid = |position: usize, indices: usize, material: usize| json!({"attributes": {"POSITION": position}, "indices": indices, "material": material});
    let mut morph = solid(crate_, outer, 2);
    morph["attributes"]["TEXCOORD_0"] = json!(sides);
    morph["attributes"]["COLOR_0"] = json!(colours);
    morph["targets"] = json!([{"POSITION": lift}]);
    let mut skin = solid(crate_, outer, 0);
    skin["attributes"]["JOINTS_0"] = json!(joints);
    skin["attributes"]["WEIGHTS_0"] = json!(weights);
    let instanced =
        |at: usize| json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": at}}});
    let pointer = |p: &str| json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": p}}});
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2, 4, 5, 6, 7, 8, 9]}],
        "extensionsUsed": ["KHR_lights_punctual", "EXT_mesh_gpu_instancing"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "color": [1, 1, 1], "intensity": 300, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.7}}]}},
        "nodes": [
            {"name": "room", "mesh": 0},
            {"name": "lamp", "mesh": 1, "translation": [0.7, 1.9, 0.7]},
            {"name": "group", "scale": [-1, 1, 1], "translation": [2, 0, 0], "children": [3]},
            {"name": "crate", "mesh": 2, "translation": [1.2, 0.1, 0.2], "weights": [0.5]},
            {"name": "camera", "camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 1, 1.9, 1]},
            {"name": "sun", "translation": [1, 1.5, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "bone", "translation": [0.2, 0.1, 1.3]},
            {"name": "robot", "mesh": 3, "skin": 0},
            {"name": "row", "mesh": 4, "translation": [0.1, 0.3, 0.1], "extensions": instanced(rows)},
            {"name": "rows", "mesh": 4, "translation": [0.1, 0.9, 0.1], "extensions": instanced(sparse)}
        ],
        "skins": [{"joints": [6], "inverseBindMatrices": bind}],
        "meshes": [
            {"name": "room", "primitives": [solid(room, inner, 0)]},
            {"name": "lamp", "primitives": [fan.clone()]},
            {"name": "crate", "primitives": [morph], "weights": [0]},
            {"name": "robot", "primitives": [skin]},
            {"name": "shelf", "primitives": [{"attributes": {"POSITION": lamp}, "mode": 6, "material": 2}]}
        ],
        "materials": [
            {"name": "wall", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.6, 0.7, 1]}},
            {"name": "light", "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "extensions":
                {"KHR_texture_transform": {"offset": [0.2, 0.1], "rotation": 0.4, "scale": [2, 1], "texCoord": 1}}},
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}},
            {"name": "red", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.4, "pbrMetallicRoughness":
                {"baseColorFactor": [0.7, 0.1, 0.1, 1], "baseColorTexture": {"index": 0, "texCoord": 0}}}
        ],
        "textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1.5}}],
        "animations": [{"name": "all",
            "samplers": [
                {"input": times, "output": slide}, {"input": times, "output": turn},
                {"input": times, "output": blink, "interpolation": "STEP"},
                {"input": times, "output": still}, {"input": times, "output": glow}],
            "channels": [
                {"sampler": 0, "target": pointer("/nodes/3/translation")},
                {"sampler": 1, "target": {"node": 3, "path": "rotation"}},
                {"sampler": 2, "target": {"node": 6, "path": "scale"}},
                {"sampler": 3, "target": {"node": 3, "path": "weights"}},
                {"sampler": 4, "target": pointer("/materials/1/emissiveFactor")}]}],
        "accessors": p.accessors, "bufferViews": p.views, "buffers": [{"byteLength": p.bin.len()}],
    });
    (json, p.bin)
}

pub(crate) fn room_glb() -> Vec<u8> {
    let (json, bin) = room();
    pack(&json, &bin)
}

pub(crate) const SENSORS: &str = "# on the floor\n0.3 0.01 0.3 0 1 0\n1.7 1.0 1.7 -1 0 -1\n";

const TABLE: &str =
    "name,body,x,y,z,nx,ny,nz\ndesk,,0.3,0.2,1.0,0,1,0\n\"on, it\",room,1.9,1,1.8,-1,0,0\n";

const VIEW3D: &str = "T box\nC eps=1.0e-4 encl=1\nF 3\nV 1 0 0 0\nV 2 2 0 0\nV 3 2 2 0\nV 4 0 2 0\n\
V 5 0 0 1\nV 6 2 0 1\nV 7 2 2 1\nV 8 0 2 1\nV 9 0.5 0.5 0\nV 10 1 0.5 0\nV 11 1 1 0\nV 12 0.5 1 0\n\
S 1 1 2 3 4 0 0 0.9 floor\nS 2 8 7 6 5 0 0 0.9 top\nS 3 1 5 6 2 0 0 0.5 south\nS 4 2 6 7 3 0 0 0.5 east\n\
S 5 3 7 8 4 0 3 0.5 north\nS 6 4 8 5 1 0 0 0.5 west\nS 7 9 10 11 12 1 0 0.3 hatch\nEnd of data\n";

const FLAT: &str = "segment floor 0 0 2 0 reflectance 0.6 # grey\nsegment right 2 0 2 2 reflectance 0.5,0.2,0.1\n\
segment top 2 2 0 2 emit 1\nsegment left 0 2 0 0\nbody box\nat 0 1 1\nat 1 1.2 1.4 90\n\
polygon box -0.2 -0.2 -0.2 0.2 0.2 0.2 0.2 -0.2 reflectance 0.8\nbody blade\nat 0 0.5 0.5\nat 2 0.5 1.5\n\
segment blade -0.2 0 0.2 0 two-sided emit 2,0,1\n";

const SVG: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" data-units-per-metre="100">
<g id="room" data-reflectance="0.5" data-front="inside"><rect id="walls" x="0" y="0" width="200" height="200"/></g>
<g id="lamp" transform="translate(50 20) rotate(10)" data-emit="2,1,1"><line x1="0" y1="0" x2="-40" y2="0"/></g>
<g id="box" data-front="outside"><animateTransform attributeName="transform" type="translate" values="100 100; 140 120" keyTimes="0; 1" dur="2s"/>
<polygon points="-20,-20 20,-20 20,20 -20,20"/></g>
<g><path d="M 20 150 l 30 0 L 60 170 h 5 v -5" data-two-sided="true"/><polyline points="150,20 170,30 180,50"/></g>
</svg>
"#;

const OBJ: &str = "mtllib missing.mtl\no floor\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nusemtl red\nf 1 2 3 4 5\n\
g lamp\nv 0 0 3\nv 1 0 3\nv 1 1 3\nv 0 1 3\nvt 0 1\nvn 0 0 1\nf -1/1/1 -2/1/1 -3/1/1 -4/1/1\nf 6//1 7//1 8//1\nl 1 2\np 1\n";

const STL: &str = "solid roof\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0.5\nendloop\nendfacet\n\
facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 1e-1\nvertex 0 1 0.5\nendloop\nendfacet\nendsolid roof\n";

const PLY: &str = "ply\nformat ascii 1.0\ncomment roof\nelement vertex 5\nproperty float x\nproperty double y\nproperty int z\n\
property uchar red\nelement face 2\nproperty list uchar int vertex_indices\nelement edge 1\nproperty list char float a\nend_header\n\
0 0 0 1\n2 0 0 2\n2 2 0 3\n1 0.5 0 4\n0 2 1 5\n4 0 1 2 3\n3 0 3 4\n2 1.5 2\n";

/// The room without its animation, in light of pictures all around.
fn surrounded() -> Seed {
    let (mut json, bin) = room();
    json.as_object_mut().expect("a document is an object").remove("animations");
    json["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
    let coefficients = vec![[1.0, 0.9, 0.8]; 9];
    let faces = vec![vec![0; 6]; 2];
    json["extensions"]["EXT_lights_image_based"] = json!({"lights": [{"intensity": 0.5,
        "rotation": [0.1, 0.2, 0.3, 0.9], "irradianceCoefficients": coefficients,
        "specularImageSize": 6, "specularImages": faces}]});
    Seed { name: "surrounded", format: Format::Gltf, content: Content::Tree { json, bin } }
}

/// A ring whose mesh is stored compressed, from the tests of the reader.
fn ring(name: &'static str, file: &[u8]) -> Seed {
    let (json, bin) = unpack(file);
    Seed { name, format: Format::Glb, content: Content::Tree { json, bin } }
}

/// All of them.
pub(crate) fn all() -> Vec<Seed> {
    let tree = |name, format| {
        let (json, bin) = room();
        Seed { name, format, content: Content::Tree { json, bin } }
    };
    let text =
        |name, format, text: &str| Seed { name, format, content: Content::Text(text.to_owned()) };
    vec![
        tree("room.glb", Format::Glb),
        tree("room.glb again: it holds the most", Format::Glb),
        tree("room.gltf", Format::Gltf),
        surrounded(),
        text("box.vs3", Format::View3d, VIEW3D),
        text("room.flat", Format::Flat, FLAT),
        text("room.svg", Format::Svg, SVG),
        text("sensors", Format::Sensors, SENSORS),
        text("table of sensors", Format::Sensors, TABLE),
        text("room.obj", Format::Obj, OBJ),
        text("roof.stl", Format::Stl, STL),
        text("roof.ply", Format::Ply, PLY),
        ring(
            "draco, in order",
            include_bytes!("../../../relume-io/tests/data/packed/ring-draco-sequential.glb"),
        ),
        ring(
            "draco, standard",
            include_bytes!("../../../relume-io/tests/data/packed/ring-draco-standard.glb"),
        ),
        ring(
            "draco, valence",
            include_bytes!("../../../relume-io/tests/data/packed/ring-draco-valence.glb"),
        ),
        ring(
            "meshopt, older",
            include_bytes!("../../../relume-io/tests/data/packed/ring-meshopt-ext.glb"),
        ),
        ring(
            "meshopt, newer",
            include_bytes!("../../../relume-io/tests/data/packed/ring-meshopt-khr.glb"),
        ),
    ]
}
