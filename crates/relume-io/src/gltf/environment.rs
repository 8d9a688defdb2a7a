//! Light from pictures all around that a file carries (`EXT_lights_image_based`): six faces of a cube, and what they bring to
//! diffuse surfaces as nine coefficients of spherical harmonics.
//!
//! The pictures say where light comes from, the coefficients how much it is in all: of pictures in JPEG what is brighter than white
//! is lost, the coefficients have it. Must not know what becomes of it.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use image::RgbaImage;
use serde::Deserialize;

use super::document::Document;
use super::images::encoded;
use super::{json, note};
use crate::surface::image_file::texels;
use relume_core::scene::outside::Environment;
use relume_core::scene::{Note, SceneError, Severity};

const NAME: &str = "EXT_lights_image_based";

/// Other extensions that describe light from all around, none of them ratified.
const NOT_READ: [&str; 2] = ["KHR_lights_environment", "KHR_environment_map"];

/// Least and largest width of the equirectangular picture that is made of the cube, pixels.
const WIDTHS: [u32; 2] = [64, 2048];

/// Bytes that a pixel of that picture takes.
const BYTES_PER_PIXEL: u64 = 12;

/// The spherical harmonic of order 0: its value in every direction, 1.
const HARMONIC_0: f64 = 0.282_094_791_773_878_14;

/// Share of the mean of the three channels that is taken for dark, 1.
const DARK: f64 = 1e-6;

/// The radiance from all directions that the active scene of a file is lit by, if any; what is wrong with it is noted.
///
/// # Errors
/// Images that do not exist, may not be opened, or need more memory than is allowed.
pub(super) fn of_scene(
    document: &Document,
    notes: &mut Vec<Note>,
) -> Result<Option<Arc<Environment>>, SceneError> {
    let used = &document.root.extensions_used;
    if let Some(name) = used.iter().find(|name| NOT_READ.contains(&name.as_str())) {
        say(document, notes, Severity::Warning, &format!("({name}) is not read: {REMEDY}"));
    }
    let light = match light_of_scene(document) {
        Ok(Some(light)) => light,
        Ok(None) => return Ok(None),
        Err(why) => return Ok(left_out(document, notes, &why)),
    };
    let radiance = match cube(document, &light)? {
        Ok(cube) => cube.radiance(&light),
        Err(why) => {
            let what = format!(
                "({NAME}) has pictures that cannot be read ({why}): it lights as its nine coefficients say, which know no small bright \
                 parts"
            );
            say(document, notes, Severity::Warning, &what);
            smooth(&light)
        }
    };
    match radiance.and_then(|(size, pixels)| {
        Environment::new(&document.file, size, pixels).map_err(|error| error.to_string())
    }) {
        Ok(environment) => {
            let what =
                format!("({NAME}) lights the scene where no other light from outside is asked for");
            say(document, notes, Severity::Info, &what);
            Ok(Some(Arc::new(environment)))
        }
        Err(why) => Ok(left_out(document, notes, &why)),
    }
}

const REMEDY: &str = "give a picture of all directions as the sky: `Sky::Environment`";

fn say(document: &Document, notes: &mut Vec<Note>, severity: Severity, what: &str) {
    notes.push(note(severity, "environment", &document.file, 1, format!("its environment {what}")));
}

fn left_out(document: &Document, notes: &mut Vec<Note>, why: &str) -> Option<Arc<Environment>> {
    say(document, notes, Severity::Warning, &format!("({NAME}) is left out, as {why}: {REMEDY}"));
    None
}

/// The light that the active scene names, or what is wrong with it.
fn light_of_scene(document: &Document) -> Result<Option<json::Environment>, String> {
    let root = &document.root;
    let scene = root.scenes.get(root.scene.unwrap_or(0));
    let Some(named) = scene.and_then(|scene| scene.extensions.environment.as_ref()) else {
        return Ok(None);
    };
    let index = named.get("light").and_then(serde_json::Value::as_u64);
    let index = index.ok_or("its scene does not say which light it is")?;
    let lights = root.extensions.environments.as_ref().and_then(|list| list.get("lights"));
    let light = lights.and_then(|lights| lights.get(usize::try_from(index).ok()?));
    let light = light.ok_or_else(|| format!("there is no light {index}"))?;
    let light = json::Environment::deserialize(light).map_err(|error| error.to_string())?;
    let numbers = light.irradiance_coefficients.iter().flatten().chain(&light.rotation);
    let finite = numbers.chain([&light.intensity]).all(|x| x.is_finite() && x.abs() < 1e12);
    if !finite || light.intensity < 0.0 || turn(&light).is_none() {
        return Err("its rotation, intensity or coefficients are out of range".into());
    }
    Ok(Some(light))
}

/// From the frame of its pictures to the world.
fn turn(light: &json::Environment) -> Option<DQuat> {
    let turn = DQuat::from_array(light.rotation);
    (turn.length() > 1e-6).then(|| turn.normalize())
}

/// The six faces of a cube, linear radiance but for a factor: +X, -X, +Y, -Y, +Z, -Z.
struct Cube {
    faces: Vec<RgbaImage>,
    lie: Lie,
}

/// How faces lie. The extension has those of cube maps, each "flipped about its vertical axis to correspond with the way glTF
/// references texture space". The sample file of its authors (EnvironmentTest of glTF-Sample-Models) is upside down, as that
/// purpose asks for; by the letter faces are mirrored, and look from within as pictures do. The coefficients tell which.
#[derive(Clone, Copy)]
enum Lie {
    UpsideDown,
    Mirrored,
}

fn cube(
    document: &Document,
    light: &json::Environment,
) -> Result<Result<Cube, String>, SceneError> {
    let Some(first) = light.specular_images.first() else {
        return Ok(Err("there are none".into()));
    };
    let mut faces = Vec::with_capacity(6);
    for &index in first {
        let bytes = match encoded(document, index)? {
            Ok(bytes) => bytes,
            Err(why) => return Ok(Err(why)),
        };
        let owner = format!("image {index}");
        // All six are kept at once.
        match texels(&bytes, "", &|needs| document.fits(&owner, needs.saturating_mul(6)))? {
            Ok(face) if face.width() > 0 && face.height() > 0 => faces.push(face),
            Ok(_) => return Ok(Err(format!("{owner} is empty"))),
            Err(why) => return Ok(Err(why)),
        }
    }
    let pixels = u64::from(WIDTHS[1]) * u64::from(WIDTHS[1] / 2);
    document.fits("its environment", pixels * BYTES_PER_PIXEL)?;
    let mut cube = Cube { faces, lie: Lie::Mirrored };
    let mirrored = cube.likeness(light);
    cube.lie = Lie::UpsideDown;
    if mirrored > cube.likeness(light) {
        cube.lie = Lie::Mirrored;
    }
    Ok(Ok(cube))
}

/// A picture of all directions: its size and its pixels.
type Picture = ((u32, u32), Vec<[f32; 3]>);

impl Cube {
    /// Radiance as an equirectangular picture, W/m2/sr: each pixel is a mean over itself.
    fn radiance(&self, light: &json::Environment) -> Result<Picture, String> {
        let side = self.faces.iter().map(RgbaImage::width).max().unwrap_or(1);
        let width = side.saturating_mul(4).clamp(WIDTHS[0], WIDTHS[1]);
        let each = side.saturating_mul(4).div_ceil(width).clamp(2, 8);
        let linear = linear_of_bytes();
        let at = |direction: DVec3| self.at(direction, &linear);
        let mut picture = equirectangular(width, each, light, &at)?;
        scale(&mut picture, light);
        Ok(picture)
    }

    /// The cosine of the angle between the coefficients of the pictures and those of the light, both without the first; 0 where
    /// either has none.
    fn likeness(&self, light: &json::Environment) -> f64 {
        let linear = linear_of_bytes();
        let [width, height] = [WIDTHS[0], WIDTHS[0] / 2].map(f64::from);
        let mut found = [[0.0; 3]; 9];
        for y in 0..WIDTHS[0] / 2 {
            let theta = (f64::from(y) + 0.5) / height * PI;
            let (sin, cos) = (libm::sin(theta), libm::cos(theta));
            for x in 0..WIDTHS[0] {
                let phi = f64::from(x) / width * 2.0 * PI;
                let d = DVec3::new(sin * libm::sin(phi), cos, -sin * libm::cos(phi));
                let radiance = self.at(d, &linear);
                for (sum, harmonic) in found.iter_mut().zip(harmonics(d)) {
                    (0..3).for_each(|c| sum[c] += sin * harmonic * radiance[c]);
                }
            }
        }
        let order = |k: usize| if k < 4 { 2.0 * PI / 3.0 } else { PI / 4.0 };
        let (mut both, mut ours, mut theirs) = (0.0, 0.0, 0.0);
        for k in 1..9 {
            for c in 0..3 {
                let (a, b) = (order(k) * found[k][c], light.irradiance_coefficients[k][c]);
                (both, ours, theirs) = (both + a * b, ours + a * a, theirs + b * b);
            }
        }
        if ours * theirs > 0.0 { both / (ours * theirs).sqrt() } else { 0.0 }
    }

    /// What comes from a direction in the frame of the pictures.
    fn at(&self, d: DVec3, linear: &[f64]) -> [f64; 3] {
        let by = d.abs();
        let (face, across, down, depth) = if by.x >= by.y && by.x >= by.z {
            if d.x > 0.0 { (0, -d.z, -d.y, by.x) } else { (1, d.z, -d.y, by.x) }
        } else if by.y >= by.z {
            if d.y > 0.0 { (2, d.x, d.z, by.y) } else { (3, d.x, -d.z, by.y) }
        } else if d.z > 0.0 {
            (4, d.x, -d.y, by.z)
        } else {
            (5, -d.x, -d.y, by.z)
        };
        let (across, down) = match self.lie {
            Lie::UpsideDown => (across, -down),
            Lie::Mirrored => (-across, down),
        };
        let image = &self.faces[face];
        let pick = |x: f64, count: u32| {
            ((0.5 * (x / depth + 1.0) * f64::from(count)) as u32).min(count - 1)
        };
        let [r, g, b, a] =
            image.get_pixel(pick(across, image.width()), pick(down, image.height())).0;
        // Without any alpha there is nothing to divide by.
        let divisor = f64::from(a.max(1)) / 255.0;
        [r, g, b].map(|c| linear[usize::from(c)] / divisor)
    }
}

/// A picture of all directions of what comes from each in the frame of the light's pictures, with so many points along each side
/// of a pixel.
fn equirectangular(
    width: u32,
    each: u32,
    light: &json::Environment,
    at: &dyn Fn(DVec3) -> [f64; 3],
) -> Result<Picture, String> {
    let back = turn(light).ok_or("its rotation is nothing")?.inverse();
    let height = width / 2;
    let mut pixels = Vec::with_capacity((width * height) as usize);
    let places = |k: u32, count: u32| {
        (0..each).map(move |i| {
            (f64::from(k) + (f64::from(i) + 0.5) / f64::from(each)) / f64::from(count)
        })
    };
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut weights) = ([0.0; 3], 0.0);
            for theta in places(y, height).map(|v| v * PI) {
                let (sin, cos) = (libm::sin(theta), libm::cos(theta));
                for phi in places(x, width).map(|u| (u - 0.5) * 2.0 * PI) {
                    let d = DVec3::new(sin * libm::sin(phi), cos, -sin * libm::cos(phi));
                    let found = at(back * d);
                    (0..3).for_each(|c| sum[c] += sin * found[c]);
                    weights += sin;
                }
            }
            pixels.push(sum.map(|s| (s / weights) as f32));
        }
    }
    Ok(((width, height), pixels))
}

/// Mean of a picture over all directions.
fn mean(((width, height), pixels): &Picture) -> [f64; 3] {
    let (mut sum, mut weights) = ([0.0; 3], 0.0);
    for (row, y) in pixels.chunks(*width as usize).zip(0..*height) {
        let weight = libm::sin((f64::from(y) + 0.5) / f64::from(*height) * PI);
        for pixel in row {
            (0..3).for_each(|c| sum[c] += weight * f64::from(pixel[c]));
            weights += weight;
        }
    }
    sum.map(|s| s / weights)
}

/// Brings a picture to the mean irradiance that the coefficients say, W/m2, channel by channel, and to the light's intensity.
fn scale(picture: &mut Picture, light: &json::Environment) {
    let found = mean(picture);
    let wanted = light.irradiance_coefficients[0].map(|c| c * HARMONIC_0 / PI);
    let dark = DARK * found.iter().sum::<f64>() / 3.0;
    let by: [f64; 3] = std::array::from_fn(|c| {
        let known = wanted[c] > 0.0 && found[c] > dark;
        light.intensity * if known { wanted[c] / found[c] } else { 1.0 }
    });
    for pixel in &mut picture.1 {
        *pixel = std::array::from_fn(|c| (f64::from(pixel[c]) * by[c]) as f32);
    }
}

/// Radiance with the coefficients' irradiance up to the second order, W/m2/sr; 0 where that would be negative.
fn smooth(light: &json::Environment) -> Result<Picture, String> {
    // Irradiance is radiance convolved with a clamped cosine (Ramamoorthi and Hanrahan 2001).
    let share = |k: usize| match k {
        0 => PI,
        1..=3 => 2.0 * PI / 3.0,
        _ => PI / 4.0,
    };
    let at = |d: DVec3| {
        let harmonics = harmonics(d);
        std::array::from_fn(|c| {
            let of = |k: usize| light.irradiance_coefficients[k][c] * harmonics[k] / share(k);
            (0..9).map(of).sum::<f64>().max(0.0)
        })
    };
    let mut picture = equirectangular(WIDTHS[0], 2, light, &at)?;
    scale(&mut picture, light);
    Ok(picture)
}

/// The first nine real spherical harmonics, in the order and with the signs of Ramamoorthi and Hanrahan (2001).
fn harmonics(DVec3 { x, y, z }: DVec3) -> [f64; 9] {
    const FIRST: f64 = 0.488_602_511_902_919_9;
    const SECOND: f64 = 1.092_548_430_592_079_2;
    [
        HARMONIC_0,
        FIRST * y,
        FIRST * z,
        FIRST * x,
        SECOND * x * y,
        SECOND * y * z,
        0.315_391_565_252_520_05 * (3.0 * z * z - 1.0),
        SECOND * x * z,
        0.546_274_215_296_039_6 * (x * x - y * y),
    ]
}

/// Linear values of all bytes of sRGB.
fn linear_of_bytes() -> Vec<f64> {
    (0..256).map(|c| linear(f64::from(c) / 255.0)).collect()
}

/// Linear value of an sRGB one.
fn linear(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}
