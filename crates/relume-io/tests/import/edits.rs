//! Scenes that are changed before they are built: materials that shine, nodes that are left out.

use std::f64::consts::PI;

use relume_core::scene::{Edits, Scene, SceneError};
use relume_io::{ImportOptions, import};
use serde_json::json;

use super::gltf::Gltf;

/// Two crates, one below the other in the tree, a light and a camera below the second.
fn file() -> Gltf {
    let mut g = Gltf::new();
    let mesh = g.cube_mesh();
    g.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 100.0}]}});
    g.json["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let bulb = g.push(
        "nodes",
        json!({"name": "bulb", "extensions": {"KHR_lights_punctual": {"light": 0}}}),
    );
    let eye = g.push("nodes", json!({"name": "eye", "camera": 0}));
    let inner =
        g.push("nodes", json!({"name": "inner crate", "mesh": mesh, "children": [bulb, eye]}));
    g.node(json!({"name": "outer crate", "mesh": mesh, "translation": [3, 0, 0]}));
    g.node(json!({"name": "group", "children": [inner]}));
    g
}

fn edited(gltf: &Gltf, edits: Edits) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    import(gltf.write(folder.path(), "scene"), &ImportOptions { edits, ..Default::default() })
}

fn hiding(names: &[&str]) -> Edits {
    Edits { hide: names.iter().map(|&n| n.to_owned()).collect(), ..Edits::default() }
}

#[test]
fn what_hangs_below_a_hidden_node_goes_with_it() {
    let names = |s: &Scene| s.bodies.iter().map(|b| b.name.clone()).collect::<Vec<_>>();
    let whole = edited(&file(), Edits::default()).unwrap();
    assert_eq!((whole.lights.len(), whole.cameras.len()), (1, 1));
    for name in ["group", "inner*", "*"] {
        let scene = edited(&file(), hiding(&[name]));
        if name == "*" {
            let text = scene.unwrap_err().to_string();
            assert_eq!(text, "everything that could be lit is hidden; hide less");
            continue;
        }
        let scene = scene.unwrap();
        assert_eq!(names(&scene), ["outer crate"], "{name}");
        assert_eq!((scene.lights.len(), scene.cameras.len()), (0, 0), "{name}");
    }
    let lamp_alone = edited(&file(), hiding(&["bulb"])).unwrap();
    assert_eq!((lamp_alone.bodies.len(), lamp_alone.lights.len()), (2, 0));
}

#[test]
fn a_material_shines_and_reflects_as_it_is_told() {
    let mut g = file();
    g.json["materials"][0]["emissiveFactor"] = json!([1.0, 0.0, 0.0]);
    let edits = Edits {
        emit: vec![("gr*y".to_owned(), [2.0, 0.0, 1.0])],
        reflect: vec![("grey".to_owned(), [0.25, 0.5, 0.0]), ("grey".to_owned(), [0.125; 3])],
        ..Edits::default()
    };
    let scene = edited(&g, edits).unwrap();
    assert_eq!(scene.materials[0].exitance, [2.0 * PI, 0.0, PI]);
    assert_eq!(scene.materials[0].reflectance, [0.125; 3]);
}

#[test]
fn names_that_fit_nothing_are_errors_with_those_that_are_there() {
    let text = edited(&file(), hiding(&["crate"])).unwrap_err().to_string();
    assert!(text.starts_with("no node is called `crate`; there are `"), "{text}");
    assert!(text.contains("`outer crate`"), "{text}");
    let emit =
        |name: &str, l: f64| Edits { emit: vec![(name.to_owned(), [l; 3])], ..Edits::default() };
    let text = edited(&file(), emit("gray", 1.0)).unwrap_err().to_string();
    assert!(text.starts_with("no material is called `gray`; there are `grey`; use"), "{text}");
    for radiance in [-1.0, f64::NAN, f64::INFINITY, 1e31] {
        let text = edited(&file(), emit("grey", radiance)).unwrap_err().to_string();
        assert!(text.contains("its radiance is to be"), "{text}");
    }
    let reflect = Edits { reflect: vec![("grey".to_owned(), [1.0; 3])], ..Edits::default() };
    let text = edited(&file(), reflect).unwrap_err().to_string();
    assert!(text.contains("its reflectance is to be 1"), "{text}");
}

#[test]
fn surfaces_of_view3d_are_hidden_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.vs3");
    let text = "F 3\nV 1 0 0 0\nV 2 1 0 0\nV 3 1 1 0\nV 4 0 1 0\nV 5 0 0 1\nV 6 1 0 1\nV 7 1 1 1\nV 8 0 1 1\n\
                S 1 1 2 3 4 0 0 0.5 low\nS 2 8 7 6 5 0 0 0.5 high\nEnd\n";
    std::fs::write(&path, text).unwrap();
    let options = ImportOptions { edits: hiding(&["high"]), ..Default::default() };
    let scene = import(&path, &options).unwrap();
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["low"]);
}
