//! For each receiver the sources it gathers from.

use super::field::SPARE;
use crate::element::Renumbering;
use crate::pair::Gradients;

/// One source of a receiver: 12 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// The source.
    pub source: u32,
    /// V X / A_receiver.
    pub coupling: f32,
    /// Relative gradient of what arrives over the receiver, per radius, as in [`Gradients`].
    pub over_receiver: [i8; 2],
    /// Relative gradient of what a point of the source sends, per radius, as in [`Gradients`].
    pub over_source: [i8; 2],
}

impl Link {
    /// The gradient over the receiver, per radius.
    #[inline]
    pub fn receiver_gradient(&self) -> [f32; 2] {
        self.over_receiver.map(Gradients::value)
    }

    /// The gradient over the source, per radius.
    #[inline]
    pub fn source_gradient(&self) -> [f32; 2] {
        self.over_source.map(Gradients::value)
    }
}

/// Links of one receiver in the pool, with room for the next multiple of four.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    start: u32,
    len: u32,
}

/// Links are kept in blocks with room for a multiple of so many.
const CAPACITY: u32 = 4;

fn room(len: u32) -> u32 {
    len.next_multiple_of(CAPACITY)
}

/// The links of all receivers, in one pool; each pair of a receiver and a source at most once.
#[derive(Clone, Debug, Default)]
pub struct Links {
    spans: Vec<Span>,
    pool: Vec<Link>,
    /// Room in the pool that no span has.
    lost: usize,
    /// Links on their way in.
    fresh: Vec<Link>,
}

/// Counts first, then fills: two passes over the links, no sorting.
#[derive(Clone, Debug)]
pub struct LinksBuilder {
    spans: Vec<Span>,
}

impl LinksBuilder {
    /// For `elements` elements.
    pub fn new(elements: usize) -> LinksBuilder {
        LinksBuilder { spans: vec![Span::default(); elements] }
    }

    /// Announces one source of a receiver.
    #[inline]
    pub fn count(&mut self, receiver: u32) {
        self.spans[receiver as usize].len += 1;
    }

    /// Ends counting; `fill` is called once and must hand in as many sources as were announced, as
    /// (receiver, link). Links keep the order in which they are handed in.
    pub fn fill(mut self, fill: impl FnOnce(&mut dyn FnMut(u32, Link))) -> Links {
        let mut total = 0;
        for span in &mut self.spans {
            span.start = total;
            total += room(span.len);
            span.len = 0;
        }
        let mut pool = vec![Link::default(); total as usize];
        let spans = &mut self.spans;
        fill(&mut |receiver, link| {
            let span = &mut spans[receiver as usize];
            pool[(span.start + span.len) as usize] = link;
            span.len += 1;
        });
        Links { spans: self.spans, pool, ..Links::default() }
    }
}

impl Links {
    /// The links of a receiver.
    #[inline]
    pub fn of(&self, receiver: u32) -> &[Link] {
        let span = self.spans[receiver as usize];
        &self.pool[span.start as usize..(span.start + span.len) as usize]
    }

    /// Receivers there is room for.
    pub fn elements(&self) -> usize {
        self.spans.len()
    }

    /// Makes room for receivers with higher ids; they have no links yet.
    pub fn extend(&mut self, elements: usize) {
        if elements > self.spans.capacity() {
            self.spans.reserve_exact(elements + elements / SPARE - self.spans.len());
        }
        if elements > self.spans.len() {
            self.spans.resize(elements, Span::default());
        }
    }

    /// Adds links, each from another source, or gives those from the same sources new values; a coupling of
    /// 0 takes them out. What stays may change its order.
    pub fn set(&mut self, receiver: u32, links: impl Iterator<Item = Link>) {
        let Span { start, len: before } = self.spans[receiver as usize];
        let mut fresh = std::mem::take(&mut self.fresh);
        let mut len = before as usize;
        for link in links {
            let held = &mut self.pool[start as usize..start as usize + len];
            match held.iter().position(|l| l.source == link.source) {
                Some(at) if link.coupling == 0.0 => {
                    len -= 1;
                    held[at] = held[len];
                }
                Some(at) => held[at] = link,
                None if link.coupling == 0.0 => {}
                None => fresh.push(link),
            }
        }
        let wanted = (len + fresh.len()) as u32;
        self.spans[receiver as usize].len = len as u32;
        if wanted > room(before) {
            self.lost += room(before) as usize;
            self.relocate(receiver, wanted);
        } else {
            self.lost += (room(before) - room(wanted)) as usize;
        }
        let span = &mut self.spans[receiver as usize];
        let end = (span.start + span.len) as usize;
        self.pool[end..end + fresh.len()].copy_from_slice(&fresh);
        span.len = wanted;
        fresh.clear();
        self.fresh = fresh;
    }

    /// Puts the links of a receiver in the order of their sources.
    pub fn sort(&mut self, receiver: u32) {
        let span = self.spans[receiver as usize];
        self.pool[span.start as usize..(span.start + span.len) as usize]
            .sort_unstable_by_key(|l| l.source);
    }

    /// Moves a block to the end of the pool, where there is room for `len`.
    fn relocate(&mut self, receiver: u32, len: u32) {
        let span = self.spans[receiver as usize];
        let (from, to) = (span.start as usize, self.pool.len());
        let wanted = to + room(len) as usize;
        if wanted > self.pool.capacity() {
            self.pool.reserve_exact(wanted / SPARE + room(len) as usize);
        }
        self.pool.extend_from_within(from..from + span.len as usize);
        self.pool.resize(wanted, Link::default());
        self.spans[receiver as usize].start = to as u32;
    }

    /// Moves everything together where more than a sixteenth of the pool is lost.
    pub fn tidy(&mut self) {
        if self.lost * 16 <= self.pool.len() {
            return;
        }
        let total: u32 = self.spans.iter().map(|s| room(s.len)).sum();
        let mut pool = Vec::with_capacity(total as usize);
        for span in &mut self.spans {
            let from = span.start as usize;
            span.start = pool.len() as u32;
            pool.extend_from_slice(&self.pool[from..from + span.len as usize]);
            pool.resize((span.start + room(span.len)) as usize, Link::default());
        }
        (self.pool, self.lost) = (pool, 0);
    }

    /// Follows elements to their new ids. The links of a receiver keep their order.
    pub fn renumber(&mut self, to: &Renumbering) {
        let spans: Vec<Span> = to.old_of().iter().map(|&old| self.spans[old as usize]).collect();
        for &Span { start, len } in &spans {
            for link in &mut self.pool[start as usize..(start + len) as usize] {
                link.source = to.new_of(link.source);
            }
        }
        self.spans = spans;
        self.lost =
            self.pool.len() - self.spans.iter().map(|s| room(s.len) as usize).sum::<usize>();
        self.tidy();
    }

    /// Gives back room beyond a small reserve.
    pub fn trim(&mut self) {
        self.spans.shrink_to(self.spans.len() + self.spans.len() / SPARE);
        self.pool.shrink_to(self.pool.len() + self.pool.len() / SPARE);
        self.fresh = Vec::new();
    }

    /// Bytes held by the links.
    pub fn pool_bytes(&self) -> u64 {
        (self.pool.capacity() * size_of::<Link>()) as u64
    }

    /// Bytes held to say where the links of each receiver are.
    pub fn span_bytes(&self) -> u64 {
        (self.spans.capacity() * size_of::<Span>()) as u64
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        self.pool_bytes() + self.span_bytes()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Whatever is set, removed and tidied, a table remembers what the pool should hold.
        #[test]
        fn the_pool_holds_what_was_put_in(
            steps in prop::collection::vec(
                (0..7_u32, prop::collection::btree_map(0..40_u32, 0..3_u32, 0..30), 0..4_u32),
                0..60,
            )
        ) {
            let mut links = Links::default();
            links.extend(7);
            let mut table = [[0.0_f32; 40]; 7];
            for (k, (receiver, some, action)) in steps.into_iter().enumerate() {
                let coupling = |kind: u32| if kind == 0 { 0.0 } else { k as f32 + 1.0 };
                let link = |(source, kind)| {
                    Link { source, coupling: coupling(kind), ..Link::default() }
                };
                let some: Vec<Link> = some.into_iter().map(link).collect();
                for link in &some {
                    table[receiver as usize][link.source as usize] = link.coupling;
                }
                links.set(receiver, some.into_iter());
                if action == 3 {
                    links.tidy();
                    links.sort(receiver);
                }
                let rooms: u32 = links.spans.iter().map(|s| room(s.len)).sum();
                prop_assert_eq!(links.pool.len(), rooms as usize + links.lost);
                for (r, row) in table.iter().enumerate() {
                    let held = links.of(r as u32);
                    prop_assert_eq!(held.len(), row.iter().filter(|c| **c > 0.0).count());
                    for link in held {
                        prop_assert_eq!(link.coupling, row[link.source as usize]);
                    }
                }
            }
        }
    }
}
