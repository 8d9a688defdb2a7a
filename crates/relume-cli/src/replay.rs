//! `relume replay`: a log of commands, done again.

use std::io::Write;

use relume::{Frame, Log, LogError};

use crate::args::{ReplayArgs, UpdateChoice, UpdateFlag};
use crate::clip::{Clip, step_failure};
use crate::failure::Failure;
use crate::output::{self, Sink, count, counted};
use crate::scene_file;

/// Runs the command. A hash that differs from the log's is a failure.
pub(crate) fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let text = scene_file::read(&args.log)?;
    let clip = Clip::open(&args.source, &args.clip)?;
    clip.warn();
    let mut session = clip.session(UpdateChoice::of(UpdateFlag::Certificate), true)?;
    let mut told = Told { quiet: args.clip.quiet, ..Told::default() };
    let log = Log::replay(&text[..], &mut session, |frame, hash| told.frame(frame, hash));
    let log = log.map_err(|error| failure(args, error))?;
    if let Some(error) = told.failed {
        return Err(error);
    }
    if let Some(path) = &args.output {
        let mut sink = Sink::open(Some(path))?;
        log.write(&mut sink).and_then(|()| sink.flush()).map_err(|error| sink.failure(&error))?;
        sink.finish()?;
    }
    if let Some(solve) = told.differs {
        return Err(Failure::new(format_args!(
            "solve {solve} does not have the hash that the log has for it"
        ))
        .help(
            "the scene, the options or the version of relume differ from those that wrote the log",
        ));
    }
    if args.clip.quiet {
        return Ok(());
    }
    output::print(&format!(
        "{}, {} with the hash of the log\n",
        counted(told.solves, "solve"),
        told.alike
    ))
}

/// What is said while a log is followed.
#[derive(Default)]
struct Told {
    quiet: bool,
    solves: usize,
    alike: usize,
    /// The first solve whose hash is another than the log's.
    differs: Option<usize>,
    failed: Option<Failure>,
}

impl Told {
    fn frame(&mut self, frame: Frame<'_>, logged: Option<&str>) {
        let (report, hash) = (frame.report(), frame.hash().to_string());
        let verdict = match logged {
            None => "",
            Some(logged) if logged == hash => {
                self.alike += 1;
                "  as logged"
            }
            Some(_) => {
                self.differs.get_or_insert(self.solves);
                "  not as logged"
            }
        };
        let line = format!(
            "solve {:>4}  {:>10} links  {:>9} changed  {hash}{verdict}\n",
            self.solves,
            count(report.links),
            count(report.work.changed)
        );
        self.solves += 1;
        if !self.quiet && self.failed.is_none() {
            self.failed = output::print(&line).err();
        }
    }
}

fn failure(args: &ReplayArgs, error: LogError) -> Failure {
    let log = args.log.display();
    // But for what concerns the file, errors begin with the line.
    let in_line = |error: &LogError| Failure::new(format_args!("{log}, {error}"));
    match error {
        LogError::Unsolved { line, source } => {
            step_failure(source, &format!("at line {line} of {log}"))
        }
        LogError::Unknown { .. } => in_line(&error)
            .help("`relume info` lists the bodies, materials and lights of the scene"),
        // It names the remedy.
        LogError::Refused { .. } => in_line(&error),
        LogError::Line { .. } => in_line(&error).help("`relume help replay` lists the commands"),
        other => Failure::new(format_args!("{log}: {other}")),
    }
}
