//! The order of the rooms, checked from the source: each uses only the rooms above it.
//!
//! Read from the text of every file, not from its `use` lines alone, so that a path written out
//! in the middle of a function counts too. Comments do not: a doc link downwards is harmless.

use std::fs;
use std::path::{Path, PathBuf};

/// The rooms of the engine, from the ground up. A room may use those before it.
const ROOMS: [&str; 12] = [
    "geometry",
    "scene",
    "element",
    "transport",
    "predict",
    "pair",
    "solver",
    "follow",
    "space",
    "read",
    "session",
    "flat",
];

/// What the phases of a frame must not know, though it is above them: where things are is asked of a space.
const NOT_OF_FRAMES: [&str; 3] = ["geometry", "scene", "transport"];

/// The crates from the ground up, with the names they have in source text.
const CRATES: [(&str, &str); 5] = [
    ("relume-core", "relume_core"),
    ("relume-io", "relume_io"),
    ("relume-picture", "relume_picture"),
    ("relume", "relume"),
    ("relume-cli", "relume_cli"),
];

/// The crate of references: it uses none of those above, and only their tests may use it.
const JUDGE: (&str, &str) = ("relume-judge", "relume_judge");

/// Text without comments, with line breaks kept so that lines can be counted.
pub(crate) fn without_comments(text: &str) -> String {
    text.lines()
        .map(|line| line.split_once("//").map_or(line, |(code, _)| code))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Every identifier that directly follows `crate::` in `text`, braces of a `use` list expanded,
/// with its line number from 1.
fn rooms_used(text: &str) -> Vec<(usize, String)> {
    let code = without_comments(text);
    let mut found = Vec::new();
    let mut rest_from = 0;
    while let Some(at) = code[rest_from..].find("crate::") {
        let start = rest_from + at + "crate::".len();
        let line = code[..start].matches('\n').count() + 1;
        rest_from = start;
        // `$crate::` counts as well; `other_crate::` does not.
        let before = code[..start - "crate::".len()].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        for name in heads(&code[start..]) {
            found.push((line, name));
        }
    }
    found
}

/// First path segments of what follows `crate::`: one identifier, or those of a `{...}` list.
fn heads(rest: &str) -> Vec<String> {
    let identifier = |s: &str| -> String {
        s.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    let Some(list) = rest.trim_start().strip_prefix('{') else {
        return vec![identifier(rest)];
    };
    let mut names = Vec::new();
    let (mut depth, mut item) = (0, String::new());
    for c in list.chars() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => names.push(identifier(&std::mem::take(&mut item))),
            _ if depth == 0 => item.push(c),
            _ => {}
        }
    }
    names.push(identifier(&item));
    names.retain(|name| !name.is_empty());
    names
}

/// What is wrong with `text`, a file of `room`: one line for each use of a room below.
fn violations(room: &str, file: &str, text: &str) -> Vec<String> {
    let Some(level) = ROOMS.iter().position(|r| *r == room) else {
        return vec![format!("{file}: `{room}` is not a room: put it into ROOMS in layers.rs")];
    };
    let mut wrong: Vec<String> = rooms_used(text)
        .into_iter()
        .filter_map(|(line, name)| {
            let used = ROOMS.iter().position(|r| *r == name)?;
            (used > level)
                .then(|| format!("{file}:{line}: `{room}` uses `{name}`, which is below it"))
        })
        .collect();
    for (number, line) in without_comments(text).lines().enumerate() {
        // Leaving the room by `super::super` would escape the check above.
        if line.contains("super::super::super") {
            wrong.push(format!("{file}:{}: write `crate::...` instead", number + 1));
        }
    }
    wrong
}

/// All `.rs` files below `dir`, in name order.
pub(crate) fn sources(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut entries: Vec<PathBuf> =
        fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

pub(crate) fn crates_dir() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

#[test]
fn each_room_uses_only_rooms_above_it() {
    let src = crates_dir().join("relume-core/src");
    let mut wrong = Vec::new();
    let mut rooms_seen = 0;
    for file in sources(&src) {
        let relative = file.strip_prefix(&src).unwrap();
        let first = relative.components().next().unwrap().as_os_str().to_str().unwrap();
        let room = first.strip_suffix(".rs").unwrap_or(first);
        if room == "lib" {
            continue;
        }
        rooms_seen += 1;
        let text = fs::read_to_string(&file).unwrap();
        wrong.extend(violations(room, &relative.display().to_string(), &text));
    }
    assert!(rooms_seen >= 3, "the engine's source was not found");
    assert!(wrong.is_empty(), "rooms out of order:\n{}", wrong.join("\n"));
}

#[test]
fn the_phases_of_a_frame_know_no_space() {
    let follow = crates_dir().join("relume-core/src/follow");
    let files = sources(&follow);
    assert!(files.len() > 5, "the phases were not found");
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        for (line, name) in rooms_used(&text) {
            assert!(!NOT_OF_FRAMES.contains(&&*name), "{}:{line} uses {name}", file.display());
        }
    }
}

#[test]
fn each_crate_uses_only_crates_above_it() {
    let mut wrong = Vec::new();
    for (level, (dir, _)) in CRATES.iter().enumerate() {
        let manifest = fs::read_to_string(crates_dir().join(dir).join("Cargo.toml")).unwrap();
        let dependencies = entries(&manifest, "dependencies");
        for (below, ident) in &CRATES[level + 1..] {
            if dependencies.iter().any(|name| name == below) {
                wrong.push(format!("{dir}/Cargo.toml depends on {below}, which is below it"));
            }
            for file in sources(&crates_dir().join(dir).join("src")) {
                let text = without_comments(&fs::read_to_string(&file).unwrap());
                if text.contains(&format!("{ident}::")) {
                    wrong.push(format!("{} uses {below}, which is below {dir}", file.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "crates out of order:\n{}", wrong.join("\n"));
}

/// What the engine may depend on: nothing that reads or writes a format of files.
const ENGINE_NEEDS: [&str; 9] = [
    "fearless_simd",
    "glam",
    "libm",
    "obvhs",
    "rayon",
    "serde",
    "solar-positioning",
    "strsim",
    "thiserror",
];

/// Ways to files that the engine does not take.
const FILES: [&str; 5] = ["std::fs", "fs::", "File::", "OpenOptions", "include_bytes!"];

/// The names of the dependencies in one table of a manifest.
fn entries(manifest: &str, name: &str) -> Vec<String> {
    let of_line = |line: &str| line.split(['.', '=', ' ']).next().unwrap_or("").to_owned();
    let names = table(manifest, name).lines().map(of_line).collect::<Vec<_>>();
    names.into_iter().filter(|name| !name.is_empty() && !name.starts_with('#')).collect()
}

#[test]
fn the_engine_knows_no_files() {
    let engine = crates_dir().join("relume-core");
    let manifest = fs::read_to_string(engine.join("Cargo.toml")).unwrap();
    assert_eq!(entries(&manifest, "dependencies"), ENGINE_NEEDS);
    for file in sources(&engine.join("src")) {
        let text = without_comments(&fs::read_to_string(&file).unwrap());
        for way in FILES {
            assert!(!text.contains(way), "{} uses {way}", file.display());
        }
    }
}

#[test]
fn crates_that_compute_ban_the_same_calls() {
    let bans = |dir: &str| fs::read_to_string(crates_dir().join(dir).join("clippy.toml")).unwrap();
    assert_eq!(bans("relume-core"), bans("relume-io"));
}

/// The variants of a public enum in a source text.
fn variants(text: &str, name: &str) -> Vec<String> {
    let code = without_comments(text);
    let body = code.split_once(&format!("pub enum {name} {{\n")).map_or("", |(_, rest)| rest);
    let body = body.split("\n}").next().unwrap_or("");
    let of_line = |line: &str| {
        let line = line.strip_prefix("    ").filter(|rest| rest.starts_with(char::is_uppercase))?;
        Some(line.chars().take_while(|c| c.is_alphanumeric()).collect())
    };
    body.lines().filter_map(of_line).collect()
}

/// Outside of the engine no match over commands is exhaustive, so that the build does not say which one a log leaves out.
#[test]
fn a_log_knows_every_command() {
    let read = |file: &str| fs::read_to_string(crates_dir().join(file)).unwrap();
    let commands = variants(&read("relume-core/src/session/command.rs"), "Command");
    assert!(commands.len() >= 9 && commands.contains(&"PutBack".to_owned()), "{commands:?}");
    let log = without_comments(&read("relume-io/src/log.rs"));
    let written = log.split_once("fn of(").unwrap().1;
    let written = written.split("fn command(").next().unwrap();
    for command in commands {
        assert!(written.contains(&format!("Command::{command}(")), "a log leaves out {command}");
    }
}

/// A filter that fits no test passes without a word.
#[test]
fn the_fast_tier_names_modules_that_are_there() {
    let script = fs::read_to_string(crates_dir().join("../.ci/fast")).unwrap();
    let files: Vec<PathBuf> = sources(&crates_dir());
    for list in ["engine", "others"] {
        let names = script.split_once(&format!("\n{list}=(")).unwrap().1.split(')').next().unwrap();
        assert!(names.split_whitespace().count() >= 3, "{list}: {names}");
        for name in names.split_whitespace() {
            let is_it = |file: &PathBuf| {
                let of_tests = file.iter().any(|part| part == "tests");
                let module = file.with_extension("");
                of_tests && (module.ends_with(name) || module.ends_with(format!("{name}/mod")))
            };
            assert!(files.iter().any(is_it), ".ci/fast: there are no tests `{name}`");
        }
    }
}

/// The entries of one table of a manifest.
fn table(manifest: &str, name: &str) -> String {
    let after = manifest.split_once(&format!("[{name}]\n")).map_or("", |(_, rest)| rest);
    after.split("\n[").next().unwrap_or("").to_owned()
}

#[test]
fn the_judge_is_independent_and_for_tests_only() {
    let read = |dir: &str| fs::read_to_string(crates_dir().join(dir).join("Cargo.toml")).unwrap();
    let code = |dir: &str| -> Vec<(PathBuf, String)> {
        let files = sources(&crates_dir().join(dir).join("src"));
        files.into_iter().map(|f| (f.clone(), fs::read_to_string(f).unwrap())).collect()
    };
    let manifest = read(JUDGE.0);
    assert!(manifest.contains("publish = false"));
    assert!(!table(&manifest, "dependencies").contains("relume"), "the judge uses the engine");
    assert!(!manifest.contains("dev-dependencies"), "the judge needs no help in its own tests");
    for (dir, _) in CRATES {
        assert!(!table(&read(dir), "dependencies").contains(JUDGE.0), "{dir} uses the judge");
        for (file, text) in code(dir) {
            assert!(!without_comments(&text).contains(JUDGE.1), "{} uses it", file.display());
        }
    }
    assert!(table(&read("relume-core"), "dev-dependencies").contains(JUDGE.0));
}

#[test]
fn checker_finds_a_use_of_a_room_below() {
    for bad in [
        "use crate::solver::gather;",
        "use crate::{geometry::Pose, solver::gather};",
        "use crate::{\n    geometry::{Pose, Bounds},\n    session::Session,\n};",
        "fn f() { let x = crate::session::Options::default(); }",
        "pub use crate::pair;",
    ] {
        assert_eq!(violations("transport", "bad.rs", bad).len(), 1, "{bad}");
    }
    assert_eq!(violations("nowhere", "bad.rs", "").len(), 1);
    assert_eq!(violations("pair", "bad.rs", "use super::super::super::session::X;").len(), 1);
}

#[test]
fn checker_accepts_what_is_in_order() {
    for good in [
        "use crate::geometry::Pose;\nuse crate::{scene::Scene, element::Element};",
        "// use crate::session::Session;",
        "/// See [`crate::solver`].",
        "use my_crate::session::Session;",
        "use crate::transport::exchange;",
    ] {
        assert_eq!(violations("transport", "good.rs", good), Vec::<String>::new(), "{good}");
    }
}
