//! The sun: where it is, how strongly it shines, and its disc.
//!
//! Up is +Y, north -Z, east +X. Must not know the sky.

use glam::{DQuat, DVec3};
use solar_positioning::{Location, RefractionCorrection, SolarPositions, time::JulianDate};

use super::perez::{SOLAR_CONSTANT, air_mass};
use super::sky::zenith_angle;
use crate::scene::SceneError;
use crate::scene::tuning::SUN_CORNERS;

/// The sun's disc as a light.
#[derive(Clone, Debug, PartialEq)]
pub struct Sun {
    /// Where it is.
    pub place: SunPlace,
    /// Irradiance of a surface that faces it, W/m2, linear RGB. `None`: that of a clear day at its height, 1361 W/m2
    /// x 0.7^(m^0.678), m being the air mass (Meinel and Meinel 1976).
    pub irradiance: Option<[f64; 3]>,
    /// Apparent diameter, degrees.
    pub diameter_deg: f64,
}

/// Apparent diameter of the sun's disc, degrees.
pub const SUN_DIAMETER_DEG: f64 = 0.533;

/// Place of the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SunPlace {
    /// In a direction that does not change, degrees.
    Direction {
        /// From north (-Z) clockwise seen from above: east (+X) is 90.
        azimuth: f64,
        /// Above the horizon.
        elevation: f64,
    },
    /// Where it is seen from a place on earth, degrees; by NREL's algorithm, with refraction.
    Earth {
        /// North of the equator.
        latitude: f64,
        /// East of Greenwich.
        longitude: f64,
        /// Seconds since 1970-01-01, UTC.
        unix_s: f64,
    },
}

/// Angles are rounded to this, degrees: mathematics of the platform must not show.
const ROUND_DEG: f64 = 1e-6;

/// Difference between terrestrial and universal time in our days, seconds.
const DELTA_T_S: f64 = 69.0;

impl SunPlace {
    /// Azimuth and elevation, degrees, `after_s` seconds later.
    pub fn angles(&self, after_s: f64) -> Result<[f64; 2], SceneError> {
        let (latitude, longitude, unix_s) = match *self {
            SunPlace::Direction { azimuth, elevation } => return Ok([azimuth, elevation]),
            SunPlace::Earth { latitude, longitude, unix_s } => (latitude, longitude, unix_s),
        };
        let julian = (unix_s + after_s) / 86_400.0 + 2_440_587.5;
        let refraction = Some(RefractionCorrection::standard());
        let place = Location { latitude, longitude };
        let found = JulianDate::new(julian, DELTA_T_S)
            .and_then(|t| SolarPositions::new().at_from_julian(t, place, 0.0, refraction));
        let found = found.map_err(|error| SceneError::Geometry {
            subject: "the sun".into(),
            what: format!("it has no place at latitude {latitude}, longitude {longitude}: {error}"),
            remedy:
                "give a latitude of -90 to 90, a longitude of -180 to 180, and a year of our time"
                    .into(),
        })?;
        let round = |a: f64| (a / ROUND_DEG).round() * ROUND_DEG;
        Ok([round(found.azimuth()), round(found.elevation_angle())])
    }
}

/// Unit vector in a direction given in degrees.
pub(super) fn direction([azimuth, elevation]: [f64; 2]) -> DVec3 {
    let (a, e) = (azimuth.to_radians(), elevation.to_radians());
    let out = libm::cos(e);
    DVec3::new(out * libm::sin(a), libm::sin(e), -out * libm::cos(a))
}

impl Sun {
    /// Irradiance of a surface that faces it, W/m2, with the sun in a direction: less while a part of the disc is
    /// below the horizon.
    pub(super) fn irradiance_at(&self, direction: DVec3) -> [f64; 3] {
        let zenith = zenith_angle(direction);
        let clear = SOLAR_CONSTANT * libm::pow(0.7, libm::pow(air_mass(zenith), 0.678));
        let radius = 0.5 * self.diameter_deg;
        let above = ((90.0 - zenith.to_degrees() + radius) / (2.0 * radius)).clamp(0.0, 1.0);
        self.irradiance.unwrap_or([clear; 3]).map(|e| e * above)
    }

    /// Corners of the disc around +Y at distance 1 about the middle, counter-clockwise seen from there: a regular
    /// polygon of the disc's area.
    pub(super) fn corners(&self) -> Vec<DVec3> {
        let radius = libm::tan(0.5 * self.diameter_deg.to_radians());
        let step = 2.0 * std::f64::consts::PI / f64::from(SUN_CORNERS);
        // n / 2 r^2 sin(2 pi / n) = pi radius^2.
        let r = radius * (step / libm::sin(step)).sqrt();
        let corner = |k: u32| {
            let angle = step * (f64::from(k) + 0.5);
            DVec3::new(r * libm::cos(angle), 1.0, r * libm::sin(angle))
        };
        (0..SUN_CORNERS).map(corner).collect()
    }

    /// Solid angle of the disc weighed with the cosine from its middle, sr: irradiance over radiance.
    pub(super) fn projected_sr(&self) -> f64 {
        std::f64::consts::PI * libm::sin(0.5 * self.diameter_deg.to_radians()).powi(2)
    }
}

/// The shortest rotation from +Y to a direction.
pub(super) fn from_zenith(to: DVec3) -> DQuat {
    let (axis, cosine) = (DVec3::Y.cross(to), to.y);
    if cosine < -1.0 + 1e-12 {
        return DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    }
    let w = (0.5 * (1.0 + cosine)).sqrt();
    let v = axis / (2.0 * w);
    DQuat::from_xyzw(v.x, v.y, v.z, w)
}
