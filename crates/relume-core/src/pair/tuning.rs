//! Calibration constants of the room `pair`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Standard deviation of a source's reflected radiosity over a reference-sized element beyond its gradient, relative to its mean.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more links to bright walls
/// - Smaller: uneven radiosity of large sources goes unseen
pub(super) const SOURCE_VARIATION: f64 = 0.2;

/// Weight of the unevenness with which lamps close to a source light it.
///
/// - Unit: 1
/// - Tried: 0.3, 1, 2, 3
/// - Larger: links beside lamps: a lamp 3 mm below a ceiling has 7 times as many as with 0 at 2, 10 times at 3
/// - Smaller: walls beside lamps that nearly touch a ceiling are too bright: at 1 by up to 1.6 % of the lamp's light at
///   tolerance 0.1, at 0.3 by 4 %, at 0 by 37 %
pub(super) const SPOT: f64 = 2.0;

/// Area over which a lamp's light is spread on average, over that of an element that weighs 1 in the error norm: about that of
/// a coarse element.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: as SPOT
/// - Smaller: as SPOT
pub(super) const SPOT_AROUND: f64 = 16.5;

/// Standard deviation of a source's reflected radiosity where what stands on it hides light from one part, over its mean.
///
/// - Unit: 1
/// - Tried: 0, 0.3, 1, 3
/// - Larger: links around what stands on a surface: at 3 a hall of 60 boxes has a quarter to a third more than at 1
/// - Smaller: light leaks past doors that turn, from elements on both sides: at 0 a room behind one errs by half as much again
pub(super) const JUMP: f64 = 1.0;

/// Error that splitting the smaller end must remove, over that of the larger, for the smaller to be split.
///
/// - Unit: 1
/// - Tried: 1, 1.5, 3, infinite
/// - Larger: a tenth more links and a third more error where the larger end is always split
/// - Smaller: pairs change sides under the smallest motion: at 1 a quarter of all edits under a moving lamp
pub(super) const PREFERENCE: f64 = 3.0;

/// Weight of the variation of visibility over a receiver beyond its gradient, for a link whose neighbours are hidden otherwise.
///
/// - Unit: 1
/// - Tried: 0.2 against counting neighbours alike (docs/tolerance.md)
/// - Larger: more links at the edges of lamps' shadows
/// - Smaller: edges of shadows are too coarse
pub(super) const EDGE: f64 = 0.2;

/// Least weight of the variation of visibility over a receiver for reflected light, whose sources all around are hidden along one edge.
///
/// - Unit: 1
/// - Tried: 0.2, 0.4, 1, 2, 3
/// - Larger: more links in corners and gaps
/// - Smaller: with 1 or 0.2 tables of form factors behind partitions and white closets miss their limits; at 0.4 the gap behind a lamp made 95 % of a room's squared error
pub(super) const EDGE_REFLECTED: f64 = 3.0;

/// Share of the links across which a shadow's edge sweeps whose errors have one sign.
///
/// - Unit: 1
/// - Tried: 0.5, 1
/// - Larger: with 1 tables and halls have a quarter more links for the same errors
/// - Smaller: lanes under the sky err by more than the tolerance
pub(super) const ALIKE_SHARE: f64 = 0.5;

/// Largest form factor of all sources that are counted as hidden along one edge.
///
/// - Unit: 1
/// - Tried: 0.3, 1
/// - Larger: with 1 scenes have a tenth more links for the same errors
/// - Smaller: lanes under the sky err by more than the tolerance
pub(super) const ALIKE_FACTOR: f64 = 0.3;

/// Weight of the variation of the kernel over a receiver beyond its gradient; readings find most of it again.
///
/// - Unit: 1
/// - Tried: 1, 0.5, below 0.5
/// - Larger: more links than the error needs, since readings add the bend
/// - Smaller: the solver's own errors within elements make everything brighter by 5e-4
pub(super) const BENT: f64 = 0.5;

/// Least standard deviation of visibility over an end of a partly hidden pair with a steep kernel, unless the kernel itself varies less
/// over that end.
///
/// - Unit: 1
/// - Tried: 0, 0.3; 0.3 over both ends however even the kernel is over one of them
/// - Larger: more links at near misses; over both ends blinds at tolerance 0.02 had 2,189,000 links in place of 280,000, for the same errors
/// - Smaller: with 0 the rows of louvres summed to 0.70
pub(super) const STEEP: f64 = 0.3;

/// Visibility below which an end counts as hidden: a sliver that rounding leaves.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: thin gaps are taken for hidden
/// - Smaller: slivers of rounding are refined
pub(super) const SEEN: f64 = 1e-4;

/// Area of the elements that weigh 1 where edges of shadows are concerned, over that of the smallest shadow that blockers throw in the light
/// of the other end's middle.
///
/// - Unit: 1
/// - Tried: 1, 2, 5
/// - Larger: sensors beside a device of 2 cm in a hall off by 0.43 % at tolerance 0.005 and 1.2 % at 0.02 (0.33 and 0.61 at 2)
/// - Smaller: elements in shadows of small things are split further
pub(super) const SMALL_SHADOW: f64 = 2.0;

/// Area within which neighbouring sources are hidden alike, over that of all blockers between.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more sources count as hidden alike
/// - Smaller: fewer sources count as hidden alike
pub(super) const SHADOW_AREAS: f64 = 5.0;

/// Weight of the sampling error of visibility, which is independent from link to link.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: sampled pairs are refined for noise that averages out
/// - Smaller: noise of sampled pairs shows
pub(super) const NOISE: f64 = 0.2;

/// Contribution of a pair to its receiver, in thresholds of a link, from which up to `CLIPPED_MAX_CLOSE` occluders are clipped.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: pairs that matter are sampled: noise
/// - Smaller: time: pairs that do not matter are clipped
pub(super) const CLOSE_SHARE: f64 = 2.0;

/// Most occluders of a pair that contributes much for clipping; beyond it is sampled.
///
/// - Unit: occluders
/// - Tried: 12 for all pairs, 96
/// - Larger: time in rooms with many things
/// - Smaller: with 12 the error of a room of 64 boxes was 2.5 % in place of 1.1 %, from 2 % of the links
pub(super) const CLIPPED_MAX_CLOSE: usize = 96;

/// Most occluders of a pair that contributes little for clipping.
///
/// - Unit: occluders
/// - Tried: 4, 12
/// - Larger: with 12 most of the clipping goes to links that do not need it
/// - Smaller: noise of sampling
pub(super) const CLIPPED_MAX_REST: usize = 4;

/// Blockers of a pair that are listed; more are a crowd, past which segments look in the hierarchy.
///
/// - Unit: blockers
/// - Tried: 64, 128
/// - Larger: time in rooms with thousands of things
/// - Smaller: pairs that contribute much past few things are sampled
pub(super) const LISTED_MAX: usize = 64;

/// Visibility that segments which are all blocked may have missed.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more pairs are clipped to be sure that they are hidden
/// - Smaller: narrow gaps are lost
pub(super) const SAMPLED_MAX: f64 = 0.15;

/// Area at which an element weighs 1 in the error norm, over the area of the connected patches that it belongs to: a face of a cube.
///
/// - Unit: 1
/// - Tried: 1/12, 1/6, 1/2
/// - Larger: with 1/2 a device in a hall misses the tolerance
/// - Smaller: with 1/12 a room of 64 boxes has a fifth more links
pub(super) const CONNECTED_SHARE: f64 = 1.0 / 6.0;

/// Contribution of a pair that may go unseen, over the error that a link may have.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: narrow gaps are lost
/// - Smaller: more points on pairs that are hidden
pub(super) const OVERLOOKED_MAX: f64 = 0.25;

/// Threshold below which links get no more points; elements shrink instead.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: fine tolerances keep the error of four points
/// - Smaller: time at fine tolerances
pub(super) const FINEST: f64 = 0.002;

/// Form factor times error of visibility, over the error that a link may have, for each square of points on an end.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: partly hidden links keep the error of few points
/// - Smaller: time: more points on each link
pub(super) const CLOSER: f64 = 0.03;

/// Distance of two ends, in sums of their radii, below which a pair with a group is refined whatever it carries.
///
/// - Unit: 1
/// - Tried: 0.7 to 1.3: no difference in rooms and towns (0.2 % by patch); on a lumpy body 1.0 takes a quarter of the links away
/// - Larger: more links of groups
/// - Smaller: errors of groups close to each other
pub(super) const APART: f64 = 1.0;

/// Radius that an element of a patch that is in groups counts with where the larger end of a pair with a group is refined, over its own.
///
/// - Unit: 1
/// - Tried: 0.5, 0.7, 1
/// - Larger: from 0.75 on triangles beside each other are divided: a lumpy torus has a fifth more links at 1
/// - Smaller: at 0.5 patches of a heap of small tori err by 4 % more
pub(super) const FACET_RADIUS: f64 = 0.7;

/// Error of the form factor between near-flat neighbours, over the square of the sine of half the angle of the cone around their
/// normals; 1.5 is the largest for small angles.
///
/// - Unit: 1
/// - Tried: 0.5, 1
/// - Larger: more links on finely tessellated bodies (a lumpy ball of 29,264 triangles: 29,700 at 0.5, 31,500 at 1)
/// - Smaller: errors where such bodies are hollow
pub(super) const GRAZING: f64 = 1.0;

/// Sine of half the angle of that cone up to which neighbours are near-flat.
///
/// - Unit: 1
/// - Tried: 0.25, 0.35, 0.5
/// - Larger: patches of a heap of small tori err by 2.5 % more at 0.5
/// - Smaller: more links on finely tessellated bodies (a lumpy ball of 29,264 triangles: 31,500 at 0.5, 34,600 at 0.35, 41,900 at 0.25)
pub(super) const NEAR_FLAT: f64 = 0.35;

/// Weight of the second order in size over distance of either end in the error of a group's link.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more links of groups
/// - Smaller: groups close to each other err
pub(super) const PLACE: f64 = 1.0;

/// Weight of the standard deviation of visibility on an element linked with a group, which has one visibility for all of it.
///
/// - Unit: 1
/// - Tried: 0.5, 1
/// - Larger: more links of groups
/// - Smaller: with 0.5 places on a ceiling close above a lamp err more: 4.5 to 7.4 % by area
pub(super) const SHARED: f64 = 1.0;

/// Weight of the standard deviation of visibility on a group, whose facets have visibilities of their own.
///
/// - Unit: 1
/// - Tried: 0.25, 0.5, 1
/// - Larger: with 1 5 % more links and no difference in the error
/// - Smaller: no difference down to 0.25
pub(super) const SHARED_BY_FACETS: f64 = 0.5;

/// Variance of visibility that sixteen segments may miss.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more links of groups
/// - Smaller: small blockers of groups go unseen
pub(super) const MISSED: f64 = 0.01;

/// Further share of a group's area that it may show, for each radius over distance of the other end.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more links of groups
/// - Smaller: groups close to an end are taken for smaller than they look
pub(super) const TURNED: f64 = 0.5;

/// Nodes of the hierarchy visited for the certificate of one pair.
///
/// - Unit: nodes
/// - Tried: 256, unlimited
/// - Larger: certificates cost more than they save: unlimited, a frame with a turning ball took 1.7 cold builds in place of 1.25
/// - Smaller: fewer pairs are certified
pub(super) const EFFORT: u32 = 256;

/// Pairs judged by one task.
///
/// - Unit: pairs
/// - Tried: not varied
/// - Larger: threads wait for each other
/// - Smaller: overhead of tasks
pub(super) const CHUNK: usize = 128;

/// Pairs judged before their results are applied.
///
/// - Unit: pairs
/// - Tried: not varied
/// - Larger: scratch memory
/// - Smaller: threads wait for the writer
pub(super) const BLOCK: usize = 1 << 15;
