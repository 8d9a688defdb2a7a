//! What a body covers of a patch that it stands on or sticks in. Pure geometry.

use glam::{DVec2, DVec3};

use crate::geometry::{Moments, Plane, Segment, common, difference, within_outlines};
use crate::scene::Scene;
use crate::scene::placed::Placed;
use crate::scene::tuning::COVERED_PARTS_MAX;

use super::hull::{ABOVE, Hull};
use super::parts::{Covered, Inside, add, around};

/// Holes narrower than this, in roundings, let nothing through.
const SLIT: f64 = 8.0;

/// A body that stands on patches or sticks in them.
pub(in crate::scene) struct Stands<'a> {
    scene: &'a Scene,
    placed: &'a [Placed],
    hull: &'a Hull,
    /// What may close its border.
    near: &'a [&'a Placed],
    slack_m: f64,
    /// Whether patches close it, by the planes that were asked for.
    closed: Vec<(Plane, bool)>,
}

/// Where a body crosses the plane of a patch: disjoint convex polygons in the patch's frame, counter-clockwise, metres.
struct Footprint {
    within: Vec<Vec<DVec2>>,
    /// Whether the polygons of the body are wound inwards.
    turned: bool,
}

impl<'a> Stands<'a> {
    /// Of a body, with its polygons by number, and the patches around it.
    pub(in crate::scene) fn new(
        scene: &'a Scene,
        (placed, hull): (&'a [Placed], &'a Hull),
        near: &'a [&'a Placed],
        slack_m: f64,
    ) -> Stands<'a> {
        Stands { scene, placed, hull, near, slack_m, closed: Vec::new() }
    }

    /// Adds what it covers of a patch. `is_own` if the patch is of that body, which moves, and places are in its frame. A two-sided body
    /// with a border covers nothing in a plane whose patches leave a part of its opening free: light gets in there.
    pub(in crate::scene) fn on(
        &mut self,
        (patch, is_own): (&Placed, bool),
        covered: &mut Covered,
        left: &mut usize,
    ) {
        let Some(Footprint { within, turned }) = self.footprint(patch) else { return };
        let hull = self.hull;
        *left = left.saturating_sub(hull.polygons.len());
        let lets_light_in = !(hull.border.is_empty() || hull.twins.is_empty());
        if lets_light_in && !self.is_closed_at(patch, &within, left) {
            return;
        }
        let inner = if turned { &hull.polygons } else { &hull.twins };
        let whole = &self.scene.patches[patch.id.0 as usize].corners;
        for outline in within.iter().map(|p| common(p, whole)).filter(|p| p.len() > 2) {
            let (bounds, [u, v]) = (around(&outline), patch.axes);
            let plane = [patch.origin, u, v];
            covered.inside.push(Inside { of: hull.of, is_own, outline, bounds, plane });
        }
        if add(self.scene, patch.id, within, (&mut *covered, left)) {
            covered.contacts.extend(inner.iter().map(|&k| self.placed[k].id));
        }
    }

    fn footprint(&self, patch: &Placed) -> Option<Footprint> {
        let (hull, slack_m) = (self.hull, self.slack_m);
        let height = |c: DVec3| (c - patch.corners[0]).dot(patch.normal);
        if hull.border.iter().any(|&c| height(c) > slack_m) {
            return None;
        }
        let mut outline: Vec<Segment> = Vec::new();
        for polygon in hull.polygons.iter().map(|&k| &self.placed[k]) {
            let above = |c: DVec3| height(c) - ABOVE * slack_m;
            let n = polygon.corners.len();
            let through = (0..n).filter_map(|k| {
                let [p, q] = [polygon.corners[k], polygon.corners[(k + 1) % n]];
                let (x, y) = (above(p), above(q));
                ((x > 0.0) != (y > 0.0)).then(|| p + (q - p) * (x / (x - y)))
            });
            let ends: Vec<DVec3> = through.collect();
            let [p, q] = ends[..] else { continue };
            // The inside is on the left, seen from the front of the patch.
            let along = patch.normal.cross(polygon.normal);
            let [p, q] = if along.dot(q - p) < 0.0 { [q, p] } else { [p, q] };
            outline.push([p, q].map(|c| patch.in_frame(c)));
        }
        if outline.is_empty() || outline.len() > COVERED_PARTS_MAX {
            return None;
        }
        let turns: f64 = outline.iter().map(|[p, q]| p.perp_dot(*q)).sum();
        // Two-sided polygons may all be wound either way.
        let turned = turns < 0.0 && hull.twins.len() == hull.polygons.len();
        if turned {
            outline.iter_mut().for_each(|line| line.reverse());
        }
        Some(Footprint { within: within_outlines(&outline, slack_m), turned })
    }

    /// Whether patches in the plane of one fill what the body leaves open there.
    fn is_closed_at(&mut self, patch: &Placed, within: &[Vec<DVec2>], left: &mut usize) -> bool {
        let slack_m = self.slack_m;
        let lies_in = |plane: &Plane, p: &Placed| {
            p.corners.iter().all(|&c| plane.distance(c).abs() <= slack_m)
        };
        if let Some((_, closed)) = self.closed.iter().find(|(plane, _)| lies_in(plane, patch)) {
            return *closed;
        }
        let plane = Plane::through(patch.corners[0], patch.normal);
        let mut open = within.to_vec();
        for lid in self.near.iter().filter(|other| lies_in(&plane, other)) {
            let mut corners: Vec<DVec2> = lid.corners.iter().map(|&c| patch.in_frame(c)).collect();
            if lid.normal.dot(patch.normal) < 0.0 {
                corners.reverse();
            }
            let mut rest = Vec::with_capacity(open.len());
            for piece in &open {
                *left = left.saturating_sub(1);
                difference(piece, &corners, &mut rest);
            }
            // Slits of roundings let nothing through.
            rest.retain(|piece| {
                let [low, high] = around(piece);
                Moments::of(piece).area > SLIT * slack_m * (high - low).length()
            });
            open = rest;
            if open.is_empty() || *left == 0 {
                break;
            }
        }
        self.closed.push((plane, open.is_empty()));
        open.is_empty()
    }
}
