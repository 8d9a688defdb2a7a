//! The pool of quadtree elements, which come and go above the fixed part: split, release, reap, compact.

use std::ops::Range;

use super::{ChildRange, Forest, NONE, Node, Siblings};
use crate::element::exposed::exposed_m2;
use crate::element::ids::{ElementId, Kind, Renumbering};

/// Spare capacity that vectors of the forest keep, as one part in this many of their length.
const SPARE: usize = 32;

impl Forest {
    /// Everything that exists now stays for good.
    pub fn keep_all(&mut self) {
        self.kept_len = self.nodes.len() as u32;
        self.changed = Vec::new();
        self.nodes.shrink_to_fit();
        self.siblings.shrink_to_fit();
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
        let facet = self.siblings(id).facet;
        let coarse = self.coarse(id).map_or(NONE, |number| number as u32);
        let seams = self.fixed.seams.get(&facet).map_or(&[][..], |seams| seams);
        let (places, count) = place.children(chart.len, chart.shape(&place).cut(), seams);
        let first = self.room_for(count);
        for (k, place) in places[..count].iter().enumerate() {
            let shape = chart.shape(place);
            let area_m2 = shape.area() as f32;
            self.nodes[first as usize + k] =
                Node { place: *place, children: ChildRange::LEAF, area_m2 };
            if self.exposed.contains_key(&id.0) {
                let exposed_m2 = exposed_m2(&shape, self.covered(id)) as f32;
                if exposed_m2 < area_m2 {
                    self.exposed.insert(first + k as u32, exposed_m2);
                }
            }
        }
        for k in (0..count as u32).step_by(2) {
            let siblings = self.siblings_of(first + k);
            let path = key.path << 2 | k;
            self.siblings[siblings] = Siblings { parent: id.0, facet, path, coarse, users: 0 };
        }
        *self.users(first) = 1;
        self.nodes[id.0 as usize].children = ChildRange::new(first, count);
        self.counts.elements += count as u64;
        self.counts.leaves += count as u64 - 1;
        self.changed.push(id);
        (self.children(id), true)
    }

    fn room_for(&mut self, count: usize) -> u32 {
        self.vacant[count / 4].pop().unwrap_or_else(|| {
            let first = self.nodes.len();
            self.nodes.resize(first + count, Node::VACANT);
            let siblings = self.siblings_of((first + count) as u32);
            self.siblings.resize(siblings, Siblings::VACANT);
            first as u32
        })
    }

    /// Users of the element whose first child this is.
    fn users(&mut self, first_child: u32) -> &mut u32 {
        let siblings = self.siblings_of(first_child);
        &mut self.siblings[siblings].users
    }

    /// Takes back one use of an element's children; [`Forest::reap`] removes what has none left.
    ///
    /// # Panics
    /// If there is no user.
    pub fn release(&mut self, id: ElementId) {
        let users = self.users(self.nodes[id.0 as usize].children.first());
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
            let below = self.nodes[child as usize].children.range();
            debug_assert!(
                below.is_empty() || *self.users(below.start) == 0,
                "a child outlives its parent's pair"
            );
            count += self.remove_children(ElementId(child));
            self.nodes[child as usize] = Node::VACANT;
            self.exposed.remove(&child);
        }
        for first in children.clone().step_by(2) {
            let siblings = self.siblings_of(first);
            self.siblings[siblings] = Siblings::VACANT;
        }
        self.vacant[children.len() / 4].push(children.start);
        self.nodes[id.0 as usize].children = ChildRange::LEAF;
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
        let siblings = self.siblings_of(alive as u32);
        let (old, old_siblings) =
            (std::mem::take(&mut self.nodes), std::mem::take(&mut self.siblings));
        self.nodes.reserve_exact(alive);
        self.siblings.reserve_exact(siblings);
        self.nodes.extend_from_slice(&old[..kept]);
        self.siblings.extend_from_slice(&old_siblings[..self.siblings_of(self.kept_len)]);
        let mut old_of: Vec<u32> = (0..self.kept_len).collect();
        let mut at = 0;
        while at < self.nodes.len() {
            let children = self.nodes[at].children;
            if !children.is_other() && children.first() >= self.kept_len {
                let first = self.nodes.len() as u32;
                let children = children.range();
                self.nodes[at].children = ChildRange::new(first, children.len());
                self.nodes.extend_from_slice(&old[children.start as usize..children.end as usize]);
                old_of.extend(children.clone());
                for child in children.step_by(2) {
                    let siblings = old_siblings[self.siblings_of(child)];
                    self.siblings.push(Siblings { parent: at as u32, ..siblings });
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
        Renumbering::new(new_of, old_of)
    }

    /// Gives back room beyond a small reserve.
    pub fn trim(&mut self) {
        self.nodes.shrink_to(self.nodes.len() + self.nodes.len() / SPARE);
        self.siblings.shrink_to(self.siblings.len() + self.siblings.len() / SPARE);
        self.vacant.iter_mut().for_each(|list| list.shrink_to(2 * list.len()));
    }
}
