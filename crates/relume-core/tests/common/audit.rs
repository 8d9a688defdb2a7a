//! The laws that hold at every instant (design: invariants), checked on a solved session.

use std::collections::BTreeSet;

use relume_core::element::{ElementId, Forest, Kind};
use relume_core::pair::{PairId, PairTree, State};
use relume_core::session::Session;

/// What an audit measured; every law is a bound on one of these.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Audit {
    /// |sum over active and culled pairs of the areas' product - that of the root|, relative.
    pub(crate) coverage: f64,
    /// The same at the worst refined pair, against its children.
    pub(crate) local_coverage: f64,
    /// Largest relative difference between an element's area and the sum of its children's.
    pub(crate) areas: f64,
    /// Smallest and largest visibility of a link.
    pub(crate) visibility: [f64; 2],
    /// Smallest exchange area of a link, m2.
    pub(crate) exchange_min: f64,
    /// Largest F(a -> b) of a link.
    pub(crate) factor_max: f64,
    /// Smallest and largest row sum of a leaf.
    pub(crate) row_sum: [f64; 2],
    /// RMS of how far row sums lie outside [0, 1], weighed by exposed areas.
    pub(crate) row_excess: f64,
}

/// Measures every law.
pub(crate) fn audit(session: &Session) -> Audit {
    let (tree, forest) = session.frame().unwrap().pairs();
    let mut out = Audit {
        visibility: [f64::INFINITY, f64::NEG_INFINITY],
        row_sum: [f64::INFINITY, f64::NEG_INFINITY],
        exchange_min: f64::INFINITY,
        ..Audit::default()
    };
    let refined_on = cover(tree, forest, &mut out);
    has_no_other_children(forest, &refined_on);
    let (mut squares, mut area) = (0.0, 0.0);
    for id in (0..forest.len() as u32).map(ElementId) {
        let children = forest.children(id);
        if !children.is_empty() {
            let sum: f64 = children.map(|c| forest.area_m2(ElementId(c))).sum();
            out.areas = out.areas.max((sum / forest.area_m2(id) - 1.0).abs());
        }
    }
    for (id, row) in session.frame().unwrap().rows() {
        assert!(row.is_finite() && forest.kind(id) == Kind::Element);
        out.row_sum = [out.row_sum[0].min(row), out.row_sum[1].max(row)];
        squares += forest.exposed_m2(id) * (row - row.clamp(0.0, 1.0)).powi(2);
        area += forest.exposed_m2(id);
    }
    out.row_excess = (squares / f64::max(area, f64::MIN_POSITIVE)).sqrt();
    for link in tree.links() {
        let (x, v) = (f64::from(link.exchange_area_m2()), f64::from(link.visibility()));
        assert!(x.is_finite() && v.is_finite());
        out.exchange_min = out.exchange_min.min(x);
        out.visibility = [out.visibility[0].min(v), out.visibility[1].max(v)];
        let areas = [link.a, link.b].map(|e| forest.area_m2(e));
        if areas[0] > 0.0 && areas[1] > 0.0 {
            out.factor_max = out.factor_max.max(x * v / areas[0].min(areas[1]));
        }
    }
    out
}

/// Ordered area product of an unordered pair: a pair of two counts both ways.
fn weight(tree: &PairTree, forest: &Forest, id: PairId) -> f64 {
    let (a, b) = tree.ends(id);
    let product = forest.area_m2(a) * forest.area_m2(b);
    if a == b { product } else { 2.0 * product }
}

/// An element has children exactly where a pair is refined on it, or above the coarse elements.
fn has_no_other_children(forest: &Forest, refined_on: &BTreeSet<ElementId>) {
    let ids = || (0..forest.len() as u32).map(ElementId);
    let has_coarse = ids().any(|id| forest.coarse(id).is_some());
    for id in ids().filter(|&id| forest.kind(id) == Kind::Element) {
        let is_above = has_coarse && forest.coarse(id).is_none();
        if !is_above {
            let has_children = !forest.children(id).is_empty();
            assert_eq!(has_children, refined_on.contains(&id), "{id:?}: children, refined on");
        }
    }
}

/// Every pair of points is covered exactly once, globally and below every refined pair. Returns the elements on which pairs are
/// refined.
fn cover(tree: &PairTree, forest: &Forest, out: &mut Audit) -> BTreeSet<ElementId> {
    let root = weight(tree, forest, PairTree::ROOT);
    let (mut seen, mut refined_on) = (BTreeSet::new(), BTreeSet::new());
    let mut covered = 0.0;
    let mut stack = vec![PairTree::ROOT];
    while let Some(id) = stack.pop() {
        assert!(seen.insert(id), "{id:?} has two parents");
        let own = weight(tree, forest, id);
        assert!(!matches!(tree.state(id), State::New | State::Vacant), "{id:?} is unjudged");
        if !tree.state(id).is_refined() {
            assert!(tree.children(id).is_empty(), "{id:?} is not refined but has children");
            covered += own;
            continue;
        }
        let children = tree.children(id).map(PairId);
        let sum: f64 = children.clone().map(|c| weight(tree, forest, c)).sum();
        if own > 0.0 {
            out.local_coverage = out.local_coverage.max((sum / own - 1.0).abs());
        }
        let (a, b) = tree.ends(id);
        for end in children.clone().map(|child| tree.ends(child)).flat_map(|(c, d)| [c, d]) {
            refined_on
                .extend(forest.parent(end).filter(|&p| end != a && end != b && (p == a || p == b)));
        }
        stack.extend(children);
    }
    assert_eq!(seen.len(), tree.len(), "pairs that no parent knows");
    out.coverage = (covered / root - 1.0).abs();
    refined_on
}

impl Audit {
    /// Asserts the laws. `row_slack` is how far row sums may lie outside [0, 1], RMS over the
    /// area; single leaves, which may be very small, by `LEAF_SLACK`.
    pub(crate) fn check(&self, row_slack: f64) {
        assert!(self.coverage < 1e-6 && self.local_coverage < DEEP, "coverage: {self:?}");
        assert!(self.areas < DEEP, "child areas: {self:?}");
        assert!(self.visibility[0] >= 0.0 && self.visibility[1] <= 1.0, "visibility: {self:?}");
        assert!(self.exchange_min >= 0.0, "exchange areas: {self:?}");
        assert!(self.factor_max <= 1.0 + FACTOR_SLACK, "form factors: {self:?}");
        assert!(self.row_excess <= row_slack, "row sums: {self:?}");
        let [low, high] = self.row_sum;
        assert!(low >= -LEAF_SLACK && high <= 1.0 + LEAF_SLACK, "row sums: {self:?}");
    }
}

/// Relative error of areas: corners are kept in single precision relative to the patch, so that
/// it doubles with every level. Found: 5e-6 at the finest.
const DEEP: f64 = 2e-5;

/// How far the form factor of one link may exceed 1.
const FACTOR_SLACK: f64 = 3e-3;

/// How far the row sum of one leaf may lie outside [0, 1]: gradients reach beyond it, and what
/// touches is counted twice. Found: -0.57 to 2.26, on a leaf of a five-hundredth of the reference area.
const LEAF_SLACK: f64 = 1.4;
