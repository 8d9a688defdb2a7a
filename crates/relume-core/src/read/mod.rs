//! Readers of a solution: snapshots, sensors, tables, errors, comparisons.
//!
//! All of them take a solved state and change nothing. Must not know sessions, commands or clips.

mod accuracy;
mod bends;
mod coarse_values;
mod compare;
mod direct;
mod estimate;
mod events;
mod factors;
mod fluxes;
mod frame;
mod gap;
mod gather;
mod lossy;
mod names;
mod pieces;

mod reconstruct;
mod sensors;
mod snapshot;
mod solution;
mod tuning;

pub use coarse_values::{CoarseQuantity, CoarseValue};
pub use compare::{Difference, RadiosityGap, Which, compare, radiosity_gap};
pub use estimate::PointError;
pub use events::{Event, EventKind};
pub use factors::{Closure, Factors, Grouping, GroupingError, Open, PartFactors};
pub use fluxes::Flux;
pub use frame::{Frame, Hash, Mesh};
pub use lossy::{Missed, RadiosityError, missed, radiosity_error};
pub use names::ElementName;
pub use snapshot::{Gathered, LampLight, Leaf, Snapshot};
pub use solution::Elements;

// The plane names its events likewise.
pub(crate) use events::with_names;
