//! Strategies of following a motion.

/// Strategy by which the pair tree follows motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Update {
    /// Rebuild everything in every frame: the reference that others are checked against.
    Scratch,
    /// Look again at every pair that the motion since the last step may concern, and at no other.
    Reinspect,
    /// The paper's prediction, lossy: a line through the last two evaluations of each dynamic pair says
    /// in which frame its verdict changes or its occlusion begins or ends; until then its exchange area
    /// and visibility follow the line.
    Extrapolate {
        /// Frames from one evaluation to the next at most, in 1..=255. The paper's is 7.
        frames: u32,
        /// Where given, a pair is evaluated again as soon as the estimated error of X V, relative to X,
        /// could pass this; then `frames` is only the limit.
        error: Option<f64>,
    },
    /// As [`Update::Reinspect`], but pairs that the known motion cannot concern before some time are not looked at
    /// until then. The links are the same, bit for bit.
    Certificate,
}

impl Update {
    /// Checks the ranges of what it is given; what is wrong, as a sentence.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Update::Extrapolate { frames, error } = *self else { return Ok(()) };
        if !(1..=255).contains(&frames) {
            return Err(format!("extrapolate={frames}: frames ahead must be 1 to 255"));
        }
        match error.filter(|&e| !(e > 0.0 && e < 1.0)) {
            Some(error) => Err(format!(
                "the error {error} of extrapolation is not between 0 and 1: it is a relative error, such as 0.01"
            )),
            None => Ok(()),
        }
    }
}
