//! Files in: .glb and .gltf files become scenes here, files of View3D in `view3d`, meshes at rest in `mesh_file`.
//!
//! Reads and translates; what makes a scene valid is `assemble`'s. Whatever is wrong with a file
//! is an error that names the node or mesh and the remedy, never a panic. Must not know light
//! transport.

use std::path::Path;

mod accessor;
mod animation;
mod base64;
mod chart;
mod clock;
mod document;
mod draco;
mod facet;
mod guard;
mod images;
mod json;
mod light;
mod look;
mod material;
mod mesh;
mod meshopt;
#[cfg(test)]
mod packed;
mod parts;
mod pieces;
mod sizes;
mod skin;
mod tree;

use document::Document;

use super::assemble::assemble;
use super::mesh_file::Format;
use super::{Edits, Note, Scene, SceneError, Severity, mesh_file, view3d};

/// What to read of a file.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Name of the one animation to play; `None` plays all together, as exporters that write one
    /// for each object mean it, but of those that move the same properties the first alone.
    pub animation: Option<String>,
    /// Whether buffers and images may be anywhere: outside the file's folder, and devices or pipes.
    pub allow_outside: bool,
    /// Whether images are kept for pictures, as [`super::Patch::print`]; the solution does not need them.
    pub pictures: bool,
    /// Bytes that a file, an image or a list of numbers may need, each by itself: what needs more is refused
    /// before memory is asked for. `None` for no limit.
    pub max_memory_bytes: Option<u64>,
    /// What of the scene is changed before it is built.
    pub edits: Edits,
}

/// Reads a scene from a .glb or .gltf file (glTF 2.0; external, embedded and compressed buffers), a .vs3 file
/// of View3D, or an .obj, .stl or .ply file.
///
/// Of the last three: a body at rest for each object or group, in metres as the numbers are. Materials of OBJ have Kd
/// as reflectance and Ke as radiance in W/m2/sr; what has none is a middle grey; all but what emits is double-sided.
/// Of View3D: one body at rest with a surface for each of the file's, in its order and by its name;
/// reflectance is 1 minus emittance, subsurfaces and null surfaces are cut out of their base, combined
/// surfaces are one, obstructions are in [`Scene::obstructions`]. Of glTF:
///
/// Units are metres, seconds and W: emissive factors are radiances in W/m2/sr, punctual lights are
/// converted ([`super::Light::conversion`]). Emissions and visibility may be animated
/// (KHR_animation_pointer). Extensions without effect on diffuse light are
/// ignored; what is read otherwise than the file says is in [`Scene::notes`]. Skins whose triangles hang on one
/// joint each move with their joints; other skins are held in their pose at the start, moving morph targets in their
/// rest shape, and scales that change at their first size, each with a warning that names the node. Only files in the scene's own folder and below are opened,
/// unless [`ImportOptions::allow_outside`] says otherwise.
///
/// # Errors
/// A file that is missing, damaged or needs what is not supported, a
/// scene without polygons: each names the file, node or mesh, and the remedy.
pub fn import(path: impl AsRef<Path>, options: &ImportOptions) -> Result<Scene, SceneError> {
    let path = path.as_ref();
    if view3d::is_view3d(path) {
        return match &options.animation {
            None => view3d::import(path, options),
            Some(name) => Err(no_animation(name, "View3D")),
        };
    }
    if let Some(format) = Format::of(path) {
        return match &options.animation {
            None => mesh_file::import(path, format, options),
            Some(name) => Err(no_animation(name, format.name())),
        };
    }
    let document = Document::open(path, options)?;
    let mut draft = tree::draft(&document, options)?;
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
    draft.name = stem.unwrap_or_else(|| document.file.clone());
    draft.edits = options.edits.clone();
    assemble(draft)
}

fn no_animation(name: &str, format: &str) -> SceneError {
    SceneError::Animation {
        animation: name.to_owned(),
        what: format!("files of {format} have no animation"),
        remedy: "leave out --animation".into(),
    }
}

/// A note in one line.
fn note(
    severity: Severity,
    code: &'static str,
    subject: &str,
    count: usize,
    message: String,
) -> Note {
    Note { severity, code, subject: subject.to_owned(), count, message }
}

/// The node's name, or that of what it shows, or its number.
fn node_name(document: &Document, index: usize) -> String {
    let node = document.root.nodes.get(index);
    let named = |name: &Option<String>| name.clone().filter(|n| !n.is_empty());
    let of_mesh = || {
        node.and_then(|n| n.mesh)
            .and_then(|m| document.root.meshes.get(m))
            .and_then(|m| named(&m.name))
    };
    node.and_then(|n| named(&n.name)).or_else(of_mesh).unwrap_or_else(|| format!("node {index}"))
}
