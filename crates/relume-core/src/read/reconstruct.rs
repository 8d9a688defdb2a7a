//! The solution read anew, every leaf with links of its own.
//!
//! A leaf below the end of a link inherits a straight line from it. Along edges between walls, and across the
//! edges of shadows, the truth is steep and bent. Here each link is shared out among the leaves below its ends,
//! as the kernel falls on them and past what hides it from each, and the solution settles with those links.
//! The session's own stays as it is.

use rayon::prelude::*;

use crate::element::{ElementId, Forest, Kind, Shape};
use crate::follow::directions;
use crate::pair::{self, Carried, Gradients};
use crate::solver::{Dirty, Link, Links, LinksBuilder, Radiosity, Stop};
use crate::space::Solved;
use crate::transport::{Meeting, Side, meeting};

use super::compare::mean_radiosity;
use super::pieces::Sharing;
use super::tuning::{NEGLIGIBLE_SHARE, RECONSTRUCTION_SWEEPS};

/// Links that one task looks at.
const LINKS_AT_ONCE: usize = 512;

/// The solution with the links of leaves in place of those of their ancestors.
pub(super) fn solve(solved: &Solved) -> (Links, Radiosity) {
    let forest = &solved.space.forest;
    let at = Reconstruction {
        solved,
        sharing: Sharing::new(solved),
        leaves: Leaves::of(forest),
        negligible_w_m2: NEGLIGIBLE_SHARE * solved.space.tuning.tolerance * mean_radiosity(solved),
    };
    let links: Vec<pair::Link> = solved.tree.links().collect();
    let of_links = |links: &[pair::Link]| {
        let mut found = Vec::new();
        links.iter().for_each(|link| at.add_link(link, &mut found));
        found
    };
    let found: Vec<Vec<(u32, Link)>> = links.par_chunks(LINKS_AT_ONCE).map(of_links).collect();
    let mut builder = LinksBuilder::new(forest.len());
    found.iter().flatten().for_each(|(receiver, _)| builder.count(*receiver));
    let links = builder.fill(|add| found.iter().flatten().for_each(|(to, link)| add(*to, *link)));
    let mut out = solved.radiosity.clone();
    out.solve(&solved.space.surfaces(), &links, Dirty::All, Stop::Sweeps(RECONSTRUCTION_SWEEPS));
    (links, out)
}

/// The leaves of a forest in depth-first order, so that those below an element are side by side.
struct Leaves {
    ids: Vec<u32>,
    shapes: Vec<Shape>,
    /// By element.
    below: Vec<(u32, u32)>,
}

impl Leaves {
    fn of(forest: &Forest) -> Leaves {
        let below = vec![(0, 0); forest.len()];
        let mut out = Leaves { ids: Vec::new(), shapes: Vec::new(), below };
        forest.facets().iter().for_each(|&facet| out.add(forest, facet));
        out
    }

    fn add(&mut self, forest: &Forest, id: ElementId) {
        let start = self.ids.len() as u32;
        let children = forest.children(id);
        if children.is_empty() {
            self.ids.push(id.0);
            self.shapes.push(forest.shape(id));
        }
        children.for_each(|child| self.add(forest, ElementId(child)));
        self.below[id.0 as usize] = (start, self.ids.len() as u32);
    }

    fn below(&self, id: ElementId) -> (&[u32], &[Shape]) {
        let (start, end) = self.below[id.0 as usize];
        let range = start as usize..end as usize;
        (&self.ids[range.clone()], &self.shapes[range])
    }
}

struct Reconstruction<'a> {
    solved: &'a Solved,
    sharing: Sharing<'a>,
    leaves: Leaves,
    negligible_w_m2: f64,
}

impl Reconstruction<'_> {
    fn add_link(&self, link: &pair::Link, found: &mut Vec<(u32, Link)>) {
        let shared = [(link.a, link.b), (link.b, link.a)].map(|(receiver, source)| {
            self.share_out(link, receiver, source, found).then_some(receiver.0)
        });
        let is_shared = |receiver: u32| shared.contains(&Some(receiver));
        found.extend(directions(&self.solved.space.forest, link).filter(|(to, _)| !is_shared(*to)));
    }

    /// Links of the leaves below a receiver in place of its own; false where its own will do.
    fn share_out(
        &self,
        link: &pair::Link,
        receiver: ElementId,
        source: ElementId,
        found: &mut Vec<(u32, Link)>,
    ) -> bool {
        let forest = &self.solved.space.forest;
        if !forest.receives(receiver)
            || forest.kind(source) != Kind::Element
            || forest.are_in_contact(receiver, source)
        {
            return false;
        }
        let sends = self.solved.radiosity.radiosity(source.0);
        let brightest = f64::from(sends.iter().fold(0.0_f32, |m, b| m.max(*b)));
        if brightest * self.line_error(link, receiver) <= self.negligible_w_m2 {
            return false;
        }
        let (ids, shapes) = self.leaves.below(receiver);
        if ids.len() < 2 {
            let Some(own) = self.look_again(link, receiver, source) else { return false };
            found.push((receiver.0, own));
            return true;
        }
        let other = [forest.shape(source)];
        let is_a = receiver == link.a;
        let ends = if is_a { (shapes, &other[..]) } else { (&other[..], shapes) };
        let Some((shares, exchanges)) = self.sharing.shares_that_vary(link, ends) else {
            return false;
        };
        let radius = forest.extent(source).radius;
        for ((leaf, share), x) in ids.iter().zip(shares).zip(exchanges) {
            if share <= 0.0 {
                continue;
            }
            let (own, others) = if is_a { (x.over_a, x.over_b) } else { (x.over_b, x.over_a) };
            let size = forest.extent(ElementId(*leaf)).radius;
            let g = Gradients::new((own.gradient, size), (others.gradient, radius));
            let coupling = (share / forest.receiving_m2(ElementId(*leaf))) as f32;
            let (over_receiver, over_source) = (g.over_a, g.over_b);
            found.push((*leaf, Link { source: source.0, coupling, over_receiver, over_source }));
        }
        true
    }

    /// The link of a leaf with what the leaf itself sees; `None` where that is known.
    fn look_again(&self, link: &pair::Link, leaf: ElementId, source: ElementId) -> Option<Link> {
        let Carried { exchange_area_m2, visibility, gradients } = link.carried;
        if visibility == u16::MAX {
            return None;
        }
        let (observer, over_receiver, over_source) = match leaf == link.a {
            true => (Side::A, gradients.over_a, gradients.over_b),
            false => (Side::B, gradients.over_b, gradients.over_a),
        };
        let v = self.sharing.visibility_from(link, observer)?;
        let area_m2 = self.solved.space.forest.receiving_m2(leaf);
        let coupling = (v * f64::from(exchange_area_m2) / area_m2) as f32;
        Some(Link { source: source.0, coupling, over_receiver, over_source })
    }

    /// How far a link's line may be off over a receiver, as a form factor: without occlusion the square
    /// of size over distance, relative.
    fn line_error(&self, link: &pair::Link, receiver: ElementId) -> f64 {
        let (a, b) = self.sharing.whole(link);
        let distance2 = (b.centre - a.centre).length_squared();
        if meeting(&a, &b) == Meeting::Cut {
            // The part that is in front of the other may be small: what a point there sees at most.
            let source = if receiver == link.a { &b } else { &a };
            return (source.area / (std::f64::consts::PI * distance2)).min(1.0);
        }
        let factor =
            f64::from(link.carried.exchange_area_m2) / self.solved.space.forest.area_m2(receiver);
        if link.carried.visibility < u16::MAX {
            return factor;
        }
        let size = a.radius.max(b.radius);
        factor * (size * size / distance2).min(1.0)
    }
}
