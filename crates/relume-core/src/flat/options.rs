//! How a scene in the plane is solved.

use crate::follow::Update;

use super::scene::SceneError;

/// Options of a solution in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatOptions {
    /// Largest form factor of a link, in (0, 1). Default 0.05.
    pub epsilon: f64,
    /// Elements up to this length are not refined, m. Default 0.02.
    pub min_length_m: f64,
    /// Whether elements are constant, as in the paper; otherwise links carry gradients. Default false.
    pub constant: bool,
    /// Residual of the solver, relative to the mean radiosity, in (0, 1). Default 1e-5.
    pub residual: f64,
    /// How the pair tree follows the motion. Default [`Update::Certificate`].
    pub update: Update,
    /// Whether every step measures row sums and energies. Default true.
    pub balance: bool,
    /// Whether every step keeps the events of its links, for [`FlatFrame::events`](super::FlatFrame::events).
    pub events: bool,
}

impl Default for FlatOptions {
    fn default() -> FlatOptions {
        FlatOptions {
            epsilon: 0.05,
            min_length_m: 0.02,
            constant: false,
            residual: 1e-5,
            update: Update::Certificate,
            balance: true,
            events: false,
        }
    }
}

/// An option out of its range, or a scene that cannot be solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OptionError {
    /// A threshold out of range.
    #[error("{0} is {1}: it must lie between 0 and 1")]
    Range(&'static str, f64),
    /// A smallest length that is negative or not finite.
    #[error("the smallest length is {0} m: it must not be negative")]
    Length(f64),
    /// A parameter of a strategy out of its range.
    #[error("{0}")]
    Update(String),
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl FlatOptions {
    pub(super) fn check(&self) -> Result<(), OptionError> {
        for (name, value) in [("epsilon", self.epsilon), ("the residual", self.residual)] {
            if !(value > 0.0 && value < 1.0) {
                return Err(OptionError::Range(name, value));
            }
        }
        if !(self.min_length_m >= 0.0 && self.min_length_m.is_finite()) {
            return Err(OptionError::Length(self.min_length_m));
        }
        self.update.check().map_err(OptionError::Update)
    }
}
