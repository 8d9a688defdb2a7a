//! Light over all surfaces at several instants, on one triangulation for all of them: what files that play are made of.
//!
//! Must not know the view, nor files. The triangulation is that of pictures (`gouraud`, `smooth`), of the smallest leaves that a place
//! has at any of the instants; so irradiance is continuous over each patch and over curved bodies, and a vertex is one
//! thing from the first instant to the last. Where patches adjoin, each has the points of both.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use relume_core::scene::{Patch, PatchId, Scene, World};
use relume_core::session::{Leaf, Snapshot};

use super::gouraud::{Net, net};
use super::smooth::Smooth;
use super::stitch::{Between, Piece, stitch};

/// Snapshots of a clip, one after the other, kept as far as [`Recorder::finish`] needs them.
///
/// Memory: 120 bytes for each leaf of a patch whose light differs from that of the instant before.
#[derive(Debug, Default)]
pub struct Recorder {
    instants: Vec<Instant>,
}

/// What is kept of a snapshot.
#[derive(Debug)]
struct Instant {
    scene: Arc<Scene>,
    time_s: f64,
    world: World,
    error_w_m2: f64,
    /// By patch, in the order of `order`; empty where the body is absent.
    leaves: Vec<Arc<[Leaf]>>,
}

/// Irradiance over the patches of a scene at several instants.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The instants, seconds.
    pub times_s: Vec<f64>,
    /// Poses, materials and lights at the instants.
    pub worlds: Vec<World>,
    /// Patches that are there at some instant, by [`PatchId`].
    pub patches: Vec<PatchLight>,
}

/// Irradiance over one patch.
#[derive(Clone, Debug)]
pub struct PatchLight {
    /// The patch.
    pub patch: PatchId,
    /// Points in the frame of the patch's body, metres.
    pub points: Vec<DVec3>,
    /// Numbers of points, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Irradiance at the points, W/m2, linear RGB, by instant; that of another instant where the body is absent.
    pub irradiance: Vec<Arc<[[f32; 3]]>>,
}

/// Place of a leaf in its patch: an ancestor comes right before what is in it.
fn order(leaf: &Leaf) -> (u32, u32, u32) {
    let path = leaf.path.max(1);
    (leaf.facet, path << path.leading_zeros() << 1, leaf.level())
}

/// Whether a leaf is `within` or has it in itself.
fn holds(leaf: &Leaf, within: &Leaf) -> bool {
    leaf.facet == within.facet
        && leaf.level() <= within.level()
        && within.path >> (2 * (within.level() - leaf.level())) == leaf.path
}

impl Recorder {
    /// Keeps a snapshot; instants come in ascending order.
    ///
    /// # Panics
    /// If it is of a scene with other patches than the one before.
    pub fn add(&mut self, snapshot: &Snapshot) {
        let last = self.instants.last();
        let count = snapshot.scene.patches.len();
        assert!(last.is_none_or(|last| last.leaves.len() == count), "one scene");
        let leaves = (0..count).map(|k| {
            let mut leaves = snapshot.leaves_of(PatchId(k as u32)).to_vec();
            leaves.sort_by_key(order);
            match last.map(|last| &last.leaves[k]) {
                Some(before) if is_same(before, &leaves) => Arc::clone(before),
                _ => leaves.into(),
            }
        });
        let instant = Instant {
            leaves: leaves.collect(),
            scene: Arc::clone(&snapshot.scene),
            time_s: snapshot.time_s,
            world: snapshot.world.clone(),
            error_w_m2: snapshot.error_w_m2,
        };
        self.instants.push(instant);
    }

    /// The recording; `None` where nothing was added. Cost: that of triangulating every instant once.
    pub fn finish(self) -> Option<Recording> {
        let first = self.instants.first()?;
        let scene = Arc::clone(&first.scene);
        let count = scene.patches.len();
        let finest: Vec<Vec<Leaf>> =
            (0..count).into_par_iter().map(|k| self.finest_of(k)).collect();
        let mut patches: Vec<PatchLight> = Vec::new();
        let mut between: Vec<Vec<Between>> = Vec::new();
        for (number, instant) in self.instants.iter().enumerate() {
            let snapshot = self.on(&finest, number);
            let smooth = Smooth::new(&snapshot);
            let of = |k: usize| {
                let patch = PatchId(k as u32);
                net_of(&scene.patches[k], snapshot.leaves_of(patch), smooth.of(patch))
            };
            let present: Vec<usize> = (0..count).filter(|&k| !finest[k].is_empty()).collect();
            let nets: Vec<Net> = present.par_iter().map(|&k| of(k)).collect();
            if number == 0 {
                (patches, between) = begin(&scene, instant.time_s, &present, &nets);
            }
            for ((patch, net), between) in patches.iter_mut().zip(nets).zip(&between) {
                let points = net.points.len() + between.len();
                debug_assert_eq!(patch.points.len(), points, "at {}", instant.time_s);
                let mut irradiance: Vec<[f32; 3]> =
                    net.values.iter().map(|h| h.map(|h| h.max(0.0) as f32)).collect();
                for &Between { ends: [a, b], share } in between {
                    let [a, b] = [a, b].map(|k| irradiance[k as usize]);
                    irradiance.push([0, 1, 2].map(|c| a[c] + share as f32 * (b[c] - a[c])));
                }
                let kept = match patch.irradiance.last() {
                    Some(before) if **before == *irradiance => Arc::clone(before),
                    _ => irradiance.into(),
                };
                patch.irradiance.push(kept);
            }
        }
        let times_s = self.instants.iter().map(|instant| instant.time_s).collect();
        let worlds = self.instants.into_iter().map(|instant| instant.world).collect();
        Some(Recording { scene, times_s, worlds, patches })
    }

    /// The smallest leaves that a patch has at any instant.
    fn finest_of(&self, patch: usize) -> Vec<Leaf> {
        let mut all: Vec<Leaf> = Vec::new();
        let mut before: Option<&Arc<[Leaf]>> = None;
        for Instant { leaves, .. } in &self.instants {
            let of_patch = &leaves[patch];
            if !before.is_some_and(|before| Arc::ptr_eq(before, of_patch)) {
                all.extend_from_slice(of_patch);
                all.sort_by_key(order);
                all.dedup_by_key(|leaf| (leaf.facet, leaf.path));
            }
            before = Some(of_patch);
        }
        let is_split = |k: usize| all.get(k + 1).is_some_and(|next| holds(&all[k], next));
        (0..all.len()).filter(|&k| !is_split(k)).map(|k| all[k]).collect()
    }

    /// The solution of an instant on the smallest leaves of all; time is the first one's, so that what depends on it is the same
    /// for all.
    fn on(&self, finest: &[Vec<Leaf>], number: usize) -> Snapshot {
        let Instant { scene, world, error_w_m2, .. } = &self.instants[number];
        let mut leaf_offsets = vec![0];
        let mut leaves = Vec::new();
        for (k, finest) in finest.iter().enumerate() {
            if let Some(from) = self.present(k, number) {
                let (exitance, reflectance) = (
                    world.exitance(scene, &scene.patches[k]),
                    world.reflectance(scene, &scene.patches[k]),
                );
                leaves.extend(finest.iter().map(|leaf| {
                    let irradiance = read(from, leaf);
                    let radiosity = [0, 1, 2]
                        .map(|c| (exitance[c] + reflectance[c] * f64::from(irradiance[c])) as f32);
                    Leaf { irradiance, radiosity, irradiance_gradient: [[0.0; 3]; 2], ..*leaf }
                }));
            }
            leaf_offsets.push(leaves.len() as u32);
        }
        let (scene, world) = (Arc::clone(scene), world.clone());
        let time_s = self.instants[0].time_s;
        Snapshot {
            scene,
            time_s,
            error_w_m2: *error_w_m2,
            world,
            leaves,
            leaf_offsets,
            indirect: Vec::new(),
            lamps: Vec::new(),
        }
    }

    /// The leaves of a patch at an instant; where it is absent those of the last instant before at which it is there, or of the
    /// first after.
    fn present(&self, patch: usize, number: usize) -> Option<&[Leaf]> {
        let (until, after) = self.instants.split_at(number + 1);
        let there = |instant: &&Instant| !instant.leaves[patch].is_empty();
        let found = until.iter().rev().find(there).or_else(|| after.iter().find(there))?;
        Some(&found.leaves[patch])
    }
}

impl Recording {
    /// Radiosity at the points of one of the patches, W/m2, linear RGB: B = M + rho H.
    pub fn radiosity(&self, of: &PatchLight, instant: usize) -> Vec<[f32; 3]> {
        let patch = &self.scene.patches[of.patch.0 as usize];
        let world = &self.worlds[instant];
        let exitance = world.exitance(&self.scene, patch);
        let reflectance = world.reflectance(&self.scene, patch);
        let b = |h: &[f32; 3]| {
            [0, 1, 2].map(|c| (exitance[c] + reflectance[c] * f64::from(h[c])) as f32)
        };
        of.irradiance[instant].iter().map(b).collect()
    }
}

/// Irradiance of a leaf as sorted leaves that have it in themselves say.
fn read(sorted: &[Leaf], leaf: &Leaf) -> [f32; 3] {
    let after = sorted.partition_point(|other| order(other) <= order(leaf));
    let Some(found) = after.checked_sub(1).map(|at| &sorted[at]) else { return leaf.irradiance };
    debug_assert!(holds(found, leaf), "every leaf is in one of each instant");
    if found.path == leaf.path {
        return found.irradiance;
    }
    found.irradiance_at(leaf.centroid())
}

/// Whether leaves have the same light, bit for bit.
fn is_same(one: &[Leaf], other: &[Leaf]) -> bool {
    let of = |leaf: &Leaf| {
        let gradient = leaf.irradiance_gradient.map(|g| g.map(f32::to_bits));
        (leaf.facet, leaf.path, leaf.irradiance.map(f32::to_bits), gradient)
    };
    one.len() == other.len() && one.iter().zip(other).all(|(one, other)| of(one) == of(other))
}

/// Irradiance over a patch; one value all over where pictures draw it flat.
fn net_of(patch: &Patch, leaves: &[Leaf], at_corners: Option<&[[f64; 3]]>) -> Net {
    let values: Vec<[f64; 3]> = leaves.iter().map(|leaf| leaf.irradiance.map(f64::from)).collect();
    let found = net(&patch.corners, leaves, &values, at_corners);
    if !found.triangles.is_empty() {
        return found;
    }
    let n = patch.corners.len() as u32;
    let flat = values.first().copied().unwrap_or_default();
    Net {
        points: patch.corners.clone(),
        values: vec![flat; patch.corners.len()],
        triangles: (1..n - 1).map(|k| [0, k, k + 1]).collect(),
    }
}

/// Patches without any light yet, with points between the others that neighbours have.
fn begin(
    scene: &Scene,
    time_s: f64,
    present: &[usize],
    nets: &[Net],
) -> (Vec<PatchLight>, Vec<Vec<Between>>) {
    let piece = |(&k, net): (&usize, &Net)| {
        let Patch { body, frame, .. } = &scene.patches[k];
        let points = net.points.iter().map(|&p| frame.point(p)).collect();
        Piece { body: *body, points, triangles: net.triangles.clone() }
    };
    let mut pieces: Vec<Piece> = present.iter().zip(nets).map(piece).collect();
    let between = stitch(scene, time_s, &mut pieces);
    let patches = present.iter().zip(pieces).map(|(&k, Piece { points, triangles, .. })| {
        PatchLight { patch: PatchId(k as u32), points, triangles, irradiance: Vec::new() }
    });
    (patches.collect(), between)
}
