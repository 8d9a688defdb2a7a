//! Light from outside as the command line gives it: `--sky`, `--sun`, `--day`, `--ground`, `--environment`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use clap::Args;
use relume::scene::Scene;
use relume::scene::outside::{Day, Outside, SUN_DIAMETER_DEG, Sky, Sun, SunPlace};

use crate::failure::Failure;
use crate::memory;
use crate::scene_file;

/// Light from outside the scene. Up is +Y, north -Z, east +X.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct OutsideFlags {
    /// Light from the sky, without the sun's disc: none, uniform=L (radiance, W/m2/sr; or R,G,B), overcast[=E] (CIE overcast;
    /// E is horizontal irradiance, W/m2 [100]), clear[=E] (CIE clear [100]), perez=T (by turbidity, 1.7 to 10, with its
    /// colours; luminance over 125 lm/W), perez=DIRECT,DIFFUSE (all-weather, by the sun's normal and the sky's horizontal
    /// irradiance, W/m2). `perez` and `clear` need --sun. `render` adds an overcast one and a sun where what emits lights little
    /// of what is seen, unless it is told none.
    #[arg(long, value_name = "SKY", conflicts_with = "environment")]
    pub(crate) sky: Option<SkyFlag>,
    /// The sun: AZIMUTH,ELEVATION[,E] in degrees, azimuth from north (-Z) clockwise (east, +X, is 90), or
    /// LATITUDE,LONGITUDE,TIME[,E], TIME as 2026-06-21T12:00+02:00 (UTC without an offset). E is its irradiance at normal
    /// incidence, W/m2 [that of a clear day at its height].
    #[arg(long, value_name = "SUN", allow_hyphen_values = true)]
    pub(crate) sun: Option<SunFlag>,
    /// Diameter of the sun's disc, degrees [default: 0.533].
    #[arg(long, value_name = "DEGREES", requires = "sun", allow_negative_numbers = true)]
    pub(crate) sun_size: Option<f64>,
    /// A day passes over the clip: 06:00..18:00, in the offset of --sun's TIME; or 06:00..18:00/96 over so many frames
    /// (96 where nothing else moves).
    #[arg(long, value_name = "DAY", requires = "sun")]
    pub(crate) day: Option<DayFlag>,
    /// Reflectance of the ground beyond the scene: it shines up with what sky and sun send down [default: 0].
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub(crate) ground: Option<f64>,
    /// Light from a picture of all directions: .hdr or .exr, equirectangular, radiance in W/m2/sr; its middle is north.
    #[arg(long, value_name = "FILE")]
    pub(crate) environment: Option<PathBuf>,
    /// Turns --environment about the vertical, counter-clockwise seen from above, degrees.
    #[arg(long, value_name = "DEGREES", requires = "environment", allow_negative_numbers = true)]
    pub(crate) environment_turn: Option<f64>,
}

/// `--sky`
#[derive(Clone, Debug)]
pub(crate) struct SkyFlag {
    text: String,
    /// `None` for none.
    sky: Option<Sky>,
}

/// `--sun`
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SunFlag {
    text: String,
    place: SunPlace,
    irradiance: Option<f64>,
    /// Seconds of the day in the offset of the time given.
    of_day_s: Option<f64>,
}

/// `--day`
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DayFlag {
    text: String,
    from_s: f64,
    to_s: f64,
    frames: Option<u32>,
}

/// Horizontal irradiance of skies of which none is stated, W/m2.
const SKY_W_M2: f64 = 100.0;

/// Frames of a day where nothing else says.
const DAY_FRAMES: u32 = 96;

/// What `render` lights a scene with in which nothing emits: an overcast sky and a sun of these irradiances (W/m2; of the sky
/// horizontal, of the sun at normal incidence), the sun so high (degrees), above ground of this reflectance, so that undersides
/// are seen too.
const DEFAULT_SKY_W_M2: f64 = 3.0;
const DEFAULT_SUN_W_M2: f64 = 3.0;
const DEFAULT_ELEVATION: f64 = 40.0;
const DEFAULT_GROUND: f64 = 0.2;

impl OutsideFlags {
    /// Whether nothing of it was asked for.
    pub(crate) fn is_empty(&self) -> bool {
        self.sky.is_none() && self.sun.is_none() && self.environment.is_none()
    }

    /// As on the command line, for reports; `None` if nothing was asked for.
    pub(crate) fn describe(&self) -> Option<String> {
        let mut words: Vec<String> = Vec::new();
        let mut say = |name: &str, value: Option<String>| {
            words.extend(value.map(|value| format!("--{name} {value}")));
        };
        say("sky", self.sky.as_ref().map(|f| f.text.clone()));
        say("sun", self.sun.as_ref().map(|f| f.text.clone()));
        say("sun-size", self.sun_size.map(|s| s.to_string()));
        say("day", self.day.as_ref().map(|f| f.text.clone()));
        say("ground", self.ground.map(|r| r.to_string()));
        say("environment", self.environment.as_ref().map(|p| p.display().to_string()));
        say("environment-turn", self.environment_turn.map(|a| a.to_string()));
        (!words.is_empty()).then(|| words.join(" "))
    }

    /// The scene in that light, or in that which its file carries where none was asked for. Pictures of environments are read here.
    pub(crate) fn light(&self, scene: Scene, fps: f64, fineness: f64) -> Result<Scene, Failure> {
        if self.is_empty() {
            let own = scene.environment.clone().filter(|_| self.ground.is_none());
            if let Some(own) = own {
                let sky = Some(Sky::Environment(own));
                let outside = Outside { sky, fineness, ..Outside::default() };
                return scene.with_outside(outside).map_err(scene_file::failure);
            }
            if self.ground.is_some() {
                return Err(Failure::usage(
                    "--ground shines with what the sky and the sun send down",
                )
                .help("add --sky or --sun"));
            }
            return Ok(scene);
        }
        let environment = self.environment.as_ref().map(|path| {
            memory::at(format_args!("reading {}", path.display()));
            let read = relume::read_environment(path, memory::limit_bytes());
            let turned = self.environment_turn.unwrap_or(0.0);
            read.map(|e| Sky::Environment(Arc::new(e.turned(turned)))).map_err(scene_file::failure)
        });
        let sky =
            environment.transpose()?.or_else(|| self.sky.as_ref().and_then(|f| f.sky.clone()));
        if sky.is_none() && self.sun.is_none() {
            return Ok(scene);
        }
        let sun = self.sun.as_ref().map(|flag| Sun {
            place: flag.place,
            irradiance: flag.irradiance.map(|e| [e; 3]),
            diameter_deg: self.sun_size.unwrap_or(SUN_DIAMETER_DEG),
        });
        let day = self.day.as_ref().map(|day| self.day_of(day, &scene, fps)).transpose()?;
        let ground = self.ground.unwrap_or(0.0);
        let outside = Outside { sky, sun, ground, day, fineness };
        scene.with_outside(outside).map_err(scene_file::failure)
    }

    fn day_of(&self, day: &DayFlag, scene: &Scene, fps: f64) -> Result<Day, Failure> {
        let of_day_s = self.sun.as_ref().and_then(|sun| sun.of_day_s).ok_or_else(|| {
            Failure::usage("--day moves the sun of a place on earth")
                .help("give --sun LATITUDE,LONGITUDE,TIME")
        })?;
        let over = |frames: u32| f64::from(frames - 1) / fps;
        let over_s = match day.frames {
            Some(frames) => over(frames),
            None if scene.motion.duration_s > 0.0 => scene.motion.duration_s,
            None => over(DAY_FRAMES),
        };
        Ok(Day { from_s: day.from_s - of_day_s, to_s: day.to_s - of_day_s, over_s })
    }
}

/// Why a scene has the light that pictures have by default.
pub(crate) enum Unlit {
    /// Nothing emits.
    Dark,
    /// What emits lights this share of what the view shows of surfaces.
    Dim(f64),
}

/// A scene in the light that pictures have by default: with a sun where its azimuth is known, degrees.
pub(crate) fn lit_by_default(
    scene: &Scene,
    azimuth: Option<f64>,
    fineness: f64,
) -> Result<Scene, Failure> {
    let sky = Some(Sky::Overcast { irradiance: DEFAULT_SKY_W_M2 });
    let sun = azimuth.map(|azimuth| Sun {
        place: SunPlace::Direction { azimuth, elevation: DEFAULT_ELEVATION },
        irradiance: Some([DEFAULT_SUN_W_M2; 3]),
        diameter_deg: SUN_DIAMETER_DEG,
    });
    let outside = Outside { sky, sun, ground: DEFAULT_GROUND, fineness, ..Outside::default() };
    scene.clone().with_outside(outside).map_err(scene_file::failure)
}

/// That light as on the command line.
pub(crate) fn default_light(azimuth: Option<f64>) -> String {
    let sun = azimuth.map_or(String::new(), |azimuth| {
        format!(" --sun {azimuth},{DEFAULT_ELEVATION},{DEFAULT_SUN_W_M2}")
    });
    format!("--sky overcast={DEFAULT_SKY_W_M2}{sun} --ground {DEFAULT_GROUND}")
}

/// What is said of that light.
pub(crate) fn said_of_default(name: &str, azimuth: f64, why: &Unlit) -> String {
    let light = default_light(Some(azimuth));
    match why {
        Unlit::Dark => format!(
            "note: nothing emits light in `{name}`: lit by {light}; choose with --sky, --sun or --environment"
        ),
        Unlit::Dim(share) => format!(
            "note: what emits light in `{name}` reaches {:.0} % of what the view shows: {light} is added; --sky none leaves it \
             out",
            100.0 * share
        ),
    }
}

/// What is said of a lamp where no light from outside gets in.
pub(crate) fn said_of_lamp(name: &str, place: &str) -> String {
    format!(
        "note: no light from outside gets to what the view shows of `{name}`: a lamp is put {place}; choose with \
         --emit MATERIAL=RADIANCE, or --sky none for what the file has alone"
    )
}

/// Numbers between commas.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |piece: &str| match piece.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{piece}` is not a number")),
    };
    text.split(',').map(number).collect()
}

impl FromStr for SkyFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<SkyFlag, String> {
        let (name, given) = match text.split_once('=') {
            Some((name, given)) => (name, numbers(given)?),
            None => (text, Vec::new()),
        };
        let sky = match (name, given[..].iter().as_slice()) {
            ("none", []) => return Ok(SkyFlag { text: text.to_owned(), sky: None }),
            ("uniform", &[l]) => Sky::Uniform([l; 3]),
            ("uniform", &[r, g, b]) => Sky::Uniform([r, g, b]),
            ("overcast", []) => Sky::Overcast { irradiance: SKY_W_M2 },
            ("overcast", &[irradiance]) => Sky::Overcast { irradiance },
            ("clear", []) => Sky::Clear { irradiance: SKY_W_M2 },
            ("clear", &[irradiance]) => Sky::Clear { irradiance },
            ("perez", &[turbidity]) => Sky::Turbid { turbidity },
            ("perez", &[direct, diffuse]) => Sky::AllWeather { direct, diffuse },
            _ => {
                return Err(
                    "write none, uniform=L, uniform=R,G,B, overcast, overcast=E, clear, clear=E, \
                            perez=TURBIDITY or perez=DIRECT,DIFFUSE"
                        .into(),
                );
            }
        };
        Ok(SkyFlag { text: text.to_owned(), sky: Some(sky) })
    }
}

impl FromStr for SunFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<SunFlag, String> {
        let pieces: Vec<&str> = text.split(',').map(str::trim).collect();
        let flag = |place, irradiance, of_day_s| SunFlag {
            text: text.to_owned(),
            place,
            irradiance,
            of_day_s,
        };
        let written = "write AZIMUTH,ELEVATION[,E] or LATITUDE,LONGITUDE,TIME[,E], such as 135,40 or \
                       48.2,16.4,2026-06-21T12:00+02:00";
        let is_time = |piece: &&&str| piece[1..].contains('-') && !piece.contains(['e', 'E']);
        match pieces.get(2).filter(is_time) {
            Some(time) => {
                let (unix_s, of_day_s) = time_of(time)?;
                let place = numbers(&pieces[..2].join(","))?;
                let irradiance = match pieces.len() {
                    3 => None,
                    4 => Some(numbers(pieces[3])?[0]),
                    _ => return Err(written.into()),
                };
                let (latitude, longitude) = (place[0], place[1]);
                let place = SunPlace::Earth { latitude, longitude, unix_s };
                Ok(flag(place, irradiance, Some(of_day_s)))
            }
            None => match numbers(text)?[..] {
                [azimuth, elevation] => {
                    Ok(flag(SunPlace::Direction { azimuth, elevation }, None, None))
                }
                [azimuth, elevation, e] => {
                    Ok(flag(SunPlace::Direction { azimuth, elevation }, Some(e), None))
                }
                _ => Err(written.into()),
            },
        }
    }
}

impl FromStr for DayFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<DayFlag, String> {
        let written = || format!("`{text}` is no day: write 06:00..18:00 or 06:00..18:00/96");
        let (hours, frames) = match text.split_once('/') {
            Some((hours, frames)) => {
                let frames = frames.parse().ok().filter(|&n: &u32| n >= 2);
                (hours, Some(frames.ok_or_else(written)?))
            }
            None => (text, None),
        };
        let (from, to) = hours.split_once("..").ok_or_else(written)?;
        let (from_s, to_s) = (clock(from).ok_or_else(written)?, clock(to).ok_or_else(written)?);
        // Over midnight.
        let to_s = if to_s <= from_s { to_s + DAY_S } else { to_s };
        Ok(DayFlag { text: text.to_owned(), from_s, to_s, frames })
    }
}

impl fmt::Display for SunFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

const DAY_S: f64 = 86_400.0;

/// Seconds of a day of `06:30` or `06:30:15`.
fn clock(text: &str) -> Option<f64> {
    let mut parts = text.trim().split(':').map(|p| p.parse::<u32>().ok());
    let (hours, minutes) = (parts.next()??, parts.next()??);
    let seconds = match parts.next() {
        Some(seconds) => seconds?,
        None => 0,
    };
    let fits = hours <= 24 && minutes < 60 && seconds < 60 && parts.next().is_none();
    fits.then(|| f64::from(hours * 3600 + minutes * 60 + seconds))
}

/// Seconds since 1970, UTC, and seconds of the day in its own offset, of a time as in RFC 3339; seconds and offset may be
/// left out (UTC), and so may the time of a date (noon).
fn time_of(text: &str) -> Result<(f64, f64), String> {
    let wrong = || format!("`{text}` is no time: write 2026-06-21T12:00+02:00");
    let (date, rest) = match text.split_once(['T', 't', ' ']) {
        Some((date, rest)) => (date, rest),
        None => (text, "12:00"),
    };
    let (time, offset) = match rest.find(['Z', 'z', '+', '-']) {
        Some(at) => rest.split_at(at),
        None => (rest, "Z"),
    };
    let offset_s = match offset.split_at(1) {
        ("Z" | "z", "") => 0.0,
        ("+", hours) => clock(hours).ok_or_else(wrong)?,
        ("-", hours) => -clock(hours).ok_or_else(wrong)?,
        _ => return Err(wrong()),
    };
    let numbers: Option<Vec<i64>> = date.split('-').map(|p| p.parse().ok()).collect();
    let days = match numbers.as_deref() {
        Some(&[year, month, day])
            if (1..=12).contains(&month)
                && (1..=31).contains(&day)
                && (0..6000).contains(&year) =>
        {
            days_since_1970(year, month, day)
        }
        _ => return Err(wrong()),
    };
    let of_day_s = clock(time).ok_or_else(wrong)?;
    Ok((days as f64 * DAY_S + of_day_s - offset_s, of_day_s))
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    // Years that begin in March: the day that leap years add is their last.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let before = 365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    before + (153 * month + 2) / 5 + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suns_are_directions_or_places_with_a_time() {
        let sun = |text: &str| text.parse::<SunFlag>().unwrap();
        assert_eq!(sun("135,40").place, SunPlace::Direction { azimuth: 135.0, elevation: 40.0 });
        assert_eq!(sun("-135, 40, 800").irradiance, Some(800.0));
        assert_eq!(sun("-135,40,1e-3").irradiance, Some(1e-3));
        let there = sun("48.2,-16.4,2026-06-21T12:00+02:00,900");
        let unix_s = 1_782_036_000.0;
        let place = SunPlace::Earth { latitude: 48.2, longitude: -16.4, unix_s };
        assert_eq!((there.place, there.irradiance), (place, Some(900.0)));
        assert_eq!(there.of_day_s, Some(43_200.0));
        assert_eq!(sun("0,0,1970-01-01").of_day_s, Some(43_200.0));
        let wrong = ["", "1", "1,2,3,4", "a,b", "1,2,2026-13-01", "1,2,2026-06-21T25:00", "1,2,-"];
        wrong.iter().for_each(|text| assert!(text.parse::<SunFlag>().is_err(), "{text}"));
    }

    #[test]
    fn days_count_from_1970() {
        for (date, days) in [((1970, 1, 1), 0), ((2000, 3, 1), 11_017), ((2026, 6, 21), 20_625)] {
            assert_eq!(days_since_1970(date.0, date.1, date.2), days);
        }
    }

    #[test]
    fn skies_and_days_say_what_is_wrong_with_them() {
        let sky = |text: &str| text.parse::<SkyFlag>();
        for good in
            ["uniform=2", "uniform=1,2,3", "overcast", "clear=80", "perez=3", "perez=600,90"]
        {
            assert!(sky(good).is_ok(), "{good}");
        }
        for bad in ["", "uniform", "uniform=a", "blue", "perez=1,2,3", "overcast=1,2", "clear="] {
            assert!(sky(bad).is_err(), "{bad}");
        }
        let day = "22:00..04:00/49".parse::<DayFlag>().unwrap();
        assert_eq!((day.from_s, day.to_s, day.frames), (79_200.0, 100_800.0, Some(49)));
        for bad in ["", "6..18", "06:00-18:00", "06:00..18:00/1", "06:60..18:00", "06:00..18:00/x"]
        {
            assert!(bad.parse::<DayFlag>().is_err(), "{bad}");
        }
    }
}
