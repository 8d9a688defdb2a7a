//! Difference of two world states, and which pairs it may affect.

use crate::element::{ElementId, Forest, Kind, WorldElement, WorldView};
use crate::scene::{BodyId, LightKind, PatchId, Scene};
use crate::transport::Shaft;

use super::coarse_brightness::BrightnessShifts;
use super::ends::{BoxShaft, LightPlace, body_of};
use super::margin::Growth;
use super::verdict::Stale;

/// Motion of a node of the forest's fixed part: its bodies that moved, appeared or vanished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Still,
    Some,
    All,
}

/// Difference of two world states: moved bodies and changed brightness.
///
/// Only the two states count, not the motion between them: the state of a pair is a function of one instant.
pub struct WorldChange<'a> {
    old: &'a WorldView,
    motion: Vec<Motion>,
    movers: Vec<BodyId>,
    /// Changes of brightness; no lists where there are none.
    shifts: BrightnessShifts,
    /// Nodes above the coarse level with a changed coarse element or light below.
    brightness_changed_below: Vec<bool>,
    /// Whether all margins count from the first instant.
    knows_margins: bool,
    /// Nodes that became groups or coarse elements, or ceased to be, ascending.
    regrouped: &'a [ElementId],
}

impl<'a> WorldChange<'a> {
    /// Motion between two instants, without changes of brightness. Cost: proportional to the forest's fixed part.
    pub fn new(
        scene: &Scene,
        forest: &Forest,
        old: &'a WorldView,
        new: &WorldView,
    ) -> WorldChange<'a> {
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let moved = |body: &BodyId| {
            let k = body.0 as usize;
            old.poses()[k] != new.poses()[k] && !scene.bodies[k].patches.is_empty()
        };
        let movers: Vec<BodyId> = bodies.filter(moved).collect();
        let far = old.far_m() != new.far_m();
        let mut motion = vec![Motion::Still; forest.fixed_len() as usize];
        for id in (0..forest.fixed_len()).rev() {
            let element = ElementId(id);
            let of = match forest.kind(element) {
                Kind::Light => {
                    let light = forest.light(element).expect("a light has an index");
                    let sun = new.light(light).is_some_and(|l| l.kind == LightKind::Directional);
                    if old.light(light) != new.light(light) || (far && sun) {
                        Motion::All
                    } else {
                        Motion::Still
                    }
                }
                _ => match body_of(forest, new, element) {
                    Some(body) if movers.binary_search(&body).is_ok() => Motion::All,
                    Some(_) => Motion::Still,
                    None => continue,
                },
            };
            motion[id as usize] = of;
        }
        // Groups of bodies: their children come after them.
        for id in (0..forest.fixed_len()).rev() {
            let element = ElementId(id);
            if forest.kind(element) == Kind::Cluster && forest.cluster_body(element).is_none() {
                let any = forest.children(element).any(|c| motion[c as usize] != Motion::Still);
                motion[id as usize] = if any { Motion::Some } else { Motion::Still };
            }
        }
        WorldChange {
            old,
            motion,
            movers,
            shifts: BrightnessShifts::default(),
            brightness_changed_below: Vec::new(),
            knows_margins: true,
            regrouped: &[],
        }
    }

    /// The same where some nodes (ascending) became groups or coarse elements, or ceased to be: pairs that end there are judged
    /// again, and those above them are looked through.
    pub fn with_regrouped(mut self, forest: &Forest, nodes: &'a [ElementId]) -> WorldChange<'a> {
        for &id in nodes {
            let mut above = forest.parent(id);
            while let Some(id) = above {
                let motion = &mut self.motion[id.0 as usize];
                if *motion == Motion::Still {
                    *motion = Motion::Some;
                }
                above = forest.parent(id);
            }
        }
        WorldChange { regrouped: nodes, ..self }
    }

    /// Difference after an update that was left half-way: some margins count from its beginning, others from its end.
    pub fn after_a_stop(self) -> WorldChange<'a> {
        WorldChange { knows_margins: false, ..self }
    }

    /// Adds the changes of brightness of coarse elements (by number) and of punctual lights.
    pub fn set_brightness_shifts(
        &mut self,
        forest: &Forest,
        coarse: &[u32],
        shifts: BrightnessShifts,
    ) {
        self.brightness_changed_below = vec![false; forest.kept_len() as usize];
        let elements = coarse.iter().zip(&shifts.coarse).filter(|(_, shift)| shift.is_some());
        let is_shifted = |id: &u32| {
            let light = forest.light(ElementId(*id));
            light.is_some_and(|light| shifts.lights[light].is_some())
        };
        let below = elements.map(|(&id, _)| id).chain((0..forest.fixed_len()).filter(is_shifted));
        for id in below {
            let mut above = forest.parent(ElementId(id));
            while let Some(id) = above {
                if std::mem::replace(&mut self.brightness_changed_below[id.0 as usize], true) {
                    break;
                }
                above = forest.parent(id);
            }
        }
        self.shifts = shifts;
    }

    /// Staleness of a pair by changes of brightness.
    pub(super) fn brightness(&self, forest: &Forest, a: ElementId, b: ElementId) -> Stale {
        if self.shifts.coarse.is_empty() {
            return Stale::Nothing;
        }
        let shifted = |id: ElementId| match (forest.coarse(id), forest.light(id)) {
            (Some(number), _) => self.shifts.coarse[number].is_some(),
            (None, Some(light)) => self.shifts.lights[light].is_some(),
            (None, None) => self.brightness_changed_below[id.0 as usize],
        };
        // Above the coarse level no verdict depends on brightness.
        let low = |id| forest.coarse(id).is_some() || forest.kind(id) == Kind::Light;
        match shifted(a) || shifted(b) {
            false => Stale::Nothing,
            true if low(a) && low(b) => Stale::Brightness,
            true => Stale::Below,
        }
    }

    /// Growth of the errors of a pair at or below the coarse level since its margin was counted; `None` if unknown.
    pub(super) fn growth(&self, forest: &Forest, a: ElementId, b: ElementId) -> Option<Growth> {
        let shift = |id| {
            let of_light = || forest.light(id).and_then(|light| self.shifts.lights[light]);
            forest
                .coarse(id)
                .map_or_else(of_light, |number| self.shifts.coarse[number])
                .unwrap_or_default()
        };
        self.knows_margins.then(|| Growth::of_pair(&shift(a), &shift(b)))
    }

    /// Whether the ends of a pair moved against each other.
    pub(super) fn moved(
        &self,
        forest: &Forest,
        new: &WorldView,
        a: ElementId,
        b: ElementId,
    ) -> bool {
        let moved = |id| self.motion[forest.fixed(id).0 as usize] != Motion::Still;
        let body = body_of(forest, new, a);
        let one_body = body.is_some() && body_of(forest, new, b) == body;
        !one_body && (moved(a) || moved(b))
    }

    /// Staleness of a pair by motion.
    pub(super) fn geometry(
        &self,
        forest: &Forest,
        new: &WorldView,
        a: ElementId,
        b: ElementId,
    ) -> Stale {
        if self.moved(forest, new, a, b) {
            return Stale::Moved;
        }
        if [a, b].iter().any(|end| self.regrouped.binary_search(end).is_ok()) {
            return Stale::Regrouped;
        }
        let motion = |id| self.motion[forest.fixed(id).0 as usize];
        let body = body_of(forest, new, a).filter(|&body| body_of(forest, new, b) == Some(body));
        if self.movers.is_empty() {
            return Stale::Nothing;
        }
        if let Some(body) = body
            && self.old.is_present(body) != new.is_present(body)
        {
            return Stale::Moved;
        }
        let rides = body.filter(|_| motion(a) == Motion::All);
        let views = [self.old, new];
        let entered = match (forest.kind(a), forest.kind(b)) {
            (Kind::Element, Kind::Element) => self.mover_is_between(forest, views, (a, b), rides),
            (Kind::Light, Kind::Element) => self.mover_is_before_light(forest, views, a, b),
            (Kind::Element, Kind::Light) => self.mover_is_before_light(forest, views, b, a),
            // Lights have no box: their pairs with groups are looked at always.
            (Kind::Light, _) | (_, Kind::Light) => true,
            _ => views.iter().any(|v| {
                self.mover_enters_box_shaft(forest, &BoxShaft::new(v, forest, (a, b), body), rides)
            }),
        };
        if entered { Stale::Occlusion } else { Stale::Nothing }
    }

    /// Whether the box of a mover meets a shaft; seen from the body `rides` that both ends ride on, all else moves.
    fn mover_enters_box_shaft(
        &self,
        forest: &Forest,
        shaft: &BoxShaft<'_>,
        rides: Option<BodyId>,
    ) -> bool {
        match rides {
            Some(_) => shaft.is_entered_by(Forest::ROOT, rides),
            None => self.movers.iter().any(|&m| shaft.is_entered_by(forest.body_root(m), None)),
        }
    }

    /// Whether a mover stood or stands between two elements.
    fn mover_is_between(
        &self,
        forest: &Forest,
        views: [&WorldView; 2],
        (a, b): (ElementId, ElementId),
        rides: Option<BodyId>,
    ) -> bool {
        let patch = |id| forest.patch(id).expect("elements have patches");
        let patches = (patch(a), patch(b));
        let place = |view, id| WorldElement::new(view, forest, id, false);
        if rides.is_some() {
            // Seen from a moving body, everything else moves.
            return views.iter().any(|view| {
                let (a, b) = (&place(view, a), &place(view, b));
                let shaft = Shaft { forest, view, a, b, own: None, patches };
                shaft.is_entered_by(Forest::ROOT, rides)
            });
        }
        let (a, b) = (&place(views[1], a), &place(views[1], b));
        self.mover_enters_shaft(forest, views, (a, b), patches)
    }

    /// Whether a mover stood or stands between a punctual light and an element.
    fn mover_is_before_light(
        &self,
        forest: &Forest,
        views: [&WorldView; 2],
        light: ElementId,
        element: ElementId,
    ) -> bool {
        let [_, new] = views;
        let Some(lamp) = forest.light(light).and_then(|l| new.light(l)) else { return false };
        let e = WorldElement::new(new, forest, element, false);
        let place = LightPlace::new(lamp, &e, new.far_m());
        let patch = forest.patch(element).expect("elements have patches");
        self.mover_enters_shaft(forest, views, (&e, &place.stand_in), (patch, patch))
    }

    /// Whether a mover stood or stands between two ends that are at rest.
    fn mover_enters_shaft(
        &self,
        forest: &Forest,
        views: [&WorldView; 2],
        (a, b): (&WorldElement, &WorldElement),
        patches: (PatchId, PatchId),
    ) -> bool {
        views.iter().any(|view| {
            let shaft = Shaft { forest, view, a, b, own: None, patches };
            self.movers.iter().any(|&m| shaft.is_entered_by(forest.body_root(m), None))
        })
    }
}
