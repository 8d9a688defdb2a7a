//! Running the command and looking at what it printed, shared by the integration tests.
#![allow(dead_code)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// What a run printed, and its exit code.
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Ran {
    /// Asserts an exit code and that stderr holds each of the texts.
    #[track_caller]
    pub(crate) fn fails(&self, code: i32, texts: &[&str]) {
        assert_eq!(self.code, Some(code), "{}{}", self.out, self.err);
        assert!(!self.err.contains("panicked"), "{}", self.err);
        for text in texts {
            assert!(self.err.contains(text), "`{text}` is missing in:\n{}", self.err);
        }
    }

    /// Asserts that all went well and that stdout holds each of the texts.
    #[track_caller]
    pub(crate) fn says(&self, texts: &[&str]) {
        assert_eq!(self.code, Some(0), "{}{}", self.out, self.err);
        for text in texts {
            assert!(self.out.contains(text), "`{text}` is missing in:\n{}", self.out);
        }
    }

    /// Asserts that all went well.
    #[track_caller]
    pub(crate) fn succeeds(self) -> Ran {
        assert_eq!(self.code, Some(0), "{}{}", self.out, self.err);
        self
    }
}

/// Runs the command.
pub(crate) fn relume(arguments: &[&str]) -> Ran {
    let Output { status, stdout, stderr } =
        Command::new(env!("CARGO_BIN_EXE_relume")).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ran { code: status.code(), out: text(stdout), err: text(stderr) }
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A file as JSON.
pub(crate) fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// A directory with `room.glb` in it.
pub(crate) fn room() -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    // The scene is written before anything is solved; frame 99 does not exist, so nothing is.
    let out = dir.path().to_str().unwrap();
    relume(&["demo", "room", "-o", out, "--frames", "99"]).fails(1, &["frame 99"]);
    let scene = dir.path().join("room.glb");
    assert!(scene.is_file());
    (dir, scene)
}

/// Starts a run, interrupts it as Ctrl-C does, and returns what came of it.
#[cfg(unix)]
pub(crate) fn interrupted(arguments: &[&str]) -> Ran {
    use std::process::Stdio;
    let child = Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(500));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ran { code: status.code(), out: text(stdout), err: text(stderr) }
}
