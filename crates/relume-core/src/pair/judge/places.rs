//! Two elements placed for a verdict, with what may be between them.

use crate::element::{ElementId, WorldElement};
use crate::scene::{BodyId, PatchId};
use crate::transport::{Exchange, InShaft, Meeting, Shaft};

use super::space_judge::SpaceJudge;

/// Places of the two elements of a pair.
pub(super) struct Places {
    /// In the frame that their light must not depend on: their body's if they have one in common.
    pub(super) own: (WorldElement, WorldElement),
    /// In the world, where that differs and is asked for.
    pub(super) world: Option<(BodyId, WorldElement, WorldElement)>,
    pub(super) patches: (PatchId, PatchId),
}

impl Places {
    #[inline]
    pub(super) fn new(at: &SpaceJudge<'_>, (a, b): (ElementId, ElementId), world: bool) -> Places {
        let patches = (at.patch_of(a), at.patch_of(b));
        let body = at.view.patch(patches.0).body;
        let one_body = at.view.patch(patches.1).body == body;
        let place = |id, in_body| WorldElement::new(at.view, at.forest, id, in_body);
        Places {
            own: (place(a, one_body), place(b, one_body)),
            world: (one_body && world).then(|| (body, place(a, false), place(b, false))),
            patches,
        }
    }

    pub(super) fn shaft<'a>(&'a self, at: &'a SpaceJudge<'_>) -> Shaft<'a> {
        let (own_a, own_b) = (&self.own.0, &self.own.1);
        match &self.world {
            Some((body, a, b)) => at.shaft((a, b), Some((*body, own_a, own_b)), self.patches),
            None => at.shaft((own_a, own_b), None, self.patches),
        }
    }
}

/// A pair of elements that is decided on.
pub(super) struct Elements<'a> {
    pub(super) ids: (ElementId, ElementId),
    pub(super) places: (&'a WorldElement, &'a WorldElement),
    pub(super) key: u64,
    pub(super) met: Meeting,
    pub(super) shaft: &'a Shaft<'a>,
    /// Candidates in the shaft.
    pub(super) candidates: &'a [u32],
    pub(super) found: InShaft,
}

impl Elements<'_> {
    pub(super) fn in_contact(&self) -> bool {
        self.met == Meeting::Coplanar
    }

    /// What may be in the way: of two ends in contact nothing, as what covers them is left out of what they exchange.
    pub(super) fn blockers(&self) -> &[PatchId] {
        if self.in_contact() { &[] } else { &self.found.blockers }
    }

    /// Leaves out blockers that are only beside the ends: a steep pair that counts as partly hidden is refined as if points
    /// could not tell how much.
    pub(super) fn leave_out_what_is_beside(&mut self, x: &Exchange) {
        if x.is_steep && self.shaft.is_beside(&self.found.blockers) {
            self.found.blockers.clear();
        }
    }

    /// Form factor from the smaller end to the other.
    pub(super) fn factor(&self, x: &Exchange) -> f64 {
        x.area_m2 / self.places.0.area.min(self.places.1.area)
    }
}
