//! The part of a solved state that is of space.

use std::sync::Arc;

use crate::element::{ElementId, Forest, WorldView};
use crate::pair::RefinementCriterion;
use crate::scene::{Held, Scene, World};
use crate::solver::GroupLinks;
use crate::transport::Simd;

use super::coarse::Coarse;
use super::importance::Aim;
use super::surfaces::LitForest;
use super::tuning::REFERENCE_SHARE;

/// What a scene is solved with.
#[derive(Clone, Debug)]
pub(crate) struct Tuning {
    /// Relative error of irradiance aimed at.
    pub(crate) tolerance: f64,
    /// What the tolerance is about.
    pub(crate) aim: Aim,
    /// What decides on pairs.
    pub(crate) criterion: RefinementCriterion,
    /// Vector instructions.
    pub(crate) simd: Simd,
}

/// The part of a solved state that is of space.
pub struct SpaceState {
    pub(crate) scene: Arc<Scene>,
    pub(crate) tuning: Tuning,
    pub(crate) world: World,
    /// What was held by hand.
    pub(crate) held: Held,
    pub(crate) forest: Forest,
    pub(crate) view: WorldView,
    pub(crate) groups: GroupLinks,
    pub(crate) coarse: Coarse,
    /// The world when no link was extrapolated last.
    pub(crate) sound_world: World,
    /// Facets of which another part is covered than when they were solved, ascending.
    pub(crate) touched: Vec<ElementId>,
    /// Elements of which bodies that move cover another part than when they were solved, ascending.
    pub(crate) covered: Vec<ElementId>,
    /// Nodes that became groups or coarse elements since they were solved, or ceased to be, ascending.
    pub(crate) regrouped: Vec<ElementId>,
    /// Whether a frame was left half-way.
    pub(super) is_stopped: bool,
}

impl SpaceState {
    /// The elements with their light, absent ones among them.
    pub(crate) fn surfaces(&self) -> LitForest<'_> {
        LitForest::new(&self.scene, &self.forest, &self.world).with_groups(&self.groups)
    }

    /// Area of an element that weighs 1 in the error norm of the scene, m2.
    pub(crate) fn reference_area_m2(&self) -> f64 {
        self.forest.made_m2() * REFERENCE_SHARE
    }
}
