//! The first commands that somebody types at a file of others: light where there is none, views, sizes.

use std::path::{Path, PathBuf};

use crate::common::{json, relume, text};
use glam::{DQuat, DVec3};
use relume::export::write_glb;
use relume::scene::SceneBuilder;
use relume_picture::picture::is_whole_png;

/// A dark room with a crate in it, of which nothing emits, in a file.
fn dark_room(dir: &Path) -> PathBuf {
    let mut b = SceneBuilder::new("cellar");
    let wall = b.material("whitewash", [0.7; 3], [0.0; 3]);
    let wood = b.material("wood", [0.4, 0.3, 0.2], [0.0; 3]);
    let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(room, "walls", wall, DVec3::ZERO, DVec3::new(4.0, 3.0, 4.0));
    let crate_ = b.node("crate", None, DVec3::new(1.0, 0.5, 1.0), DQuat::IDENTITY);
    b.cuboid(crate_, "crate", wood, DVec3::ZERO, DVec3::ONE);
    let path = dir.join("cellar.glb");
    write_glb(&b.build().unwrap(), &path).unwrap();
    path
}

const HELP: [&str; 4] = [
    "nothing in cellar emits light",
    "--sky uniform=1",
    "--emit MATERIAL=RADIANCE",
    "`whitewash`, `wood`",
];

#[test]
fn in_the_dark_sensors_read_zero_and_are_told_how_to_light_it() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dark_room(dir.path());
    let sensors = dir.path().join("sensors.txt");
    std::fs::write(&sensors, "2 1 2 0 1 0\n").unwrap();
    let told = relume(&["probe", text(&scene), text(&sensors)]).succeeds();
    assert!(HELP.iter().all(|part| told.err.contains(part)), "{}", told.err);
    let row: Vec<&str> = told.out.lines().nth(1).expect("one row").split(',').collect();
    assert_eq!(row[row.len() - 3..], ["0", "0", "0"], "{}", told.out);
}

#[test]
fn nothing_is_solved_where_nothing_emits() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dark_room(dir.path());
    let out = dir.path().join("out");
    for command in [
        vec!["render", text(&scene), "-o", text(&out), "--sky", "uniform=0"],
        vec!["solve", text(&scene)],
    ] {
        relume(&command).fails(1, &HELP);
    }
    assert!(!out.exists());
    relume(&["factors", text(&scene), "--tolerance", "0.3"]).succeeds();
}

#[test]
fn a_material_that_is_told_to_shine_lights_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dark_room(dir.path());
    let out = dir.path().join("out");
    let render = |more: &[&str]| {
        let always =
            ["render", text(&scene), "-o", text(&out), "--size", "64x48", "--tolerance", "0.3"];
        relume(&[&always[..], more].concat())
    };
    render(&["--emit", "wod=1"])
        .fails(1, &["no material is called `wod`; there are `wood`, `whitewash`"]);
    render(&["--hide", "rom"]).fails(1, &["no node is called `rom`; there are"]);
    render(&["--emit", "wood"]).fails(2, &["lamp=40"]);
    render(&["--reflect", "wood=1.5"]).fails(1, &["`wood`: its reflectance is to be 1.5"]);
    render(&["--emit", "wood=2", "--reflect", "white*=0.5,0.5,0.25"]).succeeds();
    let report = json(&out.join("report.json"));
    // 6 m2, of which the floor has none: pi L A = 12 pi in each of three channels.
    let emitted = report["frames"][0]["energy"]["emitted_w"].as_f64().unwrap();
    assert!((emitted / (3.0 * 12.0 * std::f64::consts::PI) - 1.0).abs() < 1e-5, "{emitted}");
    assert_eq!(report["options"]["edits"][0], "--emit wood=2");
    render(&["--emit", "wood=3", "--resume"]).fails(1, &["edits was"]);
    relume(&["info", text(&scene), "--emit", "wood=2"])
        .says(&["wood", "emits (6.283, 6.283, 6.283)"]);
    relume(&["verify", "--demo", "room", "--hide", "lamp"]).fails(2, &["relume demo"]);
}

/// A statue with eyes that glow, in a file.
fn statue(dir: &Path) -> PathBuf {
    let mut b = SceneBuilder::new("statue");
    let stone = b.material("stone", [0.6; 3], [0.0; 3]);
    let glow = b.material("glow", [0.5; 3], [1.0; 3]);
    let node = b.node("statue", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(node, "body", stone, DVec3::ZERO, DVec3::new(1.0, 2.0, 1.0));
    b.cuboid(node, "eyes", glow, DVec3::new(0.4, 1.7, 1.01), DVec3::new(0.6, 1.75, 1.02));
    let path = dir.join("statue.glb");
    write_glb(&b.build().unwrap(), &path).unwrap();
    path
}

const SMALL: [&str; 4] = ["--size", "64x48", "--tolerance", "0.3"];

#[test]
fn a_sky_is_added_where_what_emits_lights_little_of_what_is_seen() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, out) = (statue(dir.path()), dir.path().join("out"));
    let emitted = |more: &[&str]| {
        let ran = relume(&[&["render", text(&scene), "-o", text(&out)], &SMALL[..], more].concat());
        let ran = ran.succeeds();
        let watts = json(&out.join("report.json"))["frames"][0]["energy"]["emitted_w"].clone();
        (ran.err, watts.as_f64().unwrap())
    };
    let (said, with_sky) = emitted(&[]);
    assert!(said.contains("% of what the view shows: --sky overcast=3 --sun"), "{said}");
    assert!(said.contains("--sky none leaves it out"), "{said}");
    // The report knows the light, and so does a run that goes on.
    let chosen = |out: &Path| json(&out.join("report.json"))["options"]["outside"].clone();
    let light = chosen(&out);
    assert!(said.contains(light.as_str().expect("a light was chosen")), "{light} of {said}");
    let other = ["--resume", "--eye=-3,1,-3", "--look-at=0.5,1,0.5"];
    let again = [&["render", text(&scene), "-o", text(&out)], &SMALL[..], &other].concat();
    relume(&again).fails(1, &["outside was --sky overcast=3 --sun"]);
    let (said, without) = emitted(&["--sky", "none"]);
    assert!(!said.contains("--sky"), "{said}");
    assert!(with_sky > 10.0 * without, "{with_sky} {without}");
    // Chosen light is left as it is, and so is a room that its lamp lights.
    let (said, _) = emitted(&["--emit", "glow=2"]);
    assert!(!said.contains("--sky"), "{said}");
    let demo = ["demo", "room", "-o", text(&out), "--frames", "0"];
    let ran = relume(&[&demo[..], &SMALL].concat()).succeeds();
    assert!(!ran.err.contains("--sky"), "{}", ran.err);
}

#[test]
fn a_closed_room_without_a_lamp_gets_one_for_its_picture() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, out) = (dark_room(dir.path()), dir.path().join("out"));
    let render = ["render", text(&scene), "-o", text(&out)];
    let ran = relume(&[&render[..], &SMALL].concat()).succeeds();
    assert!(ran.err.contains("a lamp is put where the view is from"), "{}", ran.err);
    assert!(!ran.err.contains("almost no light"), "{}", ran.err);
    // Seen from outside, through the backs of its walls, it is lit from its middle.
    let from_outside = ["--eye", "20,9,30"];
    let ran = relume(&[&render[..], &SMALL, &from_outside].concat()).succeeds();
    assert!(ran.err.contains("a lamp is put in the middle of the scene"), "{}", ran.err);
    assert!(!ran.err.contains("almost no light"), "{}", ran.err);
    // Under a sky that was asked for it stays dark, and that is said in place of a balance of nothing.
    let ran = relume(&[&render[..], &SMALL, &["--sky", "uniform=1"]].concat()).succeeds();
    assert!(ran.out.contains("next to no light from outside gets in"), "{}", ran.out);
    assert!(!ran.out.contains("unbalanced"), "{}", ran.out);
}

#[test]
fn rough_pictures_are_drawn_without_solving() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, out) = (statue(dir.path()), dir.path().join("out"));
    let render = ["render", text(&scene), "-o", text(&out), "--size", "64x48", "--preview"];
    relume(&[&render[..], &["--turntable", "3"]].concat()).says(&["3 rough pictures"]);
    let picture = |k: u32| std::fs::read(out.join(format!("preview-000{k}.png"))).unwrap();
    assert!(is_whole_png(&picture(0)) && picture(0) != picture(1) && picture(1) != picture(2));
    assert!(!out.join("report.json").exists() && !out.join("frame-0000.png").exists());
    relume(&[&render[..], &["--resume"]].concat()).fails(2, &["--preview"]);
}

#[test]
fn pictures_are_coarser_than_numbers_unless_told() {
    let dir = tempfile::tempdir().unwrap();
    let mut b = SceneBuilder::new("lamp");
    let paper = b.material("paper", [0.7; 3], [1.0; 3]);
    let node = b.node("lamp", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(node, "lamp", paper, DVec3::ZERO, DVec3::ONE);
    let (scene, out) = (dir.path().join("lamp.glb"), dir.path().join("out"));
    write_glb(&b.build().unwrap(), &scene).unwrap();
    let tolerance = |command: &[&str]| {
        relume(&[command, &["-o", text(&out)]].concat()).succeeds();
        json(&out.join("report.json"))["options"]["tolerance"].clone()
    };
    let render = ["render", text(&scene), "--size", "64x48"];
    assert_eq!(tolerance(&render), 0.1);
    assert_eq!(tolerance(&[&render[..], &["--tolerance", "0.3"]].concat()), 0.3);
    assert_eq!(tolerance(&["solve", text(&scene)]), 0.02);
}

#[test]
fn a_still_scene_on_a_turntable_is_solved_once() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dark_room(dir.path());
    let out = dir.path().join("out");
    relume(&[
        "render",
        text(&scene),
        "-o",
        text(&out),
        "--size",
        "64x48",
        "--tolerance",
        "0.3",
        "--emit",
        "wood=2",
        "--turntable",
        "3",
        "--eye",
        "2,1.5,9",
        "--look-at",
        "2,1,2",
    ])
    .says(&["3 frames"]);
    let report = json(&out.join("report.json"));
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 3);
    assert!(frames[0]["examined"].as_u64().unwrap() > 0);
    assert!(frames[1..].iter().all(|f| f["examined"] == 0 && f["hash"] == frames[0]["hash"]));
    let picture = |k: u32| std::fs::read(out.join(format!("frame-000{k}.png"))).unwrap();
    assert!(picture(0) != picture(1) && picture(1) != picture(2));
}

#[test]
fn a_view_into_the_dark_is_said_once() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dark_room(dir.path());
    let out = dir.path().join("out");
    let away = ["--eye", "2,1.5,9", "--look-at", "2,1.5,20", "--turntable", "2"];
    let render = [
        "render",
        text(&scene),
        "-o",
        text(&out),
        "--size",
        "64x48",
        "--tolerance",
        "0.3",
        "--emit",
        "wood=2",
    ];
    let ran = relume(&[&render[..], &away[..]].concat()).succeeds();
    assert_eq!(ran.err.matches("the view sees almost no light").count(), 1, "{}", ran.err);
    assert!(ran.err.contains("--overview"), "{}", ran.err);
    let ran = relume(&render).succeeds();
    assert!(!ran.err.contains("almost no light"), "{}", ran.err);
}

/// The statue with the file's camera so far away that nothing of it is made out, in a file.
fn far_off(dir: &Path, distance_m: f64) -> PathBuf {
    let path = statue(dir);
    let bytes = std::fs::read(&path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let json_bytes = word(12);
    let mut json: serde_json::Value =
        serde_json::from_slice(&bytes[20..20 + json_bytes]).expect("its JSON");
    json["cameras"] =
        serde_json::json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]);
    let nodes = json["nodes"].as_array_mut().unwrap();
    nodes.push(
        serde_json::json!({"name": "lookout", "camera": 0, "translation": [0.5, 1, distance_m]}),
    );
    let camera = nodes.len() - 1;
    json["scenes"][0]["nodes"].as_array_mut().unwrap().push(camera.into());
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + json_bytes..];
    let length = (20 + text.len() + rest.len()) as u32;
    let head = [&bytes[..8], &length.to_le_bytes(), &(text.len() as u32).to_le_bytes(), b"JSON"];
    std::fs::write(&path, [&head.concat()[..], &text, rest].concat()).unwrap();
    path
}

#[test]
fn a_camera_that_shows_a_speck_gives_way_to_an_overview() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let said = |distance_m: f64, more: &[&str]| {
        let scene = far_off(dir.path(), distance_m);
        let always = ["render", text(&scene), "-o", text(&out), "--sky", "uniform=1"];
        relume(&[&always[..], &SMALL[..], more].concat()).succeeds().err
    };
    let whole = "an overview is shown instead";
    let speck = said(200.0, &[]);
    assert!(
        speck.contains("camera lookout shows the scene on 0.0 %") && speck.contains(whole),
        "{speck}"
    );
    for (distance_m, more) in [(6.0, vec![]), (200.0, vec!["--camera", "lookout"])] {
        let kept = said(distance_m, &more);
        assert!(!kept.contains(whole), "{kept}");
    }
}
