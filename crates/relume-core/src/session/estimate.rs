//! Estimate of pairs, memory and time of a frame before it is solved.
//!
//! The estimate follows from the number of pairs of patches that face each other and are in no group: all of them are judged, at any
//! tolerance, and most of them become links. Half of these patches, or of their groups, have a pair with each distant polygon.
//! Refinement adds few pairs to many patches, and many to few. Each patch of a group costs a number of pairs. The numbers were
//! fitted to measured scenes (docs/performance.md). No solution depends on an estimate.

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::{BodyId, Scene};

use crate::element::{distant_parts, grouped_patches};

use super::tuning::{
    BYTES, FITTED_AT, GROUPED_AT, GROUPS, PAIRS_OF_FACING, PAIRS_OF_GROUPED, PAIRS_OF_PATCHES,
    REFINED, REFINED_MOST, SECONDS, TRIED,
};
use super::{Options, Oracle};

/// Estimated work of one frame from scratch: rough ranges from low to high, which do not bound every scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Patches that are present.
    pub patches: u64,
    /// Pairs of them that face each other.
    pub facing: u64,
    /// Pairs that are looked at and kept, links among them.
    pub pairs: [u64; 2],
    /// Memory of the engine, bytes.
    pub bytes: [u64; 2],
    /// Seconds of one core.
    pub core_seconds: [f64; 2],
    /// Whether refinement makes most of it, at worst: then a coarser tolerance helps.
    pub by_refinement: bool,
}

/// What there is but for what is distant: patches, how many of them groups are made of, and pairs that face each other.
struct Near {
    patches: u64,
    grouped: u64,
    facing: u64,
}

/// A patch in the world: its plane and its corners.
struct Placed {
    normal: DVec3,
    offset_m: f64,
    corners: Vec<DVec3>,
}

impl Placed {
    /// Whether any part of another patch is in front of this one; touching is not.
    fn faces(&self, other: &Placed, slack_m: f64) -> bool {
        other.corners.iter().any(|corner| self.normal.dot(*corner) > self.offset_m + slack_m)
    }
}

/// All patches that are there at a time.
fn placed(scene: &Scene, time_s: f64) -> Vec<Placed> {
    let mut placed = Vec::new();
    for body in (0..scene.bodies.len() as u32).map(BodyId).filter(|&b| !scene.is_distant(b)) {
        let Some(pose) = scene.pose(body, time_s) else { continue };
        placed.extend(scene.patches_of(body).map(|(_, patch)| {
            let normal = pose.direction(patch.frame.normal);
            let offset_m = normal.dot(pose.point(patch.frame.origin));
            let corners = patch.corners_in_body().map(|p| pose.point(p)).collect();
            Placed { normal, offset_m, corners }
        }));
    }
    placed
}

/// Pairs that face each other, counted or, of more than `tried`, estimated.
fn count_facing(placed: &[Placed], slack_m: f64, tried: u64) -> u64 {
    let count = placed.len() as u64;
    let all = count * count.saturating_sub(1) / 2;
    // Every stride-th partner of each patch, counted from another one each time.
    let stride = all.div_ceil(tried).max(1) as usize;
    let of_patch = |k: usize| {
        let partners = placed[k + 1..].iter().skip(k % stride).step_by(stride);
        let both =
            |other: &&Placed| placed[k].faces(other, slack_m) && other.faces(&placed[k], slack_m);
        partners.filter(both).count() as u64
    };
    let found: u64 = (0..placed.len()).into_par_iter().map(of_patch).sum();
    (found * stride as u64).min(all)
}

impl Estimate {
    /// Estimate for a scene at `time_s`, solved from scratch with these options.
    ///
    /// Cost: some million tests of two polygons at most.
    pub fn of(scene: &Scene, time_s: f64, options: &Options) -> Estimate {
        let placed = placed(scene, time_s);
        let extent_m = scene.bounds(time_s).map_or(0.0, |bounds| bounds.diagonal());
        let facing = count_facing(&placed, 1e-6 * extent_m, TRIED);
        let patches = placed.len() as u64;
        let grouped = match options.oracle {
            Oracle::Error if options.groups => (grouped_patches(scene) as u64).min(patches),
            _ => 0,
        };
        let near = Near { patches, grouped, facing };
        Estimate::from_counts(&near, distant_parts(scene), options.tolerance)
    }

    /// See [`PAIRS_OF_PATCHES`] and what follows it.
    fn from_counts(near: &Near, distant: [u64; 2], tolerance: f64) -> Estimate {
        let Near { patches, grouped, facing: facing_of_all } = *near;
        let all = (patches as f64).max(1.0);
        let [wide, narrow] = distant.map(|parts| parts as f64);
        let of = |k: usize| {
            // Those that groups are not made of, and some groups.
            let n = (patches - grouped) as f64 + if grouped > 0 { GROUPS[k] } else { 0.0 };
            let of_near = facing_of_all as f64 * (n / all).min(1.0).powi(2);
            // What is distant is met by half of all that faces any way.
            let of_sky = (n * wide + patches as f64 * narrow) / 2.0;
            let facing = of_near + of_sky;
            let base = n * (n - 1.0).max(0.0) / 2.0 + PAIRS_OF_FACING * facing;
            let (fixed, of_patch) = REFINED[k];
            let refined = (fixed + of_patch * n) * FITTED_AT / tolerance;
            let finer = if k == 0 { 1.0 } else { (GROUPED_AT / tolerance).max(1.0) };
            let of_groups = grouped as f64 * PAIRS_OF_GROUPED[k] * finer;
            (PAIRS_OF_PATCHES[k] * base, refined.min(facing * REFINED_MOST) + of_groups)
        };
        let pairs = [0, 1].map(|k| of(k).0 + of(k).1);
        Estimate {
            patches,
            facing: facing_of_all,
            pairs: pairs.map(|pairs| pairs as u64),
            bytes: [0, 1].map(|k| (pairs[k] * BYTES[k]) as u64),
            core_seconds: [0, 1].map(|k| pairs[k] * SECONDS[k]),
            by_refinement: 2.0 * of(1).1 > pairs[1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SceneBuilder;
    use crate::scene::outside::{Outside, Sky};
    use crate::session::Session;

    use std::sync::Arc;

    use glam::DQuat;

    /// A floor with so many crates on it, under a lamp.
    fn crates(rows: u32) -> Scene {
        let mut b = SceneBuilder::new("crates");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let lamp = b.material("lamp", [0.5; 3], [9.0; 3]);
        let node = b.node("hall", None, DVec3::ZERO, DQuat::IDENTITY);
        let side_m = f64::from(rows) * 2.0;
        b.cuboid_inward(node, "walls", grey, DVec3::ZERO, DVec3::new(side_m, 3.0, side_m));
        let down = [(0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)];
        let corners = down.map(|(x, z)| DVec3::new(x * side_m, 2.9, z * side_m));
        b.polygon(node, "lamp", lamp, &corners);
        for (i, k) in (0..rows).flat_map(|i| (0..rows).map(move |k| (i, k))) {
            let low = DVec3::new(f64::from(i) * 2.0 + 0.5, 0.0, f64::from(k) * 2.0 + 0.5);
            b.cuboid(node, &format!("crate {i} {k}"), grey, low, low + DVec3::ONE);
        }
        b.build().unwrap()
    }

    #[test]
    fn pairs_and_memory_of_scenes_are_within_what_was_estimated() {
        for (rows, tolerance) in [(1, 0.1), (2, 0.3), (4, 0.3), (4, 0.1)] {
            let scene = crates(rows);
            let options = Options { tolerance, ..Options::default() };
            let estimate = Estimate::of(&scene, 0.0, &options);
            assert_eq!(estimate.patches, scene.patches.len() as u64);
            let mut session = Session::new(Arc::new(scene), options).unwrap();
            let found = session.step(0, 0.0).unwrap().pairs;
            let found = found.active + found.refined + found.culled;
            let [low, high] = estimate.pairs;
            assert!(
                (low..=high).contains(&found),
                "{rows} rows at {tolerance}: {found} {estimate:?}"
            );
            let bytes = session.memory_bytes();
            assert!(bytes <= estimate.bytes[1], "{rows} rows at {tolerance}: {bytes} {estimate:?}");
            // What could be seen meanwhile.
            assert_eq!(session.watch().pairs(), found);
        }
    }

    /// Things in the open make pairs with the sky above all.
    #[test]
    fn pairs_with_a_sky_count() {
        let mut b = SceneBuilder::new("open");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let node = b.node("street", None, DVec3::ZERO, DQuat::IDENTITY);
        for k in 0..12 {
            let low = DVec3::new(f64::from(k % 4) * 3.0, 0.0, f64::from(k / 4) * 3.0);
            b.cuboid(node, &format!("house {k}"), grey, low, low + DVec3::new(1.0, 2.0, 1.0));
        }
        let sky = Some(Sky::Overcast { irradiance: 3.0 });
        let outside = Outside { sky, fineness: 0.1, ..Outside::default() };
        let scene = b.build().unwrap().with_outside(outside).unwrap();
        let options = Options { tolerance: 0.1, ..Options::default() };
        let estimate = Estimate::of(&scene, 0.0, &options);
        let mut session = Session::new(Arc::new(scene), options).unwrap();
        let found = session.step(0, 0.0).unwrap().pairs;
        let found = (found.active + found.refined + found.culled) as f64;
        let middle = (estimate.pairs[0] as f64 * estimate.pairs[1] as f64).sqrt();
        assert!((1.0 / 3.0..3.0).contains(&(middle / found)), "{found} {estimate:?}");
    }

    #[test]
    fn an_even_share_of_many_pairs_stands_for_all() {
        let placed = placed(&crates(6), 0.0);
        let whole = count_facing(&placed, 1e-9, u64::MAX);
        let share = count_facing(&placed, 1e-9, 1_000);
        let off = share as f64 / whole as f64 - 1.0;
        assert!(whole > 1_000 && off.abs() < 0.15, "{share} of {whole}");
        assert_eq!(count_facing(&placed[0..0], 1e-9, 10), 0);
    }

    #[test]
    fn halls_of_thousands_of_polygons_are_no_matter_of_tolerance() {
        let hall = |patches, grouped, facing| Near { patches, grouped, facing };
        let estimate = Estimate::from_counts(&hall(33_000, 0, 90_000_000), [0, 0], 0.1);
        assert!(estimate.pairs[0] > 400_000_000 && !estimate.by_refinement, "{estimate:?}");
        // The same of small patches in groups.
        let grouped = Estimate::from_counts(&hall(33_000, 32_000, 90_000_000), [0, 0], 0.1);
        assert!(grouped.pairs[1] < 40_000_000 && grouped.by_refinement, "{grouped:?}");
        assert!(Estimate::from_counts(&hall(16, 0, 40), [0, 0], 0.005).by_refinement);
        assert_eq!(Estimate::from_counts(&hall(1, 0, 0), [0, 0], 0.02).pairs, [0, 0]);
    }
}
