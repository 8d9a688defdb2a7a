//! Incremental equals from scratch: after any motion the links are those of a cold build, bit for
//! bit, the elements are the same, and the radiosities agree within the residuals' bound.

use std::sync::Arc;

use crate::common::{at_tolerance, form_factor_oracle, lit_room, shipped};
use relume_core::scene::Scene;
use relume_core::session::{Aim, FrameReport, Options, Session, Update};

/// Frames are checked at this rate.
const FRAMES_PER_SECOND: f64 = 30.0;

fn pair_of(scene: &Arc<Scene>, options: &Options) -> (Session, Session) {
    let scratch = Options { update: Update::Scratch, ..options.clone() };
    (
        Session::new(Arc::clone(scene), options.clone()).unwrap(),
        Session::new(Arc::clone(scene), scratch).unwrap(),
    )
}

#[test]
fn there_and_back_again_equals_cold_builds() {
    let scene = Arc::new(lit_room());
    for (name, options) in [
        ("error", at_tolerance(0.1)),
        ("error at points", Options { aim: Aim::Points, ..at_tolerance(0.05) }),
        ("form factor", form_factor_oracle(0.05, 1e-3)),
    ] {
        let (mut warm, mut cold) = pair_of(&scene, &options);
        for (k, time) in [0.0, 0.05, 0.1, 0.2, 1.0, 0.5, 0.1, 0.1, 0.0].into_iter().enumerate() {
            let one = warm.step(k as u32, time).unwrap();
            let two = cold.step(k as u32, time).unwrap();
            println!(
                "{name} {time}: links {} visited {} examined {} changed {} promoted {} demoted {} occluded {} made {} reaped {} sweeps {} gathers {} | {:.4} {:.4} cold {:.4} {:.4} sweeps {} gathers {}",
                one.links,
                one.work.visited,
                one.work.examined,
                one.work.changed,
                one.work.promoted,
                one.work.demoted,
                one.work.occlusion_changed,
                one.work.elements_made,
                one.elements_reaped,
                one.sweeps,
                one.gathers,
                one.seconds.total,
                one.seconds.solve,
                two.seconds.total,
                two.seconds.solve,
                two.sweeps,
                two.gathers
            );
            assert_eq!(one.hash, two.hash, "{name} at {time}");
            assert_eq!(one.elements, two.elements, "{name} at {time}");
            assert_eq!(one.leaves, two.leaves, "{name} at {time}");
        }
    }
}

#[test]
fn every_frame_of_the_shipped_scenes_equals_a_cold_build() {
    for name in [
        "box_room.glb",
        "cornell_moving_box_and_lamp.glb",
        "satellite_rotating_arrays.glb",
        "room_box_static.glb",
    ] {
        let scene = Arc::new(shipped(name));
        let frames = (scene.motion.duration_s * FRAMES_PER_SECOND).round() as u32;
        for (oracle, options) in
            [("error", at_tolerance(0.4)), ("form factor", form_factor_oracle(0.2, 0.05))]
        {
            let (mut warm, mut cold) = pair_of(&scene, &options);
            for frame in 0..=frames {
                let time_s = f64::from(frame) / FRAMES_PER_SECOND;
                let one = warm.step(frame, time_s).unwrap();
                let two = cold.step(frame, time_s).unwrap();
                let state = |r: &FrameReport| (r.hash.clone(), r.links, r.elements, r.leaves);
                assert_eq!(state(&one), state(&two), "{name}, {oracle}, frame {frame}");
            }
            println!("{name}, {oracle}: {} frames, hash equal at each", frames + 1);
        }
    }
}
