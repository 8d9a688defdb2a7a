//! Polygons on bodies, their places in a world and their light, as the frame loop (`follow`) asks for them.
//!
//! [`Solved`] is a solved state of a scene; everything that reads a solution takes one. Must not know commands or clips.

mod bed;
mod coarse;
mod emission;
mod groups;
mod importance;
mod inner;
mod phases;
mod promise;
mod sensor;
mod sensor_views;
mod state;
mod surfaces;
mod tally;
mod tuning;

pub(crate) use bed::{Bed, Bedding};
pub(crate) use groups::{Before, group_links, replanted_links};
pub use importance::Aim;
pub(crate) use phases::Goal;
pub use sensor::{MountedSensor, Sensor};
pub use state::SpaceState;
pub(crate) use state::Tuning;
pub(crate) use surfaces::{LitForest, place_of};
pub(crate) use tally::row_sums_of;

/// A solved state of a scene.
pub type Solved = crate::follow::Follower<SpaceState>;
