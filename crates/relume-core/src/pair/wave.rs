//! Waves of an update: pairs to be visited, with lists of candidate occluders that many pairs share.

use std::collections::BTreeMap;

use crate::element::ElementId;

use super::tree::{PairId, PairTree, State};

/// Pairs to be visited, with the candidate occluders of their parents.
#[derive(Clone, Debug, Default)]
pub(super) struct Wave {
    pub(super) items: Vec<Item>,
    pub(super) candidates: Vec<u32>,
    /// Lists handed on unchanged from the wave before, by their start there.
    handed_on: BTreeMap<u32, List>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) pair: PairId,
    pub(super) list: List,
}

impl Item {
    /// Whether an earlier edit of the same wave removed the pair. Only pairs that are due can have an ancestor in their wave.
    pub(super) fn is_gone(&self, tree: &PairTree, ends: (ElementId, ElementId)) -> bool {
        tree.state(self.pair) == State::Vacant || tree.ends(self.pair) != ends
    }
}

/// Range of the candidates of a wave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct List {
    start: u32,
    len: u32,
}

impl Wave {
    pub(super) fn push_candidates(&mut self, list: &[u32]) -> List {
        let start = self.candidates.len() as u32;
        self.candidates.extend_from_slice(list);
        List { start, len: list.len() as u32 }
    }

    /// Takes over a list of the wave before: once, however many pairs have it in common.
    pub(super) fn hand_on(&mut self, list: List, before: &Wave) -> List {
        match (list, self.handed_on.get(&list.start)) {
            (List::CLEAR, _) => list,
            (_, Some(&known)) if list.len > 0 => known,
            _ => {
                let here = self.push_candidates(list.of(&before.candidates));
                if list.len > 0 {
                    self.handed_on.insert(list.start, here);
                }
                here
            }
        }
    }

    /// Without the room that is kept to grow into, as [`PairTree::used_bytes`].
    pub(super) fn used_bytes(&self) -> u64 {
        let lists = self.handed_on.len() * size_of::<(u32, List)>();
        (self.items.len() * size_of::<Item>() + self.candidates.len() * 4 + lists) as u64
    }
}

impl List {
    /// No candidates, by the certificate of a pair above.
    pub(super) const CLEAR: List = List { start: u32::MAX, len: 0 };

    pub(super) fn from_start(start: usize, candidates: &[u32]) -> List {
        List { start: start as u32, len: (candidates.len() - start) as u32 }
    }

    pub(super) fn of(self, candidates: &[u32]) -> &[u32] {
        match self.len {
            0 => &[],
            len => &candidates[self.start as usize..(self.start + len) as usize],
        }
    }
}

/// The candidates of the children of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) enum Below {
    /// The candidates of the pair itself: nearly all of them are left.
    Same,
    /// A list of its own in the chunk.
    Own(List),
}

impl Below {
    /// Eighths of the parent's candidates from which a list is shared, not copied: in a heap of slivers every shaft contains
    /// nearly all candidates, and copies would be most of the memory.
    const MOST: usize = 7;

    /// The list at the end of `narrowed` if it is short against the one that it was found in.
    pub(super) fn of(above: List, start: usize, narrowed: &mut Vec<u32>) -> Below {
        let (all, left) = (above.len as usize, narrowed.len() - start);
        if left > 0 && left <= all && 8 * left >= Below::MOST * all {
            narrowed.truncate(start);
            return Below::Same;
        }
        Below::Own(List::from_start(start, narrowed))
    }
}
