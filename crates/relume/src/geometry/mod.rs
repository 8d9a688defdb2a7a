//! Geometry as pure functions: rigid motion, planar polygons, bounds, shafts.
//!
//! This room must not know what a scene, a light or a frame is.

mod bounds;
mod convex;
mod pose;

pub use bounds::{Aabb, shaft_meets_box};
pub use convex::{ConvexPolygon, Plane, split_convex};
pub use pose::Pose;
