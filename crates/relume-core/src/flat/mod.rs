//! Flatland: scenes that do not change along one direction, with that direction integrated out.
//!
//! Surfaces become segments in the plane, elements halves of halves of them, and what two segments
//! exchange has a closed form, occlusion included (Hottel's crossed strings). Pair tree, verdict
//! bookkeeping, events, extrapolation, hash, solver and the phases of a frame are those of space: this room hands them
//! another [`Hierarchy`](crate::pair::Hierarchy), another [`Judge`](crate::pair::Judge), other
//! [`Surfaces`](crate::solver::Surfaces) and another `Space` to follow, and knows nothing of files, polygons or pictures.
//!
//! All quantities are per metre of the direction that was integrated out: an "area" is a length, m2 for
//! each metre of depth.

mod certificate;
mod drift;
mod forest;
mod frame;
mod judge;
mod options;
mod plane;
mod scene;
mod session;
mod state;
mod strings;
mod surfaces;
mod tuning;
mod view;

pub use forest::FlatForest;
pub use frame::{FlatElement, FlatFrame, FlatLink};
pub use options::{FlatOptions, OptionError};
pub use plane::{PlanePose, Segment};
pub use scene::{Body, BodyIndex, FlatScene, Key, Material, Motion, SceneError, Wall, WallIndex};
pub use session::FlatSession;
#[doc(hidden)]
pub use state::{FlatSolved, PlaneState};
pub use strings::{Shaft, exchange, visible_exchange};
pub use view::PlaneView;
