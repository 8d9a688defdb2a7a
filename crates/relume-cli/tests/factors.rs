//! `relume factors` as a user meets it: known values, tables, formats, closures, messages.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{json, relume, text};
use glam::{DQuat, DVec3};
use relume::export::write_glb;
use relume::scene::{Interpolation, Scene, SceneBuilder, Track};
use tempfile::TempDir;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The unit square at height 0 of a node, facing up or down.
fn square(up: bool) -> [DVec3; 4] {
    let mut corners = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)];
    if !up {
        corners.reverse();
    }
    corners
}

/// Two unit plates face to face, drawn apart from distance 1 at 0 s to 2 at 1 s.
fn plates() -> Scene {
    let mut b = SceneBuilder::new("plates");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let low = b.node("low", None, DVec3::ZERO, DQuat::IDENTITY);
    b.polygon(low, "low", grey, &square(true));
    let high = b.node("high", None, v(0.0, 0.0, 1.0), DQuat::IDENTITY);
    b.polygon(high, "high", grey, &square(false));
    let values = vec![v(0.0, 0.0, 1.0), v(0.0, 0.0, 2.0)];
    let interpolation = Interpolation::Linear;
    b.animate_translation(high, Track { times_s: vec![0.0, 1.0], values, interpolation });
    b.build().unwrap()
}

/// A closed unit room in which a box slides.
fn closed_room() -> Scene {
    let mut b = SceneBuilder::new("closed");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    for (name, k) in
        [("left", 0), ("right", 1), ("floor", 2), ("ceiling", 3), ("front", 4), ("back", 5)]
    {
        let node = b.node(name, None, DVec3::ZERO, DQuat::IDENTITY);
        let mut one = SceneBuilder::new("one");
        let m = one.material("m", [0.5; 3], [0.0; 3]);
        let n = one.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
        one.cuboid_inward(n, "s", m, DVec3::ZERO, DVec3::ONE);
        let corners: Vec<DVec3> = one.build().unwrap().patches[k].corners_in_body().collect();
        b.polygon(node, name, grey, &corners);
    }
    let node = b.node("box", None, v(0.3, 0.3, 0.3), DQuat::IDENTITY);
    b.cuboid(node, "box", grey, DVec3::splat(-0.1), DVec3::splat(0.1));
    let values = vec![v(0.3, 0.3, 0.3), v(0.7, 0.3, 0.3)];
    let interpolation = Interpolation::Linear;
    b.animate_translation(node, Track { times_s: vec![0.0, 1.0], values, interpolation });
    b.build().unwrap()
}

/// A directory with a scene in it.
fn written(scene: &Scene) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(format!("{}.glb", scene.name));
    write_glb(scene, &path).unwrap();
    (dir, path)
}

/// (frame, from, to) -> (area of from, factor).
type Table = BTreeMap<(u32, String, String), (f64, f64)>;

fn table(csv: &str) -> Table {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("frame,from,to,area_from_m2,factor"));
    let row = |line: &str| {
        let words: Vec<&str> = line.split(',').collect();
        let [frame, from, to, area, factor] = words[..] else { panic!("{line}") };
        let key = (frame.parse().unwrap(), from.to_owned(), to.to_owned());
        (key, (area.parse().unwrap(), factor.parse().unwrap()))
    };
    lines.map(row).collect()
}

fn factor(table: &Table, frame: u32, from: &str, to: &str) -> f64 {
    table.get(&(frame, from.to_owned(), to.to_owned())).map_or(0.0, |entry| entry.1)
}

#[test]
fn two_plates_drawn_apart_have_the_factors_of_the_catalogue() {
    let (_dir, scene) = written(&plates());
    let ran = relume(&["factors", text(&scene), "--by", "surface"]).succeeds();
    let found = table(&ran.out);
    for (frame, want) in [(0, 0.199_824_895_698), (24, 0.068_590)] {
        for (from, to) in [("low", "high"), ("high", "low")] {
            let got = factor(&found, frame, from, to);
            assert!((got - want).abs() < 1e-4, "frame {frame}: {got} instead of {want}");
            let rest = factor(&found, frame, from, "environment");
            assert!((rest + got - 1.0).abs() < 1e-12, "{rest}");
        }
    }
    assert!(ran.err.contains("2 surfaces, 25 frames") && ran.err.contains("never normalised"));
    assert!(!ran.err.contains("nothing emits"), "no light is needed: {}", ran.err);
}

#[test]
fn reciprocity_holds_to_rounding_and_rows_of_a_closed_room_sum_to_one() {
    let (_dir, scene) = written(&closed_room());
    let ran =
        relume(&["factors", text(&scene), "--frames", "0,24", "--tolerance", "0.01"]).succeeds();
    let found = table(&ran.out);
    for ((frame, from, to), (area, f)) in &found {
        if to == "environment" {
            assert!(f.abs() < 1e-3, "{from} in frame {frame}: {f} escapes");
            continue;
        }
        let (other_area, other) = found[&(*frame, to.clone(), from.clone())];
        assert!((area * f / (other_area * other) - 1.0).abs() < 1e-14, "{from} {to}");
    }
    assert!((found[&(0, "box".into(), "floor".into())].0 - 0.24).abs() < 1e-6);
}

#[test]
fn only_what_changed_is_written_where_asked() {
    let (_dir, scene) = written(&closed_room());
    let run = |more: &[&str]| {
        let all =
            ["factors", text(&scene), "--by", "patch", "--frames", "0,0-2", "--tolerance", "0.1"];
        table(&relume(&[&all[..], more].concat()).succeeds().out)
    };
    let (all, changed) = (run(&[]), run(&["--changed-only"]));
    assert!(changed.len() < all.len(), "{} {}", changed.len(), all.len());
    // Put together they are the whole table again.
    let mut now: BTreeMap<(String, String), f64> = BTreeMap::new();
    for frame in 0..3 {
        let of = |t: &Table| -> Vec<((String, String), f64)> {
            let here = t.iter().filter(|(key, _)| key.0 == frame);
            here.map(|((_, from, to), (_, f))| ((from.clone(), to.clone()), *f)).collect()
        };
        now.extend(of(&changed));
        let (have, want) = (now.iter().filter(|e| *e.1 != 0.0), of(&all));
        let want: BTreeMap<_, _> = want.into_iter().filter(|e| e.1 != 0.0).collect();
        assert_eq!(have.map(|(k, f)| (k.clone(), *f)).collect::<BTreeMap<_, _>>(), want);
    }
    // Behind the box everything is as it was: far walls see each other past the box.
    assert!(changed.keys().any(|key| key.0 == 2 && key.1.starts_with("box")));
}

#[test]
fn closures_make_rows_sum_to_one_in_a_closed_scene_only() {
    let (_dir, scene) = written(&closed_room());
    for closure in ["rows", "reciprocal"] {
        let all =
            ["factors", text(&scene), "--frames", "0", "--tolerance", "0.1", "--closure", closure];
        let ran = relume(&all).succeeds();
        assert!(ran.err.contains("row sums (before "), "{}", ran.err);
        let mut exact = true;
        let found = table(&ran.out);
        for ((_, from, to), (area, f)) in &found {
            if to == "environment" {
                assert!(f.abs() < 1e-12, "{from}: {f}");
                continue;
            }
            let (other_area, other) = found[&(0, to.clone(), from.clone())];
            exact &= (area * f / (other_area * other) - 1.0).abs() < 1e-12;
        }
        assert_eq!(exact, closure == "reciprocal");
    }
    let (dir, open) = written(&plates());
    let out = dir.path().join("F.csv");
    relume(&["factors", text(&open), "--closure", "rows", "-o", text(&out)])
        .fails(1, &["the scene is open in frame 0", "sum to 0.1998", "help: leave out --closure"]);
    assert!(!out.exists(), "nothing may be left behind");
}

#[test]
fn sides_of_double_sided_surfaces_are_told_apart() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../relume-core/tests/data/satellite_rotating_arrays.glb");
    let by = |by: &str| {
        let all = ["factors", text(&scene), "--by", by, "--frames", "0", "--tolerance", "0.1"];
        table(&relume(&all).succeeds().out)
    };
    let bodies = by("body");
    // The bus is a box: from within it sees only itself, from without never.
    assert!((factor(&bodies, 0, "bus back", "bus back") - 1.0).abs() < 1e-2);
    assert_eq!(factor(&bodies, 0, "bus", "bus"), 0.0);
    let sees = factor(&bodies, 0, "bus", "array1");
    assert!(
        sees > 0.0 && (factor(&bodies, 0, "bus", "environment") + 2.0 * sees - 1.0).abs() < 1e-2
    );
    assert!((bodies[&(0, "bus".into(), "environment".into())].0 - 8.0).abs() < 1e-6);
    assert!(by("patch").contains_key(&(0, "bus/5 back".into(), "bus/0 back".into())));
}

#[test]
fn what_is_called_environment_does_not_get_mixed_up_with_what_escapes() {
    let mut b = SceneBuilder::new("sky");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let low = b.node("environment", None, DVec3::ZERO, DQuat::IDENTITY);
    b.polygon(low, "environment", grey, &square(true));
    let high = b.node("high", None, v(0.0, 0.0, 1.0), DQuat::IDENTITY);
    b.polygon(high, "high", grey, &square(false));
    let (_dir, scene) = written(&b.build().unwrap());
    let ran = relume(&["factors", text(&scene)]).succeeds();
    assert!(ran.err.contains("what escapes is called `environment 2`"), "{}", ran.err);
    let found = table(&ran.out);
    assert!((factor(&found, 0, "high", "environment") - 0.1998).abs() < 1e-3);
    assert!((factor(&found, 0, "high", "environment 2") - 0.8002).abs() < 1e-3);
}

#[test]
fn archives_and_reports_hold_the_same_numbers() {
    let (dir, scene) = written(&plates());
    let (npz, sparse) = (dir.path().join("F.npz"), dir.path().join("S.npz"));
    let report = dir.path().join("report.json");
    let frames = ["--frames", "0,24", "--tolerance", "0.1"];
    let base = ["factors", text(&scene)];
    relume(&[&base[..], &frames, &["-o", text(&npz), "--report", text(&report)]].concat())
        .succeeds();
    relume(&[&base[..], &frames, &["-o", text(&sparse), "--format", "npz-sparse"]].concat())
        .succeeds();
    for (path, arrays) in [
        (&npz, &["factors", "area_m2", "frame", "time_s", "name"][..]),
        (&sparse, &["data", "indices", "indptr", "shape", "format", "name"]),
    ] {
        let bytes = fs::read(path).unwrap();
        for array in arrays {
            let entry = format!("{array}.npy");
            let found = bytes.windows(entry.len()).any(|w| w == entry.as_bytes());
            assert!(found, "{} lacks {entry}", path.display());
        }
    }
    let report = json(&report);
    assert_eq!(report["schema"], "relume-factors/1");
    let sum = report["frames"][1]["row_sums"]["max"].as_f64().unwrap();
    assert!((sum - 0.0686).abs() < 1e-3, "{sum}");
    let escapes = report["frames"][0]["escapes"].as_f64().unwrap();
    assert!((escapes - 0.8002).abs() < 1e-3, "{escapes}");
}

#[test]
fn view3d_and_energyplus_get_their_own_formats() {
    let (dir, scene) = written(&closed_room());
    let file = |name: &str| dir.path().join(name);
    let run = |name: &str| {
        let path = file(name);
        let all =
            ["factors", text(&scene), "--frames", "0", "--tolerance", "0.1", "-o", text(&path)];
        relume(&all).succeeds();
        fs::read_to_string(path).unwrap()
    };
    let vf = run("F.vf");
    let lines: Vec<&str> = vf.lines().collect();
    assert_eq!(lines.len(), 1 + 1 + 7 + 1);
    assert_eq!((lines[0].len(), lines[0].split_whitespace().last()), (30, Some("7")));
    assert_eq!(lines[1].split(' ').count(), 7);
    let sum: f64 = lines[2].split(' ').map(|f| f.parse::<f64>().unwrap()).sum();
    assert!((sum - 1.0).abs() < 1e-2 && lines[2].split(' ').all(|f| f.len() == 8), "{}", lines[2]);
    assert!(lines[9].split(' ').all(|e| e == "0.500"), "{}", lines[9]);
    let idf = run("F.idf");
    assert!(idf.contains("ZoneProperty:UserViewFactors:BySurfaceName,\n  closed,\n  "), "{idf}");
    assert_eq!(idf.lines().filter(|l| l.starts_with("  left, ")).count(), 7);
    assert!(idf.trim_end().ends_with(';') && idf.matches(';').count() == 1);
}

#[test]
fn combinations_that_make_no_sense_are_refused() {
    let (dir, scene) = written(&plates());
    let out = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    for (more, said) in [
        (vec!["-o", &out("F.xyz")], &["does not say which format", ".npz", "--format"][..]),
        (vec!["-o", &out("F.vf")], &["holds one frame, not 25", "--frames"]),
        (vec!["--format", "npz"], &["is not text", "-o"]),
        (vec!["-o", &out("F.npz"), "--changed-only"], &["--changed-only does not go with"]),
        (vec!["--format", "energyplus", "--by", "body", "--frames", "0"], &["--by surface"]),
        (vec!["--by", "colour"], &["patch", "surface", "body"]),
    ] {
        let all = [&["factors", text(&scene)][..], &more].concat();
        relume(&all).fails(2, said);
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing may be left behind");
}

/// Two unit squares with half of the way between them blocked over a quarter of it.
const BLOCKED: &str = "T two squares with a square in between
C encl=0 list=2 eps=1.e-6
F 3
V 1 0 0 0
V 2 1 0 0
V 3 1 1 0
V 4 0 1 0
V 5 0 0 1
V 6 1 0 1
V 7 1 1 1
V 8 0 1 1
V 9 0 0 .5
V 10 .5 0 .5
V 11 .5 .5 .5
V 12 0 .5 .5
S 1 1 2 3 4 0 0 0.50 low
S 2 7 6 5 8 0 0 0.20 high
O 3 9 10 11 12
End of data
";

#[test]
fn files_of_view3d_are_read_and_answered_in_its_format() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, out) = (dir.path().join("squares.vs3"), dir.path().join("F.vf"));
    fs::write(&scene, BLOCKED).unwrap();
    let ran =
        relume(&["factors", text(&scene), "-o", text(&out), "--tolerance", "0.005"]).succeeds();
    assert!(ran.err.contains("2 surfaces, 1 frame: 2 factors"), "{}", ran.err);
    let vf = fs::read_to_string(&out).unwrap();
    let lines: Vec<&str> = vf.lines().collect();
    assert_eq!(lines[1], "1 1");
    let factors: Vec<f64> = lines[2].split(' ').map(|f| f.parse().unwrap()).collect();
    assert!(factors[0] == 0.0 && (factors[1] - 0.149_868_671_774).abs() < 1e-4, "{factors:?}");
    assert_eq!(lines[4], "0.500 0.200");
    // As a table: no factor to what is only in the way.
    let found = table(&relume(&["factors", text(&scene)]).succeeds().out);
    assert_eq!(found.len(), 4, "{found:?}");
    relume(&["info", text(&scene)]).says(&[
        "3 surfaces",
        "low",
        "obstruction 3",
        "list=2 eps=1.e-6",
    ]);
    let checked = relume(&["check", text(&scene)]).succeeds();
    assert!(!checked.out.contains("nothing-emits"), "{}", checked.out);
    // A mistake is named by its line.
    fs::write(&scene, BLOCKED.replace("S 2 7 6 5 8", "S 2 7 6 5 80")).unwrap();
    relume(&["factors", text(&scene)]).fails(
        1,
        &["squares.vs3`, line 17", "refers to vertex 80", "help: there are vertices 1 to 12"],
    );
}
