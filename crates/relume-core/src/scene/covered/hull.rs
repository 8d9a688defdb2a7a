//! Polygons of a body that hang together along sides, with where they are open and what may shine in there. Pure geometry.

use glam::DVec3;

use crate::geometry::Aabb;
use crate::scene::placed::{IN_PLANE, Placed, reach_m};
use crate::scene::topology::{Polygon, components, matched, sides_of};
use crate::scene::tuning::{COVERED_PARTS_MAX, COVERING_POLYGONS_MAX};
use crate::scene::weld::Weld;
use crate::scene::{BodyId, PatchId, Scene};

/// Bodies are cut this far above a patch to see what they cover, in roundings.
pub(super) const ABOVE: f64 = 4.0;

/// Polygons of a body that hang together along sides.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Hull {
    /// Numbers of its patches in the group; of two sides the first.
    pub(in crate::scene) polygons: Vec<usize>,
    /// The other sides.
    pub(in crate::scene) twins: Vec<usize>,
    /// Ends of sides that no other polygon has.
    pub(in crate::scene) border: Vec<DVec3>,
    pub(in crate::scene) bounds: Aabb,
    /// Whether it lies behind the planes of all its polygons.
    pub(in crate::scene) is_convex: bool,
    /// The body that it is of, and its number there.
    pub(in crate::scene) of: (BodyId, u32),
}

impl Hull {
    /// Whether all corners lie behind the planes of all polygons; that of a body of many polygons is not asked.
    fn is_convex(&self, placed: &[Placed], slack_m: f64) -> bool {
        let polygons = || self.polygons.iter().map(|&k| &placed[k]);
        let behind = |one: &Placed| {
            let height = |c: DVec3| (c - one.corners[0]).dot(one.normal);
            polygons().all(|other| other.corners.iter().all(|&c| height(c) <= slack_m))
        };
        self.polygons.len() <= COVERING_POLYGONS_MAX && polygons().all(behind)
    }

    /// Whether a box lies in front of one of the polygons of a convex body; touching counts.
    pub(in crate::scene) fn is_before(
        &self,
        placed: &[Placed],
        bounds: &Aabb,
        slack_m: f64,
    ) -> bool {
        let before = |polygon: &Placed| {
            let n = polygon.normal;
            let pick = |k: usize| if n[k] > 0.0 { bounds.lo[k] } else { bounds.hi[k] };
            let nearest = DVec3::new(pick(0), pick(1), pick(2));
            (nearest - polygon.corners[0]).dot(n) >= -slack_m
        };
        self.is_convex && self.polygons.iter().any(|&k| before(&placed[k]))
    }

    /// Whether a lamp that touches two-sided polygons may shine among them: if it lies flush on one of them and looks inwards (they
    /// hide nothing of what lies in their place; inwards is known of convex bodies only, so any way counts for others), or if it
    /// lies in the plane of the border and looks at them, as a lamp in the rim of an open box does.
    pub(in crate::scene) fn is_lit_by(
        &self,
        placed: &[Placed],
        lamp: &Placed,
        slack_m: f64,
    ) -> bool {
        !self.twins.is_empty()
            && (self.is_lit_through(placed, lamp, slack_m)
                || self.is_lit_from_border(placed, lamp, slack_m))
    }

    fn is_lit_from_border(&self, placed: &[Placed], lamp: &Placed, slack_m: f64) -> bool {
        let height = |c: DVec3| (c - lamp.corners[0]).dot(lamp.normal);
        !self.border.is_empty()
            && self.bounds.grown(ABOVE * slack_m).meets(&lamp.bounds)
            && self.border.iter().all(|&c| height(c).abs() <= ABOVE * slack_m)
            && self
                .polygons
                .iter()
                .any(|&k| placed[k].corners.iter().any(|&c| height(c) > ABOVE * slack_m))
    }

    fn is_lit_through(&self, placed: &[Placed], lamp: &Placed, slack_m: f64) -> bool {
        let is_flush = |wall: &Placed| {
            let height = |c: DVec3| (c - wall.corners[0]).dot(wall.normal);
            wall.bounds.grown(ABOVE * slack_m).meets(&lamp.bounds)
                && lamp.corners.iter().all(|&c| height(c).abs() <= ABOVE * slack_m)
        };
        let looks_out = |wall: &Placed| self.is_convex && wall.normal.dot(lamp.normal) > 0.0;
        let mut walls = self.polygons.iter().map(|&k| &placed[k]);
        walls.any(|wall| is_flush(wall) && !looks_out(wall))
    }

    /// Whether a patch of the group is one of its own.
    pub(in crate::scene) fn holds(&self, k: usize) -> bool {
        self.polygons.binary_search(&k).is_ok() || self.twins.binary_search(&k).is_ok()
    }
}

/// Adds the groups of polygons of a body, from the number `first` on, that hang together along sides, each of which
/// is run as often one way as the other, or is on the border.
pub(in crate::scene) fn hulls_of(
    scene: &Scene,
    (placed, first): (&[Placed], usize),
    out: &mut Vec<Hull>,
) {
    let Some(body) = placed.get(first).map(|p| scene.patches[p.id.0 as usize].body) else { return };
    let twin = |p: &Placed| scene.patches[p.id.0 as usize].twin;
    let firsts: Vec<usize> = (first..placed.len())
        .filter(|&k| twin(&placed[k]).is_none_or(|twin| twin > placed[k].id))
        .collect();
    let all = || firsts.iter().map(|&k| &placed[k]);
    let mut weld = Weld::of_corners(all().flat_map(|p| p.corners.iter().copied()));
    let polygon = |p: &Placed| {
        let mut corners: Vec<u32> = p.corners.iter().map(|&c| weld.vertex(c)).collect();
        corners.dedup();
        Polygon { patch: p.id, two_sided: false, corners }
    };
    let polygons: Vec<Polygon> = all().map(polygon).collect();
    let sides = matched(&weld.points, weld.tolerance, sides_of(&polygons));
    let component = components(polygons.len(), &sides);
    let count = component.iter().max().map_or(0, |&most| most as usize + 1);
    let mut hulls: Vec<Hull> = (0..count)
        .map(|_| Hull {
            polygons: Vec::new(),
            twins: Vec::new(),
            border: Vec::new(),
            bounds: Aabb::EMPTY,
            is_convex: false,
            of: (body, 0),
        })
        .collect();
    let number_of = |patch: PatchId| {
        let start = placed[first].id.0;
        first + (patch.0 - start) as usize
    };
    for (at, &of) in component.iter().enumerate() {
        let hull = &mut hulls[of as usize];
        let own = &placed[firsts[at]];
        hull.polygons.push(firsts[at]);
        hull.twins.extend(twin(own).map(number_of));
        hull.bounds = hull.bounds.union(own.bounds);
    }
    for group in &sides {
        let forth = group.iter().filter(|s| s.start < s.end).count();
        if 2 * forth != group.len() {
            let ends = [group[0].start, group[0].end].map(|c| weld.points[c as usize]);
            hulls[component[group[0].polygon as usize] as usize].border.extend(ends);
        }
    }
    for (number, hull) in (0..).zip(&mut hulls) {
        hull.of.1 = number;
        hull.twins.sort_unstable();
        hull.is_convex = hull.is_convex(placed, IN_PLANE * reach_m(&hull.bounds));
    }
    out.extend(
        hulls.into_iter().filter(|hull| (3..=COVERED_PARTS_MAX).contains(&hull.polygons.len())),
    );
}
