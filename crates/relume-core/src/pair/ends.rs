//! Ends of pairs that are no polygons: lights as polygons far away, and boxes of nodes, with the shafts between them.

use glam::DVec3;

use crate::element::{ElementId, Forest, Kind, WorldElement, WorldLight, WorldView};
use crate::geometry::{Aabb, Plane, ShaftOfBoxes};
use crate::scene::{BodyId, LightKind, PatchId};
use crate::transport::{SegmentBundle, light_at};

/// How many times as far as out of the scene a directional light is taken to be.
const PARALLEL: f64 = (1 << 20) as f64;

/// A punctual light as the far end of a shaft.
pub(super) struct LightPlace {
    pub(super) stand_in: WorldElement,
    /// For directional lights: far enough along the light to be outside everything.
    away_m: f64,
}

impl LightPlace {
    pub(super) fn new(lamp: &WorldLight, e: &WorldElement, away_m: f64) -> LightPlace {
        let corners = match lamp.kind {
            LightKind::Directional => e.corners.map(|c| c - lamp.direction * away_m),
            LightKind::Point | LightKind::Spot { .. } => [lamp.position; 4],
        };
        let centre = (corners[0] + corners[1] + corners[2] + corners[3]) * 0.25;
        let stand_in = WorldElement {
            corners,
            len: 4,
            // Nothing is behind a light.
            plane: Plane { normal: DVec3::ZERO, offset: -1.0 },
            axes: [DVec3::ZERO; 2],
            centre,
            radius: corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max),
            area: 0.0,
            bounds: Aabb::of(corners),
            rounding_m: 0.0,
        };
        LightPlace { stand_in, away_m }
    }

    /// Point that the light comes from, or seems to come from: rays of a directional light are parallel to rounding.
    pub(super) fn from(&self, lamp: &WorldLight, e: &WorldElement) -> DVec3 {
        match lamp.kind {
            LightKind::Directional => e.centre - lamp.direction * (self.away_m * PARALLEL),
            LightKind::Point | LightKind::Spot { .. } => lamp.position,
        }
    }

    pub(super) fn segments(&self, lamp: &WorldLight, e: &WorldElement, key: u64) -> SegmentBundle {
        let end = |p: DVec3| match lamp.kind {
            LightKind::Directional => p - lamp.direction * self.away_m,
            LightKind::Point | LightKind::Spot { .. } => lamp.position,
        };
        SegmentBundle::to_light(e, key, end, |p| light_at(lamp, p, e.plane.normal))
    }
}

/// The one body that a node belongs to; `None` for groups of bodies and for lights.
pub(super) fn body_of(forest: &Forest, view: &WorldView, id: ElementId) -> Option<BodyId> {
    match forest.patch(id) {
        Some(patch) => Some(view.patch(patch).body),
        None => forest.cluster_body(id),
    }
}

/// The shaft of two nodes of the fixed part, as boxes.
pub(super) struct BoxShaft<'a> {
    view: &'a WorldView,
    forest: &'a Forest,
    world: ShaftOfBoxes,
    /// Shaft of both boxes in the frame of the one body that they are in.
    own: Option<(BodyId, ShaftOfBoxes)>,
    /// Ends that are patches.
    patches: [Option<PatchId>; 2],
    /// Clusters of this size are small against it.
    keep_m: f64,
    margin_m: f64,
}

impl<'a> BoxShaft<'a> {
    /// Shaft of two nodes, at least one of which is a group; `body` if both are in that one.
    pub(super) fn new(
        view: &'a WorldView,
        forest: &'a Forest,
        (a, b): (ElementId, ElementId),
        body: Option<BodyId>,
    ) -> BoxShaft<'a> {
        let patches = [forest.patch(a), forest.patch(b)];
        let (a, b) = (forest.fixed(a), forest.fixed(b));
        let in_body = |_| ShaftOfBoxes::new(view.box_in_body(a), view.box_in_body(b));
        let own = body.map(|body| (body, in_body(body)));
        let world = (view.end_box(a), view.end_box(b));
        BoxShaft {
            view,
            forest,
            world: ShaftOfBoxes::new(world.0, world.1),
            own,
            patches,
            keep_m: 0.5 * world.0.union(*world.1).diagonal().min(view.far_m()),
            // More than the slack of any pair: what lies on an end may hide it.
            margin_m: 5e-7 * view.far_m(),
        }
    }

    /// Whether the box of a node meets the shaft.
    fn meets(&self, id: ElementId) -> bool {
        let world = self.view.fixed_box(id);
        let (shaft, bounds) = match &self.own {
            Some((body, own)) if body_of(self.forest, self.view, id) == Some(*body) => {
                (own, self.view.box_in_body(id))
            }
            _ => (&self.world, world),
        };
        !world.is_empty() && shaft.meets(bounds, self.margin_m)
    }

    /// Whether a patch blocks no segment of this pair or of one below it though its box may meet the shaft. A lamp behind one end
    /// may light the other one unevenly.
    fn is_spared_by(&self, patch: PatchId) -> bool {
        if self.view.is_hidden_twin(patch) {
            return true;
        }
        let is_behind = |end| !self.forest.is_lamp(patch) && self.is_behind(patch, end);
        self.patches.iter().flatten().any(|&end| patch == end || is_behind(end))
    }

    /// Whether a patch is wholly behind the plane of another, and does not lie in it.
    fn is_behind(&self, patch: PatchId, end: PatchId) -> bool {
        let (body, of_end) = (self.view.patch(patch).body, self.view.patch(end));
        // In the frame in which it is looked at by every pair below.
        let in_body = self.own.as_ref().is_some_and(|own| own.0 == body);
        let (frame, occluder) = match in_body {
            true => (&of_end.local, self.view.occluder_in_body(patch)),
            false => (&of_end.world, self.view.occluder(patch)),
        };
        let plane = Plane::through(frame.origin, frame.normal);
        let mut least = f64::INFINITY;
        for &corner in occluder.corners {
            let above = plane.distance(corner);
            if above > 0.0 {
                return false;
            }
            least = least.min(above);
        }
        least < -self.margin_m
    }

    /// Which of `parents` may block; clusters large against the shaft are opened.
    pub(super) fn narrow(&self, parents: &[u32], out: &mut Vec<u32>) {
        let mut stack: Vec<u32> = parents.iter().rev().copied().collect();
        while let Some(id) = stack.pop() {
            let element = ElementId(id);
            if self.forest.kind(element) == Kind::Light || !self.meets(element) {
                continue;
            }
            match self.forest.patch(element) {
                Some(patch) if self.is_spared_by(patch) => {}
                Some(_) => out.push(id),
                None => {
                    let mixed = self.forest.cluster_body(element).is_none()
                        && (self.own.is_some() || !self.forest.is_of_stage(element));
                    if !mixed && self.view.fixed_box(element).diagonal() <= self.keep_m {
                        out.push(id);
                    } else {
                        stack.extend(self.forest.children(element).rev());
                    }
                }
            }
        }
    }

    /// Whether the box of anything at or below `id` meets the shaft, what is in `except` aside.
    pub(super) fn is_entered_by(&self, id: ElementId, except: Option<BodyId>) -> bool {
        let body = body_of(self.forest, self.view, id);
        if (body.is_some() && body == except) || self.forest.kind(id) == Kind::Light {
            return false;
        }
        let mixed = body.is_none();
        self.meets(id)
            && (!mixed
                || self.forest.children(id).any(|c| self.is_entered_by(ElementId(c), except)))
    }
}
