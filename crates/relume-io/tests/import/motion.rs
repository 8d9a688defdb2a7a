//! Animations of a file as poses of bodies.

use std::sync::Arc;

use glam::DVec3;
use relume_core::geometry::Aabb;
use relume_core::scene::outside::{Outside, Sky};
use relume_core::scene::{BodyId, Scene, Severity};
use relume_core::session::{Options, Session, compare};
use relume_io::{ImportOptions, Instants, import};
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
    let choose = |name: &str| {
        import(&file, &ImportOptions { animation: Some(name.to_owned()), ..Default::default() })
    };
    let all = scene_of(&g).unwrap();
    assert_eq!((at(&all, 1.0), all.moves(BodyId(1)), all.motion.duration_s), (DVec3::X, true, 2.0));
    let others = with_code(&all.notes, "other-animations");
    assert!(
        others.len() == 1 && others[0].message.contains("1 others do not: again;"),
        "{:?}",
        all.notes
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
    assert_eq!(constant.bounds(0.0).unwrap().hi, DVec3::new(2.0, 3.0, 1.0));
    let blinks = with("STEP", &[0.0, 1.0, 2.0], &[1., 1., 1., 0., 0., 0., 1., 1., 1.]).unwrap();
    assert_eq!([0.5, 1.5, 2.5].map(|t| blinks.pose(BodyId(0), t).is_some()), [true, false, true]);
    // What grows otherwise is held at its first size, and moves on.
    let mut g = Gltf::cube();
    g.animate("a", 0, "scale", "LINEAR", &[0.0, 1.0], &[2., 2., 2., 3., 1., 3.]);
    g.animate("b", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 4., 0., 0.]);
    let channel = g.json["animations"][1]["channels"][0].clone();
    let sampler = g.json["animations"][1]["samplers"][0].clone();
    g.json["animations"][0]["channels"].as_array_mut().unwrap().push(channel);
    g.json["animations"][0]["channels"][1]["sampler"] = json!(1);
    g.json["animations"][0]["samplers"].as_array_mut().unwrap().push(sampler);
    let grows = scene_of(&g).unwrap();
    let wanted = Aabb { lo: DVec3::X * 4.0, hi: DVec3::new(6.0, 2.0, 2.0) };
    assert_eq!(grows.bounds(1.0).unwrap(), wanted);
    let held = with_code(&grows.notes, "held-size");
    assert!(
        held.len() == 1
            && held[0].subject == "crate"
            && held[0].message.contains("[2.0, 2.0, 2.0]")
    );
    // What grows out of nothing is there from halfway on.
    let born = with("LINEAR", &[0.0, 1.0], &[0., 0., 0., 2., 2., 2.]).unwrap();
    assert_eq!([0.4, 0.6].map(|t| born.pose(BodyId(0), t).is_some()), [false, true]);
    assert_eq!(born.bounds(1.0).unwrap().hi, DVec3::splat(2.0));
    let short = with("LINEAR", &[0.0, 1.0], &[1., 1., 1.]).unwrap_err().to_string();
    assert!(short.contains("`crate`") && short.contains("2 key times need 2 values"), "{short}");
}

#[test]
fn growth_matters_only_where_a_mesh_hangs_below() {
    let mut g = Gltf::cube();
    let bone = g.node(json!({"name": "bone"}));
    g.animate("a", bone, "scale", "LINEAR", &[0.0, 1.0], &[1., 1., 1., 2., 2., 2.]);
    let quiet = scene_of(&g).unwrap();
    assert!(!quiet.moves(BodyId(0)) && with_code(&quiet.notes, "held-size").is_empty());
    let shapes = json!([
        g.push("nodes", json!({"name": "shape", "mesh": 0, "translation": [5, 0, 0]})),
        g.push("nodes", json!({"name": "twin", "mesh": 0, "translation": [7, 0, 0]})),
    ]);
    g.json["nodes"][bone]["children"] = shapes;
    let grows = scene_of(&g).unwrap();
    let held = with_code(&grows.notes, "held-size");
    assert_eq!((held.len(), held[0].subject.as_str()), (1, "bone"));
    assert_eq!(grows.bounds(1.0).unwrap().hi, DVec3::new(8.0, 1.0, 1.0));
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

/// A file whose cube slides by these keys, one a frame.
fn stepping(fps: f64, keys: u16) -> Gltf {
    let mut g = Gltf::cube();
    let times: Vec<f32> = (0..keys).map(|k| (f64::from(k) / fps) as f32).collect();
    let values: Vec<f32> = (0..keys).flat_map(|k| [f32::from(k), 0.0, 0.0]).collect();
    g.animate("a", 0, "translation", "STEP", &times, &values);
    g
}

#[test]
fn a_step_key_is_shown_in_its_own_frame_at_any_rate() {
    let television = [24_000.0 / 1001.0, 30_000.0 / 1001.0, 23.976, 29.97];
    for fps in [24.0, 72.0, 90.0, 37.3].into_iter().chain(television) {
        let scene = scene_of(&stepping(fps, 400)).unwrap();
        for k in 0..400 {
            assert_eq!(at(&scene, f64::from(k) / fps).x, f64::from(k), "{fps}");
        }
    }
}

#[test]
fn a_clip_lasts_to_its_last_key_whether_anything_changes_there_or_not() {
    let mut g = Gltf::cube();
    let other = g.node(json!({"name": "other", "mesh": 0}));
    g.animate("slide", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    g.animate("rest", other, "translation", "LINEAR", &[0.0, 2.0], &[0.; 6]);
    assert_eq!(scene_of(&g).unwrap().motion.duration_s, 2.0);
    g.animate(
        "gone",
        other,
        "scale",
        "STEP",
        &[0.0, 0.5, 3.0],
        &[1., 1., 1., 0., 0., 0., 0., 0., 0.],
    );
    assert_eq!(scene_of(&g).unwrap().motion.duration_s, 3.0);
    g.animate("same", 0, "scale", "LINEAR", &[0.0, 4.0], &[1.; 6]);
    assert_eq!(scene_of(&g).unwrap().motion.duration_s, 4.0);
}

fn pointer(g: &mut Gltf, pointer: &str, kind: &str, how: &str, values: &[f32]) {
    let input = g.floats("SCALAR", &[0.0, 1.0]);
    let output = g.floats(kind, values);
    let target =
        json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
    g.push(
        "animations",
        json!({
            "channels": [{"sampler": 0, "target": target}],
            "samplers": [{"input": input, "output": output, "interpolation": how}],
        }),
    );
}

#[test]
fn pointers_to_a_nodes_placement_move_it_as_plain_channels_do() {
    let mut g = Gltf::cube();
    pointer(&mut g, "/nodes/0/translation", "VEC3", "LINEAR", &[0., 0., 0., 2., 0., 0.]);
    pointer(&mut g, "/nodes/0/rotation", "VEC4", "LINEAR", &[0., 0., 0., 1., 0., 0., 1., 0.]);
    pointer(&mut g, "/nodes/0/scale", "VEC3", "STEP", &[3., 3., 3., 0., 0., 0.]);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.bounds(0.0).unwrap().hi, DVec3::splat(3.0));
    let pose = scene.pose(BodyId(0), 0.5).unwrap();
    assert_eq!(pose.translation, DVec3::X);
    assert!((pose.rotation * DVec3::X).distance(DVec3::Y) < 1e-12);
    assert!(scene.pose(BodyId(0), 1.0).is_none());
    assert_eq!(with_code(&scene.notes, "animation-pointer").len(), 0);
}

/// The cube with two morph targets that lift it, by 1 and by 10.
fn morphing() -> Gltf {
    let mut g = Gltf::cube();
    let lift = |by: f32| [0.0, by, 0.0].repeat(24);
    let (one, ten) = (g.floats("VEC3", &lift(1.0)), g.floats("VEC3", &lift(10.0)));
    g.json["meshes"][0]["primitives"][0]["targets"] =
        json!([{"POSITION": one}, {"NORMAL": 0, "POSITION": ten}]);
    g
}

#[test]
fn morph_weights_that_do_not_change_shape_the_mesh() {
    let height = |g: &Gltf| scene_of(g).unwrap().bounds(0.0).unwrap().lo.y;
    let mut g = morphing();
    assert_eq!(height(&g), 0.0);
    g.json["meshes"][0]["weights"] = json!([1.0, 0.5]);
    assert_eq!(height(&g), 6.0);
    g.json["nodes"][0]["weights"] = json!([0.0, 2.0]);
    assert_eq!(height(&g), 20.0);
    // Another node with the same mesh keeps the mesh's own.
    g.node(json!({"name": "other", "mesh": 0}));
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.bounds(0.0).unwrap().lo.y, 6.0);
    let mut keyed = morphing();
    keyed.json["nodes"][0]["weights"] = json!([0.0, 2.0]);
    pointer(&mut keyed, "/nodes/0/weights", "SCALAR", "LINEAR", &[0.0, 1.0, 0.0, 1.0]);
    assert_eq!(height(&keyed), 10.0);
    assert!(with_code(&scene_of(&keyed).unwrap().notes, "morph")[0].severity == Severity::Info);
    // What does change is said, and the shape at rest is kept.
    let mut moving = morphing();
    moving.json["nodes"][0]["weights"] = json!([0.0, 2.0]);
    pointer(&mut moving, "/nodes/0/weights", "SCALAR", "LINEAR", &[0.0, 1.0, 0.0, 2.0]);
    assert_eq!(height(&moving), 20.0);
    assert!(with_code(&scene_of(&moving).unwrap().notes, "morph")[0].severity == Severity::Warning);
}

/// A cube that turns about this axis by a quarter in a second, below a parent of this scale.
fn turning_below(scale: [f64; 3], axis: usize) -> Gltf {
    let mut g = Gltf::new();
    let mesh = g.cube_mesh();
    let child = g.push(
        "nodes",
        json!({"name": "child", "mesh": mesh, "translation": [3, 0, 0], "rotation": [0.5, 0.5, 0.5, 0.5]}),
    );
    g.node(json!({"name": "parent", "scale": scale, "children": [child]}));
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mut turn = [0.0, 0.0, 0.0, half];
    turn[axis] = half;
    // The quarter after the child's own rotation.
    let q = glam::Quat::from_array(turn) * glam::Quat::from_xyzw(0.5, 0.5, 0.5, 0.5);
    let keys = [[0.5; 4], q.to_array()].concat();
    g.animate("a", child, "rotation", "LINEAR", &[0.0, 1.0], &keys);
    g
}

#[test]
fn a_turning_child_of_a_mirrored_parent_goes_where_the_file_says() {
    let uneven: [f64; 3] = [1.0, 1.000_03, 0.999_95];
    let scales: [[f64; 3]; 6] =
        [[-1., 1., 1.], [-2., -2., -2.], [2., 2., -2.], uneven, [2., -2., 5.], [2., 2., -3.]];
    for scale in scales {
        let axes = if scale[0].abs() == scale[2].abs() || scale == uneven { 0..3 } else { 2..3 };
        for axis in axes {
            let scene = scene_of(&turning_below(scale, axis)).unwrap();
            for share in [0.0, 0.3, 1.0] {
                // Brute force: the file's own matrices.
                let angle = share * std::f64::consts::FRAC_PI_2;
                let about = glam::DQuat::from_axis_angle(DVec3::AXES[axis], angle);
                let local = about * glam::DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5);
                let world = |p: DVec3| DVec3::from(scale) * (DVec3::X * 3.0 + local * p);
                let pose = scene.pose(BodyId(0), share).unwrap();
                let found: Vec<DVec3> = scene
                    .patches
                    .iter()
                    .flat_map(|p| p.corners_in_body())
                    .map(|p| pose.point(p))
                    .collect();
                for bits in 0..8 {
                    let corner = DVec3::from([0, 1, 2].map(|k| f64::from(bits >> k & 1)));
                    let nearest =
                        found.iter().map(|p| p.distance(world(corner))).fold(9.0, f64::min);
                    assert!(nearest < 2e-4, "{scale:?}, axis {axis}, {share}: {nearest}");
                }
                let middle = pose.inverse_point(world(DVec3::splat(0.5)));
                for p in &scene.patches {
                    assert!(p.frame.normal.dot(p.frame.origin - middle) > 0.0);
                }
            }
        }
    }
}

#[test]
fn a_shear_matters_only_where_a_mesh_is_moved_by_it() {
    let mut g = turning_below([1.0, 1.0, 2.0], 0);
    let held = |g: &Gltf| {
        let scene = scene_of(g).unwrap();
        let notes = with_code(&scene.notes, "held-shape");
        notes.iter().map(|n| n.subject.clone()).collect::<Vec<String>>()
    };
    assert_eq!(held(&g), ["child"]);
    g.json["nodes"][0].as_object_mut().unwrap().remove("mesh");
    g.node(json!({"name": "box", "mesh": 0}));
    assert_eq!(scene_of(&g).unwrap().bodies.len(), 1);
    assert!(held(&g).is_empty());
    // Below the sheared node it counts again.
    let below = g.push("nodes", json!({"name": "below", "mesh": 0}));
    g.json["nodes"][0]["children"] = json!([below]);
    assert_eq!(held(&g), ["child"]);
}

#[test]
fn what_is_sheared_keeps_its_first_shape_and_turns_as_nearly_as_a_body_can() {
    let stretched = DVec3::new(1.0, 1.0, 2.0);
    for how in ["LINEAR", "CUBICSPLINE"] {
        let mut g = turning_below(stretched.to_array(), 0);
        if how == "CUBICSPLINE" {
            let (first, last) =
                ([0.5_f32; 4], glam::Quat::from_rotation_x(1.0) * glam::Quat::from_array([0.5; 4]));
            let flat = [0.0; 4];
            let keys = [flat, first, flat, flat, last.to_array(), flat].concat();
            let output = g.floats("VEC4", &keys);
            g.json["animations"][0]["samplers"][0]["output"] = json!(output);
            g.json["animations"][0]["samplers"][0]["interpolation"] = json!(how);
        }
        let scene = scene_of(&g).unwrap();
        let corners = |time_s: f64| {
            let pose = scene.pose(BodyId(0), time_s).unwrap();
            scene
                .patches
                .iter()
                .flat_map(|p| p.corners_in_body())
                .map(|c| pose.point(c))
                .collect::<Vec<_>>()
        };
        // At the start just what the file says.
        let turn = glam::DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5);
        for found in corners(0.0) {
            let nearest = (0..8)
                .map(|bits| DVec3::from([0, 1, 2].map(|k| f64::from(bits >> k & 1))))
                .map(|corner| found.distance(stretched * (DVec3::X * 3.0 + turn * corner)))
                .fold(9.0, f64::min);
            assert!(nearest < 1e-6, "{how}: {nearest}");
        }
        // A body turns about the axis that the file turns it about.
        let pose = scene.pose(BodyId(0), 1.0).unwrap();
        let since = pose.rotation * scene.pose(BodyId(0), 0.0).unwrap().rotation.transpose();
        let (axis, angle) = glam::DQuat::from_mat3(&since).to_axis_angle();
        assert!(
            axis.distance(DVec3::X) < 1e-6 && (0.8..1.8).contains(&angle),
            "{how}: {axis} {angle}"
        );
    }
}

#[test]
fn a_pose_does_not_play_in_place_of_a_motion() {
    let mut g = Gltf::cube();
    let pose = [0., 0., 0., 0., 0., 0.];
    g.animate("RESET", 0, "translation", "LINEAR", &[0.0], &pose[..3]);
    g.animate("static", 0, "translation", "STEP", &[0.0, 1.0], &pose);
    g.animate(
        "held",
        0,
        "translation",
        "CUBICSPLINE",
        &[0.0, 1.0],
        &[[0.0; 6], [0.0; 6], [0.0; 6]].concat(),
    );
    let all = scene_of(&g).unwrap();
    assert_eq!(all.motion.animation.as_deref(), Some("RESET"));
    g.animate("walk", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    g.animate("run", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 2., 0., 0.]);
    let moving = scene_of(&g).unwrap();
    assert_eq!(moving.motion.animation.as_deref(), Some("walk"));
    assert_eq!(at(&moving, 1.0).x - at(&all, 1.0).x, 1.0);
}

#[test]
fn of_animations_of_the_same_things_the_first_plays_and_the_others_are_listed() {
    let mut g = Gltf::cube();
    let other = g.node(json!({"name": "other", "mesh": 0}));
    let third = g.node(json!({"name": "third", "mesh": 0}));
    let along = |g: &mut Gltf, name: &str, node: usize, path: &str| {
        let values: &[f32] = if path == "rotation" {
            &[0., 0., 0., 1., 1., 0., 0., 0.]
        } else {
            &[0., 0., 0., 1., 0., 0.]
        };
        g.animate(name, node, path, "LINEAR", &[0.0, 1.0], values);
    };
    along(&mut g, "walk", 0, "translation");
    along(&mut g, "door", third, "translation");
    along(&mut g, "wave", other, "rotation");
    // What both move ties them together: walk, wave and this are clips of one figure.
    along(&mut g, "run", 0, "translation");
    let mut channel = g.json["animations"][2]["channels"][0].clone();
    channel["sampler"] = json!(1);
    let sampler = g.json["animations"][2]["samplers"][0].clone();
    g.json["animations"][3]["channels"].as_array_mut().unwrap().push(channel);
    g.json["animations"][3]["samplers"].as_array_mut().unwrap().push(sampler);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.motion.animation.as_deref(), Some("walk, door"));
    assert_eq!([0, 1, 2].map(|b| scene.moves(BodyId(b))), [true, false, true]);
    assert_eq!(scene.pose(BodyId(0), 1.0).unwrap().rotation, glam::DMat3::IDENTITY);
    let listed = with_code(&scene.notes, "other-animations");
    assert!(
        listed.len() == 1 && listed[0].message.contains("2 others do not: wave, run"),
        "{:?}",
        scene.notes
    );
}

#[test]
fn scales_that_change_by_rounding_do_not_change() {
    let mut g = Gltf::cube();
    g.animate("a", 0, "scale", "LINEAR", &[0.0, 1.0], &[1., 1., 1., 1.000_05, 0.999_96, 1.]);
    assert!(!scene_of(&g).unwrap().moves(BodyId(0)));
}

#[test]
fn instances_are_objects_of_their_own() {
    let mut g = Gltf::cube();
    let at = g.floats("VEC3", &[0., 0., 0., 5., 0., 0., 0., 7., 0.]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn = g.floats("VEC4", &[0., 0., 0., 1., 0., 0., half, half, 0., 0., 0., 1.]);
    let scale = g.floats("VEC3", &[1., 1., 1., 1., 1., 1., 2., 2., 2.]);
    let attributes = json!({"TRANSLATION": at, "ROTATION": turn, "SCALE": scale});
    g.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    g.json["nodes"][0]["translation"] = json!([0, 0, 1]);
    g.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = scene_of(&g).unwrap();
    assert_eq!((scene.bodies.len(), scene.patches.len()), (3, 18));
    let Aabb { lo: low, hi: high } = scene.bounds(0.0).unwrap();
    assert!(low.distance(DVec3::new(0.0, 0.0, 1.0)) < 1e-6, "{low}");
    assert!(high.distance(DVec3::new(5.0, 9.0, 3.0)) < 1e-6, "{high}");
    // What moves carries its instances.
    g.animate("a", 0, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 1., 0., 0., 2.]);
    assert_eq!(scene_of(&g).unwrap().bodies.len(), 1);
    let few = g.floats("VEC3", &[0.; 6]);
    g.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = json!(few);
    let error = scene_of(&g).unwrap_err().to_string();
    assert!(error.contains("`crate`") && error.contains("different lengths"), "{error}");
}

/// The cube skinned to two joints, its sides -x and +x to the second, with other parts beside it.
fn skinned(whole: bool) -> Gltf {
    let mut g = Gltf::new();
    let mesh = g.cube_mesh();
    let joint_of = |vertex: usize| f32::from(u8::from(!whole && vertex < 8));
    let weights: Vec<f32> = [1.0, 0.0, 0.0, 0.0].repeat(24);
    let view = g.view(&(0..24).flat_map(|v| [joint_of(v) as u8, 0, 0, 0]).collect::<Vec<u8>>());
    let joints = g.push(
        "accessors",
        json!({"bufferView": view, "componentType": 5121, "count": 24, "type": "VEC4"}),
    );
    let weights = g.floats("VEC4", &weights);
    let attributes = &mut g.json["meshes"][mesh]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    // Bound where the joints stood at x = 1 and y = 2.
    let bind = |x: f32, y: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -x, -y, 0., 1.];
    let binds = g.floats("MAT4", &[bind(1.0, 0.0), bind(0.0, 2.0)].concat());
    let one = g.node(json!({"name": "one", "translation": [1, 0, 5]}));
    let two = g.node(json!({"name": "two", "translation": [0, 2, 0]}));
    g.json["skins"] = json!([{"joints": [one, two], "inverseBindMatrices": binds}]);
    // The mesh's own node stands elsewhere, which does not count.
    g.node(json!({"name": "robot", "mesh": mesh, "skin": 0, "translation": [70, 70, 70]}));
    g.animate("a", one, "translation", "LINEAR", &[0.0, 1.0], &[1., 0., 5., 3., 0., 5.]);
    g
}

#[test]
fn a_skin_of_rigid_joints_moves_with_them() {
    let scene = scene_of(&skinned(true)).unwrap();
    assert_eq!((scene.bodies.len(), scene.patches.len()), (1, 6));
    assert_eq!(scene.surfaces[0].name, "robot");
    for t in [0.0, 0.5] {
        let wanted =
            Aabb { lo: DVec3::new(2.0 * t, 0., 5.), hi: DVec3::new(2.0 * t + 1.0, 1., 6.) };
        assert_eq!(scene.bounds(t).unwrap(), wanted);
    }
    assert_eq!(with_code(&scene.notes, "skin").len(), 0);
    let scene = scene_of(&skinned(false)).unwrap();
    assert_eq!((scene.bodies.len(), scene.patches.len()), (2, 6));
    let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["robot/one", "robot/two"]);
    let ends = |t| scene.bounds(t).unwrap();
    assert_eq!(ends(1.0), Aabb { lo: DVec3::ZERO, hi: DVec3::new(3.0, 1.0, 6.0) });
}

/// A skin one of whose vertices hangs on two joints, below an armature that moves.
fn bending() -> Gltf {
    let mut g = skinned(false);
    // The first vertex of side -x, at the cube's origin, hangs on both joints by halves.
    let weights = g.json["accessors"][3]["bufferView"].as_u64().unwrap() as usize;
    let offset = g.json["bufferViews"][weights]["byteOffset"].as_u64().unwrap() as usize;
    for (k, value) in [0.5_f32, 0.5].into_iter().enumerate() {
        g.bin[offset + 4 * k..][..4].copy_from_slice(&value.to_le_bytes());
    }
    let view = g.json["accessors"][2]["bufferView"].as_u64().unwrap() as usize;
    let offset = g.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
    g.bin[offset] = 0;
    g.bin[offset + 1] = 1;
    // Both joints hang on an armature that moves; the first joint moves by itself as well.
    let armature = g.node(json!({"name": "armature", "scale": [2, 2, 2], "children": [0, 1]}));
    g.json["scenes"][0]["nodes"] = json!([armature, 2]);
    g.animate("b", armature, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 0., 0., 9.]);
    g
}

/// Brute force: the first joint puts a vertex at v + (0, 0, 5), and from there by a share of its way; the second where it is;
/// twice as large, where the armature is.
#[track_caller]
fn is_bent(scene: &Scene, time_s: f64, way: f64) {
    let there = |p: &&relume_core::scene::Patch| scene.pose(p.body, time_s).is_some();
    let placed = |p: &relume_core::scene::Patch| {
        let pose = scene.pose(p.body, time_s).unwrap();
        p.corners_in_body().map(|c| pose.point(c)).collect::<Vec<_>>()
    };
    let found: Vec<DVec3> = scene.patches.iter().filter(there).flat_map(placed).collect();
    for (vertex, p) in super::gltf::cube_positions().chunks(3).enumerate() {
        let share = match vertex {
            0 => 0.5,
            1..8 => 0.0,
            _ => 1.0,
        };
        let p = DVec3::new(p[0].into(), p[1].into(), p[2].into());
        let by = DVec3::new(2.0 * way, 0.0, 5.0);
        let meant = 2.0 * (p + by * share) + DVec3::Z * 9.0 * time_s;
        let nearest = found.iter().map(|f| f.distance(meant)).fold(99.0, f64::min);
        assert!(nearest < 1e-6, "vertex {vertex} at {time_s}: {nearest}");
    }
}

/// A scene whose meshes are read anew at each frame of four a second.
fn rebuilt(g: &Gltf) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let rebuild = Some(Instants { fps: 4.0, frames: Vec::new() });
    let options = ImportOptions { rebuild, ..ImportOptions::default() };
    import(g.write(folder.path(), "scene"), &options).unwrap()
}

/// The bodies that are there at a time.
fn present(scene: &Scene, time_s: f64) -> usize {
    (0..scene.bodies.len() as u32).filter(|&b| scene.pose(BodyId(b), time_s).is_some()).count()
}

#[test]
fn a_skin_that_bends_is_rebuilt_at_each_frame_if_asked_for() {
    let scene = rebuilt(&bending());
    assert_eq!((scene.bodies.len(), with_code(&scene.notes, "rebuilt").len()), (5, 1));
    assert!(with_code(&scene.notes, "skin").is_empty());
    for time_s in [0.0, 0.25, 0.5, 0.75, 1.0] {
        assert_eq!(present(&scene, time_s), 1);
        is_bent(&scene, time_s, time_s);
    }
    // The scale that sizes are measured by is that of one shape.
    let first: f64 = scene.patches_of(BodyId(0)).map(|(_, p)| p.area_m2()).sum();
    assert_eq!(scene.made_area_m2(), first);
}

#[test]
fn morph_targets_that_move_are_rebuilt_at_each_frame_if_asked_for() {
    let mut g = morphing();
    g.json["nodes"][0]["weights"] = json!([0.0, 2.0]);
    pointer(&mut g, "/nodes/0/weights", "SCALAR", "LINEAR", &[0.0, 1.0, 0.0, 2.0]);
    let scene = rebuilt(&g);
    assert!(with_code(&scene.notes, "morph").is_empty());
    for k in 0..5 {
        let time_s = f64::from(k) / 4.0;
        assert_eq!(present(&scene, time_s), 1);
        assert!((scene.bounds(time_s).unwrap().lo.y - 10.0 * (1.0 + time_s)).abs() < 1e-6);
    }
    // Frames that follow each other equal cold builds, bit for bit, there and back again.
    let sky = Some(Sky::Uniform([1.0; 3]));
    let scene = scene.with_outside(Outside { sky, fineness: 0.1, ..Outside::default() }).unwrap();
    let scene = Arc::new(scene);
    let session = || Session::new(Arc::clone(&scene), Options::default()).unwrap();
    let mut warm = session();
    for k in [0, 1, 2, 4, 3, 0] {
        let mut cold = session();
        let report = warm.step(k, f64::from(k) / 4.0).unwrap();
        cold.step(k, f64::from(k) / 4.0).unwrap();
        assert_eq!(compare(warm.solved().unwrap(), cold.solved().unwrap()), None, "frame {k}");
        assert!(report.links > 100, "{}", report.links);
    }
}

#[test]
fn a_skin_that_bends_is_held_in_its_pose_at_the_start() {
    let scene = scene_of(&bending()).unwrap();
    let notes = with_code(&scene.notes, "skin");
    assert_eq!((notes.len(), notes[0].subject.as_str()), (1, "robot"));
    assert!(
        notes[0].message.contains("several joints") && notes[0].message.contains("`armature`"),
        "{}",
        notes[0].message
    );
    assert_eq!(scene.surfaces[0].name, "robot");
    for time_s in [0.0, 1.0] {
        is_bent(&scene, time_s, 0.0);
    }
}

#[test]
fn a_skin_without_its_joints_is_named_and_read_as_it_was_before() {
    let mut g = skinned(true);
    g.json["scenes"][0]["nodes"] = json!([2]);
    let scene = scene_of(&g).unwrap();
    let notes = with_code(&scene.notes, "skin");
    assert_eq!(notes[0].subject, "robot");
    assert!(notes[0].message.contains("not in the scene"), "{}", notes[0].message);
    assert_eq!(scene.bounds(0.0).unwrap().lo, DVec3::splat(70.0));
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
