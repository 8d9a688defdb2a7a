//! Update strategies as a user meets them: `--update`, `--error`, `--events`.

use std::fs;

use crate::common::{json, relume, room, text};

#[test]
fn exact_strategies_give_the_same_links() {
    let (dir, scene) = room();
    let hashes = ["certificate", "reinspect", "scratch", "extrapolate=1"].map(|update| {
        let report = dir.path().join("report.json");
        let more = ["--report", text(&report), "--update", update, "--oracle", "form-factor=0.2"];
        let solve = ["solve", text(&scene), "--frames", "0-3", "--quiet"];
        relume(&[&solve[..], &more[..]].concat()).succeeds();
        let value = json(&report);
        assert_eq!(value["options"]["update"], update);
        let frames = value["frames"].as_array().unwrap().clone();
        frames.iter().map(|f| f["hash"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    });
    assert!(hashes.iter().all(|h| *h == hashes[0]), "{hashes:?}");
}

#[test]
fn events_are_written_one_a_line() {
    let (dir, scene) = room();
    let (events, report) = (dir.path().join("events.csv"), dir.path().join("report.json"));
    let more = ["--events", text(&events), "--report", text(&report), "--tolerance", "0.3"];
    let solve = ["solve", text(&scene), "--frames", "0-2", "--quiet"];
    relume(&[&solve[..], &more[..]].concat()).succeeds();
    let table = fs::read_to_string(&events).unwrap();
    let mut lines = table.lines();
    let header = "frame,kind,receiver,source,x_before_m2,v_before,x_after_m2,v_after";
    assert_eq!(lines.next(), Some(header));
    let value = json(&report);
    let count = |frame: usize, kinds: &[&str]| {
        let begins: Vec<String> = kinds.iter().map(|kind| format!("{frame},{kind},")).collect();
        table.lines().filter(|l| begins.iter().any(|b| l.starts_with(b))).count() as u64
    };
    for frame in [1, 2] {
        let counted = |name: &str| value["frames"][frame][name].as_u64().unwrap();
        assert!(counted("promoted") + counted("demoted") > 0);
        assert_eq!(count(frame, &["promoted"]), counted("promoted"));
        assert_eq!(count(frame, &["demoted"]), counted("demoted"));
        assert_eq!(count(frame, &["occluded", "revealed"]), counted("occlusion_changed"));
    }
    assert!(lines.all(|l| l.split(',').count() == 8 && !l.starts_with("0,")), "{table}");
}

#[test]
fn wrong_usage_is_explained() {
    let (_dir, scene) = room();
    let solve = |more: &[&str]| relume(&[&["solve", text(&scene)][..], more].concat());
    solve(&["--error", "0.1"]).fails(2, &["--error goes with --update extrapolate", "help:"]);
    solve(&["--update", "extrapolate=0"]).fails(2, &["1 to 255"]);
    solve(&["--update", "guess"]).fails(2, &["certificate", "extrapolate[=N]"]);
    let update = ["--update", "extrapolate", "--error"];
    solve(&[&update[..], &["2"]].concat()).fails(2, &["between 0 and 1"]);
    solve(&["--events", "no/such/events.csv"]).fails(1, &["cannot write", "events.csv"]);
    let verify = ["verify", text(&scene), "--update", "extrapolate"];
    relume(&verify).fails(2, &["certificate", "reinspect"]);
}
