//! Links that end on groups of patches, as numbers for the solver: from the pair tree and the poses.

use std::f64::consts::FRAC_1_PI;

use rayon::prelude::*;

use crate::element::{ElementId, Forest, WorldView};
use crate::pair::{self, PairTree};
use crate::solver::{GroupEnd, GroupLink, GroupLinks, PlacedLinks, SQUARE_MOMENT};
use crate::transport::{GroupSight, Spread, common_body};

use super::report::LinkKinds;

/// Links that one task places.
const LINKS_AT_ONCE: usize = 256;

/// The group links of a tree: those of `last` that are not among `anew` (ascending) as they were, all others from the poses.
/// Cost: proportional to all links, and to the facets at the ends of those with groups; rays for those that are not.
pub(super) fn group_links(
    (forest, view): (&Forest, &WorldView),
    tree: &PairTree,
    (last, anew): (&GroupLinks, &[(ElementId, ElementId)]),
) -> GroupLinks {
    let groups = forest.groups();
    if groups.is_empty() {
        return GroupLinks::default();
    }
    let is_group = |id| forest.group(id).is_some();
    let ends_on_group =
        |link: &pair::Link| (is_group(link.a) || is_group(link.b)) && link.carried.visibility > 0;
    let all: Vec<pair::Link> = tree.links().filter(ends_on_group).collect();
    let place = |links: &[pair::Link]| {
        let mut out = PlacedLinks::default();
        for link in links {
            let kept = anew.binary_search(&(link.a, link.b)).is_err()
                && last.copy([link.a.0, link.b.0], &mut out);
            if !kept {
                let placed = placed((forest, view), link, &mut out.factors);
                out.links.push(placed);
                out.ids.push([link.a.0, link.b.0]);
            }
        }
        out
    };
    let parts: Vec<PlacedLinks> = all.par_chunks(LINKS_AT_ONCE).map(place).collect();
    let mut links = PlacedLinks::default();
    parts.into_iter().for_each(|part| links.extend(part));
    let facets = groups.leaves().iter().map(|leaf| (leaf.facet.0, leaf.area_m2 as f32)).collect();
    let root = |&root: &ElementId| forest.group(root).expect("a root is a group").leaves.clone();
    let roots = groups.roots().iter().map(root).collect();
    GroupLinks::new(facets, roots, links, SQUARE_MOMENT)
}

fn placed(
    (forest, view): (&Forest, &WorldView),
    link: &pair::Link,
    factors: &mut Vec<f32>,
) -> GroupLink {
    let common = common_body(forest, view, link.a, link.b);
    let ends = [link.a, link.b].map(|id| Spread::new(forest, view, id, common));
    let apart2 = ends[0].centre.distance_squared(ends[1].centre);
    let seen = (link.carried.visibility < u16::MAX).then(|| {
        let candidates = GroupSight::between(forest, view, link.a, link.b);
        let sight = GroupSight { forest, view, common, candidates: &candidates };
        let key = pair::pair_key(forest.key(link.a), forest.key(link.b));
        sight.by_facets(&ends[0], &ends[1], key)
    });
    let visibility = match &seen {
        Some(seen) if seen.mean > 0.0 => 1.0 / seen.mean,
        Some(_) => 0.0,
        None => f64::from(link.carried.visibility()),
    };
    let coupling = visibility * FRAC_1_PI / apart2;
    let mut end = |own: &Spread<'_>, other: &Spread<'_>, side: usize| match forest.group(own.id) {
        Some(group) => {
            let first = factors.len() as u32;
            own.factors(other, &mut |f| factors.push(f as f32));
            if let Some(seen) = &seen
                && !seen.of_facets[side].is_empty()
            {
                let own = &mut factors[first as usize..];
                own.iter_mut().zip(&seen.of_facets[side]).for_each(|(f, v)| *f *= v);
            }
            GroupEnd::Group { facets: group.leaves.clone(), first }
        }
        None => {
            let slope = own.slope(other);
            GroupEnd::Element {
                id: own.id.0,
                area_m2: own.area_m2 as f32,
                radius: own.radius as f32,
                mean: (slope.mean * seen.as_ref().map_or(1.0, |seen| seen.mean)) as f32,
                gradient: [slope.gradient.x, slope.gradient.y].map(|g| (g * own.radius) as f32),
            }
        }
    };
    let (one, other) = (end(&ends[0], &ends[1], 0), end(&ends[1], &ends[0], 1));
    GroupLink { ends: [one, other], coupling: coupling as f32 }
}

/// Links by what they end on; `None` where there are no groups.
pub(super) fn kinds(forest: &Forest, tree: &PairTree) -> Option<LinkKinds> {
    if forest.groups().is_empty() {
        return None;
    }
    let mut kinds = LinkKinds::default();
    for link in tree.links() {
        match [link.a, link.b].iter().filter(|&&end| forest.group(end).is_some()).count() {
            0 => kinds.element_element += 1,
            1 => kinds.group_element += 1,
            _ => kinds.group_group += 1,
        }
    }
    Some(kinds)
}
