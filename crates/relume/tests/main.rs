//! The tests of the face, of the order of all crates, and of the page of constants.

mod circles;
mod layers;
mod program;
mod tuning;
