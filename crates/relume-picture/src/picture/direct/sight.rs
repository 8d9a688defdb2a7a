//! What a leaf sees of the lamps, found once for all of its points.
//!
//! Must not know snapshots.

use glam::{DMat3, DVec2, DVec3};
use relume_core::element::WorldLight;
use relume_core::geometry::{Aabb, Plane};
use relume_core::scene::{LightKind, PatchId};
use relume_core::transport::{form_factor_from_point, keep_in_front, light_at};

use super::cut::{Blocker, Cutter, Hides, Screen};
use super::tree::Tree;
use crate::picture::tuning::{PATCHWORK_FAR, PATCHWORK_LAMPS};

/// A polygon that shines on its front.
pub(super) struct Lamp {
    pub(super) patch: PatchId,
    pub(super) corners: Vec<DVec3>,
    pub(super) plane: Plane,
    pub(super) bounds: Aabb,
    /// To its axes, of which the third is its normal.
    pub(super) turn: DMat3,
    /// Its corners in these.
    pub(super) turned: Vec<DVec3>,
    /// W/m2.
    pub(super) exitance: [f64; 3],
    pub(super) lying_m2: f64,
}

/// A punctual light with its intensity, W/sr (directional: W/m2).
pub(super) struct Punctual {
    pub(super) light: WorldLight,
    pub(super) intensity: [f64; 3],
}

/// Everything that shines or hides, in the world.
pub(super) struct Surroundings {
    pub(super) lamps: Vec<Lamp>,
    pub(super) lights: Vec<Punctual>,
    pub(super) blockers: Vec<Blocker>,
    /// What each of them is.
    pub(super) known: Vec<Known>,
    pub(super) tree: Tree,
    /// What is no further above a surface hides nothing of what it sees, metres.
    pub(super) slack_m: f64,
    pub(super) far_m: f64,
}

/// What is known of a blocker where it lies in the plane of a lamp.
#[derive(Clone, Copy)]
pub(super) struct Known {
    pub(super) patch: PatchId,
    pub(super) twin: Option<PatchId>,
    pub(super) lying_m2: f64,
}

/// A flat piece of a surface.
pub(super) struct Receiver<'a> {
    pub(super) corners: &'a [DVec3],
    pub(super) plane: Plane,
    pub(super) patch: PatchId,
    /// The box around it in the patch's frame.
    pub(super) low: DVec2,
    pub(super) high: DVec2,
    /// The point of the world at a point of the patch's frame.
    pub(super) place: &'a dyn Fn(DVec2) -> DVec3,
}

/// A lamp as a leaf sees it.
struct LampSight {
    lamp: u32,
    /// Whether it reaches below the horizon of the leaf.
    crosses: bool,
    /// What hides of it, in its axes.
    screens: Vec<Screen>,
}

/// What a leaf sees of the lamps.
pub(super) struct Sight {
    lamps: Vec<LampSight>,
    lights: Vec<(u32, Vec<Blocker>)>,
    /// Light of lamps that nothing hides from any of its points.
    clear: Option<Patchwork>,
}

/// A smooth function over a rectangle by its values at 3 x 3 points.
struct Patchwork {
    low: DVec2,
    size: DVec2,
    values: [[f64; 3]; 9],
}

impl Patchwork {
    fn at(&self, p: DVec2) -> [f64; 3] {
        let t = (p - self.low) / self.size;
        let weights =
            |x: f64| [2.0 * (x - 0.5) * (x - 1.0), 4.0 * x * (1.0 - x), 2.0 * x * (x - 0.5)];
        let (wx, wy) = (weights(t.x), weights(t.y));
        let mut out = [0.0; 3];
        for (j, wy) in wy.iter().enumerate() {
            for (i, wx) in wx.iter().enumerate() {
                let value = &self.values[3 * j + i];
                (0..3).for_each(|c| out[c] += wx * wy * value[c]);
            }
        }
        out
    }
}

impl Sight {
    pub(super) fn new(around: &Surroundings, receiver: &Receiver<'_>) -> Sight {
        let mut sight = Sight { lamps: Vec::new(), lights: Vec::new(), clear: None };
        let bounds = Aabb::of(receiver.corners.iter().copied());
        let mut found = Vec::new();
        for (index, lamp) in (0..).zip(&around.lamps) {
            let before = |plane: &Plane, corners: &[DVec3]| {
                corners.iter().any(|&c| plane.distance(c) > around.slack_m)
            };
            if lamp.patch == receiver.patch
                || !before(&lamp.plane, receiver.corners)
                || !before(&receiver.plane, &lamp.corners)
            {
                continue;
            }
            around.tree.between(&bounds, &lamp.bounds, &mut found);
            let blockers = around.between(receiver, &lamp.corners, Some(lamp), &found);
            let hides_all = |blocker: &Blocker| {
                let hides = |&c: &DVec3| blocker.hides(c, &lamp.corners, around.slack_m);
                receiver.corners.iter().all(|c| hides(c) == Hides::All)
            };
            if blockers.iter().any(hides_all) {
                continue;
            }
            let crosses = lamp.corners.iter().any(|&c| receiver.plane.distance(c) < 0.0);
            let screens = blockers.iter().map(|b| Screen::new(b, &lamp.turn)).collect();
            sight.lamps.push(LampSight { lamp: index, crosses, screens });
        }
        for (index, punctual) in (0..).zip(&around.lights) {
            let ends = receiver.corners.iter().map(|&c| around.end(&punctual.light, c));
            let ends: Vec<DVec3> = ends.collect();
            if ends.iter().all(|&end| receiver.plane.distance(end) <= 0.0) {
                continue;
            }
            around.tree.between(&bounds, &Aabb::of(ends.iter().copied()), &mut found);
            sight.lights.push((index, around.between(receiver, &ends, None, &found)));
        }
        sight.take_clear(around, receiver);
        sight
    }

    /// Puts lamps that are clear and far for the size of the leaf together, where there are several.
    fn take_clear(&mut self, around: &Surroundings, receiver: &Receiver<'_>) {
        let node = |k: usize| {
            let share = DVec2::new((k % 3) as f64, (k / 3) as f64) * 0.5;
            (receiver.place)(receiver.low + (receiver.high - receiver.low) * share)
        };
        let nodes: [DVec3; 9] = std::array::from_fn(node);
        let bounds = Aabb::of(nodes);
        let is_far = |sight: &LampSight| {
            let lamp = &around.lamps[sight.lamp as usize];
            let size_m = nodes[0].distance(nodes[8]);
            !sight.crosses
                && sight.screens.is_empty()
                && nodes.iter().all(|&c| lamp.plane.distance(c) > around.slack_m)
                && lamp.bounds.distance(&bounds) > PATCHWORK_FAR * size_m
        };
        let far: Vec<u32> = self.lamps.iter().filter(|s| is_far(s)).map(|s| s.lamp).collect();
        if far.len() < PATCHWORK_LAMPS {
            return;
        }
        self.lamps.retain(|sight| !far.contains(&sight.lamp));
        let value = |at: DVec3| {
            let mut sum = [0.0; 3];
            for &lamp in &far {
                let lamp = &around.lamps[lamp as usize];
                let factor = form_factor_from_point(at, receiver.plane.normal, &lamp.corners);
                (0..3).for_each(|c| sum[c] += factor * lamp.exitance[c]);
            }
            sum
        };
        let (low, size) = (receiver.low, receiver.high - receiver.low);
        self.clear = Some(Patchwork { low, size, values: nodes.map(value) });
    }

    /// Whether anything stands between it and a lamp.
    pub(super) fn is_shaded(&self) -> bool {
        self.lamps.iter().any(|sight| !sight.screens.is_empty())
            || self.lights.iter().any(|(_, blockers)| !blockers.is_empty())
    }

    /// What arrives at a point of the leaf straight from the lamps, W/m2.
    pub(super) fn at(
        &self,
        around: &Surroundings,
        (point, normal): (DVec3, DVec3),
        in_patch: DVec2,
        cutter: &mut Cutter,
    ) -> [f64; 3] {
        let mut sum = self.clear.as_ref().map_or([0.0; 3], |clear| clear.at(in_patch));
        let horizon = Plane::through(point, normal);
        let mut cut = Vec::new();
        for sight in &self.lamps {
            let lamp = &around.lamps[sight.lamp as usize];
            if lamp.plane.distance(point) <= around.slack_m {
                continue;
            }
            if sight.crosses {
                cut.clear();
                cut.extend_from_slice(&lamp.corners);
                keep_in_front(&mut cut, &horizon);
                if cut.len() < 3 {
                    continue;
                }
            }
            let factor = if sight.screens.is_empty() {
                let seen = if sight.crosses { &cut } else { &lamp.corners };
                form_factor_from_point(point, normal, seen)
            } else {
                let seen = if sight.crosses {
                    cut.iter_mut().for_each(|c| *c = lamp.turn * *c);
                    &cut
                } else {
                    &lamp.turned
                };
                let at = (lamp.turn * point, lamp.turn * normal);
                cutter.factor(at, seen, &sight.screens, around.slack_m)
            };
            (0..3).for_each(|c| sum[c] += factor * lamp.exitance[c]);
        }
        for (index, blockers) in &self.lights {
            let Punctual { light, intensity } = &around.lights[*index as usize];
            let arrives = light_at(light, point, normal);
            if arrives > 0.0 {
                let end = around.end(light, point);
                if !blockers.iter().any(|blocker| blocker.is_between(point, end)) {
                    (0..3).for_each(|c| sum[c] += arrives * intensity[c]);
                }
            }
        }
        sum
    }
}

impl Surroundings {
    /// Where light on its way to a point comes from.
    fn end(&self, light: &WorldLight, point: DVec3) -> DVec3 {
        match light.kind {
            LightKind::Directional => point - light.direction * self.far_m,
            _ => light.position,
        }
    }

    /// Whether a patch lies on a lamp, in its plane, and hides what it covers: of what faces the same way the smaller does, as in
    /// the solution, and what faces the lamp and has one side does.
    fn lies_on(&self, blocker: u32, lamp: &Lamp) -> bool {
        let (known, of) = (&self.known[blocker as usize], &self.blockers[blocker as usize]);
        let is_off = |&c: &DVec3| lamp.plane.distance(c).abs() > self.slack_m;
        let is_its = known.patch == lamp.patch || known.twin == Some(lamp.patch);
        if is_its || of.corners.iter().any(is_off) {
            return false;
        }
        let is_smaller = known.lying_m2 < lamp.lying_m2 * (1.0 - 1e-6);
        is_smaller || (known.twin.is_none() && of.plane.normal.dot(lamp.plane.normal) < 0.0)
    }

    /// What of the patches found stands between a receiver and something convex: the parts before both planes.
    fn between(
        &self,
        receiver: &Receiver<'_>,
        to: &[DVec3],
        lamp: Option<&Lamp>,
        found: &[u32],
    ) -> Vec<Blocker> {
        let raised = |p: &Plane| Plane { normal: p.normal, offset: p.offset + self.slack_m };
        let (own, other) = (raised(&receiver.plane), lamp.map(|lamp| raised(&lamp.plane)));
        let mut hull = None;
        let part = |&k: &u32| {
            let Blocker { corners, plane } = &self.blockers[k as usize];
            let (mut corners, mut plane) = (corners.clone(), *plane);
            if let Some(lamp) = lamp.filter(|lamp| self.lies_on(k, lamp)) {
                let lift = lamp.plane.normal * (2.0 * self.slack_m);
                corners.iter_mut().for_each(|c| *c += lift);
                plane.offset += plane.normal.dot(lift);
            }
            for before in [Some(&own), other.as_ref()].into_iter().flatten() {
                let off = |&c: &DVec3| before.distance(c);
                if corners.iter().all(|c| off(c) <= 0.0) {
                    return None;
                }
                if corners.iter().any(|c| off(c) < 0.0) {
                    keep_in_front(&mut corners, before);
                }
            }
            if corners.len() < 3 {
                return None;
            }
            let hull = hull.get_or_insert_with(|| hull_planes(receiver.corners, to));
            let outside = |p: &Plane| corners.iter().all(|&c| p.distance(c) <= 0.0);
            let is_between = !hull.iter().any(outside);
            is_between.then_some(Blocker { corners, plane })
        };
        found.iter().filter_map(part).collect()
    }
}

/// Planes through an edge of one polygon and a corner of another that have both in front, or on them.
fn hull_planes(one: &[DVec3], other: &[DVec3]) -> Vec<Plane> {
    let mut planes = Vec::new();
    for (edges, corners) in [(one, other), (other, one)] {
        for (k, &from) in edges.iter().enumerate() {
            let along = edges[(k + 1) % edges.len()] - from;
            for &corner in corners {
                let Some(normal) = along.cross(corner - from).try_normalize() else { continue };
                let plane = Plane::through(from, normal);
                let reach = along.length() + (corner - from).length();
                let slack = 1e-9 * reach;
                let span = |of: &[DVec3]| {
                    let off = of.iter().map(|&c| plane.distance(c));
                    off.fold((0.0_f64, 0.0_f64), |(lo, hi), d| (lo.min(d), hi.max(d)))
                };
                let (a, b) = (span(one), span(other));
                let (low, high) = (a.0.min(b.0), a.1.max(b.1));
                if low >= -slack {
                    planes.push(plane);
                } else if high <= slack {
                    planes.push(Plane { normal: -plane.normal, offset: -plane.offset });
                }
            }
        }
    }
    planes
}
