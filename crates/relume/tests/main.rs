//! The tests of the face, and of the order of all crates.

mod layers;
mod program;
