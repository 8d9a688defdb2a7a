//! Verdicts on pairs of two elements, by either oracle.

use crate::element::{ElementId, WorldElement};
use crate::geometry::no_smaller;
use crate::transport::{
    Exchange, InShaft, Meeting, Side, Visibility, contact_exchange, exchange_by_points, meeting,
};

use super::errors::{norm_of, refined};
use super::places::{Elements, Places};
use super::sight::Seen;
use super::space_judge::{SpaceJudge, Stage, carrying, culled, passing};
use super::unoccluded::Exchanged;
use crate::pair::carried::Carried;
use crate::pair::coarse_brightness::CoarseBrightness;
use crate::pair::hash::pair_key;
use crate::pair::margin::Margin;
use crate::pair::oracle::{End, RefinementCriterion, estimate};
use crate::pair::tree::CullReason;
use crate::pair::tuning::{FINEST, LISTED_MAX, SPOT_AROUND};
use crate::pair::verdict::{Judgement, Verdict};

impl SpaceJudge<'_> {
    /// Judges a pair of elements; `known` is what it carried as a link while nothing of its geometry changed.
    pub(super) fn judge_elements(
        &self,
        (a, b): (ElementId, ElementId),
        known: Option<&Carried>,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        let patches = (self.patch_of(a), self.patch_of(b));
        let bodies = (self.view.patch(patches.0).body, self.view.patch(patches.1).body);
        if !self.view.is_present(bodies.0) || !self.view.is_present(bodies.1) {
            return culled(CullReason::Absent);
        }
        let places = Places::new(self, (a, b), !candidates.is_empty());
        let met = meeting(&places.own.0, &places.own.1);
        let shaft = places.shaft(self);
        let is_apart = || !shaft.is_contact() || self.leaves_neither(a, b);
        if met == Meeting::BackFacing || (met == Meeting::Coplanar && is_apart()) {
            return culled(CullReason::FacingAway);
        }
        if self.is_above_coarse(a, b) {
            shaft.narrow(candidates, narrowed);
            return passing(Verdict::Refine(self.larger_above_coarse(a, b)), 0);
        }
        // What two ends in contact exchange is found from all that covers it.
        let listed_max = if met == Meeting::Coplanar { usize::MAX } else { LISTED_MAX };
        let start = narrowed.len();
        let found = shaft.narrow_to_blockers(candidates, narrowed, listed_max);
        let key = pair_key(self.forest.key(a), self.forest.key(b));
        let places = (&places.own.0, &places.own.1);
        let (shaft, candidates) = (&shaft, &narrowed[start..]);
        let mut pair = Elements { ids: (a, b), places, key, met, shaft, candidates, found };
        let x = match pair.in_contact() {
            true => contact_exchange(places.0, places.1, shaft.contact_m2(&pair.found.blockers)),
            false => exchange_by_points(self.simd, places.0, places.1, met),
        };
        self.decide(&mut pair, x, known)
    }

    /// Whether what two touching elements exchange counts for nothing, as it leaves neither: where there is light. Links of patches
    /// that rest against each other say so themselves; tables of form factors have all of it.
    ///
    /// Among links of elements of unlike sizes it would be more than leaves them: light between a moving crate's bottom and the floor
    /// grew to 80 times that of the room.
    fn leaves_neither(&self, a: ElementId, b: ElementId) -> bool {
        self.forest.shines() && !self.forest.rest_in_contact(a, b)
    }

    /// Judges a pair of elements that face each other, at or below the coarse level; `x` is what they exchange by points.
    fn decide(&self, pair: &mut Elements<'_>, x: Exchange, known: Option<&Carried>) -> Judgement {
        // The paper's oracle refines without asking for blockers.
        let asks_first = matches!(self.criterion, RefinementCriterion::Error { .. });
        if asks_first {
            pair.leave_out_what_is_beside(&x);
        }
        if let Some(linked) = self.by_whole_ends(pair, &x) {
            return linked;
        }
        let exchanged = match self.exchanged(pair, x) {
            Ok(exchanged) => exchanged,
            Err(decided) => return decided,
        };
        let x = &exchanged.x;
        let firm = match self.by_form_factor(pair, x) {
            Ok(margin) => margin,
            Err(decided) => return decided,
        };
        if !asks_first {
            pair.leave_out_what_is_beside(x);
        }
        let seen = self.look(pair, x);
        let verdict = match (self.stage, self.criterion) {
            (Stage::Fine(brightness), RefinementCriterion::Error { threshold }) => {
                return self.by_error(pair, &exchanged, seen, known, (brightness, threshold));
            }
            (Stage::Coarse, _) => Verdict::CoarseLink,
            (Stage::Fine(_), _) if self.is_distant(pair) => {
                self.by_unevenness(pair.ids, pair.places, x, &seen.v)
            }
            (Stage::Fine(_), _) => Verdict::Link,
        };
        Judgement { margin: firm, ..carrying(verdict, x, &seen.v, pair.places) }
    }

    /// Whether an end of a pair is distant.
    fn is_distant(&self, pair: &Elements<'_>) -> bool {
        self.forest.is_distant(pair.ids.0) || self.forest.is_distant(pair.ids.1)
    }

    /// Margin of the form-factor oracle where it does not refine a pair; as an error its verdict where it does.
    fn by_form_factor(&self, pair: &Elements<'_>, x: &Exchange) -> Result<Margin, Judgement> {
        let (RefinementCriterion::FormFactor { epsilon, min_area_m2 }, Stage::Fine(_)) =
            (self.criterion, self.stage)
        else {
            return Ok(Margin::Firm);
        };
        let areas = (pair.places.0.area, pair.places.1.area);
        let larger = || self.larger(pair.ids, areas, min_area_m2);
        let Some(side) = larger().filter(|_| !self.is_distant(pair)) else {
            return Ok(Margin::Firm);
        };
        let factor = x.area_m2 / areas.0.min(areas.1);
        let wanted = factor > epsilon;
        // Only extrapolation asks how far the verdict is from changing.
        let mut margin = Margin::Firm;
        if self.lookahead.is_some() {
            let (large, small) = if wanted { (factor, epsilon) } else { (epsilon, factor) };
            margin = Margin::of_error(!wanted, Margin::between(large, small));
        }
        match wanted {
            true => Err(Judgement { margin, ..passing(Verdict::Refine(side), 0) }),
            false => Ok(margin),
        }
    }

    /// The error oracle's verdict on a pair.
    fn by_error(
        &self,
        pair: &Elements<'_>,
        exchanged: &Exchanged,
        seen: Seen<'_>,
        known: Option<&Carried>,
        (brightness, threshold): (&CoarseBrightness, f64),
    ) -> Judgement {
        let Exchanged { x, overstated, by_points } = exchanged;
        let (v, way) = (&seen.v, seen.way);
        let ends = self.ends(pair, brightness);
        let norm = norm_of(brightness, threshold);
        let around = |end: &End| end.surface_area.min(SPOT_AROUND * norm.reference_area_m2);
        let around = [around(&ends[0]), around(&ends[1])];
        let sizes = match &seen.crossed {
            Some(crossed) => {
                let (blockers, lamps) = (crossed.clone(), pair.found.lamps.clone());
                pair.shaft.sizes_of(&InShaft { blockers, lamps, ..pair.found }, around)
            }
            None => pair.shaft.sizes_of(&pair.found, around),
        };
        let e = estimate(x, v, ends.each_ref(), &sizes, &norm);
        let wish = self.wish(pair.ids, &ends, &e);
        // In another light the errors by points may be enough to refine, and that perhaps the other side.
        let until_points = by_points
            .map_or(Margin::ENDLESS, |e| Margin::between(threshold, e.error().min(threshold)));
        if let Some(refined) = refined(&e, wish, threshold, way.min(until_points), v.segments) {
            return refined;
        }
        let below = |side: usize| match wish {
            Some(_) => {
                let by_points = by_points.map_or(0.0, |e| e.on[side]);
                let error = (overstated * e.on[side]).max(by_points);
                way.min(Margin::between(threshold, error.min(threshold)))
            }
            None => way,
        };
        let both_ways = way != Margin::ENDLESS;
        let margin = Margin::Link { on: [below(0), below(1)], both_ways };
        // How V is found may depend on the light.
        if let Some(&carried) = known.filter(|_| !both_ways) {
            return Judgement { verdict: Verdict::Link, carried, margin, segments: v.segments };
        }
        let v = self.look_closer(pair, seen, pair.factor(x) / threshold.max(FINEST));
        Judgement { margin, ..carrying(Verdict::Link, x, &v, pair.places) }
    }

    /// The form-factor oracle's verdict on an end and what is distant: no splitting makes the factor smaller, but what
    /// arrives becomes even.
    fn by_unevenness(
        &self,
        (a, b): (ElementId, ElementId),
        (place_a, place_b): (&WorldElement, &WorldElement),
        x: &Exchange,
        v: &Visibility,
    ) -> Verdict {
        let RefinementCriterion::FormFactor { epsilon, min_area_m2 } = self.criterion else {
            return Verdict::Link;
        };
        let (receiver, place, over, spread, side) = match self.forest.is_distant(a) {
            true => (b, place_b, &x.over_b, v.spread_b, Side::B),
            false => (a, place_a, &x.over_a, v.spread_a, Side::A),
        };
        let room = place.area > min_area_m2 && self.forest.can_split(receiver);
        self.refine_if(over.slope.max(spread) > epsilon && room, side)
    }

    /// The side above the coarse level; the larger if both are.
    fn larger_above_coarse(&self, a: ElementId, b: ElementId) -> Side {
        match (self.forest.coarse(a), self.forest.coarse(b)) {
            (None, Some(_)) => Side::A,
            (Some(_), None) => Side::B,
            _ if no_smaller(self.forest.area_m2(a), self.forest.area_m2(b)) => Side::A,
            _ => Side::B,
        }
    }

    /// The larger side if it may still be refined, else the smaller.
    fn larger(
        &self,
        (a, b): (ElementId, ElementId),
        (area_a, area_b): (f64, f64),
        min_area: f64,
    ) -> Option<Side> {
        let order =
            if no_smaller(area_a, area_b) { [Side::A, Side::B] } else { [Side::B, Side::A] };
        order.into_iter().find(|&side| {
            let (id, area) = if side == Side::A { (a, area_a) } else { (b, area_b) };
            area > min_area && self.forest.can_split(id)
        })
    }
}
