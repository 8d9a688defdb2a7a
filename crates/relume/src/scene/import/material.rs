//! Materials: reflectance and exitance, with the mean of a texture where there is one.
//!
//! Diffuse only: `baseColorFactor` is taken for the reflectance whatever the metallic factor says,
//! and layers (specular, clearcoat, sheen and so on) are ignored quietly.

use std::f64::consts::PI;
use std::io::Cursor;

use super::animation::GlowKeys;
use super::document::Document;
use super::json;
use super::note;
use crate::scene::{Material, Note, SceneError, Severity};

/// The largest reflectance that is taken from a file. With 1 light would never be absorbed and the
/// balance has no solution; no real paint reaches 0.98.
pub(super) const REFLECTANCE_MAX: f64 = 0.98;

/// Bytes of the largest image file that is read.
const IMAGE_MAX: usize = 1 << 28;

/// All materials of the file, and one more behind them for primitives without one.
pub(super) fn materials(
    document: &Document,
    keys: &[GlowKeys],
    notes: &mut Vec<Note>,
) -> Result<Vec<Material>, SceneError> {
    let mut means = Means { document, of_image: vec![None; document.root.images.len()] };
    let read = |(i, m): (usize, &json::Material)| {
        let name =
            m.name.clone().filter(|n| !n.is_empty()).unwrap_or_else(|| format!("material {i}"));
        one(m, &keys[i], name, &mut means, notes)
    };
    let mut materials: Vec<Material> =
        document.root.materials.iter().enumerate().map(read).collect::<Result<_, _>>()?;
    materials.push(Material {
        name: "no material".into(),
        reflectance: [REFLECTANCE_MAX; 3],
        exitance: [0.0; 3],
        glow: None,
        double_sided: false,
    });
    Ok(materials)
}

fn one(
    material: &json::Material,
    keys: &GlowKeys,
    name: String,
    means: &mut Means,
    notes: &mut Vec<Note>,
) -> Result<Material, SceneError> {
    let (mut reflectance, texture) = base_colour(material);
    if let Some(texture) = texture {
        let mean = means.of(texture, &name, "base colour", notes)?;
        reflectance = product(reflectance, mean);
    }
    let strength = material
        .extensions
        .emissive_strength
        .as_ref()
        .and_then(|e| e.emissive_strength)
        .unwrap_or(1.0);
    let factor = material.emissive_factor.unwrap_or_default();
    let mut besides = [PI; 3];
    let glows = keys.colour.is_some() || factor != [0.0; 3];
    if let (Some(texture), true) = (material.emissive_texture, glows) {
        besides = product(besides, means.of(texture, &name, "emission", notes)?);
    }
    let radiance = factor.map(|c| c * strength);
    note_what_is_ignored(material, &name, notes);
    let reflectance = clamped(reflectance, &name, notes);
    Ok(Material {
        name,
        reflectance,
        exitance: product(radiance, besides),
        glow: keys.glow((factor, strength), besides),
        double_sided: material.double_sided,
    })
}

/// The factor and the texture of the diffuse colour.
fn base_colour(material: &json::Material) -> ([f64; 3], Option<json::TextureRef>) {
    let (factor, texture) =
        match (&material.pbr_metallic_roughness, &material.extensions.specular_glossiness) {
            (_, Some(s)) => (s.diffuse_factor, s.diffuse_texture),
            (Some(p), None) => (p.base_color_factor, p.base_color_texture),
            (None, None) => (None, None),
        };
    let [r, g, b, _] = factor.unwrap_or([1.0; 4]);
    ([r, g, b], texture)
}

fn product(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// At most [`REFLECTANCE_MAX`], with a note if that changed anything.
fn clamped(reflectance: [f64; 3], name: &str, notes: &mut Vec<Note>) -> [f64; 3] {
    let clamped = reflectance.map(|r| r.min(REFLECTANCE_MAX));
    let count = (0..3).filter(|&k| clamped[k] != reflectance[k]).count();
    if count > 0 {
        let [r, g, b] = reflectance;
        let message = format!(
            "its reflectance ({r:.3}, {g:.3}, {b:.3}) is lowered to {REFLECTANCE_MAX}: nothing reflects all light; \
             set baseColorFactor to what the surface really reflects"
        );
        notes.push(note(Severity::Warning, "reflectance", name, count, message));
    }
    clamped
}

fn note_what_is_ignored(material: &json::Material, name: &str, notes: &mut Vec<Note>) {
    let metallic =
        material.pbr_metallic_roughness.as_ref().and_then(|p| p.metallic_factor).unwrap_or(0.0);
    if metallic > 0.0 {
        let message = format!(
            "metallicFactor {metallic} is ignored: the base colour is taken as diffuse reflectance"
        );
        notes.push(note(Severity::Info, "metallic", name, 1, message));
    }
    let see_through = material.extensions.transmission.is_some()
        || material.alpha_mode.as_deref() == Some("BLEND");
    if see_through {
        let message = "transparency is ignored: the material is taken as opaque".to_owned();
        notes.push(note(Severity::Info, "transparency", name, 1, message));
    }
}

/// Why an image has no mean.
#[derive(Clone)]
enum NoMean {
    /// It cannot be read.
    Unreadable(String),
    /// Its pixels need so many bytes, more than are allowed.
    TooLarge(u64),
}

/// Mean linear colours of images, each decoded once.
struct Means<'a> {
    document: &'a Document,
    of_image: Vec<Option<Result<[f64; 3], NoMean>>>,
}

impl Means<'_> {
    /// The mean of a texture over its whole image (not only over the part that is mapped); white
    /// and a note where the image cannot be read.
    fn of(
        &mut self,
        texture: json::TextureRef,
        material: &str,
        which: &str,
        notes: &mut Vec<Note>,
    ) -> Result<[f64; 3], SceneError> {
        let textures = &self.document.root.textures;
        let entry = textures
            .get(texture.index)
            .ok_or_else(|| self.document.out_of_range("texture", texture.index))?;
        let mean = match entry.source {
            Some(image) => {
                if image >= self.of_image.len() {
                    return Err(self.document.out_of_range("image", image));
                }
                if let Some(uri) = &self.document.root.images[image].uri
                    && !uri.starts_with("data:")
                    && !uri.contains("://")
                {
                    self.document.inside(uri, &format!("image {image}"))?;
                }
                let read = || mean_of_image(self.document, image);
                match self.of_image[image].get_or_insert_with(read).clone() {
                    Ok(mean) => Ok(mean),
                    Err(NoMean::Unreadable(why)) => Err(why),
                    // White instead would be another scene with less memory.
                    Err(NoMean::TooLarge(bytes)) => {
                        self.document.fits(format_args!("image {image}"), bytes)?;
                        Err("it is too large".to_owned())
                    }
                }
            }
            None => Err("it has no PNG or JPEG image".to_owned()),
        };
        let (severity, message) = match &mean {
            Ok([r, g, b]) => {
                let what = format!(
                    "the {which} texture counts with its mean, linear ({r:.4}, {g:.4}, {b:.4})"
                );
                (Severity::Info, what)
            }
            Err(why) => {
                let what = format!(
                    "the {which} texture cannot be read ({why}) and is taken as white; \
                     put the image in place or set the factor to its mean"
                );
                (Severity::Warning, what)
            }
        };
        notes.push(note(severity, "texture", material, 1, message));
        Ok(mean.unwrap_or([1.0; 3]))
    }
}

/// The mean linear colour of an image, or why there is none.
fn mean_of_image(document: &Document, index: usize) -> Result<[f64; 3], NoMean> {
    let unreadable = |why: &dyn std::fmt::Display| NoMean::Unreadable(why.to_string());
    let of_scene = |error: SceneError| match error {
        SceneError::TooLarge { needs_bytes, .. } => NoMean::TooLarge(needs_bytes),
        other => unreadable(&other),
    };
    let image = &document.root.images[index];
    let bytes = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => {
            document.uri(uri, &format!("image {index}"), IMAGE_MAX).map_err(of_scene)?
        }
        (None, Some(view)) => document.view(view).map_err(of_scene)?.0.to_vec(),
        (None, None) => {
            return Err(unreadable(&format!(
                "image {index} names neither a file nor a buffer view"
            )));
        }
    };
    let format = image::guess_format(&bytes).map_err(|e| unreadable(&e))?;
    let size = image::ImageReader::with_format(Cursor::new(&bytes), format).into_dimensions();
    let (width, height) = size.map_err(|e| unreadable(&e))?;
    // Three bytes a pixel at least.
    let needs = 3 * u64::from(width) * u64::from(height);
    document.fits("an image", needs).map_err(of_scene)?;
    let pixels = image::load_from_memory_with_format(&bytes, format);
    let pixels = pixels.map_err(|e| unreadable(&e))?.into_rgb8();
    mean_linear(pixels.as_raw()).ok_or_else(|| unreadable(&"the image is empty"))
}

/// The mean of 8-bit sRGB pixels, decoded to linear first (IEC 61966-2-1). Exact up to rounding
/// and independent of the order of the pixels: they are counted, then summed by value.
fn mean_linear(rgb: &[u8]) -> Option<[f64; 3]> {
    let mut counts = [[0u64; 256]; 3];
    for pixel in rgb.chunks_exact(3) {
        for k in 0..3 {
            counts[k][pixel[k] as usize] += 1;
        }
    }
    let pixels = (rgb.len() / 3) as f64;
    let sum = |count: &[u64; 256]| {
        count.iter().enumerate().map(|(v, &n)| n as f64 * linear(v)).sum::<f64>()
    };
    (pixels > 0.0).then(|| [0, 1, 2].map(|k: usize| sum(&counts[k]) / pixels))
}

/// Linear value of an 8-bit sRGB one. `libm`, so that it is the same on every machine.
fn linear(value: usize) -> f64 {
    let c = value as f64 / 255.0;
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_taken_in_linear_light() {
        let mean = mean_linear(&[0, 128, 255, 255, 128, 255]).unwrap();
        assert!((mean[0] - 0.5).abs() < 1e-15);
        assert!((mean[1] - 0.215_860_500).abs() < 1e-8, "{}", mean[1]);
        assert!((mean[2] - 1.0).abs() < 1e-15);
        assert_eq!(mean_linear(&[]), None);
    }
}
