//! The invariants of elements and pairs on scenes of many kinds, for every oracle and tolerance.

use crate::common;
use crate::common::audit::{Audit, audit};
use crate::common::{
    Random, at_tolerance, facing_up, form_factor_oracle, leaf_area, lit_room, plate_scene, shipped,
    solved, v,
};
use glam::{DQuat, DVec3};
use relume_core::scene::{LightKind, Scene, SceneBuilder};
use relume_core::session::Options;

/// Solves, prints and audits; `row_slack` is as in [`Audit::check`].
fn check(name: &str, scene: &Scene, options: Options, row_slack: f64) -> Audit {
    let (session, report) = solved(scene.clone(), options);
    let a = audit(&session);
    println!(
        "{name}: coverage {:.1e}/{:.1e} areas {:.1e} V {:?} row sums {:.4?} excess {:.1e}, {} links",
        a.coverage, a.local_coverage, a.areas, a.visibility, a.row_sum, a.row_excess, report.links
    );
    a.check(row_slack);
    let counted = session.frame().unwrap().pairs().0.links().count() as u64;
    assert_eq!((report.links, report.pairs.active), (counted, counted));
    a
}

/// A room with boxes, triangles and a hexagon at random places, some of them cutting each other.
fn random_scene(seed: u64, bodies: u32) -> Scene {
    let mut random = Random(seed);
    let mut b = SceneBuilder::new("random");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let both = b.double_sided_material("both", [0.3; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [5.0; 3]);
    let room = common::still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::splat(-1.0), DVec3::ONE);
    for k in 0..bodies {
        let at = random.point(DVec3::splat(-0.6), DVec3::splat(0.6));
        let node = b.node(&format!("body {k}"), None, at, random.rotation());
        let size = random.between(0.05, 0.3);
        match k % 4 {
            0 => b.cuboid(node, "box", grey, DVec3::splat(-size), v(size, 0.5 * size, size)),
            1 => b.polygon(node, "tri", both, &[DVec3::ZERO, v(size, 0.0, 0.0), v(0.0, size, 0.0)]),
            2 => {
                let corner =
                    |k: u32| DQuat::from_rotation_z(f64::from(k) * 1.047) * v(size, 0., 0.);
                b.polygon(node, "hexagon", both, &(0..6).map(corner).collect::<Vec<_>>());
            }
            _ => b.polygon(node, "lamp", lamp, &facing_up([-size, size], [-0.1, 0.1], 0.0)),
        }
    }
    b.build().unwrap()
}

#[test]
fn random_rooms_obey_the_laws() {
    for seed in 0..6 {
        let scene = random_scene(seed, 4 + seed as u32);
        check(&format!("random {seed}"), &scene, at_tolerance(0.1), 0.1);
    }
}

#[test]
fn every_oracle_obeys_the_laws() {
    let scene = random_scene(3, 6);
    for tolerance in [0.5, 0.2, 0.05] {
        check(&format!("tolerance {tolerance}"), &scene, at_tolerance(tolerance), 0.15);
    }
    for epsilon in [0.5, 0.1, 0.03] {
        let options = form_factor_oracle(epsilon, 1e-3);
        check(&format!("form factor {epsilon}"), &scene, options, 0.15);
    }
}

#[test]
fn rows_of_a_plain_closed_room_sum_to_one() {
    let mut b = SceneBuilder::new("room");
    let grey = b.material("grey", [0.5; 3], [1.0; 3]);
    let room = common::still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, v(1.0, 2.0, 0.5));
    let scene = b.build().unwrap();
    for tolerance in [0.1, 0.02] {
        let a = check("plain room", &scene, at_tolerance(tolerance), tolerance);
        // Strips along the edges are off by up to a fifth, whatever the tolerance.
        assert!(a.row_sum[0] > 0.8 && a.row_sum[1] < 1.25, "{a:?}");
        let report = solved(scene.clone(), at_tolerance(tolerance)).1;
        assert!(report.row_sum_error.unwrap().rms < tolerance, "{report:?}");
    }
}

#[test]
fn an_open_scene_loses_light_and_never_makes_any() {
    let floor = facing_up([0.0, 1.0], [0.0, 1.0], 0.0).to_vec();
    let wall = vec![v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)];
    let scene = plate_scene(&[("floor", &[floor]), ("wall", &[wall])]);
    let a = check("open", &scene, Options::default(), 1e-3);
    assert!(a.row_sum[1] < 0.9);
}

#[test]
fn lights_cover_nothing_and_break_nothing() {
    let mut b = SceneBuilder::new("lights");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let room = common::still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, DVec3::ONE);
    b.cuboid(room, "box", grey, DVec3::splat(0.4), DVec3::splat(0.6));
    let node = b.node("lamp", None, v(0.5, 0.5, 0.9), DQuat::IDENTITY);
    b.light("point", node, LightKind::Point, [1.0; 3]);
    b.light("sun", node, LightKind::Directional, [1.0; 3]);
    check("lights", &b.build().unwrap(), at_tolerance(0.1), 0.1);
}

#[test]
fn shipped_scenes_obey_the_laws() {
    check("box room", &shipped("box_room.glb"), at_tolerance(0.1), 0.1);
    check("cornell", &shipped("cornell_moving_box_and_lamp.glb"), at_tolerance(0.1), 0.1);
    check("static", &shipped("room_box_static.glb"), at_tolerance(0.1), 0.1);
    check("satellite", &shipped("satellite_rotating_arrays.glb"), at_tolerance(0.1), 0.1);
    check("lit room", &lit_room(), at_tolerance(0.1), 0.1);
}

#[test]
fn a_plain_room_read_leaf_by_leaf_keeps_every_tolerance() {
    let mut b = SceneBuilder::new("room");
    let grey = b.material("grey", [0.5; 3], [1.0; 3]);
    let room = common::still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, DVec3::ONE);
    let scene = b.build().unwrap();
    for tolerance in [0.05, 0.02, 0.01, 0.005] {
        let (session, report) = solved(scene.clone(), at_tolerance(tolerance));
        let (mut squares, mut area, mut max) = (0.0, 0.0, 0.0_f64);
        for leaf in &session.frame().unwrap().reconstruction().leaves {
            // Exitance 1 and reflectance 1/2: everything receives 2.
            let off = f64::from(leaf.irradiance[0]) / 2.0 - 1.0;
            squares += leaf_area(leaf) * off * off;
            area += leaf_area(leaf);
            max = max.max(off.abs());
        }
        let rms = (squares / area).sqrt();
        let rows = report.row_sum_error.unwrap();
        println!("plain room at {tolerance}: RMS {rms:.1e}, max {max:.1e}; rows of lines {rows:?}");
        assert!(rms < 0.01 * tolerance && max < 0.1 * tolerance, "{tolerance}: {rms} {max}");
    }
}

#[test]
fn what_touches_is_not_seen_through() {
    // The inside of a box that stands on a floor: closed, so its rows sum to one.
    let mut b = SceneBuilder::new("contact");
    let both = b.double_sided_material("both", [0.5; 3], [1.0; 3]);
    let node = common::still(&mut b, "floor");
    b.polygon(node, "floor", both, &facing_up([-1.0, 1.0], [-1.0, 1.0], 0.0));
    let node = common::still(&mut b, "box");
    b.cuboid(node, "box", both, v(-0.3, -0.3, 0.0), v(0.3, 0.3, 0.6));
    let a = audit(&solved(b.build().unwrap(), Options::default()).0);
    println!("contact: row sums {:.3?} excess {:.1e}", a.row_sum, a.row_excess);
    assert!(a.row_excess < 0.01 && a.row_sum[1] < 1.3, "{a:?}");
}
