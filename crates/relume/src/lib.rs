//! Relume: diffuse interreflection (radiosity) in scenes whose objects and lights move.
//!
//! The rooms, from the ground up; each may use those above it in this list and no other
//! (`tests/layers.rs` checks it):
//!
//! | room | one sentence |
//! |---|---|
//! | [`geometry`] | polygons, bounds, shafts, rigid motion: pure functions |
//! | [`scene`] | glTF and View3D's files in; bodies, patches, materials, motion: validated, then immutable |
//! | [`element`] | the element forest: clusters, patches and their quadtrees |
//! | [`transport`] | exchange area and visibility of two elements: pure queries |
//! | [`event`] | what the known motion allows within the coming time, and until when |
//! | [`pair`] | the pair tree, oracles and verdicts |
//! | [`solver`] | gather, push, pull, residual |
//! | [`session`] | owns all state; runs the phases of a frame; snapshots out |
//! | [`flat`] | the plane: another space for the same pairs, events and solver |

// Tests may measure and compare with whatever the platform offers: what they compute decides nothing.
#![cfg_attr(test, allow(clippy::disallowed_methods, clippy::disallowed_types))]

pub mod element;
pub mod event;
pub mod flat;
pub mod geometry;
pub mod pair;
pub mod scene;
pub mod session;
pub mod solver;
pub mod transport;
