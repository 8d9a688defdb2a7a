//! A solved state of the plane as its readers see it.

use std::ops::Range;

use crate::element::{ElementId, ElementKey};
use crate::follow::{Follower, FrameReport};
use crate::pair::{Carried, Link, LinkEvent, PairTree};
use crate::read::{ElementName, Elements, Event, with_names};

use super::forest::FlatForest;
use super::plane::Segment;
use super::state::{FlatSolved, PlaneState};
use super::surfaces::LitPlane;
use super::view::PlaneView;

/// A link of the plane; it carries light both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatLink {
    /// First end.
    pub a: ElementId,
    /// Second end.
    pub b: ElementId,
    /// Exchange area without occlusion (m2 for each metre of depth) and visibility.
    pub carried: Carried,
}

/// An element of the plane as pictures need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatElement {
    /// Its id in the present solution.
    pub id: ElementId,
    /// Where it is in the world.
    pub place: Segment,
    /// Levels below its facet.
    pub level: u32,
    /// Whether it has no children.
    pub is_leaf: bool,
    /// Radiosity, W/m2.
    pub radiosity: [f32; 3],
}

/// The solution of a scene in the plane, until the session goes on.
#[derive(Clone, Copy)]
pub struct FlatFrame<'a> {
    solved: &'a FlatSolved,
}

impl<'a> FlatFrame<'a> {
    pub(super) fn new(solved: &'a FlatSolved) -> FlatFrame<'a> {
        FlatFrame { solved }
    }

    /// Counters, energies and seconds.
    pub fn report(&self) -> &'a FrameReport {
        &self.solved.report
    }

    /// The pair tree with the forest its elements are in.
    pub fn pairs(&self) -> (&'a PairTree, &'a FlatForest) {
        (&self.solved.tree, &self.solved.space.forest)
    }

    /// Places of all elements at this instant.
    pub fn view(&self) -> &'a PlaneView {
        &self.solved.space.view
    }

    /// All links, in the order of their names.
    pub fn links(&self) -> Vec<FlatLink> {
        let solved = self.solved;
        let link = |l: Link| FlatLink { a: l.a, b: l.b, carried: l.carried };
        let mut out: Vec<FlatLink> = solved.tree.links().map(link).collect();
        out.sort_by_key(|l| (solved.space.forest.key(l.a), solved.space.forest.key(l.b)));
        out
    }

    /// All elements, parents before children, in the order of their names.
    pub fn elements(&self) -> Vec<FlatElement> {
        let Follower { space: PlaneState { forest, view, .. }, radiosity, .. } = self.solved;
        let element = |id: ElementId| FlatElement {
            id,
            place: view.place(forest, id),
            level: forest.level(id),
            is_leaf: forest.children(id).is_empty(),
            radiosity: radiosity.radiosity(id.0),
        };
        forest.elements().into_iter().map(element).collect()
    }

    /// Radiosity of an element, W/m2.
    pub fn radiosity(&self, id: ElementId) -> [f32; 3] {
        self.solved.radiosity.radiosity(id.0)
    }

    /// The events that led here, with names, if [`FlatOptions::events`](super::FlatOptions::events) asks for them.
    pub fn events(&self) -> Vec<Event> {
        with_names(&self.solved.events, &|facet| self.solved.space.facet_name(ElementId(facet)))
    }

    /// Events as the engine records them, by ids.
    pub fn link_events(&self) -> &'a [LinkEvent] {
        &self.solved.events
    }

    /// Where the element of a name is in the world, whether it exists or not.
    pub fn place_of(&self, key: ElementKey) -> Segment {
        let whole = self.solved.space.view.place(&self.solved.space.forest, ElementId(key.facet));
        let levels = (31 - key.path.leading_zeros()) / 2;
        (0..levels).rev().fold(whole, |s, level| s.half(key.path >> (2 * level) & 1))
    }

    /// The name of an element.
    pub fn name(&self, id: ElementId) -> ElementName {
        let key = self.solved.space.forest.key(id);
        self.solved.space.facet_name(ElementId(key.facet)).at(key.path)
    }
}

impl PlaneState {
    fn facet_name(&self, facet: ElementId) -> ElementName {
        let (wall, back) = self.forest.wall(facet);
        let wall = &self.scene.walls()[wall.0 as usize];
        let body = &self.scene.bodies()[wall.body.0 as usize];
        let surface = if back { format!("{} back", wall.name) } else { wall.name.clone() };
        let (body, path) = (body.name.clone(), Vec::new());
        ElementName::Element { body, surface, patch: None, facet: None, path }
    }
}

impl Elements for PlaneState {
    fn facets(&self) -> &[ElementId] {
        self.forest.facets()
    }

    fn id_limit(&self) -> u32 {
        self.forest.len() as u32
    }

    fn is_element(&self, id: ElementId) -> bool {
        self.forest.is_element(id)
    }

    fn children(&self, id: ElementId) -> Range<u32> {
        self.forest.children(id)
    }

    fn key(&self, id: ElementId) -> ElementKey {
        self.forest.key(id)
    }

    fn name_of(&self, key: ElementKey) -> ElementName {
        self.facet_name(ElementId(key.facet)).at(key.path)
    }

    fn area_m2(&self, id: ElementId) -> f64 {
        self.forest.length(id)
    }

    fn is_present(&self, _: ElementId) -> bool {
        true
    }

    fn error_growth(solved: &FlatSolved) -> f64 {
        let lit = LitPlane::new(&solved.space.scene, &solved.space.forest);
        solved.radiosity.growth(&lit, &solved.links)
    }

    fn is_of_the_scene_of(&self, other: &PlaneState) -> bool {
        self.forest.facets() == other.forest.facets()
            && self.scene.walls().len() == other.scene.walls().len()
    }
}
