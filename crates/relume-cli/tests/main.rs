//! The integration tests of the command, one binary: each runs `relume` as a user would.

mod bench;
mod command_line;
mod common;
mod export;
mod factors;
mod files;
mod first_minutes;
mod flat;
mod flicker;
mod fuzz;
mod killed;
mod memory;
mod outside;
mod pictures;
mod probe;
mod readme;
mod replay;
mod shell;
mod strategies;
mod verify;
