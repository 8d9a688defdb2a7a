//! `--max-memory` is kept in every command, from the first file on; running out is a message, with an exit
//! code of its own, and takes nothing that is finished.
#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Ran, json, relume, room, text};
use glam::{DQuat, DVec3};
use relume::export::write_glb;
use relume::scene::{NodeId, SceneBuilder};
use tempfile::TempDir;

const MIB: u64 = 1 << 20;

/// Runs the command within so many MiB; it must end with exit code 3, say these texts, and never have held
/// more than what is documented.
#[track_caller]
fn runs_out(arguments: &[&str], mib: u64, texts: &[&str]) -> Ran {
    let limit = format!("{mib}M");
    let most = mib * MIB + (mib * MIB / 10).max(32 * MIB);
    let (ran, peak) = measured(&[arguments, &["--max-memory", &limit]].concat(), most);
    assert!(peak <= most, "{} MiB of {mib}: {}", peak / MIB, ran.err);
    ran.fails(3, &[texts, &["of memory allowed", "\n  help: raise --max-memory"]].concat());
    ran
}

/// Runs the command; the most memory it was seen to hold, bytes. It is ended where that is above a bound.
fn measured(arguments: &[&str], most: u64) -> (Ran, u64) {
    let dir = tempfile::tempdir().unwrap();
    let (out, err) = (dir.path().join("out"), dir.path().join("err"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(arguments)
        .stdout(File::create(&out).unwrap())
        .stderr(File::create(&err).unwrap())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    let code = loop {
        let held = fs::read_to_string(&status).unwrap_or_default();
        let line = held.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes =
            line.map(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().unwrap());
        peak = kilobytes.map_or(peak, |k| k * 1024);
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        if peak > most {
            let _ = child.kill();
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    };
    let text = |path| fs::read_to_string(path).unwrap();
    (Ran { code, out: text(out), err: text(err) }, peak)
}

/// A file of zeros that takes no room on the disk.
fn zeros(dir: &Path, name: &str, bytes: u64) -> PathBuf {
    let path = dir.join(name);
    File::create(&path).unwrap().set_len(bytes).unwrap();
    path
}

/// A lit box; from 1 s on with a crowd of boxes in it.
fn crowd() -> (TempDir, PathBuf) {
    let mut b = SceneBuilder::new("crowd");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.5; 3], [3.0; 3]);
    let node = |b: &mut SceneBuilder, name: &str| -> NodeId {
        b.node(name, None, DVec3::ZERO, DQuat::IDENTITY)
    };
    let room = node(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, DVec3::ONE);
    let lit = node(&mut b, "lamp");
    b.cuboid(lit, "lamp", lamp, DVec3::new(0.4, 0.9, 0.4), DVec3::new(0.6, 0.95, 0.6));
    let crowd = node(&mut b, "crowd");
    for k in 0..216 {
        let at =
            DVec3::new(f64::from(k % 6), f64::from(k / 6 % 6), f64::from(k / 36)) * 0.14 + 0.05;
        b.cuboid(crowd, &format!("box {k}"), grey, at, at + 0.06);
    }
    b.animate_presence(crowd, vec![(0.0, false), (1.0, true)]);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("crowd.glb");
    write_glb(&b.build().unwrap(), &path).unwrap();
    (dir, path)
}

/// Frames 0 and 1 of the crowd, of which the second needs more than [`CROWD_MIB`].
const TWO: [&str; 6] = ["--fps", "1", "--frames", "0-1", "--oracle", "form-factor=0.5"];
const CROWD_MIB: u64 = 16;

/// Names in a directory.
fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    // What an ended run leaves of its lock locks nothing.
    names.retain(|name| name != ".relume.lock");
    names.sort_unstable();
    names
}

#[test]
fn files_larger_than_the_limit_are_refused_before_they_are_read() {
    let (dir, scene) = room();
    let size = 1 << 30;
    for name in ["a.glb", "a.gltf", "a.vs3"] {
        let file = zeros(dir.path(), name, size);
        for command in ["info", "check", "solve", "factors"] {
            runs_out(&[command, text(&file)], 20, &[name, "1.00 GiB"]);
        }
    }
    for name in ["a.flat", "a.svg"] {
        let file = zeros(dir.path(), name, size);
        runs_out(&["flat", text(&file)], 20, &[name, "1.00 GiB"]);
    }
    let sensors = zeros(dir.path(), "a.csv", size);
    runs_out(&["probe", text(&scene), text(&sensors)], 20, &["a.csv", "1.00 GiB"]);
}

#[test]
fn what_a_file_declares_is_refused_before_memory_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let solve = |json: &str, mib, texts: &[&str]| {
        let path = dir.path().join("scene.gltf");
        fs::write(&path, json).unwrap();
        runs_out(&["solve", text(&path)], mib, texts);
    };
    let head = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}], "materials": [{"#;
    // A million points without data, 24 bytes each.
    let points = r#"}], "accessors": [{"componentType": 5126, "count": 1048576, "type": "VEC3"}]}"#;
    solve(&format!("{head}{points}"), 20, &["accessor 0 of mesh", "24.00 MiB"]);
    // A picture whose file is small.
    let picture = image::RgbImage::new(6000, 6000);
    picture.save(dir.path().join("wall.png")).unwrap();
    let image = r#""pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0}],
        "images": [{"uri": "wall.png"}], "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}]}"#;
    solve(&format!("{head}{image}"), 40, &["image 0", "240.33 MiB"]);
    // A buffer beside the file.
    zeros(dir.path(), "points.bin", 1 << 30);
    let buffer = r#"}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"uri": "points.bin", "byteLength": 1000000000}]}"#;
    solve(&format!("{head}{buffer}"), 40, &["buffer 0", "points.bin", "953.67 MiB"]);
}

#[test]
fn reading_that_grows_is_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("nodes.gltf");
    let nodes = vec![r#"{"name": "node", "translation": [1, 2, 3]}"#; 250_000].join(",");
    let json = format!(r#"{{"asset": {{"version": "2.0"}}, "nodes": [{nodes}]}}"#);
    fs::write(&path, json).unwrap();
    for command in ["info", "check", "solve", "render", "factors", "verify", "bench"] {
        let out = dir.path().join("out");
        let to: &[&str] = if command == "render" { &["-o", text(&out)] } else { &[] };
        runs_out(&[&[command, text(&path)], to].concat(), 40, &["reading", "nodes.gltf"]);
    }
}

#[test]
fn a_solve_ends_with_the_frame_s_name_and_can_be_resumed() {
    let (dir, scene) = crowd();
    let out = dir.path().join("out");
    let solve = [&["solve", text(&scene), "-o", text(&out)], &TWO[..]].concat();
    runs_out(&solve, CROWD_MIB, &["frame 1", "stay"]);
    assert_eq!(json(&out.join("report.json"))["frames"].as_array().unwrap().len(), 1);
    assert_eq!(names(&out), ["report.json"]);
    relume(&[&solve[..], &["--resume"]].concat()).says(&["2 frames (1 finished before)"]);
}

#[test]
fn pictures_that_are_drawn_stay_and_no_other_is_begun() {
    let (dir, scene) = crowd();
    let out = dir.path().join("out");
    let render =
        [&["render", text(&scene), "-o", text(&out), "--size", "64x48"], &TWO[..]].concat();
    runs_out(&render, CROWD_MIB, &["frame 1"]);
    assert_eq!(names(&out), ["frame-0000.png", "report.json"]);
    let large = ["render", text(&scene), "-o", text(&out), "--size", "8192x8192"];
    runs_out(&large, 50, &["a picture of 8192x8192", "384.00 MiB"]);
    assert_eq!(names(&out), ["frame-0000.png", "report.json"]);
}

#[test]
fn rows_of_frames_that_are_finished_stay() {
    let (dir, scene) = crowd();
    let (sensors, out) = (dir.path().join("sensors.txt"), dir.path().join("out"));
    fs::write(&sensors, "0.5 0.02 0.5 0 1 0\n").unwrap();
    fs::create_dir(&out).unwrap();
    let table = out.join("table.csv");
    let frames_of_rows = || -> Vec<String> {
        let rows = fs::read_to_string(&table).unwrap();
        let mut frames: Vec<String> =
            rows.lines().skip(1).map(|row| row.split(',').next().unwrap().to_owned()).collect();
        frames.dedup();
        frames
    };
    let probe = ["probe", text(&scene), text(&sensors), "-o", text(&table)];
    let factors = ["factors", text(&scene), "--by", "body", "-o", text(&table)];
    for command in [&probe[..], &factors] {
        let _ = fs::remove_file(&table);
        runs_out(&[command, &TWO[..]].concat(), CROWD_MIB, &["frame 1"]);
        assert_eq!((frames_of_rows(), names(&out)), (vec!["0".into()], vec!["table.csv".into()]));
    }
}

#[test]
fn sessions_side_by_side_share_the_limit() {
    let (_dir, scene) = room();
    let flags = ["--oracle", "form-factor=0.008,0.004", "--frames", "0-1"];
    let with = |first: &[&str]| -> Vec<String> {
        let scene = [text(&scene)];
        [first, &scene, &flags].concat().into_iter().map(str::to_owned).collect()
    };
    // One of them fits.
    let alone = with(&["solve", "--max-memory", "28M"]);
    relume(&alone.iter().map(String::as_str).collect::<Vec<_>>()).succeeds();
    for several in [&["verify"][..], &["bench", "--no-pictures"], &["bench", "--compare"]] {
        let several = with(several);
        let several: Vec<&str> = several.iter().map(String::as_str).collect();
        // Said by the engine, which counts what it is about to take, or by the watch, which sees what is held.
        runs_out(&several, 28, &["frame "]);
    }
}

#[test]
fn the_plane_is_limited_too() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("many.flat");
    let mut scene = String::from("segment floor 0 0 40 0 reflectance 0.5 emit 1\n");
    for k in 0..1_000 {
        let (x, y) = (k % 40, 1 + k / 40);
        scene += &format!("segment s{k} {x} {y} {x}.3 {y}.2 reflectance 0.5\n");
    }
    scene += "body mover\nat 0 1 0.5\nat 1 2 0.5\nsegment mover 0 0 0.1 0.1\n";
    fs::write(&path, scene).unwrap();
    for more in [&[][..], &["--verify"], &["--bench"], &["--bench", "--compare"]] {
        let ran = runs_out(&[&["flat", text(&path)], more].concat(), 10, &["frame 0 needs"]);
        assert_eq!(ran.out, "");
    }
}
