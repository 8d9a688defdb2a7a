//! Images multiplied back onto patches whose light was found with their means.
//!
//! Must not know how light was found. Radiosity without emission is what arrives times the mean reflectance; what is seen
//! at a place is the same times its own reflectance, and its own emission.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use relume_core::scene::{Frame, PatchId, Print, Printed};
use relume_core::session::Snapshot;

use super::project::SeenPlane;

/// A patch with an image, as it is seen.
#[derive(Debug)]
pub(super) struct Shown {
    print: Arc<Print>,
    plane: SeenPlane,
    frame: Frame,
    /// Means of the patch, as it was solved.
    reflectance: [f64; 3],
    exitance: [f64; 3],
    /// Exitance where the image of the emission is white.
    exitance_of_white: [f64; 3],
}

/// Mean reflectances below this tell nothing of the light that arrives.
const BLACK: f64 = 1e-6;

impl Shown {
    /// `None` for a patch that looks the same everywhere.
    pub(super) fn new(snapshot: &Snapshot, id: PatchId, plane: SeenPlane) -> Option<Shown> {
        let (scene, now) = (&snapshot.scene, &snapshot.world);
        let patch = &scene.patches[id.0 as usize];
        if now.reflectance(scene, patch) != scene.reflectance(patch) {
            // A reflectance by hand is in place of the texture.
            return None;
        }
        Some(Shown {
            print: patch.print.clone()?,
            plane,
            frame: patch.frame,
            reflectance: scene.reflectance(patch),
            exitance: now.exitance(scene, patch),
            exitance_of_white: now.material_exitance(patch.material),
        })
    }

    /// Diffuse reflectance at a pixel, linear RGB.
    pub(super) fn reflectance_at(&self, pixel: DVec2) -> [f64; 3] {
        self.at(pixel).reflectance.map(|rho| rho.min(1.0))
    }

    /// The images where a pixel sees them.
    fn at(&self, pixel: DVec2) -> Printed {
        let at = self.plane.unproject(pixel);
        let side = |step: DVec2| -> DVec3 {
            let d = self.plane.unproject(pixel + step) - at;
            self.frame.u * d.x + self.frame.v * d.y
        };
        self.print.at(self.frame.point(at), [side(DVec2::X), side(DVec2::Y)])
    }

    /// What is seen at a pixel, W/m2, where the patch as it was solved has this radiosity.
    pub(super) fn radiosity(&self, pixel: DVec2, solved: [f32; 3]) -> [f32; 3] {
        let seen = self.at(pixel);
        [0, 1, 2].map(|c| {
            let reflected = (f64::from(solved[c]) - self.exitance[c]).max(0.0);
            let share = match self.reflectance[c] > BLACK {
                true => seen.reflectance[c].min(1.0) / self.reflectance[c],
                false => 1.0,
            };
            (self.exitance_of_white[c] * seen.emission[c] + reflected * share) as f32
        })
    }
}
