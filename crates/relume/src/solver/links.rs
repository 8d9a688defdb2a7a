//! Links sorted by receiver, ready to gather.

/// For each receiver the sources it gathers from and the coupling V X / A_receiver.
#[derive(Clone, Debug, Default)]
pub struct Links {
    offsets: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

/// Counts first, then fills: two passes over the links, no sorting.
#[derive(Clone, Debug)]
pub struct LinksBuilder {
    counts: Vec<u32>,
}

impl LinksBuilder {
    /// For `elements` elements.
    pub fn new(elements: usize) -> LinksBuilder {
        LinksBuilder { counts: vec![0; elements + 1] }
    }

    /// Announces one source of a receiver.
    #[inline]
    pub fn count(&mut self, receiver: u32) {
        self.counts[receiver as usize + 1] += 1;
    }

    /// Ends counting; `fill` is called once and must hand in as many sources as were announced, as
    /// (receiver, source, coupling). Sources keep the order in which they are handed in.
    pub fn fill(self, fill: impl FnOnce(&mut dyn FnMut(u32, u32, f32))) -> Links {
        let mut offsets = self.counts;
        for k in 1..offsets.len() {
            offsets[k] += offsets[k - 1];
        }
        let total = offsets.last().copied().unwrap_or(0) as usize;
        let mut entries = vec![(0, 0.0); total];
        let mut next = offsets.clone();
        fill(&mut |receiver, source, coupling| {
            let at = &mut next[receiver as usize];
            entries[*at as usize] = (source, coupling);
            *at += 1;
        });
        Links { offsets, entries }
    }
}

impl Links {
    /// (source, coupling) of a receiver.
    #[inline]
    pub fn of(&self, receiver: u32) -> &[(u32, f32)] {
        let at = receiver as usize;
        &self.entries[self.offsets[at] as usize..self.offsets[at + 1] as usize]
    }

    /// Elements.
    pub fn elements(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        (self.offsets.capacity() * 4 + self.entries.capacity() * 8) as u64
    }
}
