//! glTF files in (`.glb`, `.gltf`): buffers, images, meshes, skins, lights, cameras and animation.
//!
//! Reads and translates; what makes a scene valid is [`Scene::from_draft`](relume_core::scene::Scene::from_draft)'s. Whatever
//! is wrong with a file is an error that names the node or mesh and the remedy, never a panic.

use std::path::Path;

mod accessor;
mod animation;
mod clock;
mod component;
mod counts;
mod document;
mod draco;
mod environment;
mod images;
mod json;
mod light;
mod look;
mod material;
mod mesh;
mod meshopt;
#[cfg(test)]
mod packed;
mod sizes;
mod skin;
mod skinned;
mod streams;
mod tree;

use document::Document;

use crate::ImportOptions;
use crate::range::of_points;
use relume_core::scene::draft::Draft;
use relume_core::scene::{Note, SceneError, Severity};

/// What a file holds, unchecked.
///
/// # Errors
/// A file that is missing, damaged or needs what is not supported, with its name and the remedy.
pub(super) fn draft(path: &Path, options: &ImportOptions) -> Result<Draft, SceneError> {
    let document = Document::open(path, options)?;
    let mut draft = tree::draft(&document, options)?;
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
    draft.name = stem.unwrap_or_else(|| document.file.clone());
    unless_of_points(&document, &draft)?;
    Ok(draft)
}

/// An error where nothing that is shown has a surface, for all of it is points or lines.
fn unless_of_points(document: &Document, draft: &Draft) -> Result<(), SceneError> {
    let drawn = || document.root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let is_without_area = |mode: Option<u32>| mode.is_some_and(|mode| mode < 4);
    let has_surfaces = draft.nodes.iter().any(|node| !node.surfaces.is_empty());
    if has_surfaces || drawn().next().is_none() || !drawn().all(|p| is_without_area(p.mode)) {
        return Ok(());
    }
    Err(of_points(draft.name.clone()))
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
