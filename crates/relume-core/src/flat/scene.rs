//! Scenes in the plane: bodies of walls, materials and motion; validated, then immutable.

use std::ops::Range;

use glam::DVec2;

use super::plane::{PlanePose, ROUNDING, Segment};
use crate::scene::limits::{EMISSION_MAX, is_place};

/// Length of the shortest wall, m.
const LENGTH_MIN_M: f64 = 1e-9;

/// Index of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BodyIndex(pub u32);

/// Index of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct WallIndex(pub u32);

/// Diffuse material of a wall, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Reflectance rho, in [0, 1).
    pub reflectance: [f64; 3],
    /// Exitance M, W/m2.
    pub exitance: [f64; 3],
    /// Whether both sides reflect and emit; otherwise the back is black. Both sides block light.
    pub two_sided: bool,
}

impl Material {
    /// A grey surface that emits nothing.
    pub fn grey(reflectance: f64) -> Material {
        Material { reflectance: [reflectance; 3], exitance: [0.0; 3], two_sided: false }
    }

    /// With an exitance, W/m2, in all channels.
    pub fn emitting(self, exitance: f64) -> Material {
        Material { exitance: [exitance; 3], ..self }
    }
}

/// A wall: a segment of the input.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// What it is called.
    pub name: String,
    /// Where it is in its body's frame.
    pub local: Segment,
    /// What it is made of.
    pub material: Material,
    /// Its body.
    pub body: BodyIndex,
}

/// Where a body is at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// When, seconds.
    pub time_s: f64,
    /// Where its origin is, metres.
    pub place: DVec2,
    /// By how much it is turned, radians, counter-clockwise.
    pub angle: f64,
}

/// Motion of a body: straight from key to key, at rest before the first and after the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    keys: Vec<Key>,
}

impl Motion {
    /// From keys at ascending times; without any the body rests where it was made.
    pub fn new(keys: Vec<Key>) -> Motion {
        Motion { keys }
    }

    /// The keys.
    pub fn keys(&self) -> &[Key] {
        &self.keys
    }

    /// Where the body is: a pure function of time.
    pub fn pose(&self, time_s: f64) -> PlanePose {
        self.at(time_s).map_or(PlanePose::IDENTITY, |key| PlanePose::new(key.angle, key.place))
    }

    /// The key that the body is at; `None` where there are none.
    pub(super) fn at(&self, time_s: f64) -> Option<Key> {
        let after = self.keys.partition_point(|key| key.time_s <= time_s);
        match (after.checked_sub(1).map(|k| self.keys[k]), self.keys.get(after)) {
            (None, None) => None,
            (Some(only), None) => Some(only),
            (None, Some(&first)) => Some(first),
            (Some(one), Some(two)) => {
                let share = (time_s - one.time_s) / (two.time_s - one.time_s);
                let place = one.place + (two.place - one.place) * share;
                Some(Key { time_s, place, angle: one.angle + (two.angle - one.angle) * share })
            }
        }
    }
}

/// Rigid body of the plane: walls with one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// What it is called.
    pub name: String,
    /// How it moves.
    pub motion: Motion,
    /// Its walls.
    pub walls: Range<u32>,
}

/// A scene in the plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlatScene {
    bodies: Vec<Body>,
    walls: Vec<Wall>,
}

/// Error: a scene of the plane that cannot be solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// A wall without a direction.
    #[error(
        "segment `{0}` has no length, or too little for where it is: give it two different ends"
    )]
    NoLength(String),
    /// A number that is not finite, or too large to compute with.
    #[error("`{0}` has a number that is not finite, or larger than 1e12")]
    NotFinite(String),
    /// A reflectance out of range.
    #[error("segment `{0}`: a reflectance lies in [0, 1), such as 0.5")]
    Reflectance(String),
    /// A negative exitance.
    #[error("segment `{0}`: what is emitted lies between 0 and 1e30")]
    Exitance(String),
    /// A wall before any body, or a body without walls.
    #[error("body `{0}` has no segments: give it one, or leave it out")]
    Empty(String),
    /// Keys out of order.
    #[error("body `{0}`: the times of its keys must ascend")]
    Keys(String),
    /// A scene without walls.
    #[error("the scene has no segments")]
    Nothing,
}

impl FlatScene {
    /// A scene without bodies.
    pub fn new() -> FlatScene {
        FlatScene::default()
    }

    /// Begins a body; the walls added next are its own, in its frame.
    ///
    /// # Errors
    /// If its keys are not finite or their times do not ascend.
    pub fn body(&mut self, name: &str, motion: Motion) -> Result<BodyIndex, SceneError> {
        let finite = |k: &Key| is_place(&[k.time_s, k.place.x, k.place.y, k.angle]);
        if !motion.keys.iter().all(finite) {
            return Err(SceneError::NotFinite(name.into()));
        }
        if !motion.keys.is_sorted_by(|one, two| one.time_s < two.time_s) {
            return Err(SceneError::Keys(name.into()));
        }
        let start = self.walls.len() as u32;
        self.bodies.push(Body { name: name.into(), motion, walls: start..start });
        Ok(BodyIndex(self.bodies.len() as u32 - 1))
    }

    /// Adds a wall to the last body; where there is none yet, to a first one that rests.
    ///
    /// # Errors
    /// If it has no length, or a number is out of its range.
    pub fn wall(
        &mut self,
        name: &str,
        local: Segment,
        material: Material,
    ) -> Result<WallIndex, SceneError> {
        let name = name.to_owned();
        let Segment { start, end } = local;
        if !is_place(&[start.x, start.y, end.x, end.y]) {
            return Err(SceneError::NotFinite(name));
        }
        // What is shorter than the rounding of its ends has no direction.
        let least = LENGTH_MIN_M.max(1e3 * ROUNDING * local.size());
        if local.start == local.end || local.length() < least {
            return Err(SceneError::NoLength(name));
        }
        // The solver holds it in single precision.
        if !material.reflectance.iter().all(|&r| r >= 0.0 && (r as f32) < 1.0) {
            return Err(SceneError::Reflectance(name));
        }
        if !material.exitance.iter().all(|m| (0.0..=EMISSION_MAX).contains(m)) {
            return Err(SceneError::Exitance(name));
        }
        if self.bodies.is_empty() {
            self.body("scene", Motion::default())?;
        }
        let body = BodyIndex(self.bodies.len() as u32 - 1);
        self.walls.push(Wall { name, local, material, body });
        self.bodies[body.0 as usize].walls.end += 1;
        Ok(WallIndex(self.walls.len() as u32 - 1))
    }

    /// Adds a closed polygon to the last body, a wall for each edge, named `name.1` and so on. The
    /// fronts are on the left: outside if the corners go clockwise.
    ///
    /// # Errors
    /// As for each of the walls.
    pub fn polygon(
        &mut self,
        name: &str,
        corners: &[DVec2],
        material: Material,
    ) -> Result<(), SceneError> {
        for (k, &start) in corners.iter().enumerate() {
            let end = corners[(k + 1) % corners.len()];
            self.wall(&format!("{name}.{}", k + 1), Segment { start, end }, material)?;
        }
        Ok(())
    }

    /// Whether it can be solved.
    ///
    /// # Errors
    /// If there is no wall, or a body has none.
    pub fn check(&self) -> Result<(), SceneError> {
        if let Some(body) = self.bodies.iter().find(|b| b.walls.is_empty()) {
            return Err(SceneError::Empty(body.name.clone()));
        }
        if self.walls.is_empty() { Err(SceneError::Nothing) } else { Ok(()) }
    }

    /// The bodies.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The walls, those of one body together.
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// Time of the last key, seconds.
    pub fn duration_s(&self) -> f64 {
        let last = |b: &Body| b.motion.keys.last().map_or(0.0, |key| key.time_s);
        self.bodies.iter().map(last).fold(0.0, f64::max)
    }
}
