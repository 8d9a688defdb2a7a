//! The session: owner of all mutable state, which takes commands and gives access to solved frames.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::follow::{Failed, Order, Why};
use crate::scene::{BodyId, Held, Scene, World};
use crate::space::{Bed, Goal, Solved, SpaceState, Tuning};
use crate::transport::Simd;

mod back;
mod command;
mod estimate;
mod options;
mod replant;
mod tuning;

pub use command::{Command, CommandError, Removed};
pub use estimate::Estimate;
pub use options::{Aim, Options, Oracle};

pub use crate::follow::{
    Accuracy, Energy, Follower, FrameReport, LinkKinds, Memory, PairCounts, RowSumError, Seconds,
    Update, Watch,
};
pub use crate::pair::Work;
pub use crate::read::{
    Closure, CoarseQuantity, CoarseValue, Difference, ElementName, Elements, Event, EventKind,
    Factors, Flux, Frame, Gathered, Grouping, GroupingError, Hash, LampLight, Leaf, Mesh, Missed,
    Open, PartFactors, PointError, RadiosityError, RadiosityGap, Snapshot, Which, compare, missed,
    radiosity_error, radiosity_gap,
};

pub use crate::space::{MountedSensor, Sensor};

use replant::{Edited, Start};

/// Why a frame could not be computed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The links of this tolerance do not fit into the memory allowed.
    #[error(
        "frame {frame} at tolerance {tolerance} needs more than the {limit_bytes} bytes of memory allowed ({pairs} pairs so far): raise `Options::max_memory_bytes` or the tolerance (with the form-factor oracle its epsilon; where the scene has very many polygons, use fewer)"
    )]
    OutOfMemory {
        /// The frame being computed.
        frame: u32,
        /// The tolerance asked for.
        tolerance: f64,
        /// The limit, bytes.
        limit_bytes: u64,
        /// Pairs made when the limit was met.
        pairs: u64,
    },
    /// The step was called off by [`Watch::cancel`].
    #[error("frame {frame} was called off")]
    Cancelled {
        /// The frame that was being computed.
        frame: u32,
    },
    /// Light does not settle between some surfaces.
    #[error(
        "frame {frame}: light between {} does not settle (residual {residual:.1e} of the mean radiosity): they pierce each other, or lie so close that form factors between them sum to more than 1; move them apart, make their materials reflect less, or use a finer tolerance",
        names(surfaces)
    )]
    Unsettled {
        /// The frame being computed.
        frame: u32,
        /// Residual of the last sweep, relative to the mean radiosity.
        residual: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
    /// Absorbed and escaped flux differ from the emitted flux.
    #[error(
        "frame {frame}: {:.0} % of the light that is emitted is unaccounted for; most of it between {}: they pierce each other, or lie so close that form factors between them sum to more than 1; move them apart, make their materials reflect less, or use a finer tolerance", 100.0 * share, names(surfaces)
    )]
    Unbalanced {
        /// The frame being computed.
        frame: u32,
        /// Difference as a share of the emitted flux, 1.
        share: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
    /// A time that is no number of seconds.
    #[error("there is nothing at the time {time_s} of a clip: give a number of seconds")]
    Time {
        /// The time asked for.
        time_s: f64,
    },
    /// An option is out of its range.
    #[error("{0}")]
    Option(String),
}

/// Names in a sentence.
fn names(surfaces: &[String]) -> String {
    match surfaces {
        [] => "the surfaces of this scene".to_owned(),
        [one] => format!("the parts of `{one}`"),
        several => several.iter().map(|s| format!("`{s}`")).collect::<Vec<_>>().join(" and "),
    }
}

/// One scene being solved, frame by frame.
pub struct Session {
    /// The scene as commands have made it, and the initial forest of builds: where bodies came or left since the last step,
    /// the forest of the scene before.
    bed: Bed,
    /// Whether they belong together.
    is_planted: bool,
    options: Options,
    simd: Simd,
    /// The last solution, in the scene that it is of.
    solved: Option<Solved>,
    /// Bodies that came into that scene and left it since.
    edited: Option<Edited>,
    /// Whether the next step may not start from the last solution.
    starts_anew: bool,
    /// Progress of a step for other threads.
    watch: Arc<Watch>,
    /// Time that `moved` compares with, where it is not that of the last step.
    count_motion_from: Option<f64>,
    /// Values set by commands in place of the clip's.
    held: Held,
    /// Bodies that are not where the scene has them at rest, as the seed knows them.
    displaced: BTreeSet<BodyId>,
    /// Time of the clip, seconds.
    time_s: f64,
    /// Steps so far.
    frames: u32,
}

impl Session {
    /// Prepares a scene for solving; the links are built by the first [`Session::solve`].
    ///
    /// # Errors
    /// [`SessionError::Option`] if an option is out of its range.
    pub fn new(scene: impl Into<Arc<Scene>>, options: Options) -> Result<Session, SessionError> {
        options.validate()?;
        let scene = scene.into();
        let displaced: BTreeSet<BodyId> = scene.removed_bodies().collect();
        Ok(Session {
            bed: Bed::new(scene, &displaced, options.bedding()),
            is_planted: true,
            options,
            simd: Simd::detect(),
            solved: None,
            edited: None,
            starts_anew: false,
            watch: Arc::default(),
            count_motion_from: None,
            held: Held::default(),
            displaced,
            time_s: 0.0,
            frames: 0,
        })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.bed.scene
    }

    /// Progress of the step under way, for any thread.
    pub fn watch(&self) -> Arc<Watch> {
        Arc::clone(&self.watch)
    }

    /// The options it is solved with.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Sets the limit on memory, bytes, of the steps to come: what others leave of it may differ from step to
    /// step. No result depends on it.
    pub fn set_max_memory_bytes(&mut self, limit: Option<u64>) {
        self.options.max_memory_bytes = limit;
    }

    /// Brings the solution to `time_s` (seconds of the animation); `frame` only labels the report.
    ///
    /// Any time may follow any other: the links are those of a cold build at `time_s`, bit for bit.
    /// Cost: proportional to what differs from the step before, unless [`Update::Scratch`] is
    /// asked for.
    ///
    /// # Errors
    /// As [`Session::solve`].
    #[doc(hidden)]
    pub fn step(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        if !time_s.is_finite() {
            return Err(SessionError::Time { time_s });
        }
        self.time_s = time_s;
        self.frames += 1;
        let back = self.solved.as_ref().map(|solved| self.way_back(solved));
        let Start { last, remains } = self.follow_hands();
        let world = self.world();
        let count_motion_from =
            self.count_motion_from.take().map(|from_s| self.bed.scene.at_but(from_s, &self.held));
        let last_world = last.as_ref().map(|last| last.space.world.clone());
        // Where groups differ, the way back does not lead to the links of before.
        let is_alike = last.as_ref().is_none_or(|last| last.space.regrouped.is_empty());
        let from = count_motion_from.as_ref().or(last_world.as_ref());
        let goal = self.goal(&world, &self.held, from);
        let moved = from.map_or(Vec::new(), |from| self.moved(from, &world));
        let order = self.order(FrameReport { frame, time_s, moved, ..FrameReport::default() });
        let done = Follower::follow(last, &goal, &order);
        // What was called off too late calls nothing else off.
        self.watch.take_cancelled();
        match done {
            Ok(solved) => {
                let solved = match remains {
                    Some(scene) => self.forget_remains(solved, scene),
                    None => solved,
                };
                Ok(self.solved.insert(solved).report.clone())
            }
            Err(failed) => {
                let error = self.error_of(&failed, frame);
                let last_world = last_world.filter(|_| is_alike);
                self.solved =
                    back.and_then(|back| self.go_back(*failed, back, last_world, remains));
                Err(error)
            }
        }
    }

    /// Sets the time of the frame before the next step, where that is not the last step:
    /// [`FrameReport::moved`] and [`Work::dynamic_links`](crate::pair::Work::dynamic_links) count from there. Nothing else
    /// depends on it.
    #[doc(hidden)]
    pub fn count_motion_from(&mut self, time_s: Option<f64>) {
        self.count_motion_from = time_s;
    }

    /// Solves the world as the commands so far have made it; the first time that is a cold build.
    ///
    /// # Errors
    /// [`SessionError`]; [`Session::frame`] is then that of the last solution as before, if there was one. Going back to it
    /// costs what a step there costs, or, where the last step did not start from it ([`Update::Scratch`], say), a cold
    /// build. Links are the same, bit for bit (but for those that [`Update::Extrapolate`] extrapolates), and
    /// radiosities within the residual.
    pub fn solve(&mut self) -> Result<Frame<'_>, SessionError> {
        self.solve_at(self.time_s)
    }

    /// Goes to a time of the clip, seconds, and solves the world there. Any time may follow any other.
    ///
    /// # Errors
    /// As [`Session::solve`].
    pub fn solve_at(&mut self, time_s: f64) -> Result<Frame<'_>, SessionError> {
        self.step(self.frames, time_s)?;
        Ok(Frame::new(self.solved.as_ref().expect("a step leaves a solution"), self.frames))
    }

    /// The last solution, if there is one: of the scene as it was then, whatever commands came since.
    pub fn frame(&self) -> Option<Frame<'_>> {
        self.solved.as_ref().map(|solved| Frame::new(solved, self.frames))
    }

    /// The state that the last step left.
    #[doc(hidden)]
    pub fn solved(&self) -> Option<&Solved> {
        self.solved.as_ref()
    }

    /// The world that the next [`Session::solve`] solves.
    pub fn world(&self) -> World {
        self.bed.scene.at_but(self.time_s, &self.held)
    }

    /// Time of the clip that the next [`Session::solve`] is at, seconds.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Values set by commands in place of the clip's.
    pub fn held(&self) -> &Held {
        &self.held
    }

    /// Names of the bodies that are elsewhere in one world than in another.
    fn moved(&self, from: &World, to: &World) -> Vec<String> {
        let bodies = self.bed.scene.bodies.iter().enumerate();
        let moved = bodies.filter(|(b, _)| from.poses()[*b] != to.poses()[*b]);
        moved.map(|(_, body)| body.name.clone()).collect()
    }

    /// A step to a world, in the present scene.
    fn goal<'a>(&'a self, world: &'a World, held: &'a Held, from: Option<&'a World>) -> Goal<'a> {
        let tuning = Tuning {
            tolerance: self.options.tolerance,
            aim: self.options.aim.clone(),
            criterion: self.options.refinement_criterion(),
            simd: self.simd,
        };
        Goal { bed: &self.bed, world, held, from, tuning }
    }

    /// A step as the options ask for.
    fn order(&self, label: FrameReport) -> Order<'_> {
        let Options { update, events, balance, max_memory_bytes, .. } = self.options;
        Order { label, update, events, balance, max_memory_bytes, watch: Some(&self.watch) }
    }

    /// The error of a step that failed.
    fn error_of(&self, failed: &Failed<SpaceState>, frame: u32) -> SessionError {
        match failed.why.clone() {
            Why::Cancelled => SessionError::Cancelled { frame },
            Why::OutOfMemory => SessionError::OutOfMemory {
                frame,
                tolerance: self.options.tolerance,
                limit_bytes: self.options.max_memory_bytes.unwrap_or(u64::MAX),
                pairs: failed.pairs(),
            },
            Why::Unsettled { residual, surfaces } => {
                SessionError::Unsettled { frame, residual, surfaces }
            }
            Why::Unbalanced { share, surfaces } => {
                SessionError::Unbalanced { frame, share, surfaces }
            }
        }
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory(&self) -> Memory {
        let seed = self.bed.seed.memory_bytes() + self.bed.seed.shared_bytes();
        let mut memory = self.solved.as_ref().map_or_else(Memory::default, Solved::memory);
        memory.fixed += seed;
        memory
    }

    /// Bytes that the engine's structures hold now, all together.
    pub fn memory_bytes(&self) -> u64 {
        let memory = self.memory();
        memory.pairs + memory.elements + memory.fixed
    }
}
