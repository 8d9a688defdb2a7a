//! Level of a leaf: a line that its reflected light counts times, so that its row is even and sums to 1.

use super::field::Linear;
use super::place::Place;

/// How the light of a leaf is levelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Whether the leaf is in closed surroundings; else its row stays as it is.
    pub(super) is_closed: bool,
    /// Direct irradiance, W/m2; it counts as it is.
    pub(super) direct: Linear,
    /// What reflected light is multiplied with at the centroid, 1.
    pub(super) factor: f32,
    /// Share by which that factor falls along the axes of the patch, 1/m.
    pub(super) slope: [f32; 2],
}

impl Level {
    pub(super) const NONE: Level = Level {
        is_closed: false,
        direct: Linear { mean: [0.0; 3], gradient: [[0.0; 3]; 2] },
        factor: 1.0,
        slope: [0.0; 2],
    };

    /// Irradiance as it is with an even row that sums to 1, from that over the links, W/m2 and per metre: of a level that counts for
    /// what is received alone.
    pub(super) fn evened(&self, h: &Linear) -> Linear {
        if !self.is_closed {
            return *h;
        }
        let mut reflected = h.minus(&self.direct);
        for (gradient, slope) in reflected.gradient.iter_mut().zip(self.slope) {
            (0..3).for_each(|c| gradient[c] -= slope * reflected.mean[c]);
        }
        reflected.times(self.factor).plus(&self.direct)
    }

    /// Irradiance from that over the links, W/m2 and per metre: of a symmetric level.
    pub(super) fn received(&self, h: &Linear, place: &Place, moment: f32) -> Linear {
        self.weighed(&h.minus(&self.direct), place, moment).plus(&self.direct)
    }

    /// Product of a linear function over the leaf and its level, without the quadratic part: mean and gradient, in the unit of `value`.
    pub(super) fn weighed(&self, value: &Linear, place: &Place, moment: f32) -> Linear {
        let mut out = *value;
        let scale = place.radius * moment;
        for c in 0..3 {
            let first = place.first_moments(value.gradient.map(|g| g[c] * place.radius), moment);
            for (k, slope) in self.slope.into_iter().enumerate() {
                out.mean[c] -= scale * slope * first[k];
                out.gradient[k][c] -= slope * value.mean[c];
            }
        }
        out.times(self.factor)
    }
}
