//! Calibration constants of the room `read`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// (Sum of the radii / distance)^2 above which two pieces of a link are no points.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of shares beside edges
/// - Smaller: time of readings
pub(super) const PIECES_APART: f64 = 0.01;

/// Most occluders for pieces of a link to be clipped.
///
/// - Unit: occluders
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: shares of partly hidden links are those of the lines
pub(super) const PIECES_CLIPPED_MAX: usize = 96;

/// Form factor of a piece times the bend of visibility, over the tolerance, for each square of points on it.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of shares across shadows
/// - Smaller: time of readings
pub(super) const PIECES_CLOSER: f64 = 0.01;

/// Most cells along a side of a piece.
///
/// - Unit: cells
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: errors of shares across shadows
pub(super) const PIECES_CELLS_MAX: f64 = 8.0;

/// Pieces before and after one that may lie beside it.
///
/// - Unit: pieces
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: neighbours are missed
pub(super) const AROUND: usize = 32;

/// Bend of visibility that neighbouring pieces which agree may have missed.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: errors of shares across shadows
pub(super) const PIECES_UNSEEN: f64 = 0.6;

/// Distance of a blocker, in radii of a piece, below which `PIECES_UNSEEN_NEAR` counts.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: errors of shares close to blockers
pub(super) const PIECES_NEAR: f64 = 4.0;

/// Bend of visibility that neighbouring pieces may have missed where a blocker is near.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: errors of shares close to blockers
pub(super) const PIECES_UNSEEN_NEAR: f64 = 1.5;

/// Bend of visibility that neighbouring pieces may have missed where all see a part of the other end.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: errors of shares across shadows
pub(super) const PIECES_UNSEEN_PARTLY: f64 = 0.2;

/// Steps in which shares are fitted to what every piece sees.
///
/// - Unit: steps
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: rows of pieces do not add up
pub(super) const FITS: usize = 8;

/// Least visibility of a pair of pieces that fitting starts from, over that of the link.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light where pieces are hidden
/// - Smaller: fits that cannot settle
pub(super) const SEEN_MIN: f64 = 1e-3;

/// Size over distance up to which an element in plain view sends its mean.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of sensors up to this share
/// - Smaller: time of sensors
pub(super) const GATHER_FAR: f64 = 1.0 / 32.0;

/// As `GATHER_FAR`, for points that a sensor sees, and in plain view or not.
///
/// - Unit: 1
/// - Tried: 1/32, 1/16, 1/8, 1/4 (in a room with a crate sensors change by less than 0.01 % from first to last)
/// - Larger: errors of what leaves surfaces close to sensors
/// - Smaller: time of sensors
pub(super) const BEYOND_FAR: f64 = 1.0 / 4.0;

/// Radius of an element in plain view over its distance, up to which it is taken as a whole where a solution is checked.
///
/// - Unit: 1
/// - Tried: 1/4
/// - Larger: errors of estimates beside uneven surfaces
/// - Smaller: time of estimates
pub(super) const CHECK_FAR: f64 = 0.25;

/// What a patch brings to a point at which a solution is checked, over tolerance and irradiance, below which one ray tells if it
/// is in view.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: noise of estimates among many bodies
/// - Smaller: time of estimates
pub(super) const CHECK_LITTLE: f64 = 0.02;

/// Points of the estimate that every frame gets, at least and at most.
///
/// - Unit: points
/// - Tried: 16, 32, 64, 256 on the scenes of `tests/kinds`
/// - Larger: time of frames
/// - Smaller: errors in few places are missed
pub(super) const CHECK_POINTS: (usize, usize) = (4, 128);

/// Cost of that estimate over that of a cold build, which is counted in links, a point costing as many as the root of the leaves and
/// `CHECK_COST_PER_PATCH` for each patch.
///
/// - Unit: 1
/// - Tried: 1/10, as asked for
/// - Larger: time of frames
/// - Smaller: errors in few places are missed
pub(super) const CHECK_SHARE: f64 = 0.1;

/// Links that are judged in a cold build in the time in which a point looks for what may stand before one patch.
///
/// - Unit: links
/// - Tried: fitted to a room of 19 patches and a hall of 368
/// - Larger: fewer points among many patches
/// - Smaller: time of frames among many patches
pub(super) const CHECK_COST_PER_PATCH: f64 = 1.0 / 6.0;

/// Share of the points of an estimate that is spread evenly over all lit leaves, the rest by squared slope of irradiance.
///
/// - Unit: 1
/// - Tried: 0.3, 1 (one of four estimates within a factor of 1.5 at 64 points in place of three)
/// - Larger: few points where errors are
/// - Smaller: errors in leaves of even light are missed
pub(super) const DRAWN_EVENLY: f64 = 0.3;

/// Squared rise of irradiance over a leaf, relative, up to which it gets more points.
///
/// - Unit: 1
/// - Tried: 4
/// - Larger: all points in the darkest leaves
/// - Smaller: few points where errors are
pub(super) const DOUBT_MAX: f64 = 4.0;

/// Radius of a part of a leaf over its distance from the sensor, at most: what leaves it is found at its middle.
///
/// - Unit: 1
/// - Tried: 1, 0.5, 0.35, 0.25
/// - Larger: errors of sensors beside contact shadows: at 1 the side of a device half a millimetre above a table was 20 % too bright
/// - Smaller: time of sensors
pub(super) const GATHER_PART: f64 = 0.35;

/// Form factor to a part of a leaf below which the part sends what the leaf's line says.
///
/// - Unit: 1
/// - Tried: 0.01, 0.003, 0.001
/// - Larger: errors of sensors beside contact shadows
/// - Smaller: time of sensors
pub(super) const GATHER_LITTLE: f64 = 0.003;

/// Share of a point's view above which leaves that are large against their distance make a gap of any width.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: gaps are too bright: 20 to 70 times 20 gaps deep
/// - Smaller: time of sensors
pub(super) const IN_A_GAP: f64 = 0.5;

/// Largest width of a gap, over the length at which an element weighs 1 in the error norm.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time of sensors
/// - Smaller: sensors in gaps are as wrong as leaves there, by a tenth
pub(super) const GAP_NARROW: f64 = 0.25;

/// Distance up to which leaves are not taken at their line in a gap, over its width: at least, and at most where that is less than
/// the length at which an element weighs 1 in the error norm.
///
/// - Unit: 1
/// - Tried: 0, 4, 8, 16 without and with 64
/// - Larger: time of sensors and scatter of walks
/// - Smaller: sensors in gaps are as wrong as leaves there (0: by up to 16 %; 4: by 3 %; 60 widths deep 16 alone is ten times too
///   bright)
pub(super) const GAP_REACH: (f64, f64) = (16.0, 64.0);

/// Radius of an element over its distance up to which it sends its mean radiosity into a gap.
///
/// - Unit: 1
/// - Tried: 1/32, 1/8
/// - Larger: errors of uneven surfaces that are seen out of a gap
/// - Smaller: time of sensors
pub(super) const GAP_FAR: f64 = 1.0 / 8.0;

/// Irradiance in a gap by what arrives from far along walks, over that by lines, below which lines are of no use.
///
/// - Unit: 1
/// - Tried: 0, 1/4
/// - Larger: scatter of readings in gaps
/// - Smaller: readings deep in gaps are too bright: ten times, 60 widths deep
pub(super) const GAP_DARK: f64 = 0.25;

/// Walks from a sensor in a gap.
///
/// - Unit: walks
/// - Tried: 15, 32, 64, 120; 16 to 64 until they scatter by a quarter of the tolerance (one of 30 sensors off by 7 % at 0.02)
/// - Larger: time of sensors
/// - Smaller: scatter of readings in gaps: of 120 sensors one is off by more than the tolerance of 0.02 with 64, six with 32
pub(super) const GAP_WALKS: usize = 64;

/// Share of the light, in tolerances, below which a walk in a gap ends, and its bounces at most.
///
/// - Unit: 1, bounces
/// - Tried: 1e-3, 1e-2, 3e-2 without the tolerance
/// - Larger: errors of leaves in gaps show
/// - Smaller: time of sensors
pub(super) const GAP_FOLLOWED: (f64, usize) = (0.05, 24);

/// Error of a solution in dark places, in tolerances of the mean irradiance: where automatic exposure stops.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: dark pictures
/// - Smaller: blotches of dark places show
pub(super) const VISIBLE: f64 = 0.05;

/// Walks from each point of an estimate of accuracy.
///
/// - Unit: walks
/// - Tried: not varied
/// - Larger: time of estimates
/// - Smaller: smaller errors stay unresolved
pub(super) const WALKS: usize = 8;

/// Rays that a point looks around with for each walk; a square number.
///
/// - Unit: rays
/// - Tried: 64; half as many cost half as much and resolve errors larger by the root of two
/// - Larger: time of estimates
/// - Smaller: smaller errors stay unresolved
pub(super) const ACCURACY_RAYS: usize = 64;

/// Most points of a walk.
///
/// - Unit: points
/// - Tried: not varied
/// - Larger: time of estimates
/// - Smaller: errors of many bounces stay unseen
pub(super) const STEPS: usize = 6;

/// Weight below which a walk ends.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of many bounces stay unseen
/// - Smaller: time of estimates
pub(super) const WALK_LEAST: f64 = 0.02;

/// Irradiance below which a surface counts as dark, over the mean.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors in dim places count less
/// - Smaller: relative errors of what is black
pub(super) const DARK: f64 = 1e-3;

/// Brightest patches whose emission is gathered exactly.
///
/// - Unit: patches
/// - Tried: not varied
/// - Larger: time of estimates
/// - Smaller: noise where many lamps are small
pub(super) const LAMPS: usize = 16;

/// Exitance over the mean radiosity from which a patch counts as a lamp.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: noise from lamps that are found by rays
/// - Smaller: time of estimates
pub(super) const BRIGHT: f64 = 4.0;

/// Error of a link's line, over the tolerance times the mean radiosity, below which the line is left as it is.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors between leaves
/// - Smaller: time of readings
pub(super) const NEGLIGIBLE_SHARE: f64 = 0.001;

/// Sweeps over everything once leaves have links of their own; each passes on less than half.
///
/// - Unit: sweeps
/// - Tried: not varied
/// - Larger: time of readings
/// - Smaller: leaves do not settle
pub(super) const RECONSTRUCTION_SWEEPS: u32 = 8;

/// Distance of a row sum from 1 up to which it is taken for an error of the links.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: open scenes that are closed by force
/// - Smaller: coarse tables that are refused
pub(super) const CLOSED_WITHIN: f64 = 0.1;

/// Halvings of a leaf before a sensor that falls into too many pieces; then its middle decides.
///
/// - Unit: halvings
/// - Tried: not varied
/// - Larger: time of sensors close to clutter
/// - Smaller: errors there
pub(super) const SENSOR_SPLITS: u32 = 6;

/// Cosine of the angle by which the normal of a point may differ from that of its patch.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: points of curved surfaces that find no patch
/// - Smaller: points that find the patch around a corner
pub(super) const FACES_ALONG: f64 = 0.9;

/// Distance of the middles of two pieces, over the sum of their radii, up to which they are side by side.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time of tables
/// - Smaller: errors between neighbours
pub(super) const BESIDE: f64 = 1.01;

/// Sum of the ways from a piece to two others, over one of them, up to which these lie opposite each other about it.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors of pieces that are close on one side
/// - Smaller: pieces that are cut in vain
pub(super) const OPPOSITE: f64 = 0.1;
