//! The scenes that ship with the command: the two sequences of Forsyth, Yang and Teo 1995,
//! Table 0.1, and a living room, made from code. Metres, +Y up.
//!
//! Nothing here knows how a scene is solved or drawn, beyond the settings that suit it.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use relume::scene::{
    Interpolation, MaterialId, Projection, Scene, SceneBuilder, SceneError, Track,
};

use crate::args::{DemoScene, Shading};

mod living_room;

/// Frames a second that the keys are made for.
const FPS: f64 = 24.0;

/// Frames of the corridor, as in the paper's table.
const CORRIDOR_FRAMES: u32 = 109;
/// Frames of the room, as in the paper's table.
const ROOM_FRAMES: u32 = 20;
/// Tolerances at which the paper's 5,000 to 6,000 elements are drawn in a frame.
const CORRIDOR_TOLERANCE: f64 = 0.028;
const ROOM_TOLERANCE: f64 = 0.036;
/// That of pictures.
const LIVING_ROOM_TOLERANCE: f64 = 0.1;

const CORRIDOR_WIDTH_M: f64 = 4.0;
const CORRIDOR_LENGTH_M: f64 = 8.0;
const CORRIDOR_HEIGHT_M: f64 = 3.0;
/// Width, height, depth of the box, and where its footprint's centre is.
const BOX_SIZE_M: DVec3 = DVec3::new(1.2, 1.3, 1.2);
const BOX_PLACE_M: DVec3 = DVec3::new(-0.5, 0.0, -4.6);
const BOX_TURN: f64 = 0.4;
const CORRIDOR_LAMP_SIDE_M: f64 = 1.0;
/// Half axes of the lamp's ellipse in the plane of the ceiling.
const CORRIDOR_PATH_M: (f64, f64) = (1.2, 2.9);

const ROOM_SIDE_M: f64 = 3.0;
const ROOM_LAMP_SIDE_M: f64 = 0.7;
/// How far below the ceiling the lamp hangs.
const ROOM_LAMP_DROP_M: f64 = 0.1;
/// Negative: it starts at the back.
const ROOM_PATH_M: (f64, f64) = (-0.95, -0.95);

/// Emitted radiance of the lamps, W/m2/sr: a warm white.
const LAMP_RADIANCE: [f64; 3] = [20.0, 18.0, 15.0];
const WHITE: [f64; 3] = [0.75, 0.75, 0.73];
const FLOOR: [f64; 3] = [0.55, 0.5, 0.43];
const RED: [f64; 3] = [0.7, 0.14, 0.1];
const GREEN: [f64; 3] = [0.16, 0.55, 0.2];
const BLUE: [f64; 3] = [0.13, 0.3, 0.65];
const OCHRE: [f64; 3] = [0.75, 0.6, 0.3];
const NONE: [f64; 3] = [0.0; 3];

/// A scene with what suits it.
pub(crate) struct Demo {
    /// File stem.
    pub(crate) name: &'static str,
    /// Display of the sequence.
    pub(crate) shading: Shading,
    /// Default tolerance.
    pub(crate) tolerance: f64,
    /// Makes the scene.
    pub(crate) build: fn() -> Result<Scene, SceneError>,
}

/// The demonstration of this name.
pub(crate) fn demo(scene: DemoScene) -> Demo {
    match scene {
        DemoScene::Corridor => Demo {
            name: "corridor",
            shading: Shading::Smooth,
            tolerance: CORRIDOR_TOLERANCE,
            build: corridor,
        },
        DemoScene::Room => {
            Demo { name: "room", shading: Shading::Smooth, tolerance: ROOM_TOLERANCE, build: room }
        }
        DemoScene::LivingRoom => Demo {
            name: "living-room",
            shading: Shading::Smooth,
            tolerance: LIVING_ROOM_TOLERANCE,
            build: living_room::living_room,
        },
    }
}

/// Three walls, a floor, no ceiling, a box on the floor, a lamp moving in the plane of the ceiling.
fn corridor() -> Result<Scene, SceneError> {
    let mut b = SceneBuilder::new("corridor");
    let half = CORRIDOR_WIDTH_M / 2.0;
    let min = DVec3::new(-half, 0.0, -CORRIDOR_LENGTH_M);
    let max = DVec3::new(half, CORRIDOR_HEIGHT_M, 0.0);
    let (white, floor) = (b.material("white", WHITE, NONE), b.material("floor", FLOOR, NONE));
    let (red, blue) = (b.material("red", RED, NONE), b.material("blue", BLUE, NONE));
    wall(&mut b, "left wall", red, min, max, Side::Left);
    wall(&mut b, "right wall", blue, min, max, Side::Right);
    wall(&mut b, "back wall", white, min, max, Side::Back);
    wall(&mut b, "floor", floor, min, max, Side::Floor);
    standing_box(&mut b);
    let centre = DVec3::new(0.0, CORRIDOR_HEIGHT_M, -CORRIDOR_LENGTH_M / 2.0);
    // The last frame is the first again.
    let path = ellipse(centre, CORRIDOR_PATH_M, CORRIDOR_FRAMES, CORRIDOR_FRAMES - 1);
    lamp(&mut b, CORRIDOR_LAMP_SIDE_M, path);
    let eye = DVec3::new(0.0, 1.9, 2.6);
    camera(&mut b, eye, -0.1, 52f64.to_radians());
    b.build()
}

/// A closed cubical room with a lamp that circles just below the ceiling.
fn room() -> Result<Scene, SceneError> {
    let mut b = SceneBuilder::new("room");
    let half = ROOM_SIDE_M / 2.0;
    let min = DVec3::new(-half, 0.0, -half);
    let max = DVec3::new(half, ROOM_SIDE_M, half);
    let (white, floor) = (b.material("white", WHITE, NONE), b.material("floor", FLOOR, NONE));
    let (red, green) = (b.material("red", RED, NONE), b.material("green", GREEN, NONE));
    wall(&mut b, "left wall", red, min, max, Side::Left);
    wall(&mut b, "right wall", green, min, max, Side::Right);
    wall(&mut b, "back wall", white, min, max, Side::Back);
    wall(&mut b, "front wall", white, min, max, Side::Front);
    wall(&mut b, "floor", floor, min, max, Side::Floor);
    wall(&mut b, "ceiling", white, min, max, Side::Ceiling);
    let centre = DVec3::new(0.0, ROOM_SIDE_M - ROOM_LAMP_DROP_M, 0.0);
    // A loop: the frame after the last is the first.
    lamp(&mut b, ROOM_LAMP_SIDE_M, ellipse(centre, ROOM_PATH_M, ROOM_FRAMES, ROOM_FRAMES));
    // Outside, looking in through the front wall: pictures leave out what is seen from behind. At
    // 4 : 3 the opening is just wider than the picture.
    let eye = DVec3::new(0.0, ROOM_SIDE_M / 2.0, half + 1.45);
    camera(&mut b, eye, 0.0, 74f64.to_radians());
    b.build()
}

/// A side of a room, named as seen by the camera, which looks along -Z.
#[derive(Clone, Copy)]
enum Side {
    Left,
    Right,
    Floor,
    Ceiling,
    Back,
    Front,
}

/// One side of the box `min..max`, facing inwards, as an object of its own.
fn wall(
    b: &mut SceneBuilder,
    name: &str,
    material: MaterialId,
    min: DVec3,
    max: DVec3,
    side: Side,
) {
    let at = |x: f64, y: f64, z: f64| min + (max - min) * DVec3::new(x, y, z);
    let corners = match side {
        Side::Left => [at(0., 0., 0.), at(0., 1., 0.), at(0., 1., 1.), at(0., 0., 1.)],
        Side::Right => [at(1., 0., 0.), at(1., 0., 1.), at(1., 1., 1.), at(1., 1., 0.)],
        Side::Floor => [at(0., 0., 0.), at(0., 0., 1.), at(1., 0., 1.), at(1., 0., 0.)],
        Side::Ceiling => [at(0., 1., 0.), at(1., 1., 0.), at(1., 1., 1.), at(0., 1., 1.)],
        Side::Back => [at(0., 0., 0.), at(1., 0., 0.), at(1., 1., 0.), at(0., 1., 0.)],
        Side::Front => [at(0., 0., 1.), at(0., 1., 1.), at(1., 1., 1.), at(1., 0., 1.)],
    };
    let node = b.node(name, None, DVec3::ZERO, DQuat::IDENTITY);
    b.polygon(node, name, material, &corners);
}

/// The box of the corridor, turned about the vertical. It stands on the floor, so it has no bottom:
/// no light reaches there.
fn standing_box(b: &mut SceneBuilder) {
    let material = b.material("ochre", OCHRE, NONE);
    let node = b.node("box", None, BOX_PLACE_M, DQuat::from_rotation_y(BOX_TURN));
    let (x, y, z) = (BOX_SIZE_M.x / 2.0, BOX_SIZE_M.y, BOX_SIZE_M.z / 2.0);
    let at = DVec3::new;
    let sides = [
        [at(-x, 0., -z), at(-x, 0., z), at(-x, y, z), at(-x, y, -z)],
        [at(x, 0., -z), at(x, y, -z), at(x, y, z), at(x, 0., z)],
        [at(-x, 0., -z), at(-x, y, -z), at(x, y, -z), at(x, 0., -z)],
        [at(-x, 0., z), at(x, 0., z), at(x, y, z), at(-x, y, z)],
        [at(-x, y, -z), at(-x, y, z), at(x, y, z), at(x, y, -z)],
    ];
    for side in sides {
        b.polygon(node, "box", material, &side);
    }
}

/// A square lamp that shines down and follows `path` with its centre.
fn lamp(b: &mut SceneBuilder, side_m: f64, path: Track) {
    let material = b.material("lamp", [0.0; 3], LAMP_RADIANCE.map(|l| PI * l));
    let node = b.node("lamp", None, path.values[0], DQuat::IDENTITY);
    let h = side_m / 2.0;
    let at = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    b.polygon(node, "lamp", material, &[at(-h, -h), at(h, -h), at(h, h), at(-h, h)]);
    b.animate_translation(node, path);
}

/// One key a frame along a horizontal ellipse that takes `turn_frames` frames for a full turn.
fn ellipse(centre: DVec3, half_axes: (f64, f64), frames: u32, turn_frames: u32) -> Track {
    let key = |frame: u32| {
        let angle = TAU * f64::from(frame) / f64::from(turn_frames);
        let (sin, cos) = libm::sincos(angle);
        centre + DVec3::new(half_axes.0 * sin, 0.0, half_axes.1 * cos)
    };
    Track {
        times_s: (0..frames).map(|frame| f64::from(frame) / FPS).collect(),
        values: (0..frames).map(key).collect(),
        interpolation: Interpolation::Linear,
    }
}

/// A camera that looks along -Z, tilted up by `pitch` radians.
fn camera(b: &mut SceneBuilder, eye: DVec3, pitch: f64, yfov: f64) {
    let node = b.node("camera", None, eye, DQuat::from_rotation_x(pitch));
    b.camera("camera", node, Projection::Perspective { yfov, aspect: None });
}

#[cfg(test)]
mod tests {
    use relume::scene::PatchId;

    use super::*;
    use crate::frames::frame_count;

    #[test]
    fn frames_are_those_of_the_paper() {
        for (scene, frames) in [(DemoScene::Corridor, 109), (DemoScene::Room, 20)] {
            let scene = (demo(scene).build)().unwrap();
            assert_eq!(frame_count(scene.motion.duration_s, FPS), Ok(frames));
        }
    }

    #[test]
    fn the_living_room_is_large_and_its_door_stays_clear_of_the_wall_and_the_furniture() {
        let scene = (demo(DemoScene::LivingRoom).build)().unwrap();
        assert_eq!(frame_count(scene.motion.duration_s, FPS), Ok(living_room::FRAMES));
        assert!((2_000..10_000).contains(&scene.patches.len()), "{}", scene.patches.len());
        // That names are shared is said, and no more.
        assert!(scene.notes.iter().all(|note| note.code == "renamed"), "{:?}", scene.notes);
        let moving = |name: &str, frame: u32| {
            let body = scene.body_named(name).unwrap();
            let pose = scene.pose(body, f64::from(frame) / FPS).unwrap();
            let corners = scene.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
            corners.map(|c| pose.point(c)).collect::<Vec<DVec3>>()
        };
        for frame in 0..living_room::FRAMES {
            // Between the doorway and the shelf, and above the floor.
            for p in moving("door", frame) {
                assert!(p.x < 4.35 && p.y > 0.0 && p.y < 2.05, "{p} in frame {frame}");
                assert!(p.z < -2.9 && p.z > -4.12, "{p} in frame {frame}");
            }
            for p in moving("lantern", frame) {
                assert!(p.x > 1.2 && p.x < 4.0 && p.y > 1.0 && p.z < -1.3 && p.z > -2.9, "{p}");
            }
        }
    }

    #[test]
    fn every_side_of_the_room_faces_its_middle() {
        let scene = room().unwrap();
        let middle = DVec3::new(0.0, ROOM_SIDE_M / 2.0, 0.0);
        assert_eq!(scene.patches.len(), 7);
        for (index, patch) in scene.patches.iter().enumerate() {
            let pose = scene.pose(patch.body, 0.0).unwrap();
            let towards = middle - pose.point(patch.frame.origin);
            assert!(
                towards.dot(pose.direction(patch.frame.normal)) > 0.0,
                "{:?} {}",
                PatchId(index as u32),
                scene.surfaces[patch.surface.0 as usize].name
            );
        }
    }

    #[test]
    fn the_box_faces_outwards_and_stands_inside_the_walls() {
        let scene = corridor().unwrap();
        assert_eq!(scene.patches.len(), 4 + 5 + 1);
        let centre = BOX_PLACE_M + DVec3::new(0.0, BOX_SIZE_M.y / 2.0, 0.0);
        for patch in &scene.patches {
            let surface = &scene.surfaces[patch.surface.0 as usize];
            let outwards = patch.frame.origin - centre;
            if surface.object == "box" {
                assert!(outwards.dot(patch.frame.normal) > 0.0);
                for corner in patch.corners_in_body() {
                    assert!(corner.x.abs() < CORRIDOR_WIDTH_M / 2.0);
                    assert!((-CORRIDOR_LENGTH_M..0.0).contains(&corner.z));
                }
            }
        }
    }

    #[test]
    fn lamps_shine_down_and_stay_between_the_walls() {
        for scene in [corridor().unwrap(), room().unwrap()] {
            let (patch, body) = scene
                .patches
                .iter()
                .find(|p| scene.materials[p.material.0 as usize].exitance[0] > 0.0)
                .map(|p| (p, p.body))
                .unwrap();
            let bounds = scene.bounds(0.0).unwrap();
            for frame in 0..20 {
                let pose = scene.pose(body, f64::from(frame) / FPS).unwrap();
                assert_eq!(pose.direction(patch.frame.normal), DVec3::NEG_Y);
                for corner in patch.corners_in_body() {
                    let p = pose.point(corner);
                    assert!(bounds.lo.cmple(p).all() && p.cmple(bounds.hi).all(), "{p}");
                }
            }
        }
    }
}
