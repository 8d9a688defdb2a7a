//! Files of View3D in (`.vs3`): named planar surfaces, none of which moves or emits.
//!
//! Reads and translates; what makes a scene valid is [`Scene::from_draft`]'s. The format: the manual of View3D
//! 3.3, section 5. Must not know light transport.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DQuat, DVec3};

use crate::ImportOptions;
use crate::folder::read_scene;
use relume_core::scene::draft::{Draft, DraftNode, DraftSurface};
use relume_core::scene::flatten::{Flaw, flatten};
use relume_core::scene::names::Names;
use relume_core::scene::{Material, MaterialId, Note, Scene, SceneError, Severity, SurfaceId};

mod carve;
mod read;

use read::{File, Kind, RawSurface, Wrong};

/// Emittances that View3D allows; others are moved to the nearest of them, as it does.
const EMITTANCE: (f64, f64) = (0.001, 0.999);

/// Whether a file is one of View3D, by its name.
pub(super) fn is_view3d(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("vs3"))
}

/// Reads a scene from a `.vs3` file: one body at rest, a surface for each radiating or obstructing
/// surface of the file, in its order and by its name.
///
/// Reflectance is 1 minus the emittance. Subsurfaces are cut out of their base, null surfaces too
/// and left out; combined surfaces become one. Obstructions are in [`Scene::obstructions`]. What is
/// only for View3D's own method (eps, maxU ...) is in [`Scene::notes`].
///
/// # Errors
/// What View3D would not take either, and masking surfaces: with the line and the remedy.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    let (bytes, stem) = read_scene(path, options.max_memory_bytes)?;
    scene(&stem, &String::from_utf8_lossy(&bytes), options).map_err(|error| match error {
        Refused::Text(Wrong { line, what, remedy }) => {
            SceneError::View3d { file, line, what, remedy }
        }
        Refused::Scene(error) => error,
    })
}

/// Why there is no scene.
#[derive(Debug)]
enum Refused {
    Text(Wrong),
    Scene(SceneError),
}

impl From<Wrong> for Refused {
    fn from(wrong: Wrong) -> Refused {
        Refused::Text(wrong)
    }
}

fn scene(name: &str, text: &str, options: &ImportOptions) -> Result<Scene, Refused> {
    let file = read::read(text)?;
    check(&file.surfaces)?;
    let mut notes = notes_of(&file);
    let mut names = Names::default();
    let mut materials = Materials::default();
    let mut surfaces: Vec<DraftSurface> = Vec::new();
    let mut obstructions = Vec::new();
    // Where the polygons of each surface of the file went.
    let mut places: BTreeMap<usize, usize> = BTreeMap::new();
    for (k, raw) in file.surfaces.iter().enumerate() {
        if raw.kind == Kind::Null {
            continue;
        }
        let place = match raw.combined_with {
            Some(first) => places[&first],
            None => {
                let wanted = raw.name.clone().unwrap_or_else(|| match raw.kind {
                    Kind::Obstruction => format!("obstruction {}", k + 1),
                    _ => format!("surface {}", k + 1),
                });
                let name = names.unique(&wanted);
                if raw.kind == Kind::Obstruction {
                    obstructions.push(name.clone());
                }
                let material = materials.of(raw, &mut notes);
                surfaces.push(DraftSurface {
                    name: Some(name),
                    material,
                    polygons: Vec::new(),
                    tints: Vec::new(),
                    prints: Vec::new(),
                });
                surfaces.len() - 1
            }
        };
        places.insert(k, place);
        surfaces[place].polygons.extend(carve::what_is_left(&file.surfaces, k)?);
    }
    surfaces.retain(|surface| !surface.polygons.is_empty());
    notes.extend(names.notes("surface"));
    let mut node = DraftNode::still(name, None, DVec3::ZERO, DQuat::IDENTITY);
    node.surfaces = surfaces;
    let draft = Draft {
        name: name.to_owned(),
        nodes: vec![node],
        materials: materials.list,
        notes,
        edits: options.edits.clone(),
        near_origin: options.near_origin,
        ..Draft::default()
    };
    let mut scene = Scene::from_draft(draft).map_err(Refused::Scene)?;
    let ids = (0..).map(SurfaceId).zip(&scene.surfaces);
    let blocks = ids.filter(|(_, surface)| obstructions.contains(&surface.name));
    scene.obstructions = blocks.map(|(id, _)| id).collect();
    Ok(scene)
}

/// Surfaces as View3D wants them.
fn check(surfaces: &[RawSurface]) -> Result<(), Wrong> {
    if surfaces.is_empty() {
        return Err(Wrong {
            line: 0,
            what: "there is no surface in it".into(),
            remedy: "describe surfaces by lines that begin with S".into(),
        });
    }
    for (k, raw) in surfaces.iter().enumerate() {
        let wrong = |what: String, remedy: &str| {
            Err(Wrong { line: raw.line, what, remedy: remedy.to_owned() })
        };
        let number = k + 1;
        match flatten(&raw.corners).err() {
            None => {}
            Some(Flaw::Degenerate) => {
                return wrong(
                    format!("surface {number} has no area"),
                    "give it three corners or more that are not in one line",
                );
            }
            Some(Flaw::NonPlanar) => {
                return wrong(
                    format!("the corners of surface {number} are not in one plane"),
                    "cut it into triangles that are combined (column cmb)",
                );
            }
            Some(Flaw::NotConvex) => {
                return wrong(
                    format!("surface {number} is not convex"),
                    "cut it into convex surfaces that are combined (column cmb)",
                );
            }
        }
        if let Some(first) = raw.combined_with {
            let with = &surfaces[first];
            if first >= k || with.kind != Kind::Radiating || with.combined_with.is_some() {
                return wrong(
                    format!("surface {number} is combined with surface {}", first + 1),
                    "combine with an earlier S surface that is not combined itself",
                );
            }
        }
    }
    Ok(())
}

/// Materials by emittance.
#[derive(Default)]
struct Materials {
    list: Vec<Material>,
}

impl Materials {
    fn of(&mut self, raw: &RawSurface, notes: &mut Vec<Note>) -> MaterialId {
        let (name, emittance) = match raw.kind {
            Kind::Obstruction => ("obstruction".to_owned(), 1.0),
            _ => {
                let emittance = raw.emittance.clamp(EMITTANCE.0, EMITTANCE.1);
                if emittance != raw.emittance {
                    notes.push(note(
                        Severity::Warning,
                        "emittance",
                        raw.name.as_deref().unwrap_or(""),
                        format!("its emittance {} is taken as {emittance}", raw.emittance),
                    ));
                }
                (format!("emittance {emittance}"), emittance)
            }
        };
        let index = self.list.iter().position(|m| m.name == name).unwrap_or_else(|| {
            let reflectance = [1.0 - emittance; 3];
            let material =
                Material { name, reflectance, exitance: [0.0; 3], glow: None, double_sided: false };
            self.list.push(material);
            self.list.len() - 1
        });
        MaterialId(index as u32)
    }
}

/// What the file asks for beyond its geometry.
fn notes_of(file: &File) -> Vec<Note> {
    let mut notes = Vec::new();
    let mut ignored = Vec::new();
    for (word, value) in &file.control {
        let on = value.parse::<f64>().is_ok_and(|v| v != 0.0);
        match word.to_ascii_lowercase().as_str() {
            "encl" if on => notes.push(note(
                Severity::Info,
                "view3d-enclosure",
                "encl",
                "View3D adjusts the factors of an enclosure; here that is `Factors::close`".into(),
            )),
            "emit" if on => notes.push(note(
                Severity::Warning,
                "view3d-emittance",
                "emit",
                "factors that include reflections (script F) are not made: surfaces count as black"
                    .into(),
            )),
            "row" | "col" if on => notes.push(note(
                Severity::Info,
                "view3d-row",
                word,
                "factors of all surfaces are found".into(),
            )),
            "encl" | "emit" | "row" | "col" => {}
            _ => ignored.push(format!("{word}={value}")),
        }
    }
    if !ignored.is_empty() {
        let message = "for View3D's own method; accuracy here is `Options::tolerance`".to_owned();
        notes.push(note(Severity::Info, "view3d-control", &ignored.join(" "), message));
    }
    if !file.title.is_empty() {
        notes.push(note(Severity::Info, "title", "", file.title.clone()));
    }
    notes.extend(file.ignored_lines.iter().map(|(line, what)| {
        note(Severity::Warning, "view3d-line", &format!("line {line}"), what.clone())
    }));
    notes
}

fn note(severity: Severity, code: &'static str, subject: &str, message: String) -> Note {
    Note { severity, code, subject: subject.to_owned(), count: 1, message }
}

#[cfg(test)]
mod tests;
