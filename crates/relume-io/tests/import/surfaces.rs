//! Materials, textures, lights and instances of a file.

use std::f64::consts::PI;

use relume_core::scene::{LightKind, Scene, Severity};
use serde_json::json;

use super::gltf::Gltf;
use super::{scene_of, with_code};

fn png(pixels: &[[u8; 3]]) -> Vec<u8> {
    let image = image::RgbImage::from_raw(pixels.len() as u32, 1, pixels.concat()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn textured(image: serde_json::Value, g: &mut Gltf) -> Scene {
    g.json["images"] = json!([image]);
    g.json["textures"] = json!([{"source": 0}]);
    g.json["materials"][0] = json!({"name": "poster", "emissiveFactor": [1.0, 0.5, 0.0],
        "emissiveTexture": {"index": 0}, "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "baseColorTexture": {"index": 0}}});
    scene_of(g).unwrap()
}

#[test]
fn without_texture_coordinates_the_linear_mean_of_the_image_counts() {
    let mut g = Gltf::cube();
    // Linear means: 1/2, 0.21586 (sRGB 128), 0.
    let view = g.view(&png(&[[0, 128, 0], [255, 128, 0]]));
    let scene = textured(json!({"bufferView": view, "mimeType": "image/png"}), &mut g);
    let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-7);
    for patch in &scene.patches {
        let (rho, m) = (scene.reflectance(patch), scene.exitance_at(patch, 0.0));
        assert!(close(rho, [0.25, 0.107_930_25, 0.0]), "{rho:?}");
        assert!(close(m, [2.0 * PI, 2.0 * PI * 0.215_860_5, 0.0]), "{m:?}");
    }
    // It has no texture coordinates: one warning for each texture, beside what is said of all.
    let severities: Vec<Severity> =
        with_code(&scene.notes, "texture").iter().map(|n| n.severity).collect();
    assert_eq!(severities, [Severity::Warning, Severity::Warning, Severity::Info]);
}

#[test]
fn a_missing_or_damaged_image_is_white_and_a_warning() {
    for image in [json!({"uri": "lost.png"}), json!({"uri": "data:image/png;base64,AAAA"})] {
        let scene = textured(image, &mut Gltf::cube());
        assert_eq!(scene.materials[0].reflectance, [0.5; 3]);
        let notes = with_code(&scene.notes, "texture");
        assert!(
            notes.len() == 2
                && notes.iter().all(|n| n.severity == Severity::Warning && n.subject == "poster")
        );
    }
}

#[test]
fn reflectances_stay_below_one() {
    let mut g = Gltf::cube();
    g.json["materials"][0]["pbrMetallicRoughness"] =
        json!({"baseColorFactor": [1.0, 0.5, 7.0, 1.0], "metallicFactor": 1});
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.materials[0].reflectance, [0.98, 0.5, 0.98]);
    let notes = with_code(&scene.notes, "reflectance");
    assert_eq!(
        (notes[0].subject.as_str(), notes[0].count, notes[0].severity),
        ("grey", 1, Severity::Warning)
    );
    assert_eq!(with_code(&scene.notes, "metallic").len(), 1);
    g.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    let scene = scene_of(&g).unwrap();
    assert_eq!(with_code(&scene.notes, "no-material")[0].count, 1);
}

#[test]
fn punctual_lights_say_what_they_became() {
    let mut g = Gltf::cube();
    g.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 683.0, "color": [1.0, 0.5, 0.0]},
        {"type": "spot", "intensity": 1366.0, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}},
        {"type": "directional", "intensity": 683.0, "range": 3.0},
    ]}});
    for light in 0..3 {
        g.node(json!({"name": format!("lamp{light}"), "extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    let scene = scene_of(&g).unwrap();
    let got: Vec<(LightKind, [f64; 3])> =
        scene.lights.iter().map(|l| (l.kind, l.intensity)).collect();
    let spot = LightKind::Spot { inner: 0.1, outer: 0.2 };
    let wanted =
        [(LightKind::Point, [1.0, 0.5, 0.0]), (spot, [2.0; 3]), (LightKind::Directional, [1.0; 3])];
    assert_eq!(got, wanted);
    let said = [("683 cd", "W/sr"), ("1366 cd", "W/sr"), ("683 lx", "W/m2; its range is ignored")];
    for (light, (from, to)) in scene.lights.iter().zip(said) {
        assert!(
            light.conversion.contains(from) && light.conversion.contains(to),
            "{}",
            light.conversion
        );
    }
    assert_eq!(with_code(&scene.notes, "light-units").len(), 3);
}

#[test]
fn a_light_below_a_mirror_is_noted() {
    let mut g = Gltf::cube();
    g.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot"}]}});
    g.node(json!({"name": "torch", "scale": [1, 1, -1], "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    g.node(json!({"name": "big", "scale": [2, 3, 4], "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    let scene = scene_of(&g).unwrap();
    let subjects: Vec<&str> =
        with_code(&scene.notes, "direction").iter().map(|n| n.subject.as_str()).collect();
    assert_eq!(subjects, ["torch"]);
}

#[test]
fn names_are_made_unique_once() {
    let mut g = Gltf::cube();
    g.node(json!({"name": "crate", "mesh": 0}));
    let scene = scene_of(&g).unwrap();
    let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["crate", "crate 2"]);
    assert_eq!(with_code(&scene.notes, "renamed").len(), 1);
}

#[test]
fn instances_share_a_mesh_and_mirrors_keep_the_front() {
    let mut g = Gltf::cube();
    g.node(json!({"name": "mirrored", "mesh": 0, "translation": [5, 0, 0], "scale": [-1, 1, 1]}));
    let columns = [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 0, 0, 9, 1];
    g.node(json!({"name": "turned", "mesh": 0, "matrix": columns}));
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 18);
    for (body, area, centre) in
        [(0, 6.0, [0.5, 0.5, 0.5]), (1, 6.0, [4.5, 0.5, 0.5]), (2, 24.0, [-1.0, 1.0, 10.0])]
    {
        let patches: Vec<_> =
            scene.patches_of(relume_core::scene::BodyId(body)).map(|(_, p)| p).collect();
        let total: f64 = patches.iter().map(|p| p.area_m2()).sum();
        assert!((total - area).abs() < 1e-12);
        for p in patches {
            assert!(
                p.frame.normal.dot(p.frame.origin - glam::DVec3::from_array(centre)) > 0.0,
                "body {body}"
            );
        }
    }
}

#[test]
fn double_sided_materials_make_twins() {
    let mut g = Gltf::cube();
    g.json["materials"][0]["doubleSided"] = json!(true);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 12);
    for (i, p) in scene.patches.iter().enumerate() {
        let twin = &scene.patches[p.twin.unwrap().0 as usize];
        assert_eq!(twin.twin.unwrap().0 as usize, i);
        assert_eq!(twin.frame.normal, -p.frame.normal);
    }
}
