//! Pictures of all directions: equirectangular, linear radiance (Radiance .hdr, OpenEXR).
//!
//! The middle of the picture is north (-Z), its right half east (+X), its top the zenith (+Y). Must not know facets.

use std::f64::consts::PI;
use std::io::Cursor;
use std::path::Path;

use glam::DVec3;

use crate::scene::SceneError;

/// Radiance from all directions, W/m2/sr, linear RGB.
#[derive(Clone)]
pub struct Environment {
    name: String,
    width: u32,
    height: u32,
    /// Row by row from the top.
    pixels: Vec<[f32; 3]>,
    /// Turned about +Y, counter-clockwise seen from above, radians: sine and cosine.
    turned: [f64; 2],
}

impl std::fmt::Debug for Environment {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Environment({}, {} x {})", self.name, self.width, self.height)
    }
}

/// Bytes that decoding takes for each pixel at most: as decoded, and as kept.
const BYTES_PER_PIXEL: u64 = 16 + 12;

impl Environment {
    /// Of pixels, row by row from the top: W/m2/sr, linear RGB.
    ///
    /// # Errors
    /// As many pixels as `width` times `height`, finite and not negative, or the error names `name`.
    pub fn new(
        name: &str,
        (width, height): (u32, u32),
        pixels: Vec<[f32; 3]>,
    ) -> Result<Environment, SceneError> {
        let fails = |what: String, remedy: &str| SceneError::Geometry {
            subject: format!("environment `{name}`"),
            what,
            remedy: remedy.into(),
        };
        if pixels.is_empty() || pixels.len() as u64 != u64::from(width) * u64::from(height) {
            let what = format!("{} pixels are not {width} x {height}", pixels.len());
            return Err(fails(what, "give one for each place, at least one"));
        }
        let is_bad = |p: &[f32; 3]| p.iter().any(|c| !c.is_finite() || *c < 0.0 || *c > 1e30);
        if let Some(at) = pixels.iter().position(is_bad) {
            let (x, y) = (at as u64 % u64::from(width), at as u64 / u64::from(width));
            let what = format!("the pixel at column {x}, row {y} is {:?}", pixels[at]);
            return Err(fails(what, "write finite radiances of 0 or more"));
        }
        Ok(Environment { name: name.to_owned(), width, height, pixels, turned: [0.0, 1.0] })
    }

    /// Reads a .hdr or .exr file; `max_memory_bytes` as for scenes.
    ///
    /// # Errors
    /// A file that is missing, damaged, too large, or something else.
    pub fn read(path: &Path, max_memory_bytes: Option<u64>) -> Result<Environment, SceneError> {
        let file = path.display().to_string();
        let unreadable = |source| SceneError::Read {
            file: file.clone(),
            source,
            remedy: "check its path and that it may be read".into(),
        };
        let too_large = |what: &str, needs_bytes| SceneError::TooLarge {
            file: file.clone(),
            what: what.into(),
            needs_bytes,
            limit_bytes: max_memory_bytes.unwrap_or(u64::MAX),
            remedy: "raise --max-memory, or use a smaller picture".into(),
        };
        let damaged = |what: String| SceneError::Geometry {
            subject: format!("environment `{file}`"),
            what,
            remedy: "give an equirectangular picture of radiance, .hdr or .exr".into(),
        };
        let limit = max_memory_bytes.unwrap_or(u64::MAX);
        let len = std::fs::metadata(path).map_err(unreadable)?.len();
        if len > limit {
            return Err(too_large("the file", len));
        }
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let format = match bytes.get(..4) {
            Some(b"#?RA" | b"#?RG") => image::ImageFormat::Hdr,
            Some([0x76, 0x2f, 0x31, 0x01]) => image::ImageFormat::OpenExr,
            _ => return Err(damaged("it is neither Radiance's .hdr nor OpenEXR".into())),
        };
        let reader = || image::ImageReader::with_format(Cursor::new(&bytes), format);
        let said = |e: image::ImageError| damaged(format!("the picture cannot be decoded: {e}"));
        let (width, height) = reader().into_dimensions().map_err(said)?;
        let needs = u64::from(width) * u64::from(height) * BYTES_PER_PIXEL + len;
        // Without a limit, as much as the largest pictures that are sold.
        if needs > limit.min(PICTURE_MAX_BYTES) {
            return Err(too_large(&format!("the picture of {width} x {height}"), needs));
        }
        let decoded = reader().decode().map_err(said)?.into_rgb32f();
        let pixel = |p: &image::Rgb<f32>| p.0.map(|c| if c.is_nan() { 0.0 } else { c.max(0.0) });
        let pixels = decoded.pixels().map(pixel).collect();
        Environment::new(&file, (width, height), pixels)
    }

    /// The same turned about the vertical, counter-clockwise seen from above, degrees.
    pub fn turned(mut self, degrees: f64) -> Environment {
        let angle = degrees.to_radians();
        self.turned = [libm::sin(angle), libm::cos(angle)];
        self
    }

    /// What it is called: the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Pixels across and down.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Radiance from a direction (a unit vector), that of the pixel there, W/m2/sr.
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let [sine, cosine] = self.turned;
        // Turned back.
        let d = DVec3::new(
            cosine * direction.x - sine * direction.z,
            direction.y,
            sine * direction.x + cosine * direction.z,
        );
        let across = 0.5 + libm::atan2(d.x, -d.z) / (2.0 * PI);
        let down = libm::acos(d.y.clamp(-1.0, 1.0)) / PI;
        let pick = |share: f64, count: u32| ((share * f64::from(count)) as u32).min(count - 1);
        let (x, y) = (pick(across, self.width), pick(down, self.height));
        self.pixels[y as usize * self.width as usize + x as usize].map(f64::from)
    }
}

/// Bytes that a picture may take where no limit is given: 32,768 x 16,384 pixels.
const PICTURE_MAX_BYTES: u64 = 16 << 30;
