//! One step: from the state at one instant to that at another, by edits.
//!
//! Without a state to start from, the same edits build it: a cold build is the update of nothing.

use glam::DVec3;

use crate::element::{ElementId, Forest, Kind, WorldView};
use crate::event::Ticks;
use crate::pair::{
    Changes, Edit, OutOfMemory, PairHash, PairId, PairTree, Placed, Record, Since, Stage, update,
};
use crate::scene::{self, BodyId, LightId, LightKind, World};
use crate::solver::{Dirty, GroupLinks, Links, Radiosity};

use super::ahead::{Ahead, Void, most_mean, while_extrapolated};
use super::budget;
use super::coarse::{self, Coarse};
use super::groups;
use super::promise::Promise;
use super::replant::links_on;
use super::report::FrameReport;
use super::surfaces::{LitForest, apply_edits, links_of};
use super::{Clock, FOLLOWED_SHARE, Next, RESIDUAL_SHARE, Session, SessionError, Solved, tally};

impl Session {
    /// The state in a world, from the last one if there is one.
    pub(super) fn advance(
        &self,
        last: Option<Solved>,
        next: &Next,
        mut report: FrameReport,
    ) -> Result<Solved, SessionError> {
        let mut clock = Clock::start();
        let cold = last.is_none();
        let mut solved = last.unwrap_or_else(|| self.blank(next));
        let now = &next.world;
        let view = WorldView::new(&self.bed.scene, &solved.forest, now);
        let old = std::mem::replace(&mut solved.view, view);
        let before = std::mem::replace(&mut solved.world, now.clone());
        let from_s = std::mem::replace(&mut solved.time_s, next.time_s);
        let held = std::mem::replace(&mut solved.held, self.held.clone());
        let relit = cold || now.any_relit(&before);
        let touched = std::mem::take(&mut solved.touched);
        let mut since =
            (!cold).then(|| Since::new(&self.bed.scene, &solved.forest, &old, &solved.view));
        report.seconds.moving = clock.lap();
        let ahead = match cold {
            true => Ahead::default(),
            false => Ahead::new(
                self.options.update,
                &Promise { scene: &self.bed.scene, held: &self.held },
                (&mut solved.ticks, &mut solved.tree),
                [from_s, next.time_s],
                Void {
                    rounding: old.far_m() != solved.view.far_m(),
                    promise: !held.promises_as(&self.held),
                },
            ),
        };
        report.seconds.predict = clock.lap();

        let mut changes = Changes::default();
        let bring = |solved: &mut Solved, since: Option<&Since<'_>>, level, fresh: &[PairId]| {
            let record = Record { edits: !cold, events: !cold && self.options.events };
            let found = self.update(solved, (since, &ahead), level, (record, fresh));
            found.map_err(|OutOfMemory| self.stopped(solved, next.frame))
        };
        if !self.bed.coarse_ids.is_empty() {
            changes = bring(&mut solved, since.as_ref(), Level::Coarse, &[])?;
            self.follow_coarse(
                &mut solved,
                &changes,
                (since.as_mut(), relit || !touched.is_empty()),
            );
        }
        let fine = bring(&mut solved, since.as_ref(), Level::Fine, &changes.refined)?;
        changes.work.add_after_coarse(fine.work);
        changes.edits.extend(fine.edits);
        changes.apart.extend(fine.apart);
        changes.events.extend(fine.events);
        changes.edits.extend(links_on(&solved, &touched).into_iter().map(Edit::Set));
        solved.events = std::mem::take(&mut changes.events);
        let work = changes.work;
        report.seconds.evaluate = clock.lap();

        let mut dirty = self.edit_links(&mut solved, &changes, cold, &mut report);
        let before_groups = match cold || old.far_m() != solved.view.far_m() {
            true => groups::Before::default(),
            false => {
                let links =
                    (std::mem::take(&mut solved.groups), std::mem::take(&mut changes.apart));
                groups::Before::new((&self.bed.scene, &solved.forest), (&old, &solved.view), links)
            }
        };
        let places = (&solved.forest, &solved.view);
        solved.groups = groups::group_links(places, &solved.tree, &before_groups);
        if let Dirty::Some { parents, .. } = &mut dirty {
            let facets = solved.forest.near_facets();
            parents.extend(self.came_or_went(&solved, &old, facets));
            if relit {
                parents.extend(self.relit_facets(&solved, &before, facets));
            }
        }
        let relights = now.lights_differ(&before) || self.outside_differs(&solved, &old, &before);
        if !touched.is_empty() {
            dirty = Dirty::All;
        }
        if relights {
            // Whoever gathers from a light, or from outside, gathers anew: neither knows who that is.
            dirty = Dirty::All;
        }
        report.seconds.judge = clock.lap();

        let lit = LitForest::new(&self.bed.scene, &solved.forest, now)
            .with_groups(&solved.groups)
            .present_in(&solved.view);
        if relights {
            coarse::set_sources(now, (&solved.forest, &lit), &mut solved.radiosity);
        }
        let lit = if let Dirty::All = dirty { lit.with_places() } else { lit };
        let share = if cold { RESIDUAL_SHARE } else { FOLLOWED_SHARE };
        let residual = self.options.tolerance * share;
        let shines = |&light: &LightId| {
            now.light_pose(light).is_some() && now.intensity(light).iter().any(|&i| i > 0.0)
        };
        let lamps =
            (0..self.bed.scene.lights.len() as u32).map(LightId).any(|light| shines(&light));
        if lit.is_dark() && !lamps {
            // What is left of earlier light would fade for ever.
            solved.radiosity = coarse::start(now, &solved.forest, &lit);
        } else if solved.is_settled() {
            let bound = (residual, most_mean(self.most_mean_w_m2(now)));
            solved.radiosity.solve_bounded(&lit, &solved.links, dirty, bound);
            if !solved.radiosity.has_settled() {
                return Err(SessionError::Unsettled {
                    frame: next.frame,
                    residual: solved.radiosity.residual,
                    surfaces: tally::suspects(&self.bed.scene, &solved),
                });
            }
        } else {
            let brightened = self.brightened(&solved.sound_world, now);
            // From nothing on, no growth is too much.
            let mean = solved.sound_mean_w_m2 * brightened;
            let mean = if mean > 0.0 { mean } else { f64::INFINITY };
            let stop = while_extrapolated(residual, mean, self.most_mean_w_m2(now));
            solved.radiosity.solve(&lit, &solved.links, dirty, stop);
        }
        report.seconds.solve = clock.lap();
        if solved.is_settled() {
            solved.sound_mean_w_m2 = solved.radiosity.mean_w_m2(&lit);
            solved.sound_world = now.clone();
        }
        solved.compact();

        report.count(&work);
        tally::fill(&mut report, &solved);
        if self.options.balance {
            tally::fill_balance(&mut report, &self.bed.scene, &solved);
            let share = report.energy.map_or(0.0, |energy| energy.unbalanced());
            let most = self.unbalanced_max();
            if solved.is_settled() && (share > most || share.is_nan()) {
                let surfaces = tally::suspects(&self.bed.scene, &solved);
                return Err(SessionError::Unbalanced { frame: next.frame, share, surfaces });
            }
        }
        if cold {
            let from = next.from.as_ref();
            report.dynamic_links = from.map_or(0, |from| self.dynamic_links(&solved, from));
        }
        report.seconds.total = clock.total();
        solved.report = report;
        Ok(solved)
    }

    /// Share of what is emitted that may be unaccounted for in a result: as much as is asked for, or a tenth.
    fn unbalanced_max(&self) -> f64 {
        match self.options.oracle {
            super::Oracle::Error => self.options.tolerance.max(0.1),
            super::Oracle::FormFactor { .. } => 0.5,
        }
    }

    /// A bound on the mean radiosity in a world and at any time of the clip: all that can be emitted, over what is
    /// absorbed at least.
    fn most_mean_w_m2(&self, now: &World) -> f64 {
        let scene = &self.bed.scene;
        let rho = scene.patches.iter().flat_map(|p| now.reflectance(scene, p)).fold(0.0, f64::max);
        let most = |one: [f64; 3], other: [f64; 3]| [0, 1, 2].map(|c| one[c].max(other[c]));
        let emitted_w = self.emitted_w(
            |p| most(scene.most_exitance(p), now.exitance(scene, p)),
            |k| most(scene.lights[k.0 as usize].most_intensity(), now.intensity(k)),
        );
        emitted_w / self.bed.scene.area_m2() / (1.0 - rho)
    }

    /// How many times as much the scene emits in a world as in another, present or not.
    fn brightened(&self, since: &World, now: &World) -> f64 {
        let emitted_w =
            |w: &World| self.emitted_w(|p| w.exitance(&self.bed.scene, p), |k| w.intensity(k));
        if now.any_relit(since) { emitted_w(now) / emitted_w(since) } else { 1.0 }
    }

    /// What all surfaces and lights emit, W, with given exitances and intensities.
    fn emitted_w(
        &self,
        exitance: impl Fn(&scene::Patch) -> [f64; 3],
        intensity: impl Fn(LightId) -> [f64; 3],
    ) -> f64 {
        let scene = &self.bed.scene;
        let mean = |c: [f64; 3]| c.iter().sum::<f64>() / 3.0;
        let area_m2 = scene.area_m2();
        // Of what moves, patches are placed about its origin, which is the scene's middle.
        let middle = scene.bounds(0.0).map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
        let factor = |p: &scene::Patch| {
            p.most_factor(if scene.moves(p.body) { DVec3::ZERO } else { middle })
        };
        let of_patch = |p: &scene::Patch| {
            let exitance = mean(exitance(p));
            exitance * if scene.is_distant(p.body) { factor(p) * area_m2 } else { p.area_m2() }
        };
        let of_light = |k: u32| {
            let spread = match scene.lights[k as usize].kind {
                LightKind::Directional => area_m2,
                LightKind::Point | LightKind::Spot { .. } => 4.0 * std::f64::consts::PI,
            };
            mean(intensity(LightId(k))) * spread
        };
        scene.patches.iter().map(of_patch).chain((0..scene.lights.len() as u32).map(of_light)).sum()
    }

    /// Nothing but the seed and an unjudged root.
    fn blank(&self, next: &Next) -> Solved {
        Solved {
            time_s: next.time_s,
            world: next.world.clone(),
            held: self.held.clone(),
            forest: self.bed.seed.clone(),
            view: WorldView::new(&self.bed.scene, &self.bed.seed, &next.world),
            ticks: Ticks::default(),
            tree: PairTree::new(Forest::ROOT),
            hash: PairHash::default(),
            links: Links::default(),
            groups: GroupLinks::default(),
            coarse: Coarse::default(),
            radiosity: Radiosity::default(),
            sound_mean_w_m2: 0.0,
            sound_world: next.world.clone(),
            events: Vec::new(),
            touched: Vec::new(),
            report: FrameReport::default(),
        }
    }

    fn update(
        &self,
        solved: &mut Solved,
        (since, ahead): (Option<&Since<'_>>, &Ahead),
        level: Level,
        record_and_fresh: (Record, &[PairId]),
    ) -> Result<Changes, OutOfMemory> {
        let within = budget::within(self.options.max_memory_bytes);
        let may_go_on = |tree: &PairTree, elements: usize, scratch: u64| {
            self.watch.see(tree.len() as u64, budget::bytes_of(tree, elements, scratch));
            within(tree, elements, scratch) && !self.watch.is_cancelled()
        };
        let stage = match level {
            Level::Coarse => Stage::Coarse,
            Level::Fine => Stage::Fine(&solved.coarse.brightness),
        };
        let mut placed = Placed {
            forest: &mut solved.forest,
            view: &solved.view,
            stage,
            oracle: self.options.pair_oracle(),
            simd: self.simd,
            since,
            ahead: ahead.foresight.as_ref(),
            lookahead: ahead.lookahead,
        };
        let tree = (&mut solved.tree, &mut solved.hash);
        update(tree, &mut placed, &[Forest::ROOT.0], record_and_fresh, &may_go_on)
    }

    /// Solves over the coarse pairs anew where any changed, or the emission did, and says which elements' brightness did.
    fn follow_coarse(
        &self,
        solved: &mut Solved,
        changes: &Changes,
        (since, relit): (Option<&mut Since<'_>>, bool),
    ) {
        let changed = solved.coarse.follow(&self.bed.seed, changes);
        if !changed && !relit {
            return;
        }
        let before = std::mem::take(&mut solved.coarse.brightness);
        let lit = (&*self.bed.scene, &solved.world);
        solved.coarse.solve(lit, &self.bed.seed, &self.bed.coarse_ids);
        if let Some(since) = since {
            let (shifts, of_lights) = solved.coarse.brightness.shifts(&before);
            since.dim(&self.bed.seed, &self.bed.coarse_ids, (shifts, of_lights));
        }
    }

    /// Carries the changes of the pair tree over to links and elements; what is to be solved anew.
    fn edit_links(
        &self,
        solved: &mut Solved,
        changes: &Changes,
        cold: bool,
        report: &mut FrameReport,
    ) -> Dirty {
        let many = changes.edits.len() as u64 > solved.tree.counts().active / 2;
        let receivers = if cold || many {
            report.elements_reaped = solved.forest.reap();
            solved.links = links_of(&solved.forest, &solved.tree);
            None
        } else {
            let Solved { links, forest, tree, .. } = solved;
            let receivers = apply_edits(links, forest, tree, &changes.edits);
            report.elements_reaped = forest.reap();
            Some(receivers)
        };
        let split = solved.forest.take_changed();
        let lit = LitForest::new(&self.bed.scene, &solved.forest, &solved.world);
        let lit = lit.present_in(&solved.view);
        if cold {
            solved.radiosity = self.first_guess(solved, &lit);
            return Dirty::All;
        }
        solved.radiosity.extend(solved.forest.len());
        let alive = |id: &ElementId| solved.forest.kind(*id) == Kind::Element;
        let split: Vec<u32> = split.iter().filter(|id| alive(id)).map(|id| id.0).collect();
        for &parent in &split {
            solved.radiosity.inherit(&lit, parent);
        }
        match receivers {
            None => Dirty::All,
            Some(receivers) => Dirty::Some {
                receivers: receivers.into_iter().filter(|&id| alive(&ElementId(id))).collect(),
                parents: split,
            },
        }
    }

    /// Those of some facets whose bodies appeared or vanished since `old`: what they emit did too.
    fn came_or_went(&self, solved: &Solved, old: &WorldView, of: &[ElementId]) -> Vec<u32> {
        let forest = &solved.forest;
        let toggled = |facet: &&ElementId| {
            let patch = forest.patch(**facet).expect("a facet has a patch");
            let body = solved.view.patch(patch).body;
            solved.view.is_present(body) != old.is_present(body)
        };
        of.iter().filter(toggled).map(|f| f.0).collect()
    }

    /// Whether what is distant emits otherwise than `before`, or came or went since `old`.
    fn outside_differs(&self, solved: &Solved, old: &WorldView, before: &World) -> bool {
        let distant = solved.forest.distant_facets();
        !self.came_or_went(solved, old, distant).is_empty()
            || !self.relit_facets(solved, before, distant).is_empty()
    }

    /// Those of some facets that emit or reflect otherwise than `before`.
    fn relit_facets(&self, solved: &Solved, before: &World, of: &[ElementId]) -> Vec<u32> {
        let forest = &solved.forest;
        let is_relit = |facet: &&ElementId| {
            let patch = forest.patch(**facet).expect("a facet has a patch");
            let material = self.bed.scene.patches[patch.0 as usize].material;
            solved.world.is_relit(before, material)
        };
        of.iter().filter(is_relit).map(|f| f.0).collect()
    }

    /// The coarse solution, where there is one; else exitances.
    fn first_guess(&self, solved: &Solved, lit: &LitForest<'_>) -> Radiosity {
        let mut out = coarse::start(&solved.world, &solved.forest, lit);
        for id in 0..solved.forest.len() as u32 {
            if let Some(number) = solved.forest.coarse(ElementId(id)) {
                out.set(id, solved.coarse.radiosity(self.bed.coarse_ids[number]));
            }
        }
        out
    }

    fn dynamic_links(&self, solved: &Solved, from: &World) -> u64 {
        let moved = |b: BodyId| from.pose(b) != solved.world.pose(b);
        let light_moved = |k: usize| {
            let before = WorldView::light_in(&self.bed.scene, from, LightId(k as u32));
            before.as_ref() != solved.view.light(k)
        };
        tally::dynamic_links(&self.bed.scene, &solved.forest, &solved.tree, &moved, &light_moved)
    }

    /// Why an update did not go on.
    fn stopped(&self, solved: &Solved, frame: u32) -> SessionError {
        if self.watch.is_cancelled() {
            return SessionError::Cancelled { frame };
        }
        SessionError::OutOfMemory {
            frame,
            tolerance: self.options.tolerance,
            limit_bytes: self.options.max_memory_bytes.unwrap_or(u64::MAX),
            links: solved.tree.len() as u64,
        }
    }
}

#[derive(Clone, Copy)]
enum Level {
    Coarse,
    Fine,
}
