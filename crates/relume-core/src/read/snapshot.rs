//! An immutable picture of the solution at one instant: what pictures and exports read.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::element::{ElementId, Kind};
use crate::scene::{PatchId, Scene, World};

use crate::solver::{Links, Radiosity, Surfaces};
use crate::space::{LitForest, Solved, SpaceState};

use super::bends::Bends;
use super::tuning::VISIBLE;
use crate::read::tuning::FACES_ALONG;

/// The solution at one instant.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The scene that was solved.
    pub scene: Arc<Scene>,
    /// Time in the animation, seconds.
    pub time_s: f64,
    /// Error of radiosities where little light arrives, W/m2, roughly: a share of the tolerance times the mean irradiance.
    /// Pictures show nothing darker than this.
    pub error_w_m2: f64,
    /// Poses, materials and lights as they were.
    pub world: World,
    /// Leaf elements of all patches, grouped by patch; none of those that are distant.
    pub leaves: Vec<Leaf>,
    /// For each patch the range of its leaves; indexed by `PatchId`, one entry more than patches.
    pub leaf_offsets: Vec<u32>,
    /// What each leaf receives beside the light of lamps that were named; empty unless asked for
    /// ([`super::Frame::solution_beside`]).
    pub indirect: Vec<Gathered>,
    /// These lamps, in the order of their patches.
    pub lamps: Vec<LampLight>,
}

/// A patch whose emission is told apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampLight {
    /// The patch.
    pub patch: PatchId,
    /// What it emits, W/m2, linear RGB.
    pub exitance: [f32; 3],
}

/// Irradiance of a leaf, or a part of it: a line over the leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gathered {
    /// Mean, W/m2, linear RGB.
    pub irradiance: [f32; 3],
    /// Gradient in the patch's frame, W/m3, linear RGB: along u, then along v.
    pub gradient: [[f32; 3]; 2],
}

/// A leaf of the element forest: a convex piece of a patch, over which irradiance is linear.
#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Index of its facet in its patch, from 0: triangles and quadrilaterals are one.
    pub facet: u32,
    /// Place in its facet: a one bit, then two bits for each quartering. The same in every solution.
    pub path: u32,
    /// Corners in the patch's frame, counter-clockwise, metres; a triangle repeats its last corner.
    pub corners: [DVec2; 4],
    /// Irradiance H, W/m2, linear RGB.
    pub irradiance: [f32; 3],
    /// Gradient of the irradiance in the patch's frame, W/m3, linear RGB: along u, then along v.
    pub irradiance_gradient: [[f32; 3]; 2],
    /// Radiosity B = M + rho H, W/m2, linear RGB.
    pub radiosity: [f32; 3],
}

impl Leaf {
    /// Number of quarterings from its facet down to it.
    pub fn level(&self) -> u32 {
        self.path.max(1).ilog2() / 2
    }

    /// Centroid in the patch's frame, metres.
    pub fn centroid(&self) -> DVec2 {
        crate::element::Shape { corners: self.corners, len: 4 }.centroid()
    }

    /// Irradiance at a point of the patch's frame: linear over the leaf, never negative; W/m2.
    pub fn irradiance_at(&self, p: DVec2) -> [f32; 3] {
        let d = p - self.centroid();
        let [x, y] = [d.x as f32, d.y as f32];
        let [gu, gv] = self.irradiance_gradient;
        std::array::from_fn(|c| (self.irradiance[c] + gu[c] * x + gv[c] * y).max(0.0))
    }

    /// Whether a point of the patch's frame is in the leaf, or no further than `slack_m` beside it.
    fn holds(&self, p: DVec2, slack_m: f64) -> bool {
        (0..4).all(|k| {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % 4]);
            (to - from).perp_dot(p - from) >= -slack_m * (to - from).length()
        })
    }
}

impl Snapshot {
    /// The same, knowing what of its light is direct: the lines of its leaves without and with the rest.
    ///
    /// Lines lead below 0 past the edges of shadows, each part for itself: only their difference is clamped.
    pub(super) fn beside(
        mut self,
        (all, direct): (&[Gathered], &[Gathered]),
        lamps: Vec<LampLight>,
    ) -> Snapshot {
        self.lamps = lamps;
        let rest = |(all, direct): (&Gathered, &Gathered)| Gathered {
            irradiance: [0, 1, 2].map(|c| (all.irradiance[c] - direct.irradiance[c]).max(0.0)),
            gradient: [0, 1]
                .map(|axis| [0, 1, 2].map(|c| all.gradient[axis][c] - direct.gradient[axis][c])),
        };
        self.indirect = all.iter().zip(direct).map(rest).collect();
        self
    }

    /// Irradiance of the mesh at a point of a surface, W/m2, linear RGB: on the nearest patch that faces along `normal` (to
    /// within 25 degrees, of any length but 0) and has the point on it, no further than a 1/1000 of the scene's diagonal away; `None` where there is
    /// none.
    ///
    /// Linear over a leaf, with jumps between leaves: across the edge of a shadow it is right in the
    /// mean and wrong on either side. [`Frame::irradiance_at`](super::Frame::irradiance_at) has no such limit.
    pub fn irradiance_at(&self, point: DVec3, normal: DVec3) -> Option<[f64; 3]> {
        let near_m = 1e-3 * self.scene.bounds_in(&self.world)?.diagonal();
        let normal = normal.normalize_or_zero();
        let mut found: Vec<(f64, PatchId, DVec2)> = Vec::new();
        for (k, patch) in self.scene.patches.iter().enumerate() {
            let Some(pose) = self.world.pose(patch.body) else { continue };
            let d = pose.inverse_point(point) - patch.frame.origin;
            let off_m = d.dot(patch.frame.normal).abs();
            let along = pose.direction(patch.frame.normal).dot(normal);
            if along > FACES_ALONG && off_m <= near_m {
                let p = DVec2::new(d.dot(patch.frame.u), d.dot(patch.frame.v));
                found.push((off_m, PatchId(k as u32), p));
            }
        }
        // Stable: of patches alike the first.
        found.sort_by(|one, other| one.0.total_cmp(&other.0));
        found.iter().find_map(|&(_, patch, p)| {
            let under = |leaf: &&Leaf| leaf.holds(p, 1e-3 * near_m);
            let leaf = self.leaves_of(patch).iter().find(under)?;
            Some(leaf.irradiance_at(p).map(f64::from))
        })
    }

    /// The leaves of one patch; empty if its body is absent.
    pub fn leaves_of(&self, patch: PatchId) -> &[Leaf] {
        let i = patch.0 as usize;
        &self.leaves[self.leaf_offsets[i] as usize..self.leaf_offsets[i + 1] as usize]
    }
}

/// The leaves of a solved forest with a solution over it.
pub(super) fn take(solved: &Solved, links: &Links, radiosity: &Radiosity) -> Snapshot {
    take_with_lines(solved, links, radiosity).0
}

/// The same, with the line of each leaf as it is: it may lead below 0.
pub(super) fn take_with_lines(
    solved: &Solved,
    links: &Links,
    radiosity: &Radiosity,
) -> (Snapshot, Vec<Gathered>) {
    let scene = &solved.space.scene;
    let reader = Reader::new(solved, links, radiosity);
    let of_patch = |patch| {
        let (mut leaves, mut lines) = (Vec::new(), Vec::new());
        reader.of_patch(patch, &mut |leaf, line| {
            leaves.push(leaf);
            lines.push(line);
        });
        (leaves, lines)
    };
    let patches = (0..scene.patches.len() as u32).into_par_iter().map(PatchId);
    let (by_patch, lines): (Vec<Vec<Leaf>>, Vec<Vec<Gathered>>) = patches.map(of_patch).unzip();
    let mut leaf_offsets = vec![0];
    let mut end = 0;
    leaf_offsets.extend(by_patch.iter().map(|leaves| {
        end += leaves.len() as u32;
        end
    }));
    let leaves = by_patch.concat();
    let error = solved.space.tuning.tolerance * VISIBLE;
    let snapshot = Snapshot {
        scene: Arc::clone(scene),
        time_s: solved.time_s,
        error_w_m2: error * mean_irradiance_w_m2(&leaves),
        world: solved.space.world.clone(),
        leaves,
        leaf_offsets,
        indirect: Vec::new(),
        lamps: Vec::new(),
    };
    (snapshot, lines.concat())
}

/// The lines of the leaves of a solved forest with a solution over it: they may lead below 0.
pub(super) fn lines(solved: &Solved, links: &Links, radiosity: &Radiosity) -> Vec<Gathered> {
    let reader = Reader::new(solved, links, radiosity);
    let of_patch = |patch| {
        let mut lines = Vec::new();
        reader.of_patch(patch, &mut |_, line| lines.push(line));
        lines
    };
    let patches = (0..solved.space.scene.patches.len() as u32).into_par_iter().map(PatchId);
    patches.map(of_patch).collect::<Vec<_>>().concat()
}

/// Reads leaves of a solved forest.
struct Reader<'a> {
    solved: &'a Solved,
    surfaces: LitForest<'a>,
    radiosity: &'a Radiosity,
    bends: Bends<'a>,
}

impl<'a> Reader<'a> {
    fn new(solved: &'a Solved, links: &'a Links, radiosity: &'a Radiosity) -> Reader<'a> {
        let bends = Bends { solved, links, radiosity };
        Reader { solved, surfaces: solved.space.surfaces(), radiosity, bends }
    }

    /// Hands over the leaves of all facets of a patch with their lines; none where it is absent or distant.
    fn of_patch(&self, patch: PatchId, add: &mut dyn FnMut(Leaf, Gathered)) {
        let SpaceState { scene, forest, view, .. } = &self.solved.space;
        let body = scene.patches[patch.0 as usize].body;
        if !view.is_present(body) || scene.is_distant(body) {
            return;
        }
        let mut stack = vec![forest.patch_root(patch)];
        let mut facets = 0;
        while let Some(id) = stack.pop() {
            match forest.kind(id) {
                Kind::Polygon => stack.extend(forest.children(id).rev().map(ElementId)),
                _ => {
                    self.of_facet(facets, id, add);
                    facets += 1;
                }
            }
        }
    }

    /// Hands over the leaves of a facet; `number` counts those of its patch.
    fn of_facet(&self, number: u32, facet: ElementId, add: &mut dyn FnMut(Leaf, Gathered)) {
        let forest = &self.solved.space.forest;
        let material = self.surfaces.material(facet.0);
        let mut bent = self.bends.of_leaves(facet.0).into_iter();
        self.radiosity.irradiances(&self.surfaces, facet.0, &mut |id, h| {
            // Of what is exposed; a leaf is read about its own centroid.
            let extent = forest.extent(ElementId(id));
            let h = h.moved(&self.surfaces.place(id), [extent.centroid.x, extent.centroid.y]);
            let h = h.plus(&bent.next().expect("the same leaves"));
            let irradiance = h.mean.map(|x| x.max(0.0));
            let leaf = Leaf {
                facet: number,
                path: forest.key(ElementId(id)).path,
                corners: forest.shape(ElementId(id)).corners,
                irradiance,
                irradiance_gradient: h.gradient,
                radiosity: std::array::from_fn(|c| {
                    material.exitance[c] + material.reflectance[c] * irradiance[c]
                }),
            };
            add(leaf, Gathered { irradiance: h.mean, gradient: h.gradient });
        });
    }
}

/// Mean over the area and the channels.
fn mean_irradiance_w_m2(leaves: &[Leaf]) -> f64 {
    let area_m2 = |leaf: &Leaf| {
        let [a, b, c, d] = leaf.corners;
        (c - a).perp_dot(d - b) / 2.0
    };
    let arriving = |leaf: &Leaf| {
        area_m2(leaf) * leaf.irradiance.iter().map(|&h| f64::from(h)).sum::<f64>() / 3.0
    };
    let whole_m2: f64 = leaves.iter().map(area_m2).sum();
    if whole_m2 > 0.0 { leaves.iter().map(arriving).sum::<f64>() / whole_m2 } else { 0.0 }
}
