//! `relume verify` as a user meets it.

use crate::common::{interrupted, json, relume, room, text};

/// The room's coarse links take hundredths of a second a frame.
const COARSE: [&str; 4] = ["--tolerance", "0.3", "--threads", "2"];

#[test]
fn verify_prints_a_line_a_frame() {
    let (dir, scene) = room();
    let fixed = ["verify", text(&scene), "--frames", "0,3,4"];
    let ran = relume(&[&fixed[..], &COARSE[..]].concat());
    ran.says(&["frame    0 ", "frame    3 ", "frame    4 ", " links ", " changed ", " equal, "]);
    ran.says(&["\n3 frames equal: links bit for bit, radiosities within "]);
    assert_eq!(ran.out.lines().count(), 4, "{}", ran.out);
    assert_eq!(ran.err, "");

    // The hash is that of a frame solved on its own.
    let report = dir.path().join("report.json");
    let alone = ["solve", text(&scene), "--frames", "4", "--report", text(&report), "--quiet"];
    relume(&[&alone[..], &COARSE[..]].concat()).says(&[]);
    ran.says(&[json(&report)["frames"][0]["hash"].as_str().unwrap()]);
}

#[test]
fn verify_knows_the_demonstrations_and_the_oracles() {
    let oracle = ["--oracle", "form-factor=0.2,0.5", "--frames", "0-2"];
    relume(&[&["verify", "--demo", "corridor"], &oracle[..]].concat()).says(&["3 frames equal"]);
    let ran = relume(&[&["verify", "--demo", "room", "-q"], &oracle[..]].concat());
    ran.says(&[]);
    assert_eq!((ran.out.as_str(), ran.err.as_str()), ("", ""));
}

#[test]
fn wrong_usage_of_verify_is_explained() {
    relume(&["verify"]).fails(2, &["SCENE"]);
    relume(&["verify", "a.glb", "--demo", "room"]).fails(2, &["cannot be used with"]);
    relume(&["verify", "--demo", "cellar"]).fails(2, &["corridor", "room"]);
    relume(&["verify", "missing.glb"]).fails(1, &["error: ", "missing.glb", "\n  help: "]);
    relume(&["verify", "--demo", "room", "--frames", "99"])
        .fails(1, &["frame 99 is outside the animation", "help:"]);
    relume(&["verify", "--demo", "room", "--max-memory", "64K"])
        .fails(3, &["64.00 KiB of memory allowed", "help: raise --max-memory"]);
    relume(&["verify", "--help"]).says(&[
        "Example:  relume ",
        "--demo",
        "--tolerance",
        "[default: 24]",
    ]);
    relume(&["verify", "--demo", "room", "--animation", "x"]).fails(2, &["leave out --animation"]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_verify_says_how_far_it_came() {
    let ran = interrupted(&["verify", "--demo", "corridor", "--threads", "1"]);
    ran.fails(130, &["stopped: ", " of 109 frames compared, all equal"]);
}
