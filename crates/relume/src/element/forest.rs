//! The forest itself: a pool of nodes, the fixed part (down to facets) first.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::clusters::{Branch, binary_tree};
use super::split::Shape;
use crate::geometry::{Aabb, split_convex};
use crate::scene::{BodyId, PatchId, Scene};

/// Index of a node in a [`Forest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ElementId(pub u32);

/// What a node of the forest is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A group of nodes: the scene, a group of bodies, a body, or a part of its hierarchy.
    Cluster,
    /// A planar polygon with more than four corners: a group of coplanar nodes.
    Polygon,
    /// A triangle or quadrilateral: the root of a quadtree or a node of it.
    Element,
    /// A punctual light: it has no area and receives nothing.
    Light,
}

/// The name of an element that does not depend on history: its facet and the path below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ElementKey {
    /// Id of the quadtree's root, which is fixed.
    pub facet: u32,
    /// A one bit, then two bits a level.
    pub path: u32,
}

/// 64 bytes.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// In the patch's frame. Neighbours share these values exactly, so they tile without gaps.
    corners: [[f32; 2]; 4],
    parent: u32,
    first_child: u32,
    /// Patch, light or body, depending on the kind; `u32::MAX` for groups of bodies.
    subject: u32,
    facet: u32,
    path: u32,
    coarse: u32,
    area_m2: f32,
    child_count: u16,
    kind: Kind,
    corner_count: u8,
}

const NONE: u32 = u32::MAX;

/// Levels that a path has room for.
const LEVELS_MAX: u32 = 15;

/// All elements of a scene.
///
/// Nodes with ids below [`Forest::fixed_len`] (clusters, lights, polygons and facets) are a pure
/// function of the scene; quadtree elements come and go above them.
#[derive(Clone, Debug)]
pub struct Forest {
    nodes: Vec<Node>,
    fixed_len: u32,
    /// Outline of each [`Kind::Polygon`] node and its id, ascending.
    patch_roots: Vec<ElementId>,
    body_roots: Vec<ElementId>,
}

impl Forest {
    /// The fixed part of the forest of a scene.
    pub fn new(scene: &Scene) -> Forest {
        let mut forest = Forest {
            nodes: Vec::new(),
            fixed_len: 0,
            patch_roots: vec![ElementId(NONE); scene.patches.len()],
            body_roots: vec![ElementId(NONE); scene.bodies.len()],
        };
        forest.nodes.push(blank(Kind::Cluster, NONE, NONE));
        let lights = scene.lights.len() as u32;
        let children = u32::from(!scene.patches.is_empty()) + lights;
        forest.nodes.extend((0..children).map(|_| blank(Kind::Light, 0, NONE)));
        forest.nodes[0].first_child = 1;
        forest.nodes[0].child_count = u16::try_from(children).expect("fewer than 65,536 lights");
        for (k, node) in forest.nodes[(1 + children - lights) as usize..].iter_mut().enumerate() {
            node.subject = k as u32;
            node.path = 1;
        }
        for id in (1 + children - lights)..=children {
            forest.nodes[id as usize].facet = id;
        }
        if !scene.patches.is_empty() {
            forest.plant_bodies(scene, 1);
        }
        forest.fixed_len = forest.nodes.len() as u32;
        forest.sum_areas();
        forest
    }

    fn plant_bodies(&mut self, scene: &Scene, at: u32) {
        let bodies: Vec<u32> = (0..scene.bodies.len() as u32)
            .filter(|&b| !scene.bodies[b as usize].patches.is_empty())
            .collect();
        let boxes: Vec<Aabb> = bodies.iter().map(|&b| box_at_start(scene, BodyId(b))).collect();
        let tree = binary_tree(&boxes);
        self.plant(&tree, 0, at, NONE, &mut |forest, leaf, id| {
            forest.plant_body(scene, bodies[leaf as usize], id);
        });
    }

    fn plant_body(&mut self, scene: &Scene, body: u32, at: u32) {
        self.body_roots[body as usize] = ElementId(at);
        let range = scene.bodies[body as usize].patches.clone();
        let boxes: Vec<Aabb> =
            range.clone().map(|p| Aabb::of(scene.patches[p as usize].corners_in_body())).collect();
        let tree = binary_tree(&boxes);
        self.set(at, Kind::Cluster, body);
        let child = self.add_children(at, 1);
        self.plant(&tree, 0, child, body, &mut |forest, leaf, id| {
            let patch = range.start + leaf;
            forest.patch_roots[patch as usize] = ElementId(id);
            forest.plant_polygon(patch, &scene.patches[patch as usize].corners, id);
        });
    }

    fn plant(
        &mut self,
        tree: &[Branch],
        node: u32,
        at: u32,
        subject: u32,
        leaf: &mut dyn FnMut(&mut Forest, u32, u32),
    ) {
        match tree[node as usize] {
            Branch::Leaf(k) => leaf(self, k, at),
            Branch::Inner(a, b) => {
                self.set(at, Kind::Cluster, subject);
                let child = self.add_children(at, 2);
                self.plant(tree, a, child, subject, leaf);
                self.plant(tree, b, child + 1, subject, leaf);
            }
        }
    }

    fn plant_polygon(&mut self, patch: u32, corners: &[DVec2], at: u32) {
        if corners.len() <= 4 {
            self.set(at, Kind::Element, patch);
            let shape = Shape::new(corners);
            let node = &mut self.nodes[at as usize];
            node.facet = at;
            node.path = 1;
            node.set_shape(&shape);
            return;
        }
        self.set(at, Kind::Polygon, patch);
        let (one, two) = split_convex(corners);
        let child = self.add_children(at, 2);
        self.plant_polygon(patch, &one, child);
        self.plant_polygon(patch, &two, child + 1);
    }

    fn set(&mut self, at: u32, kind: Kind, subject: u32) {
        let node = &mut self.nodes[at as usize];
        node.kind = kind;
        node.subject = subject;
    }

    fn add_children(&mut self, at: u32, count: u16) -> u32 {
        let first = self.nodes.len() as u32;
        self.nodes.extend((0..u32::from(count)).map(|_| blank(Kind::Cluster, at, NONE)));
        let node = &mut self.nodes[at as usize];
        node.first_child = first;
        node.child_count = count;
        first
    }

    fn sum_areas(&mut self) {
        let mut sums = vec![0.0_f64; self.nodes.len()];
        for id in (0..self.nodes.len()).rev() {
            let node = &self.nodes[id];
            if node.kind == Kind::Element {
                sums[id] = node.shape().area();
            }
            if node.parent != NONE {
                sums[node.parent as usize] += sums[id];
            }
        }
        for (node, sum) in self.nodes.iter_mut().zip(sums) {
            node.area_m2 = sum as f32;
        }
    }

    /// The scene's node.
    pub const ROOT: ElementId = ElementId(0);

    /// Nodes alive.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there is nothing but the root.
    pub fn is_empty(&self) -> bool {
        self.nodes.len() <= 1
    }

    /// Ids below this are a pure function of the scene.
    pub fn fixed_len(&self) -> u32 {
        self.fixed_len
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        (self.nodes.capacity() * size_of::<Node>()) as u64
    }

    /// What the node is.
    #[inline]
    pub fn kind(&self, id: ElementId) -> Kind {
        self.nodes[id.0 as usize].kind
    }

    /// The node's parent; `None` for the root.
    #[inline]
    pub fn parent(&self, id: ElementId) -> Option<ElementId> {
        let parent = self.nodes[id.0 as usize].parent;
        (parent != NONE).then_some(ElementId(parent))
    }

    /// Ids of the node's children; empty for a leaf.
    #[inline]
    pub fn children(&self, id: ElementId) -> Range<u32> {
        let node = &self.nodes[id.0 as usize];
        match node.child_count {
            0 => 0..0,
            n => node.first_child..node.first_child + u32::from(n),
        }
    }

    /// Area, m2; 0 for a light. Exact up to single precision.
    #[inline]
    pub fn area_m2(&self, id: ElementId) -> f64 {
        f64::from(self.nodes[id.0 as usize].area_m2)
    }

    /// The patch an element or polygon belongs to.
    #[inline]
    pub fn patch(&self, id: ElementId) -> Option<PatchId> {
        let node = &self.nodes[id.0 as usize];
        matches!(node.kind, Kind::Element | Kind::Polygon).then_some(PatchId(node.subject))
    }

    /// Index of a light in the scene.
    #[inline]
    pub fn light(&self, id: ElementId) -> Option<usize> {
        let node = &self.nodes[id.0 as usize];
        (node.kind == Kind::Light).then_some(node.subject as usize)
    }

    /// The name of an element or light that does not depend on history.
    #[inline]
    pub fn key(&self, id: ElementId) -> ElementKey {
        let node = &self.nodes[id.0 as usize];
        ElementKey { facet: node.facet, path: node.path }
    }

    /// Corners of an element in its patch's frame.
    #[inline]
    pub fn shape(&self, id: ElementId) -> Shape {
        self.nodes[id.0 as usize].shape()
    }

    /// Index of the coarse element that holds this one, if coarse elements have been numbered.
    #[inline]
    pub fn coarse(&self, id: ElementId) -> Option<usize> {
        let coarse = self.nodes[id.0 as usize].coarse;
        (coarse != NONE).then_some(coarse as usize)
    }

    /// Makes `id` the coarse element number `index`; elements made below it later inherit it.
    pub fn set_coarse(&mut self, id: ElementId, index: usize) {
        self.nodes[id.0 as usize].coarse = index as u32;
    }

    /// The root node of a patch.
    pub fn patch_root(&self, patch: PatchId) -> ElementId {
        self.patch_roots[patch.0 as usize]
    }

    /// The cluster of a body.
    pub fn body_root(&self, body: BodyId) -> ElementId {
        self.body_roots[body.0 as usize]
    }

    /// Whether the element may be split once more: paths have room for 15 levels.
    #[inline]
    pub fn can_split(&self, id: ElementId) -> bool {
        let path = self.nodes[id.0 as usize].path;
        self.nodes[id.0 as usize].child_count > 0 || path.leading_zeros() > 31 - 2 * LEVELS_MAX + 1
    }

    /// The children of an element, made if it is a leaf. Areas of the children sum to the
    /// parent's up to single precision. Returns the ids and whether they are new.
    ///
    /// # Panics
    /// If `id` is no element or has no room below it.
    pub fn split(&mut self, id: ElementId) -> (Range<u32>, bool) {
        let node = self.nodes[id.0 as usize];
        if node.child_count > 0 {
            return (self.children(id), false);
        }
        assert!(node.kind == Kind::Element && self.can_split(id), "{id:?} cannot be split");
        let shapes = node.shape().children();
        let first = self.nodes.len() as u32;
        for (k, shape) in shapes.iter().enumerate() {
            let mut child = blank(Kind::Element, id.0, node.subject);
            child.facet = node.facet;
            child.path = node.path << 2 | k as u32;
            child.coarse = node.coarse;
            child.set_shape(shape);
            self.nodes.push(child);
        }
        let parent = &mut self.nodes[id.0 as usize];
        parent.first_child = first;
        parent.child_count = shapes.len() as u16;
        (self.children(id), true)
    }
}

impl Node {
    fn shape(&self) -> Shape {
        let corner = |k: usize| {
            let [x, y] = self.corners[k];
            DVec2::new(f64::from(x), f64::from(y))
        };
        Shape {
            corners: [corner(0), corner(1), corner(2), corner(3)],
            len: self.corner_count as usize,
        }
    }

    fn set_shape(&mut self, shape: &Shape) {
        self.corners = shape.corners.map(|c| [c.x as f32, c.y as f32]);
        self.corner_count = shape.len as u8;
        self.area_m2 = self.shape().area() as f32;
    }
}

fn blank(kind: Kind, parent: u32, subject: u32) -> Node {
    Node {
        corners: [[0.0; 2]; 4],
        parent,
        first_child: NONE,
        subject,
        facet: NONE,
        path: 0,
        coarse: NONE,
        area_m2: 0.0,
        child_count: 0,
        kind,
        corner_count: 0,
    }
}

/// Box of a body where it is at time 0, or in its own frame if it is absent then.
fn box_at_start(scene: &Scene, body: BodyId) -> Aabb {
    let pose = scene.pose(body, 0.0).unwrap_or(crate::geometry::Pose::IDENTITY);
    let corners = scene.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
    Aabb::of(corners.map(|c: DVec3| pose.point(c)))
}
