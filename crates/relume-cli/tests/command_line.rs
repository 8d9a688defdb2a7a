//! The command as a user meets it: messages, exit codes, files.
//!
//! Runs the binary itself. Scenes are the demonstrations, written into a temporary directory.

use std::fs;
use std::path::Path;

use crate::common::{json, relume, room, text};
use glam::{DQuat, DVec3};
use relume::export::write_glb;
use relume::scene::SceneBuilder;
use serde_json::Value;

fn frames_of(report: &Value) -> Vec<u64> {
    report["frames"].as_array().unwrap().iter().map(|f| f["frame"].as_u64().unwrap()).collect()
}

fn names_in(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn wrong_usage_is_explained() {
    relume(&[]).fails(2, &["Usage: relume [OPTIONS] <COMMAND>", "demo", "render"]);
    relume(&["solve"]).fails(2, &["SCENE"]);
    relume(&["render", "a.glb"]).fails(2, &["--output"]);
    for (flag, value, message) in [
        ("--tolerance", "0", "between 0 and 1"),
        ("--tolerance", "-0.1", "between 0 and 1"),
        ("--tolerance", "1", "between 0 and 1"),
        ("--tolerance", "NaN", "between 0 and 1"),
        ("--frames", "9-3", "runs backwards: write 3-9"),
        ("--frames", "", "write frames like"),
        ("--frames", "-3", "is not a frame number"),
        ("--fps", "0", "above 0"),
        ("--oracle", "magic", "form-factor=EPS"),
        ("--update", "magic", "scratch"),
        ("--threads", "0", "from 1 to"),
        ("--max-memory", "lots", "4G"),
    ] {
        relume(&["solve", "a.glb", flag, value]).fails(2, &[message]);
    }
    for (flag, value, message) in
        [("--size", "0x0", "640x480"), ("--exposure", "bright", "auto"), ("--shading", "x", "flat")]
    {
        relume(&["render", "a.glb", "-o", "out", flag, value]).fails(2, &[message]);
    }
    relume(&["solve", "a.glb", "--resume"]).fails(2, &["nothing to resume from", "help:"]);
}

#[test]
fn help_states_units_defaults_and_examples() {
    let help = relume(&["render", "--help"]).succeeds().out;
    for part in ["0-24x6", "[default: 24]", "0.02", "4G", "640x480", "[default: auto]", "gouraud"] {
        assert!(help.contains(part), "{part}");
    }
    assert!(relume(&["--version"]).succeeds().out.starts_with("relume "));
}

#[test]
fn a_file_that_is_missing_or_broken_is_one_clear_message() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("missing.glb");
    let broken = dir.path().join("broken.glb");
    fs::write(&broken, b"glTF\x02\0\0\0 and then nothing").unwrap();
    for command in ["info", "check", "solve"] {
        for file in [&missing, &broken, &dir.path().to_owned()] {
            let ran = relume(&[command, text(file)]);
            ran.fails(1, &["error: ", text(file), "\n  help: "]);
            assert_eq!(ran.out, "");
        }
    }
    let out = dir.path().join("out");
    relume(&["render", text(&missing), "-o", text(&out)]).fails(1, &["missing.glb"]);
    assert!(!out.exists(), "nothing may be left behind");
}

#[test]
fn info_says_what_was_read() {
    let (_dir, scene) = room();
    let out = relume(&["info", text(&scene)]).succeeds().out;
    for part in [
        "scene      room",
        "7 bodies, 7 surfaces, 7 patches",
        "frames 0-19 at 24 fps (20 in all), 1 of 7 bodies moving",
        "left wall",
        "sum 81.59, from 0.49 m2",
        "perspective, 74.0 degrees high",
    ] {
        assert!(out.contains(part), "`{part}` is missing in:\n{out}");
    }
}

#[test]
fn check_finds_nothing_wrong_with_the_demonstrations() {
    let (_dir, scene) = room();
    let out = relume(&["check", text(&scene)]).succeeds().out;
    assert!(out.ends_with("room: nothing wrong found\n"), "{out}");
}

#[test]
fn frames_outside_the_animation_are_refused() {
    let (_dir, scene) = room();
    relume(&["solve", text(&scene), "--frames", "0-30"])
        .fails(1, &["frame 30 is outside the animation, which has frames 0-19 at 24 fps", "help:"]);
}

// Over 60 lines: one run, looked at from all sides.
#[test]
fn solve_prints_a_summary_and_writes_a_report() {
    let (dir, scene) = room();
    let file = dir.path().join("own.json");
    let out_dir = dir.path().join("out");
    let ran = relume(&[
        "solve",
        text(&scene),
        "-o",
        text(&out_dir),
        "--frames",
        "0-4x2",
        "--tolerance",
        "0.3",
        "--report",
        text(&file),
    ])
    .succeeds();
    assert!(ran.out.starts_with("3 frames, "), "{}", ran.out);
    assert_eq!(ran.err, "");
    assert_eq!(names_in(&out_dir), ["report.json"]);
    let report = json(&out_dir.join("report.json"));
    assert_eq!(report, json(&file));
    assert_eq!(report["schema"], "relume-report/1");
    assert_eq!(report["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["scene"]["name"], "room");
    assert_eq!(report["scene"]["bodies"], 7);
    assert_eq!(report["scene"]["patches"], 7);
    assert_eq!(report["scene"]["bounds"]["max"][1], 3.0);
    assert_eq!(report["options"]["tolerance"], 0.3);
    assert_eq!(report["options"]["frames"], "0-4x2");
    assert!(report["peak_memory_bytes"].as_u64().unwrap() > 0);
    assert_eq!(frames_of(&report), [0, 2, 4]);
    let frame = report["frames"][1].as_object().unwrap();
    let keys: Vec<&str> = frame.keys().map(String::as_str).collect();
    let mut expected = [
        "frame",
        "time_s",
        "moved",
        "elements",
        "leaves",
        "links",
        "dynamic_links",
        "pairs",
        "visited",
        "examined",
        "coarse_examined",
        "reevaluated",
        "visibility_only",
        "brightness_only",
        "followed",
        "extrapolated",
        "certified",
        "changed",
        "promoted",
        "demoted",
        "occlusion_changed",
        "segments",
        "elements_made",
        "elements_reaped",
        "sweeps",
        "gathers",
        "residual",
        "row_sum_error",
        "energy",
        "unbalanced",
        "accuracy",
        "hash",
        "seconds",
    ];
    expected.sort_unstable();
    assert_eq!(keys, expected);
}

#[test]
fn frames_say_how_good_they_are_unless_that_is_off() {
    let (dir, scene) = room();
    let file = dir.path().join("report.json");
    let solve = |more: &[&str]| {
        let fixed = ["solve", text(&scene), "--frames", "0-1", "--tolerance", "0.3"];
        relume(&[&fixed[..], &["--report", text(&file)], more].concat()).succeeds()
    };
    let said = solve(&[]).out;
    assert!(said.contains("irradiance is off by about") && said.contains("nine tenths"), "{said}");
    let accuracy = json(&file)["frames"][1]["accuracy"].clone();
    assert!(accuracy["points"].as_u64().unwrap() >= 4, "{accuracy}");
    let rms = accuracy["rms"].as_f64().unwrap();
    assert!(rms > 0.0 && rms < 1.0, "{accuracy}");
    // The same numbers again, on any number of threads.
    solve(&["--threads", "1"]);
    assert_eq!(json(&file)["frames"][1]["accuracy"], accuracy);
    let said = solve(&["--accuracy", "off"]).out;
    assert!(!said.contains("irradiance is off"), "{said}");
    assert!(json(&file)["frames"][1]["accuracy"].is_null());
    let said = relume(&["errors", text(&scene), "--frames", "0", "--tolerance", "0.3"]).succeeds();
    assert!(said.out.starts_with("frame 0\n") && said.out.contains("W/m2 said"), "{}", said.out);
}

#[test]
fn too_little_memory_is_said_with_the_remedy() {
    let (_dir, scene) = room();
    relume(&["solve", text(&scene), "--max-memory", "64K"]).fails(
        3,
        &[
            "error: ",
            "needs more than the 64.00 KiB of memory allowed",
            "\n  help: raise --max-memory",
        ],
    );
}

#[test]
fn quiet_is_quiet() {
    let (_dir, scene) = room();
    let ran = relume(&["solve", text(&scene), "--frames", "0", "--tolerance", "0.3", "--quiet"])
        .succeeds();
    assert_eq!((ran.out.as_str(), ran.err.as_str()), ("", ""));
}

#[test]
fn resuming_keeps_finished_frames_and_refuses_other_options() {
    let (dir, scene) = room();
    let out = dir.path().join("out");
    let solve = |more: &[&str]| {
        let fixed = ["solve", text(&scene), "-o", text(&out), "--tolerance", "0.3"];
        relume(&[&fixed, more].concat())
    };
    // Nothing to resume from yet: that is no error, so scripts can always say --resume.
    solve(&["--frames", "0-1", "--resume"]).succeeds();
    let path = out.join("report.json");
    // A mark in a finished frame shows that it was kept, not computed again.
    let marked = fs::read_to_string(&path).unwrap().replacen("\"time_s\":0.0", "\"time_s\":9.5", 1);
    assert!(marked.contains("9.5"));
    fs::write(&path, marked).unwrap();
    let ran = solve(&["--frames", "0-2", "--resume", "--threads", "1"]).succeeds();
    assert!(ran.out.starts_with("3 frames (2 finished before), "), "{}", ran.out);
    let report = json(&path);
    assert_eq!(frames_of(&report), [0, 1, 2]);
    assert_eq!(report["frames"][0]["time_s"], 9.5);

    let before = fs::read(&path).unwrap();
    solve(&["--resume", "--fps", "12"]).fails(
        1,
        &["cannot resume from", "fps was 24.0 and is 12.0 now", "help: use the scene and options"],
    );
    assert_eq!(fs::read(&path).unwrap(), before, "a refused run leaves everything as it was");

    let mut changed = fs::read(&scene).unwrap();
    let at = changed.windows(7).position(|w| w == b"ceiling").unwrap();
    changed[at] = b'C';
    fs::write(&scene, changed).unwrap();
    solve(&["--resume"])
        .fails(1, &["the scene file, a file it refers to or the environment has changed"]);

    fs::write(&path, "{ half a rep").unwrap();
    solve(&["--resume"]).fails(1, &["is not a report of relume", "leave out --resume"]);
}

#[test]
fn places_that_cannot_be_written_are_named() {
    let (dir, scene) = room();
    let file = dir.path().join("taken");
    fs::write(&file, "mine").unwrap();
    relume(&["solve", text(&scene), "-o", text(&file)])
        .fails(1, &["taken is a file, not a directory", "help: choose another directory"]);
    let below = file.join("below");
    relume(&["solve", text(&scene), "-o", text(&below)]).fails(1, &["cannot write", "below"]);
    let nowhere = dir.path().join("no/such/report.json");
    relume(&["solve", text(&scene), "--report", text(&nowhere)])
        .fails(1, &["cannot write", "report.json", "help:"]);
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    use std::process::{Command, Stdio};
    let (_dir, scene) = room();
    let mut child = Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(["info", text(&scene)])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let ran = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(ran.stderr).unwrap(), "");
    assert!(ran.status.success());
}

#[test]
fn walls_inside_a_closed_shell_are_solved_only_where_they_may_be_seen() {
    let patches_with = |lamp_at: f64| {
        let mut b = SceneBuilder::new("crate");
        let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
        let bright = b.material("bright", [0.0; 3], [9.0; 3]);
        let node = b.node("crate", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid(node, "crate", thin, DVec3::splat(-0.5), DVec3::splat(0.5));
        let node = b.node("lamp", None, DVec3::Y * lamp_at, DQuat::IDENTITY);
        b.polygon(node, "lamp", bright, &[DVec3::ZERO, DVec3::X * 0.2, DVec3::Z * 0.2]);
        let dir = tempfile::tempdir().unwrap();
        let [file, report] = ["crate.glb", "report.json"].map(|name| dir.path().join(name));
        write_glb(&b.build().unwrap(), &file).unwrap();
        let all = ["solve", text(&file), "--tolerance", "0.5", "--report", text(&report)];
        relume(&all).succeeds();
        json(&report)["scene"]["patches"].as_u64()
    };
    assert_eq!((patches_with(1.0), patches_with(0.0)), (Some(7), Some(13)));
}
