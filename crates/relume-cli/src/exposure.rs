//! The frame by which pictures of a clip are exposed, and exposure in stops.

use std::collections::BTreeMap;

use relume::scene::{BodyId, Light, MaterialId, Scene};

use crate::frames;

/// The first of the frames of the animation in which most is emitted; `None` if nothing ever is.
///
/// Cost: one pose for each emitting body, material and frame.
pub(crate) fn brightest_frame(scene: &Scene, fps: f64) -> Option<u32> {
    let count = frames::frame_count(scene.motion.duration_s, fps).ok()?;
    brightest_of(scene, fps, 0..count)
}

/// The first of some frames in which most is emitted; `None` if nothing is in any.
pub(crate) fn brightest_of(
    scene: &Scene,
    fps: f64,
    frames: impl Iterator<Item = u32>,
) -> Option<u32> {
    // The area that would emit as much if it were all white.
    let mut lamps: BTreeMap<(BodyId, MaterialId), [f64; 3]> = BTreeMap::new();
    for patch in scene.patches.iter().filter(|p| scene.patch_emits(p)) {
        let (share, area_m2) = (scene.emission_share(patch), patch.area_m2());
        let area = lamps.entry((patch.body, patch.material)).or_default();
        (0..3).for_each(|c| area[c] += share[c] * area_m2);
    }
    let sum = |emission: [f64; 3]| emission.iter().sum::<f64>();
    let emitted = |frame: u32| {
        let time_s = frames::time_of(frame, fps);
        let of_lamp = |(&(body, of), area): (&(BodyId, MaterialId), &[f64; 3])| {
            let exitance = scene.materials[of.0 as usize].exitance_at(time_s);
            let there = scene.pose(body, time_s).is_some();
            if there { sum([0, 1, 2].map(|c| area[c] * exitance[c])) } else { 0.0 }
        };
        let of_light = |l: &Light| {
            let there = scene.motion.pose(l.node, time_s).is_some();
            if there { sum(l.intensity_at(time_s)) } else { 0.0 }
        };
        lamps.iter().map(of_lamp).chain(scene.lights.iter().map(of_light)).sum::<f64>()
    };
    let brighter = |best: (Option<u32>, f64), frame: u32| {
        let now = emitted(frame);
        if now > best.1 { (Some(frame), now) } else { best }
    };
    frames.fold((None, 0.0), brighter).0
}

/// The stops of a scale, rounded to a thousandth so that what the report says is what was used.
pub(crate) fn stops(scale: f64) -> f64 {
    let stops = scale.log2();
    if stops.is_finite() { (stops * 1000.0).round() / 1000.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use relume::scene::{Glow, Interpolation, Track};
    use relume_picture::picture::Exposure;

    use super::*;
    use crate::args::DemoScene;
    use crate::clip::fixed;
    use crate::demo;

    #[test]
    fn the_exposure_frame_is_the_first_with_most_light() {
        let mut scene = (demo::demo(DemoScene::Room).build)().unwrap();
        assert_eq!(brightest_frame(&scene, 24.0), Some(0));
        let lamp = scene.motion.nodes.iter_mut().find(|n| n.name == "lamp").unwrap();
        lamp.presence = vec![(0.0, false), (0.25, true)];
        assert_eq!(brightest_frame(&scene, 24.0), Some(6));
        let lamp = scene.materials.iter_mut().find(|m| m.emits()).unwrap();
        let values = vec![DVec3::ONE, DVec3::splat(3.0)];
        let track = Track { times_s: vec![0.0, 0.5], values, interpolation: Interpolation::Step };
        lamp.glow = Some(Glow { scale: lamp.exitance, tracks: vec![track] });
        assert_eq!(brightest_frame(&scene, 24.0), Some(12));
        for material in &mut scene.materials {
            (material.exitance, material.glow) = ([0.0; 3], None);
        }
        assert_eq!(brightest_frame(&scene, 24.0), None);
    }

    #[test]
    fn stops_and_scales() {
        assert_eq!(fixed(-1.0), Exposure::Fixed(0.5));
        assert_eq!(stops(8.0), 3.0);
        assert_eq!(stops(0.0), 0.0);
    }
}
