//! The forest itself: a pool of nodes, the fixed part (down to facets) first.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::clusters::{Branch, binary_tree};
use super::split::{Chart, Extent, Place, Shape};
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
    /// Nothing: room of elements that were reaped, to be used again.
    Vacant,
}

/// The name of an element that does not depend on history: its facet and the path below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ElementKey {
    /// Id of the quadtree's root, which is fixed.
    pub facet: u32,
    /// A one bit, then two bits a level.
    pub path: u32,
}

/// 44 bytes.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Where an element lies within its facet.
    place: Place,
    parent: u32,
    first_child: u32,
    facet: u32,
    path: u32,
    coarse: u32,
    /// Pairs that are refined on this element.
    users: u32,
    area_m2: f32,
    child_count: u16,
    kind: Kind,
}

const NONE: u32 = u32::MAX;

/// Levels that a path has room for.
const LEVELS_MAX: u32 = 15;

/// All elements of a scene.
///
/// Nodes with ids below [`Forest::fixed_len`] (clusters, lights, polygons and facets) are a pure
/// function of the scene; quadtree elements come and go above them. Which of these exist follows
/// from the pairs that are refined on them; their ids depend on history, their names do not.
#[derive(Clone, Debug)]
pub struct Forest {
    nodes: Vec<Node>,
    fixed_len: u32,
    /// Elements with ids below this are never reaped.
    kept_len: u32,
    /// Patch, light or body of each node of the fixed part; `NONE` for groups of bodies.
    subjects: Vec<u32>,
    /// Geometry of each facet, by id; of no meaning for the rest of the fixed part.
    charts: Vec<Chart>,
    patch_roots: Vec<ElementId>,
    body_roots: Vec<ElementId>,
    facets: Vec<ElementId>,
    /// First ids of vacant groups of two and of four.
    vacant: [Vec<u32>; 2],
    /// Elements that lost their last user.
    loose: Vec<u32>,
    /// Elements whose children came or went since [`Forest::take_changed`].
    changed: Vec<ElementId>,
    counts: Counts,
}

/// How many elements there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Elements, at all levels.
    pub elements: u64,
    /// Elements without children.
    pub leaves: u64,
}

impl Forest {
    /// The fixed part of the forest of a scene.
    pub fn new(scene: &Scene) -> Forest {
        let mut forest = Forest {
            nodes: Vec::new(),
            fixed_len: 0,
            kept_len: 0,
            subjects: Vec::new(),
            charts: Vec::new(),
            patch_roots: vec![ElementId(NONE); scene.patches.len()],
            body_roots: vec![ElementId(NONE); scene.bodies.len()],
            facets: Vec::new(),
            vacant: [Vec::new(), Vec::new()],
            loose: Vec::new(),
            changed: Vec::new(),
            counts: Counts::default(),
        };
        forest.push_fixed(Kind::Cluster, NONE, 1);
        let lights = scene.lights.len() as u32;
        let children = u32::from(!scene.patches.is_empty()) + lights;
        forest.push_fixed(Kind::Light, 0, children);
        forest.nodes[0].first_child = 1;
        forest.nodes[0].child_count = u16::try_from(children).expect("fewer than 65,536 lights");
        let first_light = 1 + children - lights;
        for (light, id) in (first_light..=children).enumerate() {
            forest.subjects[id as usize] = light as u32;
            let node = &mut forest.nodes[id as usize];
            (node.facet, node.path) = (id, 1);
        }
        if !scene.patches.is_empty() {
            forest.plant_bodies(scene, 1);
        }
        forest.facets.sort_unstable();
        forest.fixed_len = forest.nodes.len() as u32;
        forest.kept_len = forest.fixed_len;
        forest.sum_areas();
        forest
    }

    fn push_fixed(&mut self, kind: Kind, parent: u32, count: u32) -> u32 {
        let first = self.nodes.len() as u32;
        let len = self.nodes.len() + count as usize;
        self.nodes.resize(len, blank(kind, parent));
        self.subjects.resize(len, NONE);
        self.charts.resize(len, Chart::of(&Shape { corners: [DVec2::ZERO; 4], len: 4 }));
        first
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
            self.charts[at as usize] = Chart::of(&shape);
            let node = &mut self.nodes[at as usize];
            (node.facet, node.path, node.place) = (at, 1, Place::whole(shape.len));
            node.area_m2 = shape.area() as f32;
            self.facets.push(ElementId(at));
            self.counts.elements += 1;
            self.counts.leaves += 1;
            return;
        }
        self.set(at, Kind::Polygon, patch);
        let (one, two) = split_convex(corners);
        let child = self.add_children(at, 2);
        self.plant_polygon(patch, &one, child);
        self.plant_polygon(patch, &two, child + 1);
    }

    fn set(&mut self, at: u32, kind: Kind, subject: u32) {
        self.nodes[at as usize].kind = kind;
        self.subjects[at as usize] = subject;
    }

    fn add_children(&mut self, at: u32, count: u16) -> u32 {
        let first = self.push_fixed(Kind::Cluster, at, u32::from(count));
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
                sums[id] = self.shape(ElementId(id as u32)).area();
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

    /// Room for nodes: ids are below this; some may be vacant.
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

    /// Ids below this are never reaped.
    pub fn kept_len(&self) -> u32 {
        self.kept_len
    }

    /// How many elements there are.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The quadtree roots, ascending.
    pub fn facets(&self) -> &[ElementId] {
        &self.facets
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        let fixed = self.charts.capacity() * size_of::<Chart>() + self.subjects.capacity() * 4;
        let lists = self.vacant.iter().map(Vec::capacity).sum::<usize>() + self.loose.capacity();
        (self.nodes.capacity() * size_of::<Node>() + fixed + lists * 4) as u64
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
        match node.kind {
            Kind::Element => Some(PatchId(self.subjects[node.facet as usize])),
            Kind::Polygon => Some(PatchId(self.subjects[id.0 as usize])),
            _ => None,
        }
    }

    /// The node of the fixed part that an element is in; the node itself for any other.
    #[inline]
    pub fn fixed(&self, id: ElementId) -> ElementId {
        if id.0 < self.fixed_len { id } else { ElementId(self.nodes[id.0 as usize].facet) }
    }

    /// Index of a light in the scene.
    #[inline]
    pub fn light(&self, id: ElementId) -> Option<usize> {
        let is_light = self.nodes[id.0 as usize].kind == Kind::Light;
        is_light.then(|| self.subjects[id.0 as usize] as usize)
    }

    /// The body of a cluster; `None` for groups of bodies and for what is no cluster.
    #[inline]
    pub fn cluster_body(&self, id: ElementId) -> Option<BodyId> {
        let node = &self.nodes[id.0 as usize];
        let subject = *self.subjects.get(id.0 as usize)?;
        (node.kind == Kind::Cluster && subject != NONE).then_some(BodyId(subject))
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
        let node = &self.nodes[id.0 as usize];
        self.charts[node.facet as usize].shape(&node.place)
    }

    /// Where an element lies in its patch's frame, and how far it reaches.
    #[inline]
    pub fn extent(&self, id: ElementId) -> Extent {
        let node = &self.nodes[id.0 as usize];
        self.charts[node.facet as usize].extent(&node.place)
    }

    /// Index of the coarse element that holds this one, if coarse elements have been numbered.
    #[inline]
    pub fn coarse(&self, id: ElementId) -> Option<usize> {
        let coarse = self.nodes[id.0 as usize].coarse;
        (coarse != NONE).then_some(coarse as usize)
    }

    /// Whether this is one of the coarse elements itself, not a part of one.
    #[inline]
    pub fn is_coarse_root(&self, id: ElementId) -> bool {
        let node = &self.nodes[id.0 as usize];
        node.coarse != NONE
            && (node.parent == NONE || self.nodes[node.parent as usize].coarse == NONE)
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

    /// Everything that exists now stays for good.
    pub fn keep_all(&mut self) {
        self.kept_len = self.nodes.len() as u32;
        self.changed.clear();
    }

    /// The children of an element, made if it is a leaf, with one more user. Areas of the children
    /// sum to the parent's up to single precision. Returns the ids and whether they are new.
    ///
    /// # Panics
    /// If `id` is no element or has no room below it.
    pub fn split(&mut self, id: ElementId) -> (Range<u32>, bool) {
        self.nodes[id.0 as usize].users += 1;
        let node = self.nodes[id.0 as usize];
        if node.child_count > 0 {
            return (self.children(id), false);
        }
        assert!(node.kind == Kind::Element && self.can_split(id), "{id:?} cannot be split");
        let chart = self.charts[node.facet as usize];
        let (places, count) = node.place.children(chart.len, chart.shape(&node.place).cut());
        let first = self.room_for(count);
        for (k, place) in places[..count].iter().enumerate() {
            let mut child = blank(Kind::Element, id.0);
            child.facet = node.facet;
            child.path = node.path << 2 | k as u32;
            child.coarse = node.coarse;
            child.place = *place;
            child.area_m2 = chart.shape(place).area() as f32;
            self.nodes[first as usize + k] = child;
        }
        let parent = &mut self.nodes[id.0 as usize];
        parent.first_child = first;
        parent.child_count = count as u16;
        self.counts.elements += count as u64;
        self.counts.leaves += count as u64 - 1;
        self.changed.push(id);
        (self.children(id), true)
    }

    fn room_for(&mut self, count: usize) -> u32 {
        self.vacant[count / 4].pop().unwrap_or_else(|| {
            let first = self.nodes.len();
            self.nodes.resize(first + count, blank(Kind::Vacant, NONE));
            first as u32
        })
    }

    /// Takes back one use of an element's children; [`Forest::reap`] removes what has none left.
    ///
    /// # Panics
    /// If there is no user.
    pub fn release(&mut self, id: ElementId) {
        let users = &mut self.nodes[id.0 as usize].users;
        *users = users.checked_sub(1).expect("released more often than split");
        if *users == 0 {
            self.loose.push(id.0);
        }
    }

    /// Removes the children of elements that lost their last user; returns how many.
    pub fn reap(&mut self) -> u64 {
        let mut reaped = 0;
        for id in std::mem::take(&mut self.loose) {
            let node = &self.nodes[id as usize];
            if node.users == 0 && node.kind == Kind::Element {
                reaped += self.remove_children(ElementId(id));
            }
        }
        reaped
    }

    fn remove_children(&mut self, id: ElementId) -> u64 {
        let children = self.children(id);
        if children.is_empty() || children.start < self.kept_len {
            return 0;
        }
        let mut count = children.len() as u64;
        self.counts.elements -= count;
        self.counts.leaves -= count - 1;
        for child in children.clone() {
            debug_assert_eq!(
                self.nodes[child as usize].users, 0,
                "a child outlives its parent's pair"
            );
            count += self.remove_children(ElementId(child));
            self.nodes[child as usize] = blank(Kind::Vacant, NONE);
        }
        self.vacant[children.len() / 4].push(children.start);
        self.nodes[id.0 as usize].child_count = 0;
        self.changed.push(id);
        count
    }

    /// Elements whose children came or went since the last call; some may be vacant by now, some
    /// may be named twice.
    pub fn take_changed(&mut self) -> Vec<ElementId> {
        std::mem::take(&mut self.changed)
    }
}

fn blank(kind: Kind, parent: u32) -> Node {
    Node {
        place: Place::whole(4),
        parent,
        first_child: NONE,
        facet: NONE,
        path: 0,
        coarse: NONE,
        users: 0,
        area_m2: 0.0,
        child_count: 0,
        kind,
    }
}

/// Box of a body where it is at time 0, or in its own frame if it is absent then.
fn box_at_start(scene: &Scene, body: BodyId) -> Aabb {
    let pose = scene.pose(body, 0.0).unwrap_or(crate::geometry::Pose::IDENTITY);
    let corners = scene.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
    Aabb::of(corners.map(|c: DVec3| pose.point(c)))
}
