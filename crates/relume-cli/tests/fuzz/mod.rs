//! Damaged files of every format that is read, made from valid ones by their structure: whatever the command is
//! given, it ends in time and within bounds, in words and with an exit code of its own, and writes numbers.
//!
//! Everything follows from a seed. `RELUME_FUZZ_RUNS=100000 cargo test --release -p relume-cli --test tests fuzz:: -- --ignored
//! --nocapture` runs as many as are asked for (`RELUME_FUZZ_SEED` begins elsewhere) and keeps what it finds in
//! `RELUME_FUZZ_KEEP`, or in `target/tmp/fuzz`. Must not know how anything is read.

// Tests may use clocks and whatever the platform offers.
#![allow(clippy::disallowed_methods)]

mod child;
mod glb;
mod mutate;
mod random;
mod seeds;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use self::child::{Find, Limits};
use self::random::Random;
use self::seeds::{Format, Seed};

/// What is tried with a file.
fn commands(format: Format, random: &mut Random) -> Vec<Vec<String>> {
    let of = |words: &str| words.split_whitespace().map(str::to_owned).collect::<Vec<String>>();
    let coarse = "--frames 0 --tolerance 0.5 --threads 1 --max-memory 1G --quiet";
    match format {
        Format::Glb | Format::Gltf => match random.below(8) {
            0 => vec![of("info FILE"), of(&format!("solve FILE --sky uniform=1 {coarse}"))],
            1 => vec![of(&format!("factors FILE {coarse}"))],
            2 => vec![of(&format!("probe FILE SENSORS {coarse}"))],
            3..=4 => vec![of("check FILE")],
            _ => vec![of("info FILE")],
        },
        Format::Obj | Format::Stl | Format::Ply => match random.below(3) {
            0 => vec![of("info FILE"), of(&format!("factors FILE {coarse}"))],
            _ => vec![of("info FILE")],
        },
        Format::View3d => match random.below(4) {
            0 => vec![of("info FILE"), of(&format!("factors FILE {coarse}"))],
            _ => vec![of("check FILE")],
        },
        Format::Flat | Format::Svg => match random.below(3) {
            0 => vec![of("flat FILE --frames 0 --epsilon 0.3 --min-length 0.2 --verify")],
            _ => vec![of("flat FILE --frames 0 --epsilon 0.3 --min-length 0.2")],
        },
        Format::Sensors => vec![of(&format!("probe SCENE FILE {coarse}"))],
    }
}

/// Tries files from `first` on until `runs` are done or time is over; how many were, and what was found.
fn hunt(first: u64, runs: u64, until: Instant, keep: &Path) -> (u64, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("valid.glb");
    let sensors = folder.path().join("valid.txt");
    let seeds = seeds::all();
    std::fs::write(&scene, seeds::room_glb()).unwrap();
    std::fs::write(&sensors, seeds::SENSORS).unwrap();
    let limits = Limits { seconds: Duration::from_secs(60), kilobytes: 2 << 20 };
    let mut found = Vec::new();
    let mut done = 0;
    while done < runs && Instant::now() < until {
        let number = first + done;
        let mut random = Random::new(number);
        let seed: &Seed = &seeds[random.below(seeds.len())];
        let bytes = mutate::mutated(seed, &mut random);
        let file = folder.path().join(format!("case.{}", seed.format.ending()));
        std::fs::write(&file, &bytes).unwrap();
        let mut verdicts = Vec::new();
        for command in commands(seed.format, &mut random) {
            let arguments: Vec<String> = command
                .iter()
                .map(|word| match word.as_str() {
                    "FILE" => file.display().to_string(),
                    "SCENE" => scene.display().to_string(),
                    "SENSORS" => sensors.display().to_string(),
                    other => other.to_owned(),
                })
                .collect();
            match child::run(&arguments, &limits) {
                Ok(code) => verdicts.push(code),
                Err(Find { what, said }) => {
                    let name = format!("{number}.{}", seed.format.ending());
                    std::fs::create_dir_all(keep).unwrap();
                    std::fs::write(keep.join(&name), &bytes).unwrap();
                    let line = format!("{name}: relume {}: {what}: {said}", command.join(" "));
                    println!("{line}");
                    found.push(line);
                }
            }
        }
        // One reader, one verdict.
        if let [info, solve] = verdicts[..]
            && info != solve
        {
            let name = format!("{number}.{}", seed.format.ending());
            std::fs::create_dir_all(keep).unwrap();
            std::fs::write(keep.join(&name), &bytes).unwrap();
            let line = format!("{name}: info ends with {info}, what solves it with {solve}");
            println!("{line}");
            found.push(line);
        }
        done += 1;
    }
    (done, found)
}

fn keep() -> PathBuf {
    std::env::var_os("RELUME_FUZZ_KEEP")
        .map_or_else(|| Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz"), PathBuf::from)
}

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

#[test]
fn valid_seeds_are_read_and_solved() {
    let folder = tempfile::tempdir().unwrap();
    for seed in seeds::all() {
        let file = folder.path().join(format!("valid.{}", seed.format.ending()));
        std::fs::write(&file, seed.bytes()).unwrap();
        let file = file.display().to_string();
        let arguments = match seed.format {
            Format::Flat | Format::Svg => vec!["flat".to_owned(), file],
            Format::Sensors => {
                let scene = folder.path().join("room.glb");
                std::fs::write(&scene, seeds::room_glb()).unwrap();
                [
                    "probe",
                    &scene.display().to_string(),
                    &file,
                    "--tolerance",
                    "0.5",
                    "--frames",
                    "0",
                ]
                .map(str::to_owned)
                .to_vec()
            }
            _ => ["factors", &file, "--tolerance", "0.5", "--frames", "0"]
                .map(str::to_owned)
                .to_vec(),
        };
        let limits = Limits { seconds: Duration::from_secs(60), kilobytes: 2 << 20 };
        assert_eq!(child::run(&arguments, &limits), Ok(0), "{}", seed.name);
    }
}

#[test]
fn damaged_files_end_in_words_and_in_time() {
    let until = Instant::now() + Duration::from_secs(40);
    let (done, found) = hunt(10_000, 2_000, until, &keep());
    println!("{done} files tried");
    assert!(found.is_empty(), "{}\nthe files are in {}", found.join("\n"), keep().display());
}

#[test]
#[ignore = "takes as long as it is asked to: see the head of this file"]
fn as_many_damaged_files_as_asked_for_end_in_words_and_in_time() {
    let never = Instant::now() + Duration::from_secs(7 * 24 * 3600);
    let (first, runs) = (number("RELUME_FUZZ_SEED", 1), number("RELUME_FUZZ_RUNS", 100_000));
    let (done, found) = hunt(first, runs, never, &keep());
    println!("{done} files tried, {} finds", found.len());
    assert!(found.is_empty(), "{}\nthe files are in {}", found.join("\n"), keep().display());
}
