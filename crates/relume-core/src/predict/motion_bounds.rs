//! Bounds of the bodies' motion until each of a few coming ticks.

use super::ticks::{Tick, Ticks};
use super::tuning::AHEAD;
use crate::geometry::Aabb;
use crate::scene::{BodyId, Drift, Scene};

/// Known motion of a scene, in space or in the plane (that of z = 0).
pub trait KnownMotion {
    /// Bodies are numbered below this.
    fn body_count(&self) -> usize;
    /// Whether a body is animated at all.
    fn moves(&self, body: BodyId) -> bool;
    /// Whether a body stands for light from outside: it comes between nothing.
    fn is_distant(&self, _body: BodyId) -> bool {
        false
    }
    /// Bounds of the displacement of a body's points between two times, the earlier one first.
    fn drift(&self, body: BodyId, span_s: [f64; 2]) -> Drift;
    /// Bounds of the displacement of each punctual light.
    fn light_drifts(&self, span_s: [f64; 2]) -> Vec<Drift>;
    /// The first time after `time_s` at which a body or a light appears or vanishes; infinite if none
    /// does any more.
    fn next_presence_change_s(&self, time_s: f64) -> f64;
}

impl KnownMotion for Scene {
    fn body_count(&self) -> usize {
        self.bodies.len()
    }

    fn moves(&self, body: BodyId) -> bool {
        Scene::moves(self, body)
    }

    fn is_distant(&self, body: BodyId) -> bool {
        Scene::is_distant(self, body)
    }

    fn drift(&self, body: BodyId, span_s: [f64; 2]) -> Drift {
        Scene::drift(self, body, span_s)
    }

    fn light_drifts(&self, span_s: [f64; 2]) -> Vec<Drift> {
        self.lights.iter().map(|l| self.motion.drift(l.node, 0.0, span_s)).collect()
    }

    fn next_presence_change_s(&self, time_s: f64) -> f64 {
        Scene::next_presence_change_s(self, time_s)
    }
}

/// Bounds of the bodies' motion until some coming ticks, the *horizons*, counted from the nearest. No body and no light
/// appears or vanishes before any of them.
#[derive(Clone, Debug, Default)]
pub struct MotionBounds {
    now: Tick,
    horizons: Vec<Horizon>,
    /// Row of each body; the rows are those of bodies that are animated at all.
    rows: Vec<Option<u32>>,
    bodies: Vec<BodyId>,
}

#[derive(Clone, Debug)]
struct Horizon {
    until: Tick,
    drifts: Vec<Drift>,
    lights: Vec<Drift>,
    widest: Aabb,
    widest_distant: Aabb,
}

impl MotionBounds {
    /// Bounds from `time_s` on, the present of `ticks`. Cost:
    /// proportional to the bodies and their keys within the horizons.
    pub fn new(scene: &impl KnownMotion, ticks: &Ticks, time_s: f64) -> MotionBounds {
        let all = (0..scene.body_count() as u32).map(BodyId);
        let bodies: Vec<BodyId> = all.clone().filter(|&b| scene.moves(b)).collect();
        let mut out = MotionBounds { now: ticks.now(), bodies, ..MotionBounds::default() };
        out.rows = vec![None; scene.body_count()];
        for (row, body) in out.bodies.iter().enumerate() {
            out.rows[body.0 as usize] = Some(row as u32);
        }
        let change_s = scene.next_presence_change_s(time_s);
        for ahead in AHEAD {
            let until = ticks.now() + ahead;
            let span = [time_s, ticks.time_s(until)];
            if !ticks.runs() || span[1] >= change_s {
                break;
            }
            let drifts: Vec<Drift> = out.bodies.iter().map(|&b| scene.drift(b, span)).collect();
            let lights = scene.light_drifts(span);
            let widest_of = |distant: bool| {
                let all = out.bodies.iter().zip(&drifts);
                let wanted = all.filter(|(body, _)| scene.is_distant(**body) == distant);
                wanted.fold(Drift::Rests.reach(), |b, (_, d)| b.union(d.reach()))
            };
            let (widest, widest_distant) = (widest_of(false), widest_of(true));
            out.horizons.push(Horizon { until, drifts, lights, widest, widest_distant });
        }
        out
    }

    /// Whether a certificate that expires after `until` stands now.
    #[inline]
    pub fn holds(&self, until: Tick) -> bool {
        until >= self.now
    }

    /// The horizons, from the nearest.
    pub fn horizons(&self) -> std::ops::Range<usize> {
        0..self.horizons.len()
    }

    /// The tick of a horizon.
    pub fn until(&self, horizon: usize) -> Tick {
        self.horizons[horizon].until
    }

    /// Bounds of a body's displacement.
    #[inline]
    pub fn drift(&self, horizon: usize, body: BodyId) -> Drift {
        match self.rows[body.0 as usize] {
            Some(row) => self.horizons[horizon].drifts[row as usize],
            None => Drift::Rests,
        }
    }

    /// Whether a punctual light stays as it is.
    pub fn light_rests(&self, horizon: usize, light: usize) -> bool {
        self.horizons[horizon].lights[light] == Drift::Rests
    }

    /// Displacements of all bodies together, of those that are distant aside.
    pub fn widest(&self, horizon: usize) -> Aabb {
        self.horizons[horizon].widest
    }

    /// Displacements of all distant bodies together.
    pub fn widest_distant(&self, horizon: usize) -> Aabb {
        self.horizons[horizon].widest_distant
    }

    /// The bodies that do not rest up to a horizon.
    pub fn movers(&self, horizon: usize) -> impl Iterator<Item = BodyId> + '_ {
        let drifts = &self.horizons[horizon].drifts;
        self.bodies.iter().zip(drifts).filter(|(_, d)| **d != Drift::Rests).map(|(b, _)| *b)
    }
}
