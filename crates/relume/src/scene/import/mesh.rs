//! Mesh primitives to convex polygons in the mesh's own frame.
//!
//! Must not know where meshes are placed or what they are made of.

use glam::DVec3;

use super::document::Document;
use super::{json, note};
use crate::scene::merge::merge;
use crate::scene::{Note, SceneError, Severity};

/// A primitive: its polygons, counter-clockwise from the front, and the material's index.
pub(super) struct Polygons {
    pub(super) material: Option<usize>,
    pub(super) loops: Vec<Vec<DVec3>>,
}

/// All primitives of a mesh that have triangles.
pub(super) fn polygons(
    document: &Document,
    index: usize,
    notes: &mut Vec<Note>,
) -> Result<Vec<Polygons>, SceneError> {
    let mesh =
        document.root.meshes.get(index).ok_or_else(|| document.out_of_range("mesh", index))?;
    let name =
        mesh.name.clone().filter(|n| !n.is_empty()).unwrap_or_else(|| format!("mesh {index}"));
    let mut primitives = Vec::new();
    for (number, primitive) in mesh.primitives.iter().enumerate() {
        let owner = format!("mesh `{name}`, primitive {number}");
        if let Some(p) = one(document, primitive, &name, &owner, notes)? {
            primitives.push(p);
        }
    }
    Ok(primitives)
}

fn one(
    document: &Document,
    primitive: &json::Primitive,
    mesh: &str,
    owner: &str,
    notes: &mut Vec<Note>,
) -> Result<Option<Polygons>, SceneError> {
    let mode = primitive.mode.unwrap_or(4);
    if mode < 4 {
        let what = if mode == 0 { "points" } else { "lines" };
        let message = format!("{what} have no area and were left out");
        notes.push(note(Severity::Info, "not-triangles", mesh, 1, message));
        return Ok(None);
    }
    let Some(&position) = primitive.attributes.get("POSITION") else {
        let message = "a primitive without positions was left out".to_owned();
        notes.push(note(Severity::Warning, "no-positions", mesh, 1, message));
        return Ok(None);
    };
    check_compression(document, primitive, position)?;
    let points = positions(document, position, mesh, owner)?;
    let corners = match primitive.indices {
        Some(accessor) => document.indices(accessor, owner)?,
        None => (0..points.len() as u32).collect(),
    };
    if let Some(bad) = corners.iter().find(|&&c| c as usize >= points.len()) {
        let count = points.len();
        return Err(
            document.malformed(format!("{owner}: index {bad} points past its {count} vertices"))
        );
    }
    let triangles = triangles(mode, &corners)
        .ok_or_else(|| document.malformed(format!("{owner} has the unknown mode {mode}")))?;
    if mode == 4 && corners.len() % 3 != 0 {
        let message = format!(
            "{} corners do not make whole triangles; the last ones were left out",
            corners.len()
        );
        notes.push(note(Severity::Warning, "not-triangles", mesh, corners.len() % 3, message));
    }
    let merged = merge(&points, &triangles);
    if merged.degenerate > 0 {
        let message = format!(
            "{} of {} triangles have no area and were left out",
            merged.degenerate,
            triangles.len()
        );
        notes.push(note(Severity::Info, "degenerate", mesh, merged.degenerate, message));
    }
    Ok(Some(Polygons { material: primitive.material, loops: merged.polygons }))
}

/// A compressed primitive can be read only if its plain numbers are there too.
fn check_compression(
    document: &Document,
    primitive: &json::Primitive,
    position: usize,
) -> Result<(), SceneError> {
    let draco = "KHR_draco_mesh_compression";
    let plain = document.root.accessors.get(position).is_some_and(|a| a.buffer_view.is_some());
    if primitive.extensions.contains_key(draco) && !plain {
        return Err(document.extension(draco));
    }
    Ok(())
}

fn positions(
    document: &Document,
    accessor: usize,
    mesh: &str,
    owner: &str,
) -> Result<Vec<DVec3>, SceneError> {
    let points: Vec<DVec3> =
        document.numbers::<3>(accessor, owner)?.into_iter().map(DVec3::from_array).collect();
    if let Some((i, p)) = points.iter().enumerate().find(|(_, p)| !p.is_finite()) {
        return Err(SceneError::Geometry {
            subject: format!("mesh `{mesh}`"),
            what: format!("vertex {i} is at ({}, {}, {}), which is no place", p.x, p.y, p.z),
            remedy: "repair the mesh and export it again".into(),
        });
    }
    Ok(points)
}

/// Triangles of a list (4), strip (5) or fan (6).
fn triangles(mode: u32, c: &[u32]) -> Option<Vec<[u32; 3]>> {
    let triples = || 2..c.len();
    Some(match mode {
        4 => c.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        5 => {
            triples()
                .map(|i| {
                    if i % 2 == 0 { [c[i - 2], c[i - 1], c[i]] } else { [c[i - 1], c[i - 2], c[i]] }
                })
                .collect()
        }
        6 => triples().map(|i| [c[0], c[i - 1], c[i]]).collect(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_alternate_and_fans_turn() {
        assert_eq!(triangles(5, &[0, 1, 2, 3, 4]).unwrap(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        assert_eq!(triangles(6, &[0, 1, 2, 3]).unwrap(), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangles(4, &[0, 1, 2, 3]).unwrap(), [[0, 1, 2]]);
        assert_eq!(triangles(5, &[0]).unwrap(), Vec::<[u32; 3]>::new());
        assert!(triangles(7, &[]).is_none());
    }
}
