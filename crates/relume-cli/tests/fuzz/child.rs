//! The command in a process of its own, with limits, and what is wrong with how it ended.

use std::io::Read;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// What a run may take.
pub(crate) struct Limits {
    pub(crate) seconds: Duration,
    pub(crate) kilobytes: u64,
}

/// Something that no input may do.
#[derive(Debug, PartialEq)]
pub(crate) struct Find {
    pub(crate) what: String,
    pub(crate) said: String,
}

/// Runs the command; its exit code, 0, 1 or 3, if all is as it should be.
pub(crate) fn run(arguments: &[String], limits: &Limits) -> Result<i32, Find> {
    // The shell sets the limit of memory: the standard library cannot.
    let limited = format!("ulimit -v {}; exec \"$@\"", limits.kilobytes);
    let mut child = Command::new("sh")
        .args(["-c", &limited, "sh", env!("CARGO_BIN_EXE_relume")])
        .args(arguments)
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
    let read = |mut from: Box<dyn Read + Send>| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = from.read_to_end(&mut bytes);
            String::from_utf8_lossy(&bytes).into_owned()
        })
    };
    let (out, err) = (read(Box::new(out)), read(Box::new(err)));
    let status = ended(&mut child, limits);
    let (out, err) = (out.join().unwrap(), err.join().unwrap());
    let said =
        || err.lines().find(|l| !l.trim().is_empty()).unwrap_or("").chars().take(300).collect();
    let find = |what: String| Err(Find { what, said: said() });
    let code = match status.map(|s| s.code()) {
        None => return find(format!("not done after {} s", limits.seconds.as_secs())),
        Some(None) => return find("ended by a signal".into()),
        Some(Some(code @ (0 | 1 | 3))) => code,
        Some(Some(code)) => return find(format!("exit code {code}")),
    };
    if err.contains("of memory allowed") {
        // Read, and too large for the limit that it was given.
        return Ok(0);
    }
    if err.contains("defect of relume") {
        return find("calls itself a defect".into());
    }
    if code == 1 && !err.contains("error") {
        return find("exit code 1 without a word".into());
    }
    // Names are the file's own: `info` and `check` quote them, tables have them before the numbers.
    let numbers = match arguments[0].as_str() {
        "info" | "check" => 0,
        "probe" => 9,
        "factors" => 2,
        _ => usize::MAX,
    };
    match out.lines().find(|line| holds_no_number(line, numbers)) {
        Some(line) => Err(Find {
            what: "writes what is no number".into(),
            said: line.chars().take(200).collect(),
        }),
        _ => Ok(code),
    }
}

/// The status of a child once it ended; `None` if it took too long and was killed.
fn ended(child: &mut Child, limits: &Limits) -> Option<ExitStatus> {
    let started = Instant::now();
    let mut pause = Duration::from_micros(500);
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return Some(status);
        }
        if started.elapsed() > limits.seconds {
            let _ = child.kill();
            let _ = child.wait();
            return None;
        }
        std::thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    }
}

/// Whether a line of a table or report has NaN, infinity, or null where a number should be, in its last
/// fields.
fn holds_no_number(line: &str, fields: usize) -> bool {
    let value = |word: &str| {
        let word = word.trim().trim_start_matches('-').trim_end_matches(',');
        ["NaN", "nan", "inf", "null"].contains(&word)
    };
    line.rsplit([',', ':', '[', ']', ' ']).take(fields).any(value)
}
