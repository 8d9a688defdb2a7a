//! What a follower asks of the space that it follows.

use crate::element::{ElementId, Renumbering};
use crate::pair::{Changes, Judge, PairId, PairTree};
use crate::solver::{Dirty, Radiosity, Surfaces};

use super::follower::{Follower, Why};
use super::links::Receivers;
use super::prediction::{Clocked, Prediction};
use super::report::{Energy, FrameReport, RowSumError};
use super::update::Update;

/// How far pairs are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// Down to the coarse elements.
    Coarse,
    /// Down to the links.
    Fine,
}

/// What pairs may feel of a motion: what lies behind, and what is known of what lies ahead.
pub(crate) struct Motion<'m, Change> {
    /// What happened since the last frame; `None` in a cold build.
    pub(crate) change: Option<&'m Change>,
    /// What is predicted with.
    pub(crate) prediction: &'m Prediction,
}

/// Where the flux of a solution goes.
pub(crate) struct Balance {
    /// How far row sums are from 1.
    pub(crate) rows: RowSumError,
    /// What is emitted, absorbed and lost.
    pub(crate) energy: Energy,
    /// Names of surfaces, where the balance is off.
    pub(crate) suspects: Vec<String>,
}

/// The part of a solved state that knows where things are: elements, their places, what they emit and reflect.
///
/// Every method that takes a goal is asked within one frame, in the order in which they stand here.
pub(crate) trait Space: Sized + Send {
    /// What a frame leads to, and what it is solved with.
    type Goal<'g>: Sync;
    /// What was before the frame.
    type Was: Sync;
    /// The difference between what was and what is, as pairs feel it.
    type Change<'m>: Sync
    where
        Self: 'm;
    /// What decides on pairs.
    type Judge<'j>: Judge
    where
        Self: 'j;
    /// The elements.
    type Forest: Receivers;
    /// The elements with their light.
    type LitSurfaces<'l>: Surfaces
    where
        Self: 'l;

    /// The node of the forest that holds all.
    const ROOT: ElementId;

    // Before a frame.

    /// Elements as a cold build begins with them.
    fn unsolved(goal: &Self::Goal<'_>) -> Self;
    /// Whether this is what the goal asks for.
    fn is_at(&self, goal: &Self::Goal<'_>) -> bool;
    /// Takes over the goal's promises where nothing else differs. Whether bodies move as they promised before.
    fn stay(&mut self, goal: &Self::Goal<'_>) -> bool;
    /// Is told that a frame was left half-way: what is kept with a pair may be of either of its instants.
    fn stop(&mut self) {}
    /// Whether nothing but the clip moves anything since the last frame, so that links may be extrapolated on.
    fn goes_on(&self, goal: &Self::Goal<'_>) -> bool;

    // Move.

    /// Goes where the goal says; what was before.
    fn go(&mut self, goal: &Self::Goal<'_>) -> Self::Was;
    /// What differs.
    fn change<'m>(&self, goal: &Self::Goal<'_>, was: &'m Self::Was) -> Self::Change<'m>;
    /// What is predicted with from here on.
    fn prediction(
        &self,
        goal: &Self::Goal<'_>,
        was: &Self::Was,
        update: Update,
        clocked: Clocked<'_>,
    ) -> Prediction;

    // Coarse and fine.

    /// What may stand between any two elements.
    fn candidates(goal: &Self::Goal<'_>) -> Vec<u32>;
    /// What decides on pairs, down to a level.
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
    /// Follows the coarse pairs with the coarse solution; what of it changed is added to `change`.
    fn weigh(
        &mut self,
        _goal: &Self::Goal<'_>,
        _was: &Self::Was,
        _changes: &Changes,
        _change: Option<&mut Self::Change<'_>>,
    ) {
    }

    // Edit.

    /// Links that are made anew although no verdict on them changed.
    fn remade(&self, _was: &Self::Was, _tree: &PairTree) -> Vec<PairId> {
        Vec::new()
    }
    /// The elements.
    fn forest(&self) -> &Self::Forest;
    /// Removes elements that no pair is refined on any more; how many.
    fn reap(&mut self) -> u64;
    /// Elements whose children came or went since this was asked last.
    fn take_changed(&mut self) -> Vec<u32>;
    /// A solution to begin with.
    fn first_guess(&self, goal: &Self::Goal<'_>, surfaces: &Self::LitSurfaces<'_>) -> Radiosity;
    /// Works out links that end on groups; `apart` are those that were looked at again, `None` in a cold build.
    fn place_groups(
        &mut self,
        _goal: &Self::Goal<'_>,
        _was: &Self::Was,
        _tree: &PairTree,
        _apart: Option<Vec<(ElementId, ElementId)>>,
    ) {
    }
    /// Adds what emits or reflects otherwise than before. Whether sources that are no surfaces do, or what is distant.
    fn add_dirty(&self, _goal: &Self::Goal<'_>, _was: &Self::Was, _dirty: &mut Dirty) -> bool {
        false
    }

    // Solve.

    /// The elements with their light; with places worked out beforehand if most of them are to be gathered.
    fn surfaces(&self, goal: &Self::Goal<'_>, everywhere: bool) -> Self::LitSurfaces<'_>;
    /// Gives sources that are no surfaces what they send.
    fn set_sources(
        &self,
        _goal: &Self::Goal<'_>,
        _surfaces: &Self::LitSurfaces<'_>,
        _light: &mut Radiosity,
    ) {
    }
    /// The solution, where nothing emits.
    fn if_dark(&self, goal: &Self::Goal<'_>, surfaces: &Self::LitSurfaces<'_>)
    -> Option<Radiosity>;
    /// Residual to solve to, relative to the mean radiosity.
    fn residual(goal: &Self::Goal<'_>, is_cold: bool) -> f64;
    /// The mean radiosity that the space cannot pass at any time, W/m2, whatever hides what.
    fn mean_radiosity_bound_w_m2(goal: &Self::Goal<'_>) -> f64;
    /// How many times as much is emitted as when [`Space::finish`] was told last of a solution without extrapolated links.
    fn brightened(&self, _goal: &Self::Goal<'_>) -> f64 {
        1.0
    }
    /// Is told that a solution was found, and whether without extrapolated links.
    fn finish(&mut self, _is_settled: bool) {}

    // Tally.

    /// Gives back room of elements that are gone; new ids, if they changed.
    fn compact(&mut self) -> Option<Renumbering> {
        None
    }
    /// Gives back room beyond a small reserve.
    fn trim(&mut self) {}
    /// Fills in numbers of elements.
    fn count(&self, tree: &PairTree, report: &mut FrameReport);
    /// Row sums and energies: a pass over all links and elements.
    fn balance(state: &Follower<Self>) -> Balance;
    /// Links with an end that is elsewhere, against the other, than in the frame before.
    fn dynamic_links(&self, goal: &Self::Goal<'_>, tree: &PairTree) -> u64;
    /// Whether a solution can be one.
    fn check(_goal: &Self::Goal<'_>, _state: &Follower<Self>) -> Result<(), Why> {
        Ok(())
    }

    /// Bytes of what grows with the pairs; of what grows with the elements; of the rest.
    fn bytes(&self) -> [u64; 3];
}
