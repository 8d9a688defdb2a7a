//! What a ray meets first, among all patches at one instant.
//!
//! Single precision, in units of the scene: its middle is the origin and its diagonal 1. Good enough
//! to choose a view by; nothing that is solved uses it.

use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use obvhs::ray::{INVALID_ID, Ray, RayHit};
use relume_core::geometry::Pose;
use relume_core::scene::{PatchId, Scene};

/// How far off a surface rays start, in units of the scene.
pub(in super::super) const LIFT: f32 = 1e-5;

/// All patches at one instant, made ready for rays.
pub(in super::super) struct Caster {
    tree: Bvh2,
    /// In the order of the tree.
    triangles: Vec<Triangle>,
    middle: DVec3,
    /// Metres in a unit of the scene.
    unit_m: f64,
}

/// A part of a patch.
#[derive(Clone, Copy)]
struct Triangle {
    a: Vec3,
    ab: Vec3,
    ac: Vec3,
    patch: PatchId,
}

/// What a ray meets.
#[derive(Clone, Copy)]
pub(in super::super) struct Hit {
    /// The patch whose front it is; `None` for the black back of a single-sided one.
    pub(in super::super) front: Option<PatchId>,
    /// Distance, in units of the scene.
    pub(in super::super) distance: f32,
    /// Cosine between the ray and the normal, not negative.
    pub(in super::super) cosine: f32,
}

impl Caster {
    /// Of the patches that are present; `poses` by body.
    pub(in super::super) fn new(
        scene: &Scene,
        poses: &[Option<Pose>],
        (middle, unit_m): (DVec3, f64),
    ) -> Caster {
        let mut triangles = Vec::new();
        for (index, patch) in scene.patches.iter().enumerate() {
            let Some(pose) = &poses[patch.body.0 as usize] else { continue };
            // Of two sides of one polygon the first stands for both.
            if patch.twin.is_some_and(|twin| (twin.0 as usize) < index) {
                continue;
            }
            let place = |p: DVec3| ((pose.point(p) - middle) / unit_m).as_vec3();
            let corners: Vec<Vec3> = patch.corners_in_body().map(place).collect();
            let of_pair = |pair: &[Vec3]| Triangle {
                a: corners[0],
                ab: pair[0] - corners[0],
                ac: pair[1] - corners[0],
                patch: PatchId(index as u32),
            };
            triangles.extend(corners[1..].windows(2).map(of_pair));
        }
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::bounds).collect();
        let tree = if boxes.is_empty() {
            Bvh2::default()
        } else {
            let indices = (0..boxes.len() as u32).collect();
            let search = PlocSearchDistance::Medium;
            PlocBuilder::new().build(search, &boxes, indices, SortPrecision::U64, 0)
        };
        let triangles = tree.primitive_indices.iter().map(|&k| triangles[k as usize]).collect();
        Caster { tree, triangles, middle, unit_m }
    }

    /// A point of the world in units of the scene.
    pub(in super::super) fn place(&self, world: DVec3) -> Vec3 {
        ((world - self.middle) / self.unit_m).as_vec3()
    }

    /// A point in units of the scene in the world, metres.
    pub(in super::super) fn world(&self, at: Vec3) -> DVec3 {
        at.as_dvec3() * self.unit_m + self.middle
    }

    /// Metres in a unit of the scene.
    pub(in super::super) fn unit_m(&self) -> f64 {
        self.unit_m
    }

    /// The first thing on the way from a point in a unit direction.
    pub(in super::super) fn first(&self, scene: &Scene, from: Vec3, towards: Vec3) -> Option<Hit> {
        self.nearest(scene, from, towards, false)
    }

    /// The same, passing through the backs of single-sided patches, as pictures do.
    pub(in super::super) fn first_front(
        &self,
        scene: &Scene,
        from: Vec3,
        towards: Vec3,
    ) -> Option<Hit> {
        self.nearest(scene, from, towards, true)
    }

    fn nearest(&self, scene: &Scene, from: Vec3, towards: Vec3, past_backs: bool) -> Option<Hit> {
        if self.triangles.is_empty() {
            return None;
        }
        let ray = Ray::new(from.into(), towards.into(), LIFT, f32::INFINITY);
        let mut hit = RayHit::none();
        self.tree.ray_traverse(ray, &mut hit, |ray, k| {
            let triangle = &self.triangles[k];
            let is_single = || scene.patches[triangle.patch.0 as usize].twin.is_none();
            if past_backs && triangle.normal().dot(towards) > 0.0 && is_single() {
                return f32::INFINITY;
            }
            triangle.meets(from, towards, ray.tmin)
        });
        (hit.primitive_id != INVALID_ID).then(|| {
            let triangle = &self.triangles[hit.primitive_id as usize];
            let along = triangle.normal().normalize_or_zero().dot(towards);
            let twin = scene.patches[triangle.patch.0 as usize].twin;
            let front = if along <= 0.0 { Some(triangle.patch) } else { twin };
            Hit { front, distance: hit.t, cosine: along.abs() }
        })
    }

    /// Whether nothing is on the way from a point in a unit direction, up to a distance.
    pub(in super::super) fn is_free(&self, from: Vec3, towards: Vec3, distance: f32) -> bool {
        self.triangles.is_empty() || {
            let ray = Ray::new(from.into(), towards.into(), LIFT, distance - LIFT);
            self.tree
                .ray_traverse_miss(ray, |ray, k| self.triangles[k].meets(from, towards, ray.tmin))
        }
    }
}

impl Triangle {
    fn bounds(&self) -> Aabb {
        let (b, c) = (self.a + self.ab, self.a + self.ac);
        Aabb::new(self.a.min(b).min(c).into(), self.a.max(b).max(c).into())
    }

    /// Out of its front; as long as twice its area.
    fn normal(&self) -> Vec3 {
        self.ab.cross(self.ac)
    }

    /// Distance at which a ray meets it, infinite if it does not (Moeller and Trumbore 1997).
    fn meets(&self, from: Vec3, towards: Vec3, nearest: f32) -> f32 {
        let p = towards.cross(self.ac);
        let determinant = self.ab.dot(p);
        if determinant == 0.0 {
            return f32::INFINITY;
        }
        let s = from - self.a;
        let u = s.dot(p) / determinant;
        let q = s.cross(self.ab);
        let v = towards.dot(q) / determinant;
        let t = self.ac.dot(q) / determinant;
        // A little wider than it is, so that no ray gets between neighbours.
        let inside = u >= -1e-6 && v >= -1e-6 && u + v <= 1.0 + 1e-6;
        if inside && t > nearest { t } else { f32::INFINITY }
    }
}
