//! The four scenes in `tests/data`: two written by hand, two exported by Blender.

use std::f64::consts::PI;

use glam::DVec3;
use relume_core::geometry::Pose;
use relume_core::scene::{BodyId, Projection, Scene, check};

use super::{read, shipped};

fn names(scene: &Scene) -> Vec<&str> {
    scene.bodies.iter().map(|b| b.name.as_str()).collect()
}

fn patches(scene: &Scene) -> Vec<u32> {
    scene.bodies.iter().map(|b| b.patches.end - b.patches.start).collect()
}

#[test]
fn box_room() {
    let scene = read(&shipped("box_room.glb")).unwrap();
    assert_eq!(scene.name, "box_room");
    assert_eq!((names(&scene), patches(&scene)), (vec!["room", "box", "lamp"], vec![6, 6, 1]));
    let surfaces: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(surfaces, ["room/wall", "room/warm", "box", "lamp"]);
    assert!((scene.area_m2() - (6.0 + 6.0 * 0.09 + 0.0625)).abs() < 1e-6, "{}", scene.area_m2());
    let lamp = &scene.materials[scene.patches[12].material.0 as usize];
    assert_eq!((lamp.reflectance, lamp.exitance), ([0.0; 3], [10.0 * PI; 3]));
    assert_eq!(scene.motion.animation.as_deref(), Some("motion"));
    assert_eq!(scene.motion.duration_s, 1.0);
    // Half-way: half of the way, and half of a quarter turn about y.
    assert_eq!(scene.pose(BodyId(0), 0.5), Some(Pose::IDENTITY));
    let pose = scene.pose(BodyId(1), 0.5).unwrap();
    assert!(
        pose.translation.distance(DVec3::new(0.5, 0.325, 0.475)) < 1e-7,
        "{}",
        pose.translation
    );
    let half = 0.5f64.sqrt();
    assert!(pose.direction(DVec3::X).distance(DVec3::new(half, 0.0, -half)) < 1e-7);
    let camera = &scene.cameras[0];
    assert_eq!(camera.name, "camera");
    assert_eq!(camera.projection, Projection::Perspective { yfov: 1.2, aspect: Some(4.0 / 3.0) });
    let view = scene.motion.pose(camera.node, 0.0).unwrap();
    assert!(view.direction(-DVec3::Z).distance(DVec3::new(0.0, -0.145_494, -0.989_359)) < 1e-5);
    assert_eq!(scene.notes, []);
    assert_eq!(check(&scene), []);
}

#[test]
fn cornell_box_from_blender() {
    let scene = read(&shipped("cornell_moving_box_and_lamp.glb")).unwrap();
    assert_eq!(names(&scene), ["floor", "ceiling", "back", "left", "right", "mover", "lamp"]);
    // Blender writes double-sided materials: every polygon is two patches.
    assert_eq!(patches(&scene), [2, 2, 2, 2, 2, 12, 2]);
    assert!(scene.patches.iter().all(|p| p.twin.is_some() && p.corners.len() == 4));
    assert_eq!(scene.motion.animation.as_deref(), Some("moverAction, lampAction"));
    assert_eq!(scene.motion.duration_s, 5.0);
    // Key times are frames of 1/24 s again, so every frame has the pose of its key.
    let track = scene.motion.nodes[5].translation_track.as_ref().unwrap();
    for frame in 1..=120 {
        let time_s = f64::from(frame) / 24.0;
        let pose = scene.pose(BodyId(5), time_s).unwrap();
        assert_eq!(pose.translation, track.values[frame as usize - 1]);
    }
    let found = check(&scene);
    let open: Vec<&str> =
        found.iter().filter(|n| n.code == "open-enclosure").map(|n| n.subject.as_str()).collect();
    assert_eq!(open, ["ceiling", "floor", "left", "right"]);
    assert_eq!(
        found.iter().filter(|n| n.code == "reflectance").count(),
        1,
        "the lamp's white: {found:?}"
    );
    assert_eq!(found.len(), 5, "{found:?}");
}

#[test]
fn static_room() {
    let scene = read(&shipped("room_box_static.glb")).unwrap();
    assert_eq!((names(&scene), patches(&scene)), (vec!["room", "lamp", "box"], vec![9, 1, 6]));
    assert_eq!((scene.motion.duration_s, &scene.motion.animation), (0.0, &None));
    assert!((scene.area_m2() - (6.0 + 6.0 * 0.09)).abs() < 1e-6, "{}", scene.area_m2());
    assert_eq!(scene.notes, []);
    assert_eq!(check(&scene), []);
}

#[test]
fn satellite() {
    let scene = read(&shipped("satellite_rotating_arrays.glb")).unwrap();
    assert_eq!(
        (names(&scene), patches(&scene)),
        (vec!["bus", "array-1", "array1"], vec![12, 12, 12])
    );
    assert_eq!(scene.pose(BodyId(0), 7.0), Some(Pose::IDENTITY));
    for t in [0.0, 3.3, 9.9] {
        let pose = scene.pose(BodyId(1), t).unwrap();
        assert!((pose.rotation.determinant() - 1.0).abs() < 1e-12);
        assert!((pose.translation.x + 1.9).abs() < 1e-6);
    }
    assert_ne!(scene.pose(BodyId(1), 3.3), scene.pose(BodyId(1), 5.0));
    assert_eq!(check(&scene)[0].code, "nothing-emits");
}
