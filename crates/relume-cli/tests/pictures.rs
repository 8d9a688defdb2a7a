//! Runs that make pictures: what lies in the directory, whatever ends the run.
//!
//! Runs the binary itself on the demonstrations, small and coarse. What the pictures show is tested
//! where they are drawn.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

const QUICK: [&str; 4] = ["--size", "64x48", "--tolerance", "0.3"];

fn relume(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_relume")).args(arguments).args(QUICK).output().unwrap()
}

#[track_caller]
fn succeeded(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

fn report(dir: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(dir.join("report.json")).unwrap()).unwrap()
}

fn frames_of(report: &Value) -> Vec<u64> {
    report["frames"].as_array().unwrap().iter().map(|f| f["frame"].as_u64().unwrap()).collect()
}

/// Names in a directory, hidden ones too: nothing half-written may be left.
fn names_in(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_demonstration_writes_scene_pictures_and_report() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    let text = succeeded(&relume(&["demo", "room", "-o", out, "--frames", "0-2"]));
    assert!(text.starts_with("3 frames, "), "{text}");
    assert!(text.contains(&format!(" s, pictures in {out}\nframe 2: ")), "{text}");
    assert!(text.contains(" % unbalanced\nframe "), "{text}");
    assert!(text.contains(": irradiance is off by about "), "{text}");
    assert_eq!(
        names_in(dir.path()),
        ["frame-0000.png", "frame-0001.png", "frame-0002.png", "report.json", "room.glb"]
    );
    let report = report(dir.path());
    assert_eq!(frames_of(&report), [0, 1, 2]);
    assert_eq!(report["options"]["picture"]["size"], "64x48");
    assert_eq!(report["options"]["picture"]["shading"], "smooth");
    assert!(report["options"]["picture"]["exposure_ev"].is_f64());
    let png = fs::read(dir.path().join("frame-0001.png")).unwrap();
    assert_eq!(&png[1..4], b"PNG");
    assert_eq!(&png[16..24], [0, 0, 0, 64, 0, 0, 0, 48]);
}

/// Nor does a dot at the end of a folder that is not there yet stop it.
#[test]
fn a_demonstration_leaves_another_scene_of_its_name_alone() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("new").join(".");
    let out = out.to_str().unwrap();
    let run = || relume(&["demo", "room", "-o", out, "--frames", "0"]);
    succeeded(&run());
    succeeded(&run());
    let scene = dir.path().join("new").join("room.glb");
    fs::write(&scene, "my own").unwrap();
    let refused = run();
    assert!(!refused.status.success());
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("room.glb is another scene") && said.contains("-o"), "{said}");
    assert_eq!(fs::read_to_string(&scene).unwrap(), "my own");
}

#[test]
fn parts_of_a_clip_match_the_whole() {
    part_matches_whole(&[]);
}

#[test]
fn numbers_are_shown_on_one_scale_over_the_clip() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    succeeded(&relume(&["demo", "room", "-o", out, "--frames", "0"]));
    let scene = format!("{out}/room.glb");
    let render = |name: &str, more: &[&str]| {
        let out = format!("{out}/{name}");
        relume(&[&["render", &scene, "-o", &out, "--frames", "3,9"], more].concat())
    };
    let pixels = |name: &str, frame: u32| {
        let path = dir.path().join(format!("{name}/frame-{frame:04}.png"));
        image::load_from_memory(&fs::read(path).unwrap()).unwrap().into_rgb8().into_raw()
    };
    succeeded(&render("auto", &["--show", "irradiance", "--isolines", "4"]));
    let [one, other] = [3, 9].map(|frame| pixels("auto", frame));
    assert_ne!(one, other);
    // Where the legend is: frames differ in what is behind it by a fifth.
    let row = |bytes: &[u8], y: usize| bytes[3 * (64 * y + 20)..3 * (64 * y + 57)].to_vec();
    for y in 14..36 {
        let pairs = row(&one, y).into_iter().zip(row(&other, y));
        assert!(pairs.map(|(a, b)| a.abs_diff(b)).max() < Some(60), "row {y}");
    }
    let options = &report(&dir.path().join("auto"))["options"]["picture"]["view"];
    assert_eq!(options[0], "--show irradiance");
    // Below the scale all is its first colour, above it the last, but for the legend.
    for (ends, colour) in [("1e8,1e9", [0, 0, 0]), ("-2,-1", [255, 255, 255])] {
        succeeded(&render(ends, &["--show=irradiance", "--map=grey", &format!("--scale={ends}")]));
        let bytes = pixels(ends, 3);
        assert!((0..48).all(|y| bytes[3 * (64 * y + 62)..][..3] == colour), "{ends}");
    }
    for shown in ["level", "mesh", "body", "linked", "links", "error", "radiosity", "illuminance"] {
        succeeded(&render(shown, &["--show", shown]));
        assert_ne!(pixels(shown, 3), one, "{shown}");
    }
    let lamp = pixels("links", 3);
    succeeded(&render("of", &["--show", "links", "--of", "lamp"]));
    assert_eq!(pixels("of", 3), lamp);
    let refused = render("none", &["--show", "links", "--of", "door"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("no body `door`"));
    for (shown, update) in [("events", "scratch"), ("certificates", "reinspect")] {
        let refused = render("none", &["--show", shown, "--update", update]);
        assert_eq!(refused.status.code(), Some(2), "{shown}");
    }
    assert_eq!(render("exr", &["--show=level", "--format=exr"]).status.code(), Some(2));
}

/// Whichever frames are asked for, each shows what happened since the one before it.
#[test]
fn events_and_certificates_are_those_of_a_frame() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    succeeded(&relume(&["demo", "room", "-o", &path("room"), "--frames", "0"]));
    let scene = path("room/room.glb");
    let picture = |shown: &str, frames: &str, more: &[&str]| {
        let out = path(&format!("{shown}-{frames}-{}", more.len()));
        let mut run = Command::new(env!("CARGO_BIN_EXE_relume"));
        run.args(["render", &scene, "-o", &out, "--show", shown, "--frames", frames]);
        run.args(["--size", "240x180", "--tolerance", "0.2"]).args(more);
        succeeded(&run.output().unwrap());
        fs::read(format!("{out}/frame-0005.png")).unwrap()
    };
    for shown in ["events", "certificates"] {
        let whole = picture(shown, "0-5", &[]);
        assert!(whole == picture(shown, "5", &[]), "{shown}: alone");
        assert!(whole == picture(shown, "2,5", &[]), "{shown}: after a gap");
        assert!(whole != picture(shown, "5", &["--of", "floor"]), "{shown}: of all");
    }
}

#[test]
fn parts_of_a_reconstructed_clip_match_the_whole() {
    part_matches_whole(&["--reconstruct"]);
}

fn part_matches_whole(how: &[&str]) {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (whole, part) = (path("whole"), path("part"));
    // From scratch, so that radiosities are the same to the last bit; else they agree within the
    // solver's residual, and a few pixels differ by one level.
    let scratch = [&["--update", "scratch"], how].concat();
    let demo = ["demo", "room", "-o", &whole, "--frames", "0-6x3"];
    succeeded(&relume(&[&demo[..], &scratch].concat()));
    let scene = format!("{whole}/room.glb");
    // Frame 6 alone: the exposure is still that of frame 0.
    let render = ["render", &scene, "-o", &part, "--frames", "6"];
    succeeded(&relume(&[&render[..], &scratch].concat()));
    let picture = |dir: &str| fs::read(format!("{dir}/frame-0006.png")).unwrap();
    assert!(picture(&whole) == picture(&part), "the pictures differ");
    let ev = |dir: &str| report(Path::new(dir))["options"]["picture"]["exposure_ev"].clone();
    assert_eq!(ev(&whole), ev(&part));
    let hash = |dir: &str, at: usize| report(Path::new(dir))["frames"][at]["hash"].clone();
    assert_eq!(hash(&whole, 2), hash(&part, 0));
}

/// A scene without a camera, so that a view is chosen: that runs in parallel too.
#[test]
fn any_number_of_threads_gives_the_same_pictures_and_links() {
    let scene = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../relume-core/tests/data/cornell_moving_box_and_lamp.glb"
    );
    let dir = tempfile::tempdir().unwrap();
    let run = |threads: &str| {
        let out = dir.path().join(threads);
        let args = ["render", scene, "-o", out.to_str().unwrap(), "--frames", "60"];
        let more = ["--threads", threads];
        succeeded(&relume(&[&args[..], &more].concat()));
        let hash = report(&out)["frames"][0]["hash"].clone();
        (fs::read(out.join("frame-0060.png")).unwrap(), hash)
    };
    let one = run("1");
    assert!(run("2") == one && run("8") == one);
}

#[test]
fn resuming_makes_what_is_missing_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    let demo = ["demo", "room", "-o", out, "--resume", "--frames"];
    succeeded(&relume(&[&demo[..], &["0-1"]].concat()));
    let picture = |frame: u32| dir.path().join(format!("frame-000{frame}.png"));
    let lost = fs::read(picture(0)).unwrap();
    fs::remove_file(picture(0)).unwrap();
    let written = || fs::metadata(picture(1)).unwrap().modified().unwrap();
    let kept = written();
    let text = succeeded(&relume(&[&demo[..], &["0-2"]].concat()));
    assert!(text.starts_with("3 frames (1 finished before), "), "{text}");
    assert!(fs::read(picture(0)).unwrap() == lost, "the same frame, the same picture");
    assert_eq!(written(), kept, "it is not made again");
    assert_eq!(frames_of(&report(dir.path())), [0, 1, 2]);
    // The lamp moved between frames 1 and 2, although this run began with frame 0.
    assert_eq!(report(dir.path())["frames"][2]["moved"], serde_json::json!(["lamp"]));

    // What is no picture is made again, and what moved is still told.
    fs::write(picture(2), "garbage").unwrap();
    let text = succeeded(&relume(&[&demo[..], &["0-2"]].concat()));
    assert!(text.starts_with("3 frames (2 finished before), "), "{text}");
    assert!(fs::read(picture(2)).unwrap().starts_with(b"\x89PNG"));
    assert_eq!(report(dir.path())["frames"][2]["moved"], serde_json::json!(["lamp"]));

    // A run that fails before its first frame leaves the report of the last.
    let before = fs::read(dir.path().join("report.json")).unwrap();
    let small = ["demo", "room", "-o", out, "--frames", "0-2", "--max-memory", "100K"];
    assert_eq!(relume(&small).status.code(), Some(3));
    assert!(fs::read(dir.path().join("report.json")).unwrap() == before);

    let refused = relume(&[&demo[..], &["0-2", "--shading", "flat"]].concat());
    assert_eq!(refused.status.code(), Some(1));
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(message.contains("shading was smooth and is flat now"), "{message}");
}

#[test]
fn old_pictures_and_unknown_cameras_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    fs::write(dir.path().join("frame-0017.png"), "old").unwrap();
    let ran = relume(&["demo", "room", "-o", out, "--frames", "0", "--mesh", "--exposure", "-3"]);
    succeeded(&ran);
    let message = String::from_utf8(ran.stderr).unwrap();
    assert!(message.contains("pictures of an earlier run: frames 17"), "{message}");
    let ran = relume(&["demo", "room", "-o", out, "--camera", "attic"]);
    assert_eq!(ran.status.code(), Some(1));
    let message = String::from_utf8(ran.stderr).unwrap();
    assert!(message.contains("no camera is called \"attic\""), "{message}");
}

/// The first Ctrl-C leaves finished frames, a report of exactly those, and no rest of any other.
#[cfg(unix)]
#[test]
fn an_interrupted_run_can_be_resumed() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    // More frames than could be made in the time before the signal.
    let demo = ["demo", "room", "-o", out, "--fps", "24000"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(demo)
        .args(QUICK)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let started = Instant::now();
    while !dir.path().join("frame-0001.png").exists() {
        let ended = child.try_wait().unwrap();
        assert!(ended.is_none(), "it ended by itself: {ended:?}");
        assert!(started.elapsed() < Duration::from_secs(60), "no frame in a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let ran = child.wait_with_output().unwrap();
    let message = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(130), "{message}");
    assert!(message.contains(" of 19,001 frames finished"), "{message}");
    assert!(message.contains("the same command with --resume"), "{message}");
    let finished = frames_of(&report(dir.path()));
    assert!(finished.len() >= 2);
    let mut expected: Vec<String> =
        finished.iter().map(|frame| format!("frame-{frame:04}.png")).collect();
    expected.extend(["report.json".into(), "room.glb".into()]);
    assert_eq!(names_in(dir.path()), expected);
    let last = finished.len().to_string();
    let text = succeeded(&relume(&[&demo[..], &["--resume", "--frames", &last]].concat()));
    assert!(text.starts_with("1 frame, "), "{text}");
    assert_eq!(frames_of(&report(dir.path())).len(), finished.len() + 1);
}

/// One signal is enough, also in the middle of a frame that takes minutes.
#[cfg(unix)]
#[test]
fn one_sigterm_ends_a_long_frame_within_seconds() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(["demo", "corridor", "-o", out, "--tolerance", "0.0001", "--threads", "1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(700));
    assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
    let asked = Instant::now();
    assert!(Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
    let ran = child.wait_with_output().unwrap();
    let message = String::from_utf8(ran.stderr).unwrap();
    assert!(asked.elapsed() < Duration::from_secs(5), "{message}");
    assert_eq!(ran.status.code(), Some(130), "{message}");
    assert!(message.contains("stopped: 0 of 109 frames finished"), "{message}");
    // The file of the lock may stay: it locks nothing any more.
    let left: Vec<String> =
        names_in(dir.path()).into_iter().filter(|name| name != ".relume.lock").collect();
    assert_eq!(left, ["corridor.glb"]);
}

/// A wall of 2 m x 2 m that is seen from the front, left half red and right half glowing, in a file of its own.
fn painted_wall(dir: &Path) -> std::path::PathBuf {
    let png = |name: &str, left: [u8; 3], right: [u8; 3]| {
        let pixels = [left, right].concat();
        image::RgbImage::from_raw(2, 1, pixels).unwrap().save(dir.join(name)).unwrap();
    };
    png("colour.png", [255, 0, 0], [0, 0, 0]);
    png("glow.png", [0, 0, 0], [0, 255, 0]);
    let points = [-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0];
    let places = [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let numbers: Vec<u8> =
        points.iter().chain(&places).flat_map(|v: &f32| v.to_le_bytes()).collect();
    fs::write(dir.join("wall.bin"), numbers).unwrap();
    let json = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 683}]}},
        "nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"camera": 0, "translation": [0, 0, 5]}],
        "cameras": [{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "mode": 6, "material": 0}]}],
        "materials": [{"emissiveFactor": [0.3, 0.3, 0.3], "emissiveTexture": {"index": 1}, "pbrMetallicRoughness":
            {"baseColorFactor": [0.5, 0.5, 0.5, 1], "baseColorTexture": {"index": 0}, "metallicFactor": 0}}],
        "textures": [{"source": 0}, {"source": 1}],
        "images": [{"uri": "colour.png"}, {"uri": "glow.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 32}],
        "buffers": [{"uri": "wall.bin", "byteLength": 80}],
    });
    let path = dir.join("wall.gltf");
    fs::write(&path, json.to_string()).unwrap();
    path
}

#[test]
fn images_are_seen_on_what_they_are_on() {
    let dir = tempfile::tempdir().unwrap();
    let scene = painted_wall(dir.path());
    let out = dir.path().join("out");
    let arguments =
        ["render", scene.to_str().unwrap(), "-o", out.to_str().unwrap(), "--exposure", "0"];
    succeeded(&relume(&arguments));
    let picture = image::open(out.join("frame-0000.png")).unwrap().into_rgb8();
    let at = |x: u32| picture.get_pixel(x, 20).0;
    // A radiance of 0.5 / pi, and one of 0.3: (tone-mapped) sRGB.
    for (x, lit) in [(12, 0), (28, 0), (36, 1), (50, 1)] {
        let seen = at(x);
        for c in 0..3 {
            assert_eq!(seen[c] > 60, c == lit, "at {x}: {seen:?}");
        }
    }
}
