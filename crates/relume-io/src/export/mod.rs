//! Scenes, solutions and tables as files that other programs read.
//!
//! Every file appears whole or not at all. Must not know pictures.

mod factors;
mod file;
mod glb;
mod npz;

pub use factors::{energyplus, view3d};
pub use file::{WholeFile, probe, remove_remains, settle_unfinished, write_atomically};
pub use glb::{ExportError, glb, write_glb};
pub use npz::Npz;
