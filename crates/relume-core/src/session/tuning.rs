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

/// Pairs of patches that are tried at most: of more, an even share.
///
/// - Unit: pairs
/// - Tried: not varied
/// - Larger: time of the estimate
/// - Smaller: scatter of the estimate
pub(super) const TRIED: u64 = 4_000_000;

/// Pairs for each pair of patches, low and high.
///
/// - Unit: 1
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const PAIRS_OF_PATCHES: [f64; 2] = [0.8, 1.3];

/// Pairs that each pair of patches that face each other brings beside.
///
/// - Unit: 1
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const PAIRS_OF_FACING: f64 = 1.7;

/// Pairs that refinement adds at the tolerance `FITTED_AT`, and for each patch: low and high. In inverse proportion to the tolerance.
///
/// - Unit: pairs
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const REFINED: [(f64, f64); 2] = [(0.0, 100.0), (70_000.0, 2_000.0)];

/// Tolerance that `REFINED` holds at.
///
/// - Unit: 1
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too low
/// - Smaller: estimates too high
pub(super) const FITTED_AT: f64 = 0.02;

/// Pairs that refinement adds for each pair that faces, at most.
///
/// - Unit: 1
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high at fine tolerances
/// - Smaller: estimates too low at fine tolerances
pub(super) const REFINED_MOST: f64 = 1e4;

/// Groups that are in no other, low and high.
///
/// - Unit: groups
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const GROUPS: [f64; 2] = [50.0, 600.0];

/// Pairs for each patch of groups, low and high; the latter at the tolerance `GROUPED_AT`, of finer ones in inverse proportion.
///
/// - Unit: pairs
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const PAIRS_OF_GROUPED: [f64; 2] = [40.0, 700.0];

/// Tolerance that `PAIRS_OF_GROUPED` holds at.
///
/// - Unit: 1
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too low
/// - Smaller: estimates too high
pub(super) const GROUPED_AT: f64 = 0.1;

/// Bytes for a pair, low and high.
///
/// - Unit: bytes
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const BYTES: [f64; 2] = [55.0, 200.0];

/// Seconds of one core for a pair, low and high.
///
/// - Unit: s
/// - Tried: fitted to 15 files from outside
/// - Larger: estimates too high
/// - Smaller: estimates too low
pub(super) const SECONDS: [f64; 2] = [8e-6, 45e-6];
