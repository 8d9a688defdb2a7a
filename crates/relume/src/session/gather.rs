//! Irradiance at a point, gathered from the elements with fresh visibility.

use glam::DVec3;

use crate::element::{ElementId, Forest, Kind, WorldElement};
use crate::geometry::ConvexPolygon;
use crate::geometry::Plane;
use crate::transport::{form_factor_from_point, light_at, segment_is_clear};

use super::{Session, Solved};

impl Session {
    /// Irradiance at a point with a unit normal, W/m2, linear RGB: gathered from all elements and
    /// punctual lights, each with visibility of its own from this point.
    ///
    /// Elements that are large as seen from the point are taken in parts; what one of them sends
    /// errs by its radiosity's variation within the element.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn irradiance_at(&self, point: DVec3, normal: DVec3) -> [f64; 3] {
        let solved = self.solved.as_ref().expect("a step comes before a query");
        let mut sum = [0.0; 3];
        for id in 0..self.forest.len() as u32 {
            let element = ElementId(id);
            let leaf = self.forest.children(element).is_empty();
            match self.forest.kind(element) {
                Kind::Element if leaf => {
                    let f = self.visible_form_factor(solved, element, point, normal);
                    let b = solved.radiosity.radiosity(id);
                    (0..3).for_each(|c| sum[c] += f * f64::from(b[c]));
                }
                Kind::Light => {
                    let e = self.from_light(solved, element, point, normal);
                    (0..3).for_each(|c| sum[c] += e[c]);
                }
                _ => {}
            }
        }
        sum
    }

    fn from_light(&self, solved: &Solved, id: ElementId, point: DVec3, normal: DVec3) -> [f64; 3] {
        let index = self.forest.light(id).expect("a light has an index");
        let Some(light) = solved.view.light(index) else { return [0.0; 3] };
        let e = light_at(light, point, normal);
        let away = solved.view.fixed_box(Forest::ROOT).diagonal() * 1.5;
        let end = match light.kind {
            crate::scene::LightKind::Directional => point - light.direction * away,
            _ => light.position,
        };
        let clear =
            e > 0.0 && segment_is_clear(&solved.view, &self.forest, point, end, 1e-9 * away);
        self.scene.lights[index].intensity.map(|i| if clear { i * e } else { 0.0 })
    }

    fn visible_form_factor(
        &self,
        solved: &Solved,
        id: ElementId,
        point: DVec3,
        normal: DVec3,
    ) -> f64 {
        let patch = self.forest.patch(id).expect("elements have patches");
        if !solved.view.is_present(self.scene.patches[patch.0 as usize].body) {
            return 0.0;
        }
        let e = WorldElement::new(&solved.view, &self.forest, id, false);
        if e.plane.distance(point) <= e.rounding_m {
            return 0.0;
        }
        self.visible_part(solved, &e.corners, &e.plane, point, normal, 0, patch)
    }

    #[allow(clippy::too_many_arguments)]
    fn visible_part(
        &self,
        solved: &Solved,
        corners: &[DVec3; 4],
        plane: &Plane,
        point: DVec3,
        normal: DVec3,
        depth: u32,
        patch: crate::scene::PatchId,
    ) -> f64 {
        let tangent = Plane::through(point, normal);
        let seen = ConvexPolygon::new(corners).clipped(&tangent, 0.0);
        if seen.corners().len() < 3 {
            return 0.0;
        }
        let f = form_factor_from_point(point, normal, seen.corners());
        let at = |s: f64, t: f64| crate::element::bilinear(corners, s, t);
        // Enough parts that none matters much; a part is seen wholly or not at all.
        if f > 2e-4 && depth < 6 {
            let part =
                |s: f64, t: f64| [at(s, t), at(s + 0.5, t), at(s + 0.5, t + 0.5), at(s, t + 0.5)];
            return [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)]
                .into_iter()
                .map(|(s, t)| {
                    self.visible_part(solved, &part(s, t), plane, point, normal, depth + 1, patch)
                })
                .sum();
        }
        let slack = 1e-9 * solved.view.fixed_box(Forest::ROOT).diagonal();
        let middle = at(0.5, 0.5);
        if segment_is_clear(&solved.view, &self.forest, point, middle, slack) { f } else { 0.0 }
    }
}
