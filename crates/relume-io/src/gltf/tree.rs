//! The node tree of the file: placements, and what hangs on each node.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};

use super::animation::{GlowKeys, Moves, played};
use super::counts::{self, Uses};
use super::document::Document;
use super::look::{Clear, Looks};
use super::mesh::{Polygons, polygons};
use super::skinned::Skinned;
use super::{environment, json, light, material, node_name, note};
use crate::ImportOptions;
use crate::options::Span;
use crate::tuning::REFLECTANCE_MAX;
use relume_core::scene::draft::{Draft, DraftNode, DraftSurface};
use relume_core::scene::{Camera, MaterialId, NodeId, Note, SceneError, Severity, Track};

/// Relative difference of scale components that counts as none (32-bit exporters).
const SAME_SCALE: f64 = 1e-6;

/// Everything of the file's active scene. What lets all light pass is left out, but where there is nothing else: a glass alone is
/// to be seen.
pub(super) fn draft(document: &Document, options: &ImportOptions) -> Result<Draft, SceneError> {
    let read = tree(document, options, Clear::LeftOut)?;
    let read = match read.polygons == 0 && read.looks.leaves_out() {
        true => tree(document, options, Clear::Opaque)?,
        false => read,
    };
    Ok(read.finish())
}

fn tree<'a>(
    document: &'a Document,
    options: &ImportOptions,
    clear: Clear,
) -> Result<Tree<'a>, SceneError> {
    let mut notes = Vec::new();
    let roots = roots(document, &mut notes)?;
    let uses = counts::check(document, &roots)?;
    let environment = environment::of_scene(document, &mut notes)?;
    let played = played(document, options.animation.as_deref(), &mut notes)?;
    let (materials, paints) =
        material::materials(document, &played.materials, &mut notes).into_iter().unzip();
    let mut tree = Tree {
        document,
        moves: played.moves,
        lights: played.lights,
        looks: Looks::new(document, paints, options.pictures, clear),
        meshes: BTreeMap::new(),
        places: document.root.nodes.iter().map(|_| None).collect(),
        spans: options.rebuild.as_ref().map_or(Vec::new(), |rebuild| rebuild.spans(played.end_s)),
        skinned: Vec::new(),
        uses,
        promised: 0,
        polygons: 0,
        without_material: 0,
        growths: BTreeMap::new(),
        growing: Vec::new(),
        draft: Draft {
            materials,
            animation: played.names,
            end_s: played.end_s,
            environment,
            ..Draft::default()
        },
    };
    tree.draft.notes = notes;
    let base = document.root.extensions.relative_to.as_ref().map(|centre| {
        let node = json::Node { translation: Some(centre.center), ..json::Node::default() };
        tree.below(None, placed(&node, "CESIUM_RTC", None))
    });
    tree.walk(&roots, base)?;
    tree.skins()?;
    Ok(tree)
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

pub(super) struct Tree<'a> {
    pub(super) document: &'a Document,
    moves: Vec<Moves>,
    /// How the lights of the file change.
    lights: Vec<GlowKeys>,
    pub(super) looks: Looks<'a>,
    /// Polygons of the meshes read so far, by mesh and weights of its morph targets (as bits).
    meshes: BTreeMap<(usize, Vec<u64>), Vec<Polygons>>,
    /// Where each node of the file is in the draft.
    pub(super) places: Vec<Option<usize>>,
    /// When meshes that change their shape are read; never again where there are none.
    pub(super) spans: Vec<Span>,
    /// Nodes with a skin, which wait for their joints.
    pub(super) skinned: Vec<Skinned>,
    uses: Uses,
    /// Polygons of the meshes read so far, as often as those are shown.
    promised: u64,
    /// Polygons in the draft so far.
    polygons: usize,
    without_material: usize,
    /// How the scales of nodes of the file change, until that is said.
    growths: BTreeMap<usize, String>,
    /// For each node of the draft: the nodes of the file at or above it whose scale changes.
    growing: Vec<Vec<usize>>,
    pub(super) draft: Draft,
}

/// Polygons of a draft at most: above any scene that can be solved, and a small file can ask for many by
/// instances.
const POLYGONS_MAX: usize = 1 << 22;

impl Tree<'_> {
    /// Adds the nodes below `roots`, parents first, in file order, on a node of the draft.
    fn walk(&mut self, roots: &[usize], base: Option<usize>) -> Result<(), SceneError> {
        let mut seen = vec![false; self.document.root.nodes.len()];
        let mut waiting: Vec<(usize, Option<usize>)> =
            roots.iter().rev().map(|&r| (r, base)).collect();
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
        let morphs = moves.morphs;
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
        self.places[index] = Some(me);
        let mut growing = parent.map(|p| self.growing[p].clone()).unwrap_or_default();
        if let Some(how) = moves.growth {
            growing.push(index);
            self.growths.insert(index, how);
        }
        self.growing.push(growing);
        self.draft.nodes.push(placed);
        if let Some(mesh) = node.mesh {
            let weights =
                self.weights(mesh, index, moves.weights.as_deref(), !morphs.is_empty())?;
            self.add_mesh((me, index), node, mesh, weights, morphs)?;
        }
        self.add_light_and_camera((me, index), node, name)?;
        Ok(me)
    }

    /// Adds the mesh of a node, by its indices in the draft and in the file, with the weights of its morph targets at rest and in
    /// motion.
    fn add_mesh(
        &mut self,
        (me, index): (usize, usize),
        node: &json::Node,
        mesh: usize,
        weights: Vec<f64>,
        morphs: Vec<Track>,
    ) -> Result<(), SceneError> {
        let is_still = morphs.is_empty();
        let is_rebuilt = self.is_rebuilt() && node.extensions.instancing.is_none();
        if !is_still && !is_rebuilt {
            let message = "its morph target animation is ignored: it keeps its shape at rest; `ImportOptions::rebuild` plays it";
            self.note(Severity::Warning, "morph", index, message.to_owned());
        }
        match (node.skin, &node.extensions.instancing) {
            (Some(skin), _) => {
                self.skinned.push(Skinned { index, me, mesh, skin, weights, morphs });
                Ok(())
            }
            (None, Some(instancing)) => self.instances((me, index), mesh, &weights, instancing),
            (None, None) if is_still || !is_rebuilt => self.show(me, mesh, &weights),
            (None, None) => self.morphing((me, index), mesh, &weights, &morphs),
        }
    }

    /// Adds the light and the camera of a node, by its indices in the draft and in the file.
    fn add_light_and_camera(
        &mut self,
        (me, index): (usize, usize),
        node: &json::Node,
        name: String,
    ) -> Result<(), SceneError> {
        let id = NodeId(me as u32);
        if let Some(l) = &node.extensions.light {
            let keys = self.lights.get(l.light).cloned().unwrap_or_default();
            let on = (id, name.as_str());
            let light = light::light(self.document, (l.light, &keys), on, &mut self.draft.notes)?;
            self.draft.lights.push(light);
        }
        if let Some(camera) = node.camera {
            let (projection, said) = light::projection(self.document, camera)?;
            if let Some(said) = said {
                self.note(Severity::Warning, "camera", index, said);
            }
            self.draft.cameras.extend(projection.map(|projection| Camera {
                name,
                node: id,
                projection,
            }));
        }
        Ok(())
    }

    /// Says once of each node whose scale changes that what hangs on it or below is held at one size.
    fn note_growth(&mut self, node: usize) {
        for index in std::mem::take(&mut self.growing[node]) {
            if let Some(how) = self.growths.remove(&index) {
                self.note(Severity::Warning, "held-size", index, how);
            }
        }
    }

    /// The weights of a mesh's morph targets on a node, with a note where they count.
    fn weights(
        &mut self,
        mesh: usize,
        index: usize,
        keyed: Option<&[f64]>,
        moving: bool,
    ) -> Result<Vec<f64>, SceneError> {
        let root = &self.document.root;
        let of_mesh =
            root.meshes.get(mesh).ok_or_else(|| self.document.out_of_range("mesh", mesh))?;
        let targets = of_mesh.primitives.iter().map(|p| p.targets.len()).max().unwrap_or(0);
        let of_node = root.nodes[index].weights.as_deref();
        let mut weights = keyed.or(of_node).unwrap_or(&of_mesh.weights).to_vec();
        weights.resize(targets, 0.0);
        if targets > 0 && !moving {
            let message = format!("its morph targets count with the weights {weights:?}");
            self.note(Severity::Info, "morph", index, message);
        }
        Ok(weights)
    }

    /// Whether meshes that change their shape are read at each instant.
    pub(super) fn is_rebuilt(&self) -> bool {
        self.spans.len() > 1
    }

    /// Shows a mesh in the shapes that it has at each instant, each on a node of its own below one of the draft.
    fn morphing(
        &mut self,
        (me, index): (usize, usize),
        mesh: usize,
        weights: &[f64],
        morphs: &[Track],
    ) -> Result<(), SceneError> {
        let name = self.draft.nodes[me].name.clone();
        for (number, span) in self.spans.clone().iter().enumerate() {
            let shape = placed(&json::Node::default(), &name, Some(me));
            let shape = self.below(Some(me), shaped(shape, number, span));
            self.show(shape, mesh, &weights_at(weights, morphs, span.time_s))?;
        }
        self.note_rebuilt(index);
        Ok(())
    }

    pub(super) fn note_rebuilt(&mut self, index: usize) {
        let count = self.spans.len();
        let message =
            format!("its shape changes: it is a body of its own at each of {count} frames");
        self.note(Severity::Info, "rebuilt", index, message);
    }

    /// Shows a mesh on a node of the draft.
    pub(super) fn show(
        &mut self,
        me: usize,
        mesh: usize,
        weights: &[f64],
    ) -> Result<(), SceneError> {
        let key = (mesh, weights.iter().map(|w| w.to_bits()).collect::<Vec<u64>>());
        let primitives = match self.meshes.get(&key) {
            Some(read) => read.clone(),
            None => {
                let with = (self.document, &mut self.looks);
                let read = polygons(with, mesh, weights, &mut self.draft.notes)?;
                self.promise(me, mesh, &read)?;
                self.meshes.entry(key).or_insert(read).clone()
            }
        };
        self.put(me, primitives)
    }

    /// An error if a mesh that was read makes too many polygons, as often as it is shown; before it is.
    fn promise(&mut self, me: usize, mesh: usize, read: &[Polygons]) -> Result<(), SceneError> {
        // In another shape it was counted.
        if self.meshes.keys().any(|known| known.0 == mesh) {
            return Ok(());
        }
        let polygons: usize = read.iter().map(|primitive| primitive.loops.len()).sum();
        let shown = self.uses.of(mesh);
        let more = shown.saturating_mul(polygons as u64);
        self.promised = self.promised.saturating_add(more);
        match self.promised > POLYGONS_MAX as u64 {
            true => {
                let why = format!(": its mesh has {polygons} and is shown {shown} times");
                Err(self.too_many_polygons(me, if shown > 1 { &why } else { "" }))
            }
            false => Ok(()),
        }
    }

    fn too_many_polygons(&self, me: usize, why: &str) -> SceneError {
        SceneError::Geometry {
            subject: format!("node `{}`", self.draft.nodes[me].name),
            what: format!("with it the scene has more than {POLYGONS_MAX} polygons{why}"),
            remedy: "leave out objects or instances, or simplify their meshes".into(),
        }
    }

    /// Hangs polygons on a node of the draft.
    pub(super) fn put(&mut self, me: usize, primitives: Vec<Polygons>) -> Result<(), SceneError> {
        self.note_growth(me);
        for primitive in primitives {
            let none = self.draft.materials.len() - 1;
            let material = primitive.material.unwrap_or(none);
            if primitive.material.is_some() && material >= none {
                return Err(self.document.out_of_range("material", material));
            }
            self.without_material += usize::from(primitive.material.is_none());
            self.polygons += primitive.loops.len();
            if self.polygons > POLYGONS_MAX {
                return Err(self.too_many_polygons(me, ""));
            }
            let Polygons { loops: polygons, tints, prints, .. } = primitive;
            let material = MaterialId(material as u32);
            self.draft.nodes[me].surfaces.push(DraftSurface {
                name: None,
                material,
                polygons,
                tints,
                prints,
            });
        }
        Ok(())
    }

    /// Adds a node that does not move by itself.
    pub(super) fn below(&mut self, parent: Option<usize>, node: DraftNode) -> usize {
        self.growing.push(parent.map(|p| self.growing[p].clone()).unwrap_or_default());
        self.draft.nodes.push(node);
        self.draft.nodes.len() - 1
    }

    /// Adds the instances of a mesh (EXT_mesh_gpu_instancing), each a node of its own below the one that
    /// says where they are.
    fn instances(
        &mut self,
        (me, index): (usize, usize),
        mesh: usize,
        weights: &[f64],
        instancing: &json::Instancing,
    ) -> Result<(), SceneError> {
        let owner = format!("the instances of node `{}`", node_name(self.document, index));
        let get = |name: &str| instancing.attributes.get(name);
        let (document, owned) = (self.document, owner.as_str());
        let vectors = |name| get(name).map(|&a| document.numbers::<3>(a, owned)).transpose();
        let (at, scale) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let turn = get("ROTATION").map(|&a| document.numbers::<4>(a, owned)).transpose()?;
        let counts = [at.as_ref().map(Vec::len), turn.as_ref().map(Vec::len)];
        let mut counts = counts.into_iter().chain([scale.as_ref().map(Vec::len)]).flatten();
        let Some(count) = counts.next() else { return self.show(me, mesh, weights) };
        if counts.any(|other| other != count) {
            return Err(document.malformed(format!("{owner} have attributes of different lengths")));
        }
        for k in 0..count {
            let node = json::Node {
                translation: at.as_ref().map(|at| at[k]),
                rotation: turn.as_ref().map(|turn| turn[k]),
                scale: scale.as_ref().map(|scale| scale[k]),
                ..json::Node::default()
            };
            let name = format!("{}/{k}", self.draft.nodes[me].name);
            let instance = self.below(Some(me), placed(&node, &name, Some(me)));
            self.show(instance, mesh, weights)?;
        }
        Ok(())
    }

    /// When a node of the draft and all above it are present.
    pub(super) fn presence_of(&self, node: usize) -> Vec<(f64, bool)> {
        let nodes = &self.draft.nodes;
        let upward = std::iter::successors(Some(node), |&n| nodes[n].parent);
        let keyed = upward.map(|n| &nodes[n].presence).filter(|keys| !keys.is_empty());
        keyed.fold(Vec::new(), |all, keys| match all.is_empty() {
            true => keys.clone(),
            false => both(&all, keys),
        })
    }

    pub(super) fn note(
        &mut self,
        severity: Severity,
        code: &'static str,
        node: usize,
        message: String,
    ) {
        self.draft.notes.push(note(severity, code, &node_name(self.document, node), 1, message));
    }

    /// The draft, without the stand-in for missing materials if none is missing.
    fn finish(mut self) -> Draft {
        if self.without_material == 0 {
            self.draft.materials.pop();
        } else {
            let (count, rho) = (self.without_material, REFLECTANCE_MAX);
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
        self.draft.tints = self.looks.finish(&mut self.draft.notes);
        self.draft
    }
}

/// A node that is there at one instant of several.
pub(super) fn shaped(node: DraftNode, number: usize, span: &Span) -> DraftNode {
    let name = format!("{} @{:.3} s", node.name, span.time_s);
    DraftNode { name, presence: span.keys(), again: number > 0, ..node }
}

/// The weights of morph targets at a time, where they change then.
pub(super) fn weights_at(weights: &[f64], morphs: &[Track], time_s: f64) -> Vec<f64> {
    let at =
        |(target, &weight): (usize, &f64)| morphs.get(target).map_or(weight, |m| m.at(time_s).x);
    weights.iter().enumerate().map(at).collect()
}

/// A node with its placement: from its matrix, or from translation, rotation and scale.
pub(super) fn placed(node: &json::Node, name: &str, parent: Option<usize>) -> DraftNode {
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
pub(super) fn both(a: &[(f64, bool)], b: &[(f64, bool)]) -> Vec<(f64, bool)> {
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
