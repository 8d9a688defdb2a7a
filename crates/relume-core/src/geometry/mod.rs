//! Geometry as pure functions: rigid motion, planar polygons, bounds, shafts.
//!
//! This room must not know what a scene, a light or a frame is.

mod bounds;
mod box_tree;
mod choice;
mod convex;
mod cut;
mod hull;
mod pose;
mod region;
mod tuning;

pub use bounds::{Aabb, Interval, ShaftOfBoxes, shaft_meets_box};
pub use box_tree::BoxTree;
pub use choice::{at_share, spread};
pub use convex::{ConvexPolygon, Plane, polygon_area, split_convex};
pub use cut::{Segment, cut_along, segment_within};
pub use hull::is_outside_hull;
pub use pose::Pose;
pub use region::{Moments, common, difference, part_in_front, within_outlines};

/// How far apart equal areas may be for rounding, relative: files hold corners in single precision.
const AREA_ROUNDING: f64 = 1e-6;

/// Whether an area is no smaller than another. Equal ones are that both ways, in whatever units they were
/// computed: what is decided by size must not depend on the last bit.
pub fn no_smaller(area: f64, other: f64) -> bool {
    area >= other * (1.0 - AREA_ROUNDING)
}
