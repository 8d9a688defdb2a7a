//! One exposure for a clip, from its first frame.
//!
//! Must not know display values or bytes.

use std::f64::consts::PI;

use relume::scene::PatchId;
use relume::session::Snapshot;

use super::assemble::Drawing;
use super::camera::View;
use super::project::Projector;
use super::raster::{Grid, rasterise};
use super::render::Shading;
use super::tone::luminance;

/// How bright pictures are.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Exposure {
    /// [`Exposure::automatic`] of each picture by itself. A clip would flicker: fix it first.
    #[default]
    Automatic,
    /// Linear display value per radiance, 1/(W/m2/sr).
    Fixed(f64),
}

/// Display value of the log-average luminance.
const MIDDLE: f64 = 0.2;

/// Display value that all but the brightest 2 % stay below.
const BRIGHT: f64 = 0.9;

impl Exposure {
    /// The exposure that suits what is seen of a snapshot: [`Exposure::Fixed`] for the whole clip.
    ///
    /// The log-average luminance of the visible surfaces that do not emit becomes a middle grey
    /// (0.2), or less where more than 2 % of them would exceed 0.9. Lamps do not count, unless
    /// nothing else is lit; then the brightest becomes 0.9. Deterministic.
    pub fn automatic(snapshot: &Snapshot, view: &View) -> Exposure {
        let mut lit = Vec::new();
        let mut lamp_max = 0.0_f64;
        for (luminance, emits) in visible_radiances(snapshot, view) {
            if emits {
                lamp_max = lamp_max.max(luminance);
            } else if luminance > 0.0 {
                lit.push(luminance);
            }
        }
        lit.sort_by(f64::total_cmp);
        let Some(&bright) = lit.get((lit.len() * 98 / 100).min(lit.len().saturating_sub(1))) else {
            return Exposure::Fixed(if lamp_max > 0.0 { BRIGHT / lamp_max } else { 1.0 });
        };
        let log_mean = lit.iter().map(|&l| libm::log(l)).sum::<f64>() / lit.len() as f64;
        Exposure::Fixed((MIDDLE / libm::exp(log_mean)).min(BRIGHT / bright))
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

/// Luminance of the radiance (W/m2/sr) at the pixels of a small picture, and whether it is a lamp.
fn visible_radiances(snapshot: &Snapshot, view: &View) -> Vec<(f64, bool)> {
    let aspect = view.aspect().filter(|a| a.is_normal()).unwrap_or(4.0 / 3.0).clamp(0.25, 4.0);
    let (width, height) = ((120.0 * aspect) as u32, 120);
    let grid = Grid::new(width, height, 1);
    let projector = Projector::new(view, width, height);
    let drawing = Drawing::new(snapshot, &projector, &grid, Shading::Flat, false);
    let emits = |patch: PatchId| {
        let scene = &snapshot.scene;
        let now = scene.exitance_at(&scene.patches[patch.0 as usize], snapshot.time_s);
        now.iter().any(|&m| m > 0.0)
    };
    let pixels = rasterise(&grid, &drawing.primitives, |fragments| {
        fragments[0].primitive.map(|p| {
            let radiance = luminance(drawing.radiosity(p, fragments[0].position)) / PI;
            (radiance, emits(drawing.patches[p]))
        })
    });
    pixels.into_iter().flatten().collect()
}
