//! Completions for shells and manual pages, made of the definition of the command line.
//!
//! Must not know what the commands do.

use clap::CommandFactory;
use clap_mangen::Man;
use relume::export::write_atomically;

use crate::args::{Cli, CompletionsArgs, ManArgs};
use crate::failure::Failure;
use crate::output;

/// Prints the completions for a shell.
pub(crate) fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "relume", &mut script);
    output::print_bytes(&script)
}

/// Writes a manual page for `relume` and for each of its commands.
pub(crate) fn man(args: &ManArgs) -> Result<(), Failure> {
    std::fs::create_dir_all(&args.directory)
        .map_err(|error| Failure::write(&args.directory, &error))?;
    // The pages of `help` would say what `--help` says.
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    write_pages(&command, args)
}

/// Writes the page of a command and those of the commands below it.
fn write_pages(command: &clap::Command, args: &ManArgs) -> Result<(), Failure> {
    let page = Man::new(command.clone());
    let path = args.directory.join(page.get_filename());
    let mut text = Vec::new();
    page.render(&mut text).map_err(|error| Failure::write(&path, &error))?;
    write_atomically(&path, &text).map_err(|error| Failure::write(&path, &error))?;
    command.get_subcommands().try_for_each(|below| write_pages(below, args))
}
