//! The tests of the face, of the order of all crates, and of the pages that are made of the source.

mod circles;
mod layers;
mod lengths;
mod program;
mod tuning;
mod tutorial;
