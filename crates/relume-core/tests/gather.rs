//! Irradiance gathered at points: what hides a source, whatever its shape, and in which order.

// Reference values may use the platform's functions: nothing that the engine decides rests on them.
#![allow(clippy::disallowed_methods)]

use crate::common::{at_tolerance, facing_up, flipped, shipped, solved, still, v};
use glam::DVec3;
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{Sensor, Session};

/// A ceiling that glows with 1 W/m2 at height 2 over [-1, 1] x [-1, 1], and what `fill` adds.
fn under_a_ceiling(fill: impl Fn(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::new("ceiling");
    let glow = b.material("glow", [0.0; 3], [1.0; 3]);
    let node = still(&mut b, "ceiling");
    b.polygon(node, "ceiling", glow, &flipped(facing_up([-1.0, 1.0], [-1.0, 1.0], 2.0)));
    fill(&mut b);
    b.build().unwrap()
}

fn session(fill: impl Fn(&mut SceneBuilder)) -> Session {
    solved(under_a_ceiling(fill), at_tolerance(0.05)).0
}

/// What arrives at the origin from above.
fn at_the_origin(fill: impl Fn(&mut SceneBuilder)) -> f64 {
    session(fill).frame().unwrap().irradiance_at(DVec3::ZERO, DVec3::Z)[0]
}

/// Corners of a regular polygon about the axis at a height.
fn disc(corners: usize, radius: f64, z: f64) -> Vec<DVec3> {
    let angle = |k: usize| k as f64 * std::f64::consts::TAU / corners as f64;
    (0..corners).map(|k| v(radius * angle(k).cos(), radius * angle(k).sin(), z)).collect()
}

fn add(b: &mut SceneBuilder, name: &str, polygons: &[Vec<DVec3>]) {
    let black = b.material("black", [0.0; 3], [0.0; 3]);
    let node = still(b, name);
    for corners in polygons {
        b.polygon(node, name, black, corners);
    }
}

#[test]
fn an_occluder_of_many_corners_hides_all_that_it_covers() {
    let whole = at_the_origin(|b| add(b, "disc", &[disc(40, 0.3, 1.0)]));
    // The same in triangles: each has few corners, together they are more than a dozen.
    let fan = |k: usize, c: &[DVec3]| vec![v(0.0, 0.0, 1.0), c[k], c[(k + 1) % 40]];
    let parts = at_the_origin(|b| {
        let c = disc(40, 0.3, 1.0);
        add(b, "disc", &(0..40).map(|k| fan(k, &c)).collect::<Vec<_>>());
    });
    let open = at_the_origin(|_| ());
    assert!((whole - parts).abs() < 1e-9, "{whole} {parts}");
    // From a point on the axis the disc hides r2 / (r2 + h2), for a polygon times its share of it.
    let share = |c: &[DVec3]| {
        let angle = |p: DVec3, q: DVec3| p.angle_between(q) * p.cross(q).normalize().z;
        (0..40).map(|k| angle(c[k], c[(k + 1) % 40])).sum::<f64>() / std::f64::consts::TAU
    };
    let hidden = share(&disc(40, 0.3, 1.0));
    assert!((open - whole - hidden).abs() < 1e-6, "{open} {whole} {hidden}");
}

#[test]
fn many_small_occluders_hide_as_much_as_they_are_seen_to() {
    // A board of 12 x 12 little squares, every other one there: against one square at a time.
    let square = |k: usize| {
        let (x, y) = ((k % 12) as f64 * 0.1 - 0.6, (k / 12) as f64 * 0.1 - 0.6);
        facing_up([x, x + 0.1], [y, y + 0.1], 1.2).to_vec()
    };
    let there = |k: &usize| (k % 12 + k / 12).is_multiple_of(2);
    let board: Vec<Vec<DVec3>> = (0..144).filter(there).map(square).collect();
    let open = at_the_origin(|_| ());
    let all = at_the_origin(|b| add(b, "board", &board));
    let one = |k: usize| open - at_the_origin(|b| add(b, "square", &board[k..=k]));
    let hidden: f64 = (0..board.len()).map(one).sum();
    assert!((open - all - hidden).abs() < 1e-6, "{open} {all} {hidden}");
}

#[test]
fn a_sheet_that_lies_on_a_lamp_hides_it() {
    // Face up against the ceiling: it lies in the very plane of what it hides.
    let sheet = facing_up([-1.0, 0.0], [-1.0, 1.0], 2.0).to_vec();
    let half = at_the_origin(|b| add(b, "sheet", std::slice::from_ref(&sheet)));
    let open = at_the_origin(|_| ());
    assert!((half - 0.5 * open).abs() < 1e-6, "{half} {open}");
    // The other way round it faces as the lamp does: the smaller of two surfaces in one plane shows, and the lamp counts as a fifth.
    let along = |x: [f64; 2]| {
        at_the_origin(|b| add(b, "sheet", &[flipped(facing_up(x, [-1.0, 1.0], 2.0)).to_vec()]))
    };
    assert!((along([-1.0, 0.0]) - open).abs() < 1e-6, "{} {open}", along([-1.0, 0.0]));
    let hidden = [along([-1.0, -0.7]), along([0.7, 1.0])];
    assert!(hidden[0] < 0.95 * open && (hidden[0] - hidden[1]).abs() < 1e-6, "{hidden:?} {open}");
}

/// The dark side of a door leaf with both sides, turned by 22 degrees, at a place of seven digits that lies 1e-7 m behind it: it
/// read the light of the lit side, 1.1 W/m2.
#[test]
fn a_sensor_on_a_sheet_is_on_its_own_side_whatever_rounding_says() {
    let (session, _) = solved(shipped("door_opens.glb"), at_tolerance(0.1));
    let (at, normal) = (v(4.15868, 1.768994, 1.540503), v(0.9271839, -0.3746066, 0.0).normalize());
    let frame = session.frame().unwrap();
    let (dark, lit) = (frame.irradiance_at(at, normal)[0], frame.irradiance_at(at, -normal)[0]);
    assert!(dark > 0.01 && dark < 0.02 && lit > 1.0, "{dark} {lit}");
}

#[test]
fn many_sensors_are_answered_in_their_order_and_alike_one_by_one() {
    let session = session(|b| add(b, "disc", &[disc(7, 0.3, 1.0)]));
    let sensor = |k: u32| {
        let normal = v(f64::from(k % 3) - 1.0, 0.2, 1.0).normalize();
        Sensor { at: v(f64::from(k) * 0.05 - 1.0, 0.1, 0.0), normal }
    };
    let sensors: Vec<Sensor> = (0..40).map(sensor).collect();
    let all = session.frame().unwrap().irradiances_at(&sensors);
    assert!(all.iter().all(|e| e[0] > 0.0));
    for (s, e) in sensors.iter().zip(all) {
        assert_eq!(session.frame().unwrap().irradiance_at(s.at, s.normal), e);
    }
}
