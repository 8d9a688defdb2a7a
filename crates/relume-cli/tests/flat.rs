//! `relume flat`: reports, comparison with cold builds, figures, messages.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{json, relume, text};
use tempfile::TempDir;

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

#[test]
fn a_scene_gives_a_report_and_drawings() {
    let dir = TempDir::new().unwrap();
    let (out, events) = (dir.path().join("out"), dir.path().join("events.csv"));
    let room = scene("room.flat");
    let arguments = ["flat", text(&room), "-o", text(&out), "--events", text(&events)];
    relume(&[&arguments[..], &["--frames", "0-24x12", "--epsilon", "0.1"]].concat()).succeeds();
    let report = json(&out.join("report.json"));
    assert_eq!(report["schema"], "relume-flat/1");
    assert_eq!(report["segments"], 8);
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 3);
    assert_eq!(frames[1]["moved"][0], "lamp");
    assert!(frames[2]["examined"].as_u64() < frames[0]["examined"].as_u64());
    let svg = fs::read_to_string(out.join("frame-0024.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("#e23c8e"), "no links are drawn");
    let events = fs::read_to_string(events).unwrap();
    assert!(events.lines().any(|line| line.starts_with("24,demoted,")), "{events}");
}

#[test]
fn every_scene_that_ships_agrees_with_cold_builds() {
    for name in ["triangle", "duct", "wedge", "screen", "approach", "gutter", "room", "studio"] {
        let ending = if name == "studio" { "svg" } else { "flat" };
        let file = scene(&format!("{name}.{ending}"));
        for update in ["certificate", "reinspect"] {
            let more = ["--verify", "--fps", "5", "--epsilon", "0.1", "--update", update];
            let ran = relume(&[&["flat", text(&file)], &more[..]].concat());
            ran.says(&["equal: links bit for bit"]);
        }
    }
    // What is extrapolated is not a function of the instant, and that is found out.
    let gutter = scene("gutter.flat");
    relume(&["flat", text(&gutter), "--verify", "--update", "extrapolate"]).fails(1, &["differs"]);
}

#[test]
fn the_bench_is_that_of_space() {
    let dir = TempDir::new().unwrap();
    let (room, numbers) = (scene("room.flat"), dir.path().join("bench.json"));
    let bench = |more: &[&str]| {
        let begin = ["flat", text(&room), "--bench", "--frames", "0-8", "--json", text(&numbers)];
        relume(&[&begin, more].concat())
    };
    bench(&["--every", "2"]).says(&[
        "room: oracle form-factor=0.05,0.02, update certificate, ",
        "\nroom           8  ",
        "\nfrom scratch  4 frames built both ways",
        " of links with a moved end",
        " bytes a pair (",
    ]);
    let value = json(&numbers);
    assert_eq!(value["schema"], "relume-bench/1");
    let frame = &value["frames"][0];
    assert_eq!(frame["report"]["hash"], frame["from_scratch"]["report"]["hash"]);
    assert!(frame["from_scratch"]["report"]["dynamic_links"].as_u64() > Some(0));
    assert!(value["memory_each"]["pair_bytes"].as_f64().unwrap() > 0.0);
    bench(&["--compare"]).says(&["room: oracle form-factor=0.05,0.02, ", "\ncertificate  "]);
    let value = json(&numbers);
    assert_eq!(value["schema"], "relume-strategies/1");
    for exact in 0..3 {
        let row = &value["strategies"][exact]["means"];
        let missed = (row["missed_states"].as_f64(), row["missed_occlusions"].as_f64());
        assert_eq!((row["equal_frames"].as_u64(), missed), (Some(8), (Some(0.0), Some(0.0))));
    }
    let judged = |k: usize| value["strategies"][k]["means"]["examined"].as_f64();
    assert!(judged(2) < judged(1));
}

#[test]
fn the_figures_kept_are_those_the_command_draws() {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/figures");
    let dir = TempDir::new().unwrap();
    for figure in ["0.1", "0.2", "0.3", "0.4"] {
        let ran = relume(&["flat", "figure", figure, "-o", text(dir.path())]).succeeds();
        for name in ran.out.lines() {
            let (new, old) = (dir.path().join(name), kept.join(name));
            let bytes = |path: &Path| fs::read(path).unwrap_or_default();
            let same = name.ends_with(".png") || bytes(&new) == bytes(&old);
            assert!(same, "draw it anew: relume flat figure {figure} -o docs/figures");
            assert!(old.exists() && bytes(&new).len() > 1000, "{name}");
        }
    }
}

/// They follow every change to oracles and pictures, and hold times: only that they are drawn.
#[test]
fn the_figures_of_space_are_drawn() {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/figures");
    let dir = TempDir::new().unwrap();
    let ran = relume(&["figure", "0.5", "-o", text(dir.path())]).succeeds();
    assert_eq!(ran.out, "figure-0.5.svg\nfigure-0.5.png\n");
    let svg = fs::read_to_string(dir.path().join("figure-0.5.svg")).unwrap();
    assert_eq!(
        svg.matches("<image ").count(),
        12,
        "a picture for each of three sequences and four frames"
    );
    for name in ["figure-0.5.svg", "figure-0.5.png", "table-0.1.svg", "table-0.1.png"] {
        assert!(kept.join(name).exists(), "draw it: relume figure {} -o docs/figures", &name[..9]);
    }
    let table = fs::read_to_string(kept.join("table-0.1.svg")).unwrap();
    assert!(table.starts_with("<svg"));
}

/// Runs what the tutorial says, in the directory of the scenes, and compares what it prints.
#[test]
fn the_tutorial_is_right() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tutorial = fs::read_to_string(root.join("../../docs/tutorial.md")).unwrap();
    let mut blocks = 0;
    for block in tutorial.split("```console\n").skip(1) {
        let block = block.split("```").next().unwrap();
        let (command, expected) = block.split_once('\n').unwrap();
        let words = command.strip_prefix("$ relume ").expect("a command").split_whitespace();
        let ran = std::process::Command::new(env!("CARGO_BIN_EXE_relume"))
            .args(words)
            .current_dir(root.join("scenes"))
            .output()
            .unwrap();
        assert_eq!(String::from_utf8(ran.stdout).unwrap(), expected, "{command}");
        blocks += 1;
    }
    assert!(blocks >= 8, "{blocks}");
}

#[test]
fn a_bad_file_ends_with_the_exit_code_of_a_bad_file_in_space() {
    let dir = TempDir::new().unwrap();
    let endless = "body b\nat 0 0 0\nat 1e9 0 0\nsegment p 0 0 1 0\n";
    for (name, content, what) in [
        ("empty.flat", "", "no segments"),
        ("far.flat", "segment p 0 0 1e300 0\n", "larger than 1e12"),
        ("bright.flat", "segment p 0 0 1 0 emit 1e38\n", "between 0 and 1e30"),
        ("endless.flat", endless, "more frames than can be counted"),
        ("deep.svg", &format!("<svg>{}", "<g>".repeat(5_000)), "no XML"),
    ] {
        let file = dir.path().join(name);
        fs::write(&file, content).unwrap();
        relume(&["flat", text(&file)]).fails(1, &[what]);
        relume(&["solve", text(&file)]).fails(1, &["error"]);
    }
    relume(&["flat", text(dir.path())]).fails(1, &["cannot read"]);
}

/// Bright walls through each other whose rows sum to more than 1.
const CROSSED: &str = "segment wall 0 2 0 0 reflectance 0.8853079981
body one
segment one -0.4 0 -0.288 0.412 reflectance 0.3037953448
body two
at 0 0.2073 1.0
segment lamp 0.156 -0.3 0.111 0.182 reflectance 0.99 emit 611496
body three
at 0 -0.0236 1.0 75.443
segment blade -0.2 -0.383 0.311 -0.283 reflectance 0.99 two-sided
";

#[test]
fn light_between_bright_walls_that_cross_stays_balanced() {
    let dir = TempDir::new().unwrap();
    let (file, out) = (dir.path().join("crossed.flat"), dir.path().join("out"));
    fs::write(&file, CROSSED).unwrap();
    let crossed = ["flat", text(&file), "--epsilon", "0.2", "--min-length", "0.1"];
    relume(&[&crossed[..], &["--verify"]].concat()).succeeds();
    relume(&[&crossed[..], &["-o", text(&out)]].concat()).succeeds();
    let energy = &json(&out.join("report.json"))["frames"][0]["energy"];
    let watts = |name: &str| energy[name].as_f64().unwrap();
    let left = watts("absorbed_w") + watts("escaped_w");
    // Handed down as lines, the light grew without end.
    assert!((left / watts("emitted_w") - 1.0).abs() < 1e-3, "{energy}");
}

#[test]
fn messages_say_where_and_what() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("wrong.flat");
    fs::write(&file, "segment floor 0 0 1 0\nsegment wall 0 1\n").unwrap();
    relume(&["flat", text(&file)]).fails(1, &["line 2", "`wall`", "x0 y0 x1 y1"]);
    let svg = dir.path().join("wrong.SVG");
    fs::write(&svg, "<svg>\n<path id='arc' d='M0 0A1 1 0 0 0 1 1'/></svg>").unwrap();
    relume(&["flat", text(&svg)])
        .fails(1, &["path `arc`, line 2", "`A`", "\n  help: make it straight"]);
    let gutter = scene("gutter.flat");
    let with = |more: &[&str]| relume(&[&["flat", text(&gutter)], more].concat());
    with(&["--epsilon", "2"]).fails(2, &["between 0 and 1"]);
    with(&["--update", "reinspect", "--error", "0.1"])
        .fails(2, &["goes with --update extrapolate"]);
    with(&["--compare"]).fails(2, &["add --bench"]);
    with(&["--bench", "--verify"]).fails(2, &["cannot be used with"]);
    with(&["--bench", "--frames", "3"]).fails(1, &["two frames or more"]);
    with(&["--frames", "9999"]).fails(1, &["outside the animation"]);
    relume(&["flat"]).fails(2, &["<SCENE>"]);
    relume(&["flat", "figure", "0.9"]).fails(2, &["0.1", "0.4"]);
    relume(&["figure", "0.4"]).fails(2, &["0.5", "table-0.1"]);
}
