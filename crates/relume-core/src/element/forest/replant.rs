//! How a running forest goes on when bodies came into its scene or left it, or cover other parts of what they rest on.
//!
//! What the old and the new scene have in common has the same nodes below its root in both fixed parts. Their ids are those
//! of a forest that is made anew; what is above the kept part keeps its order.

use super::{
    BodyId, ChildRange, ElementId, Forest, NONE, Node, Renumbering, STAGE, Siblings, exposed_m2,
};
use crate::scene::{FIRST_NAME, Glowing};

/// Initial forests of two scenes.
#[derive(Clone, Copy)]
pub struct Seeds<'a> {
    /// That of the scene before.
    pub old: &'a Forest,
    /// That of the scene now.
    pub new: &'a Forest,
}

impl Seeds<'_> {
    /// Nodes that both have of which only one is a group, or only one a coarse element, by their new ids, ascending. Pairs that
    /// end there are decided in another way though nothing moved.
    pub fn regrouped(&self, to: &Renumbering) -> Vec<ElementId> {
        let Seeds { old, new } = self;
        let both = (1..old.kept_len).filter(|&was| to.new_of(was) != NONE);
        let both = both.map(|was| (ElementId(was), ElementId(to.new_of(was))));
        let differs = |&(was, is): &(ElementId, ElementId)| {
            old.group(was).is_some() != new.group(is).is_some()
                || old.is_coarse_root(was) != new.is_coarse_root(is)
        };
        let mut out: Vec<ElementId> = both.filter(differs).map(|(_, is)| is).collect();
        out.sort_unstable();
        out
    }
}

impl Forest {
    /// Where the elements of this forest, which grew from one seed, go in one that grows from another; `body` says which
    /// body of the new scene one of the old is. What is new stands in `old_of` as the root, which has neither links nor
    /// light. `None` where what both have in common was planted in another way, or glows at other times.
    pub fn renumbering_to(
        &self,
        Seeds { old, new }: Seeds<'_>,
        body: &dyn Fn(BodyId) -> Option<BodyId>,
    ) -> Option<Renumbering> {
        let mut new_of = vec![NONE; old.kept_len as usize];
        let made = old.fixed.made_children;
        if made != new.fixed.made_children || old.shines() != new.shines() {
            return None;
        }
        new_of[Forest::ROOT.0 as usize] = Forest::ROOT.0;
        let common = (1..=made).map(|id| (id, id));
        let inserted = old.children(Forest::ROOT).skip(made as usize).filter_map(|id| {
            let was = old.cluster_body(ElementId(id)).expect("an inserted body");
            Some((id, new.body_root(body(was)?).0))
        });
        let mut stack: Vec<(u32, u32)> = common.chain(inserted).collect();
        while let Some((was, is)) = stack.pop() {
            let (one, two) = (ElementId(was), ElementId(is));
            let (below, then) = (old.children(one), new.children(two));
            if !old.is_like(one, new, two) || below.len() != then.len() {
                return None;
            }
            new_of[was as usize] = is;
            stack.extend(below.zip(then));
        }
        let mut old_of = vec![Forest::ROOT.0; new.kept_len as usize];
        for (was, &is) in (0..).zip(&new_of) {
            if is != NONE {
                old_of[is as usize] = was;
            }
        }
        let beyond = old.kept_len..self.nodes.len() as u32;
        new_of.extend(beyond.clone().map(|id| id - old.kept_len + new.kept_len));
        old_of.extend(beyond);
        Some(Renumbering::new(new_of, old_of))
    }

    /// Whether a node of the kept part is what one of another forest is. A cluster of several bodies is a group in one of them
    /// and none in the other where one of the bodies is taken up ([`Seeds::regrouped`]).
    fn is_like(&self, own: ElementId, other: &Forest, id: ElementId) -> bool {
        let alike = match (self.group(own), other.group(id)) {
            (None, None) => true,
            (Some(a), Some(b)) => a.centre == b.centre && a.radius == b.radius,
            _ => self.is_of_stage(own) != other.is_of_stage(id),
        };
        let glows = |forest: &Forest, id| {
            let Glowing { at_all, as_lamp } = &forest.fixed.glowing;
            forest.patch(id).map(|patch| [at_all, as_lamp].map(|of| of[patch.0 as usize]))
        };
        // What was inserted has other numbers of patches and bodies.
        let subject = |forest: &Forest, id: ElementId| {
            let subject = forest.fixed.subjects.get(id.0 as usize).copied();
            let subject = subject.map(|subject| if subject == STAGE { NONE } else { subject });
            subject.filter(|_| self.is_made(own))
        };
        alike
            && subject(self, own) == subject(other, id)
            && self.kind(own) == other.kind(id)
            && glows(self, own) == glows(other, id)
            && self.fixed.seams.get(&own.0) == other.fixed.seams.get(&id.0)
    }

    /// Whether a node is of what the scene was made with, not of a body that was inserted.
    pub fn is_made(&self, id: ElementId) -> bool {
        let name = self.fixed.names.get(self.fixed(id).0 as usize);
        name.is_none_or(|&name| name < FIRST_NAME)
    }

    /// This forest, which grew from one seed, as it grows from another, with ids as [`Forest::renumbering_to`] says; and
    /// the facets of which another part is covered. Elements of bodies that left must have been reaped.
    pub fn replanted(&self, seeds: Seeds<'_>, to: &Renumbering) -> (Forest, Vec<ElementId>) {
        let Seeds { old, new } = seeds;
        let mut out = new.clone();
        let numbers = coarse_numbers(seeds, to);
        let children = |children: ChildRange| match children.range() {
            _ if children.is_other() => children,
            below if below.is_empty() => children,
            below => ChildRange::new(to.new_of(below.start), below.len()),
        };
        for id in (0..old.kept_len).filter(|&id| to.new_of(id) != NONE) {
            let at = to.new_of(id) as usize;
            if !self.nodes[id as usize].children.is_other() {
                out.nodes[at].children = children(self.nodes[id as usize].children);
            }
            let siblings = out.siblings_of(at as u32);
            out.siblings[siblings].users = self.siblings[self.siblings_of(id)].users;
        }
        let beyond = &self.nodes[old.kept_len as usize..];
        out.nodes
            .extend(beyond.iter().map(|node| Node { children: children(node.children), ..*node }));
        let id = |old: u32| if old == NONE { NONE } else { to.new_of(old) };
        let number = |old: u32| numbers.get(old as usize).copied().unwrap_or(old);
        let beyond = &self.siblings[self.siblings_of(old.kept_len)..];
        out.siblings.extend(beyond.iter().map(|siblings| Siblings {
            parent: id(siblings.parent),
            facet: id(siblings.facet),
            coarse: match new.fixed.coarse.get(id(siblings.facet) as usize) {
                Some(&of_facet) if of_facet != NONE => of_facet,
                _ => number(siblings.coarse),
            },
            ..*siblings
        }));
        for (vacant, own) in out.vacant.iter_mut().zip(&self.vacant) {
            *vacant = own.iter().map(|&first| id(first)).collect();
        }
        out.counts.elements += self.counts.elements - old.counts.elements;
        out.counts.leaves += self.counts.leaves - old.counts.leaves;
        let beyond = self.exposed.range(old.kept_len..);
        out.exposed.extend(beyond.map(|(&old, &m2)| (id(old), m2)));
        let touched = Forest::touched(seeds, to);
        touched.iter().for_each(|&facet| out.expose(facet));
        (out, touched)
    }

    /// The facets of what a scene was made with of which another part is covered than before.
    fn touched(Seeds { old, new }: Seeds<'_>, to: &Renumbering) -> Vec<ElementId> {
        let facets = old.facets().iter().filter(|facet| old.is_made(**facet));
        let both = facets.map(|&facet| (facet, ElementId(to.new_of(facet.0))));
        let differs = |&(was, is): &(ElementId, ElementId)| old.covered(was) != new.covered(is);
        both.filter(differs).map(|(_, is)| is).collect()
    }

    /// Finds anew what is exposed of the elements of a facet beyond the kept part.
    fn expose(&mut self, facet: ElementId) {
        let mut stack = vec![facet.0];
        while let Some(id) = stack.pop() {
            stack.extend(self.children(ElementId(id)));
            if id < self.kept_len {
                continue;
            }
            let area_m2 = self.nodes[id as usize].area_m2;
            let exposed_m2 = exposed_m2(&self.shape(ElementId(id)), self.covered(ElementId(id)));
            match (exposed_m2 as f32) < area_m2 {
                true => drop(self.exposed.insert(id, exposed_m2 as f32)),
                false => drop(self.exposed.remove(&id)),
            }
        }
    }
}

/// New numbers of the coarse elements of an old seed, by number, where these are parts of facets.
fn coarse_numbers(Seeds { old, new }: Seeds<'_>, to: &Renumbering) -> Vec<u32> {
    let mut out = Vec::new();
    for (id, &number) in (0..).zip(&old.fixed.coarse).filter(|(_, number)| **number != NONE) {
        out.resize(out.len().max(number as usize + 1), NONE);
        let at = to.new_of(id);
        if at != NONE {
            out[number as usize] = new.fixed.coarse[at as usize];
        }
    }
    out
}

/// Old numbers of the coarse elements of a new seed, by number: of each the one that it was, or was a part of; `None` for those
/// that are new or were several.
pub fn old_coarse_numbers(
    Seeds { old, new }: Seeds<'_>,
    to: &Renumbering,
    count: usize,
) -> Vec<Option<usize>> {
    let mut out = vec![None; count];
    for id in (0..new.kept_len).map(ElementId).filter(|&id| new.is_coarse_root(id)) {
        let number = new.coarse(id).expect("a coarse element has a number");
        out[number] = old.coarse(ElementId(to.old_of()[id.0 as usize]));
    }
    out
}
