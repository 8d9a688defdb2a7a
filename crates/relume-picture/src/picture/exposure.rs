//! One exposure for a clip, from its first frame.
//!
//! Must not know display values or bytes.

use std::f64::consts::PI;

use relume_core::scene::PatchId;
use relume_core::session::Snapshot;

use super::assemble::{Drawing, Light};
use super::camera::View;
use super::project::Projector;
use super::raster::{Grid, rasterise};
use super::tone::luminance;
use super::tuning::{BRIGHT, MIDDLE, UNTOLD};

/// How bright pictures are.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Exposure {
    /// [`Exposure::automatic`] of each picture by itself. A clip would flicker: fix it first.
    #[default]
    Automatic,
    /// Linear display value per radiance, 1/(W/m2/sr).
    Fixed(f64),
}

/// An exposure, and how much there is to see with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metered {
    /// [`Exposure::Fixed`].
    pub exposure: Exposure,
    /// Share of the picture that shows more light than the solution may be off by, lamps included.
    pub lit: f64,
}

impl Exposure {
    /// The exposure that suits what is seen of a snapshot: [`Exposure::Fixed`] for the whole clip.
    ///
    /// The log-average luminance of the visible surfaces that do not emit becomes a middle grey
    /// (0.2), or less where more than 2 % of them would exceed 0.9. Lamps do not count, unless
    /// nothing else is lit; then the brightest becomes 0.9. What is darker than [`Snapshot::error_w_m2`] counts as
    /// that, and it never shows as more than 0.1: a dark view stays dark. Deterministic.
    pub fn automatic(snapshot: &Snapshot, view: &View) -> Exposure {
        Exposure::metered(snapshot, view).exposure
    }

    /// The same, with how much is lit.
    pub fn metered(snapshot: &Snapshot, view: &View) -> Metered {
        let untold = snapshot.error_w_m2 / PI;
        Metered::of(visible_radiances(snapshot, view).into_iter(), untold)
    }

    /// Display value per W/m2/sr for this picture.
    pub(crate) fn resolve(self, snapshot: &Snapshot, view: &View) -> f64 {
        match self {
            Exposure::Fixed(exposure) => exposure,
            Exposure::Automatic => match Exposure::automatic(snapshot, view) {
                Exposure::Fixed(exposure) => exposure,
                Exposure::Automatic => 1.0,
            },
        }
    }
}

impl Metered {
    /// From the luminances of the pixels (radiance, W/m2/sr), each with whether it is a lamp's, `None` where no surface is
    /// seen; `untold` is by how much the solution may be off.
    pub(super) fn of(seen: impl Iterator<Item = Option<(f64, bool)>>, untold: f64) -> Metered {
        let mut lit = Vec::new();
        let (mut lamps, mut lamp_max, mut told, mut pixels) = (0, 0.0_f64, 0, 0);
        for seen in seen {
            pixels += 1;
            match seen {
                Some((luminance, true)) => {
                    lamps += 1;
                    lamp_max = lamp_max.max(luminance);
                }
                Some((luminance, false)) if luminance > 0.0 => {
                    told += u32::from(luminance > untold);
                    lit.push(luminance.max(untold));
                }
                _ => {}
            }
        }
        lit.sort_by(f64::total_cmp);
        let most = if untold > 0.0 { UNTOLD / untold } else { f64::INFINITY };
        let scale = match lit.get((lit.len() * 98 / 100).min(lit.len().saturating_sub(1))) {
            Some(&bright) => {
                let log_mean = lit.iter().map(|&l| libm::log(l)).sum::<f64>() / lit.len() as f64;
                (MIDDLE / libm::exp(log_mean)).min(BRIGHT / bright).min(most)
            }
            None if lamp_max > 0.0 => BRIGHT / lamp_max,
            None if most.is_finite() => most,
            None => 1.0,
        };
        let lit = f64::from(told + lamps) / f64::from(pixels.max(1));
        Metered { exposure: Exposure::Fixed(scale), lit }
    }
}

/// Luminance of the radiance (W/m2/sr) at the pixels of a small picture, and whether it is a lamp;
/// `None` where nothing is seen.
fn visible_radiances(snapshot: &Snapshot, view: &View) -> Vec<Option<(f64, bool)>> {
    let aspect = view.aspect().filter(|a| a.is_normal()).unwrap_or(4.0 / 3.0).clamp(0.25, 4.0);
    let (width, height) = ((120.0 * aspect) as u32, 120);
    let grid = Grid::new(width, height, 1);
    let projector = Projector::new(view, width, height);
    let drawing = Drawing::new(snapshot, &projector, &grid, Light::Flat, false);
    let emits = |patch: PatchId| {
        let scene = &snapshot.scene;
        let now = snapshot.world.exitance(scene, &scene.patches[patch.0 as usize]);
        now.iter().any(|&m| m > 0.0)
    };
    rasterise(&grid, &drawing.primitives, |fragments| {
        fragments[0].primitive.map(|p| {
            let radiance = luminance(drawing.radiosity(p, fragments[0].position)) / PI;
            (radiance, emits(drawing.patches[p]))
        })
    })
}
