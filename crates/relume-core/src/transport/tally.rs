//! Weighted sums over the segments of a pair, of which visibility and its gradients and spreads are made.

use glam::DVec2;

use crate::element::WorldElement;

use super::segments::{SEGMENTS, SegmentBundle};
use super::share::Visibility;

/// Weighted sums over segments, of all and of the clear ones.
#[derive(Default)]
pub(super) struct Tally {
    a: SideTally,
    b: SideTally,
}

#[derive(Default)]
struct SideTally {
    total: [f64; 4],
    clear: [f64; 4],
    moment: DVec2,
    clear_moment: DVec2,
}

impl SideTally {
    fn add(&mut self, quadrant: u8, at: DVec2, weight: f64, clear: f64) {
        self.total[quadrant as usize] += weight;
        self.clear[quadrant as usize] += clear;
        self.moment += at * weight;
        self.clear_moment += at * clear;
    }

    /// Contribution of occlusion to the relative gradient: the shift of the centre of what arrives,
    /// against the element's own second moment.
    fn gradient(&self, e: &WorldElement) -> DVec2 {
        let (total, clear): (f64, f64) = (self.total.iter().sum(), self.clear.iter().sum());
        if clear <= 0.0 {
            return DVec2::ZERO;
        }
        e.gradient_of_shift(self.clear_moment / clear - self.moment / total)
    }

    fn spread(&self, value: f64) -> f64 {
        let total: f64 = self.total.iter().sum();
        let mut sum = 0.0;
        for q in 0..4 {
            if self.total[q] > 0.0 {
                let off = self.clear[q] / self.total[q] - value;
                sum += self.total[q] / total * off * off;
            }
        }
        sum.sqrt()
    }
}

impl Tally {
    pub(super) fn add(
        &mut self,
        bundle: &SegmentBundle,
        mask: u16,
        a: &WorldElement,
        b: &WorldElement,
    ) {
        let dark = bundle.weight.iter().all(|&w| w <= 0.0);
        for k in 0..SEGMENTS {
            // A pair that hardly faces itself has no weights: all segments count alike.
            let weight = if dark { f64::MIN_POSITIVE } else { bundle.weight[k] };
            let clear = if mask >> k & 1 == 1 { 0.0 } else { weight };
            let (p, q) = bundle.ends(k);
            self.a.add(bundle.quadrant_a[k], a.offset(p), weight, clear);
            self.b.add(bundle.quadrant_b[k], b.offset(q), weight, clear);
        }
    }

    pub(super) fn finish(&self, segments: u32, a: &WorldElement, b: &WorldElement) -> Visibility {
        let (total, clear): (f64, f64) = (self.a.total.iter().sum(), self.a.clear.iter().sum());
        let value = (clear / total).clamp(0.0, 1.0);
        Visibility {
            value,
            gradient_a: self.a.gradient(a),
            gradient_b: self.b.gradient(b),
            spread_a: self.a.spread(value),
            spread_b: self.b.spread(value),
            segments,
        }
    }
}
