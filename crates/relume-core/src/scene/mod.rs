//! Scenes: bodies, patches, materials, lights, cameras and their motion.
//!
//! A [`Scene`] is validated when it is made and immutable afterwards; every pose is a pure
//! function of time. Scenes are built in code ([`SceneBuilder`]) or from what a reader of files hands over
//! ([`draft::Draft`]). This room must not know files, elements, pairs or light transport.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::geometry::{Aabb, Pose, polygon_area};

mod assemble;
mod builder;
mod check;
mod connected;
pub mod coverage;
mod covered;
mod covering;
mod dark;
mod discontinuity;
pub mod draft;
mod drift;
mod edit;
mod edited;
mod error;
pub mod flatten;
mod gap;
mod glow;
mod in_plane;
mod insert;
mod inside;
mod join;
mod lamp;
pub mod limits;
pub mod merge;
mod motion;
pub mod names;
mod origin;
pub mod outside;
mod placed;
pub mod print;
pub mod pyramid;
mod rigid;
mod shell;
mod solid;
mod tint;
mod topology;
mod tuning;
mod weld;
mod world;

pub use builder::SceneBuilder;
pub use check::check;
pub use covered::{Covered, Inside};
pub use covering::{Covering, Instant};
pub(crate) use discontinuity::Discontinuities;
pub use draft::Edits;
pub use drift::Drift;
pub use edited::Edited;
pub(crate) use edited::FIRST_NAME;
pub use error::SceneError;
pub use glow::Glow;
pub use in_plane::{InPlane, Lying, Sheet};
pub use insert::{NewBody, NewMesh, TakenBody};
pub use join::{Joined, Part};
pub use motion::{Interpolation, Motion, Node, NodeId, RotationTrack, Track};
pub use print::{Print, Printed};
pub use rigid::check_track;
pub use solid::{Enclosure, Solid, SolidEdge, SolidFace, Solids};
pub use tint::{Glowing, Tint};
pub use world::{Held, World};

/// Index of a [`Body`] in [`Scene::bodies`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId(pub u32);

/// Index of a [`Patch`] in [`Scene::patches`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PatchId(pub u32);

/// Index of a [`Material`] in [`Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaterialId(pub u32);

/// Index of a [`Surface`] in [`Scene::surfaces`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SurfaceId(pub u32);

/// Index of a [`Tint`] in [`Scene::tints`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TintId(pub u32);

/// Index of a [`Light`] in [`Scene::lights`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LightId(pub u32);

/// Everything that is lit, as read and validated. Immutable.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name of the scene (the file's stem, or the name given in code).
    pub name: String,
    /// Rigid groups; names are unique.
    pub bodies: Vec<Body>,
    /// Named parts of bodies: one for each mesh primitive that an object instantiates.
    pub surfaces: Vec<Surface>,
    /// Surfaces that only block light: in tables of form factors what reaches them has escaped.
    /// Files of View3D have such; everything else treats them as black surfaces.
    pub obstructions: BTreeSet<SurfaceId>,
    /// All patches, sorted by body (then by surface): [`Body::patches`] is a range of them.
    pub patches: Vec<Patch>,
    /// Materials; every patch names one.
    pub materials: Vec<Material>,
    /// What textures and vertex colours make of materials, one entry for each distinct value: ask
    /// [`Scene::reflectance`] and [`Scene::exitance_at`], which know them.
    pub tints: Vec<Tint>,
    /// Punctual lights (KHR_lights_punctual).
    pub lights: Vec<Light>,
    /// Cameras, in file order.
    pub cameras: Vec<Camera>,
    /// The node tree and its animation.
    pub motion: Motion,
    /// Where the origin of all its coordinates lies in those of its file, metres: 0 unless it was read near the origin
    /// ([`draft::Draft::near_origin`]) and lies far from it.
    pub origin: DVec3,
    /// The light from outside that distant bodies stand for ([`Scene::with_outside`]).
    pub outside: Option<Arc<outside::Outside>>,
    /// Distance of distant bodies, metres; 0 where there are none.
    pub outside_m: f64,
    /// Radiance from all directions that the file carries: it lights the scene where [`Scene::with_outside`] takes it as its sky.
    pub environment: Option<Arc<outside::Environment>>,
    /// What was noticed while reading, for `info` and `check`.
    pub notes: Vec<Note>,
    /// Bodies that came or went since it was made: none by default.
    pub edited: Edited,
}

/// Everything that moves rigidly together: an animated node with what hangs rigidly below it,
/// Relative rounding of coordinates in single precision.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// or one object that never moves.
#[derive(Clone, Debug)]
pub struct Body {
    /// Unique name, from the node.
    pub name: String,
    /// The node whose rigid motion the body follows. Where nothing moves it ([`Scene::moves`]) the
    /// node's placement is already in the patches: use [`Scene::pose`], not [`Motion::pose`].
    pub node: NodeId,
    /// The patches of this body, a range of [`Scene::patches`].
    pub patches: std::ops::Range<u32>,
    /// Whether the body is a part of the sky or the sun, at no place in the scene: it shines, and what reaches it has escaped; it
    /// has no share in the scene's extent and area, hides nothing, is lit by nothing.
    pub distant: bool,
    /// Whether the body is one of the shapes, one after the other, of a mesh that deforms; it does not count in the scale that
    /// sizes are measured by.
    pub again: bool,
}

/// A named part of a body: one mesh primitive of one object (node with a mesh).
#[derive(Clone, Debug)]
pub struct Surface {
    /// Name of the object (glTF node), then of the material where an object has several
    /// primitives; unique in the scene.
    pub name: String,
    /// Name of the object (glTF node) the surface belongs to.
    pub object: String,
    /// The body it rides on.
    pub body: BodyId,
    /// Its material.
    pub material: MaterialId,
}

/// A planar convex polygon of the input, one-sided: it reflects and emits on the side its
/// normal points to and is black on the other, but blocks light on both.
///
/// A double-sided polygon is two patches, each the other's [`Patch::twin`].
#[derive(Clone, Debug)]
pub struct Patch {
    /// The body it rides on.
    pub body: BodyId,
    /// The named surface it belongs to.
    pub surface: SurfaceId,
    /// Its material.
    pub material: MaterialId,
    /// Reflectance and share of the exitance of its own, where textures or vertex colours vary them.
    pub tint: Option<TintId>,
    /// Images that vary over it, if they were kept for pictures.
    pub print: Option<Arc<Print>>,
    /// Its plane's frame in the body's frame.
    pub frame: Frame,
    /// Corners in the plane's frame, counter-clockwise seen from the front, convex, three or
    /// more, no three successive ones collinear (up to rounding), metres.
    pub corners: Vec<DVec2>,
    /// The same polygon seen from behind, if the material is double-sided.
    pub twin: Option<PatchId>,
}

/// An orthonormal frame of a plane, in the body's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Origin, a point of the plane, metres.
    pub origin: DVec3,
    /// First axis in the plane, unit length.
    pub u: DVec3,
    /// Second axis in the plane, unit length.
    pub v: DVec3,
    /// Unit normal, `u x v`: the side that reflects.
    pub normal: DVec3,
}

impl Frame {
    /// The point of the body's frame at plane coordinates `p`.
    pub fn point(&self, p: DVec2) -> DVec3 {
        self.origin + self.u * p.x + self.v * p.y
    }
}

/// A diffuse material; linear RGB. Textures and vertex colours are not in it: see [`Tint`].
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Unique name.
    pub name: String,
    /// Diffuse reflectance rho, each channel in [0, 1).
    pub reflectance: [f64; 3],
    /// Exitance M = pi x emitted radiance, W/m2; at time 0 where it changes.
    pub exitance: [f64; 3],
    /// Keyframes of the exitance, if it changes.
    pub glow: Option<Glow>,
    /// Whether both sides of its polygons reflect and emit.
    pub double_sided: bool,
}

/// A punctual light: a direct source without area.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Unique name, from the node.
    pub name: String,
    /// The node it hangs on; it shines along the node's -Z axis.
    pub node: NodeId,
    /// Point, spot or directional, with its shape.
    pub kind: LightKind,
    /// Point and spot: radiant intensity, W/sr. Directional: irradiance at normal incidence, W/m2.
    /// Linear RGB; at time 0 where it changes.
    pub intensity: [f64; 3],
    /// Keyframes of the intensity, if it changes.
    pub glow: Option<Glow>,
    /// Text: the value in the file and how it was converted.
    pub conversion: String,
}

/// The kinds of punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines equally in all directions.
    Point,
    /// Shines in a cone around -Z; full inside `inner`, nothing outside `outer` (radians from the
    /// axis), and the glTF falloff between.
    Spot {
        /// Half angle of the full cone, radians.
        inner: f64,
        /// Half angle where nothing is left, radians.
        outer: f64,
    },
    /// Parallel light along -Z.
    Directional,
}

/// A camera that hangs on a node and looks along the node's -Z, +Y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Unique name.
    pub name: String,
    /// The node it hangs on.
    pub node: NodeId,
    /// How it projects.
    pub projection: Projection,
}

/// Camera projections of glTF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective with a vertical field of view in radians and, if the file gives one, a width to
    /// height ratio.
    Perspective {
        /// Vertical field of view, radians.
        yfov: f64,
        /// Width : height, if given.
        aspect: Option<f64>,
    },
    /// Orthographic with half extents in metres.
    Orthographic {
        /// Half width, metres.
        xmag: f64,
        /// Half height, metres.
        ymag: f64,
    },
}

/// Finding about the input.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// How serious it is.
    pub severity: Severity,
    /// Short stable identifier, such as `degenerate` or `light-units`.
    pub code: &'static str,
    /// The node, mesh, material or extension it is about.
    pub subject: String,
    /// How many items it concerns.
    pub count: usize,
    /// One sentence: what was found, and what was done or what to do about it.
    pub message: String,
}

/// How serious a [`Note`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Worth knowing.
    Info,
    /// The result is likely not what was meant.
    Warning,
    /// The result will be wrong.
    Error,
}

impl Scene {
    /// Where a body is at `time_s`, or `None` while it is absent (scale 0). Exactly
    /// [`Pose::IDENTITY`] for a body that never moves: its patches are placed in the world.
    pub fn pose(&self, body: BodyId, time_s: f64) -> Option<Pose> {
        if !self.moves(body) {
            return Some(Pose::IDENTITY);
        }
        self.motion.pose(self.bodies[body.0 as usize].node, time_s)
    }

    /// Whether a body moves, or comes and goes, at any time of the animation.
    pub fn moves(&self, body: BodyId) -> bool {
        self.motion.moves(self.bodies[body.0 as usize].node)
    }

    /// Smallest box around all patches present at `time_s`, distant ones aside; `None` while none is.
    pub fn bounds(&self, time_s: f64) -> Option<Aabb> {
        self.bounds_of(|body| self.pose(body, time_s))
    }

    /// Smallest box at time 0 around the bodies that the scene was made with, removed ones among them, distant ones aside.
    pub(crate) fn made_bounds(&self) -> Option<Aabb> {
        self.bounds_of(|body| self.pose(body, 0.0).filter(|_| !self.is_inserted(body)))
    }

    /// Smallest box around all patches present in a world, distant ones aside; `None` while none is.
    pub fn bounds_in(&self, now: &World) -> Option<Aabb> {
        self.bounds_of(|body| now.pose(body))
    }

    fn bounds_of(&self, pose: impl Fn(BodyId) -> Option<Pose>) -> Option<Aabb> {
        let mut bounds = Aabb::EMPTY;
        for body in (0..self.bodies.len() as u32).map(BodyId).filter(|&b| !self.is_distant(b)) {
            let Some(pose) = pose(body) else { continue };
            for point in self.patches_of(body).flat_map(|(_, p)| p.corners_in_body()) {
                bounds = bounds.with(pose.point(point));
            }
        }
        (!bounds.is_empty()).then_some(bounds)
    }

    /// The same scene with nothing that emits: what form factors are found in, so that every surface
    /// weighs the same.
    pub fn without_light(&self) -> Scene {
        let mut dark = Scene { lights: Vec::new(), ..self.clone() };
        for material in &mut dark.materials {
            (material.exitance, material.glow) = ([0.0; 3], None);
        }
        dark
    }

    /// The same scene without the bodies that stand for light from outside, which come last, and without those that were
    /// inserted after them.
    pub fn without_outside(&self) -> Scene {
        let mut near = Scene { outside: None, outside_m: 0.0, ..self.clone() };
        let made = near.bodies.iter().position(|body| body.distant).unwrap_or(near.bodies.len());
        near.bodies.truncate(made);
        let (bodies, patches) =
            (near.bodies.len(), near.bodies.last().map_or(0, |body| body.patches.end));
        near.patches.truncate(patches as usize);
        near.surfaces.retain(|surface| (surface.body.0 as usize) < bodies);
        near
    }

    /// The patches of a body with their ids.
    pub fn patches_of(&self, body: BodyId) -> impl Iterator<Item = (PatchId, &Patch)> {
        let range = self.bodies[body.0 as usize].patches.clone();
        range.map(|i| (PatchId(i), &self.patches[i as usize]))
    }

    /// Whether a body stands for light from outside; see [`Body::distant`].
    pub fn is_distant(&self, body: BodyId) -> bool {
        self.bodies[body.0 as usize].distant
    }

    /// Sum of the areas of all patches, distant ones aside, m2 (a double-sided polygon counts twice).
    pub fn area_m2(&self) -> f64 {
        let near = self.patches.iter().filter(|p| !self.is_distant(p.body));
        near.map(Patch::area_m2).sum()
    }

    /// Sum of the areas of the bodies that the scene was made with, removed ones among them, m2: the scale that sizes are
    /// measured by, which no body changes that comes or goes.
    pub fn made_area_m2(&self) -> f64 {
        self.patches.iter().filter(|p| self.is_made(p)).map(Patch::area_m2).sum()
    }

    /// Whether a patch is one of the surfaces that the scene was made of: not distant, not inserted, and no body's second shape.
    fn is_made(&self, patch: &Patch) -> bool {
        let body = patch.body;
        let is_again = self.bodies[body.0 as usize].again;
        !self.is_distant(body) && !self.is_inserted(body) && !is_again
    }
}

impl Patch {
    /// Area by the shoelace formula, m2; exact up to rounding.
    pub fn area_m2(&self) -> f64 {
        polygon_area(&self.corners)
    }

    /// A bound on the form factor from a point of the scene around `centre` to this patch, if it is distant: its area
    /// over pi times the square of how far its plane is.
    pub(crate) fn most_factor(&self, centre: DVec3) -> f64 {
        let far = (self.frame.origin - centre).dot(self.frame.normal);
        (self.area_m2() / (std::f64::consts::PI * far * far)).min(1.0)
    }

    /// Rounding of its corners in its own frame, metres: what files hold, coordinates in single precision.
    pub(crate) fn rounding_m(&self) -> f64 {
        ROUNDING * self.corners.iter().fold(0.0_f64, |m, c| m.max(c.x.abs()).max(c.y.abs()))
    }

    /// Corners in the body's frame, counter-clockwise seen from the front.
    pub fn corners_in_body(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.corners.iter().map(|&c| self.frame.point(c))
    }
}
