//! Exchange area and visibility of two elements: pure queries.
//!
//! Nothing here knows radiosity, time or the pair tree.

mod exchange;
mod kernel;
mod point;
mod segments;
mod visibility;

pub use exchange::{Exchange, Meeting, Variation, exchange, light_at, light_exchange, meeting};
pub use kernel::Simd;
pub use point::form_factor_from_point;
pub use segments::{SEGMENTS, SegmentBundle};
pub use visibility::{
    Candidates, Shaft, Visibility, light_visibility, segment_is_clear, visibility,
};
