//! Scenes without the inner sides of closed shells in which it is dark: what is left is lit as before, and
//! equals the same scene of single-sided polygons bit for bit.

use std::sync::Arc;

use crate::common::{at_tolerance, sliding, still, turn, v};
use glam::DVec3;
use relume_core::scene::{MaterialId, Scene, SceneBuilder};
use relume_core::session::{Sensor, Session};

/// A closed single-sided room with a lamp, a crate that slides and turns, and a prism on the floor.
fn room(two_sided: bool) -> Scene {
    let mut b = SceneBuilder::new("room");
    let wall = b.material("wall", [0.6, 0.5, 0.4], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [30.0, 20.0, 10.0]);
    let make = |b: &mut SceneBuilder, name| -> MaterialId {
        match two_sided {
            true => b.double_sided_material(name, [0.5, 0.3, 0.2], [0.0; 3]),
            false => b.material(name, [0.5, 0.3, 0.2], [0.0; 3]),
        }
    };
    let (card, wood) = (make(&mut b, "card"), make(&mut b, "wood"));
    let node = still(&mut b, "room");
    b.cuboid_inward(node, "room", wall, DVec3::ZERO, DVec3::ONE);
    let down = [v(0.3, 0.98, 0.3), v(0.7, 0.98, 0.3), v(0.7, 0.98, 0.7), v(0.3, 0.98, 0.7)];
    b.polygon(node, "lamp", lamp, &down);
    let node = sliding(&mut b, "crate", v(0.3, 0.55, 0.3), v(0.6, 0.65, 0.5));
    turn(&mut b, node, v(1.0, 2.0, 0.5), 1.3);
    b.cuboid(node, "crate", card, DVec3::splat(-0.1), DVec3::splat(0.1));
    let node = still(&mut b, "prism");
    let base = [v(0.6, 0.0, 0.6), v(0.9, 0.0, 0.6), v(0.75, 0.0, 0.9)];
    let top = base.map(|c| c + DVec3::Y * 0.3);
    b.polygon(node, "prism", wood, &base);
    b.polygon(node, "prism", wood, &[top[0], top[2], top[1]]);
    for k in 0..3 {
        let l = (k + 1) % 3;
        b.polygon(node, "prism", wood, &[base[k], top[k], top[l], base[l]]);
    }
    b.build().unwrap()
}

/// The session after some times, and the last report's hash and counts.
fn solved(scene: Scene, times: &[f64]) -> (Session, (String, u64, u64)) {
    let mut session = Session::new(Arc::new(scene), at_tolerance(0.05)).unwrap();
    let reports: Vec<_> = times.iter().map(|&t| session.step(0, t).unwrap()).collect();
    let last = reports.last().unwrap();
    let counts = (last.hash.clone(), last.links, last.elements);
    (session, counts)
}

#[test]
fn closed_double_sided_bodies_cost_and_give_what_single_sided_ones_do() {
    let (_, single) = solved(room(false), &[0.0, 0.5]);
    let (_, double) = solved(room(true).without_dark_sides(), &[0.0, 0.5]);
    assert_eq!(single, double);
}

#[test]
fn light_outside_of_shells_stays_as_it_is_and_inside_there_is_none() {
    let (whole, _) = solved(room(true), &[0.3]);
    let (left, _) = solved(room(true).without_dark_sides(), &[0.3]);
    let up = |at: DVec3| Sensor { at, normal: DVec3::Y };
    for at in [v(0.3, 1e-4, 0.4), v(0.7, 0.3001, 0.7), v(0.1, 0.5, 0.9), v(0.95, 1e-4, 0.95)] {
        let [a, b] = [&whole, &left].map(|s| s.frame().unwrap().irradiances_at(&[up(at)])[0]);
        for c in 0..3 {
            assert!((a[c] / b[c] - 1.0).abs() < 0.02, "{at}: {a:?} {b:?}");
        }
    }
    // In the prism, looking up, down and aside; in the crate.
    let pose = left.scene().pose(relume_core::scene::BodyId(1), 0.3).unwrap();
    let inside = [v(0.75, 0.1, 0.7), v(0.7, 0.2, 0.65), pose.point(DVec3::splat(0.03))];
    for at in inside {
        for normal in [DVec3::Y, DVec3::NEG_Y, DVec3::X] {
            let sensor = Sensor { at, normal };
            let found = left.frame().unwrap().irradiances_at(&[sensor])[0];
            // To rounding: cracks between shadows of neighbouring faces.
            assert!(found.iter().all(|&e| e < 1e-8), "{sensor:?} {found:?}");
        }
    }
}

/// A closed room of 4 x 2.5 x 3 m of double-sided polygons, wound either way, and what `add` puts in it.
fn thin_room(inward: bool, add: impl Fn(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::new("thin room");
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let node = still(&mut b, "room");
    let make = if inward { SceneBuilder::cuboid_inward } else { SceneBuilder::cuboid };
    make(&mut b, node, "room", thin, DVec3::ZERO, v(4.0, 2.5, 3.0));
    add(&mut b);
    b.build().unwrap()
}

/// The share of what is emitted in a scene without its dark sides that is absorbed there, at some times.
fn absorbed(scene: &Scene, times: &[f64]) -> Vec<f64> {
    let mut session =
        Session::new(Arc::new(scene.without_dark_sides()), at_tolerance(0.05)).unwrap();
    let share = |&time_s: &f64| {
        let energy = session.step(0, time_s).unwrap().energy.unwrap();
        energy.absorbed_w / energy.emitted_w
    };
    times.iter().map(share).collect()
}

/// A lamp in the ceiling of the room and a panel in a wall.
const IN_CEILING: [DVec3; 4] = [
    DVec3::new(1.0, 2.5, 1.0),
    DVec3::new(1.5, 2.5, 1.0),
    DVec3::new(1.5, 2.5, 1.5),
    DVec3::new(1.0, 2.5, 1.5),
];
const IN_WALL: [DVec3; 4] = [
    DVec3::new(0.0, 0.5, 0.5),
    DVec3::new(0.0, 1.5, 0.5),
    DVec3::new(0.0, 1.5, 1.5),
    DVec3::new(0.0, 0.5, 1.5),
];

#[test]
fn a_lamp_flush_in_a_double_sided_room_lights_it() {
    for inward in [false, true] {
        for corners in [IN_CEILING, IN_WALL] {
            let scene = thin_room(inward, |b| {
                let glow = b.material("glow", [0.3; 3], [10.0; 3]);
                let grey = b.material("grey", [0.5; 3], [0.0; 3]);
                let node = still(b, "lamp");
                b.polygon(node, "lamp", glow, &corners);
                let node = sliding(b, "crate", v(2.0, 0.0, 1.0), v(2.5, 0.0, 1.0));
                b.cuboid(node, "crate", grey, DVec3::ZERO, DVec3::splat(0.5));
            });
            let found = absorbed(&scene, &[0.0, 0.5]);
            assert!(found.iter().all(|a| (a - 1.0).abs() < 0.01), "{inward} {corners:?} {found:?}");
        }
    }
}

#[test]
fn a_lamp_that_slides_along_a_double_sided_ceiling_and_a_bulb_in_it_light_the_room() {
    let slides = thin_room(false, |b| {
        let glow = b.material("glow", [0.3; 3], [10.0; 3]);
        let node = sliding(b, "lamp", DVec3::ZERO, v(1.0, 0.0, 0.5));
        b.polygon(node, "lamp", glow, &IN_CEILING);
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let node = still(b, "crate");
        b.cuboid(node, "crate", grey, v(2.0, 0.0, 1.0), v(2.5, 0.5, 1.5));
    });
    let found = absorbed(&slides, &[0.0, 0.5]);
    assert!(found.iter().all(|a| (a - 1.0).abs() < 0.01), "{found:?}");
    let moving_room = {
        let mut b = SceneBuilder::new("a room that moves");
        let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
        let glow = b.material("glow", [0.3; 3], [10.0; 3]);
        let node = sliding(&mut b, "room", DVec3::ZERO, v(1.0, 0.0, 0.5));
        b.cuboid(node, "room", thin, DVec3::ZERO, v(4.0, 2.5, 3.0));
        b.polygon(node, "lamp", glow, &IN_CEILING);
        b.cuboid(node, "crate", thin, v(2.0, 0.0, 1.0), v(2.5, 0.5, 1.5));
        b.build().unwrap()
    };
    let found = absorbed(&moving_room, &[0.0, 0.5]);
    assert!(found.iter().all(|a| (a - 1.0).abs() < 0.01), "{found:?}");
}

#[test]
fn a_lamp_on_a_double_sided_crate_that_looks_away_leaves_it_dark() {
    let scene = thin_room(false, |b| {
        let glow = b.material("glow", [0.3; 3], [10.0; 3]);
        let mut corners = IN_CEILING;
        corners.reverse();
        let node = still(b, "lamp");
        b.polygon(node, "lamp", glow, &corners);
    });
    let found = absorbed(&scene, &[0.0]);
    assert!(found[0].abs() < 1e-6, "{found:?}");
}

#[test]
fn a_lamp_let_into_a_double_sided_ceiling_shines_down_and_one_below_it_does_not_shine_out() {
    for (y, least, most) in [(2.5, 0.25, 0.9), (2.4, 0.99, 1.01)] {
        let scene = thin_room(false, |b| {
            let glow = b.material("glow", [0.3; 3], [10.0; 3]);
            let node = still(b, "lamp");
            b.cuboid(node, "lamp", glow, v(1.0, y, 1.0), v(1.2, y + 0.1, 1.2));
        });
        let found = absorbed(&scene, &[0.0])[0];
        // Let in, the lower face shines into the room, 1/4 of all; the others onto its roof and away.
        assert!((least..most).contains(&found), "{y} {found}");
        let (session, _) = solved(scene.without_dark_sides(), &[0.0]);
        let floor = Sensor { at: v(1.1, 1e-4, 1.1), normal: DVec3::Y };
        assert!(session.frame().unwrap().irradiances_at(&[floor])[0][0] > 0.01);
    }
}
