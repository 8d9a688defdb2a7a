//! What a user may choose about a solution.

/// How a scene is solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Relative error of irradiance aimed at (RMS), in (0, 1). Default 0.02.
    pub tolerance: f64,
    /// What decides whether a pair becomes a link.
    pub oracle: Oracle,
    /// How the pair tree follows the motion.
    pub update: Update,
    /// Whether groups of small patches of one rigid body may be ends of links, where there are many such patches: with the
    /// error oracle alone. Default true. Tables of form factors go without.
    pub groups: bool,
    /// Whether every step measures row sums and energies: a pass over all links, whatever moved.
    pub balance: bool,
    /// Whether every step keeps the events of its links, for [`Session::events`](super::Session::events).
    pub events: bool,
    /// Limit on the engine's memory, bytes; `None` for no limit.
    pub max_memory_bytes: Option<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            tolerance: 0.02,
            oracle: Oracle::Error,
            update: Update::Certificate,
            groups: true,
            balance: true,
            events: false,
            max_memory_bytes: None,
        }
    }
}

/// What decides on a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oracle {
    /// The default: an estimate of the irradiance error that the link causes on its receivers.
    Error,
    /// The paper's: a link where the form factor is below `epsilon`, elements never smaller than
    /// `min_area_m2`.
    FormFactor {
        /// Largest form factor of a link.
        epsilon: f64,
        /// Elements below this area are not refined, m2.
        min_area_m2: f64,
    },
}

/// How the pair tree follows the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
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

impl Options {
    /// Checks every range.
    pub(super) fn validate(&self) -> Result<(), super::SessionError> {
        let fail = |text: String| Err(super::SessionError::Option(text));
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return fail(format!(
                "tolerance {} is not between 0 and 1: it is a relative error, such as 0.02",
                self.tolerance
            ));
        }
        if let Update::Extrapolate { frames, error } = self.update {
            if !(1..=255).contains(&frames) {
                return fail(format!("extrapolate={frames}: frames ahead must be 1 to 255"));
            }
            if let Some(error) = error.filter(|&e| !(e > 0.0 && e < 1.0)) {
                return fail(format!(
                    "the error {error} of extrapolation is not between 0 and 1: it is a relative error, such as 0.01"
                ));
            }
        }
        if let Oracle::FormFactor { epsilon, min_area_m2 } = self.oracle
            && !(epsilon > 0.0 && epsilon < 1.0 && min_area_m2 >= 0.0)
        {
            return fail(format!(
                "form-factor={epsilon},{min_area_m2}: the form factor must lie between 0 and 1 and the area must not be negative"
            ));
        }
        Ok(())
    }

    /// The oracle in the pair tree's terms.
    pub(super) fn pair_oracle(&self) -> crate::pair::Oracle {
        match self.oracle {
            Oracle::Error => {
                crate::pair::Oracle::Error { threshold: self.tolerance * super::LINK_SHARE }
            }
            Oracle::FormFactor { epsilon, min_area_m2 } => {
                crate::pair::Oracle::FormFactor { epsilon, min_area_m2 }
            }
        }
    }
}
