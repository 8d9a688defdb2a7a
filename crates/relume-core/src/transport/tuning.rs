//! Calibration constants of the room `transport`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// (Sum of the radii / distance)^2 up to which 2 x 2 Gauss points are used on each end; a value that equal quadtrees do not meet.
///
/// - Unit: 1
/// - Tried: measured against 24 x 24 pieces of the closed form
/// - Larger: errors of exchange areas above 0.25 %
/// - Smaller: time: 4 x 4 points
pub(super) const EXCHANGE_NEAR: f64 = 0.1193;

/// (Sum of the radii / distance)^2 up to which 4 x 4 Gauss points are used on each end; the closed form beyond.
///
/// - Unit: 1
/// - Tried: measured against 24 x 24 pieces of the closed form
/// - Larger: errors of exchange areas above 0.02 %
/// - Smaller: time: closed form
pub(super) const EXCHANGE_CLOSE: f64 = 0.3993;

/// Second-order variation of the kernel over its first-order variation squared.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more links
/// - Smaller: bends between points go unseen
pub(super) const CURVATURE: f64 = 0.4;

/// Relative difference of the exchange area from points of either end up to which it is taken.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of exchange areas of near pairs
/// - Smaller: time: integrals along outlines
pub(super) const AGREE: f64 = 2e-3;

/// Form factor from the smaller end above which points miss its edges.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of exchange areas of near pairs
/// - Smaller: time: integrals along outlines
pub(super) const FULL: f64 = 0.8;

/// Bend over both ends above which points may have missed what is between them, though they agree.
///
/// - Unit: 1
/// - Tried: 0.3, 0.75 on 52,000 pairs: half are off by less than 1e-4, one in a hundred by 1e-3 to 3e-3
/// - Larger: errors of exchange areas of near pairs
/// - Smaller: time: integrals along outlines
pub(super) const EXCHANGE_BENT: f64 = 0.75;

/// Relative error of exchange areas along outlines.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of exchange areas of near pairs
/// - Smaller: time
pub(super) const OUTLINE_ERROR: f64 = 1e-4;

/// Range of the form factors from points of a quadrilateral above which it is integrated in four parts.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of exchange areas of touching pairs
/// - Smaller: time
pub(super) const FORM_FACTOR_RANGE: f64 = 0.5;

/// (Sum of the radii / distance)^2 from which bends are read from the closed form.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of bends beside edges
/// - Smaller: time of readings
pub(super) const BEND_CLOSE: f64 = 1.0;

/// (Sum of the radii / distance)^2 below which a source is a point for bends.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of bends
/// - Smaller: time of readings
pub(super) const BEND_FAR: f64 = 0.03;

/// Most occluders of a pair for clipping where nothing is known of its brightness.
///
/// - Unit: occluders
/// - Tried: 12 for all pairs: see `CLIPPED_MAX_CLOSE` of `pair`
/// - Larger: time
/// - Smaller: noise of sampling
pub const CLIPPED_MAX: usize = 12;

/// Share of the smaller end's extent by which a polygon may reach into the hull of a steep pair and not count as a blocker.
///
/// - Unit: 1
/// - Tried: 0, 1e-3
/// - Larger: that share of either end may be hidden unseen
/// - Smaller: with 0 what only rounding of single precision lets reach in counts
pub(super) const GRAZED: f64 = 1e-3;

/// Area of a blocker that is in a group, over that of the connected patches that it belongs to, at least: a face of a cube.
///
/// - Unit: 1
/// - Tried: 0, 1/6
/// - Larger: elements in shadows of small things weigh less
/// - Smaller: with 0 triangles of a ball count as things of their own, and elements in its shadow are split to the size of these
pub(super) const BODY_SHARE: f64 = 1.0 / 6.0;

/// Error of visibility from four points that all see a part of the other end, over its spread between them.
///
/// - Unit: 1
/// - Tried: root mean square over 47,000 links of three scenes
/// - Larger: more points on links that need none
/// - Smaller: links keep the error of few points
pub(super) const ERROR_SMOOTH: f64 = 0.06;

/// Error of visibility from four points that see equal parts of the other end.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more points on links that need none
/// - Smaller: links keep the error of few points
pub(super) const UNSEEN_SMOOTH: f64 = 0.002;

/// Error of visibility from four points of which some see all of the other end or nothing, over its spread between them.
///
/// - Unit: 1
/// - Tried: root mean square over 47,000 links of three scenes
/// - Larger: more points on links that need none
/// - Smaller: links keep the error of few points
pub(super) const ERROR_KINKED: f64 = 0.33;

/// Least error of visibility from four points of which some see all of the other end or nothing.
///
/// - Unit: 1
/// - Tried: 0.05 (root mean square over 47,000 links of three scenes), 0.1
/// - Larger: more points on links that need none
/// - Smaller: with 0.05 rows of blades that see a wall past each other's edges are off by a third of the tolerance: links in which two of four points
///   see a sliver err by 0.13, all in one sense
pub(super) const UNSEEN_KINKED: f64 = 0.1;

/// Error of visibility from four points that all see the whole other end, or all nothing.
///
/// - Unit: 1
/// - Tried: root mean square over 47,000 links of three scenes
/// - Larger: more points on links that need none
/// - Smaller: links keep the error of few points
pub(super) const UNSEEN: f64 = 0.075;

/// Visibility that four points which see nothing may have missed, where nothing proves that the end is hidden.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more points on pairs that are hidden
/// - Smaller: narrow gaps are lost
pub(super) const OVERLOOKED: f64 = 0.3;

/// Halvings of an end of which each part must be hidden by one occluder, to prove that it is hidden.
///
/// - Unit: halvings
/// - Tried: not varied
/// - Larger: time
/// - Smaller: more points on pairs that are hidden
pub(super) const HALVINGS: u32 = 5;

/// Most cells along a side of an end, of four points each.
///
/// - Unit: cells
/// - Tried: not varied
/// - Larger: time
/// - Smaller: links keep the error of few points
pub const CELLS_MAX: u32 = 8;

/// Ratio of the motions of shadows over the two ends from which the larger end is the observer.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: four points of a ceiling cannot tell how much of it a lamp just below hides
/// - Smaller: the larger end has too few points
pub(super) const MOTION_RATIO: f64 = 16.0;

/// Share of an end in front of the other's plane from which it counts as wholly facing the other; a value that quadtrees do not meet.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: ends that nearly face the other are left out as observers
/// - Smaller: points behind the other's plane see nothing: a wall half behind a box's top was dark
pub(super) const FACING: f64 = 0.7303;

/// Rays from each facet of the end that has more facets.
///
/// - Unit: rays
/// - Tried: 4, 32
/// - Larger: time: 4 rays take 5 to 22 % of a cold build; eight times as many changed no error (12.4 % by area either way)
/// - Smaller: visibilities of facets are noise
pub(super) const FACET_RAYS: usize = 4;

/// Runs of neighbouring facets of an end that have a visibility of their own, at most.
///
/// - Unit: runs
/// - Tried: 256
/// - Larger: time on finely tessellated bodies
/// - Smaller: shadows on them are coarse
pub(super) const RUNS_MAX: usize = 256;

/// Segments that a pair with a group is sampled by.
///
/// - Unit: segments
/// - Tried: not varied
/// - Larger: time of links with groups
/// - Smaller: noise of their visibility
pub const GROUP_SEGMENTS: u32 = 16;

/// Relative standard deviation that contact over a part of an end counts for at most.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: links along contacts
/// - Smaller: light that leaks along contacts
pub(super) const UNEVEN: f64 = 4.0;

/// Halvings of a quadrilateral in the near field.
///
/// - Unit: halvings
/// - Tried: not varied
/// - Larger: time of close pairs: it grows fourfold
/// - Smaller: pairs that count as steep
pub(super) const NEAR_HALVINGS: u32 = 1;

/// Share of the other end below which what a point sees may be a sliver between shadows.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light that is lost through narrow gaps
/// - Smaller: light through gaps that rounding makes
pub(super) const SEEN_SLIVER: f64 = 1e-4;

/// Share of the way to the middle by which the corners of an end are drawn in, so that none lies in the plane of what stands on
/// the end.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: edges of shadows beside contacts
/// - Smaller: corners that what stands on the end hides
pub(super) const DRAWN_IN: f64 = 0.005;
