//! What leaves receive straight from lamps and punctual lights, as the links have it.
//!
//! So that who finds that light exactly can take it out of the solution, and not count it twice. A pure query.

use crate::element::ElementId;
use crate::scene::PatchId;
use crate::solver::{Links, Radiosity};
use crate::space::Solved;

use super::snapshot::{self, Gathered, LampLight};

/// What some patches emit. What they reflect is left to the links: in the gap above a lamp it is far from uniform.
pub(super) fn lights(solved: &Solved, lamps: &[PatchId]) -> Vec<LampLight> {
    let space = &solved.space;
    let of_patch = |&patch: &PatchId| {
        let exitance = space.world.exitance(&space.scene, &space.scene.patches[patch.0 as usize]);
        LampLight { patch, exitance: exitance.map(|m| m as f32) }
    };
    lamps.iter().map(of_patch).collect()
}

/// The lines of all leaves in the light that comes straight from what some patches emit, and from punctual lights: they may lead
/// below 0.
pub(super) fn of(
    solved: &Solved,
    links: &Links,
    radiosity: &Radiosity,
    lamps: &[LampLight],
) -> Vec<Gathered> {
    snapshot::lines(solved, links, &self::radiosity(solved, links, radiosity, lamps))
}

/// That light, as the links have it.
pub(super) fn radiosity(
    solved: &Solved,
    links: &Links,
    radiosity: &Radiosity,
    lamps: &[LampLight],
) -> Radiosity {
    let mut emitted = vec![[0.0; 3]; solved.space.scene.patches.len()];
    lamps.iter().for_each(|lamp| emitted[lamp.patch.0 as usize] = lamp.exitance);
    let forest = &solved.space.forest;
    let surfaces = solved.space.surfaces().emitting(&emitted);
    let mut beginning = radiosity.clone();
    // What is distant is no receiver, and keeps what it is given.
    for &facet in forest.distant_facets() {
        let patch = forest.patch(facet).expect("a facet has a patch");
        let mut below = vec![facet];
        while let Some(id) = below.pop() {
            beginning.set(id.0, emitted[patch.0 as usize]);
            below.extend(forest.children(id).map(ElementId));
        }
    }
    beginning.of_emission(&surfaces, links)
}
