//! How much the light that an element gets counts where irradiance is gathered at points: the adjoint of the coarse solution.
//!
//! A point gathers what elements send with visibility of its own, and lamps' light exactly: that the mesh errs there is no
//! error of the point. An error on an element reaches points by what the element reflects, past all else that reflects. So
//! it counts by the importance of the element (Smits, Arvo and Salesin 1992), with each place in the scene as a sensor, of
//! which errors are relative to what arrives there.

use std::sync::Arc;

use crate::element::{ElementId, Forest};
use crate::pair::{Brightness, coarsen};
use crate::solver::{Link, Links, Surfaces};

use super::sensor::MountedSensor;
use super::sensor_views::SensorView;
use super::surfaces::CoarseSurfaces;
use super::tuning::{
    COARSE_SWEEPS, POINTS_MOST, POINTS_NEAR, POINTS_SHARE, SENSORS_CAP, SENSORS_NEAR, SENSORS_SHARE,
};

/// What the tolerance is about: whose irradiance is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Aim {
    /// The irradiance that elements have: what pictures, exported light and snapshots show.
    #[default]
    Mesh,
    /// The irradiance that is gathered at points ([`Frame::irradiance_at`](crate::session::Frame::irradiance_at)): sensors. It
    /// finds lamps' light and shadows itself, so elements only need to send the right light: at the same tolerance with a
    /// fifth to nine tenths of the links. Elements themselves may then err by several times the tolerance.
    Points,
    /// The irradiance that is gathered at these sensors, and at no other place: root mean square over them. Of more than 256
    /// sensors an evenly spaced selection counts, and while no sensor is there it is as for [`Points`](Aim::Points).
    Sensors(Arc<[MountedSensor]>),
}

impl Aim {
    /// The sensors that are known, none where they may be anywhere; `None` if no point is read.
    pub(super) fn sensors(&self) -> Option<&[MountedSensor]> {
        match self {
            Aim::Mesh => None,
            Aim::Points => Some(&[]),
            Aim::Sensors(sensors) => Some(sensors),
        }
    }
}

/// Weighs coarse elements (by number, `known` with unrounded brightness) by what errors on them do to points, `views` of which are
/// known ahead: their irradiance is replaced by one over the larger of two weights.
///
/// One is their importance, times `POINTS_SHARE`: what errs in one sense wherever light comes from there. What counts for more
/// than is typical of the scene, as the few elements that light goes through on its way into another room, counts for more by as
/// much again. It is at most their weight for the mesh; where they count for more than twice what is typical, up to `POINTS_MOST`
/// times that. The other is what they do where they are most of what is seen, as in a gap, times `POINTS_NEAR`, up to their
/// weight for the mesh. For known sensors the three are `SENSORS_SHARE`, `SENSORS_CAP` and `SENSORS_NEAR`.
pub(super) fn weigh_by_points(
    (links, forest, coarse): (&Links, &Forest, &[u32]),
    surfaces: &CoarseSurfaces<'_>,
    views: &[SensorView],
    known: &mut [Brightness],
) {
    let scene = Reflecting { links, forest, coarse, surfaces };
    let (straight, [share, near, cap]) = match views {
        [] => (scene.everywhere(known), [POINTS_SHARE, POINTS_NEAR, POINTS_MOST]),
        _ => (scene.at_sensors(views), [SENSORS_SHARE, SENSORS_NEAR, SENSORS_CAP]),
    };
    let (importance, nearby) = (scene.importance(&straight.mean), straight.rms);
    let (mut area_m2, mut sum) = (0.0, 0.0);
    for ((light, importance), &id) in known.iter().zip(&importance).zip(coarse) {
        if light.irradiance.is_finite() {
            area_m2 += surfaces.area_m2(id);
            sum += surfaces.area_m2(id) * importance * light.irradiance;
        }
    }
    // As brightness is rounded, so that it seldom changes.
    let typical = coarsen(sum / area_m2).max(f64::MIN_POSITIVE);
    for ((light, importance), nearby) in known.iter_mut().zip(&importance).zip(&nearby) {
        if light.irradiance.is_finite() {
            let beside_typical = importance * light.irradiance / typical;
            // Over the weight for the mesh.
            let over_mesh = |weight: f64, most: f64| (weight * light.irradiance).min(most);
            // In a white room all count for much, and all alike.
            let most = (0.5 * beside_typical).clamp(1.0, cap);
            let reflected = over_mesh(share * importance * beside_typical, most);
            let near = over_mesh(near * nearby, 1.0);
            light.irradiance /= reflected.max(near).max(LEAST);
        }
    }
}

/// Weight of what counts for nothing, over that for the mesh: a number that can be divided by.
const LEAST: f64 = 1e-9;

/// The coarse elements and what goes from one to the other.
struct Reflecting<'a> {
    links: &'a Links,
    forest: &'a Forest,
    coarse: &'a [u32],
    surfaces: &'a CoarseSurfaces<'a>,
}

/// Relative change of irradiance at points, straight from each coarse element, per change of what it reflects, m2/W.
struct Straight {
    /// Mean over the points, over the element's share of the area.
    mean: Vec<f64>,
    /// Root mean square over the points, over the root of that share, times the element's reflectance.
    rms: Vec<f64>,
}

impl Reflecting<'_> {
    /// With all places that receive light as points.
    fn everywhere(&self, known: &[Brightness]) -> Straight {
        let area_m2 = |id: u32| self.surfaces.area_m2(id);
        // By reciprocity what the element sends goes where its own sources are.
        let mean = |&id: &u32| {
            let sends = |(number, coupling): (usize, f64)| coupling / known[number].irradiance;
            self.seen(id).map(sends).sum::<f64>()
        };
        let rms = |&id: &u32| {
            let square = |(number, coupling): (usize, f64)| {
                let change = coupling / known[number].irradiance;
                change * change * area_m2(id) / area_m2(self.coarse[number]).max(f64::MIN_POSITIVE)
            };
            self.reflectance(id) * self.seen(id).map(square).sum::<f64>().sqrt()
        };
        Straight {
            mean: self.coarse.iter().map(mean).collect(),
            rms: self.coarse.iter().map(rms).collect(),
        }
    }

    /// With sensors as points. What is near a sensor is gathered anew there, so what that sees counts in its place.
    fn at_sensors(&self, views: &[SensorView]) -> Straight {
        let len = self.coarse.len();
        let all_m2: f64 = self.coarse.iter().map(|&id| self.surfaces.area_m2(id)).sum();
        let (mut mean, mut near) = (vec![0.0; len], vec![0.0; len]);
        let (mut square, mut near_square) = (vec![0.0; len], vec![0.0; len]);
        for view in views {
            let over = 1.0 / (view.irradiance * views.len() as f64);
            for seen in &view.seen {
                mean[seen.number] += seen.far * over;
                near[seen.number] += seen.near * over;
                square[seen.number] += seen.far * seen.far * over / view.irradiance;
                near_square[seen.number] += seen.near * seen.near * over / view.irradiance;
            }
        }
        let area_m2 =
            |number: usize| self.surfaces.area_m2(self.coarse[number]).max(f64::MIN_POSITIVE);
        let of = |(number, &id): (usize, &u32)| {
            let share = area_m2(number) / all_m2;
            let rho = self.reflectance(id);
            let (mut straight, mut squared) = (mean[number] / share, square[number] / share);
            for (other, coupling) in self.seen(id) {
                let through = coupling * self.reflectance(self.coarse[other]);
                let share = area_m2(other) / all_m2;
                straight += through * near[other] / share;
                squared += through * through * near_square[other] * area_m2(number)
                    / (area_m2(other) * share);
            }
            (straight, rho * squared.sqrt())
        };
        let (mean, rms) = self.coarse.iter().enumerate().map(of).unzip();
        Straight { mean, rms }
    }

    /// For each coarse element, m2/W: mean relative change of irradiance at the points, by whatever way, per change of
    /// its own irradiance, over its share of the area; from the mean of what goes there straight.
    ///
    /// The adjoint of gathering, in as many sweeps as the coarse solution has.
    fn importance(&self, straight: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.coarse.len()];
        for _ in 0..COARSE_SWEEPS {
            let of = |(&id, straight): (&u32, &f64)| {
                let on = self.seen(id).map(|(number, coupling)| coupling * out[number]);
                self.reflectance(id) * (straight + on.sum::<f64>())
            };
            out = self.coarse.iter().zip(straight).map(of).collect();
        }
        out
    }

    /// The coarse elements that one sees, by number, with the form factors to them; what is distant sees none.
    fn seen(&self, id: u32) -> impl Iterator<Item = (usize, f64)> + '_ {
        let links = match self.forest.is_distant(ElementId(id)) {
            true => &[],
            false => self.links.of(id),
        };
        let seen = |link: &Link| {
            Some((self.forest.coarse(ElementId(link.source))?, f64::from(link.coupling)))
        };
        links.iter().filter_map(seen)
    }

    fn reflectance(&self, id: u32) -> f64 {
        let of = self.surfaces.material(self.surfaces.facet_of(id)).reflectance;
        of.iter().map(|&rho| f64::from(rho)).sum::<f64>() / 3.0
    }
}
