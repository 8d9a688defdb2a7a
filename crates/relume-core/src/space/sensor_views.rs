//! What sensors see of the coarse solution: enough to say which coarse elements matter to them.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use crate::element::{ElementId, Forest, WorldElement, WorldView};
use crate::geometry::{Plane, spread};
use crate::scene::{LightId, LightKind, World};
use crate::solver::{Radiosity, Surfaces};
use crate::transport::{Rays, form_factor_from_point, keep_in_front, light_at, segment_is_clear};

use super::sensor::{MountedSensor, Sensor};
use super::surfaces::CoarseSurfaces;
use super::tuning::{FEW_RAYS, GAP_NEAR, SENSOR_RAYS, SENSORS_MOST, SENSORS_RAYS};

/// How far from their surfaces rays begin, of the scene's extent.
const LIFT: f64 = 1e-9;

fn mean(v: [f32; 3]) -> f64 {
    v.iter().map(|&x| f64::from(x)).sum::<f64>() / 3.0
}

/// The coarse elements that a sensor sees.
pub(super) struct SensorView {
    pub(super) seen: Vec<Seen>,
    /// Irradiance at the sensor by the coarse solution, W/m2, mean of channels.
    pub(super) irradiance: f64,
}

/// What a sensor sees of a coarse element.
pub(super) struct Seen {
    pub(super) number: usize,
    /// Form factor to what is taken at its word: what is far for its size, and all in a gap.
    pub(super) far: f64,
    /// Form factor to what is gathered anew.
    pub(super) near: f64,
}

/// A coarse solution in the world.
pub(super) struct CoarseScene<'a> {
    pub(super) now: &'a World,
    pub(super) view: &'a WorldView,
    pub(super) forest: &'a Forest,
    /// Coarse elements by number.
    pub(super) coarse: &'a [u32],
    pub(super) surfaces: &'a CoarseSurfaces<'a>,
    pub(super) radiosity: &'a Radiosity,
    /// Irradiance that is added to what arrives, W/m2.
    pub(super) floor: f64,
}

impl CoarseScene<'_> {
    /// The views of the sensors that are there, of no more than `SENSORS_MOST`.
    pub(super) fn views(&self, sensors: &[MountedSensor]) -> Vec<SensorView> {
        let step = sensors.len().div_ceil(SENSORS_MOST).max(1);
        let chosen = sensors.iter().step_by(step).filter_map(|sensor| sensor.at(self.now));
        let chosen: Vec<(usize, Sensor)> = chosen.enumerate().collect();
        let rays = (SENSORS_RAYS / chosen.len().max(1)).clamp(SENSOR_RAYS[0], SENSOR_RAYS[1]);
        let emitting: Vec<usize> =
            (0..self.coarse.len()).filter(|&number| self.exitance(number) > 0.0).collect();
        chosen.par_iter().map(|(k, sensor)| self.view_from(sensor, (*k, rays), &emitting)).collect()
    }

    /// The view of sensor `k` by some rays, spread as the cosine to the normal, and of small emitters by their form factors.
    fn view_from(
        &self,
        sensor: &Sensor,
        (k, rays): (usize, usize),
        emitting: &[usize],
    ) -> SensorView {
        let mut irradiance = self.floor + self.of_lights(sensor);
        let mut small = BTreeSet::new();
        for &number in emitting {
            if let Some(factor) = self.to_small(sensor, number, rays) {
                irradiance += factor * self.exitance(number);
                small.insert(number);
            }
        }
        let mut met: BTreeMap<usize, [u32; 2]> = BTreeMap::new();
        for (number, is_near) in self.met_by(sensor, (k, rays)) {
            met.entry(number).or_default()[usize::from(is_near)] += 1;
        }
        let mut seen = Vec::new();
        for (number, counts) in met {
            let [far, near] = counts.map(|count| f64::from(count) / rays as f64);
            let known = if small.contains(&number) { self.exitance(number) } else { 0.0 };
            irradiance += (far + near) * (self.sent(number) - known).max(0.0);
            seen.push(Seen { number, far, near });
        }
        // In a gap light is followed from part to part of what is near, by what that says of itself.
        if seen.iter().map(|seen: &Seen| seen.near).sum::<f64>() > GAP_NEAR {
            seen.iter_mut().for_each(|seen| seen.far += seen.near);
        }
        SensorView { seen, irradiance }
    }

    /// The coarse elements that rays from sensor `k` meet first, and whether they are large for their distance.
    fn met_by(
        &self,
        sensor: &Sensor,
        (k, rays): (usize, usize),
    ) -> impl Iterator<Item = (usize, bool)> {
        let cast = Rays::new(self.view, self.forest);
        let from = sensor.at + sensor.normal * (LIFT * self.view.far_m());
        let (one, two) = sensor.normal.any_orthonormal_pair();
        let shift = [spread(k, 0), spread(k, 1)];
        (0..rays).filter_map(move |ray| {
            let turn = TAU * (spread(ray, 2) + shift[0]).fract();
            let square = ((ray as f64 + 0.5) / rays as f64 + shift[1]).fract();
            let (across, up) = (square.sqrt(), (1.0 - square).sqrt());
            let (sin, cos) = libm::sincos(turn);
            let direction = one * (across * cos) + two * (across * sin) + sensor.normal * up;
            let hit = cast.first(from, direction)?;
            let radius_m = cast.place(hit.leaf).radius;
            Some((self.forest.coarse(hit.leaf)?, hit.at.distance(from) < radius_m))
        })
    }

    /// Form factor to what is seen of an emitter that is too small for rays; `None` for a larger one.
    fn to_small(&self, sensor: &Sensor, number: usize, rays: usize) -> Option<f64> {
        let id = ElementId(self.coarse[number]);
        let (whole, seen) = match self.forest.group(id) {
            Some(_) => self.to_group(sensor, id),
            None => self.to_element(sensor, id),
        };
        (whole * rays as f64 <= FEW_RAYS).then_some(seen)
    }

    fn sent(&self, number: usize) -> f64 {
        mean(self.radiosity.radiosity(self.coarse[number]))
    }

    fn exitance(&self, number: usize) -> f64 {
        let id = self.coarse[number];
        match self.forest.is_distant(ElementId(id)) {
            true => self.sent(number),
            false => mean(self.surfaces.material(self.surfaces.facet_of(id)).exitance),
        }
    }

    /// Form factor to an element, and to what is seen of it: all or nothing, as its middle is.
    fn to_element(&self, sensor: &Sensor, id: ElementId) -> (f64, f64) {
        let patch = self.forest.patch(id).expect("an element has a patch");
        let world_patch = self.view.patch(patch);
        let plane = self.view.occluder(patch).plane;
        let is_before = plane.distance(sensor.at) > world_patch.rounding_m;
        if !is_before || !self.view.is_present(world_patch.body) {
            return (0.0, 0.0);
        }
        let e = WorldElement::new(self.view, self.forest, id, false);
        let mut corners = e.corners[..e.len].to_vec();
        keep_in_front(&mut corners, &Plane::through(sensor.at, sensor.normal));
        if corners.len() < 3 {
            return (0.0, 0.0);
        }
        let whole = form_factor_from_point(sensor.at, sensor.normal, &corners);
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        (whole, if self.is_clear(sensor, middle) { whole } else { 0.0 })
    }

    /// About the form factor to a group, that of a ball with the area of its patches, and to what is seen of it: all or nothing,
    /// as its near side is.
    fn to_group(&self, sensor: &Sensor, id: ElementId) -> (f64, f64) {
        let bounds = self.view.fixed_box(id);
        let (middle, radius) = (bounds.centre(), 0.5 * bounds.diagonal());
        let way = middle - sensor.at;
        let distance = way.length().max(radius).max(f64::MIN_POSITIVE);
        let seen_m2 = 0.25 * self.surfaces.area_m2(id.0);
        let factor = seen_m2 * sensor.normal.dot(way).max(0.0) / (PI * distance.powi(3));
        let clear = factor > 0.0 && self.is_clear(sensor, middle - way * (radius / distance));
        (factor, if clear { factor.min(1.0) } else { 0.0 })
    }

    fn of_lights(&self, sensor: &Sensor) -> f64 {
        let away = self.view.far_m();
        let arriving = |id: ElementId| {
            let index = self.forest.light(id)?;
            let light = self.view.light(index)?;
            let e = light_at(light, sensor.at, sensor.normal);
            let end = match light.kind {
                LightKind::Directional => sensor.at - light.direction * away,
                _ => light.position,
            };
            let intensity = self.now.intensity(LightId(index as u32)).iter().sum::<f64>() / 3.0;
            (e > 0.0 && self.is_clear(sensor, end)).then_some(intensity * e)
        };
        self.forest.children(Forest::ROOT).map(ElementId).filter_map(arriving).sum()
    }

    fn is_clear(&self, sensor: &Sensor, to: DVec3) -> bool {
        let slack_m = LIFT * self.view.far_m();
        segment_is_clear(self.view, self.forest, sensor.at, to, slack_m)
    }
}
