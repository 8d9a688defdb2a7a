//! Light from outside: a sky, the sun, the ground beyond, as bodies so far away that they have no place in the scene.
//!
//! Their polygons are patches like any other: shadows, motion and changing emission hold for them
//! ([`Body::distant`](super::Body::distant)). Up is +Y, north -Z, east +X. Must not know elements.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

mod build;
mod dome;
mod environment;
mod perez;
mod sky;
mod sun;

pub use environment::Environment;
pub use perez::LUMENS_PER_WATT;
pub use sky::Sky;
pub use sun::{SUN_DIAMETER_DEG, Sun, SunPlace};

use super::SceneError;
use crate::scene::tuning::SUN_KEY_S;
use sky::SkyNow;

/// Light from outside a scene.
#[derive(Clone, Debug, Default)]
pub struct Outside {
    /// The sky.
    pub sky: Option<Sky>,
    /// The sun.
    pub sun: Option<Sun>,
    /// Reflectance of the ground beyond the scene, in [0, 1): it shines up with what the sky and the sun send down. 0:
    /// nothing comes from below the horizon.
    pub ground: f64,
    /// How the clip's time runs for the sun.
    pub day: Option<Day>,
    /// Relative error of irradiance that the sky's facets may make: the tolerance, as a rule. At 0 they are as many as
    /// are allowed.
    pub fineness: f64,
}

/// Time of the sun over a clip: the sun is at its place in the given second of the place's time at the start, and later (or
/// earlier) by so much at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Day {
    /// From the sun's given time to the clip's start, seconds.
    pub from_s: f64,
    /// From the sun's given time to the clip's end, seconds.
    pub to_s: f64,
    /// How long the clip takes for it, seconds.
    pub over_s: f64,
}

/// Light from outside at one instant.
pub struct OutsideNow {
    sky: Option<SkyNow>,
    /// Direction, cosine of the disc's radius, radiance.
    sun: Option<(DVec3, f64, [f64; 3])>,
    ground: [f64; 3],
}

impl Outside {
    /// Whether it changes over time.
    pub fn changes(&self) -> bool {
        self.day.is_some()
    }

    /// Checks all numbers.
    ///
    /// # Errors
    /// Numbers out of their ranges, a sky that needs a sun where there is none, a day without a place on earth.
    pub fn check(&self) -> Result<(), SceneError> {
        let fails = |subject: &str, what: String, remedy: &str| {
            Err(SceneError::Geometry { subject: subject.into(), what, remedy: remedy.into() })
        };
        let is_emission = |e: f64| e.is_finite() && (0.0..=1e12).contains(&e);
        let of_sky: &[f64] = match &self.sky {
            Some(Sky::Uniform(radiance)) => radiance,
            Some(Sky::Overcast { irradiance } | Sky::Clear { irradiance }) => &[*irradiance],
            Some(Sky::AllWeather { direct, diffuse }) => &[*direct, *diffuse],
            Some(Sky::Turbid { turbidity }) if !(1.7..=10.0).contains(turbidity) => {
                let what = format!("the turbidity {turbidity} is none");
                return fails("the sky", what, "give 1.7 (very clear) to 10 (hazy)");
            }
            Some(Sky::Turbid { .. } | Sky::Environment(_)) | None => &[],
        };
        let of_sun = self.sun.iter().filter_map(|sun| sun.irradiance).flatten();
        if let Some(bad) = of_sky.iter().copied().chain(of_sun).find(|&e| !is_emission(e)) {
            let what = format!("it shines with {bad}");
            return fails("light from outside", what, "give values of 0 to 1e12");
        }
        if !(0.0..1.0).contains(&self.ground) {
            let what = format!("its reflectance is {}", self.ground);
            return fails("the ground beyond the scene", what, "give 0 or more and less than 1");
        }
        if self.sky.as_ref().is_some_and(Sky::follows_the_sun) && self.sun.is_none() {
            let what = "how it looks depends on where the sun is".into();
            return fails("the sky", what, "give the sun's place: `Outside::sun`");
        }
        if let Some(sun) = &self.sun {
            if !(sun.diameter_deg >= 1e-3 && sun.diameter_deg <= 60.0) {
                let what = format!("its disc is {} degrees wide", sun.diameter_deg);
                return fails("the sun", what, "give 0.001 to 60 degrees");
            }
            if let SunPlace::Direction { azimuth, elevation } = sun.place
                && !(azimuth.abs() <= 360.0 && elevation.abs() <= 90.0)
            {
                let what = format!("it has no place at azimuth {azimuth}, elevation {elevation}");
                return fails("the sun", what, "give degrees: -360 to 360, and -90 to 90");
            }
        }
        match (&self.day, &self.sun) {
            (None, _) | (Some(_), Some(Sun { place: SunPlace::Earth { .. }, .. })) => Ok(()),
            _ => {
                let what =
                    "the sun moves over the day of a place on earth, and there is none".into();
                fails("the day", what, "give `SunPlace::Earth`")
            }
        }
    }

    /// The light at a time of the clip, seconds.
    ///
    /// # Errors
    /// A sun without a place.
    pub fn at(&self, time_s: f64) -> Result<OutsideNow, SceneError> {
        let after_s = self.day.map_or(0.0, |day| {
            let share = if day.over_s > 0.0 { (time_s / day.over_s).clamp(0.0, 1.0) } else { 0.0 };
            day.from_s + (day.to_s - day.from_s) * share
        });
        let angles = self.sun.as_ref().map(|sun| sun.place.angles(after_s)).transpose()?;
        let towards = angles.map(sun::direction);
        let sky = self.sky.as_ref().map(|sky| sky.at(towards));
        let mut ground = sky.as_ref().map_or([0.0; 3], SkyNow::horizontal);
        let sun = self.sun.as_ref().zip(towards).map(|(sun, towards)| {
            let irradiance = self.sun_irradiance(sun, towards);
            (0..3).for_each(|c| ground[c] += irradiance[c] * towards.y.max(0.0));
            let cosine = libm::cos(0.5 * sun.diameter_deg.to_radians());
            (towards, cosine, irradiance.map(|e| e / sun.projected_sr()))
        });
        let all_round = self.sky.as_ref().is_some_and(Sky::is_all_round);
        let reflectance = if all_round { 0.0 } else { self.ground };
        Ok(OutsideNow { sky, sun, ground: ground.map(|e| e * reflectance / PI) })
    }

    /// The sun's irradiance where it is: as stated of it, or of the sky.
    fn sun_irradiance(&self, sun: &Sun, towards: DVec3) -> [f64; 3] {
        match (&self.sky, sun.irradiance) {
            (Some(Sky::AllWeather { direct, .. }), None) => {
                Sun { irradiance: Some([*direct; 3]), ..sun.clone() }.irradiance_at(towards)
            }
            _ => sun.irradiance_at(towards),
        }
    }

    /// Times of the clip at which light that changes is stated, seconds: between them it changes evenly.
    fn key_times_s(&self) -> Vec<f64> {
        let Some(day) = self.day else { return vec![0.0] };
        let spans = ((day.to_s - day.from_s).abs() / SUN_KEY_S).ceil().clamp(1.0, 300.0) as u32;
        (0..=spans).map(|k| day.over_s * f64::from(k) / f64::from(spans)).collect()
    }
}

impl OutsideNow {
    /// Azimuth and elevation of the sun, degrees, if there is one.
    pub fn sun_angles(&self) -> Option<[f64; 2]> {
        let (d, ..) = self.sun?;
        let azimuth = libm::atan2(d.x, -d.z).to_degrees().rem_euclid(360.0);
        Some([azimuth, libm::asin(d.y.clamp(-1.0, 1.0)).to_degrees()])
    }

    /// Irradiance of a horizontal surface that faces up: of the sky, and of the sun; W/m2, linear RGB.
    pub fn horizontal_w_m2(&self) -> [[f64; 3]; 2] {
        let sky = self.sky.as_ref().map_or([0.0; 3], SkyNow::horizontal);
        let sun = self.sun.map_or([0.0; 3], |(towards, cosine, radiance)| {
            // Irradiance is pi sin^2 of the disc's radius times radiance.
            radiance.map(|l| PI * (1.0 - cosine * cosine) * l * towards.y.max(0.0))
        });
        [sky, sun]
    }

    /// Irradiance of the sun at normal incidence, W/m2, and the unit vector towards it, while it is up.
    pub fn sun_beam(&self) -> Option<(DVec3, [f64; 3])> {
        let (towards, cosine, radiance) = self.sun.filter(|sun| sun.0.y > 0.0)?;
        Some((towards, radiance.map(|l| PI * (1.0 - cosine * cosine) * l)))
    }

    /// Radiance from a direction (a unit vector), W/m2/sr, linear RGB: what a camera sees there.
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        if let Some((towards, cosine, radiance)) = self.sun
            && direction.dot(towards) >= cosine
            && direction.y > 0.0
        {
            return radiance;
        }
        self.sky_radiance(direction)
    }

    /// Radiance from a direction (a unit vector) without the sun's disc, W/m2/sr, linear RGB.
    pub fn sky_radiance(&self, direction: DVec3) -> [f64; 3] {
        match &self.sky {
            Some(sky) if direction.y > 0.0 || matches!(sky, SkyNow::Picture(_)) => {
                sky.radiance(direction)
            }
            _ if direction.y <= 0.0 => self.ground,
            _ => [0.0; 3],
        }
    }
}

/// Rotation and irradiance of a sun at one key.
struct SunKey {
    rotation: DQuat,
    exitance: DVec3,
    is_up: bool,
}
