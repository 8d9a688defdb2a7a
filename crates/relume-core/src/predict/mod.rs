//! Prediction: bounds of the known motion of bodies over the coming time.
//!
//! [`MotionBounds`] say how far bodies can get until coming ticks ([`Ticks`]): certificates rest on them. [`History`] draws a
//! line through the last evaluations of a pair: extrapolation rests on it. Must not know pairs or light.

mod history;
mod motion_bounds;
mod ticks;
mod tuning;

pub use history::{History, Lookahead, Sample};
pub use motion_bounds::{KnownMotion, MotionBounds};
pub use ticks::{Tick, Ticks};
