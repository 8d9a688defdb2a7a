//! What to read of a file, whatever its format.

use relume_core::scene::Edits;

/// Options of reading a scene from a file.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Name of the one animation to play; `None` plays all together, as exporters that write one
    /// for each object mean it, but of those that move the same properties the first alone.
    pub animation: Option<String>,
    /// Whether buffers and images may be anywhere: outside the file's folder, and devices or pipes.
    pub allow_outside: bool,
    /// Whether images are kept for pictures, as [`Patch::print`](relume_core::scene::Patch::print); the solution does not need them.
    pub pictures: bool,
    /// Bytes that a file, an image or a list of numbers may need, each by itself: what needs more is refused
    /// before memory is asked for. `None` for no limit.
    pub max_memory_bytes: Option<u64>,
    /// What of the scene is changed before it is built.
    pub edits: Edits,
}
