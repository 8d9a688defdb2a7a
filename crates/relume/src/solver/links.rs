//! Links sorted by receiver, ready to gather.

/// One source of a receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// The source.
    pub source: u32,
    /// V X / A_receiver.
    pub coupling: f32,
    /// Relative gradient of what arrives over the receiver, times its radius, in steps.
    pub over_receiver: [i16; 2],
    /// Relative gradient of what a point of the source sends, times its radius, in steps.
    pub over_source: [i16; 2],
}

impl Link {
    /// Steps of a gradient in one.
    pub const STEPS: f32 = crate::pair::Gradients::STEPS;
}

/// For each receiver the sources it gathers from and the coupling V X / A_receiver.
#[derive(Clone, Debug, Default)]
pub struct Links {
    offsets: Vec<u32>,
    entries: Vec<Link>,
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
    /// (receiver, link). Links keep the order in which they are handed in.
    pub fn fill(self, fill: impl FnOnce(&mut dyn FnMut(u32, Link))) -> Links {
        let mut offsets = self.counts;
        for k in 1..offsets.len() {
            offsets[k] += offsets[k - 1];
        }
        let total = offsets.last().copied().unwrap_or(0) as usize;
        let mut entries = vec![Link::default(); total];
        let mut next = offsets.clone();
        fill(&mut |receiver, link| {
            let at = &mut next[receiver as usize];
            entries[*at as usize] = link;
            *at += 1;
        });
        Links { offsets, entries }
    }
}

impl Links {
    /// The links of a receiver.
    #[inline]
    pub fn of(&self, receiver: u32) -> &[Link] {
        let at = receiver as usize;
        &self.entries[self.offsets[at] as usize..self.offsets[at + 1] as usize]
    }

    /// Elements.
    pub fn elements(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        (self.offsets.capacity() * 4 + self.entries.capacity() * size_of::<Link>()) as u64
    }
}
