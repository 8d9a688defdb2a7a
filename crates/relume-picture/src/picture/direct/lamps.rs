//! Which patches' light is found exactly: lamps, the sun and the bright part of the sky.
//!
//! Must not know the view.

use relume_core::scene::{PatchId, Scene, World};

use crate::picture::tone::luminance;
use crate::picture::tuning::{BRIGHT_SKY, LAMP_SHARE, LAMPS_MAX, SKY_LAMPS_MAX};

/// Patches whose own light a cleaned picture finds exactly, ascending: those that emit more than a thousandth of what all lamps do, the
/// sun, and parts of the sky that are much brighter than the rest.
///
/// A function of the scene and the world alone. For [`relume_core::session::Frame::solution_beside`].
pub fn direct_lamps(scene: &Scene, world: &World) -> Vec<PatchId> {
    let mut near: Vec<(f64, PatchId)> = Vec::new();
    let mut distant: Vec<(f64, PatchId, f64)> = Vec::new();
    for (k, patch) in scene.patches.iter().enumerate() {
        let id = PatchId(k as u32);
        if world.pose(patch.body).is_none() {
            continue;
        }
        let bright = luminance(world.exitance(scene, patch).map(|m| m as f32));
        if bright > 0.0 && scene.is_distant(patch.body) {
            distant.push((bright, id, patch.area_m2()));
        } else if bright > 0.0 {
            near.push((bright * patch.area_m2(), id));
        }
    }
    let all_w: f64 = near.iter().map(|lamp| lamp.0).sum();
    near.retain(|lamp| lamp.0 >= LAMP_SHARE * all_w);
    let strongest = |one: &(f64, PatchId), other: &(f64, PatchId)| {
        other.0.total_cmp(&one.0).then(one.1.cmp(&other.1))
    };
    near.sort_by(strongest);
    near.truncate(LAMPS_MAX);
    // Sky that is as bright as the rest of it casts no shadow that the mesh has not.
    let area: f64 = distant.iter().map(|sky| sky.2).sum();
    let mut areas: Vec<(f64, f64)> = distant.iter().map(|sky| (sky.0, sky.2)).collect();
    areas.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut left = 0.5 * area;
    let median = areas.iter().find(|(_, own)| {
        left -= own;
        left <= 0.0
    });
    let median = median.map_or(0.0, |sky| sky.0);
    let is_bright = |sky: &&(f64, PatchId, f64)| sky.0 > BRIGHT_SKY * median || distant.len() < 4;
    let mut sky: Vec<(f64, PatchId)> =
        distant.iter().filter(is_bright).map(|sky| (sky.0 * sky.2, sky.1)).collect();
    sky.sort_by(strongest);
    sky.truncate(SKY_LAMPS_MAX);
    let mut lamps: Vec<PatchId> = near.into_iter().chain(sky).map(|lamp| lamp.1).collect();
    lamps.sort_unstable();
    lamps
}
