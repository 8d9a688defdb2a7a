//! Prediction of a frame: certificates or extrapolation, by strategy.

use crate::pair::PairTree;
use crate::predict::{KnownMotion, Lookahead, MotionBounds, Ticks};
use crate::solver::Stop;

use super::tuning::{DIVERGENCE_RATIO, GROWTH_MAX, LINK_ERROR_RATIO};
use super::update::Update;

/// Stop criterion of a solve over extrapolated links: it is given up where the mean radiosity passes that of the last exact
/// solution, or the bound of the scene, by a factor. Mean radiosities, W/m2.
pub(super) fn while_extrapolated(
    residual: f64,
    last_exact_mean_w_m2: f64,
    mean_radiosity_bound_w_m2: f64,
) -> Stop {
    let mean_w_m2 =
        (GROWTH_MAX * last_exact_mean_w_m2).min(LINK_ERROR_RATIO * mean_radiosity_bound_w_m2);
    Stop::Bounded { residual, mean_w_m2 }
}

/// Mean radiosity from which a solve is given up, W/m2, from the upper bound of the scene.
pub(super) fn mean_radiosity_limit(mean_radiosity_bound_w_m2: f64) -> f64 {
    // A scene that is dark at all times has nothing to be measured against.
    if mean_radiosity_bound_w_m2 > 0.0 {
        DIVERGENCE_RATIO * mean_radiosity_bound_w_m2
    } else {
        f64::INFINITY
    }
}

/// Assumptions of certificates that no longer hold.
#[derive(Clone, Copy, Default)]
pub(crate) struct Void {
    /// The size of rounding errors changed.
    pub(crate) rounding: bool,
    /// Bodies move otherwise than predicted.
    pub(crate) promise: bool,
}

/// Prediction of a strategy; both `None` for strategies without one.
#[derive(Default)]
pub(crate) struct Prediction {
    /// Bounds of motion, for certificates.
    pub(crate) motion_bounds: Option<MotionBounds>,
    /// Settings of extrapolation.
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
    /// Prediction from the second of two times on; voided certificates and histories are removed from the tree.
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
