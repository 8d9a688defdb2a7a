//! Box of a scene over its animation.
//!
//! Must not know what looks at it.

use glam::DVec3;
use relume_core::scene::{BodyId, Scene};

/// Width : height that candidates are framed for.
pub(super) const ASPECT: f64 = 4.0 / 3.0;

/// Instants at which the swept bounds are taken.
const SWEEP_STEPS: u32 = 64;

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Bounds {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Bounds {
    /// Of everything, over the whole animation; `None` if there is nothing.
    pub(in super::super) fn swept(scene: &Scene) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        for body in (0..scene.bodies.len() as u32).map(BodyId) {
            let steps = if scene.moves(body) { SWEEP_STEPS } else { 0 };
            for step in 0..=steps {
                let time = scene.motion.duration_s * f64::from(step) / f64::from(steps.max(1));
                let Some(pose) = scene.pose(body, time) else { continue };
                for p in scene.patches_of(body).flat_map(|(_, patch)| patch.corners_in_body()) {
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
