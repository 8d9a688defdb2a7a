//! Where the solution is heading: by how much the last solve changed it, to begin the next one from.

use crate::element::Renumbering;

use super::field::{Field, NINE, SPARE};
use super::surfaces::{Surfaces, for_each_below};
use super::tuning::WIDE_SHARE;

/// The last change of every mean radiosity; nothing where the last solve changed few. 4 bytes an element, since it only
/// says where to begin: a step of 1/127 of the largest of the three channels.
#[derive(Clone, Debug, Default)]
pub(super) struct Trend {
    steps: Vec<Step>,
    /// How much of the change before it the last change was, from 0 to 1: what of it is expected again.
    share: f32,
    /// Whether the last solve changed most of the scene.
    pub(super) is_wide: bool,
}

/// Three changes in steps of a power of two.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Step {
    counts: [i8; 3],
    exponent: i8,
}

/// Mean radiosities before a solve.
pub(super) struct Start(Vec<[f32; 3]>);

impl Trend {
    /// Goes on as before, from `field`; returns where that was.
    pub(super) fn follow(&self, surfaces: &impl Surfaces, field: &mut Field) -> Start {
        let start = Start(means(field).copied().collect());
        if self.share > 0.0 && !self.steps.is_empty() {
            for_each_element(surfaces, &mut |id| {
                let change = self.steps[id].value();
                let mean = &mut field.0[id * NINE..][..3];
                (0..3).for_each(|c| mean[c] += self.share * change[c]);
            });
        }
        start
    }

    /// Learns from what the solve changed; all is forgotten where few changed by more than `limit`.
    pub(super) fn learn(
        &mut self,
        surfaces: &impl Surfaces,
        start: &Start,
        field: &Field,
        limit: f32,
    ) {
        let before = std::mem::take(&mut self.steps);
        self.steps.resize(start.0.len(), Step::default());
        let (mut along, mut last, mut wide, mut all) = (0.0, 0.0, 0, 0);
        for_each_element(surfaces, &mut |id| {
            let expected = before.get(id).copied().unwrap_or_default().value();
            let change = [0, 1, 2].map(|c| field.0[id * NINE + c] - start.0[id][c]);
            all += 1;
            wide += usize::from(change.iter().any(|d| d.abs() > limit));
            for c in 0..3 {
                along += f64::from(expected[c] * change[c]);
                last += f64::from(expected[c] * expected[c]);
            }
            self.steps[id] = Step::of(change);
        });
        self.share = if last > 0.0 { (along / last).clamp(0.0, 1.0) as f32 } else { 1.0 };
        if wide * WIDE_SHARE < all {
            *self = Trend::default();
        }
    }

    /// Gives a new child what is expected of its parent.
    pub(super) fn inherit(&mut self, parent: u32, child: u32) {
        if let Some(&step) = self.steps.get(parent as usize) {
            self.extend(child as usize + 1);
            self.steps[child as usize] = step;
        }
    }

    /// Makes room for elements with higher ids, if there is any.
    pub(super) fn extend(&mut self, len: usize) {
        if !self.steps.is_empty() && len > self.steps.len() {
            self.steps.resize(len, Step::default());
        }
    }

    pub(super) fn renumber(&mut self, to: &Renumbering) {
        if !self.steps.is_empty() {
            let old = to.old_of().iter().map(|&old| old as usize);
            self.steps = old.map(|old| self.steps.get(old).copied().unwrap_or_default()).collect();
        }
    }

    pub(super) fn trim(&mut self) {
        self.steps.shrink_to(self.steps.len() + self.steps.len() / SPARE);
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.steps.capacity() * size_of::<Step>()) as u64
    }
}

fn means(field: &Field) -> impl Iterator<Item = &[f32; 3]> {
    field.0.chunks_exact(NINE).map(|nine| nine.first_chunk().expect("nine numbers"))
}

/// Visits all elements of surfaces, parents first.
fn for_each_element(surfaces: &impl Surfaces, visit: &mut dyn FnMut(usize)) {
    for facet in surfaces.facets() {
        for_each_below(surfaces, facet.0, &mut |id| visit(id as usize));
    }
}

impl Step {
    fn of(change: [f32; 3]) -> Step {
        let most = change.iter().fold(0.0_f32, |most, d| most.max(d.abs()));
        // The power of two above; what is too little or too much for it to fit is not followed.
        let exponent = (most.to_bits() >> 23) as i32 - 126;
        if !most.is_finite() || !(-100..100).contains(&exponent) {
            return Step::default();
        }
        let unit = unit(exponent as i8);
        Step { counts: change.map(|d| (d / unit) as i8), exponent: exponent as i8 }
    }

    fn value(self) -> [f32; 3] {
        let unit = unit(self.exponent);
        self.counts.map(|count| f32::from(count) * unit)
    }
}

/// 2^(exponent - 7).
fn unit(exponent: i8) -> f32 {
    f32::from_bits(((i32::from(exponent) + 120) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::element::ElementId;
    use crate::solver::{FacetMaterial, Place};

    use super::*;

    proptest! {
        #[test]
        fn steps_are_right_to_a_hundredth(change in [-1e3..1e3_f32, -1.0..1.0_f32, -1e-3..1e-3_f32]) {
            let most = change.iter().fold(0.0_f32, |most, d| most.max(d.abs()));
            for (d, found) in change.iter().zip(Step::of(change).value()) {
                prop_assert!((d - found).abs() <= most / 64.0, "{d} {found}");
            }
        }
    }

    #[test]
    fn nothing_and_what_does_not_fit_are_no_steps() {
        for change in
            [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [1e-40; 3], [f32::MAX; 3]]
        {
            assert_eq!(Step::of(change), Step::default(), "{change:?}");
        }
    }

    /// One element; another is vacant.
    struct One([ElementId; 1], FacetMaterial);

    impl Surfaces for One {
        fn len(&self) -> usize {
            2
        }
        fn facets(&self) -> &[ElementId] {
            &self.0
        }
        fn facet_of(&self, id: u32) -> u32 {
            id
        }
        fn parent(&self, _: u32) -> Option<u32> {
            None
        }
        fn children(&self, _: u32) -> std::ops::Range<u32> {
            0..0
        }
        fn area_m2(&self, _: u32) -> f64 {
            1.0
        }
        fn place(&self, _: u32) -> Place {
            Place { centroid: [0.0; 2], radius: 1.0, moment: [1.0, 0.0, 1.0] }
        }
        fn material(&self, _: u32) -> &FacetMaterial {
            &self.1
        }
    }

    #[test]
    fn what_goes_on_is_expected_and_what_turns_back_is_not() {
        let one = One([ElementId(0)], FacetMaterial { reflectance: [0.5; 3], exitance: [0.0; 3] });
        let field = |value: f32| {
            let mut field = Field::default();
            field.extend(2);
            field.0[..3].fill(value);
            field.0[NINE..NINE + 3].fill(7.0);
            field
        };
        let mut trend = Trend::default();
        for (before, after, expected) in
            [(1.0, 2.0, 3.0), (2.0, 3.0, 4.0), (3.0, 3.5, 3.75), (3.5, 3.0, 3.0)]
        {
            let start = trend.follow(&one, &mut field(before));
            assert_eq!(start.0, [[before; 3], [7.0; 3]]);
            trend.learn(&one, &start, &field(after), 0.1);
            let mut next = field(after);
            trend.follow(&one, &mut next);
            assert!((next.0[0] - expected).abs() < 0.02, "{} {expected}", next.0[0]);
            assert_eq!(next.0[NINE], 7.0);
        }
        let start = trend.follow(&one, &mut field(3.0));
        trend.learn(&one, &start, &field(3.05), 0.1);
        assert!(!trend.is_wide && trend.steps.is_empty());
    }
}
