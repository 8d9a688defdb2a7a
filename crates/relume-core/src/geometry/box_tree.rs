//! A hierarchy over boxes, to find those that meet another one.

use super::Aabb;

/// Boxes of one leaf at most.
const LEAF: usize = 4;

/// A hierarchy over numbered boxes: what meets a box is found without a look at all of them. A pure function of the boxes; what it
/// finds does not depend on how it is built. Empty boxes meet nothing. 60 bytes a box.
#[derive(Clone, Debug, Default)]
pub struct BoxTree {
    /// From the root, each node before what is below it.
    nodes: Vec<Node>,
    /// Boxes with their numbers, those of each leaf side by side.
    boxes: Vec<(Aabb, u32)>,
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Aabb,
    /// The first node that is not below this one.
    end: u32,
    /// Its boxes; of an inner node none.
    first: u32,
    count: u32,
}

impl BoxTree {
    /// Over some boxes, numbered from 0. Cost: n log^2 n.
    pub fn new(boxes: impl IntoIterator<Item = Aabb>) -> BoxTree {
        let mut tree = BoxTree { nodes: Vec::new(), boxes: boxes.into_iter().zip(0..).collect() };
        tree.boxes.retain(|(bounds, _)| !bounds.is_empty());
        if !tree.boxes.is_empty() {
            tree.grow(0, tree.boxes.len());
        }
        tree
    }

    /// Adds the node of some boxes, halved by number along its longest side.
    fn grow(&mut self, first: usize, count: usize) {
        let own = &mut self.boxes[first..first + count];
        let bounds = own.iter().fold(Aabb::EMPTY, |all, (bounds, _)| all.union(*bounds));
        let at = self.nodes.len();
        let is_leaf = count <= LEAF;
        let held = if is_leaf { count as u32 } else { 0 };
        self.nodes.push(Node { bounds, end: 0, first: first as u32, count: held });
        if !is_leaf {
            let size = bounds.hi - bounds.lo;
            let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
            let middle = |of: &Aabb| of.lo[axis] + of.hi[axis];
            own.sort_unstable_by(|(a, i), (b, j)| middle(a).total_cmp(&middle(b)).then(i.cmp(j)));
            let half = count / 2;
            self.grow(first, half);
            self.grow(first + half, count - half);
        }
        self.nodes[at].end = self.nodes.len() as u32;
    }

    /// Whether a test holds for any box that meets another; touching counts. The order of the tests is not said.
    pub fn any(&self, bounds: &Aabb, mut test: impl FnMut(usize) -> bool) -> bool {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !node.bounds.meets(bounds) {
                at = node.end as usize;
                continue;
            }
            at += 1;
            let own = &self.boxes[node.first as usize..(node.first + node.count) as usize];
            if own.iter().any(|(other, k)| other.meets(bounds) && test(*k as usize)) {
                return true;
            }
        }
        false
    }

    /// Numbers of all boxes that meet another, ascending; touching counts.
    pub fn meeting(&self, bounds: &Aabb) -> Vec<usize> {
        let mut out = Vec::new();
        self.any(bounds, |k| {
            out.push(k);
            false
        });
        out.sort_unstable();
        out
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;

    fn any_box() -> impl Strategy<Value = Aabb> {
        let corner =
            || prop::array::uniform3(-4..4_i32).prop_map(|c| DVec3::from(c.map(f64::from)));
        // Some are empty, many touch.
        (corner(), corner())
            .prop_map(|(lo, size)| Aabb { lo, hi: lo + size.max(DVec3::splat(-1.0)) })
    }

    proptest! {
        /// Against a look at all of them.
        #[test]
        fn all_that_meet_a_box_are_found(boxes in prop::collection::vec(any_box(), 0..60), of in any_box()) {
            let tree = BoxTree::new(boxes.iter().copied());
            let met = |k: &usize| !boxes[*k].is_empty() && boxes[*k].meets(&of);
            let all: Vec<usize> = (0..boxes.len()).filter(met).collect();
            prop_assert_eq!(&tree.meeting(&of), &all);
            prop_assert_eq!(tree.any(&of, |k| k % 3 == 0), all.iter().any(|k| k % 3 == 0));
        }
    }
}
