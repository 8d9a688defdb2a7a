//! Mesh primitives to convex polygons in the mesh's own frame.
//!
//! Must not know where meshes are placed.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::document::Document;
use super::look::{Looks, Triangles};
use super::{json, note};
use crate::range::out_of_range;
use crate::tuning::STRAY_WEIGHT;
use relume_core::scene::limits::is_place;
use relume_core::scene::{Note, Print, SceneError, Severity, TintId};

/// A primitive: its polygons, counter-clockwise from the front, with their tints, and the material's index.
#[derive(Clone)]
pub(super) struct Polygons {
    pub(super) material: Option<usize>,
    pub(super) loops: Vec<Vec<DVec3>>,
    pub(super) tints: Vec<Option<TintId>>,
    pub(super) prints: Vec<Option<Arc<Print>>>,
}

/// A primitive before its triangles are merged.
pub(super) struct Soup<'a> {
    primitive: &'a json::Primitive,
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    owner: String,
}

/// All primitives of a mesh that have triangles, in the shape of these weights of its morph targets.
pub(super) fn polygons(
    (document, looks): (&Document, &mut Looks<'_>),
    index: usize,
    weights: &[f64],
    notes: &mut Vec<Note>,
) -> Result<Vec<Polygons>, SceneError> {
    let (name, soups) = soups(document, index, weights, notes)?;
    soups.iter().map(|soup| soup.merged(&soup.triangles, &name, looks, notes)).collect()
}

/// The polygons of each joint of a skin, ascending; or how many triangles hang on several.
pub(super) type Jointed = Result<Vec<(usize, Vec<Polygons>)>, usize>;

/// The polygons of each joint of a skin where every triangle hangs on one joint alone.
pub(super) fn by_joint(
    (document, looks): (&Document, &mut Looks<'_>),
    index: usize,
    weights: &[f64],
    notes: &mut Vec<Note>,
) -> Result<Jointed, SceneError> {
    let (name, soups) = soups(document, index, weights, notes)?;
    let mut parts: BTreeMap<usize, Vec<Polygons>> = BTreeMap::new();
    let mut bent = 0;
    for soup in &soups {
        let joints = joints(document, soup)?;
        let mut groups: BTreeMap<usize, Vec<[u32; 3]>> = BTreeMap::new();
        for &triangle in &soup.triangles {
            match triangle.map(|corner| joints[corner as usize]) {
                [Some(a), Some(b), Some(c)] if a == b && b == c => {
                    groups.entry(a).or_default().push(triangle);
                }
                _ => bent += 1,
            }
        }
        if bent == 0 {
            for (joint, triangles) in groups {
                parts.entry(joint).or_default().push(soup.merged(&triangles, &name, looks, notes)?);
            }
        }
    }
    Ok(if bent > 0 { Err(bent) } else { Ok(parts.into_iter().collect()) })
}

/// The one joint that each vertex hangs on, if it is one.
fn joints(document: &Document, soup: &Soup<'_>) -> Result<Vec<Option<usize>>, SceneError> {
    let only = |vertex: &Vec<(usize, f64)>| {
        let all: f64 = vertex.iter().map(|w| w.1.abs()).sum();
        vertex.iter().find(|w| w.1 > 0.0 && w.1 >= (1.0 - STRAY_WEIGHT) * all).map(|w| w.0)
    };
    Ok(vertex_weights(document, soup)?.iter().map(only).collect())
}

/// The joints that each vertex hangs on, each once, and their weights as the file has them.
pub(super) fn vertex_weights(
    document: &Document,
    soup: &Soup<'_>,
) -> Result<Vec<Vec<(usize, f64)>>, SceneError> {
    let mut weights: Vec<Vec<(usize, f64)>> = vec![Vec::new(); soup.points.len()];
    for set in 0.. {
        let attribute = |name: &str| soup.primitive.attributes.get(&format!("{name}_{set}"));
        let (Some(&which), Some(&share)) = (attribute("JOINTS"), attribute("WEIGHTS")) else {
            break;
        };
        let which = document.numbers::<4>(which, &soup.owner)?;
        let share = document.numbers::<4>(share, &soup.owner)?;
        for (vertex, (which, share)) in weights.iter_mut().zip(which.iter().zip(&share)) {
            for (&joint, &weight) in which.iter().zip(share) {
                let joint = joint as usize;
                match vertex.iter_mut().find(|w| w.0 == joint) {
                    Some(known) => known.1 += weight,
                    None => vertex.push((joint, weight)),
                }
            }
        }
    }
    Ok(weights)
}

/// The mesh's name and its primitives that have triangles.
pub(super) fn soups<'a>(
    document: &'a Document,
    index: usize,
    weights: &[f64],
    notes: &mut Vec<Note>,
) -> Result<(String, Vec<Soup<'a>>), SceneError> {
    let mesh =
        document.root.meshes.get(index).ok_or_else(|| document.out_of_range("mesh", index))?;
    let name =
        mesh.name.clone().filter(|n| !n.is_empty()).unwrap_or_else(|| format!("mesh {index}"));
    let mut soups = Vec::new();
    for (number, primitive) in mesh.primitives.iter().enumerate() {
        let owner = format!("mesh `{name}`, primitive {number}");
        soups.extend(soup(document, primitive, weights, (&name, owner), notes)?);
    }
    Ok((name, soups))
}

fn soup<'a>(
    document: &Document,
    primitive: &'a json::Primitive,
    weights: &[f64],
    (mesh, owner): (&str, String),
    notes: &mut Vec<Note>,
) -> Result<Option<Soup<'a>>, SceneError> {
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
    let points = morphed(document, primitive, position, weights, (mesh, &owner))?;
    let corners = match primitive.indices {
        Some(accessor) => document.indices(accessor, &owner)?,
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
    Ok(Some(Soup { primitive, points, triangles, owner }))
}

impl Soup<'_> {
    /// These triangles as polygons.
    pub(super) fn merged(
        &self,
        triangles: &[[u32; 3]],
        mesh: &str,
        looks: &mut Looks<'_>,
        notes: &mut Vec<Note>,
    ) -> Result<Polygons, SceneError> {
        let Soup { primitive, points, owner, .. } = self;
        let merged = looks.polygons(&Triangles { primitive, points, triangles, owner }, notes)?;
        if merged.degenerate > 0 {
            let message = format!(
                "{} of {} triangles have no area or repeat another and were left out",
                merged.degenerate,
                triangles.len()
            );
            notes.push(note(Severity::Info, "degenerate", mesh, merged.degenerate, message));
        }
        let material = self.primitive.material;
        Ok(Polygons { material, loops: merged.loops, tints: merged.tints, prints: merged.prints })
    }
}

/// The corners in the shape of these weights (glTF 2.0, section 3.7.2.2): what every target adds, times its weight.
fn morphed(
    document: &Document,
    primitive: &json::Primitive,
    position: usize,
    weights: &[f64],
    (mesh, owner): (&str, &str),
) -> Result<Vec<DVec3>, SceneError> {
    let mut points = positions(document, position, (mesh, owner))?;
    let count = points.len();
    for (target, &weight) in primitive.targets.iter().zip(weights) {
        let (Some(&accessor), true) = (target.get("POSITION"), weight != 0.0) else { continue };
        let shifts = positions(document, accessor, (mesh, owner))?;
        if shifts.len() != count {
            let what =
                format!("{owner}: a morph target shifts {} of {count} vertices", shifts.len());
            return Err(document.malformed(what));
        }
        for (point, shift) in points.iter_mut().zip(shifts) {
            *point += shift * weight;
        }
    }
    Ok(points)
}

fn positions(
    document: &Document,
    accessor: usize,
    (mesh, owner): (&str, &str),
) -> Result<Vec<DVec3>, SceneError> {
    let points: Vec<DVec3> =
        document.numbers::<3>(accessor, owner)?.into_iter().map(DVec3::from_array).collect();
    check_places(&points, mesh)?;
    Ok(points)
}

/// An error if a vertex is nowhere, or further out than anything can be computed with.
pub(super) fn check_places(points: &[DVec3], mesh: &str) -> Result<(), SceneError> {
    match points.iter().enumerate().find(|(_, p)| !is_place(&p.to_array())) {
        None => Ok(()),
        Some((i, p)) => Err(SceneError::Geometry {
            subject: format!("mesh `{mesh}`"),
            what: format!("vertex {i} is at {}", out_of_range(*p)),
            remedy: "repair the mesh and export it again".into(),
        }),
    }
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
