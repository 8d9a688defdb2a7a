//! What a view sees as numbers instead of colours, and as the layers of an OpenEXR file.
//!
//! Must not know exposure, tone or display values.

use std::f64::consts::PI;
use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage, Layer,
    LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text, WritableImage,
};
use glam::DVec3;
use relume_core::scene::Patch;
use relume_core::scene::outside::OutsideNow;
use relume_core::session::Snapshot;

use super::assemble::{Drawing, Light, Quantity};
use super::camera::View;
use super::lit::Lit;
use super::project::Projector;
use super::raster::{Fragment, Grid, rasterise};
use super::render::Settings;
use super::shading::Shading;

/// What is seen at one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Radiance, W/m2/sr, linear RGB: mean over the pixel, sky included.
    pub radiance: [f32; 3],
    /// Share of the pixel that sees a surface.
    pub coverage: f32,
    /// Irradiance, W/m2, linear RGB: mean over what is seen of surfaces; 0 where none is.
    pub irradiance: [f32; 3],
    /// The part of it that comes straight from lamps, the sun and bright parts of the sky: where that is found apart
    /// ([`Snapshot::indirect`]), else 0.
    pub direct: [f32; 3],
    /// Diffuse reflectance, linear RGB: the same.
    pub reflectance: [f32; 3],
    /// Unit normal in the world of the surface that most of the pixel sees; 0 where none is.
    pub normal: [f32; 3],
    /// Distance of that surface along the direction that the view looks in, metres; infinite where none is.
    pub depth_m: f32,
    /// Number of its body in the scene, from 1; 0 where none is.
    pub body: u32,
}

/// What a view sees, pixel by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top left.
    pub pixels: Vec<Seen>,
    /// Names of the bodies, in the order of their numbers.
    pub bodies: Vec<String>,
    /// Whether direct light was found apart.
    pub is_told_apart: bool,
}

/// What a view sees of a snapshot, as numbers. Of the settings size, shading and samples count.
///
/// Radiance is that of [`super::render`] before exposure and tone: M/pi + rho H/pi of the same layers' irradiance and reflectance where
/// a pixel sees one surface without emission. The same bits for every number of threads.
pub fn layers(snapshot: &Snapshot, view: &View, settings: &Settings) -> Layers {
    let grid = Grid::new(settings.width, settings.height, settings.samples);
    let projector = Projector::new(view, settings.width, settings.height);
    let lit = (settings.shading == Shading::Smooth).then(|| Lit::new(snapshot));
    let light = Light::of(settings.shading, lit.as_ref());
    let draw = |quantity| Drawing::of(quantity, snapshot, (&projector, &grid), light, false);
    let (drawing, arriving) = (draw(Quantity::Radiosity), draw(Quantity::Irradiance));
    // A sun without a place was refused when the scene was made.
    let outside = snapshot.scene.outside.as_ref().and_then(|o| o.at(snapshot.time_s).ok());
    let reader = Reader { snapshot, drawing: &drawing, arriving: &arriving, outside, projector };
    let samples = f64::from(grid.samples());
    let pixels =
        rasterise(&grid, &drawing.primitives, |fragments| reader.pixel(fragments, samples));
    let bodies = snapshot.scene.bodies.iter().map(|body| body.name.clone()).collect();
    let is_told_apart = lit.is_some() && !snapshot.indirect.is_empty();
    Layers { width: settings.width, height: settings.height, pixels, bodies, is_told_apart }
}

struct Reader<'a> {
    snapshot: &'a Snapshot,
    drawing: &'a Drawing<'a>,
    arriving: &'a Drawing<'a>,
    outside: Option<OutsideNow>,
    projector: Projector,
}

impl Reader<'_> {
    fn pixel(&self, fragments: &[Fragment], samples: f64) -> Seen {
        let (mut radiance, mut irradiance, mut reflectance) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let mut direct = [0.0; 3];
        let mut on_surfaces = 0.0;
        // By how many samples.
        let mut most: Option<(u32, &Patch, f64)> = None;
        let add = |sum: &mut [f64; 3], value: [f64; 3], weight: f64| {
            (0..3).for_each(|c| sum[c] += weight * value[c]);
        };
        let (scene, world) = (&self.snapshot.scene, &self.snapshot.world);
        for fragment in fragments {
            let (weight, at) = (f64::from(fragment.samples), fragment.position);
            let Some(primitive) = fragment.primitive else {
                let sky = self.outside.as_ref().map(|o| o.radiance(self.projector.direction(at)));
                add(&mut radiance, sky.unwrap_or_default(), weight);
                continue;
            };
            let patch = &scene.patches[self.drawing.patches[primitive].0 as usize];
            let mean = world.reflectance(scene, patch);
            let leaving = self.drawing.seen(primitive, at).map(|b| f64::from(b) / PI);
            add(&mut radiance, leaving, weight);
            add(&mut irradiance, self.arriving.radiosity(primitive, at).map(f64::from), weight);
            if let Some(arriving) = self.drawing.arriving(primitive, at) {
                add(&mut direct, arriving.direct, weight);
            }
            add(&mut reflectance, self.drawing.reflectance(primitive, at, mean), weight);
            on_surfaces += weight;
            if most.is_none_or(|(samples, ..)| fragment.samples > samples) {
                most = Some((fragment.samples, patch, self.drawing.depth(primitive, at)));
            }
        }
        let share =
            |sum: [f64; 3], of: f64| sum.map(|s| if of > 0.0 { (s / of) as f32 } else { 0.0 });
        let normal = most.and_then(|(_, patch, _)| {
            world.pose(patch.body).map(|pose| pose.direction(patch.frame.normal))
        });
        Seen {
            radiance: share(radiance, samples),
            coverage: (on_surfaces / samples) as f32,
            irradiance: share(irradiance, on_surfaces),
            direct: share(direct, on_surfaces),
            reflectance: share(reflectance, on_surfaces),
            normal: normal.unwrap_or(DVec3::ZERO).as_vec3().to_array(),
            depth_m: most.map_or(f32::INFINITY, |(_, _, depth)| depth as f32),
            body: most.map_or(0, |(_, patch, _)| patch.body.0 + 1),
        }
    }
}

impl Layers {
    /// The bytes of an OpenEXR file: channels R, G, B (W/m2/sr), A (coverage), and layers `irradiance` (R, G, B), `reflectance`
    /// (R, G, B), where they were found apart `direct` and `indirect` (R, G, B, parts of the irradiance), `normal` (X, Y, Z), `depth` (Z) and `body` (id, whole numbers), 32 bits each, packed without loss. The attribute `bodies`
    /// names the bodies, one a line.
    ///
    /// # Errors
    /// What the encoder says: pictures without pixels cannot be written.
    pub fn to_exr(&self) -> Result<Vec<u8>, String> {
        let floats = |name: &str, of: &dyn Fn(&Seen) -> f32| {
            AnyChannel::new(name, FlatSamples::F32(self.pixels.iter().map(of).collect()))
        };
        let mut channels =
            vec![floats("A", &|seen| seen.coverage), floats("depth.Z", &|seen| seen.depth_m)];
        for (c, [colour, axis]) in [["R", "X"], ["G", "Y"], ["B", "Z"]].into_iter().enumerate() {
            channels.push(floats(colour, &|seen| seen.radiance[c]));
            channels.push(floats(&format!("irradiance.{colour}"), &|seen| seen.irradiance[c]));
            if self.is_told_apart {
                channels.push(floats(&format!("direct.{colour}"), &|seen| seen.direct[c]));
                let rest = |seen: &Seen| seen.irradiance[c] - seen.direct[c];
                channels.push(floats(&format!("indirect.{colour}"), &rest));
            }
            channels.push(floats(&format!("reflectance.{colour}"), &|seen| seen.reflectance[c]));
            channels.push(floats(&format!("normal.{axis}"), &|seen| seen.normal[c]));
        }
        let bodies = self.pixels.iter().map(|seen| seen.body).collect();
        channels.push(AnyChannel::new("body.id", FlatSamples::U32(bodies)));
        let encoding = Encoding {
            compression: Compression::ZIP16,
            line_order: LineOrder::Increasing,
            ..Encoding::SMALL_LOSSLESS
        };
        let software_name = Text::new_or_none(concat!("relume ", env!("CARGO_PKG_VERSION")));
        let mut attributes = LayerAttributes { software_name, ..LayerAttributes::default() };
        if let Some(names) = Text::new_or_none(latin(&self.bodies.join("\n"))) {
            attributes
                .other
                .insert("bodies".into(), exr::meta::attribute::AttributeValue::Text(names));
        }
        let size = (self.width as usize, self.height as usize);
        let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into()));
        let mut bytes = Cursor::new(Vec::new());
        let image = ExrImage::from_layer(layer);
        image.write().non_parallel().to_buffered(&mut bytes).map_err(|error| error.to_string())?;
        Ok(bytes.into_inner())
    }
}

/// Text as the format takes it: letters beyond Latin are question marks.
fn latin(text: &str) -> String {
    text.chars().map(|c| if u32::from(c) < 256 { c } else { '?' }).collect()
}

/// Whether `bytes` are an OpenEXR file that can be decoded to its last pixel.
pub fn is_whole_exr(bytes: &[u8]) -> bool {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level();
    let reader = reader.all_channels().all_layers().all_attributes().non_parallel();
    reader.from_buffered(Cursor::new(bytes)).is_ok()
}
