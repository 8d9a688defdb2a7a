//! What leaves receive straight from lamps and punctual lights, as the links have it.
//!
//! So that who finds that light exactly can take it out of the solution, and not count it twice. A pure query.

use crate::element::ElementId;
use crate::scene::PatchId;
use crate::solver::{Links, Radiosity};
use crate::space::Solved;

use super::snapshot::{self, Snapshot};

/// A snapshot of the light that comes straight from what some patches emit, and from punctual lights.
pub(super) fn of(
    solved: &Solved,
    links: &Links,
    radiosity: &Radiosity,
    lamps: &[PatchId],
) -> Snapshot {
    let mut emits = vec![false; solved.space.scene.patches.len()];
    lamps.iter().for_each(|lamp| emits[lamp.0 as usize] = true);
    let forest = &solved.space.forest;
    let surfaces = solved.space.surfaces().emission_of(&emits);
    let mut beginning = radiosity.clone();
    // What is distant is no receiver, and keeps what it is given.
    for &facet in forest.distant_facets() {
        let patch = forest.patch(facet).expect("a facet has a patch");
        if !emits[patch.0 as usize] {
            let mut below = vec![facet];
            while let Some(id) = below.pop() {
                beginning.set(id.0, [0.0; 3]);
                below.extend(forest.children(id).map(ElementId));
            }
        }
    }
    let direct = beginning.of_emission(&surfaces, links);
    snapshot::take(solved, links, &direct)
}
