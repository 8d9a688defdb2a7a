//! Memory budget of an update: pairs and elements, and the links and radiosities made of them later.
//!
//! Must not know space, light or what else the process holds.

use crate::pair::PairTree;

/// Links by receiver, for each pair of the tree, bytes.
const PAIR_LINKS_BYTES: u64 = 20;

/// An element with its radiosity, bytes.
const ELEMENT_BYTES: u64 = 122;

/// Whether a tree, this many elements and scratch of so many bytes keep within a limit, with links by receiver
/// and radiosities that may be still to come.
pub(super) fn within(max_memory_bytes: Option<u64>) -> impl Fn(&PairTree, usize, u64) -> bool {
    let limit = max_memory_bytes.unwrap_or(u64::MAX);
    move |tree, elements, scratch| bytes_of(tree, elements, scratch) <= limit
}

/// Bytes of a tree, elements and scratch, with what is still to come of them.
pub(super) fn bytes_of(tree: &PairTree, elements: usize, scratch: u64) -> u64 {
    let pairs = tree.used_bytes() + tree.len() as u64 * PAIR_LINKS_BYTES;
    pairs + elements as u64 * ELEMENT_BYTES + scratch
}
