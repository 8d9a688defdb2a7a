//! The frame loop: a solved state ([`Follower`]) and the phases that bring it to another instant.
//!
//! `phases` has the order of a frame (`Follower::frame`). Places, emission and reflection come from a trait, `Space`, which the
//! rooms `space` (polygons) and `flat` (segments in the plane) implement. Must not know polygons, segments, scenes or files.

mod budget;
mod clock;
mod follower;
mod links;
mod phases;
mod prediction;
mod report;
mod space;
mod tally;
mod tuning;
mod update;
mod watch;

pub(crate) use follower::{Said, Why};
pub(crate) use links::{Receivers, directions, set_pairs};
pub(crate) use phases::{Failed, Order};
pub(crate) use prediction::{Clocked, Prediction, Void};
pub(crate) use space::{Balance, Level, Motion, Space};
pub(crate) use tally::balance_of;

pub use follower::Follower;
pub use report::{
    Accuracy, Energy, FrameReport, LinkKinds, Memory, PairCounts, RowSumError, Seconds,
};
pub use update::Update;
pub use watch::Watch;
