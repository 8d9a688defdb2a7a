//! Visibility V of a pair past more blockers than are worth listing: over the same segments, which look for what they cross in the
//! hierarchy, all sixteen of a bundle at once.
//!
//! Equal to [`visibility`](super::visibility()) over a list of the blockers, bit for bit. Must not know how blockers are counted.

use crate::element::{ElementId, Kind, WorldElement};
use crate::scene::PatchId;

use super::candidates::Candidates;
use super::kernel::Simd;
use super::segments::{SEGMENTS, SegmentBundle};
use super::shaft::{LIFT, Shaft, ShaftsOfBoxes, Standing, TestFrame};
use super::share::Visibility;
use super::tally::Tally;

/// The blockers of a pair, not listed.
pub struct Crowd<'a> {
    /// The pair.
    pub shaft: &'a Shaft<'a>,
    /// Candidates that they are among.
    pub candidates: &'a Candidates,
    /// Vector instructions.
    pub simd: Simd,
}

/// A bundle of segments in the world, and in the frame of the body that both ends ride on.
struct Bundles<'a> {
    world: &'a SegmentBundle,
    own: Option<&'a SegmentBundle>,
}

/// What segments crossed.
#[derive(Default)]
struct Crossed {
    /// A bit for each segment that was blocked.
    blocked: u16,
    /// All that blocked any, if they are asked for.
    by: Option<Vec<PatchId>>,
}

impl Crowd<'_> {
    /// Visibility over sixteen segments, and all patches that block any of them, ascending: a sample of the crowd.
    pub fn first_look(&self, key: u64) -> (Visibility, Vec<PatchId>) {
        let mut crossed = Crossed { by: Some(Vec::new()), ..Crossed::default() };
        let v = self.look(key, 4, &mut crossed);
        let mut by = crossed.by.unwrap_or_default();
        by.sort_unstable();
        (v, by)
    }

    /// Visibility over `2^log2_count` segments; `key` names the pair and nothing else.
    pub fn visibility(&self, key: u64, log2_count: u32) -> Visibility {
        self.look(key, log2_count, &mut Crossed::default())
    }

    fn look(&self, key: u64, log2_count: u32, crossed: &mut Crossed) -> Visibility {
        let Shaft { a, b, own, .. } = *self.shaft;
        let ends = self.shaft.own_frame();
        let mut tally = Tally::default();
        for block in 0..(1_u32 << log2_count) / SEGMENTS as u32 {
            let of = |a: &WorldElement, b: &WorldElement| {
                SegmentBundle::new(a, b, key, log2_count, block)
            };
            let (world, own) = (of(a, b), own.map(|(_, a, b)| of(a, b)));
            crossed.blocked = 0;
            self.cross(&Bundles { world: &world, own: own.as_ref() }, crossed);
            let weights = own.as_ref().unwrap_or(&world);
            tally.add(weights, crossed.blocked, ends.a, ends.b);
        }
        tally.finish(1 << log2_count, ends.a, ends.b)
    }

    /// Finds what the segments of a bundle cross.
    fn cross(&self, bundles: &Bundles<'_>, crossed: &mut Crossed) {
        let Shaft { forest, view, .. } = *self.shaft;
        // What covers an end is lifted off it.
        let margin_m = 2.0 * LIFT * self.shaft.slack();
        let shafts = self.shaft.shafts();
        let mut stack: Vec<u32> = self.candidates.to_vec();
        while let Some(id) = stack.pop() {
            let id = ElementId(id);
            // Those that are blocked are done, unless all that blocks them is asked for.
            let done = if crossed.by.is_some() { 0 } else { crossed.blocked };
            if done == u16::MAX {
                return;
            }
            if view.fixed_box(id).is_empty() || forest.kind(id) == Kind::Light {
                continue;
            }
            let frame = self.frame_of(id);
            let bundle = bundles.own.filter(|_| frame.is_own).unwrap_or(bundles.world);
            if bundle.that_meet(self.simd, frame.bounds(id), margin_m) & !done == 0 {
                continue;
            }
            match forest.patch(id) {
                Some(patch) => self.cross_patch(&shafts, bundle, patch, crossed),
                None => stack.extend(forest.children(id)),
            }
        }
    }

    /// The frame in which a node is tested.
    fn frame_of(&self, id: ElementId) -> TestFrame<'_> {
        match self.shaft.forest.patch(id) {
            Some(patch) => self.shaft.frame_of(patch),
            None => self.shaft.frame_of_body(self.shaft.forest.cluster_body(id)),
        }
    }

    fn cross_patch(
        &self,
        shafts: &ShaftsOfBoxes,
        bundle: &SegmentBundle,
        patch: PatchId,
        crossed: &mut Crossed,
    ) {
        let lifted = self.shaft.lifted(patch).1.polygon();
        let hit = bundle.blocked_by(self.simd, &lifted, 2.0 * self.shaft.slack());
        let is_new = hit & !crossed.blocked != 0 || crossed.by.is_some();
        if hit == 0 || !is_new || self.shaft.standing(shafts, patch) != Standing::Between {
            return;
        }
        crossed.blocked |= hit;
        if let Some(by) = &mut crossed.by {
            by.push(patch);
        }
    }
}

/// Visibility of a punctual light, the second end of the shaft, from an element past a crowd; `segments` come from
/// [`SegmentBundle::to_light`].
pub fn light_past_crowd(crowd: &Crowd<'_>, segments: &SegmentBundle) -> Visibility {
    let (mut crossed, mut tally) = (Crossed::default(), Tally::default());
    crowd.cross(&Bundles { world: segments, own: None }, &mut crossed);
    let e = crowd.shaft.a;
    tally.add(segments, crossed.blocked, e, e);
    let both = tally.finish(SEGMENTS as u32, e, e);
    Visibility { gradient_b: glam::DVec2::ZERO, spread_b: 0.0, ..both }
}
