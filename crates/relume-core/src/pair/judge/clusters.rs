//! Pairs of which an end is a cluster that no link ends on: culled where they are out of sight, else refined by area.

use glam::DVec3;

use crate::element::{ElementId, Kind};
use crate::geometry::{Aabb, Plane, no_smaller};
use crate::transport::Side;

use super::space_judge::{SpaceJudge, culled, passing};
use crate::pair::ends::BoxShaft;
use crate::pair::tree::CullReason;
use crate::pair::verdict::{Judgement, Verdict};

/// Depth behind a plane, in roundings of its patch, up to which a group may hold what touches it.
const IN_PLANE: f64 = 64.0;

impl SpaceJudge<'_> {
    /// Judges a pair of clusters, of a cluster and an element or a light, or of a polygon with itself.
    pub(super) fn judge_clusters(
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
    pub(in crate::pair) fn is_out_of_sight(
        &self,
        (a, b): (ElementId, ElementId),
        one_body: bool,
    ) -> bool {
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
}
