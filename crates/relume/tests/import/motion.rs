//! Animations of a file as poses of bodies.

use glam::DVec3;
use relume::scene::{BodyId, ImportOptions, Scene, import};
use serde_json::json;

use super::gltf::Gltf;
use super::{scene_of, with_code};

fn at(scene: &Scene, time_s: f64) -> DVec3 {
    scene.pose(BodyId(0), time_s).unwrap().translation
}

#[test]
fn linear_step_and_cubic_translations() {
    let mut g = Gltf::cube();
    g.animate("a", 0, "translation", "LINEAR", &[1.0, 3.0], &[0., 0., 0., 4., 0., 0.]);
    let scene = scene_of(&g).unwrap();
    assert_eq!([0.0, 1.5, 9.0].map(|t| at(&scene, t).x), [0.0, 1.0, 4.0]);
    g.json["animations"][0]["samplers"][0]["interpolation"] = json!("STEP");
    let scene = scene_of(&g).unwrap();
    assert_eq!([1.5, 2.99, 3.0].map(|t| at(&scene, t).x), [0.0, 0.0, 4.0]);
    let mut g = Gltf::cube();
    // x = t^2 with its slopes.
    let values: Vec<f32> = [0., 0., 0., 0., 4., 4.].iter().flat_map(|&x| [x, 0.0, 0.0]).collect();
    g.animate(
        "a",
        0,
        "translation",
        "CUBICSPLINE",
        &[0.0, 2.0],
        &[&values[..9], &[4., 0., 0., 4., 0., 0., 0., 0., 0.]].concat(),
    );
    let scene = scene_of(&g).unwrap();
    assert!((at(&scene, 1.5).x - 2.25).abs() < 1e-12);
}

#[test]
fn all_animations_play_unless_one_is_chosen() {
    let mut g = Gltf::cube();
    let other = g.node(json!({"name": "other", "mesh": 0}));
    g.animate("slide", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    g.animate("lift", other, "translation", "LINEAR", &[0.0, 2.0], &[0., 0., 0., 0., 2., 0.]);
    g.animate("again", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 0., 0., 5.]);
    let folder = tempfile::tempdir().unwrap();
    let file = g.write(folder.path(), "s");
    let choose = |name: &str| import(&file, &ImportOptions { animation: Some(name.to_owned()) });
    let all = scene_of(&g).unwrap();
    assert_eq!((at(&all, 1.0), all.moves(BodyId(1)), all.motion.duration_s), (DVec3::X, true, 2.0));
    let conflict = with_code(&all.notes, "animation-conflict");
    assert!(
        conflict.len() == 1
            && conflict[0].subject == "crate"
            && conflict[0].message.contains("`again`")
    );
    let again = choose("again").unwrap();
    assert_eq!((at(&again, 1.0), again.moves(BodyId(1))), (DVec3::Z * 5.0, false));
    let message = choose("none such").unwrap_err().to_string();
    assert!(message.contains("none such") && message.contains("slide, lift, again"), "{message}");
}

#[test]
fn scales_are_constant_or_switch() {
    let with = |how: &str, times: &[f32], values: &[f32]| {
        let mut g = Gltf::cube();
        g.animate("a", 0, "scale", how, times, values);
        scene_of(&g)
    };
    let constant = with("LINEAR", &[0.0, 1.0], &[2., 3., 1., 2., 3., 1.]).unwrap();
    assert!(!constant.moves(BodyId(0)));
    assert_eq!(constant.bounds(0.0).unwrap().1, DVec3::new(2.0, 3.0, 1.0));
    let blinks = with("STEP", &[0.0, 1.0, 2.0], &[1., 1., 1., 0., 0., 0., 1., 1., 1.]).unwrap();
    assert_eq!([0.5, 1.5, 2.5].map(|t| blinks.pose(BodyId(0), t).is_some()), [true, false, true]);
    let grows = with("LINEAR", &[0.0, 1.0], &[1., 1., 1., 2., 2., 2.]).unwrap_err().to_string();
    assert!(grows.contains("`crate`") && grows.contains("scale changes"), "{grows}");
}

#[test]
fn growth_matters_only_where_a_mesh_hangs_below() {
    let mut g = Gltf::cube();
    let bone = g.node(json!({"name": "bone"}));
    g.animate("a", bone, "scale", "LINEAR", &[0.0, 1.0], &[1., 1., 1., 2., 2., 2.]);
    assert!(!scene_of(&g).unwrap().moves(BodyId(0)));
    let shape = g.push("nodes", json!({"name": "shape", "mesh": 0}));
    g.json["nodes"][bone]["children"] = json!([shape]);
    let grows = scene_of(&g).unwrap_err().to_string();
    assert!(grows.contains("`bone`") && grows.contains("scale changes"), "{grows}");
}

#[test]
fn visibility_pointers_are_presence_and_others_are_noted() {
    let mut g = Gltf::cube();
    let input = g.floats("SCALAR", &[0.0, 1.0]);
    let view = g.view(&[1, 0]);
    let output = g.push(
        "accessors",
        json!({"bufferView": view, "componentType": 5121, "count": 2, "type": "SCALAR"}),
    );
    let channel = |pointer: &str| json!({"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}});
    let colour = "/materials/0/pbrMetallicRoughness/baseColorFactor";
    g.push(
        "animations",
        json!({
            "channels": [channel("/nodes/0/extensions/KHR_node_visibility/visible"), channel(colour)],
            "samplers": [{"input": input, "output": output, "interpolation": "STEP"}],
        }),
    );
    g.json["extensionsRequired"] = json!(["KHR_animation_pointer", "KHR_node_visibility"]);
    let scene = scene_of(&g).unwrap();
    assert!(scene.pose(BodyId(0), 0.9).is_some() && scene.pose(BodyId(0), 1.0).is_none());
    assert_eq!(with_code(&scene.notes, "animation-pointer")[0].subject, colour);
}

#[test]
fn emission_pointers_are_colours_and_strengths_over_time() {
    let mut g = Gltf::cube();
    g.json["materials"] = json!([{
        "name": "lamp",
        "emissiveFactor": [1.0, 0.5, 0.0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}
    }]);
    g.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    g.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1.0, 0.5, 0.25], "intensity": 683.0}
    ]}});
    g.node(json!({"name": "bulb", "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    let input = g.floats("SCALAR", &[0.0, 2.0]);
    let colour = g.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let strength = g.floats("SCALAR", &[1.0, 3.0]);
    let channel = |sampler: usize, pointer: &str| json!({"sampler": sampler, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}});
    let emissive_strength =
        "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength";
    let intensity = "/extensions/KHR_lights_punctual/lights/0/intensity";
    g.push(
        "animations",
        json!({
            "name": "dusk",
            "channels": [channel(0, "/materials/0/emissiveFactor"), channel(1, intensity)],
            "samplers": [{"input": input, "output": colour}, {"input": input, "output": strength}],
        }),
    );
    g.json["extensionsRequired"] = json!(["KHR_animation_pointer"]);
    let pi = std::f64::consts::PI;
    let scene = scene_of(&g).unwrap();
    let lamp = &scene.materials[0];
    // The strength at rest stays; the colour at rest does not count.
    assert_eq!(lamp.exitance, [0.0; 3]);
    assert_eq!(lamp.exitance_at(1.0), [4.0 * pi; 3]);
    assert_eq!(lamp.most_exitance(), [8.0 * pi; 3]);
    assert_eq!(scene.motion.duration_s, 2.0);
    let bulb = scene.lights[0].intensity_at(1.0);
    let expected = [2.0, 1.0, 0.5].map(|x| x / 683.0);
    assert!((0..3).all(|c| (bulb[c] - expected[c]).abs() < 1e-12), "{bulb:?}");
    assert!(scene.lights[0].conversion.ends_with("it changes over time"));
    // Both at once.
    let second = channel(1, emissive_strength);
    g.json["animations"][0]["channels"].as_array_mut().unwrap().push(second.clone());
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.materials[0].exitance_at(1.0), [pi; 3]);
    // And once too often, or of nothing.
    g.json["animations"][0]["channels"].as_array_mut().unwrap().push(second);
    let scene = scene_of(&g).unwrap();
    assert_eq!(with_code(&scene.notes, "animation-conflict")[0].subject, emissive_strength);
    let missing = channel(0, "/materials/7/emissiveFactor");
    g.json["animations"][0]["channels"].as_array_mut().unwrap().push(missing);
    assert!(scene_of(&g).unwrap_err().to_string().contains('7'));
}

#[test]
fn skins_and_morphs_are_named() {
    let mut g = Gltf::cube();
    g.json["nodes"][0]["skin"] = json!(0);
    g.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}]);
    let scene = scene_of(&g).unwrap();
    for code in ["skin", "morph"] {
        assert_eq!(with_code(&scene.notes, code)[0].subject, "crate");
    }
}

#[test]
fn cameras_and_lights_ride_on_animated_nodes() {
    let mut g = Gltf::cube();
    let arm = g.node(json!({"name": "arm"}));
    let eye = g.push("nodes", json!({"name": "eye", "camera": 0, "translation": [0, 1, 0]}));
    g.json["nodes"][arm]["children"] = json!([eye]);
    g.json["nodes"][arm]["scale"] = json!([2, 2, 2]);
    g.json["cameras"] = json!([{"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1, "znear": 0, "zfar": 9}}]);
    g.animate("a", arm, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.bodies.len(), 1);
    let pose = scene.motion.pose(scene.cameras[0].node, 0.5).unwrap();
    assert_eq!(pose.translation, DVec3::new(0.5, 2.0, 0.0));
}
