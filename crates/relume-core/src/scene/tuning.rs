//! Calibration constants of the room `scene`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Sum of the errors of a sky's facets, over the error of irradiance that they may make: a bound for any surface.
///
/// - Unit: 1
/// - Tried: shaped skies come to two thirds of the bound
/// - Larger: errors above the fineness
/// - Smaller: more facets
pub(super) const SKY_SHARE: f64 = 0.5;

/// Sum of the errors of facets all around, over the error of irradiance that they may make: a surface sees half of them.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors above the fineness
/// - Smaller: more facets
pub(super) const SKY_SHARE_ALL_ROUND: f64 = 0.25;
