//! Geometry as pure functions: rigid motion, planar polygons, bounds, shafts.
//!
//! This room must not know what a scene, a light or a frame is.

mod pose;

pub use pose::Pose;
