//! Irradiance at points, gathered from the elements with visibility of their own.
//!
//! From patches down: what stands between the point and a whole patch is found once, and handed
//! down to the elements below it, most of which find nothing in the way.

use glam::DVec3;

use crate::element::{ElementId, Forest, Kind, WorldElement};
use crate::geometry::{Aabb, Plane, shaft_meets_box};
use crate::scene::{InPlane, LightId, LightKind, PatchId};
use crate::solver::SQUARE_MOMENT;
use crate::transport::{
    form_factor_from_point, form_factor_past, in_plane, keep_in_front, lies_in, light_at,
    segment_is_clear,
};

use crate::space::{Sensor, Solved, place_of};

use super::tuning::{BEYOND_FAR, CHECK_FAR, GAP_FAR, GATHER_FAR, GATHER_PART};
use crate::geometry::at_share;
use crate::read::tuning::SENSOR_SPLITS;

/// How far a sensor may be off the surface it lies on, relative to the scene's diagonal: what files
/// with six digits hold. What is no further above its tangent plane hides nothing.
const SENSOR_ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// How far what lies on a patch is lifted off it, in roundings of its corners.
const LIFT: f64 = 8.0;

/// What a look is for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// A sensor itself: all that leaves surfaces close by is gathered anew where they are looked at.
    Sensor,
    /// A point that a sensor sees: leaves are taken at their word.
    Beyond,
    /// A point at which a solution is checked: as beyond, and what is far or brings little is taken as a whole.
    Check,
}

/// A sensor looking at a solved scene.
pub(super) struct Look<'a> {
    solved: &'a Solved,
    forest: &'a Forest,
    point: DVec3,
    normal: DVec3,
    /// Where the sensor's front begins.
    tangent: Plane,
    slack_m: f64,
    purpose: Purpose,
    /// Distance up to which no leaf is taken at its word, however small it is, metres: that of the other side of a gap, some
    /// times; 0 outside gaps.
    reach_m: f64,
    /// Radius of a part over its distance, at most, outside gaps.
    part_size: f64,
    /// Irradiance below which one ray tells if a patch is in view, W/m2, sum of channels; 0 where none does.
    little_w_m2: f64,
}

/// What a point gathers.
#[derive(Default)]
pub(super) struct Gathered {
    /// Irradiance from what is far enough for its size, W/m2.
    pub(super) sum: [f64; 3],
    /// Parts of leaves that are large against their distance or within reach; of the sensor itself.
    pub(super) parts: Vec<Part>,
    /// Such leaves as wholes; of other points.
    pub(super) near: Vec<Near>,
    /// Form factor to what is far enough.
    factor: f64,
    /// Distance of what is far enough, metres, with its form factor; of the sensor itself.
    seen: Vec<(f64, f64)>,
}

impl Gathered {
    /// Distance within which half of the hemisphere is seen, metres; infinite where more than that is open.
    pub(super) fn half_seen_m(&self) -> f64 {
        let near = self.parts.iter().map(|part| (part.nearest_m, part.factor));
        let mut seen: Vec<(f64, f64)> = self.seen.iter().copied().chain(near).collect();
        seen.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut left = 0.5;
        let found = seen.iter().find(|(_, factor)| {
            left -= factor;
            left < 0.0
        });
        found.map_or(f64::INFINITY, |&(distance_m, _)| distance_m)
    }
}

/// A part of a leaf, as large as it is far.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) leaf: ElementId,
    /// The middle of the visible portion, metres.
    pub(super) at: DVec3,
    /// Distance of its nearest point, metres.
    nearest_m: f64,
    pub(super) factor: f64,
}

/// A leaf that is large against its distance, or within reach.
pub(super) struct Near {
    pub(super) leaf: ElementId,
    pub(super) factor: f64,
    /// Irradiance that it causes by its line, W/m2.
    pub(super) sent: [f64; 3],
}

impl<'a> Look<'a> {
    pub(super) fn new(solved: &'a Solved, sensor: &Sensor, purpose: Purpose) -> Look<'a> {
        let slack_m = SENSOR_ROUNDING * solved.space.view.fixed_box(Forest::ROOT).diagonal();
        Look {
            solved,
            forest: &solved.space.forest,
            point: sensor.at,
            normal: sensor.normal,
            tangent: Plane::through(sensor.at, sensor.normal),
            slack_m,
            purpose,
            reach_m: 0.0,
            part_size: if purpose == Purpose::Sensor { GATHER_PART } else { 1.0 },
            little_w_m2: 0.0,
        }
    }

    /// The same look, in which one ray tells if a patch that brings less than this is in view, W/m2, sum of channels.
    pub(super) fn rougher_below(self, little_w_m2: f64) -> Look<'a> {
        Look { little_w_m2, ..self }
    }

    /// The same look, that takes no leaf at its word up to a distance.
    pub(super) fn reaching(self, reach_m: f64) -> Look<'a> {
        Look { reach_m, ..self }
    }

    /// What the point sees.
    pub(super) fn gather(&self) -> Gathered {
        let mut out = Gathered::default();
        for patch in 0..self.solved.space.scene.patches.len() as u32 {
            self.add_patch(PatchId(patch), &mut out);
        }
        let lights = self.lights_arriving();
        (0..3).for_each(|c| out.sum[c] += lights[c]);
        out
    }

    fn light_arriving(&self, id: ElementId) -> [f64; 3] {
        let view = &self.solved.space.view;
        let index = self.forest.light(id).expect("a light has an index");
        let Some(light) = view.light(index) else { return [0.0; 3] };
        let e = light_at(light, self.point, self.normal);
        let away = view.far_m();
        let end = match light.kind {
            LightKind::Directional => self.point - light.direction * away,
            _ => light.position,
        };
        let clear = e > 0.0 && segment_is_clear(view, self.forest, self.point, end, 1e-9 * away);
        let intensity = self.solved.space.world.intensity(LightId(index as u32));
        intensity.map(|i| if clear { i * e } else { 0.0 })
    }

    fn add_patch(&self, patch: PatchId, out: &mut Gathered) {
        let (view, root) = (&self.solved.space.view, self.forest.patch_root(patch));
        if !view.is_present(view.patch(patch).body) {
            return;
        }
        let polygon = view.occluder(patch);
        let rounding_m = view.patch(patch).rounding_m;
        let before = polygon.plane.distance(self.point) > rounding_m;
        if !before || polygon.corners.iter().all(|&c| self.tangent.distance(c) <= self.slack_m) {
            return;
        }
        if self.little_w_m2 > 0.0 && self.add_little(root, out) {
            return;
        }
        let occluders = self.between(patch, rounding_m);
        let all: Vec<&Occluder> = occluders.iter().collect();
        let mut stack = vec![root];
        while let Some(id) = stack.pop() {
            match self.forest.kind(id) {
                Kind::Element => self.add_element(id, &all, out),
                _ => stack.extend(self.forest.children(id).rev().map(ElementId)),
            }
        }
    }

    /// Adds a patch that brings little, if it does: in view or not, as its middle is.
    fn add_little(&self, root: ElementId, out: &mut Gathered) -> bool {
        if self.forest.kind(root) != Kind::Element {
            return false;
        }
        let e = WorldElement::new(&self.solved.space.view, self.forest, root, false);
        let seen = self.in_front(&e);
        if seen.len() < 3 {
            return true;
        }
        let factor = form_factor_from_point(self.point, self.normal, &seen);
        let b = self.solved.radiosity.radiosity(root.0).map(f64::from);
        let brings = factor * b.iter().sum::<f64>();
        if brings >= self.little_w_m2 {
            return false;
        }
        let at = seen.iter().sum::<DVec3>() / seen.len() as f64;
        let view = &self.solved.space.view;
        if brings > 0.0 && segment_is_clear(view, self.forest, self.point, at, self.slack_m) {
            (0..3).for_each(|c| out.sum[c] += factor * b[c]);
        }
        true
    }

    /// What stands between the point and a patch, in the order of the forest.
    fn between(&self, target: PatchId, rounding_m: f64) -> Vec<Occluder> {
        let view = &self.solved.space.view;
        let root = self.forest.patch_root(target);
        let (from, to) = (Aabb::of([self.point]), *view.end_box(root));
        let plane = view.occluder(target).plane;
        let raised = |p: &Plane, by: f64| Plane { normal: p.normal, offset: p.offset + by };
        let front = [raised(&self.tangent, self.slack_m), raised(&plane, rounding_m)];
        let mut out = Vec::new();
        let mut stack = vec![Forest::ROOT];
        while let Some(id) = stack.pop() {
            let bounds = view.fixed_box(id);
            // What lies in the target's plane may be a little behind it.
            if bounds.is_empty() || !shaft_meets_box(&from, &to, &bounds.grown(rounding_m)) {
                continue;
            }
            let Some(patch) = self.forest.patch(id) else {
                stack.extend(self.forest.children(id).map(ElementId));
                continue;
            };
            if patch == target || view.is_hidden_twin(patch) {
                continue;
            }
            let polygon = view.occluder(patch);
            let on_target = lies_in(&polygon, &plane, rounding_m).is_some_and(|lying| {
                in_plane(self.forest, view, patch, target, lying) != InPlane::Apart
            });
            let lift = if on_target { plane.normal * (LIFT * rounding_m) } else { DVec3::ZERO };
            let mut corners: Vec<DVec3> = polygon.corners.iter().map(|&c| c + lift).collect();
            front.iter().for_each(|p| keep_in_front(&mut corners, p));
            if corners.len() >= 3
                && let Some(occluder) = Occluder::new(self.point, corners)
            {
                out.push(occluder);
            }
        }
        out
    }

    /// Adds what an element sends past the occluders that may be in its way.
    fn add_element(&self, id: ElementId, occluders: &[&Occluder], out: &mut Gathered) {
        let e = WorldElement::new(&self.solved.space.view, self.forest, id, false);
        let seen = self.in_front(&e);
        if seen.len() < 3 {
            return;
        }
        let Some(in_the_way) = self.in_the_way(&seen, occluders) else { return };
        let children = self.forest.children(id);
        let distance = (e.centre - self.point).length();
        let far = match self.purpose {
            Purpose::Check => CHECK_FAR,
            _ if self.reach_m > 0.0 => GAP_FAR,
            Purpose::Beyond => BEYOND_FAR,
            _ => GATHER_FAR,
        };
        let is_rough = self.purpose == Purpose::Beyond && self.reach_m == 0.0;
        let as_one = (is_rough || in_the_way.is_empty()) && e.radius < far * distance;
        if !children.is_empty() && !as_one {
            children.for_each(|child| self.add_element(ElementId(child), &in_the_way, out));
            return;
        }
        let way_m = e.bounds.distance(&Aabb::of([self.point]));
        let is_near = e.radius > way_m || way_m < self.reach_m;
        if self.purpose == Purpose::Sensor && is_near {
            return self.add_parts(id, &seen, (&in_the_way, SENSOR_SPLITS), &mut out.parts);
        }
        let as_mean = in_the_way.is_empty() && !is_near && self.purpose != Purpose::Check;
        let (factor, b) = if as_mean {
            let factor = form_factor_from_point(self.point, self.normal, &seen);
            (factor, self.solved.radiosity.radiosity(id.0))
        } else {
            // The part in view may be much brighter or darker than the rest.
            let (factor, moment) = self.factor_past(&seen, &in_the_way, SENSOR_SPLITS);
            (factor, radiosity_at(self.solved, &e, id, middle_of((factor, moment), &seen)))
        };
        if factor <= 0.0 {
            return;
        }
        let sent = b.map(|b| factor * f64::from(b));
        if is_near && self.purpose != Purpose::Check {
            out.near.push(Near { leaf: id, factor, sent });
            return;
        }
        (0..3).for_each(|c| out.sum[c] += sent[c]);
        out.factor += factor;
        if self.purpose == Purpose::Sensor {
            out.seen.push((distance, factor));
        }
    }

    /// The part of an element before the point.
    fn in_front(&self, e: &WorldElement) -> Vec<DVec3> {
        let mut seen = e.corners[..e.len].to_vec();
        if !seen.iter().all(|&c| self.tangent.distance(c) >= 0.0) {
            keep_in_front(&mut seen, &self.tangent);
        }
        seen
    }

    /// Which occluders hide some of a polygon; `None` if one hides all of it.
    fn in_the_way<'o>(
        &self,
        seen: &[DVec3],
        occluders: &[&'o Occluder],
    ) -> Option<Vec<&'o Occluder>> {
        let mut out = Vec::new();
        if !occluders.is_empty() {
            let pyramid = pyramid(self.point, seen);
            for &occluder in occluders {
                match occluder.hides(seen, &pyramid) {
                    Hides::Nothing => {}
                    Hides::Some => out.push(occluder),
                    Hides::All => return None,
                }
            }
        }
        Some(out)
    }

    /// What arrives from punctual lights and from what some patches emit, W/m2.
    pub(super) fn direct(&self, lamps: &[PatchId]) -> [f64; 3] {
        let space = &self.solved.space;
        let mut sum = self.lights_arriving();
        for &lamp in lamps {
            let mut seen = Gathered::default();
            self.add_patch(lamp, &mut seen);
            let near = seen.near.iter().map(|near| near.factor);
            let factor = seen.factor + near.sum::<f64>();
            let m = space.world.exitance(&space.scene, &space.scene.patches[lamp.0 as usize]);
            (0..3).for_each(|c| sum[c] += factor * m[c]);
        }
        sum
    }

    /// What arrives from punctual lights, W/m2.
    fn lights_arriving(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for id in self.forest.children(Forest::ROOT).map(ElementId) {
            if self.forest.kind(id) == Kind::Light {
                let e = self.light_arriving(id);
                (0..3).for_each(|c| sum[c] += e[c]);
            }
        }
        sum
    }

    /// Adds the parts, as large as they are far, of a part of a leaf that is seen.
    fn add_parts(
        &self,
        leaf: ElementId,
        part: &[DVec3],
        (occluders, splits): (&[&Occluder], u32),
        out: &mut Vec<Part>,
    ) {
        let middle = part.iter().sum::<DVec3>() / part.len() as f64;
        let radius = part.iter().map(|c| c.distance(middle)).fold(0.0, f64::max);
        let nearest_m = Aabb::of(part.iter().copied()).distance(&Aabb::of([self.point]));
        // In a gap a part reaches no nearer than it is large: what arrives changes within the gap's width.
        let way_m = match self.reach_m > 0.0 {
            true => nearest_m,
            false => self.part_size * (middle - self.point).length(),
        };
        if splits > 0 && radius > way_m {
            for k in 0..part.len() {
                let part = towards(part, k, middle);
                let pyramid = pyramid(self.point, &part);
                let hides = |o: &&&Occluder| o.hides(&part, &pyramid) != Hides::Nothing;
                let rest: Vec<&Occluder> = occluders.iter().filter(hides).copied().collect();
                self.add_parts(leaf, &part, (&rest, splits - 1), out);
            }
            return;
        }
        let (factor, moment) = self.factor_past(part, occluders, SENSOR_SPLITS);
        if factor > 0.0 {
            let at = middle_of((factor, moment), part);
            out.push(Part { leaf, at, nearest_m, factor });
        }
    }

    /// One part of some leaves close by, each as likely as its form factor is large if both numbers, from 0 to 1, are equally
    /// distributed; `None` if nothing is seen of them.
    pub(super) fn choose(&self, near: &[Near], [which, where_]: [f64; 2]) -> Option<Part> {
        let leaf = near[at_share(near.iter().map(|n| n.factor), which)?].leaf;
        let patch = self.forest.patch(leaf).expect("an element has a patch");
        let occluders = self.between(patch, self.solved.space.view.patch(patch).rounding_m);
        let e = WorldElement::new(&self.solved.space.view, self.forest, leaf, false);
        let seen = self.in_front(&e);
        let all: Vec<&Occluder> = occluders.iter().collect();
        let in_the_way = self.in_the_way(&seen, &all)?;
        let mut parts = Vec::new();
        self.add_parts(leaf, &seen, (&in_the_way, SENSOR_SPLITS), &mut parts);
        Some(parts[at_share(parts.iter().map(|p| p.factor), where_)?])
    }

    /// The form factor to what is seen of a polygon past occluders, and that times the middle of it.
    fn factor_past(&self, seen: &[DVec3], occluders: &[&Occluder], splits: u32) -> (f64, DVec3) {
        let polygons = occluders.iter().map(|o| o.corners.as_slice());
        let found = form_factor_past(self.point, self.normal, seen, polygons);
        if found.is_exact {
            return (found.factor, found.middle * found.factor);
        }
        let middle = seen.iter().sum::<DVec3>() / seen.len() as f64;
        if splits == 0 {
            let view = &self.solved.space.view;
            let clear = segment_is_clear(view, self.forest, self.point, middle, self.slack_m);
            let f = form_factor_from_point(self.point, self.normal, seen);
            return if clear { (f, middle * f) } else { (0.0, DVec3::ZERO) };
        }
        // Towards the corners: each part is a quadrilateral.
        let n = seen.len();
        let part = |k: usize| {
            let part = towards(seen, k, middle);
            let pyramid = pyramid(self.point, &part);
            let hides = |o: &&&Occluder| o.hides(&part, &pyramid) != Hides::Nothing;
            let rest: Vec<&Occluder> = occluders.iter().filter(hides).copied().collect();
            self.factor_past(&part, &rest, splits - 1)
        };
        (0..n).map(part).fold((0.0, DVec3::ZERO), |sum, part| (sum.0 + part.0, sum.1 + part.1))
    }
}

impl Part {
    /// Radiosity of the part by the line of its leaf, W/m2.
    pub(super) fn line(&self, solved: &Solved) -> [f64; 3] {
        let e = WorldElement::new(&solved.space.view, &solved.space.forest, self.leaf, false);
        radiosity_at(solved, &e, self.leaf, self.at).map(f64::from)
    }
}

/// The middle of what is seen of a polygon, from its form factor and that times the middle: of a sliver both are differences of
/// rounded numbers, but it is on the polygon all the same.
fn middle_of((factor, moment): (f64, DVec3), polygon: &[DVec3]) -> DVec3 {
    let bounds = Aabb::of(polygon.iter().copied());
    (moment / factor.max(f64::MIN_POSITIVE)).clamp(bounds.lo, bounds.hi)
}

/// Radiosity of an element at a point of it, from its line, never negative, W/m2.
pub(super) fn radiosity_at(
    solved: &Solved,
    e: &WorldElement,
    id: ElementId,
    at: DVec3,
) -> [f32; 3] {
    let forest = &solved.space.forest;
    let place = place_of(forest, id);
    let b = solved.radiosity.linear(id.0, &place, SQUARE_MOMENT);
    // Its mean is that of what is exposed of it.
    let [x, y] = place.centroid.map(f64::from);
    let middle = glam::DVec2::new(x, y) - forest.extent(id).centroid;
    let at = (e.offset(at) - middle) / e.radius;
    b.at(at.x as f32, at.y as f32).map(|b| b.max(0.0))
}

/// The part of a polygon towards its corner `k`: a quadrilateral with a corner in the middle.
fn towards(polygon: &[DVec3], k: usize, middle: DVec3) -> [DVec3; 4] {
    let n = polygon.len();
    let (before, after) = (polygon[(k + n - 1) % n], polygon[(k + 1) % n]);
    [polygon[k], (polygon[k] + after) * 0.5, middle, (polygon[k] + before) * 0.5]
}

/// A polygon between the point and a patch.
struct Occluder {
    corners: Vec<DVec3>,
    /// Planes through the point and its edges; the shadow is in front of all.
    pyramid: Vec<DVec3>,
    point: DVec3,
}

/// How much of a polygon an occluder hides.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hides {
    Nothing,
    Some,
    All,
}

impl Occluder {
    /// `None` for a polygon that is seen edge on.
    fn new(point: DVec3, corners: Vec<DVec3>) -> Option<Occluder> {
        let pyramid = pyramid(point, &corners);
        (!pyramid.is_empty()).then_some(Occluder { corners, pyramid, point })
    }

    /// How much of a polygon with this pyramid is hidden. Conservative: what touches counts.
    fn hides(&self, polygon: &[DVec3], pyramid: &[DVec3]) -> Hides {
        let beside = |planes: &[DVec3], corners: &[DVec3]| {
            planes.iter().any(|n| corners.iter().all(|&c| n.dot(c - self.point) <= 0.0))
        };
        if beside(pyramid, &self.corners) || beside(&self.pyramid, polygon) {
            return Hides::Nothing;
        }
        let within =
            self.pyramid.iter().all(|n| polygon.iter().all(|&c| n.dot(c - self.point) >= 0.0));
        if within { Hides::All } else { Hides::Some }
    }
}

/// Normals of the planes through a point and a polygon's edges, inwards; none where the polygon is
/// seen edge on.
fn pyramid(point: DVec3, corners: &[DVec3]) -> Vec<DVec3> {
    let n = corners.len();
    let normals = |k: usize| (corners[k] - point).cross(corners[(k + 1) % n] - point);
    let fan = |k: usize| (corners[k] - corners[0]).cross(corners[k + 1] - corners[0]);
    let facing = (1..n - 1).map(fan).sum::<DVec3>().dot(corners[0] - point);
    if facing == 0.0 {
        return Vec::new();
    }
    (0..n).map(|k| normals(k) * facing.signum()).collect()
}
