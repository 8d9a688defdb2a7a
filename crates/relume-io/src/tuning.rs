//! Calibration constants of the readers of files: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Share of the squares of all texels that a cut of a textured polygon has to gain: no more than a hundred cuts can.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: images that are smeared over polygons
/// - Smaller: polygons
pub(crate) const CUT_GAIN: f64 = 0.01;

/// Parts of a textured polygon at most.
///
/// - Unit: parts
/// - Tried: not varied
/// - Larger: polygons
/// - Smaller: images that are smeared
pub(crate) const CUT_PARTS_MAX: usize = 32;

/// Share of its polygon that a part covers at least.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: small bright spots that are smeared
/// - Smaller: polygons
pub(crate) const CUT_SHARE_MIN: f64 = 1.0 / 1024.0;

/// Places that are looked at along an axis at once for a cut.
///
/// - Unit: places
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: cuts beside the best place
pub(crate) const CUT_PLACES: usize = 8;

/// Times that a cut is sought between the best two places.
///
/// - Unit: times
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: cuts beside the best place
pub(crate) const CUT_ROUNDS: usize = 5;

/// Parts along the sides of a triangle on which image and vertex colours both vary.
///
/// - Unit: parts
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: errors of its means
pub(crate) const MEAN_PARTS: usize = 8;

/// Differences of colours, and relative ones of emissions, that count as none: neighbours may be merged.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: colours that are smeared over merged triangles
/// - Smaller: polygons
pub(crate) const ALIKE: f64 = 1.0 / 32.0;

/// Standard deviations of the image within two triangles up to which their difference counts as none: the halves of a square on
/// an even ramp differ by 1.41.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: images that are smeared
/// - Smaller: polygons
pub(crate) const ALIKE_DEVIATIONS: f64 = 2.0;

/// Difference of colours from which on a picture shows it.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: pictures without fine textures
/// - Smaller: memory of pictures
pub(crate) const SEEN: f64 = 1.0 / 128.0;

/// Steps across a triangle for its means in the search of cuts.
///
/// - Unit: steps
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: cuts beside the best place
pub(crate) const COARSE_STEPS: f64 = 64.0;

/// Steps across a triangle for its means, at least and at most.
///
/// - Unit: steps
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: errors of means over fine textures
pub(crate) const MEAN_STEPS: (f64, f64) = (32.0, 4096.0);

/// Steps that all triangles of a mesh share.
///
/// - Unit: steps
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: errors of means in large meshes
pub(crate) const MEAN_STEPS_SHARED: f64 = 4e6;

/// Time that a scale may take from nothing to full size and still count as a switch: exporters that write a key for each frame
/// turn a switch into a ramp of one frame.
///
/// - Unit: s
/// - Tried: not varied
/// - Larger: growth that is taken for appearing
/// - Smaller: scenes that are refused for scales in motion
pub(crate) const SWITCH_S: f64 = 0.1;

/// Relative difference of scales in motion that counts as none: what exporters and rigs leave behind.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: places off by as much
/// - Smaller: scenes that are refused
pub(crate) const SAME_SCALE: f64 = 1e-4;

/// Share of a vertex's weight that other joints may have: what 8-bit weights leave.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: places off by as much
/// - Smaller: skins that are refused
pub(crate) const STRAY_WEIGHT: f64 = 4e-3;

/// Reflectance that is taken from a file at most: no real paint reaches it, and with 1 light would never be absorbed.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: sweeps
/// - Smaller: white that is darker than said
pub(crate) const REFLECTANCE_MAX: f64 = 0.98;

/// Alpha, or dissolve, from which on a blended surface blocks light; below, all light passes.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: glass that lets all light pass
/// - Smaller: glass that blocks
pub(crate) const BLEND_CUTOFF: f64 = 0.5;

/// Reflectance of what has no material: a middle grey.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rooms brighter than they are
/// - Smaller: rooms darker than they are
pub(crate) const REFLECTANCE_OF_NONE: f64 = 0.5;
