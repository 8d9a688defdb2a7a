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

/// Width of the strip of a narrow gap that is lit as what is beside it, over the width of the gap: as much light as gets in.
///
/// - Unit: 1
/// - Tried: 2; what gets in is 0.5 between black faces, 4 between faces of reflectance 0.95
/// - Larger: gaps are too bright
/// - Smaller: too dark
pub(super) const GAP_STRIP: f64 = 2.0;

/// By how much that strip is wider, in widths of the gap, for each width of it over the length of its faces.
///
/// - Unit: 1
/// - Tried: 40
/// - Larger: gaps a twentieth as wide as long are lit as what is beside them
/// - Smaller: the middle of gaps a tenth as wide as long is dark
pub(super) const GAP_BEND: f64 = 40.0;
