//! Bodies come into the scene of a running session, leave it, or are taken from where they rest.
//!
//! The state is first carried over to the new scene, in which the bodies that came are absent and those that left still are
//! there, as bodies that are about to vanish; the step that follows is one like any other; then what has left is forgotten.
//! Must not know what a step does.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::element::{ElementId, Forest, WorldView, old_coarse_numbers};
use crate::geometry::Pose;
use crate::pair::PairId;
use crate::scene::{BodyId, Held, Patch, Scene};

use super::groups::{Before, group_links};
use super::{Session, Solved, Update, seed_of, tally};

/// A solved state whose scene has been edited since.
pub(super) struct Left {
    /// The scene as it was.
    scene: Arc<Scene>,
    solved: Solved,
    /// Bodies of that scene that left it.
    gone: BTreeSet<BodyId>,
    /// Bodies that came.
    fresh: BTreeSet<BodyId>,
}

/// What edits a scene.
#[derive(Clone, Copy)]
pub(super) enum Edit {
    /// A body comes in.
    In(BodyId),
    /// A body leaves.
    Out(BodyId),
}

/// A scene, and what starts from it.
#[derive(Clone)]
pub(super) struct Bed {
    pub(super) scene: Arc<Scene>,
    /// The part of the forest that is always there, where every build starts.
    pub(super) seed: Forest,
    /// Coarse elements of the seed by number; none for oracles that ask for no brightness.
    pub(super) coarse_ids: Vec<u32>,
}

impl Session {
    /// Goes on with an edited scene.
    pub(super) fn change_scene(&mut self, scene: Scene, edit: Edit) {
        let old = std::mem::replace(&mut self.bed.scene, Arc::new(scene));
        let (Edit::In(body) | Edit::Out(body)) = edit;
        if !old.is_inserted(body) && !self.bed.scene.is_inserted(body) {
            // One that the scene was made with stays in it, absent; that it comes or goes was not foreseen.
            self.solved = self.solved.take().filter(Solved::is_settled);
            if let Some(solved) = &mut self.solved {
                solved.tree.forget_certificates();
            }
            return;
        }
        self.is_planted = false;
        if let Some(solved) = self.solved.take() {
            let (gone, fresh) = (BTreeSet::new(), BTreeSet::new());
            self.left = Some(Left { scene: old, solved, gone, fresh });
        }
        if let Some(left) = &mut self.left {
            match edit {
                Edit::In(body) => drop(left.fresh.insert(body)),
                Edit::Out(body) if left.fresh.remove(&body) => {}
                Edit::Out(body) => drop(left.gone.insert(body)),
            }
        }
    }

    /// Tells the seed what hands have changed of it: which bodies came and left, which patches emit at any time, and which
    /// bodies at rest are where the scene has them, covering what they stand on. The state is carried over where it can be;
    /// else nothing that was solved stays. Returns the scene to go on with after the next step, where bodies are to be
    /// forgotten then.
    pub(super) fn follow_hands(&mut self) -> Option<Arc<Scene>> {
        let displaced = self.displaced_now();
        let glows = |session: &Session, scene: &Scene| {
            let emits = |p: &Patch| scene.patch_emits(p) || session.emits_by_hand(scene, p);
            scene.patches.iter().map(emits).collect::<Vec<bool>>()
        };
        if self.is_planted && displaced == self.displaced {
            let glows = glows(self, &self.bed.scene);
            if self.bed.seed.set_glows(glows) {
                self.solved = None;
            }
            return None;
        }
        let scene = Arc::clone(&self.bed.scene);
        let from = self.take_last(&scene);
        let onto = from.as_ref().map_or_else(|| Arc::clone(&scene), |from| Arc::clone(&from.onto));
        let plant = |session: &Session, scene: &Arc<Scene>| {
            let (mut seed, coarse_ids) = seed_of(scene, &session.options, &displaced);
            seed.set_glows(glows(session, scene));
            Bed { scene: Arc::clone(scene), seed, coarse_ids }
        };
        let bed = plant(self, &onto);
        if let Some(Moved { was, .. }) = &from
            && Arc::ptr_eq(was, &bed.scene)
            && bed.seed.is_as_displaced(&self.bed.seed)
        {
            (self.solved, self.displaced) = (from.map(|from| from.last), displaced);
            return None;
        }
        let carried = from.and_then(|from| {
            let Moved { last, was, body, .. } = from;
            let old = Bed { scene: was, ..self.bed.clone() };
            replanted(last, (&old, &bed), &body)
        });
        let is_cold = carried.is_none();
        self.solved = carried;
        let remains = !Arc::ptr_eq(&onto, &scene);
        self.bed = if is_cold && remains { plant(self, &scene) } else { bed };
        (self.is_planted, self.displaced) = (true, displaced);
        (remains && !is_cold).then_some(scene)
    }

    /// The last state, if it can be carried over to the present scene.
    fn take_last(&mut self, scene: &Arc<Scene>) -> Option<Moved> {
        let left = self.left.take();
        if self.options.update == Update::Scratch {
            return None;
        }
        let Some(left) = left else {
            let last = self.solved.take().filter(Solved::is_settled)?;
            let (was, onto) = (Arc::clone(scene), Arc::clone(scene));
            return Some(Moved { last, was, onto, body: Box::new(Some) });
        };
        let Left { scene: was, solved: last, gone, fresh } = left;
        if !last.is_settled() {
            return None;
        }
        let list: Vec<BodyId> = gone.into_iter().collect();
        let (onto, ids) = match list.is_empty() {
            true => (Arc::clone(scene), Vec::new()),
            false => {
                let (onto, ids) = scene.with_remains(&was, &list);
                (Arc::new(onto), ids)
            }
        };
        let body = move |body: BodyId| match list.iter().position(|&gone| gone == body) {
            Some(k) => Some(ids[k]),
            None => (!fresh.contains(&body)).then_some(body),
        };
        Some(Moved { last, was, onto, body: Box::new(body) })
    }

    /// Forgets the bodies that have left, which are absent by now.
    pub(super) fn forget_remains(&mut self, last: Solved, scene: Arc<Scene>) -> Solved {
        let (mut seed, coarse_ids) = seed_of(&scene, &self.options, &self.displaced);
        let emits = |p: &Patch| scene.patch_emits(p) || self.emits_by_hand(&scene, p);
        seed.set_glows(scene.patches.iter().map(emits).collect());
        let bed = Bed { scene, seed, coarse_ids };
        let count = bed.scene.bodies.len();
        let body = |body: BodyId| ((body.0 as usize) < count).then_some(body);
        let mut last = replanted(last, (&self.bed, &bed), &body).expect("the same but for bodies");
        debug_assert!(last.touched.is_empty(), "what has left covers nothing");
        last.compact();
        self.bed = bed;
        last
    }

    /// Bodies that no clip moves, and that a hand has moved, hidden or removed.
    fn displaced_now(&self) -> BTreeSet<BodyId> {
        let Held { poses, presence, .. } = &self.held;
        let moved = poses.iter().filter(|(_, pose)| **pose != Pose::IDENTITY);
        let hidden = presence.iter().filter(|(_, there)| !**there);
        let bodies = moved.map(|(&body, _)| body).chain(hidden.map(|(&body, _)| body));
        let scene = &self.bed.scene;
        let rests = |body: &BodyId| !scene.moves(*body) && !scene.is_inserted(*body);
        bodies.chain(scene.removed_bodies()).filter(rests).collect()
    }

    /// Whether a hand makes a patch emit.
    fn emits_by_hand(&self, scene: &Scene, patch: &Patch) -> bool {
        let Some(exitance) = self.held.exitances.get(&patch.material) else { return false };
        let share = scene.emission_share(patch);
        (0..3).any(|c| exitance[c] * share[c] > 0.0)
    }
}

/// A state on its way from one scene to another.
struct Moved {
    last: Solved,
    was: Arc<Scene>,
    onto: Arc<Scene>,
    /// Which body of the other scene one is.
    body: Box<dyn Fn(BodyId) -> Option<BodyId>>,
}

/// A state in the scene of another bed: what is new there is absent. `None` if what they have in common is not alike.
fn replanted(
    mut last: Solved,
    (old, new): (&Bed, &Bed),
    body: &dyn Fn(BodyId) -> Option<BodyId>,
) -> Option<Solved> {
    let seeds = (&old.seed, &new.seed);
    let to = last.forest.renumbering_to(seeds, body)?;
    let (forest, touched) = last.forest.replanted(seeds, &to);
    last.forest = forest;
    last.touched = touched;
    last.links.renumber(&to);
    last.radiosity.renumber(&to);
    last.tree.renumber(&to);
    last.tree.regroup(last.forest.children(Forest::ROOT));
    // What stands in the way of whom was not foreseen.
    last.tree.forget_certificates();
    let numbers = old_coarse_numbers(seeds, &to, new.coarse_ids.len());
    let lens = [old, new].map(|bed| bed.seed.kept_len());
    last.coarse.renumber(&to.below(lens), &numbers);
    let mut from = vec![None; new.scene.bodies.len()];
    for was in (0..old.scene.bodies.len() as u32).map(BodyId) {
        if let Some(is) = body(was) {
            from[is.0 as usize] = Some(was);
        }
    }
    for world in [&mut last.world, &mut last.sound_world] {
        *world = world.of_bodies(&from);
    }
    last.view = WorldView::new(&new.scene, &last.forest, &last.world);
    last.groups = group_links((&last.forest, &last.view), &last.tree, &Before::default());
    let mut report = std::mem::take(&mut last.report);
    tally::fill(&mut report, &last);
    last.report = report;
    Some(last)
}

/// Links with an end on some facets, to be made anew.
pub(super) fn links_on(solved: &Solved, facets: &[ElementId]) -> Vec<PairId> {
    let is_on = |id| facets.binary_search(&solved.forest.fixed(id)).is_ok();
    let touches = |&id: &PairId| {
        let (a, b) = solved.tree.ends(id);
        is_on(a) || is_on(b)
    };
    solved.tree.link_ids().filter(touches).collect()
}
