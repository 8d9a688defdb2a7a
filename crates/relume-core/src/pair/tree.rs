//! The tree of unordered element pairs.

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;

use crate::element::{ElementId, Renumbering};
use crate::predict::{History, Lookahead, Tick};

use super::carried::{Carried, Gradients};
use super::margin::Margin;
use crate::transport::Side;

/// Index of a pair in a [`PairTree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PairId(pub u32);

/// Why a pair exchanges nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CullReason {
    /// One end is wholly behind the other, or an element is paired with itself.
    FacingAway,
    /// A body is absent.
    Absent,
    /// Two lights.
    NoReceiver,
    /// The ends touch, and other surfaces in their plane show in place of all that they have in common.
    Covered,
    /// A group paired with itself that is near-flat: what its facets exchange is left out.
    Grazing,
}

/// State of a pair at this instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Not judged yet.
    New,
    /// A link, used in both directions.
    Active,
    /// Its children carry the transport: those of one side with the whole other side.
    Refined(Side),
    /// A cluster paired with itself; its children are all pairs of the cluster's children.
    RefinedSelf,
    /// It exchanges nothing, for the reason given.
    Culled(CullReason),
    /// No pair: room to be used again.
    Vacant,
}

impl State {
    /// Whether the pair has children.
    #[inline]
    pub fn is_refined(self) -> bool {
        matches!(self, State::Refined(_) | State::RefinedSelf)
    }

    const ALL: [State; 11] = [
        State::New,
        State::Active,
        State::Refined(Side::A),
        State::Refined(Side::B),
        State::RefinedSelf,
        State::Culled(CullReason::FacingAway),
        State::Culled(CullReason::Absent),
        State::Culled(CullReason::NoReceiver),
        State::Vacant,
        State::Culled(CullReason::Covered),
        State::Culled(CullReason::Grazing),
    ];

    fn code(self) -> u32 {
        match self {
            State::New => 0,
            State::Active => 1,
            State::Refined(Side::A) => 2,
            State::Refined(Side::B) => 3,
            State::RefinedSelf => 4,
            State::Culled(CullReason::FacingAway) => 5,
            State::Culled(CullReason::Absent) => 6,
            State::Culled(CullReason::NoReceiver) => 7,
            State::Vacant => 8,
            State::Culled(CullReason::Covered) => 9,
            State::Culled(CullReason::Grazing) => 10,
        }
    }
}

/// A link as the tree hands it out.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// First end.
    pub a: ElementId,
    /// Second end; the order is inherited from the pair of facets above.
    pub b: ElementId,
    /// Its values.
    pub carried: Carried,
}

impl Link {
    /// Exchange area X without occlusion, m2.
    pub fn exchange_area_m2(&self) -> f32 {
        self.carried.exchange_area_m2
    }

    /// Visibility V, in [0, 1].
    pub fn visibility(&self) -> f32 {
        self.carried.visibility()
    }
}

/// A node: 20 bytes. The two highest bits of both ends hold the state.
#[derive(Clone, Copy, Debug)]
struct Node {
    a: u32,
    b: u32,
    /// For a link X, V (below its margin) and gradients; for a refined pair its first child, the number of children and its
    /// margins.
    payload: [u32; 3],
}

/// Spare capacity that vectors keep, as one part in this many of their length.
const SPARE: usize = 32;

/// Bits of an element's id.
const ID_BITS: u32 = 30;
const ID_MASK: u32 = (1 << ID_BITS) - 1;

impl Node {
    fn new(a: ElementId, b: ElementId, state: State) -> Node {
        debug_assert!(a.0 <= ID_MASK && b.0 <= ID_MASK, "more than 2^30 elements");
        let mut node = Node { a: a.0, b: b.0, payload: [0; 3] };
        node.set_state(state);
        node
    }

    #[inline]
    fn state(&self) -> State {
        State::ALL[((self.a >> ID_BITS) << 2 | self.b >> ID_BITS) as usize]
    }

    fn set_state(&mut self, state: State) {
        let code = state.code();
        self.a = self.a & ID_MASK | (code >> 2) << ID_BITS;
        self.b = self.b & ID_MASK | (code & 3) << ID_BITS;
    }

    #[inline]
    fn carried(&self) -> Carried {
        let [x, v, g] = self.payload;
        let [au, av, bu, bv] = g.to_le_bytes();
        Carried {
            exchange_area_m2: f32::from_bits(x),
            visibility: v as u16,
            gradients: Gradients { over_a: [au as i8, av as i8], over_b: [bu as i8, bv as i8] },
        }
    }

    fn set_carried(&mut self, carried: &Carried) {
        let Gradients { over_a: [au, av], over_b: [bu, bv] } = carried.gradients;
        self.payload = [
            carried.exchange_area_m2.to_bits(),
            self.payload[1] & !0xffff | u32::from(carried.visibility),
            u32::from_le_bytes([au as u8, av as u8, bu as u8, bv as u8]),
        ];
    }
}

/// Nodes of a pair tree by state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateCounts {
    /// Links.
    pub active: u64,
    /// Pairs whose children carry the transport.
    pub refined: u64,
    /// Pairs that exchange nothing.
    pub culled: u64,
}

/// The tree of pairs, from the one root (scene, scene). Ids depend on history.
#[derive(Clone, Debug, Default)]
pub struct PairTree {
    nodes: Vec<Node>,
    /// First ids of vacant groups of siblings, by their number.
    vacant: Vec<Vec<u32>>,
    counts: StateCounts,
    /// Expiry of each pair's certificate.
    expiry: SideTable<Tick>,
    /// Last evaluations of each extrapolated pair.
    history: SideTable<History>,
    /// Pairs that are extrapolated.
    live: usize,
}

/// Values by pair beside the nodes; takes no memory while all values are the default.
#[derive(Clone, Debug, Default)]
struct SideTable<T> {
    values: Vec<T>,
}

impl<T: Copy + Default + PartialEq> SideTable<T> {
    #[inline]
    fn get(&self, id: PairId) -> T {
        self.values.get(id.0 as usize).copied().unwrap_or_default()
    }

    /// Sets one of `len`.
    fn set(&mut self, id: PairId, value: T, len: usize) {
        let at = id.0 as usize;
        if at >= self.values.len() {
            if value == T::default() {
                return;
            }
            self.values.reserve_exact(len - self.values.len());
            self.values.resize(len, T::default());
        }
        self.values[at] = value;
    }

    /// Moves the value at `order[k]` to k.
    fn reorder(&mut self, order: &[u32]) {
        if !self.values.is_empty() {
            self.values = order.iter().map(|&from| self.get(PairId(from))).collect();
        }
    }

    fn trim(&mut self) {
        self.values.shrink_to(self.values.len() + self.values.len() / SPARE);
    }

    fn memory_bytes(&self) -> u64 {
        (self.values.capacity() * size_of::<T>()) as u64
    }

    fn used_bytes(&self) -> u64 {
        (self.values.len() * size_of::<T>()) as u64
    }
}

impl PairTree {
    /// The root alone, unjudged.
    pub fn new(root: ElementId) -> PairTree {
        PairTree { nodes: vec![Node::new(root, root, State::New)], ..PairTree::default() }
    }

    /// The root pair.
    pub const ROOT: PairId = PairId(0);

    /// Pairs in the tree.
    pub fn len(&self) -> usize {
        (self.counts.active + self.counts.refined + self.counts.culled) as usize
    }

    /// Whether nothing has been judged.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Pairs by state.
    pub fn counts(&self) -> StateCounts {
        self.counts
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        let lists: usize =
            self.vacant.iter().map(|l| l.capacity() * 4 + size_of::<Vec<u32>>()).sum();
        let side_tables = self.expiry.memory_bytes() + self.history.memory_bytes();
        (self.nodes.capacity() * size_of::<Node>() + lists) as u64 + side_tables
    }

    /// Bytes in use: without the room that vectors keep to grow into, which is no memory before it is
    /// written to.
    pub fn used_bytes(&self) -> u64 {
        let lists: usize = self.vacant.iter().map(|l| l.len() * 4 + size_of::<Vec<u32>>()).sum();
        let side_tables = self.expiry.used_bytes() + self.history.used_bytes();
        (self.nodes.len() * size_of::<Node>() + lists) as u64 + side_tables
    }

    /// Room that no pair has.
    pub fn vacant_len(&self) -> usize {
        self.nodes.len() - self.len()
    }

    /// Follows elements to their new ids. Pairs of those that are gone are of no use then: see [`PairTree::regroup`].
    pub fn renumber(&mut self, to: &Renumbering) {
        for node in &mut self.nodes {
            if node.state() != State::Vacant {
                let end = |packed: u32| packed & !ID_MASK | to.new_of(packed & ID_MASK) & ID_MASK;
                (node.a, node.b) = (end(node.a), end(node.b));
            }
        }
    }

    /// Follows the root, paired with itself, to its present children: pairs of what it has more are absent, as pairs of
    /// what it has no more must have been.
    pub fn regroup(&mut self, children: Range<u32>) {
        let old = self.children(PairTree::ROOT);
        if self.state(PairTree::ROOT) != State::RefinedSelf {
            return;
        }
        let with = |one: u32| (one..children.end).map(move |two| (ElementId(one), ElementId(two)));
        let wanted: Vec<_> = children.clone().flat_map(with).collect();
        if old.clone().map(|id| self.ends(PairId(id))).eq(wanted.iter().copied()) {
            return;
        }
        let mut known = BTreeMap::new();
        for id in old.clone().map(PairId) {
            let node = self.nodes[id.0 as usize];
            let same = known.insert(self.ends(id), (node, self.expiry(id), self.history(id)));
            // Ends that are gone cannot be told apart.
            same.iter().for_each(|(node, ..)| self.count_out(node));
            self.set_history(id, History::default());
            self.nodes[id.0 as usize].set_state(State::Vacant);
        }
        self.make_vacant(old);
        let first = self.refine(PairTree::ROOT, State::RefinedSelf, wanted.iter().copied()).start;
        for (id, ends) in (first..).map(PairId).zip(&wanted) {
            match known.remove(ends) {
                Some((node, expiry, history)) => {
                    self.nodes[id.0 as usize] = node;
                    self.set_expiry(id, expiry);
                    self.set_history(id, history);
                }
                None => self.set_state(id, State::Culled(CullReason::Absent)),
            }
        }
        known.into_values().for_each(|(node, ..)| self.count_out(&node));
    }

    /// Counts an absent pair no more.
    fn count_out(&mut self, node: &Node) {
        debug_assert_eq!(node.state(), State::Culled(CullReason::Absent));
        self.count(node.state(), -1);
    }

    /// Puts all pairs together so that no room is vacant: parents before children, level by level.
    pub fn compact(&mut self) {
        let old = std::mem::take(&mut self.nodes);
        let mut order = Vec::with_capacity(self.len());
        self.nodes.reserve_exact(self.len());
        self.nodes.push(old[0]);
        order.push(0);
        let mut at = 0;
        while at < self.nodes.len() {
            if self.nodes[at].state().is_refined() {
                let children = self.children(PairId(at as u32));
                self.nodes[at].payload[0] = self.nodes.len() as u32;
                self.nodes.extend_from_slice(&old[children.start as usize..children.end as usize]);
                order.extend(children);
            }
            at += 1;
        }
        debug_assert_eq!(self.nodes.len(), self.len());
        self.expiry.reorder(&order);
        self.history.reorder(&order);
        self.vacant = Vec::new();
    }

    /// Gives back room beyond a small reserve.
    pub fn trim(&mut self) {
        self.nodes.shrink_to(self.nodes.len() + self.nodes.len() / SPARE);
        self.expiry.trim();
        self.history.trim();
        self.vacant.iter_mut().for_each(|list| list.shrink_to(2 * list.len()));
    }

    /// Both ends of a pair.
    #[inline]
    pub fn ends(&self, id: PairId) -> (ElementId, ElementId) {
        let node = &self.nodes[id.0 as usize];
        (ElementId(node.a & ID_MASK), ElementId(node.b & ID_MASK))
    }

    /// State of a pair.
    #[inline]
    pub fn state(&self, id: PairId) -> State {
        self.nodes[id.0 as usize].state()
    }

    /// Ids of a pair's children; empty unless it is refined.
    #[inline]
    pub fn children(&self, id: PairId) -> std::ops::Range<u32> {
        let node = &self.nodes[id.0 as usize];
        match node.state().is_refined() {
            true => node.payload[0]..node.payload[0] + node.payload[1],
            false => 0..0,
        }
    }

    /// A pair as a link, if it is one.
    #[inline]
    pub fn link(&self, id: PairId) -> Option<Link> {
        let node = &self.nodes[id.0 as usize];
        let (a, b) = self.ends(id);
        (node.state() == State::Active).then(|| Link { a, b, carried: node.carried() })
    }

    /// Ids of all links, ascending.
    pub fn link_ids(&self) -> impl Iterator<Item = PairId> + '_ {
        (0..self.nodes.len() as u32).map(PairId).filter(|&id| self.state(id) == State::Active)
    }

    /// All links, in no particular order.
    pub fn links(&self) -> impl Iterator<Item = Link> + Clone + '_ {
        self.slots().flatten()
    }

    /// The links by id; `None` for pairs that are none.
    pub fn slots(&self) -> impl Iterator<Item = Option<Link>> + Clone + '_ {
        (0..self.nodes.len() as u32).map(|id| self.link(PairId(id)))
    }

    /// All links, each with the expiry of the certificate that lasts longest of its own and those of the pairs above it, which hold for
    /// all below; 0 without any. From the root down.
    pub fn certified_links(&self) -> Vec<(Link, Tick)> {
        let mut found = Vec::new();
        let mut open = vec![(PairTree::ROOT, 0)];
        while let Some((id, above)) = open.pop() {
            let until = self.expiry(id).max(above);
            found.extend(self.link(id).map(|link| (link, until)));
            open.extend(self.children(id).rev().map(|child| (PairId(child), until)));
        }
        found
    }

    /// [`PairTree::slots`] in parallel.
    pub fn par_slots(&self) -> impl IndexedParallelIterator<Item = Option<Link>> + '_ {
        (0..self.nodes.len() as u32).into_par_iter().map(|id| self.link(PairId(id)))
    }

    /// Sets what a pair without children is; what it carries is kept where it stays a link.
    pub(super) fn set_state(&mut self, id: PairId, state: State) {
        self.count(self.state(id), -1);
        self.count(state, 1);
        self.nodes[id.0 as usize].set_state(state);
    }

    pub(super) fn set_carried(&mut self, id: PairId, carried: &Carried) {
        debug_assert_eq!(self.state(id), State::Active);
        self.nodes[id.0 as usize].set_carried(carried);
    }

    /// Margin of a pair's verdict.
    #[inline]
    pub(super) fn margin(&self, id: PairId) -> Margin {
        let node = &self.nodes[id.0 as usize];
        match node.state() {
            State::Active => Margin::of_link((node.payload[1] >> 16) as u16),
            State::Refined(_) => Margin::of_refined(node.payload[2]),
            _ => Margin::Firm,
        }
    }

    pub(super) fn set_margin(&mut self, id: PairId, margin: Margin) {
        let node = &mut self.nodes[id.0 as usize];
        match node.state() {
            State::Active => {
                node.payload[1] = margin.packed() << 16 | node.payload[1] & 0xffff;
            }
            State::Refined(_) => node.payload[2] = margin.packed(),
            _ => {}
        }
    }

    /// Expiry of a pair's certificate; 0 without one.
    #[inline]
    pub(super) fn expiry(&self, id: PairId) -> Tick {
        self.expiry.get(id)
    }

    pub(super) fn set_expiry(&mut self, id: PairId, expiry: Tick) {
        self.expiry.set(id, expiry, self.nodes.len());
    }

    /// Last evaluations of a pair; empty where extrapolation is not asked for.
    #[inline]
    pub(super) fn history(&self, id: PairId) -> History {
        self.history.get(id)
    }

    pub(super) fn set_history(&mut self, id: PairId, history: History) {
        self.live -= usize::from(self.history.get(id).is_live());
        self.live += usize::from(history.is_live());
        self.history.set(id, history, self.nodes.len());
    }

    /// Pairs that are extrapolated from time to time.
    pub fn live_count(&self) -> usize {
        self.live
    }

    /// Extrapolated pairs that are due for evaluation, ascending.
    pub(super) fn due_pairs(&self, ahead: &Lookahead) -> Vec<PairId> {
        if self.live == 0 {
            return Vec::new();
        }
        let is_due =
            |(_, h): &(usize, &History)| h.is_live() && h.is_due(ahead) && h.is_older_than(ahead);
        let histories = self.history.values.iter().enumerate();
        histories.filter(is_due).map(|(id, _)| PairId(id as u32)).collect()
    }

    /// Takes back all certificates.
    pub fn forget_certificates(&mut self) {
        self.expiry = SideTable::default();
    }

    /// Extrapolates no pair any more.
    pub fn forget_histories(&mut self) {
        self.history = SideTable::default();
        self.live = 0;
    }

    fn count(&mut self, state: State, by: i64) {
        let slot = match state {
            State::Active => &mut self.counts.active,
            State::Refined(_) | State::RefinedSelf => &mut self.counts.refined,
            State::Culled(_) => &mut self.counts.culled,
            State::New | State::Vacant => return,
        };
        *slot = slot.wrapping_add_signed(by);
    }

    /// Makes a pair without children refined into unjudged ones; returns their ids.
    pub(super) fn refine(
        &mut self,
        parent: PairId,
        state: State,
        ends: impl ExactSizeIterator<Item = (ElementId, ElementId)>,
    ) -> std::ops::Range<u32> {
        let count = ends.len();
        let vacant = self.vacant.get_mut(count).and_then(Vec::pop);
        let first = vacant.unwrap_or(self.nodes.len() as u32);
        if vacant.is_none() {
            self.nodes.extend(ends.map(|(a, b)| Node::new(a, b, State::New)));
        } else {
            for (node, (a, b)) in self.nodes[first as usize..].iter_mut().zip(ends) {
                *node = Node::new(a, b, State::New);
            }
            for id in (first..first + count as u32).map(PairId) {
                self.set_expiry(id, 0);
                self.set_history(id, History::default());
            }
        }
        self.set_state(parent, state);
        self.nodes[parent.0 as usize].payload = [first, count as u32, 0];
        first..first + count as u32
    }

    /// Forgets the children of a refined pair, which have none themselves; it is to be judged anew.
    pub(super) fn remove_children(&mut self, parent: PairId) {
        let children = self.children(parent);
        for child in children.clone() {
            debug_assert!(!self.state(PairId(child)).is_refined());
            self.set_state(PairId(child), State::Vacant);
            self.set_history(PairId(child), History::default());
        }
        self.make_vacant(children);
        self.set_state(parent, State::New);
    }

    /// Keeps the room of siblings for others.
    fn make_vacant(&mut self, siblings: Range<u32>) {
        let count = siblings.len();
        if self.vacant.len() <= count {
            self.vacant.resize(count + 1, Vec::new());
        }
        self.vacant[count].push(siblings.start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_survive_being_packed() {
        let (a, b) = (ElementId(ID_MASK), ElementId(7));
        for (code, state) in State::ALL.into_iter().enumerate() {
            assert_eq!(state.code(), code as u32);
            let node = Node::new(a, b, state);
            assert_eq!((node.state(), node.a & ID_MASK, node.b & ID_MASK), (state, a.0, b.0));
        }
    }

    #[test]
    fn the_root_follows_its_children() {
        let mut tree = PairTree::new(ElementId(0));
        let both = [(1, 1), (1, 2), (2, 2)].map(|(a, b)| (ElementId(a), ElementId(b)));
        let absent = State::Culled(CullReason::Absent);
        for id in tree.refine(PairTree::ROOT, State::RefinedSelf, both.into_iter()) {
            tree.set_state(PairId(id), absent);
        }
        let first = PairId(tree.children(PairTree::ROOT).start);
        tree.set_state(first, State::New);
        let below = [(ElementId(5), ElementId(5))];
        let below = tree.refine(first, State::RefinedSelf, below.into_iter());
        let below = PairId(below.start);
        tree.set_state(below, State::Active);
        for (end, counts) in [(4, [1, 2, 5]), (2, [1, 2, 0]), (3, [1, 2, 2])] {
            tree.regroup(1..end);
            let found = tree.counts();
            assert_eq!([found.active, found.refined, found.culled], counts);
            let pairs: Vec<PairId> = tree.children(PairTree::ROOT).map(PairId).collect();
            assert_eq!(pairs.len() as u32, (end - 1) * end / 2);
            assert_eq!(tree.children(pairs[0]), below.0..below.0 + 1);
            assert!(pairs[1..].iter().all(|&pair| tree.state(pair) == absent));
        }
        // Elements 2 and 3 go at once.
        let [new_of, old_of] = [vec![0, 1, u32::MAX, u32::MAX, 4, 2], vec![0, 1, 5]];
        tree.renumber(&Renumbering::new(new_of, old_of));
        tree.regroup(1..2);
        tree.compact();
        let found = tree.counts();
        assert_eq!([found.active, found.refined, found.culled], [1, 2, 0]);
        assert_eq!((tree.len(), tree.links().count()), (3, 1));
    }

    #[test]
    fn what_a_link_carries_survives_being_packed() {
        let gradients = Gradients { over_a: [-127, 3], over_b: [127, -1] };
        let carried = Carried { exchange_area_m2: 0.123, visibility: 65_535, gradients };
        let mut tree = PairTree::new(ElementId(0));
        tree.set_state(PairTree::ROOT, State::Active);
        let margin = Margin::Link { on: [1230, Margin::ENDLESS], both_ways: true };
        tree.set_margin(PairTree::ROOT, margin);
        tree.set_carried(PairTree::ROOT, &carried);
        assert_eq!(tree.link(PairTree::ROOT).unwrap().carried, carried);
        assert_eq!(tree.margin(PairTree::ROOT), margin);
        assert_eq!(carried.visibility(), 1.0);
    }
}
