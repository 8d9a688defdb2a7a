//! Judging pairs of the plane by the paper's oracle: a form factor and a smallest length.

use std::ops::Range;

use glam::DVec2;

use crate::element::{ElementId, ElementKey};
use crate::pair::{
    Carried, CertificateTests, CullReason, Finding, Gradients, Hierarchy, Judge, Judgement, Margin,
    Side, Stale, Verdict, in_steps,
};
use crate::predict::{Lookahead, MotionBounds, Tick};

use super::certificate::PlaneCertificateTests;
use super::forest::{FlatForest, FlatKind};
use super::plane::Segment;
use super::scene::{BodyIndex, FlatScene};
use super::strings::Shaft;
use super::view::PlaneView;

/// The forest of the plane placed at one instant, with what decides.
pub(crate) struct PlaneJudge<'a> {
    pub(super) scene: &'a FlatScene,
    pub(super) forest: &'a mut FlatForest,
    pub(super) now: &'a PlaneView,
    /// The instant of the last update; `None` where there was none.
    pub(super) before: Option<&'a PlaneView>,
    /// Largest form factor of a link.
    pub(super) epsilon: f64,
    /// Elements up to this length are not refined, m.
    pub(super) min_length_m: f64,
    /// Links carry no gradients.
    pub(super) constant: bool,
    /// What the known motion allows next; `None` where certificates are not asked for.
    pub(super) motion_bounds: Option<&'a MotionBounds>,
    pub(super) lookahead: Option<Lookahead>,
}

/// Two elements as their pair sees them: in the world or, if one body holds both, in its frame, so that
/// what they exchange does not change by a bit when the body moves.
struct Ends {
    a: Segment,
    b: Segment,
    own: Option<BodyIndex>,
    /// The walls that they are on.
    walls: (u32, u32),
}

impl Hierarchy for PlaneJudge<'_> {
    fn children(&self, id: ElementId) -> Range<u32> {
        self.forest.children(id)
    }

    fn split(&mut self, id: ElementId) -> (Range<u32>, bool) {
        match self.forest.kind(id) {
            FlatKind::Element => self.forest.split(id),
            _ => (self.forest.children(id), false),
        }
    }

    fn release(&mut self, id: ElementId) {
        if self.forest.kind(id) == FlatKind::Element {
            self.forest.release(id);
        }
    }

    fn key(&self, id: ElementId) -> ElementKey {
        self.forest.key(id)
    }

    fn element_count(&self) -> usize {
        self.forest.element_count() as usize
    }
}

impl Judge for PlaneJudge<'_> {
    fn judge(
        &self,
        (a, b): (ElementId, ElementId),
        _: Option<&Carried>,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        if !self.are_elements(a, b) {
            narrowed.extend_from_slice(candidates);
            return passing(self.refine_groups(a, b), Margin::Firm);
        }
        if self.forest.facet(a) == self.forest.facet(b) {
            return passing(Verdict::Cull(CullReason::FacingAway), Margin::Firm);
        }
        let ends = self.ends(a, b);
        match Shaft::new(&ends.a, &ends.b) {
            Some(shaft) => {
                let start = narrowed.len();
                self.narrow_to(&shaft, &ends, candidates, narrowed);
                self.decide((a, b), (&ends, &shaft), &narrowed[start..])
            }
            None => passing(Verdict::Cull(CullReason::FacingAway), Margin::Firm),
        }
    }

    fn withstands(&self, _: ElementId, _: ElementId, margin: Margin) -> Option<Margin> {
        // No verdict depends on the light.
        Some(margin)
    }

    fn stale(&self, a: ElementId, b: ElementId, certified: bool) -> Stale {
        let Some(before) = self.before else { return Stale::Moved };
        let (body_a, body_b) = (self.forest.body(a), self.forest.body(b));
        let (Some(body_a), Some(body_b)) = (body_a, body_b) else { return Stale::Below };
        let apart = body_a != body_b && (self.moved(body_a) || self.moved(body_b));
        if !self.are_elements(a, b) {
            let near = apart || (!certified && self.are_neared((body_a, body_b), before));
            return if near { Stale::Below } else { Stale::Nothing };
        }
        match (apart, certified) {
            (true, true) => return Stale::Followed,
            (true, false) => return Stale::Moved,
            (false, true) => return Stale::Nothing,
            (false, false) => {}
        }
        let ends = self.ends(a, b);
        let entered = Shaft::new(&ends.a, &ends.b)
            .is_some_and(|shaft| self.is_crossed(&shaft, &ends, body_a, before));
        if entered { Stale::Occlusion } else { Stale::Nothing }
    }

    fn narrow(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> bool {
        let shaft_of = |ends: &Ends| Shaft::new(&ends.a, &ends.b);
        match self.are_elements(a, b).then(|| self.ends(a, b)) {
            Some(ends) => match shaft_of(&ends) {
                Some(shaft) => self.narrow_to(&shaft, &ends, candidates, narrowed),
                None => return false,
            },
            None => narrowed.extend_from_slice(candidates),
        }
        true
    }

    fn brightness_changed(&self, _: ElementId, _: ElementId) -> bool {
        false
    }

    fn certified(&self, until: Tick) -> bool {
        self.motion_bounds.is_some_and(|motion_bounds| motion_bounds.holds(until))
    }

    fn lookahead(&self) -> Option<&Lookahead> {
        self.lookahead.as_ref()
    }

    fn may_be_clear(&self, a: ElementId, b: ElementId, narrowed: &[u32]) -> bool {
        if !self.are_elements(a, b) {
            return narrowed.is_empty();
        }
        // Walls that touch a shaft are possible occluders of pairs below, but do not stand in it.
        let ends = self.ends(a, b);
        let enters =
            |shaft: &Shaft, &wall: &u32| shaft.is_entered_by(&self.wall(self.now, &ends, wall));
        Shaft::new(&ends.a, &ends.b)
            .is_some_and(|shaft| !narrowed.iter().any(|wall| enters(&shaft, wall)))
    }

    fn expiry(&self, a: ElementId, b: ElementId, finding: Finding) -> Tick {
        let Some(motion_bounds) = self.motion_bounds else { return 0 };
        let (scene, forest, now) = (self.scene, &*self.forest, self.now);
        PlaneCertificateTests { scene, forest, now, motion_bounds }.until(a, b, finding)
    }

    fn is_coarse_pair(&self, _: ElementId, _: ElementId) -> bool {
        false
    }
}

fn passing(verdict: Verdict, margin: Margin) -> Judgement {
    Judgement { verdict, carried: Carried::default(), margin, segments: 0 }
}

/// How what arrives varies over both ends: the difference of their halves, exact, past all blockers.
fn gradients(ends: &Ends, blockers: &[Segment]) -> Gradients {
    let slope = |of: &Segment, other: &Segment| {
        let half = |k: u32| {
            let shaft = Shaft::new(&of.half(k), other);
            shaft.map_or(0.0, |shaft| match blockers {
                [] => shaft.exchange(),
                _ => shaft.exchange_past(blockers).0,
            })
        };
        let (first, second) = (half(0), half(1));
        let both = first + second;
        // Means of the halves are a radius apart.
        let relative = if both > 0.0 { 2.0 * (second - first) / both } else { 0.0 };
        (DVec2::new(relative, 0.0), 1.0)
    };
    Gradients::new(slope(&ends.a, &ends.b), slope(&ends.b, &ends.a))
}

impl PlaneJudge<'_> {
    fn are_elements(&self, a: ElementId, b: ElementId) -> bool {
        self.forest.is_element(a) && self.forest.is_element(b)
    }

    fn refine_groups(&self, a: ElementId, b: ElementId) -> Verdict {
        let group = |id| !self.forest.is_element(id);
        match (group(a), group(b)) {
            _ if a == b => Verdict::RefineSelf,
            (true, false) => Verdict::Refine(Side::A),
            (false, true) => Verdict::Refine(Side::B),
            // By length, which no motion changes.
            _ if self.forest.length(a) >= self.forest.length(b) => Verdict::Refine(Side::A),
            _ => Verdict::Refine(Side::B),
        }
    }

    fn ends(&self, a: ElementId, b: ElementId) -> Ends {
        let own = self.forest.body(a).filter(|&body| self.forest.body(b) == Some(body));
        let place = |id| match own {
            Some(_) => self.forest.local(id),
            None => self.now.place(self.forest, id),
        };
        let walls = (self.forest.wall(a).0.0, self.forest.wall(b).0.0);
        Ends { a: place(a), b: place(b), own, walls }
    }

    fn wall(&self, at: &PlaneView, ends: &Ends, wall: u32) -> Segment {
        at.wall(wall, ends.own.map(|body| (body, self.scene)))
    }

    fn narrow_to(&self, shaft: &Shaft, ends: &Ends, candidates: &[u32], out: &mut Vec<u32>) {
        let may_block = |&&wall: &&u32| {
            wall != ends.walls.0
                && wall != ends.walls.1
                && shaft.may_be_entered_by(&self.wall(self.now, ends, wall))
        };
        out.extend(candidates.iter().filter(may_block));
    }

    fn decide(
        &self,
        (a, b): (ElementId, ElementId),
        (ends, shaft): (&Ends, &Shaft),
        candidates: &[u32],
    ) -> Judgement {
        let exchange = shaft.exchange();
        let (length_a, length_b) = (self.forest.length(a), self.forest.length(b));
        let factor = exchange / length_a.min(length_b);
        let mut margin = Margin::Firm;
        if let Some(side) = self.larger((a, b), (length_a, length_b)) {
            let refined = factor > self.epsilon;
            if self.lookahead.is_some() {
                let (large, small) =
                    if refined { (factor, self.epsilon) } else { (self.epsilon, factor) };
                margin = Margin::of_error(!refined, Margin::between(large, small));
            }
            if refined {
                return passing(Verdict::Refine(side), margin);
            }
        }
        // Candidates depend on the way here, blockers do not.
        let walls = candidates.iter().map(|&wall| self.wall(self.now, ends, wall));
        let blockers: Vec<Segment> = walls.filter(|wall| shaft.is_entered_by(wall)).collect();
        let (visibility, segments) = match blockers.is_empty() {
            true => (1.0, 0),
            false => {
                let (past, pieces) = shaft.exchange_past(&blockers);
                ((past / exchange.max(f64::MIN_POSITIVE)).min(1.0), pieces)
            }
        };
        let carried = Carried {
            exchange_area_m2: exchange as f32,
            visibility: in_steps(visibility),
            gradients: match self.constant {
                true => Gradients::default(),
                false => gradients(ends, &blockers),
            },
        };
        Judgement { verdict: Verdict::Link, carried, margin, segments }
    }

    /// The longer side that may be refined.
    fn larger(
        &self,
        (a, b): (ElementId, ElementId),
        (length_a, length_b): (f64, f64),
    ) -> Option<Side> {
        let sides = [(Side::A, a, length_a), (Side::B, b, length_b)];
        let order = if length_a >= length_b { [0, 1] } else { [1, 0] };
        let splits = |&(_, id, length): &(Side, ElementId, f64)| {
            length > self.min_length_m && self.forest.can_split(id)
        };
        order.into_iter().map(|k| sides[k]).find(splits).map(|(side, ..)| side)
    }

    fn moved(&self, body: BodyIndex) -> bool {
        let pose = |at: &PlaneView| at.poses[body.0 as usize];
        self.before.is_none_or(|before| pose(before) != pose(self.now))
    }

    /// Whether something that moves against two bodies, which rest against each other, was or is near.
    fn are_neared(&self, (a, b): (BodyIndex, BodyIndex), before: &PlaneView) -> bool {
        let bodies = 0..self.now.poses.len() as u32;
        let rides = a == b && self.moved(a);
        // Seen from a moving body, everything else moves.
        let mut movers =
            bodies.map(BodyIndex).filter(|&body| if rides { body != a } else { self.moved(body) });
        movers.any(|mover| {
            [before, self.now]
                .iter()
                .any(|at| at.bounds(a).union(*at.bounds(b)).distance(at.bounds(mover)) == 0.0)
        })
    }

    /// Whether something that moves against the ends of a pair, which rest against each other, stood or
    /// stands between them.
    fn is_crossed(&self, shaft: &Shaft, ends: &Ends, body: BodyIndex, before: &PlaneView) -> bool {
        let rides = ends.own.is_some() && self.moved(body);
        let moves = |wall: &u32| {
            let of = self.now.bodies[*wall as usize];
            if rides { of != body } else { self.moved(of) }
        };
        let walls = 0..self.now.walls.len() as u32;
        walls.filter(moves).any(|wall| {
            [before, self.now].iter().any(|at| shaft.may_be_entered_by(&self.wall(at, ends, wall)))
        })
    }
}
