//! Exchange area X and visibility V of two elements: pure queries.
//!
//! [`exchange`](exchange()) computes X, [`visibility`](visibility()) computes V over fixed segments and [`clipping`] in closed form past
//! occluders, [`Shaft`] finds the occluders between two elements, [`GroupSight`] answers for groups of patches. Must not know
//! radiosity, time or the pair tree.

mod bend;
mod between;
mod blocker_sizes;
mod blockers;
mod candidates;
mod cells;
mod clip;
mod clipping;
mod contact;
mod contour;
mod crowd;
mod exchange;
mod group;
mod kernel;
mod logarithm;
mod point;
mod point_view;
mod prepared_view;
mod rays;
mod segments;
mod shaft;
mod share;
mod side;
mod silhouette;
mod spot;
mod tally;
mod target_frame;
mod tuning;
mod visibility;

pub use bend::{Bend, Receiver};
pub use blocker_sizes::BlockerSizes;
pub use blockers::{clipping, prepare_view};
pub use candidates::{Candidates, InShaft};
pub use clip::keep_in_front;
pub use clipping::{Clipping, FirstLook};
pub use contact::{in_plane, lies_in, overlap_m2};
pub use crowd::{Crowd, light_past_crowd};
pub use exchange::{
    Exchange, Meeting, Variation, contact_exchange, exchange, exchange_by_points,
    exchange_of_points, exchange_of_polygons, light_at, light_exchange, meeting,
};
pub use group::{GroupSight, Slope, Spread, common_body};
pub use kernel::Simd;
pub use point::form_factor_from_point;
pub use point_view::{FactorPast, form_factor_past};
pub use prepared_view::PreparedView;
pub(crate) use rays::{Hit, Rays};
pub use segments::{SEGMENTS, SegmentBundle};
pub use shaft::Shaft;
pub use share::Visibility;
pub use side::Side;
pub use tuning::{CELLS_MAX, CLIPPED_MAX, GROUP_SEGMENTS};
pub use visibility::{light_visibility, segment_is_clear, visibility};
