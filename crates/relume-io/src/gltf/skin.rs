//! Skinned meshes: rigid parts that move with their joints, or one shape in its pose at the start.
//!
//! A vertex is where its joints put it: sum of weight times joint times inverse bind matrix times vertex; where the
//! mesh's own node stands does not count (glTF 2.0, section 3.7.3.3). Must not know how joints move.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat4, DVec3};

use super::mesh::{Polygons, by_joint, check_places, soups, vertex_weights};
use super::skinned::Skinned;
use super::tree::{Tree, both, placed, shaped, weights_at};
use super::{json, node_name};
use crate::options::Span;
use relume_core::scene::draft::DraftNode;
use relume_core::scene::{SceneError, Severity, check_track};

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

/// A mesh as its joints bend it, in the frame of a node of the draft, or in the world.
struct Bent {
    on: Option<usize>,
    primitives: Vec<Polygons>,
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

    /// Puts a mesh that bends where its joints have it: at the start, on whatever its skeleton hangs on; or at each instant, in the
    /// world.
    fn held(
        &mut self,
        skinned: &Skinned,
        joints: &Joints,
        bent: usize,
    ) -> Result<Result<(), String>, SceneError> {
        let is_rebuilt = self.is_rebuilt();
        let at_start = Span { time_s: 0.0, presence: [None; 2] };
        let spans = if is_rebuilt { self.spans.clone() } else { vec![at_start] };
        let mut name = None;
        let mut carrier = None;
        for (number, span) in spans.iter().enumerate() {
            let Bent { on, primitives } = match self.bent(skinned, joints, span.time_s)? {
                Ok(found) => found,
                Err(why) => return Ok(Err(why)),
            };
            let name = name.get_or_insert_with(|| self.leave_name(skinned));
            let shape = placed(&json::Node::default(), name, on);
            carrier = on;
            let shape = if is_rebuilt { shaped(shape, number, span) } else { shape };
            self.hang(skinned, shape, primitives)?;
        }
        if is_rebuilt {
            self.note_rebuilt(skinned.index);
            return Ok(Ok(()));
        }
        let on = carrier.map_or(String::new(), |c| {
            format!(" and moves as `{}` does", self.draft.nodes[c].name)
        });
        let message = format!(
            "{bent} of its triangles hang on several joints and would bend: it is held in its pose at the start{on}; `ImportOptions::rebuild` \
             bends it"
        );
        self.note(Severity::Warning, "skin", skinned.index, message);
        Ok(Ok(()))
    }

    /// The polygons of a mesh where its joints have it at a time: in the frame of a node that it hangs on, if it is not to be
    /// read anew as time goes on; or why there is no skin to speak of.
    fn bent(
        &mut self,
        skinned: &Skinned,
        joints: &Joints,
        time_s: f64,
    ) -> Result<Result<Bent, String>, SceneError> {
        let document = self.document;
        let weights = match self.is_rebuilt() {
            true => weights_at(&skinned.weights, &skinned.morphs, time_s),
            false => skinned.weights.clone(),
        };
        // What the vertices themselves say of them has been noted before.
        let (mesh, mut soups) = soups(document, skinned.mesh, &weights, &mut Vec::new())?;
        let mut matrices: Vec<Option<DAffine3>> = vec![None; joints.nodes.len()];
        let mut used = BTreeSet::new();
        for soup in &mut soups {
            let weights = vertex_weights(document, soup)?;
            for &(joint, weight) in weights.iter().flatten() {
                if weight != 0.0 && used.insert(joint) {
                    match self.joint(joints, joint) {
                        Ok(found) => matrices[joint] = Some(self.posed(&found, time_s)),
                        Err(why) => return Ok(Err(why)),
                    }
                }
            }
            for (point, weights) in soup.points.iter_mut().zip(&weights) {
                *point = skinned_point(*point, weights, &matrices);
            }
        }
        let (carrier, from_world) = match self.is_rebuilt() {
            true => (None, DAffine3::IDENTITY),
            false => self.carrier(joints, &used),
        };
        let mut primitives = Vec::new();
        for soup in &mut soups {
            soup.points.iter_mut().for_each(|p| *p = from_world.transform_point3(*p));
            check_places(&soup.points, &mesh)?;
            let notes = &mut self.draft.notes;
            primitives.push(soup.merged(&soup.triangles, &mesh, &mut self.looks, notes)?);
        }
        Ok(Ok(Bent { on: carrier, primitives }))
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

    /// What a joint makes of a vertex at a time: where it is in the world.
    fn posed(&self, joint: &Joint, time_s: f64) -> DAffine3 {
        let bind = joint.bind.map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&m));
        self.at(joint.place, time_s) * DAffine3::from_mat4(bind)
    }

    /// Where a node of the draft is at a time, with all scales above it.
    fn at(&self, node: usize, time_s: f64) -> DAffine3 {
        let nodes = &self.draft.nodes;
        let upward = std::iter::successors(Some(node), |&n| nodes[n].parent);
        upward.fold(DAffine3::IDENTITY, |below, n| placement(&nodes[n], time_s) * below)
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
        let from_world = carrier.map_or(DAffine3::IDENTITY, |c| self.at(c, 0.0).inverse());
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
        let presence = self.presence_of(skinned.me);
        part.presence = match (presence.is_empty(), part.presence.is_empty()) {
            (_, true) => presence,
            (true, _) => part.presence,
            _ => both(&presence, &part.presence),
        };
        let part = self.below(part.parent, part);
        self.put(part, primitives)
    }
}

/// Where a node is in its parent at a time.
fn placement(node: &DraftNode, time_s: f64) -> DAffine3 {
    // Tracks are checked when the scene is made.
    let is_sound = |times_s: &[f64], values: usize, interpolation| {
        !times_s.is_empty() && check_track(&node.name, times_s, values, interpolation).is_ok()
    };
    let track = node.translation_track.as_ref();
    let track = track.filter(|t| is_sound(&t.times_s, t.values.len(), t.interpolation));
    let translation = track.map_or(node.translation, |t| t.at(time_s));
    let track = node.rotation_track.as_ref();
    let track = track.filter(|t| is_sound(&t.times_s, t.values.len(), t.interpolation));
    let rotation = track.map_or(node.rotation, |t| t.at(time_s)).normalize();
    DAffine3::from_mat3_translation(glam::DMat3::from_quat(rotation) * node.shape, translation)
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
