//! A scene before it is checked: what the builder and the importer hand to `assemble`.
//!
//! Nodes still carry scales, polygons are loops of points in their node's own frame, and names
//! may repeat. Must not know where any of it came from.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};

use super::{
    Camera, Edits, Light, Material, MaterialId, Note, Print, RotationTrack, Tint, TintId, Track,
};

/// Everything of a scene, unchecked.
#[derive(Default)]
pub(super) struct Draft {
    pub(super) name: String,
    /// Parents before children.
    pub(super) nodes: Vec<DraftNode>,
    pub(super) materials: Vec<Material>,
    pub(super) tints: Vec<Tint>,
    pub(super) lights: Vec<Light>,
    pub(super) cameras: Vec<Camera>,
    pub(super) animation: Option<String>,
    /// No animation ends earlier than this, seconds, even if nothing moves any more.
    pub(super) end_s: f64,
    pub(super) notes: Vec<Note>,
    /// What is to be changed before anything is checked.
    pub(super) edits: Edits,
}

/// A node with its scale and what hangs on it.
pub(super) struct DraftNode {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    /// Applied before the rotation: a scale, or any constant linear map.
    pub(super) shape: DMat3,
    pub(super) translation_track: Option<Track>,
    pub(super) rotation_track: Option<RotationTrack>,
    pub(super) presence: Vec<(f64, bool)>,
    pub(super) surfaces: Vec<DraftSurface>,
    /// Its number among the bodies that were declared as such: they come first in the scene, in this order.
    pub(super) body: Option<u32>,
}

/// Polygons of one material on one node.
pub(super) struct DraftSurface {
    /// `None`: the object's name, followed by the material's where the object has several surfaces.
    pub(super) name: Option<String>,
    pub(super) material: MaterialId,
    /// Loops, counter-clockwise from the front, in the node's own (scaled) frame.
    pub(super) polygons: Vec<Vec<DVec3>>,
    /// Tints of the polygons, where they have any; shorter where the last ones have none.
    pub(super) tints: Vec<Option<TintId>>,
    /// Images on the polygons in the node's own frame, likewise.
    pub(super) prints: Vec<Option<Arc<Print>>>,
}

impl DraftNode {
    /// A node that does not move and shows nothing.
    pub(super) fn still(
        name: &str,
        parent: Option<usize>,
        translation: DVec3,
        rotation: DQuat,
    ) -> DraftNode {
        DraftNode {
            name: name.to_owned(),
            parent,
            translation,
            rotation,
            shape: DMat3::IDENTITY,
            translation_track: None,
            rotation_track: None,
            presence: Vec::new(),
            surfaces: Vec::new(),
            body: None,
        }
    }
}
