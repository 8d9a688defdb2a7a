//! What two elements exchange without occlusion: by points, along outlines where they are close, or as whole ends.

use crate::transport::{BlockerSizes, Exchange, Visibility};

use super::errors::{norm_of, refined};
use super::places::Elements;
use super::space_judge::{SpaceJudge, Stage, carrying, culled};
use crate::pair::margin::Margin;
use crate::pair::oracle::{Estimate, RefinementCriterion, estimate};
use crate::pair::tree::CullReason;
use crate::pair::verdict::{Judgement, Verdict};

/// What a pair exchanges without occlusion.
pub(super) struct Exchanged {
    pub(super) x: Exchange,
    /// How many times too large the area is that verdicts were first made with.
    pub(super) overstated: f64,
    /// The errors of those verdicts, where they were not enough to refine.
    pub(super) by_points: Option<Estimate>,
}

impl SpaceJudge<'_> {
    /// The link of a pair with nothing between its ends where nothing shines, `x` by points.
    ///
    /// Links then serve tables of form factors alone, which ask what whole elements exchange: that is known exactly, and how it is
    /// spread over the ends does not matter. Two turned rectangles 0.1 mm apart would be refined all over to find it again.
    pub(super) fn by_whole_ends(&self, pair: &Elements<'_>, x: &Exchange) -> Option<Judgement> {
        let (Stage::Fine(brightness), RefinementCriterion::Error { threshold }) =
            (self.stage, self.criterion)
        else {
            return None;
        };
        let is_whole = pair.in_contact() || pair.found.is_clear();
        if self.forest.shines() || !is_whole || x.area_m2 <= 0.0 {
            return None;
        }
        let (clear, nothing) = (Visibility::CLEAR, BlockerSizes::NOTHING);
        let ends = self.ends(pair, brightness);
        let norm = norm_of(brightness, threshold);
        let by_points = || estimate(x, &clear, ends.each_ref(), &nothing, &norm).error();
        let is_found = pair.in_contact() || (!x.is_steep && by_points() <= threshold);
        let (place_a, place_b) = pair.places;
        let x = if is_found { *x } else { x.along_outlines(self.simd, place_a, place_b) };
        Some(carrying(Verdict::Link, &x, &clear, pair.places))
    }

    /// What a pair exchanges without occlusion, `x` by points; as an error the verdict, where that alone decides.
    pub(super) fn exchanged(
        &self,
        pair: &Elements<'_>,
        x: Exchange,
    ) -> Result<Exchanged, Judgement> {
        let (place_a, place_b) = pair.places;
        if pair.in_contact() && x.area_m2 <= 0.0 {
            let is_covered = !pair.found.blockers.is_empty();
            let reason = if is_covered { CullReason::Covered } else { CullReason::FacingAway };
            return Err(culled(reason));
        }
        if !x.is_steep {
            return Ok(Exchanged { x, overstated: 1.0, by_points: None });
        }
        let mut by_points = None;
        // What the smaller area by points is enough to refine needs no better one.
        if let (Stage::Fine(brightness), RefinementCriterion::Error { threshold }) =
            (self.stage, self.criterion)
            && pair.found.is_clear()
        {
            let (clear, nothing) = (Visibility::CLEAR, BlockerSizes::NOTHING);
            let ends = self.ends(pair, brightness);
            let norm = norm_of(brightness, threshold);
            let e = estimate(&x, &clear, ends.each_ref(), &nothing, &norm);
            let wish = self.wish(pair.ids, &ends, &e);
            if let Some(refined) = refined(&e, wish, threshold, Margin::ENDLESS, 0) {
                return Err(refined);
            }
            by_points = Some(e);
        }
        let exact = x.along_outlines(self.simd, place_a, place_b);
        let overstated = (x.area_m2 / exact.area_m2.max(f64::MIN_POSITIVE)).max(1.0);
        Ok(Exchanged { x: exact, overstated, by_points })
    }
}
