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

/// Distance of a scene's middle from the origin, over the scene's size, from which it is moved there when it is read.
///
/// - Unit: 1
/// - Tried: 8; left where it is, a room of 5 m is as at the origin at 600 times its size, and has lost 0.37 of its light at 600,000
/// - Larger: what is a share of the largest coordinate (one plane, one point) grows beside the scene
/// - Smaller: scenes are moved that need not be
pub(super) const FAR: f64 = 8.0;

/// Coordinates of 32-bit corners in their meshes, over the scene's size, from which it is said that they are coarse.
///
/// - Unit: 1
/// - Tried: 256, where they are 3e-5 of the scene apart
/// - Larger: gaps between walls that nobody was told of
/// - Smaller: warnings of what does not show
pub(super) const FAR_CORNERS: f64 = 256.0;
