//! Calibration constants of the room `follow`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Mean radiosity over that of the last exact solution from which an extrapolated frame is rebuilt: links that are a little too large amplify each other.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: frames with too much light are shown
/// - Smaller: frames are rebuilt without need
pub(super) const GROWTH_MAX: f64 = 1.25;

/// Mean radiosity over the upper bound of the scene from which a solve is given up as diverging.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time until a diverging solution is found anew
/// - Smaller: solutions that would settle are given up
pub(super) const DIVERGENCE_RATIO: f64 = 2.0;

/// Mean radiosity over the upper bound of the scene that errors of links may explain, where links are extrapolated.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: frames with too much light are shown
/// - Smaller: frames are rebuilt without need
pub(super) const LINK_ERROR_RATIO: f64 = 1.1;

/// Pairs of the tree, for each vacant one, below which the tree is compacted.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time: a pass over all pairs more often
/// - Smaller: memory
pub(super) const VACANT_PAIRS: usize = 16;
