//! What a scene emits, all together.

use glam::DVec3;

use crate::scene::{LightId, LightKind, Patch, Scene, World};

/// A bound on the mean radiosity in a world and at any time of the clip, W/m2: all that can be emitted, over what is
/// absorbed at least.
pub(super) fn mean_radiosity_bound_w_m2(scene: &Scene, now: &World) -> f64 {
    let rho = scene.patches.iter().flat_map(|p| now.reflectance(scene, p)).fold(0.0, f64::max);
    let most = |one: [f64; 3], other: [f64; 3]| [0, 1, 2].map(|c| one[c].max(other[c]));
    let emitted_w = emitted_w(
        scene,
        |p| most(scene.most_exitance(p), now.exitance(scene, p)),
        |k| most(scene.lights[k.0 as usize].most_intensity(), now.intensity(k)),
    );
    emitted_w / scene.area_m2() / (1.0 - rho)
}

/// How many times as much a scene emits in a world as in another, present or not.
pub(super) fn brightened(scene: &Scene, change: &World, now: &World) -> f64 {
    let emitted_w = |w: &World| emitted_w(scene, |p| w.exitance(scene, p), |k| w.intensity(k));
    if now.any_relit(change) { emitted_w(now) / emitted_w(change) } else { 1.0 }
}

/// What all surfaces and lights emit, W, with given exitances and intensities.
fn emitted_w(
    scene: &Scene,
    exitance: impl Fn(&Patch) -> [f64; 3],
    intensity: impl Fn(LightId) -> [f64; 3],
) -> f64 {
    let mean = |c: [f64; 3]| c.iter().sum::<f64>() / 3.0;
    let area_m2 = scene.area_m2();
    // Of what moves, patches are placed about its origin, which is the scene's middle.
    let middle = scene.bounds(0.0).map_or(DVec3::ZERO, |bounds| bounds.centre());
    let factor = |p: &Patch| p.most_factor(if scene.moves(p.body) { DVec3::ZERO } else { middle });
    let of_patch = |p: &Patch| {
        let exitance = mean(exitance(p));
        exitance * if scene.is_distant(p.body) { factor(p) * area_m2 } else { p.area_m2() }
    };
    let of_light = |k: u32| {
        let spread = match scene.lights[k as usize].kind {
            LightKind::Directional => area_m2,
            LightKind::Point | LightKind::Spot { .. } => 4.0 * std::f64::consts::PI,
        };
        mean(intensity(LightId(k))) * spread
    };
    scene.patches.iter().map(of_patch).chain((0..scene.lights.len() as u32).map(of_light)).sum()
}
