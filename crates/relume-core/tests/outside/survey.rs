//! Hundreds of scenes of each kind, each in a process of its own, so that one that panics or does not end is a line
//! among others.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use relume_io::export::write_glb;

use crate::outside::case::Case;
use crate::outside::verdict::{STEP, Verdict, judge};
use crate::outside::{KINDS, kind};

/// One line about a scene.
fn line(name: &str, seed: u64, case: &Case, verdict: &Verdict) -> String {
    let worst = match (&verdict.refused, verdict.worst()) {
        (Some(why), _) => format!("refused: {why}"),
        (None, Some(m)) => format!("{:.2} of the limit: off {:.2e}, {}", m.share(), m.off, m.what),
        (None, None) => "nothing was measured".to_owned(),
    };
    format!(
        "{} {name} {seed} at {}: {:.1} s, {} links, elements to {:.2}; {worst} [{}]",
        if verdict.passes() { "pass" } else { "FAIL" },
        case.tolerance,
        verdict.engine_s,
        verdict.links,
        verdict.element,
        case.story
    )
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn tolerance() -> Option<f64> {
    variable("RELUME_TOLERANCE").map(|t| t.parse().expect("RELUME_TOLERANCE is a number"))
}

/// What begins the line of a scene's result, for the process that waits for it.
const RESULT: &str = "RESULT ";

#[test]
#[ignore = "one scene, named by RELUME_SCENE"]
fn one_scene() {
    let Some(scene) = variable("RELUME_SCENE") else {
        println!("RELUME_SCENE='slab 17' says which");
        return;
    };
    let (name, seed) = scene.split_once(' ').expect("RELUME_SCENE is a kind and a seed");
    let seed = seed.parse().expect("a seed is a number");
    let mut case = kind(name).case(seed, tolerance());
    case.says_steps = true;
    if let Some(file) = variable("RELUME_GLB") {
        write_glb(&case.scene(), Path::new(&file)).expect("a scene can be written");
    }
    let loud = variable("RELUME_QUIET").is_none();
    if loud {
        println!("{}, at {}", case.story, case.tolerance);
        for panel in &case.panels {
            println!("{panel:?}");
        }
        println!("{:?}\n{:?}", case.movers, case.sensors);
    }
    let verdict = judge(&case);
    if loud {
        for m in &verdict.measures {
            println!("{:8.3} of the limit: off {:9.2e}, {}", m.share(), m.off, m.what);
        }
    }
    let classes = verdict.by_class();
    let classes: Vec<String> = classes.iter().map(|(c, s)| format!("{c}={s}")).collect();
    let line = line(name, seed, &case, &verdict);
    println!("{RESULT}{} {} {line}", classes.join(","), verdict.engine_s);
}

/// What became of a scene.
pub(crate) struct Outcome {
    pub(crate) passes: bool,
    seed: u64,
    /// Worst error of each class of measures, in its limit; none where there is no result.
    shares: BTreeMap<String, f64>,
    engine_s: f64,
    /// All in one line.
    pub(crate) line: String,
}

/// Runs a scene in a process of its own.
pub(crate) fn apart(name: &str, seed: u64, limit: Duration) -> Outcome {
    let this = std::env::current_exe().expect("a test has a path");
    let mut child = Command::new(this)
        .args([
            "--ignored",
            "--exact",
            "outside::survey::one_scene",
            "--nocapture",
            "--test-threads=1",
        ])
        .env("RELUME_SCENE", format!("{name} {seed}"))
        .env("RELUME_QUIET", "1")
        .env("RAYON_NUM_THREADS", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the test starts itself");
    let start = Instant::now();
    let ended = loop {
        if child.try_wait().expect("a child can be asked").is_some() {
            break true;
        }
        if start.elapsed() > limit {
            child.kill().expect("a child can be ended");
            child.wait().expect("an ended child can be waited for");
            break false;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let (mut out, mut err) = (String::new(), String::new());
    // Little is written, so that no pipe fills before the end.
    child.stdout.take().expect("piped").read_to_string(&mut out).expect("text");
    child.stderr.take().expect("piped").read_to_string(&mut err).expect("text");
    let found = out.lines().find_map(|l| l.split_once(RESULT)).map(|l| l.1.splitn(3, ' '));
    let failed = |line: String| {
        let engine_s = start.elapsed().as_secs_f64();
        Outcome { passes: false, seed, shares: BTreeMap::new(), engine_s, line }
    };
    match found {
        Some(mut words) => {
            let class =
                |c: &str| c.split_once('=').map(|(c, s)| Some((c.to_owned(), s.parse().ok()?)));
            let shares =
                words.next().unwrap_or_default().split(',').filter_map(|c| class(c)?).collect();
            let engine_s = words.next().and_then(|w| w.parse().ok()).unwrap_or(f64::NAN);
            let line = words.next().unwrap_or_default().to_owned();
            Outcome { passes: line.starts_with("pass"), seed, shares, engine_s, line }
        }
        None if !ended => {
            let last = out.lines().filter_map(|l| l.split_once(STEP)).next_back();
            let last = last.map_or("no frame solved".to_owned(), |l| format!("solved {}", l.1));
            failed(format!("FAIL {name} {seed}: not done after {limit:?}, {last}"))
        }
        None => {
            let why = err.lines().find(|l| l.contains("panicked")).unwrap_or("");
            let next = err.lines().skip_while(|l| !l.contains("panicked")).nth(1).unwrap_or("");
            failed(format!("FAIL {name} {seed}: ended without a result: {why} {next}"))
        }
    }
}

/// The seeds that `RELUME_SEEDS` names, `A..B`.
fn seeds() -> std::ops::Range<u64> {
    let Some(text) = variable("RELUME_SEEDS") else { return 0..500 };
    let (lo, hi) = text.split_once("..").expect("RELUME_SEEDS is like 0..500");
    lo.parse().expect("a number")..hi.parse().expect("a number")
}

/// Of each class of measures: how many scenes keep it, and the worst, in the limit.
fn by_class(outcomes: &[Outcome]) -> String {
    let classes: BTreeSet<&String> = outcomes.iter().flat_map(|o| o.shares.keys()).collect();
    let mut text = String::new();
    for class in classes {
        let mut of: Vec<(f64, u64)> =
            outcomes.iter().filter_map(|o| Some((*o.shares.get(class)?, o.seed))).collect();
        let kept = of.iter().filter(|s| s.0 <= 1.0).count();
        of.sort_by(|a, b| b.0.total_cmp(&a.0));
        let worst: Vec<String> =
            of.iter().take(3).map(|(share, seed)| format!("{share:.3} (seed {seed})")).collect();
        let worst = worst.join(", ");
        text +=
            &format!("    {class:10} {kept:4} of {:4}; worst, of the limit: {worst}\n", of.len());
    }
    let none = outcomes.iter().filter(|o| o.shares.is_empty()).count();
    if none > 0 {
        text += &format!("    no result  {none:4}\n");
    }
    text
}

#[test]
#[ignore = "hours: five hundred scenes of each kind"]
fn five_hundred_of_each() {
    let names = variable("RELUME_KINDS");
    let limit = variable("RELUME_LIMIT_S").map_or(60.0, |s| s.parse().expect("seconds"));
    let limit = Duration::from_secs_f64(limit);
    let jobs = variable("RELUME_JOBS").map_or(2, |s| s.parse().expect("a number"));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().expect("threads");
    let kinds: Vec<&str> = match &names {
        Some(names) => names.split(',').map(|n| kind(n).name).collect(),
        None => KINDS.iter().map(|k| k.name).collect(),
    };
    let mut all = true;
    let mut table = String::new();
    for name in kinds {
        let one = |seed: u64| {
            let outcome = apart(name, seed, limit);
            if !outcome.passes {
                println!("{}", outcome.line);
            }
            outcome
        };
        let range: Vec<u64> = seeds().collect();
        let mut outcomes: Vec<Outcome> =
            pool.install(|| range.par_iter().map(|&s| one(s)).collect());
        let passed = outcomes.iter().filter(|o| o.passes).count();
        all &= passed == outcomes.len();
        outcomes.sort_by(|a, b| b.engine_s.total_cmp(&a.engine_s));
        let slowest = outcomes.first().map(|o| format!("{:.1} s (seed {})", o.engine_s, o.seed));
        let row = format!(
            "{name:14} {passed:4} of {:4} pass; slowest {}\n{}",
            outcomes.len(),
            slowest.unwrap_or_default(),
            by_class(&outcomes)
        );
        print!("{row}");
        table += &row;
    }
    println!("\n{table}");
    assert!(all, "not all pass");
}
