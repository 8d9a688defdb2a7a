//! The engine of Relume: scenes, the element forest, pairs of elements and their links, the solver, and the session that
//! runs the phases of a frame.
//!
//! Programs use the crate `relume`, which re-exports what is stable of this one; everything else here may change with any
//! version. Must not know files, nor how anything is shown.

// Tests may measure and compare with whatever the platform offers: what they compute decides nothing.
#![cfg_attr(test, allow(clippy::disallowed_methods, clippy::disallowed_types))]

// The rooms, from the ground up; each may use those above it and no other (`tests/layers.rs` of `relume` checks the order).
pub mod element; // the element forest: clusters, patches and their quadtrees
pub mod flat; // the plane: another space for the same pairs, events, solver and frames
pub mod follow; // the phases of a frame, in any space
pub mod geometry; // polygons, bounds, shafts, rigid motion: pure functions
pub mod pair; // the pair tree, oracles and verdicts
pub mod predict; // what the known motion allows within the coming time, and until when
pub mod read; // what is read from a solution
pub mod scene; // bodies, patches, materials, motion, and worlds made of them
pub mod session; // owns all state; commands in, frames out
pub mod solver; // gather, push, pull, residual
pub mod space; // polygons, their light and their places, as followers see them
pub mod transport; // exchange area and visibility of two elements: pure queries

pub use glam;
