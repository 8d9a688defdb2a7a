//! Irradiance at sensors: gathered in the open, followed along walks in gaps. Must not know who asks.

use rayon::prelude::*;

use crate::space::{Sensor, Solved};

use super::gap::Gap;
use super::gather::{Gathered, Look, Purpose};
use super::tuning::GATHER_LITTLE;

/// Sensors that one task handles.
const SENSORS_AT_ONCE: usize = 8;

/// Irradiances at sensors in parallel, W/m2, linear RGB, in their order: gathered from all elements and punctual lights,
/// each with visibility of its own from the sensor; the same bits for any number of threads.
///
/// Visibility is exact up to rounding, except where an element falls into more than some hundred visible pieces; what an
/// element sends errs by its radiosity's variation within it. What an emitter emits is exact. Cost: proportional to sensors
/// times the elements that are neither far away nor hidden, some 0.1 us each, more where something is partly in the way.
pub(super) fn irradiances_at(solved: &Solved, sensors: &[Sensor]) -> Vec<[f64; 3]> {
    let one = |sensor: &Sensor| irradiance(solved, sensor);
    sensors.par_chunks(SENSORS_AT_ONCE).flat_map_iter(|some| some.iter().map(one)).collect()
}

/// Irradiance at a sensor, W/m2.
pub(super) fn irradiance(solved: &Solved, sensor: &Sensor) -> [f64; 3] {
    if !sensor.is_finite() {
        return [f64::NAN; 3];
    }
    let found = Look::new(solved, sensor, Purpose::Sensor).gather();
    if let Some(gap) = Gap::around(solved, &found) {
        return gap.irradiance(solved, sensor);
    }
    let Gathered { mut sum, parts, .. } = found;
    for (k, part) in parts.iter().enumerate() {
        let b = match part.factor > GATHER_LITTLE {
            true => Gap::NONE.radiosity_of(solved, part, k),
            false => part.line(solved),
        };
        (0..3).for_each(|c| sum[c] += part.factor * b[c]);
    }
    sum
}
