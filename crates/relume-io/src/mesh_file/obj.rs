//! Wavefront OBJ: objects or groups of polygons, and materials of MTL files beside it.
//!
//! Of a material Kd is the reflectance and Ke the radiance that it emits, W/m2/sr, as `emissiveFactor` of glTF is.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::io::Cursor;
use std::path::Path;

use glam::DVec3;
use tobj::{LoadError, LoadOptions};

use super::{CORNERS_MAX, Contents, Format, Object, Part, damaged, info, polygon, warning};
use crate::folder::Folder;
use relume_core::scene::{Material, Note, SceneError};

/// The largest reflectance that is taken from a file; see the materials of glTF.
const REFLECTANCE_MAX: f64 = 0.98;

/// Bytes of the largest MTL file that is read.
const MTL_MAX: usize = 1 << 26;

pub(super) fn read(bytes: &[u8], stem: &str, folder: &Folder) -> Result<Contents, SceneError> {
    let text = String::from_utf8_lossy(bytes);
    let options = LoadOptions { ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    let library = Library { folder, notes: RefCell::default(), refused: RefCell::default() };
    let mut source = Cursor::new(text.as_bytes());
    let loaded = tobj::load_obj_buf(&mut source, &options, |path| library.load(path));
    let Library { notes, refused, .. } = library;
    if let Some(error) = refused.into_inner() {
        return Err(error);
    }
    let (models, materials) = loaded.map_err(|e| damaged(folder, Format::Obj, e))?;
    let mut contents = Contents { notes: notes.into_inner(), ..Contents::default() };
    for material in materials.unwrap_or_default() {
        let translated = translated(&material, &mut contents.notes);
        contents.materials.push(translated);
    }
    grey_if_all_black(&mut contents, stem);
    let mut corners = 0;
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for model in models {
        let unnamed = model.name == "unnamed_object" || model.name.is_empty();
        let name = if unnamed { stem.to_owned() } else { model.name };
        corners += model.mesh.indices.len();
        if corners > CORNERS_MAX {
            let what = format!("its polygons have more than {CORNERS_MAX} corners");
            return Err(damaged(folder, Format::Obj, what));
        }
        let part = part(&model.mesh, contents.materials.len())
            .map_err(|what| damaged(folder, Format::Obj, format!("object `{name}`: {what}")))?;
        if part.triangles.is_empty() {
            continue;
        }
        let next = contents.objects.len();
        let place = *places.entry(name.clone()).or_insert(next);
        if place == next {
            contents.objects.push(Object { name, parts: Vec::new() });
        }
        add(&mut contents.objects[place], part);
    }
    Ok(contents)
}

/// Where no material reflects or emits anything, as exporters write what they do not know, all get the grey of what has none.
fn grey_if_all_black(contents: &mut Contents, stem: &str) {
    let is_black = |m: &Material| m.reflectance == [0.0; 3] && m.exitance == [0.0; 3];
    if contents.materials.is_empty() || !contents.materials.iter().all(is_black) {
        return;
    }
    let count = contents.materials.len();
    let message = format!(
        "all materials are black (Kd 0 0 0), and are taken as reflecting {}; give them their Kd",
        super::REFLECTANCE
    );
    contents.notes.push(warning("black", stem, count, message));
    for material in &mut contents.materials {
        material.reflectance = [super::REFLECTANCE; 3];
    }
}

/// Adds a part, to what is there of its material already.
fn add(object: &mut Object, part: Part) {
    let Some(same) = object.parts.iter_mut().find(|p| p.material == part.material) else {
        object.parts.push(part);
        return;
    };
    let first = same.points.len() as u32;
    same.points.extend(part.points);
    same.triangles.extend(part.triangles.into_iter().map(|t| t.map(|c| c + first)));
}

/// Files of materials, and what became of them.
struct Library<'a> {
    folder: &'a Folder,
    notes: RefCell<Vec<Note>>,
    /// The first that may not be opened.
    refused: RefCell<Option<SceneError>>,
}

impl Library<'_> {
    fn load(&self, path: &Path) -> tobj::MTLLoadResult {
        let name = path.to_string_lossy().into_owned();
        let missing = |what: String| {
            let message = format!("{what}; what uses it gets no material");
            self.notes.borrow_mut().push(warning("material-file", &name, 1, message));
            Err(LoadError::OpenFileFailed)
        };
        match self.folder.read(&name, "a material file", MTL_MAX) {
            Ok(bytes) => {
                let text = String::from_utf8_lossy(&bytes);
                tobj::load_mtl_buf(&mut Cursor::new(text.as_bytes()))
                    .or_else(|e| missing(format!("the file of materials cannot be read ({e})")))
            }
            Err(SceneError::Read { source, .. }) => {
                missing(format!("the file of materials cannot be read ({source})"))
            }
            Err(error) => {
                self.refused.borrow_mut().get_or_insert(error);
                Err(LoadError::OpenFileFailed)
            }
        }
    }
}

/// The triangles of a mesh, with its own points only.
fn part(mesh: &tobj::Mesh, materials: usize) -> Result<Part, String> {
    let points: Vec<DVec3> = mesh.positions.chunks_exact(3).map(DVec3::from_slice).collect();
    if let Some(bad) = mesh.indices.iter().find(|&&c| c as usize >= points.len()) {
        return Err(format!("corner {bad} is none of its {} vertices", points.len()));
    }
    let mut triangles = Vec::new();
    let mut rest = mesh.indices.as_slice();
    let arities = mesh.face_arities.iter().map(|&n| n as usize);
    let all_triangles = mesh.indices.len() / 3;
    let plain =
        std::iter::repeat_n(3, if mesh.face_arities.is_empty() { all_triangles } else { 0 });
    for corners in arities.chain(plain) {
        let Some((polygon, others)) = rest.split_at_checked(corners) else { break };
        rest = others;
        let cut = polygon::triangles(&points, polygon).ok_or_else(|| {
            format!("a polygon of {corners} corners is not convex: cut it into triangles")
        })?;
        triangles.extend(cut);
    }
    let material = mesh.material_id.filter(|&m| m < materials);
    Ok(Part { material, points, triangles })
}

/// A material. What emits has a front, all else is seen from both sides.
fn translated(material: &tobj::Material, notes: &mut Vec<Note>) -> Material {
    let name = material.name.clone();
    let finite = |c: [f64; 3]| c.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
    let stated = finite(material.diffuse.unwrap_or([super::REFLECTANCE; 3]));
    let reflectance = stated.map(|c| c.min(REFLECTANCE_MAX));
    if stated != reflectance {
        let message = format!("its reflectance {stated:?} is taken as {REFLECTANCE_MAX} at most");
        notes.push(warning("reflectance", &name, 1, message));
    }
    let mut reflectance = reflectance;
    if let Some(texture) = &material.diffuse_texture {
        let message = if stated == [0.0; 3] {
            // The texture alone was meant.
            reflectance = [super::REFLECTANCE; 3];
            format!("its texture {texture} is not read, and its Kd is black: it is grey")
        } else {
            format!("its texture {texture} is not read: Kd counts alone")
        };
        notes.push(warning("texture", &name, 1, message));
    }
    if material.dissolve.is_some_and(|d| d < 1.0) {
        let message = "it lets light through, which is ignored: it is opaque".to_owned();
        notes.push(info("transparency", &name, 1, message));
    }
    let radiance = finite(material.emissive.unwrap_or_default());
    let emits = radiance.iter().any(|&c| c > 0.0);
    let exitance = radiance.map(|c| c * PI);
    Material { name, reflectance, exitance, glow: None, double_sided: !emits }
}
