//! The judge of pairs in space, and what verdicts on all kinds of ends ask of it.

use crate::element::{ElementId, Forest, WorldElement, WorldView};
use crate::predict::{Lookahead, MotionBounds};
use crate::scene::{BodyId, PatchId};
use crate::transport::{Exchange, Shaft, Side, Simd, Visibility};

use crate::pair::carried::{Carried, Gradients, in_steps};
use crate::pair::coarse_brightness::CoarseBrightness;
use crate::pair::ends::body_of;
use crate::pair::margin::Margin;
use crate::pair::oracle::RefinementCriterion;
use crate::pair::tree::CullReason;
use crate::pair::tuning::CONNECTED_SHARE;
use crate::pair::verdict::{Judgement, Verdict};
use crate::pair::world_change::WorldChange;

/// Level down to which pairs are judged.
#[derive(Clone, Copy, Debug)]
pub enum Stage<'a> {
    /// Down to pairs of coarse elements, which become coarse links.
    Coarse,
    /// Down to links by the oracle, which weighs by this brightness.
    Fine(&'a CoarseBrightness),
}

/// Judge of pairs in space: the forest at one instant, with the oracle.
pub struct SpaceJudge<'a> {
    /// The elements.
    pub forest: &'a mut Forest,
    /// Places of the elements at this instant.
    pub view: &'a WorldView,
    /// Level down to which pairs are judged.
    pub stage: Stage<'a>,
    /// What decides on links.
    pub criterion: RefinementCriterion,
    /// Vector instructions.
    pub simd: Simd,
    /// Difference from the last update; `None` in a cold build.
    pub change: Option<&'a WorldChange<'a>>,
    /// Bounds of the known motion; `None` where certificates are not asked for.
    pub motion_bounds: Option<&'a MotionBounds>,
    /// Settings of extrapolation; `None` where pairs are not extrapolated.
    pub lookahead: Option<Lookahead>,
}

/// A verdict of which the numbers do not matter.
pub(in crate::pair) fn passing(verdict: Verdict, segments: u32) -> Judgement {
    Judgement { verdict, carried: Carried::default(), margin: Margin::Firm, segments }
}

pub(in crate::pair) fn culled(reason: CullReason) -> Judgement {
    passing(Verdict::Cull(reason), 0)
}

/// A verdict to link, finely or coarsely, with the values of the link.
pub(super) fn carrying(
    verdict: Verdict,
    x: &Exchange,
    v: &Visibility,
    (a, b): (&WorldElement, &WorldElement),
) -> Judgement {
    let gradients = Gradients::new(
        (x.over_a.gradient + v.gradient_a, a.radius),
        (x.over_b.gradient + v.gradient_b, b.radius),
    );
    let visibility = in_steps(v.value);
    let carried = Carried { exchange_area_m2: x.area_m2 as f32, visibility, gradients };
    Judgement { verdict, carried, margin: Margin::Firm, segments: v.segments }
}

impl SpaceJudge<'_> {
    pub(super) fn shaft<'a>(
        &'a self,
        (a, b): (&'a WorldElement, &'a WorldElement),
        own: Option<(BodyId, &'a WorldElement, &'a WorldElement)>,
        patches: (PatchId, PatchId),
    ) -> Shaft<'a> {
        Shaft { forest: self.forest, view: self.view, a, b, own, patches }
    }

    pub(super) fn patch_of(&self, id: ElementId) -> PatchId {
        self.forest.patch(id).expect("elements have patches")
    }

    /// The one body that a node belongs to.
    pub(super) fn body_of(&self, id: ElementId) -> Option<BodyId> {
        body_of(self.forest, self.view, id)
    }

    /// Area at which an element weighs 1 in the error norm, m2: by the size of the scene, or of the connected patches that
    /// it belongs to where these are small.
    pub(in crate::pair) fn reference_area(
        &self,
        brightness: &CoarseBrightness,
        id: ElementId,
    ) -> f64 {
        let of_scene = brightness.reference_area_m2();
        let of_patch = |patch| CONNECTED_SHARE * self.forest.connected_m2(patch);
        self.forest.patch(id).map_or(of_scene, |patch| of_scene.min(of_patch(patch)))
    }

    /// Whether an end is above the level at which the coarse solution links.
    pub(super) fn is_above_coarse(&self, a: ElementId, b: ElementId) -> bool {
        matches!(self.criterion, RefinementCriterion::Error { .. })
            && (self.forest.coarse(a).is_none() || self.forest.coarse(b).is_none())
    }

    pub(super) fn refine_if(&self, wanted: bool, side: Side) -> Verdict {
        if wanted { Verdict::Refine(side) } else { Verdict::Link }
    }
}
