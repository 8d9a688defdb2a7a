//! Files of Relume: scenes, environments and logs of commands in; scenes, tables and logs out.
//!
//! Readers hand a [`Draft`](relume_core::scene::draft::Draft) to the engine, which checks it. Programs use the crate `relume`,
//! which re-exports all of this. Must not know how anything is solved or shown.

// Tests may measure and compare with whatever the platform offers: what they compute decides nothing.
#![cfg_attr(test, allow(clippy::disallowed_methods, clippy::disallowed_types))]

mod data_uri;
mod environment;
pub mod export;
pub mod flat;
mod folder;
mod gltf;
mod guard;
mod import;
mod log;
mod mesh_file;
mod options;
mod photometry;
mod range;
mod regular;
mod surface;
mod tuning;
mod view3d;

pub use environment::read_environment;
pub use import::import;
pub use log::{Log, LogError};
pub use options::{FrameRange, ImportOptions, Instants};
pub use photometry::PEAK_LUMENS_PER_WATT;
pub use regular::read_file;
