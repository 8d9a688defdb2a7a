//! Wavefront OBJ: objects or groups of polygons, and materials of MTL files beside it.
//!
//! Of a material Kd is the reflectance and Ke the radiance that it emits, W/m2/sr, as `emissiveFactor` of glTF is, both times
//! their images; what d, times its image, leaves below a half lets light pass.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::io::Cursor;
use std::path::Path;

use glam::{DVec2, DVec3};
use tobj::{LoadError, LoadOptions};

use super::mtl::Textures;
use super::paint::{apart, linear};
use super::{CORNERS_MAX, Contents, Format, Object, Part, damaged, mtl, polygon, warning};
use crate::folder::Folder;
use crate::tuning::{REFLECTANCE_MAX, REFLECTANCE_OF_NONE};
use relume_core::scene::{Material, Note, SceneError};

/// As messages call it.
const MATERIAL_FILE: &str = "a material file";

/// Bytes of the largest MTL file that is read.
const MTL_MAX: usize = 1 << 26;

pub(super) fn read(bytes: &[u8], stem: &str, folder: &Folder) -> Result<Contents, SceneError> {
    let (text, names) = with_names(&String::from_utf8_lossy(bytes));
    let options = LoadOptions { ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    let library = Library::new(folder, names);
    let mut source = Cursor::new(text.as_bytes());
    let loaded = tobj::load_obj_buf(&mut source, &options, |path| library.load(path));
    let Library { names, notes, refused, elsewhere, .. } = library;
    if let Some(error) = refused.into_inner() {
        return Err(error);
    }
    let (models, materials) = loaded.map_err(|e| damaged(folder, Format::Obj, e))?;
    let has_vertices = text.lines().any(|line| line.split_whitespace().next() == Some("v"));
    let mut contents = Contents { notes: notes.into_inner(), has_vertices, ..Contents::default() };
    let materials = materials.unwrap_or_default();
    let named = names.len();
    let numbers = used_or_defined(&models, &materials, named, (stem, &mut contents.notes));
    let mut textures = Textures::new(folder, elsewhere.into_inner());
    let mut order: Vec<usize> = (0..materials.len()).filter(|&m| numbers[m].is_some()).collect();
    order.sort_by_key(|&m| numbers[m]);
    for material in order.into_iter().map(|m| &materials[m]) {
        let mut translated = translated(material, &mut contents.notes);
        let paint = textures.paint(material, &translated, &mut contents.notes)?;
        if paint.as_ref().is_none_or(|paint| paint.base.is_none()) && mtl::is_image_alone(material)
        {
            translated.reflectance = [REFLECTANCE_OF_NONE; 3];
        }
        contents.materials.push(translated);
        contents.paints.push(paint);
    }
    let defined = materials.len().saturating_sub(named);
    grey_if_all_black(&mut contents, defined, stem);
    add_models(&mut contents, models, &numbers, (stem, folder))?;
    Ok(contents)
}

/// Adds an object for each name, with the polygons of all models of that name.
fn add_models(
    contents: &mut Contents,
    models: Vec<tobj::Model>,
    numbers: &[Option<usize>],
    (stem, folder): (&str, &Folder),
) -> Result<(), SceneError> {
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
        let material = model.mesh.material_id.and_then(|m| numbers.get(m).copied().flatten());
        let is_painted = material.is_some_and(|m| contents.paints[m].is_some());
        let part = part(&model.mesh, material, is_painted)
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
    Ok(())
}

/// The file of materials that stands for the names that the scene file uses.
const NAMES: &str = "\u{1}";

/// What a surface uses whose material has no name.
const NAMELESS: &str = "(unnamed)";

/// The text with a first file of materials, [`NAMES`], and the names that it uses, each once: what no file defines keeps
/// its name, and what has none gets one.
fn with_names(text: &str) -> (String, Vec<String>) {
    let mut names: Vec<String> = Vec::new();
    let mut out = format!("mtllib {NAMES}\n");
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if words.next() != Some("usemtl") {
            out.push_str(line);
        } else {
            let rest = line.split_once("usemtl").map_or("", |(_, rest)| rest.trim());
            let name = if rest.is_empty() { NAMELESS } else { rest };
            out.push_str("usemtl ");
            out.push_str(name);
            names.push(name.to_owned());
        }
        out.push('\n');
    }
    names.sort();
    names.dedup();
    (out, names)
}

/// For each material its number among those that files define or surfaces use; the first `named` are those of [`NAMES`].
fn used_or_defined(
    models: &[tobj::Model],
    materials: &[tobj::Material],
    named: usize,
    (stem, notes): (&str, &mut Vec<Note>),
) -> Vec<Option<usize>> {
    let mut kept: Vec<bool> = (0..materials.len()).map(|m| m >= named).collect();
    for material in models.iter().filter_map(|model| model.mesh.material_id) {
        kept[material] = true;
    }
    let undefined: Vec<&str> = (0..named.min(materials.len()))
        .filter(|&m| kept[m] && materials[m].name != NAMELESS)
        .map(|m| materials[m].name.as_str())
        .collect();
    if !undefined.is_empty() {
        let message = format!(
            "no file defines these materials, which are grey (reflectance {}): {}; put the .mtl file beside it, or change them with \
             `ImportOptions::edits`",
            REFLECTANCE_OF_NONE,
            undefined.join(", ")
        );
        notes.push(warning("material-undefined", stem, undefined.len(), message));
    }
    // Those that files define come first.
    let order = (named..materials.len()).chain(0..named.min(materials.len()));
    let mut numbers = vec![None; materials.len()];
    for (number, material) in order.filter(|&m| kept[m]).enumerate() {
        numbers[material] = Some(number);
    }
    numbers
}

/// Where none of the first `defined` materials reflects or emits anything, as exporters write what they do not know, all get the grey of what has none.
fn grey_if_all_black(contents: &mut Contents, defined: usize, stem: &str) {
    let is_black = |m: &Material| m.reflectance == [0.0; 3] && m.exitance == [0.0; 3];
    let materials = &mut contents.materials[..defined];
    if materials.is_empty() || !materials.iter().all(is_black) {
        return;
    }
    let count = materials.len();
    let message = format!(
        "all materials are black (Kd 0 0 0), and are taken as reflecting {}; give them their Kd",
        REFLECTANCE_OF_NONE
    );
    contents.notes.push(warning("black", stem, count, message));
    for material in materials {
        material.reflectance = [REFLECTANCE_OF_NONE; 3];
    }
}

/// Adds a part, to what is there of its material already.
fn add(object: &mut Object, part: Part) {
    let is_same = |p: &&mut Part| {
        p.material == part.material
            && p.places.is_some() == part.places.is_some()
            && p.colours.is_some() == part.colours.is_some()
    };
    let Some(same) = object.parts.iter_mut().find(is_same) else {
        object.parts.push(part);
        return;
    };
    let first = same.points.len() as u32;
    same.points.extend(part.points);
    if let (Some(same), Some(more)) = (&mut same.places, part.places) {
        same.extend(more);
    }
    if let (Some(same), Some(more)) = (&mut same.colours, part.colours) {
        same.extend(more);
    }
    same.triangles.extend(part.triangles.into_iter().map(|t| t.map(|c| c + first)));
}

/// Files of materials, and what became of them.
struct Library<'a> {
    folder: &'a Folder,
    /// See [`with_names`].
    names: Vec<String>,
    notes: RefCell<Vec<Note>>,
    /// Folders of those that are not beside the scene file, with a slash at the end.
    elsewhere: RefCell<Vec<String>>,
    /// The first that may not be opened.
    refused: RefCell<Option<SceneError>>,
}

impl Library<'_> {
    fn new(folder: &Folder, names: Vec<String>) -> Library<'_> {
        let (notes, elsewhere, refused) = Default::default();
        Library { folder, names, notes, elsewhere, refused }
    }

    fn load(&self, path: &Path) -> tobj::MTLLoadResult {
        let name = path.to_string_lossy().into_owned();
        if name == NAMES {
            let text: String = self.names.iter().map(|name| format!("newmtl {name}\n")).collect();
            return tobj::load_mtl_buf(&mut Cursor::new(text.as_bytes()));
        }
        let missing = |name: &str, what: String| {
            let message = format!("{what}; what uses its materials is grey");
            self.notes.borrow_mut().push(warning("material-file", name, 1, message));
        };
        // A name may have spaces, and a line may have several names.
        let whole = mtl::file_name(&name);
        let names = match self.folder.read(&whole, MATERIAL_FILE, MTL_MAX) {
            Err(SceneError::Read { .. }) => mtl::file_names(&name),
            _ => vec![whole],
        };
        let mut all = String::new();
        for name in &names {
            match self.folder.read(name, MATERIAL_FILE, MTL_MAX) {
                Ok(bytes) => {
                    all.push_str(&mtl::with_values(&mtl::text(&bytes)));
                    all.push('\n');
                    if let Some(end) = name.rfind('/') {
                        self.elsewhere.borrow_mut().push(name[..=end].to_owned());
                    }
                }
                Err(SceneError::Read { source, .. }) => {
                    missing(name, format!("the file of materials cannot be read ({source})"));
                }
                Err(error) => {
                    self.refused.borrow_mut().get_or_insert(error);
                    return Err(LoadError::OpenFileFailed);
                }
            }
        }
        tobj::load_mtl_buf(&mut Cursor::new(all.as_bytes())).inspect_err(|e| {
            missing(&name, format!("the file of materials cannot be read ({e})"));
        })
    }
}

/// The triangles of a mesh, with its own points only; where its material has images a point for each corner, with texture
/// coordinates.
fn part(mesh: &tobj::Mesh, material: Option<usize>, is_painted: bool) -> Result<Part, String> {
    let points: Vec<DVec3> = mesh.positions.chunks_exact(3).map(DVec3::from_slice).collect();
    if let Some(bad) = mesh.indices.iter().find(|&&c| c as usize >= points.len()) {
        return Err(format!("corner {bad} is none of its {} vertices", points.len()));
    }
    let colours: Vec<[f64; 3]> =
        mesh.vertex_color.chunks_exact(3).map(|c| linear([c[0], c[1], c[2]])).collect();
    // Of all vertices or of none.
    let colours =
        Some(colours).filter(|c| c.len() == points.len() && c.iter().any(|c| *c != [1.0; 3]));
    let mut part = Part { material, points, triangles: Vec::new(), places: None, colours };
    let mut indices = mesh.indices.clone();
    if is_painted && mesh.texcoord_indices.len() == indices.len() {
        let places: Vec<DVec2> = mesh.texcoords.chunks_exact(2).map(DVec2::from_slice).collect();
        let place = |&k: &u32| places.get(k as usize).copied().filter(|p| p.is_finite());
        let placed: Option<Vec<DVec2>> = mesh.texcoord_indices.iter().map(place).collect();
        part.points = apart(&part.points, &indices);
        part.colours =
            part.colours.map(|colours| indices.iter().map(|&c| colours[c as usize]).collect());
        part.places = placed;
        indices = (0..indices.len() as u32).collect();
    }
    let mut rest = indices.as_slice();
    let arities = mesh.face_arities.iter().map(|&n| n as usize);
    let all_triangles = indices.len() / 3;
    let plain =
        std::iter::repeat_n(3, if mesh.face_arities.is_empty() { all_triangles } else { 0 });
    for corners in arities.chain(plain) {
        let Some((polygon, others)) = rest.split_at_checked(corners) else { break };
        rest = others;
        let cut = polygon::triangles(&part.points, polygon).ok_or_else(|| {
            format!("a polygon of {corners} corners is not convex: cut it into triangles")
        })?;
        part.triangles.extend(cut);
    }
    Ok(part)
}

/// A material. What emits has a front, all else is seen from both sides. Images that stand alone count with a factor of 1.
fn translated(material: &tobj::Material, notes: &mut Vec<Note>) -> Material {
    let name = material.name.clone();
    let stated = mtl::factor(material);
    let reflectance = stated.map(|c| c.min(REFLECTANCE_MAX));
    if stated != reflectance && material.diffuse_texture.is_none() {
        let message = format!("its reflectance {stated:?} is taken as {REFLECTANCE_MAX} at most");
        notes.push(warning("reflectance", &name, 1, message));
    }
    let unset = if mtl::emission_texture(material).is_some() { 1.0 } else { 0.0 };
    let radiance = mtl::finite(material.emissive.unwrap_or([unset; 3]));
    let emits = radiance.iter().any(|&c| c > 0.0);
    let exitance = radiance.map(|c| c * PI);
    Material { name, reflectance, exitance, glow: None, double_sided: !emits }
}
