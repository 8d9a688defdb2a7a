//! Update of a pair tree: pairs that may have changed are judged in parallel, then the tree is edited in order.
//!
//! Pairs are judged in blocks of fixed size, each in chunks of fixed size; the results of the chunks are applied in order by
//! one writer. The resulting tree does not depend on the number of threads. A cold build is the update of a tree with
//! nothing but its root.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;

use crate::element::{ElementId, ElementKey};
use crate::predict::{History, Lookahead, Sample, Tick};

use super::certificate_tests::Finding;
use super::hash::{PairHash, pair_key};
use super::margin::Margin;
use super::tree::{Carried, CullReason, PairId, PairTree, State};
use super::tuning::{BLOCK, CHUNK};
use crate::transport::Side;

/// Decision on a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The pair becomes a link.
    Link,
    /// One side is replaced by its children.
    Refine(Side),
    /// A cluster paired with itself: all pairs of its children.
    RefineSelf,
    /// The pair exchanges nothing.
    Cull(CullReason),
    /// The pair is a link of the coarse solution: it keeps its state, and is reported in [`Changes::coarse_links`].
    CoarseLink,
}

/// A verdict with the values of the pair.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Values of the pair as a link, or as a coarse link.
    pub carried: Carried,
    /// Change of brightness up to which the verdict stands.
    pub margin: Margin,
    /// Visibility segments traced.
    pub segments: u32,
}

/// Part of a pair that may have changed since it was judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stale {
    /// Nothing of the pair, and nothing of any pair below it.
    Nothing,
    /// Nothing of the pair itself; perhaps something of a pair below it.
    Below,
    /// The brightness of its ends: perhaps its verdict, not its values.
    Brightness,
    /// The occluders between its ends.
    Occlusion,
    /// The places of its ends; a certificate says that nothing stands between them.
    Followed,
    /// Its extrapolated values, which are due for evaluation.
    Due,
    /// The places of its ends.
    Moved,
    /// Everything: the pair has not been judged yet.
    New,
}

/// Hierarchy of the elements that are ends of pairs.
pub trait Hierarchy {
    /// Ids of the children; empty for a leaf.
    fn children(&self, id: ElementId) -> Range<u32>;
    /// The children, and whether they were made by this call. Each call counts as a use of the children, until
    /// [`Hierarchy::release`].
    fn split(&mut self, id: ElementId) -> (Range<u32>, bool);
    /// Takes back one use of the children.
    fn release(&mut self, id: ElementId);
    /// Name of an element; independent of history.
    fn key(&self, id: ElementId) -> ElementKey;
    /// Elements alive.
    fn element_count(&self) -> usize;
}

/// Questions of the pair tree to the space that its elements are in.
pub trait Judge: Hierarchy + Sync {
    /// Verdict on a pair. `candidates` are the candidate occluders of its parent pair; the candidates of this pair are
    /// appended to `narrowed`, whose present content belongs to other pairs. `known` are the values of a link of which only
    /// the brightness changed. The verdict is a pure function of the space: it does not depend on which candidates were
    /// given, as long as no occluder is missing.
    fn judge(
        &self,
        ends: (ElementId, ElementId),
        known: Option<&Carried>,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement;

    /// Rest of a pair's margin after the changes of brightness since the last update; `None` if the verdict may have
    /// changed.
    fn withstands(&self, a: ElementId, b: ElementId, margin: Margin) -> Option<Margin>;

    /// Part of a pair that may have changed since the last update. `certified` says that a certificate stands: unless the
    /// pair is culled, nothing has come or gone between its ends.
    fn stale(&self, a: ElementId, b: ElementId, certified: bool) -> Stale;

    /// Refreshes the candidate occluders of a refined pair with ends at rest: appends them to `narrowed`. Returns false if
    /// the verdict depends on visibility; the pair must then be judged.
    fn narrow(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> bool;

    /// Whether the brightness of an end changed and the verdict on the pair depends on brightness.
    fn brightness_changed(&self, a: ElementId, b: ElementId) -> bool;

    /// Whether a certificate that expires after `until` stands at this instant.
    fn certified(&self, until: Tick) -> bool;

    /// Settings of extrapolation; `None` where pairs are not extrapolated.
    fn lookahead(&self) -> Option<&Lookahead>;

    /// Whether [`Finding::Clear`] may be certified for a refined pair with these candidate occluders.
    fn may_be_clear(&self, _a: ElementId, _b: ElementId, narrowed: &[u32]) -> bool {
        narrowed.is_empty()
    }

    /// Expiry of a certificate: the last tick until which the known motion cannot change a finding on a pair; 0 if none.
    fn expiry(&self, a: ElementId, b: ElementId, finding: Finding) -> Tick;

    /// Whether this pair is a coarse link unless it is culled.
    fn is_coarse_pair(&self, a: ElementId, b: ElementId) -> bool;

    /// Whether a link between these two ends is evaluated facet by facet (groups), so that judged pairs must be recorded in
    /// [`Changes::apart`].
    fn is_apart(&self, _a: ElementId, _b: ElementId) -> bool {
        false
    }
}

/// Exact counts of the work of an update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Pairs visited on the walk, unaffected ones included.
    pub visited: u64,
    /// Pairs judged.
    pub examined: u64,
    /// Pairs with moved ends of which only the exchange area was evaluated: a certificate says that nothing stands between
    /// the ends.
    pub followed: u64,
    /// Links of which X and V were extrapolated.
    pub extrapolated: u64,
    /// Pairs skipped, with their subtrees, because their certificate stands.
    pub certified: u64,
    /// Pairs judged for the coarse solution before; each is visited again.
    pub coarse_examined: u64,
    /// Pairs judged because an end moved, or for the first time.
    pub reevaluated: u64,
    /// Pairs judged because something moved between their ends.
    pub visibility_only: u64,
    /// Pairs judged because the light on their ends changed.
    pub brightness_only: u64,
    /// Pairs whose state, or what they carry as a link, differs from before.
    pub changed: u64,
    /// Refined pairs that became links.
    pub promoted: u64,
    /// Links that were refined.
    pub demoted: u64,
    /// Links whose visibility changed.
    pub occlusion_changed: u64,
    /// Links with an end that moved against the other.
    pub dynamic_links: u64,
    /// Visibility segments traced.
    pub segments: u64,
    /// Elements made.
    pub elements_made: u64,
}

impl Work {
    /// Adds the update with the oracle to the update down to the coarse level. Visits and judgements are those of the second
    /// update, which visits every pair of the first again; edits are the sum of both.
    pub fn add_after_coarse(&mut self, other: Work) {
        self.coarse_examined = self.examined;
        self.visited = other.visited;
        self.examined = other.examined;
        self.followed = other.followed;
        self.certified = other.certified;
        self.extrapolated = other.extrapolated;
        self.reevaluated = other.reevaluated;
        self.visibility_only = other.visibility_only;
        self.brightness_only = other.brightness_only;
        self.changed += other.changed;
        self.promoted += other.promoted;
        self.demoted += other.demoted;
        self.occlusion_changed += other.occlusion_changed;
        self.dynamic_links += other.dynamic_links;
        self.segments += other.segments;
        self.elements_made += other.elements_made;
    }
}

/// One edit to the set of links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edit {
    /// A pair is a link with new values.
    Set(PairId),
    /// Two elements are no longer linked.
    Removed(ElementId, ElementId),
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Links below a refined pair became one link.
    Promoted,
    /// A link became refined.
    Demoted,
    /// More stands between its ends.
    Occluded,
    /// Less stands between its ends.
    Revealed,
    /// Its ends no longer face each other, or one vanished.
    Culled,
    /// Its ends came to face each other.
    Woken,
}

/// An event of a link, by the names of its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkEvent {
    /// Kind of the event.
    pub kind: EventKind,
    /// Both ends.
    pub ends: (ElementKey, ElementKey),
    /// Values before; `None` where the pair was no link.
    pub before: Option<Carried>,
    /// Values after; `None` where the pair is no link.
    pub after: Option<Carried>,
}

/// Records that an update keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Edits to the links.
    pub edits: bool,
    /// Events of the links.
    pub events: bool,
}

/// A link of the coarse solution, with its values.
#[derive(Clone, Copy, Debug)]
pub struct CoarseLink {
    /// First end.
    pub a: ElementId,
    /// Second end.
    pub b: ElementId,
    /// Values of the link.
    pub carried: Carried,
}

/// Result of an update.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Counts.
    pub work: Work,
    /// Edits to the links, in order; empty where they are not recorded.
    pub edits: Vec<Edit>,
    /// Events of links that were there before or are there now, in order; empty where they are not
    /// recorded. What is made or removed below a refined pair is not among them.
    pub events: Vec<LinkEvent>,
    /// Newly refined pairs, ascending; empty where edits are not recorded.
    pub refined: Vec<PairId>,
    /// Coarse links that were judged.
    pub coarse_links: Vec<CoarseLink>,
    /// Pairs that may have lost their coarse link; both ends may have vanished since.
    pub dropped_coarse_links: Vec<(ElementId, ElementId)>,
    /// Links of groups ([`Judge::is_apart`]) of which more than the brightness was evaluated; empty where edits are not
    /// recorded.
    pub apart: Vec<(ElementId, ElementId)>,
}

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

/// Pairs to be visited, with the candidate occluders of their parents.
#[derive(Clone, Debug, Default)]
struct Wave {
    items: Vec<Item>,
    candidates: Vec<u32>,
    /// Lists handed on unchanged from the wave before, by their start there.
    handed_on: BTreeMap<u32, List>,
}

#[derive(Clone, Copy, Debug)]
struct Item {
    pair: PairId,
    list: List,
}

impl Item {
    /// Whether an earlier edit of the same wave removed the pair. Only pairs that are due can have an ancestor in their wave.
    fn is_gone(&self, tree: &PairTree, ends: (ElementId, ElementId)) -> bool {
        tree.state(self.pair) == State::Vacant || tree.ends(self.pair) != ends
    }
}

/// Range of the candidates of a wave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct List {
    start: u32,
    len: u32,
}

impl Wave {
    fn push_candidates(&mut self, list: &[u32]) -> List {
        let start = self.candidates.len() as u32;
        self.candidates.extend_from_slice(list);
        List { start, len: list.len() as u32 }
    }

    /// Takes over a list of the wave before: once, however many pairs have it in common.
    fn hand_on(&mut self, list: List, before: &Wave) -> List {
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
    fn used_bytes(&self) -> u64 {
        let lists = self.handed_on.len() * size_of::<(u32, List)>();
        (self.items.len() * size_of::<Item>() + self.candidates.len() * 4 + lists) as u64
    }
}

impl List {
    /// No candidates, by the certificate of a pair above.
    const CLEAR: List = List { start: u32::MAX, len: 0 };

    fn from_start(start: usize, candidates: &[u32]) -> List {
        List { start: start as u32, len: (candidates.len() - start) as u32 }
    }

    fn of(self, candidates: &[u32]) -> &[u32] {
        match self.len {
            0 => &[],
            len => &candidates[self.start as usize..(self.start + len) as usize],
        }
    }
}

/// The candidates of the children of a pair.
#[derive(Clone, Copy, Debug)]
enum Below {
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
    fn of(above: List, start: usize, narrowed: &mut Vec<u32>) -> Below {
        let (all, left) = (above.len as usize, narrowed.len() - start);
        if left > 0 && left <= all && 8 * left >= Below::MOST * all {
            narrowed.truncate(start);
            return Below::Same;
        }
        Below::Own(List::from_start(start, narrowed))
    }
}

struct Chunk<'a> {
    items: &'a [Item],
    ends: Vec<(ElementId, ElementId)>,
    outcomes: Vec<Outcome>,
    candidates: Vec<u32>,
}

/// Result of evaluating one pair against the unchanging tree.
enum Outcome {
    /// A certificate says that nothing changed here or below.
    Certified,
    /// Nothing changed here or below, nor can it until the given tick.
    Unaffected(Tick),
    /// The children are to be visited. `Some` is the expiry of a new certificate; with `None` the pair keeps its own. The
    /// same holds for the expiries below.
    Descend(Option<Tick>),
    /// The children are to be visited with these candidates.
    Narrowed(Below),
    /// The brightness changed, the verdict did not; the children are to be visited.
    Withstands(Margin, Option<Tick>),
    /// A link with extrapolated values.
    Extrapolated(Carried, Option<Margin>),
    /// A judged pair, with the candidates of its children and the expiry of its certificate.
    Judged(Judgement, Stale, Below, Option<Tick>),
}

fn judge_block<'a, J: Judge>(
    tree: &PairTree,
    judge: &J,
    items: &'a [Item],
    candidates: &[u32],
    fresh: &[PairId],
) -> Vec<Chunk<'a>> {
    let judge_chunk = |items: &'a [Item]| {
        let mut narrowed = Vec::new();
        let outcomes = items
            .iter()
            .map(|item| evaluate(tree, judge, item, (candidates, &mut narrowed), fresh))
            .collect();
        let ends = items.iter().map(|item| tree.ends(item.pair)).collect();
        Chunk { items, ends, outcomes, candidates: narrowed }
    };
    items.par_chunks(CHUNK).map(judge_chunk).collect()
}

fn evaluate<J: Judge>(
    tree: &PairTree,
    judge: &J,
    item: &Item,
    (candidates, narrowed): (&[u32], &mut Vec<u32>),
    fresh: &[PairId],
) -> Outcome {
    let (a, b) = tree.ends(item.pair);
    let state = tree.state(item.pair);
    let new = state == State::New || fresh.binary_search(&item.pair).is_ok();
    let history = tree.history(item.pair);
    let mut due = false;
    if let Some(ahead) = judge.lookahead().filter(|_| !new && history.is_live()) {
        due = history.is_due(ahead);
        if !due && let Some(outcome) = extrapolate(tree, judge, item.pair, &history, ahead) {
            return outcome;
        }
    }
    let certified = !new && judge.certified(tree.expiry(item.pair));
    if certified && matches!(state, State::Culled(_)) {
        return Outcome::Certified;
    }
    let stale = match new {
        true => Stale::New,
        false if due => Stale::Due,
        false => judge.stale(a, b, certified || item.list == List::CLEAR),
    };
    // Of a pair whose ends are at rest with nothing new between them.
    let unaffected = || (!certified).then(|| judge.expiry(a, b, Finding::Unaffected));
    if stale == Stale::Brightness
        && let Some(left) = judge.withstands(a, b, tree.margin(item.pair))
    {
        return Outcome::Withstands(left, unaffected());
    }
    let start = narrowed.len();
    match stale {
        Stale::Nothing => return unaffected().map_or(Outcome::Certified, Outcome::Unaffected),
        Stale::Below => return Outcome::Descend(unaffected()),
        Stale::Occlusion
            if state.is_refined() && judge.narrow(a, b, item.list.of(candidates), narrowed) =>
        {
            return Outcome::Narrowed(Below::of(item.list, start, narrowed));
        }
        _ => {}
    }
    judge_again(tree, judge, item, stale, (candidates, narrowed), &unaffected)
}

/// Judges a pair of which something changed; `unaffected` is its certificate where nothing but the light did.
fn judge_again<J: Judge>(
    tree: &PairTree,
    judge: &J,
    item: &Item,
    stale: Stale,
    (candidates, narrowed): (&[u32], &mut Vec<u32>),
    unaffected: &dyn Fn() -> Option<Tick>,
) -> Outcome {
    let ((a, b), state) = (tree.ends(item.pair), tree.state(item.pair));
    let start = narrowed.len();
    let candidates = if stale == Stale::Followed { &[] } else { item.list.of(candidates) };
    // What is extrapolated is not what an evaluation would find.
    let lit_anew = stale == Stale::Brightness && judge.lookahead().is_none();
    let link = if lit_anew { tree.link(item.pair) } else { None };
    let known = link.as_ref().map(|link| &link.carried);
    let mut found = judge.judge((a, b), known, candidates, narrowed);
    if let (Some(_), State::Refined(side), Verdict::Refine(_)) =
        (judge.lookahead(), state, found.verdict)
    {
        // Which side is better matters little; making everything below anew costs much.
        found.verdict = Verdict::Refine(side);
        found.margin = found.margin.on_this_side();
    }
    let refined = matches!(found.verdict, Verdict::Refine(_) | Verdict::RefineSelf);
    let is_clear = match refined {
        true => stale == Stale::Moved && judge.may_be_clear(a, b, &narrowed[start..]),
        false => found.segments == 0,
    };
    let may_be_clear = is_clear && !candidates.is_empty();
    if !refined {
        narrowed.truncate(start);
    }
    let expiry = match stale == Stale::Brightness {
        true if !matches!(found.verdict, Verdict::Cull(_) | Verdict::CoarseLink) => unaffected(),
        _ => certificate(judge, (a, b), (found.verdict, stale), may_be_clear),
    };
    let list = match stale {
        Stale::Followed => Below::Own(List::CLEAR),
        _ => Below::of(item.list, start, narrowed),
    };
    Outcome::Judged(found, stale, list, expiry)
}

/// Expiry of the certificate of a judged pair; `None` where the pair keeps the certificate that it has.
fn certificate<J: Judge>(
    judge: &J,
    (a, b): (ElementId, ElementId),
    found: (Verdict, Stale),
    may_be_clear: bool,
) -> Option<Tick> {
    match found {
        (Verdict::Cull(_), _) => Some(judge.expiry(a, b, Finding::Culled)),
        (_, Stale::Followed) => None,
        // It is met again, perhaps still in the state that it had.
        (Verdict::CoarseLink, _) => Some(0),
        (_, Stale::Moved) if may_be_clear => Some(judge.expiry(a, b, Finding::Clear)),
        _ => Some(0),
    }
}

/// Outcome for a dynamic pair that is not due; `None` if its brightness changed so much that it must be judged.
fn extrapolate<J: Judge>(
    tree: &PairTree,
    judge: &J,
    pair: PairId,
    history: &History,
    ahead: &Lookahead,
) -> Option<Outcome> {
    let (a, b) = tree.ends(pair);
    let margin = match judge.brightness_changed(a, b) {
        true => Some(judge.withstands(a, b, tree.margin(pair))?),
        false => None,
    };
    match tree.link(pair) {
        Some(link) => {
            let (exchange_area_m2, visibility) = history.extrapolated(ahead);
            let carried = Carried { exchange_area_m2, visibility, ..link.carried };
            Some(Outcome::Extrapolated(carried, margin))
        }
        None => Some(match margin {
            Some(margin) => Outcome::Withstands(margin, None),
            None => Outcome::Descend(None),
        }),
    }
}

/// The one writer of a tree.
struct Editor<'a, J> {
    tree: &'a mut PairTree,
    hash: &'a mut PairHash,
    judge: &'a mut J,
    record: Record,
    changes: Changes,
    next: Wave,
}

impl<J: Judge> Editor<'_, J> {
    fn apply_chunk(&mut self, chunk: &Chunk<'_>, wave: &Wave) {
        for ((item, outcome), &ends) in chunk.items.iter().zip(&chunk.outcomes).zip(&chunk.ends) {
            if item.is_gone(self.tree, ends) {
                continue;
            }
            self.changes.work.visited += 1;
            match outcome {
                Outcome::Certified => self.changes.work.certified += 1,
                Outcome::Unaffected(expiry) => self.tree.set_expiry(item.pair, *expiry),
                Outcome::Descend(expiry) => {
                    self.certify(item.pair, *expiry);
                    let children = self.tree.children(item.pair);
                    self.enqueue(children, Below::Same, item, (chunk, wave));
                }
                Outcome::Narrowed(list) => {
                    let children = self.tree.children(item.pair);
                    self.enqueue(children, *list, item, (chunk, wave));
                }
                Outcome::Withstands(margin, expiry) => {
                    self.certify(item.pair, *expiry);
                    self.tree.set_margin(item.pair, *margin);
                    let children = self.tree.children(item.pair);
                    self.enqueue(children, Below::Same, item, (chunk, wave));
                }
                Outcome::Extrapolated(carried, margin) => {
                    self.changes.work.extrapolated += 1;
                    self.changes.work.dynamic_links += 1;
                    self.carry(item.pair, carried);
                    self.note_apart(item.pair);
                    if let Some(margin) = margin {
                        self.tree.set_margin(item.pair, *margin);
                    }
                }
                Outcome::Judged(found, stale, list, expiry) => {
                    self.count(found, *stale);
                    self.remember(item.pair, found, *stale);
                    let children = self.apply(item.pair, found, *stale);
                    if found.verdict == Verdict::Link && *stale != Stale::Brightness {
                        self.note_apart(item.pair);
                    }
                    self.certify(item.pair, *expiry);
                    self.enqueue(children, *list, item, (chunk, wave));
                }
            }
        }
    }

    fn note_apart(&mut self, pair: PairId) {
        let (a, b) = self.tree.ends(pair);
        if self.record.edits && self.judge.is_apart(a, b) {
            self.changes.apart.push((a, b));
        }
    }

    fn certify(&mut self, pair: PairId, expiry: Option<Tick>) {
        if let Some(expiry) = expiry {
            self.tree.set_expiry(pair, expiry);
        }
    }

    fn count(&mut self, found: &Judgement, stale: Stale) {
        let work = &mut self.changes.work;
        work.segments += u64::from(found.segments);
        if stale == Stale::Followed {
            work.followed += 1;
            return;
        }
        work.examined += 1;
        match stale {
            Stale::Occlusion => work.visibility_only += 1,
            Stale::Brightness => work.brightness_only += 1,
            _ => work.reevaluated += 1,
        }
    }

    /// Adds an evaluation to the history of a pair, before it is applied.
    fn remember(&mut self, pair: PairId, found: &Judgement, stale: Stale) {
        let Some(ahead) = self.judge.lookahead() else { return };
        let (a, b) = self.tree.ends(pair);
        let dynamic = match stale {
            Stale::Moved | Stale::Occlusion | Stale::Due => true,
            Stale::New => self.judge.stale(a, b, false) == Stale::Moved,
            _ => return,
        };
        let same = matches!(
            (self.tree.state(pair), found.verdict),
            (State::Active, Verdict::Link) | (State::Refined(_), Verdict::Refine(_))
        );
        let goes_on = matches!(found.verdict, Verdict::Link | Verdict::Refine(_));
        let sample = Sample {
            exchange_area_m2: found.carried.exchange_area_m2,
            visibility: found.carried.visibility,
            margin: match found.margin.error() {
                Margin::ENDLESS => Sample::FIRM,
                margin => margin,
            },
        };
        let before = self.tree.history(pair);
        let history = match same {
            _ if !(dynamic && goes_on) => History::default(),
            // It came to rest.
            true if stale == Stale::Due && before.is_straight_through(&sample) => {
                match self.judge.stale(a, b, false) {
                    Stale::Moved | Stale::Occlusion => before.evaluated(sample, ahead),
                    _ => History::default(),
                }
            }
            true => before.evaluated(sample, ahead),
            false => History::begun(sample, ahead),
        };
        self.tree.set_history(pair, history);
    }

    fn enqueue(
        &mut self,
        pairs: Range<u32>,
        list: Below,
        item: &Item,
        (chunk, wave): (&Chunk<'_>, &Wave),
    ) {
        if !pairs.is_empty() {
            let list = match list {
                Below::Same => self.next.hand_on(item.list, wave),
                Below::Own(List::CLEAR) => List::CLEAR,
                Below::Own(list) => self.next.push_candidates(list.of(&chunk.candidates)),
            };
            self.next.items.extend(pairs.map(|id| Item { pair: PairId(id), list }));
        }
    }

    /// Carries out a verdict; returns the children to be visited.
    fn apply(&mut self, pair: PairId, found: &Judgement, stale: Stale) -> Range<u32> {
        let before = self.tree.state(pair);
        let (a, b) = self.tree.ends(pair);
        let wanted = match found.verdict {
            Verdict::CoarseLink => {
                self.changes.coarse_links.push(CoarseLink { a, b, carried: found.carried });
                return 0..0;
            }
            Verdict::Link => State::Active,
            Verdict::Refine(side) => State::Refined(side),
            Verdict::RefineSelf => State::RefinedSelf,
            Verdict::Cull(reason) => State::Culled(reason),
        };
        let moved = match stale {
            Stale::New => wanted == State::Active && self.judge.stale(a, b, false) == Stale::Moved,
            stale => {
                wanted == State::Active && {
                    matches!(stale, Stale::Moved | Stale::Followed | Stale::Due)
                }
            }
        };
        let work = &mut self.changes.work;
        work.dynamic_links += u64::from(moved);
        if before != wanted {
            work.changed += 1;
            work.promoted += u64::from(before.is_refined() && wanted == State::Active);
            work.demoted += u64::from(before == State::Active && wanted.is_refined());
            self.note_change(pair, wanted, &found.carried);
            self.leave(pair, before);
            let children = self.enter(pair, wanted, found);
            self.tree.set_margin(pair, found.margin);
            return children;
        }
        self.tree.set_margin(pair, found.margin);
        match wanted {
            State::Active => self.carry(pair, &found.carried),
            _ => return self.tree.children(pair),
        }
        0..0
    }

    /// Sets the values of a link that stays one.
    fn carry(&mut self, pair: PairId, carried: &Carried) {
        let before = self.tree.link(pair).expect("a link").carried;
        if before != *carried {
            let key = self.key(pair);
            self.hash.remove(key, &before);
            self.hash.add(key, carried);
            self.changes.work.changed += 1;
            self.changes.work.occlusion_changed +=
                u64::from(before.visibility != carried.visibility);
            self.tree.set_carried(pair, carried);
            self.record(Edit::Set(pair));
            let kind = match before.visibility.cmp(&carried.visibility) {
                Ordering::Equal => return,
                Ordering::Greater => EventKind::Occluded,
                Ordering::Less => EventKind::Revealed,
            };
            self.note(kind, pair, Some(before), Some(*carried));
        }
    }

    /// Notes that a pair becomes a link or ceases to be one.
    fn note_change(&mut self, pair: PairId, wanted: State, carried: &Carried) {
        let before = self.tree.link(pair).map(|link| link.carried);
        let after = (wanted == State::Active).then_some(*carried);
        let kind = match (self.tree.state(pair), wanted) {
            (State::Active, State::Culled(_)) => EventKind::Culled,
            (State::Active, _) => EventKind::Demoted,
            (State::Culled(_), State::Active) => EventKind::Woken,
            (State::Refined(_) | State::RefinedSelf, State::Active) => EventKind::Promoted,
            _ => return,
        };
        self.note(kind, pair, before, after);
    }

    fn note(
        &mut self,
        kind: EventKind,
        pair: PairId,
        before: Option<Carried>,
        after: Option<Carried>,
    ) {
        if self.record.events {
            let (a, b) = self.tree.ends(pair);
            let ends = (self.judge.key(a), self.judge.key(b));
            self.changes.events.push(LinkEvent { kind, ends, before, after });
        }
    }

    /// Removes the links and children of a pair, so that it is like a new one.
    fn leave(&mut self, pair: PairId, before: State) {
        match before {
            State::Active => self.unlink(pair),
            State::Refined(_) | State::RefinedSelf => self.remove_below(pair),
            State::Culled(_) | State::New | State::Vacant => {}
        }
    }

    fn enter(&mut self, pair: PairId, wanted: State, found: &Judgement) -> Range<u32> {
        let (a, b) = self.tree.ends(pair);
        if self.record.edits && wanted.is_refined() {
            self.changes.refined.push(pair);
        }
        match wanted {
            State::Refined(side) => {
                let (children, made) = self.judge.split(if side == Side::A { a } else { b });
                self.changes.work.elements_made += if made { children.len() as u64 } else { 0 };
                let ends = (0..children.len()).map(|k| {
                    let child = ElementId(children.start + k as u32);
                    if side == Side::A { (child, b) } else { (a, child) }
                });
                self.tree.refine(pair, wanted, ends)
            }
            State::RefinedSelf => {
                let children = self.judge.children(a);
                let with = |one: u32| (one..children.end).map(move |two| (one, two));
                let ends: Vec<_> = children.clone().flat_map(with).collect();
                let ends = ends.into_iter().map(|(one, two)| (ElementId(one), ElementId(two)));
                self.tree.refine(pair, wanted, ends)
            }
            State::Active => {
                self.tree.set_state(pair, wanted);
                self.tree.set_carried(pair, &found.carried);
                self.hash.add(self.key(pair), &found.carried);
                self.record(Edit::Set(pair));
                0..0
            }
            State::Culled(_) | State::New | State::Vacant => {
                self.tree.set_state(pair, wanted);
                self.drop_coarse_link(pair);
                0..0
            }
        }
    }

    fn unlink(&mut self, pair: PairId) {
        let link = self.tree.link(pair).expect("a link");
        self.hash.remove(self.key(pair), &link.carried);
        self.record(Edit::Removed(link.a, link.b));
    }

    /// Removes everything below a refined pair, from the leaves up.
    fn remove_below(&mut self, pair: PairId) {
        for child in self.tree.children(pair).map(PairId) {
            let state = self.tree.state(child);
            self.leave(child, state);
            self.drop_coarse_link(child);
        }
        if let State::Refined(side) = self.tree.state(pair) {
            let (a, b) = self.tree.ends(pair);
            self.judge.release(if side == Side::A { a } else { b });
        }
        self.tree.remove_children(pair);
    }

    fn drop_coarse_link(&mut self, pair: PairId) {
        let (a, b) = self.tree.ends(pair);
        if self.judge.is_coarse_pair(a, b) {
            self.changes.dropped_coarse_links.push((a, b));
        }
    }

    fn key(&self, pair: PairId) -> u64 {
        let (a, b) = self.tree.ends(pair);
        pair_key(self.judge.key(a), self.judge.key(b))
    }

    fn record(&mut self, edit: Edit) {
        if self.record.edits {
            self.changes.edits.push(edit);
        }
    }
}
