//! Broken files: each kind is refused in words that name what and say what to do; none panics.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::gltf::Gltf;
use super::{read, scene_of, shipped, with_code};
use relume_io::{ImportOptions, import};

/// What is said about the cube after a change to its JSON.
fn refusal(change: impl FnOnce(&mut Value)) -> String {
    let mut g = Gltf::cube();
    change(&mut g.json);
    match scene_of(&g) {
        Ok(scene) => panic!("read as a scene of {} patches", scene.patches.len()),
        Err(e) => e.to_string(),
    }
}

fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn indices_out_of_range() {
    says(&refusal(|j| j["nodes"][0]["mesh"] = json!(7)), &["mesh 7", "does not exist"]);
    says(&refusal(|j| j["scenes"][0]["nodes"] = json!([0, 7])), &["node 7"]);
    says(&refusal(|j| j["scene"] = json!(3)), &["scene 3"]);
    says(&refusal(|j| j["nodes"][0]["children"] = json!([9])), &["node 9"]);
    says(&refusal(|j| j["nodes"][0]["camera"] = json!(1)), &["camera 1"]);
    says(
        &refusal(|j| j["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}})),
        &["light 0"],
    );
    let primitive =
        |j: &mut Value, key: &str, value: Value| j["meshes"][0]["primitives"][0][key] = value;
    says(&refusal(|j| primitive(j, "material", json!(1))), &["material 1"]);
    says(
        &refusal(|j| primitive(j, "indices", json!(9))),
        &["mesh `Cube`, primitive 0", "accessor 9"],
    );
    says(&refusal(|j| primitive(j, "mode", json!(7))), &["mesh `Cube`", "unknown mode 7"]);
    says(
        &refusal(|j| j["accessors"][0]["count"] = json!(20)),
        &["mesh `Cube`", "index", "20 vertices"],
    );
    says(
        &refusal(|j| j["accessors"][0]["count"] = json!(25)),
        &["mesh `Cube`", "25 elements", "288 bytes"],
    );
    says(&refusal(|j| j["accessors"][0]["count"] = json!(u64::MAX)), &["elements"]);
    says(&refusal(|j| j["accessors"][0]["bufferView"] = json!(5)), &["buffer view 5"]);
    says(&refusal(|j| j["accessors"][0]["byteOffset"] = json!(u64::MAX)), &["accessor 0"]);
    says(&refusal(|j| j["bufferViews"][0]["buffer"] = json!(2)), &["buffer 2"]);
    says(&refusal(|j| j["bufferViews"][0]["byteLength"] = json!(u64::MAX)), &["buffer view 0"]);
}

#[test]
fn wrong_types_and_versions() {
    says(
        &refusal(|j| j["nodes"][0]["mesh"] = json!("Cube")),
        &["nodes[0].mesh", "string \"Cube\"", "whole number"],
    );
    says(
        &refusal(|j| j["meshes"][0]["primitives"] = json!({})),
        &["meshes[0].primitives", "array"],
    );
    says(&refusal(|j| j["nodes"][0]["scale"] = json!([1, 1])), &["nodes[0].scale"]);
    says(&refusal(|j| j["nodes"][0]["mesh"] = json!(-1)), &["nodes[0].mesh", "-1"]);
    says(
        &refusal(|j| j["accessors"][0]["componentType"] = json!(5)),
        &["accessor 0", "component type 5"],
    );
    says(&refusal(|j| j["accessors"][0]["type"] = json!("VEC2")), &["should be VEC3 but is VEC2"]);
    says(
        &refusal(|j| j["accessors"][1]["componentType"] = json!(5126)),
        &["accessor 1", "unsigned"],
    );
    says(&refusal(|j| j["asset"]["version"] = json!("1.0")), &["version is 1.0", "glTF 2.0"]);
    says(&refusal(|j| j["asset"] = json!({})), &["asset.version"]);
    says(&refusal(|j| j["nodes"] = json!({"n": {}})), &["version is 1.0"]);
}

#[test]
fn extensions_that_cannot_be_read() {
    let needs = |e: &str| refusal(|j| j["extensionsRequired"] = json!([e]));
    says(&needs("ACME_voxels"), &["ACME_voxels", "export the scene again without it"]);
}

#[test]
fn trees_that_are_none() {
    says(&refusal(|j| j["nodes"][0]["children"] = json!([0])), &["node `crate`", "below itself"]);
    let cycle = refusal(|j| {
        j["nodes"] = json!([{"name": "a", "children": [1]}, {"name": "b", "children": [0]}]);
        j.as_object_mut().unwrap().remove("scenes");
        j.as_object_mut().unwrap().remove("scene");
    });
    says(&cycle, &["node `a`", "below itself"]);
    let shared = refusal(|j| {
        j["nodes"] = json!([{"name": "a", "children": [2]}, {"name": "b", "children": [2]}, {"name": "c", "mesh": 0}]);
        j["scenes"][0]["nodes"] = json!([0, 1]);
    });
    says(&shared, &["node `c`", "two parents"]);
}

#[test]
fn a_very_deep_tree_is_no_problem() {
    let mut g = Gltf::cube();
    let depth = 20_000;
    let nodes: Vec<Value> = (1..depth).map(|i| json!({"children": [i]})).collect();
    g.json["nodes"] = json!(nodes);
    g.push("nodes", json!({"name": "leaf", "mesh": 0}));
    assert_eq!(scene_of(&g).unwrap().patches.len(), 6);
}

#[test]
fn numbers_that_are_no_place() {
    let mut g = Gltf::cube();
    g.bin[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    says(&scene_of(&g).unwrap_err().to_string(), &["mesh `Cube`", "vertex 0", "NaN"]);
    says(
        &refusal(|j| j["nodes"][0]["rotation"] = json!([0, 0, 0, 0])),
        &["node `crate`", "rotation"],
    );
    let far =
        json!({"name": "crate", "mesh": 0, "translation": [1e308, 0, 0], "scale": [1e308, 1, 1]});
    says(&refusal(|j| j["nodes"][0] = far), &["crate", "1e308", "more than 1e12"]);
    says(
        &refusal(|j| j["materials"][0]["emissiveFactor"] = json!([-1, 0, 0])),
        &["material `grey`", "exitance"],
    );
    says(&refusal(|j| j["nodes"][0]["scale"] = json!([0, 0, 0])), &["no area"]);
    let mut g = Gltf::cube();
    g.animate("a", 0, "translation", "LINEAR", &[1.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    says(&scene_of(&g).unwrap_err().to_string(), &["crate", "do not ascend"]);
    let mut g = Gltf::cube();
    g.animate("a", 0, "rotation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0., 0., 0.]);
    says(&scene_of(&g).unwrap_err().to_string(), &["crate", "not a rotation"]);
    let mut g = Gltf::cube();
    g.animate("a", 0, "translation", "CUBICSPLINE", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    says(&scene_of(&g).unwrap_err().to_string(), &["crate", "need 6 values, not 2"]);
}

#[test]
fn files_that_are_missing_empty_or_something_else() {
    let folder = tempfile::tempdir().unwrap();
    let say = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        read(&path).unwrap_err().to_string()
    };
    says(
        &read(Path::new("no/such.glb")).unwrap_err().to_string(),
        &["no/such.glb", "check the path"],
    );
    says(&read(folder.path()).unwrap_err().to_string(), &["cannot read"]);
    says(&say("e.gltf", b""), &["e.gltf", "empty"]);
    says(&say("p.glb", b"\x89PNG\r\n"), &["neither like a .glb file nor like JSON"]);
    says(&say("j.gltf", b"{\"asset\": {\"version\": \"2.0\"}, \"nodes\": ["), &["cut off"]);
    says(&say("k.gltf", b"{\"asset\": nonsense}"), &["does not parse", "line 1"]);
    says(&say("v.glb", b"glTF\x01\0\0\0\x0C\0\0\0"), &["version is 1"]);
    says(&say("h.glb", b"glTF\x02\0\0\0\x0C\0\0\0"), &["no JSON chunk"]);
    let mut g = Gltf::cube();
    says(
        &read(&g.write_json(folder.path(), "m", json!("gone.bin"))).unwrap_err().to_string(),
        &["gone.bin", "buffer 0"],
    );
    let network = g.write_json(folder.path(), "n", json!("https://example.org/a.bin"));
    says(&read(&network).unwrap_err().to_string(), &["network", "download"]);
    let data = g.write_json(folder.path(), "d", json!("data:;base64,####"));
    says(&read(&data).unwrap_err().to_string(), &["buffer 0", "base64"]);
    g.json["buffers"] = json!([{"byteLength": 9999, "uri": "s.bin"}]);
    says(&read(&g.write(folder.path(), "s")).unwrap_err().to_string(), &["buffer 0", "9999 bytes"]);
    g.json["buffers"] = json!([{"byteLength": 8}]);
    says(
        &read(&g.write(folder.path(), "t")).unwrap_err().to_string(),
        &["buffer 0", "no binary chunk"],
    );
}

#[test]
fn numbers_that_cannot_be_computed_with_are_refused_with_their_name() {
    let node = |key: &str, value: Value| refusal(|j| j["nodes"][0][key] = value);
    says(&node("translation", json!([1e39, 0, 0])), &["node `crate`", "1e39", "more than 1e12"]);
    says(&node("translation", json!([0, 0, 1e155])), &["node `crate`", "1e155"]);
    says(&node("scale", json!([1e20, 1e20, 1e20])), &["node `crate`", "scale", "1e20"]);
    says(&node("scale", json!([1e-9, 1e-9, 1e-9])), &["`crate`", "1.7", "e-9 m large", "scale"]);
    let far = refusal(|j| {
        let links = json!({"scale": [1e9, 1e9, 1e9], "children": [1]});
        let crate_ = json!({"name": "crate", "mesh": 0, "scale": [1e9, 1e9, 1e9]});
        j["nodes"] = json!([links, crate_]);
    });
    says(&far, &["`crate`", "1e18", "further out"]);
    let bright = |key: &str, value: Value| refusal(|j| j["materials"][0][key] = value);
    says(&bright("emissiveFactor", json!([1e38, 0, 0])), &["material `grey`", "1e30"]);
    let lamp = refusal(|j| {
        j["extensions"] =
            json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1e300}]}});
        j["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    });
    says(&lamp, &["light `crate`", "1e30"]);
    let glow = |value: f32| {
        let mut g = Gltf::cube();
        let input = g.floats("SCALAR", &[0.0, 1.0]);
        let output = g.floats("VEC3", &[1.0, 1.0, 1.0, value, 1.0, 1.0]);
        let pointer = json!({"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}});
        let target = json!({"path": "pointer", "extensions": pointer});
        let samplers = json!([{"input": input, "output": output}]);
        let channels = json!([{"sampler": 0, "target": target}]);
        g.push("animations", json!({"samplers": samplers, "channels": channels}));
        scene_of(&g)
    };
    assert!(glow(1e20).is_ok());
    says(&glow(1e37).unwrap_err().to_string(), &["grey", "1e30"]);
}

#[test]
fn slivers_are_left_out_however_long_they_are() {
    let mut g = Gltf::cube();
    // As export leaves them along edges: a thousandth of a millimetre across, in a scene of some metres.
    g.node(
        json!({"name": "sliver", "mesh": 0, "scale": [0.05, 5e-7, 5e-7], "translation": [2, 0, 0]}),
    );
    g.node(json!({"name": "wire", "mesh": 0, "scale": [1, 2e-5, 2e-5], "translation": [4, 0, 0]}));
    let scene = scene_of(&g).unwrap();
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(names.contains(&"wire"), "{names:?}");
    let notes = with_code(&scene.notes, "speck");
    assert_eq!((notes[0].subject.as_str(), notes[0].count), ("sliver", 6));
}

#[test]
fn what_is_too_small_for_the_scene_is_left_out_by_name() {
    let mut g = Gltf::cube();
    g.node(
        json!({"name": "speck", "mesh": 0, "scale": [1e-7, 1e-7, 1e-7], "translation": [2, 0, 0]}),
    );
    g.node(json!({"name": "wall", "mesh": 0, "translation": [0, 4, 0]}));
    g.json["materials"][0]["doubleSided"] = json!(true);
    let scene = scene_of(&g).unwrap();
    assert_eq!((scene.bodies.len(), scene.surfaces.len(), scene.patches.len()), (2, 2, 24));
    let notes = with_code(&scene.notes, "speck");
    assert_eq!((notes[0].subject.as_str(), notes[0].count), ("speck", 12));
    for (k, patch) in scene.patches.iter().enumerate() {
        let body = &scene.bodies[patch.body.0 as usize];
        assert!(body.patches.contains(&(k as u32)));
        assert_eq!(scene.surfaces[patch.surface.0 as usize].name, body.name);
        let twin = patch.twin.unwrap();
        assert_eq!(scene.patches[twin.0 as usize].twin.unwrap().0, k as u32);
    }
}

#[test]
fn bodies_too_far_apart_for_their_sizes_are_named() {
    let mut g = Gltf::cube();
    g.node(json!({"name": "far", "mesh": 0, "translation": [1e8, 0, 0]}));
    let message = scene_of(&g).unwrap_err().to_string();
    assert!(message.contains("`far` are 1.000e8 m apart"), "{message}");
}

#[test]
fn a_uri_that_names_nothing_is_said() {
    let mut g = Gltf::cube();
    g.json["buffers"] = json!([{"byteLength": 4, "uri": ""}]);
    let message = scene_of(&g).unwrap_err().to_string();
    assert!(message.contains("buffer 0 names no file: its URI is empty"), "{message}");
}

#[test]
fn counts_without_data_are_refused_before_memory_is_asked_for() {
    let many = |count: u64| {
        refusal(|j| {
            j["accessors"][0].as_object_mut().unwrap().remove("bufferView");
            j["accessors"][0]["count"] = json!(count);
        })
    };
    says(&many(1 << 27), &["mesh `Cube`", "134217728", "without data"]);
    says(&many(u64::MAX), &["mesh `Cube`", "without data"]);
    let mut g = Gltf::cube();
    let attributes = json!({"TRANSLATION": g.push("accessors", json!({"componentType": 5126, "count": 1 << 20, "type": "VEC3"}))});
    g.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    says(&scene_of(&g).unwrap_err().to_string(), &["`crate`", "1048576 objects", "more than"]);
}

#[test]
fn what_lies_outside_the_scenes_folder_is_opened_only_if_asked_for() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("scene");
    std::fs::create_dir(&folder).unwrap();
    let g = Gltf::cube();
    std::fs::write(parent.path().join("cube.bin"), &g.bin).unwrap();
    std::fs::write(folder.join("cube.bin"), &g.bin).unwrap();
    let absolute = parent.path().join("cube.bin").display().to_string();
    for uri in
        ["../cube.bin", "%2e%2e/cube.bin", "%2E%2E%2Fcube.bin", "x/../../cube.bin", &absolute]
    {
        let file = g.write_json(&folder, "s", json!(uri));
        says(
            &read(&file).unwrap_err().to_string(),
            &["buffer 0", "outside", "`ImportOptions::allow_outside`"],
        );
    }
    let anywhere = ImportOptions { allow_outside: true, ..ImportOptions::default() };
    for uri in ["../cube.bin", &absolute] {
        let file = g.write_json(&folder, "s", json!(uri));
        assert_eq!(import(&file, &anywhere).unwrap().patches.len(), 6);
    }
    let file = g.write_json(&folder, "s", json!("../scene/cube.bin"));
    assert!(read(&file).is_err());
    let file = g.write_json(&folder, "s", json!("./x/../cube.bin"));
    assert!(std::fs::create_dir(folder.join("x")).is_ok() && read(&file).is_ok());
    // An image too.
    let mut g = Gltf::cube();
    g.json["images"] = json!([{"uri": "../wood.png"}]);
    g.json["textures"] = json!([{"source": 0}]);
    g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    says(
        &scene_of(&g).unwrap_err().to_string(),
        &["image 0", "wood.png", "`ImportOptions::allow_outside`"],
    );
}

#[cfg(unix)]
#[test]
fn pipes_are_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let made = std::process::Command::new("mkfifo").arg(folder.path().join("pipe")).status();
    if !made.is_ok_and(|status| status.success()) {
        println!("skipped: no mkfifo");
        return;
    }
    let file = Gltf::cube().write_json(folder.path(), "s", json!("pipe"));
    says(&read(&file).unwrap_err().to_string(), &["buffer 0", "a pipe, not a regular file"]);
}

#[test]
fn empty_scenes() {
    says(
        &refusal(|j| j["scenes"][0]["nodes"] = json!([])),
        &["scene `scene` has no polygon", "no nodes"],
    );
    says(
        &refusal(|j| j["meshes"][0]["primitives"][0]["mode"] = json!(1)),
        &["points or lines alone"],
    );
    says(
        &refusal(|j| j["nodes"][0] = json!({"name": "empty"})),
        &["none of its 1 nodes has a mesh"],
    );
}

#[test]
fn damage_anywhere_in_a_file_never_panics() {
    let whole = std::fs::read(shipped("box_room.glb")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("damaged.glb");
    let mut refused = 0;
    for cut in (0..whole.len()).step_by(7) {
        std::fs::write(&path, &whole[..cut]).unwrap();
        assert!(read(&path).is_err(), "a file cut off after {cut} bytes was read");
    }
    for place in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[place] = damaged[place].wrapping_add(1 + (place % 37) as u8);
        std::fs::write(&path, &damaged).unwrap();
        refused += usize::from(read(&path).is_err());
    }
    assert!(refused > whole.len() / 4, "{refused}");
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    for path in paths {
        match path.extension().and_then(|e| e.to_str()) {
            _ if path.is_dir() => files_below(&path, found),
            Some("gltf" | "glb") => found.push(path),
            _ => {}
        }
    }
}

/// What is said about each file of Debian's assimp-testmodels that is broken on purpose.
const ASSIMP: [(&str, &str); 15] = [
    ("BoxTextured-glTF-techniqueWebGL/BoxTextured.gltf", "KHR_technique_webgl"),
    ("BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb", "mesh `Mesh`: vertex 0 is at (-inf"),
    ("IndexOutOfRange/IndexOutOfRange.gltf", "mesh `Mesh`, primitive 0: index 255"),
    ("IndexOutOfRange/AllIndicesOutOfRange.gltf", "mesh `Mesh`, primitive 0: index 65535"),
    ("MissingBin/BoxTextured.gltf", "cannot read `BoxTextured0.bin`"),
    ("RecursiveNodes/RecursiveNodes.gltf", "below itself"),
    ("SchemaFailures/sceneWrongType.gltf", "at scene: invalid type: string \"hello\""),
    ("TestNoRootNode/NoScene.gltf", "scene 0 is referred to"),
    ("TestNoRootNode/SceneWithoutNodes.gltf", "there are no nodes"),
    ("wrongTypes/badArray.gltf", "at meshes[0].primitives"),
    ("wrongTypes/badObject.gltf", "at materials[0].pbrMetallicRoughness"),
    ("wrongTypes/badUint.gltf", "baseColorTexture.index"),
    ("Mesh_PrimitiveMode/Mesh_PrimitiveMode_00.gltf", "points or lines alone"),
    ("glTF/CesiumMilkTruck/CesiumMilkTruck.gltf", "its version is 1.0"),
    ("glTF/BoxTextured-glTF-Binary/BoxTextured.glb", "its version is 1"),
];

#[test]
fn assimp_models_are_read_or_refused_in_words() {
    let mut files = Vec::new();
    files_below(Path::new("/usr/share/assimp/models"), &mut files);
    if files.is_empty() {
        println!("skipped: Debian's assimp-testmodels is not installed");
        return;
    }
    for file in &files {
        let expected = ASSIMP.iter().find(|(name, _)| file.ends_with(name)).map(|e| e.1);
        match (read(file).map_err(|e| e.to_string()), expected) {
            (Ok(scene), None) => {
                let started = std::time::Instant::now();
                let found = relume_core::scene::check(&scene);
                println!(
                    "{}: {} patches, checked in {:?}",
                    file.display(),
                    scene.patches.len(),
                    started.elapsed()
                );
                found.iter().chain(&scene.notes).for_each(|n| {
                    println!(
                        "  {:?} {} `{}` x{}: {}",
                        n.severity, n.code, n.subject, n.count, n.message
                    );
                    assert!(!n.message.is_empty() && !n.subject.is_empty());
                });
            }
            (Ok(_), Some(words)) => panic!("{} was read, but should say: {words}", file.display()),
            (Err(said), expected) => says(&said, &[expected.unwrap_or(";")]),
        }
    }
}

/// What a camera looks at is read though the camera makes no picture; degrees in place of radians are taken as such.
#[test]
fn cameras_that_make_no_picture_are_left_out_or_mended() {
    let camera = |camera: Value| {
        let mut g = Gltf::cube();
        g.json["cameras"] = json!([camera]);
        g.json["nodes"][0]["camera"] = json!(0);
        let scene = scene_of(&g).unwrap();
        let said =
            with_code(&scene.notes, "camera").iter().map(|n| n.message.clone()).collect::<Vec<_>>();
        (scene.cameras.first().map(|c| c.projection), said.join("\n"))
    };
    let perspective = |yfov: f64| {
        camera(json!({"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.1}}))
    };
    let (seen, said) = perspective(45.0);
    let yfov = 45.0_f64.to_radians();
    assert_eq!(seen, Some(relume_core::scene::Projection::Perspective { yfov, aspect: None }));
    says(&said, &["45 rad", "taken as degrees"]);
    let (seen, said) = perspective(1.0);
    assert!(seen.is_some() && said.is_empty(), "{said}");
    for broken in [
        json!({"type": "perspective", "perspective": {"yfov": 0.0, "znear": 0.1}}),
        json!({"type": "perspective", "perspective": {"yfov": 400.0, "znear": 0.1}}),
        json!({"type": "orthographic", "orthographic": {"xmag": 0.0, "ymag": 1.0, "znear": 0, "zfar": 9}}),
        json!({"type": "perspective"}),
    ] {
        let (seen, said) = camera(broken);
        assert_eq!(seen, None);
        says(&said, &["left out", "choose a view"]);
    }
}

#[test]
fn too_many_polygons_are_told_by_their_mesh_and_how_often_it_is_shown() {
    let mut g = Gltf::new();
    let place = g.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let triangle = json!({"attributes": {"POSITION": place}, "material": 0});
    let mesh = g.push("meshes", json!({"name": "leaf", "primitives": vec![triangle; 4800]}));
    for k in 0..1000 {
        g.node(json!({"name": format!("tree {k}"), "mesh": mesh}));
    }
    let said = scene_of(&g).unwrap_err().to_string();
    assert!(said.contains("its mesh has 4800 and is shown 1000 times"), "{said}");
}
