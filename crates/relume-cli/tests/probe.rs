//! `relume probe` as a user meets it: tables, sensors that ride, messages with line numbers.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{relume, room, text};

/// A scene or reference that the engine's tests hold.
fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../relume-core/tests/data").join(name)
}

/// The rows of a table, with its heading taken off and compared.
fn rows(table: &str) -> Vec<Vec<String>> {
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("frame,sensor,x,y,z,nx,ny,nz,E_r,E_g,E_b"));
    lines.map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn number(word: &str) -> f64 {
    word.parse().unwrap()
}

/// RMS relative error of a table against the path-traced reference, whose own variance is taken out, frame by frame.
fn misses(arguments: &[&str]) -> Vec<f64> {
    let (scene, sensors) = (shipped("box_room.glb"), shipped("box_room.pts"));
    let mut all = vec!["probe", text(&scene), text(&sensors), "--frames", "0-24x8"];
    all.extend_from_slice(arguments);
    let got = rows(&relume(&all).succeeds().out);
    let reference = fs::read_to_string(shipped("box_room.csv")).unwrap();
    let want: Vec<Vec<String>> = reference
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect();
    assert_eq!(got.len(), want.len());
    let mut sums = [(0.0, 0); 4];
    for (got, want) in got.iter().zip(&want) {
        assert_eq!(got[..2], want[..2]);
        let frame: usize = got[0].parse().unwrap();
        for k in 8..11 {
            let (right, deviation) = (number(&want[k]), number(&want[k + 3]));
            let error = number(&got[k]) / right - 1.0;
            sums[frame / 8].0 += error * error - (deviation / right).powi(2);
            sums[frame / 8].1 += 1;
        }
    }
    sums.iter().map(|&(sum, n)| (f64::max(sum, 0.0) / f64::from(n)).sqrt()).collect()
}

#[test]
fn the_reference_room_is_right_within_two_per_cent_in_every_frame() {
    for miss in misses(&[]) {
        assert!(miss <= 0.02, "{miss}");
    }
}

#[test]
fn the_reference_room_at_a_fine_tolerance_is_right_within_half_a_per_cent_in_every_frame() {
    for miss in misses(&["--tolerance", "0.005"]) {
        assert!(miss <= 0.005, "{miss}");
    }
}

#[test]
fn a_sensor_with_a_body_rides_on_it() {
    let (dir, scene) = room();
    let sensors = dir.path().join("sensors.csv");
    // The lamp hangs under the ceiling and shines down; it is at x = 1.5, z = 0 at the start.
    fs::write(
        &sensors,
        "name,x,y,z,nx,ny,nz,body\nrests,0,0.5,0,0,3,0,\nrides,1.5,2.5,0,0,1,0,lamp\n",
    )
    .unwrap();
    let ran =
        relume(&["probe", text(&scene), text(&sensors), "--frames", "0,5", "--tolerance", "0.1"])
            .succeeds();
    let table = rows(&ran.out);
    assert!(ran.err.contains("2 sensors at 2 frames"), "{}", ran.err);
    let named: Vec<[&str; 2]> = table.iter().map(|r| [r[0].as_str(), r[1].as_str()]).collect();
    assert_eq!(named, [["0", "rests"], ["0", "rides"], ["5", "rests"], ["5", "rides"]]);
    assert_eq!(table[0][2..8], ["0", "0.5", "0", "0", "1", "0"]);
    assert_eq!(table[2][2..8], table[0][2..8]);
    assert_eq!(table[1][2..5], ["1.5", "2.5", "0"]);
    assert_ne!(table[3][2..5], table[1][2..5], "the lamp has moved on");
    // As far below the lamp as before.
    assert_eq!(table[3][3], "2.5");
    assert!(table.iter().all(|r| number(&r[8]) > 0.0));
}

#[test]
fn the_mesh_is_read_where_asked_and_only_on_surfaces() {
    let (dir, scene) = room();
    let sensors = dir.path().join("sensors.txt");
    fs::write(&sensors, "0 0 0 0 1 0\n").unwrap();
    let run = |more: &[&str]| {
        let mut all = vec!["probe", text(&scene), text(&sensors), "--frames", "0"];
        all.extend_from_slice(more);
        relume(&all)
    };
    let gathered = number(&rows(&run(&[]).succeeds().out)[0][8]);
    let meshed = number(&rows(&run(&["--interpolate"]).succeeds().out)[0][8]);
    assert!((meshed / gathered - 1.0).abs() < 0.05 && meshed != gathered, "{meshed} {gathered}");
    fs::write(&sensors, "0 0 0 0 1 0\n\n0 1 0 0 1 0\n").unwrap();
    run(&[]).succeeds();
    run(&["--interpolate"]).fails(1, &["sensors.txt, line 3", "on no surface", "help: leave out"]);
}

#[test]
fn sensors_that_cannot_be_are_named_by_their_line() {
    let (dir, scene) = room();
    let sensors = dir.path().join("sensors.csv");
    let out = dir.path().join("E.csv");
    for (content, said) in [
        ("# none\n", &["no sensor in it", "help: write six numbers"][..]),
        ("0 0 0 0 1 0\n0 0 nan 0 1 0\n", &["sensors.csv, line 2: z is NaN", "help:"]),
        ("0 0 0 0 0 0\n", &["line 1: the normal is 0 0 0", "help:"]),
        (
            "x,y,z,nx,ny,nz,body\n0,0,0,0,1,0,roof\n",
            &["line 2: there is no body `roof`", "`floor`"],
        ),
    ] {
        fs::write(&sensors, content).unwrap();
        let ran = relume(&["probe", text(&scene), text(&sensors), "-o", text(&out)]);
        ran.fails(1, said);
        assert!(!out.exists() && ran.out.is_empty(), "nothing may be left behind");
    }
    let missing = dir.path().join("missing.txt");
    relume(&["probe", text(&scene), text(&missing)]).fails(1, &["cannot read", "missing.txt"]);
}

#[test]
fn a_sensor_inside_a_body_is_an_error_and_one_that_is_run_over_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, sensors) = (shipped("box_room.glb"), dir.path().join("sensors.txt"));
    // The centre of the box in frame 0; by frame 24 it has slid away.
    fs::write(&sensors, "# a comment\n0.3 0.3 0.5 0 1 0\n").unwrap();
    let run = |frames: &str| {
        let options = ["--frames", frames, "--tolerance", "0.2"];
        relume(&[&["probe", text(&scene), text(&sensors)], &options[..]].concat())
    };
    run("0").fails(1, &["line 2: sensor `0` is inside body `box`", "help: no light gets there"]);
    let ran = run("0,24").succeeds();
    let warning = "warning: line 2: sensor `0` is inside body `box` in 1 frame, first in frame 0";
    assert!(ran.err.contains(warning), "{}", ran.err);
    let e: Vec<f64> = rows(&ran.out).iter().map(|r| number(&r[8])).collect();
    assert!(e[0] < 1e-6 && e[1] > 0.1, "{e:?}");
}

/// A .glb with everything below one node more, at a place.
fn moved(scene: &Path, to: [f64; 3]) -> Vec<u8> {
    let bytes = fs::read(scene).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let roots = json["scenes"][0]["nodes"].clone();
    let nodes = json["nodes"].as_array_mut().unwrap();
    let number = nodes.len();
    nodes.push(serde_json::json!({ "name": "away", "children": roots, "translation": to }));
    json["scenes"][0]["nodes"] = serde_json::json!([number]);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + length..];
    let mut out = bytes[..8].to_vec();
    out.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend(rest);
    out
}

#[test]
fn at_map_coordinates_it_reads_what_it_does_at_the_origin() {
    let (dir, near) = room();
    let away = [500_000.0, 128.0, -5_500_000.0];
    let far = dir.path().join("far.glb");
    fs::write(&far, moved(&near, away)).unwrap();
    let read = |scene: &Path, at: [f64; 3]| {
        let sensors = dir.path().join("sensors.csv");
        let place = |p: [f64; 3]| format!("{},{},{}", at[0] + p[0], at[1] + p[1], at[2] + p[2]);
        let (rests, rides) = (place([0.0, 0.5, 0.0]), place([1.5, 2.5, 0.0]));
        let lines =
            format!("name,x,y,z,nx,ny,nz,body\nrests,{rests},0,1,0,\nrides,{rides},0,1,0,lamp\n");
        fs::write(&sensors, lines).unwrap();
        let arguments = ["probe", text(scene), text(&sensors), "--frames", "0-6x3"];
        rows(&relume(&arguments).succeeds().out)
    };
    let (here, there) = (read(&near, [0.0; 3]), read(&far, away));
    assert_eq!(here.len(), there.len());
    for (here, there) in here.iter().zip(&there) {
        for k in 2..11 {
            let (here, there) = (number(&here[k]), number(&there[k]));
            let away = if k < 5 { away[k - 2] } else { 0.0 };
            assert!((there - away - here).abs() <= 1e-3 * here.abs() + 1e-6, "{here} {there}");
        }
    }
    relume(&["info", text(&far)]).says(&["bounds     (49999"]);
    relume(&["check", text(&far)]).succeeds();
}
