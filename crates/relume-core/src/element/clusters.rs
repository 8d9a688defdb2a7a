//! Bounding-volume hierarchies over boxes, as plain binary trees.

use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use crate::geometry::Aabb;

/// A node of a binary tree over numbered boxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Branch {
    /// One of the boxes.
    Leaf(u32),
    /// Two nodes of the tree, by index.
    Inner(u32, u32),
}

/// A binary bounding-volume hierarchy over `boxes`, root first; a pure function of the boxes.
///
/// # Panics
/// Without any box.
pub(super) fn binary_tree(boxes: &[Aabb]) -> Vec<Branch> {
    assert!(!boxes.is_empty(), "a tree over no boxes");
    if boxes.len() == 1 {
        return vec![Branch::Leaf(0)];
    }
    // Single precision is enough: the tree decides how fast a walk is, never what it finds.
    let single: Vec<obvhs::aabb::Aabb> = boxes
        .iter()
        .map(|b| obvhs::aabb::Aabb::new(b.lo.as_vec3().into(), b.hi.as_vec3().into()))
        .collect();
    let indices = (0..boxes.len() as u32).collect();
    let tree = PlocBuilder::new().build(
        PlocSearchDistance::Medium,
        &single,
        indices,
        SortPrecision::U64,
        0,
    );
    tree.nodes
        .iter()
        .map(|n| match n.prim_count {
            0 => Branch::Inner(n.first_index, n.first_index + 1),
            _ => Branch::Leaf(tree.primitive_indices[n.first_index as usize]),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn every_box_is_one_leaf_even_where_boxes_coincide() {
        let boxes: Vec<Aabb> = (0..97)
            .map(|k| {
                let c = DVec3::new(f64::from(k % 7), f64::from(k % 3), 0.0);
                Aabb { lo: c, hi: c + DVec3::ONE }
            })
            .collect();
        let tree = binary_tree(&boxes);
        let mut seen = vec![0; boxes.len()];
        let mut stack = vec![0];
        while let Some(n) = stack.pop() {
            match tree[n as usize] {
                Branch::Leaf(k) => seen[k as usize] += 1,
                Branch::Inner(a, b) => stack.extend([a, b]),
            }
        }
        assert!(seen.iter().all(|&s| s == 1));
        assert_eq!(tree, binary_tree(&boxes));
    }
}
