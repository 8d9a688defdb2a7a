//! Growing a pair tree from a frontier: judge in parallel, then edit in order.
//!
//! Work goes in blocks of fixed size; every block is judged in chunks of fixed size, whose results
//! are applied in order. The tree is the same for any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use crate::element::ElementId;

use super::oracle::Side;
use super::tree::{CullReason, Gradients, PairId, PairTree, State};

/// What is decided on a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It becomes a link.
    Link,
    /// One side is replaced by its children.
    Refine(Side),
    /// A cluster paired with itself: all pairs of its children.
    RefineSelf,
    /// It exchanges nothing.
    Cull(CullReason),
    /// Undecided: it waits in the frontier.
    Hold,
}

/// A verdict with what it rests on.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Exchange area, m2.
    pub exchange_area_m2: f32,
    /// Visibility.
    pub visibility: f32,
    /// How what arrives varies over both ends.
    pub gradients: Gradients,
    /// Visibility segments traced.
    pub segments: u32,
}

/// The hierarchy that the two ends of a pair come from.
pub trait Hierarchy {
    /// Ids of the children; empty for a leaf.
    fn children(&self, id: ElementId) -> Range<u32>;
    /// The children, made where there are none yet; and whether they were.
    fn split(&mut self, id: ElementId) -> (Range<u32>, bool);
    /// Elements alive.
    fn element_count(&self) -> usize;
}

/// What the pair tree asks of the space it works in.
pub trait Judge: Hierarchy + Sync {
    /// Judges a pair. `candidates` are the possible occluders of the pair above; those of this
    /// pair are appended to `narrowed`, whose present content belongs to other pairs. A pure function of the space.
    fn judge(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement;
}

/// Pairs that wait to be judged, with the possible occluders of the pairs above them.
#[derive(Clone, Debug, Default)]
pub struct Frontier {
    items: Vec<Item>,
    candidates: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Item {
    pair: PairId,
    start: u32,
    len: u32,
}

impl Frontier {
    /// The pairs, in order.
    pub fn pairs(&self) -> impl Iterator<Item = PairId> + Clone + '_ {
        self.items.iter().map(|i| i.pair)
    }

    fn push_candidates(&mut self, list: &[u32]) -> (u32, u32) {
        let start = self.candidates.len() as u32;
        self.candidates.extend_from_slice(list);
        (start, list.len() as u32)
    }

    fn memory_bytes(&self) -> u64 {
        (self.items.capacity() * size_of::<Item>() + self.candidates.capacity() * 4) as u64
    }
}

/// Exact counts of what was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Pairs judged.
    pub examined: u64,
    /// Visibility segments traced.
    pub segments: u64,
    /// Elements made.
    pub elements_made: u64,
}

/// Pairs judged by one task.
const CHUNK: usize = 128;

/// Pairs judged before their results are applied.
const BLOCK: usize = 1 << 15;

/// Judges from the root down; returns the pairs held.
///
/// `may_go_on` is asked after each block with the tree, the hierarchy's size in elements and the
/// scratch memory in bytes; growth ends early when it says no (`None` is returned).
pub fn grow<J: Judge>(
    tree: &mut PairTree,
    judge: &mut J,
    root_candidates: &[u32],
    work: &mut Work,
    may_go_on: &dyn Fn(&PairTree, usize, u64) -> bool,
) -> Option<Frontier> {
    let mut start = Frontier::default();
    let (at, len) = start.push_candidates(root_candidates);
    start.items.push(Item { pair: PairTree::ROOT, start: at, len });
    resume(tree, judge, start, work, may_go_on)
}

/// Judges from a frontier down, like [`grow`].
pub fn resume<J: Judge>(
    tree: &mut PairTree,
    judge: &mut J,
    frontier: Frontier,
    work: &mut Work,
    may_go_on: &dyn Fn(&PairTree, usize, u64) -> bool,
) -> Option<Frontier> {
    let mut held = Frontier::default();
    let mut wave = frontier;
    while !wave.items.is_empty() {
        let mut next = Frontier::default();
        for block in wave.items.chunks(BLOCK) {
            let judged = judge_block(tree, judge, block, &wave.candidates);
            for chunk in &judged {
                apply(tree, judge, chunk, &mut next, &mut held, work);
            }
            let scratch = wave.memory_bytes() + next.memory_bytes() + held.memory_bytes();
            if !may_go_on(tree, judge.element_count(), scratch) {
                return None;
            }
        }
        wave = next;
    }
    Some(held)
}

struct Chunk<'a> {
    items: &'a [Item],
    judgements: Vec<(Judgement, Range<usize>)>,
    candidates: Vec<u32>,
}

fn judge_block<'a, J: Judge>(
    tree: &PairTree,
    judge: &J,
    items: &'a [Item],
    candidates: &[u32],
) -> Vec<Chunk<'a>> {
    let judge_chunk = |items: &'a [Item]| {
        let mut chunk =
            Chunk { items, judgements: Vec::with_capacity(items.len()), candidates: Vec::new() };
        for item in items {
            let pair = tree.pair(item.pair);
            let list = &candidates[item.start as usize..(item.start + item.len) as usize];
            let start = chunk.candidates.len();
            let judgement = judge.judge(pair.a, pair.b, list, &mut chunk.candidates);
            if !matches!(
                judgement.verdict,
                Verdict::Refine(_) | Verdict::RefineSelf | Verdict::Hold
            ) {
                chunk.candidates.truncate(start);
            }
            chunk.judgements.push((judgement, start..chunk.candidates.len()));
        }
        chunk
    };
    items.par_chunks(CHUNK).map(judge_chunk).collect()
}

fn apply<J: Judge>(
    tree: &mut PairTree,
    judge: &mut J,
    chunk: &Chunk<'_>,
    next: &mut Frontier,
    held: &mut Frontier,
    work: &mut Work,
) {
    for (item, (judgement, range)) in chunk.items.iter().zip(&chunk.judgements) {
        work.examined += 1;
        work.segments += u64::from(judgement.segments);
        let pair = tree.pair_mut(item.pair);
        pair.exchange_area_m2 = judgement.exchange_area_m2;
        pair.visibility = judgement.visibility;
        pair.gradients = judgement.gradients;
        let (a, b) = (pair.a, pair.b);
        let list = &chunk.candidates[range.clone()];
        let first = match judgement.verdict {
            Verdict::Link => {
                pair.state = State::Active;
                continue;
            }
            Verdict::Cull(reason) => {
                pair.state = State::Culled(reason);
                continue;
            }
            Verdict::Hold => {
                let (start, len) = held.push_candidates(list);
                held.items.push(Item { pair: item.pair, start, len });
                continue;
            }
            Verdict::Refine(side) => {
                let whole = if side == Side::A { a } else { b };
                let (children, made) = judge.split(whole);
                work.elements_made += if made { children.len() as u64 } else { 0 };
                let ends = children.map(|c| match side {
                    Side::A => (ElementId(c), b),
                    Side::B => (a, ElementId(c)),
                });
                tree.refine(item.pair, ends)
            }
            Verdict::RefineSelf => {
                let children = judge.children(a);
                let ends = children.clone().flat_map(|one| {
                    (one..children.end).map(move |two| (ElementId(one), ElementId(two)))
                });
                tree.refine(item.pair, ends)
            }
        };
        let (start, len) = next.push_candidates(list);
        let children = first.0..tree.len() as u32;
        next.items.extend(children.map(|c| Item { pair: PairId(c), start, len }));
    }
}
