//! Scenes, solutions and tables as files that other programs read.
//!
//! Every file appears whole or not at all. Must not know pictures.

mod factors;
mod file;
mod glb;
mod lit;
mod lit_glb;
mod npz;
mod page;
mod usd;
mod vtk;

pub use factors::{energyplus, view3d};
pub use file::{WholeFile, probe, remove_remains, settle_unfinished, write_atomically};
pub use glb::{ExportError, glb, write_glb};
pub use lit::{Lit, LitPart, Tone};
pub use lit_glb::{lit_glb, morph_bytes};
pub use npz::Npz;
pub use page::{PageView, page};
pub use usd::usda;
pub use vtk::{pvd, vtp};
