//! Irradiance at a point, gathered from the elements with fresh visibility.

use glam::DVec3;

use crate::element::{ElementId, Forest, Kind, WorldElement};
use crate::geometry::{Aabb, ConvexPolygon, Plane, shaft_meets_box};
use crate::transport::{
    CLIPPED_MAX, form_factor_from_point, light_at, segment_is_clear, visible_form_factor,
};

use super::{Session, Solved};

impl Session {
    /// Irradiance at a point with a unit normal, W/m2, linear RGB: gathered from all elements and
    /// punctual lights, each with visibility of its own from this point.
    ///
    /// Visibility is exact where no more than twelve polygons stand between the point and an
    /// element; what an element sends errs by its radiosity's variation within it.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn irradiance_at(&self, point: DVec3, normal: DVec3) -> [f64; 3] {
        let solved = self.solved.as_ref().expect("a step comes before a query");
        let mut sum = [0.0; 3];
        for id in 0..solved.forest.len() as u32 {
            let element = ElementId(id);
            let leaf = solved.forest.children(element).is_empty();
            match solved.forest.kind(element) {
                Kind::Element if leaf => {
                    let f = self.gather_element(solved, element, point, normal);
                    let b = solved.radiosity.radiosity(id);
                    (0..3).for_each(|c| sum[c] += f * f64::from(b[c]));
                }
                Kind::Light => {
                    let e = self.gather_light(solved, element, point, normal);
                    (0..3).for_each(|c| sum[c] += e[c]);
                }
                _ => {}
            }
        }
        sum
    }

    fn gather_light(
        &self,
        solved: &Solved,
        id: ElementId,
        point: DVec3,
        normal: DVec3,
    ) -> [f64; 3] {
        let index = solved.forest.light(id).expect("a light has an index");
        let Some(light) = solved.view.light(index) else { return [0.0; 3] };
        let e = light_at(light, point, normal);
        let away = solved.view.far_m();
        let end = match light.kind {
            crate::scene::LightKind::Directional => point - light.direction * away,
            _ => light.position,
        };
        let clear =
            e > 0.0 && segment_is_clear(&solved.view, &solved.forest, point, end, 1e-9 * away);
        self.scene.lights[index].intensity.map(|i| if clear { i * e } else { 0.0 })
    }

    fn gather_element(&self, solved: &Solved, id: ElementId, point: DVec3, normal: DVec3) -> f64 {
        let patch = solved.forest.patch(id).expect("elements have patches");
        let e = WorldElement::new(&solved.view, &solved.forest, id, false);
        let absent = !solved.view.is_present(solved.view.patch(patch).body);
        if absent || e.plane.distance(point) <= e.rounding_m {
            return 0.0;
        }
        let look = Look { solved, forest: &solved.forest, point, normal, plane: e.plane };
        look.at(&ConvexPolygon::new(&e.corners[..e.len]), SPLITS)
    }
}

/// Halvings of an element with more polygons in the way; then its middle decides.
const SPLITS: u32 = 6;

/// A look from a point at one element.
struct Look<'a> {
    solved: &'a Solved,
    forest: &'a Forest,
    point: DVec3,
    normal: DVec3,
    /// The element's.
    plane: Plane,
}

impl Look<'_> {
    /// Form factor to the visible part of a polygon of the element's plane.
    fn at(&self, polygon: &ConvexPolygon, splits: u32) -> f64 {
        let tangent = Plane::through(self.point, self.normal);
        let seen = polygon.clipped(&tangent, 0.0);
        if seen.corners().len() < 3 {
            return 0.0;
        }
        let Some(between) = self.between(&seen, &tangent) else {
            return self.in_parts(&seen, splits);
        };
        visible_form_factor(self.point, self.normal, &seen, &between)
    }

    /// Occluders between the point and a polygon; `None` if there are many.
    fn between(&self, seen: &ConvexPolygon, tangent: &Plane) -> Option<Vec<ConvexPolygon>> {
        let slack = self.slack();
        let raised = |p: &Plane| Plane { normal: p.normal, offset: p.offset + slack };
        let (from, to) = (Aabb::of([self.point]), Aabb::of(seen.corners().iter().copied()));
        let mut out = Vec::new();
        let mut stack = vec![Forest::ROOT];
        while let Some(id) = stack.pop() {
            let bounds = self.solved.view.fixed_box(id);
            if bounds.is_empty() || !shaft_meets_box(&from, &to, bounds) {
                continue;
            }
            let Some(patch) = self.forest.patch(id) else {
                stack.extend(self.forest.children(id).map(ElementId));
                continue;
            };
            if self.solved.view.is_hidden_twin(patch) {
                continue;
            }
            let corners = self.solved.view.occluder(patch).corners;
            let few = &corners[..corners.len().min(ConvexPolygon::START_MAX)];
            let part = ConvexPolygon::new(few)
                .clipped(&raised(tangent), 0.0)
                .clipped(&raised(&self.plane), 0.0);
            if part.corners().len() >= 3 {
                out.push(part);
            }
            if out.len() > CLIPPED_MAX {
                return None;
            }
        }
        Some(out)
    }

    fn slack(&self) -> f64 {
        1e-9 * self.solved.view.fixed_box(Forest::ROOT).diagonal()
    }

    fn in_parts(&self, seen: &ConvexPolygon, splits: u32) -> f64 {
        let c = seen.corners();
        let middle = c.iter().sum::<DVec3>() / c.len() as f64;
        if splits == 0 {
            let clear =
                segment_is_clear(&self.solved.view, self.forest, self.point, middle, self.slack());
            let f = form_factor_from_point(self.point, self.normal, c);
            return if clear { f } else { 0.0 };
        }
        // Towards the corners: each part is a quadrilateral.
        (0..c.len())
            .map(|k| {
                let (before, after) = (c[(k + c.len() - 1) % c.len()], c[(k + 1) % c.len()]);
                let part = [c[k], (c[k] + after) * 0.5, middle, (c[k] + before) * 0.5];
                self.at(&ConvexPolygon::new(&part), splits - 1)
            })
            .sum()
    }
}
