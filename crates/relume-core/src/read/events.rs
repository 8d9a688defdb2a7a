//! Link events as a user reads them.

use std::collections::BTreeMap;

use crate::element::ElementKey;
use crate::pair::Carried;
use crate::space::Solved;

use super::names::{ElementName, name_of};

pub use crate::pair::EventKind;

/// Change of a link: promoted, demoted or occluded (Forsyth et al. 1995), or that two elements came to face each other or no
/// longer do.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// What happened.
    pub kind: EventKind,
    /// One end; every link carries light both ways.
    pub receiver: ElementName,
    /// The other.
    pub source: ElementName,
    /// Exchange area without occlusion (m2) and visibility before; `None` where there was no link.
    pub before: Option<(f32, f32)>,
    /// Exchange area without occlusion (m2) and visibility after; `None` where there is no link.
    pub after: Option<(f32, f32)>,
}

/// The events of the last step, with names.
pub(super) fn named(solved: &Solved) -> Vec<Event> {
    let whole =
        |facet| name_of(&solved.space.scene, &solved.space.forest, ElementKey { facet, path: 1 });
    with_names(&solved.events, &whole)
}

/// Events with names, from those of the facets.
pub(crate) fn with_names(
    events: &[crate::pair::LinkEvent],
    whole: &dyn Fn(u32) -> ElementName,
) -> Vec<Event> {
    let mut facets: BTreeMap<u32, ElementName> = BTreeMap::new();
    let mut name =
        |key: ElementKey| facets.entry(key.facet).or_insert_with(|| whole(key.facet)).at(key.path);
    let numbers = |c: Carried| (c.exchange_area_m2, c.visibility());
    let event = |e: &crate::pair::LinkEvent| Event {
        kind: e.kind,
        receiver: name(e.ends.0),
        source: name(e.ends.1),
        before: e.before.map(numbers),
        after: e.after.map(numbers),
    };
    events.iter().map(event).collect()
}
