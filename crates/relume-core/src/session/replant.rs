//! Carrying a solved state over to an edited scene: inserted, removed and displaced bodies.
//!
//! The state is first carried over to the new scene, in which the bodies that came are absent and those that left still are
//! there, as bodies that are about to vanish; the step that follows is one like any other; then what has left is forgotten.
//! Must not know what a step does.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::element::{ElementId, Forest, Seeds, WorldView, old_coarse_numbers};
use crate::geometry::Pose;
use crate::scene::{BodyId, Glowing, Held, Scene};
use crate::space::{Bed, Before, Solved, SpaceState, group_links, replanted_links};

use super::{Session, Update};

/// Bodies inserted and removed since a scene was solved.
#[derive(Clone, Debug, Default)]
pub(super) struct Edited {
    /// Bodies of that scene that left it.
    pub(super) gone: BTreeSet<BodyId>,
    /// Bodies that came.
    pub(super) fresh: BTreeSet<BodyId>,
}

/// Edit of a scene.
#[derive(Clone, Copy)]
pub(super) enum Edit {
    /// A body comes in.
    In(BodyId),
    /// A body leaves.
    Out(BodyId),
}

/// Start of a step.
pub(super) struct Start {
    /// The state to start from, in the session's scene.
    pub(super) last: Option<Solved>,
    /// The scene to go on with after the step, where bodies are to be forgotten then.
    pub(super) remains: Option<Arc<Scene>>,
}

impl Session {
    /// Goes on with an edited scene.
    pub(super) fn change_scene(&mut self, scene: Scene, edit: Edit) {
        let old = std::mem::replace(&mut self.bed.scene, Arc::new(scene));
        let (Edit::In(body) | Edit::Out(body)) = edit;
        if !old.is_inserted(body) && !self.bed.scene.is_inserted(body) {
            // One that the scene was made with stays in it, absent; that it comes or goes was not foreseen.
            if let Some(solved) = &mut self.solved {
                solved.break_promise();
            }
            return;
        }
        self.is_planted = false;
        if self.solved.is_none() {
            return;
        }
        let edited = self.edited.get_or_insert_default();
        match edit {
            Edit::In(body) => drop(edited.fresh.insert(body)),
            Edit::Out(body) if edited.fresh.remove(&body) => {}
            Edit::Out(body) => drop(edited.gone.insert(body)),
        }
    }

    /// Tells the seed what hands have changed of it: which bodies came and left, which patches emit at any time, and which
    /// bodies at rest are where the scene has them, covering what they stand on. The last solution is taken from the session,
    /// and carried over where it can be.
    pub(super) fn follow_hands(&mut self) -> Start {
        let displaced = self.displaced_now();
        if self.is_planted && displaced == self.displaced {
            let glowing = glowing(&self.bed.scene, &self.held);
            let last = self.solved.take();
            let is_other = self.bed.seed.set_glowing(glowing);
            return Start { last: last.filter(|_| !is_other), remains: None };
        }
        let scene = Arc::clone(&self.bed.scene);
        let from = self.take_last(&scene);
        let onto = from.as_ref().map_or_else(|| Arc::clone(&scene), |from| Arc::clone(&from.onto));
        let bed = self.plant(Arc::clone(&onto), &displaced, &self.held);
        if let Some(Moved { was, .. }) = &from
            && Arc::ptr_eq(was, &bed.scene)
            && bed.seed.is_as_displaced(&self.bed.seed)
        {
            self.displaced = displaced;
            return Start { last: from.map(|from| from.last), remains: None };
        }
        let last = from.and_then(|from| {
            let Moved { last, was, body, .. } = from;
            let old = Bed { scene: was, ..self.bed.clone() };
            replanted(last, &old, &bed, &body)
        });
        let remains = (!Arc::ptr_eq(&onto, &scene)).then(|| Arc::clone(&scene));
        self.bed = match (&last, &remains) {
            (None, Some(scene)) => self.plant(Arc::clone(scene), &displaced, &self.held),
            _ => bed,
        };
        (self.is_planted, self.displaced) = (true, displaced);
        let remains = remains.filter(|_| last.is_some());
        Start { last, remains }
    }

    /// A scene with what builds start from, as hands have changed it.
    pub(super) fn plant(
        &self,
        scene: Arc<Scene>,
        displaced: &BTreeSet<BodyId>,
        held: &Held,
    ) -> Bed {
        let mut bed = Bed::new(scene, displaced, self.options.bedding());
        bed.seed.set_glowing(glowing(&bed.scene, held));
        bed
    }

    /// The last state, if it can be carried over to the present scene.
    fn take_last(&mut self, scene: &Arc<Scene>) -> Option<Moved> {
        let (last, edited) = (self.solved.take(), self.edited.take());
        let starts_anew = std::mem::take(&mut self.starts_anew);
        if starts_anew || self.options.update == Update::Scratch {
            return None;
        }
        let last = last.filter(Solved::is_settled)?;
        let Some(Edited { gone, fresh }) = edited else {
            let (was, onto) = (Arc::clone(scene), Arc::clone(scene));
            return Some(Moved { last, was, onto, body: Box::new(Some) });
        };
        let was = Arc::clone(&last.space.scene);
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
        let bed = self.plant(scene, &self.displaced, &self.held);
        let count = bed.scene.bodies.len();
        let body = |body: BodyId| ((body.0 as usize) < count).then_some(body);
        let mut last = replanted(last, &self.bed, &bed, &body).expect("the same but for bodies");
        debug_assert!(last.space.touched.is_empty(), "what has left covers nothing");
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
}

/// Nodes of the fixed part on which links of groups are found anew: what is covered otherwise, groups that hold some of it,
/// and what is grouped otherwise.
fn ends_anew(space: &SpaceState) -> BTreeSet<ElementId> {
    let mut out: BTreeSet<ElementId> = space.regrouped.iter().copied().collect();
    for &facet in &space.touched {
        let above = |&id: &ElementId| space.forest.parent(id);
        out.extend(std::iter::successors(Some(facet), above));
    }
    out
}

/// Which patches of a scene emit light at any time, with this in hand.
fn glowing(scene: &Scene, held: &Held) -> Glowing {
    scene.glowing(&|patch| {
        let Some(exitance) = held.exitances.get(&patch.material) else { return [0.0; 3] };
        let share = scene.emission_share(patch);
        [0, 1, 2].map(|c| exitance[c] * share[c])
    })
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
    old: &Bed,
    new: &Bed,
    body: &dyn Fn(BodyId) -> Option<BodyId>,
) -> Option<Solved> {
    let seeds = Seeds { old: &old.seed, new: &new.seed };
    let uncovered = last.space.forest.uncover();
    let to = last.space.forest.renumbering_to(seeds, body)?;
    let (forest, touched) = last.space.forest.replanted(seeds, &to);
    last.space.scene = Arc::clone(&new.scene);
    last.space.forest = forest;
    last.space.touched = touched;
    last.space.regrouped = seeds.regrouped(&to);
    last.links.renumber(&to);
    last.radiosity.renumber(&to);
    last.tree.renumber(&to);
    last.tree.regroup(last.space.forest.children(Forest::ROOT));
    // What stands in the way of whom was not foreseen.
    last.tree.forget_certificates();
    let numbers = old_coarse_numbers(seeds, &to, new.coarse_ids.len());
    let lens = [old, new].map(|bed| bed.seed.kept_len());
    let Solved { space, .. } = &mut last;
    space.coarse.renumber(&new.seed, &to.below(lens), &numbers, &space.regrouped);
    let mut from = vec![None; new.scene.bodies.len()];
    for was in (0..old.scene.bodies.len() as u32).map(BodyId) {
        if let Some(is) = body(was) {
            from[is.0 as usize] = Some(was);
        }
    }
    let space = &mut last.space;
    for world in [&mut space.world, &mut space.sound_world] {
        *world = world.of_bodies(&from);
    }
    let uncovered = std::mem::take(&mut space.covered).into_iter().chain(uncovered);
    let kept = uncovered.filter_map(|id| to.kept(id));
    space.covered = kept.chain(space.forest.cover(&new.scene, &space.world)).collect();
    let view = WorldView::new(&new.scene, &space.forest, &space.world);
    let was = std::mem::replace(&mut space.view, view);
    let links = std::mem::take(&mut space.groups);
    let is_rounded_as_before = was.far_m() == space.view.far_m();
    let anew = ends_anew(space);
    space.groups = match space.touched.is_empty() && space.regrouped.is_empty() {
        true if !is_rounded_as_before => {
            let places = (&space.forest, &space.view);
            group_links(places, &last.tree, &Before::default())
        }
        // The step that follows finds those anew that end on what is covered otherwise, or grouped otherwise.
        _ => replanted_links(links, &to, &space.forest, &|id| {
            is_rounded_as_before && !anew.contains(&space.forest.fixed(id))
        }),
    };
    let mut report = std::mem::take(&mut last.report);
    last.count(&mut report);
    last.report = report;
    Some(last)
}
