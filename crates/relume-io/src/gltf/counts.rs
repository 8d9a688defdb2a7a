//! How much a file asks for, counted from what it declares before any of it is read: a small file can name the same numbers many
//! times over.
//!
//! Must not know what the numbers mean.

use super::document::Document;
use super::json::{Instancing, Primitive};
use super::node_name;
use relume_core::scene::SceneError;

/// Objects at most: nodes with a mesh, and instances. Some 1.6 KB each before anything is solved.
const OBJECTS_MAX: u64 = 1 << 17;

/// Corners of triangles of all meshes at most, each mesh once: as in files of meshes.
const CORNERS_MAX: u64 = 1 << 24;

/// Keys of animations at most, those of each channel by themselves.
const KEYS_MAX: u64 = 1 << 24;

/// How often each mesh is shown.
pub(super) struct Uses(Vec<u64>);

impl Uses {
    /// How often a mesh is shown, instances counted.
    pub(super) fn of(&self, mesh: usize) -> u64 {
        self.0.get(mesh).copied().unwrap_or(0)
    }
}

/// An error if what hangs on some nodes and below is more than is read; how often each mesh is shown there.
pub(super) fn check(document: &Document, roots: &[usize]) -> Result<Uses, SceneError> {
    let root = &document.root;
    let mut uses = vec![0_u64; root.meshes.len()];
    let (mut objects, mut corners) = (0_u64, 0_u64);
    let mut seen = vec![false; root.nodes.len()];
    let mut waiting = roots.to_vec();
    while let Some(index) = waiting.pop() {
        // What is wrong with the tree is said where it is walked.
        let Some(node) = root.nodes.get(index) else { continue };
        if std::mem::replace(&mut seen[index], true) {
            continue;
        }
        waiting.extend(&node.children);
        let Some(mesh) = node.mesh else { continue };
        let count = node.extensions.instancing.as_ref().map_or(1, |i| instances(document, i));
        objects = objects.saturating_add(count);
        if objects > OBJECTS_MAX {
            return Err(too_many(
                document,
                index,
                &format!("with it the file has {objects} objects, more than {OBJECTS_MAX}"),
            ));
        }
        let Some(of_mesh) = uses.get_mut(mesh) else { continue };
        if *of_mesh == 0 {
            let of_primitive = |p: &Primitive| {
                count_of(document, p.indices.or(p.attributes.get("POSITION").copied()))
            };
            let more: u64 =
                root.meshes[mesh].primitives.iter().map(of_primitive).fold(0, u64::saturating_add);
            corners = corners.saturating_add(more);
            if corners > CORNERS_MAX {
                return Err(too_many(
                    document,
                    index,
                    &format!(
                        "with it the meshes of the file have {corners} corners, more than {CORNERS_MAX}"
                    ),
                ));
            }
        }
        *of_mesh += count;
    }
    keys(document)?;
    Ok(Uses(uses))
}

fn keys(document: &Document) -> Result<(), SceneError> {
    let mut keys = 0_u64;
    for animation in &document.root.animations {
        for channel in &animation.channels {
            let sampler = animation.samplers.get(channel.sampler);
            keys = keys.saturating_add(count_of(document, sampler.map(|s| s.input)));
        }
        if keys > KEYS_MAX {
            let name = animation.name.as_deref().unwrap_or("");
            return Err(SceneError::Animation {
                animation: name.to_owned(),
                what: format!("with it the file has {keys} keys, more than {KEYS_MAX}"),
                remedy: "leave out animations, or export fewer keys".into(),
            });
        }
    }
    Ok(())
}

/// Instances that a node declares.
fn instances(document: &Document, of: &Instancing) -> u64 {
    let counts = ["TRANSLATION", "ROTATION", "SCALE"].map(|name| {
        of.attributes.get(name).map_or(0, |&accessor| count_of(document, Some(accessor)))
    });
    counts.into_iter().max().unwrap_or(0).max(1)
}

fn count_of(document: &Document, accessor: Option<usize>) -> u64 {
    accessor.and_then(|a| document.root.accessors.get(a)).map_or(0, |a| a.count as u64)
}

/// An error about a node that is one too many.
fn too_many(document: &Document, node: usize, what: &str) -> SceneError {
    SceneError::Geometry {
        subject: format!("node `{}`", node_name(document, node)),
        what: what.to_owned(),
        remedy: "leave out objects or instances, or simplify their meshes".into(),
    }
}
