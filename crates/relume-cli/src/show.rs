//! `render --show`: the solution as numbers in colours, its elements, bodies and links, in place of pictures.
//!
//! Knows nothing of how frames are solved or where pictures go.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use relume::PEAK_LUMENS_PER_WATT;
use relume::scene::{BodyId, Scene};
use relume::session::{Leaf, Session, Snapshot, Update};
use relume_picture::drawing::with_legend;
use relume_picture::picture::{self, ColourMap, Image, Numbers, Scale, Settings, View};

use crate::around::{Around, solved};
use crate::failure::Failure;
use crate::output;

/// `--show` and what goes with it.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct ShowFlags {
    /// Show the solution itself in place of a picture: a number in colours with a legend, or elements, bodies and links.
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with_all = ["preview", "mesh"])]
    pub(crate) show: Option<Shown>,
    /// Colours of numbers.
    #[arg(long, value_enum, value_name = "MAP", default_value = "viridis", requires = "show")]
    pub(crate) map: MapFlag,
    /// Numbers at the ends of the colours, LOW,HIGH in the unit of what is shown, the same for all frames [default: from 0 to what the
    /// exposure shows as full white, of a surface that reflects half; levels 0 to 10; certificates 64 frames].
    #[arg(long, value_name = "LOW,HIGH", requires = "show", allow_hyphen_values = true)]
    pub(crate) scale: Option<ScaleFlag>,
    /// Draw lines of equal numbers, which part the colours into N.
    #[arg(long, value_name = "N", requires = "show", default_value = "0", value_parser = clap::value_parser!(u32).range(0..=100), allow_negative_numbers = true)]
    pub(crate) isolines: u32,
    /// The body that `linked`, `links`, `certificates` and `events` are about [default: all that emit; events: all].
    #[arg(long, value_name = "BODY", requires = "show")]
    pub(crate) of: Option<String>,
}

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Shown {
    /// Radiosity, W/m2: luminance of the channels.
    Radiosity,
    /// Irradiance, W/m2: luminance of the channels.
    Irradiance,
    /// Illuminance, lx: 683 times that, as glTF reckons.
    Illuminance,
    /// By how much light gathered anew over links of each leaf's own differs from the mesh's, W/m2: a part of its error.
    Error,
    /// How often each leaf's polygon was quartered to get it.
    Level,
    /// The outlines of the leaves.
    Mesh,
    /// Each body in a colour of its own.
    Body,
    /// The elements that are linked with a body (the paper's figure 0.5).
    Linked,
    /// Links with a body, from middle to middle of their elements.
    Links,
    /// What happened to links since the frame before, in colours.
    Events,
    /// Links with a body, in the colours of how long nothing is certified to change what hides them, s.
    Certificates,
}

/// `--map`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum MapFlag {
    /// Violet, green, yellow: lighter is more.
    #[default]
    Viridis,
    /// Blue, green, red.
    Turbo,
    /// Black to white.
    Grey,
}

/// `--scale`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ScaleFlag([f64; 2]);

impl FromStr for ScaleFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<ScaleFlag, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[low, high]) if low.is_finite() && high.is_finite() && low < high => {
                Ok(ScaleFlag([low, high]))
            }
            _ => Err("write two numbers, the smaller first, with a comma: 0,500".into()),
        }
    }
}

impl fmt::Display for ScaleFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.0[0], self.0[1])
    }
}

/// Highest level of the colours.
const LEVELS: f64 = 10.0;
/// Numbers beside the colours, where levels are not counted.
const STEPS: u32 = 5;
impl ShowFlags {
    /// As on the command line, for reports.
    pub(crate) fn described(&self) -> Vec<String> {
        let Some(shown) = self.show else { return Vec::new() };
        let name = |value: &dyn Fn() -> Option<clap::builder::PossibleValue>| {
            value().map_or(String::new(), |v| v.get_name().to_owned())
        };
        let all = [
            Some(format!("--show {}", name(&|| shown.to_possible_value()))),
            Some(format!("--map {}", name(&|| self.map.to_possible_value()))),
            self.scale.map(|scale| format!("--scale {scale}")),
            (self.isolines > 0).then(|| format!("--isolines {}", self.isolines)),
            self.of.as_ref().map(|body| format!("--of {body}")),
        ];
        all.into_iter().flatten().collect()
    }

    /// An error where a body is named that is not there, or what `update` does not keep is to be shown.
    pub(crate) fn check(&self, scene: &Scene, update: Update) -> Result<(), Failure> {
        let needed = match self.show {
            Some(Shown::Certificates) if update != Update::Certificate => {
                "there are certificates with --update certificate alone"
            }
            Some(Shown::Events) if update == Update::Scratch => {
                "with --update scratch links have no past"
            }
            _ => return self.bodies(scene).map(drop),
        };
        Err(Failure::usage(needed).help("leave out --update"))
    }

    /// Whether what happens to links is to be kept.
    pub(crate) fn needs_events(&self) -> bool {
        self.show == Some(Shown::Events)
    }

    /// Frames to be solved before one, where the last that was solved is another: so that what is shown does not depend on which
    /// frames are asked for. Certificates are made anew, as time that went back voids them.
    pub(crate) fn frames_before(&self, frame: u32, last: Option<u32>) -> Vec<u32> {
        match (self.show, frame.checked_sub(1)) {
            (Some(Shown::Events), Some(before)) if last != Some(before) => vec![before],
            (Some(Shown::Certificates), Some(before)) => vec![frame, before],
            _ => Vec::new(),
        }
    }

    /// What is drawn of a solution; `None` where pictures are wanted. `scale` is that of the exposure: display value over radiance.
    // Over 60 lines: a case for each thing that is shown.
    pub(crate) fn draw(
        &self,
        session: &Session,
        snapshot: &Snapshot,
        (view, settings): (&View, &Settings),
        scale: f64,
    ) -> Result<Option<Image>, Failure> {
        let Some(shown) = self.show else { return Ok(None) };
        let layers = || picture::layers(snapshot, view, settings);
        let of_leaves = |of: &dyn Fn(usize, &Leaf) -> f32| {
            let numbers: Vec<f32> =
                snapshot.leaves.iter().enumerate().map(|(k, leaf)| of(k, leaf)).collect();
            picture::numbers_of_leaves(snapshot, view, settings, &numbers)
        };
        // What leaves a white surface that is shown as full white.
        let white = PI / scale;
        let image = match shown {
            Shown::Mesh => picture::mesh(snapshot, view, settings),
            Shown::Body => picture::bodies(snapshot, view, settings),
            Shown::Linked | Shown::Links => {
                let bodies = self.bodies(session.scene())?;
                let around = Around::new(session, (view, settings), &layers());
                if shown == Shown::Links { around.links(&bodies) } else { around.linked(&bodies) }
            }
            Shown::Events => {
                let bodies = self.of.as_ref().map(|_| self.bodies(session.scene())).transpose()?;
                Around::new(session, (view, settings), &layers()).events(bodies.as_ref())
            }
            Shown::Certificates => {
                let bodies = self.bodies(session.scene())?;
                let (links, horizon_s) = solved(session).certificates();
                let scale = self.scale(0.0, if horizon_s > 0.0 { horizon_s } else { 1.0 });
                let around = Around::new(session, (view, settings), &layers());
                let image = around.certificates(&links, &bodies, &scale);
                with_legend(image, &scale, "LEFT S", STEPS - 1)
            }
            Shown::Radiosity => {
                let of = |seen: &picture::Seen| PI as f32 * luminance(seen.radiance);
                self.coloured(&picture::numbers_of(&layers(), of), white, "B W/M2")
            }
            Shown::Irradiance => {
                let of = |seen: &picture::Seen| luminance(seen.irradiance);
                self.coloured(&picture::numbers_of(&layers(), of), 2.0 * white, "H W/M2")
            }
            Shown::Illuminance => {
                let of =
                    |seen: &picture::Seen| PEAK_LUMENS_PER_WATT as f32 * luminance(seen.irradiance);
                let numbers = picture::numbers_of(&layers(), of);
                self.coloured(&numbers, 2.0 * PEAK_LUMENS_PER_WATT * white, "E LX")
            }
            Shown::Error => {
                let anew = solved(session).reconstruction();
                let off = |k: usize, leaf: &Leaf| {
                    let [one, other] = [leaf.irradiance, anew.leaves[k].irradiance];
                    luminance([0, 1, 2].map(|c| (one[c] - other[c]).abs()))
                };
                self.coloured(&of_leaves(&off), 0.02 * white, "ERROR W/M2")
            }
            Shown::Level => {
                let numbers = of_leaves(&|_, leaf| leaf.level() as f32);
                self.coloured(&numbers, LEVELS, "LEVEL")
            }
        };
        Ok(Some(image))
    }

    fn coloured(&self, numbers: &Numbers, high: f64, title: &str) -> Image {
        let is_level = title == "LEVEL";
        let scale = self.scale(0.0, if is_level { high } else { round_up(high) });
        let Scale { low, high, .. } = scale;
        let steps = match (is_level, self.isolines) {
            (true, _) => (high - low).ceil().clamp(1.0, 20.0) as u32,
            (false, 0) => STEPS,
            (false, lines) => lines,
        };
        with_legend(scale.picture(numbers, [128; 3]), &scale, title, steps)
    }

    /// The colours, from numbers at their ends that hold where none were given.
    fn scale(&self, low: f64, high: f64) -> Scale {
        let [low, high] = self.scale.map_or([low, high], |ScaleFlag(ends)| ends);
        let map = match self.map {
            MapFlag::Viridis => ColourMap::Viridis,
            MapFlag::Turbo => ColourMap::Turbo,
            MapFlag::Grey => ColourMap::Grey,
        };
        Scale { map, low, high, lines: self.isolines }
    }

    /// The bodies that links are about.
    fn bodies(&self, scene: &Scene) -> Result<BTreeSet<BodyId>, Failure> {
        let Some(name) = &self.of else {
            let emits = |patch: &&relume::scene::Patch| scene.patch_emits(patch);
            return Ok(scene.patches.iter().filter(emits).map(|patch| patch.body).collect());
        };
        let found = (0..).zip(&scene.bodies).find(|(_, body)| body.name == *name);
        match found {
            Some((k, _)) => Ok([BodyId(k)].into()),
            None => Err(Failure::usage(format_args!(
                "there is no body `{}` in the scene",
                output::name(name)
            ))
            .help("`relume info` lists the bodies")),
        }
    }
}

/// Of linear RGB (Rec. 709).
fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The next of 1, 2, 5, 10, 20 ...
fn round_up(value: f64) -> f64 {
    if value.is_nan() || value <= 0.0 || value.is_infinite() {
        return 1.0;
    }
    let unit = 10_f64.powf(value.log10().floor());
    let first = [1.0, 2.0, 5.0].into_iter().find(|step| step * unit >= value * (1.0 - 1e-9));
    first.unwrap_or(10.0) * unit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_on_round_numbers_and_are_read_as_written() {
        assert_eq!(
            [0.3, 1.0, 1.1, 4.9, 7.0, 20.0, 0.0].map(round_up),
            [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 1.0]
        );
        assert_eq!("0,500".parse(), Ok(ScaleFlag([0.0, 500.0])));
        for wrong in ["", "5", "5,1", "1,1", "0,inf", "0,1,2", "a,b"] {
            assert!(wrong.parse::<ScaleFlag>().is_err(), "{wrong}");
        }
    }
}
