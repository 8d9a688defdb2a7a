//! Calibration constants of the room `predict`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Ticks ahead until which certificates may stand.
///
/// - Unit: ticks
/// - Tried: not varied
/// - Larger: time for each certificate
/// - Smaller: pairs are visited more often
pub(super) const AHEAD: [u16; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Length of a step over that of a tick from which a new clock starts.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: certificates by ticks that are too long or too short
/// - Smaller: certificates are lost when the step changes
pub(super) const STEP_RATIO_MAX: f64 = 4.0;

/// Change of an exchange area by extrapolation, over its last evaluation, from which it is evaluated again.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: a receiver may get more than it can see, and interreflection grows without end
/// - Smaller: more evaluations
pub(super) const EXTRAPOLATED_SHARE_MAX: f64 = 0.25;
