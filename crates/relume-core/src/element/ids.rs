//! Ids and names of the forest's nodes, and how ids change.

/// Index of a node in a [`Forest`](super::Forest).
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

    /// New id of an element; `None` where it has left.
    pub fn kept(&self, old: ElementId) -> Option<ElementId> {
        let new = self.new_of(old.0);
        ((new as usize) < self.old_of.len()).then_some(ElementId(new))
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
