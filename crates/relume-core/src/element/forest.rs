//! The forest itself: a pool of nodes, the fixed part (down to facets) first.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::clusters::{Branch, binary_tree};
use super::exposed::{exposed_extent, exposed_m2};
use super::groups::{Group, Groups, Layout, Sort};
use super::split::{Chart, Extent, Place, Shape};
use crate::geometry::{Aabb, cut_along, polygon_area, split_convex};
use crate::scene::{BodyId, Covered, Enclosure, Lines, PatchId, Scene, Solid, Solids};

mod replant;

pub use replant::old_coarse_numbers;

/// Index of a node in a [`Forest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ElementId(pub u32);

/// What a node of the forest is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A group of nodes: the scene, a group of bodies, a body, or a part of its hierarchy.
    Cluster,
    /// A planar polygon with more than four corners, or one that lines of contact cut: a group of coplanar nodes.
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
    /// Name of the quadtree's root: its id in the forest of the scene as it was made, or one that it has since it was inserted.
    pub facet: u32,
    /// A one bit, then two bits a level.
    pub path: u32,
}

/// What differs between siblings: 20 bytes.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Where an element lies within its facet.
    place: Place,
    fan: Fan,
    area_m2: f32,
}

/// What two siblings have in common; a node of the fixed part has one of its own. 20 bytes.
#[derive(Clone, Copy, Debug)]
struct Twins {
    parent: u32,
    facet: u32,
    /// Path of the first of them; that of the other is one more.
    path: u32,
    /// Coarse element that they are a part of.
    coarse: u32,
    /// Pairs that are refined on the parent; kept where its first two children are.
    users: u32,
}

/// The children of a node in 32 bits: the first one's id, and their number in the two highest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Fan(u32);

impl Fan {
    const SHIFT: u32 = 30;
    const LEAF: Fan = Fan(0);
    /// In the fixed part: as many children as [`Fixed::child_counts`] says. Beyond it: no node.
    const OTHER: Fan = Fan(3 << Fan::SHIFT);

    /// Two or four children.
    fn new(first: u32, count: usize) -> Fan {
        debug_assert!(first >> Fan::SHIFT == 0, "more than 2^30 elements");
        Fan(first | (count as u32 / 2) << Fan::SHIFT)
    }

    fn other(first: u32) -> Fan {
        Fan(first | Fan::OTHER.0)
    }

    fn is_other(self) -> bool {
        self.0 >= Fan::OTHER.0
    }

    fn first(self) -> u32 {
        self.0 & !Fan::OTHER.0
    }

    /// The children of anything but [`Fan::other`].
    fn range(self) -> Range<u32> {
        let count = (self.0 >> Fan::SHIFT) * 2;
        self.first()..self.first() + count
    }
}

const NONE: u32 = u32::MAX;

/// In place of a body: all that never moves, planted as one.
const STAGE: u32 = u32::MAX - 1;

/// What is planted, with the lines that patches are cut along, and in which order.
type Plot<'a> = (&'a Scene, &'a Cuts, &'a Layout);

/// Vectors of the forest are given room for this share more than they need.
const SLACK: usize = 32;

/// Elements of which a smaller share is exposed count as covered wholly.
const EXPOSED_LEAST: f64 = 1.0 / 16.0;

/// Side over distance of a square from which a part of the sky is wide: six discs of the sun, less than two degrees.
const WIDE: f64 = 0.03;

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
    /// One for each node of the fixed part, then one for every two.
    twins: Vec<Twins>,
    /// Area of what light can reach of the elements that are partly or wholly covered, m2.
    exposed: BTreeMap<u32, f32>,
    fixed_len: u32,
    /// Elements with ids below this are never reaped.
    kept_len: u32,
    /// What no split and no motion changes: one copy for all clones.
    fixed: Arc<Fixed>,
    /// First ids of vacant groups of two and of four.
    vacant: [Vec<u32>; 2],
    /// Elements that lost their last user.
    loose: Vec<u32>,
    /// Elements whose children came or went since [`Forest::take_changed`].
    changed: Vec<ElementId>,
    counts: Counts,
}

/// What is known of the fixed part alone, by id.
#[derive(Clone, Debug, Default)]
struct Fixed {
    kinds: Vec<Kind>,
    child_counts: Vec<u16>,
    /// Patch, light or body of each node; `NONE` for groups of bodies.
    subjects: Vec<u32>,
    /// Geometry of each facet; of no meaning for other nodes.
    charts: Vec<Chart>,
    /// Numbers of the coarse elements, by id; empty if they have not been numbered.
    coarse: Vec<u32>,
    patch_roots: Vec<ElementId>,
    body_roots: Vec<ElementId>,
    facets: Vec<ElementId>,
    /// The convex solids that patches are faces of.
    solids: Solids,
    /// What of each patch is covered, by patch.
    covered: Vec<Covered>,
    /// Box around the unit normals of the patches at or below each node, in their bodies' frames.
    normals: Vec<Aabb>,
    /// Whether a patch emits light at any time, by patch.
    glows: Vec<bool>,
    /// Area of the patches connected with each patch, itself among them, by patch, m2.
    connected_m2: Vec<f64>,
    /// Whether a node stands for light from outside, by id; empty if none does.
    distant: Vec<bool>,
    /// Whether it is a wide part of the sky, by id; empty if nothing is distant.
    wide: Vec<bool>,
    /// How many facets receive light: they come before those that are distant.
    near_facets: usize,
    /// Clusters that may be ends of links.
    groups: Groups,
    /// How many children of the root are of what the scene was made with: they come first.
    made_children: u32,
    /// Area of what the scene was made with, m2.
    made_m2: f32,
    /// Names by id, where bodies were inserted; else names are ids.
    names: Vec<u32>,
}

/// Where elements went when the forest was put together, or followed its scene: those that stayed keep their order.
#[derive(Clone, Debug)]
pub struct Renumbering {
    new_of: Vec<u32>,
    old_of: Vec<u32>,
}

impl Renumbering {
    /// From new ids by old one, and old ones by new one; old ids that are gone lead beyond all others.
    pub fn new(new_of: Vec<u32>, old_of: Vec<u32>) -> Renumbering {
        Renumbering { new_of, old_of }
    }

    /// New id of an element that is still there.
    #[inline]
    pub fn new_of(&self, old: u32) -> u32 {
        self.new_of[old as usize]
    }

    /// Old ids, by new one.
    pub fn old_of(&self) -> &[u32] {
        &self.old_of
    }

    /// How many old ids there are.
    pub fn old_len(&self) -> usize {
        self.new_of.len()
    }

    /// That of the ids below a bound of the old ones and one of the new.
    pub fn below(&self, [old, new]: [u32; 2]) -> Renumbering {
        let (new_of, old_of) = (&self.new_of[..old as usize], &self.old_of[..new as usize]);
        Renumbering::new(new_of.to_vec(), old_of.to_vec())
    }
}

/// How many elements there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Elements, at all levels.
    pub elements: u64,
    /// Elements without children.
    pub leaves: u64,
}

/// The children of the root.
struct Rows {
    /// Bodies that are there.
    near: Vec<u32>,
    /// Bodies that are far away.
    far: Vec<u32>,
    /// The node after those of the lights: of what is far away, if anything is.
    after_lights: u32,
    /// The node of the first inserted body.
    first_inserted: u32,
}

impl Forest {
    /// The fixed part of the forest of a scene, in which no cluster is an end of links.
    pub fn new(scene: &Scene) -> Forest {
        Forest::displaced(scene, &|_| false)
    }

    /// The same where bodies that no clip moves are not where the scene has them at rest.
    pub fn displaced(scene: &Scene, is_displaced: &dyn Fn(BodyId) -> bool) -> Forest {
        Forest::planted(scene, &Layout::default(), is_displaced)
    }

    /// The same with clusters of small patches as ends of links, where there are many such patches; where there are not,
    /// it is that of [`Forest::displaced`].
    pub fn with_groups(scene: &Scene, is_displaced: &dyn Fn(BodyId) -> bool) -> Forest {
        let layout = Layout::of(scene, is_displaced);
        let mut forest = Forest::planted(scene, &layout, is_displaced);
        if layout.has_groups() {
            let groups = Groups::of(scene, &forest, &layout);
            for id in groups.ids() {
                let twins = &mut forest.twins[id.0 as usize];
                (twins.facet, twins.path) = (id.0, 1);
            }
            forest.fixed_mut().groups = groups;
        }
        forest
    }

    fn planted(scene: &Scene, layout: &Layout, is_displaced: &dyn Fn(BodyId) -> bool) -> Forest {
        let solids = scene.solids();
        let mut forest = Forest {
            nodes: Vec::new(),
            twins: Vec::new(),
            exposed: BTreeMap::new(),
            // All that is planted here.
            fixed_len: u32::MAX,
            kept_len: u32::MAX,
            fixed: Arc::new(Fixed {
                patch_roots: vec![ElementId(NONE); scene.patches.len()],
                body_roots: vec![ElementId(NONE); scene.bodies.len()],
                covered: scene.covered(&solids, is_displaced),
                solids,
                ..Fixed::default()
            }),
            vacant: [Vec::new(), Vec::new()],
            loose: Vec::new(),
            changed: Vec::new(),
            counts: Counts::default(),
        };
        forest.push_fixed(Kind::Cluster, NONE, 1);
        let rows = forest.sow(scene);
        let cuts = Cuts::new(scene);
        let to = (scene, &cuts, layout);
        if !rows.near.is_empty() {
            forest.plant_bodies(to, &rows.near, 1);
        }
        let mut beds = Vec::new();
        for (at, body) in (rows.first_inserted..).zip(scene.inserted_bodies()) {
            let first = forest.nodes.len() as u32;
            forest.plant_body(to, body.0, at);
            let names = scene.names_of(body).expect("it was inserted").clone();
            beds.push(Bed { root: at, below: first..forest.nodes.len() as u32, names });
        }
        if !rows.far.is_empty() {
            let first = forest.nodes.len();
            forest.plant_bodies(to, &rows.far, rows.after_lights);
            let mut distant = vec![false; forest.nodes.len()];
            distant[rows.after_lights as usize] = true;
            distant[first..].fill(true);
            forest.fixed_mut().distant = distant;
            forest.fixed_mut().wide = forest.wide_parts(scene, first);
        }
        if !beds.is_empty() {
            forest.fixed_mut().names = names_in(forest.nodes.len() as u32, &beds);
        }
        forest.finish_fixed(scene);
        forest
    }

    /// Makes the children of the root: what is there, the lights, what is far away, and each body that was inserted.
    fn sow(&mut self, scene: &Scene) -> Rows {
        let bodies = |distant: bool| -> Vec<u32> {
            let bodies = (0..).zip(&scene.bodies);
            let is_wanted = |(k, b): &(u32, &crate::scene::Body)| {
                !b.patches.is_empty() && b.distant == distant && !scene.is_inserted(BodyId(*k))
            };
            bodies.filter(is_wanted).map(|(k, _)| k).collect()
        };
        let (near, far) = (bodies(false), bodies(true));
        let first_light = 1 + u32::from(!near.is_empty());
        let after_lights = first_light + scene.lights.len() as u32;
        let made_children = after_lights + u32::from(!far.is_empty()) - 1;
        let children = made_children + scene.inserted_bodies().len() as u32;
        self.push_fixed(Kind::Light, 0, children);
        self.nodes[0].fan = Fan::other(1);
        self.fixed_mut().made_children = made_children;
        self.fixed_mut().child_counts[0] =
            u16::try_from(children).expect("fewer than 65,536 lights and inserted bodies");
        for (light, id) in (first_light..after_lights).enumerate() {
            self.fixed_mut().subjects[id as usize] = light as u32;
            let twins = &mut self.twins[id as usize];
            (twins.facet, twins.path) = (id, 1);
        }
        Rows { near, far, after_lights, first_inserted: made_children + 1 }
    }

    /// Which nodes are wide parts of the sky; those from `first` on are distant.
    fn wide_parts(&self, scene: &Scene, first: usize) -> Vec<bool> {
        let is_wide = |id: usize| {
            let id = ElementId(id as u32);
            let wide_m2 = (WIDE * scene.outside_m).powi(2);
            self.kind(id) == Kind::Element && self.shape(id).area() > wide_m2
        };
        (0..self.nodes.len()).map(|id| id >= first && is_wide(id)).collect()
    }

    /// Works out what is known of the fixed part once all of it is there.
    fn finish_fixed(&mut self, scene: &Scene) {
        self.fixed_mut().facets.sort_unstable();
        let near_facets = self.facets().partition_point(|facet| !self.is_distant(*facet));
        self.fixed_mut().near_facets = near_facets;
        self.fixed_len = self.nodes.len() as u32;
        self.kept_len = self.fixed_len;
        self.sum_areas();
        self.fixed_mut().normals = self.boxes_of_normals(scene);
        self.fixed_mut().glows =
            scene.patches.iter().map(|patch| scene.patch_emits(patch)).collect();
        self.fixed_mut().connected_m2 = scene.connected_areas_m2();
    }

    fn boxes_of_normals(&self, scene: &Scene) -> Vec<Aabb> {
        let mut boxes = vec![Aabb::EMPTY; self.nodes.len()];
        for id in (0..self.nodes.len()).rev() {
            let element = ElementId(id as u32);
            if let Some(patch) = self.patch(element) {
                boxes[id] = Aabb::of([scene.patches[patch.0 as usize].frame.normal]);
            }
            if let Some(parent) = self.parent(element) {
                boxes[parent.0 as usize] = boxes[parent.0 as usize].union(boxes[id]);
            }
        }
        boxes
    }

    fn push_fixed(&mut self, kind: Kind, parent: u32, count: u32) -> u32 {
        let first = self.nodes.len() as u32;
        let len = self.nodes.len() + count as usize;
        self.nodes.resize(len, Node { fan: Fan::LEAF, ..Node::VACANT });
        self.twins.resize(len, Twins { parent, ..Twins::VACANT });
        let fixed = self.fixed_mut();
        fixed.kinds.resize(len, kind);
        fixed.child_counts.resize(len, 0);
        fixed.subjects.resize(len, NONE);
        fixed.charts.resize(len, Chart::of(&Shape { corners: [DVec2::ZERO; 4], len: 4 }));
        first
    }

    fn fixed_mut(&mut self) -> &mut Fixed {
        Arc::make_mut(&mut self.fixed)
    }

    fn plant_bodies(&mut self, to: Plot<'_>, bodies: &[u32], at: u32) {
        let (scene, _, layout) = to;
        let is_staged = |body: &&u32| layout.is_staged(**body);
        let staged: Vec<u32> = bodies.iter().filter(is_staged).copied().collect();
        let alone = bodies.iter().filter(|body| !is_staged(body));
        // What is planted as one comes first.
        let mut wholes: Vec<Vec<u32>> = alone.map(|&body| vec![body]).collect();
        if !staged.is_empty() {
            wholes.insert(0, staged);
        }
        let of_whole = |whole: &Vec<u32>| {
            let boxes = whole.iter().map(|&body| box_at_start(scene, BodyId(body)));
            boxes.fold(Aabb::EMPTY, Aabb::union)
        };
        let boxes: Vec<Aabb> = wholes.iter().map(of_whole).collect();
        let tree = binary_tree(&boxes);
        self.plant(&tree, 0, at, NONE, &mut |forest, leaf, id| {
            let whole = &wholes[leaf as usize];
            match layout.is_staged(whole[0]) {
                true => forest.plant_sorted(to, whole, STAGE, id),
                false => forest.plant_body(to, whole[0], id),
            }
        });
    }

    fn plant_body(&mut self, to: Plot<'_>, body: u32, at: u32) {
        self.fixed_mut().body_roots[body as usize] = ElementId(at);
        if to.2.is_sorted(body) {
            return self.plant_sorted(to, &[body], body, at);
        }
        let patches: Vec<u32> = to.0.bodies[body as usize].patches.clone().collect();
        self.set(at, Kind::Cluster, body);
        let child = self.add_children(at, 1);
        self.plant_patches(to, &patches, body, child);
    }

    /// Some bodies as one, with a tree for each sort of their patches.
    fn plant_sorted(&mut self, to: Plot<'_>, bodies: &[u32], subject: u32, at: u32) {
        let (scene, _, layout) = to;
        let all = || bodies.iter().flat_map(|&body| scene.bodies[body as usize].patches.clone());
        let of_sort =
            |sort: Sort| all().filter(|&patch| layout.sort(patch) == sort).collect::<Vec<u32>>();
        let sorts = Sort::ALL.map(of_sort);
        let sorts: Vec<&Vec<u32>> = sorts.iter().filter(|patches| !patches.is_empty()).collect();
        self.set(at, Kind::Cluster, subject);
        let first = self.add_children(at, sorts.len() as u16);
        for (child, patches) in (first..).zip(sorts) {
            self.plant_patches(to, patches, subject, child);
        }
    }

    fn plant_patches(&mut self, to: Plot<'_>, patches: &[u32], subject: u32, at: u32) {
        let (scene, cuts, _) = to;
        // What is planted together with others rests, so that its body's frame is the world's.
        let of_patch = |&patch: &u32| Aabb::of(scene.patches[patch as usize].corners_in_body());
        let boxes: Vec<Aabb> = patches.iter().map(of_patch).collect();
        let tree = binary_tree(&boxes);
        self.plant(&tree, 0, at, subject, &mut |forest, leaf, id| {
            let patch = patches[leaf as usize];
            forest.fixed_mut().patch_roots[patch as usize] = ElementId(id);
            let corners = &scene.patches[patch as usize].corners;
            forest.plant_polygon((patch, &cuts.of(patch), 0), corners, id);
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

    /// A polygon as a facet, or as a group of facets where lines cut it or it has too many corners; `cut` is how often it was cut
    /// before.
    fn plant_polygon(
        &mut self,
        (patch, cuts, cut): (u32, &PatchCuts<'_>, u32),
        corners: &[DVec2],
        at: u32,
    ) {
        let along_lines = cuts.apply(corners, cut);
        let cut = cut + u32::from(along_lines.is_some());
        let parts = along_lines.or_else(|| (corners.len() > 4).then(|| split_convex(corners)));
        let Some((one, two)) = parts else {
            return self.plant_facet(patch, corners, at);
        };
        self.set(at, Kind::Polygon, patch);
        let child = self.add_children(at, 2);
        self.plant_polygon((patch, cuts, cut), &one, child);
        self.plant_polygon((patch, cuts, cut), &two, child + 1);
    }

    fn plant_facet(&mut self, patch: u32, corners: &[DVec2], at: u32) {
        self.set(at, Kind::Element, patch);
        let shape = Shape::new(corners);
        let fixed = self.fixed_mut();
        fixed.charts[at as usize] = Chart::of(&shape);
        fixed.facets.push(ElementId(at));
        self.nodes[at as usize].place = Place::whole(shape.len);
        let twins = &mut self.twins[at as usize];
        (twins.facet, twins.path) = (at, 1);
        self.counts.elements += 1;
        self.counts.leaves += 1;
    }

    fn set(&mut self, at: u32, kind: Kind, subject: u32) {
        let fixed = self.fixed_mut();
        fixed.kinds[at as usize] = kind;
        fixed.subjects[at as usize] = subject;
    }

    fn add_children(&mut self, at: u32, count: u16) -> u32 {
        let first = self.push_fixed(Kind::Cluster, at, u32::from(count));
        self.nodes[at as usize].fan = Fan::other(first);
        self.fixed_mut().child_counts[at as usize] = count;
        first
    }

    fn sum_areas(&mut self) {
        let mut sums = vec![[0.0_f64; 2]; self.nodes.len()];
        for id in (0..self.nodes.len()).rev() {
            let id = ElementId(id as u32);
            if self.kind(id) == Kind::Element && !self.is_distant(id) {
                let shape = self.shape(id);
                sums[id.0 as usize] = [shape.area(), exposed_m2(&shape, self.covered(id))];
            }
            if let Some(parent) = self.parent(id) {
                let [area, exposed] = sums[id.0 as usize];
                sums[parent.0 as usize][0] += area;
                sums[parent.0 as usize][1] += exposed;
            }
        }
        let made = (1..=self.fixed.made_children).rev();
        self.fixed_mut().made_m2 = made.map(|id| sums[id as usize][0]).sum::<f64>() as f32;
        for (id, [area, exposed]) in (0..).zip(sums) {
            self.nodes[id as usize].area_m2 = area as f32;
            if exposed < area {
                self.exposed.insert(id, exposed as f32);
            }
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

    /// Area of what the scene was made with, m2: it stays when bodies come and go. Exact up to single precision.
    pub fn made_m2(&self) -> f64 {
        f64::from(self.fixed.made_m2)
    }

    /// How many elements there are.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The quadtree roots, ascending.
    pub fn facets(&self) -> &[ElementId] {
        &self.fixed.facets
    }

    /// Those of them that receive light, ascending; the others are distant.
    pub fn near_facets(&self) -> &[ElementId] {
        &self.fixed.facets[..self.fixed.near_facets]
    }

    /// Those of them that are distant, ascending.
    pub fn distant_facets(&self) -> &[ElementId] {
        &self.fixed.facets[self.fixed.near_facets..]
    }

    /// Bytes held by what clones of this forest do not share.
    pub fn memory_bytes(&self) -> u64 {
        let lists = self.vacant.iter().map(Vec::capacity).sum::<usize>()
            + self.loose.capacity()
            + self.changed.capacity();
        let nodes = self.nodes.capacity() * size_of::<Node>();
        let twins = self.twins.capacity() * size_of::<Twins>();
        (nodes + twins + lists * 4) as u64
    }

    /// Bytes held once by all clones of this forest: none of them grows when elements are split.
    pub fn shared_bytes(&self) -> u64 {
        let f = &self.fixed;
        let ids = f.subjects.capacity()
            + f.coarse.capacity()
            + f.patch_roots.capacity()
            + f.body_roots.capacity()
            + f.facets.capacity();
        let kinds = f.kinds.capacity() * size_of::<Kind>() + f.child_counts.capacity() * 2;
        let ids = ids + f.names.capacity();
        (f.charts.capacity() * size_of::<Chart>() + ids * 4 + kinds) as u64
            + f.groups.memory_bytes()
    }

    /// Room that no element has.
    pub fn vacant_len(&self) -> usize {
        2 * self.vacant[0].len() + 4 * self.vacant[1].len()
    }

    /// Index of what a node has in common with its twin.
    #[inline]
    fn twins_of(&self, id: u32) -> usize {
        match id.checked_sub(self.fixed_len) {
            None => id as usize,
            Some(beyond) => self.fixed_len as usize + beyond as usize / 2,
        }
    }

    #[inline]
    fn twins(&self, id: ElementId) -> &Twins {
        &self.twins[self.twins_of(id.0)]
    }

    /// What the node is.
    #[inline]
    pub fn kind(&self, id: ElementId) -> Kind {
        if id.0 < self.fixed_len {
            return self.fixed.kinds[id.0 as usize];
        }
        if self.nodes[id.0 as usize].fan.is_other() { Kind::Vacant } else { Kind::Element }
    }

    /// The node's parent; `None` for the root.
    #[inline]
    pub fn parent(&self, id: ElementId) -> Option<ElementId> {
        let parent = self.twins(id).parent;
        (parent != NONE).then_some(ElementId(parent))
    }

    /// Ids of the node's children; empty for a leaf.
    #[inline]
    pub fn children(&self, id: ElementId) -> Range<u32> {
        let fan = self.nodes[id.0 as usize].fan;
        if !fan.is_other() {
            return fan.range();
        }
        // Vacant room has none.
        let count = self.fixed.child_counts.get(id.0 as usize).map_or(0, |n| u32::from(*n));
        fan.first()..fan.first() + count
    }

    /// Area, m2; 0 for a light and for what is distant. Exact up to single precision.
    #[inline]
    pub fn area_m2(&self, id: ElementId) -> f64 {
        f64::from(self.nodes[id.0 as usize].area_m2)
    }

    /// Area of what light can reach, m2: without what rests on the element ([`Scene::covered`]); a millionth of the area
    /// where it is covered wholly. Light counts over this area alone: an element has the mean radiosity of what can be seen of
    /// it. Exact up to single precision.
    #[inline]
    pub fn exposed_m2(&self, id: ElementId) -> f64 {
        let is_covered = |patch: PatchId| !self.fixed.covered[patch.0 as usize].parts.is_empty();
        match self.patch(id) {
            Some(patch) if is_covered(patch) => {
                self.exposed.get(&id.0).map_or_else(|| self.area_m2(id), |&m2| f64::from(m2))
            }
            _ => self.area_m2(id),
        }
    }

    /// What arrives is spread over this area, m2: what is exposed, or all of an element of which next to nothing is.
    #[inline]
    pub fn receiving_m2(&self, id: ElementId) -> f64 {
        let (area, exposed) = (self.area_m2(id), self.exposed_m2(id));
        if exposed > EXPOSED_LEAST * area { exposed } else { area }
    }

    /// Whether two elements are on patches that rest against each other in one plane: what they exchange leaves neither, and
    /// counts for nothing.
    #[inline]
    pub fn rest_in_contact(&self, a: ElementId, b: ElementId) -> bool {
        let (Some(of_a), Some(of_b)) = (self.patch(a), self.patch(b)) else { return false };
        let rests = |on: PatchId, other: PatchId| {
            self.fixed.covered[on.0 as usize].contacts.binary_search(&other).is_ok()
        };
        rests(of_a, of_b) || rests(of_b, of_a)
    }

    /// Covered parts of the patch of an element.
    fn covered(&self, id: ElementId) -> &Covered {
        let patch = self.patch(id).expect("an element has a patch");
        &self.fixed.covered[patch.0 as usize]
    }

    /// Where what is exposed of an element lies in its patch's frame; the radius is that of the whole.
    pub fn exposed_extent(&self, id: ElementId) -> Extent {
        let extent = self.extent(id);
        let (area, exposed) = (self.area_m2(id), self.exposed_m2(id));
        let is_part = exposed > EXPOSED_LEAST * area && exposed < area;
        if is_part { exposed_extent(&self.shape(id), extent, self.covered(id)) } else { extent }
    }

    /// The patch an element or polygon belongs to.
    #[inline]
    pub fn patch(&self, id: ElementId) -> Option<PatchId> {
        match self.fixed.kinds.get(id.0 as usize) {
            Some(Kind::Element | Kind::Polygon) => {
                Some(PatchId(self.fixed.subjects[id.0 as usize]))
            }
            Some(_) => None,
            None if self.nodes[id.0 as usize].fan.is_other() => None,
            None => Some(PatchId(self.fixed.subjects[self.twins(id).facet as usize])),
        }
    }

    /// The node of the fixed part that an element is in; the node itself for any other.
    #[inline]
    pub fn fixed(&self, id: ElementId) -> ElementId {
        if id.0 < self.fixed_len { id } else { ElementId(self.twins(id).facet) }
    }

    /// Index of a light in the scene.
    #[inline]
    pub fn light(&self, id: ElementId) -> Option<usize> {
        let is_light = self.kind(id) == Kind::Light;
        is_light.then(|| self.fixed.subjects[id.0 as usize] as usize)
    }

    /// The body of a cluster; `None` for groups of bodies and for what is no cluster.
    #[inline]
    pub fn cluster_body(&self, id: ElementId) -> Option<BodyId> {
        let subject = *self.fixed.subjects.get(id.0 as usize)?;
        (self.kind(id) == Kind::Cluster && subject < STAGE).then_some(BodyId(subject))
    }

    /// Whether this is a cluster of patches that never move, of whichever bodies.
    #[inline]
    pub fn is_of_stage(&self, id: ElementId) -> bool {
        self.fixed.subjects.get(id.0 as usize) == Some(&STAGE) && self.kind(id) == Kind::Cluster
    }

    /// What is known of a cluster that may be an end of links; `None` for all else.
    #[inline]
    pub fn group(&self, id: ElementId) -> Option<&Group> {
        self.fixed.groups.get(id)
    }

    /// Whether a node of the fixed part is a group or in one.
    pub fn is_in_group(&self, id: ElementId) -> bool {
        self.fixed.groups.holds(id)
    }

    /// Whether groups that a facet is in are in the frame of its body, not in the world.
    pub fn moves_with_group(&self, facet: ElementId) -> bool {
        let above = self.parent(facet).map(|parent| match self.kind(parent) {
            Kind::Polygon => self.moves_with_group(parent),
            _ => !self.is_of_stage(parent),
        });
        above.unwrap_or(true)
    }

    /// The clusters that may be ends of links.
    pub fn groups(&self) -> &Groups {
        &self.fixed.groups
    }

    /// The name of an element or light that does not depend on history.
    #[inline]
    pub fn key(&self, id: ElementId) -> ElementKey {
        let twins = self.twins(id);
        // Beyond the fixed part twins are an even number of ids from its end.
        let second = if id.0 < self.fixed_len { 0 } else { (id.0 - self.fixed_len) & 1 };
        let facet = self.fixed.names.get(twins.facet as usize).copied().unwrap_or(twins.facet);
        ElementKey { facet, path: twins.path + second }
    }

    /// The facet, light or group of a name.
    ///
    /// # Panics
    /// If there is none.
    pub fn named(&self, name: u32) -> ElementId {
        let names = &self.fixed.names;
        match names.is_empty() {
            true => ElementId(name),
            false => ElementId(names.iter().position(|&n| n == name).expect("a name") as u32),
        }
    }

    /// Corners of an element in its patch's frame.
    #[inline]
    pub fn shape(&self, id: ElementId) -> Shape {
        self.chart(id).shape(&self.nodes[id.0 as usize].place)
    }

    /// Where an element lies in its patch's frame, and how far it reaches.
    #[inline]
    pub fn extent(&self, id: ElementId) -> Extent {
        self.chart(id).extent(&self.nodes[id.0 as usize].place)
    }

    #[inline]
    fn chart(&self, id: ElementId) -> &Chart {
        &self.fixed.charts[self.twins(id).facet as usize]
    }

    /// Index of the coarse element that holds this one, if coarse elements have been numbered.
    #[inline]
    pub fn coarse(&self, id: ElementId) -> Option<usize> {
        let coarse = match self.fixed.coarse.get(id.0 as usize) {
            Some(number) => *number,
            None => self.twins(id).coarse,
        };
        (coarse != NONE).then_some(coarse as usize)
    }

    /// Whether this is one of the coarse elements itself, not a part of one.
    #[inline]
    pub fn is_coarse_root(&self, id: ElementId) -> bool {
        self.coarse(id).is_some() && self.parent(id).is_none_or(|p| self.coarse(p).is_none())
    }

    /// Makes `id` the coarse element number `index`, and all below it a part of it; elements made later, once all that
    /// exist are kept, inherit it.
    pub fn set_coarse(&mut self, id: ElementId, index: usize) {
        let len = self.nodes.len();
        let mut below = vec![id];
        while let Some(id) = below.pop() {
            let coarse = &mut self.fixed_mut().coarse;
            coarse.resize(len, NONE);
            coarse[id.0 as usize] = index as u32;
            below.extend(self.children(id).map(ElementId));
        }
    }

    /// The root node of a patch.
    pub fn patch_root(&self, patch: PatchId) -> ElementId {
        self.fixed.patch_roots[patch.0 as usize]
    }

    /// The convex solid whose face a patch is, if it is one's.
    pub fn solid(&self, patch: PatchId) -> Option<u32> {
        self.fixed.solids.of_patch[patch.0 as usize]
    }

    /// What the closed surface that a patch belongs to encloses.
    pub fn enclosure(&self, patch: PatchId) -> Enclosure {
        self.fixed.solids.enclosures[patch.0 as usize]
    }

    /// Whether a patch emits light at any time.
    pub fn glows(&self, patch: PatchId) -> bool {
        self.fixed.glows[patch.0 as usize]
    }

    /// Says which patches emit light at any time. Whether that differs from before.
    pub fn set_glows(&mut self, glows: Vec<bool>) -> bool {
        let differs = self.fixed.glows != glows;
        if differs {
            self.fixed_mut().glows = glows;
        }
        differs
    }

    /// Whether this is another forest of the same scene though other bodies are displaced: as much of patches is covered, the
    /// same patches glow, and there are no groups.
    pub fn is_as_displaced(&self, other: &Forest) -> bool {
        let (own, others) = (&self.fixed, &other.fixed);
        let no_groups = own.groups.is_empty() && others.groups.is_empty();
        no_groups && own.covered == others.covered && own.glows == others.glows
    }

    /// Area of the patches that are connected with a patch by common corners, itself among them, m2.
    pub fn connected_m2(&self, patch: PatchId) -> f64 {
        self.fixed.connected_m2[patch.0 as usize]
    }

    /// Whether a node may hold a patch with a normal opposed to `normal`, which is in the frame of the node's
    /// body. Conservative.
    pub fn may_oppose(&self, id: ElementId, normal: DVec3) -> bool {
        let bounds = &self.fixed.normals[self.fixed(id).0 as usize];
        let least = (bounds.lo * normal).min(bounds.hi * normal);
        least.x + least.y + least.z < -0.5 + 1e-6
    }

    /// A convex solid.
    pub fn solid_shape(&self, solid: u32) -> &Solid {
        &self.fixed.solids.list[solid as usize]
    }

    /// The cluster of a body.
    pub fn body_root(&self, body: BodyId) -> ElementId {
        self.fixed.body_roots[body.0 as usize]
    }

    /// Whether the node stands for light from outside ([`crate::scene::Body::distant`]): it shines, and nothing else.
    #[inline]
    pub fn is_distant(&self, id: ElementId) -> bool {
        self.fixed.distant.get(id.0 as usize).is_some_and(|&distant| distant)
    }

    /// Whether a node is a part of the sky so wide that no shadow has an edge in its light: groups are linked with it as
    /// they are. Of the sun and of the brightest parts of pictures each patch sees its own share.
    #[inline]
    pub fn is_wide(&self, id: ElementId) -> bool {
        self.fixed.wide.get(id.0 as usize).is_some_and(|&wide| wide)
    }

    /// Whether light is gathered there: an element that is not distant.
    #[inline]
    pub fn receives(&self, id: ElementId) -> bool {
        self.kind(id) == Kind::Element && !self.is_distant(id)
    }

    /// Whether the element may be split once more: paths have room for 15 levels. What is distant is as small as it is.
    #[inline]
    pub fn can_split(&self, id: ElementId) -> bool {
        let path = self.key(id).path;
        if self.is_distant(id) {
            return false;
        }
        !self.children(id).is_empty() || path.leading_zeros() > 31 - 2 * LEVELS_MAX + 1
    }

    /// Everything that exists now stays for good.
    pub fn keep_all(&mut self) {
        self.kept_len = self.nodes.len() as u32;
        self.changed = Vec::new();
        self.nodes.shrink_to_fit();
        self.twins.shrink_to_fit();
        self.fixed_mut().coarse.shrink_to_fit();
    }

    /// The children of an element, made if it is a leaf, with one more user. Areas of the children
    /// sum to the parent's up to single precision. Returns the ids and whether they are new.
    ///
    /// # Panics
    /// If `id` is no element or has no room below it.
    pub fn split(&mut self, id: ElementId) -> (Range<u32>, bool) {
        let children = self.children(id);
        if !children.is_empty() {
            *self.users(children.start) += 1;
            return (children, false);
        }
        assert!(self.kind(id) == Kind::Element && self.can_split(id), "{id:?} cannot be split");
        let (key, place, chart) = (self.key(id), self.nodes[id.0 as usize].place, *self.chart(id));
        let facet = self.twins(id).facet;
        let coarse = self.coarse(id).map_or(NONE, |number| number as u32);
        let (places, count) = place.children(chart.len, chart.shape(&place).cut());
        let first = self.room_for(count);
        for (k, place) in places[..count].iter().enumerate() {
            let shape = chart.shape(place);
            let area_m2 = shape.area() as f32;
            self.nodes[first as usize + k] = Node { place: *place, fan: Fan::LEAF, area_m2 };
            if self.exposed.contains_key(&id.0) {
                let exposed_m2 = exposed_m2(&shape, self.covered(id)) as f32;
                if exposed_m2 < area_m2 {
                    self.exposed.insert(first + k as u32, exposed_m2);
                }
            }
        }
        for k in (0..count as u32).step_by(2) {
            let twins = self.twins_of(first + k);
            let path = key.path << 2 | k;
            self.twins[twins] = Twins { parent: id.0, facet, path, coarse, users: 0 };
        }
        *self.users(first) = 1;
        self.nodes[id.0 as usize].fan = Fan::new(first, count);
        self.counts.elements += count as u64;
        self.counts.leaves += count as u64 - 1;
        self.changed.push(id);
        (self.children(id), true)
    }

    fn room_for(&mut self, count: usize) -> u32 {
        self.vacant[count / 4].pop().unwrap_or_else(|| {
            let first = self.nodes.len();
            self.nodes.resize(first + count, Node::VACANT);
            let twins = self.twins_of((first + count) as u32);
            self.twins.resize(twins, Twins::VACANT);
            first as u32
        })
    }

    /// Users of the element whose first child this is.
    fn users(&mut self, first_child: u32) -> &mut u32 {
        let twins = self.twins_of(first_child);
        &mut self.twins[twins].users
    }

    /// Takes back one use of an element's children; [`Forest::reap`] removes what has none left.
    ///
    /// # Panics
    /// If there is no user.
    pub fn release(&mut self, id: ElementId) {
        let users = self.users(self.nodes[id.0 as usize].fan.first());
        *users = users.checked_sub(1).expect("released more often than split");
        if *users == 0 {
            self.loose.push(id.0);
        }
    }

    /// Removes the children of elements that lost their last user; returns how many.
    pub fn reap(&mut self) -> u64 {
        let mut reaped = 0;
        for id in std::mem::take(&mut self.loose) {
            let children = self.children(ElementId(id));
            if !children.is_empty() && *self.users(children.start) == 0 {
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
            let below = self.nodes[child as usize].fan.range();
            debug_assert!(
                below.is_empty() || *self.users(below.start) == 0,
                "a child outlives its parent's pair"
            );
            count += self.remove_children(ElementId(child));
            self.nodes[child as usize] = Node::VACANT;
            self.exposed.remove(&child);
        }
        for first in children.clone().step_by(2) {
            let twins = self.twins_of(first);
            self.twins[twins] = Twins::VACANT;
        }
        self.vacant[children.len() / 4].push(children.start);
        self.nodes[id.0 as usize].fan = Fan::LEAF;
        self.changed.push(id);
        count
    }

    /// Elements whose children came or went since the last call; some may be vacant by now, some
    /// may be named twice.
    pub fn take_changed(&mut self) -> Vec<ElementId> {
        std::mem::take(&mut self.changed)
    }

    /// Puts all elements together so that no room is vacant: parents before children, level by level
    /// above those that are kept, which stay where they are.
    pub fn compact(&mut self) -> Renumbering {
        let kept = self.kept_len as usize;
        let alive = self.nodes.len() - self.vacant_len();
        let twins = self.twins_of(alive as u32);
        let (old, old_twins) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.twins));
        self.nodes.reserve_exact(alive);
        self.twins.reserve_exact(twins);
        self.nodes.extend_from_slice(&old[..kept]);
        self.twins.extend_from_slice(&old_twins[..self.twins_of(self.kept_len)]);
        let mut old_of: Vec<u32> = (0..self.kept_len).collect();
        let mut at = 0;
        while at < self.nodes.len() {
            let fan = self.nodes[at].fan;
            if !fan.is_other() && fan.first() >= self.kept_len {
                let first = self.nodes.len() as u32;
                let children = fan.range();
                self.nodes[at].fan = Fan::new(first, children.len());
                self.nodes.extend_from_slice(&old[children.start as usize..children.end as usize]);
                old_of.extend(children.clone());
                for child in children.step_by(2) {
                    let twins = old_twins[self.twins_of(child)];
                    self.twins.push(Twins { parent: at as u32, ..twins });
                }
            }
            at += 1;
        }
        debug_assert_eq!(self.nodes.len(), alive);
        self.vacant = [Vec::new(), Vec::new()];
        let mut new_of = vec![NONE; old.len()];
        old_of.iter().enumerate().for_each(|(new, &old)| new_of[old as usize] = new as u32);
        let exposed = std::mem::take(&mut self.exposed);
        self.exposed = exposed.into_iter().map(|(id, m2)| (new_of[id as usize], m2)).collect();
        Renumbering { new_of, old_of }
    }

    /// Gives back room beyond a small reserve.
    pub fn trim(&mut self) {
        self.nodes.shrink_to(self.nodes.len() + self.nodes.len() / SLACK);
        self.twins.shrink_to(self.twins.len() + self.twins.len() / SLACK);
        self.vacant.iter_mut().for_each(|list| list.shrink_to(2 * list.len()));
    }
}

/// The lines that patches are cut along before anything else, so that no element lies on both sides of a wall's foot.
struct Cuts {
    lines: Vec<Lines>,
    /// Smaller polygons are left whole, m2.
    least_m2: f64,
}

/// Those of one patch.
struct PatchCuts<'a> {
    lines: &'a Lines,
    least_m2: f64,
    slack_m: f64,
}

/// Share of a polygon's chord along a line that must be covered by the lines of contact on it.
const CUT_SHARE: f64 = 0.25;

/// Polygons of a smaller share of the scene's area are not cut: light jumps from one to the next anyway.
const CUT_LEAST: f64 = 1.0 / 64.0;

/// Smaller ones too where another patch crosses them, so that one part is before a wall and one behind it: along lines that
/// cover this share of the chord, into parts of at least this share of the area, and at most so often.
const CROSSED_SHARE: f64 = 0.9;
const CROSSED_PART: f64 = 1.0 / 64.0;
const CROSSED_TIMES: u32 = 2;

impl Cuts {
    fn new(scene: &Scene) -> Cuts {
        Cuts { lines: scene.discontinuities(), least_m2: CUT_LEAST * scene.made_area_m2() }
    }

    fn of(&self, patch: u32) -> PatchCuts<'_> {
        let lines = &self.lines[patch as usize];
        let ends = lines.all.iter().flatten();
        let reach = ends.fold(0.0_f64, |reach, p| reach.max(p.abs().max_element()));
        PatchCuts { lines, least_m2: self.least_m2, slack_m: 1e-6 * reach }
    }
}

impl PatchCuts<'_> {
    /// Both parts of a polygon that is to be cut, after so many cuts before.
    fn apply(&self, corners: &[DVec2], cut: u32) -> Option<(Vec<DVec2>, Vec<DVec2>)> {
        let area = polygon_area(corners);
        if area >= self.least_m2 {
            return cut_along(corners, &self.lines.all, CUT_SHARE, self.slack_m);
        }
        if cut >= CROSSED_TIMES {
            return None;
        }
        let is_part = |part: &[DVec2]| polygon_area(part) >= CROSSED_PART * area;
        cut_along(corners, &self.lines.crossing, CROSSED_SHARE, self.slack_m)
            .filter(|(one, two)| is_part(one) && is_part(two))
    }
}

/// Where an inserted body was planted.
struct Bed {
    root: u32,
    /// All nodes below its root.
    below: Range<u32>,
    names: Range<u32>,
}

/// Names of so many nodes of the fixed part: of what the scene was made with the ids that they would have without the
/// inserted bodies, which have their own.
fn names_in(len: u32, beds: &[Bed]) -> Vec<u32> {
    let mut out = vec![NONE; len as usize];
    for Bed { root, below, names } in beds {
        assert!(below.len() < names.len(), "an inserted body has more parts than names");
        out[*root as usize] = names.start;
        below.clone().zip(names.start + 1..).for_each(|(id, name)| out[id as usize] = name);
    }
    let made = out.iter_mut().filter(|name| **name == NONE);
    (0..).zip(made).for_each(|(id, name)| *name = id);
    out
}

impl Node {
    const VACANT: Node = Node { place: Place::WHOLE, fan: Fan::OTHER, area_m2: 0.0 };
}

impl Twins {
    const VACANT: Twins = Twins { parent: NONE, facet: NONE, path: 0, coarse: NONE, users: 0 };
}

/// Box of a body where it is at time 0, or in its own frame if it is absent then.
fn box_at_start(scene: &Scene, body: BodyId) -> Aabb {
    let pose = scene.pose(body, 0.0).unwrap_or(crate::geometry::Pose::IDENTITY);
    let corners = scene.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
    Aabb::of(corners.map(|c: DVec3| pose.point(c)))
}
