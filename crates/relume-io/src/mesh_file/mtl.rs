//! Files of materials of OBJ: images and how they lie on surfaces, and what lets light pass.
//!
//! Must not know meshes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec2;
use image::{Rgba, RgbaImage};

use super::paint::{Paint, Sheet};
use super::warning;
use crate::folder::Folder;
use crate::regular::unless_fits;
use crate::surface::image_file::{IMAGE_MAX, texels};
use crate::tuning::{BLEND_CUTOFF, REFLECTANCE_OF_NONE};
use relume_core::scene::coverage::Wrap;
use relume_core::scene::pyramid::Pyramid;
use relume_core::scene::{Material, Note, SceneError};

/// The text without lines that have a keyword and no value, as exporters write what they do not know.
pub(super) fn with_values(text: &str) -> String {
    let has_value = |line: &&str| {
        let mut words = line.split_whitespace();
        match (words.next(), words.next()) {
            (Some(word), None) => word.starts_with('#'),
            _ => true,
        }
    };
    text.lines().filter(has_value).flat_map(|line| [line, "\n"]).collect()
}

/// The text of a file: UTF-16 where its first character, the byte order mark, says so, otherwise UTF-8.
pub(super) fn text(bytes: &[u8]) -> Cow<'_, str> {
    let wide = |from: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|pair| from([pair[0], pair[1]]));
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes {
        [0xFE, 0xFF, ..] => Cow::Owned(wide(u16::from_be_bytes)),
        [0xFF, 0xFE, ..] => Cow::Owned(wide(u16::from_le_bytes)),
        [0xEF, 0xBB, 0xBF, rest @ ..] => String::from_utf8_lossy(rest),
        _ => String::from_utf8_lossy(bytes),
    }
}

/// A file's name as another system writes it: backslashes part folders, but before a space they only say that it belongs to the name.
pub(super) fn file_name(text: &str) -> String {
    text.trim().replace("\\ ", " ").replace('\\', "/")
}

/// The names of a line that has several.
pub(super) fn file_names(line: &str) -> Vec<String> {
    // No name has this character.
    let kept = line.replace("\\ ", "\0");
    kept.split_whitespace().map(|name| file_name(&name.replace('\0', " "))).collect()
}

/// What a material reflects, or what the image of that is multiplied with.
pub(super) fn factor(material: &tobj::Material) -> [f64; 3] {
    match is_image_alone(material) {
        true => [1.0; 3],
        false => finite(material.diffuse.unwrap_or([REFLECTANCE_OF_NONE; 3])),
    }
}

/// Whether a material's reflectance is an image without a factor, or with black, which is meant as it is.
pub(super) fn is_image_alone(material: &tobj::Material) -> bool {
    let stated = finite(material.diffuse.unwrap_or_default());
    material.diffuse_texture.is_some() && stated == [0.0; 3]
}

/// Without what is no number or negative.
pub(super) fn finite(colour: [f64; 3]) -> [f64; 3] {
    colour.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 })
}

/// What varies the radiance that a material emits.
pub(super) fn emission_texture(material: &tobj::Material) -> Option<&String> {
    material.unknown_param.get("map_Ke").or_else(|| material.unknown_param.get("map_ke"))
}

/// A reference to an image: the name of its file, and how it lies.
#[derive(Clone, Debug, PartialEq)]
struct Reference {
    name: String,
    scale: DVec2,
    offset: DVec2,
    wrap: Wrap,
}

/// Options of references with a number of values, at most; of these `-s`, `-o` and `-clamp` are read.
const OPTIONS: [(&str, usize); 13] = [
    ("-s", 3),
    ("-o", 3),
    ("-t", 3),
    ("-mm", 2),
    ("-clamp", 1),
    ("-blendu", 1),
    ("-blendv", 1),
    ("-boost", 1),
    ("-bm", 1),
    ("-cc", 1),
    ("-imfchan", 1),
    ("-texres", 1),
    ("-type", 1),
];

/// The first word, and what comes after it.
fn next(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// Options come before the name, which may have spaces.
fn reference(text: &str) -> Reference {
    let mut found = Reference {
        name: String::new(),
        scale: DVec2::ONE,
        offset: DVec2::ZERO,
        wrap: Wrap::Repeat,
    };
    let mut rest = text.trim();
    while let Some(&(option, most)) = OPTIONS.iter().find(|(option, _)| next(rest).0 == *option) {
        rest = next(rest).1;
        let mut numbers = Vec::new();
        for _ in 0..most {
            let (word, others) = next(rest);
            let number = word.parse::<f64>().ok().filter(|x| x.is_finite());
            // Of numbers there may be fewer; the name is last.
            if others.is_empty() || most > 1 && number.is_none() {
                break;
            }
            if (option, word) == ("-clamp", "on") {
                found.wrap = Wrap::ClampToEdge;
            }
            numbers.extend(number);
            rest = others;
        }
        let pair = |unset: f64| {
            DVec2::from_array([0, 1].map(|k| numbers.get(k).copied().unwrap_or(unset)))
        };
        match option {
            "-s" => found.scale = pair(1.0),
            "-o" => found.offset = pair(0.0),
            _ => {}
        }
    }
    found.name = file_name(rest);
    found
}

const WHITE: Rgba<u8> = Rgba([255; 4]);

/// Images of a quantity: of its values, or white, and of what of it is there, or all.
#[derive(Clone)]
struct Texture {
    place: Reference,
    colour: Option<String>,
    mask: Option<String>,
    /// The least alpha of texels that count.
    least: u16,
}

impl Texture {
    /// `None` where there is neither.
    fn new(colour: Option<&String>, mask: Option<&String>, least: u16) -> Option<Texture> {
        let place = reference(colour.or(mask)?);
        let name = |text: Option<&String>| text.map(|text| reference(text).name);
        Some(Texture { place, colour: name(colour), mask: name(mask), least })
    }
}

/// What a pyramid is made of: its colours, its mask, and the least alpha.
type Key = (Option<String>, Option<String>, u16);

/// Images of one file's materials, each read once.
pub(super) struct Textures<'a> {
    folder: &'a Folder,
    /// Where files of materials are that are not beside the scene file, as paths from there that end with a slash: images may be named
    /// from there.
    elsewhere: Vec<String>,
    images: BTreeMap<String, Result<Arc<RgbaImage>, String>>,
    pyramids: BTreeMap<Key, Arc<Pyramid>>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(folder: &'a Folder, elsewhere: Vec<String>) -> Textures<'a> {
        Textures { folder, elsewhere, images: BTreeMap::new(), pyramids: BTreeMap::new() }
    }

    /// What images make of a material; `None` where it looks the same everywhere.
    ///
    /// # Errors
    /// Images that need more memory than is allowed.
    pub(super) fn paint(
        &mut self,
        material: &tobj::Material,
        translated: &Material,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Paint>, SceneError> {
        let dissolve = material.dissolve.filter(|d| d.is_finite()).unwrap_or(1.0);
        let least =
            (BLEND_CUTOFF * 255.0 / dissolve.max(f64::MIN_POSITIVE)).ceil().clamp(0.0, 256.0);
        let least = if material.dissolve_texture.is_some() { least as u16 } else { 0 };
        let (colour, mask) = (&material.diffuse_texture, &material.dissolve_texture);
        let mut sheet = |texture: Option<Texture>| match texture {
            Some(texture) => self.sheet(&translated.name, &texture, notes),
            None => Ok(None),
        };
        let base = sheet(Texture::new(colour.as_ref(), mask.as_ref(), least))?;
        let emission = emission_texture(material).filter(|_| translated.exitance != [0.0; 3]);
        let emission = sheet(Texture::new(emission, None, 0))?;
        if base.is_none() && emission.is_none() {
            return Ok(None);
        }
        let is_see_through = mask.is_some() && base.is_some();
        Ok(Some(Paint { factor: factor(material), base, emission, is_see_through }))
    }

    /// A texture on a surface; none, and a note, where one of its images cannot be read.
    fn sheet(
        &mut self,
        material: &str,
        texture: &Texture,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Sheet>, SceneError> {
        let Texture { place: Reference { name, scale, offset, wrap }, .. } = texture.clone();
        Ok(match self.pyramid(texture)? {
            Ok(pyramid) => Some(Sheet { pyramid, wrap, scale, offset }),
            Err(why) => {
                let message = format!(
                    "its texture {name} cannot be read ({why}): Kd counts alone, or grey where that is black; put the image in place"
                );
                notes.push(warning("texture", material, 1, message));
                None
            }
        })
    }

    /// The texels of a texture with their means, made once; or why they cannot be read.
    fn pyramid(&mut self, texture: &Texture) -> Result<Result<Arc<Pyramid>, String>, SceneError> {
        let Texture { colour, mask, least, .. } = texture;
        let key = (colour.clone(), mask.clone(), *least);
        if let Some(known) = self.pyramids.get(&key) {
            return Ok(Ok(known.clone()));
        }
        let mut image = |name: &Option<String>| name.as_ref().map(|name| self.image(name));
        let (colour_image, mask_image) =
            (image(colour).transpose()?.transpose(), image(mask).transpose()?.transpose());
        let made = colour_image.and_then(|colour_image| {
            let mask_image = mask_image?;
            // A file that is both is both in its own way.
            let own = mask_image.as_ref().filter(|_| colour == mask);
            let mask_image = mask_image.as_ref().filter(|_| colour != mask);
            let image = match (colour_image, mask_image, own) {
                (Some(image), Some(mask), _) => masked(&image, mask),
                (Some(image), None, Some(_)) => (*image).clone(),
                (Some(image), None, None) => opaque(&image),
                (None, Some(mask), _) => {
                    masked(&RgbaImage::from_pixel(mask.width(), mask.height(), WHITE), mask)
                }
                (None, None, _) => return Err("it names no image".to_owned()),
            };
            let size = [image.width() as usize, image.height() as usize];
            Pyramid::new(size, image.into_raw(), *least)
                .map(Arc::new)
                .ok_or_else(|| "the image is empty".to_owned())
        });
        if let Ok(pyramid) = &made {
            self.pyramids.insert(key, pyramid.clone());
        }
        Ok(made)
    }

    /// An image where its path says, from the scene file or from files of materials, or by its name alone; or why there is none.
    fn image(&mut self, name: &str) -> Result<Result<Arc<RgbaImage>, String>, SceneError> {
        if let Some(known) = self.images.get(name) {
            return Ok(known.clone());
        }
        let last = name.rsplit('/').next().unwrap_or(name);
        let read = |name: &str| self.folder.read(name, "an image", IMAGE_MAX);
        let bytes = match read(name) {
            Err(error @ (SceneError::Outside { .. } | SceneError::Read { .. })) => {
                let folders: Vec<&str> =
                    self.elsewhere.iter().map(String::as_str).chain([""]).collect();
                let places =
                    [name, last].map(|name| folders.iter().map(move |at| format!("{at}{name}")));
                let found = places.into_iter().flatten().find_map(|place| read(&place).ok());
                // What is said is said of the path that the file has.
                found.ok_or(error)
            }
            found => found,
        };
        let image = match bytes {
            Ok(bytes) => {
                let fits = |bytes| {
                    let what = format_args!("image {name}");
                    unless_fits(&self.folder.file, what, bytes, self.folder.max_memory_bytes)
                };
                texels(&bytes, name, &fits)?.map(Arc::new)
            }
            Err(error @ SceneError::TooLarge { .. }) => return Err(error),
            Err(SceneError::Read { source, .. }) => Err(source.to_string()),
            Err(SceneError::Outside { what, remedy, .. }) => Err(format!("{what}; {remedy}")),
            Err(error) => Err(error.to_string()),
        };
        self.images.insert(name.to_owned(), image.clone());
        Ok(image)
    }
}

/// An image with the alpha of another one, at the same places; of one that is opaque all over the brightness counts.
fn masked(image: &RgbaImage, mask: &RgbaImage) -> RgbaImage {
    let by_alpha = mask.pixels().any(|texel| texel.0[3] < 255);
    let at = |k: u32, of: u32, from: u32| {
        let scaled = u64::from(k) * u64::from(of) / u64::from(from.max(1));
        scaled.min(u64::from(of.saturating_sub(1))) as u32
    };
    let mut texels = image.clone();
    for (x, y, texel) in texels.enumerate_pixels_mut() {
        let (x, y) = (at(x, mask.width(), image.width()), at(y, mask.height(), image.height()));
        let [r, g, b, alpha] = mask.get_pixel(x, y).0.map(u16::from);
        texel.0[3] = if by_alpha { alpha } else { (r + g + b) / 3 } as u8;
    }
    texels
}

/// An image all of which is there.
fn opaque(image: &RgbaImage) -> RgbaImage {
    let mut texels = image.clone();
    texels.pixels_mut().for_each(|texel| texel.0[3] = 255);
    texels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_images_come_before_their_names() {
        let of = |text: &str| reference(text);
        let plain = of("wood.png");
        assert_eq!(
            (plain.name.as_str(), plain.scale, plain.offset),
            ("wood.png", DVec2::ONE, DVec2::ZERO)
        );
        let all = of("-s 2 3 1 -o 0.5 -clamp on -blendu off  my textures\\a b.png ");
        assert_eq!(all.name, "my textures/a b.png");
        assert_eq!((all.scale, all.offset), (DVec2::new(2.0, 3.0), DVec2::new(0.5, 0.0)));
        assert_eq!(all.wrap, Wrap::ClampToEdge);
        assert_eq!(of("-bm 0.2 4.png").name, "4.png");
        // A number may be a name.
        assert_eq!(of("-s 1 1 1 7").name, "7");
    }

    #[test]
    fn lines_without_values_are_left_out() {
        assert_eq!(
            with_values("newmtl a\nmap_Kd\n#\n\nillum \nKd 1 1 1"),
            "newmtl a\n#\n\nKd 1 1 1\n"
        );
    }
}
