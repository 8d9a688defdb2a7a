//! Incremental equals from scratch: after any motion the links are those of a cold build, bit for
//! bit, the elements are the same, and the radiosities agree within the residuals' bound.

use std::sync::Arc;

use crate::common::{at_tolerance, form_factor_oracle, lit_room, shipped, sliding, still, v};
use glam::DVec3;
use relume_core::scene::{BodyId, Scene, SceneBuilder};
use relume_core::session::{Aim, FrameReport, MountedSensor, Options, Sensor, Session, Update};

/// Frames are checked at this rate.
const FRAMES_PER_SECOND: f64 = 30.0;

fn pair_of(scene: &Arc<Scene>, options: &Options) -> (Session, Session) {
    let scratch = Options { update: Update::Scratch, ..options.clone() };
    (
        Session::new(Arc::clone(scene), options.clone()).unwrap(),
        Session::new(Arc::clone(scene), scratch).unwrap(),
    )
}

/// Sensors on a wall, on a body that moves, and on one that there is not.
fn riding_sensors(scene: &Scene) -> Aim {
    let body = |name: &str| scene.bodies.iter().position(|b| b.name == name);
    let mover = BodyId(body("mover").expect("a body that moves") as u32);
    let sensor = Sensor { at: DVec3::new(0.4, 0.0, 0.3), normal: DVec3::Y };
    let side = Sensor { at: DVec3::new(0.0, 0.121, 0.0), normal: DVec3::Y };
    let on = |body: Option<BodyId>, sensor| MountedSensor { body, sensor };
    let nowhere = BodyId(scene.bodies.len() as u32);
    Aim::Sensors([on(None, sensor), on(Some(mover), side), on(Some(nowhere), side)].into())
}

#[test]
fn there_and_back_again_equals_cold_builds() {
    let scene = Arc::new(lit_room());
    for (name, options) in [
        ("error", at_tolerance(0.1)),
        ("error at points", Options { aim: Aim::Points, ..at_tolerance(0.05) }),
        ("error at sensors", Options { aim: riding_sensors(&scene), ..at_tolerance(0.05) }),
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
fn what_sensors_see_changes_though_no_light_does() {
    let mut b = SceneBuilder::new("carried");
    let wall = b.material("wall", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [30.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", wall, DVec3::ZERO, DVec3::ONE);
    b.cuboid(room, "crate", wall, v(0.1, 0.0, 0.1), v(0.5, 0.4, 0.5));
    b.polygon(
        room,
        "lamp",
        lamp,
        &[[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]].map(|[x, z]| v(x, 0.95, z)),
    );
    // Outside of the room, where no light is; the sensor that it carries is inside.
    let carrier = sliding(&mut b, "carrier", v(9.0, 0.0, 0.0), v(9.8, 0.0, 0.0));
    b.cuboid(carrier, "carrier", wall, v(-0.1, -0.1, -0.1), v(0.1, 0.1, 0.1));
    let scene = Arc::new(b.build().unwrap());
    let carrier = scene.bodies.iter().position(|b| b.name == "carrier").unwrap();
    let sensor = Sensor { at: v(-8.95, 0.01, 0.3), normal: DVec3::Y };
    let rider = MountedSensor { body: Some(BodyId(carrier as u32)), sensor };
    let options = Options { aim: Aim::Sensors([rider].into()), ..at_tolerance(0.01) };
    let (mut warm, mut cold) = pair_of(&scene, &options);
    for (k, (time_s, x)) in [(0.0, 0.05), (0.5, 0.45), (1.0, 0.85)].into_iter().enumerate() {
        let hash = warm.step(k as u32, time_s).unwrap().hash;
        assert_eq!(hash, cold.step(k as u32, time_s).unwrap().hash, "at {time_s}");
        let place = scene.pose(BodyId(carrier as u32), time_s).unwrap().point(sensor.at);
        assert!(place.distance(v(x, 0.01, 0.3)) < 1e-9);
        let rests = MountedSensor { body: None, sensor: Sensor { at: place, ..sensor } };
        let options = Options { aim: Aim::Sensors([rests].into()), ..at_tolerance(0.01) };
        let mut resting = Session::new(Arc::clone(&scene), options).unwrap();
        assert_eq!(hash, resting.step(k as u32, time_s).unwrap().hash, "resting at {time_s}");
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
