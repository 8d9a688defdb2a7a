//! Rays through a solved scene: what a point sees in a direction. Must not know what is asked about it.

use glam::{DVec2, DVec3};

use crate::element::{ElementId, Forest, Kind, Shape, WorldElement, WorldView};
use crate::geometry::Aabb;
use crate::scene::PatchId;

/// A leaf that a ray meets from its front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub(crate) patch: PatchId,
    pub(crate) leaf: ElementId,
    /// Where, metres.
    pub(crate) at: DVec3,
}

/// What rays are cast through.
#[derive(Clone, Copy)]
pub(crate) struct Rays<'a> {
    view: &'a WorldView,
    forest: &'a Forest,
}

/// A half-line.
struct Ray {
    from: DVec3,
    direction: DVec3,
    /// 1 over each component of the direction.
    inverse: DVec3,
}

impl<'a> Rays<'a> {
    pub(crate) fn new(view: &'a WorldView, forest: &'a Forest) -> Rays<'a> {
        Rays { view, forest }
    }

    /// The leaf that a ray meets first; `None` where it meets the back of something, or leaves the scene.
    pub(crate) fn first(&self, from: DVec3, direction: DVec3) -> Option<Hit> {
        let ray = Ray { from, direction, inverse: direction.recip() };
        let mut nearest: Option<(f64, PatchId)> = None;
        let mut stack = vec![Forest::ROOT];
        while let Some(id) = stack.pop() {
            let within = nearest.map_or(f64::INFINITY, |(t, _)| t);
            if !ray.meets(self.view.fixed_box(id), within) {
                continue;
            }
            match self.forest.patch(id) {
                None => stack.extend(self.forest.children(id).map(ElementId)),
                Some(patch) if self.view.is_hidden_twin(patch) => {}
                Some(patch) => {
                    let met = self.distance(&ray, patch).filter(|&t| t < within);
                    nearest = met.map(|t| (t, patch)).or(nearest);
                }
            }
        }
        let far = || {
            let facets = self.forest.distant_facets().iter();
            let patches = facets.filter_map(|&facet| self.forest.patch(facet));
            patches.filter_map(|patch| Some((self.distance(&ray, patch)?, patch))).next()
        };
        let (t, patch) = nearest.or_else(far)?;
        let patch = match self.view.normal(patch, false).dot(direction) < 0.0 {
            true => patch,
            false => self.view.patch(patch).twin?,
        };
        let at = from + direction * t;
        Some(Hit { patch, leaf: self.leaf(patch, at), at })
    }

    /// Distance along a ray to a patch, from either side.
    fn distance(&self, ray: &Ray, patch: PatchId) -> Option<f64> {
        if !self.view.is_present(self.view.patch(patch).body) {
            return None;
        }
        let polygon = self.view.occluder(patch);
        let t = -polygon.plane.distance(ray.from) / polygon.plane.normal.dot(ray.direction);
        // A ray within the plane meets nothing: it is infinite or not a number.
        if !(t > 0.0 && t.is_finite()) {
            return None;
        }
        let at = ray.from + ray.direction * t;
        polygon.edges.iter().all(|edge| edge.distance(at) >= 0.0).then_some(t)
    }

    /// The leaf of a patch at one of its points.
    fn leaf(&self, patch: PatchId, at: DVec3) -> ElementId {
        let frame = &self.view.patch(patch).world;
        let d = at - frame.origin;
        let p = DVec2::new(d.dot(frame.u), d.dot(frame.v));
        let deepest = |ids: &[ElementId]| {
            let depth = |&id: &ElementId| (depth_in(&self.forest.shape(id), p), id);
            let found = ids.iter().map(depth).max_by(|a, b| a.0.total_cmp(&b.0));
            found.map(|(_, id)| id)
        };
        let mut leaf = deepest(&self.facets(patch)).expect("a patch has a facet");
        loop {
            let children: Vec<ElementId> = self.forest.children(leaf).map(ElementId).collect();
            match deepest(&children) {
                Some(child) => leaf = child,
                None => return leaf,
            }
        }
    }

    /// The elements that a patch is made of: itself, or its parts where it is cut.
    fn facets(&self, patch: PatchId) -> Vec<ElementId> {
        let mut out = Vec::new();
        let mut stack = vec![self.forest.patch_root(patch)];
        while let Some(id) = stack.pop() {
            match self.forest.kind(id) {
                Kind::Element => out.push(id),
                _ => stack.extend(self.forest.children(id).map(ElementId)),
            }
        }
        out
    }

    /// A leaf where it is.
    pub(crate) fn place(&self, leaf: ElementId) -> WorldElement {
        debug_assert_eq!(self.forest.kind(leaf), Kind::Element);
        WorldElement::new(self.view, self.forest, leaf, false)
    }
}

impl Ray {
    /// Whether it meets a box nearer than some distance.
    fn meets(&self, bounds: &Aabb, within: f64) -> bool {
        if bounds.is_empty() {
            return false;
        }
        let (one, two) =
            ((bounds.lo - self.from) * self.inverse, (bounds.hi - self.from) * self.inverse);
        // Not a number where the ray runs within a face: such a side does not count.
        let enters = one.min(two).max_element().max(0.0);
        let leaves = one.max(two).min_element();
        !(enters > leaves * (1.0 + 1e-12) || enters > within)
    }
}

/// How far a point is within a shape, at least; negative outside, metres.
fn depth_in(shape: &Shape, p: DVec2) -> f64 {
    let corners = &shape.corners[..shape.len];
    let depth = |k: usize| {
        let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
        (to - from).perp_dot(p - from) / (to - from).length().max(f64::MIN_POSITIVE)
    };
    (0..corners.len()).map(depth).fold(f64::INFINITY, f64::min)
}
