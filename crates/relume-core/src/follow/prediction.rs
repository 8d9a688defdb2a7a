//! What a strategy predicts with.

use crate::pair::PairTree;
use crate::predict::{KnownMotion, Lookahead, MotionBounds, Ticks};
use crate::solver::Stop;

use super::update::Update;

/// How many times as bright as when no link was extrapolated last a scene may get before its frame is built anew:
/// links that are a little too large feed each other.
const SUDDEN: f64 = 1.25;

/// When to stop a solve over extrapolated links: given up where it gets brighter than it did without them, or than
/// the scene can be. Mean radiosities, W/m2.
pub(super) fn while_extrapolated(
    residual: f64,
    last_exact_mean_w_m2: f64,
    mean_radiosity_bound_w_m2: f64,
) -> Stop {
    let mean_w_m2 = (SUDDEN * last_exact_mean_w_m2).min(ROUNDING * mean_radiosity_bound_w_m2);
    Stop::Bounded { residual, mean_w_m2 }
}

/// What the mean radiosity of a solution cannot reach, from what all that is emitted can make of it, W/m2.
pub(super) fn mean_radiosity_limit(mean_radiosity_bound_w_m2: f64) -> f64 {
    // A scene that is dark at all times has nothing to be measured against.
    if mean_radiosity_bound_w_m2 > 0.0 { BEYOND * mean_radiosity_bound_w_m2 } else { f64::INFINITY }
}

/// How many times as bright as it can be a solution gets before it is given up.
const BEYOND: f64 = 2.0;

/// By how much the errors of links may make a scene brighter than it can be.
const ROUNDING: f64 = 1.1;

/// What does not hold any more that certificates rest on.
#[derive(Clone, Copy, Default)]
pub(crate) struct Void {
    /// What counts as rounding changed.
    pub(crate) rounding: bool,
    /// Bodies move otherwise than was foreseen.
    pub(crate) promise: bool,
}

/// What a strategy predicts with; nothing for those that do not.
#[derive(Default)]
pub(crate) struct Prediction {
    /// Of certificates.
    pub(crate) motion_bounds: Option<MotionBounds>,
    /// Of extrapolation.
    pub(crate) lookahead: Option<Lookahead>,
}

/// A clock and the tree whose certificates it times, on their way from one time to another.
pub(crate) struct Clocked<'a> {
    /// The clock.
    pub(crate) ticks: &'a mut Ticks,
    /// The tree.
    pub(crate) tree: &'a mut PairTree,
    /// From this time, seconds.
    pub(crate) from_s: f64,
    /// To this one.
    pub(crate) to_s: f64,
}

impl Prediction {
    /// From the second of two times on; what no longer holds is taken back.
    pub(crate) fn new(
        update: Update,
        scene: &impl KnownMotion,
        clocked: Clocked<'_>,
        no_longer: Void,
    ) -> Prediction {
        let Clocked { ticks, tree, from_s, to_s } = clocked;
        let mut prediction = Prediction::default();
        if matches!(update, Update::Scratch | Update::Reinspect) {
            return prediction;
        }
        let void = ticks.go(from_s, to_s) || no_longer.promise;
        if void || no_longer.rounding {
            tree.forget_certificates();
        }
        if void {
            tree.forget_histories();
        }
        match update {
            Update::Extrapolate { frames, error } if ticks.runs() => {
                let frame_s = ticks.length_s();
                prediction.lookahead = Some(Lookahead { now_s: to_s, frame_s, frames, error });
            }
            Update::Certificate => {
                prediction.motion_bounds = Some(MotionBounds::new(scene, ticks, to_s))
            }
            _ => {}
        }
        prediction
    }
}
