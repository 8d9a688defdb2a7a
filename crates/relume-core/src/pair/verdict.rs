//! Verdicts on pairs, and what may make a verdict stale.

use super::carried::Carried;
use super::margin::Margin;
use super::tree::CullReason;
use crate::transport::Side;

/// Decision on a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The pair becomes a link.
    Link,
    /// One side is replaced by its children.
    Refine(Side),
    /// A cluster paired with itself: all pairs of its children.
    RefineSelf,
    /// The pair exchanges nothing.
    Cull(CullReason),
    /// The pair is a link of the coarse solution: it keeps its state, and is reported in [`Changes::coarse_links`](super::Changes::coarse_links).
    CoarseLink,
}

/// A verdict with the values of the pair.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Values of the pair as a link, or as a coarse link.
    pub carried: Carried,
    /// Change of brightness up to which the verdict stands.
    pub margin: Margin,
    /// Visibility segments traced.
    pub segments: u32,
}

/// Part of a pair that may have changed since it was judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stale {
    /// Nothing of the pair, and nothing of any pair below it.
    Nothing,
    /// Nothing of the pair itself; perhaps something of a pair below it.
    Below,
    /// The brightness of its ends: perhaps its verdict, not its values.
    Brightness,
    /// The occluders between its ends.
    Occlusion,
    /// The places of its ends; a certificate says that nothing stands between them.
    Followed,
    /// Its extrapolated values, which are due for evaluation.
    Due,
    /// The places of its ends.
    Moved,
    /// How it is decided on: an end became a group or a coarse element, or ceased to be.
    Regrouped,
    /// Everything: the pair has not been judged yet.
    New,
}
