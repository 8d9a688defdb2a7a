//! Calibration constants of the room `space`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Area of a coarse element, over that of the scene, at most; a value that equal quadtrees do not meet.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: verdicts weigh by too rough a brightness
/// - Smaller: time: coarse elements are linked all with all
pub(super) const COARSE_SHARE: f64 = 0.0323;

/// Area of an element that weighs 1 in the error norm, over that of the scene.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: fewer links and larger errors on small elements
/// - Smaller: more links
pub(super) const REFERENCE_SHARE: f64 = 1.0 / 512.0;

/// Weight of an error that every element makes alike, where irradiance is gathered at points, over its relative effect there: errors
/// of elements have different signs.
///
/// - Unit: 1
/// - Tried: 0.01, 0.03, 0.1, 0.2, 0.25, 0.3, 1 (docs/tolerance.md)
/// - Larger: more links than sensors need
/// - Smaller: sensors behind narrow openings err by more than the tolerance
pub(super) const POINTS_SHARE: f64 = 0.2;

/// Most that weight may be, over that for the mesh.
///
/// - Unit: 1
/// - Tried: 1 (sensors behind a slit err by 1.24 of tolerance 0.02), 2, 4, no limit (a cove: 1.4 times the links of the mesh, for nothing)
/// - Larger: more links than sensors need
/// - Smaller: sensors behind narrow openings err by more than the tolerance
pub(super) const POINTS_MOST: f64 = 2.0;

/// Weight of an error of one element where irradiance is gathered at points, over its root mean square effect there; at most its
/// weight for the mesh.
///
/// - Unit: 1
/// - Tried: 0 (sensors in gaps off by up to 36 % at tolerance 0.1), 1 (one of seven 17 % off at 0.02), 2 (none worse than with solutions
///   for the mesh)
/// - Larger: more links than sensors need
/// - Smaller: sensors in gaps err
pub(super) const POINTS_NEAR: f64 = 2.0;

/// As `POINTS_SHARE`, where the sensors are known.
///
/// - Unit: 1
/// - Tried: 0, 0.02, 0.05, 0.1, 0.2 (docs/tolerance.md)
/// - Larger: more links than sensors need
/// - Smaller: sensors behind narrow openings err by more than the tolerance
pub(super) const SENSORS_SHARE: f64 = 0.05;

/// As `POINTS_MOST`, where the sensors are known.
///
/// - Unit: 1
/// - Tried: 1, 2, 4, 5, 20
/// - Larger: more links where light comes by one bright spot (60 % more in a room with a cove at 5 in place of 2)
/// - Smaller: sensors behind a slit err by more than the tolerance (1.9 times at 2, 1.1 times at 5)
pub(super) const SENSORS_CAP: f64 = 4.0;

/// As `POINTS_NEAR`, where the sensors are known.
///
/// - Unit: 1
/// - Tried: 0, 0.5, 1, 2
/// - Larger: more links than sensors need
/// - Smaller: sensors in gaps err
pub(super) const SENSORS_NEAR: f64 = 0.5;

/// Rays by which is found what sensors see, all sensors together.
///
/// - Unit: 1
/// - Tried: 8192
/// - Larger: a frame takes longer
/// - Smaller: links are spent where they bring little
pub(super) const SENSORS_RAYS: usize = 8192;

/// Rays of one sensor, at least and at most.
///
/// - Unit: 1
/// - Tried: 16 and 512
/// - Larger: a frame takes longer
/// - Smaller: links are spent where they bring little
pub(super) const SENSOR_RAYS: [usize; 2] = [16, 512];

/// Emitters that would be met by fewer of a sensor's rays, on average, are looked at one by one.
///
/// - Unit: 1
/// - Tried: 4
/// - Larger: what is partly hidden counts as seen, or as not seen
/// - Smaller: the light of small lamps is found by chance
pub(super) const FEW_RAYS: f64 = 4.0;

/// Share of a sensor's view above which what is large for its distance makes a gap.
///
/// - Unit: 1
/// - Tried: 0.5 (as where sensors are read), none (sensors in gaps of 5 mm read nothing, or half)
/// - Larger: sensors in gaps err
/// - Smaller: links that sensors beside walls do not need
pub(super) const GAP_NEAR: f64 = 0.5;

/// Sensors that are looked from at most.
///
/// - Unit: 1
/// - Tried: 256
/// - Larger: a frame takes longer
/// - Smaller: sensors that are unlike most err
pub(super) const SENSORS_MOST: usize = 256;

/// Sweeps of the coarse solution; five bounces bring a closed room within 10 %.
///
/// - Unit: sweeps
/// - Tried: not varied
/// - Larger: time
/// - Smaller: verdicts take rooms of many bounces for darker
pub(super) const COARSE_SWEEPS: u32 = 8;

/// Irradiance that is added to a receiver's in the error norm, over the mean of the scene.
///
/// - Unit: 1
/// - Tried: 0.1, 1e-3
/// - Larger: with 0.1 a room behind a door ajar erred by 3.2 % in place of 1.6 % at tolerance 0.02
/// - Smaller: 1e-3 takes twice the links of 0.1 there
pub(super) const DARK_FLOOR: f64 = 1e-3;

/// Arriving light, over that without any occlusion, below which it counts as rounding between shadows.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: dark rooms are refined as if nothing emitted
/// - Smaller: a lamp outside a closed room is refined without end
pub(super) const LOST: f64 = 1e-4;

/// Residual of the solver after a cold build, over the tolerance.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of the solver show beside those of links
/// - Smaller: sweeps
pub(super) const RESIDUAL_SHARE: f64 = 0.005;

/// Residual of the solver after an update, over the tolerance.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of the solver show beside those of links
/// - Smaller: time: small bodies change nearly everything a little
pub(super) const FOLLOWED_SHARE: f64 = 0.05;

/// Elements for each vacant one below which they are compacted.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time: a pass over all pairs more often
/// - Smaller: memory
pub(super) const VACANT_ELEMENTS: usize = 32;

/// Share of an element that must be exposed for it to receive light.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: slivers of floors beside crates are dark
/// - Smaller: rounding on covered elements
pub(super) const COVERED: f64 = 1e-4;

/// Share of what is emitted that may be unaccounted for before surfaces are named.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: surfaces at fault stay unnamed
/// - Smaller: surfaces are named that are off by errors of links
pub(super) const UNBALANCED: f64 = 0.01;
