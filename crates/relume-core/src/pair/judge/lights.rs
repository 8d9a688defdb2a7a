//! Verdicts on pairs of a punctual light and an element.

use crate::element::{ElementId, WorldElement};
use crate::transport::{
    BlockerSizes, Crowd, Exchange, Side, Visibility, light_exchange, light_past_crowd,
    light_visibility,
};

use super::errors::norm_of;
use super::space_judge::{SpaceJudge, Stage, carrying, culled, passing};
use crate::pair::ends::LightPlace;
use crate::pair::hash::pair_key;
use crate::pair::margin::{Margin, SideMargin};
use crate::pair::oracle::{End, RefinementCriterion, estimate};
use crate::pair::tree::CullReason;
use crate::pair::tuning::LISTED_MAX;
use crate::pair::verdict::{Judgement, Verdict};

/// An element in the light of a punctual light.
struct LitEnd<'a> {
    e: &'a WorldElement,
    x: &'a Exchange,
    v: &'a Visibility,
}

impl SpaceJudge<'_> {
    /// Judges a pair of a punctual light and an element, which is at that side of the pair.
    pub(super) fn judge_light(
        &self,
        light: ElementId,
        element: ElementId,
        side: Side,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        let index = self.forest.light(light).expect("a light has an index");
        let patch = self.patch_of(element);
        let present = self.view.is_present(self.view.patch(patch).body);
        let Some(lamp) = self.view.light(index).filter(|_| present) else {
            return culled(CullReason::Absent);
        };
        // Before anything is sampled: both stages must agree down to the coarse level, and a narrow
        // cone may fall between the sample points of a large element.
        if matches!(self.criterion, RefinementCriterion::Error { .. })
            && self.forest.coarse(element).is_none()
        {
            narrowed.extend_from_slice(candidates);
            return passing(Verdict::Refine(side), 0);
        }
        let e = WorldElement::new(self.view, self.forest, element, false);
        let x = light_exchange(lamp, &e);
        if x.area_m2 <= 0.0 {
            return culled(CullReason::FacingAway);
        }
        let place = LightPlace::new(lamp, &e, self.view.far_m());
        let shaft = self.shaft((&e, &place.stand_in), None, (patch, patch));
        let start = narrowed.len();
        let found = shaft.narrow_to_blockers(candidates, narrowed, LISTED_MAX);
        let key = pair_key(self.forest.key(element), self.forest.key(light));
        let segments = place.segments(lamp, &e, key);
        let crowd = Crowd { shaft: &shaft, candidates: &narrowed[start..], simd: self.simd };
        let from = place.from(lamp, &e);
        let v = match found.is_crowd {
            true => light_past_crowd(&crowd, &segments),
            false => light_visibility(self.simd, &shaft, &found.blockers, (&segments, from)),
        };
        let (verdict, margin) =
            self.decide_light((light, element), side, &LitEnd { e: &e, x: &x, v: &v });
        Judgement { margin, ..carrying(verdict, &x, &v, (&e, &place.stand_in)) }
    }

    /// The verdict on a punctual light and an element, which is at that side of the pair.
    fn decide_light(
        &self,
        (light, element): (ElementId, ElementId),
        side: Side,
        &LitEnd { e, x, v }: &LitEnd<'_>,
    ) -> (Verdict, Margin) {
        let may_split = self.forest.can_split(element);
        match (self.stage, self.criterion) {
            (Stage::Coarse, _) => (Verdict::CoarseLink, Margin::Firm),
            (Stage::Fine(brightness), RefinementCriterion::Error { threshold }) => {
                let end = |id, area, reference_area| {
                    let light = brightness.of(self.forest, id);
                    End { area, reference_area, light, own_area: 0.0, surface_area: 0.0 }
                };
                let receiver = end(element, e.area, self.reference_area(brightness, element));
                let source = end(light, 0.0, f64::INFINITY);
                let norm = norm_of(brightness, threshold);
                let ends = [&receiver, &source];
                let error = estimate(x, v, ends, &BlockerSizes::NOTHING, &norm).on[0];
                if !may_split {
                    return (Verdict::Link, Margin::Firm);
                }
                let endless = Margin::ENDLESS;
                if error > threshold {
                    let (error, side_margin) =
                        (Margin::between(error, threshold), SideMargin::ENDLESS);
                    let margin =
                        Margin::Refined { error, on: side, both_ways: false, side: side_margin };
                    return (Verdict::Refine(side), margin);
                }
                let error = Margin::between(threshold, error);
                let on = if side == Side::A { [error, endless] } else { [endless, error] };
                (Verdict::Link, Margin::Link { on, both_ways: false })
            }
            (Stage::Fine(_), RefinementCriterion::FormFactor { epsilon, min_area_m2 }) => {
                let uneven = x.over_a.slope.max(v.spread_a) > epsilon;
                let room = e.area > min_area_m2 && may_split;
                (self.refine_if(uneven && room, side), Margin::Firm)
            }
        }
    }
}
