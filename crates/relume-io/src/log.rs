//! Logs of commands: undo and redo, and files that say what was done, to be done again.
//!
//! One line of JSON for each command or solve; bodies, materials and lights by name. Must not know how a command is
//! carried out.

use std::io::{BufRead, Write};

use glam::{DMat3, DVec3};
use serde::{Deserialize, Deserializer, Serialize};

use relume_core::geometry::Pose;
use relume_core::scene::{BodyId, LightId, MaterialId, NewBody, NewMesh, Scene};
use relume_core::session::{Command, CommandError, Frame, Session, SessionError};

/// Record of a session: one entry for each command, undo, redo and solve.
#[derive(Debug, Default)]
pub struct Log {
    entries: Vec<Entry>,
    /// Inverses of the commands that stand, the last one last.
    done: Vec<Command>,
    /// Inverses of those.
    undone: Vec<Command>,
}

/// One entry of a [`Log`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Entry {
    SetTime {
        to: f64,
    },
    SetPose {
        body: String,
        #[serde(deserialize_with = "said")]
        to: Option<Placed>,
    },
    SetPresence {
        body: String,
        #[serde(deserialize_with = "said")]
        to: Option<bool>,
    },
    SetReflectance {
        material: String,
        #[serde(deserialize_with = "said")]
        to: Option<[f64; 3]>,
    },
    SetExitance {
        material: String,
        #[serde(deserialize_with = "said")]
        to: Option<[f64; 3]>,
    },
    SetIntensity {
        light: String,
        #[serde(deserialize_with = "said")]
        to: Option<[f64; 3]>,
    },
    Insert {
        name: String,
        meshes: Vec<Drawn>,
    },
    Remove {
        body: String,
    },
    Undo {},
    Redo {},
    Solve {
        hash: Option<String>,
    },
}

/// A value that may be null, but must be there.
fn said<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<Option<T>, D::Error> {
    Option::deserialize(from)
}

/// A mesh in a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Drawn {
    surface: String,
    material: String,
    /// Metres.
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// A pose in a log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Placed {
    /// Axes of the body in the world, one after the other.
    axes: [[f64; 3]; 3],
    /// Metres.
    translation: [f64; 3],
}

/// Why a log could not be read or followed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The log cannot be read.
    #[error("the log cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// A line is no entry of a log.
    #[error("line {line}: {what}")]
    Line {
        /// From 1.
        line: usize,
        /// What is wrong with it.
        what: String,
    },
    /// An entry names what the scene does not have.
    #[error("line {line}: the scene has no {what} `{name}`")]
    Unknown {
        /// From 1.
        line: usize,
        /// Body, material or light.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A command was refused.
    #[error("line {line}: {source}")]
    Refused {
        /// From 1.
        line: usize,
        /// Why.
        source: CommandError,
    },
    /// A world could not be solved.
    #[error("line {line}: {source}")]
    Unsolved {
        /// From 1.
        line: usize,
        /// Why.
        source: SessionError,
    },
}

impl Log {
    /// An empty log.
    pub fn new() -> Log {
        Log::default()
    }

    /// Applies a command to a session, and returns the inverse; commands undone before can no longer be redone.
    ///
    /// # Errors
    /// As [`Session::apply`]; a command that was refused is not logged.
    pub fn apply(
        &mut self,
        session: &mut Session,
        command: Command,
    ) -> Result<Command, CommandError> {
        let Some(entry) = Entry::of(session.scene(), &command) else {
            return Err(CommandError::Value {
                subject: "a log".into(),
                what: "it holds what was done, not what was taken back".into(),
                remedy: "use `Log::undo`".into(),
            });
        };
        let inverse = session.apply(command)?;
        self.done.push(inverse.clone());
        self.undone.clear();
        self.entries.push(entry);
        Ok(inverse)
    }

    /// Undoes the last command that is in force; returns false if there is none.
    ///
    /// # Errors
    /// [`CommandError`] if commands beside this log have changed what it would change.
    pub fn undo(&mut self, session: &mut Session) -> Result<bool, CommandError> {
        let found = turn_back(session, &mut self.done, &mut self.undone)?;
        self.entries.extend(found.then_some(Entry::Undo {}));
        Ok(found)
    }

    /// Redoes the command that was undone last; returns false if there is none.
    ///
    /// # Errors
    /// As [`Log::undo`].
    pub fn redo(&mut self, session: &mut Session) -> Result<bool, CommandError> {
        let found = turn_back(session, &mut self.undone, &mut self.done)?;
        self.entries.extend(found.then_some(Entry::Redo {}));
        Ok(found)
    }

    /// Solves the session's world, and logs the hash.
    ///
    /// # Errors
    /// As [`Session::solve`]; nothing is logged then.
    pub fn solve<'a>(&mut self, session: &'a mut Session) -> Result<Frame<'a>, SessionError> {
        let frame = session.solve()?;
        self.entries.push(Entry::Solve { hash: Some(frame.hash().to_string()) });
        Ok(frame)
    }

    /// Writes the log, a line for each entry.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write(&self, mut to: impl Write) -> std::io::Result<()> {
        for entry in &self.entries {
            serde_json::to_writer(&mut to, entry)?;
            writeln!(to)?;
        }
        Ok(())
    }

    /// Applies the entries of a log to a session, and calls `each` after every solve with the frame and the hash in the log.
    /// Returns the log of this session.
    ///
    /// # Errors
    /// [`LogError`], with the number of the line; what was done before stays.
    pub fn replay(
        from: impl BufRead,
        session: &mut Session,
        mut each: impl FnMut(Frame<'_>, Option<&str>),
    ) -> Result<Log, LogError> {
        let mut log = Log::new();
        for (number, text) in from.lines().enumerate() {
            let (line, text) = (number + 1, text?);
            if text.trim().is_empty() {
                continue;
            }
            let fail = |what: String| LogError::Line { line, what };
            let refused = |source| LogError::Refused { line, source };
            let entry: Entry = serde_json::from_str(&text).map_err(|e| fail(e.to_string()))?;
            match &entry {
                Entry::Undo {} => match log.undo(session).map_err(refused)? {
                    true => {}
                    false => return Err(fail("there is nothing to undo".into())),
                },
                Entry::Redo {} => match log.redo(session).map_err(refused)? {
                    true => {}
                    false => return Err(fail("there is nothing to redo".into())),
                },
                Entry::Solve { hash } => {
                    let frame = log.solve(session);
                    let frame = frame.map_err(|source| LogError::Unsolved { line, source })?;
                    each(frame, hash.as_deref());
                }
                other => {
                    let unknown = |(what, name)| LogError::Unknown { line, what, name };
                    let command = other.command(session.scene()).map_err(unknown)?;
                    log.apply(session, command).map_err(refused)?;
                }
            }
        }
        Ok(log)
    }
}

/// Applies the last command of one stack and puts its inverse on another.
fn turn_back(
    session: &mut Session,
    from: &mut Vec<Command>,
    to: &mut Vec<Command>,
) -> Result<bool, CommandError> {
    let Some(command) = from.last() else { return Ok(false) };
    to.push(session.apply(command.clone())?);
    from.pop();
    Ok(true)
}

/// A pose of a body where all places are told from another origin, which lies at `-by`.
fn moved(scene: &Scene, body: BodyId, pose: &Pose, by: DVec3) -> Pose {
    // That of a body that rests is from where it is in the file: its corners are told from another origin too.
    let moves = scene.bodies.get(body.0 as usize).is_some_and(|_| scene.moves(body));
    let own = if moves { DVec3::ZERO } else { pose.rotation * by };
    Pose { rotation: pose.rotation, translation: pose.translation + by - own }
}

impl Drawn {
    fn of(mesh: &NewMesh, name_of: &dyn Fn(&MaterialId) -> Option<String>) -> Drawn {
        let NewMesh { surface, material, positions, triangles } = mesh.clone();
        Drawn {
            surface,
            // What does not exist is refused when the command is applied.
            material: name_of(&material).unwrap_or_default(),
            positions,
            triangles,
        }
    }
}

impl Entry {
    /// What a log says of a command; nothing of one that puts back.
    fn of(scene: &Scene, command: &Command) -> Option<Entry> {
        // What does not exist is refused when the command is applied.
        let body = |id: &BodyId| scene.bodies.get(id.0 as usize).map(|b| b.name.clone());
        let material = |id: &MaterialId| scene.materials.get(id.0 as usize).map(|m| m.name.clone());
        let light = |id: &LightId| scene.lights.get(id.0 as usize).map(|l| l.name.clone());
        Some(match command {
            Command::SetTime(to) => Entry::SetTime { to: *to },
            Command::SetPose(id, to) => Entry::SetPose {
                body: body(id).unwrap_or_default(),
                to: to.map(|pose| {
                    let pose = moved(scene, *id, &pose, scene.origin);
                    let axes = pose.rotation.to_cols_array_2d();
                    Placed { axes, translation: pose.translation.to_array() }
                }),
            },
            Command::SetPresence(id, to) => {
                Entry::SetPresence { body: body(id).unwrap_or_default(), to: *to }
            }
            Command::SetReflectance(id, to) => {
                Entry::SetReflectance { material: material(id).unwrap_or_default(), to: *to }
            }
            Command::SetExitance(id, to) => {
                Entry::SetExitance { material: material(id).unwrap_or_default(), to: *to }
            }
            Command::SetIntensity(id, to) => {
                Entry::SetIntensity { light: light(id).unwrap_or_default(), to: *to }
            }
            Command::Insert(new) => Entry::Insert {
                name: new.name().to_owned(),
                meshes: new.meshes().iter().map(|mesh| Drawn::of(mesh, &material)).collect(),
            },
            Command::Remove(id) => Entry::Remove { body: body(id).unwrap_or_default() },
            Command::PutBack(_) => return None,
            // None: the test `a_log_knows_every_command` holds that every command stands above.
            _ => return None,
        })
    }

    /// The command that an entry says; it is one.
    ///
    /// # Errors
    /// What is named and is not in the scene.
    fn command(&self, scene: &Scene) -> Result<Command, (&'static str, String)> {
        let body = |name: &String| scene.body_named(name).ok_or_else(|| ("body", name.to_owned()));
        let material = |name: &String| {
            let at = scene.materials.iter().position(|m| m.name == *name);
            at.map(|k| MaterialId(k as u32)).ok_or_else(|| ("material", name.to_owned()))
        };
        let light = |name: &String| {
            let at = scene.lights.iter().position(|l| l.name == *name);
            at.map(|k| LightId(k as u32)).ok_or_else(|| ("light", name.to_owned()))
        };
        Ok(match self {
            Entry::SetTime { to } => Command::SetTime(*to),
            Entry::SetPose { body: name, to } => {
                let body = body(name)?;
                let pose = |Placed { axes, translation }| {
                    let rotation = DMat3::from_cols_array_2d(&axes);
                    let pose = Pose { rotation, translation: translation.into() };
                    moved(scene, body, &pose, -scene.origin)
                };
                Command::SetPose(body, to.map(pose))
            }
            Entry::SetPresence { body: name, to } => Command::SetPresence(body(name)?, *to),
            Entry::SetReflectance { material: name, to } => {
                Command::SetReflectance(material(name)?, *to)
            }
            Entry::SetExitance { material: name, to } => Command::SetExitance(material(name)?, *to),
            Entry::SetIntensity { light: name, to } => Command::SetIntensity(light(name)?, *to),
            Entry::Insert { name, meshes } => {
                let mut new = NewBody::new(name);
                for Drawn { surface, material: of, positions, triangles } in meshes {
                    new = new.with_mesh(surface, material(of)?, positions, triangles);
                }
                Command::Insert(new)
            }
            Entry::Remove { body: name } => Command::Remove(body(name)?),
            Entry::Undo {} | Entry::Redo {} | Entry::Solve { .. } => {
                unreachable!("the caller carries these out")
            }
        })
    }
}
