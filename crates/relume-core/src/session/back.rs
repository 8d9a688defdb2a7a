//! The way back to the last solution, where a step comes to nothing.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::follow::{Failed, Follower, Said};
use crate::scene::{BodyId, Held, Scene, World};
use crate::space::{Solved, SpaceState};

use super::replant::Edited;
use super::{FrameReport, Session};

/// State needed to compute an earlier solution again.
pub(super) struct Back {
    scene: Arc<Scene>,
    world: World,
    held: Held,
    /// See [`Session`].
    displaced: BTreeSet<BodyId>,
    /// See [`Session`].
    edited: Option<Edited>,
    said: Said,
}

impl Session {
    /// The way back to the last solution.
    pub(super) fn way_back(&self, solved: &Solved) -> Back {
        let SpaceState { scene, world, held, .. } = &solved.space;
        Back {
            scene: Arc::clone(scene),
            world: world.clone(),
            held: held.clone(),
            displaced: self.displaced.clone(),
            edited: self.edited.clone(),
            said: solved.said(),
        }
    }

    /// The last solution, found anew: from what the failed step left, where that began with it, in `last_world`; else from
    /// nothing. `remains` is the scene without the bodies that have left, where the failed step was on the way there.
    pub(super) fn go_back(
        &mut self,
        failed: Failed<SpaceState>,
        back: Back,
        last_world: Option<World>,
        remains: Option<Arc<Scene>>,
    ) -> Option<Solved> {
        let (state, world) = match (failed.into_way_back(), last_world) {
            (Some(state), Some(world)) => (Some(state), world),
            _ => {
                let scene = Arc::clone(&back.scene);
                let bed = self.plant(scene, &back.displaced, &back.held);
                let scene = remains.clone().unwrap_or_else(|| Arc::clone(&self.bed.scene));
                (self.bed, self.is_planted, self.starts_anew) = (bed, false, true);
                (self.edited, self.displaced) = (back.edited, back.displaced);
                let goal = self.goal(&back.world, &back.held, None);
                let found = Follower::found_again(
                    None,
                    &goal,
                    self.order(FrameReport::default()),
                    back.said,
                );
                self.bed.scene = scene;
                return found;
            }
        };
        let goal = self.goal(&world, &back.held, None);
        let found =
            Follower::found_again(state, &goal, self.order(FrameReport::default()), back.said);
        if let Some(scene) = remains {
            let gone = scene.bodies.len() as u32..self.bed.scene.bodies.len() as u32;
            self.edited = Some(Edited { gone: gone.map(BodyId).collect(), fresh: BTreeSet::new() });
            (self.bed.scene, self.is_planted) = (scene, false);
        }
        found
    }
}
