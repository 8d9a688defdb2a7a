//! One step: from the state at one instant to that at another, by edits.
//!
//! Without a state to start from, the same edits build it: a cold build is the update of nothing.

use glam::DVec3;

use crate::element::{ElementId, Forest, Kind, WorldView};
use crate::event::Ticks;
use crate::pair::{
    Changes, OutOfMemory, PairHash, PairId, PairTree, Placed, Record, Since, Stage, update,
};
use crate::scene::{self, BodyId, LightKind};
use crate::solver::{Dirty, GroupLinks, Links, Radiosity};

use super::ahead::{Ahead, most_mean, while_extrapolated};
use super::budget;
use super::coarse::{self, Coarse};
use super::groups::group_links;
use super::report::FrameReport;
use super::surfaces::{LitForest, apply_edits, links_of};
use super::{Clock, FOLLOWED_SHARE, RESIDUAL_SHARE, Session, SessionError, Solved, tally};

impl Session {
    /// Whether nothing at all differs between the last state and this time.
    pub(super) fn is_still(&self, last: &Solved, time_s: f64) -> bool {
        let bodies = (0..self.scene.bodies.len())
            .all(|b| last.view.poses()[b] == self.scene.pose(BodyId(b as u32), time_s));
        bodies
            && !self.scene.is_relit([last.time_s, time_s])
            && self.scene.lights.iter().enumerate().all(|(k, light)| {
                last.view.light(k) == WorldView::light_at(&self.scene, light, time_s).as_ref()
            })
    }

    /// The state at `report.time_s`, from the last one if there is one. `from` is the time that
    /// dynamic links are counted from where there is none.
    pub(super) fn advance(
        &self,
        last: Option<Solved>,
        from: Option<f64>,
        mut report: FrameReport,
    ) -> Result<Solved, SessionError> {
        let mut clock = Clock::start();
        let (time_s, frame) = (report.time_s, report.frame);
        let cold = last.is_none();
        let mut solved = last.unwrap_or_else(|| self.blank(time_s));
        let view = WorldView::new(&self.scene, &solved.forest, time_s);
        let old = std::mem::replace(&mut solved.view, view);
        let from_s = std::mem::replace(&mut solved.time_s, time_s);
        let relit = cold || self.scene.is_relit([from_s, time_s]);
        let mut since =
            (!cold).then(|| Since::new(&self.scene, &solved.forest, &old, &solved.view));
        report.seconds.moving = clock.lap();
        let ahead = match cold {
            true => Ahead::default(),
            false => Ahead::new(
                self.options.update,
                &*self.scene,
                (&mut solved.ticks, &mut solved.tree),
                [from_s, time_s],
                old.far_m() != solved.view.far_m(),
            ),
        };
        report.seconds.predict = clock.lap();

        let mut changes = Changes::default();
        let bring = |solved: &mut Solved, since: Option<&Since<'_>>, level, fresh: &[PairId]| {
            let record = Record { edits: !cold, events: !cold && self.options.events };
            let found = self.update(solved, (since, &ahead), level, (record, fresh));
            found.map_err(|OutOfMemory| self.too_large(solved, frame))
        };
        if !self.coarse_ids.is_empty() {
            changes = bring(&mut solved, since.as_ref(), Level::Coarse, &[])?;
            self.follow_coarse(&mut solved, &changes, (since.as_mut(), relit));
        }
        let fine = bring(&mut solved, since.as_ref(), Level::Fine, &changes.refined)?;
        changes.work.add_after_coarse(fine.work);
        changes.edits.extend(fine.edits);
        changes.events.extend(fine.events);
        solved.events = std::mem::take(&mut changes.events);
        let work = changes.work;
        report.seconds.evaluate = clock.lap();

        let mut dirty = self.edit_links(&mut solved, &changes, cold, &mut report);
        solved.groups = group_links(&solved.forest, &solved.view, &solved.tree);
        if let Dirty::Some { parents, .. } = &mut dirty {
            let facets = solved.forest.near_facets();
            parents.extend(self.came_or_went(&solved, &old, facets));
            if relit {
                parents.extend(self.relit_facets(&solved, from_s, facets));
            }
        }
        let lights = &self.scene.lights;
        let relights = lights.iter().any(|light| light.is_relit([from_s, time_s]))
            || self.outside_differs(&solved, &old, from_s);
        if relights {
            // Whoever gathers from a light, or from outside, gathers anew: neither knows who that is.
            dirty = Dirty::All;
        }
        report.seconds.judge = clock.lap();

        let lit = LitForest::new(&self.scene, &solved.forest, time_s)
            .with_groups(&solved.groups)
            .present_in(&solved.view);
        if relights {
            let at = (&*self.scene, time_s);
            coarse::set_sources(at, (&solved.forest, &lit), &mut solved.radiosity);
        }
        let dirty = if solved.groups.is_empty() { dirty } else { Dirty::All };
        let lit = if let Dirty::All = dirty { lit.with_places() } else { lit };
        let share = if cold { RESIDUAL_SHARE } else { FOLLOWED_SHARE };
        let residual = self.options.tolerance * share;
        let shines = |(k, light): (usize, &scene::Light)| {
            solved.view.light(k).is_some() && light.intensity_at(time_s).iter().any(|&i| i > 0.0)
        };
        let lamps = self.scene.lights.iter().enumerate().any(shines);
        if lit.is_dark() && !lamps {
            // What is left of earlier light would fade for ever.
            let none = (&*self.scene, time_s);
            solved.radiosity = coarse::start(none, &solved.forest, &lit);
        } else if solved.is_settled() {
            let bound = (residual, most_mean(self.most_mean_w_m2()));
            solved.radiosity.solve_bounded(&lit, &solved.links, dirty, bound);
            if !solved.radiosity.has_settled() {
                return Err(SessionError::Unsettled {
                    frame,
                    residual: solved.radiosity.residual,
                    surfaces: tally::suspects(&self.scene, &solved),
                });
            }
        } else {
            let brightened = self.brightened(solved.sound_time_s, time_s);
            // From nothing on, no growth is too much.
            let mean = solved.sound_mean_w_m2 * brightened;
            let mean = if mean > 0.0 { mean } else { f64::INFINITY };
            let stop = while_extrapolated(residual, mean, self.most_mean_w_m2());
            solved.radiosity.solve(&lit, &solved.links, dirty, stop);
        }
        report.seconds.solve = clock.lap();
        if solved.is_settled() {
            solved.sound_mean_w_m2 = solved.radiosity.mean_w_m2(&lit);
            solved.sound_time_s = time_s;
        }
        solved.compact();

        report.count(&work);
        tally::fill(&mut report, &solved);
        if self.options.balance {
            tally::fill_balance(&mut report, &self.scene, &solved);
            let share = report.energy.map_or(0.0, |energy| energy.unbalanced());
            let most = self.unbalanced_max();
            if solved.is_settled() && (share > most || share.is_nan()) {
                let surfaces = tally::suspects(&self.scene, &solved);
                return Err(SessionError::Unbalanced { frame, share, surfaces });
            }
        }
        if cold {
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

    /// A bound on the mean radiosity of the scene at any time: all that can be emitted, over what is
    /// absorbed at least.
    fn most_mean_w_m2(&self) -> f64 {
        let scene = &self.scene;
        let rho = scene.patches.iter().flat_map(|p| scene.reflectance(p)).fold(0.0, f64::max);
        let emitted_w = self.emitted_w(|p| scene.most_exitance(p), scene::Light::most_intensity);
        emitted_w / self.scene.area_m2() / (1.0 - rho)
    }

    /// How many times as much the scene emits now as at another time, present or not.
    fn brightened(&self, since_s: f64, now_s: f64) -> f64 {
        let at = |t: f64| self.emitted_w(|p| self.scene.exitance_at(p, t), |l| l.intensity_at(t));
        if self.scene.is_relit([since_s, now_s]) { at(now_s) / at(since_s) } else { 1.0 }
    }

    /// What all surfaces and lights emit, W, with given exitances and intensities.
    fn emitted_w(
        &self,
        exitance: impl Fn(&scene::Patch) -> [f64; 3],
        intensity: impl Fn(&scene::Light) -> [f64; 3],
    ) -> f64 {
        let scene = &self.scene;
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
        let of_light = |light: &scene::Light| {
            let spread = match light.kind {
                LightKind::Directional => area_m2,
                LightKind::Point | LightKind::Spot { .. } => 4.0 * std::f64::consts::PI,
            };
            mean(intensity(light)) * spread
        };
        scene.patches.iter().map(of_patch).chain(scene.lights.iter().map(of_light)).sum()
    }

    /// Nothing but the seed and an unjudged root.
    fn blank(&self, time_s: f64) -> Solved {
        Solved {
            time_s,
            forest: self.seed.clone(),
            view: WorldView::new(&self.scene, &self.seed, time_s),
            ticks: Ticks::default(),
            tree: PairTree::new(Forest::ROOT),
            hash: PairHash::default(),
            links: Links::default(),
            groups: GroupLinks::default(),
            coarse: Coarse::default(),
            radiosity: Radiosity::default(),
            sound_mean_w_m2: 0.0,
            sound_time_s: time_s,
            events: Vec::new(),
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
            within(tree, elements, scratch)
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
        let changed = solved.coarse.follow(&self.seed, changes);
        if !changed && !relit {
            return;
        }
        let before = std::mem::take(&mut solved.coarse.brightness);
        let lit = (&*self.scene, solved.time_s);
        solved.coarse.solve(lit, &self.seed, &self.coarse_ids);
        if let Some(since) = since {
            let (shifts, of_lights) = solved.coarse.brightness.shifts(&before);
            since.dim(&self.seed, &self.coarse_ids, (shifts, of_lights));
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
        let lit = LitForest::new(&self.scene, &solved.forest, solved.time_s);
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

    /// Whether what is distant emits otherwise than at `from_s`, or came or went since `old`.
    fn outside_differs(&self, solved: &Solved, old: &WorldView, from_s: f64) -> bool {
        let distant = solved.forest.distant_facets();
        !self.came_or_went(solved, old, distant).is_empty()
            || !self.relit_facets(solved, from_s, distant).is_empty()
    }

    /// Those of some facets that emit otherwise than at `from_s`.
    fn relit_facets(&self, solved: &Solved, from_s: f64, of: &[ElementId]) -> Vec<u32> {
        let forest = &solved.forest;
        let times = [from_s, solved.time_s];
        let relit: Vec<bool> = self.scene.materials.iter().map(|m| m.is_relit(times)).collect();
        let is_relit = |facet: &&ElementId| {
            let patch = forest.patch(**facet).expect("a facet has a patch");
            relit[self.scene.patches[patch.0 as usize].material.0 as usize]
        };
        of.iter().filter(is_relit).map(|f| f.0).collect()
    }

    /// The coarse solution, where there is one; else exitances.
    fn first_guess(&self, solved: &Solved, lit: &LitForest<'_>) -> Radiosity {
        let mut out = coarse::start((&self.scene, solved.time_s), &solved.forest, lit);
        for id in 0..solved.forest.len() as u32 {
            if let Some(number) = solved.forest.coarse(ElementId(id)) {
                out.set(id, solved.coarse.radiosity(self.coarse_ids[number]));
            }
        }
        out
    }

    fn dynamic_links(&self, solved: &Solved, from_s: f64) -> u64 {
        let moved = |b: BodyId| self.scene.pose(b, from_s) != solved.view.poses()[b.0 as usize];
        let light_moved = |k: usize| {
            let before = WorldView::light_at(&self.scene, &self.scene.lights[k], from_s);
            before.as_ref() != solved.view.light(k)
        };
        tally::dynamic_links(&self.scene, &solved.forest, &solved.tree, &moved, &light_moved)
    }

    fn too_large(&self, solved: &Solved, frame: u32) -> SessionError {
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
