//! A scene of two plates, for tests of solving.

use std::ops::Range;

use crate::element::ElementId;
use crate::solver::links::{Link, Links};
use crate::solver::place::Place;
use crate::solver::surfaces::{FacetMaterial, Surfaces};

/// Two facets, the second of which is split in two, and perhaps the first half of it again.
pub(super) struct Toy {
    pub(super) lit: [FacetMaterial; 2],
    pub(super) facets: [ElementId; 2],
    /// Where elements lie along the first axis, and their areas; a lamp without area is no surface.
    pub(super) at: Vec<(f32, f64)>,
    pub(super) quarters: bool,
}

impl Surfaces for Toy {
    /// Room for many more, so that two receivers are few.
    fn len(&self) -> usize {
        64
    }
    fn facets(&self) -> &[ElementId] {
        &self.facets
    }
    fn facet_of(&self, id: u32) -> u32 {
        id.min(1)
    }
    fn parent(&self, id: u32) -> Option<u32> {
        (id >= 2).then_some(if id < 4 { 1 } else { 2 })
    }
    fn children(&self, id: u32) -> Range<u32> {
        match id {
            1 => 2..4,
            2 if self.quarters => 4..6,
            _ => 0..0,
        }
    }
    fn area_m2(&self, id: u32) -> f64 {
        self.at[id as usize].1
    }
    fn place(&self, id: u32) -> Place {
        // Strips: as long as their area says.
        let (x, area) = self.at[id as usize];
        let radius = 0.5 * area as f32;
        Place { centroid: [x, 0.0], radius, moment: [radius * radius / 3.0, 0.0, 0.05] }
    }
    fn material(&self, facet: u32) -> &FacetMaterial {
        &self.lit[facet as usize]
    }
}

pub(super) fn set(links: &mut Links, receiver: u32, source: u32, coupling: f32) {
    set_sloping(links, receiver, source, coupling, 0);
}

/// `slope` says how much more arrives at the receiver's upper end.
pub(super) fn set_sloping(links: &mut Links, receiver: u32, source: u32, coupling: f32, slope: i8) {
    let over_receiver = [slope, 0];
    links.set(receiver, [Link { source, coupling, over_receiver, ..Link::default() }].into_iter());
}

/// Two plates, the second split in two, and a lamp; with given couplings.
pub(super) fn plates() -> (Toy, Links) {
    let lit = [FacetMaterial { reflectance: [0.5, 0.8, 0.0], exitance: [1.0, 2.0, 3.0] }; 2];
    let mut links = Links::default();
    links.extend(64);
    for (receiver, source, coupling) in [(0, 2, 0.5), (0, 3, 0.5), (2, 0, 1.0), (3, 0, 1.0)] {
        set(&mut links, receiver, source, coupling);
    }
    let at = vec![(0.0, 1.0), (0.0, 1.0), (-0.25, 0.5), (0.25, 0.5), (0.0, 0.0)];
    (Toy { lit, facets: [ElementId(0), ElementId(1)], at, quarters: false }, links)
}
