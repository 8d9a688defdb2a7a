//! Values of options: how each is written, its units and range. Whatever can be judged from the text alone is judged here.

use std::fmt;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use relume::session::Update;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;

/// Largest picture side, pixels.
const SIZE_MAX: u32 = 16_384;
/// Most threads that can be asked for.
const THREADS_MAX: usize = 1_024;

/// `--by`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum By {
    /// Each planar polygon: `floor/0`, `floor/1`.
    Patch,
    /// Each surface: an object, or a part of it of one material.
    Surface,
    /// Each body: what moves together.
    Body,
}

/// `--closure`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClosureFlag {
    /// As they are.
    None,
    /// Each row is divided by its sum; reciprocity is lost by as much as the sums differed.
    Rows,
    /// Exchange areas are scaled, the same in both directions, until rows sum to 1.
    Reciprocal,
}

/// `--format`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FactorFormat {
    /// A line for each factor above 0: frame,from,to,area_from_m2,factor.
    Csv,
    /// NumPy: `factors` (frame, from, to), `name`, `area_m2`, `frame`, `time_s`.
    Npz,
    /// SciPy: `scipy.sparse.load_npz` reads one CSR matrix, the frames one below the other.
    NpzSparse,
    /// The text file that View3D writes; one frame.
    View3d,
    /// The object of EnergyPlus that gives view factors by surface name; one frame.
    Energyplus,
}

impl By {
    /// As on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            By::Patch => "patch",
            By::Surface => "surface",
            By::Body => "body",
        }
    }
}

impl ClosureFlag {
    /// As on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            ClosureFlag::None => "none",
            ClosureFlag::Rows => "rows",
            ClosureFlag::Reciprocal => "reciprocal",
        }
    }
}

impl FactorFormat {
    /// As on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            FactorFormat::Csv => "csv",
            FactorFormat::Npz => "npz",
            FactorFormat::NpzSparse => "npz-sparse",
            FactorFormat::View3d => "view3d",
            FactorFormat::Energyplus => "energyplus",
        }
    }
}

/// The strategies that lose nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExactUpdate {
    /// Wait for certificates to expire.
    Certificate,
    /// Look again at the pairs that the motion may concern.
    Reinspect,
}

impl From<ExactUpdate> for UpdateFlag {
    fn from(update: ExactUpdate) -> UpdateFlag {
        match update {
            ExactUpdate::Certificate => UpdateFlag::Certificate,
            ExactUpdate::Reinspect => UpdateFlag::Reinspect,
        }
    }
}

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Pixels across.
    pub(crate) width: u32,
    /// Pixels down.
    pub(crate) height: u32,
}

/// How elements become colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Shading {
    /// One value an element.
    Flat,
    /// Interpolated over a triangulation.
    Gouraud,
    /// One continuous function over every surface.
    Smooth,
}

/// `render --format`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FrameFormat {
    /// Colours as screens show them, 8 bits.
    Png,
    /// OpenEXR: radiance in W/m2/sr, linear, 32 bits; layers irradiance, reflectance, normal, depth and body.
    Exr,
}

impl FrameFormat {
    /// Ending of the files' names.
    pub(crate) fn ending(self) -> &'static str {
        match self {
            FrameFormat::Png => "png",
            FrameFormat::Exr => "exr",
        }
    }
}

/// `--exposure`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ExposureFlag {
    /// Chosen once for the clip.
    Auto,
    /// Stops.
    Stops(f64),
}

/// `--oracle`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum OracleFlag {
    /// The estimated error of irradiance.
    Error,
    /// The paper's threshold.
    FormFactor {
        /// Largest form factor of a link.
        epsilon: f64,
        /// Smallest element that is refined, m2; `None`: a share of the scene's area.
        min_area_m2: Option<f64>,
    },
}

/// `--update`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UpdateFlag {
    /// Wait for certificates to expire.
    Certificate,
    /// Look again at the pairs that the motion may concern, and at no other.
    Reinspect,
    /// Follow a line through the last two evaluations.
    Extrapolate {
        /// Frames ahead at most, where given.
        frames: Option<u32>,
    },
    /// Rebuild everything in every frame.
    Scratch,
}

/// How the links follow the motion.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct UpdateChoice {
    /// How the links follow the motion. `certificate`: what the known motion cannot concern before some
    /// time is not looked at until then. `reinspect`: what the motion since the last frame may
    /// concern. `scratch`: everything anew in every frame. The links of a frame are the same with
    /// these three. `extrapolate[=N]`: the paper's prediction, up to N frames ahead (7 if not
    /// given); quicker and less exact.
    #[arg(long = "update", value_name = "STRATEGY", default_value = "certificate")]
    pub(crate) strategy: UpdateFlag,
    /// With `--update extrapolate`: evaluate a link again as soon as its exchange is estimated to be off by
    /// this share; N then is the limit (4 if not given). An estimate, no bound: what no line foretells, such as
    /// a shadow that reaches a clear link, is not seen.
    #[arg(long, value_name = "E", value_parser = parse_share, allow_negative_numbers = true)]
    pub(crate) error: Option<f64>,
}

/// `--max-memory`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MemorySize {
    /// Bytes.
    pub(crate) bytes: u64,
}

pub(super) fn parse_fps(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(fps) if fps.is_finite() && fps > 0.0 => Ok(fps),
        _ => Err("frames a second must be a number above 0, such as 24 or 29.97".into()),
    }
}

pub(super) fn parse_tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(tolerance) if tolerance > 0.0 && tolerance < 1.0 => Ok(tolerance),
        _ => Err("the tolerance is a relative error between 0 and 1, such as 0.02 for 2 %".into()),
    }
}

pub(super) fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(error) if error > 0.0 && error < 1.0 => Ok(error),
        _ => Err("give a relative error between 0 and 1, such as 0.01 for 1 %".into()),
    }
}

pub(super) fn parse_every(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(every) if every > 0 => Ok(every),
        _ => Err("give a whole number of frames, 1 or more".into()),
    }
}

pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(threads) if (1..=THREADS_MAX).contains(&threads) => Ok(threads),
        _ => Err(format!("give a number of threads from 1 to {THREADS_MAX}")),
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Size, String> {
        let side = |piece: &str| piece.parse().ok().filter(|s| (1..=SIZE_MAX).contains(s));
        text.split_once(['x', 'X'])
            .and_then(|(w, h)| Some(Size { width: side(w)?, height: side(h)? }))
            .ok_or_else(|| format!("write WIDTHxHEIGHT in pixels, each 1 to {SIZE_MAX}: 640x480"))
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// How the error of frames is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AccuracyFlag {
    /// As far as a tenth of the time of a cold build goes.
    Quick,
    /// By walks at so many points.
    Points(u32),
    /// Not at all.
    Off,
}

impl FromStr for AccuracyFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<AccuracyFlag, String> {
        match (text, text.parse()) {
            ("quick", _) => Ok(AccuracyFlag::Quick),
            ("off", _) => Ok(AccuracyFlag::Off),
            (_, Ok(points @ 1..)) => Ok(AccuracyFlag::Points(points)),
            _ => Err("write `off` or a number of points from 1 on".into()),
        }
    }
}

impl FromStr for ExposureFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<ExposureFlag, String> {
        if text == "auto" {
            return Ok(ExposureFlag::Auto);
        }
        match text.parse::<f64>() {
            Ok(stops) if stops.abs() <= 100.0 => Ok(ExposureFlag::Stops(stops)),
            _ => Err("write `auto` or a number of stops from -100 to 100, such as 1.5".into()),
        }
    }
}

impl fmt::Display for ExposureFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ExposureFlag::Auto => f.write_str("auto"),
            ExposureFlag::Stops(stops) => write!(f, "{stops}"),
        }
    }
}

impl FromStr for OracleFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<OracleFlag, String> {
        if text == "error" {
            return Ok(OracleFlag::Error);
        }
        let Some(numbers) = text.strip_prefix("form-factor=") else {
            return Err(
                "write `error` or `form-factor=EPS[,MINAREA]`: form-factor=0.02,0.001".into()
            );
        };
        let (epsilon, area) = match numbers.split_once(',') {
            Some((epsilon, area)) => (epsilon, Some(area)),
            None => (numbers, None),
        };
        let epsilon = epsilon
            .parse::<f64>()
            .ok()
            .filter(|e| *e > 0.0 && *e < 1.0)
            .ok_or("EPS is a form factor between 0 and 1, such as 0.02")?;
        let min_area_m2 = area
            .map(|area| {
                area.parse::<f64>()
                    .ok()
                    .filter(|a| a.is_finite() && *a > 0.0)
                    .ok_or("MINAREA is an area in m2 above 0, such as 0.001")
            })
            .transpose()?;
        Ok(OracleFlag::FormFactor { epsilon, min_area_m2 })
    }
}

impl fmt::Display for OracleFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OracleFlag::Error => f.write_str("error"),
            OracleFlag::FormFactor { epsilon, min_area_m2: None } => {
                write!(f, "form-factor={epsilon}")
            }
            OracleFlag::FormFactor { epsilon, min_area_m2: Some(area) } => {
                write!(f, "form-factor={epsilon},{area}")
            }
        }
    }
}

impl FromStr for UpdateFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<UpdateFlag, String> {
        Ok(match text {
            "certificate" => UpdateFlag::Certificate,
            "reinspect" => UpdateFlag::Reinspect,
            "scratch" => UpdateFlag::Scratch,
            "extrapolate" => UpdateFlag::Extrapolate { frames: None },
            _ => {
                let frames = text
                    .strip_prefix("extrapolate=")
                    .ok_or("write `certificate`, `reinspect`, `extrapolate[=N]` or `scratch`")?;
                let frames = frames.parse().ok().filter(|n| (1..=255).contains(n));
                let frames = frames.ok_or("N is the number of frames ahead, 1 to 255")?;
                UpdateFlag::Extrapolate { frames: Some(frames) }
            }
        })
    }
}

/// The paper looks seven frames ahead.
const FRAMES_AHEAD: u32 = 7;

/// Frames ahead where an error is stated instead.
const FRAMES_AHEAD_AT_MOST: u32 = 4;

impl UpdateChoice {
    /// A strategy without a stated error.
    pub(crate) const fn of(strategy: UpdateFlag) -> UpdateChoice {
        UpdateChoice { strategy, error: None }
    }

    /// The name on the command line and in the report.
    pub(crate) fn name(self) -> String {
        let name = match self.strategy {
            UpdateFlag::Certificate => "certificate".to_owned(),
            UpdateFlag::Reinspect => "reinspect".to_owned(),
            UpdateFlag::Scratch => "scratch".to_owned(),
            UpdateFlag::Extrapolate { frames: None } if self.error.is_some() => {
                "extrapolate".to_owned()
            }
            UpdateFlag::Extrapolate { frames } => {
                format!("extrapolate={}", frames.unwrap_or(FRAMES_AHEAD))
            }
        };
        match self.error {
            Some(error) => format!("{name} --error {error}"),
            None => name,
        }
    }

    /// What the engine is asked for.
    ///
    /// Fails if an error is stated without extrapolation.
    pub(crate) fn asked_for(self) -> Result<Update, Failure> {
        self.update().ok_or_else(|| {
            Failure::usage(
                "--error goes with --update extrapolate only: the other strategies have none",
            )
            .help("leave out --error, or add --update extrapolate")
        })
    }

    /// The same; `None` if an error is stated without extrapolation.
    fn update(self) -> Option<Update> {
        Some(match (self.strategy, self.error) {
            (UpdateFlag::Extrapolate { frames }, error) => {
                let most = if error.is_some() { FRAMES_AHEAD_AT_MOST } else { FRAMES_AHEAD };
                Update::Extrapolate { frames: frames.unwrap_or(most), error }
            }
            (_, Some(_)) => return None,
            (UpdateFlag::Certificate, None) => Update::Certificate,
            (UpdateFlag::Reinspect, None) => Update::Reinspect,
            (UpdateFlag::Scratch, None) => Update::Scratch,
        })
    }
}

impl FromStr for MemorySize {
    type Err = String;

    fn from_str(text: &str) -> Result<MemorySize, String> {
        let wrong = || "write a number of bytes, or with K, M, G or T: 4G, 512M, 1.5G".to_owned();
        let upper = text.trim().to_ascii_uppercase();
        let unit = upper.trim_end_matches("IB").trim_end_matches('B');
        let (number, scale) = match unit.chars().last() {
            Some('K') => (&unit[..unit.len() - 1], 1u64 << 10),
            Some('M') => (&unit[..unit.len() - 1], 1 << 20),
            Some('G') => (&unit[..unit.len() - 1], 1 << 30),
            Some('T') => (&unit[..unit.len() - 1], 1 << 40),
            _ => (unit, 1),
        };
        let number: f64 = number.trim().parse().map_err(|_| wrong())?;
        let bytes = number * scale as f64;
        if !(bytes >= 1.0 && bytes < 2f64.powi(63)) {
            return Err(wrong());
        }
        Ok(MemorySize { bytes: bytes as u64 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory() {
        let bytes = |text: &str| text.parse::<MemorySize>().map(|m| m.bytes);
        assert_eq!(bytes("4G"), Ok(4 << 30));
        assert_eq!(bytes("512M"), Ok(512 << 20));
        assert_eq!(bytes("1.5GiB"), Ok(3 << 29));
        assert_eq!(bytes("64kb"), Ok(64 << 10));
        assert_eq!(bytes("1000"), Ok(1000));
        for wrong in ["", "G", "-1G", "0", "NaN", "inf", "four", "1e40"] {
            assert!(bytes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn oracles() {
        let oracle = |text: &str| text.parse::<OracleFlag>();
        assert_eq!(oracle("error"), Ok(OracleFlag::Error));
        assert_eq!(
            oracle("form-factor=0.02"),
            Ok(OracleFlag::FormFactor { epsilon: 0.02, min_area_m2: None })
        );
        assert_eq!(
            oracle("form-factor=0.02,0.001"),
            Ok(OracleFlag::FormFactor { epsilon: 0.02, min_area_m2: Some(0.001) })
        );
        for wrong in ["", "bf", "form-factor", "form-factor=", "form-factor=2", "form-factor=0.1,0"]
        {
            assert!(oracle(wrong).is_err(), "{wrong}");
        }
        for text in ["error", "form-factor=0.02", "form-factor=0.02,0.001"] {
            assert_eq!(oracle(text).unwrap().to_string(), text);
        }
    }

    #[test]
    fn strategies() {
        let of = |text: &str, error| {
            text.parse::<UpdateFlag>().map(|strategy| UpdateChoice { strategy, error })
        };
        for text in ["certificate", "reinspect", "scratch", "extrapolate=3"] {
            assert_eq!(of(text, None).unwrap().name(), text);
        }
        let seven = Some(Update::Extrapolate { frames: 7, error: None });
        assert_eq!(of("extrapolate", None).unwrap().update(), seven);
        assert_eq!(of("extrapolate", None).unwrap().name(), "extrapolate=7");
        let stated = of("extrapolate", Some(0.01)).unwrap();
        assert_eq!(stated.name(), "extrapolate --error 0.01");
        assert_eq!(stated.update(), Some(Update::Extrapolate { frames: 4, error: Some(0.01) }));
        assert_eq!(of("reinspect", Some(0.01)).unwrap().update(), None);
        for wrong in ["", "predict", "extrapolate=", "extrapolate=0", "extrapolate=256"] {
            assert!(of(wrong, None).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_and_exposures() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        for wrong in ["640", "0x480", "640x99999", "axb", "-1x3"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
        assert_eq!("auto".parse(), Ok(ExposureFlag::Auto));
        assert_eq!("-1.5".parse(), Ok(ExposureFlag::Stops(-1.5)));
        assert!("NaN".parse::<ExposureFlag>().is_err());
    }
}
