//! The same cube in every form that a file may take.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use super::gltf::{Gltf, cube_indices, cube_positions};
use super::{read, scene_of, with_code};
use relume_core::scene::Scene;

fn corners(scene: &Scene) -> Vec<[f64; 3]> {
    scene.patches.iter().flat_map(|p| p.corners_in_body()).map(|c| c.to_array()).collect()
}

/// The cube, whatever the order of its corners.
fn is_the_cube(scene: &Scene) {
    assert_eq!(scene.patches.len(), 6);
    assert!((scene.area_m2() - 6.0).abs() < 1e-12);
    let bounds = scene.bounds(0.0).unwrap();
    assert_eq!((bounds.lo.to_array(), bounds.hi.to_array()), ([0.0; 3], [1.0; 3]));
    for p in &scene.patches {
        assert!(p.frame.normal.dot(p.frame.origin - bounds.centre()) > 0.0);
    }
}

#[test]
fn external_embedded_and_binary_buffers() {
    let folder = tempfile::tempdir().unwrap();
    let g = Gltf::cube();
    let external = read(&g.write(folder.path(), "a")).unwrap();
    is_the_cube(&external);
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&g.bin));
    let embedded = read(&g.write_json(folder.path(), "b", json!(uri))).unwrap();
    std::fs::write(folder.path().join("with space.bin"), &g.bin).unwrap();
    let escaped = read(&g.write_json(folder.path(), "c", json!("with%20space.bin"))).unwrap();
    let binary = folder.path().join("d.glb");
    std::fs::write(&binary, g.glb()).unwrap();
    for other in [embedded, escaped, read(&binary).unwrap()] {
        assert_eq!(corners(&other), corners(&external));
    }
}

#[test]
fn plain_strided_sparse_and_quantised_positions() {
    let mut plain = Gltf::cube();
    plain.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    let triangles: Vec<f32> = cube_indices()
        .iter()
        .flat_map(|&i| cube_positions()[3 * i as usize..][..3].to_vec())
        .collect();
    let position = plain.floats("VEC3", &triangles);
    plain.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(position);
    is_the_cube(&scene_of(&plain).unwrap());

    let mut strided = Gltf::cube();
    let bytes: Vec<u8> = cube_positions()
        .chunks(3)
        .flat_map(|p| [p[0], p[1], p[2], 9.0])
        .flat_map(f32::to_le_bytes)
        .collect();
    let view = strided.view(&bytes);
    strided.json["bufferViews"][view]["byteStride"] = json!(16);
    strided.json["accessors"][0]["bufferView"] = json!(view);
    is_the_cube(&scene_of(&strided).unwrap());

    let mut sparse = Gltf::cube();
    let raised: Vec<u16> =
        (0..24).filter(|&v| cube_positions()[3 * v as usize..][..3] != [0.0; 3]).collect();
    let values: Vec<f32> =
        raised.iter().flat_map(|&v| cube_positions()[3 * v as usize..][..3].to_vec()).collect();
    let indices = sparse.view(&raised.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let values = sparse.view(&values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    sparse.json["accessors"][0] = json!({"componentType": 5126, "count": 24, "type": "VEC3", "sparse": {
        "count": raised.len(), "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": values}}});
    is_the_cube(&scene_of(&sparse).unwrap());

    for (code, normalized, largest, scale) in [(5121, true, 255, 1.0), (5120, false, 100, 0.01)] {
        let mut quantised = Gltf::cube();
        let bytes: Vec<u8> = cube_positions()
            .chunks(3)
            .flat_map(|p| [p[0], p[1], p[2], 0.0])
            .map(|c| c as u8 * largest)
            .collect();
        let view = quantised.view(&bytes);
        quantised.json["bufferViews"][view]["byteStride"] = json!(4);
        quantised.json["accessors"][0] = json!({"bufferView": view, "componentType": code,
            "normalized": normalized, "count": 24, "type": "VEC3"});
        quantised.json["nodes"][0]["scale"] = json!([scale, scale, scale]);
        quantised.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        is_the_cube(&scene_of(&quantised).unwrap());
    }
}

#[test]
fn strips_fans_lines_and_points() {
    let mut g = Gltf::new();
    let square = g.floats("VEC3", &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    let strip = g.shorts(&[0, 1, 3, 2]);
    let p = |mode: u32| json!({"attributes": {"POSITION": square}, "mode": mode, "material": 0});
    let mut of_strip = p(5);
    of_strip["indices"] = json!(strip);
    let primitives = json!([p(6), of_strip, p(1), p(0)]);
    let mesh = g.push("meshes", json!({"name": "mixed", "primitives": primitives}));
    g.node(json!({"mesh": mesh}));
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 2);
    assert!(scene.patches.iter().all(|p| p.frame.normal == glam::DVec3::Z && p.area_m2() == 1.0));
    assert_eq!(scene.bodies[0].name, "mixed");
    assert_eq!(with_code(&scene.notes, "not-triangles").len(), 2);
}

#[test]
fn harmless_extensions_are_ignored_quietly() {
    let mut g = Gltf::cube();
    g.json["extensionsUsed"] =
        json!(["KHR_materials_specular", "KHR_materials_ior", "ACME_anything"]);
    g.json["materials"][0]["extensions"] = json!({"KHR_materials_specular": {"specularFactor": 0}, "KHR_materials_ior": {"ior": 1.4}, "ACME_anything": 3});
    g.json["extras"] = json!({"anything": [1, 2, 3]});
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.notes, []);
}

#[test]
fn environments_of_files_are_named() {
    let mut g = Gltf::cube();
    assert!(with_code(&scene_of(&g).unwrap().notes, "environment").is_empty());
    g.json["extensionsUsed"] = json!(["KHR_lights_environment"]);
    let scene = scene_of(&g).unwrap();
    assert!(with_code(&scene.notes, "environment")[0].message.contains("`Sky::Environment`"));
}

#[test]
fn nodes_of_other_scenes_and_invisible_ones_are_left_out() {
    let mut g = Gltf::cube();
    g.push("nodes", json!({"name": "elsewhere", "mesh": 0}));
    let child = g.push("nodes", json!({"name": "child", "mesh": 0}));
    g.node(json!({"name": "hidden", "children": [child], "extensions": {"KHR_node_visibility": {"visible": false}}}));
    g.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.bodies.len(), 1);
    assert_eq!(with_code(&scene.notes, "invisible")[0].subject, "hidden");
    g.json.as_object_mut().unwrap().remove("scene");
    g.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(scene_of(&g).unwrap().bodies.len(), 2);
}

/// Extensions of other trades that change nothing of what is seen, and an origin that is elsewhere.
#[test]
fn what_is_required_and_changes_no_surface_is_read() {
    let mut g = Gltf::cube();
    g.json["extensionsRequired"] = json!(["EXT_structural_metadata", "MSFT_lod", "CESIUM_RTC"]);
    g.json["extensions"] = json!({"CESIUM_RTC": {"center": [100.0, -20.0, 3.0]}});
    let scene = scene_of(&g).unwrap();
    let bounds = scene.bounds(0.0).unwrap();
    assert_eq!(bounds.centre() + scene.origin, glam::DVec3::new(100.5, -19.5, 3.5));
}
