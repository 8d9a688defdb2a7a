//! Light over curved bodies that are made of flat polygons: irradiance at the corners of small patches, W/m2, as the
//! neighbours have it that meet there at small angles (Gouraud 1971). For pictures only.
//!
//! Must not know the view, nor materials.

use std::collections::BTreeMap;

use super::tuning::{LARGE, SMOOTH};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use relume_core::scene::{BodyId, PatchId, Scene};
use relume_core::session::{Leaf, Snapshot};

/// Cosine above which neighbours lie in one plane but for rounding.
const FLAT: f64 = 0.999_99;

/// Corners are one if they are no further apart than this, in extents of the scene.
const SAME: f64 = 1e-6;

type Rgb = [f64; 3];

/// A number at the corners of the patches that stand for curved surfaces.
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
}

/// What a corner has by itself and with its neighbours.
struct Shared {
    meeting: Meeting,
    own: Rgb,
    mean: Rgb,
}

/// Irradiance of a patch at its corner, W/m2: by the patch, by the leaf that is nearest (its index in the snapshot) and by the
/// place of the corner in the patch's frame.
type OfCorner<'a> = &'a (dyn Fn(PatchId, usize, DVec2) -> Rgb + Sync);

/// Whether the light of two patches is one function already.
type IsOne<'a> = &'a (dyn Fn(PatchId, PatchId) -> bool + Sync);

impl Smooth {
    /// Irradiance at corners, by the nearest leaves. Cost O(n log n) in the number of corners.
    pub(super) fn new(snapshot: &Snapshot) -> Smooth {
        let of_leaf = |_, leaf: usize, _| snapshot.leaves[leaf].irradiance.map(f64::from);
        let normal = |patch: PatchId| snapshot.scene.patches[patch.0 as usize].frame.normal;
        let is_one = |patch, other| normal(patch).dot(normal(other)) >= FLAT;
        Smooth::of_all(snapshot, &of_leaf, &is_one, false)
    }

    /// What corners lack of the irradiance that they have with their neighbours, where that is not one already.
    pub(super) fn lacking(
        snapshot: &Snapshot,
        of_corner: OfCorner<'_>,
        is_one: IsOne<'_>,
    ) -> Smooth {
        Smooth::of_all(snapshot, of_corner, is_one, true)
    }

    fn of_all(
        snapshot: &Snapshot,
        of_corner: OfCorner<'_>,
        is_one: IsOne<'_>,
        lacks: bool,
    ) -> Smooth {
        let scene = &snapshot.scene;
        let mut smooth = Smooth { corners: vec![Vec::new(); scene.patches.len()] };
        let large_m2 = LARGE * scene.area_m2();
        let step = scene.bounds(snapshot.time_s).map_or(1.0, |bounds| bounds.diagonal());
        let step = (step * SAME).max(f64::MIN_POSITIVE);
        let near = |body: &BodyId| !scene.is_distant(*body);
        let own = |patch: PatchId, at: DVec2| {
            nearest(snapshot, patch, at).map_or([0.0; 3], |leaf| of_corner(patch, leaf, at))
        };
        for body in (0..scene.bodies.len() as u32).map(BodyId).filter(near) {
            let mut places: BTreeMap<[i64; 3], Vec<Meeting>> = BTreeMap::new();
            for (id, patch) in scene.patches_of(body) {
                if snapshot.leaves_of(id).is_empty() {
                    continue;
                }
                for (corner, place) in patch.corners_in_body().enumerate() {
                    let normal = patch.frame.normal;
                    let meeting = Meeting { patch: id, corner, normal, area_m2: patch.area_m2() };
                    let place = (place / step).round().to_array().map(|x| x as i64);
                    places.entry(place).or_default().push(meeting);
                }
            }
            let groups: Vec<Vec<Meeting>> = places.into_values().collect();
            let bends = Bends { large_m2, is_one };
            let shared = |meetings: &Vec<Meeting>| shared(meetings, &bends, scene, &own);
            let found: Vec<Vec<Shared>> = groups.par_iter().map(shared).collect();
            for Shared { meeting, own: had, mean } in found.into_iter().flatten() {
                let of_patch = &mut smooth.corners[meeting.patch.0 as usize];
                if of_patch.is_empty() {
                    // Corners at which nothing else meets stay as they are.
                    let corners = &scene.patches[meeting.patch.0 as usize].corners;
                    *of_patch = match lacks {
                        true => vec![[0.0; 3]; corners.len()],
                        false => corners.iter().map(|&at| own(meeting.patch, at)).collect(),
                    };
                }
                of_patch[meeting.corner] = match lacks {
                    true => [0, 1, 2].map(|c| mean[c] - had[c]),
                    false => mean,
                };
            }
        }
        smooth
    }

    /// Irradiance at the corners of a patch, W/m2; `None` where it is to be left as it is.
    pub(super) fn of(&self, patch: PatchId) -> Option<&[Rgb]> {
        self.corners.get(patch.0 as usize).map(Vec::as_slice).filter(|c| !c.is_empty())
    }
}

/// Which patches go over into their neighbours.
struct Bends<'a> {
    /// Area above which patches are walls.
    large_m2: f64,
    is_one: IsOne<'a>,
}

impl Bends<'_> {
    fn between(&self, own: &Meeting, other: &Meeting) -> bool {
        let along = own.normal.dot(other.normal);
        // What is flat but for rounding is so whatever its size.
        let may = along > SMOOTH && (along >= FLAT || own.area_m2 <= self.large_m2);
        may && !(self.is_one)(own.patch, other.patch)
    }
}

/// What meets at one corner: each small patch gets the mean over those that it goes over into.
fn shared(
    meetings: &[Meeting],
    bends: &Bends<'_>,
    scene: &Scene,
    own: &impl Fn(PatchId, DVec2) -> Rgb,
) -> Vec<Shared> {
    let is_bent = |&k: &usize| meetings.iter().any(|other| bends.between(&meetings[k], other));
    let bent: Vec<usize> = (0..meetings.len()).filter(is_bent).collect();
    if bent.is_empty() {
        return Vec::new();
    }
    let at_corner = |m: &Meeting| {
        let corners = &scene.patches[m.patch.0 as usize].corners;
        own(m.patch, corners[m.corner])
    };
    let values: Vec<Rgb> = meetings.iter().map(at_corner).collect();
    let of = |k: usize| {
        let (mut sum, mut whole) = ([0.0; 3], 0.0);
        for other in connected(meetings, k) {
            let area_m2 = meetings[other].area_m2;
            (0..3).for_each(|c| sum[c] += area_m2 * values[other][c]);
            whole += area_m2;
        }
        Shared { meeting: meetings[k], own: values[k], mean: sum.map(|s| s / whole) }
    };
    bent.into_iter().map(of).collect()
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

/// The leaf of a patch whose middle is nearest to a point of its frame; of equals the first.
fn nearest(snapshot: &Snapshot, patch: PatchId, at: DVec2) -> Option<usize> {
    let off = |(_, leaf): &(usize, &Leaf)| {
        let [a, b, c, d] = leaf.corners;
        ((a + b + c + d) * 0.25).distance_squared(at)
    };
    let first = snapshot.leaf_offsets[patch.0 as usize] as usize;
    let leaves = (first..).zip(snapshot.leaves_of(patch));
    leaves.min_by(|one, other| off(one).total_cmp(&off(other))).map(|(index, _)| index)
}
