//! The interface between the frame loop and a space: polygons in space, or segments in the plane.

use crate::element::{ElementId, Renumbering};
use crate::pair::{Changes, CoarseLink, Judge, PairId, PairTree};
use crate::solver::{Dirty, Radiosity, Surfaces};

use super::follower::{Follower, Why};
use super::links::Receivers;
use super::prediction::{Clocked, Prediction};
use super::report::{Energy, FrameReport, RowSumError};
use super::update::Update;

/// Level down to which pairs are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// Down to the coarse elements.
    Coarse,
    /// Down to the links.
    Fine,
}

/// Motion as pairs see it: the change since the last frame, and the prediction.
pub(crate) struct Motion<'m, Change> {
    /// Change since the last frame; `None` in a cold build.
    pub(crate) change: Option<&'m Change>,
    /// Prediction from this frame on.
    pub(crate) prediction: &'m Prediction,
}

/// Row sums and flux balance of a solution.
pub(crate) struct Balance {
    /// Distance of row sums from 1.
    pub(crate) rows: RowSumError,
    /// Flux emitted, absorbed and escaped.
    pub(crate) energy: Energy,
    /// Names of the surfaces where the balance is off.
    pub(crate) suspects: Vec<String>,
}

/// The geometric part of a solved state: elements, their places, their emission and reflectance.
///
/// Methods that take a goal are called within one frame, in the order in which they stand here.
pub(crate) trait Space: Sized + Send {
    /// World and options that a frame leads to.
    type Goal<'g>: Sync;
    /// State before the frame, as far as later phases need it.
    type Was: Sync;
    /// Difference between the state before and now.
    type Change<'m>: Sync
    where
        Self: 'm;
    /// Judge of pairs.
    type Judge<'j>: Judge
    where
        Self: 'j;
    /// The elements.
    type Forest: Receivers;
    /// Elements with exitance and reflectance, for the solver.
    type LitSurfaces<'l>: Surfaces
    where
        Self: 'l;

    /// Root node of the forest.
    const ROOT: ElementId;

    // Before a frame.

    /// State with the elements that a cold build begins with, and no solution.
    fn unsolved(goal: &Self::Goal<'_>) -> Self;
    /// Whether this state is that of the goal.
    fn is_at(&self, goal: &Self::Goal<'_>) -> bool;
    /// Takes over the goal's promises of motion, where nothing else differs. Returns whether they equal those before.
    fn stay(&mut self, goal: &Self::Goal<'_>) -> bool;
    /// Called when a frame was left half-way: data kept with pairs may belong to either of its two instants.
    fn stop(&mut self) {}
    /// Whether nothing but the clip moves anything since the last frame, so that links may be extrapolated on.
    fn goes_on(&self, goal: &Self::Goal<'_>) -> bool;

    // Move.

    /// Moves to the goal; returns the state before.
    fn go(&mut self, goal: &Self::Goal<'_>) -> Self::Was;
    /// Difference from the state before.
    fn change<'m>(&self, goal: &Self::Goal<'_>, was: &'m Self::Was) -> Self::Change<'m>;
    /// Prediction from the goal on.
    fn prediction(
        &self,
        goal: &Self::Goal<'_>,
        was: &Self::Was,
        update: Update,
        clocked: Clocked<'_>,
    ) -> Prediction;

    // Coarse and fine.

    /// Candidate occluders of the root pair.
    fn candidates(goal: &Self::Goal<'_>) -> Vec<u32>;
    /// Judge of pairs, down to a level.
    fn judge<'j>(
        &'j mut self,
        goal: &'j Self::Goal<'_>,
        level: Level,
        motion: &Motion<'j, Self::Change<'_>>,
    ) -> Self::Judge<'j>;
    /// Whether verdicts weigh by a coarse solution.
    fn has_coarse(_goal: &Self::Goal<'_>) -> bool {
        false
    }
    /// Updates the coarse solution from the changed coarse pairs; adds changes of brightness to `change`.
    fn weigh(
        &mut self,
        _goal: &Self::Goal<'_>,
        _was: &Self::Was,
        _changes: &Changes,
        _change: Option<&mut Self::Change<'_>>,
    ) {
    }

    // Edit.

    /// Removes coarse links that were set in a frame which then failed; the frame that leads back sets those of the last solution again.
    fn forget_coarse_links(&mut self, _goal: &Self::Goal<'_>, _links: &[CoarseLink]) {}
    /// Links to be set again although no verdict on them changed.
    fn remade(&self, _was: &Self::Was, _tree: &PairTree) -> Vec<PairId> {
        Vec::new()
    }
    /// The elements.
    fn forest(&self) -> &Self::Forest;
    /// Removes elements that no pair is refined on any more; returns their number.
    fn reap(&mut self) -> u64;
    /// Elements whose children came or went since the last call.
    fn take_changed(&mut self) -> Vec<u32>;
    /// Initial solution.
    fn first_guess(&self, goal: &Self::Goal<'_>, surfaces: &Self::LitSurfaces<'_>) -> Radiosity;
    /// Evaluates links that end on groups, facet by facet; `apart` are those that were judged again, `None` in a cold build.
    fn place_groups(
        &mut self,
        _goal: &Self::Goal<'_>,
        _was: &Self::Was,
        _tree: &PairTree,
        _apart: Option<Vec<(ElementId, ElementId)>>,
    ) {
    }
    /// Adds elements with changed exitance or reflectance. Returns whether punctual lights or distant elements changed.
    fn add_dirty(&self, _goal: &Self::Goal<'_>, _was: &Self::Was, _dirty: &mut Dirty) -> bool {
        false
    }

    // Solve.

    /// Elements with exitance and reflectance; with places computed beforehand if most of them are to be gathered.
    fn surfaces(&self, goal: &Self::Goal<'_>, everywhere: bool) -> Self::LitSurfaces<'_>;
    /// Sets the radiosity of sources that are no surfaces.
    fn set_sources(
        &self,
        _goal: &Self::Goal<'_>,
        _surfaces: &Self::LitSurfaces<'_>,
        _light: &mut Radiosity,
    ) {
    }
    /// The solution where nothing emits; else `None`.
    fn if_dark(&self, goal: &Self::Goal<'_>, surfaces: &Self::LitSurfaces<'_>)
    -> Option<Radiosity>;
    /// Residual to solve to, relative to the mean radiosity.
    fn residual(goal: &Self::Goal<'_>, is_cold: bool) -> f64;
    /// Whether the sums of form factors from leaves are off by errors of links alone: not with the paper's oracle.
    fn rows_are_close(_goal: &Self::Goal<'_>) -> bool {
        true
    }
    /// Upper bound of the mean radiosity at any time, W/m2, whatever the visibilities.
    fn mean_radiosity_bound_w_m2(goal: &Self::Goal<'_>) -> f64;
    /// Emitted flux relative to that of the last exact solution ([`Space::finish`] with `is_settled`): 1.
    fn brightened(&self, _goal: &Self::Goal<'_>) -> f64 {
        1.0
    }
    /// Called when a solution was found; `is_settled` if no link is extrapolated.
    fn finish(&mut self, _is_settled: bool) {}

    // Tally.

    /// Frees the storage of removed elements; new ids, if they changed.
    fn compact(&mut self) -> Option<Renumbering> {
        None
    }
    /// Frees spare capacity beyond a small reserve.
    fn trim(&mut self) {}
    /// Fills in numbers of elements.
    fn count(&self, tree: &PairTree, report: &mut FrameReport);
    /// Row sums and energies: a pass over all links and elements.
    fn balance(state: &Follower<Self>) -> Balance;
    /// Links of which one end moved against the other since the frame before.
    fn dynamic_links(&self, goal: &Self::Goal<'_>, tree: &PairTree) -> u64;
    /// Checks that a solution is plausible.
    fn check(_goal: &Self::Goal<'_>, _state: &Follower<Self>) -> Result<(), Why> {
        Ok(())
    }

    /// Bytes that grow with the pairs, bytes that grow with the elements, and the rest.
    fn bytes(&self) -> [u64; 3];
}
