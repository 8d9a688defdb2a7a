//! Where a picture is taken from: a camera of the scene, or a view chosen for it.
//!
//! Must not know pixels, leaves or light.

use glam::{DMat3, DQuat, DVec3};
use relume_core::geometry::Pose;
use relume_core::scene::{Projection, Scene};

use super::overview::Overview;

/// A camera at one instant: a placement and a projection.
///
/// Looks along its own -Z, +Y up, +X right, as in glTF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Placement of the camera in the world, metres.
    pub world_from_camera: Pose,
    /// How it projects.
    pub projection: Projection,
}

/// Why there is no view.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ViewError {
    /// No camera has the name that was asked for.
    #[error("no camera is called \"{name}\"; {}", known(.cameras))]
    UnknownCamera {
        /// The name that was asked for.
        name: String,
        /// The cameras that exist.
        cameras: Vec<String>,
    },
    /// The camera's node is absent (scaled to nothing) at this time.
    #[error(
        "camera \"{name}\" is absent (its node or a parent has scale 0) at {time_s} s; \
         choose another camera or other frames"
    )]
    CameraAbsent {
        /// The camera.
        name: String,
        /// The time, seconds.
        time_s: f64,
    },
}

fn known(cameras: &[String]) -> String {
    if cameras.is_empty() {
        "the scene has none, so leave the name out for an automatic view".into()
    } else {
        format!("the scene has: {}", cameras.join(", "))
    }
}

/// What the pictures of a clip are taken from: one of the scene's cameras, which may move, or a
/// fixed view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint {
    /// Index into [`Scene::cameras`].
    Camera(usize),
    /// The same view in every frame.
    Fixed(View),
}

impl Viewpoint {
    /// The camera called `name`; without a name the scene's first camera; without a camera
    /// [`View::automatic`].
    pub fn new(scene: &Scene, name: Option<&str>) -> Result<Viewpoint, ViewError> {
        match name {
            Some(name) => match scene.cameras.iter().position(|c| c.name == name) {
                Some(index) => Ok(Viewpoint::Camera(index)),
                None => Err(ViewError::UnknownCamera {
                    name: name.into(),
                    cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
                }),
            },
            None if scene.cameras.is_empty() => Ok(Viewpoint::Fixed(View::automatic(scene))),
            None => Ok(Viewpoint::Camera(0)),
        }
    }

    /// The view at `time_s` seconds.
    pub fn at(&self, scene: &Scene, time_s: f64) -> Result<View, ViewError> {
        let index = match *self {
            Viewpoint::Fixed(view) => return Ok(view),
            Viewpoint::Camera(index) => index,
        };
        let camera = &scene.cameras[index];
        match scene.motion.pose(camera.node, time_s) {
            Some(world_from_camera) => {
                Ok(View { world_from_camera, projection: camera.projection })
            }
            None => Err(ViewError::CameraAbsent { name: camera.name.clone(), time_s }),
        }
    }
}

impl View {
    /// The view of [`Overview::of`].
    pub fn automatic(scene: &Scene) -> View {
        Overview::of(scene).view
    }

    /// A perspective view from `eye` towards `target` with +Y up (or, looking along Y, -Z up).
    ///
    /// Metres; `yfov` in radians.
    pub fn look_at(eye: DVec3, target: DVec3, yfov: f64) -> View {
        View::look_at_with_up(eye, target, DVec3::Y, yfov)
    }

    /// The same with another direction upright in the picture.
    pub fn look_at_with_up(eye: DVec3, target: DVec3, up: DVec3, yfov: f64) -> View {
        let back = (eye - target).try_normalize().unwrap_or(DVec3::Z);
        let across = up.normalize_or_zero().cross(back);
        let right = across.try_normalize().unwrap_or(DVec3::X);
        let rotation = DMat3::from_cols(right, back.cross(right), back);
        View {
            world_from_camera: Pose { rotation, translation: eye },
            projection: Projection::Perspective { yfov, aspect: None },
        }
    }

    /// The view carried about an axis through a point (world, metres; the axis of unit length), by a share of a
    /// whole turn, counter-clockwise seen from the axis's end.
    #[must_use]
    pub fn turned(&self, about: DVec3, axis: DVec3, turns: f64) -> View {
        let (sin, cos) = libm::sincos(turns * std::f64::consts::PI);
        let rotation = DMat3::from_quat(DQuat::from_vec4((axis * sin).extend(cos)));
        let turn = Pose { rotation, translation: about - rotation * about };
        View { world_from_camera: turn * self.world_from_camera, ..*self }
    }

    /// Width : height that the camera asks for, if it does.
    ///
    /// A picture of another shape shows all that the camera frames, and more on two sides.
    pub fn aspect(&self) -> Option<f64> {
        match self.projection {
            Projection::Perspective { aspect, .. } => aspect,
            Projection::Orthographic { xmag, ymag } => Some(xmag / ymag),
        }
    }
}
