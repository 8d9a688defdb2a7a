//! The interface between the pair tree and the space of its elements: hierarchy and judge.

use std::ops::Range;

use crate::element::{ElementId, ElementKey};
use crate::predict::{Lookahead, Tick};

use super::carried::Carried;
use super::certificate_tests::Finding;
use super::margin::Margin;
use super::verdict::{Judgement, Stale};

/// Hierarchy of the elements that are ends of pairs.
pub trait Hierarchy {
    /// Ids of the children; empty for a leaf.
    fn children(&self, id: ElementId) -> Range<u32>;
    /// The children, and whether they were made by this call. Each call counts as a use of the children, until
    /// [`Hierarchy::release`].
    fn split(&mut self, id: ElementId) -> (Range<u32>, bool);
    /// Takes back one use of the children.
    fn release(&mut self, id: ElementId);
    /// Name of an element; independent of history.
    fn key(&self, id: ElementId) -> ElementKey;
    /// Elements alive.
    fn element_count(&self) -> usize;
}

/// Questions of the pair tree to the space that its elements are in.
pub trait Judge: Hierarchy + Sync {
    /// Verdict on a pair. `candidates` are the candidate occluders of its parent pair; the candidates of this pair are
    /// appended to `narrowed`, whose present content belongs to other pairs. `known` are the values of a link of which only
    /// the brightness changed. The verdict is a pure function of the space: it does not depend on which candidates were
    /// given, as long as no occluder is missing.
    fn judge(
        &self,
        ends: (ElementId, ElementId),
        known: Option<&Carried>,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement;

    /// Rest of a pair's margin after the changes of brightness since the last update; `None` if the verdict may have
    /// changed.
    fn withstands(&self, a: ElementId, b: ElementId, margin: Margin) -> Option<Margin>;

    /// Part of a pair that may have changed since the last update. `certified` says that a certificate stands: unless the
    /// pair is culled, nothing has come or gone between its ends.
    fn stale(&self, a: ElementId, b: ElementId, certified: bool) -> Stale;

    /// Refreshes the candidate occluders of a refined pair with ends at rest: appends them to `narrowed`. Returns false if
    /// the verdict depends on visibility; the pair must then be judged.
    fn narrow(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> bool;

    /// Whether the brightness of an end changed and the verdict on the pair depends on brightness.
    fn brightness_changed(&self, a: ElementId, b: ElementId) -> bool;

    /// Whether a certificate that expires after `until` stands at this instant.
    fn certified(&self, until: Tick) -> bool;

    /// Settings of extrapolation; `None` where pairs are not extrapolated.
    fn lookahead(&self) -> Option<&Lookahead>;

    /// Whether [`Finding::Clear`] may be certified for a refined pair with these candidate occluders.
    fn may_be_clear(&self, _a: ElementId, _b: ElementId, narrowed: &[u32]) -> bool {
        narrowed.is_empty()
    }

    /// Expiry of a certificate: the last tick until which the known motion cannot change a finding on a pair; 0 if none.
    fn expiry(&self, a: ElementId, b: ElementId, finding: Finding) -> Tick;

    /// Whether this pair is a coarse link unless it is culled.
    fn is_coarse_pair(&self, a: ElementId, b: ElementId) -> bool;

    /// Whether a link between these two ends is evaluated facet by facet (groups), so that judged pairs must be recorded in
    /// [`Changes::apart`](super::Changes::apart).
    fn is_apart(&self, _a: ElementId, _b: ElementId) -> bool {
        false
    }
}
