//! Light over the surfaces of a scene at several instants, as files that show it take it. Knows no format.

use std::sync::Arc;

use relume_core::geometry::Pose;
use relume_core::scene::{BodyId, Scene, SurfaceId};

/// Irradiance over the surfaces of a scene at several instants, on one triangulation.
#[derive(Clone, Debug)]
pub struct Lit {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The instants, seconds, ascending.
    pub times_s: Vec<f64>,
    /// The surfaces, or parts of them that reflect and emit alike, those of a surface one after the other.
    pub parts: Vec<LitPart>,
    /// Linear display value of a radiance of 1 W/m2/sr: one for all instants.
    pub exposure: f64,
}

/// A part of a surface with the light on it.
#[derive(Clone, Debug)]
pub struct LitPart {
    /// Its surface.
    pub surface: SurfaceId,
    /// Points in the frame of the body, metres.
    pub points: Vec<[f32; 3]>,
    /// Numbers of points, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Irradiance at the points, W/m2, linear RGB, by instant.
    pub irradiance: Vec<Vec<[f32; 3]>>,
    /// Exitance, W/m2, linear RGB, by instant.
    pub exitance: Vec<[f64; 3]>,
    /// Diffuse reflectance, linear RGB.
    pub reflectance: [f64; 3],
}

/// Tone curve: linear display values in [0, 1] of a radiance in display values that may be above 1.
pub type Tone<'a> = &'a dyn Fn(f64) -> f64;

impl Lit {
    /// The body that a part belongs to.
    pub fn body(&self, part: &LitPart) -> BodyId {
        self.scene.surfaces[part.surface.0 as usize].body
    }

    /// Name of a part's surface.
    pub fn name(&self, part: &LitPart) -> &str {
        &self.scene.surfaces[part.surface.0 as usize].name
    }

    /// Where a part is at an instant; `None` while it is absent.
    pub fn pose(&self, part: &LitPart, instant: usize) -> Option<Pose> {
        self.scene.pose(self.body(part), self.times_s[instant])
    }

    /// Points of all parts.
    pub fn points(&self) -> usize {
        self.parts.iter().map(|part| part.points.len()).sum()
    }

    /// The scene with the light of every `step`-th instant and of the last one alone.
    pub fn every(mut self, step: usize) -> Lit {
        let last = self.times_s.len() - 1;
        fn keep<T>(values: &mut Vec<T>, step: usize, last: usize) {
            let mut at = 0_usize;
            values.retain(|_| {
                at += 1;
                (at - 1).is_multiple_of(step) || at - 1 == last
            });
        }
        keep(&mut self.times_s, step, last);
        for part in &mut self.parts {
            keep(&mut part.irradiance, step, last);
            keep(&mut part.exitance, step, last);
        }
        self
    }

    /// Radiance over a part at an instant times the exposure: display values without a tone curve, linear RGB.
    pub fn exposed<'a>(
        &'a self,
        part: &'a LitPart,
        instant: usize,
    ) -> impl ExactSizeIterator<Item = [f64; 3]> + 'a {
        let scale = self.exposure / std::f64::consts::PI;
        part.radiosity(instant).map(move |b| b.map(|b| scale * b))
    }
}

impl LitPart {
    /// Radiosity at the points at an instant, W/m2, linear RGB: B = M + rho H.
    pub fn radiosity(&self, instant: usize) -> impl ExactSizeIterator<Item = [f64; 3]> + '_ {
        let (exitance, reflectance) = (self.exitance[instant], self.reflectance);
        self.irradiance[instant]
            .iter()
            .map(move |h| [0, 1, 2].map(|c| exitance[c] + reflectance[c] * f64::from(h[c])))
    }

    /// Whether the light that leaves it is not the same, bit for bit, at all instants.
    pub fn changes(&self) -> bool {
        let reflects = self.reflectance.map(|rho| rho > 0.0);
        let differ = |one: &[[f32; 3]], other: &[[f32; 3]]| {
            one.iter().zip(other).any(|(a, b)| (0..3).any(|c| reflects[c] && a[c] != b[c]))
        };
        self.irradiance.windows(2).any(|w| differ(&w[0], &w[1]))
            || self.exitance.windows(2).any(|w| w[0] != w[1])
    }
}
