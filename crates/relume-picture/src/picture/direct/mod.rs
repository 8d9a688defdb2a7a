//! Light straight from lamps, the sun, bright parts of the sky and punctual lights, found exactly at points of leaves.
//!
//! | file | one sentence |
//! |---|---|
//! | `lamps` | which patches count as lamps here |
//! | `tree` | what may stand between two boxes |
//! | `cut` | what a point sees of a polygon past others |
//! | `sight` | what a leaf sees of the lamps |
//!
//! A function of the scene, of its world, of the leaves' shapes and of what lamps emit. Must not know the view.

mod cut;
mod lamps;
mod sight;
mod tree;

use std::cell::RefCell;
use std::sync::OnceLock;

use glam::{DMat3, DVec2, DVec3};
use relume_core::element::WorldView;
use relume_core::geometry::{Aabb, Plane};
use relume_core::scene::{Frame, LightId, Patch, PatchId, World};
use relume_core::session::{LampLight, Snapshot};

use cut::{Blocker, Cutter};
pub use lamps::direct_lamps;
use sight::{Known, Lamp, Punctual, Receiver, Sight, Surroundings};
use tree::Tree;

/// What is no further above a surface hides nothing, in diagonals of the scene: what files with six digits hold.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

thread_local! {
    /// Buffers, empty between uses.
    static CUTTER: RefCell<Cutter> = RefCell::default();
}

/// Light straight from lamps over the leaves of a snapshot.
pub(super) struct Direct {
    around: Surroundings,
    /// Planes of the patches in the world; `None` for those of absent bodies.
    frames: Vec<Option<Frame>>,
    /// By leaf.
    sights: Vec<OnceLock<Sight>>,
}

/// The plane of a patch in the world; `None` where its body is absent.
fn frame_of(patch: &Patch, world: &World) -> Option<Frame> {
    let pose = world.pose(patch.body)?;
    let Frame { origin, u, v, normal } = patch.frame;
    let turn = |d| pose.direction(d);
    Some(Frame { origin: pose.point(origin), u: turn(u), v: turn(v), normal: turn(normal) })
}

impl Direct {
    /// Cost: proportional to the patches; leaves are looked at when they are asked about.
    pub(super) fn new(snapshot: &Snapshot) -> Direct {
        let (scene, world) = (&snapshot.scene, &snapshot.world);
        let frames: Vec<Option<Frame>> =
            scene.patches.iter().map(|patch| frame_of(patch, world)).collect();
        let corners = |k: usize, frame: &Frame| -> Vec<DVec3> {
            scene.patches[k].corners.iter().map(|&c| frame.point(c)).collect()
        };
        let diagonal_m = scene.bounds_in(world).map_or(1.0, |bounds| bounds.diagonal());
        let (mut blockers, mut known, mut boxes) = (Vec::new(), Vec::new(), Vec::new());
        for (k, patch) in scene.patches.iter().enumerate() {
            let Some(frame) = &frames[k] else { continue };
            // Of two sides of one polygon the first stands for both.
            let is_second = patch.twin.is_some_and(|twin| (twin.0 as usize) < k);
            if scene.is_distant(patch.body) || is_second {
                continue;
            }
            let own = PatchId(k as u32);
            for corners in Blocker::parts(&corners(k, frame)) {
                let (twin, lying_m2) = (patch.twin, scene.lying_m2(patch));
                known.push(Known { patch: own, twin, lying_m2 });
                boxes.push(Aabb::of(corners.iter().copied()));
                let plane = Plane::through(frame.origin, frame.normal);
                blockers.push(Blocker { plane, corners });
            }
        }
        let lamp = |lamp: &LampLight| {
            let k = lamp.patch.0 as usize;
            let frame = frames[k].as_ref()?;
            let corners = corners(k, frame);
            let turn = DMat3::from_cols(frame.u, frame.v, frame.normal).transpose();
            Some(Lamp {
                patch: lamp.patch,
                bounds: Aabb::of(corners.iter().copied()),
                turned: corners.iter().map(|&c| turn * c).collect(),
                turn,
                corners,
                plane: Plane::through(frame.origin, frame.normal),
                lying_m2: scene.lying_m2(&scene.patches[k]),
                exitance: lamp.exitance.map(f64::from),
            })
        };
        let light = |k: usize| {
            let id = LightId(k as u32);
            let light = WorldView::light_in(scene, world, id)?;
            Some(Punctual { light, intensity: world.intensity(id) })
        };
        Direct {
            around: Surroundings {
                lamps: snapshot.lamps.iter().filter_map(lamp).collect(),
                lights: (0..scene.lights.len()).filter_map(light).collect(),
                blockers,
                known,
                tree: Tree::new(boxes),
                slack_m: ROUNDING * diagonal_m,
                far_m: 2.0 * diagonal_m,
            },
            frames,
            sights: snapshot.leaves.iter().map(|_| OnceLock::new()).collect(),
        }
    }

    /// What arrives straight from lamps at a point of a patch's frame, in or right beside one of its leaves, W/m2.
    pub(super) fn at(
        &self,
        snapshot: &Snapshot,
        patch: PatchId,
        leaf: usize,
        p: DVec2,
    ) -> [f64; 3] {
        let Some(frame) = &self.frames[patch.0 as usize] else { return [0.0; 3] };
        let sight = self.sights[leaf].get_or_init(|| {
            let flat = snapshot.leaves[leaf].corners;
            let len = if flat[2] == flat[3] { 3 } else { 4 };
            let corners = flat.map(|c| frame.point(c));
            let receiver = Receiver {
                corners: &corners[..len],
                plane: Plane::through(frame.origin, frame.normal),
                patch,
                low: flat.into_iter().fold(flat[0], DVec2::min),
                high: flat.into_iter().fold(flat[0], DVec2::max),
                place: &|p| frame.point(p),
            };
            Sight::new(&self.around, &receiver)
        });
        let at = (frame.point(p), frame.normal);
        CUTTER.with_borrow_mut(|cutter| sight.at(&self.around, at, p, cutter))
    }

    /// Whether anything stands between a lamp and a leaf that was asked about.
    pub(super) fn is_shaded(&self, leaf: usize) -> bool {
        self.sights[leaf].get().is_some_and(Sight::is_shaded)
    }
}
