//! Verdicts on pairs of elements in space: exchange area and visibility of a pair, by `transport`, and what the oracle makes of
//! them.

use std::cell::Cell;
use std::ops::Range;

use glam::DVec3;

use crate::element::{ElementId, ElementKey, Forest, Kind, WorldElement, WorldView};
use crate::geometry::{Aabb, Plane, no_smaller};
use crate::predict::{Lookahead, MotionBounds, Tick};
use crate::scene::{BodyId, PatchId};
use crate::transport::{
    BlockerSizes, CELLS_MAX, CLIPPED_MAX, Clipping, Crowd, Exchange, InShaft, Meeting, Shaft, Simd,
    Visibility, clipping, contact_exchange, exchange_by_points, light_exchange, light_past_crowd,
    light_visibility, meeting, visibility,
};

use super::certificate::SpaceCertificateTests;
use super::certificate_tests::{CertificateTests, Finding};
use super::coarse_brightness::CoarseBrightness;
use super::ends::{BoxShaft, LightPlace, body_of};
use super::hash::pair_key;
use super::margin::{Margin, SideMargin};
use super::oracle::{End, Estimate, Norm, Oracle, estimate};
use super::space::{Hierarchy, Judge};
use super::tree::{Carried, CullReason, Gradients, in_steps};
use super::tuning::{
    CLIPPED_MAX_CLOSE, CLIPPED_MAX_REST, CLOSE_SHARE, CLOSER, CONNECTED_SHARE, EFFORT, FINEST,
    LISTED_MAX, OVERLOOKED_MAX, SAMPLED_MAX, SPOT_AROUND,
};
use super::verdict::{Judgement, Stale, Verdict};
use super::world_change::WorldChange;
use crate::transport::Side;

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
    /// Oracle that decides on links.
    pub oracle: Oracle,
    /// Vector instructions.
    pub simd: Simd,
    /// Difference from the last update; `None` in a cold build.
    pub change: Option<&'a WorldChange<'a>>,
    /// Bounds of the known motion; `None` where certificates are not asked for.
    pub motion_bounds: Option<&'a MotionBounds>,
    /// Settings of extrapolation; `None` where pairs are not extrapolated.
    pub lookahead: Option<Lookahead>,
}

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
            _ => self.judge_groups(a, b, candidates, narrowed),
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
                let by_area = matches!(self.oracle, Oracle::FormFactor { .. }) && !distant;
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

/// Depth behind a plane, in roundings of its patch, up to which a group may hold what touches it.
const IN_PLANE: f64 = 64.0;

/// A verdict of which the numbers do not matter.
pub(super) fn passing(verdict: Verdict, segments: u32) -> Judgement {
    Judgement { verdict, carried: Carried::default(), margin: Margin::Firm, segments }
}

pub(super) fn culled(reason: CullReason) -> Judgement {
    passing(Verdict::Cull(reason), 0)
}

/// The verdict to refine a side, if there is one to be refined and the error is too large; `way` is how far the light is
/// from V being found in another way.
fn refined(
    e: &Estimate,
    wish: Option<(Side, SideMargin)>,
    threshold: f64,
    way: u16,
    segments: u32,
) -> Option<Judgement> {
    let (side, side_margin) = wish.filter(|_| e.error() > threshold)?;
    let error = way.min(Margin::between(e.error(), threshold));
    let both_ways = way != Margin::ENDLESS;
    let margin = Margin::Refined { error, on: e.larger(), both_ways, side: side_margin };
    Some(Judgement { margin, ..passing(Verdict::Refine(side), segments) })
}

/// A verdict to link, finely or coarsely, with the values of the link.
fn carrying(
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
    fn judge_groups(
        &self,
        a: ElementId,
        b: ElementId,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        let (fixed_a, fixed_b) = (self.forest.fixed(a), self.forest.fixed(b));
        let (box_a, box_b) = (self.view.end_box(fixed_a), self.view.end_box(fixed_b));
        let is_light = |id| self.forest.kind(id) == Kind::Light;
        if (box_a.is_empty() && !is_light(a)) || (box_b.is_empty() && !is_light(b)) {
            return culled(CullReason::Absent);
        }
        if a == b {
            if self.forest.kind(a) == Kind::Polygon {
                return culled(CullReason::FacingAway);
            }
            narrowed.extend_from_slice(candidates);
            return passing(Verdict::RefineSelf, 0);
        }
        if is_light(a) || is_light(b) {
            narrowed.extend_from_slice(candidates);
            let side = if is_light(a) { Side::B } else { Side::A };
            return passing(Verdict::Refine(side), 0);
        }
        let body = self.body_of(a).filter(|&body| self.body_of(b) == Some(body));
        if self.is_out_of_sight((a, b), body.is_some()) {
            return culled(CullReason::FacingAway);
        }
        BoxShaft::new(self.view, self.forest, (a, b), body).narrow(candidates, narrowed);
        // By area, which no motion changes: the extent of a group follows each of its bodies, and all
        // pairs below would be made anew. What is above the coarse level comes first.
        let size = |id: ElementId| match self.forest.kind(id) {
            _ if self.is_only_coarse((a, b), id) => -1.0,
            Kind::Element => 0.0,
            // What is distant has no area: it comes after all that has.
            _ => self.forest.area_m2(id).max(f64::MIN_POSITIVE),
        };
        let side = if no_smaller(size(a), size(b)) { Side::A } else { Side::B };
        passing(Verdict::Refine(side), 0)
    }

    /// Whether one end of a pair is wholly behind the plane of the other, and does not touch it.
    pub(super) fn is_out_of_sight(&self, (a, b): (ElementId, ElementId), one_body: bool) -> bool {
        // What is decided on two parts of one body must not depend on where the body is.
        let bounds = |id| match one_body {
            true => self.view.box_in_body(self.forest.fixed(id)),
            false => self.view.end_box(self.forest.fixed(id)),
        };
        let is_behind = |of: ElementId, other: ElementId| {
            self.box_is_behind(of, bounds(other), one_body)
                .is_some_and(|is_in_plane| !is_in_plane || !self.may_touch(of, other, one_body))
        };
        is_behind(a, b) || is_behind(b, a)
    }

    /// Whether one end of a pair is a group, and the other is above the coarse level.
    fn is_only_coarse(&self, (a, b): (ElementId, ElementId), id: ElementId) -> bool {
        let other = if id == a { b } else { a };
        self.is_group(id) && self.forest.coarse(other).is_none()
    }

    /// Whether a group may hold a patch that opposes a polygon or element.
    fn may_touch(&self, of: ElementId, group: ElementId, in_body: bool) -> bool {
        let (Some(patch), Some(body)) = (self.forest.patch(of), self.body_of(group)) else {
            return true;
        };
        let normal = self.view.normal(patch, in_body);
        let turned = match self.view.poses()[body.0 as usize] {
            Some(pose) if !in_body => pose.rotation.transpose() * normal,
            _ => normal,
        };
        self.forest.may_oppose(group, turned)
    }

    /// Whether a box is wholly behind the plane of a polygon or element, and if so whether it reaches into the
    /// plane; the box is in the body's frame if `in_body`.
    fn box_is_behind(&self, id: ElementId, bounds: &Aabb, in_body: bool) -> Option<bool> {
        let patch = self.forest.patch(id)?;
        let patch = self.view.patch(patch);
        let frame = if in_body { &patch.local } else { &patch.world };
        let n = frame.normal;
        let plane = Plane::through(frame.origin, n);
        let far = DVec3::select(n.cmpge(DVec3::ZERO), bounds.hi, bounds.lo);
        let above = plane.distance(far);
        // What is in contact with this one may be off by the rounding of both.
        (above <= patch.rounding_m).then_some(above >= -IN_PLANE * patch.rounding_m)
    }

    fn judge_elements(
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

    fn shaft<'a>(
        &'a self,
        (a, b): (&'a WorldElement, &'a WorldElement),
        own: Option<(BodyId, &'a WorldElement, &'a WorldElement)>,
        patches: (PatchId, PatchId),
    ) -> Shaft<'a> {
        Shaft { forest: self.forest, view: self.view, a, b, own, patches }
    }

    fn patch_of(&self, id: ElementId) -> PatchId {
        self.forest.patch(id).expect("elements have patches")
    }

    /// The one body that a node belongs to.
    fn body_of(&self, id: ElementId) -> Option<BodyId> {
        body_of(self.forest, self.view, id)
    }

    /// Judges a pair of elements that face each other, at or below the coarse level; `x` is what they exchange by points.
    fn decide(&self, pair: &mut Elements<'_>, x: Exchange, known: Option<&Carried>) -> Judgement {
        // The paper's oracle refines without asking for blockers.
        let asks_first = matches!(self.oracle, Oracle::Error { .. });
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
        let verdict = match (self.stage, self.oracle) {
            (Stage::Fine(brightness), Oracle::Error { threshold }) => {
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

    /// Both ends of a pair as the error oracle weighs them.
    fn ends(&self, pair: &Elements<'_>, brightness: &CoarseBrightness) -> [End; 2] {
        let (place_a, place_b) = pair.places;
        let end = |id, area| End {
            area: if self.forest.is_distant(id) { 0.0 } else { area },
            reference_area: self.reference_area(brightness, id),
            light: brightness.of(self.forest, id),
            own_area: area,
            surface_area: match self.forest.is_distant(id) {
                true => {
                    2.0 * std::f64::consts::PI * (place_a.centre - place_b.centre).length_squared()
                }
                false => self.forest.area_m2(self.forest.patch_root(self.patch_of(id))),
            },
            alike_area: self.forest.alike_m2(self.patch_of(id)),
        };
        [end(pair.ids.0, place_a.area), end(pair.ids.1, place_b.area)]
    }

    /// The link of a pair with nothing between its ends where nothing shines, `x` by points.
    ///
    /// Links then serve tables of form factors alone, which ask what whole elements exchange: that is known exactly, and how it is
    /// spread over the ends does not matter. Two turned rectangles 0.1 mm apart would be refined all over to find it again.
    fn by_whole_ends(&self, pair: &Elements<'_>, x: &Exchange) -> Option<Judgement> {
        let (Stage::Fine(brightness), Oracle::Error { threshold }) = (self.stage, self.oracle)
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
    fn exchanged(&self, pair: &Elements<'_>, x: Exchange) -> Result<Exchanged, Judgement> {
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
        if let (Stage::Fine(brightness), Oracle::Error { threshold }) = (self.stage, self.oracle)
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

    /// Margin of the form-factor oracle where it does not refine a pair; as an error its verdict where it does.
    fn by_form_factor(&self, pair: &Elements<'_>, x: &Exchange) -> Result<Margin, Judgement> {
        let (Oracle::FormFactor { epsilon, min_area_m2 }, Stage::Fine(_)) =
            (self.oracle, self.stage)
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

    /// A first look at the visibility of a pair: clipped where few polygons are in the way, else sampled.
    fn look<'p>(&self, pair: &'p Elements<'_>, x: &Exchange) -> Seen<'p> {
        let &Elements { shaft, candidates, ref found, key, .. } = pair;
        let crowd = found.is_crowd.then_some(Crowd { shaft, candidates, simd: self.simd });
        let blockers = pair.blockers();
        let occluders = if crowd.is_some() { usize::MAX } else { shaft.occluders(blockers) };
        let (most, way) = self.clipped_max(pair, x, occluders);
        let factor = pair.factor(x);
        // Of the canonical brightness, which is coarse, less is asked.
        let overlooked_max = match (self.stage, self.oracle) {
            (Stage::Fine(_), Oracle::Error { threshold }) => {
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
        let (v, doubt) = match (&mut clipped, sampled) {
            (Some(clipped), _) => clipped.first_look(overlooked_max),
            (None, sampled) => (sampled.expect("what is not clipped is sampled"), 0.0),
        };
        Seen { v, doubt, way, clipped, crowd, crossed }
    }

    /// How many polygons in the way of a pair are clipped at most, and how far its light is from another number for those that
    /// are: [`Margin::ENDLESS`] where that changes nothing.
    fn clipped_max(&self, pair: &Elements<'_>, x: &Exchange, occluders: usize) -> (usize, u16) {
        let (Stage::Fine(brightness), Oracle::Error { threshold }) = (self.stage, self.oracle)
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

    /// The visibility that a link carries; `stake` is its form factor over what it may err by.
    fn look_closer(&self, pair: &Elements<'_>, seen: Seen<'_>, stake: f64) -> Visibility {
        let Seen { v, doubt, clipped, crowd, .. } = seen;
        match (clipped, crowd) {
            (Some(mut clipped), _) => look_closer(v, &mut clipped, stake * doubt),
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

    /// The form-factor oracle's verdict on an end and what is distant: no splitting makes the factor smaller, but what
    /// arrives becomes even.
    fn by_unevenness(
        &self,
        (a, b): (ElementId, ElementId),
        (place_a, place_b): (&WorldElement, &WorldElement),
        x: &Exchange,
        v: &Visibility,
    ) -> Verdict {
        let Oracle::FormFactor { epsilon, min_area_m2 } = self.oracle else { return Verdict::Link };
        let (receiver, place, over, spread, side) = match self.forest.is_distant(a) {
            true => (b, place_b, &x.over_b, v.spread_b, Side::B),
            false => (a, place_a, &x.over_a, v.spread_a, Side::A),
        };
        let room = place.area > min_area_m2 && self.forest.can_split(receiver);
        self.refine_if(over.slope.max(spread) > epsilon && room, side)
    }

    /// The share of a receiver's irradiance that a pair brings without occlusion, weighed as errors
    /// are: what V errs by is multiplied with it. The larger of both directions.
    fn relative_contribution(
        &self,
        brightness: &CoarseBrightness,
        [a, b]: [(ElementId, f64); 2],
        exchange_area_m2: f64,
    ) -> f64 {
        let one_way = |(receiver, area): (ElementId, f64), source: ElementId| {
            if self.forest.is_distant(receiver) {
                return 0.0;
            }
            let arrives = brightness.of(self.forest, source).radiosity * exchange_area_m2;
            let known = brightness.of(self.forest, receiver).irradiance;
            arrives / known / (area * self.reference_area(brightness, receiver)).sqrt()
        };
        one_way(a, b.0).max(one_way(b, a.0))
    }

    /// Area at which an element weighs 1 in the error norm, m2: by the size of the scene, or of the connected patches that
    /// it belongs to where these are small.
    pub(super) fn reference_area(&self, brightness: &CoarseBrightness, id: ElementId) -> f64 {
        let of_scene = brightness.reference_area_m2();
        let of_patch = |patch| CONNECTED_SHARE * self.forest.connected_m2(patch);
        self.forest.patch(id).map_or(of_scene, |patch| of_scene.min(of_patch(patch)))
    }

    /// Whether an end is above the level at which the coarse solution links.
    fn is_above_coarse(&self, a: ElementId, b: ElementId) -> bool {
        matches!(self.oracle, Oracle::Error { .. })
            && (self.forest.coarse(a).is_none() || self.forest.coarse(b).is_none())
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

    /// The side that is to be refined if any is, and how firmly.
    fn wish(
        &self,
        ids: (ElementId, ElementId),
        [a, b]: &[End; 2],
        e: &Estimate,
    ) -> Option<(Side, SideMargin)> {
        let (better, margin) = e.side(a, b);
        let (side, firm) = self.splittable(ids, (a.area, b.area), better)?;
        Some((side, if firm { SideMargin::ENDLESS } else { SideMargin::new(margin) }))
    }

    /// The side to refine: the one wished for if it can be, else the other unless it is the smaller; and whether
    /// there was no choice.
    fn splittable(
        &self,
        (a, b): (ElementId, ElementId),
        (area_a, area_b): (f64, f64),
        wish: Side,
    ) -> Option<(Side, bool)> {
        match (self.forest.can_split(a), self.forest.can_split(b)) {
            (true, true) => Some((wish, false)),
            // Smaller sources do not mend what a receiver is too large for.
            (true, false) => no_smaller(area_a, area_b).then_some((Side::A, true)),
            (false, true) => no_smaller(area_b, area_a).then_some((Side::B, true)),
            (false, false) => None,
        }
    }

    fn judge_light(
        &self,
        light: ElementId,
        element: ElementId,
        side: Side,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        let index = self.forest.light(light).expect("a light has an index");
        let patch = self.patch_of(element);
        let present = self.view.is_present(self.view.patch(patch).body);
        let Some(lamp) = self.view.light(index).filter(|_| present) else {
            return culled(CullReason::Absent);
        };
        // Before anything is sampled: both stages must agree down to the coarse level, and a narrow
        // cone may fall between the sample points of a large element.
        if matches!(self.oracle, Oracle::Error { .. }) && self.forest.coarse(element).is_none() {
            narrowed.extend_from_slice(candidates);
            return passing(Verdict::Refine(side), 0);
        }
        let e = WorldElement::new(self.view, self.forest, element, false);
        let x = light_exchange(lamp, &e);
        if x.area_m2 <= 0.0 {
            return culled(CullReason::FacingAway);
        }
        let place = LightPlace::new(lamp, &e, self.view.far_m());
        let shaft = self.shaft((&e, &place.stand_in), None, (patch, patch));
        let start = narrowed.len();
        let found = shaft.narrow_to_blockers(candidates, narrowed, LISTED_MAX);
        let key = pair_key(self.forest.key(element), self.forest.key(light));
        let segments = place.segments(lamp, &e, key);
        let crowd = Crowd { shaft: &shaft, candidates: &narrowed[start..], simd: self.simd };
        let from = place.from(lamp, &e);
        let v = match found.is_crowd {
            true => light_past_crowd(&crowd, &segments),
            false => light_visibility(self.simd, &shaft, &found.blockers, (&segments, from)),
        };
        let (verdict, margin) =
            self.decide_light((light, element), side, &LitEnd { e: &e, x: &x, v: &v });
        Judgement { margin, ..carrying(verdict, &x, &v, (&e, &place.stand_in)) }
    }

    /// The verdict on a punctual light and an element, which is at that side of the pair.
    fn decide_light(
        &self,
        (light, element): (ElementId, ElementId),
        side: Side,
        &LitEnd { e, x, v }: &LitEnd<'_>,
    ) -> (Verdict, Margin) {
        let may_split = self.forest.can_split(element);
        match (self.stage, self.oracle) {
            (Stage::Coarse, _) => (Verdict::CoarseLink, Margin::Firm),
            (Stage::Fine(brightness), Oracle::Error { threshold }) => {
                let end = |id, area, reference_area| {
                    let light = brightness.of(self.forest, id);
                    End {
                        area,
                        reference_area,
                        light,
                        own_area: 0.0,
                        surface_area: 0.0,
                        alike_area: 0.0,
                    }
                };
                let receiver = end(element, e.area, self.reference_area(brightness, element));
                let source = end(light, 0.0, f64::INFINITY);
                let norm = norm_of(brightness, threshold);
                let ends = [&receiver, &source];
                let error = estimate(x, v, ends, &BlockerSizes::NOTHING, &norm).on[0];
                if !may_split {
                    return (Verdict::Link, Margin::Firm);
                }
                let endless = Margin::ENDLESS;
                if error > threshold {
                    let (error, side_margin) =
                        (Margin::between(error, threshold), SideMargin::ENDLESS);
                    let margin =
                        Margin::Refined { error, on: side, both_ways: false, side: side_margin };
                    return (Verdict::Refine(side), margin);
                }
                let error = Margin::between(threshold, error);
                let on = if side == Side::A { [error, endless] } else { [endless, error] };
                (Verdict::Link, Margin::Link { on, both_ways: false })
            }
            (Stage::Fine(_), Oracle::FormFactor { epsilon, min_area_m2 }) => {
                let uneven = x.over_a.slope.max(v.spread_a) > epsilon;
                let room = e.area > min_area_m2 && may_split;
                (self.refine_if(uneven && room, side), Margin::Firm)
            }
        }
    }

    fn refine_if(&self, wanted: bool, side: Side) -> Verdict {
        if wanted { Verdict::Refine(side) } else { Verdict::Link }
    }
}

/// An element in the light of a punctual light.
struct LitEnd<'a> {
    e: &'a WorldElement,
    x: &'a Exchange,
    v: &'a Visibility,
}

/// A pair of elements that is decided on.
struct Elements<'a> {
    ids: (ElementId, ElementId),
    places: (&'a WorldElement, &'a WorldElement),
    key: u64,
    met: Meeting,
    shaft: &'a Shaft<'a>,
    /// Candidates in the shaft.
    candidates: &'a [u32],
    found: InShaft,
}

impl Elements<'_> {
    fn in_contact(&self) -> bool {
        self.met == Meeting::Coplanar
    }

    /// What may be in the way: of two ends in contact nothing, as what covers them is left out of what they exchange.
    fn blockers(&self) -> &[PatchId] {
        if self.in_contact() { &[] } else { &self.found.blockers }
    }

    /// Leaves out blockers that are only beside the ends: a steep pair that counts as partly hidden is refined as if points
    /// could not tell how much.
    fn leave_out_what_is_beside(&mut self, x: &Exchange) {
        if x.is_steep && self.shaft.is_beside(&self.found.blockers) {
            self.found.blockers.clear();
        }
    }

    /// Form factor from the smaller end to the other.
    fn factor(&self, x: &Exchange) -> f64 {
        x.area_m2 / self.places.0.area.min(self.places.1.area)
    }
}

/// What a pair exchanges without occlusion.
struct Exchanged {
    x: Exchange,
    /// How many times too large the area is that verdicts were first made with.
    overstated: f64,
    /// The errors of those verdicts, where they were not enough to refine.
    by_points: Option<Estimate>,
}

/// A first look at the visibility of a pair.
struct Seen<'p> {
    v: Visibility,
    /// How far off it may be.
    doubt: f64,
    /// How far the light is from V being found in another way.
    way: u16,
    clipped: Option<Clipping<'p>>,
    crowd: Option<Crowd<'p>>,
    /// What segments past a crowd crossed.
    crossed: Option<Vec<PatchId>>,
}

/// Places of the two elements of a pair.
struct Places {
    /// In the frame that their light must not depend on: their body's if they have one in common.
    own: (WorldElement, WorldElement),
    /// In the world, where that differs and is asked for.
    world: Option<(BodyId, WorldElement, WorldElement)>,
    patches: (PatchId, PatchId),
}

impl Places {
    #[inline]
    fn new(at: &SpaceJudge<'_>, (a, b): (ElementId, ElementId), world: bool) -> Places {
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

    fn shaft<'a>(&'a self, at: &'a SpaceJudge<'_>) -> Shaft<'a> {
        let (own_a, own_b) = (&self.own.0, &self.own.1);
        match &self.world {
            Some((body, a, b)) => at.shaft((a, b), Some((*body, own_a, own_b)), self.patches),
            None => at.shaft((own_a, own_b), None, self.patches),
        }
    }
}

/// Norm of the error oracle.
fn norm_of(brightness: &CoarseBrightness, threshold: f64) -> Norm {
    Norm { reference_area_m2: brightness.reference_area_m2(), threshold }
}

/// A link that is partly hidden is looked at from more points, the more so the larger its `error`: how far V
/// may be off times the form factor, over what a link may err by.
fn look_closer(v: Visibility, clipped: &mut Clipping<'_>, error: f64) -> Visibility {
    if error <= CLOSER {
        return v;
    }
    // The error of n x n points on a function with kinks falls as 1 / n^2.
    let cells = (error / CLOSER).sqrt().ceil().min(f64::from(CELLS_MAX));
    let again = clipped.visibility(cells as u32);
    Visibility { segments: v.segments + again.segments, ..again }
}
