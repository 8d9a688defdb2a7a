//! What the pair tree asks of a judge ([`Judge`]), answered in space by the kinds of a pair's ends.

use std::cell::Cell;
use std::ops::Range;

use crate::element::{ElementId, ElementKey, Kind};
use crate::predict::{Lookahead, Tick};
use crate::transport::Side;

use super::places::Places;
use super::space_judge::{SpaceJudge, Stage, culled};
use crate::pair::carried::Carried;
use crate::pair::certificate::SpaceCertificateTests;
use crate::pair::certificate_tests::{CertificateTests, Finding};
use crate::pair::ends::BoxShaft;
use crate::pair::margin::Margin;
use crate::pair::oracle::RefinementCriterion;
use crate::pair::space::{Hierarchy, Judge};
use crate::pair::tree::CullReason;
use crate::pair::tuning::EFFORT;
use crate::pair::verdict::{Judgement, Stale};
use crate::pair::world_change::WorldChange;

impl Hierarchy for SpaceJudge<'_> {
    fn children(&self, id: ElementId) -> Range<u32> {
        self.forest.children(id)
    }

    fn split(&mut self, id: ElementId) -> (Range<u32>, bool) {
        match self.forest.kind(id) {
            Kind::Element => self.forest.split(id),
            _ => (self.forest.children(id), false),
        }
    }

    fn release(&mut self, id: ElementId) {
        if self.forest.kind(id) == Kind::Element {
            self.forest.release(id);
        }
    }

    fn key(&self, id: ElementId) -> ElementKey {
        self.forest.key(id)
    }

    fn element_count(&self) -> usize {
        self.forest.counts().elements as usize
    }
}

impl Judge for SpaceJudge<'_> {
    fn judge(
        &self,
        (a, b): (ElementId, ElementId),
        known: Option<&Carried>,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        let receives_nothing =
            |id| self.forest.kind(id) == Kind::Light || self.forest.is_distant(id);
        if receives_nothing(a) && receives_nothing(b) {
            return culled(CullReason::NoReceiver);
        }
        if self.is_group_pair(a, b) {
            return self.judge_group_pair((a, b), candidates, narrowed);
        }
        match (self.forest.kind(a), self.forest.kind(b)) {
            (Kind::Element, Kind::Element) => {
                self.judge_elements((a, b), known, candidates, narrowed)
            }
            (Kind::Cluster, Kind::Light) if self.is_group(a) => {
                self.judge_group_light((b, a), Side::A, candidates, narrowed)
            }
            (Kind::Light, Kind::Cluster) if self.is_group(b) => {
                self.judge_group_light((a, b), Side::B, candidates, narrowed)
            }
            (Kind::Element, Kind::Light) => self.judge_light(b, a, Side::A, candidates, narrowed),
            (Kind::Light, Kind::Element) => self.judge_light(a, b, Side::B, candidates, narrowed),
            _ => self.judge_clusters(a, b, candidates, narrowed),
        }
    }

    fn withstands(&self, a: ElementId, b: ElementId, margin: Margin) -> Option<Margin> {
        margin.after(&self.change?.growth(self.forest, a, b)?)
    }

    fn stale(&self, a: ElementId, b: ElementId, certified: bool) -> Stale {
        let Some(change) = self.change else { return Stale::Moved };
        let brightness = match self.stage {
            Stage::Fine(_) => change.brightness(self.forest, a, b),
            Stage::Coarse => Stale::Nothing,
        };
        let geometry = match certified {
            true if change.moved(self.forest, self.view, a, b) => Stale::Followed,
            true => Stale::Nothing,
            false => change.geometry(self.forest, self.view, a, b),
        };
        if geometry == Stale::Nothing { brightness } else { geometry }
    }

    fn narrow(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> bool {
        if self.is_group_pair(a, b) {
            // Whether a group is refined depends on what hides it.
            let is_self = a == b && matches!(self.stage, Stage::Fine(_));
            if is_self {
                narrowed.extend_from_slice(candidates);
            }
            return is_self;
        }
        match (self.forest.kind(a), self.forest.kind(b)) {
            (Kind::Element, Kind::Element) => {
                // Of what is distant the form-factor oracle goes by what is seen, too.
                let distant = self.forest.is_distant(a) || self.forest.is_distant(b);
                let by_area =
                    matches!(self.criterion, RefinementCriterion::FormFactor { .. }) && !distant;
                if !by_area && !self.is_above_coarse(a, b) {
                    return false;
                }
                let places = Places::new(self, (a, b), !candidates.is_empty());
                places.shaft(self).narrow(candidates, narrowed);
            }
            (Kind::Light, _) | (_, Kind::Light) => return false,
            _ if a == b => narrowed.extend_from_slice(candidates),
            _ => {
                let body = self.body_of(a).filter(|&body| self.body_of(b) == Some(body));
                let shaft = BoxShaft::new(self.view, self.forest, (a, b), body);
                shaft.narrow(candidates, narrowed);
            }
        }
        true
    }

    fn brightness_changed(&self, a: ElementId, b: ElementId) -> bool {
        let differs =
            |change: &WorldChange<'_>| change.brightness(self.forest, a, b) == Stale::Brightness;
        self.change.is_some_and(differs)
    }

    fn lookahead(&self) -> Option<&Lookahead> {
        match self.stage {
            // Both stages meet the same pairs.
            Stage::Coarse => None,
            Stage::Fine(_) => self.lookahead.as_ref(),
        }
    }

    fn certified(&self, until: Tick) -> bool {
        self.motion_bounds.is_some_and(|motion_bounds| motion_bounds.holds(until))
    }

    fn expiry(&self, a: ElementId, b: ElementId, finding: Finding) -> Tick {
        let Some(motion_bounds) = self.motion_bounds else { return 0 };
        let effort = Cell::new(EFFORT);
        SpaceCertificateTests { forest: self.forest, view: self.view, motion_bounds, effort }
            .until(a, b, finding)
    }

    fn is_coarse_pair(&self, a: ElementId, b: ElementId) -> bool {
        let at_level = |id| self.forest.is_coarse_root(id) || self.forest.kind(id) == Kind::Light;
        at_level(a) && at_level(b)
    }

    fn is_apart(&self, a: ElementId, b: ElementId) -> bool {
        self.is_group(a) || self.is_group(b)
    }
}
