//! The session owns all mutable state and runs the phases of a frame; snapshots come out.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

use crate::element::{ElementId, Forest, WorldView};
use crate::event::Ticks;
use crate::pair::{LinkEvent, PairHash, PairTree};
use crate::scene::{BodyId, Held, Scene, World};
use crate::solver::{GroupLinks, Links, Radiosity};
use crate::transport::Simd;

mod accuracy;
mod advance;
mod ahead;
mod bends;
pub(crate) mod budget;
mod coarse;
mod command;
mod compact;
mod compare;
mod estimate;
mod events;
mod factors;
mod frame;
mod gather;
mod groups;
mod lossy;
mod names;
mod options;
mod pieces;
mod promise;
mod reconstruct;
mod replant;
mod report;
mod snapshot;
mod solution;
mod surfaces;
mod tally;
mod watch;

pub use accuracy::Accuracy;
pub use command::{Command, CommandError, Removed};
pub use compare::{Difference, RadiosityGap, Which, compare, radiosity_gap};
pub use estimate::Estimate;
pub use events::{Event, EventKind};
pub use factors::{Closure, Factors, Grouping, Open, PartFactors};
pub use frame::{Frame, Hash, Mesh};
pub use gather::Sensor;
pub use lossy::{Missed, RadiosityError, missed, radiosity_error};
pub use names::ElementName;
pub use options::{Options, Oracle, Update};
pub use report::{Energy, FrameReport, LinkKinds, PairCounts, RowSumError, Seconds};
pub use snapshot::{Leaf, Snapshot};
pub use solution::Solution;
pub use watch::Watch;

// Flatland's session shares these.
pub(crate) use ahead::{Ahead, Void, most_mean, while_extrapolated};
pub(crate) use events::with_names;
pub(crate) use surfaces::{Receivers, apply_edits, links_of};
pub(crate) use tally::balance_of;

use coarse::Coarse;
use replant::{Bed, Left};

/// Why a frame could not be computed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The links of this tolerance do not fit into the memory allowed.
    #[error(
        "frame {frame} at tolerance {tolerance} needs more than the {limit_bytes} bytes of memory allowed ({links} pairs so far): raise --max-memory or the tolerance (with the form-factor oracle its EPS; where the scene has very many polygons, use fewer)"
    )]
    OutOfMemory {
        /// The frame being computed.
        frame: u32,
        /// The tolerance asked for.
        tolerance: f64,
        /// The limit, bytes.
        limit_bytes: u64,
        /// Pairs made when the limit was met.
        links: u64,
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
        /// What the last sweep left, relative to the mean radiosity.
        residual: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
    },
    /// What is absorbed and escapes is not what is emitted.
    #[error(
        "frame {frame}: {:.0} % of the light that is emitted is unaccounted for; most of it between {}: they pierce each other, or lie so close that form factors between them sum to more than 1; move them apart, make their materials reflect less, or use a finer tolerance", 100.0 * share, names(surfaces)
    )]
    Unbalanced {
        /// The frame being computed.
        frame: u32,
        /// Share of what is emitted.
        share: f64,
        /// Names of the surfaces whose rows exceed 1 by most.
        surfaces: Vec<String>,
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
    bed: Bed,
    /// Whether the seed is that of the scene.
    is_planted: bool,
    options: Options,
    simd: Simd,
    solved: Option<Solved>,
    /// In place of it once bodies came or left since.
    left: Option<Left>,
    /// What others may see of a step under way.
    watch: Arc<Watch>,
    /// Time that `moved` compares with, where it is not that of the last step.
    came_from: Option<f64>,
    /// What is held by hand.
    held: Held,
    /// Bodies that are not where the scene has them at rest, as the seed knows them.
    displaced: BTreeSet<BodyId>,
    /// Time of the clip, seconds.
    time_s: f64,
    /// Steps so far.
    frames: u32,
}

/// The world that a step leads to.
struct Next {
    frame: u32,
    /// Time of the clip, seconds.
    time_s: f64,
    world: World,
    /// The world of the frame before, which dynamic links are counted from.
    from: Option<World>,
}

/// What the last step left.
struct Solved {
    time_s: f64,
    world: World,
    /// What was held by hand.
    held: Held,
    forest: Forest,
    view: WorldView,
    /// By which certificates expire.
    ticks: Ticks,
    tree: PairTree,
    hash: PairHash,
    links: Links,
    groups: GroupLinks,
    coarse: Coarse,
    radiosity: Radiosity,
    /// Mean radiosity when no link was extrapolated last, W/m2.
    sound_mean_w_m2: f64,
    /// The world it was in.
    sound_world: World,
    events: Vec<LinkEvent>,
    /// Facets of which another part is covered than when they were solved, ascending.
    touched: Vec<ElementId>,
    report: FrameReport,
}

impl Solved {
    /// Whether nothing is extrapolated.
    fn is_settled(&self) -> bool {
        self.tree.live_count() == 0
    }
}

/// Threshold of the error oracle for a link, relative to the tolerance of the whole: the errors of
/// a receiver's links add up. Measured; see docs/tolerance.md.
const LINK_SHARE: f64 = 0.25;

/// Residual of the solver after a cold build, relative to the tolerance.
const RESIDUAL_SHARE: f64 = 0.005;

/// The same after an update: a small body that moves changes nearly everything a little, and that
/// little need not be followed.
const FOLLOWED_SHARE: f64 = 0.05;

impl Session {
    /// Prepares a scene for solving; the links are built by the first [`Session::step`].
    ///
    /// # Errors
    /// [`SessionError::Option`] if an option is out of its range.
    pub fn new(scene: impl Into<Arc<Scene>>, options: Options) -> Result<Session, SessionError> {
        options.validate()?;
        let scene = scene.into();
        let displaced: BTreeSet<BodyId> = scene.removed_bodies().collect();
        let (seed, coarse_ids) = seed_of(&scene, &options, &displaced);
        let simd = Simd::detect();
        let (watch, solved, came_from) = (Arc::default(), None, None);
        let (held, time_s, frames) = (Held::default(), 0.0, 0);
        Ok(Session {
            bed: Bed { scene, seed, coarse_ids },
            is_planted: true,
            options,
            simd,
            solved,
            left: None,
            watch,
            came_from,
            held,
            displaced,
            time_s,
            frames,
        })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.bed.scene
    }

    /// What can be seen of a step while it is under way, from any thread.
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
    /// [`SessionError::OutOfMemory`] if the links do not fit; there is no solution then until a
    /// step succeeds.
    #[doc(hidden)]
    pub fn step(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        self.time_s = time_s;
        self.frames += 1;
        let done = self.step_on(frame, time_s);
        // What was called off too late calls nothing else off.
        self.watch.take_cancelled();
        done
    }

    fn step_on(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        let Some(scene) = self.follow_hands() else { return self.step_to(frame, time_s) };
        // On the way bodies that left are still there, absent.
        let done = self.step_to(frame, time_s);
        match self.solved.take() {
            Some(solved) => self.solved = Some(self.forget_remains(solved, scene)),
            None => (self.bed.scene, self.is_planted) = (scene, false),
        }
        done.map(|_| self.now().report.clone())
    }

    fn step_to(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        let world = self.bed.scene.at_but(time_s, &self.held);
        let came_from = self.came_from.take();
        let from = came_from.map(|from_s| self.bed.scene.at_but(from_s, &self.held));
        let from = from.or(self.solved.as_ref().map(|s| s.world.clone()));
        let moved = from.as_ref().map_or(Vec::new(), |from| self.moved(from, &world));
        let next = Next { frame, time_s, world, from };
        let label = FrameReport { frame, time_s, moved, ..FrameReport::default() };
        let mut last = self.solved.take();
        if self.options.update == Update::Scratch {
            last = None;
        }
        // What was extrapolated cannot be taken along when time jumps or goes back, or a hand takes hold.
        let goes_on =
            |last: &Solved| last.ticks.goes_on(last.time_s, time_s) && last.held == self.held;
        last = last.filter(|last| last.is_settled() || goes_on(last));
        let solved = match last {
            Some(mut last)
                if last.is_settled() && last.world == next.world && last.touched.is_empty() =>
            {
                if time_s < last.time_s || !last.held.promises_as(&self.held) {
                    // What was foreseen from a later time says nothing of an earlier one.
                    last.ticks = Ticks::default();
                    last.tree.forget_certificates();
                }
                let report = last.report.of_a_still_frame(label);
                let held = self.held.clone();
                Solved { time_s, held, report, events: Vec::new(), ..last }
            }
            // On a thread of the pool: entering it anew for every small task would cost more.
            last => rayon::scope(|_| {
                let solved = self.advance(last, &next, label.clone())?;
                // Extrapolated links by which light grows as it should not: this frame is built anew.
                match solved.report.residual.is_infinite() {
                    true => self.advance(None, &next, label),
                    false => Ok(solved),
                }
            })?,
        };
        let report = solved.report.clone();
        self.solved = Some(solved);
        Ok(report)
    }

    /// Says at which time the frame before the next step was, where that is not the last step:
    /// [`FrameReport::moved`] and [`FrameReport::dynamic_links`] count from there. Nothing else
    /// depends on it.
    #[doc(hidden)]
    pub fn came_from(&mut self, time_s: Option<f64>) {
        self.came_from = time_s;
    }

    /// Solves the world as the commands so far have made it; the first time that is a cold build.
    ///
    /// # Errors
    /// [`SessionError`]; there is no solution then, and the next solve is a cold build.
    pub fn solve(&mut self) -> Result<Frame<'_>, SessionError> {
        self.solve_at(self.time_s)
    }

    /// Goes to a time of the clip, seconds, and solves the world there. Any time may follow any other.
    ///
    /// # Errors
    /// As [`Session::solve`].
    pub fn solve_at(&mut self, time_s: f64) -> Result<Frame<'_>, SessionError> {
        self.step(self.frames, time_s)?;
        Ok(Frame::new(self))
    }

    /// The last solution, if there is one.
    pub fn frame(&self) -> Option<Frame<'_>> {
        self.solved.is_some().then(|| Frame::new(self))
    }

    /// The world that the next [`Session::solve`] solves.
    pub fn world(&self) -> World {
        self.bed.scene.at_but(self.time_s, &self.held)
    }

    /// Time of the clip that the next [`Session::solve`] is at, seconds.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// What commands hold in place of what the clip says.
    pub fn held(&self) -> &Held {
        &self.held
    }

    /// Names of the bodies that are elsewhere in one world than in another.
    fn moved(&self, from: &World, to: &World) -> Vec<String> {
        let bodies = self.bed.scene.bodies.iter().enumerate();
        let moved = bodies.filter(|(b, _)| from.poses()[*b] != to.poses()[*b]);
        moved.map(|(_, body)| body.name.clone()).collect()
    }

    /// The present solution as an immutable value, read with the bends that links leave out.
    ///
    /// Cost: a pass over all links, some 90 ns each.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    #[doc(hidden)]
    pub fn snapshot(&self) -> Snapshot {
        let solved = self.solved.as_ref().expect("a step comes before a snapshot");
        snapshot::take(self, solved, (&solved.links, &solved.radiosity))
    }

    /// The present solution settled anew with links of every leaf's own in place of those above it: along
    /// edges between surfaces, where leaves of [`Session::snapshot`] inherit lines and parabolas through steep
    /// curves, some thirty times as accurate. The session's own solution stays as it is.
    ///
    /// Error: at the default tolerance leaves of a uniform closed scene are within 1e-3, relative
    /// (docs/tolerance.md). Cost: some ten times that of a frame with a moving light.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    #[doc(hidden)]
    pub fn reconstruction(&self) -> Snapshot {
        let solved = self.solved.as_ref().expect("a step comes before a snapshot");
        let (links, radiosity) = reconstruct::solve(self, solved);
        snapshot::take(self, solved, (&links, &radiosity))
    }

    /// The pair tree of the present solution, with the forest its elements are in.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    #[doc(hidden)]
    pub fn pairs(&self) -> (&PairTree, &Forest) {
        let solved = self.solved.as_ref().expect("a step comes before a look at the pairs");
        (&solved.tree, &solved.forest)
    }

    /// The link events of the last step, if [`Options::events`] asks for them: none after a cold build.
    /// In the order in which they were found, which is the same for any number of threads.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    #[doc(hidden)]
    pub fn events(&self) -> Vec<Event> {
        let solved = self.solved.as_ref().expect("a step comes before its events");
        events::named(&self.bed.scene, solved)
    }

    /// Sum of the form factors from every leaf element, in no order of meaning; 1 in a closed scene,
    /// up to the links' errors. Elements of absent bodies are among them.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    #[doc(hidden)]
    pub fn row_sums(&self) -> Vec<(ElementId, f64)> {
        let solved = self.solved.as_ref().expect("a step comes before a look at the rows");
        tally::row_sums_of(&self.bed.scene, solved)
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory(&self) -> Memory {
        let fixed = self.bed.seed.memory_bytes() + self.bed.seed.shared_bytes();
        let mut memory = Memory { fixed, ..Memory::default() };
        if let Some(s) = &self.solved {
            let of_groups = s.groups.memory_bytes() + s.radiosity.group_bytes();
            memory.pairs = s.tree.memory_bytes() + s.links.pool_bytes() + of_groups;
            memory.elements =
                s.forest.memory_bytes() + s.radiosity.memory_bytes() + s.links.span_bytes();
            memory.fixed += s.coarse.memory_bytes();
        }
        memory
    }

    /// Bytes that the engine's structures hold now, all together.
    pub fn memory_bytes(&self) -> u64 {
        let memory = self.memory();
        memory.pairs + memory.elements + memory.fixed
    }
}

/// The part of the forest that is always there, and its coarse elements by number.
fn seed_of(scene: &Scene, options: &Options, displaced: &BTreeSet<BodyId>) -> (Forest, Vec<u32>) {
    let is_displaced = |body: BodyId| displaced.contains(&body) || scene.is_inserted(body);
    let mut seed = match (options.oracle, options.groups) {
        (Oracle::Error, true) => Forest::with_groups(scene, &is_displaced),
        _ => Forest::displaced(scene, &is_displaced),
    };
    let coarse_ids = match options.oracle {
        Oracle::Error => coarse::number(scene, &mut seed),
        Oracle::FormFactor { .. } => Vec::new(),
    };
    (seed, coarse_ids)
}

/// Bytes that the engine's structures hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Pair tree and links by receiver.
    pub pairs: u64,
    /// Element forest, radiosities, and where each element's links are.
    pub elements: u64,
    /// What is as large at every tolerance: the forest that builds start from, what is known of
    /// facets and clusters alone (one copy for all), the coarse solution.
    pub fixed: u64,
}

/// Wall-clock time of the phases; it labels reports and decides nothing.
pub(crate) struct Clock {
    start: Instant,
    lap: Instant,
}

// The session times its phases for the report; no result uses it.
#[allow(clippy::disallowed_methods)]
impl Clock {
    pub(crate) fn start() -> Clock {
        let now = Instant::now();
        Clock { start: now, lap: now }
    }

    /// Seconds since the last lap.
    pub(crate) fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = (now - self.lap).as_secs_f64();
        self.lap = now;
        seconds
    }

    pub(crate) fn total(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
