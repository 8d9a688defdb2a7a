//! What is known beforehand of how bodies move: the clip's tracks, but for what is held by hand.

use crate::predict::KnownMotion;
use crate::scene::{BodyId, Drift, Held, LightId, Scene};

/// The motion of a clip in which some bodies are held where they are.
///
/// Who takes hold of a body, moves it or lets it go breaks the promise: what was certified by it is void.
pub(super) struct Promise<'a> {
    pub(super) scene: &'a Scene,
    pub(super) held: &'a Held,
}

impl KnownMotion for Promise<'_> {
    fn body_count(&self) -> usize {
        self.scene.bodies.len()
    }

    fn moves(&self, body: BodyId) -> bool {
        !self.held.poses.contains_key(&body) && self.scene.moves(body)
    }

    fn is_distant(&self, body: BodyId) -> bool {
        self.scene.is_distant(body)
    }

    fn drift(&self, body: BodyId, span_s: [f64; 2]) -> Drift {
        if self.moves(body) { self.scene.drift(body, span_s) } else { Drift::Rests }
    }

    fn light_drifts(&self, span_s: [f64; 2]) -> Vec<Drift> {
        let motion = &self.scene.motion;
        let of = |k: u32| {
            let node = self.scene.lights[k as usize].node;
            let carrier = self.scene.carrier(LightId(k));
            let held = carrier.filter(|body| self.held.poses.contains_key(body));
            // Of a light that moves on the body only that it does is known, which is enough.
            let rides = |body: BodyId| {
                motion.anchor(node) == motion.anchor(self.scene.bodies[body.0 as usize].node)
            };
            if held.is_some_and(rides) { Drift::Rests } else { motion.drift(node, 0.0, span_s) }
        };
        (0..self.scene.lights.len() as u32).map(of).collect()
    }

    fn next_presence_change_s(&self, time_s: f64) -> f64 {
        self.scene.next_presence_change_s(time_s)
    }
}
