//! Judging pairs of which an end is a group of patches.

use crate::element::{ElementId, Kind};
use crate::geometry::no_smaller;
use crate::transport::{GroupSight, Spread, common_body, light_at};

use super::carried::{Carried, Gradients, in_steps};
use super::coarse_brightness::CoarseBrightness;
use super::ends::{BoxShaft, body_of};
use super::hash::pair_key;
use super::judge::{SpaceJudge, Stage, culled, passing};
use super::margin::{Margin, SideMargin};
use super::oracle::RefinementCriterion;
use super::tree::CullReason;
use super::tuning::{
    APART, FACET_RADIUS, GRAZING, MISSED, NEAR_FLAT, PLACE, SHARED, SHARED_BY_FACETS, TURNED,
};
use super::verdict::{Judgement, Verdict};
use crate::transport::Side;

/// Exchange of a pair with a group, without occlusion.
struct GroupExchange {
    area_m2: f64,
    /// Radius over distance of both ends.
    size: (f64, f64),
    /// Largest projected area of each end towards the other, m2.
    shows_m2: (f64, f64),
}

/// What crosses a pair of which an end is a group.
struct Crossing<'x> {
    /// Distance of the centres, metres.
    apart_m: f64,
    x: &'x GroupExchange,
    /// Visibility, in [0, 1].
    v: f64,
}

impl SpaceJudge<'_> {
    /// Whether a node is a cluster that may be an end of links.
    pub(super) fn is_group(&self, id: ElementId) -> bool {
        self.forest.group(id).is_some()
    }

    /// Whether a pair of which an end is a group is decided as one: both ends are at or below the coarse level, and what is
    /// distant and narrow, as the sun is, meets groups in the coarse solution only.
    pub(super) fn is_group_pair(&self, a: ElementId, b: ElementId) -> bool {
        let is_end = |id| {
            self.forest.coarse(id).is_some()
                && (self.is_group(id) || self.forest.kind(id) == Kind::Element)
        };
        let coarse = matches!(self.stage, Stage::Coarse);
        let is_narrow = |id| self.forest.is_distant(id) && !self.forest.is_wide(id);
        let narrow = is_narrow(a) || is_narrow(b);
        (self.is_group(a) || self.is_group(b)) && is_end(a) && is_end(b) && (coarse || !narrow)
    }

    /// Judges a pair of a group with a group or an element.
    pub(super) fn judge_group_pair(
        &self,
        (a, b): (ElementId, ElementId),
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        if self.view.end_box(self.forest.fixed(a)).is_empty()
            || self.view.end_box(self.forest.fixed(b)).is_empty()
        {
            return culled(CullReason::Absent);
        }
        if a == b {
            return match (self.forest.group(a).is_some_and(|group| group.is_convex), self.stage) {
                (true, _) => culled(CullReason::FacingAway),
                (false, Stage::Coarse) => passing(Verdict::CoarseLink, 0),
                (false, Stage::Fine(brightness)) if self.is_flat(a, brightness) => {
                    culled(CullReason::Grazing)
                }
                (false, Stage::Fine(_)) => {
                    narrowed.extend_from_slice(candidates);
                    passing(Verdict::RefineSelf, 0)
                }
            };
        }
        let solid = |id: ElementId| match self.forest.group(id) {
            Some(group) => group.solid,
            None => self.forest.patch(id).and_then(|patch| self.forest.solid(patch)),
        };
        if solid(a).is_some() && solid(a) == solid(b) {
            return culled(CullReason::FacingAway);
        }
        let body = body_of(self.forest, self.view, a)
            .filter(|&body| body_of(self.forest, self.view, b) == Some(body));
        // As of groups that are always refined: both stages agree on what is culled.
        if self.is_out_of_sight((a, b), body.is_some()) {
            return culled(CullReason::FacingAway);
        }
        let start = narrowed.len();
        BoxShaft::new(self.view, self.forest, (a, b), body).narrow(candidates, narrowed);
        let candidates = &narrowed[start..];
        let common = common_body(self.forest, self.view, a, b);
        let end = |id| Spread::new(self.forest, self.view, id, common);
        let ends = (end(a), end(b));
        let key = pair_key(self.forest.key(a), self.forest.key(b));
        let (forest, view, simd) = (&*self.forest, self.view, self.simd);
        let sight = GroupSight { forest, view, common, candidates, simd };
        let Stage::Fine(brightness) = self.stage else {
            let (one, other) = match no_smaller(ends.0.radius, ends.1.radius) {
                true => (&ends.0, &ends.1),
                false => (&ends.1, &ends.0),
            };
            let area_m2 = one.rough_exchange_m2(other);
            let (v, segments) = match area_m2 > 0.0 {
                true => sight.visibility(&ends.0, &ends.1, key),
                false => (1.0, 0),
            };
            return carrying(Verdict::CoarseLink, area_m2, v, Margin::Firm, segments);
        };
        self.decide_group_pair((a, b), (&ends.0, &ends.1), &sight, key, brightness)
    }

    fn decide_group_pair(
        &self,
        (a, b): (ElementId, ElementId),
        (end_a, end_b): (&Spread<'_>, &Spread<'_>),
        sight: &GroupSight<'_>,
        key: u64,
        brightness: &CoarseBrightness,
    ) -> Judgement {
        let RefinementCriterion::Error { threshold } = self.criterion else {
            unreachable!("only the error oracle has groups")
        };
        let side = self.larger_radius((a, end_a), (b, end_b));
        let apart = end_a.centre.distance(end_b.centre);
        let near = apart < APART * (end_a.radius + end_b.radius);
        let factor = near.then(|| grazing_factor(end_a, end_b)).flatten();
        if let Some(side) = side.filter(|_| near && factor.is_none()) {
            return passing(Verdict::Refine(side), 0);
        }
        let x = exchange_of(end_a, end_b);
        let (v, segments) = match x.shows_m2.0 > 0.0 && x.shows_m2.1 > 0.0 {
            true => sight.visibility(end_a, end_b, key),
            false => (1.0, 0),
        };
        let crossing = Crossing { apart_m: apart, x: &x, v };
        let on = match factor {
            Some(factor) => [
                self.grazing_error(brightness, (a, end_a.area_m2), b, factor),
                self.grazing_error(brightness, (b, end_b.area_m2), a, factor),
            ],
            None => [
                self.group_error(brightness, (a, end_a.area_m2), (b, x.shows_m2.1), &crossing),
                self.group_error(brightness, (b, end_b.area_m2), (a, x.shows_m2.0), &crossing),
            ],
        };
        let error = on[0].max(on[1]);
        if let Some(side) = side.filter(|_| error > threshold) {
            let larger = if on[1] > on[0] { Side::B } else { Side::A };
            let margin = Margin::Refined {
                error: Margin::between(error, threshold),
                on: larger,
                both_ways: false,
                side: SideMargin::ENDLESS,
            };
            return Judgement { margin, ..passing(Verdict::Refine(side), segments) };
        }
        let below = |error: f64| match side {
            Some(_) => Margin::between(threshold, error.min(threshold)),
            None => Margin::ENDLESS,
        };
        let margin = Margin::Link { on: on.map(below), both_ways: false };
        carrying(Verdict::Link, x.area_m2, v, margin, segments)
    }

    /// The error of a link on one of its ends, relative to what arrives there and weighted as errors are: that of a facet
    /// that faces the other end, never of those that happened to be looked at.
    fn group_error(
        &self,
        brightness: &CoarseBrightness,
        (receiver, area_m2): (ElementId, f64),
        (source, shows_m2): (ElementId, f64),
        &Crossing { apart_m, x, v }: &Crossing<'_>,
    ) -> f64 {
        if self.forest.is_distant(receiver) {
            return 0.0;
        }
        let light = brightness.of(self.forest, receiver);
        let sent = brightness.of(self.forest, source).radiosity;
        let reference_m2 = self.group_reference_m2(brightness, receiver);
        let weight = (area_m2 / reference_m2).sqrt();
        let arrives = sent * shows_m2 / (std::f64::consts::PI * apart_m * apart_m);
        // What a facet shows a part of the sky is known exactly.
        let place = match self.forest.is_distant(source) {
            true => 0.0,
            false => PLACE * v * (x.size.0 * x.size.0 + x.size.1 * x.size.1),
        };
        let shared = if self.is_group(receiver) { SHARED_BY_FACETS } else { SHARED };
        let hidden = if v < 1.0 { shared * shared * v * (1.0 - v) + MISSED / 16.0 } else { 0.0 };
        weight * arrives / light.irradiance * (place * place + hidden).sqrt()
    }

    /// The error on an end of a link with a near-flat neighbour, weighed as [`SpaceJudge::group_error`], where the form factor of no
    /// facet may be off by more than `factor`.
    fn grazing_error(
        &self,
        brightness: &CoarseBrightness,
        (receiver, area_m2): (ElementId, f64),
        source: ElementId,
        factor: f64,
    ) -> f64 {
        let weight = (area_m2 / self.group_reference_m2(brightness, receiver)).sqrt();
        let sent = brightness.of(self.forest, source).radiosity;
        weight * sent * factor / brightness.of(self.forest, receiver).irradiance
    }

    /// Whether what the facets of a group exchange among themselves counts for nothing: that they reflect all that they receive is
    /// the most that they can send.
    fn is_flat(&self, id: ElementId, brightness: &CoarseBrightness) -> bool {
        let RefinementCriterion::Error { threshold } = self.criterion else { return false };
        let Some(group) = self.forest.group(id) else { return false };
        let Some(factor) = grazing_factor_of(group.normals.angle) else { return false };
        let area_m2 = self.forest.area_m2(id);
        let weight = (area_m2 / self.group_reference_m2(brightness, id)).sqrt();
        weight * factor <= threshold
    }

    /// Area at which an end weighs 1 in the error norm, m2.
    fn group_reference_m2(&self, brightness: &CoarseBrightness, id: ElementId) -> f64 {
        match self.forest.group(id) {
            Some(group) => {
                let first = self.forest.groups().leaves_of(group)[0].facet;
                self.reference_area(brightness, first)
            }
            None => self.reference_area(brightness, id),
        }
    }

    /// The end to refine: that of the larger radius, which no motion changes, or the other where that cannot be.
    fn larger_radius(
        &self,
        (a, end_a): (ElementId, &Spread<'_>),
        (b, end_b): (ElementId, &Spread<'_>),
    ) -> Option<Side> {
        // Two triangles of a quad are a group of a smaller radius than either: by radius alone, triangles that are near would be
        // divided before anything asks what whole ones exchange.
        let counts = |id, end: &Spread<'_>| {
            let is_facet = !self.is_group(id) && self.forest.is_in_group(self.forest.fixed(id));
            if is_facet { FACET_RADIUS * end.radius } else { end.radius }
        };
        let order = match no_smaller(counts(a, end_a), counts(b, end_b)) {
            true => [Side::A, Side::B],
            false => [Side::B, Side::A],
        };
        order.into_iter().find(|&side| {
            let id = if side == Side::A { a } else { b };
            self.is_group(id) || self.forest.can_split(id)
        })
    }

    /// Judges a pair of a punctual light with a group: held for the coarse solution, refined below it.
    pub(super) fn judge_group_light(
        &self,
        (light, group): (ElementId, ElementId),
        side: Side,
        candidates: &[u32],
        narrowed: &mut Vec<u32>,
    ) -> Judgement {
        let index = self.forest.light(light).expect("a light has an index");
        let present = !self.view.end_box(group).is_empty();
        let Some(lamp) = self.view.light(index).filter(|_| present) else {
            return culled(CullReason::Absent);
        };
        if let Stage::Fine(_) = self.stage {
            narrowed.extend_from_slice(candidates);
            return passing(Verdict::Refine(side), 0);
        }
        let of_group = self.forest.group(group).expect("an end is a group");
        let pose = of_group.body.and_then(|body| self.view.poses()[body.0 as usize]);
        let leaves = self.forest.groups().leaves_of(of_group).iter();
        let arrives = |leaf: &crate::element::GroupLeaf| {
            let (p, n) = match &pose {
                Some(pose) => (pose.point(leaf.centre), pose.direction(leaf.normal)),
                None => (leaf.centre, leaf.normal),
            };
            leaf.area_m2 * light_at(lamp, p, n)
        };
        // What is in the way is left out: weights need no shadows of lights.
        carrying(Verdict::CoarseLink, leaves.map(arrives).sum(), 1.0, Margin::Firm, 0)
    }
}

/// What the form factor of a facet of one end to the other may be off by, however close they are, where they are near-flat.
///
/// If all normals lie within t of an axis, two facets see each other only along directions within t of the plane across it, and the
/// form factor of a facet to all of them is at most 1.5 t^2 (for small t), whatever lies there.
fn grazing_factor(a: &Spread<'_>, b: &Spread<'_>) -> Option<f64> {
    grazing_factor_of(a.normals.half_angle_with(&b.normals))
}

fn grazing_factor_of(half_angle: f64) -> Option<f64> {
    let sine = libm::sin(half_angle.min(std::f64::consts::FRAC_PI_2));
    (sine <= NEAR_FLAT).then_some(GRAZING * sine * sine)
}

/// Exchange of two ends without occlusion.
fn exchange_of(a: &Spread<'_>, b: &Spread<'_>) -> GroupExchange {
    let apart = a.centre.distance(b.centre).max(f64::MIN_POSITIVE);
    let size = (a.radius / apart, b.radius / apart);
    let projected = (a.projected_m2(b), b.projected_m2(a));
    let shows = |end: &Spread<'_>, projected: f64, other: f64| {
        (projected + TURNED * other.min(1.0) * end.area_m2).min(end.area_m2)
    };
    GroupExchange {
        area_m2: projected.0 * projected.1 / (std::f64::consts::PI * apart * apart),
        size,
        shows_m2: (shows(a, projected.0, size.1), shows(b, projected.1, size.0)),
    }
}

fn carrying(verdict: Verdict, area_m2: f64, v: f64, margin: Margin, segments: u32) -> Judgement {
    let carried = Carried {
        exchange_area_m2: area_m2 as f32,
        visibility: in_steps(v),
        gradients: Gradients::default(),
    };
    Judgement { verdict, carried, margin, segments }
}
