//! What patches cover of each other, and bodies of patches, in each frame that things share. Pure geometry.

use glam::{DVec2, DVec3};

use crate::geometry::{Aabb, BoxTree, Interval, Plane, Pose};
use crate::scene::gap::{gap_reach, open_sides};
use crate::scene::placed::{IN_PLANE, Placed, reach_m};
use crate::scene::tuning::COVERED_CUTS_MAX;
use crate::scene::{BodyId, InPlane, Lying, Scene, Sheet, Solids};

use super::hull::{Hull, hulls_of};
use super::in_gap::{Face, dark_in_gaps};
use super::lamps::{Lamps, OfBodies};
use super::parts::{Covered, add};
use super::stands::Stands;

impl Scene {
    /// What of each patch is covered by what rests on it; empty where nothing is. That is where it touches another patch or
    /// another shows in its place ([`Sheet::lies_to`]), and where a body of polygons that look outwards, or are two-sided, stands on
    /// it or sticks in it: one that is closed but for a border in the patch's plane or behind it, so that boxes without a bottom
    /// count (where they are two-sided, if patches fill that border), all wound alike, and without lamps in it or in its border; and what lies in narrow gaps (`scene/gap.rs`). Bodies that never move cover each other, a body that moves only itself.
    /// Exact to a millionth of the largest coordinate. Of patches that are covered by more than 0.999 by one thing only that is said.
    /// Those that `is_displaced` names are not where the file has them: they cover themselves alone, as if they moved.
    pub(crate) fn covered(
        &self,
        solids: &Solids,
        is_displaced: &dyn Fn(BodyId) -> bool,
    ) -> Vec<Covered> {
        let mut out = vec![Covered::default(); self.patches.len()];
        let bodies = (0..self.bodies.len() as u32).map(BodyId);
        let (moving, at_rest): (Vec<BodyId>, Vec<BodyId>) = bodies
            .filter(|&body| !self.is_distant(body))
            .partition(|&b| self.moves(b) || is_displaced(b));
        let mut cuts_left = COVERED_CUTS_MAX;
        let lamps = Lamps::of(self);
        let mut cover = |bodies: &[BodyId], is_own: bool| {
            let group = Group::new(self, &lamps, bodies, is_own);
            group.cover((self, solids), &mut out, &mut cuts_left);
        };
        cover(&at_rest, false);
        moving.into_iter().for_each(|body| cover(&[body], true));
        for covered in &mut out {
            covered.contacts.sort_unstable();
            covered.contacts.dedup();
        }
        out
    }
}

/// Patches that share a frame.
struct Group<'a> {
    placed: Vec<Placed>,
    /// Their boxes.
    boxes: BoxTree,
    hulls: Vec<Hull>,
    lamps: OfBodies<'a>,
    slack_m: f64,
    /// Whether they are those of a body that moves, in its frame.
    is_own: bool,
}

impl<'a> Group<'a> {
    fn new(scene: &'a Scene, all: &'a Lamps, bodies: &'a [BodyId], is_own: bool) -> Group<'a> {
        let mut placed = Vec::new();
        let mut hulls = Vec::new();
        for &body in bodies {
            let first = placed.len();
            let own = scene.patches_of(body);
            placed.extend(own.map(|(id, patch)| Placed::new(id, patch, &Pose::IDENTITY)));
            hulls_of(scene, (&placed, first), &mut hulls);
        }
        let slack_m = IN_PLANE * placed.iter().map(|p| reach_m(&p.bounds)).fold(0.0, f64::max);
        let lamps = OfBodies { scene, all, bodies };
        hulls.retain(|hull: &Hull| !lamps.may_be_in((&placed, hull), slack_m));
        let boxes = BoxTree::new(placed.iter().map(|p| p.bounds));
        Group { placed, boxes, hulls, lamps, slack_m, is_own }
    }

    fn cover(&self, (scene, solids): (&Scene, &Solids), out: &mut [Covered], left: &mut usize) {
        let mut order: Vec<usize> = (0..self.placed.len()).collect();
        let low = |k: &usize| self.placed[*k].bounds.lo.x;
        order.sort_by(|p, q| low(p).total_cmp(&low(q)).then(p.cmp(q)));
        let mut ranks = vec![0; order.len()];
        order.iter().enumerate().for_each(|(rank, &k)| ranks[k] = rank);
        let order = Order { order, ranks };
        for &one in &order.order {
            let reach = self.placed[one].bounds.grown(self.slack_m);
            for other in order.after(one, &self.boxes, &reach) {
                if self.may_touch(one, other) {
                    self.touch((scene, solids), [one, other], out, left);
                }
            }
        }
        for hull in &self.hulls {
            let mut near = self.boxes.meeting(&hull.bounds.grown(self.slack_m));
            near.retain(|&k| !hull.holds(k));
            let near: Vec<&Placed> = near.into_iter().map(|k| &self.placed[k]).collect();
            let mut stands = Stands::new(scene, (&self.placed, hull), &near, self.slack_m);
            for patch in &near {
                stands.on((patch, self.is_own), &mut out[patch.id.0 as usize], left);
            }
        }
        self.narrow(scene, &order, out, left);
    }

    /// What of patches lies in narrow gaps.
    fn narrow(&self, scene: &Scene, order: &Order, out: &mut [Covered], left: &mut usize) {
        let open = open_sides(&self.placed);
        let face = |k: usize| Face { placed: &self.placed[k], open: open[k] };
        for &one in &order.order {
            let reach = gap_reach(&self.placed[one].bounds);
            let others = order.after(one, &self.boxes, &reach).into_iter().map(face);
            let body = scene.patches[self.placed[one].id.0 as usize].body;
            let way = &self.lamps.all.ways[body.0 as usize];
            let may_hold_lamp = |bounds: &Aabb| self.lamps.may_be_at(&way.around(bounds));
            for part in dark_in_gaps(face(one), others, self.slack_m, self.is_own, may_hold_lamp) {
                let covered = &mut out[part.patch.0 as usize];
                part.add_to(scene, covered, left);
            }
        }
    }

    /// Whether two patches lie in one plane, and their boxes meet.
    fn may_touch(&self, one: usize, other: usize) -> bool {
        let (p, q) = (&self.placed[one], &self.placed[other]);
        let plane = Plane::through(p.corners[0], p.normal);
        p.bounds.grown(self.slack_m).meets(&q.bounds)
            && p.normal.dot(q.normal).abs() > 0.5
            && q.corners.iter().all(|&c| plane.distance(c).abs() <= self.slack_m)
    }

    /// What two patches in one plane cover of each other.
    fn touch(
        &self,
        (scene, solids): (&Scene, &Solids),
        pair: [usize; 2],
        out: &mut [Covered],
        left: &mut usize,
    ) {
        let [p, q] = pair.map(|k| &self.placed[k]);
        let sheet = |p: &Placed| {
            let patch = &scene.patches[p.id.0 as usize];
            let enclosure = solids.enclosures[p.id.0 as usize];
            let (lying_m2, rounding_m) = (scene.lying_m2(patch), patch.rounding_m());
            Sheet { patch: p.id, twin: patch.twin, enclosure, lying_m2, rounding_m }
        };
        let opposed = p.normal.dot(q.normal) < 0.0;
        for (of, by) in [(p, q), (q, p)] {
            let height = |&c: &DVec3| (c - of.corners[0]).dot(of.normal);
            let lying = Lying { opposed, height_m: Interval::of(by.corners.iter().map(height)) };
            let lies = sheet(by).lies_at(&sheet(of), lying);
            if lies == InPlane::Apart {
                continue;
            }
            let mut corners: Vec<DVec2> = by.corners.iter().map(|&c| of.in_frame(c)).collect();
            if opposed {
                corners.reverse();
            }
            let covered = &mut out[of.id.0 as usize];
            let found = add(scene, of.id, vec![corners], (covered, left));
            if found && opposed {
                covered.contacts.push(by.id);
            }
        }
    }
}

/// Patches by their lowest coordinates.
struct Order {
    order: Vec<usize>,
    /// Places in the order, by patch.
    ranks: Vec<usize>,
}

impl Order {
    /// Those after one of them whose boxes meet a box, in their order.
    fn after(&self, one: usize, boxes: &BoxTree, bounds: &Aabb) -> Vec<usize> {
        let mut out = boxes.meeting(bounds);
        out.retain(|&k| self.ranks[k] > self.ranks[one]);
        out.sort_unstable_by_key(|&k| self.ranks[k]);
        out
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use crate::geometry::Moments;
    use crate::scene::{Interpolation, SceneBuilder, Track};

    /// What is covered of a floor of 4 x 4 m, a patch of its own, by a box of 1 x 2 m that is made by `skip` without some of its
    /// sides (4 is the bottom), lowered by `sunk_m`.
    fn covered_m2(skip: &[usize], sunk_m: f64, moves: bool, lamp: bool) -> f64 {
        covered(skip, sunk_m, (moves, lamp), None).0
    }

    /// The same of a box of two-sided polygons, wound inwards or not, and in how many contacts the floor is.
    fn covered(
        skip: &[usize],
        sunk_m: f64,
        (moves, lamp): (bool, bool),
        two_sided: Option<bool>,
    ) -> (f64, usize) {
        let mut b = SceneBuilder::new("floor and box");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let floor = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
        let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)];
        b.polygon(floor, "floor", grey, &corners.map(|(x, y)| DVec3::new(x, y, 0.0)));
        let at = DVec3::new(1.5, 1.5, -sunk_m);
        let node = b.node("box", None, at, DQuat::from_rotation_z(0.3));
        let p = |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64 * 2.0, (k >> 2) as f64);
        let sides =
            [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [0, 2, 3, 1], [4, 5, 7, 6]];
        let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
        for (k, side) in sides.iter().enumerate().filter(|(k, _)| !skip.contains(k)) {
            let mut corners = side.map(p);
            if two_sided == Some(true) {
                corners.reverse();
            }
            let of = if two_sided.is_some() { thin } else { grey };
            b.polygon(node, &format!("side {k}"), of, &corners);
        }
        if lamp {
            let glow = b.material("glow", [0.0; 3], [1.0; 3]);
            let small = [(0.4, 0.4), (0.6, 0.4), (0.6, 0.6)];
            b.polygon(node, "lamp", glow, &small.map(|(x, y)| DVec3::new(x, y, 0.5)));
        }
        if moves {
            let values = vec![at, at + DVec3::Z];
            let interpolation = Interpolation::Linear;
            b.animate_translation(node, Track { times_s: vec![0.0, 1.0], values, interpolation });
        }
        let scene = b.build().unwrap();
        let covered = scene.covered(&scene.solids(), &|_| false);
        let area_m2 = covered[0].parts.iter().map(|(p, _)| Moments::of(p).area).sum();
        (area_m2, covered[0].contacts.len())
    }

    #[test]
    fn two_sided_boxes_without_a_bottom_cover_too_and_see_nothing_of_the_floor() {
        for inwards in [false, true] {
            let (area_m2, contacts) = covered(&[4], 0.0, (false, false), Some(inwards));
            assert!((area_m2 - 2.0).abs() < 1e-6 && contacts == 5, "{area_m2} {contacts}");
        }
        assert_eq!(covered(&[4, 5], 0.0, (false, false), Some(false)), (0.0, 0));
    }

    #[test]
    fn boxes_cover_what_they_stand_on_with_and_without_a_bottom() {
        for (skip, sunk_m) in [(&[][..], 0.0), (&[4][..], 0.0), (&[][..], 0.3), (&[4][..], 0.3)] {
            let found = covered_m2(skip, sunk_m, false, false);
            assert!((found - 2.0).abs() < 1e-6, "{skip:?} {sunk_m}: {found}");
        }
    }

    #[test]
    fn what_light_may_get_into_or_what_moves_or_floats_covers_nothing() {
        assert_eq!(covered_m2(&[4, 5], 0.0, false, false), 0.0);
        assert_eq!(covered_m2(&[4, 0], 0.0, false, false), 0.0);
        assert_eq!(covered_m2(&[4], 0.0, false, true), 0.0);
        assert_eq!(covered_m2(&[4], 0.0, true, false), 0.0);
        assert_eq!(covered_m2(&[4], -0.1, false, false), 0.0);
        assert_eq!(covered_m2(&[], -0.1, false, false), 0.0);
    }

    #[test]
    fn of_a_rug_and_a_floor_the_floor_is_covered_and_crates_on_both_count_once() {
        let mut b = SceneBuilder::new("rug");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let node = b.node("all", None, DVec3::ZERO, DQuat::IDENTITY);
        let square =
            |r: f64| [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(x, y)| DVec3::new(x, y, 0.0));
        b.polygon(node, "floor", grey, &square(4.0));
        b.polygon(node, "rug", grey, &square(2.0));
        let crate_ = b.node("crate", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid(crate_, "crate", grey, DVec3::new(1.0, 1.0, 0.0), DVec3::new(3.0, 3.0, 1.0));
        let scene = b.build().unwrap();
        let covered = scene.covered(&scene.solids(), &|_| false);
        let area =
            |k: usize| covered[k].parts.iter().map(|(p, _)| Moments::of(p).area).sum::<f64>();
        assert!(
            (area(0) - 19.0).abs() < 1e-6 && (area(1) - 1.0).abs() < 1e-6,
            "{} {}",
            area(0),
            area(1)
        );
        assert!(!covered[0].contacts.is_empty());
    }
}
