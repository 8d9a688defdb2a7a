//! What a view sees of a solution as numbers to be coloured, and its elements and bodies.
//!
//! Must not know colour maps' colours, legends or files.

use relume_core::session::Snapshot;

use super::assemble::{Drawing, Fill, Light};
use super::camera::View;
use super::image::Image;
use super::layers::{Layers, Seen, layers};
use super::maps::Numbers;
use super::project::Projector;
use super::raster::{Fragment, Grid, rasterise};
use super::render::Settings;

/// Share of a pixel that is to see a surface for the pixel to have a number.
const COVERED: f32 = 0.5;

/// Numbers of layers: of each pixel of which at least half sees surfaces.
pub fn numbers_of(layers: &Layers, of: impl Fn(&Seen) -> f32) -> Numbers {
    let value = |seen: &Seen| (seen.coverage >= COVERED).then(|| of(seen));
    Numbers {
        width: layers.width,
        height: layers.height,
        values: layers.pixels.iter().map(value).collect(),
    }
}

/// Numbers of the leaves, in the order of [`Snapshot::leaves`], where a view sees them: at each pixel that of the leaf that most of it
/// sees.
///
/// # Panics
/// If there are not as many numbers as leaves.
pub fn numbers_of_leaves(
    snapshot: &Snapshot,
    view: &View,
    settings: &Settings,
    numbers: &[f32],
) -> Numbers {
    assert_eq!(numbers.len(), snapshot.leaves.len(), "a number for each leaf");
    let mut carrier = snapshot.clone();
    for (leaf, &number) in carrier.leaves.iter_mut().zip(numbers) {
        leaf.radiosity = [number; 3];
    }
    let (grid, projector) = grid_of(view, settings);
    let drawing = Drawing::new(&carrier, &projector, &grid, Light::Flat, false);
    let values = rasterise(&grid, &drawing.primitives, |fragments| {
        // Of equals the first.
        let most = fragments.iter().rev().max_by_key(|fragment| fragment.samples)?;
        Some(drawing.radiosity(most.primitive?, most.position)[0])
    });
    Numbers { width: settings.width, height: settings.height, values }
}

/// The outlines of the elements that a view sees, black on white.
pub fn mesh(snapshot: &Snapshot, view: &View, settings: &Settings) -> Image {
    let (grid, projector) = grid_of(view, settings);
    let drawing = Drawing::new(snapshot, &projector, &grid, Light::Flat, true);
    let samples = f64::from(grid.samples());
    let ink = |fragment: &Fragment| match fragment.primitive.map(|k| drawing.fills[k]) {
        Some(Fill::Outline(_)) => 0.0,
        Some(_) => 1.0,
        None => 0.85,
    };
    let pixels = rasterise(&grid, &drawing.primitives, |fragments| {
        let sum: f64 = fragments.iter().map(|f| ink(f) * f64::from(f.samples)).sum();
        [(255.0 * sum / samples).round() as u8; 3]
    });
    Image { width: settings.width, height: settings.height, pixels }
}

/// The bodies that a view sees, each in a colour of its own, lighter where they face the view.
pub fn bodies(snapshot: &Snapshot, view: &View, settings: &Settings) -> Image {
    let layers =
        layers(snapshot, view, &Settings { shading: super::Shading::Flat, ..settings.clone() });
    let back = view.world_from_camera.rotation.z_axis;
    let colour = |seen: &Seen| {
        if seen.body == 0 || seen.coverage < COVERED {
            return [217; 3];
        }
        let facing = glam::DVec3::from_array(seen.normal.map(f64::from)).dot(back).clamp(0.0, 1.0);
        colour_of_body(seen.body).map(|c| (f64::from(c) * (0.55 + 0.45 * facing)).round() as u8)
    };
    let pixels = layers.pixels.iter().map(colour).collect();
    Image { width: settings.width, height: settings.height, pixels }
}

/// The colour of a body by its number, from 1: sRGB, neighbours far apart.
pub fn colour_of_body(number: u32) -> [u8; 3] {
    // Hues by the golden section.
    let hue = (f64::from(number) * 0.618_033_988_749_895).fract() * 6.0;
    let light = [0.95, 0.75][number as usize % 2];
    [5.0, 3.0, 1.0].map(|offset: f64| {
        let k = (offset + hue) % 6.0;
        let dip = k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * light * (1.0 - 0.6 * dip)).round() as u8
    })
}

fn grid_of(view: &View, settings: &Settings) -> (Grid, Projector) {
    let grid = Grid::new(settings.width, settings.height, settings.samples);
    (grid, Projector::new(view, settings.width, settings.height))
}
