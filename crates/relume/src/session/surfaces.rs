//! The forest as the solver sees it, and links as numbers.

use std::ops::Range;

use rayon::prelude::*;

use crate::element::{ElementId, Forest, Kind, WorldView};
use crate::pair::{self, Edit, PairTree};
use crate::scene::{PatchId, Scene, World};
use crate::solver::{Link, Links, LinksBuilder, Lit, Place, Surfaces};

/// A forest with its materials at one instant.
pub(super) struct LitForest<'a> {
    forest: &'a Forest,
    patch_lit: Vec<Lit>,
    /// Places of all elements, where they were worth computing ahead.
    places: Vec<Place>,
}

impl<'a> LitForest<'a> {
    pub(super) fn new(scene: &Scene, forest: &'a Forest, now: &World) -> LitForest<'a> {
        let single = |v: [f64; 3]| v.map(|x| x as f32);
        let of_patch = |patch: &crate::scene::Patch| {
            let exitance = single(now.exitance(scene, patch));
            Lit { reflectance: single(now.reflectance(scene, patch)), exitance }
        };
        let patch_lit = scene.patches.iter().map(of_patch).collect();
        LitForest { forest, patch_lit, places: Vec::new() }
    }

    /// Absent bodies emit nothing: they do not count in the mean that residuals are relative to.
    pub(super) fn present_in(mut self, view: &WorldView) -> LitForest<'a> {
        for (patch, lit) in self.patch_lit.iter_mut().enumerate() {
            if !view.is_present(view.patch(PatchId(patch as u32)).body) {
                lit.exitance = [0.0; 3];
            }
        }
        self
    }

    /// Whether no surface emits anything.
    pub(super) fn is_dark(&self) -> bool {
        self.patch_lit.iter().all(|lit| lit.exitance == [0.0; 3])
    }

    /// With all places computed ahead: for several sweeps over all of the forest.
    pub(super) fn with_places(mut self) -> LitForest<'a> {
        let ids = (0..self.forest.len() as u32).into_par_iter();
        self.places = ids.map(|id| place_of(self.forest, ElementId(id))).collect();
        self
    }
}

pub(super) fn place_of(forest: &Forest, id: ElementId) -> Place {
    if forest.kind(id) != Kind::Element {
        return Place { centroid: [0.0; 2], radius: 1.0, moment: [1.0, 0.0, 1.0] };
    }
    let extent = forest.exposed_extent(id);
    Place {
        centroid: [extent.centroid.x as f32, extent.centroid.y as f32],
        radius: extent.radius as f32,
        moment: extent.second_moment.map(|m| m as f32),
    }
}

impl Surfaces for LitForest<'_> {
    fn len(&self) -> usize {
        self.forest.len()
    }

    fn facets(&self) -> &[ElementId] {
        self.forest.near_facets()
    }

    fn is_surface(&self, id: u32) -> bool {
        self.forest.receives(ElementId(id))
    }

    fn facet_of(&self, id: u32) -> u32 {
        self.forest.fixed(ElementId(id)).0
    }

    fn parent(&self, id: u32) -> Option<u32> {
        let parent = self.forest.parent(ElementId(id))?;
        (self.forest.kind(parent) == Kind::Element).then_some(parent.0)
    }

    fn children(&self, id: u32) -> Range<u32> {
        self.forest.children(ElementId(id))
    }

    fn area_m2(&self, id: u32) -> f64 {
        self.forest.exposed_m2(ElementId(id))
    }

    fn place(&self, id: u32) -> Place {
        match self.places.get(id as usize) {
            Some(place) => *place,
            None => place_of(self.forest, ElementId(id)),
        }
    }

    fn lit(&self, facet: u32) -> &Lit {
        let patch = self.forest.patch(ElementId(facet)).expect("elements have patches");
        &self.patch_lit[patch.0 as usize]
    }
}

/// Who receives over links: all that turning pairs into links asks of a hierarchy.
pub(crate) trait Receivers {
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
}

impl Receivers for Forest {
    fn room(&self) -> usize {
        self.len()
    }

    fn receives(&self, id: ElementId) -> bool {
        Forest::receives(self, id)
    }

    fn receiving_area_m2(&self, id: ElementId) -> f64 {
        self.receiving_m2(id)
    }

    fn rest_in_contact(&self, a: ElementId, b: ElementId) -> bool {
        Forest::rest_in_contact(self, a, b)
    }
}

/// Both directions of a link: (receiver, link), for the ends that receive. Links of visibility 0
/// carry nothing.
pub(super) fn directions(
    forest: &impl Receivers,
    link: &pair::Link,
) -> impl Iterator<Item = (u32, Link)> {
    let carried = link.carried;
    let exchange = carried.exchange_area_past_occluders_m2();
    let g = carried.gradients;
    let exchange = if forest.rest_in_contact(link.a, link.b) { 0.0 } else { exchange };
    let one = |receiver: ElementId, source: ElementId, over_receiver, over_source| {
        let receives = forest.receives(receiver) && exchange > 0.0;
        receives.then(|| {
            let coupling = exchange / forest.receiving_area_m2(receiver) as f32;
            // Nothing at all would take the link out.
            let coupling = coupling.max(f32::MIN_POSITIVE);
            (receiver.0, Link { source: source.0, coupling, over_receiver, over_source })
        })
    };
    let forth = one(link.a, link.b, g.over_a, g.over_b);
    let back = one(link.b, link.a, g.over_b, g.over_a);
    forth.into_iter().chain(back)
}

/// All links of a tree, by receiver.
pub(crate) fn links_of(forest: &impl Receivers, tree: &PairTree) -> Links {
    let mut builder = LinksBuilder::new(forest.room());
    for link in tree.links() {
        directions(forest, &link).for_each(|(receiver, _)| builder.count(receiver));
    }
    builder.fill(|add| {
        for link in tree.links() {
            directions(forest, &link).for_each(|(receiver, link)| add(receiver, link));
        }
    })
}

/// Removes both directions of some pairs and sets those of others to what they carry now; what is in both, is set.
pub(super) fn set_pairs(
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
        if pair.carried.exchange_area_past_occluders_m2() > 0.0
            && !forest.rest_in_contact(pair.a, pair.b)
        {
            wanted.extend(directions(forest, &pair));
        } else {
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
pub(crate) fn apply_edits(
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
