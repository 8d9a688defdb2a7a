//! Calibration constants of the room `flat`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Size of the smallest element of a pair, over its largest coordinates, from which on rounding is told from what touches.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: pairs that have no certificates
/// - Smaller: certificates that rounding may break
pub(super) const ALIKE: f64 = 0.01;

/// Width by which a shaft is widened where candidates of the shafts within it are sought, over the rounding.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: candidates
/// - Smaller: blockers that rounding leaves out
pub(super) const WIDER: f64 = 1e3;
