//! What materials and vertex colours of mesh files make of triangles: polygons with their tints.
//!
//! Must not know files.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::surface::facet::{Layer, Look};
use crate::surface::pieces::{blocking, pieces};
use crate::surface::{Mesh, Tints, resolution};
use crate::tuning::REFLECTANCE_MAX;
use relume_core::scene::coverage::Wrap;
use relume_core::scene::draft::DraftSurface;
use relume_core::scene::merge::merge;
use relume_core::scene::pyramid::Pyramid;
use relume_core::scene::{MaterialId, Tint};

use super::Part;

/// Images of a material.
#[derive(Clone, Default)]
pub(super) struct Paint {
    /// What the image of the reflectance is multiplied with.
    pub(super) factor: [f64; 3],
    pub(super) base: Option<Sheet>,
    /// What shares of the exitance are emitted where.
    pub(super) emission: Option<Sheet>,
    /// Whether light passes where the image's alpha is low.
    pub(super) is_see_through: bool,
}

/// An image and how it lies on a surface.
#[derive(Clone)]
pub(super) struct Sheet {
    pub(super) pyramid: Arc<Pyramid>,
    pub(super) wrap: Wrap,
    pub(super) scale: DVec2,
    pub(super) offset: DVec2,
}

impl Sheet {
    /// On triangles of these texture coordinates, which begin at the lower edge of the image.
    fn layer(&self, places: Option<&[DVec2]>, triangles: usize) -> Layer {
        let placed = |p: &DVec2| {
            let p = *p * self.scale + self.offset;
            DVec2::new(p.x, 1.0 - p.y)
        };
        Layer {
            pyramid: self.pyramid.clone(),
            wrap: [self.wrap; 2],
            places: places.map(|places| places.iter().map(placed).collect()),
            resolution: resolution(triangles),
        }
    }
}

/// A surface, and how many of its triangles have no area.
pub(super) fn surface(
    part: &Part,
    material: MaterialId,
    paint: &Paint,
    (tints, pictures): (&mut Tints, bool),
) -> (DraftSurface, usize) {
    let count = part.triangles.len();
    let places = part.places.as_deref();
    let look = Look {
        base: paint.base.as_ref().map(|sheet| sheet.layer(places, count)),
        emission: paint.emission.as_ref().map(|sheet| sheet.layer(places, count)),
        colours: part.colours.as_ref().map(|c| c.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect()),
        least_vertex_alpha: None,
        pictured: pictures.then_some(paint.factor),
    };
    let mut surface = DraftSurface {
        name: None,
        material,
        polygons: Vec::new(),
        tints: Vec::new(),
        prints: Vec::new(),
    };
    if look.base.is_none() && look.emission.is_none() && look.colours.is_none() {
        let merged = merge(&part.points, &part.triangles);
        surface.polygons = merged.polygons;
        return (surface, merged.degenerate);
    }
    let mesh = Mesh { points: &part.points, triangles: &part.triangles };
    let found = pieces(&look, &mesh, paint.is_see_through);
    let kept = match paint.is_see_through {
        true => blocking(&found.pieces),
        false => vec![true; found.pieces.len()],
    };
    for (piece, _) in found.pieces.into_iter().zip(kept).filter(|(_, kept)| *kept) {
        let of = |c: usize| (paint.factor[c] * piece.facet.colour[c]).clamp(0.0, REFLECTANCE_MAX);
        let reflectance = [0, 1, 2].map(of);
        let emission = piece.facet.emission.map(|e| e.clamp(0.0, 1.0));
        surface.tints.push(Some(tints.number(Tint { reflectance, emission })));
        surface.polygons.push(piece.corners);
        surface.prints.push(piece.print);
    }
    (surface, found.degenerate)
}

/// Points of their own for each corner of polygons, with the number of the first of each.
pub(super) fn apart(points: &[DVec3], corners: &[u32]) -> Vec<DVec3> {
    corners.iter().map(|&c| points[c as usize]).collect()
}

/// Linear light of sRGB values.
pub(super) fn linear(srgb: [f64; 3]) -> [f64; 3] {
    srgb.map(|c| {
        let c = c.clamp(0.0, 1.0);
        if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
    })
}
