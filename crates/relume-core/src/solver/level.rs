//! Level of a leaf: its reflected light, as if its row were even and summed to 1.

use super::field::Linear;

/// How the light that a leaf receives is levelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Whether the leaf is in closed surroundings; else nothing changes.
    pub(super) is_closed: bool,
    /// Direct irradiance, W/m2.
    pub(super) direct: Linear,
    /// What reflected light is multiplied with, 1.
    pub(super) factor: f32,
    /// Gradient of the row over its sum, 1/m.
    pub(super) slope: [f32; 2],
}

impl Level {
    pub(super) const NONE: Level = Level {
        is_closed: false,
        direct: Linear { mean: [0.0; 3], gradient: [[0.0; 3]; 2] },
        factor: 1.0,
        slope: [0.0; 2],
    };

    /// Irradiance as it is with an even row that sums to 1, from that over the links, W/m2 and per metre.
    pub(super) fn of(&self, h: &Linear) -> Linear {
        if !self.is_closed {
            return *h;
        }
        let mut reflected = h.minus(&self.direct);
        for (gradient, slope) in reflected.gradient.iter_mut().zip(self.slope) {
            (0..3).for_each(|c| gradient[c] -= slope * reflected.mean[c]);
        }
        reflected.times(self.factor).plus(&self.direct)
    }
}
