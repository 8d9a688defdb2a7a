//! A snapshot and a view to a picture.
//!
//! Must not know files. The bits depend on the arguments only, not on the number of threads.

use std::f64::consts::PI;

use glam::DVec2;
use relume_core::scene::outside::OutsideNow;
use relume_core::session::Snapshot;

use super::assemble::{Drawing, Fill, Light};
use super::camera::View;
use super::exposure::Exposure;
use super::image::Image;
use super::lit::Lit;
use super::project::Projector;
use super::raster::{Fragment, Grid, rasterise};
use super::shading::Shading;
use super::tone::{SrgbEncoder, Tone};

/// How a picture is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// How radiosity varies over a leaf.
    pub shading: Shading,
    /// How bright.
    pub exposure: Exposure,
    /// How the bright end is treated.
    pub tone: Tone,
    /// Visibility samples per pixel, 1 to 64.
    pub samples: u32,
    /// Linear display value, in [0, 1], where nothing is seen, not even a sky.
    pub background: [f64; 3],
    /// Whether the outlines of the leaves are drawn over them.
    pub mesh: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            width: 640,
            height: 480,
            shading: Shading::default(),
            exposure: Exposure::default(),
            tone: Tone::default(),
            samples: 16,
            background: [0.0; 3],
            mesh: false,
        }
    }
}

/// Draws what a view sees of a snapshot.
///
/// Patches are one-sided: they hide what lies behind them only when their front faces the camera,
/// so that one can look into a closed room from outside. (In the solution they block light on both
/// sides.) Samples of one pixel that see different things are mixed after the tone curve, so
/// that the edge of a lamp is as smooth as any.
///
/// Deterministic: the same bits for every number of threads.
pub fn render(snapshot: &Snapshot, view: &View, settings: &Settings) -> Image {
    let grid = Grid::new(settings.width, settings.height, settings.samples);
    let projector = Projector::new(view, settings.width, settings.height);
    let lit = (settings.shading == Shading::Smooth).then(|| Lit::new(snapshot));
    let light = Light::of(settings.shading, lit.as_ref());
    let drawing = Drawing::new(snapshot, &projector, &grid, light, settings.mesh);
    // A sun without a place was refused when the scene was made.
    let outside = snapshot.scene.outside.as_ref().and_then(|o| o.at(snapshot.time_s).ok());
    let shader = Shader {
        drawing: &drawing,
        outside: outside.map(|outside| (outside, projector)),
        exposure: settings.exposure.resolve(snapshot, view),
        tone: settings.tone,
        background: settings.background,
        samples: f64::from(grid.samples()),
        encoder: SrgbEncoder::new(),
    };
    let pixels = rasterise(&grid, &drawing.primitives, |fragments| shader.pixel(fragments));
    Image { width: settings.width, height: settings.height, pixels }
}

struct Shader<'a> {
    drawing: &'a Drawing<'a>,
    /// What is seen where no surface is.
    outside: Option<(OutsideNow, Projector)>,
    exposure: f64,
    tone: Tone,
    background: [f64; 3],
    samples: f64,
    encoder: SrgbEncoder,
}

impl Shader<'_> {
    fn pixel(&self, fragments: &[Fragment]) -> [u8; 3] {
        let mut sum = [0.0; 3];
        let mut merged = Vec::new();
        let fragments = match fragments.len() {
            1 => fragments,
            _ => {
                self.drawing.merged(fragments, &mut merged);
                &merged
            }
        };
        for fragment in fragments {
            let display = self.display(fragment);
            (0..3).for_each(|c| sum[c] += display[c] * f64::from(fragment.samples));
        }
        sum.map(|s| self.encoder.encode(s / self.samples))
    }

    /// Linear display values.
    fn display(&self, fragment: &Fragment) -> [f64; 3] {
        let Some(primitive) = fragment.primitive else {
            let Some((outside, projector)) = &self.outside else { return self.background };
            let radiance = outside.radiance(projector.direction(fragment.position));
            return self.tone.map(self.exposure, radiance.map(|l| (PI * l) as f32));
        };
        let radiosity = self.drawing.seen(primitive, fragment.position);
        let display = self.tone.map(self.exposure, radiosity);
        if let (Fill::Lit(_), true) = (&self.drawing.fills[primitive], fragment.samples > 1) {
            return self.closer(primitive, fragment, display);
        }
        match self.drawing.fills[primitive] {
            Fill::Outline(_) => contrast(display),
            Fill::Constant(_) | Fill::Linear(_) | Fill::Lit(_) => display,
        }
    }
}

impl Shader<'_> {
    /// Display values of a part of a pixel over which the edge of a shadow may go: where two places in it differ, the mean over more.
    fn closer(&self, primitive: usize, fragment: &Fragment, first: [f64; 3]) -> [f64; 3] {
        if !self.drawing.is_shaded(primitive) {
            return first;
        }
        // What is seen of the pixel may be less of it.
        let size = (f64::from(fragment.samples) / self.samples).sqrt();
        let at = |offset: DVec2| {
            let seen = self.drawing.seen(primitive, fragment.position + offset * size);
            self.tone.map(self.exposure, seen)
        };
        let beside = at(DVec2::new(0.35, 0.3));
        let differs = |c: usize| (beside[c] - first[c]).abs() > EDGE;
        if !(0..3).any(differs) {
            return first;
        }
        let mut sum = [0.0; 3];
        for k in 0..CLOSER {
            let y = f64::from((k as u8).reverse_bits()) / 256.0 + 0.5 / f64::from(CLOSER) - 0.5;
            let display = at(DVec2::new((f64::from(k) + 0.5) / f64::from(CLOSER) - 0.5, y));
            (0..3).for_each(|c| sum[c] += display[c] / f64::from(CLOSER));
        }
        sum
    }
}

/// Difference of display values within a pixel that is looked into.
const EDGE: f64 = 0.01;

/// Places within such a pixel.
const CLOSER: u32 = 8;

/// A colour that is seen on the given one: darker on bright, brighter on dark.
fn contrast(display: [f64; 3]) -> [f64; 3] {
    let brightest = display.into_iter().fold(0.0, f64::max);
    if brightest > 0.05 { display.map(|d| d * 0.4) } else { display.map(|d| d + 0.05) }
}
