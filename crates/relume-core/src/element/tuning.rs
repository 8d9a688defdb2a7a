//! Calibration constants of the room `element`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Share of an element that must be exposed for light to count over the exposed part.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: elements almost wholly covered are too dark
/// - Smaller: errors of visibility on slivers are amplified
pub(super) const EXPOSED_LEAST: f64 = 1.0 / 16.0;

/// Share of a polygon's chord that lines of contact must cover for it to be cut there.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light leaks under walls that cover less
/// - Smaller: polygons are cut where little stands on them
pub(super) const CUT_SHARE: f64 = 0.25;

/// Area of a polygon, over that of the scene, from which lines of contact cut it.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light leaks under walls
/// - Smaller: more elements than light needs
pub(super) const CUT_LEAST: f64 = 1.0 / 64.0;

/// Share of the chord of a smaller polygon that lines of contact must cover for it to be cut there.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light leaks through walls that furniture pierces, and past hinges
/// - Smaller: polygons are cut where little crosses them
pub(super) const SMALL_CUT_SHARE: f64 = 0.9;

/// Area of a part, over that of a smaller polygon that is cut.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light leaks through walls that furniture pierces
/// - Smaller: slivers
pub(super) const SMALL_CUT_PART: f64 = 1.0 / 64.0;

/// Cuts of a smaller polygon.
///
/// - Unit: cuts
/// - Tried: not varied
/// - Larger: more elements
/// - Smaller: light leaks through the other walls
pub(super) const SMALL_CUT_TIMES: u32 = 2;

/// Sides of lamps close before a polygon up to which it is cut along all of them.
///
/// - Unit: sides
/// - Tried: not varied
/// - Larger: more pairs of patches below ceilings of many lamps
/// - Smaller: light close above so many lamps leaks into the room
pub(super) const SPOT_LINES_MAX: usize = 64;

/// Distance of a line of contact from the sides of an element, over its width, from which the element is divided along it.
///
/// - Unit: 1
/// - Tried: 0.2
/// - Larger: elements lie on both sides of lines that are near their own
/// - Smaller: slender elements
pub(super) const SEAM_PART: f64 = 0.2;

/// Share of an element's width that a line of contact must run over for the element to be divided along it.
///
/// - Unit: 1
/// - Tried: 1/16
/// - Larger: elements lie on both sides of what stands on them until they are small
/// - Smaller: large elements of uneven shape for the sake of small bodies
pub(super) const SEAM_SHARE: f64 = 1.0 / 16.0;

/// Ratio of the sides from which an element is halved across its long side, not quartered.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: long elements
/// - Smaller: neighbours of different shape
pub(super) const ELONGATED: f64 = 1.5;

/// Longest edge squared over area above which a triangle is halved; 4 for the right isosceles one.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: long triangles
/// - Smaller: neighbours of different shape
pub(super) const SLENDER: f64 = 6.0;

/// Area of a patch, over that of the scene, up to which it may be in a group.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors: larger patches lose links of their own
/// - Smaller: more links
pub(super) const SMALL_SHARE: f64 = 1.0 / 2_000.0;

/// Small patches of a rigid body from which it has groups.
///
/// - Unit: patches
/// - Tried: not varied
/// - Larger: time in scenes of many small things
/// - Smaller: groups where links of patches are cheap
pub(super) const PATCHES_MIN: usize = 64;

/// Area of a group, over that of the scene, at most.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of the coarse solution
/// - Smaller: more pairs
pub(super) const AREA_SHARE: f64 = 1.0 / 128.0;

/// Diagonal of a group's box, over that of the scene, at most.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of the coarse solution
/// - Smaller: more pairs
pub(super) const ACROSS_SHARE: f64 = 1.0 / 8.0;

/// Side over distance of a square from which a part of the sky is wide, so that groups link with it: six discs of the sun, less
/// than two degrees.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more patches link with the sky one by one
/// - Smaller: groups link with the sun, whose shadows have edges
pub(super) const WIDE: f64 = 0.03;
