//! Memory that follows the present state, not the largest one met: vacant room is given back.
//!
//! Ids of elements and pairs change here and nothing else does: names, verdicts, the hash and
//! radiosities do not depend on ids.

use super::Solved;

/// Share of the elements' room that may be vacant: an element takes more than a hundred bytes of the
/// 128 it may take.
///
/// Putting everything together is a pass over all pairs, some nanoseconds each; at least as many
/// elements as this share, with all their pairs, have gone since the last such pass, and every one of
/// those pairs cost a judgement (a microsecond or so).
const VACANT_ELEMENTS: usize = 32;

/// Share of the pairs' room that may be vacant.
const VACANT_PAIRS: usize = 16;

impl Solved {
    /// Puts elements and pairs together where much room is vacant, and gives back what is left over.
    pub(super) fn compact(&mut self) {
        if self.forest.vacant_len() * VACANT_ELEMENTS > self.forest.len() {
            let to = self.forest.compact();
            self.links.renumber(&to);
            self.groups.renumber(&to);
            self.radiosity.renumber(&to);
            self.tree.renumber(&to);
        }
        if self.tree.vacant_len() * VACANT_PAIRS > self.tree.len() {
            self.tree.compact();
        }
        self.forest.trim();
        self.tree.trim();
        self.links.trim();
        self.radiosity.trim();
    }
}
