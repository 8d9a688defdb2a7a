//! Walls that face out of the room that they are of, where sides do not tell: rooms that are open, walls with gaps between
//! them, walls among double-sided ones.
//!
//! A wall is a flat single-sided object. It faces outwards if what it joins on three sides or more lies behind it and shows its
//! fronts to it, if rays from its back meet fronts and rays from its front next to nothing, and if light is behind it. A panel
//! that stands free joins a floor alone; outsides of houses and of furniture join others that turn their backs to them. Walls that
//! join each other and face outwards together are tried with the others of them turned round, as long as they are the smaller part of
//! what they join: the larger part says where inside is. Must not know light transport.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::world::{Face, World, spread, within};
use super::{listed, note};
use crate::geometry::Aabb;
use crate::scene::{LightKind, Note, Patch, Scene, Severity};

/// Smallest wall, as a share of the scene's diagonal.
const SMALLEST: f64 = 0.02;
/// What is nearer than this share of a wall's size (the root of its area) joins it.
const JOINS: f64 = 0.02;
/// What lies on both sides of a wall by more than this share of the longer part lies on neither.
const ON_BOTH_SIDES: f64 = 0.2;
/// Walls that are turned round at once.
const TURNED_MAX: usize = 12;
/// What a half may be more than one, by rounding.
const ROUNDING: f64 = 1e-6;
/// Points of each side of a wall.
const POINTS: u32 = 8;
/// Share of a side that has to join something.
const JOINED: f64 = 0.6;
/// Share of a wall's sides along which neighbours may look the same way round as the wall: furniture that stands there.
const SAME_WAY_MAX: f64 = 0.1;
/// Cosine of the angle within which sides of a wall are one, and widest angle without a side that is joined, degrees: an open
/// top.
const ONE_SIDE: f64 = 0.96;
const OPEN_MAX_DEG: f64 = 200.0;
/// Rays from each side of a wall.
const RAYS: u32 = 192;
/// Share of the rays from the back that meet fronts at least; backs met, and what the front's rays meet, beside these at most.
const SEEN_MIN: f64 = 0.08;
const BACKS_MAX: f64 = 0.6;
const BEFORE_MAX: f64 = 0.25;
/// Polygons that rays and sides are tried against in all.
const TRIALS: usize = 100_000_000;

/// Adds walls that face outwards, but for objects of which that is said.
pub(super) fn outward(scene: &Scene, notes: &mut Vec<Note>) {
    let said: BTreeSet<String> =
        notes.iter().filter(|n| n.code == "flipped-normals").map(|n| n.subject.clone()).collect();
    let world = World::of(scene, 0.0);
    let boxes: Vec<Aabb> = world.faces.iter().map(|face| Aabb::of(corners(&world, face))).collect();
    let flat = flat(&world);
    let walls = walls(&world);
    let meetings = Meetings::of(&walls, &world, &boxes);
    let mut left = TRIALS;
    for (k, wall) in walls.iter().enumerate().filter(|(_, wall)| !said.contains(wall.name)) {
        let alone = wall.faces_outwards(&world, (&boxes, &flat), &mut left);
        let together = || meetings.face_outwards(k, (&walls, &world), (&boxes, &flat), &mut left);
        let Some(neighbours) = alone.or_else(together) else { continue };
        let message = format!(
            "it faces away from where what joins it faces ({}), so it is black on their side; flip its normals (in Blender: \
             Mesh > Normals > Flip) or make the material double-sided",
            listed(&neighbours)
        );
        let count = wall.faces.len();
        notes.push(note(Severity::Warning, "flipped-normals", wall.name, count, message));
    }
}

/// A flat object that is seen from one side.
struct Wall<'a> {
    name: &'a str,
    faces: Vec<&'a Face>,
    normal: DVec3,
    /// What is as near as this joins it, metres.
    reach_m: f64,
    area_m2: f64,
}

/// Which walls join each other, by their numbers.
struct Meetings {
    /// All that join one.
    all: Vec<BTreeSet<usize>>,
    /// Those that look away from each other: the outsides of one corner.
    away: Vec<BTreeSet<usize>>,
}

impl Meetings {
    fn of(walls: &[Wall], world: &World, boxes: &[Aabb]) -> Meetings {
        let number: BTreeMap<&str, usize> =
            walls.iter().enumerate().map(|(k, wall)| (wall.name, k)).collect();
        let mut out = Meetings {
            all: vec![BTreeSet::new(); walls.len()],
            away: vec![BTreeSet::new(); walls.len()],
        };
        for (k, wall) in walls.iter().enumerate() {
            for (name, joint) in wall.joints(world, boxes) {
                let Some(&other) = number.get(name) else { continue };
                let join = |sets: &mut [BTreeSet<usize>]| {
                    sets[k].insert(other);
                    sets[other].insert(k);
                };
                match joint {
                    Joint::OnBothSides | Joint::Double => {}
                    Joint::Away => {
                        join(&mut out.all);
                        join(&mut out.away);
                    }
                    Joint::SameWay | Joint::Against => join(&mut out.all),
                }
            }
        }
        out
    }

    /// The walls that face outwards if one does, by number, if they are several and at most half of all that hangs together.
    fn turned(&self, one: usize, walls: &[Wall]) -> Option<BTreeSet<usize>> {
        let area_m2 = |of: &BTreeSet<usize>| of.iter().map(|&k| walls[k].area_m2).sum::<f64>();
        let away = hanging_together(one, &self.away);
        let all = hanging_together(one, &self.all);
        let is_smaller = area_m2(&away) <= (0.5 + ROUNDING) * area_m2(&all);
        ((2..=TURNED_MAX).contains(&away.len()) && is_smaller).then_some(away)
    }

    /// What a wall faces away from, if it and those that look away beside it all face outwards, each with the others turned round.
    fn face_outwards<'a>(
        &self,
        one: usize,
        (walls, world): (&[Wall<'a>], &World<'a>),
        around: (&[Aabb], &BTreeSet<&str>),
        left: &mut usize,
    ) -> Option<BTreeSet<&'a str>> {
        let turned = self.turned(one, walls)?;
        let names: BTreeSet<&str> = turned.iter().map(|&k| walls[k].name).collect();
        let mut out = BTreeSet::new();
        for &k in &turned {
            let others = names.iter().copied().filter(|&name| name != walls[k].name).collect();
            let found = walls[k].faces_outwards(&world.with_turned(&others), around, left)?;
            if k == one {
                out = found.into_iter().filter(|name| !names.contains(name)).collect();
            }
        }
        (!out.is_empty()).then_some(out)
    }
}

/// All that can be reached from one.
fn hanging_together(one: usize, beside: &[BTreeSet<usize>]) -> BTreeSet<usize> {
    let (mut found, mut waiting) = (BTreeSet::from([one]), vec![one]);
    while let Some(k) = waiting.pop() {
        waiting.extend(beside[k].iter().filter(|&&other| found.insert(other)));
    }
    found
}

/// A part of a wall's outline: from, to, and out of it in its plane.
struct Side {
    ends: [DVec3; 2],
    out: DVec3,
}

/// How a wall and what joins it at some point look at each other, the most telling last.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Joint {
    /// It goes on in front of the wall and behind it.
    OnBothSides,
    /// Its front and the wall's are the fronts of one corner, seen from within.
    SameWay,
    /// The same, seen from outside: it is behind the wall, and shows its back there.
    Away,
    /// It is behind the wall, and double-sided.
    Double,
    /// It is behind the wall, and shows its front there.
    Against,
}

/// Flat single-sided objects, the largest first.
fn walls<'a>(world: &'a World<'a>) -> Vec<Wall<'a>> {
    let mut objects: BTreeMap<&str, Vec<&Face>> = BTreeMap::new();
    for face in &world.faces {
        objects.entry(object(world, face)).or_default().push(face);
    }
    let smallest = SMALLEST * world.bounds.diagonal();
    let wall = |(name, faces): (&'a str, Vec<&'a Face>)| {
        let (first, corner) = (faces[0], corners(world, faces[0])[0]);
        let area_m2: f64 = faces.iter().map(|f| patch(world, f).area_m2()).sum();
        let reach_m = JOINS * area_m2.sqrt();
        let is_flat = |face: &&Face| {
            !face.two_sided
                && face.normal.dot(first.normal) > 0.9999
                && corners(world, face)
                    .iter()
                    .all(|c| (*c - corner).dot(first.normal).abs() < 0.5 * reach_m)
        };
        let is_wall = world.objects[name].diagonal() >= smallest && faces.iter().all(is_flat);
        is_wall.then_some(Wall { name, normal: first.normal, faces, reach_m, area_m2 })
    };
    let mut walls: Vec<Wall> = objects.into_iter().filter_map(wall).collect();
    walls.sort_by(|a, b| b.reach_m.total_cmp(&a.reach_m));
    walls
}

/// Objects of which all polygons are parallel.
fn flat<'a>(world: &'a World<'a>) -> BTreeSet<&'a str> {
    let mut normals: BTreeMap<&str, (DVec3, bool)> = BTreeMap::new();
    for face in &world.faces {
        let entry = normals.entry(object(world, face)).or_insert((face.normal, true));
        entry.1 &= face.normal.dot(entry.0).abs() > 0.99;
    }
    normals.into_iter().filter(|(_, (_, is_flat))| *is_flat).map(|(name, _)| name).collect()
}

impl<'a> Wall<'a> {
    /// What it faces away from, if it faces out of what is behind it.
    fn faces_outwards(
        &self,
        world: &World<'a>,
        (boxes, flat): (&[Aabb], &BTreeSet<&str>),
        left: &mut usize,
    ) -> Option<BTreeSet<&'a str>> {
        *left = left.checked_sub(world.faces.len())?;
        let joined = self.joined(world, boxes)?;
        *left = left.checked_sub(2 * RAYS as usize * world.faces.len())?;
        let lit = self.lit(world);
        let is_lit_behind = match joined.single_sided {
            // Where nothing shines there is a sky.
            true => lit.behind || (!lit.before && self.normal.y <= 0.5),
            // Boxes and tables of boards look the same: but for where the light is.
            false => lit.behind && !lit.before,
        };
        (is_lit_behind && self.looks_out(world, flat, &joined)).then_some(joined.names)
    }

    fn is_of(&self, face: &Face) -> bool {
        self.faces.iter().any(|own| own.patch == face.patch)
    }

    /// Outermost parts of its outline.
    fn sides(&self, world: &World) -> Vec<Side> {
        let all: Vec<DVec3> = self.faces.iter().flat_map(|face| corners(world, face)).collect();
        let mut sides = Vec::new();
        for face in &self.faces {
            let own = corners(world, face);
            for (k, &from) in own.iter().enumerate() {
                let to = own[(k + 1) % own.len()];
                let out = (to - from).cross(self.normal).normalize_or_zero();
                if all.iter().all(|p| (*p - from).dot(out) < self.reach_m) {
                    sides.push(Side { ends: [from, to], out });
                }
            }
        }
        sides
    }

    /// Polygons of others that may join it, with their corners.
    fn near<'w>(&self, world: &'w World<'a>, boxes: &[Aabb]) -> Vec<(&'w Face, Vec<DVec3>)> {
        let own = self.faces.iter().flat_map(|face| corners(world, face));
        let around = Aabb::of(own).grown(self.reach_m);
        let beside = world.faces.iter().zip(boxes);
        let beside = beside.filter(|(face, b)| b.meets(&around) && !self.is_of(face));
        beside.map(|(face, _)| (face, corners(world, face))).collect()
    }

    /// The objects that join it somewhere, and how.
    fn joints(&self, world: &World<'a>, boxes: &[Aabb]) -> BTreeSet<(&'a str, Joint)> {
        let near = self.near(world, boxes);
        let mut found = BTreeSet::new();
        for Side { ends: [from, to], out } in self.sides(world) {
            for k in 0..POINTS {
                let at = from.lerp(to, (f64::from(k) + 0.5) / f64::from(POINTS));
                let here = near.iter().filter(|(f, c)| distance(world, f, c, at) <= self.reach_m);
                let joints = here.filter_map(|(face, c)| {
                    Some((object(world, face), self.joint(face, c, at, out)?))
                });
                found.extend(joints);
            }
        }
        found
    }

    /// What joins it, if that lies behind it on three sides or more and nothing of it turns its back there.
    fn joined(&self, world: &World<'a>, boxes: &[Aabb]) -> Option<Joined<'a>> {
        let near = self.near(world, boxes);
        let mut found = Joined::default();
        // Lengths of each side: all, joined, and joined by what lies behind.
        let mut lengths: Vec<(DVec3, [f64; 3])> = Vec::new();
        let (mut single_m, mut double_m, mut same_m, mut all_m) = (0.0, 0.0, 0.0, 0.0);
        for side in self.sides(world) {
            let along = side.ends[1] - side.ends[0];
            let place = lengths.iter().position(|(out, _)| out.dot(side.out) > ONE_SIDE);
            let place = place.unwrap_or_else(|| {
                lengths.push((side.out, [0.0; 3]));
                lengths.len() - 1
            });
            let length_m = along.length() / f64::from(POINTS);
            for k in 0..POINTS {
                let at = side.ends[0] + along * ((f64::from(k) + 0.5) / f64::from(POINTS));
                let joints = near
                    .iter()
                    .filter(|(face, c)| distance(world, face, c, at) <= self.reach_m)
                    .filter_map(|(face, c)| Some((self.joint(face, c, at, side.out)?, *face)));
                let strongest = joints.max_by_key(|(joint, _)| *joint);
                let of_side = &mut lengths[place].1;
                of_side[0] += length_m;
                all_m += length_m;
                let Some((joint, face)) = strongest else { continue };
                let reaches = |c: &DVec3| (*c - at).dot(self.normal) > self.reach_m;
                if corners(world, face).iter().any(reaches) {
                    found.goes_on.insert(object(world, face));
                }
                match joint {
                    Joint::OnBothSides => {
                        found.on_both_sides.insert(object(world, face));
                    }
                    Joint::SameWay | Joint::Away => {
                        same_m += length_m;
                        continue;
                    }
                    Joint::Double => double_m += length_m,
                    Joint::Against => single_m += length_m,
                }
                of_side[1] += length_m;
                if joint != Joint::OnBothSides {
                    of_side[2] += length_m;
                    found.names.insert(object(world, face));
                }
            }
        }
        let is_mostly = |of: &[f64; 3], k: usize| of[k] >= JOINED * of[0];
        let joined: Vec<DVec3> =
            lengths.iter().filter(|(_, of)| is_mostly(of, 1)).map(|(out, _)| *out).collect();
        let behind = lengths.iter().filter(|(_, of)| is_mostly(of, 2)).count();
        found.single_sided = single_m > double_m;
        let is_room = joined.len() >= 3
            && behind >= 2
            && same_m <= SAME_WAY_MAX * all_m
            && self.widest_gap_deg(&joined) <= OPEN_MAX_DEG;
        is_room.then_some(found)
    }

    /// Widest angle between neighbours of some directions in its plane, degrees.
    fn widest_gap_deg(&self, directions: &[DVec3]) -> f64 {
        let u = self.normal.any_orthonormal_vector();
        let v = self.normal.cross(u);
        let mut angles: Vec<f64> =
            directions.iter().map(|d| libm::atan2(d.dot(v), d.dot(u)).to_degrees()).collect();
        angles.sort_by(f64::total_cmp);
        let next = |k: usize| angles.get(k + 1).copied().unwrap_or(angles[0] + 360.0);
        (0..angles.len()).map(|k| next(k) - angles[k]).fold(0.0, f64::max)
    }

    /// How a polygon that is near a point of a side looks at the wall there; `None` where that says nothing.
    fn joint(&self, face: &Face, corners: &[DVec3], at: DVec3, out: DVec3) -> Option<Joint> {
        let heights = || corners.iter().map(|c| (*c - at).dot(self.normal));
        let before = heights().fold(0.0, f64::max);
        let behind = heights().fold(0.0, |most: f64, h| most.max(-h));
        let longer = before.max(behind);
        // In the wall's own plane.
        if longer <= self.reach_m {
            return None;
        }
        if before.min(behind) > ON_BOTH_SIDES * longer {
            return Some(Joint::OnBothSides);
        }
        // Whether its front looks at the wall's middle.
        let looks = face.normal.dot(-out);
        match (behind > before, face.two_sided) {
            (true, true) => Some(Joint::Double),
            (true, false) if looks > 0.3 => Some(Joint::Against),
            (true, false) => (looks < -0.3).then_some(Joint::Away),
            (false, two_sided) => (two_sided || looks > 0.3).then_some(Joint::SameWay),
        }
    }

    /// On which of its sides there is light.
    fn lit(&self, world: &World) -> Lit {
        let middle = world.objects[self.name].centre();
        let mut lit = Lit::default();
        let mut add = |height: f64, least: f64| {
            lit.before |= height > least;
            lit.behind |= height < -least;
        };
        let scene = world.scene;
        let lamps =
            world.faces.iter().filter(|f| scene.patch_emits(patch(world, f)) && !self.is_of(f));
        for lamp in lamps {
            let c = corners(world, lamp);
            let centre = c.iter().sum::<DVec3>() / c.len() as f64;
            add((centre - middle).dot(self.normal), self.reach_m);
        }
        for light in &scene.lights {
            if !light.most_intensity().iter().any(|&i| i > 0.0) {
                continue;
            }
            let Some(pose) = scene.motion.pose(light.node, world.time_s) else { continue };
            match light.kind {
                LightKind::Directional => add(pose.direction(DVec3::Z).dot(self.normal), 0.05),
                _ => add((pose.translation - middle).dot(self.normal), self.reach_m),
            }
        }
        lit
    }

    /// Whether rays from its back meet fronts rather than backs of flat objects (of bodies those are met from within), and rays from
    /// its front next to nothing: what goes on on both sides aside, where single-sided neighbours tell which of them is inside.
    fn looks_out(&self, world: &World, flat: &BTreeSet<&str>, joined: &Joined) -> bool {
        let [mut fronts, mut backs, mut before] = [0_u32; 3];
        for k in 0..RAYS {
            let face = self.faces[k as usize % self.faces.len()];
            let own = [Some(face.patch), None];
            let (from, up) = self.ray(world, face, k);
            let met = |direction: DVec3| {
                let hit = world.first(from, direction, own)?;
                let name = object(world, hit.face);
                (name != self.name).then_some((name, hit.front))
            };
            match met(up - self.normal * (2.0 * up.dot(self.normal))) {
                Some((name, _)) if joined.on_both_sides.contains(name) => {}
                Some((_, true)) => fronts += 1,
                Some((name, false)) => backs += u32::from(flat.contains(name)),
                None => {}
            }
            let counts = |name: &str| !joined.single_sided || !joined.goes_on.contains(name);
            before += u32::from(met(up).is_some_and(|(name, _)| counts(name)));
        }
        let [fronts, backs, before] = [fronts, backs, before].map(f64::from);
        fronts >= SEEN_MIN * f64::from(RAYS)
            && backs <= BACKS_MAX * fronts
            && before <= BEFORE_MAX * fronts
    }

    /// Where the k-th ray starts on a face, and its way out of the front, by Lambert's law.
    fn ray(&self, world: &World, face: &Face, k: u32) -> (DVec3, DVec3) {
        let outline = &patch(world, face).corners;
        let middle = outline.iter().sum::<DVec2>() / outline.len() as f64;
        let corner = outline[(k / 7) as usize % outline.len()];
        let point = middle + (corner - middle) * (0.9 * f64::from(k % 7) / 6.0);
        let from = face.origin + face.axes[0] * point.x + face.axes[1] * point.y;
        let [share, turn] = spread(k);
        let (s, c) = libm::sincos(turn);
        let flat = face.axes[0] * (c * share.sqrt()) + face.axes[1] * (s * share.sqrt());
        (from, flat + self.normal * (1.0 - share).max(0.0).sqrt())
    }
}

/// What joins a wall.
#[derive(Default)]
struct Joined<'a> {
    /// Objects behind it.
    names: BTreeSet<&'a str>,
    /// Objects that go on before it and behind it.
    on_both_sides: BTreeSet<&'a str>,
    /// Objects that go on before it, be it by little.
    goes_on: BTreeSet<&'a str>,
    /// Whether more of what is behind it is single-sided than not.
    single_sided: bool,
}

#[derive(Default)]
struct Lit {
    before: bool,
    behind: bool,
}

fn patch<'a>(world: &World<'a>, face: &Face) -> &'a Patch {
    &world.scene.patches[face.patch.0 as usize]
}

fn object<'a>(world: &World<'a>, face: &Face) -> &'a str {
    &world.scene.surfaces[face.surface.0 as usize].object
}

fn corners(world: &World, face: &Face) -> Vec<DVec3> {
    let at = |c: &DVec2| face.origin + face.axes[0] * c.x + face.axes[1] * c.y;
    patch(world, face).corners.iter().map(at).collect()
}

/// Distance of a point from a convex polygon, metres.
fn distance(world: &World, face: &Face, corners: &[DVec3], at: DVec3) -> f64 {
    let from = at - face.origin;
    let height = from.dot(face.normal);
    let flat = DVec2::new(from.dot(face.axes[0]), from.dot(face.axes[1]));
    if within(&patch(world, face).corners, flat) {
        return height.abs();
    }
    let to_side = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
        let along = (at - a).dot(b - a) / a.distance_squared(b).max(f64::MIN_POSITIVE);
        at.distance(a.lerp(b, along.clamp(0.0, 1.0)))
    };
    (0..corners.len()).map(to_side).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests;
