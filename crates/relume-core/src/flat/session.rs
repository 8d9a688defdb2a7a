//! The session of the plane: owns all state, runs the phases of a frame.

use std::ops::Range;
use std::sync::Arc;

use crate::element::{ElementId, ElementKey};
use crate::event::Ticks;
use crate::pair::{Carried, LinkEvent, OutOfMemory, PairHash, PairTree, Record, update};
use crate::session::{
    Ahead, Clock, ElementName, Event, FrameReport, Memory, PairCounts, Receivers, Solution, Update,
    Void, apply_edits, balance_of, budget, links_of, most_mean, while_extrapolated, with_names,
};
use crate::solver::{Dirty, Links, Lit, Place, Radiosity, Surfaces};

use super::forest::FlatForest;
use super::judge::{FlatPlaced, PlaneView};
use super::plane::Segment;
use super::scene::{FlatScene, SceneError};

/// How a scene in the plane is solved.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatOptions {
    /// Largest form factor of a link, in (0, 1). Default 0.05.
    pub epsilon: f64,
    /// Elements up to this length are not refined, m. Default 0.02.
    pub min_length_m: f64,
    /// Whether elements are constant, as in the paper; otherwise links carry gradients. Default false.
    pub constant: bool,
    /// Residual of the solver, relative to the mean radiosity, in (0, 1). Default 1e-5.
    pub residual: f64,
    /// How the pair tree follows the motion. Default [`Update::Certificate`].
    pub update: Update,
    /// Whether every step measures row sums and energies. Default true.
    pub balance: bool,
    /// Whether every step keeps the events of its links, for [`FlatSession::events`].
    pub events: bool,
}

impl Default for FlatOptions {
    fn default() -> FlatOptions {
        FlatOptions {
            epsilon: 0.05,
            min_length_m: 0.02,
            constant: false,
            residual: 1e-5,
            update: Update::Certificate,
            balance: true,
            events: false,
        }
    }
}

/// An option out of its range, or a scene that cannot be solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OptionError {
    /// A threshold out of range.
    #[error("{0} is {1}: it must lie between 0 and 1")]
    Range(&'static str, f64),
    /// A length that is none.
    #[error("the smallest length is {0} m: it must not be negative")]
    Length(f64),
    /// Extrapolation over too many frames.
    #[error("extrapolate={0}: frames ahead must be 1 to 255")]
    Frames(u32),
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl FlatOptions {
    fn check(&self) -> Result<(), OptionError> {
        for (name, value) in [("epsilon", self.epsilon), ("the residual", self.residual)] {
            if !(value > 0.0 && value < 1.0) {
                return Err(OptionError::Range(name, value));
            }
        }
        if !(self.min_length_m >= 0.0 && self.min_length_m.is_finite()) {
            return Err(OptionError::Length(self.min_length_m));
        }
        match self.update {
            Update::Extrapolate { frames, .. } if !(1..=255).contains(&frames) => {
                Err(OptionError::Frames(frames))
            }
            Update::Extrapolate { error: Some(error), .. } if !(error > 0.0 && error < 1.0) => {
                Err(OptionError::Range("the error of extrapolation", error))
            }
            _ => Ok(()),
        }
    }
}

/// A link of the plane; it carries light both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatLink {
    /// First end.
    pub a: ElementId,
    /// Second end.
    pub b: ElementId,
    /// Exchange area without occlusion (m2 for each metre of depth) and visibility.
    pub carried: Carried,
}

/// An element of the plane as pictures need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatElement {
    /// Its id in the present solution.
    pub id: ElementId,
    /// Where it is in the world.
    pub place: Segment,
    /// Levels below its facet.
    pub level: u32,
    /// Whether it has no children.
    pub is_leaf: bool,
    /// Radiosity, W/m2.
    pub radiosity: [f32; 3],
}

/// One scene in the plane being solved, frame by frame.
pub struct FlatSession {
    scene: Arc<FlatScene>,
    options: FlatOptions,
    seed: FlatForest,
    solved: Option<Solved>,
    /// Time that dynamic links of a cold build are counted from.
    came_from: Option<f64>,
}

struct Solved {
    time_s: f64,
    forest: FlatForest,
    view: PlaneView,
    ticks: Ticks,
    tree: PairTree,
    hash: PairHash,
    links: Links,
    radiosity: Radiosity,
    /// Mean radiosity when no link was extrapolated last, W/m2.
    sound_mean_w_m2: f64,
    events: Vec<LinkEvent>,
    report: FrameReport,
}

/// Share of the pairs' room that may be vacant.
const VACANT_PAIRS: usize = 16;

impl FlatSession {
    /// Prepares a scene for solving.
    ///
    /// # Errors
    /// If an option is out of its range or the scene has nothing to solve.
    pub fn new(scene: Arc<FlatScene>, options: FlatOptions) -> Result<FlatSession, OptionError> {
        options.check()?;
        scene.check()?;
        let seed = FlatForest::new(&scene);
        Ok(FlatSession { scene, options, seed, solved: None, came_from: None })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &FlatScene {
        &self.scene
    }

    /// Brings the solution to `time_s`; `frame` only labels the report. Any time may follow any other:
    /// the links are those of a cold build at `time_s`, bit for bit, unless they are extrapolated.
    pub fn step(&mut self, frame: u32, time_s: f64) -> FrameReport {
        self.step_within(frame, time_s, None).expect("there is no limit")
    }

    /// The same within a limit on memory, bytes.
    ///
    /// # Errors
    /// [`OutOfMemory`] if the links do not fit; there is no solution then until a step succeeds.
    pub fn step_within(
        &mut self,
        frame: u32,
        time_s: f64,
        max_memory_bytes: Option<u64>,
    ) -> Result<FrameReport, OutOfMemory> {
        let from = self.came_from.take().or(self.solved.as_ref().map(|s| s.time_s));
        let last = self.solved.take().filter(|_| self.options.update != Update::Scratch);
        let settled = |last: &Solved| last.tree.live_count() == 0;
        // What was extrapolated cannot be taken along when time jumps or goes back.
        let last = last.filter(|l| settled(l) || l.ticks.goes_on(l.time_s, time_s));
        let label = FrameReport { frame, time_s, ..FrameReport::default() };
        let view = PlaneView::new(&self.scene, time_s);
        let solved = match last {
            Some(mut last) if settled(&last) && last.view == view => {
                if time_s < last.time_s {
                    // What was foreseen from a later time says nothing of an earlier one.
                    last.ticks = Ticks::default();
                    last.tree.forget_certificates();
                }
                let report = last.report.of_a_still_frame(label);
                Solved { time_s, report, events: Vec::new(), ..last }
            }
            last => rayon::scope(|_| {
                let extrapolates = last.is_some();
                let limit = max_memory_bytes;
                let solved = self.advance(last, from, view.clone(), (label.clone(), limit))?;
                // Extrapolated links by which light grows as it should not: this frame is built anew.
                match extrapolates && solved.report.residual.is_infinite() {
                    true => self.advance(None, from, view, (label, limit)),
                    false => Ok(solved),
                }
            })?,
        };
        let report = solved.report.clone();
        self.solved = Some(solved);
        Ok(report)
    }

    fn advance(
        &self,
        last: Option<Solved>,
        from: Option<f64>,
        view: PlaneView,
        (mut report, max_memory_bytes): (FrameReport, Option<u64>),
    ) -> Result<Solved, OutOfMemory> {
        let mut clock = Clock::start();
        let cold = last.is_none();
        let mut solved = last.unwrap_or_else(|| self.blank(report.time_s));
        let before = (!cold).then(|| std::mem::take(&mut solved.view));
        solved.view = view;
        if let Some(before) = &before {
            report.moved = self.moved(before, &solved.view);
        }
        report.seconds.moving = clock.lap();
        let times_s = [solved.time_s, report.time_s];
        let clocked = (&mut solved.ticks, &mut solved.tree);
        let ahead = match cold {
            true => Ahead::default(),
            false => {
                Ahead::new(self.options.update, &*self.scene, clocked, times_s, Void::default())
            }
        };
        let extrapolates = ahead.lookahead.is_some();
        report.seconds.predict = clock.lap();
        let mut placed = FlatPlaced {
            scene: &self.scene,
            forest: &mut solved.forest,
            now: &solved.view,
            before: before.as_ref(),
            epsilon: self.options.epsilon,
            min_length_m: self.options.min_length_m,
            constant: self.options.constant,
            ahead: ahead.foresight.as_ref(),
            lookahead: ahead.lookahead,
        };
        let walls: Vec<u32> = (0..self.scene.walls().len() as u32).collect();
        let record = Record { edits: !cold, events: !cold && self.options.events };
        let tree = (&mut solved.tree, &mut solved.hash);
        let may_go_on = budget::within(max_memory_bytes);
        let changes = update(tree, &mut placed, &walls, (record, &[]), &may_go_on)?;
        solved.events = changes.events;
        report.seconds.evaluate = clock.lap();
        let dirty = self.edit_links(&mut solved, &changes.edits, cold, &mut report);
        report.seconds.judge = clock.lap();
        let lit = LitPlane::new(&self.scene, &solved.forest);
        if lit.is_dark() {
            solved.radiosity = Radiosity::new(&lit);
        } else {
            let residual = self.options.residual;
            let most = self.most_mean_w_m2();
            if extrapolates {
                let stop = while_extrapolated(residual, solved.sound_mean_w_m2, most);
                solved.radiosity.solve(&lit, &solved.links, dirty, stop);
            } else {
                let bound = (residual, most_mean(most));
                solved.radiosity.solve_bounded(&lit, &solved.links, dirty, bound);
            }
        }
        report.seconds.solve = clock.lap();
        if solved.tree.live_count() == 0 {
            solved.sound_mean_w_m2 = solved.radiosity.mean_w_m2(&lit);
        }
        if solved.tree.vacant_len() * VACANT_PAIRS > solved.tree.len() {
            solved.tree.compact();
        }
        solved.time_s = report.time_s;
        report.count(&changes.work);
        if cold {
            report.dynamic_links = from.map_or(0, |from| self.dynamic_links(&solved, from));
        }
        self.tally(&mut report, &solved);
        report.seconds.total = clock.total();
        solved.report = report;
        Ok(solved)
    }

    /// The mean radiosity that no scene with these walls can pass, W/m2, whatever hides what.
    fn most_mean_w_m2(&self) -> f64 {
        let (mut emitted, mut length_m, mut rho) = (0.0, 0.0, 0.0_f64);
        for wall in self.scene.walls() {
            let long = wall.local.length();
            emitted += long * wall.material.exitance.iter().sum::<f64>() / 3.0;
            length_m += long;
            rho = wall.material.reflectance.into_iter().fold(rho, f64::max);
        }
        emitted / length_m / (1.0 - rho)
    }

    fn blank(&self, time_s: f64) -> Solved {
        Solved {
            time_s,
            forest: self.seed.clone(),
            view: PlaneView::default(),
            ticks: Ticks::default(),
            tree: PairTree::new(FlatForest::ROOT),
            hash: PairHash::default(),
            links: Links::default(),
            radiosity: Radiosity::default(),
            sound_mean_w_m2: 0.0,
            events: Vec::new(),
            report: FrameReport::default(),
        }
    }

    fn moved(&self, before: &PlaneView, now: &PlaneView) -> Vec<String> {
        let poses = before.poses().iter().zip(now.poses());
        let moved = poses.zip(self.scene.bodies()).filter(|((one, two), _)| one != two);
        moved.map(|(_, body)| body.name.clone()).collect()
    }

    fn edit_links(
        &self,
        solved: &mut Solved,
        edits: &[crate::pair::Edit],
        cold: bool,
        report: &mut FrameReport,
    ) -> Dirty {
        let Solved { links, forest, tree, radiosity, .. } = solved;
        let receivers = match cold {
            true => {
                *links = links_of(forest, tree);
                None
            }
            false => Some(apply_edits(links, forest, tree, edits)),
        };
        report.elements_reaped = forest.reap();
        let parents = forest.take_changed();
        let lit = LitPlane::new(&self.scene, forest);
        let Some(mut receivers) = receivers else {
            *radiosity = Radiosity::new(&lit);
            return Dirty::All;
        };
        radiosity.extend(forest.len());
        parents.iter().for_each(|&parent| radiosity.inherit(&lit, parent));
        receivers.retain(|&id| forest.is_element(ElementId(id)));
        Dirty::Some { receivers, parents }
    }

    fn tally(&self, report: &mut FrameReport, solved: &Solved) {
        let counts = solved.tree.counts();
        report.hash = solved.hash.to_string();
        report.links = counts.active;
        report.pairs =
            PairCounts { active: counts.active, refined: counts.refined, culled: counts.culled };
        report.elements = solved.forest.element_count();
        report.leaves = solved.forest.leaf_count();
        report.sweeps = solved.radiosity.sweeps;
        report.gathers = solved.radiosity.gathers;
        report.residual = solved.radiosity.residual;
        if !self.options.balance {
            return;
        }
        let surfaces = LitPlane::new(&self.scene, &solved.forest);
        let facets = solved.forest.facets().iter().copied();
        let lit = (&solved.links, &solved.radiosity);
        let (rows, energy) = balance_of(&surfaces, lit, facets, &|_| true);
        (report.row_sum_error, report.energy) = (Some(rows), Some(energy));
    }

    fn now(&self) -> &Solved {
        self.solved.as_ref().expect("a step comes before a look at the solution")
    }

    /// The pair tree of the present solution, with the forest its elements are in.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn pairs(&self) -> (&PairTree, &FlatForest) {
        (&self.now().tree, &self.now().forest)
    }

    /// Where everything is in the present solution.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn view(&self) -> &PlaneView {
        &self.now().view
    }

    /// All links, in the order of their names.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn links(&self) -> Vec<FlatLink> {
        let solved = self.now();
        let link = |l: crate::pair::Link| FlatLink { a: l.a, b: l.b, carried: l.carried };
        let mut out: Vec<FlatLink> = solved.tree.links().map(link).collect();
        out.sort_by_key(|l| (solved.forest.key(l.a), solved.forest.key(l.b)));
        out
    }

    /// All elements, parents before children, in the order of their names.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn elements(&self) -> Vec<FlatElement> {
        let Solved { forest, view, radiosity, .. } = self.now();
        let element = |id: ElementId| FlatElement {
            id,
            place: view.place(forest, id),
            level: forest.level(id),
            is_leaf: forest.children(id).is_empty(),
            radiosity: radiosity.radiosity(id.0),
        };
        forest.elements().into_iter().map(element).collect()
    }

    /// Radiosity of an element, W/m2.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn radiosity(&self, id: ElementId) -> [f32; 3] {
        self.now().radiosity.radiosity(id.0)
    }

    /// The events that led to the present solution, with names, if [`FlatOptions::events`] asks for them.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn events(&self) -> Vec<Event> {
        with_names(&self.now().events, &|facet| self.facet_name(ElementId(facet)))
    }

    /// The same as the engine records them.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn link_events(&self) -> &[LinkEvent] {
        &self.now().events
    }

    /// Where the element of a name is in the world, whether it exists or not.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn place_of(&self, key: ElementKey) -> Segment {
        let whole = self.now().view.place(&self.now().forest, ElementId(key.facet));
        let levels = (31 - key.path.leading_zeros()) / 2;
        (0..levels).rev().fold(whole, |s, level| s.half(key.path >> (2 * level) & 1))
    }

    /// The name of an element.
    ///
    /// # Panics
    /// Before the first [`FlatSession::step`].
    pub fn name(&self, id: ElementId) -> ElementName {
        let key = self.now().forest.key(id);
        self.facet_name(ElementId(key.facet)).at(key.path)
    }

    fn facet_name(&self, facet: ElementId) -> ElementName {
        let (wall, back) = self.seed.wall(facet);
        let wall = &self.scene.walls()[wall.0 as usize];
        let body = &self.scene.bodies()[wall.body.0 as usize];
        let surface = if back { format!("{} back", wall.name) } else { wall.name.clone() };
        let (body, path) = (body.name.clone(), Vec::new());
        ElementName::Element { body, surface, patch: None, facet: None, path }
    }

    /// Says at which time the frame before the next step was, where that is not the last step:
    /// [`FrameReport::dynamic_links`] of a cold build count from there. Nothing else depends on it.
    pub fn came_from(&mut self, time_s: Option<f64>) {
        self.came_from = time_s;
    }

    /// Links between bodies of which at least one is elsewhere than at another time.
    fn dynamic_links(&self, solved: &Solved, from_s: f64) -> u64 {
        let from = PlaneView::new(&self.scene, from_s);
        let dynamic = |link: &crate::pair::Link| {
            let bodies = [link.a, link.b].map(|id| solved.forest.body(id).expect("has a body"));
            let moved = |body: super::scene::BodyIndex| {
                from.poses()[body.0 as usize] != solved.view.poses()[body.0 as usize]
            };
            bodies[0] != bodies[1] && bodies.into_iter().any(moved)
        };
        solved.tree.links().filter(dynamic).count() as u64
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory(&self) -> Memory {
        let mut memory = Memory { fixed: self.seed.memory_bytes(), ..Memory::default() };
        if let Some(s) = &self.solved {
            memory.pairs = s.tree.memory_bytes() + s.links.pool_bytes();
            memory.elements =
                s.forest.memory_bytes() + s.radiosity.memory_bytes() + s.links.span_bytes();
        }
        memory
    }
}

impl Solution for FlatSession {
    fn tree(&self) -> &PairTree {
        &self.now().tree
    }

    fn report(&self) -> &FrameReport {
        &self.now().report
    }

    fn facets(&self) -> &[ElementId] {
        self.now().forest.facets()
    }

    fn id_limit(&self) -> u32 {
        self.now().forest.len() as u32
    }

    fn is_element(&self, id: ElementId) -> bool {
        self.now().forest.is_element(id)
    }

    fn children(&self, id: ElementId) -> Range<u32> {
        self.now().forest.children(id)
    }

    fn key(&self, id: ElementId) -> ElementKey {
        self.now().forest.key(id)
    }

    fn name_of(&self, key: ElementKey) -> ElementName {
        self.facet_name(ElementId(key.facet)).at(key.path)
    }

    fn area_m2(&self, id: ElementId) -> f64 {
        self.now().forest.length(id)
    }

    fn is_present(&self, _: ElementId) -> bool {
        true
    }

    fn radiosity(&self, id: ElementId) -> [f32; 3] {
        FlatSession::radiosity(self, id)
    }

    fn reflectance_max(&self) -> f64 {
        self.scene.walls().iter().flat_map(|w| w.material.reflectance).fold(0.0, f64::max)
    }

    fn is_of_the_scene_of(&self, other: &FlatSession) -> bool {
        self.seed.facets() == other.seed.facets()
            && self.scene.walls().len() == other.scene.walls().len()
    }
}

impl Receivers for FlatForest {
    fn room(&self) -> usize {
        self.len()
    }

    fn receives(&self, id: ElementId) -> bool {
        self.is_element(id)
    }

    fn receiving_area_m2(&self, id: ElementId) -> f64 {
        self.length(id)
    }
}

/// The forest of the plane as the solver sees it: an area is a length, and nothing varies across.
struct LitPlane<'a> {
    forest: &'a FlatForest,
    lit: Vec<Lit>,
}

impl<'a> LitPlane<'a> {
    fn new(scene: &FlatScene, forest: &'a FlatForest) -> LitPlane<'a> {
        let single = |v: [f64; 3]| v.map(|x| x as f32);
        let of = |wall: &super::scene::Wall| Lit {
            reflectance: single(wall.material.reflectance),
            exitance: single(wall.material.exitance),
        };
        LitPlane { forest, lit: scene.walls().iter().map(of).collect() }
    }

    fn is_dark(&self) -> bool {
        self.lit.iter().all(|lit| lit.exitance == [0.0; 3])
    }
}

impl Surfaces for LitPlane<'_> {
    fn len(&self) -> usize {
        self.forest.len()
    }

    fn facets(&self) -> &[ElementId] {
        self.forest.facets()
    }

    fn facet_of(&self, id: u32) -> u32 {
        self.forest.facet(ElementId(id)).0
    }

    fn parent(&self, id: u32) -> Option<u32> {
        self.forest.parent(ElementId(id)).map(|parent| parent.0)
    }

    fn children(&self, id: u32) -> Range<u32> {
        self.forest.children(ElementId(id))
    }

    fn area_m2(&self, id: u32) -> f64 {
        self.forest.length(ElementId(id))
    }

    fn place(&self, id: u32) -> Place {
        let id = ElementId(id);
        if !self.forest.is_element(id) {
            return Place { centroid: [0.0; 2], radius: 1.0, moment: [1.0, 0.0, 1.0] };
        }
        let length = self.forest.length(id);
        let whole = self.forest.local(self.forest.facet(id));
        let middle = (self.forest.local(id).centre() - whole.start).length();
        Place {
            centroid: [middle as f32, 0.0],
            radius: (0.5 * length) as f32,
            // The second axis is that of the symmetry: anything but 0.
            moment: [(length * length / 12.0) as f32, 0.0, 1.0],
        }
    }

    fn source_moment(&self) -> f32 {
        1.0 / 3.0
    }

    fn lit(&self, facet: u32) -> &Lit {
        &self.lit[self.forest.wall(ElementId(facet)).0.0 as usize]
    }
}
