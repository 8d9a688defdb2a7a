//! What single patches reflect and emit: their material's, or what textures and vertex colours make of it.
//!
//! The one place to ask about the light of a patch. Must not know where tints come from.

use super::tuning::LAMP_LEAST;
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

/// Which patches emit light; by patch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Glowing {
    /// Whether it emits at any time.
    pub at_all: Vec<bool>,
    /// Whether it is a lamp: at some time it emits far more than surfaces do on average.
    pub as_lamp: Vec<bool>,
}

impl Scene {
    /// Which patches emit light at any time, with exitances in hand, W/m2, beside those of the scene. Patches are lamps from
    /// `LAMP_LEAST` times the mean exitance of what the scene was made of, at the most of all time: where everything glows nothing lights
    /// its neighbours more than the rest does. Cost: proportional to the patches.
    pub(crate) fn glowing(&self, by_hand: &dyn Fn(&Patch) -> [f64; 3]) -> Glowing {
        let sum = |exitance: [f64; 3]| exitance.iter().sum::<f64>();
        let made = self.patches.iter().filter(|patch| self.is_made(patch));
        let flux_w: f64 = made.map(|p| sum(self.most_exitance(p)) * p.area_m2()).sum();
        let least = LAMP_LEAST * flux_w / self.made_area_m2().max(f64::MIN_POSITIVE);
        let most = |p: &Patch| sum(self.most_exitance(p)).max(sum(by_hand(p)));
        let most: Vec<f64> = self.patches.iter().map(most).collect();
        Glowing {
            at_all: most.iter().map(|&m| m > 0.0).collect(),
            as_lamp: most.iter().map(|&m| m > 0.0 && m >= least).collect(),
        }
    }

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

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::scene::{MaterialId, SceneBuilder};

    /// Which of a large square and a small one of a hundredth of its area glow, and which are lamps, if they emit that much.
    fn glowing(large: f64, small: f64, by_hand: [f64; 2]) -> Glowing {
        let mut b = SceneBuilder::new("squares");
        let node = b.node("node", None, DVec3::ZERO, DQuat::IDENTITY);
        for (name, size, exitance) in [("large", 1.0, large), ("small", 0.1, small)] {
            let material = b.material(name, [0.5; 3], [exitance; 3]);
            let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
            let corners = corners.map(|(x, y)| DVec3::new(size * x, size * y, size));
            b.polygon(node, name, material, &corners);
        }
        let scene = b.build().expect("a whole scene");
        let first = scene.patches[0].material;
        let in_hand = |m: MaterialId| by_hand[usize::from(m != first)];
        scene.glowing(&|patch| [in_hand(patch.material); 3])
    }

    #[test]
    fn lamps_outshine_the_mean_of_all_surfaces() {
        let lamps = |large, small, by_hand| glowing(large, small, by_hand).as_lamp;
        assert_eq!(lamps(0.0, 1.0, [0.0; 2]), [false, true]);
        assert_eq!(lamps(1.0, 3.0, [0.0; 2]), [false, false], "all of it glows");
        assert_eq!(lamps(1.0, 5.0, [0.0; 2]), [false, true]);
        // Hands change themselves alone.
        assert_eq!(lamps(0.0, 1.0, [1e3, 0.0]), [true, true]);
        assert_eq!(lamps(0.0, 0.0, [0.0, 1.0]), [false, true]);
        assert_eq!(glowing(1.0, 3.0, [0.0; 2]).at_all, [true, true]);
    }
}
