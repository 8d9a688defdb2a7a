//! Batches of facets, and the ways from facets down to what concerns them.

use super::field::Linear;
use super::surfaces::Surfaces;

/// Facets that go together: consecutive ones.
#[derive(Default)]
pub(super) struct Batch {
    pub(super) facets: Vec<u32>,
    /// Receivers to be gathered, and settled with what is below them; once gathered, those that cannot wait.
    pub(super) receivers: Vec<u32>,
    /// One by one, by how much what they gathered changed, W/m2 and per metre; none before it was gathered, or where
    /// everything is settled.
    pub(super) news: Vec<Linear>,
    /// Further elements to be settled with all that is below them.
    pub(super) parents: Vec<u32>,
}

/// Sets a bit; whether it was set already.
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

/// The ways from facets to the elements that a batch concerns.
pub(super) struct DirtyPath {
    /// Elements on a way.
    pub(super) on: Vec<u64>,
    /// Ends of the ways.
    ends: Vec<u64>,
    /// Which news those of the ends are; [`ALL`] where children came or went.
    numbers: Vec<u32>,
    news: Vec<Linear>,
}

/// In place of a number of news: everything below may differ.
const ALL: u32 = u32::MAX;

impl DirtyPath {
    pub(super) fn new(len: usize) -> DirtyPath {
        let bits = || vec![0; len / 64 + 1];
        DirtyPath { on: bits(), ends: bits(), numbers: vec![0; len], news: Vec::new() }
    }

    /// Whether anything changed at an element itself, and by how much what it gathered did, if that is all.
    pub(super) fn news(&self, id: u32) -> Option<Option<&Linear>> {
        let number = || self.numbers[id as usize];
        bit(&self.ends, id).then(|| (number() != ALL).then(|| &self.news[number() as usize]))
    }

    pub(super) fn mark(&mut self, surfaces: &impl Surfaces, batch: &mut Batch) -> &DirtyPath {
        self.news = std::mem::take(&mut batch.news);
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
