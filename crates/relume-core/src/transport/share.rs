//! Visibility V of a pair as a value: the unoccluded share, its gradients and spreads.

use glam::DVec2;

/// The visibility of a pair, kernel-weighted over its segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visibility {
    /// Unoccluded share, in [0, 1].
    pub value: f64,
    /// Contribution of occlusion to the relative gradient of the arriving light over the first end, 1/m.
    pub gradient_a: DVec2,
    /// Contribution of occlusion to the relative gradient over the second end, 1/m.
    pub gradient_b: DVec2,
    /// Standard deviation between the quadrants of the first end, absolute.
    pub spread_a: f64,
    /// Standard deviation between the quadrants of the second end, absolute.
    pub spread_b: f64,
    /// Segments traced; 0 where the shaft is empty, and then `value` is exactly 1.
    pub segments: u32,
}

impl Visibility {
    /// Visibility of a pair without occluders.
    pub const CLEAR: Visibility = Visibility {
        value: 1.0,
        gradient_a: DVec2::ZERO,
        gradient_b: DVec2::ZERO,
        spread_a: 0.0,
        spread_b: 0.0,
        segments: 0,
    };
}
