//! The one writer of a pair tree: applies outcomes in order and records edits and events.

use std::cmp::Ordering;
use std::ops::Range;

use crate::element::ElementId;
use crate::predict::{History, Sample, Tick};
use crate::transport::Side;

use super::carried::Carried;
use super::changes::{Changes, CoarseLink, Edit, EventKind, LinkEvent, Record};
use super::evaluate::{Chunk, Outcome};
use super::hash::{PairHash, pair_key};
use super::margin::Margin;
use super::space::Judge;
use super::tree::{PairId, PairTree, State};
use super::verdict::{Judgement, Stale, Verdict};
use super::wave::{Below, Item, List, Wave};

/// The one writer of a tree.
pub(super) struct Editor<'a, J> {
    pub(super) tree: &'a mut PairTree,
    pub(super) hash: &'a mut PairHash,
    pub(super) judge: &'a mut J,
    pub(super) record: Record,
    pub(super) changes: Changes,
    pub(super) next: Wave,
}

impl<J: Judge> Editor<'_, J> {
    /// Applies the outcomes of a chunk, in order.
    pub(super) fn apply_chunk(&mut self, chunk: &Chunk<'_>, wave: &Wave) {
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
        let came_to_rest = stale == Stale::Due && before.is_straight_through(&sample);
        let history = if !(dynamic && goes_on) {
            History::default()
        } else if !same {
            History::begun(sample, ahead)
        } else if came_to_rest
            && !matches!(self.judge.stale(a, b, false), Stale::Moved | Stale::Occlusion)
        {
            History::default()
        } else {
            before.evaluated(sample, ahead)
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
        let has_moved = || match stale {
            Stale::New => self.judge.stale(a, b, false) == Stale::Moved,
            stale => matches!(stale, Stale::Moved | Stale::Followed | Stale::Due),
        };
        let moved = wanted == State::Active && has_moved();
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
            self.keep_edit(Edit::Set(pair));
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
                self.keep_edit(Edit::Set(pair));
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
        self.keep_edit(Edit::Removed(link.a, link.b));
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

    fn keep_edit(&mut self, edit: Edit) {
        if self.record.edits {
            self.changes.edits.push(edit);
        }
    }
}
