//! Verdicts on pairs in space: exchange area and visibility of a pair, by `transport`, and what the oracle makes of them.
//!
//! `by_kind` hands a pair on by the kinds of its ends; `sight` says how visibility is found.

mod by_kind;
mod clusters;
mod elements;
mod errors;
mod lights;
mod places;
mod sight;
mod space_judge;
mod unoccluded;

pub use space_judge::{SpaceJudge, Stage};
pub(super) use space_judge::{culled, passing};
