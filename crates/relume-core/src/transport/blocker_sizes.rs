//! Sizes and distances of the blockers and lamps between two elements, which the error of a link depends on.

use crate::element::WorldElement;
use crate::scene::PatchId;

use super::candidates::InShaft;
use super::shaft::Shaft;
use super::spot::spot;
use super::tuning::BODY_SHARE;

/// Sizes of the blockers between two ends; infinite where there are none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockerSizes {
    /// For each end how unevenly lamps in the shaft light it (`spot`): 1.
    pub spots: [f64; 2],
    /// Area of the smallest shadow on each end, of those that blockers (of convex parts of bodies the largest face) would throw in the light of
    /// the other end's middle, m2.
    pub least_shadow_m2: [f64; 2],
    /// Area of all blockers, m2.
    pub all_m2: f64,
    /// For each end, how far an edge of a blocker moves over the other end, at most, in units of how far the point on
    /// this one moves that it is seen from: the ratio of the blocker's distances from the two centres.
    pub leverage: [f64; 2],
    /// For each end, how near a blocker is for its size: the square of its radius over the distance of its centre from the
    /// nearest blocker, at most 1. Where one stands on an end, light that arrives there stops at a line: 1.
    pub near: [f64; 2],
}

impl BlockerSizes {
    /// Nothing stands between the ends.
    pub const NOTHING: BlockerSizes = BlockerSizes {
        spots: [0.0; 2],
        least_shadow_m2: [f64::INFINITY; 2],
        all_m2: f64::INFINITY,
        leverage: [0.0; 2],
        near: [0.0; 2],
    };
}

/// The larger of two numbers, by end.
#[inline]
fn larger(one: [f64; 2], other: [f64; 2]) -> [f64; 2] {
    [one[0].max(other[0]), one[1].max(other[1])]
}

impl<'a> Shaft<'a> {
    /// For each end the largest `spot` of some lamps that shine on it, 1; what surrounds the ends has the areas `around_m2`.
    fn spots(&self, lamps: &[PatchId], around_m2: [f64; 2]) -> [f64; 2] {
        let mut most = [0.0; 2];
        for &patch in lamps {
            let both = self.view.patch(patch).twin.is_some();
            let frame = self.frame_of(patch);
            let (a, b, lamp) = (frame.a, frame.b, frame.occluder(patch));
            let lamp_m2 = self.forest.area_m2(self.forest.patch_root(patch));
            let of = |e: &WorldElement, around_m2: f64| {
                let shines = both || lamp.plane.distance(e.centre) > 0.0;
                if shines { spot(e, around_m2, (&lamp, lamp_m2)) } else { 0.0 }
            };
            most = larger(most, [of(a, around_m2[0]), of(b, around_m2[1])]);
        }
        most
    }

    /// Sizes of some blockers and lamps; of a crowd the blockers are those that stand for it.
    pub fn sizes_of(
        &self,
        InShaft { blockers, lamps, .. }: &InShaft,
        around_m2: [f64; 2],
    ) -> BlockerSizes {
        let spots = self.spots(lamps, around_m2);
        if blockers.is_empty() {
            return BlockerSizes { spots, ..BlockerSizes::NOTHING };
        }
        let area = |&patch: &PatchId| {
            let root = self.forest.patch_root(patch);
            let own = self.forest.area_m2(root);
            // The shadow of a finely tessellated body has the size of the body.
            match self.forest.is_in_group(root) {
                true => own.max(BODY_SHARE * self.forest.connected_m2(patch)),
                false => own,
            }
        };
        let mut sizes = BlockerSizes {
            spots,
            all_m2: blockers.iter().map(area).sum(),
            ..BlockerSizes::NOTHING
        };
        let shown = self.shown(blockers, &area);
        for patch in blockers {
            let part = self.forest.convex_part(*patch);
            let whole = shown.iter().find(|shown| Some(shown.0) == part);
            let area_m2 = whole.map_or(0.0, |shown| shown.1).max(area(patch));
            self.place(*patch, area_m2, &mut sizes);
        }
        sizes
    }

    /// For each convex part of a body of which two or more faces are among the blockers, the largest area that one of them shows towards the
    /// ends, m2. The shadow of a board is as large as the board, not as its edges.
    fn shown(&self, blockers: &[PatchId], area: &impl Fn(&PatchId) -> f64) -> Vec<(u32, f64)> {
        let mut out: Vec<(u32, f64, u32)> = Vec::new();
        for patch in blockers {
            let Some(part) = self.forest.convex_part(*patch) else { continue };
            let frame = self.frame_of(*patch);
            let (a, b) = (frame.a, frame.b);
            let way = b.centre - a.centre;
            let (towards, apart) = (frame.occluder(*patch).plane.normal.dot(way), way.length());
            // Of what is seen edge-on from the middles, other points see more.
            let share = (towards.abs() + a.radius + b.radius) / apart.max(f64::MIN_POSITIVE);
            let shown_m2 = area(patch) * share.min(1.0);
            match out.iter_mut().find(|found| found.0 == part) {
                Some(found) => *found = (part, found.1.max(shown_m2), found.2 + 1),
                None => out.push((part, shown_m2, 1)),
            }
        }
        out.retain(|found| found.2 > 1);
        out.into_iter().map(|(part, shown_m2, _)| (part, shown_m2)).collect()
    }

    /// Adds where a blocker of this area is: how far from each end.
    fn place(&self, blocker: PatchId, area_m2: f64, sizes: &mut BlockerSizes) {
        let BlockerSizes { leverage, near, least_shadow_m2, .. } = sizes;
        let frame = self.frame_of(blocker);
        let (a, b, polygon) = (frame.a, frame.b, frame.occluder(blocker));
        let from = |e: &WorldElement| polygon.distance(e.centre).max(f64::MIN_POSITIVE);
        let (from_a, from_b) = (from(a), from(b));
        // As a slide is thrown on a screen: close to the light it is as large as what it shows.
        let [on_a, on_b] =
            [from_a / from_b, from_b / from_a].map(|by| area_m2 * (1.0 + by) * (1.0 + by));
        *least_shadow_m2 = [least_shadow_m2[0].min(on_a), least_shadow_m2[1].min(on_b)];
        *leverage = larger(*leverage, [from_b / from_a, from_a / from_b]);
        let (by_a, by_b) = ((a.radius / from_a).min(1.0), (b.radius / from_b).min(1.0));
        *near = larger(*near, [by_a * by_a, by_b * by_b]);
    }
}
