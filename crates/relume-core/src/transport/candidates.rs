//! Which nodes of the forest may block segments of a pair, and which patches do: walks down from the candidates of a pair above.

use crate::element::{ElementId, Kind};
use crate::scene::{BodyId, PatchId};

use super::shaft::{Shaft, ShaftsOfBoxes, Standing};

/// Candidate occluders of a pair: nodes of the forest's fixed part (clusters and patch roots) that may stand between its ends.
/// Conservative: a patch below none of them blocks nothing.
pub type Candidates = [u32];

/// Patches in the shaft of a pair.
#[derive(Clone, Debug, Default)]
pub struct InShaft {
    /// Those that block; none where they are a crowd.
    pub blockers: Vec<PatchId>,
    /// Those that emit light at any time; they may block as well or not.
    pub lamps: Vec<PatchId>,
    /// Whether more block than were to be listed.
    pub is_crowd: bool,
}

impl InShaft {
    /// Whether nothing blocks.
    pub fn is_clear(&self) -> bool {
        self.blockers.is_empty() && !self.is_crowd
    }
}

impl<'a> Shaft<'a> {
    /// Which of `parents` (candidates of a pair above) remain candidates here, appended to `out`;
    /// clusters large against the shaft are opened.
    pub fn narrow(&self, parents: &Candidates, out: &mut Vec<u32>) {
        let (shafts, keep_m) = (self.shafts(), self.keep_m());
        for &parent in parents {
            self.walk(&shafts, ElementId(parent), keep_m, &mut |id, _| {
                out.push(id.0);
                true
            });
        }
    }

    /// Clusters of this size are small against the shaft, metres.
    fn keep_m(&self) -> f64 {
        let length = (self.b.centre - self.a.centre).length() + self.a.radius + self.b.radius;
        0.25 * length.min(self.view.far_m())
    }

    /// The patches among and below `candidates` that may block segments of this very pair, in the
    /// forest's order. Which they are depends on the pair alone, not on how `candidates` were found.
    pub fn blockers(&self, candidates: &Candidates) -> Vec<PatchId> {
        let (shafts, mut out) = (self.shafts(), Vec::new());
        for &candidate in candidates {
            self.walk(&shafts, ElementId(candidate), -1.0, &mut |id, standing| {
                out.extend(self.forest.patch(id).filter(|_| standing == Standing::Between));
                true
            });
        }
        out
    }

    /// [`Shaft::narrow`] and [`Shaft::blockers`] in one walk; of more blockers than `listed_max` none are listed.
    pub fn narrow_to_blockers(
        &self,
        parents: &Candidates,
        out: &mut Vec<u32>,
        listed_max: usize,
    ) -> InShaft {
        let (shafts, keep_m) = (self.shafts(), self.keep_m());
        let mut found = InShaft::default();
        for &parent in parents {
            self.walk(&shafts, ElementId(parent), keep_m, &mut |id, standing| {
                out.push(id.0);
                match self.forest.patch(id) {
                    Some(patch) => self.meet((patch, standing), listed_max, &mut found),
                    None if found.is_crowd && !self.forest.may_hold_lamp(id) => {}
                    None => {
                        self.walk(&shafts, id, -1.0, &mut |below, standing| {
                            if let Some(patch) = self.forest.patch(below) {
                                self.meet((patch, standing), listed_max, &mut found);
                            }
                            !found.is_crowd || self.forest.may_hold_lamp(id)
                        });
                    }
                }
                true
            });
        }
        found
    }

    /// Lists a patch that is not out of the shaft.
    fn meet(&self, (patch, standing): (PatchId, Standing), listed_max: usize, found: &mut InShaft) {
        if standing == Standing::Between && !found.is_crowd {
            found.blockers.push(patch);
            if found.blockers.len() > listed_max {
                found.is_crowd = true;
                found.blockers.clear();
            }
        }
        if self.forest.is_lamp(patch) {
            found.lamps.push(patch);
        }
    }

    /// Blockers of this pair among those of a pair above.
    pub fn those_that_block(&self, blockers: &[PatchId]) -> Vec<PatchId> {
        let shafts = self.shafts();
        let blocks = |patch: &PatchId| self.standing(&shafts, *patch) == Standing::Between;
        blockers.iter().copied().filter(blocks).collect()
    }

    /// Whether anything at or below `id` may block segments of this pair or of one below it,
    /// what rides on `except` aside.
    pub fn is_entered_by(&self, id: ElementId, except: Option<BodyId>) -> bool {
        self.is_entered_below(&self.shafts(), id, except)
    }

    /// [`Shaft::is_entered_by`] with the shafts of the ends' boxes.
    fn is_entered_below(
        &self,
        shafts: &ShaftsOfBoxes,
        id: ElementId,
        except: Option<BodyId>,
    ) -> bool {
        if except.is_some() && self.forest.cluster_body(id) == except {
            return false;
        }
        if except.is_some() && self.forest.patch(id).is_none() {
            // Groups of bodies are opened one by one, so that the excepted one is met.
            let bounds = self.view.fixed_box(id);
            return self.forest.kind(id) == Kind::Cluster
                && shafts.world.meets(bounds, self.slack())
                && self
                    .forest
                    .children(id)
                    .any(|c| self.is_entered_below(shafts, ElementId(c), except));
        }
        let mut entered = false;
        self.walk(shafts, id, -1.0, &mut |_, _| {
            entered = true;
            false
        });
        entered
    }

    /// Visits the candidates at or below `id`: patches that are not out, and clusters no larger than `keep_m`;
    /// ends and returns false as soon as `visit` does.
    fn walk(
        &self,
        shafts: &ShaftsOfBoxes,
        id: ElementId,
        keep_m: f64,
        visit: &mut dyn FnMut(ElementId, Standing) -> bool,
    ) -> bool {
        if self.view.fixed_box(id).is_empty() || self.forest.kind(id) == Kind::Light {
            return true;
        }
        if let Some(patch) = self.forest.patch(id) {
            let standing = self.standing(shafts, patch);
            return standing == Standing::Out || visit(id, standing);
        }
        let body = self.forest.cluster_body(id);
        let frame = self.frame_of_body(body);
        let bounds = frame.bounds(id);
        if !shafts.seen_in(&frame).meets(bounds, self.slack()) {
            return true;
        }
        // Groups of bodies are never kept: their boxes mix frames. Several at rest are in the world.
        let in_one_frame = body.is_some() || (self.own.is_none() && self.forest.is_of_stage(id));
        if in_one_frame && bounds.diagonal() <= keep_m {
            return visit(id, Standing::Beside);
        }
        self.forest.children(id).all(|c| self.walk(shafts, ElementId(c), keep_m, visit))
    }
}
