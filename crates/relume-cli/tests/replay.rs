//! `relume replay` as a user meets it.

use std::fs;

use crate::common::{relume, room, text};

const COARSE: [&str; 4] = ["--tolerance", "0.3", "--threads", "2"];

#[test]
fn a_log_is_followed_and_its_hashes_compared() {
    let (dir, scene) = room();
    let log = dir.path().join("moves.jsonl");
    let axes = "[[1,0,0],[0,1,0],[0,0,1]]";
    let lines = [
        "{\"solve\":{\"hash\":null}}".to_owned(),
        format!(
            "{{\"set_pose\":{{\"body\":\"lamp\",\"to\":{{\"axes\":{axes},\"translation\":[0.3,2.8,0.2]}}}}}}"
        ),
        "{\"solve\":{\"hash\":null}}".to_owned(),
        "{\"undo\":{}}".to_owned(),
        "{\"solve\":{\"hash\":null}}".to_owned(),
    ];
    fs::write(&log, lines.join("\n")).unwrap();
    let with_hashes = dir.path().join("with-hashes.jsonl");
    let run = |log, more: &[&str]| {
        relume(&[&["replay", text(log), text(&scene)], &COARSE[..], more].concat())
    };
    let ran = run(&log, &["-o", text(&with_hashes)]);
    ran.says(&["solve    0 ", "solve    2 ", "3 solves, 0 with the hash of the log\n"]);
    let hashes: Vec<&str> =
        ran.out.lines().take(3).map(|line| line.split_whitespace().last().unwrap()).collect();
    assert!(hashes[0] == hashes[2] && hashes[0] != hashes[1], "{hashes:?}");
    run(&with_hashes, &[]).says(&["as logged", "3 solves, 3 with the hash of the log\n"]);

    let written = fs::read_to_string(&with_hashes).unwrap();
    fs::write(&with_hashes, written.replacen(hashes[1], hashes[0], 1)).unwrap();
    let found = dir.path().join("found.jsonl");
    run(&with_hashes, &["-o", text(&found)]).fails(1, &["solve 1 does not have the hash", "help:"]);
    assert_eq!(fs::read_to_string(&found).unwrap(), written);
}

#[test]
fn what_cannot_be_followed_is_explained() {
    let (dir, scene) = room();
    let log = dir.path().join("moves.jsonl");
    for (line, texts) in [
        ("{\"remove\":{\"body\":\"sofa\"}}", ["line 1: the scene has no body `sofa`", "help:"]),
        ("{\"jump\":{}}", ["line 1: unknown variant `jump`", "help:"]),
        ("{\"set_time\":{\"to\":1e999}}", ["line 1: ", "help:"]),
        ("{\"set_pose\":{\"body\":\"lamp\"}}", ["line 1: missing field `to`", "help:"]),
        (
            "{\"insert\":{\"name\":\"card\",\"meshes\":[{\"surface\":\"card\",\"material\":\"gold\",\"positions\":[[0,1,0],[1,1,0],[0,1,1]],\"triangles\":[[0,1,2]]}]}}",
            ["line 1: the scene has no material `gold`", "`relume info` lists"],
        ),
    ] {
        fs::write(&log, line).unwrap();
        relume(&[&["replay", text(&log), text(&scene)], &COARSE[..]].concat()).fails(1, &texts);
    }
    relume(&["replay", "missing.jsonl", text(&scene)]).fails(1, &["missing.jsonl", "help:"]);
    relume(&["replay", text(&log)]).fails(2, &["SCENE"]);
}
