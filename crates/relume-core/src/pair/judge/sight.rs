//! How visibility of two elements is found: clipped or over segments, at a first look and for a link.

use crate::scene::PatchId;
use crate::transport::{
    CELLS_MAX, CLIPPED_MAX, Clipping, Crowd, Exchange, FirstLook, Visibility, clipping, visibility,
};

use super::places::Elements;
use super::space_judge::{SpaceJudge, Stage};
use crate::pair::margin::Margin;
use crate::pair::oracle::RefinementCriterion;
use crate::pair::tuning::{
    CLIPPED_MAX_CLOSE, CLIPPED_MAX_REST, CLOSE_SHARE, CLOSER, FINEST, OVERLOOKED_MAX, SAMPLED_MAX,
};

/// A first look at the visibility of a pair.
pub(super) struct Seen<'p> {
    pub(super) v: Visibility,
    /// How far off it may be.
    pub(super) doubt: f64,
    /// Cells along a side of the end that it was clipped from.
    pub(super) cells: u32,
    /// How far the light is from V being found in another way.
    pub(super) way: u16,
    pub(super) clipped: Option<Clipping<'p>>,
    pub(super) crowd: Option<Crowd<'p>>,
    /// What segments past a crowd crossed.
    pub(super) crossed: Option<Vec<PatchId>>,
}

impl SpaceJudge<'_> {
    /// A first look at the visibility of a pair: clipped where few polygons are in the way, else sampled.
    pub(super) fn look<'p>(&self, pair: &'p Elements<'_>, x: &Exchange) -> Seen<'p> {
        let &Elements { shaft, candidates, ref found, key, .. } = pair;
        let crowd = found.is_crowd.then_some(Crowd { shaft, candidates, simd: self.simd });
        let blockers = pair.blockers();
        let occluders = if crowd.is_some() { usize::MAX } else { shaft.occluders(blockers) };
        let (most, way) = self.clipped_max(pair, x, occluders);
        let factor = pair.factor(x);
        // Of the canonical brightness, which is coarse, less is asked.
        let overlooked_max = match (self.stage, self.criterion) {
            (Stage::Fine(_), RefinementCriterion::Error { threshold }) => {
                OVERLOOKED_MAX * threshold.max(FINEST) / factor.max(f64::MIN_POSITIVE)
            }
            _ => f64::INFINITY,
        };
        let clip = || clipping(self.simd, shaft, blockers);
        let mut clipped = (1..=most).contains(&occluders).then(clip);
        let (mut sampled, mut crossed) = (None, None);
        if clipped.is_none() {
            let v = match &crowd {
                Some(crowd) => {
                    let (v, in_the_way) = crowd.first_look(key);
                    crossed = Some(in_the_way);
                    v
                }
                None => visibility(self.simd, shaft, blockers, key, 4),
            };
            // Segments that are all blocked prove nothing.
            if v.value <= 0.0 && occluders <= CLIPPED_MAX_CLOSE && SAMPLED_MAX > overlooked_max {
                clipped = Some(clip());
            }
            sampled = Some(v);
        }
        let FirstLook { v, doubt, cells } = match (&mut clipped, sampled) {
            (Some(clipped), _) => clipped.first_look(overlooked_max),
            (None, sampled) => {
                let v = sampled.expect("what is not clipped is sampled");
                FirstLook { v, doubt: 0.0, cells: 0 }
            }
        };
        Seen { v, doubt, cells, way, clipped, crowd, crossed }
    }

    /// How many polygons in the way of a pair are clipped at most, and how far its light is from another number for those that
    /// are: [`Margin::ENDLESS`] where that changes nothing.
    fn clipped_max(&self, pair: &Elements<'_>, x: &Exchange, occluders: usize) -> (usize, u16) {
        let (Stage::Fine(brightness), RefinementCriterion::Error { threshold }) =
            (self.stage, self.criterion)
        else {
            return (CLIPPED_MAX, Margin::ENDLESS);
        };
        let ends = [(pair.ids.0, pair.places.0.area), (pair.ids.1, pair.places.1.area)];
        let contribution = self.relative_contribution(brightness, ends, x.area_m2);
        let limit = CLOSE_SHARE * threshold;
        let most = if contribution > limit { CLIPPED_MAX_CLOSE } else { CLIPPED_MAX_REST };
        let way = match (CLIPPED_MAX_REST + 1..=CLIPPED_MAX_CLOSE).contains(&occluders) {
            true => Margin::between(contribution.max(limit), contribution.min(limit)),
            false => Margin::ENDLESS,
        };
        (most, way)
    }

    /// The visibility that a link carries; `stake` is its form factor over what it may err by.
    pub(super) fn look_closer(
        &self,
        pair: &Elements<'_>,
        seen: Seen<'_>,
        stake: f64,
    ) -> Visibility {
        let Seen { v, doubt, cells, clipped, crowd, .. } = seen;
        match (clipped, crowd) {
            (Some(mut clipped), _) => {
                let cells = cells_for(cells, stake * doubt);
                if cells <= 1 {
                    return v;
                }
                let again = clipped.visibility_of(pair.key, cells);
                Visibility { segments: v.segments + again.segments, ..again }
            }
            (None, _) if v.segments == 0 => v,
            (None, crowd) => {
                let again = match &crowd {
                    Some(crowd) => crowd.visibility(pair.key, 6),
                    None => visibility(self.simd, pair.shaft, pair.blockers(), pair.key, 6),
                };
                Visibility { segments: v.segments + again.segments, ..again }
            }
        }
    }
}

/// Cells along a side of an end that a link which is partly hidden is looked at from; 1 if its first look, from `first` cells a side, is
/// enough. The more, the larger its `error`: how far V may be off times the form factor, over what a link may err by.
fn cells_for(first: u32, error: f64) -> u32 {
    if error <= CLOSER {
        return 1;
    }
    // The error of n x n points on a function with kinks falls as 1 / n^2.
    let cells = (f64::from(first) * (error / CLOSER).sqrt()).ceil();
    cells.min(f64::from(CELLS_MAX)) as u32
}
