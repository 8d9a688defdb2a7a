//! White rooms keep their light: what is absorbed and what escapes is what was emitted, and frames that follow others agree with cold builds.

use crate::common::{Random, at_tolerance, sliding, still, v};
use glam::{DQuat, DVec3};
use relume_core::scene::{MaterialId, Scene, SceneBuilder};
use relume_core::session::Session;

/// Light made or lost, over what is emitted, at most. Without levels the first of these rooms made 0.018.
const ASTRAY_MAX: f64 = 4e-3;

/// A closed room of double-sided white walls with a lamp some way below its ceiling, boxes and panels of two sides that stand,
/// float and stick through each other, and one that moves.
fn white_room(seed: u64) -> Scene {
    let mut r = Random(seed);
    let size = v(r.between(2.0, 4.0), r.between(2.0, 5.0), r.between(2.0, 3.0));
    let mut b = SceneBuilder::new("white");
    let wall = b.double_sided_material("wall", [0.95; 3], [0.0; 3]);
    let glow = b.material("glow", [0.3; 3], [30.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", wall, DVec3::ZERO, size);
    let lamp = still(&mut b, "lamp");
    let at = size * v(r.between(0.2, 0.6), r.between(0.2, 0.6), 1.0);
    b.cuboid(lamp, "lamp", glow, at - v(0.0, 0.0, 0.15), at + v(0.35, 0.35, -0.05));
    for k in 0..3 {
        let white =
            b.double_sided_material(&format!("white {k}"), [r.between(0.8, 0.98); 3], [0.0; 3]);
        let half = v(r.between(0.02, 0.4), r.between(0.02, 0.4), r.between(0.02, 0.4));
        let at = r.point(v(0.5, 0.5, 0.4), size - v(0.5, 0.5, 0.6));
        let node = match k {
            0 => sliding(&mut b, "mover", at, at + v(0.3, 0.1, 0.0)),
            _ => b.node(&format!("box {k}"), None, at, DQuat::from_rotation_z(0.4 * f64::from(k))),
        };
        b.cuboid(node, "box", white, -half, half);
    }
    b.build().unwrap()
}

#[test]
fn white_rooms_neither_make_nor_lose_light() {
    for seed in 0..6 {
        let mut session = Session::new(white_room(seed), at_tolerance(0.1)).unwrap();
        for frame in 0..3 {
            let time_s = f64::from(frame) / 24.0;
            let energy = session.solve_at(time_s).unwrap().report().energy.unwrap();
            let off = (energy.emitted_w - energy.absorbed_w) / energy.emitted_w;
            println!(
                "{seed}, {frame}: {off:.5} of {:.2} W, escapes {:.4}",
                energy.emitted_w, energy.escaped_w
            );
            assert!(off.abs() <= ASTRAY_MAX, "{seed}, {frame}: {off} of {energy:?}");
        }
    }
}

#[test]
fn frames_of_white_rooms_agree_with_cold_builds() {
    for seed in [1, 4] {
        let mut session = Session::new(white_room(seed), at_tolerance(0.1)).unwrap();
        for frame in 0..4 {
            let time_s = f64::from(frame) / 24.0;
            session.solve_at(time_s).unwrap();
            let mut cold = Session::new(session.scene().clone(), at_tolerance(0.1)).unwrap();
            cold.solve_at(time_s).unwrap();
            let difference =
                relume_core::session::compare(session.solved().unwrap(), cold.solved().unwrap());
            assert_eq!(difference, None, "{seed}, {frame}");
            let [warm, cold] = [&session, &cold].map(|s| s.frame().unwrap().solution());
            for (one, two) in warm.leaves.iter().zip(&cold.leaves) {
                for c in 0..3 {
                    let [one, two] = [one.irradiance[c], two.irradiance[c]];
                    assert!(
                        (one - two).abs() <= 0.02 * (two + 1.0),
                        "{seed}, {frame}: {one} {two}"
                    );
                }
            }
        }
    }
}

/// Light made of nothing in a closed scene, over what is emitted.
fn made(scene: Scene, tolerance: f64) -> f64 {
    let mut session = Session::new(scene, at_tolerance(tolerance)).unwrap();
    let energy = session.solve_at(0.0).unwrap().report().energy.unwrap();
    (energy.absorbed_w - energy.emitted_w) / energy.emitted_w
}

/// Light made of nothing by a lamp of both sides below a ceiling, over what it emits.
fn made_below_a_ceiling(height_m: f64, turn: f64, thick_m: f64) -> f64 {
    let mut b = SceneBuilder::new("lamp");
    let wall = b.material("wall", [0.9; 3], [0.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", wall, DVec3::ZERO, v(3.0, 4.0, 2.7));
    let at = v(1.3, 1.1, 2.7 - height_m);
    let lamp = b.node("lamp", None, at, DQuat::from_rotation_z(turn));
    if thick_m > 0.0 {
        let glow = b.material("glow", [0.3; 3], [30.0; 3]);
        b.cuboid(lamp, "lamp", glow, v(-0.2, -0.25, -thick_m), v(0.2, 0.25, 0.0));
    } else {
        let glow = b.double_sided_material("glow", [0.3; 3], [30.0; 3]);
        let corners = [(-0.2, -0.25), (0.2, -0.25), (0.2, 0.25), (-0.2, 0.25)];
        b.polygon(lamp, "lamp", glow, &corners.map(|(x, y)| v(x, y, 0.0)));
    }
    let off = made(b.build().unwrap(), 0.1);
    println!("{height_m} m, turned by {turn}, {thick_m} m thick: {off:.5}");
    off
}

#[test]
fn lamps_close_below_a_ceiling_give_the_room_no_more_than_they_emit() {
    let heights = [2e-4, 1e-3, 4e-3, 1.2e-2];
    for (height_m, turn) in heights.iter().flat_map(|&h| [(h, 0.0), (h, 0.5)]) {
        for thick_m in [0.0, 0.03] {
            let off = made_below_a_ceiling(height_m, turn, thick_m);
            assert!(off.abs() <= ASTRAY_MAX, "{height_m} m, turned by {turn}: {off}");
        }
    }
}

/// A white room with a hollow board of polygons that are seen from both sides, 1 cm below its ceiling, and the material of a lamp.
fn board_below_a_ceiling(thin: bool, glides: bool) -> (SceneBuilder, MaterialId) {
    let mut b = SceneBuilder::new("board");
    let wall = b.material("wall", [0.94; 3], [0.0; 3]);
    let white = b.double_sided_material("white", [0.95; 3], [0.0; 3]);
    let glow = match thin {
        true => b.double_sided_material("glow", [0.94; 3], [60.0; 3]),
        false => b.material("glow", [0.2; 3], [60.0; 3]),
    };
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", wall, v(-3.0, -2.5, 0.0), v(3.0, 2.5, 2.85));
    // In a frame of its own that is not the world's.
    let at = if glides { v(0.5, 0.3, 1.0) } else { DVec3::ZERO };
    let board = match glides {
        true => sliding(&mut b, "board", at, at + v(0.1, 0.0, 0.0)),
        false => still(&mut b, "board"),
    };
    b.cuboid(board, "board", white, v(-0.4, -1.2, 2.82) - at, v(1.7, 0.5, 2.84) - at);
    (b, glow)
}

#[test]
fn lamps_in_and_below_a_board_give_the_room_no_more_or_less_than_they_emit() {
    // Below its lower side, in the plane of that, and within; all stick out of it by 2 cm.
    for (height_m, tolerance) in [(2.815, 0.1), (2.815, 0.02), (2.82, 0.1), (2.825, 0.1)] {
        let (mut b, glow) = board_below_a_ceiling(true, false);
        let lamp = b.node("lamp", None, DVec3::ZERO, DQuat::IDENTITY);
        let corners = [(-0.38, 0.08), (-0.18, 0.08), (-0.18, 0.52), (-0.38, 0.52)];
        b.polygon(lamp, "lamp", glow, &corners.map(|(x, y)| v(x, y, height_m)));
        let off = made(b.build().unwrap(), tolerance);
        println!("at {height_m} m, {tolerance}: {off:.5}");
        assert!(off.abs() <= ASTRAY_MAX, "at {height_m} m, {tolerance}: {off}");
    }
}

#[test]
fn a_board_that_glides_around_a_lamp_hides_none_of_its_light() {
    let (mut b, glow) = board_below_a_ceiling(false, true);
    let lamp = still(&mut b, "lamp");
    b.cuboid(lamp, "lamp", glow, v(0.3, -0.5, 2.78), v(0.8, -0.3, 2.845));
    let off = made(b.build().unwrap(), 0.1);
    println!("gliding board: {off:.5}");
    assert!(off.abs() <= 0.01, "{off}");
}
