//! What textures and vertex colours make of triangles and polygons of a primitive.
//!
//! Means over surfaces; must not know files, or which polygons are made of the triangles.

use std::sync::Arc;

use glam::DVec2;

use super::parts::Field;
use crate::tuning::{ALIKE, ALIKE_DEVIATIONS, COARSE_STEPS, MEAN_PARTS, SEEN};
use relume_core::scene::coverage::{Cover, Wrap, for_each_third};
use relume_core::scene::print::{Print, PrintedTriangle, Sheet};
use relume_core::scene::pyramid::{Pyramid, Sums};

/// An image on a primitive.
pub(crate) struct Layer {
    pub(crate) pyramid: Arc<Pyramid>,
    pub(crate) wrap: [Wrap; 2],
    /// Texture coordinates of each vertex; without any the whole image counts everywhere.
    pub(crate) places: Option<Vec<DVec2>>,
    /// See [`Cover::resolution`].
    pub(crate) resolution: f64,
}

/// All that varies over a primitive.
#[derive(Default)]
pub(crate) struct Look {
    pub(crate) base: Option<Layer>,
    pub(crate) emission: Option<Layer>,
    /// Vertex colours, linear, with alpha (COLOR_0).
    pub(crate) colours: Option<Vec<[f64; 4]>>,
    /// Alpha of the vertices, factor included, from which on a primitive without image that lets light pass blocks it.
    pub(crate) least_vertex_alpha: Option<f64>,
    /// The factor of the base colour, where pictures are to show what varies.
    pub(crate) pictured: Option<[f64; 3]>,
}

/// Means over a triangle or a polygon.
#[derive(Clone, Copy, Default)]
pub(crate) struct Facet {
    /// Texture times vertex colour, over what is there of it.
    pub(crate) colour: [f64; 3],
    /// How much of it is there: where the image's alpha is high enough.
    pub(crate) covered: f64,
    /// Standard deviation of the brightness of the image over what is there.
    spread: f64,
    pub(crate) emission: [f64; 3],
    emission_spread: f64,
    /// The mean of the squares of the brightness of the emission.
    pub(crate) emission_squared: f64,
}

impl Layer {
    fn cover(&self) -> Cover<'_> {
        Cover { pyramid: &self.pyramid, wrap: self.wrap, resolution: self.resolution }
    }

    fn mean(&self, triangle: [u32; 3]) -> Sums {
        match self.places_of(triangle) {
            Some(places) => self.cover().mean(places),
            None => self.pyramid.mean(),
        }
    }

    pub(crate) fn places_of(&self, triangle: [u32; 3]) -> Option<[DVec2; 3]> {
        self.places.as_ref().map(|places| triangle.map(|v| places[v as usize]))
    }

    /// The mean over a convex polygon of texture coordinates.
    pub(crate) fn mean_over(&self, corners: &[DVec2]) -> Sums {
        let (area, sums) = self.cover().integral(corners);
        if area > 0.0 { sums.map(|s| s / area) } else { self.pyramid.mean() }
    }
}

impl Look {
    /// The layer along which polygons are cut into parts.
    pub(crate) fn divided(&self, is_see_through: bool) -> Option<&Layer> {
        let layer = if is_see_through { &self.base } else { &self.emission };
        layer.as_ref().filter(|layer| layer.places.is_some())
    }

    /// The means over a triangle.
    pub(crate) fn facet(&self, triangle: [u32; 3]) -> Facet {
        let (colour, there) = self.colour(triangle);
        let emission = self.emission.as_ref().map_or([1.0; 5], |layer| layer.mean(triangle));
        let mut facet = Facet::default().emitting(emission);
        facet.set_colour(colour, there);
        facet
    }

    /// What the image of the base colour sums to over a triangle, times the colours of its vertices; and without them.
    fn colour(&self, triangle: [u32; 3]) -> (Sums, Sums) {
        let vertex = self.colours.as_ref().map(|c| triangle.map(|v| c[v as usize]));
        match (&self.base, vertex) {
            (None, None) => ([1.0; 5], [1.0; 5]),
            (Some(layer), None) => {
                let mean = layer.mean(triangle);
                (mean, mean)
            }
            (None, Some(v)) => {
                let mean = [0, 1, 2, 3].map(|c| (v[0][c] + v[1][c] + v[2][c]) / 3.0);
                let there = self.least_vertex_alpha.is_none_or(|least| mean[3] >= least);
                let there = if there { 1.0 } else { 0.0 };
                ([mean[0] * there, mean[1] * there, mean[2] * there, there, 0.0], [0.0; 5])
            }
            (Some(layer), Some(v)) => {
                let whole = layer.mean(triangle);
                match layer.places_of(triangle).filter(|_| v[0] != v[1] || v[0] != v[2]) {
                    None => (times(whole, mix(v, [1.0 / 3.0; 3])), whole),
                    Some(places) => (products(layer, places, v), whole),
                }
            }
        }
    }

    /// What pictures show on a polygon of these triangles, if that is not the same everywhere.
    pub(crate) fn print(
        &self,
        triangles: &[([u32; 3], [glam::DVec3; 3])],
        facets: &[(Facet, f64)],
    ) -> Option<Print> {
        let factor = self.pictured?;
        let varies = |f: &Facet| f.spread > SEEN || f.emission_spread > SEEN * f.emission_max();
        let colours = |v: [u32; 3]| match &self.colours {
            Some(colours) => v.map(|v| colours[v as usize]).map(|[r, g, b, _]| [r, g, b]),
            None => [[1.0; 3]; 3],
        };
        let first = colours(triangles.first()?.0)[0];
        let differs = |c: &[f64; 3]| (0..3).any(|k| (c[k] - first[k]).abs() > SEEN);
        let fades = triangles.iter().any(|t| colours(t.0).iter().any(differs));
        if !fades && !facets.iter().any(|(facet, _)| varies(facet)) {
            return None;
        }
        let sheet = |layer: &Option<Layer>| {
            let layer = layer.as_ref().filter(|layer| layer.places.is_some())?;
            Some(Sheet { pyramid: layer.pyramid.clone(), wrap: layer.wrap })
        };
        let places = |layer: &Option<Layer>, v: [u32; 3]| {
            layer.as_ref().and_then(|layer| layer.places_of(v)).unwrap_or_default()
        };
        let triangle = |&(v, corners): &([u32; 3], [glam::DVec3; 3])| PrintedTriangle {
            corners,
            places: [places(&self.base, v), places(&self.emission, v)],
            colours: colours(v),
        };
        let triangles = triangles.iter().map(triangle).collect();
        Some(Print { factor, base: sheet(&self.base), emission: sheet(&self.emission), triangles })
    }

    /// Whether two triangles may be merged into one polygon.
    pub(crate) fn alike(&self, one: &Facet, other: &Facet) -> bool {
        let near =
            |a: [f64; 3], b: [f64; 3], least: f64| (0..3).all(|c| (a[c] - b[c]).abs() <= least);
        let brightest = one.emission_max().max(other.emission_max());
        let within = one.emission_spread.max(other.emission_spread);
        let emission = (ALIKE * brightest).max(ALIKE_DEVIATIONS * within);
        let spread = ALIKE.max(ALIKE_DEVIATIONS * one.spread.max(other.spread));
        let partly = |f: &Facet| (f.covered * (1.0 - f.covered)).max(0.0).sqrt();
        near(one.colour, other.colour, spread)
            && near(one.emission, other.emission, emission)
            && (one.covered - other.covered).abs() <= ALIKE.max(partly(one)).max(partly(other))
    }
}

/// The mean of an image times vertex colours that vary linearly: over equal parts, each with its mean and its middle.
fn products(layer: &Layer, places: [DVec2; 3], vertex: [[f64; 4]; 3]) -> Sums {
    let cover = layer.cover();
    let at = |w: [f64; 3]| places[0] * w[0] + places[1] * w[1] + places[2] * w[2];
    let mut sums = [0.0; 5];
    for_each_third(MEAN_PARTS, |middle| {
        // A part has the shape of the whole, or is that turned round: both have the same middle and area.
        let about = |k: usize| {
            let own = places[k] - at([1.0 / 3.0; 3]);
            at(middle) + own / MEAN_PARTS as f64
        };
        let part = times(cover.mean([about(0), about(1), about(2)]), mix(vertex, middle));
        (0..5).for_each(|c| sums[c] += part[c]);
    });
    sums.map(|s| s / (MEAN_PARTS * MEAN_PARTS) as f64)
}

fn mix(vertex: [[f64; 4]; 3], weights: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| (0..3).map(|k| weights[k] * vertex[k][c]).sum())
}

fn times(sums: Sums, colour: [f64; 3]) -> Sums {
    [sums[0] * colour[0], sums[1] * colour[1], sums[2] * colour[2], sums[3], sums[4]]
}

/// The standard deviation of brightness over what is there.
fn spread_of(sums: Sums) -> f64 {
    let mean = (sums[0] + sums[1] + sums[2]) / (3.0 * sums[3].max(f64::MIN_POSITIVE));
    (sums[4] / sums[3].max(f64::MIN_POSITIVE) - mean * mean).max(0.0).sqrt()
}

impl Facet {
    fn emission_max(&self) -> f64 {
        self.emission.into_iter().fold(0.0, f64::max)
    }

    /// With these means of the emission's image.
    pub(crate) fn emitting(self, sums: Sums) -> Facet {
        Facet {
            emission: [sums[0], sums[1], sums[2]],
            emission_spread: spread_of(sums),
            emission_squared: sums[4],
            ..self
        }
    }

    fn set_colour(&mut self, colour: Sums, image: Sums) {
        self.covered = colour[3];
        if colour[3] > 0.0 {
            self.colour = [0, 1, 2].map(|c| colour[c] / colour[3]);
        }
        self.spread = spread_of(image);
    }

    /// The mean colour of the vertices where the image alone has these means.
    pub(crate) fn vertex_colour(&self, image: &Sums) -> [f64; 3] {
        let of = |c: usize| if image[c] > 0.0 { self.colour[c] * image[3] / image[c] } else { 1.0 };
        [0, 1, 2].map(of)
    }

    /// With these means of the base colour's image, times a vertex colour.
    pub(crate) fn coloured(mut self, sums: Sums, vertex: [f64; 3]) -> Facet {
        self.set_colour(times(sums, vertex), sums);
        self
    }

    /// The mean of several, weighed with their areas.
    pub(crate) fn mean(of: &[(Facet, f64)]) -> Facet {
        let area: f64 = of.iter().map(|(_, area)| area).sum();
        let covered: f64 = of.iter().map(|(f, area)| f.covered * area).sum();
        let mut mean = Facet { covered: covered / area, ..Facet::default() };
        for (facet, part) in of {
            let there = if covered > 0.0 { facet.covered * part / covered } else { 0.0 };
            (0..3).for_each(|c| mean.colour[c] += facet.colour[c] * there);
            (0..3).for_each(|c| mean.emission[c] += facet.emission[c] * part / area);
            mean.emission_squared += facet.emission_squared * part / area;
        }
        mean
    }
}

/// A layer as what polygons are cut by.
pub(crate) struct Divided<'a> {
    pub(crate) layer: &'a Layer,
    /// By how much of the image is there, not by its brightness.
    pub(crate) by_alpha: bool,
}

impl Field for Divided<'_> {
    fn integral(&self, corners: &[DVec2]) -> (f64, f64) {
        let cover = Cover { resolution: COARSE_STEPS, ..self.layer.cover() };
        let (area, sums) = cover.integral(corners);
        let bright = (sums[0] + sums[1] + sums[2]) / 3.0;
        (area, if self.by_alpha { sums[3] } else { bright })
    }

    fn texels(&self) -> [f64; 2] {
        self.layer.pyramid.size.map(|n| n as f64)
    }
}
