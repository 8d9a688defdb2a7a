//! Batches of facets, and the paths from facets down to changed elements.

use super::field::Linear;
use super::surfaces::Surfaces;

/// Facets that go together: consecutive ones.
#[derive(Default)]
pub(super) struct Batch {
    pub(super) facets: Vec<u32>,
    /// Receivers to be gathered and then settled with their subtrees; after gathering, only those that cannot wait.
    pub(super) receivers: Vec<u32>,
    /// Change of the gathered irradiance of each receiver, W/m2 and per metre; empty before gathering, or where everything is
    /// settled.
    pub(super) changes: Vec<Linear>,
    /// Further elements to be settled with their subtrees.
    pub(super) parents: Vec<u32>,
}

/// Sets a bit; returns whether it was set already.
pub(super) fn set_bit(bits: &mut [u64], id: u32) -> bool {
    let (word, bit) = (&mut bits[id as usize / 64], 1 << (id % 64));
    let before = *word & bit != 0;
    *word |= bit;
    before
}

pub(super) fn clear_bit(bits: &mut [u64], id: u32) {
    bits[id as usize / 64] &= !(1 << (id % 64));
}

pub(super) fn bit(bits: &[u64], id: u32) -> bool {
    bits[id as usize / 64] >> (id % 64) & 1 == 1
}

/// Paths from facets down to the changed elements of a batch.
pub(super) struct DirtyPath {
    /// Elements on a path.
    pub(super) on: Vec<u64>,
    /// Ends of the paths.
    ends: Vec<u64>,
    /// Index in `changes` for each end; [`ALL`] where children came or went.
    numbers: Vec<u32>,
    changes: Vec<Linear>,
}

/// In place of an index in `changes`: everything below may differ.
const ALL: u32 = u32::MAX;

impl DirtyPath {
    pub(super) fn new(len: usize) -> DirtyPath {
        let bits = || vec![0; len / 64 + 1];
        DirtyPath { on: bits(), ends: bits(), numbers: vec![0; len], changes: Vec::new() }
    }

    /// `Some` where an element itself changed: with the change of its gathered irradiance, or `None` where its children came
    /// or went.
    pub(super) fn changes(&self, id: u32) -> Option<Option<&Linear>> {
        let number = || self.numbers[id as usize];
        bit(&self.ends, id).then(|| (number() != ALL).then(|| &self.changes[number() as usize]))
    }

    pub(super) fn mark(&mut self, surfaces: &impl Surfaces, batch: &mut Batch) -> &DirtyPath {
        self.changes = std::mem::take(&mut batch.changes);
        let receivers = batch.receivers.iter().copied().zip(0..);
        let parents = batch.parents.iter().map(|&id| (id, ALL));
        for (id, number) in receivers.chain(parents) {
            set_bit(&mut self.ends, id);
            self.numbers[id as usize] = number;
            let mut at = Some(id);
            while let Some(id) = at.filter(|&id| !set_bit(&mut self.on, id)) {
                at = surfaces.parent(id);
            }
        }
        self
    }

    pub(super) fn clear(&mut self, surfaces: &impl Surfaces, batch: &Batch) {
        for &id in batch.receivers.iter().chain(&batch.parents) {
            clear_bit(&mut self.ends, id);
            let mut at = Some(id);
            while let Some(id) = at.filter(|&id| bit(&self.on, id)) {
                clear_bit(&mut self.on, id);
                at = surfaces.parent(id);
            }
        }
    }
}
