//! What of each patch is covered by what rests on it: no light reaches it, and nobody sees it. Pure geometry.
//!
//! A crate on a floor hides the floor under it. What a part of the floor that is larger than the crate sends comes from the
//! rest alone; if the covered part counted in its mean, it would count twice, as dark and as hidden.

use glam::{DVec2, DVec3};

use super::gap::{Gap, between, gap_reach, open_sides};
use super::placed::{IN_PLANE, Placed};
use super::topology::{Polygon, components, matched, sides_of};
use super::weld::Weld;
use super::{BodyId, InPlane, Lying, PatchId, Scene, Sheet, Solids};
use crate::geometry::{
    Aabb, BoxTree, Interval, Moments, Plane, Pose, Segment, common, difference, within_outlines,
};
use crate::scene::tuning::{
    COVERED_CUTS_MAX, COVERED_PARTS_MAX, COVERED_WHOLLY, COVERING_POLYGONS_MAX,
};

/// Bodies are cut this far above a patch to see what they cover, in roundings.
const ABOVE: f64 = 4.0;

/// Lamps further from the box of a body, in roundings, neither are in it nor touch it.
const REACH: f64 = 16.0;

/// Holes narrower than this, in roundings, let nothing through.
const SLIT: f64 = 8.0;

/// Parts of less than this share of a patch are rounding.
const SLIVER: f64 = 1e-9;

/// Part of a patch that lies within a body, or in a narrow gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Inside {
    /// The body, and a number of what of it hangs together; of a gap numbers that no body has.
    pub of: (BodyId, u32),
    /// Whether the patch is one of the same body's, which moves; then places are in that body's frame, else in the world.
    pub is_own: bool,
    /// Convex polygon in the patch's frame, counter-clockwise, metres.
    pub outline: Vec<DVec2>,
    /// Lowest and highest coordinates of the outline.
    pub bounds: [DVec2; 2],
    /// Origin of the patch's frame, and its axes.
    pub plane: [DVec3; 3],
}

/// What of a patch is covered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Covered {
    /// Disjoint convex polygons in the patch's frame, counter-clockwise, with boxes around them (low, high); metres.
    pub parts: Vec<(Vec<DVec2>, [DVec2; 2])>,
    /// What of it lies within bodies or narrow gaps: what that exchanges with what lies within the same one, no light does. Of one disjoint.
    pub inside: Vec<Inside>,
    /// Whether one thing covers it but for a thousandth, or all of it: then nothing is said of parts.
    pub is_wholly: bool,
    /// Patches that touch it, and inner sides of what stands on it: what they exchange leaves neither. Ascending.
    pub contacts: Vec<PatchId>,
}

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

/// Where what emits can get in the whole animation, in the world.
struct Lamps {
    /// Ascending.
    patches: Vec<(PatchId, Aabb)>,
    /// Over their boxes.
    tree: BoxTree,
    lights: Vec<Aabb>,
    /// By body.
    ways: Vec<Way>,
}

impl Lamps {
    fn of(scene: &Scene) -> Lamps {
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let ways: Vec<Way> = bodies.map(|body| Way::of(scene, body)).collect();
        let shining = (0..scene.patches.len() as u32).map(PatchId).zip(&scene.patches);
        let of_patch = |(id, patch): (PatchId, &super::Patch)| {
            let bounds = Aabb::of(patch.corners_in_body());
            (id, ways[patch.body.0 as usize].around(&bounds))
        };
        let patches: Vec<(PatchId, Aabb)> =
            shining.filter(|(_, patch)| scene.patch_emits(patch)).map(of_patch).collect();
        let [from, to] = scene.motion.span_s();
        let light = |l: &super::Light| {
            let at = scene.motion.place(l.node, from).translation;
            Aabb::of([at]).sum(&scene.motion.drift(l.node, 0.0, [from, to]).reach())
        };
        let tree = BoxTree::new(patches.iter().map(|p| p.1));
        Lamps { patches, tree, lights: scene.lights.iter().map(light).collect(), ways }
    }
}

/// Lamps as some bodies may hold them: those of the scene as it was made, and their own.
struct OfBodies<'a> {
    scene: &'a Scene,
    all: &'a Lamps,
    bodies: &'a [BodyId],
}

impl OfBodies<'_> {
    fn counts(&self, lamp: usize) -> bool {
        let body = self.scene.patches[self.all.patches[lamp].0.0 as usize].body;
        !self.scene.is_inserted(body) || self.bodies.contains(&body)
    }

    /// Whether a lamp is or may get into a box.
    fn may_be_at(&self, bounds: &Aabb) -> bool {
        self.all.lights.iter().any(|light| light.meets(bounds))
            || self.all.tree.any(bounds, |lamp| self.counts(lamp))
    }

    /// Whether a lamp is or may get among the polygons of a body. An inner side that emits counts; touching is enough where they are
    /// two-sided and it may look in: a lamp that lies flush in a ceiling.
    fn may_be_in(&self, (placed, hull): (&[Placed], &Hull), slack_m: f64) -> bool {
        let scene = self.scene;
        let is_two_sided = !hull.twins.is_empty();
        let body = scene.patches[placed[hull.polygons[0]].id.0 as usize].body;
        let bounds = self.all.ways[body.0 as usize].around(&hull.bounds);
        let within = |lamp: &Aabb, touching: bool| {
            let [by, before] = if touching { [4.0, 2.0] } else { [2.0, 4.0] };
            let lamp = lamp.grown(by * slack_m);
            let least = bounds.lo.max(lamp.lo).cmplt(bounds.hi.min(lamp.hi) - 3.0 * slack_m);
            least.all() && (scene.moves(body) || !hull.is_before(placed, &lamp, before * slack_m))
        };
        // Of those in the same frame it is known how they lie.
        let may_be_in =
            |&(id, ref lamp): &(PatchId, Aabb)| match placed.binary_search_by_key(&id, |p| p.id) {
                Ok(k) if hull.polygons.binary_search(&k).is_ok() => is_two_sided,
                Ok(k) => within(lamp, false) || hull.is_lit_by(placed, &placed[k], slack_m),
                Err(_) => within(lamp, is_two_sided),
            };
        let patches = &self.all.patches;
        self.all.lights.iter().any(|light| within(light, is_two_sided))
            || self.all.tree.any(&bounds.grown(REACH * slack_m), |lamp| {
                self.counts(lamp) && may_be_in(&patches[lamp])
            })
    }
}

/// Where a body can get in the whole animation: its pose at the start, and how far its points get from there; `None` if it rests.
struct Way(Option<(Pose, Aabb)>);

impl Way {
    /// Cost: proportional to the patches of the body.
    fn of(scene: &Scene, body: BodyId) -> Way {
        let [from, to] = scene.motion.span_s();
        let node = scene.bodies[body.0 as usize].node;
        let way = || (scene.motion.place(node, from), scene.drift(body, [from, to]).reach());
        Way(scene.moves(body).then(way))
    }

    /// A box around something of the body on all of its way, in the world.
    fn around(&self, bounds: &Aabb) -> Aabb {
        let Some((pose, reach)) = &self.0 else { return *bounds };
        let corner = |k: u32| {
            let pick = |axis: u32, lo: f64, hi: f64| if k >> axis & 1 == 0 { lo } else { hi };
            let (lo, hi) = (bounds.lo, bounds.hi);
            pose.point(DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z)))
        };
        Aabb::of((0..8).map(corner)).sum(reach)
    }
}

/// Polygons of a body that hang together along sides.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    /// Numbers of its patches in the group; of two sides the first.
    pub(super) polygons: Vec<usize>,
    /// The other sides.
    pub(super) twins: Vec<usize>,
    /// Ends of sides that no other polygon has.
    pub(super) border: Vec<DVec3>,
    pub(super) bounds: Aabb,
    /// Whether it lies behind the planes of all its polygons.
    pub(super) is_convex: bool,
    /// The body that it is of, and its number there.
    pub(super) of: (BodyId, u32),
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
            if found && lies == InPlane::Touches && opposed {
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

/// A body that stands on patches or sticks in them.
pub(super) struct Stands<'a> {
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
    pub(super) fn new(
        scene: &'a Scene,
        (placed, hull): (&'a [Placed], &'a Hull),
        near: &'a [&'a Placed],
        slack_m: f64,
    ) -> Stands<'a> {
        Stands { scene, placed, hull, near, slack_m, closed: Vec::new() }
    }

    /// Adds what it covers of a patch. `is_own` if the patch is of that body, which moves, and places are in its frame. A two-sided body
    /// with a border covers nothing in a plane whose patches leave a part of its opening free: light gets in there.
    pub(super) fn on(
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

/// Part of a patch that lies in a narrow gap.
pub(super) struct InGap {
    pub(super) patch: PatchId,
    part: Inside,
}

impl InGap {
    /// Adds it to what is covered of its patch.
    pub(super) fn add_to(self, scene: &Scene, covered: &mut Covered, left: &mut usize) {
        *left = left.saturating_sub(1);
        let outline = self.part.outline.clone();
        covered.inside.push(self.part);
        add(scene, self.patch, vec![outline], (covered, left));
    }
}

/// A face, and which of its sides are open, from the lowest bit up.
#[derive(Clone, Copy)]
pub(super) struct Face<'a> {
    pub(super) placed: &'a Placed,
    pub(super) open: u64,
}

/// Parts of a face and of others that lie in narrow gaps between it and them; none of gaps that may hold a lamp.
pub(super) fn dark_in_gaps<'a>(
    face: Face<'a>,
    others: impl Iterator<Item = Face<'a>>,
    slack_m: f64,
    is_own: bool,
    mut may_hold_lamp: impl FnMut(&Aabb) -> bool,
) -> Vec<InGap> {
    let reach = gap_reach(&face.placed.bounds);
    let mut found = Vec::new();
    for other in others.filter(|other| reach.meets(&other.placed.bounds)) {
        let faces = [face.placed, other.placed];
        let Some(gap) = between(faces, [face.open, other.open], slack_m) else { continue };
        if !may_hold_lamp(&gap.bounds.grown(2.0 * slack_m)) {
            found.extend(hide_gap(faces, gap, is_own));
        }
    }
    found
}

/// What a gap hides of the two faces that it is between.
fn hide_gap(faces: [&Placed; 2], gap: Gap, is_own: bool) -> [InGap; 2] {
    // No body has such a number.
    let of = (BodyId(faces[0].id.0 | 1 << 31), faces[1].id.0);
    let [p, q] = gap.outlines;
    [(faces[0], p), (faces[1], q)].map(|(face, outline)| {
        let (bounds, [u, v]) = (around(&outline), face.axes);
        let plane = [face.origin, u, v];
        InGap { patch: face.id, part: Inside { of, is_own, outline, bounds, plane } }
    })
}

/// Largest coordinate of a box, metres.
pub(super) fn reach_m(bounds: &Aabb) -> f64 {
    bounds.lo.abs().max(bounds.hi.abs()).max_element()
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
    pub(super) fn is_before(&self, placed: &[Placed], bounds: &Aabb, slack_m: f64) -> bool {
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
    pub(super) fn is_lit_by(&self, placed: &[Placed], lamp: &Placed, slack_m: f64) -> bool {
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
    pub(super) fn holds(&self, k: usize) -> bool {
        self.polygons.binary_search(&k).is_ok() || self.twins.binary_search(&k).is_ok()
    }
}

/// Adds to what is covered of a patch what other polygons in its frame cover; whether they cover any of it.
fn add(
    scene: &Scene,
    patch: PatchId,
    by: Vec<Vec<DVec2>>,
    (covered, left): (&mut Covered, &mut usize),
) -> bool {
    let whole = &scene.patches[patch.0 as usize].corners;
    let whole_m2 = Moments::of(whole).area;
    let wide = |p: &[DVec2]| p.len() > 2 && Moments::of(p).area > SLIVER * whole_m2;
    let mut fresh: Vec<Vec<DVec2>> = by.iter().map(|p| common(p, whole)).collect();
    fresh.retain(|p| wide(p));
    let fresh_m2: f64 = fresh.iter().map(|p| Moments::of(p).area).sum();
    if fresh.is_empty() || fresh_m2 > COVERED_WHOLLY * whole_m2 {
        covered.is_wholly |= !fresh.is_empty();
        return !fresh.is_empty();
    }
    for (part, bounds) in &covered.parts {
        let mut rest = Vec::with_capacity(fresh.len());
        for piece in fresh {
            if *left > 0 && meet(&around(&piece), bounds) {
                *left -= 1;
                difference(&piece, part, &mut rest);
            } else {
                rest.push(piece);
            }
        }
        fresh = rest;
    }
    fresh.retain(|p| wide(p));
    if *left == 0 || covered.parts.len() + fresh.len() > COVERED_PARTS_MAX {
        // Without the cuts parts would count twice.
        covered.parts.clear();
    } else {
        covered.parts.extend(fresh.into_iter().map(|p| {
            let bounds = around(&p);
            (p, bounds)
        }));
    }
    true
}

/// Lowest and highest coordinates.
fn around(polygon: &[DVec2]) -> [DVec2; 2] {
    polygon
        .iter()
        .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[lo, hi], &p| [lo.min(p), hi.max(p)])
}

fn meet(a: &[DVec2; 2], b: &[DVec2; 2]) -> bool {
    a[0].cmplt(b[1]).all() && b[0].cmplt(a[1]).all()
}

/// Adds the groups of polygons of a body, from the number `first` on, that hang together along sides, each of which
/// is run as often one way as the other, or is on the border.
pub(super) fn hulls_of(scene: &Scene, (placed, first): (&[Placed], usize), out: &mut Vec<Hull>) {
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

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
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
