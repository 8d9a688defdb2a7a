//! The session owns all mutable state and runs the phases of a frame; snapshots come out.

use std::sync::Arc;
use std::time::Instant;

use crate::element::{ElementId, Forest, WorldView};
use crate::event::Ticks;
use crate::pair::{LinkEvent, PairHash, PairTree};
use crate::scene::{BodyId, Scene};
use crate::solver::{GroupLinks, Links, Radiosity};
use crate::transport::Simd;

mod advance;
mod ahead;
mod bends;
pub(crate) mod budget;
mod coarse;
mod compact;
mod compare;
mod estimate;
mod events;
mod factors;
mod gather;
mod groups;
mod lossy;
mod names;
mod options;
mod pieces;
mod reconstruct;
mod report;
mod snapshot;
mod solution;
mod surfaces;
mod tally;
mod watch;

pub use compare::{Difference, RadiosityGap, Which, compare, radiosity_gap};
pub use estimate::Estimate;
pub use events::{Event, EventKind};
pub use factors::{Closure, Factors, Grouping, Open, PartFactors};
pub use gather::Sensor;
pub use lossy::{Missed, RadiosityError, missed, radiosity_error};
pub use names::ElementName;
pub use options::{Options, Oracle, Update};
pub use report::{Energy, FrameReport, LinkKinds, PairCounts, RowSumError, Seconds};
pub use snapshot::{Leaf, Snapshot};
pub use solution::Solution;
pub use watch::Watch;

// Flatland's session shares these.
pub(crate) use ahead::{Ahead, most_mean, while_extrapolated};
pub(crate) use events::with_names;
pub(crate) use surfaces::{Receivers, apply_edits, links_of};
pub(crate) use tally::balance_of;

use coarse::Coarse;

/// Why a frame could not be computed.
#[derive(Debug, thiserror::Error)]
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
    scene: Arc<Scene>,
    options: Options,
    simd: Simd,
    /// The part of the forest that is always there, where every build starts.
    seed: Forest,
    /// Coarse elements of the seed by number; none for oracles that ask for no brightness.
    coarse_ids: Vec<u32>,
    solved: Option<Solved>,
    /// What others may see of a step under way.
    watch: Arc<Watch>,
    /// Time that `moved` compares with, where it is not that of the last step.
    came_from: Option<f64>,
}

/// What the last step left.
struct Solved {
    time_s: f64,
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
    /// When that was.
    sound_time_s: f64,
    events: Vec<LinkEvent>,
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
    pub fn new(scene: Arc<Scene>, options: Options) -> Result<Session, SessionError> {
        options.validate()?;
        let mut seed = match (options.oracle, options.groups) {
            (Oracle::Error, true) => Forest::with_groups(&scene),
            _ => Forest::new(&scene),
        };
        let coarse_ids = match options.oracle {
            Oracle::Error => coarse::number(&scene, &mut seed),
            Oracle::FormFactor { .. } => Vec::new(),
        };
        let simd = Simd::detect();
        let (watch, solved, came_from) = (Arc::default(), None, None);
        Ok(Session { scene, options, simd, seed, coarse_ids, solved, watch, came_from })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
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
    pub fn step(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        let moved = self.moved_since_last(time_s);
        let from = self.came_from.take().or(self.solved.as_ref().map(|s| s.time_s));
        let label = FrameReport { frame, time_s, moved, ..FrameReport::default() };
        let mut last = self.solved.take();
        if self.options.update == Update::Scratch {
            last = None;
        }
        // What was extrapolated cannot be taken along when time jumps or goes back.
        last = last.filter(|last| last.is_settled() || last.ticks.goes_on(last.time_s, time_s));
        let solved = match last {
            Some(mut last) if last.is_settled() && self.is_still(&last, time_s) => {
                if time_s < last.time_s {
                    // What was foreseen from a later time says nothing of an earlier one.
                    last.ticks = Ticks::default();
                    last.tree.forget_certificates();
                }
                let report = last.report.of_a_still_frame(label);
                Solved { time_s, report, events: Vec::new(), ..last }
            }
            // On a thread of the pool: entering it anew for every small task would cost more.
            last => rayon::scope(|_| {
                let solved = self.advance(last, from, label.clone())?;
                // Extrapolated links by which light grows as it should not: this frame is built anew.
                match solved.report.residual.is_infinite() {
                    true => self.advance(None, from, label),
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
    pub fn came_from(&mut self, time_s: Option<f64>) {
        self.came_from = time_s;
    }

    fn moved_since_last(&self, time_s: f64) -> Vec<String> {
        let last = self.came_from.or(self.solved.as_ref().map(|s| s.time_s));
        let Some(last_s) = last else { return Vec::new() };
        let moved = |b: &usize| {
            let body = BodyId(*b as u32);
            self.scene.pose(body, time_s) != self.scene.pose(body, last_s)
        };
        (0..self.scene.bodies.len())
            .filter(moved)
            .map(|b| self.scene.bodies[b].name.clone())
            .collect()
    }

    /// The present solution as an immutable value, read with the bends that links leave out.
    ///
    /// Cost: a pass over all links, some 90 ns each.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
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
    pub fn reconstruction(&self) -> Snapshot {
        let solved = self.solved.as_ref().expect("a step comes before a snapshot");
        let (links, radiosity) = reconstruct::solve(self, solved);
        snapshot::take(self, solved, (&links, &radiosity))
    }

    /// The pair tree of the present solution, with the forest its elements are in.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn pairs(&self) -> (&PairTree, &Forest) {
        let solved = self.solved.as_ref().expect("a step comes before a look at the pairs");
        (&solved.tree, &solved.forest)
    }

    /// The link events of the last step, if [`Options::events`] asks for them: none after a cold build.
    /// In the order in which they were found, which is the same for any number of threads.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn events(&self) -> Vec<Event> {
        let solved = self.solved.as_ref().expect("a step comes before its events");
        events::named(&self.scene, solved)
    }

    /// Sum of the form factors from every leaf element, in no order of meaning; 1 in a closed scene,
    /// up to the links' errors. Elements of absent bodies are among them.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn row_sums(&self) -> Vec<(ElementId, f64)> {
        let solved = self.solved.as_ref().expect("a step comes before a look at the rows");
        tally::row_sums_of(&self.scene, solved)
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory(&self) -> Memory {
        let fixed = self.seed.memory_bytes() + self.seed.shared_bytes();
        let mut memory = Memory { fixed, ..Memory::default() };
        if let Some(s) = &self.solved {
            memory.pairs = s.tree.memory_bytes() + s.links.pool_bytes() + s.groups.memory_bytes();
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
