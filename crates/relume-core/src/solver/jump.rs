//! Extrapolation of an iteration that has settled into one mode.

use super::field::Field;
use super::tuning::PARALLEL;

/// Aitken's extrapolation: once successive changes are all but parallel, one mode is left, and its
/// geometric series is summed at once.
#[derive(Default)]
pub(super) struct Jump {
    before: Vec<f32>,
    change: Vec<f32>,
    last: Vec<f32>,
}

impl Jump {
    pub(super) fn before(&mut self, field: &Field) {
        self.before.clone_from(&field.0);
    }

    pub(super) fn after(&mut self, field: &mut Field) {
        let change = field.0.iter().zip(&self.before).map(|(now, before)| now - before);
        self.change.clear();
        self.change.extend(change);
        if self.last.len() == self.change.len() {
            let dot = |x: &[f32], y: &[f32]| -> f64 {
                x.iter().zip(y).map(|(a, b)| f64::from(a * b)).sum()
            };
            let (along, now, last) = (
                dot(&self.change, &self.last),
                dot(&self.change, &self.change),
                dot(&self.last, &self.last),
            );
            let ratio = along / last.max(f64::MIN_POSITIVE);
            if along * along > PARALLEL * now * last && ratio > 0.0 && ratio < 0.95 {
                let step = (ratio / (1.0 - ratio)) as f32;
                field.0.iter_mut().zip(&self.change).for_each(|(b, d)| *b += d * step);
                self.last.clear();
                return;
            }
        }
        std::mem::swap(&mut self.last, &mut self.change);
    }
}
