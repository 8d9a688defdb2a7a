//! Which patches may stand between two boxes: a tree of boxes over all of them.
//!
//! Must not know light.

use glam::DVec3;
use relume_core::geometry::{Aabb, shaft_meets_box};

/// Boxes side by side in a leaf of the tree.
const TOGETHER: usize = 4;

/// A tree of boxes.
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// Numbers of the boxes, those below a node side by side.
    order: Vec<u32>,
    boxes: Vec<Aabb>,
}

struct Node {
    bounds: Aabb,
    /// Below it.
    range: [u32; 2],
    /// Its second child; the first comes after it. `None` for a leaf.
    second: Option<u32>,
}

impl Tree {
    pub(super) fn new(boxes: Vec<Aabb>) -> Tree {
        let order = (0..boxes.len() as u32).collect();
        let mut tree = Tree { nodes: Vec::new(), order, boxes };
        if !tree.boxes.is_empty() {
            tree.add(0, tree.boxes.len());
        }
        tree
    }

    fn add(&mut self, from: usize, to: usize) {
        let bounds = self.order[from..to]
            .iter()
            .fold(Aabb::EMPTY, |all, &k| all.union(self.boxes[k as usize]));
        let node = self.nodes.len();
        self.nodes.push(Node { bounds, range: [from as u32, to as u32], second: None });
        if to - from <= TOGETHER {
            return;
        }
        let extent = bounds.extent();
        let axis = (0..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best });
        let middle = |k: &u32| -> DVec3 { self.boxes[*k as usize].centre() };
        let mut part: Vec<u32> = self.order[from..to].to_vec();
        // By number where equal: the same tree everywhere.
        part.sort_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.cmp(b)));
        self.order[from..to].copy_from_slice(&part);
        let half = from.midpoint(to);
        self.add(from, half);
        self.nodes[node].second = Some(self.nodes.len() as u32);
        self.add(half, to);
    }

    /// Numbers of the boxes that meet the hull of two, ascending.
    pub(super) fn between(&self, a: &Aabb, b: &Aabb, found: &mut Vec<u32>) {
        found.clear();
        let mut stack = Vec::with_capacity(32);
        if !self.nodes.is_empty() {
            stack.push(0_u32);
        }
        while let Some(k) = stack.pop() {
            let node = &self.nodes[k as usize];
            if !shaft_meets_box(a, b, &node.bounds) {
                continue;
            }
            match node.second {
                Some(second) => stack.extend([second, k + 1]),
                None => {
                    let own = &self.order[node.range[0] as usize..node.range[1] as usize];
                    let meets = |k: &&u32| shaft_meets_box(a, b, &self.boxes[**k as usize]);
                    found.extend(own.iter().filter(meets));
                }
            }
        }
        found.sort_unstable();
    }
}
