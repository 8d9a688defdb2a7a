//! Where what emits light gets in the whole animation, and whether that is into a body or a gap. Pure geometry.

use glam::DVec3;

use crate::geometry::{Aabb, BoxTree, Pose};
use crate::scene::placed::Placed;
use crate::scene::{BodyId, Light, Patch, PatchId, Scene};

use super::hull::Hull;

/// Lamps further from the box of a body, in roundings, neither are in it nor touch it.
const REACH: f64 = 16.0;

/// Where what emits can get in the whole animation, in the world.
pub(super) struct Lamps {
    /// Ascending.
    pub(super) patches: Vec<(PatchId, Aabb)>,
    /// Over their boxes.
    pub(super) tree: BoxTree,
    pub(super) lights: Vec<Aabb>,
    /// By body.
    pub(super) ways: Vec<Way>,
}

impl Lamps {
    pub(super) fn of(scene: &Scene) -> Lamps {
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let ways: Vec<Way> = bodies.map(|body| Way::of(scene, body)).collect();
        let shining = (0..scene.patches.len() as u32).map(PatchId).zip(&scene.patches);
        let of_patch = |(id, patch): (PatchId, &Patch)| {
            let bounds = Aabb::of(patch.corners_in_body());
            (id, ways[patch.body.0 as usize].around(&bounds))
        };
        let patches: Vec<(PatchId, Aabb)> =
            shining.filter(|(_, patch)| scene.patch_emits(patch)).map(of_patch).collect();
        let [from, to] = scene.motion.span_s();
        let light = |l: &Light| {
            let at = scene.motion.place(l.node, from).translation;
            Aabb::of([at]).sum(&scene.motion.drift(l.node, 0.0, [from, to]).reach())
        };
        let tree = BoxTree::new(patches.iter().map(|p| p.1));
        Lamps { patches, tree, lights: scene.lights.iter().map(light).collect(), ways }
    }
}

/// Lamps as some bodies may hold them: those of the scene as it was made, and their own.
pub(super) struct OfBodies<'a> {
    pub(super) scene: &'a Scene,
    pub(super) all: &'a Lamps,
    pub(super) bodies: &'a [BodyId],
}

impl OfBodies<'_> {
    fn counts(&self, lamp: usize) -> bool {
        let body = self.scene.patches[self.all.patches[lamp].0.0 as usize].body;
        !self.scene.is_inserted(body) || self.bodies.contains(&body)
    }

    /// Whether a lamp is or may get into a box.
    pub(super) fn may_be_at(&self, bounds: &Aabb) -> bool {
        self.all.lights.iter().any(|light| light.meets(bounds))
            || self.all.tree.any(bounds, |lamp| self.counts(lamp))
    }

    /// Whether a lamp is or may get among the polygons of a body. An inner side that emits counts; touching is enough where they are
    /// two-sided and it may look in: a lamp that lies flush in a ceiling.
    pub(super) fn may_be_in(&self, (placed, hull): (&[Placed], &Hull), slack_m: f64) -> bool {
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
pub(super) struct Way(Option<(Pose, Aabb)>);

impl Way {
    /// Cost: proportional to the patches of the body.
    fn of(scene: &Scene, body: BodyId) -> Way {
        let [from, to] = scene.motion.span_s();
        let node = scene.bodies[body.0 as usize].node;
        let way = || (scene.motion.place(node, from), scene.drift(body, [from, to]).reach());
        Way(scene.moves(body).then(way))
    }

    /// A box around something of the body on all of its way, in the world.
    pub(super) fn around(&self, bounds: &Aabb) -> Aabb {
        let Some((pose, reach)) = &self.0 else { return *bounds };
        let corner = |k: u32| {
            let pick = |axis: u32, lo: f64, hi: f64| if k >> axis & 1 == 0 { lo } else { hi };
            let (lo, hi) = (bounds.lo, bounds.hi);
            pose.point(DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z)))
        };
        Aabb::of((0..8).map(corner)).sum(reach)
    }
}
