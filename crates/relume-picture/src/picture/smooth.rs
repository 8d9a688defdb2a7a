//! Light over curved bodies that are made of flat polygons: irradiance at the corners of small patches, W/m2, as the
//! neighbours have it that meet there at small angles (Gouraud 1971). For pictures only.
//!
//! Must not know the view, nor materials.

use std::collections::BTreeMap;

use super::tuning::{LARGE, SMOOTH};
use glam::{DVec2, DVec3};
use relume_core::scene::{BodyId, PatchId};
use relume_core::session::{Leaf, Snapshot};

/// Cosine above which neighbours lie in one plane: light on a plane is left as it is.
const FLAT: f64 = 0.999_99;

/// Corners are one if they are no further apart than this, in extents of the scene.
const SAME: f64 = 1e-6;

type Rgb = [f64; 3];

/// Irradiance at corners of the patches that stand for curved surfaces.
#[derive(Default)]
pub(super) struct Smooth {
    /// By patch as many as it has corners; none for those that are left as they are.
    corners: Vec<Vec<Rgb>>,
}

/// A patch where it meets others.
#[derive(Clone, Copy)]
struct Meeting {
    patch: PatchId,
    /// Number of the corner.
    corner: usize,
    normal: DVec3,
    area_m2: f64,
    irradiance: Rgb,
}

impl Smooth {
    /// Cost O(n log n) in the number of corners.
    pub(super) fn new(snapshot: &Snapshot) -> Smooth {
        let scene = &snapshot.scene;
        let mut smooth = Smooth { corners: vec![Vec::new(); scene.patches.len()] };
        let large_m2 = LARGE * scene.area_m2();
        let step = scene.bounds(snapshot.time_s).map_or(1.0, |bounds| bounds.diagonal());
        let step = (step * SAME).max(f64::MIN_POSITIVE);
        let near = |body: &BodyId| !scene.is_distant(*body);
        for body in (0..scene.bodies.len() as u32).map(BodyId).filter(near) {
            let mut places: BTreeMap<[i64; 3], Vec<Meeting>> = BTreeMap::new();
            for (id, patch) in scene.patches_of(body) {
                let leaves = snapshot.leaves_of(id);
                for (corner, (at, place)) in
                    patch.corners.iter().zip(patch.corners_in_body()).enumerate()
                {
                    let Some(leaf) = nearest(leaves, *at) else { continue };
                    let meeting = Meeting {
                        patch: id,
                        corner,
                        normal: patch.frame.normal,
                        area_m2: patch.area_m2(),
                        irradiance: leaf.irradiance.map(f64::from),
                    };
                    let place = (place / step).round().to_array().map(|x| x as i64);
                    places.entry(place).or_default().push(meeting);
                }
            }
            places.values().for_each(|meetings| smooth.add(meetings, large_m2, snapshot));
        }
        smooth
    }

    /// Irradiance at the corners of a patch, W/m2; `None` where it is to be left as it is.
    pub(super) fn of(&self, patch: PatchId) -> Option<&[Rgb]> {
        self.corners.get(patch.0 as usize).map(Vec::as_slice).filter(|c| !c.is_empty())
    }

    /// What meets at one corner: each small patch gets the mean over those that it goes over into.
    fn add(&mut self, meetings: &[Meeting], large_m2: f64, snapshot: &Snapshot) {
        for (k, own) in meetings.iter().enumerate() {
            let along = |other: &Meeting| own.normal.dot(other.normal);
            let bends = |m: &Meeting| (SMOOTH..FLAT).contains(&along(m));
            if own.area_m2 > large_m2 || !meetings.iter().any(bends) {
                continue;
            }
            let (mut sum, mut whole) = ([0.0; 3], 0.0);
            for other in connected(meetings, k) {
                let other = &meetings[other];
                (0..3).for_each(|c| sum[c] += other.area_m2 * other.irradiance[c]);
                whole += other.area_m2;
            }
            let of_patch = &mut self.corners[own.patch.0 as usize];
            if of_patch.is_empty() {
                // Corners at which nothing else meets stay as they are.
                let patch = &snapshot.scene.patches[own.patch.0 as usize];
                let leaves = snapshot.leaves_of(own.patch);
                let as_is = |&at: &DVec2| {
                    nearest(leaves, at).map_or([0.0; 3], |leaf| leaf.irradiance.map(f64::from))
                };
                *of_patch = patch.corners.iter().map(as_is).collect();
            }
            of_patch[own.corner] = sum.map(|s| s / whole);
        }
    }
}

/// The patches at a corner that one of them goes over into, from neighbour to neighbour at small angles; itself among them.
fn connected(meetings: &[Meeting], from: usize) -> Vec<usize> {
    let mut found = vec![from];
    let mut next = 0;
    while let Some(&at) = found.get(next) {
        next += 1;
        for (k, other) in meetings.iter().enumerate() {
            if !found.contains(&k) && meetings[at].normal.dot(other.normal) > SMOOTH {
                found.push(k);
            }
        }
    }
    found.sort_unstable();
    found
}

/// The leaf whose middle is nearest to a point of the patch's frame; of equals the first.
fn nearest(leaves: &[Leaf], at: DVec2) -> Option<&Leaf> {
    let off = |leaf: &&Leaf| {
        let [a, b, c, d] = leaf.corners;
        ((a + b + c + d) * 0.25).distance_squared(at)
    };
    leaves.iter().min_by(|one, other| off(one).total_cmp(&off(other)))
}
