//! Files that hold meshes and nothing that moves: Wavefront OBJ with its materials, STL, PLY.
//!
//! Coordinates are taken as metres, whatever axis is up. Each object or group is a body of its own. Reads and
//! translates; what makes a scene valid is [`Scene::from_draft`]'s. Must not know light transport.

use std::borrow::Cow;
use std::path::Path;

use glam::{DQuat, DVec2, DVec3};

use crate::ImportOptions;
use crate::folder::{Folder, read_scene};
use crate::range::{first_out_of_range, of_points, out_of_range, said};
use crate::surface::Tints;
use crate::tuning::REFLECTANCE_OF_NONE;
use paint::Paint;
use relume_core::scene::draft::{Draft, DraftNode};
use relume_core::scene::limits::is_place;
use relume_core::scene::{Material, MaterialId, Note, Scene, SceneError, Severity};

mod mtl;
mod obj;
mod paint;
mod ply;
mod polygon;
mod stl;

/// Corners of all polygons of a file at most: above any scene that can be solved.
const CORNERS_MAX: usize = 1 << 24;

/// The formats that are read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Obj,
    Stl,
    Ply,
}

impl Format {
    /// The format of a file, by its name.
    pub(super) fn of(path: &Path) -> Option<Format> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "obj" => Some(Format::Obj),
            "stl" => Some(Format::Stl),
            "ply" => Some(Format::Ply),
            _ => None,
        }
    }

    /// As messages call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Format::Obj => "OBJ",
            Format::Stl => "STL",
            Format::Ply => "PLY",
        }
    }
}

/// What a file holds.
#[derive(Default)]
struct Contents {
    objects: Vec<Object>,
    /// Whether there are any vertices, also where no polygon has them.
    has_vertices: bool,
    materials: Vec<Material>,
    /// Images of the materials, where they have any; as many, or none.
    paints: Vec<Option<Paint>>,
    notes: Vec<Note>,
}

/// An object or group: polygons of one or several materials.
struct Object {
    name: String,
    parts: Vec<Part>,
}

/// Polygons of one material.
struct Part {
    /// `None` for the one that things without a material get.
    material: Option<usize>,
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the points, from the lower edge of images.
    places: Option<Vec<DVec2>>,
    /// Linear colours of the points.
    colours: Option<Vec<[f64; 3]>>,
}

/// Reads a scene at rest.
///
/// # Errors
/// A file that is missing, damaged, too large or without polygons, with its name and the remedy.
pub(super) fn import(
    path: &Path,
    format: Format,
    options: &ImportOptions,
) -> Result<Scene, SceneError> {
    let folder = Folder {
        file: path.display().to_string(),
        directory: path.parent().unwrap_or(Path::new("")).to_owned(),
        allow_outside: options.allow_outside,
        max_memory_bytes: options.max_memory_bytes,
    };
    let (mut bytes, stem) = read_scene(path, options.max_memory_bytes)?;
    if format == Format::Obj
        && let Cow::Owned(text) = mtl::text(&bytes)
    {
        bytes = text.into_bytes();
    }
    let out_of_range = match format {
        Format::Obj => first_out_of_range(&bytes, "v"),
        Format::Stl => first_out_of_range(&bytes, "vertex"),
        Format::Ply => ply::vertex_out_of_range(&bytes),
    };
    if let Some(found) = out_of_range {
        return Err(SceneError::Mesh {
            file: folder.file,
            format: format.name(),
            what: said(found),
            remedy: "repair the mesh, or scale it to metres, and export it again".into(),
        });
    }
    let contents = match format {
        Format::Obj => obj::read(&bytes, &stem, &folder),
        Format::Stl => stl::read(bytes, &stem, &folder),
        Format::Ply => ply::read(&bytes, &stem, &folder),
    }?;
    let mut parts = contents.objects.iter().flat_map(|o| &o.parts);
    if contents.has_vertices && parts.all(|p| p.triangles.is_empty()) {
        return Err(of_points(stem));
    }
    let draft = draft(contents, stem, (format, options.pictures))?;
    let edits = options.edits.clone();
    Scene::from_draft(Draft { edits, near_origin: options.near_origin, ..draft })
}

/// An error about the content of a file.
fn damaged(folder: &Folder, format: Format, what: impl std::fmt::Display) -> SceneError {
    SceneError::Mesh {
        file: folder.file.clone(),
        format: format.name(),
        what: what.to_string(),
        remedy: "repair the file or export it again".into(),
    }
}

/// A node for each object.
fn draft(
    contents: Contents,
    name: String,
    (format, pictures): (Format, bool),
) -> Result<Draft, SceneError> {
    let Contents { objects, mut materials, paints, mut notes, .. } = contents;
    let none = materials.len();
    let is_bare = |p: &&Part| p.material.is_none() && p.colours.is_none();
    let parts = || objects.iter().flat_map(|o| &o.parts);
    let bare = parts().filter(is_bare).count();
    if bare > 0 {
        let message = format!(
            "surfaces without a material: {bare}; they get reflectance {REFLECTANCE_OF_NONE} on both sides"
        );
        notes.push(info("no-material", "no material", bare, message));
    }
    if parts().any(|p| p.material.is_none()) {
        materials.push(grey());
    }
    let message =
        format!("{} has no units and no up: coordinates are taken as metres", format.name());
    notes.push(info("units", &name, 1, message));
    let mut tints = Tints::default();
    let unpainted = |material: usize| Paint {
        factor: materials
            .get(material)
            .filter(|_| material < none)
            .map_or([1.0; 3], |m| m.reflectance),
        ..Paint::default()
    };
    let mut nodes = Vec::new();
    for object in objects {
        let mut node = DraftNode::still(&object.name, None, DVec3::ZERO, DQuat::IDENTITY);
        for part in object.parts {
            check_places(&part.points, &object.name)?;
            let material = part.material.unwrap_or(none);
            let paint = paints.get(material).cloned().flatten();
            let paint = paint.unwrap_or_else(|| unpainted(material));
            let id = MaterialId(material as u32);
            let (surface, degenerate) = paint::surface(&part, id, &paint, (&mut tints, pictures));
            if degenerate > 0 {
                let all = part.triangles.len();
                let message = format!(
                    "{degenerate} of {all} triangles have no area or repeat another and were left out"
                );
                notes.push(info("degenerate", &object.name, degenerate, message));
            }
            node.surfaces.push(surface);
        }
        nodes.push(node);
    }
    Ok(Draft { name, nodes, materials, tints: tints.finish(), notes, ..Draft::default() })
}

fn grey() -> Material {
    Material {
        name: "no material".into(),
        reflectance: [REFLECTANCE_OF_NONE; 3],
        exitance: [0.0; 3],
        glow: None,
        double_sided: true,
    }
}

fn check_places(points: &[DVec3], object: &str) -> Result<(), SceneError> {
    match points.iter().find(|p| !is_place(&p.to_array())) {
        None => Ok(()),
        Some(p) => Err(SceneError::Geometry {
            subject: format!("object `{object}`"),
            what: format!("a vertex is at {}", out_of_range(*p)),
            remedy: "repair the mesh and export it again".into(),
        }),
    }
}

fn info(code: &'static str, subject: &str, count: usize, message: String) -> Note {
    Note { severity: Severity::Info, code, subject: subject.to_owned(), count, message }
}

fn warning(code: &'static str, subject: &str, count: usize, message: String) -> Note {
    Note { severity: Severity::Warning, ..info(code, subject, count, message) }
}
