//! How far a solution that predicts with losses is from one that does not.

use crate::element::{ElementId, ElementKey};
use crate::pair::{PairId, PairTree, State};

use super::solution::{Elements, named_leaves};
use crate::follow::Follower;

/// Pairs that are in another state than they should be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Missed {
    /// Pairs that are a link, refined or culled where they should be something else, or that should not
    /// exist: promotions, demotions and cullings not followed yet.
    pub states: u64,
    /// Links that should be clear, partly occluded or wholly occluded and are not.
    pub occlusions: u64,
}

/// The pairs of `reference` that `session` lacks or has in another state. Pairs below such a pair are
/// not counted: they follow from it.
pub fn missed<S: Elements>(session: &Follower<S>, reference: &Follower<S>) -> Missed {
    let (one, two) = (&session.tree, &reference.tree);
    let mut out = Missed::default();
    // Both trees from the root: children of pairs in the same state have the same names in the same
    // order.
    let mut stack = vec![(PairTree::ROOT, PairTree::ROOT)];
    while let Some((p, q)) = stack.pop() {
        let (a, b) = (one.state(p), two.state(q));
        if a != b {
            // Refined on the other side is no event: both are fine enough.
            out.states += u64::from(!(a.is_refined() && b.is_refined()));
            continue;
        }
        if let (State::Active, Some(l), Some(m)) = (a, one.link(p), two.link(q)) {
            let class = |v: u16| {
                if v == 0 {
                    0
                } else if v == u16::MAX {
                    2
                } else {
                    1
                }
            };
            let differs = class(l.carried.visibility) != class(m.carried.visibility);
            out.occlusions += u64::from(differs);
        }
        let (p, q) = (one.children(p), two.children(q));
        stack.extend(p.map(PairId).zip(q.map(PairId)));
    }
    out
}

/// How far radiosities are from those of a reference, relative to its mean radiosity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RadiosityError {
    /// Area-weighted root mean square over the reference's leaves and the channels.
    pub rms: f64,
    /// Largest of any leaf.
    pub max: f64,
}

/// Compares radiosities over the leaves of `reference`; where `session` has other leaves, the mean of
/// its elements there, or the element that holds the leaf.
pub fn radiosity_error<S: Elements>(
    session: &Follower<S>,
    reference: &Follower<S>,
) -> RadiosityError {
    let known = Known::new(session);
    let (mut squares, mut area, mut sum, mut max) = (0.0, 0.0, 0.0, 0.0_f64);
    for (key, id) in named_leaves(reference) {
        if !reference.space.is_present(id) {
            continue;
        }
        let a = reference.space.area_m2(id);
        let found = session.radiosity.radiosity(known.holding(key).0);
        for (x, y) in found.into_iter().zip(reference.radiosity.radiosity(id.0)) {
            let off = f64::from(x) - f64::from(y);
            squares += a * off * off / 3.0;
            sum += a * f64::from(y) / 3.0;
            max = max.max(off.abs());
        }
        area += a;
    }
    if sum <= 0.0 {
        return RadiosityError::default();
    }
    let mean = sum / area;
    RadiosityError { rms: (squares / area).sqrt() / mean, max: max / mean }
}

/// Elements by name.
struct Known(Vec<(ElementKey, ElementId)>);

impl Known {
    fn new(solution: &Follower<impl Elements>) -> Known {
        let ids = (0..solution.space.id_limit()).map(ElementId);
        let elements = ids.filter(|&id| solution.space.is_element(id));
        let mut out: Vec<_> = elements.map(|id| (solution.space.key(id), id)).collect();
        out.sort_unstable_by_key(|e| e.0);
        Known(out)
    }

    /// The element of this name, or the smallest that holds it.
    fn holding(&self, mut key: ElementKey) -> ElementId {
        loop {
            match self.0.binary_search_by_key(&key, |e| e.0) {
                Ok(at) => return self.0[at].1,
                Err(_) if key.path > 1 => key.path >>= 2,
                Err(_) => return ElementId(key.facet),
            }
        }
    }
}
