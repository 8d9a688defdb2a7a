//! A scene with what every build of it starts from.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::element::Forest;
use crate::scene::{BodyId, Scene};

use super::coarse;

/// What builds start with.
#[derive(Clone, Copy)]
pub(crate) struct Bedding {
    /// Whether with groups of patches.
    pub(crate) groups: bool,
    /// Whether with coarse elements.
    pub(crate) coarse: bool,
}

/// A scene, and what starts from it.
#[derive(Clone)]
pub(crate) struct Bed {
    pub(crate) scene: Arc<Scene>,
    /// The part of the forest that is always there, where every build starts.
    pub(crate) seed: Forest,
    /// Coarse elements of the seed by number; none for oracles that ask for no brightness.
    pub(crate) coarse_ids: Vec<u32>,
}

impl Bed {
    /// Of a scene of which some bodies are not where it has them at rest.
    pub(crate) fn new(
        scene: Arc<Scene>,
        displaced: &BTreeSet<BodyId>,
        Bedding { groups, coarse }: Bedding,
    ) -> Bed {
        let is_displaced = |body: BodyId| displaced.contains(&body) || scene.is_inserted(body);
        let mut seed = match groups {
            true => Forest::with_groups(&scene, &is_displaced),
            false => Forest::displaced(&scene, &is_displaced),
        };
        let coarse_ids = if coarse { coarse::number(&scene, &mut seed) } else { Vec::new() };
        Bed { scene, seed, coarse_ids }
    }
}
