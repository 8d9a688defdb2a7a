//! A primitive's triangles as polygons: merged where they look alike, cut where an image on them varies.
//!
//! Must not know files, or what is made of the polygons.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use rayon::prelude::*;

use super::Mesh;
use super::chart::Chart;
use super::facet::{Divided, Facet, Layer, Look};
use super::parts::{Field, Part, parts};
use crate::tuning::CUT_GAIN;
use relume_core::scene::Print;
use relume_core::scene::flatten::area_vector;
use relume_core::scene::merge::merge_alike;

/// Shares of a polygon that count as nothing and as all of it.
const COVERED: (f64, f64) = (1.0 / 64.0, 63.0 / 64.0);

/// A polygon or a part of one.
pub(crate) struct Piece {
    pub(crate) corners: Vec<DVec3>,
    pub(crate) facet: Facet,
    pub(crate) print: Option<Arc<Print>>,
    area: f64,
}

pub(crate) struct Pieces {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) degenerate: usize,
}

/// Merged and divided polygons of a primitive.
pub(crate) fn pieces(look: &Look, of: &Mesh<'_>, is_see_through: bool) -> Pieces {
    let facets: Vec<Facet> = of.triangles.par_iter().map(|&t| look.facet(t)).collect();
    let points = |t: usize| of.triangles[t].map(|v| of.points[v as usize]);
    let divided = look.divided(is_see_through);
    let chart = |t: usize| Chart::new(points(t), divided?.places_of(of.triangles[t])?);
    let goes_on = |seed: usize, other: usize| match divided {
        None => true,
        Some(layer) => chart(seed).is_some_and(|chart| {
            let places = layer.places_of(of.triangles[other]).expect("it has places");
            points(other).iter().zip(places).all(|(&point, place)| chart.holds(point, place))
        }),
    };
    let alike = |seed: usize, other: usize| {
        look.alike(&facets[seed], &facets[other]) && goes_on(seed, other)
    };
    let merged = merge_alike(of.points, of.triangles, &alike);
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); merged.polygons.len()];
    for (t, polygon) in merged.polygon_of.iter().enumerate() {
        if let Some(polygon) = polygon {
            members[*polygon as usize].push(t);
        }
    }
    let area = |t: usize| area_vector(&points(t)).length() / 2.0;
    let mut all = Vec::new();
    for (corners, members) in merged.polygons.into_iter().zip(&members) {
        let weighed: Vec<(Facet, f64)> = members.iter().map(|&t| (facets[t], area(t))).collect();
        let largest = members.iter().copied().reduce(|a, b| if area(b) > area(a) { b } else { a });
        let facet = Facet::mean(&weighed);
        let area = weighed.iter().map(|w| w.1).sum();
        let shown: Vec<_> = members.iter().map(|&t| (of.triangles[t], points(t))).collect();
        let print = look.print(&shown, &weighed).map(Arc::new);
        let whole = Piece { corners, facet, print, area };
        all.push((whole, largest.and_then(chart)));
    }
    Pieces { pieces: divide(look, is_see_through, all), degenerate: merged.degenerate }
}

/// Polygons cut into parts where what they emit or cover varies.
fn divide(look: &Look, by_alpha: bool, all: Vec<(Piece, Option<Chart>)>) -> Vec<Piece> {
    let Some(layer) = look.divided(by_alpha) else {
        return all.into_iter().map(|(piece, _)| piece).collect();
    };
    let bright = |f: &Facet| f.emission.iter().sum::<f64>() / 3.0;
    // The squares of all texels, and what the mean of the polygon tells of them.
    let squares = |f: &Facet| match by_alpha {
        true => (f.covered, f.covered * f.covered),
        false => (f.emission_squared, bright(f) * bright(f)),
    };
    let total: f64 = all.iter().map(|(piece, _)| squares(&piece.facet).0 * piece.area).sum();
    let field = Divided { layer, by_alpha };
    let mut out = Vec::new();
    for (piece, chart) in all {
        let (square, told) = squares(&piece.facet);
        let is_even = (square - told) * piece.area < CUT_GAIN * total;
        match chart.filter(|_| !is_even) {
            Some(chart) => out.extend(cut(look, &field, piece, &chart, CUT_GAIN * total)),
            None => out.push(piece),
        }
    }
    out
}

/// The parts of one polygon.
fn cut(look: &Look, field: &Divided<'_>, piece: Piece, chart: &Chart, least: f64) -> Vec<Piece> {
    let places: Vec<DVec2> = piece.corners.iter().map(|&c| chart.place(c)).collect();
    let (texels, _) = field.integral(&places);
    if texels <= 0.0 {
        return vec![piece];
    }
    // Corners stay where they are, bit for bit.
    let point = |place: &DVec2| match places.iter().position(|p| p == place) {
        Some(corner) => piece.corners[corner],
        None => chart.point(*place),
    };
    let shares_places = |layer: &&Layer| layer.places == field.layer.places;
    let found = parts(field, places.clone(), least * texels / piece.area);
    let part = |part: Part| {
        let mut facet = piece.facet;
        if let Some(layer) = look.emission.as_ref().filter(shares_places) {
            facet = facet.emitting(layer.mean_over(&part.corners));
        }
        if let Some(layer) = look.base.as_ref().filter(shares_places) {
            let vertex = piece.facet.vertex_colour(&layer.mean_over(&places));
            facet = facet.coloured(layer.mean_over(&part.corners), vertex);
        }
        let area = part.area * piece.area / texels;
        let corners = part.corners.iter().map(point).collect();
        Piece { corners, facet, print: piece.print.clone(), area }
    };
    found.into_iter().map(part).collect()
}

/// Which of these block light: as many, those that cover most first, as cover the same area in all.
pub(crate) fn blocking(pieces: &[Piece]) -> Vec<bool> {
    let mut kept: Vec<bool> = pieces.iter().map(|p| p.facet.covered >= COVERED.1).collect();
    let is_partly = |p: &Piece| p.facet.covered > COVERED.0 && p.facet.covered < COVERED.1;
    let mut partly: Vec<usize> = (0..pieces.len()).filter(|&k| is_partly(&pieces[k])).collect();
    let covered = |k: usize| pieces[k].facet.covered;
    partly.sort_by(|&a, &b| covered(b).total_cmp(&covered(a)).then(a.cmp(&b)));
    let mut left: f64 = partly.iter().map(|&k| covered(k) * pieces[k].area).sum();
    for k in partly {
        kept[k] = left > 0.5 * pieces[k].area;
        left -= if kept[k] { pieces[k].area } else { 0.0 };
    }
    kept
}
