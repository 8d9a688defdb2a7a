//! Where pictures are taken from: a camera of the file, a place given on the command line, or an overview;
//! standing still, or turning about the scene.

use std::fmt;
use std::str::FromStr;

use clap::Args;
use glam::DVec3;
use relume::Aabb;
use relume::scene::{Projection, Scene};
use relume_picture::picture::{View, Viewpoint};

use crate::failure::Failure;
use crate::frames;

/// Vertical field of view from a place that is given, degrees.
const FOV: f64 = 40.0;

/// Where pictures are taken from.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct ViewFlags {
    /// Name of the camera in the file [default: the first; an overview where there is none].
    #[arg(long, value_name = "NAME")]
    pub(crate) camera: Option<String>,
    /// An overview, chosen by what is lit, also where the file has a camera.
    #[arg(long, conflicts_with_all = ["camera", "eye"])]
    pub(crate) overview: bool,
    /// Where to look from, metres in the world.
    #[arg(long, value_name = "X,Y,Z", conflicts_with = "camera", allow_hyphen_values = true)]
    pub(crate) eye: Option<Triple>,
    /// What to look at from there, metres [default: the middle of the scene].
    #[arg(long, value_name = "X,Y,Z", requires = "eye", allow_hyphen_values = true)]
    pub(crate) look_at: Option<Triple>,
    /// Which way is up, with --eye or --turntable [default: 0,1,0].
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) up: Option<Triple>,
    /// Vertical field of view, degrees [default: the camera's; 40 with --eye].
    #[arg(long, value_name = "DEGREES", value_parser = parse_fov, allow_negative_numbers = true)]
    pub(crate) fov: Option<f64>,
    /// Turns the view about the scene, once in N frames: about what is looked at, or on the spot where the view is
    /// from within the scene. N frames at least; what moves moves meanwhile and then rests. Where nothing
    /// moves the scene is solved once.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000), allow_negative_numbers = true)]
    pub(crate) turntable: Option<u32>,
}

impl ViewFlags {
    /// As on the command line, for reports, the camera aside: nothing where all is as the file says.
    pub(crate) fn described(&self) -> Vec<String> {
        let triple = |name: &str, value: Option<Triple>| value.map(|v| format!("--{name} {v}"));
        let all = [
            self.overview.then(|| "--overview".to_owned()),
            triple("eye", self.eye),
            triple("look-at", self.look_at),
            triple("up", self.up),
            self.fov.map(|degrees| format!("--fov {degrees}")),
            self.turntable.map(|frames| format!("--turntable {frames}")),
        ];
        all.into_iter().flatten().collect()
    }

    /// Frames that a run has at least.
    pub(crate) fn frames_at_least(&self) -> u32 {
        self.turntable.unwrap_or(1)
    }
}

/// Three numbers with commas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Triple(DVec3);

impl FromStr for Triple {
    type Err = String;

    fn from_str(text: &str) -> Result<Triple, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, z]) if relume::scene::limits::is_place(&[x, y, z]) => {
                Ok(Triple(DVec3::new(x, y, z)))
            }
            _ => Err("write three numbers with commas and no spaces: 0,1.5,4".into()),
        }
    }
}

impl fmt::Display for Triple {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}", self.0.x, self.0.y, self.0.z)
    }
}

fn parse_fov(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(degrees) if (0.1..=170.0).contains(&degrees) => Ok(degrees),
        _ => Err("the field of view is an angle from 0.1 to 170 degrees".into()),
    }
}

/// The views of a clip.
pub(crate) struct Viewing {
    viewpoint: Viewpoint,
    /// In place of the viewpoint's own, radians.
    yfov: Option<f64>,
    turn: Option<Turn>,
}

/// A view that turns.
struct Turn {
    about: DVec3,
    up: DVec3,
    /// Frames in which it comes round.
    frames: u32,
}

impl Viewing {
    /// The views of a scene that flags ask for.
    pub(crate) fn new(scene: &Scene, flags: &ViewFlags) -> Result<Viewing, Failure> {
        let bounds = scene.bounds(0.0).unwrap_or(Aabb { lo: DVec3::ZERO, hi: DVec3::ZERO });
        let middle = bounds.centre();
        let look_at = flags.look_at.map_or(middle, |triple| triple.0 - scene.origin);
        let up = flags.up.map_or(DVec3::Y, |triple| triple.0);
        let viewpoint = match (flags.eye, flags.overview) {
            (Some(Triple(eye)), _) => Viewpoint::Fixed(from(eye - scene.origin, look_at, up)?),
            (None, true) => Viewpoint::Fixed(View::automatic(scene)),
            (None, false) => {
                Viewpoint::new(scene, flags.camera.as_deref()).map_err(Failure::new)?
            }
        };
        let turn = match flags.turntable {
            None => None,
            Some(frames) => {
                let up = up.try_normalize().ok_or_else(no_direction)?;
                let eye = viewpoint.at(scene, 0.0).map_err(Failure::new)?;
                let eye = eye.world_from_camera.translation;
                // Within the scene it would circle through walls.
                let within = eye.cmpgt(bounds.lo).all() && eye.cmplt(bounds.hi).all();
                let about = if within && flags.look_at.is_none() { eye } else { look_at };
                Some(Turn { about, up, frames })
            }
        };
        Ok(Viewing { viewpoint, yfov: flags.fov.map(f64::to_radians), turn })
    }

    /// The view of a frame.
    pub(crate) fn at(&self, scene: &Scene, frame: u32, fps: f64) -> Result<View, Failure> {
        let view = self.at_time(scene, frames::time_of(frame, fps))?;
        match &self.turn {
            None => Ok(view),
            Some(turn) => {
                let turns = f64::from(frame % turn.frames) / f64::from(turn.frames);
                Ok(view.turned(turn.about, turn.up, turns))
            }
        }
    }

    /// The view at a time, not turned.
    pub(crate) fn at_time(&self, scene: &Scene, time_s: f64) -> Result<View, Failure> {
        let mut view = self.viewpoint.at(scene, time_s).map_err(Failure::new)?;
        if let (Some(wanted), Projection::Perspective { yfov, aspect }) =
            (self.yfov, &mut view.projection)
        {
            (*yfov, *aspect) = (wanted, None);
        }
        Ok(view)
    }
}

/// A view from a place that was given.
fn from(eye: DVec3, look_at: DVec3, up: DVec3) -> Result<View, Failure> {
    let back = eye - look_at;
    if back.try_normalize().is_none() {
        return Err(Failure::usage(
            "--eye is where --look-at is, so there is no direction to look in",
        )
        .help("move one of them"));
    }
    let across = up.normalize_or_zero().cross(back.normalize());
    if across.length() < 1e-9 && up != DVec3::Y {
        return Err(no_direction());
    }
    Ok(View::look_at_with_up(eye, look_at, up, FOV.to_radians()))
}

fn no_direction() -> Failure {
    Failure::usage("--up is no direction, or the one that is looked in")
        .help("give the axis that is to be upright in the picture, such as 0,1,0 or 0,0,1")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::DemoScene;
    use crate::demo;

    fn flags() -> ViewFlags {
        ViewFlags { eye: Some(Triple(DVec3::new(0.0, 1.0, 9.0))), ..ViewFlags::default() }
    }

    fn scene() -> Scene {
        (demo::demo(DemoScene::Room).build)().unwrap()
    }

    #[test]
    fn places_are_three_numbers() {
        assert_eq!("-1,2.5,0".parse(), Ok(Triple(DVec3::new(-1.0, 2.5, 0.0))));
        for wrong in ["1,2", "1,2,3,4", "a,b,c", "NaN,0,0", "inf,0,0", ""] {
            assert!(wrong.parse::<Triple>().is_err(), "{wrong}");
        }
        assert!(parse_fov("0").is_err() && parse_fov("180").is_err() && parse_fov("60").is_ok());
    }

    #[test]
    fn a_place_looks_at_the_middle_unless_told_otherwise() {
        let scene = scene();
        let middle = scene.bounds(0.0).unwrap().centre();
        let view = Viewing::new(&scene, &flags()).unwrap().at(&scene, 0, 24.0).unwrap();
        let centre = glam::DVec2::new(50.0, 50.0);
        assert!(view.project(middle, 100, 100).unwrap().distance(centre) < 1e-9);
        let at = DVec3::new(1.0, 0.0, 0.0);
        let flags = ViewFlags { look_at: Some(Triple(at)), fov: Some(90.0), ..flags() };
        let view = Viewing::new(&scene, &flags).unwrap().at(&scene, 0, 24.0).unwrap();
        assert!(view.project(at, 100, 100).unwrap().distance(centre) < 1e-9);
        let yfov = std::f64::consts::FRAC_PI_2;
        assert_eq!(view.projection, Projection::Perspective { yfov, aspect: None });
    }

    #[test]
    fn a_turntable_comes_round() {
        let scene = scene();
        let flags = ViewFlags { turntable: Some(4), ..flags() };
        let views = Viewing::new(&scene, &flags).unwrap();
        let eye = |frame| views.at(&scene, frame, 24.0).unwrap().world_from_camera.translation;
        let middle = scene.bounds(0.0).unwrap().centre();
        assert_eq!(eye(0), eye(4));
        let opposite = 2.0 * middle - eye(0);
        assert!((eye(2) - opposite.with_y(1.0)).length() < 1e-9, "{}", eye(2));
        assert!((eye(1).distance(middle) - eye(0).distance(middle)).abs() < 1e-9);
        // On the spot from within.
        let flags = ViewFlags { eye: Some(Triple(middle + DVec3::X * 0.1)), ..flags };
        let views = Viewing::new(&scene, &flags).unwrap();
        let eye = |frame| views.at(&scene, frame, 24.0).unwrap().world_from_camera.translation;
        assert!(eye(0).distance(eye(1)) < 1e-12);
    }

    #[test]
    fn views_without_a_direction_are_refused() {
        let same = ViewFlags { look_at: flags().eye, ..flags() };
        assert!(Viewing::new(&scene(), &same).is_err());
        let along = Triple(DVec3::new(0.0, 0.0, 1.0));
        let at = Some(Triple(DVec3::new(0.0, 1.0, 0.0)));
        assert!(
            Viewing::new(&scene(), &ViewFlags { look_at: at, up: Some(along), ..flags() }).is_err()
        );
    }
}
