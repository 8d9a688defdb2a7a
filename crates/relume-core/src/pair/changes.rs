//! Result of an update: counts of its work, edits to the links, events.

use serde::Serialize;

use crate::element::{ElementId, ElementKey};

use super::carried::Carried;
use super::tree::PairId;

/// Exact counts of the work of an update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Work {
    /// Pairs visited on the walk, unaffected ones included.
    pub visited: u64,
    /// Pairs judged, each counted once.
    pub examined: u64,
    /// Pairs with moved ends of which only the exchange area was evaluated: a certificate says that nothing stands between
    /// the ends.
    pub followed: u64,
    /// Links of which X and V were extrapolated.
    pub extrapolated: u64,
    /// Pairs skipped, with their subtrees, because their certificate stands.
    pub certified: u64,
    /// Pairs judged for the coarse solution before; each is visited again.
    pub coarse_examined: u64,
    /// Examined pairs that were judged because an end moved against the other, or for the first time.
    pub reevaluated: u64,
    /// Examined pairs of which only the visibility may have changed.
    pub visibility_only: u64,
    /// Examined pairs of which only the brightness of their ends may have changed.
    pub brightness_only: u64,
    /// Pairs whose state, or what they carry as a link, differs from before.
    pub changed: u64,
    /// Refined pairs that became links.
    pub promoted: u64,
    /// Links that were refined.
    pub demoted: u64,
    /// Links whose visibility changed.
    pub occlusion_changed: u64,
    /// Links with an end that moved against the other.
    pub dynamic_links: u64,
    /// Visibility segments traced.
    pub segments: u64,
    /// Elements made.
    pub elements_made: u64,
}

impl Work {
    /// Adds the update with the oracle to the update down to the coarse level. Visits and judgements are those of the second
    /// update, which visits every pair of the first again; edits are the sum of both.
    pub(crate) fn add_after_coarse(&mut self, other: Work) {
        self.coarse_examined = self.examined;
        self.visited = other.visited;
        self.examined = other.examined;
        self.followed = other.followed;
        self.certified = other.certified;
        self.extrapolated = other.extrapolated;
        self.reevaluated = other.reevaluated;
        self.visibility_only = other.visibility_only;
        self.brightness_only = other.brightness_only;
        self.changed += other.changed;
        self.promoted += other.promoted;
        self.demoted += other.demoted;
        self.occlusion_changed += other.occlusion_changed;
        self.dynamic_links += other.dynamic_links;
        self.segments += other.segments;
        self.elements_made += other.elements_made;
    }
}

/// One edit to the set of links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edit {
    /// A pair is a link with new values.
    Set(PairId),
    /// Two elements are no longer linked.
    Removed(ElementId, ElementId),
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Links below a refined pair became one link.
    Promoted,
    /// A link became refined.
    Demoted,
    /// The visibility of a link fell.
    Occluded,
    /// The visibility of a link rose.
    Revealed,
    /// A pair was culled: its ends no longer face each other, or one of them vanished.
    Culled,
    /// A culled pair came back: its ends face each other again.
    Woken,
}

/// An event of a link, by the names of its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkEvent {
    /// Kind of the event.
    pub kind: EventKind,
    /// Both ends.
    pub ends: (ElementKey, ElementKey),
    /// Values before; `None` where the pair was no link.
    pub before: Option<Carried>,
    /// Values after; `None` where the pair is no link.
    pub after: Option<Carried>,
}

/// Records that an update keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Edits to the links.
    pub edits: bool,
    /// Events of the links.
    pub events: bool,
}

/// A link of the coarse solution, with its values.
#[derive(Clone, Copy, Debug)]
pub struct CoarseLink {
    /// First end.
    pub a: ElementId,
    /// Second end.
    pub b: ElementId,
    /// Values of the link.
    pub carried: Carried,
}

/// Result of an update.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Counts.
    pub work: Work,
    /// Edits to the links, in order; empty where they are not recorded.
    pub edits: Vec<Edit>,
    /// Events of links that were there before or are there now, in order; empty where they are not
    /// recorded. What is made or removed below a refined pair is not among them.
    pub events: Vec<LinkEvent>,
    /// Newly refined pairs, ascending; empty where edits are not recorded.
    pub refined: Vec<PairId>,
    /// Coarse links that were judged.
    pub coarse_links: Vec<CoarseLink>,
    /// Pairs that may have lost their coarse link; both ends may have vanished since.
    pub dropped_coarse_links: Vec<(ElementId, ElementId)>,
    /// Links of groups ([`Judge::is_apart`](super::Judge::is_apart)) of which more than the brightness was evaluated; empty where edits are not
    /// recorded.
    pub apart: Vec<(ElementId, ElementId)>,
}
