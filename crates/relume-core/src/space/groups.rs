//! Links that end on groups of patches, as numbers for the solver: from the pair tree and the poses.

use std::f64::consts::FRAC_1_PI;
use std::ops::Range;

use rayon::prelude::*;

use crate::element::{ElementId, Forest, Renumbering, WorldView};
use crate::geometry::Aabb;
use crate::pair::{self, PairTree};
use crate::scene::{BodyId, PatchId, Scene};
use crate::solver::{GroupEnd, GroupLink, GroupLinks, PlacedLinks, SQUARE_MOMENT};
use crate::transport::{GroupSight, Simd, Spread, common_body};

use crate::follow::LinkKinds;

/// Links that one task places.
const LINKS_AT_ONCE: usize = 256;

/// What there was before, and what happened since.
#[derive(Default)]
pub(crate) struct Before {
    /// The links.
    pub(super) links: GroupLinks,
    /// Pairs that were looked at again since, ascending.
    pub(super) looked_at: Vec<(ElementId, ElementId)>,
    /// Bodies that moved, came or went, ascending.
    pub(super) movers: Vec<BodyId>,
    /// Boxes around each of them, where it was and where it is.
    pub(super) boxes: Vec<Aabb>,
}

impl Before {
    /// From links, the pairs that were looked at since, and the places of bodies then and now.
    pub(super) fn new(
        (scene, forest): (&Scene, &Forest),
        (old, new): (&WorldView, &WorldView),
        (links, mut looked_at): (GroupLinks, Vec<(ElementId, ElementId)>),
    ) -> Before {
        looked_at.sort_unstable();
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let moved = |body: &BodyId| old.poses()[body.0 as usize] != new.poses()[body.0 as usize];
        let movers: Vec<BodyId> = bodies.filter(moved).collect();
        let of_body = |&body: &BodyId| {
            let patches = scene.bodies[body.0 as usize].patches.clone();
            let roots = patches.map(|patch| forest.fixed(forest.patch_root(PatchId(patch))));
            let around = |view: &WorldView| {
                roots.clone().fold(Aabb::EMPTY, |all, id| all.union(*view.fixed_box(id)))
            };
            [around(old), around(new)]
        };
        let boxes = movers.iter().flat_map(of_body).filter(|bounds| !bounds.is_empty()).collect();
        Before { links, looked_at, movers, boxes }
    }

    /// The link of a pair as it was, if it is as it was.
    fn kept(&self, (forest, view): (&Forest, &WorldView), link: &pair::Link) -> Option<&GroupLink> {
        let last = self.links.between([link.a.0, link.b.0])?;
        if self.looked_at.binary_search(&(link.a, link.b)).is_err() {
            return Some(last);
        }
        let rests = |id| match forest.group(id) {
            Some(group) => group.body.is_none_or(|body| !self.has_moved(body)),
            None => forest.patch(id).is_some_and(|p| !self.has_moved(view.patch(p).body)),
        };
        let by_facets = link.carried.visibility < u16::MAX;
        if last.by_facets != by_facets || !rests(link.a) || !rests(link.b) {
            return None;
        }
        let common = common_body(forest, view, link.a, link.b);
        let ends = [link.a, link.b].map(|id| Spread::new(forest, view, id, common));
        let sight = GroupSight { forest, view, common, candidates: &[], simd: Simd::detect() };
        let key = pair::pair_key(forest.key(link.a), forest.key(link.b));
        let touched = by_facets && sight.rays_meet(&ends[0], &ends[1], key, &self.boxes);
        (!touched).then_some(last)
    }

    fn has_moved(&self, body: BodyId) -> bool {
        self.movers.binary_search(&body).is_ok()
    }
}

/// The group links of a tree: what did not change as it was before, all else from the poses. Cost: proportional to all
/// links, and to the facets at the ends of those with groups; rays for those that are not as before.
pub(crate) fn group_links(
    (forest, view): (&Forest, &WorldView),
    tree: &PairTree,
    before: &Before,
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
            let ids = [link.a.0, link.b.0];
            match before.kept((forest, view), link) {
                Some(kept) => before.links.copy(kept, ids, &mut out),
                None => {
                    let placed = placed((forest, view), link, &mut out.factors);
                    out.links.push(placed);
                    out.ids.push(ids);
                }
            }
        }
        out
    };
    let parts: Vec<PlacedLinks> = all.par_chunks(LINKS_AT_ONCE).map(place).collect();
    let mut links = PlacedLinks::default();
    parts.into_iter().for_each(|part| links.extend(part));
    let Facets { facets, roots } = facets_of(forest);
    GroupLinks::new(facets, roots, links, SQUARE_MOMENT)
}

/// The group links of a forest that grew from one seed, as it grows from another: each as it was, those with an end that `keeps`
/// denies left out.
pub(crate) fn replanted_links(
    links: GroupLinks,
    to: &Renumbering,
    forest: &Forest,
    keeps: &dyn Fn(ElementId) -> bool,
) -> GroupLinks {
    if links.is_empty() {
        return GroupLinks::default();
    }
    let Facets { facets, roots } = facets_of(forest);
    let leaves = |id| leaves_of(forest, ElementId(id));
    links.replanted(to, (facets, roots), &leaves, &|id| keeps(ElementId(id)))
}

/// Facets of the groups of a forest.
struct Facets {
    /// Ids and areas, m2, those of each group side by side.
    facets: Vec<(u32, f32)>,
    /// Places of those of each group that is in no other.
    roots: Vec<Range<u32>>,
}

fn facets_of(forest: &Forest) -> Facets {
    let groups = forest.groups();
    let leaves = groups.leaves().iter();
    Facets {
        facets: leaves.map(|leaf| (leaf.facet.0, leaf.area_m2 as f32)).collect(),
        roots: groups.roots().iter().map(|&root| leaves_of(forest, root)).collect(),
    }
}

fn leaves_of(forest: &Forest, id: ElementId) -> Range<u32> {
    forest.group(id).expect("it is a group").leaves.clone()
}

/// A link from the poses; with rays where something is in its way.
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
        let simd = Simd::detect();
        let sight = GroupSight { forest, view, common, candidates: &candidates, simd };
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
    GroupLink { ends: [one, other], coupling: coupling as f32, by_facets: seen.is_some() }
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
