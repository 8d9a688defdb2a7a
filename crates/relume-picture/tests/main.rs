//! The integration tests of pictures, lit glTF and written frames, one binary.

mod automatic_views;
mod common;
mod gallery;
mod glb;
mod pictures;
mod sky;
