//! Views that an overview is chosen from: from around the scene, and from points of free space within.
//!
//! Must not know how they are judged, apart from what is in sight around a point.

use glam::{DVec2, DVec3};

use super::super::camera::View;
use super::super::tuning::{BEHIND, INSIDE, OPEN, ROOM, SPAN, YFOV_INSIDE, YFOV_OUTSIDE};
use super::bounds::{ASPECT, Bounds};
use super::score::Stage;

/// Heights per length of views from outside, and what each is worth less than those that people would choose;
/// the last ones are for what is open or lit at the top or from below only.
const SLOPES: [(f64, f64); 7] =
    [(0.5, 0.0), (0.3, 0.0), (0.8, 0.05), (0.12, 0.02), (0.0, 0.1), (1.8, 0.2), (-0.5, 0.2)];

/// A view that may be chosen.
#[derive(Clone, Copy)]
pub(super) struct Candidate {
    pub(super) view: View,
    /// How much its score is less than what it shows: by how odd it is.
    pub(super) oddness: f64,
    /// Whether it is from within the bounds.
    pub(super) within: bool,
}

impl Bounds {
    /// Views from outside that just hold the bounds, all around at several heights. The front of a file is +Z (glTF 2.0, section
    /// 3.4): what shows as much from there is better.
    pub(super) fn outside(&self) -> Vec<Candidate> {
        let around = |(slope, oddness)| {
            azimuths().map(move |azimuth| {
                let view = self.framing(DVec3::new(azimuth.x, slope, azimuth.y));
                let oddness = oddness + BEHIND * 0.5 * (1.0 - azimuth.y);
                Candidate { view, oddness, within: false }
            })
        };
        SLOPES.into_iter().flat_map(around).collect()
    }

    /// The view from direction `towards_eye` at the least distance that holds the bounds, with a
    /// margin of a twentieth.
    fn framing(&self, towards_eye: DVec3) -> View {
        let centre = self.at(0.5, 0.5, 0.5);
        let view = View::look_at(centre + towards_eye, centre, YFOV_OUTSIDE);
        let slope_y = libm::tan(YFOV_OUTSIDE / 2.0) * 0.95;
        let slope = DVec2::new(slope_y * ASPECT, slope_y);
        let axes = view.world_from_camera;
        let distance = self.corners().fold(0.0_f64, |distance, corner| {
            let local = axes.inverse_direction(corner - centre);
            distance.max(local.z + (local.truncate().abs() / slope).max_element())
        });
        let eye = centre + towards_eye.normalize() * distance.max(1e-6);
        View::look_at(eye, centre, YFOV_OUTSIDE)
    }

    /// Views from points within the bounds that are in a room: from near the walls across the middle, and
    /// from a grid all around.
    pub(super) fn inside(&self, stage: &Stage<'_>) -> Vec<Candidate> {
        let mut views = Vec::new();
        for (eye, targets) in self.across().chain(self.around()) {
            let (enclosure, span) = stage.look_around(eye);
            if enclosure > ROOM && span > SPAN {
                let views_from = targets.iter().map(|&at| View::look_at(eye, at, YFOV_INSIDE));
                let oddness = INSIDE + OPEN * (1.0 - enclosure);
                views.extend(views_from.map(|view| Candidate { view, oddness, within: true }));
            }
        }
        views
    }

    /// Points near the walls and corners of the bounds, at and above mid height, with the middle to look at.
    fn across(&self) -> impl Iterator<Item = (DVec3, Vec<DVec3>)> + '_ {
        let places = [(1, 2), (0, 2), (2, 2), (2, 1), (0, 1), (2, 0), (0, 0), (1, 0)];
        let heights = [0.55, 0.7, 0.85].map(|h| [0.04, 0.15].map(|inset| (inset, h)));
        heights.into_iter().flatten().flat_map(move |(inset, height)| {
            places.into_iter().map(move |(x, z)| {
                let share = |i: i32| [inset, 0.5, 1.0 - inset][i as usize];
                let eye = self.at(share(x), height, share(z));
                let target = self.at(1.0 - share(x), 0.4, 1.0 - share(z));
                (eye, vec![target.midpoint(self.at(0.5, 0.4, 0.5))])
            })
        })
    }

    /// Points of a grid, each looking into eight directions, a little downwards: for several rooms, and for
    /// rooms that are not where the bounds are.
    fn around(&self) -> impl Iterator<Item = (DVec3, Vec<DVec3>)> + '_ {
        let shares = [0.125, 0.375, 0.625, 0.875];
        let plan = shares.into_iter().flat_map(move |x| shares.into_iter().map(move |z| (x, z)));
        plan.flat_map(move |(x, z)| [0.4, 0.7].into_iter().map(move |y| self.at(x, y, z))).map(
            |eye| {
                let towards = |d: DVec2| eye + DVec3::new(d.x, DOWN, d.y);
                (eye, azimuths().take(8).map(towards).collect())
            },
        )
    }
}

/// By how much views from inside look down, per length.
const DOWN: f64 = -0.15;

/// Sixteen directions around the vertical axis, (x, z), the diagonals of a quarter last; slopes rather than
/// angles, so that no transcendental function is needed.
fn azimuths() -> impl Iterator<Item = DVec2> {
    let quarter = [(0.0, 1.0), (1.0, 1.0), (0.5, 1.0), (1.0, 0.5)];
    quarter.into_iter().flat_map(|(x, z)| {
        let d = DVec2::new(x, z).normalize();
        [d, DVec2::new(d.y, -d.x), -d, DVec2::new(-d.y, d.x)]
    })
}
