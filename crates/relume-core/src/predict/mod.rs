//! Prediction: what the known motion allows within the coming time, and until when.
//!
//! This room knows no pairs and no light. Whoever has something that only a motion can change asks
//! how far bodies can get before a tick, and waits until then.

mod history;
mod motion_bounds;
mod ticks;

pub use history::{History, Lookahead, Sample};
pub use motion_bounds::{KnownMotion, MotionBounds};
pub use ticks::{Tick, Ticks};
