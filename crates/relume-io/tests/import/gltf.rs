//! Writes small glTF files for the tests: JSON with one binary buffer.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

/// A glTF file in the making; `json` may be changed freely before writing.
pub(crate) struct Gltf {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

impl Gltf {
    /// A valid file with no nodes.
    pub(crate) fn new() -> Gltf {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "materials": [{"name": "grey", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.4, 0.3, 1.0]}}],
            "accessors": [], "bufferViews": [], "animations": [],
        });
        Gltf { json, bin: Vec::new() }
    }

    /// One node `crate` with a unit cube, vertices split, indexed.
    pub(crate) fn cube() -> Gltf {
        let mut g = Gltf::new();
        let mesh = g.cube_mesh();
        g.node(json!({"name": "crate", "mesh": mesh}));
        g
    }

    /// Appends to an array of the JSON; the new index.
    pub(crate) fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// A root node.
    pub(crate) fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// A buffer view of these bytes.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.push(
            "bufferViews",
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        )
    }

    pub(crate) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "MAT4" => 16,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let count = values.len() / components;
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind}),
        )
    }

    pub(crate) fn shorts(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let count = values.len();
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5123, "count": count, "type": "SCALAR"}),
        )
    }

    pub(crate) fn cube_mesh(&mut self) -> usize {
        let position = self.floats("VEC3", &cube_positions());
        let indices = self.shorts(&cube_indices());
        let primitive =
            json!({"attributes": {"POSITION": position}, "indices": indices, "material": 0});
        self.push("meshes", json!({"name": "Cube", "primitives": [primitive]}))
    }

    /// Animates one property of a node.
    pub(crate) fn animate(
        &mut self,
        name: &str,
        node: usize,
        path: &str,
        how: &str,
        times: &[f32],
        values: &[f32],
    ) {
        let input = self.floats("SCALAR", times);
        let output = self.floats(if path == "rotation" { "VEC4" } else { "VEC3" }, values);
        self.push(
            "animations",
            json!({
                "name": name,
                "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
                "samplers": [{"input": input, "output": output, "interpolation": how}],
            }),
        );
    }

    /// As `NAME.gltf` with `NAME.bin` beside it.
    pub(crate) fn write(&self, folder: &Path, name: &str) -> PathBuf {
        std::fs::write(folder.join(format!("{name}.bin")), &self.bin).unwrap();
        self.write_json(folder, name, json!(format!("{name}.bin")))
    }

    /// As `NAME.gltf` whose buffer is at `uri`.
    pub(crate) fn write_json(&self, folder: &Path, name: &str, uri: Value) -> PathBuf {
        let mut json = self.json.clone();
        if json.get("buffers").is_none() {
            json["buffers"] = json!([{"byteLength": self.bin.len(), "uri": uri}]);
        }
        let path = folder.join(format!("{name}.gltf"));
        std::fs::write(&path, serde_json::to_vec(&json).unwrap()).unwrap();
        path
    }

    /// As one .glb file.
    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        let mut text = serde_json::to_vec(&json).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let word = |n: usize| (n as u32).to_le_bytes();
        let total = word(12 + 8 + text.len() + 8 + bin.len());
        [
            &b"glTF"[..],
            &word(2),
            &total,
            &word(text.len()),
            b"JSON",
            &text,
            &word(bin.len()),
            b"BIN\0",
            &bin,
        ]
        .concat()
    }
}

/// Corners of a unit cube, four for each side, counter-clockwise from outside.
pub(crate) fn cube_positions() -> Vec<f32> {
    let sides =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let bit = |corner: u8, axis: u8| f32::from(corner >> axis & 1);
    sides.iter().flatten().flat_map(|&c| [bit(c, 0), bit(c, 1), bit(c, 2)]).collect()
}

pub(crate) fn cube_indices() -> Vec<u16> {
    (0..6).flat_map(|s| [0, 1, 2, 0, 2, 3].map(|k| 4 * s + k)).collect()
}
