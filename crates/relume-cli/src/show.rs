//! `render --show`: the solution as numbers in colours, its elements, bodies and links, in place of pictures.
//!
//! Knows nothing of how frames are solved or where pictures go.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use glam::{DVec2, DVec3};
use relume::PEAK_LUMENS_PER_WATT;
use relume::element::ElementId;
use relume::scene::{BodyId, PatchId, Scene};
use relume::session::{Frame, Leaf, Session, Snapshot};
use relume_picture::drawing::{Drawing, Pen, with_legend};
use relume_picture::picture::{
    self, ColourMap, Image, Layers, Numbers, Outlines, Scale, Settings, View,
};

use crate::failure::Failure;
use crate::flat::draw::{BLACK, PINK};
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
    /// exposure shows as full white, of a surface that reflects half; levels 0 to 10].
    #[arg(long, value_name = "LOW,HIGH", requires = "show", allow_hyphen_values = true)]
    pub(crate) scale: Option<ScaleFlag>,
    /// Draw lines of equal numbers, which part the colours into N.
    #[arg(long, value_name = "N", requires = "show", default_value = "0", value_parser = clap::value_parser!(u32).range(0..=100), allow_negative_numbers = true)]
    pub(crate) isolines: u32,
    /// The body that `linked` and `links` are about [default: all that emit].
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
/// Links drawn at most: more are one pink surface.
const LINKS_MAX: usize = 20_000;
/// How much nearer than what is seen a place may be, as a share of the distance, and still be on it.
const ON_SURFACE: f64 = 0.01;

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

    /// An error where a body is named that is not there.
    pub(crate) fn check(&self, scene: &Scene) -> Result<(), Failure> {
        self.bodies(scene).map(drop)
    }

    /// What is drawn of a solution; `None` where pictures are wanted. `scale` is that of the exposure: display value over radiance.
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
        let [low, high] = match self.scale {
            Some(ScaleFlag(ends)) => ends,
            None if is_level => [0.0, high],
            None => [0.0, round_up(high)],
        };
        let map = match self.map {
            MapFlag::Viridis => ColourMap::Viridis,
            MapFlag::Turbo => ColourMap::Turbo,
            MapFlag::Grey => ColourMap::Grey,
        };
        let scale = Scale { map, low, high, lines: self.isolines };
        let steps = match (is_level, self.isolines) {
            (true, _) => (high - low).ceil().clamp(1.0, 20.0) as u32,
            (false, 0) => STEPS,
            (false, lines) => lines,
        };
        with_legend(scale.picture(numbers, [128; 3]), &scale, title, steps)
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

/// What a session has solved last.
fn solved(session: &Session) -> Frame<'_> {
    session.frame().expect("pictures are drawn of solutions")
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

/// Elements and links around some bodies, over a pale picture of what hides them.
struct Around<'a> {
    session: &'a Session,
    outlines: Outlines,
    view: &'a View,
    size: (u32, u32),
    /// Distances along the view of what is seen, row by row.
    depths: Vec<f32>,
    ground: Image,
}

impl<'a> Around<'a> {
    fn new(session: &'a Session, (view, settings): (&'a View, &Settings), layers: &Layers) -> Self {
        let (width, height) = (settings.width, settings.height);
        let back = view.world_from_camera.rotation.z_axis;
        let shade = |seen: &picture::Seen| {
            let facing = DVec3::from_array(seen.normal.map(f64::from)).dot(back).clamp(0.0, 1.0);
            let light = if seen.body == 0 { 1.0 } else { 0.8 + 0.15 * facing };
            [(255.0 * light).round() as u8; 3]
        };
        Around {
            session,
            outlines: Outlines::new(view, width, height),
            view,
            size: (width, height),
            depths: layers.pixels.iter().map(|seen| seen.depth_m).collect(),
            ground: Image { width, height, pixels: layers.pixels.iter().map(shade).collect() },
        }
    }

    fn sheet(&self) -> Drawing {
        let mut sheet = Drawing::new(self.size.0, self.size.1);
        sheet.picture([0, 0], self.ground.clone());
        sheet
    }

    /// The body of an element; `None` for clusters of several.
    fn body(&self, id: ElementId) -> Option<BodyId> {
        let (_, forest) = solved(self.session).pairs();
        let patch: PatchId = forest.patch(id)?;
        Some(self.session.scene().patches[patch.0 as usize].body)
    }

    /// Corners of an element in the world; `None` for groups, and where its body is absent.
    fn corners(&self, id: ElementId) -> Option<Vec<DVec3>> {
        let (_, forest) = solved(self.session).pairs();
        let scene = self.session.scene();
        let patch = &scene.patches[forest.patch(id)?.0 as usize];
        let pose = self.session.world().pose(patch.body)?;
        let shape = forest.shape(id);
        Some(shape.corners[..shape.len].iter().map(|&p| pose.point(patch.frame.point(p))).collect())
    }

    /// The links between some bodies and others: the end on them, and the other.
    fn ends(&self, bodies: &BTreeSet<BodyId>) -> Vec<[ElementId; 2]> {
        let (tree, _) = solved(self.session).pairs();
        let is_of = |id| self.body(id).is_some_and(|body| bodies.contains(&body));
        let ends = tree.links().filter_map(|link| match (is_of(link.a), is_of(link.b)) {
            (true, false) => Some([link.a, link.b]),
            (false, true) => Some([link.b, link.a]),
            _ => None,
        });
        ends.collect()
    }

    /// Whether nothing stands before a point.
    fn is_in_sight(&self, point: DVec3) -> bool {
        let Some(pixel) = self.view.project(point, self.size.0, self.size.1) else { return false };
        let DVec2 { x, y } = pixel.floor();
        if x < 0.0 || y < 0.0 || x >= f64::from(self.size.0) || y >= f64::from(self.size.1) {
            return false;
        }
        let depth = -self.view.world_from_camera.inverse_point(point).z;
        let seen = self.depths[y as usize * self.size.0 as usize + x as usize];
        depth <= f64::from(seen) * (1.0 + ON_SURFACE)
    }

    /// Outlines of the elements with links to some bodies, and of these in pink.
    fn linked(&self, bodies: &BTreeSet<BodyId>) -> Image {
        let mut sheet = self.sheet();
        let linked: BTreeSet<ElementId> = self.ends(bodies).into_iter().map(|[_, it]| it).collect();
        let outline = |sheet: &mut Drawing, polygon: &[DVec3], pen: Pen| {
            let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
            if self.outlines.faces(polygon) && self.is_in_sight(middle) {
                for [from, to] in self.outlines.edges(polygon) {
                    sheet.stroke(from.to_array(), to.to_array(), pen);
                }
            }
        };
        for polygon in linked.iter().filter_map(|&id| self.corners(id)) {
            outline(&mut sheet, &polygon, Pen::new(0.7, BLACK));
        }
        let (_, forest) = solved(self.session).pairs();
        for &facet in forest.facets() {
            if let (true, Some(polygon)) =
                (self.body(facet).is_some_and(|b| bodies.contains(&b)), self.corners(facet))
            {
                for [from, to] in self.outlines.edges(&polygon) {
                    sheet.stroke(from.to_array(), to.to_array(), Pen::new(2.0, PINK));
                }
            }
        }
        sheet.to_image(1)
    }

    /// Links of some bodies from middle to middle, the strongest last.
    fn links(&self, bodies: &BTreeSet<BodyId>) -> Image {
        let mut sheet = self.sheet();
        let middle = |id: ElementId| {
            let corners = self.corners(id)?;
            Some(corners.iter().sum::<DVec3>() / corners.len() as f64)
        };
        let ends = self.ends(bodies);
        let step = ends.len().div_ceil(LINKS_MAX).max(1);
        let pen = Pen {
            width: 0.6,
            colour: PINK,
            opacity: (600.0 / ends.len().max(1) as f64).clamp(0.08, 0.7),
        };
        for [own, other] in ends.into_iter().step_by(step) {
            let (Some(from), Some(to)) = (middle(own), middle(other)) else { continue };
            if !self.is_in_sight(to) {
                continue;
            }
            let place = |p: DVec3| self.view.project(p, self.size.0, self.size.1);
            if let (Some(from), Some(to)) = (place(from), place(to)) {
                sheet.stroke(from.to_array(), to.to_array(), pen);
                sheet.disc(to.to_array(), 1.2, PINK);
            }
        }
        sheet.to_image(1)
    }
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
