//! What a command reads is not what it writes: a scene is never replaced by the numbers that are made of it.

use std::fs;
use std::path::Path;

use crate::args::{ClipFlags, Command, FlatArgs, MeasureFlags, SolveFlags, SourceFlags};
use crate::failure::Failure;

/// The files that a command reads, and those that it writes under names of the user's.
#[derive(Default)]
struct Files<'a> {
    read: Vec<&'a Path>,
    written: Vec<&'a Path>,
}

/// An error where a file that is read would be written over.
pub(crate) fn refuse(command: &Command) -> Result<(), Failure> {
    let Files { read, written } = Files::of(command);
    let known = |path: &&Path| fs::canonicalize(path).ok();
    let read: Vec<_> = read.iter().filter_map(known).collect();
    match written.iter().find(|path| known(path).is_some_and(|file| read.contains(&file))) {
        None => Ok(()),
        Some(path) => Err(Failure::new(format_args!(
            "{} is read by this command, which would write over it",
            path.display()
        ))
        .help("name another file for what is written")),
    }
}

impl<'a> Files<'a> {
    fn of(command: &'a Command) -> Files<'a> {
        let mut files = Files::default();
        match command {
            Command::Bench(args) => {
                files.source(&args.source, &args.clip);
                files.measured(&args.measure);
            }
            Command::Factors(args) => {
                files.read.push(&args.scene);
                files.clip(&args.clip);
                files.written.extend(
                    [&args.output, &args.report].into_iter().flatten().map(|p| p.as_path()),
                );
            }
            Command::Probe(args) => {
                files.read.extend([args.scene.as_path(), &args.sensors]);
                files.clip(&args.clip);
                files.written.extend(args.output.as_deref());
            }
            Command::Export(args) => {
                files.read.push(&args.scene);
                files.clip(&args.clip);
                files.written.push(&args.output);
            }
            // A log may be written over: its steps are kept.
            Command::Replay(args) => {
                files.source(&args.source, &args.clip);
                files.written.extend(args.output.as_deref());
            }
            Command::Flat(args) => files.flat(args),
            Command::Solve(args) => {
                files.read.push(&args.scene);
                files.solved(&args.solve);
            }
            Command::Render(args) => {
                files.read.push(&args.scene);
                files.solved(&args.solve);
            }
            Command::Demo(args) => files.solved(&args.solve),
            Command::Info(_)
            | Command::Check(_)
            | Command::Verify(_)
            | Command::Errors(_)
            | Command::Flicker(_)
            | Command::Figure(_)
            | Command::Completions(_)
            | Command::Man(_) => {}
        }
        files
    }

    fn source(&mut self, source: &'a SourceFlags, clip: &'a ClipFlags) {
        self.read.extend(source.scene.as_deref());
        self.clip(clip);
    }

    fn clip(&mut self, clip: &'a ClipFlags) {
        self.read.extend(clip.outside.environment.as_deref());
    }

    fn solved(&mut self, solve: &'a SolveFlags) {
        self.clip(&solve.clip);
        self.written
            .extend([&solve.report, &solve.events].into_iter().flatten().map(|p| p.as_path()));
    }

    fn measured(&mut self, measure: &'a MeasureFlags) {
        self.written.extend(measure.json.as_deref());
    }

    fn flat(&mut self, args: &'a FlatArgs) {
        self.read.extend(args.scene.as_deref());
        self.written.extend(args.events.as_deref());
        self.measured(&args.measure);
    }
}
