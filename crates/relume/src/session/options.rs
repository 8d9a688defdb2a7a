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
    /// Limit on the engine's memory, bytes; `None` for no limit.
    pub max_memory_bytes: Option<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            tolerance: 0.02,
            oracle: Oracle::Error,
            update: Update::Scratch,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// Rebuild everything in every frame: the reference that others are checked against.
    Scratch,
}
