//! Light from pictures all around that a file carries (`EXT_lights_image_based`).

use std::f64::consts::PI;

use glam::DVec3;
use relume_core::scene::outside::Environment;
use serde_json::{Value, json};

use super::gltf::Gltf;
use super::{scene_of, with_code};

/// The spherical harmonic of order 0.
const HARMONIC_0: f64 = 0.282_094_791_773_878_14;

/// A face of 2 x 2 texels, rows from the top.
fn face(texels: [[u8; 4]; 4]) -> Vec<u8> {
    let image = image::RgbaImage::from_raw(2, 2, texels.as_flattened().to_vec()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// The cube in light of six faces; `l0` is the first coefficient of each channel.
fn lit(faces: &[Vec<u8>], l0: f64, more: Value) -> Gltf {
    let mut g = Gltf::cube();
    g.json["extensionsUsed"] = json!(["EXT_lights_image_based"]);
    let mut images = Vec::new();
    for bytes in faces {
        let view = g.view(bytes);
        images.push(json!({"bufferView": view, "mimeType": "image/png"}));
    }
    g.json["images"] = json!(images);
    let mut coefficients = vec![json!([0.0, 0.0, 0.0]); 9];
    coefficients[0] = json!([l0, l0, l0]);
    let mut light = json!({"irradianceCoefficients": coefficients, "specularImageSize": 2,
        "specularImages": [(0..faces.len()).collect::<Vec<_>>()]});
    for (key, value) in more.as_object().unwrap() {
        light[key] = value.clone();
    }
    g.json["extensions"] = json!({"EXT_lights_image_based": {"lights": [light]}});
    g.json["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
    g
}

fn environment(g: &Gltf) -> std::sync::Arc<Environment> {
    let scene = scene_of(g).unwrap();
    assert_eq!(with_code(&scene.notes, "environment").len(), 1, "{:?}", scene.notes);
    scene.environment.expect("the file carries one")
}

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];

/// Radiance from a direction relative to that of white, where only one texel of one face shines.
fn shines(g: &Gltf, directions: &[DVec3]) -> Vec<bool> {
    let found = environment(g);
    directions.iter().map(|d| found.radiance(d.normalize())[0] > 0.0).collect()
}

/// Checks where the upper left texel of each face is seen: of a face its direction, what is up in the picture, and what is right of
/// it as seen from the middle.
fn check_faces(faces: [(DVec3, DVec3, DVec3); 6], coefficients: &dyn Fn(DVec3) -> Value) {
    for (k, &(ahead, up, right)) in faces.iter().enumerate() {
        let mut all = vec![face([BLACK; 4]); 6];
        all[k] = face([WHITE, BLACK, BLACK, BLACK]);
        let towards = [-0.5, 0.5].map(|a| [0.5, -0.5].map(|b| ahead + a * right + b * up));
        let mut g = lit(&all, 0.0, json!({}));
        g.json["extensions"]["EXT_lights_image_based"]["lights"][0]["irradianceCoefficients"] =
            coefficients(towards[0][0]);
        let seen =
            shines(&g, &[towards[0][0], towards[0][1], towards[1][0], towards[1][1], -ahead]);
        assert_eq!(seen, [true, false, false, false, false], "face {k}");
    }
}

/// Coefficients of light from a direction, without the first, which says how much it is in all.
fn light_from(d: DVec3) -> Value {
    let first = [0.0, d.y, d.z, d.x, 0.0, 0.0, 0.0, 0.0, 0.0];
    json!(first.map(|c| [c; 3]))
}

/// As in the sample file of the extension's authors: the faces of cube maps, upside down.
#[test]
fn each_face_is_seen_in_its_direction_upside_down() {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    let faces = [(x, -y, -z), (-x, -y, z), (y, z, x), (-y, -z, x), (z, -y, x), (-z, -y, -x)];
    check_faces(faces, &|_| light_from(DVec3::ZERO));
    check_faces(faces, &light_from);
}

/// The extension by the letter; told from the other by the coefficients.
#[test]
fn each_face_is_seen_in_its_direction_as_from_within_where_the_coefficients_say_so() {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    let faces = [(x, y, z), (-x, y, -z), (y, -z, -x), (-y, z, -x), (z, y, -x), (-z, y, x)];
    check_faces(faces, &light_from);
}

#[test]
fn rotation_turns_it_and_intensity_and_coefficients_say_how_much_it_is() {
    let mut all = vec![face([BLACK; 4]); 6];
    all[0] = face([WHITE; 4]);
    // A quarter turn about +Y takes +X to -Z.
    let half = 0.5_f64.sqrt();
    let turned = json!({"rotation": [0.0, half, 0.0, half]});
    assert_eq!(
        shines(&lit(&all, 0.0, turned), &[DVec3::X, -DVec3::Z, DVec3::Z]),
        [false, true, false]
    );
    // Mean irradiance over all normals is pi times the mean radiance: here six times as much comes from one face.
    let found = environment(&lit(&all, 3.0, json!({"intensity": 2.0})));
    let want = 2.0 * 6.0 * 3.0 * HARMONIC_0 / PI;
    let ahead = found.radiance(DVec3::X);
    // The edges of the face are blurred by the pixels.
    assert!(ahead.iter().all(|l| (l / want - 1.0).abs() < 0.03), "{ahead:?} {want}");
}

#[test]
fn alpha_divides() {
    // Half of white is 0.2140 in linear light; over an alpha of a quarter.
    let all = vec![face([[128, 128, 128, 64]; 4]); 6];
    let found = environment(&lit(&all, 0.0, json!({})));
    let want = 0.215_86 / (64.0 / 255.0);
    assert!(
        (found.radiance(DVec3::Y)[0] / want - 1.0).abs() < 1e-4,
        "{:?}",
        found.radiance(DVec3::Y)
    );
}

#[test]
fn without_pictures_the_coefficients_light_it() {
    let mut g = lit(&[], 2.0, json!({"specularImages": []}));
    // Brighter from above: y is the second.
    g.json["extensions"]["EXT_lights_image_based"]["lights"][0]["irradianceCoefficients"][1] =
        json!([0.6, 0.6, 0.6]);
    let scene = scene_of(&g).unwrap();
    let notes = with_code(&scene.notes, "environment");
    assert!(notes[0].message.contains("cannot be read"), "{notes:?}");
    let found = scene.environment.expect("coefficients are enough");
    let [up, down] = [DVec3::Y, -DVec3::Y].map(|d| found.radiance(d)[0]);
    let want = 2.0 * HARMONIC_0 / PI;
    let more = 0.6 * 0.488_602_5 / (2.0 * PI / 3.0);
    let (mean, half) = (0.5 * (up + down), 0.5 * (up - down));
    assert!((mean / want - 1.0).abs() < 0.01 && (half / more - 1.0).abs() < 0.01, "{up} {down}");
}

#[test]
fn what_is_wrong_with_it_is_said_and_leaves_the_scene_as_it_is() {
    let faces = vec![face([WHITE; 4]); 6];
    let cases: [(&str, Value, &str); 4] = [
        ("/scenes/0/extensions/EXT_lights_image_based/light", json!(7), "no light 7"),
        (
            "/extensions/EXT_lights_image_based/lights/0/irradianceCoefficients",
            json!([1]),
            "length",
        ),
        ("/extensions/EXT_lights_image_based/lights/0/intensity", json!(-1.0), "out of range"),
        (
            "/extensions/EXT_lights_image_based/lights/0/rotation",
            json!([0, 0, 0, 0]),
            "out of range",
        ),
    ];
    for (at, wrong, why) in cases {
        let mut g = lit(&faces, 1.0, json!({"intensity": 1.0, "rotation": [0, 0, 0, 1]}));
        *g.json.pointer_mut(at).unwrap() = wrong;
        let scene = scene_of(&g).unwrap();
        assert!(scene.environment.is_none(), "{at}");
        let message = &with_code(&scene.notes, "environment")[0].message;
        assert!(message.contains(why) && message.contains("`Sky::Environment`"), "{message}");
    }
    let mut missing = lit(&faces, 1.0, json!({}));
    missing.json["extensions"]["EXT_lights_image_based"]["lights"][0]["specularImages"] =
        json!([[0, 1, 2, 3, 4, 60]]);
    assert!(scene_of(&missing).unwrap_err().to_string().contains("image 60"));
}
