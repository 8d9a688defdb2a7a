//! Commands: changes of the world of a running session, each with its inverse.
//!
//! A command changes the world of the next solve, not the last solution. Must not know links or elements.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::geometry::Pose;
use crate::scene::limits::{COORDINATE_MAX_M, EMISSION_MAX, EMISSION_MIN, is_place};
use crate::scene::{BodyId, LightId, MaterialId, NewBody, Scene, SceneError, TakenBody};

use super::Session;
use super::replant::Edit;

/// A change of the world: [`Session::apply`] returns its inverse.
///
/// Where a value is `None`, the value follows the clip of the scene again.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Command {
    /// Goes to a time of the clip, seconds.
    SetTime(f64),
    /// Places a body; the punctual lights on it move with it.
    SetPose(BodyId, Option<Pose>),
    /// Shows or hides a body; the punctual lights on it come and go with it.
    SetPresence(BodyId, Option<bool>),
    /// Changes the reflectance of a material, each channel in [0, 1); in place of its textures too.
    SetReflectance(MaterialId, Option<[f64; 3]>),
    /// Changes the exitance of a material, W/m2; a texture of emission still weighs it.
    SetExitance(MaterialId, Option<[f64; 3]>),
    /// Changes the intensity of a punctual light, W/sr (directional: W/m2).
    SetIntensity(LightId, Option<[f64; 3]>),
    /// Inserts a body at the origin of the world. The inverse, [`Command::Remove`], has its id.
    Insert(NewBody),
    /// Takes a body out.
    Remove(BodyId),
    /// Puts a body back that [`Command::Remove`] took out.
    PutBack(Arc<Removed>),
}

/// A removed body, with the values that commands had set of it.
#[derive(Clone, Debug)]
pub struct Removed {
    id: BodyId,
    body: TakenBody,
    pose: Option<Pose>,
    presence: Option<bool>,
}

impl Command {
    /// Places a body in the world. For a body that moves in the clip, `pose` is the world pose of its node; for a body at rest,
    /// the displacement from where the file has the body.
    pub fn set_pose(body: BodyId, pose: Pose) -> Command {
        Command::SetPose(body, Some(pose))
    }

    /// Shows a body.
    pub fn show(body: BodyId) -> Command {
        Command::SetPresence(body, Some(true))
    }

    /// Hides a body: it neither shines nor blocks light.
    pub fn hide(body: BodyId) -> Command {
        Command::SetPresence(body, Some(false))
    }

    /// Changes what a material reflects, each channel in [0, 1).
    pub fn set_reflectance(material: MaterialId, reflectance: [f64; 3]) -> Command {
        Command::SetReflectance(material, Some(reflectance))
    }

    /// Changes what a material emits, W/m2.
    pub fn set_exitance(material: MaterialId, exitance: [f64; 3]) -> Command {
        Command::SetExitance(material, Some(exitance))
    }

    /// Changes the intensity of a punctual light, W/sr (directional: W/m2).
    pub fn set_intensity(light: LightId, intensity: [f64; 3]) -> Command {
        Command::SetIntensity(light, Some(intensity))
    }
}

/// Error of a command that was refused; the world is unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// The scene has no such body, material or light.
    #[error("there is no {what} {index}: the scene has {count}, numbered from 0")]
    Unknown {
        /// Body, material or light.
        what: &'static str,
        /// Its index.
        index: u32,
        /// Number of such things in the scene.
        count: usize,
    },
    /// The body was removed.
    #[error(
        "body `{name}` was removed; put it back first, by the command that removing it returned"
    )]
    Removed {
        /// Its name.
        name: String,
    },
    /// A value is outside of what can be computed with.
    #[error("{subject}: {what}; {remedy}")]
    Value {
        /// Kind and name of the thing.
        subject: String,
        /// The flaw.
        what: String,
        /// The remedy.
        remedy: String,
    },
    /// The new body cannot be made.
    #[error(transparent)]
    Body(#[from] SceneError),
}

/// How far the axes of a pose may be from orthonormal.
const ORTHONORMAL: f64 = 1e-6;

impl Session {
    /// Changes the world of the next solve; returns the inverse command.
    ///
    /// Any commands followed by their inverses in reverse order lead to the state of the start, and the state
    /// after any commands equals that of a session that was given the same world at once, links bit for bit.
    ///
    /// Cost: of the command itself little; of the next solve, what the change changes, and some passes over all pairs where a
    /// body comes or leaves. Where a material comes to emit that never does in the clip, the next solve is a cold build.
    ///
    /// # Errors
    /// [`CommandError`]; nothing has changed then.
    pub fn apply(&mut self, command: Command) -> Result<Command, CommandError> {
        check(&self.bed.scene, &command)?;
        let held = &mut self.held;
        Ok(match command {
            Command::SetTime(time_s) => {
                Command::SetTime(std::mem::replace(&mut self.time_s, time_s))
            }
            Command::SetPose(body, pose) => {
                Command::SetPose(body, set(&mut held.poses, body, pose))
            }
            Command::SetPresence(body, there) => {
                Command::SetPresence(body, set(&mut held.presence, body, there))
            }
            Command::SetReflectance(material, to) => {
                Command::SetReflectance(material, set(&mut held.reflectances, material, to))
            }
            Command::SetExitance(material, to) => {
                Command::SetExitance(material, set(&mut held.exitances, material, to))
            }
            Command::SetIntensity(light, to) => {
                Command::SetIntensity(light, set(&mut held.intensities, light, to))
            }
            Command::Insert(new) => {
                let (scene, body) = self.bed.scene.with_body(&new)?;
                self.change_scene(scene, Edit::In(body));
                Command::Remove(body)
            }
            Command::Remove(body) => {
                let (scene, taken) = self.bed.scene.without_body(body);
                let (pose, presence) = (held.poses.remove(&body), held.presence.remove(&body));
                self.change_scene(scene, Edit::Out(body));
                Command::PutBack(Arc::new(Removed { id: body, body: taken, pose, presence }))
            }
            Command::PutBack(removed) => {
                let Removed { id, body, pose, presence } = &*removed;
                set(&mut held.poses, *id, *pose);
                set(&mut held.presence, *id, *presence);
                let scene = self.bed.scene.with_body_back(*id, body);
                self.change_scene(scene, Edit::In(*id));
                Command::Remove(*id)
            }
        })
    }
}

/// Sets or takes out an entry; what was there.
fn set<K: Ord, V>(map: &mut BTreeMap<K, V>, key: K, value: Option<V>) -> Option<V> {
    match value {
        Some(value) => map.insert(key, value),
        None => map.remove(&key),
    }
}

/// Whether a command can be carried out.
fn check(scene: &Scene, command: &Command) -> Result<(), CommandError> {
    let refuse = |subject: String, what: String, remedy: &str| {
        Err(CommandError::Value { subject, what, remedy: remedy.to_owned() })
    };
    match command {
        Command::SetTime(time_s) if !time_s.is_finite() => {
            refuse("the time".into(), format!("it is {time_s}"), "give a number of seconds")
        }
        Command::SetTime(_) => Ok(()),
        Command::SetPose(body, pose) => {
            let name = name_of(scene, *body)?;
            match pose.as_ref().and_then(flaw_of) {
                Some((flaw, remedy)) => refuse(format!("the pose of body `{name}`"), flaw, remedy),
                None => Ok(()),
            }
        }
        Command::SetPresence(body, _) | Command::Remove(body) => name_of(scene, *body).map(drop),
        Command::SetReflectance(material, to) => {
            let name = &found("material", &scene.materials, material.0)?.name;
            match to.iter().flatten().find(|r| !(**r >= 0.0 && (**r as f32) < 1.0)) {
                Some(bad) => refuse(
                    format!("material `{name}`"),
                    format!("its reflectance would be {bad}"),
                    "choose each channel from 0 up to, but not including, 1",
                ),
                None => Ok(()),
            }
        }
        Command::SetExitance(material, to) => {
            let name = &found("material", &scene.materials, material.0)?.name;
            check_emission(format!("material `{name}`"), to)
        }
        Command::SetIntensity(light, to) => {
            let name = &found("light", &scene.lights, light.0)?.name;
            check_emission(format!("light `{name}`"), to)
        }
        Command::Insert(_) => Ok(()),
        Command::PutBack(removed) => match scene.has_room_for(removed.id, &removed.body) {
            true => Ok(()),
            false => refuse(
                format!("body {}", removed.id.0),
                "it cannot be put back: another one has its place".into(),
                "take commands back in reverse order",
            ),
        },
    }
}

fn found<'a, T>(what: &'static str, all: &'a [T], index: u32) -> Result<&'a T, CommandError> {
    all.get(index as usize).ok_or(CommandError::Unknown { what, index, count: all.len() })
}

fn name_of(scene: &Scene, body: BodyId) -> Result<&str, CommandError> {
    let found = found("body", &scene.bodies, body.0)?;
    match scene.has_body(body) {
        true => Ok(&found.name),
        false => Err(CommandError::Removed { name: found.name.clone() }),
    }
}

fn check_emission(subject: String, to: &Option<[f64; 3]>) -> Result<(), CommandError> {
    let counts = |m: &f64| *m == 0.0 || (EMISSION_MIN..=EMISSION_MAX).contains(m);
    match to.iter().flatten().find(|m| !counts(m)) {
        Some(bad) => Err(CommandError::Value {
            subject,
            what: format!("it would emit {bad:e}"),
            remedy: format!("choose 0, or values from {EMISSION_MIN:e} to {EMISSION_MAX:e}"),
        }),
        None => Ok(()),
    }
}

/// Flaw of a pose and the remedy, if it has one.
fn flaw_of(pose: &Pose) -> Option<(String, &'static str)> {
    if !is_place(&pose.translation.to_array()) {
        let at = pose.translation;
        let flaw = format!("its translation is {at}, not within {COORDINATE_MAX_M:e} m");
        return Some((flaw, "give a translation in metres"));
    }
    let axes = pose.rotation;
    let off = axes.transpose() * axes - glam::DMat3::IDENTITY;
    let is_rigid = off.to_cols_array().iter().all(|x| x.abs() <= ORTHONORMAL);
    let flaw = || ("its axes are not a rotation's".into(), "give a rotation without scale");
    (!is_rigid || axes.determinant() <= 0.0).then(flaw)
}
