//! Where radiosity jumps: lines along which other patches meet or cross a patch, or end close before it. Pure geometry.
//!
//! On either side of the foot of a wall a floor may receive quite different light (a discontinuity of order zero;
//! Heckbert 1992). An element across it would carry the mean of both, and send it to both sides. So it does where a panel hangs a little
//! below a ceiling: what is above it is dark, or bright if the panel is a lamp, and seen by hardly anything else.

use glam::{DVec2, DVec3};

use super::gap::PARALLEL;
use super::placed::{IN_PLANE, Placed, reach_m};
use super::{BodyId, Patch, Scene};
use crate::geometry::{Plane, Pose, Segment, segment_within};
use crate::scene::tuning::{END_WITHIN, HINGE_INSTANTS};

/// Lines on a patch across which radiosity jumps, in its frame, metres; outer edges of the patch are left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Discontinuities {
    /// Where others meet its plane, and outlines of those that end close before it and are no lamps.
    pub(crate) met: Vec<Segment>,
    /// Outlines of lamps close before it that shine towards it alone.
    pub(crate) glows: Vec<Segment>,
    /// Outlines of lamps close before it that shine to both sides: it is many times as bright behind these as beside, in a room that they light
    /// all the same.
    pub(crate) spots: Vec<Segment>,
}

impl Scene {
    /// Lines across which radiosity jumps, by patch. Bodies that never move meet each other, a body that
    /// moves or was inserted itself; edges that stay in place while their body turns about them (hinges) meet what never moves.
    /// Other lines that move are not found. Exact to a millionth of the largest coordinate. Cost: pairs of patches whose boxes meet along x.
    pub(crate) fn discontinuities(&self) -> Vec<Discontinuities> {
        let mut out = vec![Discontinuities::default(); self.patches.len()];
        let bodies = (0..self.bodies.len() as u32).map(BodyId);
        let alone = |body: &BodyId| self.moves(*body) || self.is_inserted(*body);
        let (moving, at_rest): (Vec<BodyId>, Vec<BodyId>) =
            bodies.filter(|&body| !self.is_distant(body)).partition(alone);
        self.meet(&at_rest, &mut out);
        for body in moving {
            self.meet(&[body], &mut out);
            self.stand(&at_rest, &self.hinges(body), &mut out);
        }
        out
    }

    /// Edges of a body that stay where they are while it turns, in the world; none of one that is at rest or inserted.
    fn hinges(&self, body: BodyId) -> Vec<[DVec3; 2]> {
        let node = self.bodies[body.0 as usize].node;
        let [from_s, to_s] = self.motion.span_s();
        if self.is_inserted(body) || from_s >= to_s {
            return Vec::new();
        }
        let at = |k: u32| from_s + (to_s - from_s) * f64::from(k) / f64::from(HINGE_INSTANTS);
        let poses: Vec<Pose> =
            (0..=HINGE_INSTANTS).map(|k| self.motion.place(node, at(k))).collect();
        let corners: Vec<Vec<DVec3>> =
            self.patches_of(body).map(|(_, patch)| patch.corners_in_body().collect()).collect();
        let first = poses[0];
        let all = || corners.iter().flatten();
        let reach = all().map(|&c| first.point(c).abs().max_element()).fold(0.0, f64::max);
        let rests = |&c: &DVec3| {
            let is_there = |pose: &Pose| pose.point(c).distance(first.point(c)) <= IN_PLANE * reach;
            poses.iter().all(is_there)
        };
        if all().all(rests) {
            return Vec::new();
        }
        let edges = corners.iter().flat_map(|c| (0..c.len()).map(|k| [c[k], c[(k + 1) % c.len()]]));
        edges
            .filter(|edge| edge.iter().all(rests))
            .map(|edge| edge.map(|c| first.point(c)))
            .collect()
    }

    /// Adds where edges, in the world, lie in patches of bodies at rest.
    fn stand(&self, at_rest: &[BodyId], edges: &[[DVec3; 2]], out: &mut [Discontinuities]) {
        if edges.is_empty() {
            return;
        }
        for (id, patch) in at_rest.iter().flat_map(|&body| self.patches_of(body)) {
            let placed = Placed::new(id, patch, &Pose::IDENTITY);
            let slack_m = IN_PLANE * reach_m(&placed.bounds);
            let plane = Plane::through(placed.origin, placed.normal);
            let lies =
                |edge: &&[DVec3; 2]| edge.iter().all(|&p| plane.distance(p).abs() <= slack_m);
            let lines = edges.iter().filter(lies).map(|edge| edge.map(|p| placed.in_frame(p)));
            let within = lines.filter_map(|line| segment_within(&patch.corners, line, slack_m));
            out[id.0 as usize].met.extend(within);
        }
    }

    /// Adds where patches of some bodies that share a frame meet, or end close before each other.
    fn meet(&self, bodies: &[BodyId], out: &mut [Discontinuities]) {
        let mut placed: Vec<Placed> = bodies
            .iter()
            .flat_map(|&body| self.patches_of(body))
            .map(|(id, patch)| Placed::new(id, patch, &Pose::IDENTITY))
            .collect();
        let slack_m = IN_PLANE * placed.iter().map(|p| reach_m(&p.bounds)).fold(0.0, f64::max);
        placed.iter_mut().for_each(|p| p.bounds = p.bounds.grown(slack_m));
        placed.sort_by(|p, q| p.bounds.lo.x.total_cmp(&q.bounds.lo.x).then(p.id.cmp(&q.id)));
        for (k, one) in placed.iter().enumerate() {
            let near = one.bounds.grown(self.end_within_m(one));
            let beside = placed[k + 1..].iter().take_while(|q| q.bounds.lo.x <= near.hi.x);
            for other in beside.filter(|q| q.bounds.meets(&near)) {
                let touches = other.bounds.meets(&one.bounds);
                for (of, by) in [(one, other), (other, one)] {
                    let twin = self.patches[by.id.0 as usize].twin;
                    if twin == Some(of.id) {
                        continue;
                    }
                    let out = &mut out[of.id.0 as usize];
                    // The back of a polygon lies where its front does.
                    if touches && twin.is_none_or(|twin| twin >= by.id) {
                        self.met((of, by), slack_m, &mut out.met);
                    }
                    if self.is_close_before((of, by), slack_m) {
                        self.end((of, by), slack_m, out);
                    }
                }
            }
        }
    }

    /// Distance within which others end close before a patch, metres.
    fn end_within_m(&self, placed: &Placed) -> f64 {
        let (corners, n) = (&placed.corners, placed.corners.len());
        let border_m: f64 = (0..n).map(|k| corners[k].distance(corners[(k + 1) % n])).sum();
        END_WITHIN * 4.0 * self.patches[placed.id.0 as usize].area_m2() / border_m
    }

    /// Whether the polygon `by` lies before `of`, parallel to it, close for their sizes.
    fn is_close_before(&self, (of, by): (&Placed, &Placed), slack_m: f64) -> bool {
        let plane = Plane::through(of.origin, of.normal);
        let heights = || by.corners.iter().map(|&c| plane.distance(c));
        if of.normal.dot(by.normal) > -PARALLEL {
            return false;
        }
        let widest_m = self.end_within_m(of).min(self.end_within_m(by));
        heights().all(|h| h >= -slack_m && h <= widest_m) && heights().any(|h| h > slack_m)
    }

    /// Adds where the polygon `by` ends before the patch.
    fn end(&self, (of, by): (&Placed, &Placed), slack_m: f64, out: &mut Discontinuities) {
        let patch = &self.patches[of.id.0 as usize];
        let corners: Vec<DVec2> = by.corners.iter().map(|&c| of.in_frame(c)).collect();
        let sides = (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
        let within = sides.filter_map(|side| segment_within(&patch.corners, side, slack_m));
        let lamp = &self.patches[by.id.0 as usize];
        let lines = match self.patch_emits(lamp) {
            false => &mut out.met,
            true if self.emits_away_from(lamp) => &mut out.spots,
            true => &mut out.glows,
        };
        lines.extend(within);
    }

    /// Whether another patch of the body emits that looks away from a patch.
    fn emits_away_from(&self, patch: &Patch) -> bool {
        let looks_away = |p: &Patch| p.frame.normal.dot(patch.frame.normal) <= -PARALLEL;
        let emits_away = |p: &Patch| looks_away(p) && self.patch_emits(p);
        self.patches_of(patch.body).any(|(_, p)| emits_away(p))
    }

    /// Adds where the polygon `by` meets the plane of `of` within that patch.
    fn met(&self, (of, by): (&Placed, &Placed), slack_m: f64, out: &mut Vec<Segment>) {
        let patch = &self.patches[of.id.0 as usize];
        let plane = Plane::through(of.origin, of.normal);
        let in_frame = |p: DVec3| of.in_frame(p);
        let n = by.corners.len();
        let above: Vec<f64> = by.corners.iter().map(|&c| plane.distance(c)).collect();
        let is_on = |k: usize| above[k].abs() <= slack_m;
        let lines: Vec<Segment> = if (0..n).all(is_on) {
            (0..n).map(|k| [in_frame(by.corners[k]), in_frame(by.corners[(k + 1) % n])]).collect()
        } else {
            let on = (0..n).filter(|&k| is_on(k)).map(|k| by.corners[k]);
            let through = (0..n).filter_map(|k| {
                let l = (k + 1) % n;
                let crosses = !is_on(k) && !is_on(l) && (above[k] > 0.0) != (above[l] > 0.0);
                let at = above[k] / (above[k] - above[l]);
                crosses.then(|| by.corners[k] + (by.corners[l] - by.corners[k]) * at)
            });
            let points: Vec<DVec2> = on.chain(through).map(in_frame).collect();
            farthest(&points).into_iter().collect()
        };
        let within = lines.iter().filter_map(|&line| segment_within(&patch.corners, line, slack_m));
        out.extend(within);
    }
}

/// The two points farthest from each other, if there are two.
fn farthest(points: &[DVec2]) -> Option<Segment> {
    let pairs =
        points.iter().enumerate().flat_map(|(k, &p)| points[..k].iter().map(move |&q| [q, p]));
    pairs.max_by(|p, q| p[0].distance_squared(p[1]).total_cmp(&q[0].distance_squared(q[1])))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2, DVec3};

    use crate::geometry::Segment;
    use crate::scene::{Interpolation, RotationTrack, Scene, SceneBuilder, Track};

    fn met(scene: &Scene) -> Vec<Vec<Segment>> {
        scene.discontinuities().into_iter().map(|found| found.met).collect()
    }

    /// A floor of 4 x 4 m with a wall across it, on a body of its own; where the wall is, and whether it moves.
    fn lines(at: DVec3, moves: bool) -> Vec<Vec<Segment>> {
        let mut b = SceneBuilder::new("floor and wall");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let floor = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
        let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)];
        b.polygon(floor, "floor", grey, &corners.map(|(x, y)| DVec3::new(x, y, 0.0)));
        let wall = b.node("wall", None, at, DQuat::IDENTITY);
        let corners = [(1.0, 0.0), (3.0, 0.0), (3.0, 2.0), (1.0, 2.0)];
        b.polygon(wall, "wall", grey, &corners.map(|(x, z)| DVec3::new(x, 1.5, z)));
        if moves {
            let values = vec![at, at + DVec3::Z];
            let interpolation = Interpolation::Linear;
            b.animate_translation(wall, Track { times_s: vec![0.0, 1.0], values, interpolation });
        }
        met(&b.build().unwrap())
    }

    #[test]
    fn a_wall_at_rest_meets_the_floor_where_it_stands_or_sinks_in() {
        for depth in [0.0, 0.5] {
            let found = lines(DVec3::Z * -depth, false);
            let length = |s: &[DVec2; 2]| s[0].distance(s[1]);
            assert_eq!(found[0].len(), 1, "{depth}: {found:?}");
            assert!((length(&found[0][0]) - 2.0).abs() < 1e-12);
            // Along the wall's own lower edge nothing is cut; where the floor crosses the wall, it is.
            let crosses = usize::from(depth > 0.0);
            assert_eq!(found[1].len(), crosses);
        }
    }

    #[test]
    fn what_moves_or_stays_above_meets_nothing() {
        let none = |found: Vec<Vec<Segment>>| found.iter().all(|lines| lines.is_empty());
        assert!(none(lines(DVec3::Z * 0.01, false)));
        assert!(none(lines(DVec3::ZERO, true)));
    }

    /// A wall with a door that turns by a right angle about the line x = 1, y = 1.5 upwards, and so far off it.
    fn door(off_m: f64) -> Vec<Vec<Segment>> {
        let mut b = SceneBuilder::new("wall and door");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let wall = b.node("wall", None, DVec3::ZERO, DQuat::IDENTITY);
        let corners = [(1.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0)];
        b.polygon(wall, "jamb", grey, &corners.map(|(y, z)| DVec3::new(1.0, y, z)));
        let hinge = b.node("door", None, DVec3::new(1.0, 1.5, 0.0), DQuat::IDENTITY);
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (0.0, 2.0)];
        b.polygon(hinge, "leaf", grey, &corners.map(|(x, z)| DVec3::new(x + off_m, 0.0, z)));
        let values = vec![DQuat::IDENTITY, DQuat::from_rotation_z(1.5)];
        let interpolation = Interpolation::Linear;
        b.animate_rotation(hinge, RotationTrack { times_s: vec![0.0, 1.0], values, interpolation });
        met(&b.build().unwrap())
    }

    #[test]
    fn a_door_meets_the_wall_along_its_hinge_though_it_turns() {
        let found = door(0.0);
        assert_eq!(found[0].len(), 1, "{found:?}");
        assert!((found[0][0][0].distance(found[0][0][1]) - 2.0).abs() < 1e-9);
        assert!(door(0.01)[0].is_empty());
    }
    /// How many lines of each sort are on a floor of 4 x 4 m below a panel of 1 x 1 m that is turned.
    fn below_panel(height_m: f64, emits: [bool; 2], faces_down: bool) -> [usize; 3] {
        let mut b = SceneBuilder::new("panel");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let materials =
            emits.map(|emits| b.material("panel", [0.5; 3], [f64::from(u8::from(emits)); 3]));
        let square =
            |r: f64| [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(x, y)| DVec3::new(x, y, 0.0));
        let floor = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
        b.polygon(floor, "floor", grey, &square(2.0));
        let at = DVec3::Z * height_m;
        let node = b.node("panel", None, at, DQuat::from_rotation_z(0.3));
        let [up, mut down] = [square(0.5), square(0.5)];
        down.reverse();
        if faces_down {
            b.polygon(node, "lower side", materials[0], &down);
        }
        b.polygon(node, "upper side", materials[1], &up.map(|c| c + DVec3::Z * 0.001));
        let found = b.build().unwrap().discontinuities();
        let counts = |f: &super::Discontinuities| [f.met.len(), f.glows.len(), f.spots.len()];
        assert!(found[1..].iter().all(|f| counts(f) == [0; 3]));
        counts(&found[0])
    }

    #[test]
    fn a_panel_close_before_a_floor_ends_there() {
        let dark = [false; 2];
        assert_eq!(below_panel(0.01, dark, true), [4, 0, 0]);
        assert_eq!(below_panel(0.01, dark, false), [0; 3]);
        assert_eq!(below_panel(0.2, dark, true), [0; 3]);
    }

    #[test]
    fn a_lamp_that_shines_to_both_sides_throws_a_spot() {
        assert_eq!(below_panel(0.01, [true, true], true), [0, 0, 4]);
        assert_eq!(below_panel(0.01, [true, false], true), [0, 4, 0]);
        assert_eq!(below_panel(0.01, [false, true], true), [4, 0, 0]);
    }
}
