//! Links by receiver, built from the pairs of a tree or updated by its edits.

use rayon::prelude::*;

use crate::element::ElementId;
use crate::pair::{self, Edit, PairTree};
use crate::solver::{Link, Links, LinksBuilder};

/// Receivers of a hierarchy: what is needed to turn pairs into links.
pub(crate) trait Receivers: Sync {
    /// Room for elements: ids are below this.
    fn room(&self) -> usize;
    /// Whether light is gathered there: an element, neither a light nor distant.
    fn receives(&self, id: ElementId) -> bool;
    /// Area that what arrives is spread over, m2.
    fn receiving_area_m2(&self, id: ElementId) -> f64;
    /// Whether two elements rest against each other, so that what they exchange counts for nothing.
    fn rest_in_contact(&self, _a: ElementId, _b: ElementId) -> bool {
        false
    }
    /// Part of the exchange area of two elements over which no light goes, m2.
    fn dark_exchange_m2(&self, _a: ElementId, _b: ElementId, _exchange_m2: f32) -> f32 {
        0.0
    }
    /// Whether a link that ends there is gathered in another way.
    fn is_apart(&self, _id: ElementId) -> bool {
        false
    }
}

/// Exchange area of a link over which light goes, m2: nothing where it carries none.
fn lit_exchange_m2(forest: &impl Receivers, link: &pair::Link) -> f32 {
    if forest.is_apart(link.a) || forest.is_apart(link.b) {
        return 0.0;
    }
    let exchange = link.carried.exchange_area_past_occluders_m2();
    match exchange > 0.0 && !forest.rest_in_contact(link.a, link.b) {
        true => exchange - forest.dark_exchange_m2(link.a, link.b, exchange),
        false => 0.0,
    }
}

/// Both directions of a link with a lit exchange area, m2: (receiver, link), for the ends with an area that receives, m2.
fn both_ways(
    link: &pair::Link,
    exchange: f32,
    receiving_area_m2: impl Fn(ElementId) -> Option<f32>,
) -> impl Iterator<Item = (u32, Link)> {
    let g = link.carried.gradients;
    let one = |receiver: ElementId, source: ElementId, over_receiver, over_source| {
        let area = receiving_area_m2(receiver).filter(|_| exchange > 0.0)?;
        // Nothing at all would take the link out.
        let coupling = (exchange / area).max(f32::MIN_POSITIVE);
        Some((receiver.0, Link { source: source.0, coupling, over_receiver, over_source }))
    };
    let forth = one(link.a, link.b, g.over_a, g.over_b);
    let back = one(link.b, link.a, g.over_b, g.over_a);
    forth.into_iter().chain(back)
}

/// Area that what arrives is spread over, m2, where light is gathered.
fn receiving_area_m2(forest: &impl Receivers, id: ElementId) -> Option<f32> {
    forest.receives(id).then(|| forest.receiving_area_m2(id) as f32)
}

/// Both directions of a link: (receiver, link), for the ends that receive. Links of visibility 0
/// carry nothing.
pub(crate) fn directions(
    forest: &impl Receivers,
    link: &pair::Link,
) -> impl Iterator<Item = (u32, Link)> {
    both_ways(link, lit_exchange_m2(forest, link), |id| receiving_area_m2(forest, id))
}

/// All links of a tree, by receiver.
pub(super) fn links_of(forest: &impl Receivers, tree: &PairTree) -> Links {
    // Asked for often: what is covered of the ends takes a search.
    let ids = (0..forest.room() as u32).into_par_iter().map(ElementId);
    let areas: Vec<Option<f32>> = ids.map(|id| receiving_area_m2(forest, id)).collect();
    let area = |id: ElementId| areas[id.0 as usize];
    let exchanges: Vec<f32> = tree
        .par_slots()
        .map(|link| link.map_or(0.0, |link| lit_exchange_m2(forest, &link)))
        .collect();
    let lit =
        || tree.slots().zip(&exchanges).filter_map(|(link, &exchange)| Some((link?, exchange)));
    let mut builder = LinksBuilder::new(forest.room());
    for (link, exchange) in lit() {
        both_ways(&link, exchange, area).for_each(|(receiver, _)| builder.count(receiver));
    }
    builder.fill(|add| {
        for (link, exchange) in lit() {
            both_ways(&link, exchange, area).for_each(|(receiver, link)| add(receiver, link));
        }
    })
}

/// Removes both directions of some pairs and sets those of others to what they carry now; what is in both, is set.
pub(crate) fn set_pairs(
    links: &mut Links,
    forest: &impl Receivers,
    removed: impl Iterator<Item = (ElementId, ElementId)>,
    set: impl Iterator<Item = pair::Link>,
) {
    links.extend(forest.room());
    let without = |source: ElementId| Link { source: source.0, ..Link::default() };
    let both = |(a, b): (ElementId, ElementId)| [(a.0, without(b)), (b.0, without(a))];
    let mut wanted: Vec<(u32, Link)> = Vec::new();
    for pair in set {
        let start = wanted.len();
        wanted.extend(directions(forest, &pair));
        if wanted.len() == start {
            wanted.extend(both((pair.a, pair.b)));
        }
    }
    wanted.extend(removed.flat_map(both));
    // In stable order: of equals, what is set comes first.
    let ends = |(receiver, link): &(u32, Link)| u64::from(*receiver) << 32 | u64::from(link.source);
    wanted.sort_by_key(ends);
    wanted.dedup_by_key(|one| ends(one));
    for of_one in wanted.chunk_by(|one, two| one.0 == two.0) {
        links.set(of_one[0].0, of_one.iter().map(|(_, link)| *link));
    }
}

/// Carries edits of a tree over to its links; returns the receivers concerned, ascending.
pub(super) fn apply_edits(
    links: &mut Links,
    forest: &impl Receivers,
    tree: &PairTree,
    edits: &[Edit],
) -> Vec<u32> {
    let removed = edits.iter().filter_map(|edit| match *edit {
        Edit::Removed(a, b) => Some((a, b)),
        Edit::Set(_) => None,
    });
    let set = edits.iter().filter_map(|edit| match *edit {
        // What was removed again, after it was set, is no link by now.
        Edit::Set(id) => tree.link(id),
        Edit::Removed(..) => None,
    });
    let ends = removed.clone().chain(set.clone().map(|link| (link.a, link.b)));
    let receiving = |e: &ElementId| forest.receives(*e);
    let mut receivers: Vec<u32> =
        ends.flat_map(|(a, b)| [a, b]).filter(receiving).map(|e| e.0).collect();
    set_pairs(links, forest, removed, set);
    links.tidy();
    receivers.sort_unstable();
    receivers.dedup();
    receivers
}
