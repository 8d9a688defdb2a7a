//! The `relume` command: a thin layer over the engine, the pictures and the exports.

mod accuracy;
mod args;
mod around;
mod balance;
mod bench;
mod check;
mod clip;
mod clock;
mod demo;
mod edits;
mod errors;
mod events;
mod export;
mod exposure;
mod factors;
mod failure;
mod figures;
mod flat;
mod flicker;
mod frames;
mod in_flags;
mod info;
mod interrupt;
mod light;
mod lock;
mod memory;
mod notes;
mod output;
mod outside;
mod overwrite;
mod paper;
mod plan;
mod preview;
mod probe;
mod progress;
mod replay;
mod report;
mod resume;
mod run;
mod scene_file;
mod sensors;
mod sequence;
mod shell;
mod show;
mod size;
mod strategies;
mod text;
mod tuning;
mod verify;
mod viewing;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use failure::Failure;

fn main() -> ExitCode {
    let cli = Cli::parse();
    // Before anything is read.
    memory::keep_below(cli.max_memory.map(|size| size.bytes));
    match execute(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::complain(&failure.to_string());
            ExitCode::from(failure.exit_code())
        }
    }
}

fn execute(command: Command) -> Result<(), Failure> {
    overwrite::refuse(&command)?;
    match command {
        Command::Info(args) => info::info(&args),
        Command::Check(args) => check::check(&args),
        Command::Verify(args) => interrupt::listen().and_then(|()| verify::verify(&args)),
        Command::Errors(args) => interrupt::listen().and_then(|()| errors::errors(&args)),
        Command::Replay(args) => interrupt::listen().and_then(|()| replay::replay(&args)),
        Command::Bench(args) => interrupt::listen().and_then(|()| bench::bench(&args)),
        Command::Flicker(args) => interrupt::listen().and_then(|()| flicker::flicker(&args)),
        Command::Factors(args) => interrupt::listen().and_then(|()| factors::factors(&args)),
        Command::Probe(args) => interrupt::listen().and_then(|()| probe::probe(&args)),
        Command::Export(args) => interrupt::listen().and_then(|()| export::export(&args)),
        Command::Figure(args) => interrupt::listen().and_then(|()| paper::figure(&args)),
        Command::Flat(args) => interrupt::listen().and_then(|()| flat::flat(&args)),
        Command::Solve(args) => interrupt::listen().and_then(|()| run::solve(args)),
        Command::Render(args) => interrupt::listen().and_then(|()| run::render(args)),
        Command::Demo(args) => interrupt::listen().and_then(|()| run::demo(args)),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
    }
}
