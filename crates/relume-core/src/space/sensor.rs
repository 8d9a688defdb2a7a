//! Sensors: places at which irradiance is asked for.

use glam::DVec3;

use crate::scene::{BodyId, World};

/// A place and a direction at which irradiance is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Where it is, metres.
    pub at: DVec3,
    /// Direction that it faces along, of any length but 0.
    pub normal: DVec3,
}

impl Sensor {
    /// This sensor with a normal of length 1; no number where the normal has no direction.
    pub(crate) fn with_unit_normal(&self) -> Sensor {
        Sensor { normal: self.normal.normalize_or(DVec3::NAN), ..*self }
    }

    /// Whether point and normal are numbers.
    pub(crate) fn is_finite(&self) -> bool {
        self.at.is_finite() && self.normal.is_finite()
    }
}

/// A sensor that rests in the world or rides on a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountedSensor {
    /// The body that it rides on; `None` for one that rests.
    pub body: Option<BodyId>,
    /// Place and direction in the frame of that body, or in the world's, metres.
    pub sensor: Sensor,
}

impl MountedSensor {
    /// Where it is in a world, with a normal of length 1, metres; `None` while its body is absent, or where it is no number.
    pub fn at(&self, world: &World) -> Option<Sensor> {
        let Sensor { at, normal } = self.sensor;
        let placed = match self.body {
            None => self.sensor,
            Some(body) => {
                let pose = world.poses().get(body.0 as usize).copied().flatten()?;
                Sensor { at: pose.point(at), normal: pose.direction(normal) }
            }
        };
        Some(placed.with_unit_normal()).filter(Sensor::is_finite)
    }
}
