//! What the phases of a frame ask of space.

use std::sync::Arc;

use crate::element::{ElementId, Forest, Kind, Renumbering, WorldView};
use crate::follow::{
    Balance, Clocked, Follower, FrameReport, Level, Motion, Prediction, Space, Update, Void, Why,
};
use crate::pair::{
    self, Changes, CoarseLink, PairId, PairTree, RefinementCriterion, SpaceJudge, Stage,
    WorldChange,
};
use crate::scene::{BodyId, Held, LightId, World};
use crate::solver::{Dirty, GroupLinks, Radiosity};

use super::bed::Bed;
use super::coarse::{self, Coarse};
use super::importance::Aim;
use super::promise::Promise;
use super::state::{SpaceState, Tuning};
use super::surfaces::LitForest;
use super::tuning::{FOLLOWED_SHARE, RESIDUAL_SHARE, VACANT_ELEMENTS};
use super::{emission, groups, tally};

/// What a frame leads to.
pub(crate) struct Goal<'a> {
    /// The scene, and what a cold build begins with.
    pub(crate) bed: &'a Bed,
    /// Where everything is to be, and how bright.
    pub(crate) world: &'a World,
    /// What of it is held by hand.
    pub(crate) held: &'a Held,
    /// The world that dynamic links of a cold build are counted from.
    pub(crate) from: Option<&'a World>,
    /// What it is solved with.
    pub(crate) tuning: Tuning,
}

/// What was before a frame.
pub(crate) struct Was {
    world: World,
    held: Held,
    view: WorldView,
    /// See [`SpaceState`].
    regrouped: Vec<ElementId>,
}

impl Space for SpaceState {
    type Goal<'g> = Goal<'g>;
    type Was = Was;
    type Change<'m> = WorldChange<'m>;
    type Judge<'j> = SpaceJudge<'j>;
    type Forest = Forest;
    type LitSurfaces<'l> = LitForest<'l>;

    const ROOT: ElementId = Forest::ROOT;

    fn unsolved(goal: &Goal<'_>) -> SpaceState {
        let &Goal { bed, world, held, ref tuning, .. } = goal;
        SpaceState {
            scene: Arc::clone(&bed.scene),
            tuning: tuning.clone(),
            world: world.clone(),
            held: held.clone(),
            forest: bed.seed.clone(),
            view: WorldView::new(&bed.scene, &bed.seed, world),
            groups: GroupLinks::default(),
            coarse: Coarse::default(),
            sound_world: world.clone(),
            touched: Vec::new(),
            covered: Vec::new(),
            regrouped: Vec::new(),
            is_stopped: false,
        }
    }

    fn is_at(&self, goal: &Goal<'_>) -> bool {
        let pending = [&self.touched, &self.covered, &self.regrouped];
        // The brightness of a body that came is found in a frame, though the body may be absent.
        let is_known = self.coarse.brightness.is_known();
        self.world == *goal.world && is_known && pending.iter().all(|list| list.is_empty())
    }

    fn stay(&mut self, goal: &Goal<'_>) -> bool {
        self.scene = Arc::clone(&goal.bed.scene);
        let held = std::mem::replace(&mut self.held, goal.held.clone());
        held.promises_as(goal.held)
    }

    fn stop(&mut self) {
        self.is_stopped = true;
    }

    fn goes_on(&self, goal: &Goal<'_>) -> bool {
        self.held == *goal.held
    }

    fn go(&mut self, goal: &Goal<'_>) -> Was {
        self.scene = Arc::clone(&goal.bed.scene);
        let view = WorldView::new(&self.scene, &self.forest, goal.world);
        let covered = self.forest.cover(&self.scene, goal.world);
        self.covered.extend(covered);
        Was {
            world: std::mem::replace(&mut self.world, goal.world.clone()),
            held: std::mem::replace(&mut self.held, goal.held.clone()),
            view: std::mem::replace(&mut self.view, view),
            regrouped: self.regrouped.clone(),
        }
    }

    fn change<'m>(&self, _: &Goal<'_>, was: &'m Was) -> WorldChange<'m> {
        let change = WorldChange::new(&self.scene, &self.forest, &was.view, &self.view)
            .with_regrouped(&self.forest, &was.regrouped);
        if self.is_stopped { change.after_a_stop() } else { change }
    }

    fn prediction(
        &self,
        goal: &Goal<'_>,
        was: &Was,
        update: Update,
        clocked: Clocked<'_>,
    ) -> Prediction {
        let promise = Promise { scene: &self.scene, held: goal.held };
        let no_longer = Void {
            rounding: self.is_rounded_otherwise(was),
            promise: !was.held.promises_as(goal.held),
        };
        Prediction::new(update, &promise, clocked, no_longer)
    }

    fn candidates(_: &Goal<'_>) -> Vec<u32> {
        vec![Forest::ROOT.0]
    }

    fn judge<'j>(
        &'j mut self,
        goal: &'j Goal<'_>,
        level: Level,
        motion: &Motion<'j, WorldChange<'_>>,
    ) -> SpaceJudge<'j> {
        SpaceJudge {
            forest: &mut self.forest,
            view: &self.view,
            stage: match level {
                Level::Coarse => Stage::Coarse,
                Level::Fine => Stage::Fine(&self.coarse.brightness),
            },
            criterion: goal.tuning.criterion,
            simd: goal.tuning.simd,
            change: motion.change,
            motion_bounds: motion.prediction.motion_bounds.as_ref(),
            lookahead: motion.prediction.lookahead,
        }
    }

    fn has_coarse(goal: &Goal<'_>) -> bool {
        !goal.bed.coarse_ids.is_empty()
    }

    fn forget_coarse_links(&mut self, goal: &Goal<'_>, links: &[CoarseLink]) {
        self.coarse.forget(&goal.bed.seed, links);
    }

    fn weigh(
        &mut self,
        goal: &Goal<'_>,
        was: &Was,
        changes: &Changes,
        change: Option<&mut WorldChange<'_>>,
    ) {
        let Bed { scene, seed, coarse_ids } = goal.bed;
        let changed = self.coarse.follow(seed, changes);
        let relit = change.is_none() || self.world.any_relit(&was.world);
        let is_known = self.coarse.brightness.is_known();
        let is_otherwise = !self.touched.is_empty() || !self.regrouped.is_empty();
        // What sensors see changes with whatever moves.
        let seen_otherwise = matches!(goal.tuning.aim, Aim::Sensors(_)) && self.world != was.world;
        if !changed && !relit && is_known && !is_otherwise && !seen_otherwise {
            return;
        }
        let before = std::mem::take(&mut self.coarse.brightness);
        let at = (&**scene, &self.world, &self.view);
        self.coarse.solve(at, seed, coarse_ids, &goal.tuning.aim);
        if let Some(change) = change {
            let shifts = self.coarse.brightness.shifts(&before);
            change.set_brightness_shifts(seed, coarse_ids, shifts);
        }
    }

    fn remade(&self, _: &Was, tree: &PairTree) -> Vec<PairId> {
        if self.touched.is_empty() && self.covered.is_empty() {
            return Vec::new();
        }
        let mut covered = vec![false; self.forest.len()];
        self.covered.iter().for_each(|id| covered[id.0 as usize] = true);
        let is_touched = |id: ElementId| {
            covered[id.0 as usize] || self.touched.binary_search(&self.forest.fixed(id)).is_ok()
        };
        let ends_there = |&id: &PairId| {
            let (a, b) = tree.ends(id);
            is_touched(a) || is_touched(b)
        };
        tree.link_ids().filter(ends_there).collect()
    }

    fn forest(&self) -> &Forest {
        &self.forest
    }

    fn reap(&mut self) -> u64 {
        self.forest.reap()
    }

    fn take_changed(&mut self) -> Vec<u32> {
        self.forest.take_changed().into_iter().map(|id| id.0).collect()
    }

    /// The coarse solution, where there is one; else exitances.
    fn first_guess(&self, goal: &Goal<'_>, lit: &LitForest<'_>) -> Radiosity {
        let mut out = coarse::start(&self.world, &self.forest, lit);
        for id in 0..self.forest.len() as u32 {
            if let Some(number) = self.forest.coarse(ElementId(id)) {
                out.set(id, self.coarse.radiosity(goal.bed.coarse_ids[number]));
            }
        }
        out
    }

    fn place_groups(
        &mut self,
        _: &Goal<'_>,
        was: &Was,
        tree: &PairTree,
        apart: Option<Vec<(ElementId, ElementId)>>,
    ) {
        let before = match apart.filter(|_| !self.is_rounded_otherwise(was)) {
            None => groups::Before::default(),
            Some(apart) => {
                let links = (std::mem::take(&mut self.groups), apart);
                groups::Before::new((&self.scene, &self.forest), (&was.view, &self.view), links)
            }
        };
        self.groups = groups::group_links((&self.forest, &self.view), tree, &before);
    }

    fn add_dirty(&self, _: &Goal<'_>, was: &Was, dirty: &mut Dirty) -> bool {
        if let Dirty::Some { parents, .. } = dirty {
            let facets = self.forest.near_facets();
            parents.extend(self.came_or_went(was, facets));
            parents.extend(self.relit_facets(was, facets));
            parents.extend(self.covered_leaves());
        }
        let sources_differ = self.world.lights_differ(&was.world) || self.outside_differs(was);
        // Whoever gathers from a light, or from outside, gathers anew: neither knows who that is.
        if sources_differ || !self.touched.is_empty() {
            *dirty = Dirty::All;
        }
        sources_differ
    }

    fn surfaces(&self, _: &Goal<'_>, everywhere: bool) -> LitForest<'_> {
        let lit = LitForest::new(&self.scene, &self.forest, &self.world);
        let lit = lit.with_groups(&self.groups).present_in(&self.view);
        if everywhere { lit.with_places() } else { lit }
    }

    fn set_sources(&self, _: &Goal<'_>, lit: &LitForest<'_>, light: &mut Radiosity) {
        coarse::set_sources(&self.world, (&self.forest, lit), light);
    }

    fn if_dark(&self, _: &Goal<'_>, lit: &LitForest<'_>) -> Option<Radiosity> {
        let now = &self.world;
        let shines = |&light: &LightId| {
            now.light_pose(light).is_some() && now.intensity(light).iter().any(|&i| i > 0.0)
        };
        let lamps = (0..self.scene.lights.len() as u32).map(LightId).any(|light| shines(&light));
        (lit.is_dark() && !lamps).then(|| coarse::start(now, &self.forest, lit))
    }

    fn residual(goal: &Goal<'_>, is_cold: bool) -> f64 {
        goal.tuning.tolerance * if is_cold { RESIDUAL_SHARE } else { FOLLOWED_SHARE }
    }

    fn rows_are_close(goal: &Goal<'_>) -> bool {
        matches!(goal.tuning.criterion, RefinementCriterion::Error { .. })
    }

    fn mean_radiosity_bound_w_m2(goal: &Goal<'_>) -> f64 {
        emission::mean_radiosity_bound_w_m2(&goal.bed.scene, goal.world)
    }

    fn brightened(&self, _: &Goal<'_>) -> f64 {
        emission::brightened(&self.scene, &self.sound_world, &self.world)
    }

    fn finish(&mut self, is_settled: bool) {
        for list in [&mut self.touched, &mut self.covered, &mut self.regrouped] {
            list.clear();
        }
        self.is_stopped = false;
        if is_settled {
            self.sound_world = self.world.clone();
        }
    }

    fn compact(&mut self) -> Option<Renumbering> {
        if self.forest.vacant_len() * VACANT_ELEMENTS <= self.forest.len() {
            return None;
        }
        let to = self.forest.compact();
        self.groups.renumber(&to);
        self.covered = self.covered.iter().filter_map(|&id| to.kept(id)).collect();
        Some(to)
    }

    fn trim(&mut self) {
        self.forest.trim();
    }

    fn count(&self, tree: &PairTree, report: &mut FrameReport) {
        report.link_kinds = groups::kinds(&self.forest, tree);
        let counts = self.forest.counts();
        (report.elements, report.leaves) = (counts.elements, counts.leaves);
    }

    fn balance(state: &Follower<SpaceState>) -> Balance {
        tally::balance(state)
    }

    fn dynamic_links(&self, goal: &Goal<'_>, tree: &PairTree) -> u64 {
        goal.from.map_or(0, |from| self.links_moved_since(from, tree))
    }

    fn check(goal: &Goal<'_>, state: &Follower<SpaceState>) -> Result<(), Why> {
        if !state.is_settled() {
            return Ok(());
        }
        if !state.radiosity.has_settled() {
            let residual = state.radiosity.residual;
            return Err(Why::Unsettled { residual, surfaces: tally::suspects(state) });
        }
        let share = state.report.energy.map_or(0.0, |energy| energy.unbalanced());
        if share > unbalanced_max(&goal.tuning) || share.is_nan() {
            return Err(Why::Unbalanced { share, surfaces: tally::suspects(state) });
        }
        Ok(())
    }

    fn bytes(&self) -> [u64; 3] {
        [self.groups.memory_bytes(), self.forest.memory_bytes(), self.coarse.memory_bytes()]
    }
}

/// Share of what is emitted that may be unaccounted for in a result: as much as is asked for, or a tenth.
fn unbalanced_max(tuning: &Tuning) -> f64 {
    match tuning.criterion {
        RefinementCriterion::Error { .. } => tuning.tolerance.max(0.1),
        RefinementCriterion::FormFactor { .. } => 0.5,
    }
}

impl SpaceState {
    /// Whether what counts as rounding differs.
    fn is_rounded_otherwise(&self, was: &Was) -> bool {
        was.view.far_m() != self.view.far_m()
    }

    /// Those of some facets whose bodies appeared or vanished: what they emit did too.
    fn came_or_went(&self, was: &Was, of: &[ElementId]) -> Vec<u32> {
        let toggled = |facet: &&ElementId| {
            let patch = self.forest.patch(**facet).expect("a facet has a patch");
            let body = self.view.patch(patch).body;
            self.view.is_present(body) != was.view.is_present(body)
        };
        of.iter().filter(toggled).map(|f| f.0).collect()
    }

    /// Those of some facets that emit or reflect otherwise than before.
    fn relit_facets(&self, was: &Was, of: &[ElementId]) -> Vec<u32> {
        if !self.world.any_relit(&was.world) {
            return Vec::new();
        }
        let is_relit = |facet: &&ElementId| {
            let patch = self.forest.patch(**facet).expect("a facet has a patch");
            let material = self.scene.patches[patch.0 as usize].material;
            self.world.is_relit(&was.world, material)
        };
        of.iter().filter(is_relit).map(|f| f.0).collect()
    }

    /// The leaves that bodies in motion cover otherwise than before. What is above them is gathered anew where it has links.
    fn covered_leaves(&self) -> impl Iterator<Item = u32> + '_ {
        // Some may have been reaped since.
        let is_leaf = |id: &ElementId| {
            self.forest.kind(*id) == Kind::Element && self.forest.children(*id).is_empty()
        };
        self.covered.iter().copied().filter(is_leaf).map(|id| id.0)
    }

    /// Whether what is distant emits otherwise than before, or came or went.
    fn outside_differs(&self, was: &Was) -> bool {
        let distant = self.forest.distant_facets();
        !self.came_or_went(was, distant).is_empty() || !self.relit_facets(was, distant).is_empty()
    }

    /// Links between bodies (or lights) of which at least one is elsewhere than in another world.
    fn links_moved_since(&self, from: &World, tree: &PairTree) -> u64 {
        let (scene, forest) = (&*self.scene, &self.forest);
        let body = |id| match forest.patch(id) {
            Some(patch) => Some(scene.patches[patch.0 as usize].body),
            None => forest.cluster_body(id),
        };
        let has_moved = |b: BodyId| from.pose(b) != self.world.pose(b);
        let light_has_moved = |k: usize| {
            let before = WorldView::light_in(scene, from, LightId(k as u32));
            before.as_ref() != self.view.light(k)
        };
        let moves = |id| match forest.light(id) {
            Some(light) => light_has_moved(light),
            None => body(id).is_some_and(has_moved),
        };
        let is_dynamic = |l: &pair::Link| body(l.a) != body(l.b) && (moves(l.a) || moves(l.b));
        tree.links().filter(is_dynamic).count() as u64
    }
}
