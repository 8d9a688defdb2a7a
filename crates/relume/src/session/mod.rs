//! The session owns all mutable state and runs the phases of a frame; snapshots come out.

use std::sync::Arc;
use std::time::Instant;

use crate::element::{Forest, WorldView};
use crate::pair::{self, Brightness, Frontier, PairTree, Placed, Stage, Work, grow, resume};
use crate::scene::{BodyId, Scene};
use crate::solver::{Links, Radiosity, Stop};
use crate::transport::Simd;

mod coarse;
mod gather;
mod options;
mod report;
mod snapshot;
mod surfaces;
mod tally;

pub use options::{Options, Oracle, Update};
pub use report::{Energy, FrameReport, PairCounts, RowSumError, Seconds};
pub use snapshot::{Leaf, Snapshot};

use surfaces::LitForest;

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
    /// An option is out of its range.
    #[error("{0}")]
    Option(String),
}

/// One scene being solved, frame by frame.
pub struct Session {
    scene: Arc<Scene>,
    options: Options,
    simd: Simd,
    /// The fixed part of the forest, where every build starts.
    seed: Forest,
    solved: Option<Solved>,
    /// Time that `moved` compares with, where it is not that of the last step.
    came_from: Option<f64>,
}

/// What the last step left.
struct Solved {
    time_s: f64,
    forest: Forest,
    view: WorldView,
    tree: PairTree,
    links: Links,
    radiosity: Radiosity,
}

/// Threshold of the error oracle for a link, relative to the tolerance of the whole: the errors of
/// a receiver's links add up. Measured; see docs/tolerance.md.
const LINK_SHARE: f64 = 0.25;

/// Residual of the solver relative to the tolerance.
const RESIDUAL_SHARE: f64 = 0.005;

impl Session {
    /// Prepares a scene for solving; the links are built by the first [`Session::step`].
    ///
    /// # Errors
    /// [`SessionError::Option`] if an option is out of its range.
    pub fn new(scene: Arc<Scene>, options: Options) -> Result<Session, SessionError> {
        options.validate()?;
        let seed = Forest::new(&scene);
        Ok(Session { scene, options, simd: Simd::detect(), seed, solved: None, came_from: None })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The options it is solved with.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Brings the solution to `time_s` (seconds of the animation); `frame` only labels the report.
    ///
    /// # Errors
    /// [`SessionError::OutOfMemory`] if the links do not fit; the last solution is kept.
    pub fn step(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, SessionError> {
        let mut clock = Clock::start();
        let mut report = FrameReport { frame, time_s, ..FrameReport::default() };
        report.moved = self.moved_since_last(time_s);
        let mut forest = self.seed.clone();
        let view = WorldView::new(&self.scene, &forest, time_s);
        report.seconds.moving = clock.lap();

        let mut tree = PairTree::new(Forest::ROOT);
        let mut work = Work::default();
        let (start, coarse) = self.build(&mut forest, &view, &mut tree, &mut work, frame)?;
        report.seconds.evaluate = clock.lap();

        let links = surfaces::links_of(&forest, tree.links());
        let lit = LitForest::new(&self.scene, &forest);
        let stop = Stop::Residual(self.options.tolerance * RESIDUAL_SHARE);
        let guess = |id: u32| coarse::radiosity_at(&forest, &start, &coarse, id, &lit);
        let radiosity = Radiosity::solve(&lit, &links, Some(&guess), stop);
        report.seconds.solve = clock.lap();

        let solved = Solved { time_s, forest, view, tree, links, radiosity };
        tally::fill(&mut report, &self.scene, &solved, &work);
        report.seconds.total = clock.total();
        self.came_from = None;
        self.solved = Some(solved);
        Ok(report)
    }

    /// Grows the pair tree of the present poses; returns the coarse solution on the way.
    fn build(
        &self,
        forest: &mut Forest,
        view: &WorldView,
        tree: &mut PairTree,
        work: &mut Work,
        frame: u32,
    ) -> Result<(Radiosity, Vec<u32>), SessionError> {
        let limit = self.options.max_memory_bytes.unwrap_or(u64::MAX);
        let enough = |tree: &PairTree, elements: usize, scratch: u64| {
            // Links and solution are still to come: 16 bytes a pair, 32 an element.
            let pairs = tree.memory_bytes() + tree.len() as u64 * 16;
            pairs + elements as u64 * 96 + scratch <= limit
        };
        let oracle = self.options.pair_oracle();
        let coarse = match oracle {
            pair::Oracle::Error { .. } => coarse::number(&self.scene, forest),
            pair::Oracle::FormFactor { .. } => Vec::new(),
        };
        let mut placed =
            Placed { forest: &mut *forest, view, stage: Stage::Coarse, oracle, simd: self.simd };
        let root = [Forest::ROOT.0];
        let (frontier, start, brightness);
        if coarse.is_empty() {
            (start, brightness) = (Radiosity::default(), Brightness::default());
            placed.stage = Stage::Fine(&brightness);
            frontier = grow(tree, &mut placed, &root, work, &enough).map(|_| Frontier::default());
        } else {
            let held = grow(tree, &mut placed, &root, work, &enough);
            let held = held.ok_or_else(|| self.too_large(tree, limit, frame))?;
            (start, brightness) = coarse::solve(&self.scene, placed.forest, tree, &held, &coarse);
            let mut placed = Placed {
                forest: &mut *forest,
                view,
                stage: Stage::Fine(&brightness),
                oracle,
                simd: self.simd,
            };
            frontier = resume(tree, &mut placed, held, work, &enough);
        }
        match frontier {
            Some(_) => Ok((start, coarse)),
            None => Err(self.too_large(tree, limit, frame)),
        }
    }

    fn too_large(&self, tree: &PairTree, limit_bytes: u64, frame: u32) -> SessionError {
        let tolerance = self.options.tolerance;
        SessionError::OutOfMemory { frame, tolerance, limit_bytes, links: tree.len() as u64 }
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

    /// The present solution as an immutable value.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn snapshot(&self) -> Snapshot {
        let solved = self.solved.as_ref().expect("a step comes before a snapshot");
        snapshot::take(&self.scene, solved)
    }

    /// The pair tree of the present solution, with the forest its elements are in.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn pairs(&self) -> (&PairTree, &Forest) {
        let solved = self.solved.as_ref().expect("a step comes before a look at the pairs");
        (&solved.tree, &solved.forest)
    }

    /// Sum of the form factors from a leaf element; 1 in a closed scene, up to the links' errors.
    ///
    /// # Panics
    /// Before the first [`Session::step`].
    pub fn row_sum(&self, leaf: crate::element::ElementId) -> f64 {
        let solved = self.solved.as_ref().expect("a step comes before a look at the rows");
        f64::from(solved.radiosity.row_sum(leaf.0))
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory_bytes(&self) -> u64 {
        let solved = self.solved.as_ref().map_or(0, |s| {
            s.tree.memory_bytes()
                + s.links.memory_bytes()
                + s.radiosity.memory_bytes()
                + s.forest.memory_bytes()
        });
        self.seed.memory_bytes() + solved
    }
}

/// Wall-clock time of the phases; it labels reports and decides nothing.
struct Clock {
    start: Instant,
    lap: Instant,
}

// The session times its phases for the report; no result uses it.
#[allow(clippy::disallowed_methods)]
impl Clock {
    fn start() -> Clock {
        let now = Instant::now();
        Clock { start: now, lap: now }
    }

    /// Seconds since the last lap.
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = (now - self.lap).as_secs_f64();
        self.lap = now;
        seconds
    }

    fn total(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
