//! The integration tests of pictures, one binary.

mod automatic_views;
mod common;
mod gallery;
mod pictures;
mod recording;
mod show;
mod sky;
mod smooth;
