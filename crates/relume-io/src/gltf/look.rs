//! How surfaces of a file look: primitives to polygons with their tints, by textures, vertex colours and alpha.
//!
//! Reads what it needs of the file; must not know nodes or placements.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::document::Document;
use super::images::{Images, Key};
use super::material::Paint;
use super::{json, note};
use crate::surface::facet::{Facet, Layer, Look};
use crate::surface::pieces::{Pieces, blocking, pieces};
use crate::surface::{Mesh, Tints, resolution};
use crate::tuning::REFLECTANCE_MAX;
use relume_core::scene::coverage::Wrap;
use relume_core::scene::merge::{Merged, merge};
use relume_core::scene::{Note, Print, SceneError, Severity, Tint, TintId};

/// Polygons with what they are made of.
#[derive(Default)]
pub(super) struct Painted {
    pub(super) loops: Vec<Vec<DVec3>>,
    /// As many as `loops`.
    pub(super) tints: Vec<Option<TintId>>,
    /// Images to be shown on the polygons; likewise.
    pub(super) prints: Vec<Option<Arc<Print>>>,
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

/// Bytes of images that pictures show at most: primitives that come after show their means.
const SHOWN_MAX: usize = 512 << 20;

/// What becomes of surfaces that let all light pass.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Clear {
    LeftOut,
    /// They block light, as all others do.
    Opaque,
}

/// How all surfaces of a file look.
pub(super) struct Looks<'a> {
    document: &'a Document,
    /// Whether images are kept for pictures.
    pictures: bool,
    /// By material; the last one is for primitives without any.
    paints: Vec<Paint>,
    images: Images<'a>,
    tints: Tints,
    /// Materials that were lowered to [`REFLECTANCE_MAX`], and the highest that was.
    lowered: (BTreeSet<usize>, f64),
    /// Materials with textures or vertex colours.
    varied: BTreeSet<usize>,
    see_through: SeenThrough,
    clear: Clear,
    /// Images kept for pictures, and their bytes.
    shown: (BTreeSet<Key>, usize),
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

impl<'a> Looks<'a> {
    pub(super) fn new(
        document: &'a Document,
        mut paints: Vec<Paint>,
        pictures: bool,
        clear: Clear,
    ) -> Looks<'a> {
        if clear == Clear::Opaque {
            paints.iter_mut().for_each(|paint| paint.see_through = None);
        }
        Looks {
            clear,
            document,
            pictures,
            paints,
            images: Images::new(document),
            tints: Tints::default(),
            lowered: Default::default(),
            varied: BTreeSet::new(),
            see_through: SeenThrough::default(),
            shown: Default::default(),
            said: BTreeSet::new(),
        }
    }

    /// Whether polygons that let all light pass were left out so far.
    pub(super) fn leaves_out(&self) -> bool {
        self.see_through.left_out > 0
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
        let mesh = Mesh { points: of.points, triangles: of.triangles };
        let pieces = pieces(&look, &mesh, self.paints[material].see_through.is_some());
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
        let count = loops.len();
        Painted { tints: vec![None; count], prints: vec![None; count], loops, degenerate }
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
            painted.tints.push(Some(self.tint(material, &piece.facet)));
            painted.loops.push(piece.corners);
            painted.prints.push(piece.print);
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
        self.tints.number(Tint { reflectance, emission })
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
        let is_opaque = paint.see_through.is_none();
        let colours = match self.colours(of)? {
            Some(colours) if is_opaque && is_mask(&colours) => {
                self.note_mask(material, notes);
                None
            }
            colours => colours,
        };
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
        let pictured = (self.shown.1 <= SHOWN_MAX).then_some(paint.base_factor);
        let pictured = pictured.filter(|_| self.pictures);
        Ok(Look { base, emission, colours, least_vertex_alpha, pictured })
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
        if source.is_some_and(|image| self.shown.0.insert((image, least_alpha))) {
            self.shown.1 += pyramid.bytes();
        }
        let sampler = entry.sampler.and_then(|s| root.samplers.get(s));
        let wrap = [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap);
        let resolution = resolution(of.triangles.len());
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

    /// Says once of a material that vertex colours of what has it are left out.
    fn note_mask(&mut self, material: usize, notes: &mut Vec<Note>) {
        if self.said.insert((material, "vertex colours")) {
            let message =
                "its vertex colours are black with an alpha of 0 at more than half of the vertices, as what is not painted is \
                 written: they are taken for a mask and left out"
                    .to_owned();
            let name = &self.paints[material].name;
            notes.push(note(Severity::Warning, "vertex-colours", name, 1, message));
        }
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
        if self.clear == Clear::Opaque {
            let all = (0..self.paints.len() - 1).collect();
            let message = "all surfaces let light pass (alphaMode, KHR_materials_transmission), so that nothing would be left: they \
                           block it here, in their base colour";
            say(Severity::Warning, "transparency", &all, message.to_owned());
        }
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
        self.tints.finish()
    }
}

impl SeenThrough {
    fn count(&mut self, material: usize, polygons: usize, is_open: bool) {
        self.materials.insert(material);
        *(if is_open { &mut self.left_out } else { &mut self.opaque }) += polygons;
    }
}

/// Whether more than half of vertex colours are zero, alpha and all: of what is opaque that is no colour.
fn is_mask(colours: &[[f64; 4]]) -> bool {
    2 * colours.iter().filter(|c| **c == [0.0; 4]).count() > colours.len()
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
