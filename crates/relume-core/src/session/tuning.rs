//! Calibration constants of the room `session`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Threshold of the error oracle for a link, over the tolerance: the errors of a receiver's links add up.
///
/// - Unit: 1
/// - Tried: calibrated on the tables of docs/tolerance.md
/// - Larger: errors above the tolerance
/// - Smaller: more links
pub(super) const LINK_SHARE: f64 = 0.25;
