//! Rigid motion: where a body is at one instant.

use glam::{DMat3, DQuat, DVec3};

/// A rigid placement: `world = rotation * local + translation`.
///
/// `rotation` is orthonormal with determinant +1 up to rounding; metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Columns are the body's axes in world space.
    pub rotation: DMat3,
    /// World position of the body's origin, metres.
    pub translation: DVec3,
}

impl Pose {
    /// The pose that leaves every point where it is.
    pub const IDENTITY: Pose = Pose { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// A rotation about the origin, then a translation, metres.
    pub fn new(rotation: DQuat, translation: impl Into<DVec3>) -> Pose {
        Pose { rotation: DMat3::from_quat(rotation), translation: translation.into() }
    }

    /// A translation, metres.
    pub fn translation(by: impl Into<DVec3>) -> Pose {
        Pose { translation: by.into(), ..Pose::IDENTITY }
    }

    /// Maps a point of the body's frame into the world.
    pub fn point(&self, local: DVec3) -> DVec3 {
        self.rotation * local + self.translation
    }

    /// Maps a direction of the body's frame into the world; lengths are kept.
    pub fn direction(&self, local: DVec3) -> DVec3 {
        self.rotation * local
    }

    /// Maps a world point into the body's frame (the inverse of [`Pose::point`] up to rounding).
    pub fn inverse_point(&self, world: DVec3) -> DVec3 {
        self.rotation.transpose() * (world - self.translation)
    }

    /// Inverse placement: local = rotation^T * (world - translation).
    pub fn inverse(&self) -> Pose {
        Pose { rotation: self.rotation.transpose(), translation: self.inverse_point(DVec3::ZERO) }
    }

    /// Maps a world direction into the body's frame.
    pub fn inverse_direction(&self, world: DVec3) -> DVec3 {
        self.rotation.transpose() * world
    }
}

impl std::ops::Mul for Pose {
    type Output = Pose;

    /// First `inner`, then `self`: `world_from_body * body_from_part`.
    fn mul(self, inner: Pose) -> Pose {
        Pose {
            rotation: self.rotation * inner.rotation,
            translation: self.point(inner.translation),
        }
    }
}
