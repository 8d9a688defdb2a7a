//! Certificates of pairs in the plane: until when the known motion cannot change what was found.
//!
//! Conservative like those of space: where things can get is bounded by boxes, and where the exact test of
//! a pair, or of any below it, allows some rounding, these allow a quarter of the least of it or ask for a
//! clear distance.

use glam::{DVec2, DVec3};

use crate::element::ElementId;
use crate::geometry::{Aabb, Interval, shaft_meets_box};
use crate::pair::{CertificateTests, Moves};
use crate::predict::MotionBounds;
use crate::scene::{BodyId, Drift};

use super::forest::FlatForest;
use super::plane::{ROUNDING, Segment, in_space};
use super::scene::{BodyIndex, FlatScene};
use super::tuning::ALIKE;
use super::view::PlaneView;

/// A scene in the plane at one instant, with what comes.
pub(super) struct PlaneCertificateTests<'a> {
    pub(super) scene: &'a FlatScene,
    pub(super) forest: &'a FlatForest,
    pub(super) now: &'a PlaneView,
    pub(super) motion_bounds: &'a MotionBounds,
}

/// Two ends of a pair as far as shafts are concerned.
struct Ends {
    bounds: (Aabb, Aabb),
    bodies: (BodyIndex, BodyIndex),
    /// Of elements: where they are in the world, and their walls.
    places: Option<(Segment, Segment)>,
    walls: (u32, u32),
    /// The least size that rounding is relative to, of this pair and any below it at any time, m.
    least_size_m: f64,
    /// The largest coordinate of either at any time, m.
    size_m: f64,
}

/// What is farther apart than this share of the coordinates is so whatever rounding does.
const CLEAR: f64 = 1e-9;

impl CertificateTests for PlaneCertificateTests<'_> {
    fn motion_bounds(&self) -> &MotionBounds {
        self.motion_bounds
    }

    fn rest(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        match (self.forest.body(a), self.forest.body(b)) {
            (Some(a), Some(b)) => a == b || (self.rests(h, a) && self.rests(h, b)),
            _ => false,
        }
    }

    fn is_entered(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        let Some(ends) = self.ends(h, a, b) else { return true };
        let own = ends.bodies.0;
        if self.rests(h, own) {
            let mut movers = self.motion_bounds.movers(h);
            return movers.any(|BodyId(mover)| self.may_block(h, &ends, BodyIndex(mover)));
        }
        // Seen from a moving body, everything else moves.
        self.bodies().any(|other| other != own && self.may_block(h, &ends, other))
    }

    fn stays_clear(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        let clear = |ends: Ends| !self.bodies().any(|body| self.may_block(h, &ends, body));
        self.ends(h, a, b).is_some_and(clear)
    }

    fn stays_away(&self, h: usize, a: ElementId, b: ElementId) -> bool {
        self.ends(h, a, b).is_some_and(|ends| {
            let Some((place_a, place_b)) = ends.places else { return false };
            let (body_a, body_b) = ends.bodies;
            // There are no pairs below, so the larger of both counts.
            let least =
                |place: &Segment, body| place.size() - longest(&self.drift(h, body).reach());
            let least = least(&place_a, body_a).max(least(&place_b, body_b));
            let slack = 2.0 * slack_m(least, ends.size_m);
            let behind = |one: &Segment, other: &Segment, by: Drift, of: Drift| {
                let known = !matches!(of, Drift::Turns(_));
                let shift = by.reach().difference(&of.reach()).along(in_space(one.normal())).hi;
                known && farthest(one, other) + shift <= slack
            };
            let (drift_a, drift_b) = (self.drift(h, body_a), self.drift(h, body_b));
            behind(&place_a, &place_b, drift_b, drift_a)
                || behind(&place_b, &place_a, drift_a, drift_b)
        })
    }
}

/// How far in front of a segment's line another gets.
fn farthest(of: &Segment, other: &Segment) -> f64 {
    of.distance(other.start).max(of.distance(other.end))
}

/// The largest length of a vector of a box that holds 0.
fn longest(by: &Aabb) -> f64 {
    by.lo.abs().max(by.hi.abs()).truncate().length()
}

/// How far something may reach into a shaft without counting as a blocker of any pair in it whose ends have
/// no smaller coordinates than `least_m`, where the largest coordinates are `size_m`: less than 0 where
/// rounding might count.
fn slack_m(least_m: f64, size_m: f64) -> f64 {
    if least_m >= ALIKE * size_m { 0.25 * ROUNDING * least_m } else { -CLEAR * size_m }
}

/// A lower bound on the larger coordinate of any point of a segment that is displaced by vectors of a box.
fn least_m(s: &Segment, by: &Aabb) -> f64 {
    let axis = |from: f64, to: f64| if from * to > 0.0 { from.abs().min(to.abs()) } else { 0.0 };
    axis(s.start.x, s.end.x).max(axis(s.start.y, s.end.y)) - longest(by)
}

impl PlaneCertificateTests<'_> {
    fn bodies(&self) -> impl Iterator<Item = BodyIndex> {
        (0..self.scene.bodies().len() as u32).map(BodyIndex)
    }

    fn drift(&self, h: usize, body: BodyIndex) -> Drift {
        self.motion_bounds.drift(h, BodyId(body.0))
    }

    fn rests(&self, h: usize, body: BodyIndex) -> bool {
        self.drift(h, body) == Drift::Rests
    }

    /// `None` for pairs with the scene itself.
    fn ends(&self, h: usize, a: ElementId, b: ElementId) -> Option<Ends> {
        let bodies = (self.forest.body(a)?, self.forest.body(b)?);
        if !(self.forest.is_element(a) && self.forest.is_element(b)) {
            let bounds = |body| *self.now.bounds(body);
            return Some(Ends {
                bounds: (bounds(bodies.0), bounds(bodies.1)),
                bodies,
                places: None,
                walls: (u32::MAX, u32::MAX),
                least_size_m: 0.0,
                size_m: 0.0,
            });
        }
        let (local_a, local_b) = (self.forest.local(a), self.forest.local(b));
        let place = |body: BodyIndex, local| self.now.poses()[body.0 as usize].segment(local);
        let places = (place(bodies.0, &local_a), place(bodies.1, &local_b));
        let reach = |body| self.drift(h, body).reach();
        let (reach_a, reach_b) = (reach(bodies.0), reach(bodies.1));
        // Two elements of one body are judged in its frame.
        let least_size_m = match bodies.0 == bodies.1 {
            true => {
                let none = Drift::Rests.reach();
                least_m(&local_a, &none).max(least_m(&local_b, &none))
            }
            false => least_m(&places.0, &reach_a).max(least_m(&places.1, &reach_b)),
        };
        let size = |place: &Segment, by| place.size() + longest(by);
        Some(Ends {
            bounds: (places.0.bounds(), places.1.bounds()),
            bodies,
            places: Some(places),
            walls: (self.forest.wall(a).0.0, self.forest.wall(b).0.0),
            least_size_m,
            size_m: size(&places.0, &reach_a).max(size(&places.1, &reach_b)),
        })
    }

    /// Whether anything of a body may get into a shaft.
    fn may_block(&self, h: usize, ends: &Ends, body: BodyIndex) -> bool {
        let drift = self.drift(h, body);
        let end = |of: BodyIndex| (self.drift(h, of), of == body);
        let moves = Moves::new(end(ends.bodies.0), end(ends.bodies.1), drift);
        let (a, b) = (ends.bounds.0.sum(&moves.a), ends.bounds.1.sum(&moves.b));
        let c = self.now.bounds(body).sum(&moves.c);
        let size = [&a, &b, &c].map(|x| x.lo.abs().max(x.hi.abs()).max_element());
        let margin = CLEAR * size.into_iter().fold(ends.size_m, f64::max);
        if !shaft_meets_box(&a, &b, &c.grown(margin)) {
            return false;
        }
        let Some(places) = &ends.places else { return true };
        let walls = self.scene.bodies()[body.0 as usize].walls.clone();
        let rides = (ends.bodies.0 == body, ends.bodies.1 == body);
        let reach = longest(&drift.reach());
        walls.filter(|&wall| wall != ends.walls.0 && wall != ends.walls.1).any(|wall| {
            let c = &self.now.walls()[wall as usize];
            let size_m = ends.size_m.max(c.size() + reach);
            let shaft = Sweep { a: &places.0, b: &places.1, moves: &moves, rides, size_m };
            shaft.may_be_entered_by(c, slack_m(ends.least_size_m, size_m))
        })
    }
}

/// The region between two segments, wherever motion takes them within a horizon.
struct Sweep<'a> {
    a: &'a Segment,
    b: &'a Segment,
    moves: &'a Moves,
    /// Whether an end rides on the body of what may come between.
    rides: (bool, bool),
    size_m: f64,
}

impl Sweep<'_> {
    /// Whether a segment may come between; `half_m` is how far it may reach in all the same.
    fn may_be_entered_by(&self, c: &Segment, half_m: f64) -> bool {
        !self.is_apart(c)
            && !self.stays_behind(
                self.a,
                &self.moves.a,
                c,
                (self.moves.turning.0, self.rides.0),
                half_m,
            )
            && !self.stays_behind(
                self.b,
                &self.moves.b,
                c,
                (self.moves.turning.1, self.rides.1),
                half_m,
            )
            && !self.is_on_one_side(c, half_m)
    }

    /// Whether a line parts the shaft from a segment at all times: along an axis, along one of the
    /// segments, or along an edge of the shaft as it is now.
    fn is_apart(&self, c: &Segment) -> bool {
        let Sweep { a, b, moves, .. } = self;
        let normals = [
            DVec2::X,
            DVec2::Y,
            a.along().perp(),
            b.along().perp(),
            c.along().perp(),
            (b.start - a.end).perp(),
            (b.end - a.start).perp(),
            (b.start - a.start).perp(),
            (b.end - a.end).perp(),
        ];
        normals.into_iter().any(|n| {
            let span = |s: &Segment, by: &Aabb| {
                Interval::of([n.dot(s.start), n.dot(s.end)]) + by.along(in_space(n))
            };
            let ends = span(a, &moves.a).union(span(b, &moves.b));
            let c = span(c, &moves.c);
            let margin = CLEAR * self.size_m * n.length();
            ends.lo > c.hi + margin || ends.hi < c.lo - margin
        })
    }

    /// Whether a segment stays behind the line of an end: the shaft is in front of it.
    fn stays_behind(
        &self,
        end: &Segment,
        by: &Aabb,
        c: &Segment,
        (turns, rides): (bool, bool),
        half_m: f64,
    ) -> bool {
        let shift = match rides {
            // It keeps its distances.
            true => 0.0,
            false => self.moves.c.difference(by).along(in_space(end.normal())).hi,
        };
        (rides || !turns) && farthest(end, c) + shift <= half_m
    }

    /// Whether both ends stay on one side of a segment's line: so does the shaft.
    fn is_on_one_side(&self, c: &Segment, half_m: f64) -> bool {
        let normal: DVec3 = in_space(c.normal());
        let span = |end: &Segment, by: &Aabb, rides: bool| {
            let shift = match rides {
                true => Interval::ZERO,
                false => by.difference(&self.moves.c).along(normal),
            };
            Interval::of([c.distance(end.start), c.distance(end.end)]) + shift
        };
        let known = !self.moves.turning.2 || (self.rides.0 && self.rides.1);
        let a = span(self.a, &self.moves.a, self.rides.0);
        let both = a.union(span(self.b, &self.moves.b, self.rides.1));
        known && (both.lo >= -half_m || both.hi <= half_m)
    }
}
