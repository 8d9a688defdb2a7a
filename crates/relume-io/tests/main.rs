//! The integration tests of readers and writers, one binary.
//!
//! `cargo test -p relume-io --test tests NAME::` runs one module.

mod environment;
mod glb;
mod import;
mod origin;
