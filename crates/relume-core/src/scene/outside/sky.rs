//! Radiance of the sky: what a model says comes from each direction at one instant.
//!
//! Up is +Y, north -Z, east +X. Everything is radiometric: W/m2/sr, linear RGB. Must not know facets.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::DVec3;

use super::environment::Environment;
use super::perez::{self, Distribution, HORIZON};

/// Radiance of the sky, without the sun's disc.
#[derive(Clone, Debug)]
pub enum Sky {
    /// The same radiance from everywhere above the horizon, W/m2/sr, linear RGB.
    Uniform([f64; 3]),
    /// CIE standard overcast sky (Moon and Spencer 1942): three times as bright at the zenith as at the horizon.
    Overcast {
        /// Horizontal irradiance under it, W/m2.
        irradiance: f64,
    },
    /// CIE standard clear sky (ISO 15469:2004, type 12); it needs the sun's direction.
    Clear {
        /// Horizontal irradiance under it, the sun's disc aside, W/m2.
        irradiance: f64,
    },
    /// Clear to hazy skies by turbidity, with their colours (Preetham, Shirley and Smits 1999); it needs the sun's
    /// direction. Luminance becomes radiance by [`LUMENS_PER_WATT`](super::LUMENS_PER_WATT).
    Turbid {
        /// 2 (very clear) to 10 (hazy).
        turbidity: f64,
    },
    /// All-weather model (Perez, Seals and Michalsky 1993); it needs the sun's direction.
    AllWeather {
        /// Irradiance of the sun at normal incidence, W/m2.
        direct: f64,
        /// Horizontal irradiance under the sky alone, W/m2.
        diffuse: f64,
    },
    /// A picture of all directions, from below too.
    Environment(Arc<Environment>),
}

impl Sky {
    /// Whether it changes with the sun's place.
    pub fn follows_the_sun(&self) -> bool {
        matches!(self, Sky::Clear { .. } | Sky::Turbid { .. } | Sky::AllWeather { .. })
    }

    /// Whether it has radiance below the horizon too.
    pub fn is_all_round(&self) -> bool {
        matches!(self, Sky::Environment(_))
    }

    /// The sky with the sun at a place (a unit vector), if there is a sun.
    pub(super) fn at(&self, sun: Option<DVec3>) -> SkyNow {
        let sun = sun.unwrap_or(DVec3::Y);
        let shape = match self {
            Sky::Uniform(radiance) => return SkyNow::Uniform(*radiance),
            Sky::Environment(picture) => return SkyNow::Picture(Arc::clone(picture)),
            Sky::Turbid { turbidity } => {
                return SkyNow::Coloured(perez::preetham(*turbidity, zenith_angle(sun)), sun);
            }
            Sky::Overcast { irradiance } => (Shape::Overcast, *irradiance),
            Sky::Clear { irradiance } => (Shape::Clear(sun), *irradiance),
            Sky::AllWeather { direct, diffuse } => {
                let shape = perez::all_weather(*direct, *diffuse, zenith_angle(sun));
                (Shape::Perez(shape, sun), *diffuse)
            }
        };
        let (shape, irradiance) = shape;
        let under = match shape {
            // 2 pi times the integral of (1 + 2 c) / 3 c from 0 to 1.
            Shape::Overcast => 7.0 * PI / 9.0,
            _ => horizontal(&|d| shape.relative(d)),
        };
        // No sky that follows the sun is there while the sun is not.
        let is_day = sun.y > 0.0 || matches!(shape, Shape::Overcast);
        let scale = if is_day && under > 0.0 { irradiance / under } else { 0.0 };
        SkyNow::Grey { shape, scale }
    }
}

/// The angle of a direction from the zenith, radians.
pub(super) fn zenith_angle(direction: DVec3) -> f64 {
    libm::acos(direction.y.clamp(-1.0, 1.0))
}

/// The sky at one instant.
#[derive(Clone, Debug)]
pub(super) enum SkyNow {
    Uniform([f64; 3]),
    Picture(Arc<Environment>),
    Grey { shape: Shape, scale: f64 },
    Coloured(perez::Coloured, DVec3),
}

impl SkyNow {
    /// Radiance from a direction (a unit vector, towards the sky), W/m2/sr, linear RGB; nothing from below the
    /// horizon but where the sky is a picture.
    pub(super) fn radiance(&self, direction: DVec3) -> [f64; 3] {
        if let SkyNow::Picture(picture) = self {
            return picture.radiance(direction);
        }
        if direction.y <= 0.0 {
            return [0.0; 3];
        }
        match self {
            SkyNow::Uniform(radiance) => *radiance,
            SkyNow::Grey { shape, scale } => [scale * shape.relative(direction); 3],
            SkyNow::Coloured(sky, sun) => sky.radiance(direction, *sun),
            SkyNow::Picture(_) => unreachable!("a picture was looked at above"),
        }
    }

    /// Irradiance of a horizontal surface that faces up, W/m2, linear RGB.
    pub(super) fn horizontal(&self) -> [f64; 3] {
        if let SkyNow::Uniform(radiance) = self {
            return radiance.map(|l| PI * l);
        }
        [0, 1, 2].map(|c| horizontal(&|d| self.radiance(d)[c]))
    }
}

/// How a grey sky is shaped, up to a factor.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    Overcast,
    Clear(DVec3),
    Perez(Distribution, DVec3),
}

impl Shape {
    fn relative(&self, direction: DVec3) -> f64 {
        let up = direction.y;
        match self {
            Shape::Overcast => (1.0 + 2.0 * up) / 3.0,
            Shape::Clear(sun) => {
                // ISO 15469, standard sky 12: gradation a = -1, b = -0.32; indicatrix c = 10, d = -3, e = 0.45.
                let gradation = 1.0 - libm::exp(-0.32 / up.max(HORIZON));
                let cosine = direction.dot(*sun).clamp(-1.0, 1.0);
                let indicatrix = 1.0
                    + 10.0 * (libm::exp(-3.0 * libm::acos(cosine)) - libm::exp(-3.0 * FRAC_PI_2))
                    + 0.45 * cosine * cosine;
                gradation * indicatrix
            }
            Shape::Perez(distribution, sun) => distribution.at(direction, *sun).max(0.0),
        }
    }
}

/// Steps in height and around in which skies are integrated.
const STEPS: (u32, u32) = (128, 128);

/// The integral of a radiance times the cosine over the upper hemisphere: irradiance of a horizontal surface. Error:
/// some 1e-5 for the skies above.
fn horizontal(radiance: &dyn Fn(DVec3) -> f64) -> f64 {
    let (rings, sectors) = STEPS;
    let mut sum = 0.0;
    for ring in 0..rings {
        // Rings of equal solid angle times cosine.
        let up2 = (f64::from(ring) + 0.5) / f64::from(rings);
        let (up, out) = (up2.sqrt(), (1.0 - up2).sqrt());
        for sector in 0..sectors {
            let around = 2.0 * PI * (f64::from(sector) + 0.5) / f64::from(sectors);
            sum += radiance(DVec3::new(out * libm::sin(around), up, -out * libm::cos(around)));
        }
    }
    PI * sum / f64::from(rings * sectors)
}
