//! The pair tree as a table by names that do not depend on history: brute force as the judge of
//! what changed.

use std::collections::BTreeMap;

use relume_core::element::{ElementId, Forest};
use relume_core::pair::{Carried, PairId, PairTree, State};
use relume_core::session::Session;

/// An end of a pair: its id in the fixed part of the forest, else its facet and the path below it.
pub(crate) type End = (u32, u32);

/// The name of a pair.
pub(crate) type Name = (End, End);

/// What a pair is, and what it carries if it is a link.
pub(crate) type Is = (State, Option<Carried>);

fn end(forest: &Forest, id: ElementId) -> End {
    let key = forest.key(id);
    if id.0 < forest.fixed_len() { (id.0, 0) } else { (key.facet, key.path) }
}

/// All pairs of a solved session.
pub(crate) fn pairs_of(session: &Session) -> BTreeMap<Name, Is> {
    let (tree, forest) = session.frame().unwrap().pairs();
    let mut out = BTreeMap::new();
    let mut stack = vec![PairTree::ROOT];
    while let Some(id) = stack.pop() {
        let (a, b) = tree.ends(id);
        let is = (tree.state(id), tree.link(id).map(|l| l.carried));
        let twice = out.insert((end(forest, a), end(forest, b)), is);
        assert!(twice.is_none(), "a pair is in the tree twice");
        stack.extend(tree.children(id).map(PairId));
    }
    out
}

/// How two states differ, counted by brute force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Difference {
    /// Pairs that were there before, but are or carry something else now.
    pub(crate) other: u64,
    /// Of these, refined pairs that became links.
    pub(crate) promoted: u64,
    /// Of these, links that were refined.
    pub(crate) demoted: u64,
    /// Of these, links that stayed links with another visibility.
    pub(crate) occluded: u64,
    /// Pairs that are there only now, and pairs below one that is another than before: those were
    /// taken down with it and made anew, though they may look the same.
    pub(crate) new: u64,
}

/// What a solved session holds that a table from before does not.
pub(crate) fn difference(before: &BTreeMap<Name, Is>, after: &Session) -> Difference {
    let (tree, forest) = after.frame().unwrap().pairs();
    let mut out = Difference::default();
    let mut stack = vec![(PairTree::ROOT, false)];
    while let Some((id, anew)) = stack.pop() {
        let (a, b) = tree.ends(id);
        let is = (tree.state(id), tree.link(id).map(|l| l.carried));
        let was = before.get(&(end(forest, a), end(forest, b))).filter(|_| !anew);
        match was {
            None => out.new += 1,
            Some(was) => out.compare(was, &is),
        }
        let anew = was.is_none_or(|was| was.0 != is.0);
        stack.extend(tree.children(id).map(|child| (PairId(child), anew)));
    }
    out
}

impl Difference {
    fn compare(&mut self, was: &Is, is: &Is) {
        self.other += u64::from(was != is);
        self.promoted += u64::from(was.0.is_refined() && is.0 == State::Active);
        self.demoted += u64::from(was.0 == State::Active && is.0.is_refined());
        if let (Some(c), Some(d)) = (was.1, is.1) {
            self.occluded += u64::from(c.visibility != d.visibility);
        }
    }
}

/// The first pairs that differ between two sessions that should agree, in words.
pub(crate) fn first_differences(warm: &Session, cold: &Session) -> String {
    let (warm, cold) = (pairs_of(warm), pairs_of(cold));
    let mut names: Vec<&Name> = warm.keys().chain(cold.keys()).collect();
    names.sort();
    names.dedup();
    let differ = names.into_iter().filter(|n| warm.get(n) != cold.get(n));
    let word = |n: &Name| format!("\n  {n:?}: {:?}, from scratch {:?}", warm.get(n), cold.get(n));
    differ.take(4).map(word).collect()
}
