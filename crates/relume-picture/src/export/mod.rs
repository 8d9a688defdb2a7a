//! Scenes and solutions as files that other programs read.
//!
//! Every file appears whole or not at all.

mod file;
mod glb;

pub use file::{WholeFile, probe, write_atomically};
pub use glb::{ExportError, glb, write_glb};
