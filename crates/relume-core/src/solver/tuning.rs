//! Calibration constants of the room `solver`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Most batches of a sweep: each gathers what the batches before it found.
///
/// - Unit: batches
/// - Tried: not varied
/// - Larger: threads wait for each other
/// - Smaller: more sweeps
pub(super) const BATCHES: usize = 16;

/// Elements for each changed receiver below which all are gathered.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time: all are gathered where few changed
/// - Smaller: time: many receivers are found one by one
pub(super) const SOME_SHARE: usize = 4;

/// Elements for each one that a full sweep changed below which the next sweep is full.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time: full sweeps where few change
/// - Smaller: time: many receivers are found one by one
pub(super) const ALL_SHARE: usize = 16;

/// Change of a receiver's sources, over the residual, from which it gathers again.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: larger residuals
/// - Smaller: more gathers
pub(super) const PENDING_SHARE: f32 = 0.5;

/// Changes skipped since the last full sweep, over the present limit, from which all are gathered.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: larger residuals
/// - Smaller: more full sweeps
pub(super) const SKIPPED_MAX: f32 = 2.0;

/// Elements for each changed one below which the last solve counts as one of most of the scene.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: the next solve starts with all where few change
/// - Smaller: sweeps that extrapolation of the trend would save
pub(super) const WIDE_SHARE: usize = 4;

/// Squared cosine between successive changes above which the geometric series is summed at once.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: more sweeps
/// - Smaller: jumps in a wrong direction
pub(super) const PARALLEL: f64 = 0.9;

/// Change of the flux that all surfaces send in a sweep over everything, over the flux emitted or absorbed, from which there is another.
///
/// - Unit: 1
/// - Tried: 0.005; without it white bodies in motion left up to 1 % of the light unaccounted for at tolerance 0.1
/// - Larger: light is unaccounted for in bright scenes that move
/// - Smaller: time: full sweeps where little moved
pub(super) const UNBALANCED_MAX: f64 = 0.005;

/// Sum of the residuals after a sweep over a part, if all were as large as they may be and of one sign, over the same flux, from which
/// everything is gathered. What was found was a twelfth of that.
///
/// - Unit: 1
/// - Tried: 0.08
/// - Larger: light is unaccounted for in bright scenes that move
/// - Smaller: time: full sweeps where little moved
pub(super) const UNKNOWN_MAX: f64 = 0.08;

/// Flux that rows above 1 would make in even light, over what surfaces absorb, from which a frame is solved from nothing and factors of
/// leaves may count.
///
/// - Unit: 1
/// - Tried: 0.0015 (coarse links of the form-factor oracle beside a white lamp were scaled, and its room became darker), 0.005; white
///   closets have 0.06 to 0.1 and were off by 2 to 60 % without
/// - Larger: light is unaccounted for in white gaps
/// - Smaller: time: factors where rows are only a little off
pub(super) const GAIN_MAX: f64 = 0.005;

/// The same, up to which a solution counts as balanced without a look; with the paper's oracle, as levelled ones are always looked at.
///
/// - Unit: 1
/// - Tried: 0.0015
/// - Larger: light is unaccounted for in gaps of fractions of a millimetre (2.4 % beside a white box 0.04 mm above a panel)
/// - Smaller: time: a pass over all links where nothing can grow
pub(super) const GAIN_SURE: f64 = 0.0015;

/// Flux that escapes from closed surroundings, or arrives without being sent, or the other way round, over what is emitted, from which
/// levels are made symmetric if that keeps light better.
///
/// - Unit: 1
/// - Tried: 0.01 (lamps by boards below ceilings are off by up to a hundredth), 0.005
/// - Larger: more light may come of nothing, or be lost
/// - Smaller: time: several solutions of one frame
pub(super) const LEVELLED_ASTRAY_MAX: f64 = 0.005;

/// The same, from which factors of leaves count, whatever the levels.
///
/// - Unit: 1
/// - Tried: 0.01 (closets of reflectance 0.98 lose up to a tenth with levels that count one way)
/// - Larger: more than a hundredth of the light may come of nothing, or be lost
/// - Smaller: factors, which know nothing of where light is, where levels would do
pub(super) const ASTRAY_MAX: f64 = 0.01;

/// Flux that facets with rows above 1 make in a solution, over what is emitted, from which factors of leaves count with the paper's oracle.
/// It bounds factors and not errors: rows are off by tenths, and leaves are not levelled.
///
/// - Unit: 1
/// - Tried: 0.05 and 0.01 (a room with a white lamp 10 % too dark with factors, 10 % too bright without, and frames that jump between),
///   0.5
/// - Larger: light is unaccounted for
/// - Smaller: frames that jump, and the time that factors take, for nothing
pub(super) const COARSE_MADE_MAX: f64 = 0.5;

/// Largest reflectance of a scene from which it is looked whether rows above 1 make light of nothing.
///
/// - Unit: 1
/// - Tried: 0.85
/// - Larger: light is unaccounted for in gaps between bright surfaces
/// - Smaller: time: a pass over all links where nothing can grow
pub(super) const WHITE: f32 = 0.85;

/// Mean of the sums of rows over a part of a surface from which it counts as closed in, and its leaves are levelled.
///
/// - Unit: 1
/// - Tried: 0.995 (the upper side of a lamp 5 mm below a board was not closed: 1 % of the light lost)
/// - Larger: parts whose rows are a little off are not levelled
/// - Smaller: what lies beside an opening of 1 % is too bright by as much
pub(super) const CLOSED: f64 = 0.99;

/// Most that the reflected light of a leaf is multiplied with.
///
/// - Unit: 1
/// - Tried: 2
/// - Larger: leaves that see little are bright by chance
/// - Smaller: light is lost in narrow gaps
pub(super) const LEVEL_MOST: f32 = 2.0;

/// Most that the light of a leaf is divided by, so that its row sums to 1.
///
/// - Unit: 1
/// - Tried: 2 and 4 (a leaf of which a strip of a fiftieth was exposed had a row of 14, and light grew without end), 256
/// - Larger: nothing was seen
/// - Smaller: rows above 1, and light that grows between white surfaces
pub(super) const DIVIDED_MOST: f32 = 256.0;

/// Flux that scaled rows may lose or make where lines reach below zero, over what is emitted, before elements are taken to be constant.
///
/// - Unit: 1
/// - Tried: 0.01 (a white room with a closet 13 % too dark), 0.1
/// - Larger: light is unaccounted for in white scenes
/// - Smaller: constant elements, and their errors, where lines would do
pub(super) const LOST_MAX: f64 = 0.1;

/// Largest factor of a leaf.
///
/// - Unit: 1
/// - Tried: 4
/// - Larger: light that comes from a few neighbours only
/// - Smaller: light is lost where rows are low
pub(super) const FACTOR_MOST: f32 = 4.0;

/// Most that the row of a leaf is raised to, over what it sums to.
///
/// - Unit: 1
/// - Tried: 1.25, 2, 4, no limit (leaves hidden by a lamp were raised to 1)
/// - Larger: leaves that see little are too bright
/// - Smaller: light is lost where rows of the same facet are above 1 elsewhere
pub(super) const RAISED_MOST: f32 = 2.0;

/// Residual of a solution with factors, over that of others: changes that go one way add up where hardly any light is absorbed.
///
/// - Unit: 1
/// - Tried: 1 (two solutions of one scene 15 % apart), 0.1
/// - Larger: a frame that follows others differs from a cold build
/// - Smaller: time, in white scenes
pub(super) const SCALED_RESIDUAL: f64 = 0.1;

/// Rounds of the search for factors.
///
/// - Unit: rounds
/// - Tried: 32
/// - Larger: time, in white scenes
/// - Smaller: rows above 1
pub(super) const SCALING_ROUNDS: u32 = 32;

/// Sweeps after which a solve is given up as not converging (reflectances are below 1).
///
/// - Unit: sweeps
/// - Tried: not varied
/// - Larger: time until an error is said
/// - Smaller: solutions between very bright surfaces are refused
pub(super) const SWEEPS_MAX: u32 = 2_000;

/// Sweeps over everything by which a solution is settled further, at most: beyond that it is said that light is unaccounted for.
///
/// - Unit: sweeps
/// - Tried: not varied
/// - Larger: time of scenes of white surfaces
/// - Smaller: light of white scenes stays unaccounted for
pub(super) const FURTHER_MAX: u32 = 32;

/// Sweeps in which weights are looked for that bound the error of a solution by its residuals, at most.
///
/// - Unit: sweeps
/// - Tried: not varied
/// - Larger: time of a comparison of solutions in which light hardly loses anything
/// - Smaller: sound solutions of such scenes may be called different
pub(super) const GROWTH_SWEEPS: u32 = 256;
