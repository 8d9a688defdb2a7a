//! Update of a pair tree: pairs that may have changed are judged in parallel, then the tree is edited in order.
//!
//! Pairs are judged in blocks of fixed size, each in chunks of fixed size; the results of the chunks are applied in order by
//! one writer. The resulting tree does not depend on the number of threads. A cold build is the update of a tree with
//! nothing but its root.

use super::changes::{Changes, CoarseLink, Record};
use super::editor::Editor;
use super::evaluate::judge_block;
use super::hash::PairHash;
use super::space::Judge;
use super::tree::{PairId, PairTree};
use super::tuning::BLOCK;
use super::wave::{Item, Wave};

/// Error: the memory limit of an update is reached, or it was called off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfMemory;

/// A pair tree with the hash over its links.
pub struct Pairs<'a> {
    /// The tree.
    pub tree: &'a mut PairTree,
    /// The hash.
    pub hash: &'a mut PairHash,
}

/// Input of an update beside the tree and the judge.
pub struct Scope<'a> {
    /// Candidate occluders of the root pair.
    pub candidates: &'a [u32],
    /// Records to keep.
    pub record: Record,
    /// Pairs (ascending) that an earlier update with the same [`Judge::stale`] refined: all of their children are visited.
    pub fresh: &'a [PairId],
    /// Called after each block with the tree, the number of elements and the scratch memory in bytes; false ends the update.
    pub may_go_on: &'a dyn Fn(&PairTree, usize, u64) -> bool,
}

/// Brings a tree, with the hash over its links, up to date.
///
/// # Errors
/// [`OutOfMemory`] as soon as `may_go_on` returns false: pairs applied until then are up to date, the others are unchanged,
/// and new pairs may be left unjudged.
pub fn update<J: Judge>(
    Pairs { tree, hash }: Pairs<'_>,
    judge: &mut J,
    scope: &Scope<'_>,
) -> Result<Changes, OutOfMemory> {
    let &Scope { candidates: root_candidates, record, fresh, may_go_on } = scope;
    let mut editor =
        Editor { tree, hash, judge, record, changes: Changes::default(), next: Wave::default() };
    let list = editor.next.push_candidates(root_candidates);
    editor.next.items.push(Item { pair: PairTree::ROOT, list });
    loop {
        while !editor.next.items.is_empty() {
            let wave = std::mem::take(&mut editor.next);
            for block in wave.items.chunks(BLOCK) {
                let judged = judge_block(editor.tree, editor.judge, block, &wave.candidates, fresh);
                for chunk in &judged {
                    editor.apply_chunk(chunk, &wave);
                }
                let coarse = editor.changes.coarse_links.len() * size_of::<CoarseLink>();
                let scratch = wave.used_bytes() + editor.next.used_bytes() + coarse as u64;
                if !may_go_on(editor.tree, editor.judge.element_count(), scratch) {
                    return Err(OutOfMemory);
                }
            }
        }
        // Extrapolated pairs that are due, though no motion led to them.
        let due = editor.judge.lookahead().map(|ahead| editor.tree.due_pairs(ahead));
        let list = editor.next.push_candidates(root_candidates);
        editor.next.items.extend(due.into_iter().flatten().map(|pair| Item { pair, list }));
        if editor.next.items.is_empty() {
            break;
        }
    }
    editor.changes.refined.sort_unstable();
    Ok(editor.changes)
}
