//! Which bodies came into a scene, or left it, after it was made.
//!
//! A scene with such bodies is the scene as it was made and, beside it, each inserted body by itself. What is decided on the
//! scene as a whole (its area, which patches are connected or cover each other) goes by what it was made with. Must not know
//! what is solved on it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::{BodyId, Scene};

/// Bodies that came into a scene or left it after it was made (`Scene::with_body`, `Scene::without_body`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edited {
    /// Names for the parts of each body that was inserted, also where it left again and its id is reserved.
    inserted: BTreeMap<BodyId, Range<u32>>,
    /// Bodies that are absent at all times, with all their patches.
    removed: BTreeSet<BodyId>,
}

/// Below this are the names of parts of what a scene was made with.
pub(crate) const FIRST_NAME: u32 = 1 << 31;

/// Parts that a polygon of one corner may have at most, among them its share of the hierarchy over its body.
const PARTS: usize = 8;

impl Edited {
    /// Gives names to a body that is inserted with so many corners: after those of all before it.
    pub(super) fn insert(&mut self, body: BodyId, corners: usize) {
        let before = self.inserted.range(..body).next_back();
        let start = before.map_or(FIRST_NAME, |(_, names)| names.end);
        let end = u32::try_from(corners * PARTS).ok().and_then(|count| start.checked_add(count));
        let end = end.expect("bodies of fewer than 2^28 corners are inserted");
        self.inserted.insert(body, start..end);
    }

    /// Gives a body names that others may have, too.
    pub(super) fn insert_named(&mut self, body: BodyId, names: Range<u32>) {
        self.inserted.insert(body, names);
    }

    /// Forgets the names of a body whose id is free again.
    pub(super) fn forget(&mut self, body: BodyId) {
        self.inserted.remove(&body);
    }

    /// Takes a body away, or puts it back.
    pub(super) fn set_removed(&mut self, body: BodyId, removed: bool) {
        match removed {
            true => self.removed.insert(body),
            false => self.removed.remove(&body),
        };
    }
}

impl Scene {
    /// Whether a body was inserted after the scene was made.
    pub fn is_inserted(&self, body: BodyId) -> bool {
        self.edited.inserted.contains_key(&body)
    }

    /// Whether a body was removed after the scene was made. Its patches stay, and are absent.
    pub fn is_removed(&self, body: BodyId) -> bool {
        self.edited.removed.contains(&body)
    }

    /// Whether there is a body of this id with patches, at some time or by hand.
    pub(crate) fn has_body(&self, body: BodyId) -> bool {
        let found = self.bodies.get(body.0 as usize);
        found.is_some_and(|found| !found.patches.is_empty()) && !self.is_removed(body)
    }

    /// Names for the parts of a body that was inserted: no others of the scene have them, whatever else comes or goes.
    pub(crate) fn names_of(&self, body: BodyId) -> Option<&Range<u32>> {
        self.edited.inserted.get(&body)
    }

    /// Bodies that were inserted, in the order of their names; of those that share names the one that stays first.
    pub(crate) fn inserted_bodies(&self) -> Vec<BodyId> {
        let there = |body: &BodyId| !self.bodies[body.0 as usize].patches.is_empty();
        let mut out: Vec<BodyId> = self.edited.inserted.keys().copied().filter(there).collect();
        out.sort_by_key(|body| (self.edited.inserted[body].start, *body));
        out
    }

    /// Bodies that were removed, ascending.
    pub(crate) fn removed_bodies(&self) -> impl Iterator<Item = BodyId> + '_ {
        self.edited.removed.iter().copied()
    }
}
