//! Calibration constants of the room `geometry`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Lines that are looked at for one cut of a polygon: the longest.
///
/// - Unit: lines
/// - Tried: not varied
/// - Larger: time of planting: it grows as their square
/// - Smaller: cuts along short lines in place of a long broken one
pub(super) const CUT_LINES_MAX: usize = 256;

/// Share of the area of a polygon below which a part is not cut off.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light that jumps within elements near edges
/// - Smaller: slivers
pub(super) const CUT_LEAST: f64 = 1e-4;
