//! World to pixels, near clipping, and pixels back to a plane.
//!
//! Must not know leaves or light. Points on their way to the screen are `DVec4` (X, Y, W, D):
//! the pixel is (X/W, Y/W) and D is the depth along the view, metres; W is D in perspective and
//! 1 in orthographic views. All four are affine in world coordinates, so that clipping and
//! interpolation are plain linear algebra.

use glam::{DMat3, DVec2, DVec3, DVec4};
use relume_core::geometry::Pose;
use relume_core::scene::Projection;

use super::camera::View;

impl View {
    /// Position of a world point (metres) in a picture of `width` x `height` pixels: x to the
    /// right, y down, the centre of the first pixel at (0.5, 0.5). `None` behind the camera.
    pub fn project(&self, world: DVec3, width: u32, height: u32) -> Option<DVec2> {
        let projected = Projector::new(self, width, height).project(world);
        (projected.w > 0.0).then(|| DVec2::new(projected.x, projected.y) / projected.z)
    }
}

/// A view together with the size of its picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projector {
    world_from_camera: Pose,
    /// Pixels per unit of slope (perspective) or per metre (orthographic).
    scale: f64,
    centre: DVec2,
    perspective: bool,
}

impl Projector {
    /// Fits the camera's frame into the picture, keeping all of it visible.
    pub(crate) fn new(view: &View, width: u32, height: u32) -> Projector {
        let size = DVec2::new(f64::from(width), f64::from(height));
        let (half, perspective) = match view.projection {
            Projection::Perspective { yfov, aspect } => {
                let y = libm::tan(yfov / 2.0);
                (DVec2::new(y * aspect.unwrap_or(0.0), y), true)
            }
            Projection::Orthographic { xmag, ymag } => (DVec2::new(xmag, ymag).abs(), false),
        };
        let scale = (size / 2.0 / half).min_element();
        let world_from_camera = view.world_from_camera;
        Projector { world_from_camera, scale, centre: size / 2.0, perspective }
    }

    /// Where the camera is, metres.
    pub(crate) fn eye(&self) -> DVec3 {
        self.world_from_camera.translation
    }

    /// (X, Y, W, D) of a world point.
    pub(crate) fn project(&self, world: DVec3) -> DVec4 {
        self.place(self.world_from_camera.inverse_point(world), 1.0)
    }

    /// (X, Y, W, D) of a world direction: the derivative of [`Projector::project`].
    fn project_direction(&self, world: DVec3) -> DVec4 {
        self.place(self.world_from_camera.inverse_direction(world), 0.0)
    }

    fn place(&self, camera: DVec3, one: f64) -> DVec4 {
        let depth = -camera.z;
        let w = if self.perspective { depth } else { one };
        let flat = DVec2::new(camera.x, -camera.y) * self.scale + self.centre * w;
        DVec4::new(flat.x, flat.y, w, depth)
    }

    /// The unit direction from which a pixel position sees what is far away.
    pub(crate) fn direction(&self, pixel: DVec2) -> DVec3 {
        if !self.perspective {
            return -self.world_from_camera.rotation.z_axis;
        }
        let slope = (pixel - self.centre) / self.scale;
        let camera = DVec3::new(slope.x, -slope.y, -1.0).normalize();
        self.world_from_camera.rotation * camera
    }

    /// Where the ray to what a pixel position sees starts, metres.
    pub(crate) fn origin(&self, pixel: DVec2) -> DVec3 {
        if self.perspective {
            return self.eye();
        }
        let across = (pixel - self.centre) / self.scale;
        self.world_from_camera.point(DVec3::new(across.x, -across.y, 0.0))
    }

    /// Whether the side that `normal` points to, of a plane through `point`, faces the camera.
    pub(crate) fn faces(&self, point: DVec3, normal: DVec3) -> bool {
        let towards_camera = if self.perspective {
            self.eye() - point
        } else {
            self.world_from_camera.rotation.z_axis
        };
        normal.dot(towards_camera) > 0.0
    }
}

/// A plane of the world with coordinates (u, v), seen through a projector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenPlane {
    u: DVec4,
    v: DVec4,
    origin: DVec4,
    /// (x, y, 1) in pixels to (u, v, 1) times a common factor.
    plane_from_pixel: DMat3,
    /// Nearness as an affine function of the pixel: 1/D in perspective, -D in orthographic views.
    pub(crate) nearness: DVec3,
}

impl SeenPlane {
    /// The plane `origin + u U + v V` (world, metres), or `None` if it is seen edge-on.
    pub(crate) fn new(projector: &Projector, origin: DVec3, u: DVec3, v: DVec3) -> Option<Self> {
        let origin = projector.project(origin);
        let (u, v) = (projector.project_direction(u), projector.project_direction(v));
        let pixel_from_plane = DMat3::from_cols(u.truncate(), v.truncate(), origin.truncate());
        let plane_from_pixel = pixel_from_plane.try_inverse()?;
        if !plane_from_pixel.is_finite() {
            return None;
        }
        let nearness = if projector.perspective {
            plane_from_pixel.transpose().z_axis
        } else {
            plane_from_pixel.transpose() * -DVec3::new(u.w, v.w, origin.w)
        };
        Some(SeenPlane { u, v, origin, plane_from_pixel, nearness })
    }

    /// (X, Y, W, D) of the point at plane coordinates `p`.
    pub(crate) fn project(&self, p: DVec2) -> DVec4 {
        self.u * p.x + self.v * p.y + self.origin
    }

    /// Plane coordinates of what a pixel position sees.
    pub(crate) fn unproject(&self, pixel: DVec2) -> DVec2 {
        let p = self.plane_from_pixel * pixel.extend(1.0);
        p.truncate() / p.z
    }
}

/// Clips a convex polygon to depths of at least `near` and divides: corners in pixels.
///
/// Writes into `out`, which is empty afterwards if nothing is left.
pub(crate) fn clip_to_pixels(polygon: &[DVec4], near: f64, out: &mut Vec<DVec2>) {
    out.clear();
    let pixel = |p: DVec4| DVec2::new(p.x, p.y) / p.z;
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if a.w >= near {
            out.push(pixel(a));
        }
        if (a.w >= near) != (b.w >= near) {
            // From the same end whichever way round the edge is walked, so that neighbours agree.
            let (inner, outer) = if a.w >= near { (a, b) } else { (b, a) };
            let t = (inner.w - near) / (inner.w - outer.w);
            out.push(pixel(inner + (outer - inner) * t));
        }
    }
}
