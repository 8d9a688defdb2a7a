//! Calibration constants of the command: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Default tolerance of what makes numbers.
///
/// - Unit: relative error of irradiance
/// - Tried: docs/tolerance.md
/// - Larger: errors
/// - Smaller: time and memory
pub(crate) const TOLERANCE: f64 = 0.02;

/// Default tolerance of pictures: beside one at 0.02 the eye finds no difference but along some edges, at a tenth to a quarter of the time (docs/tolerance.md).
///
/// - Unit: relative error of irradiance
/// - Tried: 0.02 to 0.2
/// - Larger: errors are seen
/// - Smaller: time
pub(crate) const PICTURE_TOLERANCE: f64 = 0.1;

/// Share of the area of the scene below which the form-factor oracle does not refine, unless it is told an area.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: coarse elements
/// - Smaller: time and memory; with it a closed cube has at most 6 x 4^5 elements, about as many as the paper draws
pub(crate) const MIN_AREA_SHARE: f64 = 1.0 / 5_000.0;

/// Share of what is seen of surfaces that has to be lit at some time, so that a picture shows what it is of.
///
/// - Unit: 1
/// - Tried: eyes that glow and headlights light less, lamps in rooms and streets more
/// - Larger: dim scenes get a sky
/// - Smaller: pictures are dark
pub(crate) const LIT_MIN: f64 = 0.5;

/// Share of the picture on which a file's own camera has to show surfaces at some time, so that it is what pictures are taken from.
///
/// - Unit: 1
/// - Tried: 0.002 is what one of a games' asset showed of a loudspeaker
/// - Larger: cameras that look at something far away are not used
/// - Smaller: pictures of specks
pub(crate) const SHOWN_MIN: f64 = 0.01;

/// Share of what is emitted that may be unaccounted for in a result of the plane.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: wrong numbers are not noticed
/// - Smaller: coarse solutions are refused
pub(crate) const UNBALANCED_MAX: f64 = 0.1;

/// Share of what is emitted that is unaccounted for in a frame, from which on that is said, also with `--quiet`. Above a tenth a
/// frame is refused by the engine.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: wrong numbers are not noticed
/// - Smaller: white rooms at coarse tolerances warn, whose numbers are within them
pub(crate) const UNBALANCED_SAID: f64 = 0.01;

/// Most targets of a mesh in a .glb that plays: each takes a uniform of the vertex shader, of which WebGL2 guarantees 256.
///
/// - Unit: 1
/// - Tried: 250 play in software, with 4,096 uniforms (three.js, Babylon.js)
/// - Larger: some viewers draw nothing
/// - Smaller: light goes straight over more of the frames
pub(crate) const TARGETS_MAX: usize = 200;

/// Most memory that a viewer may take for the colours of a .glb that plays.
///
/// - Unit: bytes
/// - Tried: 293 and 610 MB, which play on a desk after 3 and 5 s
/// - Larger: phones do not show the file
/// - Smaller: light goes straight over more of the frames
pub(crate) const MORPH_BYTES_MAX: u64 = 256 << 20;

/// Tolerance of the solution that flicker is measured against, over that of the one that flickers.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: what the reference itself is off by counts
/// - Smaller: time
pub(crate) const REFERENCE_SHARE: f64 = 0.2;
