//! What single patches reflect and emit: their material's, or what textures and vertex colours make of it.
//!
//! The one place to ask about the light of a patch. Must not know where tints come from.

use super::{Material, MaterialId, Patch, Scene, TintId};

/// Reflectance and emission of patches on which textures or vertex colours make them differ from their
/// material's: means over the patch, in linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tint {
    /// Diffuse reflectance, linear RGB, each channel in [0, 1): in place of [`Material::reflectance`].
    pub reflectance: [f64; 3],
    /// Share of the material's exitance that the patch emits, by channel, in [0, 1], at all times.
    pub emission: [f64; 3],
}

impl Scene {
    /// Diffuse reflectance of a patch, linear RGB.
    pub fn reflectance(&self, patch: &Patch) -> [f64; 3] {
        self.tint(patch).map_or(self.material(patch).reflectance, |tint| tint.reflectance)
    }

    /// Exitance of a patch at `time_s`, W/m2.
    pub fn exitance_at(&self, patch: &Patch, time_s: f64) -> [f64; 3] {
        self.emission(patch, self.material(patch).exitance_at(time_s))
    }

    /// Upper bound of the exitance of a patch over all time, W/m2.
    pub fn most_exitance(&self, patch: &Patch) -> [f64; 3] {
        self.emission(patch, self.material(patch).most_exitance())
    }

    /// Whether a patch emits at any time.
    pub fn patch_emits(&self, patch: &Patch) -> bool {
        self.most_exitance(patch).iter().any(|&m| m > 0.0)
    }

    /// Reflectance, and share of its exitance, of a material in the mean over the area of all its patches that
    /// have tints; `None` if none has.
    pub fn mean_tint(&self, material: MaterialId) -> Option<Tint> {
        let of_it = || self.patches.iter().filter(|patch| patch.material == material);
        of_it().any(|patch| patch.tint.is_some()).then(|| {
            let area_m2: f64 = of_it().map(Patch::area_m2).sum();
            let mean = |of: &dyn Fn(&Patch) -> [f64; 3]| {
                let sum = of_it().fold([0.0; 3], |sum, patch| {
                    let (value, area_m2) = (of(patch), patch.area_m2());
                    [0, 1, 2].map(|c| sum[c] + area_m2 * value[c])
                });
                sum.map(|s| s / area_m2)
            };
            Tint {
                reflectance: mean(&|patch| self.reflectance(patch)),
                emission: mean(&|patch| self.emission_share(patch)),
            }
        })
    }

    /// Share of its material's exitance that a patch emits, by channel.
    pub fn emission_share(&self, patch: &Patch) -> [f64; 3] {
        self.tint(patch).map_or([1.0; 3], |tint| tint.emission)
    }

    fn material(&self, patch: &Patch) -> &Material {
        &self.materials[patch.material.0 as usize]
    }

    fn tint(&self, patch: &Patch) -> Option<&Tint> {
        patch.tint.map(|TintId(id)| &self.tints[id as usize])
    }

    /// What of a material's exitance a patch emits.
    fn emission(&self, patch: &Patch, exitance: [f64; 3]) -> [f64; 3] {
        match self.tint(patch) {
            Some(tint) => [0, 1, 2].map(|c| exitance[c] * tint.emission[c]),
            None => exitance,
        }
    }
}
