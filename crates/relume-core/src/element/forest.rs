//! The forest itself: a pool of nodes, the fixed part (down to facets) first.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::exposed::{exposed_extent, exposed_m2};
use super::groups::{Group, Groups};
use super::ids::{ElementId, ElementKey, Kind, Renumbering};
use super::split::{Chart, Extent, Place, Seam, Shape, overlap};
use crate::geometry::Aabb;
use crate::scene::{BodyId, Covered, Covering, Enclosure, Glowing, PatchId, Solid, Solids};

mod cover;
mod grouping;
mod plant;
mod pool;
mod replant;

use super::tuning::EXPOSED_LEAST;
pub use cover::PartInside;
pub use replant::{Seeds, old_coarse_numbers};

/// What differs between siblings: 20 bytes.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Where an element lies within its facet.
    place: Place,
    children: ChildRange,
    area_m2: f32,
}

/// What two siblings have in common; a node of the fixed part has one of its own. 20 bytes.
#[derive(Clone, Copy, Debug)]
struct Siblings {
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
struct ChildRange(u32);

impl ChildRange {
    const SHIFT: u32 = 30;
    const LEAF: ChildRange = ChildRange(0);
    /// In the fixed part: as many children as [`Fixed::child_counts`] says. Beyond it: no node.
    const OTHER: ChildRange = ChildRange(3 << ChildRange::SHIFT);

    /// Two or four children.
    fn new(first: u32, count: usize) -> ChildRange {
        debug_assert!(first >> ChildRange::SHIFT == 0, "more than 2^30 elements");
        ChildRange(first | (count as u32 / 2) << ChildRange::SHIFT)
    }

    fn other(first: u32) -> ChildRange {
        ChildRange(first | ChildRange::OTHER.0)
    }

    fn is_other(self) -> bool {
        self.0 >= ChildRange::OTHER.0
    }

    fn first(self) -> u32 {
        self.0 & !ChildRange::OTHER.0
    }

    /// The children of anything but [`ChildRange::other`].
    fn range(self) -> Range<u32> {
        let count = (self.0 >> ChildRange::SHIFT) * 2;
        self.first()..self.first() + count
    }
}

const NONE: u32 = u32::MAX;

/// In place of a body: several bodies of the stage, all of them at rest.
const STAGE: u32 = u32::MAX - 1;

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
    siblings: Vec<Siblings>,
    /// Area of what light can reach of the elements that are partly or wholly covered, m2.
    exposed: BTreeMap<u32, f32>,
    /// What of patches is covered now, where that differs from what always is.
    covered_now: BTreeMap<PatchId, Covered>,
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
    /// Lines of contact that elements are divided along, by facet; only of facets that have some.
    seams: BTreeMap<u32, Vec<Seam>>,
    /// Numbers of the coarse elements, by id; empty if they have not been numbered.
    coarse: Vec<u32>,
    patch_roots: Vec<ElementId>,
    body_roots: Vec<ElementId>,
    facets: Vec<ElementId>,
    /// The convex solids that patches are faces of.
    solids: Solids,
    /// What of each patch is covered, by patch.
    covered: Vec<Covered>,
    /// What moving bodies may cover.
    covering: Covering,
    /// Box around the unit normals of the patches at or below each node, in their bodies' frames.
    normals: Vec<Aabb>,
    /// Which patches emit light.
    glowing: Glowing,
    /// Whether any patch at or below a node is a lamp, by id.
    may_hold_lamp: Vec<bool>,
    /// Whether a patch emits light at any time, or there is a punctual light.
    shines: bool,
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

/// How many elements there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Elements, at all levels.
    pub elements: u64,
    /// Elements without children.
    pub leaves: u64,
}

impl Forest {
    fn fixed_mut(&mut self) -> &mut Fixed {
        Arc::make_mut(&mut self.fixed)
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
        let siblings = self.siblings.capacity() * size_of::<Siblings>();
        (nodes + siblings + lists * 4) as u64
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
            + f.seams
                .values()
                .map(|seams| (seams.capacity() * size_of::<Seam>()) as u64)
                .sum::<u64>()
            + f.groups.memory_bytes()
            + f.covering.memory_bytes() as u64
    }

    /// Room that no element has.
    pub fn vacant_len(&self) -> usize {
        2 * self.vacant[0].len() + 4 * self.vacant[1].len()
    }

    /// Index of what a node has in common with its twin.
    #[inline]
    fn siblings_of(&self, id: u32) -> usize {
        match id.checked_sub(self.fixed_len) {
            None => id as usize,
            Some(beyond) => self.fixed_len as usize + beyond as usize / 2,
        }
    }

    #[inline]
    fn siblings(&self, id: ElementId) -> &Siblings {
        &self.siblings[self.siblings_of(id.0)]
    }

    /// What the node is.
    #[inline]
    pub fn kind(&self, id: ElementId) -> Kind {
        if id.0 < self.fixed_len {
            return self.fixed.kinds[id.0 as usize];
        }
        if self.nodes[id.0 as usize].children.is_other() { Kind::Vacant } else { Kind::Element }
    }

    /// The node's parent; `None` for the root.
    #[inline]
    pub fn parent(&self, id: ElementId) -> Option<ElementId> {
        let parent = self.siblings(id).parent;
        (parent != NONE).then_some(ElementId(parent))
    }

    /// Ids of the node's children; empty for a leaf.
    #[inline]
    pub fn children(&self, id: ElementId) -> Range<u32> {
        let children = self.nodes[id.0 as usize].children;
        if !children.is_other() {
            return children.range();
        }
        // Vacant room has none.
        let count = self.fixed.child_counts.get(id.0 as usize).map_or(0, |n| u32::from(*n));
        children.first()..children.first() + count
    }

    /// Area, m2; 0 for a light and for what is distant. Exact up to single precision.
    #[inline]
    pub fn area_m2(&self, id: ElementId) -> f64 {
        f64::from(self.nodes[id.0 as usize].area_m2)
    }

    /// Area of what light can reach, m2: without what rests on the element (`Scene::covered`); a millionth of the area
    /// where it is covered wholly. Light counts over this area alone: an element has the mean radiosity of what can be seen of
    /// it. Exact up to single precision.
    #[inline]
    pub fn exposed_m2(&self, id: ElementId) -> f64 {
        match self.patch(id) {
            Some(patch) if !self.covered_of(patch).parts.is_empty() => {
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

    /// Whether two elements [rest in contact](Forest::rest_in_contact), or one is on an inner side of what stands on the other now.
    #[inline]
    pub fn are_in_contact(&self, a: ElementId, b: ElementId) -> bool {
        if self.covered_now.is_empty() {
            return self.rest_in_contact(a, b);
        }
        let (Some(of_a), Some(of_b)) = (self.patch(a), self.patch(b)) else { return false };
        let touches = |on: PatchId, other: PatchId| {
            self.covered_of(on).contacts.binary_search(&other).is_ok()
        };
        touches(of_a, of_b) || touches(of_b, of_a)
    }

    /// Covered parts of the patch of an element.
    fn covered(&self, id: ElementId) -> &Covered {
        self.covered_of(self.patch(id).expect("an element has a patch"))
    }

    /// Whether one thing covers the whole patch of an element ([`Covered::is_wholly`]).
    pub fn is_wholly_covered(&self, id: ElementId) -> bool {
        self.covered(id).is_wholly
    }

    /// Covered parts of a patch.
    #[inline]
    fn covered_of(&self, patch: PatchId) -> &Covered {
        match self.covered_now.is_empty() {
            true => &self.fixed.covered[patch.0 as usize],
            false => self.covered_now.get(&patch).unwrap_or(&self.fixed.covered[patch.0 as usize]),
        }
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
            None if self.nodes[id.0 as usize].children.is_other() => None,
            None => Some(PatchId(self.fixed.subjects[self.siblings(id).facet as usize])),
        }
    }

    /// The node of the fixed part that an element is in; the node itself for any other.
    #[inline]
    pub fn fixed(&self, id: ElementId) -> ElementId {
        if id.0 < self.fixed_len { id } else { ElementId(self.siblings(id).facet) }
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

    /// Whether this is a cluster of several bodies that no clip moves, all of them where the scene has them at rest.
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
        let siblings = self.siblings(id);
        // Beyond the fixed part twins are an even number of ids from its end.
        let second = if id.0 < self.fixed_len { 0 } else { (id.0 - self.fixed_len) & 1 };
        let facet =
            self.fixed.names.get(siblings.facet as usize).copied().unwrap_or(siblings.facet);
        ElementKey { facet, path: siblings.path + second }
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
        &self.fixed.charts[self.siblings(id).facet as usize]
    }

    /// Index of the coarse element that holds this one, if coarse elements have been numbered.
    #[inline]
    pub fn coarse(&self, id: ElementId) -> Option<usize> {
        let coarse = match self.fixed.coarse.get(id.0 as usize) {
            Some(number) => *number,
            None => self.siblings(id).coarse,
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

    /// The closed convex part of a body, of one side or of two, whose face a patch is, if it is one's.
    pub fn convex_part(&self, patch: PatchId) -> Option<u32> {
        self.fixed.solids.convex_parts[patch.0 as usize]
    }

    /// What the closed surface that a patch belongs to encloses.
    pub fn enclosure(&self, patch: PatchId) -> Enclosure {
        self.fixed.solids.enclosures[patch.0 as usize]
    }

    /// Whether a patch is a lamp: at some time it emits far more than surfaces do on average.
    pub fn is_lamp(&self, patch: PatchId) -> bool {
        self.fixed.glowing.as_lamp[patch.0 as usize]
    }

    /// Whether any patch at or below a node of the fixed part is a lamp.
    pub fn may_hold_lamp(&self, id: ElementId) -> bool {
        self.fixed.may_hold_lamp[id.0 as usize]
    }

    /// Says which patches emit light. Whether that differs from before.
    pub fn set_glowing(&mut self, glowing: Glowing) -> bool {
        let differs = self.fixed.glowing != glowing;
        if differs {
            let lights = (0..self.fixed_len).any(|id| self.kind(ElementId(id)) == Kind::Light);
            let mut may_hold_lamp = vec![false; self.fixed_len as usize];
            for id in (0..self.fixed_len).rev() {
                let patch = self.patch(ElementId(id));
                may_hold_lamp[id as usize] |= patch.is_some_and(|p| glowing.as_lamp[p.0 as usize]);
                let parent = self.parent(ElementId(id));
                if let Some(parent) = parent.filter(|_| may_hold_lamp[id as usize]) {
                    may_hold_lamp[parent.0 as usize] = true;
                }
            }
            self.fixed_mut().may_hold_lamp = may_hold_lamp;
            self.fixed_mut().shines = lights || glowing.at_all.contains(&true);
            self.fixed_mut().glowing = glowing;
        }
        differs
    }

    /// Whether anything emits light at any time.
    pub fn shines(&self) -> bool {
        self.fixed.shines
    }

    /// Whether this is another forest of the same scene though other bodies are displaced: as much of patches is covered, the
    /// same patches glow, and the same clusters are of bodies at rest.
    pub fn is_as_displaced(&self, other: &Forest) -> bool {
        let (own, others) = (&self.fixed, &other.fixed);
        own.covered == others.covered
            && own.glowing == others.glowing
            && own.subjects == others.subjects
            && own.groups.ids == others.groups.ids
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

    /// Whether the element may be split once more: paths have room for 15 levels, and places for 2^15 steps. What is distant is
    /// as small as it is.
    #[inline]
    pub fn can_split(&self, id: ElementId) -> bool {
        let path = self.key(id).path;
        if self.is_distant(id) {
            return false;
        }
        let has_room = path.leading_zeros() > 31 - 2 * LEVELS_MAX + 1;
        let is_divisible = || self.nodes[id.0 as usize].place.is_divisible(self.chart(id).len);
        !self.children(id).is_empty() || (has_room && is_divisible())
    }
}

impl Node {
    const VACANT: Node = Node { place: Place::WHOLE, children: ChildRange::OTHER, area_m2: 0.0 };
}

impl Siblings {
    const VACANT: Siblings =
        Siblings { parent: NONE, facet: NONE, path: 0, coarse: NONE, users: 0 };
}
