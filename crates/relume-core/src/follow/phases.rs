//! The phases of a frame: move, predict, coarse, fine, edit, solve, tally (`Follower::frame`).
//!
//! A cold build runs the same phases without a state to start from.

use crate::element::ElementId;
use crate::pair::{
    Changes, Edit, OutOfMemory, PairHash, PairId, PairTree, Pairs, Record, Scope, update,
};
use crate::predict::Ticks;
use crate::solver::{Bounds, Dirty, Links, Radiosity};

use super::budget;
use super::clock::Clock;
use super::follower::{Follower, Said, Why};
use super::links::{Receivers, apply_edits, links_of};
use super::prediction::{Clocked, Prediction, mean_radiosity_limit, while_extrapolated};
use super::report::{FrameReport, Memory, PairCounts};
use super::space::{Balance, Level, Motion, Space};
use super::tuning::VACANT_PAIRS;
use super::update::Update;
use super::watch::Watch;

/// Settings of one frame.
pub(crate) struct Order<'a> {
    /// Head of the report: frame, time, and names of moved bodies.
    pub(crate) label: FrameReport,
    /// Strategy by which the pairs follow motion.
    pub(crate) update: Update,
    /// Whether events of links are kept.
    pub(crate) events: bool,
    /// Whether row sums and energies are measured.
    pub(crate) balance: bool,
    /// Limit on memory, bytes.
    pub(crate) max_memory_bytes: Option<u64>,
    /// Progress of the frame for other threads, by which they may also cancel it.
    pub(crate) watch: Option<&'a Watch>,
}

/// A frame that failed.
pub(crate) struct Failed<S> {
    /// State at the failure.
    state: Follower<S>,
    is_cold: bool,
    pub(crate) why: Why,
}

/// A frame under way.
struct Step<'f, 'g, S: Space> {
    goal: &'f S::Goal<'g>,
    order: &'f Order<'f>,
    was: &'f S::Was,
    prediction: Prediction,
    /// Whether this is a cold build.
    is_cold: bool,
}

// Spaces are the engine's own: nobody else has one to follow.
#[allow(private_bounds)]
impl<S: Space> Follower<S> {
    /// The state at a goal, from the last state where there is one.
    pub(crate) fn follow(
        last: Option<Self>,
        goal: &S::Goal<'_>,
        order: &Order<'_>,
    ) -> Result<Self, Box<Failed<S>>> {
        let last =
            last.filter(|last| order.update != Update::Scratch && last.leads_on(goal, order));
        match last {
            Some(last) if last.is_at(goal) => Ok(last.stay(goal, &order.label)),
            // On a thread of the pool: entering it anew for every small task would cost more.
            last => rayon::scope(|_| {
                let was_warm = last.is_some();
                let done = Self::frame(last, goal, order)?;
                // Extrapolated links by which light grows as it should not: this frame is built anew.
                match was_warm && done.report.residual.is_infinite() {
                    true => Self::frame(None, goal, order),
                    false => Ok(done),
                }
            }),
        }
    }

    /// One frame, phase by phase: the place where it is decided what is evaluated again.
    fn frame(
        last: Option<Self>,
        goal: &S::Goal<'_>,
        order: &Order<'_>,
    ) -> Result<Self, Box<Failed<S>>> {
        let (mut clock, mut report) = (Clock::start(), order.label.clone());
        let is_cold = last.is_none();
        let mut state = last.unwrap_or_else(|| Follower::unsolved(goal, order.label.time_s));
        let failed = |state, why| Err(Box::new(Failed { state, is_cold, why }));

        let was = state.space.go(goal);
        let mut change = (!is_cold).then(|| state.space.change(goal, &was));
        report.seconds.moving = clock.lap();

        let prediction = state.predict(goal, &was, order, is_cold);
        let step = Step { goal, order, was: &was, prediction, is_cold };
        report.seconds.predict = clock.lap();

        let coarse = state.coarse(&step, &mut change);
        let changes = coarse.and_then(|coarse| state.fine(&step, change.as_ref(), coarse));
        let Ok(changes) = changes else {
            let is_called_off = order.watch.is_some_and(Watch::is_cancelled);
            return failed(state, if is_called_off { Why::Cancelled } else { Why::OutOfMemory });
        };
        report.seconds.evaluate = clock.lap();

        let edited = state.edit(&step, changes, &mut report);
        report.seconds.edit = clock.lap();

        state.solve(&step, edited);
        report.seconds.solve = clock.lap();

        state.compact();
        state.tally(&step, &mut report);
        report.seconds.total = clock.total();
        state.report = report;
        match S::check(goal, &state) {
            Ok(()) => Ok(state),
            Err(why) => failed(state, why),
        }
    }

    /// State without a solution: the initial elements and an unjudged root pair.
    fn unsolved(goal: &S::Goal<'_>, time_s: f64) -> Self {
        Follower {
            time_s,
            space: S::unsolved(goal),
            tree: PairTree::new(S::ROOT),
            hash: PairHash::default(),
            links: Links::default(),
            radiosity: Radiosity::default(),
            events: Vec::new(),
            report: FrameReport::default(),
            ticks: Ticks::default(),
            last_exact_mean_w_m2: 0.0,
            is_broken: false,
            is_unsolved: true,
        }
    }

    /// Whether a frame may start from this state: extrapolated links cannot be kept when time jumps or goes back, or when a
    /// command moves a body.
    fn leads_on(&self, goal: &S::Goal<'_>, order: &Order<'_>) -> bool {
        let goes_on = || self.ticks.goes_on(self.time_s, order.label.time_s);
        self.is_settled() || (!self.is_broken && goes_on() && self.space.goes_on(goal))
    }

    /// Whether this state is that of a goal.
    fn is_at(&self, goal: &S::Goal<'_>) -> bool {
        self.is_settled() && !self.is_unsolved && self.space.is_at(goal)
    }

    /// This state as that of another frame in which nothing differs.
    fn stay(mut self, goal: &S::Goal<'_>, label: &FrameReport) -> Self {
        if !self.space.stay(goal) || label.time_s < self.time_s {
            // Certificates from a later time do not cover an earlier one.
            self.ticks = Ticks::default();
            self.tree.forget_certificates();
        }
        let report = self.report.of_a_still_frame(label.clone());
        Follower { time_s: label.time_s, events: Vec::new(), report, ..self }
    }

    /// Prediction of the strategy from this frame on.
    fn predict(
        &mut self,
        goal: &S::Goal<'_>,
        was: &S::Was,
        order: &Order<'_>,
        is_cold: bool,
    ) -> Prediction {
        self.is_broken = false;
        let to_s = order.label.time_s;
        let from_s = std::mem::replace(&mut self.time_s, to_s);
        if is_cold {
            return Prediction::default();
        }
        let (ticks, tree) = (&mut self.ticks, &mut self.tree);
        self.space.prediction(goal, was, order.update, Clocked { ticks, tree, from_s, to_s })
    }

    /// Updates the pairs down to the coarse elements, and the coarse solution that verdicts weigh by.
    fn coarse(
        &mut self,
        step: &Step<'_, '_, S>,
        change: &mut Option<S::Change<'_>>,
    ) -> Result<Changes, OutOfMemory> {
        if !S::has_coarse(step.goal) {
            return Ok(Changes::default());
        }
        let changes = self.bring(step, Level::Coarse, change.as_ref(), &[])?;
        self.space.weigh(step.goal, step.was, &changes, change.as_mut());
        Ok(changes)
    }

    /// Updates all pairs, until every leaf of the tree is a link or culled.
    fn fine(
        &mut self,
        step: &Step<'_, '_, S>,
        change: Option<&S::Change<'_>>,
        coarse: Changes,
    ) -> Result<Changes, OutOfMemory> {
        let mut all = coarse;
        let fine = self.bring(step, Level::Fine, change, &all.refined);
        if fine.is_err() {
            // A culled pair that the coarse update woke keeps its state until this one: the way back finds it culled and drops no link.
            self.space.forget_coarse_links(step.goal, &all.coarse_links);
        }
        let fine = fine?;
        all.work.add_after_coarse(fine.work);
        all.edits.extend(fine.edits);
        all.apart.extend(fine.apart);
        all.events.extend(fine.events);
        Ok(all)
    }

    /// Updates pairs down to a level.
    fn bring(
        &mut self,
        step: &Step<'_, '_, S>,
        level: Level,
        change: Option<&S::Change<'_>>,
        fresh: &[PairId],
    ) -> Result<Changes, OutOfMemory> {
        let Step { goal, order, is_cold, .. } = step;
        let within = budget::within(order.max_memory_bytes);
        let may_go_on = |tree: &PairTree, elements: usize, scratch: u64| {
            let is_wanted = order.watch.is_none_or(|watch| {
                watch.see(tree.len() as u64, budget::bytes_of(tree, elements, scratch));
                !watch.is_cancelled()
            });
            is_wanted && within(tree, elements, scratch)
        };
        let motion = Motion { change, prediction: &step.prediction };
        let mut judge = self.space.judge(goal, level, &motion);
        let scope = Scope {
            candidates: &S::candidates(goal),
            record: Record { edits: !is_cold, events: !is_cold && order.events },
            fresh,
            may_go_on: &may_go_on,
        };
        update(Pairs { tree: &mut self.tree, hash: &mut self.hash }, &mut judge, &scope)
    }

    /// Applies the changes of pairs to elements, links and groups.
    fn edit(
        &mut self,
        step: &Step<'_, '_, S>,
        mut changes: Changes,
        report: &mut FrameReport,
    ) -> Edited {
        let remade = self.space.remade(step.was, &self.tree);
        changes.edits.extend(remade.into_iter().map(Edit::Set));
        self.events = std::mem::take(&mut changes.events);
        report.work = changes.work;
        let mut dirty = self.edit_links(step, &changes.edits, report);
        let apart = (!step.is_cold).then_some(changes.apart);
        self.space.place_groups(step.goal, step.was, &self.tree, apart);
        let sources_differ = self.space.add_dirty(step.goal, step.was, &mut dirty);
        Edited { dirty, sources_differ }
    }

    /// Applies edits of the pair tree to links and elements; returns the receivers to be gathered.
    fn edit_links(
        &mut self,
        step: &Step<'_, '_, S>,
        edits: &[Edit],
        report: &mut FrameReport,
    ) -> Dirty {
        let many = edits.len() as u64 > self.tree.counts().active / 2;
        let receivers = if step.is_cold || many {
            report.elements_reaped = self.space.reap();
            self.links = links_of(self.space.forest(), &self.tree);
            None
        } else {
            let forest = self.space.forest();
            let receivers = apply_edits(&mut self.links, forest, &self.tree, edits);
            report.elements_reaped = self.space.reap();
            Some(receivers)
        };
        let mut parents = self.space.take_changed();
        let surfaces = self.space.surfaces(step.goal, false);
        if self.is_unsolved {
            self.radiosity = self.space.first_guess(step.goal, &surfaces);
            return Dirty::All;
        }
        let forest = self.space.forest();
        self.radiosity.extend(forest.room());
        let receives = |id: &u32| forest.receives(ElementId(*id));
        parents.retain(receives);
        parents.iter().for_each(|&parent| self.radiosity.inherit(&surfaces, parent));
        match receivers {
            None => Dirty::All,
            Some(mut receivers) => {
                receivers.retain(receives);
                Dirty::Some { receivers, parents }
            }
        }
    }

    /// Solves for radiosity: gathers receivers that may have changed until the residual is small.
    fn solve(&mut self, step: &Step<'_, '_, S>, edited: Edited) {
        let Edited { dirty, sources_differ } = edited;
        let goal = step.goal;
        let surfaces = self.space.surfaces(goal, matches!(dirty, Dirty::All));
        if sources_differ {
            self.space.set_sources(goal, &surfaces, &mut self.radiosity);
        }
        let residual = S::residual(goal, self.is_unsolved);
        let bound_w_m2 = S::mean_radiosity_bound_w_m2(goal);
        if let Some(dark) = self.space.if_dark(goal, &surfaces) {
            // Light of earlier frames would decay without end.
            self.radiosity = dark;
        } else if self.is_settled() {
            let bounds = Bounds {
                residual,
                // From nothing a frame goes the way of a cold build.
                from_nothing: S::residual(goal, true),
                mean_w_m2: mean_radiosity_limit(bound_w_m2),
                rows_are_close: S::rows_are_close(goal),
            };
            self.radiosity.solve_bounded(&surfaces, &self.links, dirty, bounds);
        } else {
            let mean = self.last_exact_mean_w_m2 * self.space.brightened(goal);
            // If the last exact solution was black, there is no growth bound.
            let mean = if mean > 0.0 { mean } else { f64::INFINITY };
            let stop = while_extrapolated(residual, mean, bound_w_m2);
            self.radiosity.solve(&surfaces, &self.links, dirty, stop);
        }
        self.is_unsolved = false;
        let is_settled = self.is_settled();
        if is_settled {
            self.last_exact_mean_w_m2 = self.radiosity.mean_w_m2(&surfaces);
        }
        drop(surfaces);
        self.space.finish(is_settled);
    }

    /// Compacts elements and pairs where many are vacant, and frees spare memory: memory follows the present state, not the
    /// largest one so far. Only ids change.
    pub(crate) fn compact(&mut self) {
        if let Some(to) = self.space.compact() {
            self.links.renumber(&to);
            self.radiosity.renumber(&to);
            self.tree.renumber(&to);
        }
        if self.tree.vacant_len() * VACANT_PAIRS > self.tree.len() {
            self.tree.compact();
        }
        self.space.trim();
        self.tree.trim();
        self.links.trim();
        self.radiosity.trim();
    }

    /// Counts pairs, elements and memory; measures the balance on request.
    fn tally(&self, step: &Step<'_, '_, S>, report: &mut FrameReport) {
        self.count(report);
        if step.order.balance {
            let Balance { rows, energy, suspects } = S::balance(self);
            (report.row_sum_error, report.energy) = (Some(rows), Some(energy));
            report.suspects = suspects;
        }
        if step.is_cold {
            report.work.dynamic_links = self.space.dynamic_links(step.goal, &self.tree);
        }
    }

    /// Fills in the numbers of pairs and elements, and the work of the solver.
    pub(crate) fn count(&self, report: &mut FrameReport) {
        let counts = self.tree.counts();
        report.hash = self.hash.to_string();
        report.links = counts.active;
        report.pairs =
            PairCounts { active: counts.active, refined: counts.refined, culled: counts.culled };
        self.space.count(&self.tree, report);
        report.sweeps = self.radiosity.sweeps;
        report.gathers = self.radiosity.gathers;
        report.residual = self.radiosity.residual;
    }

    /// An earlier solution, computed again without limits; from a given state where there is one.
    pub(crate) fn found_again(
        from: Option<Self>,
        goal: &S::Goal<'_>,
        order: Order<'_>,
        said: Said,
    ) -> Option<Self> {
        let FrameReport { frame, time_s, .. } = said.report;
        let label = FrameReport { frame, time_s, ..FrameReport::default() };
        let order = Order { label, max_memory_bytes: None, watch: None, ..order };
        let mut found = Follower::follow(from, goal, &order).ok()?;
        // Extrapolated links are not found again.
        if found.report.hash == said.report.hash {
            (found.report, found.events) = (said.report, said.events);
        }
        Some(found)
    }

    /// Bytes held.
    pub(crate) fn memory(&self) -> Memory {
        let [with_pairs, with_elements, fixed] = self.space.bytes();
        let groups = self.radiosity.group_bytes();
        Memory {
            pairs: self.tree.memory_bytes() + self.links.pool_bytes() + with_pairs + groups,
            elements: with_elements + self.radiosity.memory_bytes() + self.links.span_bytes(),
            fixed,
        }
    }
}

/// Result of the edit phase.
struct Edited {
    dirty: Dirty,
    /// Whether punctual lights or distant elements changed.
    sources_differ: bool,
}

impl<S: Space> Failed<S> {
    /// Number of pairs when it failed.
    pub(crate) fn pairs(&self) -> u64 {
        self.state.tree.len() as u64
    }

    /// A state from which a frame may lead back to where the failed one began; `None` where it began with nothing.
    ///
    /// A frame in the opposite direction re-evaluates every pair that the failed frame may have changed, however far that came:
    /// the links are those of before, bit for bit.
    pub(crate) fn into_way_back(self) -> Option<Follower<S>> {
        let Failed { mut state, is_cold, why } = self;
        if is_cold || !state.is_settled() {
            return None;
        }
        state.break_promise();
        state.ticks = Ticks::default();
        state.space.stop();
        // A solution that did not settle is no guess.
        state.is_unsolved = !matches!(why, Why::OutOfMemory | Why::Cancelled);
        Some(state)
    }
}
