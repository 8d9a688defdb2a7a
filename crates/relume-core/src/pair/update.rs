//! Bringing a pair tree up to date: judge in parallel what may have changed, then edit in order.
//!
//! Work goes in blocks of fixed size; every block is judged in chunks of fixed size, whose results
//! are applied in order. The tree is the same for any number of threads. A cold build is the update
//! of a tree that holds nothing but its root.

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
use crate::transport::Side;

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
    /// Undecided: it is left as it is, and reported.
    CoarseLink,
}

/// A verdict with what it rests on.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// What the pair carries as a link, or while it is held.
    pub carried: Carried,
    /// What the verdict withstands.
    pub margin: Margin,
    /// Visibility segments traced.
    pub segments: u32,
}

/// What may have changed of a pair since it was judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stale {
    /// Nothing, and nothing of any pair below it.
    Nothing,
    /// Nothing of the pair itself.
    Below,
    /// How bright its ends are: its verdict, not what it carries.
    Brightness,
    /// What stands between its ends.
    Occlusion,
    /// Where its ends are; by certificate nothing stands between them.
    Followed,
    /// What was extrapolated of it is to be evaluated.
    Due,
    /// Where its ends are.
    Moved,
    /// Everything: it has not been judged yet.
    New,
}

/// The hierarchy that the two ends of a pair come from.
pub trait Hierarchy {
    /// Ids of the children; empty for a leaf.
    fn children(&self, id: ElementId) -> Range<u32>;
    /// The children, made where there are none yet; and whether they were. Each call is a use of
    /// them, until [`Hierarchy::release`].
    fn split(&mut self, id: ElementId) -> (Range<u32>, bool);
    /// Takes back one use of the children.
    fn release(&mut self, id: ElementId);
    /// The name of an element, which does not depend on history.
    fn key(&self, id: ElementId) -> ElementKey;
    /// Elements alive.
    fn element_count(&self) -> usize;
}

/// What the pair tree asks of the space it works in.
pub trait Judge: Hierarchy + Sync {
    /// Judges a pair. `candidates` are the possible occluders of the pair above; those of this
    /// pair are appended to `narrowed`, whose present content belongs to other pairs. A pure
    /// function of the space: `candidates` only say where to look, and `known` is what a link carries on
    /// which nothing but the light changed.
    fn judge(
        &self,
        ends: (ElementId, ElementId),
        known: Option<&Carried>,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement;

    /// What is left of the margin of a pair after the changes of brightness since the last update, if
    /// its verdict withstands them.
    fn withstands(&self, a: ElementId, b: ElementId, margin: Margin) -> Option<Margin>;

    /// What may have changed of a pair since the last update. Of a pair that is `certified` (and not
    /// culled) nothing stands between its ends, or what does is as it was.
    fn stale(&self, a: ElementId, b: ElementId, certified: bool) -> Stale;

    /// Does the part of [`Judge::judge`] that a change of occlusion asks for, for a refined pair with
    /// ends at rest, if its verdict does not depend on occlusion. Whether that is so.
    fn narrow(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> bool;

    /// Whether the light on one of the ends changed, at a pair whose verdict depends on it.
    fn brightness_changed(&self, a: ElementId, b: ElementId) -> bool;

    /// Whether a certificate stands at this instant.
    fn certified(&self, until: Tick) -> bool;

    /// How far ahead pairs are extrapolated, if they are.
    fn lookahead(&self) -> Option<&Lookahead>;

    /// Whether it is worth asking how long nothing will stand between the ends of a refined pair with
    /// these possible occluders.
    fn may_be_clear(&self, _a: ElementId, _b: ElementId, narrowed: &[u32]) -> bool {
        narrowed.is_empty()
    }

    /// The last tick until which the known motion cannot change what was found of a pair; 0 if none.
    fn expiry(&self, a: ElementId, b: ElementId, finding: Finding) -> Tick;

    /// Whether this pair is one of those that are held when it is not culled.
    fn is_coarse_pair(&self, a: ElementId, b: ElementId) -> bool;

    /// Whether a link between these two is worked out further from their places once it is one, so that it must be known
    /// where they were looked at again.
    fn is_apart(&self, _a: ElementId, _b: ElementId) -> bool {
        false
    }
}

/// Exact counts of what was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Pairs met on the walk, those included that turned out to be unaffected.
    pub visited: u64,
    /// Pairs judged.
    pub examined: u64,
    /// Pairs whose exchange area alone followed the motion of their ends: by certificate nothing
    /// stands between them.
    pub followed: u64,
    /// Links of which X and V were extrapolated.
    pub extrapolated: u64,
    /// Pairs passed over, with all below them, because their certificate stands.
    pub certified: u64,
    /// Pairs judged for the coarse solution, before; each is met again.
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
    /// Adds an update with the oracle to one down to the coarse level. What was visited and judged is
    /// that of the second, which comes by every pair of the first again; what was done is that of
    /// both.
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
    /// This pair is a link with new values.
    Set(PairId),
    /// These two are linked no more.
    Removed(ElementId, ElementId),
}

/// What happened to a link.
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
    /// What happened.
    pub kind: EventKind,
    /// Both ends.
    pub ends: (ElementKey, ElementKey),
    /// What it carried; `None` where it was no link.
    pub before: Option<Carried>,
    /// What it carries; `None` where it is no link.
    pub after: Option<Carried>,
}

/// What an update writes down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Edits to the links.
    pub edits: bool,
    /// Events of the links.
    pub events: bool,
}

/// A pair that was held, with what it would carry.
#[derive(Clone, Copy, Debug)]
pub struct CoarseLink {
    /// First end.
    pub a: ElementId,
    /// Second end.
    pub b: ElementId,
    /// What it would carry.
    pub carried: Carried,
}

/// What an update did.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Counts.
    pub work: Work,
    /// Edits to the links, in order; empty where they are not recorded.
    pub edits: Vec<Edit>,
    /// Events of links that were there before or are there now, in order; empty where they are not
    /// recorded. What is made or removed below a refined pair is not among them.
    pub events: Vec<LinkEvent>,
    /// Pairs that were refined anew, ascending; empty where edits are not recorded.
    pub refined: Vec<PairId>,
    /// Pairs held.
    pub coarse_links: Vec<CoarseLink>,
    /// Pairs that were held once and may be so no more; both ends may have vanished since.
    pub dropped_coarse_links: Vec<(ElementId, ElementId)>,
    /// Links that are worked out further ([`Judge::is_apart`]) of which more than the light was looked at, whatever they
    /// carry now; empty where edits are not recorded.
    pub apart: Vec<(ElementId, ElementId)>,
}

/// The memory that an update may use is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfMemory;

/// Pairs judged by one task.
const CHUNK: usize = 128;

/// Pairs judged before their results are applied.
const BLOCK: usize = 1 << 15;

/// A pair tree with the hash over its links.
pub struct Pairs<'a> {
    /// The tree.
    pub tree: &'a mut PairTree,
    /// The hash.
    pub hash: &'a mut PairHash,
}

/// What an update is about.
pub struct Scope<'a> {
    /// What may stand between any two elements.
    pub candidates: &'a [u32],
    /// What is written down.
    pub record: Record,
    /// Pairs (ascending) that an update with the same [`Judge::stale`] has refined already: all of their children are
    /// looked at.
    pub fresh: &'a [PairId],
    /// Asked after each block with the tree, the number of elements and the scratch memory in bytes.
    pub may_go_on: &'a dyn Fn(&PairTree, usize, u64) -> bool,
}

/// Brings a tree, with the hash over its links, up to date.
///
/// # Errors
/// [`OutOfMemory`] as soon as `may_go_on` says no: what was looked at until then is up to date, the rest is as it was, and
/// pairs may be left unjudged.
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
        // Pairs that are due though no motion led to them.
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

/// Pairs to be looked at, with the possible occluders of the pairs above them.
#[derive(Clone, Debug, Default)]
struct Wave {
    items: Vec<Item>,
    candidates: Vec<u32>,
    /// Where lists of the wave before are that were handed on as they were, by their start there.
    handed_on: BTreeMap<u32, List>,
}

#[derive(Clone, Copy, Debug)]
struct Item {
    pair: PairId,
    list: List,
}

impl Item {
    /// Whether the pair is no longer what was looked at: an edit before it in the same wave removed
    /// it. Only pairs that are due can have another of their wave above them.
    fn is_gone(&self, tree: &PairTree, ends: (ElementId, ElementId)) -> bool {
        tree.state(self.pair) == State::Vacant || tree.ends(self.pair) != ends
    }
}

/// Some candidates of a wave.
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
    /// Those of the pair above it: nearly all were left.
    Same,
    /// A list of its own, of its chunk.
    Own(List),
}

impl Below {
    /// A list that leaves more than this of every 8 is not worth a copy: in a heap of slivers every shaft holds nearly
    /// all others, and lists of their own would be most of the memory.
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

/// What a look at a pair found.
enum Outcome {
    /// Nothing can have changed here or below, by certificate.
    Certified,
    /// Nothing has changed here or below, nor can it until then.
    Unaffected(Tick),
    /// Look at the children; with a certificate, unless the pair keeps the one it has, as below.
    Descend(Option<Tick>),
    /// Look at the children, with these candidates.
    Narrowed(Below),
    /// The light changed, the verdict did not; look at the children.
    Withstands(Margin, Option<Tick>),
    /// A link, extrapolated.
    Extrapolated(Carried, Option<Margin>),
    /// Judged, with the candidates of its children and a certificate.
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

/// Until when what was found of a pair cannot change; `None` where the pair keeps the certificate that it has.
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

/// What becomes of a dynamic pair that is not due; `None` if the light on it changed so much that it is
/// judged all the same.
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

    /// Takes an evaluation into the history of a pair, before it is applied.
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

    /// Carries out a verdict; returns the children to be looked at.
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

    /// A link stays one; it may carry something else.
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

    /// Undoes what a pair was: it is as good as new then.
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
