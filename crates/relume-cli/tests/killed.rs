//! Runs that are killed and go on, and runs that want the same folder at once.
//!
//! A few in every test run. All of them, with the figures of the README printed:
//!
//! ```text
//! cargo test --release -p relume-cli --test tests killed:: -- --ignored --nocapture
//! ```
#![cfg(unix)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{json, relume, room, text};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn start(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// What a folder holds of finished frames: each one's picture, decoded, and its links' hash.
#[derive(Clone, Default)]
struct Finished {
    hashes: BTreeMap<u64, String>,
    pictures: BTreeMap<u64, Vec<u8>>,
}

/// Reads what a run left, whenever it ended: every picture is whole, the report is whole, and every
/// frame in it has its picture.
fn finished(out: &Path, with_pictures: bool) -> Finished {
    let mut found = Finished::default();
    let entries = fs::read_dir(out).into_iter().flatten();
    for path in entries.map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_str().unwrap();
        let Some(number) = name.strip_prefix("frame-").and_then(|n| n.strip_suffix(".png")) else {
            continue;
        };
        let picture = image::open(&path);
        let picture = picture.unwrap_or_else(|e| panic!("{} is not whole: {e}", path.display()));
        found.pictures.insert(number.parse().unwrap(), picture.into_rgb8().into_raw());
    }
    let report = out.join("report.json");
    if report.exists() {
        for frame in json(&report)["frames"].as_array().unwrap() {
            let number = frame["frame"].as_u64().unwrap();
            assert!(!with_pictures || found.pictures.contains_key(&number), "{number} has none");
            found.hashes.insert(number, frame["hash"].to_string());
        }
    }
    found
}

/// A scene and how it is solved or rendered.
struct Task {
    scene: PathBuf,
    command: &'static str,
    options: Vec<&'static str>,
}

impl Task {
    fn arguments<'a>(&'a self, out: &'a Path) -> Vec<&'a str> {
        let fixed = [self.command, text(&self.scene), "-o", text(out), "--resume"];
        [&fixed[..], &self.options].concat()
    }

    fn draws(&self) -> bool {
        self.command == "render"
    }
}

/// How values of pictures differ.
#[derive(Default)]
struct Difference {
    largest: u8,
    most_share: f64,
}

impl Difference {
    fn see(&mut self, one: &[u8], other: &[u8]) {
        assert_eq!(one.len(), other.len());
        let apart = one.iter().zip(other).map(|(a, b)| a.abs_diff(*b));
        self.largest = self.largest.max(apart.clone().max().unwrap());
        let share = apart.filter(|d| *d > 0).count() as f64 / one.len() as f64;
        self.most_share = self.most_share.max(share);
    }
}

/// What came of a number of kills.
#[derive(Default)]
struct Tally {
    kills: usize,
    /// Of which with SIGKILL.
    hard: usize,
    /// Runs that had ended before they were killed.
    late: usize,
    chains: usize,
    difference: Difference,
}

impl Finished {
    /// Asserts that nothing of these frames is lost or changed.
    fn is_kept_in(&self, now: &Finished) {
        for (frame, hash) in &self.hashes {
            assert_eq!(now.hashes.get(frame), Some(hash), "frame {frame} was finished");
        }
        for (frame, picture) in &self.pictures {
            if self.hashes.contains_key(frame) {
                assert!(now.pictures[frame] == *picture, "picture {frame} was finished");
            }
        }
    }
}

/// Kills runs at random times, each time going on in the same folder, and compares with the unbroken
/// run, until there were `kills`.
fn kill(task: &Task, kills: usize, seed: u64, tally: &mut Tally) {
    let dir = tempfile::tempdir().unwrap();
    let whole = dir.path().join("whole");
    let begun = Instant::now();
    relume(&task.arguments(&whole)).succeeds();
    let whole_s = begun.elapsed().as_secs_f64();
    let unbroken = finished(&whole, task.draws());
    let mut random = Random(seed);
    let wanted = tally.kills + kills;
    while tally.kills < wanted {
        let out = dir.path().join(format!("broken-{}", tally.chains));
        tally.chains += 1;
        let mut before = Finished::default();
        for _ in 0..1 + random.next() % 5 {
            let hard = random.next().is_multiple_of(2);
            let mut run = start(&task.arguments(&out));
            std::thread::sleep(Duration::from_secs_f64(random.share() * whole_s));
            if run.try_wait().unwrap().is_some() {
                tally.late += 1;
                assert!(run.wait().unwrap().success());
                break;
            }
            let signal = if hard { "-KILL" } else { "-TERM" };
            let id = run.id().to_string();
            let _ = Command::new("kill").args([signal, &id]).status().unwrap();
            let ended = run.wait_with_output().unwrap();
            let said = String::from_utf8_lossy(&ended.stderr).into_owned();
            assert!(!said.contains("panicked"), "{said}");
            tally.kills += 1;
            tally.hard += usize::from(hard);
            // Nothing that was finished is lost or changed.
            let now = finished(&out, task.draws());
            before.is_kept_in(&now);
            before = now;
        }
        relume(&task.arguments(&out)).succeeds();
        let after = finished(&out, task.draws());
        assert_eq!(after.hashes, unbroken.hashes, "links are those of the unbroken run");
        assert_eq!(
            after.pictures.keys().collect::<Vec<_>>(),
            unbroken.pictures.keys().collect::<Vec<_>>()
        );
        for (frame, picture) in &after.pictures {
            tally.difference.see(picture, &unbroken.pictures[frame]);
        }
        let names = fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name());
        let left: BTreeSet<String> = names
            .map(|name| name.into_string().unwrap())
            .filter(|name| name != "report.json" && !name.starts_with("frame-"))
            .collect();
        assert_eq!(left, BTreeSet::new(), "nothing else is left behind");
        fs::remove_dir_all(&out).unwrap();
    }
}

/// Starts two runs on one folder at once: one has it, the other is told by whom.
fn pair(task: &Task, wait: Duration) -> bool {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let first = start(&task.arguments(&out));
    std::thread::sleep(wait);
    let second = start(&task.arguments(&out));
    let ids = [first.id(), second.id()];
    let ended = [first, second].map(|run| run.wait_with_output().unwrap());
    let won: Vec<usize> = (0..2).filter(|&k| ended[k].status.success()).collect();
    let said = [0, 1].map(|k| String::from_utf8_lossy(&ended[k].stderr).into_owned());
    assert_eq!(won.len(), 1, "exactly one run has the folder: {said:?}");
    let loser = 1 - won[0];
    assert_eq!(ended[loser].status.code(), Some(1), "{}", said[loser]);
    let message = format!("process {} is writing to", ids[won[0]]);
    assert!(said[loser].contains(&message), "`{message}` is missing in {}", said[loser]);
    let all = finished(&out, task.draws());
    assert_eq!(
        all.hashes.len(),
        json(&out.join("report.json"))["frames"].as_array().unwrap().len()
    );
    let unbroken = dir.path().join("alone");
    relume(&task.arguments(&unbroken)).succeeds();
    let alone = finished(&unbroken, task.draws());
    assert!(all.hashes == alone.hashes && all.pictures == alone.pictures, "they were mixed");
    won[0] == 0
}

fn render_of(scene: &Path, options: &[&'static str]) -> Task {
    Task { scene: scene.to_owned(), command: "render", options: options.to_vec() }
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../relume-core/tests/data").join(name)
}

const SMALL: [&str; 6] = ["--tolerance", "0.1", "--size", "96x72", "--frames", "0-11"];

#[test]
fn killed_runs_go_on_with_nothing_lost() {
    let (_dir, scene) = room();
    let mut tally = Tally::default();
    kill(&render_of(&scene, &SMALL), 4, 1, &mut tally);
    let options = vec!["--tolerance", "0.1", "--frames", "0-11"];
    kill(&Task { scene, command: "solve", options }, 2, 2, &mut tally);
    assert!(tally.kills >= 6);
    assert!(tally.difference.largest <= 1, "off by {} levels", tally.difference.largest);
}

#[test]
fn of_two_runs_in_one_folder_one_is_refused() {
    let (_dir, scene) = room();
    for wait_ms in [0, 0, 3] {
        pair(&render_of(&scene, &SMALL), Duration::from_millis(wait_ms));
    }
}

#[test]
#[ignore = "some minutes: 100 kills on five scenes, at the default size"]
fn a_hundred_kills() {
    let (_dir, room) = room();
    let corridor = tempfile::tempdir().unwrap();
    let at = text(corridor.path());
    relume(&["demo", "corridor", "-o", at, "--frames", "999"]).fails(1, &["frame 999"]);
    let corridor = corridor.path().join("corridor.glb");
    let pictures = ["--tolerance", "0.05", "--frames", "0-19"];
    let numbers = ["--tolerance", "0.05", "--frames", "0-19"].to_vec();
    let tasks = [
        ("room", render_of(&room, &pictures), 25),
        ("corridor", render_of(&corridor, &pictures), 20),
        ("box and lamp", render_of(&data("cornell_moving_box_and_lamp.glb"), &pictures), 20),
        ("box in a room", render_of(&data("box_room.glb"), &pictures), 20),
        ("room, numbers only", Task { scene: room, command: "solve", options: numbers }, 15),
    ];
    let mut kills = 0;
    for (k, (name, task, wanted)) in tasks.iter().enumerate() {
        let mut tally = Tally::default();
        kill(task, *wanted, 100 + k as u64, &mut tally);
        kills += tally.kills;
        println!(
            "{name}: {} kills ({} of them SIGKILL) in {} runs from start to end, {} had ended before; pictures \
             differ by {} levels of 255 at most, {:.2} % of the values of a picture at most",
            tally.kills,
            tally.hard,
            tally.chains,
            tally.late,
            tally.difference.largest,
            tally.difference.most_share * 100.0,
        );
        assert!(tally.difference.largest <= 1);
    }
    assert!(kills >= 100);
}

#[test]
#[ignore = "a minute: 20 pairs"]
fn twenty_pairs_of_runs() {
    let (_dir, scene) = room();
    let mut random = Random(7);
    let mut first = 0;
    for _ in 0..20 {
        // Mostly within what a start takes, now and then in the middle of the first run.
        let wait_s = random.share().powi(3) * 0.05;
        first += usize::from(pair(&render_of(&scene, &SMALL), Duration::from_secs_f64(wait_s)));
    }
    println!("20 pairs: one run refused in each; the one that was started first won {first}");
}

#[test]
fn a_report_is_not_put_where_another_run_writes_its_own() {
    let (dir, scene) = room();
    let out = dir.path().join("out");
    fs::create_dir(&out).unwrap();
    // As a render holds it.
    let lock = fs::File::create(out.join(".relume.lock")).unwrap();
    lock.lock().unwrap();
    let (report, other) = (out.join("report.json"), out.join("numbers.json"));
    let solve = |report: &Path| {
        relume(&[
            "solve",
            text(&scene),
            "--frames",
            "0",
            "--tolerance",
            "0.1",
            "--report",
            text(report),
        ])
    };
    solve(&report).fails(1, &["is writing to", "out"]);
    assert!(!report.exists());
    solve(&other).succeeds();
    drop(lock);
    solve(&report).succeeds();
    assert!(report.exists());
}
