//! Certificates of pairs in space: until which tick the known motion cannot change a finding.
//!
//! All tests are conservative twice over: what can get anywhere is bounded by boxes, and where the
//! exact test of a pair allows some slack, these allow half of it, so that rounding does not matter.

use std::cell::Cell;

use glam::DVec3;

use crate::element::{
    ElementId, Forest, Kind, OccluderPolygon, WorldElement, WorldPatch, WorldView,
};
use crate::geometry::{Aabb, Interval, Plane, Pose, shaft_meets_box};
use crate::predict::MotionBounds;
use crate::scene::{BodyId, Drift, PatchId};

use super::certificate_tests::{CertificateTests, Moves};
use super::ends::{LightPlace, body_of};

/// Certificate tests in space: a scene at one instant with the bounds of its motion.
pub(super) struct SpaceCertificateTests<'a> {
    pub(super) forest: &'a Forest,
    pub(super) view: &'a WorldView,
    pub(super) motion_bounds: &'a MotionBounds,
    /// Nodes that may still be looked at; then anything may be in the way.
    pub(super) effort: Cell<u32>,
}

/// Two ends of a pair as far as shafts are concerned.
struct Ends<'a> {
    bounds: (Aabb, Aabb),
    bodies: (Option<BodyId>, Option<BodyId>),
    /// Places of both ends, where both are elements.
    places: Option<(&'a WorldElement, &'a WorldElement)>,
    patches: (Option<PatchId>, Option<PatchId>),
    /// More than the exact test of this pair, or of any below it, allows.
    margin_m: f64,
}

/// What lies farther than this from an end's plane, in halves of the slack, does not cover it.
const OFF: f64 = 8.0;

impl CertificateTests for SpaceCertificateTests<'_> {
    fn motion_bounds(&self) -> &MotionBounds {
        self.motion_bounds
    }

    fn rest(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        let same = self.body(a).is_some_and(|body| self.body(b) == Some(body));
        same || (self.rests(h, a) && self.rests(h, b))
    }

    fn is_entered(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        let own = self.body(a).filter(|&body| self.motion_bounds.drift(h, body) != Drift::Rests);
        self.with_ends(a, b, &mut |ends| match own {
            // Seen from a moving body, everything else moves.
            Some(own) => self.may_block(h, ends, Forest::ROOT, Some(own)),
            None => {
                let mut movers = self.motion_bounds.movers(h);
                movers.any(|m| self.may_block(h, ends, self.forest.body_root(m), None))
            }
        })
    }

    fn stays_clear(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        // Between groups are their own patches.
        let is_end = |id| matches!(self.forest.kind(id), Kind::Element | Kind::Polygon);
        is_end(a)
            && is_end(b)
            && self.body(a).is_some()
            && self.body(b).is_some()
            && !self.with_ends(a, b, &mut |ends| self.may_block(h, ends, Forest::ROOT, None))
    }

    fn stays_away(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        let is_light = |id| self.forest.kind(id) == Kind::Light;
        if is_light(a) && is_light(b) {
            return true;
        }
        // What is absent stays so up to every horizon.
        let absent = |id| !is_light(id) && self.view.end_box(self.forest.fixed(id)).is_empty();
        if absent(a) || absent(b) {
            return true;
        }
        if is_light(a) || is_light(b) {
            return false;
        }
        self.is_behind(h, a, b) || self.is_behind(h, b, a)
    }
}

impl SpaceCertificateTests<'_> {
    fn body(&self, id: ElementId) -> Option<BodyId> {
        body_of(self.forest, self.view, id)
    }

    fn rests(&self, h: usize, id: ElementId) -> bool {
        if let Some(light) = self.forest.light(id) {
            return self.motion_bounds.light_rests(h, light);
        }
        match self.body(id) {
            Some(body) => self.motion_bounds.drift(h, body) == Drift::Rests,
            None => self.widest(h, id) == Drift::Rests.reach(),
        }
    }

    /// Displacements of all bodies of a group together.
    fn widest(&self, h: usize, id: ElementId) -> Aabb {
        let near = self.motion_bounds.widest(h);
        if self.forest.is_distant(id) || id == Forest::ROOT {
            return near.union(self.motion_bounds.widest_distant(h));
        }
        near
    }

    fn with_ends(
        &self,
        a: ElementId,
        b: ElementId,
        then: &mut dyn FnMut(&Ends<'_>) -> bool,
    ) -> bool {
        let bodies = (self.body(a), self.body(b));
        let patches = (self.forest.patch(a), self.forest.patch(b));
        let place = |id| WorldElement::new(self.view, self.forest, id, false);
        match (self.forest.kind(a), self.forest.kind(b)) {
            (Kind::Element, Kind::Element) => {
                let (a, b) = (place(a), place(b));
                then(&Ends {
                    bounds: (a.bounds, b.bounds),
                    bodies,
                    patches,
                    margin_m: 2.0 * (a.rounding_m + b.rounding_m),
                    places: Some((&a, &b)),
                })
            }
            (Kind::Light, Kind::Element) => self.with_ends(b, a, then),
            (Kind::Element, Kind::Light) => {
                let light = self.forest.light(b).and_then(|k| self.view.light(k));
                let Some(light) = light else { return true };
                let e = place(a);
                let far = LightPlace::new(light, &e, self.view.far_m());
                then(&Ends {
                    bounds: (e.bounds, far.stand_in.bounds),
                    bodies,
                    patches,
                    margin_m: 2.0 * e.rounding_m,
                    places: None,
                })
            }
            (Kind::Light, _) | (_, Kind::Light) => true,
            _ => {
                let (a, b) = (self.forest.fixed(a), self.forest.fixed(b));
                then(&Ends {
                    bounds: (*self.view.end_box(a), *self.view.end_box(b)),
                    bodies,
                    // A group may hold its own blockers.
                    patches: (None, None),
                    margin_m: 1e-6 * self.view.far_m(),
                    places: None,
                })
            }
        }
    }

    /// Whether anything at or below `id` may get into a shaft, what rides on `except` aside.
    fn may_block(&self, h: usize, ends: &Ends<'_>, id: ElementId, except: Option<BodyId>) -> bool {
        let bounds = self.view.fixed_box(id);
        if bounds.is_empty() || self.forest.kind(id) == Kind::Light {
            return false;
        }
        let left = self.effort.get();
        if left == 0 {
            return true;
        }
        self.effort.set(left - 1);
        let body = self.body(id);
        if body.is_some() && body == except {
            return false;
        }
        let moves = self.moves(h, ends, body);
        let (a, b) = (ends.bounds.0.sum(&moves.a), ends.bounds.1.sum(&moves.b));
        if !shaft_meets_box(&a, &b, &bounds.sum(&moves.c).grown(ends.margin_m)) {
            return false;
        }
        match self.forest.patch(id) {
            Some(patch) => self.patch_may_block(ends, patch, &moves),
            None => self
                .forest
                .children(id)
                .any(|child| self.may_block(h, ends, ElementId(child), except)),
        }
    }

    /// Displacements of both ends and of what may come between.
    fn moves(&self, h: usize, ends: &Ends<'_>, body: Option<BodyId>) -> Moves {
        let of = |body: Option<BodyId>| match body {
            Some(body) => self.motion_bounds.drift(h, body),
            None => Drift::Rests,
        };
        let c = match body {
            Some(body) => self.motion_bounds.drift(h, body),
            None => Drift::Turns(self.motion_bounds.widest(h)),
        };
        let end = |end: Option<BodyId>| (of(end), end == body);
        Moves::new(end(ends.bodies.0), end(ends.bodies.1), c)
    }

    fn patch_may_block(&self, ends: &Ends<'_>, patch: PatchId, moves: &Moves) -> bool {
        if ends.patches.0 == Some(patch) || ends.patches.1 == Some(patch) {
            return false;
        }
        if self.view.is_hidden_twin(patch) {
            return false;
        }
        // A lamp matters wherever it is in the shaft.
        if self.forest.is_lamp(patch) {
            return true;
        }
        let Some((a, b)) = ends.places else { return true };
        let half = 0.5 * (a.rounding_m + b.rounding_m);
        let c = self.view.occluder(patch);
        let WorldPatch { body, twin, .. } = *self.view.patch(patch);
        let (turns_a, turns_b, turns_c) = moves.turning;
        // Distances of an end from the blocker's plane at all times.
        let span = |e: &WorldElement, by: &Aabb| {
            e.span(&c.plane) + by.difference(&moves.c).along(c.plane.normal)
        };
        let spans = [span(a, &moves.a), span(b, &moves.b)];
        let tilt_m = self.tilt_m(&c, half);
        let end =
            |e: &WorldElement, (of, on): (Option<BodyId>, Option<PatchId>), by, turns, span| {
                // What rides with the end keeps its distances.
                let rides = of == Some(body);
                let shift = match rides {
                    true => Interval::ZERO,
                    false => moves.c.difference(by).along(e.plane.normal),
                };
                let is_other_side = twin.is_some() && twin == on;
                let end = OneEnd { e, rides, shift, turns, span, is_other_side };
                end.beside(&c, turns_c, half, tilt_m)
            };
        let (patch_a, patch_b) = ends.patches;
        let at_a = end(a, (ends.bodies.0, patch_a), &moves.a, turns_a, spans[0]);
        let at_b = end(b, (ends.bodies.1, patch_b), &moves.b, turns_b, spans[1]);
        if at_a.may_cover || at_b.may_cover {
            return true;
        }
        if at_a.behind || at_b.behind {
            return false;
        }
        // Both ends on one side of the blocker's plane.
        let both = spans[0].union(spans[1]);
        turns_c || !(both.lo >= -half || both.hi <= half)
    }

    /// Distance from a blocker's plane up to which it may cover an end, however it is turned, metres.
    ///
    /// All of the blocker's corners within s of a plane tilt it by at most 2 s by its width, and a
    /// convex polygon is no narrower than its area by its diameter.
    fn tilt_m(&self, c: &OccluderPolygon<'_>, half: f64) -> f64 {
        let first = c.corners[0];
        let diameter = 2.0 * c.corners.iter().map(|p| p.distance(first)).fold(0.0, f64::max);
        let fan = c.corners.windows(2).map(|e| (e[0] - first).cross(e[1] - first));
        let area = 0.5 * fan.fold(DVec3::ZERO, |sum, n| sum + n).length();
        OFF * half * (1.0 + 2.0 * self.view.far_m() * diameter / area.max(f64::MIN_POSITIVE))
    }

    /// Whether `b` stays wholly behind the plane of `a`.
    fn is_behind(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        let (Some(patch), Some(body)) = (self.forest.patch(a), self.body(a)) else { return false };
        let drift = self.motion_bounds.drift(h, body);
        if matches!(drift, Drift::Turns(_)) {
            return false;
        }
        let patch = self.view.patch(patch);
        let plane = Plane::through(patch.world.origin, patch.world.normal);
        let by = match self.body(b) {
            Some(body) => self.motion_bounds.drift(h, body).reach(),
            None => self.widest(h, b),
        };
        let shift = by.difference(&drift.reach()).along(plane.normal).hi;
        let elements = [a, b].iter().all(|&id| self.forest.kind(id) == Kind::Element);
        let (far, slack) = if elements {
            let b = WorldElement::new(self.view, self.forest, b, false);
            (b.span(&plane).hi, b.rounding_m + patch.rounding_m)
        } else {
            let bounds = self.view.end_box(self.forest.fixed(b));
            let n = plane.normal;
            let corner = DVec3::select(n.cmpge(DVec3::ZERO), bounds.hi, bounds.lo);
            (plane.distance(corner), patch.rounding_m)
        };
        // What may come to lie in the plane and faces it may touch it.
        let opposes = || match self.body(b) {
            Some(body) if matches!(self.motion_bounds.drift(h, body), Drift::Turns(_)) => true,
            Some(body) => {
                let pose = self.view.poses()[body.0 as usize].unwrap_or(Pose::IDENTITY);
                self.forest.may_oppose(b, pose.rotation.transpose() * plane.normal)
            }
            None => true,
        };
        far + shift < -2.0 * slack || (far + shift <= 0.5 * slack && !opposes())
    }
}

/// Position of a blocker relative to an end, at all times up to a horizon.
struct AtEnd {
    behind: bool,
    may_cover: bool,
}

/// An end of a pair beside a blocker, up to a horizon.
struct OneEnd<'a> {
    e: &'a WorldElement,
    /// Whether the blocker rides on the end's body.
    rides: bool,
    /// Displacement of the blocker against the end along the end's normal, metres.
    shift: Interval,
    /// Whether the end turns.
    turns: bool,
    /// Distances of the end's corners from the blocker's plane at all times, metres.
    span: Interval,
    /// Whether the blocker is the other side of the end's polygon.
    is_other_side: bool,
}

impl OneEnd<'_> {
    /// Position of the blocker; `half` is half of the slack, `tilt_m` the distance from the blocker's plane up to which it may
    /// cover an end however it is turned, metres.
    fn beside(&self, c: &OccluderPolygon<'_>, turns_c: bool, half: f64, tilt_m: f64) -> AtEnd {
        let OneEnd { e, rides, shift, turns, span, is_other_side } = *self;
        let Interval { lo, hi } = Interval::of(c.corners.iter().map(|&p| e.plane.distance(p)));
        // The end's plane does not turn against what bounds the blocker's corners.
        let known = rides || !turns;
        let off = match known {
            true => hi + shift.lo > OFF * half || lo + shift.hi < -OFF * half,
            false => !turns_c && (span.lo > tilt_m || span.hi < -tilt_m),
        };
        let turned = !rides && (turns || turns_c);
        let faces = turned || c.plane.normal.dot(e.plane.normal).abs() > 0.5 - 1e-9;
        AtEnd { behind: known && hi + shift.hi <= half, may_cover: !is_other_side && !off && faces }
    }
}
