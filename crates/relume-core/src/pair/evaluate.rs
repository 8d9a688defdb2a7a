//! Evaluation of pairs against an unchanging tree: where it is decided what is judged again, what keeps its verdict, and what
//! is skipped with its subtree.

use rayon::prelude::*;

use crate::element::ElementId;
use crate::predict::{History, Lookahead, Tick};

use super::carried::Carried;
use super::certificate_tests::Finding;
use super::margin::Margin;
use super::space::Judge;
use super::tree::{CullReason, PairId, PairTree, State};
use super::tuning::CHUNK;
use super::verdict::{Judgement, Stale, Verdict};
use super::wave::{Below, Item, List};

/// Evaluated pairs of one task.
pub(super) struct Chunk<'a> {
    pub(super) items: &'a [Item],
    pub(super) ends: Vec<(ElementId, ElementId)>,
    pub(super) outcomes: Vec<Outcome>,
    pub(super) candidates: Vec<u32>,
}

/// Result of evaluating one pair against the unchanging tree.
pub(super) enum Outcome {
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

/// Lists of candidate occluders of a task.
struct Lists<'a> {
    /// Those of all pairs of the wave.
    candidates: &'a [u32],
    /// Those of the children of the task's pairs.
    narrowed: &'a mut Vec<u32>,
}

/// Evaluates a block of pairs in parallel, in chunks whose order is that of the pairs.
pub(super) fn judge_block<'a, J: Judge>(
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
            .map(|item| {
                evaluate(tree, judge, item, Lists { candidates, narrowed: &mut narrowed }, fresh)
            })
            .collect();
        let ends = items.iter().map(|item| tree.ends(item.pair)).collect();
        Chunk { items, ends, outcomes, candidates: narrowed }
    };
    items.par_chunks(CHUNK).map(judge_chunk).collect()
}

/// Decides what of a pair is evaluated again, and evaluates it.
fn evaluate<J: Judge>(
    tree: &PairTree,
    judge: &J,
    item: &Item,
    Lists { candidates, narrowed }: Lists<'_>,
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
    judge_again(tree, judge, item, stale, Lists { candidates, narrowed }, &unaffected)
}

/// Judges a pair of which something changed; `unaffected` is its certificate where nothing but the light did.
fn judge_again<J: Judge>(
    tree: &PairTree,
    judge: &J,
    item: &Item,
    stale: Stale,
    Lists { candidates, narrowed }: Lists<'_>,
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
        _ => certificate(judge, (a, b), found.verdict, stale, may_be_clear),
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
    verdict: Verdict,
    stale: Stale,
    may_be_clear: bool,
) -> Option<Tick> {
    match (verdict, stale) {
        // What covers it may leave.
        (Verdict::Cull(CullReason::Covered), _) => Some(judge.expiry(a, b, Finding::Unaffected)),
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
