//! How large a scene of the plane may be.

/// Segments of a scene at most: every one meets every other, so that more take gigabytes.
pub(super) const SEGMENTS_MAX: usize = 1 << 13;

/// What is said of a scene that has more.
pub(super) fn said() -> String {
    format!("with it the scene has more than {SEGMENTS_MAX} segments, which all meet each other")
}
