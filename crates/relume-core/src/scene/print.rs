//! Images on patches, for pictures: what is seen within a patch whose light was found with means.
//!
//! Must not know files or pixels. The solution does not read any of this.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::coverage::{Cover, Wrap};
use super::pyramid::{Pyramid, Sums};
use crate::scene::tuning::PRINT_RESOLUTION;

/// Images and vertex colours on a patch, in the frame of its body.
#[derive(Clone, Debug)]
pub struct Print {
    /// What the base colour is multiplied with, linear RGB.
    pub factor: [f64; 3],
    /// The image of the base colour.
    pub base: Option<Sheet>,
    /// The image of the emission, as a share of the exitance.
    pub emission: Option<Sheet>,
    /// The triangles of the mesh that the patch, and perhaps others beside it, was merged from.
    pub triangles: Vec<PrintedTriangle>,
}

/// An image as it is laid on triangles.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// The image.
    pub pyramid: Arc<Pyramid>,
    /// What texture coordinates beyond it mean, along its width and height.
    pub wrap: [Wrap; 2],
}

/// A triangle of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct PrintedTriangle {
    /// In the frame of the body, metres.
    pub corners: [DVec3; 3],
    /// Texture coordinates of base colour and emission.
    pub places: [[DVec2; 3]; 2],
    /// Colours of the vertices, linear RGB.
    pub colours: [[f64; 3]; 3],
}

/// What is at one place of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Diffuse reflectance, linear RGB, not limited.
    pub reflectance: [f64; 3],
    /// Share of the material's exitance, by channel.
    pub emission: [f64; 3],
}

impl Print {
    /// The mean over the parallelogram of these two sides around a point, both in the frame of the body, metres;
    /// sides of length 0 are a point. Where the image is transparent, what is not is taken for all of it, or white.
    pub fn at(&self, point: DVec3, sides: [DVec3; 2]) -> Printed {
        let mut nearest = (f64::NEG_INFINITY, 0, [0.0; 3]);
        for (k, triangle) in self.triangles.iter().enumerate() {
            let weights = triangle.weights(point);
            let inside = weights.into_iter().fold(f64::INFINITY, f64::min);
            if inside > nearest.0 {
                nearest = (inside, k, weights);
            }
        }
        let white = Printed { reflectance: self.factor, emission: [1.0; 3] };
        let Some(triangle) = self.triangles.get(nearest.1) else { return white };
        let weights = nearest.2;
        let along = sides.map(|side| {
            let moved = triangle.weights(point + side);
            [0, 1, 2].map(|k| moved[k] - weights[k])
        });
        let mean = |sheet: &Option<Sheet>, which: usize| {
            sheet.as_ref().map(|sheet| sheet.around(triangle.places[which], weights, along))
        };
        let share =
            |s: Sums| if s[3] > 0.0 { [s[0] / s[3], s[1] / s[3], s[2] / s[3]] } else { [1.0; 3] };
        let colour = mean(&self.base, 0).map_or([1.0; 3], share);
        let emission = mean(&self.emission, 1).map_or([1.0; 3], |s| [s[0], s[1], s[2]]);
        let vertex = |c: usize| -> f64 {
            (0..3).map(|k| weights[k].clamp(0.0, 1.0) * triangle.colours[k][c]).sum()
        };
        Printed { reflectance: [0, 1, 2].map(|c| self.factor[c] * colour[c] * vertex(c)), emission }
    }
}

impl PrintedTriangle {
    /// Barycentric weights of a point of its plane.
    fn weights(&self, point: DVec3) -> [f64; 3] {
        let [a, b, c] = self.corners;
        let normal = (b - a).cross(c - a);
        let square = normal.length_squared();
        let part = |p: DVec3, q: DVec3| (p - point).cross(q - point).dot(normal) / square;
        [part(b, c), part(c, a), part(a, b)]
    }
}

impl Sheet {
    /// The mean around a place of a triangle.
    fn around(&self, places: [DVec2; 3], weights: [f64; 3], along: [[f64; 3]; 2]) -> Sums {
        let mix = |w: [f64; 3]| places[0] * w[0] + places[1] * w[1] + places[2] * w[2];
        let (middle, sides) = (mix(weights), along.map(mix));
        let cover = Cover { pyramid: &self.pyramid, wrap: self.wrap, resolution: PRINT_RESOLUTION };
        let corner = |x: f64, y: f64| middle + sides[0] * x + sides[1] * y;
        let corners = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
        let mut mean = cover.mean([corners[0], corners[1], corners[2]]);
        let other = cover.mean([corners[0], corners[2], corners[3]]);
        (0..5).for_each(|c| mean[c] = 0.5 * (mean[c] + other[c]));
        mean
    }
}
