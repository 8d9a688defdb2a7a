//! Pictures of all directions: equirectangular, linear radiance.
//!
//! The middle of the picture is north (-Z), its right half east (+X), its top the zenith (+Y). Must not know facets or files.

use std::f64::consts::PI;

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

impl Environment {
    /// Environment of pixels, row by row from the top: W/m2/sr, linear RGB.
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

    /// The environment turned about the vertical, counter-clockwise seen from above, degrees.
    pub fn turned(mut self, degrees: f64) -> Environment {
        let angle = degrees.to_radians();
        self.turned = [libm::sin(angle), libm::cos(angle)];
        self
    }

    /// Name: that of its file.
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
