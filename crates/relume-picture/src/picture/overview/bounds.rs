//! Box of a scene over its animation.
//!
//! Must not know what looks at it.

use glam::DVec3;
use relume_core::scene::{BodyId, Patch, Scene};

use super::super::tuning::{DWARFED, SLAB};

/// Width : height that candidates are framed for.
pub(super) const ASPECT: f64 = 4.0 / 3.0;

/// Instants at which the swept bounds are taken.
const SWEEP_STEPS: u32 = 64;

/// Distance from a plane below which something is in it, over the diagonal of the scene.
const IN_PLANE: f64 = 1e-6;

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Bounds {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Bounds {
    /// Of everything, over the whole animation; `None` if there is nothing.
    pub(in super::super) fn swept(scene: &Scene) -> Option<Bounds> {
        Bounds::of(scene, |_| true)
    }

    /// Of what a scene is about: without the ground, where that is a plane or a slab beside which all else is small.
    pub(super) fn focused(self, scene: &Scene) -> Bounds {
        let largest = scene.patches.iter().max_by(|a, b| a.area_m2().total_cmp(&b.area_m2()));
        // Where it moves it is no ground.
        let Some(ground) = largest.filter(|patch| !scene.moves(patch.body)) else { return self };
        let Some(pose) = scene.pose(ground.body, 0.0) else { return self };
        let (at, normal) = (pose.point(ground.frame.origin), pose.direction(ground.frame.normal));
        let is_within = |patch: &Patch, thickness: f64| {
            let Some(pose) = scene.pose(patch.body, 0.0) else { return false };
            let off = |p: DVec3| (pose.point(p) - at).dot(normal).abs();
            patch.corners_in_body().all(|p| off(p) < thickness * self.unit().1)
        };
        let in_plane = |patch: &Patch| !scene.moves(patch.body) && is_within(patch, IN_PLANE);
        let is_slab = scene.patches_of(ground.body).all(|(_, patch)| is_within(patch, SLAB));
        let of_slab = |patch: &Patch| is_slab && patch.body == ground.body;
        let rest = Bounds::of(scene, |patch| !in_plane(patch) && !of_slab(patch));
        let dwarfed = |rest: &Bounds| rest.unit().1 * DWARFED < self.unit().1;
        rest.filter(dwarfed).unwrap_or(self)
    }

    /// Whether a place (world, metres) is within, or nearer than half of the diagonal to what is.
    pub(super) fn is_near(&self, place: DVec3) -> bool {
        let off = (place - place.clamp(self.low, self.high)).length();
        off <= 0.5 * self.unit().1
    }

    fn of(scene: &Scene, counts: impl Fn(&Patch) -> bool) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        for body in (0..scene.bodies.len() as u32).map(BodyId) {
            let patches: Vec<&Patch> = scene
                .patches_of(body)
                .map(|(_, patch)| patch)
                .filter(|patch| counts(patch))
                .collect();
            let steps = if scene.moves(body) { SWEEP_STEPS } else { 0 };
            for step in 0..=steps {
                let time = scene.motion.duration_s * f64::from(step) / f64::from(steps.max(1));
                let Some(pose) = scene.pose(body, time) else { continue };
                for p in patches.iter().flat_map(|patch| patch.corners_in_body()) {
                    let p = pose.point(p);
                    let b = bounds.unwrap_or(Bounds { low: p, high: p });
                    bounds = Some(Bounds { low: b.low.min(p), high: b.high.max(p) });
                }
            }
        }
        bounds
    }

    /// Middle and diagonal, metres.
    pub(in super::super) fn unit(&self) -> (DVec3, f64) {
        (self.at(0.5, 0.5, 0.5), self.low.distance(self.high).max(f64::MIN_POSITIVE))
    }

    /// The point at the given shares of the three sides.
    pub(super) fn at(&self, x: f64, y: f64, z: f64) -> DVec3 {
        self.low + (self.high - self.low) * DVec3::new(x, y, z)
    }

    pub(super) fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        let side = |i: u32, bit: u32| f64::from(i >> bit & 1);
        (0..8).map(move |i| self.at(side(i, 0), side(i, 1), side(i, 2)))
    }
}
