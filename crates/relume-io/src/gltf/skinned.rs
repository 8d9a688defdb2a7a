//! A skinned mesh on its way from the file to its parts.

use relume_core::scene::Track;

/// A node of the file with a skinned mesh.
pub(super) struct Skinned {
    /// In the file.
    pub(super) index: usize,
    /// In the draft.
    pub(super) me: usize,
    pub(super) mesh: usize,
    pub(super) skin: usize,
    pub(super) weights: Vec<f64>,
    /// Its weights one by one, where they change.
    pub(super) morphs: Vec<Track>,
}
