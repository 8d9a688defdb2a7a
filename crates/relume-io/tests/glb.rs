//! Scenes written as binary glTF: a valid container, and the same scene when it is read back.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use relume_core::scene::{
    BodyId, Interpolation, LightKind, Patch, Projection, RotationTrack, Scene, SceneBuilder, Track,
};
use relume_io::export::{glb, write_glb};
use relume_io::{ImportOptions, import};
use serde_json::Value;

/// A bit of everything: nested nodes, two materials on one object, weak and strong emission, motion
/// of several interpolations, a body that comes and goes, cameras and lights.
// Over 60 lines: one scene with a bit of everything.
fn everything() -> Scene {
    let mut b = SceneBuilder::new("everything");
    let grey = b.material("grey", [0.5, 0.25, 0.125], [0.0; 3]);
    let dim = b.material("dim", [0.0; 3], [0.5 * PI, 0.25 * PI, 0.0]);
    let bright = b.material("bright", [0.1; 3], [40.0 * PI, 20.0 * PI, 10.0 * PI]);
    let leaf = b.double_sided_material("leaf", [0.2, 0.5, 0.1], [0.0; 3]);
    let turn = DQuat::from_rotation_y(0.5) * DQuat::from_rotation_x(0.25);
    let at = DVec3::new;

    let hall = b.node("hall", None, at(1.0, 0.0, -2.0), DQuat::from_rotation_y(0.25));
    let cupboard = b.node("cupboard", Some(hall), at(0.5, 0.0, 0.0), turn);
    b.cuboid(cupboard, "cupboard", grey, DVec3::ZERO, at(1.0, 2.0, 0.5));
    let pentagon = [at(0., 3., 0.), at(2., 3., 0.), at(3., 3., 1.), at(2., 3., 2.), at(0., 3., 2.)];
    b.polygon(cupboard, "cupboard shelf", leaf, &pentagon);

    let arm = b.node("arm", Some(hall), DVec3::ZERO, DQuat::IDENTITY);
    let swing = RotationTrack {
        times_s: vec![0.0, 0.5, 1.0],
        values: [0.0, 1.0, 2.5].map(DQuat::from_rotation_z).to_vec(),
        interpolation: Interpolation::Linear,
    };
    b.animate_rotation(arm, swing);
    let hand = b.node("hand", Some(arm), at(0.0, 1.5, 0.0), turn);
    b.cuboid(hand, "hand", dim, DVec3::splat(-0.25), DVec3::splat(0.25));
    let bird = b.node("bird", None, DVec3::ZERO, DQuat::IDENTITY);
    let (still, up) = (DVec3::ZERO, at(1.0, 5.0, 1.0));
    let flight = Track {
        times_s: vec![0.0, 2.0],
        values: vec![still, at(0.0, 1.0, 0.0), up, up, at(2.0, 1.0, 0.0), still],
        interpolation: Interpolation::CubicSpline,
    };
    b.animate_translation(bird, flight);
    b.cuboid(bird, "bird", bright, DVec3::splat(-0.125), DVec3::splat(0.125));
    let ghost = b.node("ghost", None, at(4.0, 0.0, 0.0), DQuat::IDENTITY);
    b.animate_presence(ghost, vec![(0.0, false), (0.25, true), (0.75, false)]);
    b.cuboid(ghost, "ghost", grey, DVec3::ZERO, DVec3::ONE);

    let eye = b.node("eye", None, at(0.0, 1.5, 6.0), DQuat::IDENTITY);
    b.camera("eye", eye, Projection::Perspective { yfov: 0.75, aspect: Some(1.5) });
    b.camera("plan", eye, Projection::Orthographic { xmag: 4.0, ymag: 3.0 });
    let bulb = b.node("bulb", Some(hall), at(0.0, 2.5, 0.0), DQuat::IDENTITY);
    b.light("bulb", bulb, LightKind::Point, [2.0, 1.0, 0.5]);
    b.light("hand", hand, LightKind::Spot { inner: 0.25, outer: 0.5 }, [3.0; 3]);
    let sun = b.node("sun", None, DVec3::ZERO, turn);
    b.light("sun", sun, LightKind::Directional, [8.0, 8.0, 4.0]);
    let keys = |values: [[f64; 3]; 3]| Track {
        times_s: vec![0.0, 0.5, 1.5],
        values: values.map(DVec3::from_array).to_vec(),
        interpolation: Interpolation::Linear,
    };
    let flash = b.material("flash", [0.2; 3], [0.0; 3]);
    b.cuboid(bird, "flash", flash, DVec3::splat(-0.1), DVec3::splat(0.1));
    b.animate_exitance(flash, keys([[0.0; 3], [90.0, 40.0, 10.0], [1.0, 2.0, 3.0]]));
    let ember = b.material("ember", [0.2; 3], [0.0; 3]);
    b.cuboid(ghost, "ember", ember, DVec3::ZERO, DVec3::splat(0.1));
    b.animate_exitance(ember, keys([[0.5, 0.25, 0.0], [0.0; 3], [0.125; 3]]));
    b.animate_intensity("hand", keys([[3.0; 3], [0.001, 0.0, 0.0], [0.0, 5.0, 1.0]]));
    let mut scene = b.build().unwrap();
    // A colour and a strength apart, as files have them.
    let flash = scene.materials[flash.0 as usize].glow.as_mut().unwrap();
    flash.tracks.push(keys([[2.0; 3], [1.0; 3], [0.5; 3]]));
    scene
}

/// The JSON chunk and the length of the binary one.
fn chunks(bytes: &[u8]) -> (Value, usize) {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(&bytes[..4], b"glTF");
    assert_eq!((word(4), word(8)), (2, bytes.len()));
    let json = word(12);
    assert_eq!((json % 4, &bytes[16..20]), (0, b"JSON".as_slice()));
    let binary = word(20 + json);
    assert_eq!((binary % 4, &bytes[24 + json..28 + json]), (0, b"BIN\0".as_slice()));
    assert_eq!(28 + json + binary, bytes.len());
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), binary)
}

#[test]
fn container_and_materials() {
    let (json, binary) = chunks(&glb(&everything()).unwrap());
    assert_eq!(json["asset"]["version"], "2.0");
    assert!(json["buffers"][0]["byteLength"].as_u64().unwrap() as usize <= binary);
    let material = |name: &str| {
        let all = json["materials"].as_array().unwrap();
        all.iter().find(|m| m["name"] == name).unwrap().clone()
    };
    assert_eq!(material("grey").get("emissiveFactor"), None);
    assert_eq!(material("grey")["pbrMetallicRoughness"]["metallicFactor"], 0.0);
    assert_eq!(material("leaf")["doubleSided"], true);
    // Up to 1 no extension is needed.
    assert_eq!(material("dim").get("extensions"), None);
    let bright = material("bright");
    assert_eq!(bright["emissiveFactor"], serde_json::json!([1.0, 0.5, 0.25]));
    let strength = &bright["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
    assert!((strength.as_f64().unwrap() - 40.0).abs() < 1e-12);
    assert_eq!(
        json["extensionsUsed"],
        serde_json::json!([
            "KHR_materials_emissive_strength",
            "KHR_animation_pointer",
            "KHR_lights_punctual"
        ])
    );
    // Of the double-sided pentagon one side is written: 5 corners beside the cuboid's 24.
    let corners = |primitive: &Value| {
        let accessor = primitive["attributes"]["POSITION"].as_u64().unwrap() as usize;
        json["accessors"][accessor]["count"].as_u64().unwrap()
    };
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!(primitives.iter().map(corners).collect::<Vec<_>>(), [24, 5]);
}

#[test]
fn the_same_scene_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    let scene = everything();
    let path = dir.path().join("everything.glb");
    write_glb(&scene, &path).unwrap();
    let back = import(&path, &ImportOptions::default()).unwrap();
    same(&scene, &back);
    // And once more, from what was read.
    let again = dir.path().join("again.glb");
    write_glb(&back, &again).unwrap();
    same(&scene, &import(&again, &ImportOptions::default()).unwrap());
}

/// Names exactly, numbers to the precision of 32-bit floats.
fn same(a: &Scene, b: &Scene) {
    let names = |scene: &Scene| {
        let lists: [Vec<String>; 5] = [
            scene.bodies.iter().map(|x| x.name.clone()).collect(),
            scene.surfaces.iter().map(|x| x.object.clone()).collect(),
            scene.cameras.iter().map(|x| x.name.clone()).collect(),
            scene.lights.iter().map(|x| x.name.clone()).collect(),
            scene.materials.iter().map(|x| x.name.clone()).collect(),
        ];
        lists.map(|mut list| {
            list.sort();
            list
        })
    };
    assert_eq!(names(a), names(b));
    assert!((a.motion.duration_s - b.motion.duration_s).abs() < 1e-6);
    for x in &a.materials {
        let y = b.materials.iter().find(|y| y.name == x.name).unwrap();
        assert_eq!(x.double_sided, y.double_sided);
        close(x.reflectance, y.reflectance, &x.name);
        close(x.exitance, y.exitance, &x.name);
    }
    for x in &a.lights {
        let y = b.lights.iter().find(|y| y.name == x.name).unwrap();
        close(x.intensity, y.intensity, &x.name);
    }
    for t in [0.0, 0.1, 0.3, 0.5, 0.8, 1.5, 2.0] {
        for x in &a.materials {
            let y = b.materials.iter().find(|y| y.name == x.name).unwrap();
            close(x.exitance_at(t), y.exitance_at(t), &format!("{} at {t} s", x.name));
        }
        for x in &a.lights {
            let y = b.lights.iter().find(|y| y.name == x.name).unwrap();
            close(x.intensity_at(t), y.intensity_at(t), &format!("{} at {t} s", x.name));
        }
        for (index, body) in a.bodies.iter().enumerate() {
            let other = b.bodies.iter().position(|y| y.name == body.name).unwrap();
            let what = format!("{} at {t} s", body.name);
            same_polygons(
                polygons(a, BodyId(index as u32), t),
                polygons(b, BodyId(other as u32), t),
                &what,
            );
        }
        for x in &a.cameras {
            let y = b.cameras.iter().find(|y| y.name == x.name).unwrap();
            let (p, q) = (a.motion.pose(x.node, t).unwrap(), b.motion.pose(y.node, t).unwrap());
            assert!((p.translation - q.translation).length() < 1e-5, "{}", x.name);
            assert!(p.rotation.abs_diff_eq(q.rotation, 1e-6), "{}", x.name);
        }
    }
}

fn close(a: [f64; 3], b: [f64; 3], what: &str) {
    for k in 0..3 {
        assert!((a[k] - b[k]).abs() < 1e-6 * (1.0 + a[k]), "{what}: {a:?} and {b:?}");
    }
}

/// A polygon in the world: a point a little in front of its centre, so that the two sides of a
/// double-sided one differ; its area; its number of corners.
type Polygon = (DVec3, f64, usize);

/// The polygons of a body that is present.
fn polygons(scene: &Scene, body: BodyId, time_s: f64) -> Option<Vec<Polygon>> {
    let pose = scene.pose(body, time_s)?;
    let polygon = |patch: &Patch| {
        let corners: Vec<DVec3> = patch.corners_in_body().map(|c| pose.point(c)).collect();
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        (centre + 0.01 * pose.direction(patch.frame.normal), patch.area_m2(), corners.len())
    };
    Some(scene.patches_of(body).map(|(_, patch)| polygon(patch)).collect())
}

fn same_polygons(a: Option<Vec<Polygon>>, b: Option<Vec<Polygon>>, what: &str) {
    assert_eq!(a.is_some(), b.is_some(), "{what} is present in one scene only");
    let (a, b) = (a.unwrap_or_default(), b.unwrap_or_default());
    assert_eq!(a.len(), b.len(), "{what}");
    for x in &a {
        let alike =
            |y: &Polygon| (x.0 - y.0).length() < 1e-5 && (x.1 - y.1).abs() < 1e-5 && x.2 == y.2;
        assert!(b.iter().any(alike), "{what}: {x:?} is not in {b:?}");
    }
}
