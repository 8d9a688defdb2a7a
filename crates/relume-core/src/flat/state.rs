//! The part of a solved state that is of the plane, and what the phases of a frame ask of it.

use std::sync::Arc;

use crate::element::ElementId;
use crate::follow::{
    Balance, Clocked, Follower, FrameReport, Level, Motion, Prediction, Space, Update, Void,
    balance_of,
};
use crate::pair::{Link, PairTree};
use crate::solver::Radiosity;

use super::forest::FlatForest;
use super::judge::PlaneJudge;
use super::options::FlatOptions;
use super::scene::{BodyIndex, FlatScene};
use super::surfaces::LitPlane;
use super::view::PlaneView;

/// A solved state of a scene in the plane.
pub type FlatSolved = Follower<PlaneState>;

/// What a frame leads to.
pub(crate) struct FlatGoal<'a> {
    pub(super) scene: &'a Arc<FlatScene>,
    /// The elements that a cold build begins with.
    pub(super) seed: &'a FlatForest,
    /// Where everything is to be.
    pub(super) view: &'a PlaneView,
    /// Where it was, to count dynamic links of a cold build from.
    pub(super) from: Option<&'a PlaneView>,
    pub(super) options: &'a FlatOptions,
}

/// The part of a solved state that is of the plane.
pub struct PlaneState {
    pub(super) scene: Arc<FlatScene>,
    pub(super) forest: FlatForest,
    pub(super) view: PlaneView,
}

impl Space for PlaneState {
    type Goal<'g> = FlatGoal<'g>;
    type Was = PlaneView;
    type Change<'m> = &'m PlaneView;
    type Judge<'j> = PlaneJudge<'j>;
    type Forest = FlatForest;
    type LitSurfaces<'l> = LitPlane<'l>;

    const ROOT: ElementId = FlatForest::ROOT;

    fn unsolved(goal: &FlatGoal<'_>) -> PlaneState {
        let &FlatGoal { scene, seed, view, .. } = goal;
        PlaneState { scene: Arc::clone(scene), forest: seed.clone(), view: view.clone() }
    }

    fn is_at(&self, goal: &FlatGoal<'_>) -> bool {
        self.view == *goal.view
    }

    fn stay(&mut self, _: &FlatGoal<'_>) -> bool {
        true
    }

    fn goes_on(&self, _: &FlatGoal<'_>) -> bool {
        true
    }

    fn go(&mut self, goal: &FlatGoal<'_>) -> PlaneView {
        std::mem::replace(&mut self.view, goal.view.clone())
    }

    fn change<'m>(&self, _: &FlatGoal<'_>, was: &'m PlaneView) -> &'m PlaneView {
        was
    }

    fn prediction(
        &self,
        _: &FlatGoal<'_>,
        _: &PlaneView,
        update: Update,
        clocked: Clocked<'_>,
    ) -> Prediction {
        Prediction::new(update, &*self.scene, clocked, Void::default())
    }

    fn candidates(goal: &FlatGoal<'_>) -> Vec<u32> {
        (0..goal.scene.walls().len() as u32).collect()
    }

    fn judge<'j>(
        &'j mut self,
        goal: &'j FlatGoal<'_>,
        _: Level,
        motion: &Motion<'j, &PlaneView>,
    ) -> PlaneJudge<'j> {
        PlaneJudge {
            scene: goal.scene,
            forest: &mut self.forest,
            now: &self.view,
            before: motion.change.copied(),
            epsilon: goal.options.epsilon,
            min_length_m: goal.options.min_length_m,
            constant: goal.options.constant,
            motion_bounds: motion.prediction.motion_bounds.as_ref(),
            lookahead: motion.prediction.lookahead,
        }
    }

    fn forest(&self) -> &FlatForest {
        &self.forest
    }

    fn reap(&mut self) -> u64 {
        self.forest.reap()
    }

    fn take_changed(&mut self) -> Vec<u32> {
        self.forest.take_changed()
    }

    fn first_guess(&self, _: &FlatGoal<'_>, lit: &LitPlane<'_>) -> Radiosity {
        Radiosity::new(lit)
    }

    fn surfaces(&self, _: &FlatGoal<'_>, _: bool) -> LitPlane<'_> {
        LitPlane::new(&self.scene, &self.forest)
    }

    fn if_dark(&self, _: &FlatGoal<'_>, lit: &LitPlane<'_>) -> Option<Radiosity> {
        lit.is_dark().then(|| Radiosity::new(lit))
    }

    fn residual(goal: &FlatGoal<'_>, _: bool) -> f64 {
        goal.options.residual
    }

    fn mean_radiosity_bound_w_m2(goal: &FlatGoal<'_>) -> f64 {
        let (mut emitted, mut length_m, mut rho) = (0.0, 0.0, 0.0_f64);
        for wall in goal.scene.walls() {
            let long = wall.local.length();
            emitted += long * wall.material.exitance.iter().sum::<f64>() / 3.0;
            length_m += long;
            rho = wall.material.reflectance.into_iter().fold(rho, f64::max);
        }
        emitted / length_m / (1.0 - rho)
    }

    fn count(&self, _: &PairTree, report: &mut FrameReport) {
        report.elements = self.forest.element_count();
        report.leaves = self.forest.leaf_count();
    }

    fn balance(state: &FlatSolved) -> Balance {
        let PlaneState { scene, forest, .. } = &state.space;
        let facets = forest.facets().iter().copied();
        let (lit, Follower { links, radiosity, .. }) = (LitPlane::new(scene, forest), state);
        let (rows, energy) = balance_of(&lit, links, radiosity, facets, &|_| true);
        Balance { rows, energy, suspects: Vec::new() }
    }

    fn dynamic_links(&self, goal: &FlatGoal<'_>, tree: &PairTree) -> u64 {
        let Some(from) = goal.from else { return 0 };
        let has_moved =
            |body: BodyIndex| from.poses()[body.0 as usize] != self.view.poses()[body.0 as usize];
        let is_dynamic = |link: &Link| {
            let bodies = [link.a, link.b].map(|id| self.forest.body(id).expect("has a body"));
            bodies[0] != bodies[1] && bodies.into_iter().any(has_moved)
        };
        tree.links().filter(is_dynamic).count() as u64
    }

    fn bytes(&self) -> [u64; 3] {
        [0, self.forest.memory_bytes(), 0]
    }
}
