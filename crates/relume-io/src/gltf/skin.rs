//! Skinned meshes: rigid parts that move with their joints, or one shape in its pose at the start.
//!
//! A vertex is where its joints put it: sum of weight times joint times inverse bind matrix times vertex; where the
//! mesh's own node stands does not count (glTF 2.0, section 3.7.3.3). Must not know how joints move.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat4, DVec3};

use super::mesh::{Polygons, by_joint, check_places, soups, vertex_weights};
use super::tree::{Tree, placed};
use super::{json, node_name};
use relume_core::scene::draft::DraftNode;
use relume_core::scene::{Interpolation, SceneError, Severity};

/// A node of the file with a skinned mesh.
pub(super) struct Skinned {
    /// In the file.
    pub(super) index: usize,
    /// In the draft.
    pub(super) me: usize,
    pub(super) mesh: usize,
    pub(super) skin: usize,
    pub(super) weights: Vec<f64>,
}

/// A skin's joints as the file has them.
struct Joints {
    nodes: Vec<usize>,
    binds: Option<Vec<[f64; 16]>>,
}

/// A joint: its node in the file, the same in the draft, and its inverse bind matrix.
struct Joint {
    node: usize,
    place: usize,
    bind: Option<[f64; 16]>,
}

impl Tree<'_> {
    /// Hangs what is skinned rigidly on its joints, and what bends where it is at the start.
    pub(super) fn skins(&mut self) -> Result<(), SceneError> {
        for skinned in std::mem::take(&mut self.skinned) {
            if let Err(why) = self.skin(&skinned)? {
                let message = format!(
                    "its skin is ignored ({why}): the mesh is read as it was before skinning and moves only with the \
                     node; export it again with its armature"
                );
                self.note(Severity::Warning, "skin", skinned.index, message);
                self.show(skinned.me, skinned.mesh, &skinned.weights)?;
            }
        }
        Ok(())
    }

    /// Hangs a skinned mesh on its joints, or says why there is no skin to speak of.
    fn skin(&mut self, skinned: &Skinned) -> Result<Result<(), String>, SceneError> {
        let document = self.document;
        let Some(skin) = document.root.skins.get(skinned.skin) else {
            return Ok(Err(format!("skin {} does not exist", skinned.skin)));
        };
        let owner = format!("the skin of node `{}`", self.draft.nodes[skinned.me].name);
        let binds =
            skin.inverse_bind_matrices.map(|a| document.numbers::<16>(a, &owner)).transpose()?;
        let joints = Joints { nodes: skin.joints.clone(), binds };
        let notes = &mut self.draft.notes;
        match by_joint((document, &mut self.looks), skinned.mesh, &skinned.weights, notes)? {
            Ok(parts) => self.rigid_parts(skinned, &joints, parts),
            Err(bent) => self.held(skinned, &joints, bent),
        }
    }

    /// Puts each part on its joint.
    fn rigid_parts(
        &mut self,
        skinned: &Skinned,
        joints: &Joints,
        parts: Vec<(usize, Vec<Polygons>)>,
    ) -> Result<Result<(), String>, SceneError> {
        let mut carriers = Vec::new();
        for (joint, primitives) in parts {
            match self.joint(joints, joint) {
                Ok(joint) => carriers.push((joint, primitives)),
                Err(why) => return Ok(Err(why)),
            }
        }
        let name = self.leave_name(skinned);
        let one = carriers.len() == 1;
        for (joint, primitives) in carriers {
            let of_joint = || format!("{name}/{}", node_name(self.document, joint.node));
            let part = if one { name.clone() } else { of_joint() };
            let bound = json::Node { matrix: joint.bind, ..json::Node::default() };
            self.hang(skinned, placed(&bound, &part, Some(joint.place)), primitives)?;
        }
        Ok(Ok(()))
    }

    /// Puts a mesh that bends where its joints have it at the start, on whatever its skeleton hangs on.
    fn held(
        &mut self,
        skinned: &Skinned,
        joints: &Joints,
        bent: usize,
    ) -> Result<Result<(), String>, SceneError> {
        let document = self.document;
        // What the vertices themselves say of them has been noted before.
        let (mesh, mut soups) = soups(document, skinned.mesh, &skinned.weights, &mut Vec::new())?;
        let mut matrices: Vec<Option<DAffine3>> = vec![None; joints.nodes.len()];
        let mut used = BTreeSet::new();
        for soup in &mut soups {
            let weights = vertex_weights(document, soup)?;
            for &(joint, weight) in weights.iter().flatten() {
                if weight != 0.0 && used.insert(joint) {
                    match self.joint(joints, joint) {
                        Ok(found) => matrices[joint] = Some(self.posed(&found)),
                        Err(why) => return Ok(Err(why)),
                    }
                }
            }
            for (point, weights) in soup.points.iter_mut().zip(&weights) {
                *point = skinned_point(*point, weights, &matrices);
            }
        }
        let (carrier, from_world) = self.carrier(joints, &used);
        let mut primitives = Vec::new();
        for soup in &mut soups {
            soup.points.iter_mut().for_each(|p| *p = from_world.transform_point3(*p));
            check_places(&soup.points, &mesh)?;
            let notes = &mut self.draft.notes;
            primitives.push(soup.merged(&soup.triangles, &mesh, &mut self.looks, notes)?);
        }
        let on = carrier.map_or(String::new(), |c| {
            format!(" and moves as `{}` does", self.draft.nodes[c].name)
        });
        let message = format!(
            "{bent} of its triangles hang on several joints and would bend: it is held in its pose at the start{on}"
        );
        self.note(Severity::Warning, "skin", skinned.index, message);
        let name = self.leave_name(skinned);
        let still = placed(&json::Node::default(), &name, carrier);
        self.hang(skinned, still, primitives)?;
        Ok(Ok(()))
    }

    /// A joint of a skin, or why there is none.
    fn joint(&self, joints: &Joints, joint: usize) -> Result<Joint, String> {
        let node = joints.nodes.get(joint).copied();
        let place = node.and_then(|n| self.places.get(n).copied().flatten());
        let (Some(node), Some(place)) = (node, place) else {
            return Err(format!("its joint {joint} is not in the scene"));
        };
        let bind = match &joints.binds {
            Some(binds) => match binds.get(joint) {
                Some(bind) => Some(*bind),
                None => return Err(format!("its joint {joint} has no inverse bind matrix")),
            },
            None => None,
        };
        Ok(Joint { node, place, bind })
    }

    /// What a joint makes of a vertex at the start: where it is in the world.
    fn posed(&self, joint: &Joint) -> DAffine3 {
        let bind = joint.bind.map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&m));
        self.at_start(joint.place) * DAffine3::from_mat4(bind)
    }

    /// Where a node of the draft is at the start, with all scales above it.
    fn at_start(&self, node: usize) -> DAffine3 {
        let nodes = &self.draft.nodes;
        let upward = std::iter::successors(Some(node), |&n| nodes[n].parent);
        upward.fold(DAffine3::IDENTITY, |below, n| placement(&nodes[n]) * below)
    }

    /// The nearest node that all these joints hang below and that is no joint itself, and its frame from the
    /// world's at the start; no node where that is the world.
    fn carrier(&self, joints: &Joints, used: &BTreeSet<usize>) -> (Option<usize>, DAffine3) {
        let nodes = &self.draft.nodes;
        let place = |node: &usize| self.places.get(*node).copied().flatten();
        let are_joints: BTreeSet<usize> = joints.nodes.iter().filter_map(place).collect();
        let above = |joint: &usize| {
            let start = joints.nodes.get(*joint).and_then(place);
            std::iter::successors(start, |&n| nodes[n].parent).collect::<Vec<usize>>()
        };
        let mut ways = used.iter().map(above);
        let mut common = ways.next().unwrap_or_default();
        for way in ways {
            let way: BTreeSet<usize> = way.into_iter().collect();
            common.retain(|n| way.contains(n));
        }
        let carrier = common.into_iter().find(|n| !are_joints.contains(n));
        let from_world = carrier.map_or(DAffine3::IDENTITY, |c| self.at_start(c).inverse());
        match from_world.is_finite() {
            true => (carrier, from_world),
            false => (None, DAffine3::IDENTITY),
        }
    }

    /// Gives the name of the mesh's node to what is seen of it.
    fn leave_name(&mut self, skinned: &Skinned) -> String {
        let node = &mut self.draft.nodes[skinned.me].name;
        let name = node.clone();
        node.push_str(" (node)");
        name
    }

    /// Adds a part, there while the mesh's own node is.
    fn hang(
        &mut self,
        skinned: &Skinned,
        mut part: DraftNode,
        primitives: Vec<Polygons>,
    ) -> Result<(), SceneError> {
        part.presence = self.presence_of(skinned.me);
        let part = self.below(part.parent, part);
        self.put(part, primitives)
    }
}

/// Where a node is in its parent at the start.
fn placement(node: &DraftNode) -> DAffine3 {
    let first = |interpolation| usize::from(interpolation == Interpolation::CubicSpline);
    let track = node.translation_track.as_ref();
    let translation = track.and_then(|t| t.values.get(first(t.interpolation)));
    let track = node.rotation_track.as_ref();
    let rotation = track.and_then(|t| t.values.get(first(t.interpolation)));
    let rotation = rotation.copied().unwrap_or(node.rotation).normalize();
    let linear = glam::DMat3::from_quat(rotation) * node.shape;
    DAffine3::from_mat3_translation(linear, translation.copied().unwrap_or(node.translation))
}

/// The weighted mean of where its joints have a vertex; without weights it stays.
fn skinned_point(point: DVec3, weights: &[(usize, f64)], matrices: &[Option<DAffine3>]) -> DVec3 {
    let (mut sum, mut all) = (DVec3::ZERO, 0.0);
    for &(joint, weight) in weights {
        if let Some(matrix) = matrices.get(joint).copied().flatten() {
            sum += weight * matrix.transform_point3(point);
            all += weight;
        }
    }
    if all == 0.0 { point } else { sum / all }
}
