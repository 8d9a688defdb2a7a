//! The element forest of the plane: scene, bodies, facets, and below each facet halves of halves.

use std::ops::Range;
use std::sync::Arc;

use crate::element::{ElementId, ElementKey};

use super::plane::Segment;
use super::scene::{BodyIndex, FlatScene, WallIndex};

/// What a node stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FlatKind {
    /// The scene.
    Scene,
    /// All facets of a body.
    Body(BodyIndex),
    /// A facet or a part of one.
    Element,
    /// Nothing: room to be used again.
    Vacant,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    parent: u32,
    first_child: u32,
    facet: u32,
    /// A one bit, then two bits a level, as in space.
    path: u32,
    /// Pairs that are refined on it.
    users: u32,
}

const NONE: u32 = u32::MAX;

/// Levels that a path has room for.
const LEVELS_MAX: u32 = 15;

/// A side of a wall.
#[derive(Clone, Debug)]
struct Facet {
    wall: WallIndex,
    /// Whether it is the back.
    back: bool,
    /// Segment in the body's frame.
    local: Segment,
}

/// What never changes.
#[derive(Clone, Debug)]
struct Fixed {
    /// Nodes below this are a pure function of the scene.
    len: u32,
    bodies: u32,
    /// Children of the scene and of each body.
    groups: Vec<Range<u32>>,
    facets: Vec<ElementId>,
    walls: Vec<Facet>,
    wall_body: Vec<BodyIndex>,
    group_length: Vec<f64>,
}

/// All elements of a scene in the plane. Ids of halves depend on history; names do not.
#[derive(Clone, Debug)]
pub struct FlatForest {
    fixed: Arc<Fixed>,
    nodes: Vec<Node>,
    vacant: Vec<u32>,
    loose: Vec<u32>,
    changed: Vec<u32>,
    elements: u64,
}

impl FlatForest {
    /// The scene's node.
    pub const ROOT: ElementId = ElementId(0);

    /// Scene, bodies and facets; no facet is divided.
    pub fn new(scene: &FlatScene) -> FlatForest {
        let bodies = scene.bodies().len() as u32;
        let mut groups: Vec<Range<u32>> = std::iter::once(1..1 + bodies).collect();
        let mut walls = Vec::new();
        for body in scene.bodies() {
            let first = 1 + bodies + walls.len() as u32;
            for k in body.walls.clone() {
                let wall = &scene.walls()[k as usize];
                walls.push(Facet { wall: WallIndex(k), back: false, local: wall.local });
                if wall.material.two_sided {
                    let local = wall.local.reversed();
                    walls.push(Facet { wall: WallIndex(k), back: true, local });
                }
            }
            groups.push(first..1 + bodies + walls.len() as u32);
        }
        let len = 1 + bodies + walls.len() as u32;
        let node = |id: u32| Node { parent: NONE, first_child: NONE, facet: id, path: 1, users: 0 };
        let lengths = |facets: &Range<u32>| {
            facets.clone().map(|f| walls[(f - 1 - bodies) as usize].local.length()).sum()
        };
        let group_length = std::iter::once(0.0).chain(groups[1..].iter().map(lengths)).collect();
        FlatForest {
            nodes: (0..len).map(node).collect(),
            elements: walls.len() as u64,
            fixed: Arc::new(Fixed {
                len,
                bodies,
                groups,
                facets: (1 + bodies..len).map(ElementId).collect(),
                walls,
                wall_body: scene.walls().iter().map(|w| w.body).collect(),
                group_length,
            }),
            vacant: Vec::new(),
            loose: Vec::new(),
            changed: Vec::new(),
        }
    }

    /// Room for nodes: ids are below this.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there is nothing: never.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Bytes held, what all forests of a scene share included.
    pub fn memory_bytes(&self) -> u64 {
        let lists = self.vacant.capacity() + self.loose.capacity() + self.changed.capacity();
        let facet = size_of::<Facet>() + size_of::<ElementId>();
        let fixed = self.fixed.facets.len() * facet;
        (self.nodes.capacity() * size_of::<Node>() + lists * size_of::<u32>() + fixed) as u64
    }

    /// Elements alive, at all levels.
    pub fn element_count(&self) -> u64 {
        self.elements
    }

    /// Elements without children.
    pub fn leaf_count(&self) -> u64 {
        // Every split makes two of one.
        let facets = self.fixed.facets.len() as u64;
        facets + (self.elements - facets) / 2
    }

    /// The undivided elements, ascending.
    pub fn facets(&self) -> &[ElementId] {
        &self.fixed.facets
    }

    pub(super) fn kind(&self, id: ElementId) -> FlatKind {
        match id.0 {
            0 => FlatKind::Scene,
            k if k <= self.fixed.bodies => FlatKind::Body(BodyIndex(k - 1)),
            k if self.nodes[k as usize].facet == NONE => FlatKind::Vacant,
            _ => FlatKind::Element,
        }
    }

    /// Whether this is an element that exists.
    pub fn is_element(&self, id: ElementId) -> bool {
        (id.0 as usize) < self.nodes.len() && self.kind(id) == FlatKind::Element
    }

    /// The facet that an element is a part of.
    pub fn facet(&self, id: ElementId) -> ElementId {
        ElementId(self.nodes[id.0 as usize].facet)
    }

    /// The element that this is a half of.
    pub fn parent(&self, id: ElementId) -> Option<ElementId> {
        let parent = self.nodes[id.0 as usize].parent;
        (parent != NONE).then_some(ElementId(parent))
    }

    /// Ids of the children; empty for a leaf.
    pub fn children(&self, id: ElementId) -> Range<u32> {
        if let Some(group) = self.fixed.groups.get(id.0 as usize) {
            return group.clone();
        }
        match self.nodes[id.0 as usize].first_child {
            NONE => 0..0,
            first => first..first + 2,
        }
    }

    /// The name of an element, which does not depend on history.
    pub fn key(&self, id: ElementId) -> ElementKey {
        let node = &self.nodes[id.0 as usize];
        ElementKey { facet: node.facet, path: node.path }
    }

    fn of_facet(&self, id: ElementId) -> &Facet {
        &self.fixed.walls[(self.nodes[id.0 as usize].facet - 1 - self.fixed.bodies) as usize]
    }

    /// The wall of an element, and whether it is on its back.
    pub fn wall(&self, id: ElementId) -> (WallIndex, bool) {
        let Facet { wall, back, .. } = *self.of_facet(id);
        (wall, back)
    }

    /// The body of an element or of a body's node; `None` for the scene.
    pub fn body(&self, id: ElementId) -> Option<BodyIndex> {
        match self.kind(id) {
            FlatKind::Scene | FlatKind::Vacant => None,
            FlatKind::Body(body) => Some(body),
            FlatKind::Element => Some(self.fixed.wall_body[self.of_facet(id).wall.0 as usize]),
        }
    }

    /// Levels below its facet.
    pub fn level(&self, id: ElementId) -> u32 {
        (31 - self.nodes[id.0 as usize].path.leading_zeros()) / 2
    }

    /// Where an element is in its body's frame. Neighbours share their ends bit for bit.
    pub fn local(&self, id: ElementId) -> Segment {
        let (whole, level) = (self.of_facet(id).local, self.level(id));
        let path = self.nodes[id.0 as usize].path;
        let place = (0..level).rev().fold(0, |place, l| place << 1 | path >> (2 * l) & 1);
        let share = |k: u32| match k >> level {
            0 => whole.at(f64::from(k) / f64::from(1 << level)),
            _ => whole.end,
        };
        Segment { start: share(place), end: share(place + 1) }
    }

    /// Length of an element, or of all facets of a body, m.
    pub fn length(&self, id: ElementId) -> f64 {
        match self.fixed.group_length.get(id.0 as usize) {
            Some(sum) => *sum,
            None => self.of_facet(id).local.length() / f64::from(1 << self.level(id)),
        }
    }

    /// Whether it has children or room for them.
    pub fn can_split(&self, id: ElementId) -> bool {
        self.level(id) < LEVELS_MAX
    }

    /// The children, made where there are none, with one more user; and whether they were made.
    pub fn split(&mut self, id: ElementId) -> (Range<u32>, bool) {
        self.nodes[id.0 as usize].users += 1;
        let children = self.children(id);
        if !children.is_empty() {
            return (children, false);
        }
        assert!(self.can_split(id) && self.kind(id) == FlatKind::Element, "no room below {id:?}");
        let first = self.vacant.pop().unwrap_or(self.nodes.len() as u32);
        self.nodes.resize(self.nodes.len().max(first as usize + 2), Node::VACANT);
        let Node { facet, path, .. } = self.nodes[id.0 as usize];
        for k in 0..2 {
            let path = path << 2 | k;
            let node = Node { parent: id.0, first_child: NONE, facet, path, users: 0 };
            self.nodes[(first + k) as usize] = node;
        }
        self.nodes[id.0 as usize].first_child = first;
        self.elements += 2;
        self.changed.push(id.0);
        (first..first + 2, true)
    }

    /// Takes back one use of the children.
    ///
    /// # Panics
    /// If there is none.
    pub fn release(&mut self, id: ElementId) {
        let users = &mut self.nodes[id.0 as usize].users;
        *users = users.checked_sub(1).expect("released more often than split");
        if *users == 0 {
            self.loose.push(id.0);
        }
    }

    /// Removes the children of elements that lost their last user; returns how many.
    pub fn reap(&mut self) -> u64 {
        let before = self.elements;
        for id in std::mem::take(&mut self.loose) {
            if self.nodes[id as usize].users == 0 {
                self.remove_children(id);
            }
        }
        before - self.elements
    }

    fn remove_children(&mut self, id: u32) {
        let children = self.children(ElementId(id));
        if children.is_empty() {
            return;
        }
        for child in children.clone() {
            debug_assert_eq!(self.nodes[child as usize].users, 0, "a child outlives its pair");
            self.remove_children(child);
            self.nodes[child as usize] = Node::VACANT;
        }
        self.vacant.push(children.start);
        self.nodes[id as usize].first_child = NONE;
        self.elements -= 2;
        self.changed.push(id);
    }

    /// Elements whose children came or went since the last call and that are still there.
    pub fn take_changed(&mut self) -> Vec<u32> {
        let mut changed = std::mem::take(&mut self.changed);
        changed.retain(|&id| self.is_element(ElementId(id)));
        changed.sort_unstable();
        changed.dedup();
        changed
    }

    /// Ids below this are a pure function of the scene.
    pub fn fixed_len(&self) -> u32 {
        self.fixed.len
    }

    /// All elements, parents before children, from left to right.
    pub fn elements(&self) -> Vec<ElementId> {
        let mut out = Vec::new();
        let mut stack: Vec<u32> = self.facets().iter().rev().map(|f| f.0).collect();
        while let Some(id) = stack.pop() {
            out.push(ElementId(id));
            stack.extend(self.children(ElementId(id)).rev());
        }
        out
    }
}

impl Node {
    const VACANT: Node = Node { parent: NONE, first_child: NONE, facet: NONE, path: 0, users: 0 };
}
