//! How surfaces of a file look: primitives to polygons with their tints, by textures, vertex colours and alpha.
//!
//! Reads what it needs of the file; must not know nodes or placements.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::coverage::Wrap;
use super::document::Document;
use super::facet::{Chart, Divided, Facet, Layer, Look};
use super::images::Images;
use super::material::{Paint, REFLECTANCE_MAX};
use super::parts::{GAIN, parts};
use super::{json, note};
use crate::scene::flatten::area_vector;
use crate::scene::merge::{Merged, merge, merge_alike};
use crate::scene::{Note, SceneError, Severity, Tint, TintId};

/// Polygons with what they are made of.
#[derive(Default)]
pub(super) struct Painted {
    pub(super) loops: Vec<Vec<DVec3>>,
    /// As many as `loops`.
    pub(super) tints: Vec<Option<TintId>>,
    /// Triangles left out because they have no area.
    pub(super) degenerate: usize,
}

/// The vertices and triangles of a primitive.
pub(super) struct Triangles<'a> {
    pub(super) primitive: &'a json::Primitive,
    pub(super) points: &'a [DVec3],
    pub(super) triangles: &'a [[u32; 3]],
    /// Who they are, for messages.
    pub(super) owner: &'a str,
}

/// How all surfaces of a file look.
pub(super) struct Looks<'a> {
    document: &'a Document,
    /// By material; the last one is for primitives without any.
    paints: Vec<Paint>,
    images: Images<'a>,
    tints: Vec<Tint>,
    numbers: BTreeMap<[u64; 6], TintId>,
    /// Materials that were lowered to [`REFLECTANCE_MAX`], and the highest that was.
    lowered: (BTreeSet<usize>, f64),
    /// Materials with textures or vertex colours.
    varied: BTreeSet<usize>,
    see_through: SeenThrough,
    /// What was said of a texture already: material and which one.
    said: BTreeSet<(usize, &'static str)>,
}

/// What became of polygons that let light pass.
#[derive(Default)]
struct SeenThrough {
    materials: BTreeSet<usize>,
    opaque: usize,
    left_out: usize,
}

/// Shares of a polygon that count as nothing and as all of it.
const COVERED: (f64, f64) = (1.0 / 64.0, 63.0 / 64.0);

/// Steps across a triangle for its means ([`super::coverage::Cover::resolution`]), at most and at least, and how many all
/// triangles of a primitive share.
const STEPS: (f64, f64) = (64.0, 4096.0);
const STEPS_SHARED: f64 = 4e6;

impl<'a> Looks<'a> {
    pub(super) fn new(document: &'a Document, paints: Vec<Paint>) -> Looks<'a> {
        Looks {
            document,
            paints,
            images: Images::new(document),
            tints: Vec::new(),
            numbers: BTreeMap::new(),
            lowered: Default::default(),
            varied: BTreeSet::new(),
            see_through: SeenThrough::default(),
            said: BTreeSet::new(),
        }
    }

    /// The polygons of a primitive, merged where neighbours look alike; divided where its emission, or what it covers,
    /// varies strongly; without those that let all light pass.
    pub(super) fn polygons(
        &mut self,
        of: &Triangles<'_>,
        notes: &mut Vec<Note>,
    ) -> Result<Painted, SceneError> {
        let none = self.paints.len() - 1;
        let material = of.primitive.material.unwrap_or(none).min(none);
        let look = self.look(material, of, notes)?;
        let is_plain = look.base.is_none() && look.emission.is_none() && look.colours.is_none();
        if is_plain {
            return Ok(self.plain(material, of));
        }
        self.varied.insert(material);
        let pieces = pieces(&look, of, self.paints[material].see_through.is_some());
        Ok(self.finished(material, pieces))
    }

    /// Polygons of a primitive that looks the same everywhere.
    fn plain(&mut self, material: usize, of: &Triangles<'_>) -> Painted {
        let Merged { polygons: loops, degenerate, .. } = merge(of.points, of.triangles);
        self.lower(material, self.paints[material].base_factor);
        if let Some(see) = self.paints[material].see_through {
            let is_open = see.factor < see.cutoff;
            self.see_through.count(material, loops.len(), is_open);
            if is_open {
                return Painted { degenerate, ..Painted::default() };
            }
        }
        Painted { tints: vec![None; loops.len()], loops, degenerate }
    }

    fn finished(&mut self, material: usize, pieces: Pieces) -> Painted {
        let mut painted = Painted { degenerate: pieces.degenerate, ..Painted::default() };
        let all = pieces.pieces.len();
        let kept = match self.paints[material].see_through {
            Some(_) => {
                let kept = blocking(&pieces.pieces);
                let open = kept.iter().filter(|kept| !**kept).count();
                self.see_through.count(material, open, true);
                self.see_through.count(material, all - open, false);
                kept
            }
            None => vec![true; all],
        };
        for (piece, _) in pieces.pieces.into_iter().zip(kept).filter(|(_, kept)| *kept) {
            painted.loops.push(piece.corners);
            painted.tints.push(Some(self.tint(material, &piece.facet)));
        }
        painted
    }

    /// The tint of a polygon, the same number for the same values.
    fn tint(&mut self, material: usize, facet: &Facet) -> TintId {
        let factor = self.paints[material].base_factor;
        let reflectance = [0, 1, 2].map(|c| factor[c] * facet.colour[c]);
        self.lower(material, reflectance);
        let reflectance = reflectance.map(|r| r.clamp(0.0, REFLECTANCE_MAX));
        let emission = facet.emission.map(|e| e.clamp(0.0, 1.0));
        let bits = |k: usize| if k < 3 { reflectance[k] } else { emission[k - 3] }.to_bits();
        let key = [0, 1, 2, 3, 4, 5].map(bits);
        let next = TintId(self.tints.len() as u32);
        let id = *self.numbers.entry(key).or_insert(next);
        if id == next {
            self.tints.push(Tint { reflectance, emission });
        }
        id
    }

    fn lower(&mut self, material: usize, reflectance: [f64; 3]) {
        let highest = reflectance.into_iter().fold(0.0, f64::max);
        if highest > REFLECTANCE_MAX {
            self.lowered.0.insert(material);
            self.lowered.1 = highest.max(self.lowered.1);
        }
    }

    /// What varies over a primitive.
    fn look(
        &mut self,
        material: usize,
        of: &Triangles<'_>,
        notes: &mut Vec<Note>,
    ) -> Result<Look, SceneError> {
        let paint = self.paints[material].clone();
        let colours = self.colours(of)?;
        let mut least_alpha = 0;
        let mut least_vertex_alpha = None;
        if let Some(see) = paint.see_through {
            let vertex = colours
                .as_ref()
                .map_or(1.0, |c| c.iter().map(|c| c[3]).sum::<f64>() / c.len().max(1) as f64);
            least_alpha = least(see.cutoff, see.factor * vertex);
            least_vertex_alpha = Some(see.cutoff / see.factor.max(f64::MIN_POSITIVE));
        }
        let mut layer = |texture: Option<json::TextureRef>, which, least_alpha| match texture {
            Some(texture) => self.layer(texture, (material, which), least_alpha, of, notes),
            None => Ok(None),
        };
        let base = layer(paint.base, "base colour", least_alpha)?;
        let emission = layer(paint.emission, "emission", 0)?;
        Ok(Look { base, emission, colours, least_vertex_alpha })
    }

    /// An image on a primitive; none, and a note, where it cannot be read.
    fn layer(
        &mut self,
        texture: json::TextureRef,
        (material, which): (usize, &'static str),
        least_alpha: u16,
        of: &Triangles<'_>,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Layer>, SceneError> {
        let root = &self.document.root;
        let entry = root
            .textures
            .get(texture.index)
            .ok_or_else(|| self.document.out_of_range("texture", texture.index))?;
        let source = entry.source.or(entry.extensions.webp.as_ref().map(|i| i.source));
        let source = source.or(entry.extensions.basisu.as_ref().map(|i| i.source));
        let pyramid = match source {
            Some(image) => self.images.get((image, least_alpha))?,
            None => Err("it has no image".to_owned()),
        };
        let places = self.places(&texture, of)?;
        let message = match (&pyramid, &places) {
            (Err(why), _) => format!(
                "the {which} texture cannot be read ({why}) and is taken as white; \
                 put the image in place or set the factor to its mean"
            ),
            (Ok(_), None) => format!(
                "the {which} texture counts with the mean of the whole image on {}, which has no texture coordinates for it; \
                 unwrap the mesh",
                of.owner
            ),
            _ => String::new(),
        };
        if !message.is_empty() && self.said.insert((material, which)) {
            let name = &self.paints[material].name;
            notes.push(note(Severity::Warning, "texture", name, 1, message));
        }
        let Ok(pyramid) = pyramid else { return Ok(None) };
        let sampler = entry.sampler.and_then(|s| root.samplers.get(s));
        let wrap = [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap);
        let steps = STEPS_SHARED / of.triangles.len().max(1) as f64;
        let resolution = steps.clamp(STEPS.0, STEPS.1);
        Ok(Some(Layer { pyramid, wrap, places, resolution }))
    }

    /// The texture coordinates of each vertex, transformed (KHR_texture_transform).
    fn places(
        &self,
        texture: &json::TextureRef,
        of: &Triangles<'_>,
    ) -> Result<Option<Vec<DVec2>>, SceneError> {
        let transform = texture.extensions.transform.unwrap_or_default();
        let set = transform.tex_coord.unwrap_or(texture.tex_coord);
        let Some(places) = self.attribute::<2>(of, &format!("TEXCOORD_{set}"))? else {
            return Ok(None);
        };
        let scale = DVec2::from_array(transform.scale.unwrap_or([1.0; 2]));
        let offset = DVec2::from_array(transform.offset.unwrap_or_default());
        let (sin, cos) = libm::sincos(transform.rotation);
        let placed = |p: [f64; 2]| {
            let p = DVec2::from_array(p) * scale;
            DVec2::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x) + offset
        };
        Ok(Some(places.into_iter().map(placed).collect()))
    }

    /// Vertex colours, but where all are white.
    fn colours(&self, of: &Triangles<'_>) -> Result<Option<Vec<[f64; 4]>>, SceneError> {
        let accessor = of.primitive.attributes.get("COLOR_0");
        let kind = accessor.and_then(|&a| self.document.root.accessors.get(a)).map(|a| &a.kind);
        let colours = match kind.map(String::as_str) {
            Some("VEC3") => self.attribute::<3>(of, "COLOR_0")?.map(|colours| {
                colours.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect::<Vec<_>>()
            }),
            _ => self.attribute::<4>(of, "COLOR_0")?,
        };
        let known = |c: f64| if c.is_finite() { c.max(0.0) } else { 1.0 };
        let colours = colours.map(|all| all.into_iter().map(|c| c.map(known)).collect::<Vec<_>>());
        Ok(colours.filter(|colours| colours.iter().any(|c| *c != [1.0; 4])))
    }

    /// An attribute with a value for each vertex, if the primitive has it.
    fn attribute<const N: usize>(
        &self,
        of: &Triangles<'_>,
        name: &str,
    ) -> Result<Option<Vec<[f64; N]>>, SceneError> {
        let Some(&accessor) = of.primitive.attributes.get(name) else { return Ok(None) };
        let values = self.document.numbers::<N>(accessor, of.owner)?;
        if values.len() != of.points.len() {
            return Err(self.document.malformed(format!(
                "{}: {name} has {} values for {} vertices",
                of.owner,
                values.len(),
                of.points.len()
            )));
        }
        Ok(Some(values))
    }

    /// The tints of all polygons, with what is to be said of them.
    pub(super) fn finish(self, notes: &mut Vec<Note>) -> Vec<Tint> {
        let names = |of: &BTreeSet<usize>| {
            let first: Vec<&str> =
                of.iter().take(3).map(|&m| self.paints[m].name.as_str()).collect();
            match of.len() - first.len() {
                0 => first.join(", "),
                more => format!("{} and {more} more", first.join(", ")),
            }
        };
        let mut say = |severity, code, of: &BTreeSet<usize>, message: String| {
            if let Some(&first) = of.first() {
                let subject = &self.paints[first].name;
                notes.push(note(severity, code, subject, of.len(), message));
            }
        };
        let (lowered, highest) = &self.lowered;
        say(
            Severity::Warning,
            "reflectance",
            lowered,
            format!(
                "materials that reflect up to {highest:.3} of the light, lowered to {REFLECTANCE_MAX}: {} ({}); nothing reflects \
                 all light: set baseColorFactor to what the surface really reflects",
                lowered.len(),
                names(lowered)
            ),
        );
        say(
            Severity::Info,
            "texture",
            &self.varied,
            format!(
                "materials with textures or vertex colours, which count with their means over each polygon: {} ({})",
                self.varied.len(),
                names(&self.varied)
            ),
        );
        let SeenThrough { materials, opaque, left_out } = &self.see_through;
        say(
            Severity::Info,
            "transparency",
            materials,
            format!(
                "materials that let light pass (alphaMode, KHR_materials_transmission): {} ({}); of their polygons and parts of such \
                 {left_out} let all light pass, straight on, and {opaque} block it",
                materials.len(),
                names(materials)
            ),
        );
        self.tints
    }
}

impl SeenThrough {
    fn count(&mut self, material: usize, polygons: usize, is_open: bool) {
        self.materials.insert(material);
        *(if is_open { &mut self.left_out } else { &mut self.opaque }) += polygons;
    }
}

fn wrap(code: Option<u32>) -> Wrap {
    match code {
        Some(33071) => Wrap::ClampToEdge,
        Some(33648) => Wrap::MirroredRepeat,
        _ => Wrap::Repeat,
    }
}

/// The least 8-bit alpha that, times a factor, reaches the cutoff; 256 where none does.
fn least(cutoff: f64, factor: f64) -> u16 {
    let needed = (cutoff * 255.0 / factor.max(f64::MIN_POSITIVE) - 1e-9).ceil();
    needed.clamp(0.0, 256.0) as u16
}

/// A polygon or a part of one.
struct Piece {
    corners: Vec<DVec3>,
    facet: Facet,
    area: f64,
}

struct Pieces {
    pieces: Vec<Piece>,
    degenerate: usize,
}

/// Merged and divided polygons of a primitive.
fn pieces(look: &Look, of: &Triangles<'_>, is_see_through: bool) -> Pieces {
    let facets: Vec<Facet> = of.triangles.iter().map(|&t| look.facet(t)).collect();
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
        let whole = Piece { corners, facet, area: weighed.iter().map(|w| w.1).sum() };
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
        let is_even = (square - told) * piece.area < GAIN * total;
        match chart.filter(|_| !is_even) {
            Some(chart) => out.extend(cut(look, &field, &piece, &chart, GAIN * total)),
            None => out.push(piece),
        }
    }
    out
}

/// The parts of one polygon.
fn cut(look: &Look, field: &Divided<'_>, piece: &Piece, chart: &Chart, least: f64) -> Vec<Piece> {
    let places: Vec<DVec2> = piece.corners.iter().map(|&c| chart.place(c)).collect();
    let (texels, _) = super::parts::Field::integral(field, &places);
    if !(texels > 0.0) {
        return vec![Piece { corners: piece.corners.clone(), ..*piece }];
    }
    // Corners stay where they are, bit for bit.
    let point = |place: &DVec2| match places.iter().position(|p| p == place) {
        Some(corner) => piece.corners[corner],
        None => chart.point(*place),
    };
    let shares_places = |layer: &&Layer| layer.places == field.layer.places;
    let found = parts(field, places.clone(), least * texels / piece.area);
    let part = |part: super::parts::Part| {
        let mut facet = piece.facet;
        if let Some(layer) = look.emission.as_ref().filter(shares_places) {
            facet = facet.emitting(layer.mean_over(&part.corners));
        }
        if let Some(layer) = look.base.as_ref().filter(shares_places) {
            let vertex = piece.facet.vertex_colour(&layer.mean_over(&places));
            facet = facet.coloured(layer.mean_over(&part.corners), vertex);
        }
        let area = part.area * piece.area / texels;
        Piece { corners: part.corners.iter().map(point).collect(), facet, area }
    };
    found.into_iter().map(part).collect()
}

/// Which of these block light: as many, those that cover most first, as cover the same area in all.
fn blocking(pieces: &[Piece]) -> Vec<bool> {
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
