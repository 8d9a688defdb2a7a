//! A scene before it is checked: what readers of files hand over, and the builder too ([`Scene::from_draft`](super::Scene::from_draft)).
//!
//! Nodes still carry scales, polygons are loops of points in their node's own frame, and names
//! may repeat. Must not know where any of it came from.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};

use super::outside::Environment;
use super::{Camera, Light, Material, MaterialId, Note, Print, RotationTrack, Tint, TintId, Track};

/// Everything of a scene, unchecked.
#[derive(Default)]
pub struct Draft {
    /// Name of the scene.
    pub name: String,
    /// Parents before children.
    pub nodes: Vec<DraftNode>,
    /// Materials; exitance in W/m2.
    pub materials: Vec<Material>,
    /// What single polygons reflect and emit in place of their materials.
    pub tints: Vec<Tint>,
    /// Punctual lights; their nodes are indices into `nodes`.
    pub lights: Vec<Light>,
    /// Cameras, likewise.
    pub cameras: Vec<Camera>,
    /// Name of the animation that was chosen, if one was.
    pub animation: Option<String>,
    /// Radiance from all directions that the file carries.
    pub environment: Option<Arc<Environment>>,
    /// No animation ends earlier than this, seconds, even if nothing moves any more.
    pub end_s: f64,
    /// What was noticed while reading.
    pub notes: Vec<Note>,
    /// What is to be changed before anything is checked.
    pub edits: Edits,
    /// Whether a scene that lies far from the origin, by several times its size, is moved there ([`Scene::origin`](super::Scene::origin)).
    pub near_origin: bool,
}

/// Changes to a scene before it is built, in this order: nodes are hidden, then materials changed; of
/// several changes to one thing the last counts.
///
/// Names are unique names of the scene; `*` stands for any number of characters, unless something has
/// that very name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edits {
    /// Nodes that are left out with all below them, lights and cameras too. Surfaces of a file of
    /// View3D, which has no nodes, by their own names.
    pub hide: Vec<String>,
    /// Materials and the radiance that they emit from now on, W/m2/sr, linear RGB: in place of what the
    /// file says, animated or not.
    pub emit: Vec<(String, [f64; 3])>,
    /// Materials and their diffuse reflectance from now on, linear RGB, each in [0, 1).
    pub reflect: Vec<(String, [f64; 3])>,
}

/// A node with its scale and what hangs on it.
pub struct DraftNode {
    /// Its name; need not be unique.
    pub name: String,
    /// Index of the node that it hangs on: smaller than its own.
    pub parent: Option<usize>,
    /// In the frame of the parent, metres.
    pub translation: DVec3,
    /// In the frame of the parent; need not have unit length.
    pub rotation: DQuat,
    /// Applied before the rotation: a scale, or any constant linear map.
    pub shape: DMat3,
    /// The translation over time, metres, in place of `translation`.
    pub translation_track: Option<Track>,
    /// The rotation over time, in place of `rotation`.
    pub rotation_track: Option<RotationTrack>,
    /// From which times on, seconds, it is there or not; always there without any.
    pub presence: Vec<(f64, bool)>,
    /// What hangs on it.
    pub surfaces: Vec<DraftSurface>,
    /// It is another shape of what a node of its own shows at other times ([`Body::again`](super::Body::again)).
    pub again: bool,
    /// Its number among the bodies that were declared as such: they come first in the scene, in this order.
    pub body: Option<u32>,
}

/// Polygons of one material on one node.
pub struct DraftSurface {
    /// `None`: the object's name, followed by the material's where the object has several surfaces.
    pub name: Option<String>,
    /// Index into [`Draft::materials`].
    pub material: MaterialId,
    /// Loops, counter-clockwise from the front, in the node's own (scaled) frame.
    pub polygons: Vec<Vec<DVec3>>,
    /// Tints of the polygons, where they have any; shorter where the last ones have none.
    pub tints: Vec<Option<TintId>>,
    /// Images on the polygons in the node's own frame, likewise.
    pub prints: Vec<Option<Arc<Print>>>,
}

impl DraftNode {
    /// A node that does not move and shows nothing.
    pub fn still(
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
            again: false,
            body: None,
        }
    }
}
