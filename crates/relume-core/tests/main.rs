//! The integration tests of the engine, one binary: known answers first, then laws on random input, then whole runs.
//!
//! `cargo test -p relume-core --test tests NAME::` runs one module.

mod accuracy;
mod analytic;
mod commands;
mod common;
mod compare;
mod covered;
mod dark_sides;
mod determinism;
mod emission;
mod exact_rows;
mod flat;
mod furnace;
mod gather;
mod groups;
mod incremental;
mod kept;
mod kinds;
mod laws;
mod lights;
mod limits;
mod memory;
mod monte_carlo;
mod origin;
mod outside;
mod parts;
mod prediction;
mod random_motion;
mod reference;
mod regressions;
mod sky;
mod validation;
mod white;
mod work;
