//! Every line of "Use it" in the README does what it says, in order, in an empty folder.
//!
//! Nothing is written twice: the lines are read from the README itself. Only what is left open there is added: a
//! coarse tolerance and small pictures, to save time.

use std::fs;
use std::path::Path;
use std::process::Command;

const README: &str = include_str!("../../../README.md");

/// The commands below a heading: the lines of its first indented block, without their comments.
fn lines_below(heading: &str) -> Vec<String> {
    let section = README.split_once(&format!("\n{heading}\n")).expect("the heading is there").1;
    section
        .lines()
        .take_while(|line| !line.starts_with("## "))
        .skip_while(|line| !line.starts_with("    "))
        .take_while(|line| line.starts_with("    "))
        .map(|line| line.split(" #").next().unwrap_or_default().trim().to_owned())
        .collect()
}

/// Options that make a line quick, where it does not say itself how fine it is to be.
fn cheaper(arguments: &str) -> &'static [&'static str] {
    let command = arguments.split_whitespace().next().unwrap_or_default();
    match command {
        "info" | "check" => &[],
        _ if arguments.contains("--tolerance") => &[],
        "demo" | "render" => &["--tolerance", "0.1", "--size", "160x120"],
        _ => &["--tolerance", "0.1"],
    }
}

/// Runs a line as a shell would: the command itself, or `echo WORDS > FILE`.
fn run(line: &str, dir: &Path) {
    if let Some(rest) = line.strip_prefix("echo ") {
        let (words, file) = rest.split_once(" > ").expect("echo writes a file");
        fs::write(dir.join(file), format!("{words}\n")).unwrap();
        return;
    }
    let arguments = line.strip_prefix("relume ").unwrap_or_else(|| panic!("`{line}`"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_relume"));
    command.args(arguments.split_whitespace()).args(cheaper(arguments));
    let ran = command.current_dir(dir).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "`{line}` ends with {}: {said}", ran.status);
    assert!(!said.contains("error"), "`{line}`: {said}");
}

#[test]
fn every_line_of_use_it_runs_in_order() {
    let dir = tempfile::tempdir().unwrap();
    let lines = lines_below("## Use it");
    assert!(lines.len() >= 12, "{lines:?}");
    for line in &lines {
        run(line, dir.path());
        // What a line says it writes is there.
        let words: Vec<&str> = line.split_whitespace().collect();
        for pair in words.windows(2).filter(|w| ["-o", "--report", ">"].contains(&w[0])) {
            assert!(dir.path().join(pair[1]).exists(), "`{line}` does not write {}", pair[1]);
        }
    }
    for command in
        ["demo", "info", "check", "render", "solve", "probe", "factors", "verify", "bench"]
    {
        let begin = format!("relume {command} ");
        assert!(lines.iter().any(|line| line.starts_with(&begin)), "no line shows {command}");
    }
    assert!(dir.path().join("demo/frame-0019.png").is_file());
    assert!(dir.path().join("out/frame-0019.png").is_file());
    let probed = fs::read_to_string(dir.path().join("E.csv")).unwrap();
    assert_eq!(probed.lines().count(), 1 + 20, "a line for each frame");
}
