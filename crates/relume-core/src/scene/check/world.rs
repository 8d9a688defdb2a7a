//! The polygons of a scene at one instant, and what rays meet of them.
//!
//! Rays are tried against one polygon after another. Must not know what they are cast for.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::geometry::Aabb;
use crate::scene::{BodyId, PatchId, Scene, SurfaceId};

/// Share of the scene's diagonal that rays skip: what lies in the light's own plane.
const SKIPPED: f64 = 1e-7;

/// A polygon in the world; of two twins the first.
#[derive(Clone)]
pub(super) struct Face {
    pub(super) patch: PatchId,
    pub(super) surface: SurfaceId,
    pub(super) two_sided: bool,
    pub(super) origin: DVec3,
    pub(super) normal: DVec3,
    pub(super) axes: [DVec3; 2],
}

/// What is present at one instant.
#[derive(Clone)]
pub(super) struct World<'a> {
    pub(super) scene: &'a Scene,
    pub(super) time_s: f64,
    pub(super) faces: Vec<Face>,
    pub(super) bounds: Aabb,
    /// Bounds of each object.
    pub(super) objects: BTreeMap<&'a str, Aabb>,
}

/// What a ray meets.
pub(super) struct Hit<'w> {
    pub(super) face: &'w Face,
    pub(super) distance_m: f64,
    /// Whether the side that is met reflects.
    pub(super) front: bool,
    /// Normal of that side.
    pub(super) normal: DVec3,
}

impl<'a> World<'a> {
    /// What is present at an instant.
    pub(super) fn of(scene: &'a Scene, time_s: f64) -> World<'a> {
        let mut world = World {
            scene,
            time_s,
            faces: Vec::new(),
            bounds: Aabb::EMPTY,
            objects: BTreeMap::new(),
        };
        for body in (0..scene.bodies.len() as u32).map(BodyId) {
            let Some(pose) = scene.pose(body, time_s) else { continue };
            for (patch, p) in scene.patches_of(body) {
                if p.twin.is_some_and(|twin| twin < patch) {
                    continue;
                }
                let corners = Aabb::of(p.corners_in_body().map(|c| pose.point(c)));
                let object = scene.surfaces[p.surface.0 as usize].object.as_str();
                let of_object = world.objects.entry(object).or_insert(Aabb::EMPTY);
                *of_object = of_object.union(corners);
                world.bounds = world.bounds.union(corners);
                world.faces.push(Face {
                    patch,
                    surface: p.surface,
                    two_sided: p.twin.is_some(),
                    origin: pose.point(p.frame.origin),
                    normal: pose.direction(p.frame.normal),
                    axes: [pose.direction(p.frame.u), pose.direction(p.frame.v)],
                });
            }
        }
        world
    }

    /// The same with some objects turned inside out.
    pub(super) fn with_turned(&self, objects: &BTreeSet<&str>) -> World<'a> {
        let mut turned = self.clone();
        for face in &mut turned.faces {
            if objects.contains(self.scene.surfaces[face.surface.0 as usize].object.as_str()) {
                face.normal = -face.normal;
            }
        }
        turned
    }

    /// The first polygon on a ray's way, but for those that it starts on.
    pub(super) fn first(
        &self,
        origin: DVec3,
        direction: DVec3,
        own: [Option<PatchId>; 2],
    ) -> Option<Hit<'_>> {
        let skipped = SKIPPED * self.bounds.diagonal();
        let mut first: Option<Hit> = None;
        for face in &self.faces {
            let against = direction.dot(face.normal);
            let distance_m = (face.origin - origin).dot(face.normal) / against;
            let nearest = first.as_ref().map_or(f64::INFINITY, |hit| hit.distance_m);
            if !(distance_m > skipped && distance_m < nearest) || own.contains(&Some(face.patch)) {
                continue;
            }
            let at = origin + direction * distance_m - face.origin;
            let corners = &self.scene.patches[face.patch.0 as usize].corners;
            if within(corners, DVec2::new(at.dot(face.axes[0]), at.dot(face.axes[1]))) {
                let front = against < 0.0 || face.two_sided;
                let normal = if against < 0.0 { face.normal } else { -face.normal };
                first = Some(Hit { face, distance_m, front, normal });
            }
        }
        first
    }
}

/// Whether a point lies in a convex polygon or on its outline.
pub(super) fn within(corners: &[DVec2], p: DVec2) -> bool {
    (0..corners.len()).all(|k| {
        let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
        (to - from).perp_dot(p - from) >= 0.0
    })
}

/// The k-th of points that fill the unit disc evenly, whatever their number: share of its area within,
/// and turn in radians. By the golden section and van der Corput's sequence.
pub(super) fn spread(k: u32) -> [f64; 2] {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let share = (f64::from(k.reverse_bits()) + 0.5) / 4_294_967_296.0;
    let turns = (f64::from(k) * GOLDEN).fract();
    [share, turns * TAU + PI / 7.0]
}
