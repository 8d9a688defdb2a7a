//! The tree of unordered element pairs.

use glam::DVec2;

use crate::element::ElementId;

/// Index of a [`Pair`] in a [`PairTree`].
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
}

/// What a pair is at this instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// A link, used in both directions.
    Active,
    /// Its children carry the transport.
    Refined,
    /// It exchanges nothing, for the reason given.
    Culled(CullReason),
}

/// Relative gradients of what arrives over both ends of a pair, in their patches' frames, times the
/// ends' radii; in steps of 1/4096, at most 8.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gradients {
    /// Over the first end.
    pub over_a: [i16; 2],
    /// Over the second end.
    pub over_b: [i16; 2],
}

impl Gradients {
    /// Steps in one.
    pub const STEPS: f32 = 4096.0;

    /// From relative gradients (1/m) and radii (m) of both ends.
    pub fn new((a, radius_a): (DVec2, f64), (b, radius_b): (DVec2, f64)) -> Gradients {
        let steps = |g: DVec2, r: f64| {
            [g.x, g.y].map(|v| (v * r * f64::from(Gradients::STEPS)).round() as i16)
        };
        Gradients { over_a: steps(a, radius_a), over_b: steps(b, radius_b) }
    }
}

/// A node of the pair tree: 36 bytes.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// First end.
    pub a: ElementId,
    /// Second end; the order is inherited from the pair of facets above.
    pub b: ElementId,
    /// Exchange area X, m2, of an active (or coarse) pair.
    pub exchange_area_m2: f32,
    /// Visibility V of an active (or coarse) pair, in [0, 1].
    pub visibility: f32,
    /// How what arrives varies over the ends of an active (or coarse) pair.
    pub gradients: Gradients,
    first_child: u32,
    child_count: u32,
    /// Link, refined or culled.
    pub state: State,
}

/// The tree of pairs, from the one root (scene, scene); parents come before children.
#[derive(Clone, Debug, Default)]
pub struct PairTree {
    pairs: Vec<Pair>,
}

impl PairTree {
    /// The root alone, unjudged.
    pub fn new(root: ElementId) -> PairTree {
        let mut tree = PairTree::default();
        tree.pairs.push(unjudged(root, root));
        tree
    }

    /// The root pair.
    pub const ROOT: PairId = PairId(0);

    /// Nodes in the tree.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether the tree has no node.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        (self.pairs.capacity() * size_of::<Pair>()) as u64
    }

    /// A node.
    #[inline]
    pub fn pair(&self, id: PairId) -> &Pair {
        &self.pairs[id.0 as usize]
    }

    /// All nodes, parents before children.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Ids of a node's children.
    pub fn children(&self, id: PairId) -> std::ops::Range<u32> {
        let pair = self.pair(id);
        pair.first_child..pair.first_child + pair.child_count
    }

    /// All links.
    pub fn links(&self) -> impl Iterator<Item = &Pair> + Clone {
        self.pairs.iter().filter(|p| p.state == State::Active)
    }

    pub(super) fn pair_mut(&mut self, id: PairId) -> &mut Pair {
        &mut self.pairs[id.0 as usize]
    }

    /// Makes `parent` refined into `ends`; returns the first child's id.
    pub(super) fn refine(
        &mut self,
        parent: PairId,
        ends: impl Iterator<Item = (ElementId, ElementId)>,
    ) -> PairId {
        let first = self.pairs.len() as u32;
        self.pairs.extend(ends.map(|(a, b)| unjudged(a, b)));
        let count = self.pairs.len() as u32 - first;
        let pair = self.pair_mut(parent);
        pair.state = State::Refined;
        pair.first_child = first;
        pair.child_count = count;
        PairId(first)
    }
}

fn unjudged(a: ElementId, b: ElementId) -> Pair {
    Pair {
        a,
        b,
        exchange_area_m2: 0.0,
        visibility: 0.0,
        gradients: Gradients::default(),
        first_child: 0,
        child_count: 0,
        state: State::Culled(CullReason::FacingAway),
    }
}
