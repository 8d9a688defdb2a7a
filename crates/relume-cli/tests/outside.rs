//! Light from outside on the command line: what it is given as, what is said of it, and what it does to a run.

use std::fs;

use crate::common::{json, relume, room, text};

const QUICK: [&str; 4] = ["--size", "64x48", "--tolerance", "0.3"];

/// A floor of 2 m x 2 m that faces up, as OBJ-like numbers in glTF.
fn floor() -> (tempfile::TempDir, std::path::PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let corners: [f32; 12] = [-1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, -1.0];
    let mut bytes: Vec<u8> = corners.iter().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|k| k.to_le_bytes()));
    fs::write(dir.path().join("floor.bin"), bytes).unwrap();
    let gltf = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "floor", "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "buffers": [{ "uri": "floor.bin", "byteLength": 60 }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 }, { "buffer": 0, "byteOffset": 48, "byteLength": 12 }
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, 0, -1], "max": [1, 0, 1] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" }
        ]
    });
    let path = dir.path().join("floor.gltf");
    fs::write(&path, gltf.to_string()).unwrap();
    (dir, path)
}

/// Irradiance at the floor's middle with some options.
fn irradiance(options: &[&str]) -> Vec<f64> {
    irradiance_of(&floor(), options)
}

fn irradiance_of(
    (dir, scene): &(tempfile::TempDir, std::path::PathBuf),
    options: &[&str],
) -> Vec<f64> {
    let sensors = dir.path().join("sensors.txt");
    fs::write(&sensors, "0 0 0 0 1 0\n").unwrap();
    let common = ["probe", text(scene), text(&sensors), "--tolerance", "0.01", "--quiet"];
    let ran = relume(&[&common[..], options].concat()).succeeds();
    let rows = ran.out.lines().skip(1).map(|row| row.split(',').nth(8).unwrap().parse().unwrap());
    rows.collect()
}

#[test]
fn skies_and_the_sun_light_a_floor_as_stated() {
    let close =
        |found: f64, exact: f64| assert!((found / exact - 1.0).abs() < 5e-3, "{found} {exact}");
    close(irradiance(&["--sky", "uniform=2"])[0], 2.0 * std::f64::consts::PI);
    close(irradiance(&["--sky", "overcast=90"])[0], 90.0);
    close(irradiance(&["--sun", "-20,30,600"])[0], 300.0);
    let both = irradiance(&["--sky", "perez=500,100", "--sun", "90,30"])[0];
    close(both, 350.0);
    // Noon at the equator on an equinox: the sun is in the zenith, nearly; by night it is dark.
    let day = ["--sun", "0,0,2026-03-20T12:00,800", "--day", "00:00..12:00/3"];
    let day = irradiance(&[&day[..], &["--frames", "0-2"]].concat());
    assert_eq!(day.len(), 3);
    assert_eq!(day[0], 0.0);
    close(day[2], 800.0);
}

#[test]
fn light_that_the_file_carries_is_its_sky_unless_another_is_asked_for() {
    let file = floor();
    let mut gltf = json(&file.1);
    gltf["extensionsUsed"] = serde_json::json!(["EXT_lights_image_based"]);
    // Even light: its irradiance is the first coefficient over twice the root of pi.
    let mut coefficients = vec![[0.0; 3]; 9];
    coefficients[0] = [20.0; 3];
    let light = serde_json::json!({ "irradianceCoefficients": coefficients, "specularImageSize": 1, "specularImages": [] });
    gltf["extensions"] = serde_json::json!({ "EXT_lights_image_based": { "lights": [light] } });
    gltf["scenes"][0]["extensions"] =
        serde_json::json!({ "EXT_lights_image_based": { "light": 0 } });
    fs::write(&file.1, gltf.to_string()).unwrap();
    let own = 20.0 / (2.0 * std::f64::consts::PI.sqrt());
    for (options, right) in [
        (&[][..], own),
        (&["--sky", "none"], 0.0),
        (&["--sky", "uniform=2"], 2.0 * std::f64::consts::PI),
    ] {
        let found = irradiance_of(&file, options)[0];
        assert!((found - right).abs() < 5e-3 * right.max(1.0), "{options:?}: {found} {right}");
    }
    // Tables of form factors are of the scene alone.
    let table = file.0.path().join("f.csv");
    relume(&["factors", text(&file.1), "-o", text(&table), "--quiet"]).succeeds();
    let rows = fs::read_to_string(table).unwrap();
    assert!(rows.lines().skip(1).all(|row| row.split(',').nth(1) == Some("floor")), "{rows}");
    let out = file.0.path().join("out");
    let ran =
        relume(&[&["render", text(&file.1), "-o", text(&out)], &QUICK[..]].concat()).succeeds();
    assert!(!ran.err.contains("nothing emits"), "{}", ran.err);
}

#[test]
fn a_scene_in_which_nothing_emits_is_rendered_under_a_sky_and_that_is_said() {
    let (dir, scene) = floor();
    let out = dir.path().join("out");
    let ran =
        relume(&[&["render", text(&scene), "-o", text(&out)], &QUICK[..]].concat()).succeeds();
    let said: Vec<&str> = ran.err.lines().filter(|line| line.contains("--sky")).collect();
    assert_eq!(said.len(), 1, "{}", ran.err);
    assert!(!ran.err.contains("nothing-emits"), "{}", ran.err);
    let report = json(&out.join("report.json"));
    assert!(report["frames"][0]["energy"]["emitted_w"].as_f64().unwrap() > 1.0);
    // Without pictures nothing is solved, and what to add is said.
    relume(&["solve", text(&scene), "--tolerance", "0.3"]).fails(1, &["--sky uniform=1"]);
}

#[test]
fn runs_in_other_light_are_not_continued() {
    let (dir, scene) = floor();
    let out = dir.path().join("out");
    let run = |sky: &str, more: &[&str]| {
        let start = ["render", text(&scene), "-o", text(&out), "--sky", sky];
        relume(&[&start[..], &QUICK[..], more].concat())
    };
    run("overcast", &[]).succeeds();
    assert_eq!(json(&out.join("report.json"))["options"]["outside"], "--sky overcast");
    run("overcast", &["--resume"]).succeeds();
    run("uniform=1", &["--resume"]).fails(1, &["outside"]);
}

#[test]
fn a_day_is_verified_and_described() {
    let (_dir, scene) = room();
    let light = ["--sky", "clear", "--sun", "48,0,2026-06-21T12:00+02:00", "--day", "04:00..12:00"];
    let verify = ["verify", text(&scene), "--tolerance", "0.4", "--frames", "0-19x6"];
    relume(&[&verify[..], &light].concat()).says(&["4 frames equal"]);
    relume(&[&["info", text(&scene)], &light[..]].concat()).says(&["outside", "sun at azimuth"]);
}

#[test]
fn what_is_wrong_is_named_with_its_remedy() {
    let (_dir, scene) = floor();
    let wrong: [(&[&str], i32, &str); 9] = [
        (&["--sky", "blue"], 2, "uniform=L"),
        (&["--sky", "clear"], 1, "--sun"),
        (&["--sun", "1,2,3,4"], 2, "AZIMUTH,ELEVATION"),
        (&["--sun", "0,120"], 1, "-90 to 90"),
        (&["--day", "06:00..18:00"], 2, "--sun"),
        (&["--sun", "10,20", "--day", "06:00..18:00"], 2, "LATITUDE"),
        (&["--ground", "0.2"], 2, "--sky"),
        (&["--environment", "none.hdr"], 1, "none.hdr"),
        (&["--sky", "uniform=1", "--environment", "none.hdr"], 2, "cannot be used with"),
    ];
    for (options, code, said) in wrong {
        relume(&[&["solve", text(&scene)], options].concat()).fails(code, &[said]);
    }
    let factors = ["factors", text(&scene), "--sky", "uniform=1"];
    relume(&factors).fails(2, &["--sky"]);
}
