//! Pairs of elements as the error oracle weighs them: both ends, the side to refine, and margins.

use crate::element::ElementId;
use crate::geometry::no_smaller;
use crate::transport::Side;

use super::places::Elements;
use super::space_judge::{SpaceJudge, passing};
use crate::pair::coarse_brightness::CoarseBrightness;
use crate::pair::margin::{Margin, SideMargin};
use crate::pair::oracle::{End, Estimate, Norm};
use crate::pair::verdict::{Judgement, Verdict};

/// Norm of the error oracle.
pub(super) fn norm_of(brightness: &CoarseBrightness, threshold: f64) -> Norm {
    Norm { reference_area_m2: brightness.reference_area_m2(), threshold }
}

/// The verdict to refine a side, if there is one to be refined and the error is too large; `way` is how far the light is
/// from V being found in another way.
pub(super) fn refined(
    e: &Estimate,
    wish: Option<(Side, SideMargin)>,
    threshold: f64,
    way: u16,
    segments: u32,
) -> Option<Judgement> {
    let (side, side_margin) = wish.filter(|_| e.error() > threshold)?;
    let error = way.min(Margin::between(e.error(), threshold));
    let both_ways = way != Margin::ENDLESS;
    let margin = Margin::Refined { error, on: e.larger(), both_ways, side: side_margin };
    Some(Judgement { margin, ..passing(Verdict::Refine(side), segments) })
}

impl SpaceJudge<'_> {
    /// Both ends of a pair as the error oracle weighs them.
    pub(super) fn ends(&self, pair: &Elements<'_>, brightness: &CoarseBrightness) -> [End; 2] {
        let (place_a, place_b) = pair.places;
        let end = |id, area| End {
            area: if self.forest.is_distant(id) { 0.0 } else { area },
            reference_area: self.reference_area(brightness, id),
            light: brightness.of(self.forest, id),
            own_area: area,
            surface_area: match self.forest.is_distant(id) {
                true => {
                    2.0 * std::f64::consts::PI * (place_a.centre - place_b.centre).length_squared()
                }
                false => self.forest.area_m2(self.forest.patch_root(self.patch_of(id))),
            },
        };
        [end(pair.ids.0, place_a.area), end(pair.ids.1, place_b.area)]
    }

    /// The share of a receiver's irradiance that a pair brings without occlusion, weighed as errors
    /// are: what V errs by is multiplied with it. The larger of both directions.
    pub(super) fn relative_contribution(
        &self,
        brightness: &CoarseBrightness,
        [a, b]: [(ElementId, f64); 2],
        exchange_area_m2: f64,
    ) -> f64 {
        let one_way = |(receiver, area): (ElementId, f64), source: ElementId| {
            if self.forest.is_distant(receiver) {
                return 0.0;
            }
            let arrives = brightness.of(self.forest, source).radiosity * exchange_area_m2;
            let known = brightness.of(self.forest, receiver).irradiance;
            arrives / known / (area * self.reference_area(brightness, receiver)).sqrt()
        };
        one_way(a, b.0).max(one_way(b, a.0))
    }

    /// The side that is to be refined if any is, and how firmly.
    pub(super) fn wish(
        &self,
        ids: (ElementId, ElementId),
        [a, b]: &[End; 2],
        e: &Estimate,
    ) -> Option<(Side, SideMargin)> {
        let (better, margin) = e.side(a, b);
        let (side, firm) = self.splittable(ids, (a.area, b.area), better)?;
        Some((side, if firm { SideMargin::ENDLESS } else { SideMargin::new(margin) }))
    }

    /// The side to refine: the one wished for if it can be, else the other unless it is the smaller; and whether
    /// there was no choice.
    fn splittable(
        &self,
        (a, b): (ElementId, ElementId),
        (area_a, area_b): (f64, f64),
        wish: Side,
    ) -> Option<(Side, bool)> {
        match (self.forest.can_split(a), self.forest.can_split(b)) {
            (true, true) => Some((wish, false)),
            // Smaller sources do not mend what a receiver is too large for.
            (true, false) => no_smaller(area_a, area_b).then_some((Side::A, true)),
            (false, true) => no_smaller(area_b, area_a).then_some((Side::B, true)),
            (false, false) => None,
        }
    }
}
