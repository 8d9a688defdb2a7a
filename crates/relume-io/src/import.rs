//! Scenes from files: which reader a file is for, by its name.
//!
//! Must not know what is in files.

use std::path::Path;

use crate::mesh_file::Format;
use crate::options::ImportOptions;
use crate::{gltf, mesh_file, view3d};
use relume_core::scene::draft::Draft;
use relume_core::scene::{Scene, SceneError};

/// Reads a scene from a .glb or .gltf file (glTF 2.0; external, embedded and compressed buffers), a .vs3 file
/// of View3D, or an .obj, .stl or .ply file.
///
/// - glTF: units are metres, seconds and W. Emissive factors are radiances in W/m2/sr, punctual lights are converted
///   ([`Light::conversion`](relume_core::scene::Light::conversion)). Emissions and visibility may be animated
///   (KHR_animation_pointer). Extensions without effect on diffuse light are ignored. Skins whose triangles hang on one joint
///   each move with their joints; other skins are held in their pose at the start, moving morph targets in their rest shape,
///   unless [`ImportOptions::rebuild`] reads them anew for each frame, and scales that change at their first size, each with a
///   warning that names the node.
/// - OBJ, STL, PLY: a body at rest for each object or group; coordinates are metres. Materials of OBJ have Kd as reflectance and
///   Ke as radiance in W/m2/sr, times their images; surfaces without a material are a middle grey, or have the colours of their
///   vertices; all surfaces that do not emit are double-sided.
/// - View3D: one body at rest with a surface for each of the file's, in the file's order and by the file's names. Reflectance is 1
///   minus emittance; subsurfaces and null surfaces are cut out of their base, combined surfaces are one, obstructions are in
///   [`Scene::obstructions`].
///
/// Where the scene differs from the file, [`Scene::notes`] says so. Only files in the scene's own folder and below are opened,
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
    let draft = gltf::draft(path, options)?;
    let edits = options.edits.clone();
    Scene::from_draft(Draft { edits, near_origin: options.near_origin, ..draft })
}

fn no_animation(name: &str, format: &str) -> SceneError {
    SceneError::Animation {
        animation: name.to_owned(),
        what: format!("files of {format} have no animation"),
        remedy: "leave out `ImportOptions::animation`".into(),
    }
}
