//! `relume bench` as a user meets it: the tables are there and the file holds what they are made of.

use crate::common::{interrupted, json, relume, text};

/// The room's coarse links take hundredths of a second a frame.
const COARSE: [&str; 4] = ["--tolerance", "0.3", "--threads", "2"];

#[test]
fn bench_prints_the_tables() {
    let more = ["bench", "--demo", "room", "--frames", "0-4", "--size", "64x48", "--every", "2"];
    let ran = relume(&[&more[..], &COARSE[..]].concat());
    ran.says(&[
        "room: tolerance 0.3, oracle error, update certificate, 2 threads\n",
        "solve frame 1   ratio\n",
        "\nroom                     4  ",
        "\nroom with pictures       4  ",
        "\nfrom scratch  2 frames built both ways: average ",
        "\nbound         ",
        " of links with a moved end",
        "\nmeans of ",
        "\nevaluate ",
        "\ndynamic links ",
        "\nocclusion changed ",
        "\nelements reaped ",
        "\nexamined are ",
        "\nmemory        ",
        " bytes a pair (",
        " bytes an element (",
        " bytes a link all included (",
        "peak of the process",
    ]);
    assert_eq!(ran.err, "");
}

#[test]
fn bench_writes_json() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bench.json");
    let fixed = ["bench", "--demo", "room", "--frames", "0-2", "--no-pictures", "--quiet"];
    for strategy in ["certificate", "reinspect", "scratch"] {
        let more = ["--json", text(&path), "--update", strategy];
        let ran = relume(&[&fixed[..], &COARSE[..], &more[..]].concat());
        ran.says(&[]);
        assert_eq!((ran.out.as_str(), ran.err.as_str()), ("", ""));
        let value = json(&path);
        assert_eq!(value["schema"], "relume-bench/1");
        assert_eq!(value["update"], strategy);
        assert_eq!(value["table"].as_array().unwrap().len(), 1, "no row with pictures");
        let frames = value["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 2);
        for frame in frames {
            let (warm, cold) = (&frame["report"], &frame["from_scratch"]["report"]);
            assert_eq!(warm["hash"], cold["hash"]);
            assert!(cold["dynamic_links"].as_u64() > Some(0));
            assert!(cold["examined"].as_u64() >= warm["examined"].as_u64());
        }
        assert!(value["memory_each"]["pair_bytes"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn bench_compares_the_strategies() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("strategies.json");
    let more = ["bench", "--demo", "room", "--frames", "0-4", "--compare", "--json", text(&path)];
    let ran = relume(&[&more[..], &COARSE[..]].concat());
    ran.says(&[
        "room: tolerance 0.3, oracle error, 2 threads, 4 frames after the first",
        "\nscratch  ",
        "\nreinspect  ",
        "\ncertificate  ",
        "\nextrapolate=7  ",
        "\nextrapolate --error 0.05  ",
        "fewer segments",
    ]);
    let value = json(&path);
    assert_eq!(value["schema"], "relume-strategies/1");
    let means = |k: usize| value["strategies"][k]["means"].clone();
    for exact in 0..3 {
        let row = means(exact);
        assert_eq!(row["equal_frames"], 4, "{row}");
        assert_eq!(
            (row["missed_states"].as_f64(), row["missed_occlusions"].as_f64()),
            (Some(0.0), Some(0.0))
        );
        assert!(row["rms_error"].as_f64() < Some(0.01), "{row}");
    }
    // What certificates spare is looked at by nobody else.
    assert!(means(2)["examined"].as_f64() < means(1)["examined"].as_f64());
    assert!(means(3)["rms_error"].as_f64() > Some(0.0), "extrapolation loses something");
    relume(&["bench", "--demo", "room", "--compare", "--every", "2"]).fails(2, &["--every"]);
}

#[test]
fn wrong_usage_of_bench_is_explained() {
    relume(&["bench"]).fails(2, &["SCENE"]);
    relume(&["bench", "a.glb", "--demo", "room"]).fails(2, &["cannot be used with"]);
    relume(&["bench", "--demo", "cellar"]).fails(2, &["corridor", "room"]);
    relume(&["bench", "missing.glb"]).fails(1, &["error: ", "missing.glb", "\n  help: "]);
    relume(&["bench", "--demo", "room", "--frames", "99"])
        .fails(1, &["frame 99 is outside the animation", "help:"]);
    relume(&["bench", "--demo", "room", "--max-memory", "64K"])
        .fails(3, &["64.00 KiB of memory allowed", "help: raise --max-memory"]);
    relume(&["bench", "--help"]).says(&[
        "Example:  relume ",
        "--demo",
        "--tolerance",
        "[default: 24]",
    ]);
    relume(&["bench", "--demo", "room", "--every", "0"]).fails(2, &["1 or more"]);
    relume(&["bench", "--demo", "room", "--frames", "3"])
        .fails(1, &["two frames or more", "help: ask for more with --frames"]);
    relume(&["bench", "--demo", "room", "--json", "no/such/file.json"])
        .fails(1, &["cannot write", "file.json", "help:"]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_bench_says_how_far_it_came() {
    let ran = interrupted(&["bench", "--demo", "corridor", "--threads", "1"]);
    ran.fails(130, &["stopped: ", " of 109 frames measured"]);
}
