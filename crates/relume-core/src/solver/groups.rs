//! Links that end on groups of facets, as numbers.
//!
//! Facet i of one end and facet j of the other exchange K A_i f_i A_j f_j: whatever leaves an end over a link is one sum over its
//! facets, and what arrives is handed out by their own factors. An element stands for itself, with a line.

use std::ops::Range;
use std::sync::OnceLock;

use rayon::prelude::*;

use crate::element::Renumbering;

use super::field::Linear;

/// One end of a group link.
#[derive(Clone, Debug, PartialEq)]
pub enum GroupEnd {
    /// Facets of a group, by their places in [`GroupLinks::new`]'s list, and the first of their factors.
    Group {
        /// Places of the facets.
        facets: Range<u32>,
        /// Place of the first factor.
        first: u32,
    },
    /// An element.
    Element {
        /// Its id.
        id: u32,
        /// Area, m2.
        area_m2: f32,
        /// Largest distance of a corner from the centroid, metres.
        radius: f32,
        /// Mean factor.
        mean: f32,
        /// Relative gradient of the factor, per radius.
        gradient: [f32; 2],
    },
}

/// A link of which an end is a group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupLink {
    /// Both ends.
    pub ends: [GroupEnd; 2],
    /// K = V / (pi R^2), 1/m2; where factors have visibilities of their own in them, divided by V^2.
    pub coupling: f32,
    /// Whether they have.
    pub by_facets: bool,
}

/// The facets of a group that is in no other, with the link ends at or below it: link, and which end.
#[derive(Clone, Debug)]
struct Root {
    facets: Range<u32>,
    ends: Vec<(u32, u8)>,
}

/// End of a link that is an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct ElementEnd {
    id: u32,
    link: u32,
    /// Which end of the link.
    side: u8,
}

/// All of them.
#[derive(Clone, Debug, Default)]
pub struct GroupLinks {
    /// Facets of groups: those of each group side by side.
    facets: Vec<(u32, f32)>,
    /// Place of each facet, by id; [`NONE`] for what is in no group.
    places: Vec<u32>,
    links: Vec<GroupLink>,
    /// Ids of both ends of each link.
    ids: Vec<[u32; 2]>,
    /// The links by the ids of their ends, ascending.
    by_ids: Vec<u32>,
    factors: Vec<f32>,
    /// By the first of their facets.
    roots: Vec<Root>,
    /// Ends that are elements, by their ids.
    elements: Vec<ElementEnd>,
    /// Place of each element among those that are ends, by id; [`NONE`] for others.
    element_places: Vec<u32>,
    /// Mean of x^2 / radius^2 over an element.
    moment: f32,
    /// What arrives where every surface sends 1, once it is asked for.
    rows: OnceLock<Arriving>,
}

/// Links with the ids of their ends and the factors of their facets, one after the other.
#[derive(Clone, Debug, Default)]
pub struct PlacedLinks {
    /// The links.
    pub links: Vec<GroupLink>,
    /// Ids of both ends of each.
    pub ids: Vec<[u32; 2]>,
    /// Factors of facets.
    pub factors: Vec<f32>,
}

impl PlacedLinks {
    /// Adds others after these.
    pub fn extend(&mut self, other: PlacedLinks) {
        let shift = self.factors.len() as u32;
        self.links.extend(other.links.into_iter().map(|link| link.shifted(shift)));
        self.ids.extend(other.ids);
        self.factors.extend(other.factors);
    }
}

impl GroupLink {
    /// With factors this much further on.
    fn shifted(mut self, by: u32) -> GroupLink {
        for end in &mut self.ends {
            if let GroupEnd::Group { first, .. } = end {
                *first += by;
            }
        }
        self
    }
}

const NONE: u32 = u32::MAX;

/// What arrives over group links.
#[derive(Clone, Debug, Default)]
pub(super) struct Arriving {
    /// At the facets, by place, W/m2.
    facets: Vec<[f32; 3]>,
    /// At the elements that are ends themselves, by place; gradients per metre.
    elements: Vec<Linear>,
}

impl GroupLinks {
    /// From facets (id and area, m2), the ranges of them that are in no other group, links, and the mean of x^2 / radius^2 over an element.
    pub fn new(
        facets: Vec<(u32, f32)>,
        roots: Vec<Range<u32>>,
        PlacedLinks { links, ids, factors }: PlacedLinks,
        moment: f32,
    ) -> GroupLinks {
        let mut roots: Vec<Root> =
            roots.into_iter().map(|facets| Root { facets, ends: Vec::new() }).collect();
        roots.sort_by_key(|root| root.facets.start);
        let mut elements = Vec::new();
        for (k, link) in (0_u32..).zip(&links) {
            for (side, end) in (0_u8..).zip(&link.ends) {
                match end {
                    GroupEnd::Group { facets, .. } => {
                        let after = roots.partition_point(|root| root.facets.start <= facets.start);
                        roots[after - 1].ends.push((k, side));
                    }
                    GroupEnd::Element { id, .. } => {
                        elements.push(ElementEnd { id: *id, link: k, side });
                    }
                }
            }
        }
        elements.sort_unstable();
        let len = facets.iter().map(|&(id, _)| id as usize + 1).max().unwrap_or(0);
        let mut places = vec![NONE; len];
        facets.iter().zip(0..).for_each(|(&(id, _), place)| places[id as usize] = place);
        let rows = OnceLock::new();
        let by_ids = in_order(&ids);
        let element_places = places_of(&elements);
        GroupLinks {
            facets,
            places,
            links,
            ids,
            by_ids,
            factors,
            roots,
            elements,
            element_places,
            moment,
            rows,
        }
    }

    /// The link between two ends, if there is one.
    pub fn between(&self, ids: [u32; 2]) -> Option<&GroupLink> {
        let place = self.by_ids.binary_search_by_key(&ids, |&k| self.ids[k as usize]).ok()?;
        Some(&self.links[self.by_ids[place] as usize])
    }

    /// Links with the ids of their ends.
    pub fn iter(&self) -> impl Iterator<Item = ([u32; 2], &GroupLink)> {
        self.ids.iter().copied().zip(&self.links)
    }

    /// Factors of the facets of an end.
    pub fn factors(&self, facets: &Range<u32>, first: u32) -> &[f32] {
        &self.factors[first as usize..first as usize + facets.len()]
    }

    /// What both ends of one of these exchange, m2.
    pub fn exchange_area_m2(&self, link: &GroupLink) -> f64 {
        let projected = |end: &GroupEnd| match end {
            GroupEnd::Group { facets, first } => {
                let own = &self.facets[facets.start as usize..facets.end as usize];
                let factors = &self.factors[*first as usize..*first as usize + own.len()];
                own.iter().zip(factors).map(|(&(_, area), &f)| f64::from(area) * f64::from(f)).sum()
            }
            GroupEnd::Element { area_m2, mean, .. } => f64::from(*area_m2) * f64::from(*mean),
        };
        f64::from(link.coupling) * link.ends.iter().map(projected).product::<f64>()
    }

    /// Adds a link of these to others.
    pub fn copy(&self, link: &GroupLink, ids: [u32; 2], to: &mut PlacedLinks) {
        let mut link = link.clone();
        for end in &mut link.ends {
            if let GroupEnd::Group { facets, first } = end {
                let own = *first as usize..*first as usize + facets.len();
                *first = to.factors.len() as u32;
                to.factors.extend_from_slice(&self.factors[own]);
            }
        }
        to.links.push(link);
        to.ids.push(ids);
    }

    /// Follows elements to their new ids; groups and facets keep theirs.
    pub fn renumber(&mut self, to: &Renumbering) {
        for (link, ids) in self.links.iter_mut().zip(&mut self.ids) {
            *ids = ids.map(|id| to.new_of(id));
            for (end, &new) in link.ends.iter_mut().zip(&*ids) {
                if let GroupEnd::Element { id, .. } = end {
                    *id = new;
                }
            }
        }
        self.elements.iter_mut().for_each(|end| end.id = to.new_of(end.id));
        self.elements.sort_unstable();
        self.element_places = places_of(&self.elements);
        self.by_ids = in_order(&self.ids);
        self.rows = OnceLock::new();
    }

    /// The links where the forest grows from another seed: elements have other ids, facets of groups other places. `facets`
    /// and `roots` are as in [`GroupLinks::new`]; `leaves` gives the places of the facets of a group by its new id; `keeps` says
    /// by their new ids which ends links are kept of.
    pub fn replanted(
        self,
        to: &Renumbering,
        (facets, roots): (Vec<(u32, f32)>, Vec<Range<u32>>),
        leaves: &dyn Fn(u32) -> Range<u32>,
        keeps: &dyn Fn(u32) -> bool,
    ) -> GroupLinks {
        let GroupLinks { links, ids, factors, moment, .. } = self;
        let ids = ids.into_iter().map(|ids| ids.map(|id| to.new_of(id)));
        let kept = links.into_iter().zip(ids).filter(|(_, ids)| ids.iter().all(|&id| keeps(id)));
        let (mut links, ids): (Vec<GroupLink>, Vec<[u32; 2]>) = kept.unzip();
        for (link, ids) in links.iter_mut().zip(&ids) {
            for (end, &new) in link.ends.iter_mut().zip(ids) {
                match end {
                    GroupEnd::Element { id, .. } => *id = new,
                    GroupEnd::Group { facets, .. } => *facets = leaves(new),
                }
            }
        }
        GroupLinks::new(facets, roots, PlacedLinks { links, ids, factors }, moment)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.links.is_empty()
    }

    /// What arrives everywhere where elements send what `sent` says: means, and first moments.
    pub(super) fn arriving(&self, sent: &(impl Fn(u32) -> Linear + Sync), moment: f32) -> Arriving {
        let leaving: Vec<[[f32; 3]; 2]> = self
            .links
            .par_iter()
            .map(|link| [0, 1].map(|side| self.leaving_w(&link.ends[side], sent, moment)))
            .collect();
        let at_root = |Root { facets, ends }: &Root| {
            let mut out = vec![[0.0_f32; 3]; facets.len()];
            for &(k, side) in ends {
                let link = &self.links[k as usize];
                let GroupEnd::Group { facets: own, first } = &link.ends[usize::from(side)] else {
                    continue;
                };
                let sum = leaving[k as usize][usize::from(1 - side)].map(|x| x * link.coupling);
                let from = (own.start - facets.start) as usize;
                let factors = &self.factors[*first as usize..*first as usize + own.len()];
                for (to, f) in out[from..from + own.len()].iter_mut().zip(factors) {
                    (0..3).for_each(|c| to[c] += sum[c] * f);
                }
            }
            out
        };
        let parts: Vec<Vec<[f32; 3]>> = self.roots.par_iter().map(at_root).collect();
        let mut facets = vec![[0.0; 3]; self.facets.len()];
        for (root, part) in self.roots.iter().zip(&parts) {
            let range = root.facets.start as usize..root.facets.end as usize;
            facets[range].copy_from_slice(part);
        }
        Arriving { facets, elements: self.at_elements(&leaving) }
    }

    /// What leaves an end towards the other, before the coupling: sum of A f B, W.
    fn leaving_w(&self, end: &GroupEnd, sent: &impl Fn(u32) -> Linear, moment: f32) -> [f32; 3] {
        let mut sum = [0.0_f32; 3];
        match end {
            GroupEnd::Group { facets, first } => {
                let own = &self.facets[facets.start as usize..facets.end as usize];
                let factors = &self.factors[*first as usize..*first as usize + own.len()];
                for (&(id, area), f) in own.iter().zip(factors) {
                    if *f > 0.0 {
                        let b = sent(id).mean;
                        (0..3).for_each(|c| sum[c] += area * f * b[c]);
                    }
                }
            }
            GroupEnd::Element { id, area_m2, mean, gradient, .. } => {
                let b = sent(*id);
                for c in 0..3 {
                    let uneven = b.gradient[0][c] * gradient[0] + b.gradient[1][c] * gradient[1];
                    sum[c] = area_m2 * mean * (b.mean[c] + moment * uneven);
                }
            }
        }
        sum
    }

    fn at_elements(&self, leaving: &[[[f32; 3]; 2]]) -> Vec<Linear> {
        let of_element = |ends: &[ElementEnd]| {
            let mut h = Linear::default();
            for &ElementEnd { link: k, side, .. } in ends {
                let link = &self.links[k as usize];
                if let GroupEnd::Element { mean, radius, gradient, .. } =
                    &link.ends[usize::from(side)]
                {
                    let sum = leaving[k as usize][usize::from(1 - side)];
                    for c in 0..3 {
                        let arrives = sum[c] * link.coupling * mean;
                        h.mean[c] += arrives;
                        h.gradient[0][c] += arrives * gradient[0] / radius;
                        h.gradient[1][c] += arrives * gradient[1] / radius;
                    }
                }
            }
            h
        };
        let by_element: Vec<&[ElementEnd]> =
            self.elements.chunk_by(|one, other| one.id == other.id).collect();
        by_element.par_iter().map(|ends| of_element(ends)).collect()
    }

    /// What arrives at one element over its own group links and those of the groups that it is a facet of.
    pub(super) fn at(&self, arriving: &Arriving, id: u32) -> Linear {
        let mut h = match self.element_places.get(id as usize) {
            Some(&place) if place != NONE => arriving.elements[place as usize],
            _ => Linear::default(),
        };
        match self.places.get(id as usize) {
            Some(&place) if place != NONE => {
                let facet = arriving.facets[place as usize];
                (0..3).for_each(|c| h.mean[c] += facet[c]);
            }
            _ => {}
        }
        h
    }

    /// The sum of form factors from one element over its group links with sources that `counts` says, the same for all: in the
    /// first channel.
    pub(super) fn row(
        &self,
        id: u32,
        linear: bool,
        counts: &(dyn Fn(u32) -> bool + Sync),
    ) -> Linear {
        let ones = |id: u32| {
            let mean = [f32::from(u8::from(counts(id))), 0.0, 0.0];
            Linear { mean, ..Linear::default() }
        };
        let rows = self.rows.get_or_init(|| self.arriving(&ones, self.moment));
        let row = self.at(rows, id);
        if linear { row } else { Linear { mean: row.mean, ..Linear::default() } }
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        let ends: usize = self.roots.iter().map(|root| root.ends.capacity() * 8).sum();
        (self.links.capacity() * size_of::<GroupLink>()
            + self.factors.capacity() * 4
            + self.facets.capacity() * 8
            + self.places.capacity() * 4
            + self.elements.capacity() * size_of::<ElementEnd>()
            + self.element_places.capacity() * 4
            + (self.ids.capacity() * 8 + self.by_ids.capacity() * 4)
            + ends) as u64
    }
}

/// Number of each element among those of some ends (ascending), by id.
fn places_of(elements: &[ElementEnd]) -> Vec<u32> {
    let mut out = vec![NONE; elements.last().map_or(0, |end| end.id as usize + 1)];
    for (place, ends) in elements.chunk_by(|one, other| one.id == other.id).enumerate() {
        out[ends[0].id as usize] = place as u32;
    }
    out
}

/// Places of some pairs of ids in their order.
fn in_order(ids: &[[u32; 2]]) -> Vec<u32> {
    let mut out: Vec<u32> = (0..ids.len() as u32).collect();
    out.sort_unstable_by_key(|&k| ids[k as usize]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOMENT: f32 = 1.0 / 6.0;

    /// A group of three facets within one of four, and an element: links of the element with the smaller, and of the
    /// fourth facet's own group with it.
    fn links() -> GroupLinks {
        let facets = vec![(4, 1.0), (5, 2.0), (6, 0.5), (8, 4.0)];
        let element =
            GroupEnd::Element { id: 9, area_m2: 3.0, radius: 2.0, mean: 0.5, gradient: [0.2, 0.0] };
        let small = |first| GroupEnd::Group { facets: 0..3, first };
        let last = GroupEnd::Group { facets: 3..4, first: 6 };
        let list = vec![
            GroupLink { ends: [small(0), element], coupling: 0.1, by_facets: false },
            GroupLink { ends: [last, small(3)], coupling: 0.2, by_facets: false },
        ];
        let factors = vec![1.0, 0.5, 0.0, 0.25, 0.0, 2.0, 0.75];
        let placed = PlacedLinks { links: list, ids: vec![[1, 9], [3, 1]], factors };
        GroupLinks::new(facets, vec![0..3, 3..4], placed, MOMENT)
    }

    /// K A_i f_i A_j f_j of every two ends.
    const EXCHANGES: [(u32, u32, f32); 4] = [
        (4, 9, 0.1 * 1.0 * 1.0 * 3.0 * 0.5),
        (5, 9, 0.1 * 2.0 * 0.5 * 3.0 * 0.5),
        (4, 8, 0.2 * 1.0 * 0.25 * 4.0 * 0.75),
        (6, 8, 0.2 * 0.5 * 2.0 * 4.0 * 0.75),
    ];

    #[test]
    fn facets_receive_what_the_sum_over_all_pairs_of_facets_brings() {
        let links = links();
        let radiosity = |id: u32| [f32::from(id as u8), 1.0, 0.5];
        let sent = |id: u32| Linear { mean: radiosity(id), ..Linear::default() };
        let arriving = links.arriving(&sent, MOMENT);
        for (id, area) in [(4, 1.0), (5, 2.0), (6, 0.5), (8, 4.0), (9, 3.0)] {
            let mut want = [0.0_f32; 3];
            for (one, two, x) in EXCHANGES {
                let other = if one == id {
                    two
                } else if two == id {
                    one
                } else {
                    continue;
                };
                let b = radiosity(other);
                (0..3).for_each(|c| want[c] += x / area * b[c]);
            }
            let found = links.at(&arriving, id);
            for c in 0..3 {
                assert!((found.mean[c] - want[c]).abs() < 1e-6, "{id}: {found:?} {want:?}");
            }
            let row = links.row(id, true, &|_| true).mean[0];
            assert!((row - 2.0 * want[2]).abs() < 1e-6, "{id}: {row} {want:?}");
        }
    }

    #[test]
    fn an_element_sends_more_where_it_is_brighter_towards_the_group_and_receives_a_line() {
        let links = links();
        let even = |_: u32| Linear { mean: [1.0; 3], ..Linear::default() };
        let uneven = |id: u32| match id {
            9 => Linear { mean: [1.0; 3], gradient: [[0.5; 3], [0.0; 3]] },
            _ => even(id),
        };
        let [flat, steep] = [
            links.at(&links.arriving(&even, MOMENT), 5),
            links.at(&links.arriving(&uneven, MOMENT), 5),
        ];
        let more = 1.0 + MOMENT * 0.5 * 0.2;
        assert!((steep.mean[0] / flat.mean[0] - more).abs() < 1e-6);
        let line = links.at(&links.arriving(&even, MOMENT), 9);
        assert!((line.gradient[0][0] - line.mean[0] * 0.2 / 2.0).abs() < 1e-6);
    }
}
