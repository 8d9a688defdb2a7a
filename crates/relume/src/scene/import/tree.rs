//! The node tree of the file: placements, and what hangs on each node.

use glam::{DMat3, DQuat, DVec3};

use super::animation::{GlowKeys, Moves, played};
use super::document::Document;
use super::mesh::{Polygons, polygons};
use super::{ImportOptions, json, light, material, node_name, note};
use crate::scene::draft::{Draft, DraftNode, DraftSurface};
use crate::scene::{Camera, MaterialId, NodeId, Note, SceneError, Severity};

/// Relative difference of scale components that counts as none (32-bit exporters).
const SAME_SCALE: f64 = 1e-6;

/// Everything of the file's active scene.
pub(super) fn draft(document: &Document, options: &ImportOptions) -> Result<Draft, SceneError> {
    let mut notes = Vec::new();
    let played = played(document, options.animation.as_deref(), &mut notes)?;
    let materials = material::materials(document, &played.materials, &mut notes)?;
    let roots = roots(document, &mut notes)?;
    let mut tree = Tree {
        document,
        moves: played.moves,
        lights: played.lights,
        meshes: document.root.meshes.iter().map(|_| None).collect(),
        without_material: 0,
        growing: Vec::new(),
        draft: Draft { materials, animation: played.names, ..Draft::default() },
    };
    tree.draft.notes = notes;
    tree.walk(&roots)?;
    Ok(tree.finish())
}

/// The root nodes of the active scene: the file's default, or its first; without any scene all
/// nodes that hang on no other.
fn roots(document: &Document, notes: &mut Vec<Note>) -> Result<Vec<usize>, SceneError> {
    let root = &document.root;
    match (root.scene, root.scenes.first()) {
        (Some(index), _) => match root.scenes.get(index) {
            Some(scene) => Ok(scene.nodes.clone()),
            None => Err(document.out_of_range("scene", index)),
        },
        (None, Some(scene)) => Ok(scene.nodes.clone()),
        (None, None) => {
            let mut child = vec![false; root.nodes.len()];
            root.nodes.iter().flat_map(|n| &n.children).for_each(|&c| {
                if let Some(c) = child.get_mut(c) {
                    *c = true;
                }
            });
            let message = "the file lists no scene; all its nodes are read".to_owned();
            notes.push(note(Severity::Info, "no-scene", &document.file, 1, message));
            let roots: Vec<usize> = (0..root.nodes.len()).filter(|&i| !child[i]).collect();
            if roots.is_empty() && !root.nodes.is_empty() {
                return Err(not_a_tree(document, 0));
            }
            Ok(roots)
        }
    }
}

fn not_a_tree(document: &Document, node: usize) -> SceneError {
    SceneError::Hierarchy {
        node: node_name(document, node),
        what: "it hangs below itself or on two parents, so the nodes are not a tree".into(),
        remedy: "give each node one parent and export again".into(),
    }
}

struct Tree<'a> {
    document: &'a Document,
    moves: Vec<Moves>,
    /// How the lights of the file change.
    lights: Vec<GlowKeys>,
    /// Polygons of the meshes read so far.
    meshes: Vec<Option<Vec<Polygons>>>,
    without_material: usize,
    /// For each node of the draft: the nearest one at or above it whose scale changes, and how.
    growing: Vec<Option<(usize, String)>>,
    draft: Draft,
}

impl Tree<'_> {
    /// Adds the nodes below `roots`, parents first, in file order.
    fn walk(&mut self, roots: &[usize]) -> Result<(), SceneError> {
        let mut seen = vec![false; self.document.root.nodes.len()];
        let mut waiting: Vec<(usize, Option<usize>)> =
            roots.iter().rev().map(|&r| (r, None)).collect();
        while let Some((index, parent)) = waiting.pop() {
            let node = self
                .document
                .root
                .nodes
                .get(index)
                .ok_or_else(|| self.document.out_of_range("node", index))?;
            if std::mem::replace(&mut seen[index], true) {
                return Err(not_a_tree(self.document, index));
            }
            let shown_later = !self.moves[index].visibility.is_empty();
            if node.extensions.visibility.as_ref().is_some_and(|v| !v.visible) && !shown_later {
                let message =
                    "it is marked invisible (KHR_node_visibility) and left out with all below it"
                        .to_owned();
                self.note(Severity::Info, "invisible", index, message);
                continue;
            }
            let me = self.add(index, node, parent)?;
            waiting.extend(node.children.iter().rev().map(|&c| (c, Some(me))));
        }
        Ok(())
    }

    /// Adds one node with its mesh, light and camera; its index in the draft.
    fn add(
        &mut self,
        index: usize,
        node: &json::Node,
        parent: Option<usize>,
    ) -> Result<usize, SceneError> {
        let name = node_name(self.document, index);
        let mut placed = placed(node, &name, parent);
        let moves = std::mem::take(&mut self.moves[index]);
        if let Some(scale) = moves.scale {
            placed.shape = shape_of(scale);
        }
        placed.translation_track = moves.translation;
        placed.rotation_track = moves.rotation;
        placed.presence = match (moves.presence.is_empty(), moves.visibility.is_empty()) {
            (false, false) => both(&moves.presence, &moves.visibility),
            (true, _) => moves.visibility,
            (_, true) => moves.presence,
        };
        let me = self.draft.nodes.len();
        let above = parent.and_then(|p| self.growing[p].clone());
        self.growing.push(moves.growth.map(|what| (index, what)).or(above));
        if let Some(mesh) = node.mesh {
            placed.surfaces = self.surfaces(mesh, index, node)?;
            self.check_growth(me)?;
        }
        self.draft.nodes.push(placed);
        let id = NodeId(me as u32);
        if let Some(l) = &node.extensions.light {
            let keys = self.lights.get(l.light).cloned().unwrap_or_default();
            let on = (id, name.as_str());
            let light = light::light(self.document, (l.light, &keys), on, &mut self.draft.notes)?;
            self.draft.lights.push(light);
        }
        if let Some(camera) = node.camera {
            let projection = light::projection(self.document, camera)?;
            self.draft.cameras.push(Camera { name, node: id, projection });
        }
        Ok(me)
    }

    /// An error if a mesh hangs on a node whose scale changes, or below one.
    fn check_growth(&self, node: usize) -> Result<(), SceneError> {
        let Some((index, what)) = &self.growing[node] else { return Ok(()) };
        Err(SceneError::NotRigid {
            node: node_name(self.document, *index),
            what: what.clone(),
            remedy: "animate translation and rotation only, or switch the scale between 0 and one \
                     value in one step"
                .into(),
        })
    }

    /// The surfaces of a mesh on a node, and notes about what is not rigid in it.
    fn surfaces(
        &mut self,
        mesh: usize,
        index: usize,
        node: &json::Node,
    ) -> Result<Vec<DraftSurface>, SceneError> {
        if node.skin.is_some() {
            let message = "its skin is ignored: the mesh is read in its rest shape and moves only with the node; \
                           bake the pose into the mesh, or split the mesh into rigid parts";
            self.note(Severity::Warning, "skin", index, message.to_owned());
        }
        if node.extensions.instancing.is_some() {
            let message = "its instances (EXT_mesh_gpu_instancing) are not read, only one object is; \
                           export them as nodes of their own";
            self.note(Severity::Warning, "instancing", index, message.to_owned());
        }
        let morphed = |m: &json::Mesh| m.primitives.iter().any(|p| !p.targets.is_empty());
        let name = node_name(self.document, index);
        let noted = self.draft.notes.iter().any(|n| n.code == "morph" && n.subject == name);
        if self.document.root.meshes.get(mesh).is_some_and(morphed) && !noted {
            let message =
                "its morph targets are ignored: the mesh is read in its base shape".to_owned();
            self.note(Severity::Warning, "morph", index, message);
        }
        if mesh >= self.meshes.len() {
            return Err(self.document.out_of_range("mesh", mesh));
        }
        if self.meshes[mesh].is_none() {
            self.meshes[mesh] = Some(polygons(self.document, mesh, &mut self.draft.notes)?);
        }
        let primitives = self.meshes[mesh].as_deref().unwrap_or_default();
        let mut surfaces = Vec::with_capacity(primitives.len());
        for primitive in primitives {
            let none = self.draft.materials.len() - 1;
            let material = primitive.material.unwrap_or(none);
            if primitive.material.is_some() && material >= none {
                return Err(self.document.out_of_range("material", material));
            }
            self.without_material += usize::from(primitive.material.is_none());
            let polygons = primitive.loops.clone();
            surfaces.push(DraftSurface {
                name: None,
                material: MaterialId(material as u32),
                polygons,
            });
        }
        Ok(surfaces)
    }

    fn note(&mut self, severity: Severity, code: &'static str, node: usize, message: String) {
        self.draft.notes.push(note(severity, code, &node_name(self.document, node), 1, message));
    }

    /// The draft, without the stand-in for missing materials if none is missing.
    fn finish(mut self) -> Draft {
        if self.without_material == 0 {
            self.draft.materials.pop();
        } else {
            let (count, rho) = (self.without_material, material::REFLECTANCE_MAX);
            let message = format!(
                "surfaces without a material: {count}; they get reflectance {rho}: give them one"
            );
            self.draft.notes.push(note(
                Severity::Warning,
                "no-material",
                "no material",
                count,
                message,
            ));
        }
        self.draft
    }
}

/// A node with its placement: from its matrix, or from translation, rotation and scale.
fn placed(node: &json::Node, name: &str, parent: Option<usize>) -> DraftNode {
    let (translation, rotation, shape) = match &node.matrix {
        Some(m) => decomposed(m),
        None => (
            node.translation.map_or(DVec3::ZERO, DVec3::from_array),
            node.rotation.map_or(DQuat::IDENTITY, DQuat::from_array),
            node.scale.map_or(DMat3::IDENTITY, |s| shape_of(DVec3::from_array(s))),
        ),
    };
    DraftNode { shape, ..DraftNode::still(name, parent, translation, rotation) }
}

/// A scale as a matrix; components that differ by rounding only are made equal, and 1 where they
/// are 1 up to rounding, so that an even scale is known as one.
fn shape_of(scale: DVec3) -> DMat3 {
    let near = |a: f64, b: f64| (a - b).abs() <= SAME_SCALE * b.abs();
    let even = |a: f64| if near(a, scale.x) { scale.x } else { a };
    let one = |a: f64| if near(a, 1.0) { 1.0 } else { a };
    DMat3::from_diagonal(DVec3::new(one(scale.x), one(even(scale.y)), one(even(scale.z))))
}

/// Translation, rotation and the rest of a column-major matrix.
fn decomposed(m: &[f64; 16]) -> (DVec3, DQuat, DMat3) {
    let column = |c: usize| DVec3::new(m[4 * c], m[4 * c + 1], m[4 * c + 2]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    let mut scale = DVec3::new(column(0).length(), column(1).length(), column(2).length());
    if linear.determinant() < 0.0 {
        scale.x = -scale.x;
    }
    let axes = DMat3::from_cols(column(0) / scale.x, column(1) / scale.y, column(2) / scale.z);
    let skew = axes.transpose() * axes - DMat3::IDENTITY;
    // The negation refuses NaN too (a column of length 0).
    if !(skew.to_cols_array().iter().all(|s| s.abs() <= 1e-5)) {
        return (column(3), DQuat::IDENTITY, linear);
    }
    (column(3), DQuat::from_mat3(&axes), shape_of(scale))
}

/// Present where both say so.
fn both(a: &[(f64, bool)], b: &[(f64, bool)]) -> Vec<(f64, bool)> {
    let at =
        |keys: &[(f64, bool)], t: f64| keys[keys.partition_point(|k| k.0 <= t).saturating_sub(1)].1;
    let mut times: Vec<f64> = a.iter().chain(b).map(|k| k.0).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times.into_iter().map(|t| (t, at(a, t) && at(b, t))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_come_apart_again() {
        let q = DQuat::from_xyzw(0.1, 0.7, -0.2, 0.6).normalize();
        let (t, s) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-2.0, 0.5, 3.0));
        let m = glam::DMat4::from_scale_rotation_translation(s, q, t).to_cols_array();
        let (translation, rotation, shape) = decomposed(&m);
        assert_eq!(translation, t);
        let error =
            DMat3::from_quat(rotation) * shape - DMat3::from_quat(q) * DMat3::from_diagonal(s);
        assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-14));
        assert_eq!(shape.determinant().signum(), -1.0);
    }

    #[test]
    fn a_shear_is_kept_as_a_shape() {
        let mut m = [0.0; 16];
        (m[0], m[4], m[5], m[10], m[15]) = (1.0, 0.5, 1.0, 1.0, 1.0);
        let (_, rotation, shape) = decomposed(&m);
        assert_eq!(rotation, DQuat::IDENTITY);
        assert_eq!(shape.y_axis, DVec3::new(0.5, 1.0, 0.0));
    }

    #[test]
    fn scales_lose_their_rounding() {
        let s = shape_of(DVec3::new(0.999_999_94, 1.0, 1.000_000_1));
        assert_eq!(s, DMat3::IDENTITY);
        assert_eq!(shape_of(DVec3::new(2.0, 2.000_001, -2.0)).y_axis.y, 2.0);
    }

    #[test]
    fn two_reasons_to_be_absent_add_up() {
        let keys = both(&[(0.0, true), (2.0, false)], &[(1.0, false), (1.5, true)]);
        assert_eq!(keys, [(0.0, false), (1.0, false), (1.5, true), (2.0, false)]);
    }
}
