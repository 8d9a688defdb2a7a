//! What users of other programs reported, rebuilt by its numbers: each with its right value, where that is from, and
//! what is allowed. The names are those of the cases they came as.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use relume_core::session::{Closure, Energy, Grouping, Options, Sensor, Session};
use relume_judge::path::{self, Site};
use relume_judge::rows;

use crate::outside::case::{Case, Mover, cuboid_sides, v};
use crate::outside::verdict::{Table, overlap_is_said};

/// A closed room of 4 x 3 x 2.5 m, `r-x0` to `r-z1`.
fn room() -> Case {
    let mut case = Case::new(0.02);
    case.room(v(4.0, 3.0, 2.5));
    case
}

fn session(case: &Case, tolerance: f64, lit: bool) -> Session {
    let scene = case.scene();
    let scene = if lit { scene } else { Arc::new(scene.without_light()) };
    Session::new(scene, Options { tolerance, ..Options::default() }).unwrap()
}

/// Form factors by surface at time 0.
fn table(case: &Case, tolerance: f64) -> Table {
    let mut session = session(case, tolerance, false);
    session.step(0, 0.0).unwrap();
    table_of(&session)
}

fn table_of(session: &Session) -> Table {
    let grouping = Grouping::by_surface(session.scene());
    Table::new(&grouping.names, &session.frame().unwrap().factors(&grouping).expect("it fits"))
}

/// The factors and rows that are off by more than is allowed.
#[derive(Default)]
struct Misses(Vec<String>);

impl Misses {
    fn near(&mut self, what: &str, found: f64, right: f64, allowed: f64) {
        println!("{what}: {found:.6}, {right:.6} +- {allowed}");
        let off = (found - right).abs();
        // Nor is a number that is not one.
        if off.is_nan() || off > allowed {
            self.0.push(format!("{what}: {found:.6}, not {right:.6} +- {allowed}"));
        }
    }

    fn factor(&mut self, table: &Table, (from, to): (&str, &str), right: f64, allowed: f64) {
        self.near(&format!("{from} -> {to}"), table.factor(from, to), right, allowed);
    }

    /// The rows of some names, or of all, sum to 1.
    fn rows(&mut self, table: &Table, of: Option<&[&str]>, allowed: f64) {
        for name in table.names() {
            if of.is_none_or(|of| of.contains(&name)) {
                self.near(&format!("row of {name}"), 1.0 - table.environment(name), 1.0, allowed);
            }
        }
    }

    fn none(&self) {
        assert!(self.0.is_empty(), "{}", self.0.join("\n"));
    }
}

/// Light at the sensors within a share of what is right.
fn light(case: &Case, right: &[f64], allowed: f64) {
    let mut session = session(case, 0.02, true);
    session.step(0, 0.0).unwrap();
    let mut misses = Misses::default();
    let found = session.frame().unwrap().irradiances_at(&case.world_sensors());
    for (k, (found, &right)) in found.iter().zip(right).enumerate() {
        misses.near(&format!("sensor {k}"), found[0], right, allowed * right);
    }
    misses.none();
}

fn energy(case: &Case) -> Energy {
    let energy = session(case, 0.02, true).step(0, 0.0).unwrap().energy.unwrap();
    println!("{energy:?}");
    energy
}

/// A floor of 4 x 3 m and a strip of 1.6 m along y beside or above it, nothing else.
fn floor_and_strip(strip: [DVec3; 4]) -> Case {
    let mut case = Case::new(0.02);
    case.panel("rz0", &[v(4., 0., 0.), v(4., 3., 0.), v(0., 3., 0.), v(0., 0., 0.)], false);
    case.panel("strip", &strip, false);
    case
}

#[test]
fn f1_strip_stands_on_floor() {
    // OpenFOAM merge request 551. Closed form of rectangles at right angles.
    let case =
        floor_and_strip([v(1.8, 0.7, 0.), v(1.8, 2.3, 0.), v(1.8, 2.3, 0.004), v(1.8, 0.7, 0.004)]);
    let mut misses = Misses::default();
    for tolerance in [0.02, 0.005] {
        misses.factor(&table(&case, tolerance), ("strip", "rz0"), 0.499_357, tolerance);
    }
    misses.none();
}

#[test]
fn f1_strip_faces_floor() {
    // OpenFOAM merge request 551. Closed form of parallel rectangles.
    let mut misses = Misses::default();
    for (width, z, right) in [(0.02, 0.01, 0.999_962), (0.004, 0.002, 0.999_998)] {
        let x = 1.8 + width;
        let case = floor_and_strip([v(1.8, 0.7, z), v(1.8, 2.3, z), v(x, 2.3, z), v(x, 0.7, z)]);
        misses.factor(&table(&case, 0.005), ("strip", "rz0"), right, 0.005);
    }
    misses.none();
}

/// A strip of lamps 5 mm under a ceiling, shining up (Godot 82839).
fn cove() -> Case {
    let mut case = room();
    let z = 2.495;
    let lamp = case.panel(
        "lamp",
        &[v(1.2, 1.5, z), v(2.8, 1.5, z), v(2.8, 1.52, z), v(1.2, 1.52, z)],
        false,
    );
    (lamp.reflectance, lamp.exitance) = (0.0, 100.0 * PI);
    let sensors =
        [(v(2.0, 1.5, 0.0), DVec3::Z), (v(0.5, 0.5, 0.0), DVec3::Z), (v(2.0, 1.2, 2.5), -DVec3::Z)];
    case.sensors = sensors.map(|(at, normal)| Sensor { at, normal }).to_vec();
    case
}

#[test]
fn f1_led_cove_light() {
    // Path tracing, 4e7 paths a sensor, +-1.5 %.
    light(&cove(), &[0.08094, 0.05212, 0.03796], 0.06);
}

#[test]
fn f1_led_cove_energy() {
    // A closed room loses nothing but to the black back of the lamp, 0.4 %.
    let e = energy(&cove());
    assert!(e.escaped_w.abs() <= 0.02 * e.emitted_w, "{e:?}");
    assert!((e.emitted_w - e.absorbed_w - e.escaped_w).abs() <= 0.01 * e.emitted_w, "{e:?}");
}

#[test]
fn f1_pipe_over_floor() {
    // MOOSE 32801 and EnergyPlus CR 8034. Pipe to floor by 2e7 rays, +-1e-4.
    let mut case = room();
    let at = |k: usize, x: f64| {
        let angle = (k % 12) as f64 / 12.0 * TAU;
        v(x, 1.5 + 0.02 * angle.cos(), 0.06 + 0.02 * angle.sin())
    };
    for k in 0..12 {
        case.panel("pipe", &[at(k, 0.5), at(k + 1, 0.5), at(k + 1, 3.5), at(k, 3.5)], false);
    }
    let cap = |x: f64| (0..12).map(|k| at(k, x)).collect::<Vec<DVec3>>();
    let first: Vec<DVec3> = cap(0.5).into_iter().rev().collect();
    case.panel("pipe", &first, false);
    case.panel("pipe", &cap(3.5), false);
    let mut misses = Misses::default();
    for tolerance in [0.02, 0.005] {
        let table = table(&case, tolerance);
        misses.rows(&table, None, tolerance);
        misses.factor(&table, ("pipe", "r-z0"), 0.48476, tolerance + 3e-4);
    }
    misses.none();
}

/// A room with a box.
fn room_with(lo: DVec3, hi: DVec3) -> Case {
    let mut case = room();
    case.cuboid("b", lo, hi, false);
    case
}

#[test]
fn f1_plate_edge() {
    // A variation on uDALES 359.
    let case = room_with(v(1.0, 0.317, 0.0566), v(2.05, 1.683, 0.089));
    let mut misses = Misses::default();
    misses.rows(&table(&case, 0.02), None, 0.02);
    misses.none();
}

#[test]
fn f1_skirting_board() {
    // EnergyPlus CR 7784, 8034: 8 cm high, 1 cm thick, without the hidden faces.
    let mut case = room();
    let start = case.cuboid("sk", v(0.5, 0.0, 0.0), v(3.5, 0.01, 0.08), false).start;
    case.panels.remove(start + 4);
    case.panels.remove(start + 2);
    let mut misses = Misses::default();
    misses.rows(&table(&case, 0.02), Some(&["sk-z1", "sk-y1", "sk-x0", "sk-x1"]), 0.02);
    misses.none();
}

/// An upright panel 0.228 m from a wall and a flat one through it, with gaps all around (uDALES 359).
fn crossing(gaps: [f64; 2]) -> Case {
    let mut case = room();
    let [g, h] = gaps;
    let (y, z) = ([g, 3.0 - g], [g, 2.5 - g]);
    let p =
        [v(0.228, y[0], z[0]), v(0.228, y[1], z[0]), v(0.228, y[1], z[1]), v(0.228, y[0], z[1])];
    case.panel("p", &p, true);
    let (x, y, z) = ([h, 4.0 - h], [h, 3.0 - h], 0.4027);
    let s = [v(x[0], y[0], z), v(x[1], y[0], z), v(x[1], y[1], z), v(x[0], y[1], z)];
    case.panel("s", &s, true);
    case
}

#[test]
fn f2_crossing_panels() {
    let mut misses = Misses::default();
    misses.rows(&table(&crossing([0.05, 0.05]), 0.02), None, 0.02);
    misses.none();
}

#[test]
fn f2_crossing_panels_b() {
    let mut misses = Misses::default();
    misses.rows(&table(&crossing([0.0101, 0.0022]), 0.005), None, 0.01);
    misses.none();
}

/// An egg-crate louvre of 6 + 6 blades, 1 m long, 10 cm deep, 20 cm apart (sparrowpy 35).
fn egg_crate(z: f64) -> Case {
    let mut case = room();
    let (lo, hi) = (z, z + 0.1);
    for k in 0..6 {
        let at = 1.0 + 0.2 * f64::from(k);
        let x = [v(at, 1.0, lo), v(at, 2.0, lo), v(at, 2.0, hi), v(at, 1.0, hi)];
        case.panel(&format!("ex{k}"), &x, true);
        let y = [v(1.0, at, lo), v(2.0, at, lo), v(2.0, at, hi), v(1.0, at, hi)];
        case.panel(&format!("ey{k}"), &y, true);
    }
    case
}

#[test]
fn f2_egg_crate() {
    // Four entries by 2e7 rays, +-4e-5.
    let mut misses = Misses::default();
    for tolerance in [0.02, 0.005] {
        let table = table(&egg_crate(1.2), tolerance);
        misses.rows(&table, None, tolerance);
        for (to, right) in [("ex2", 0.02988), ("ex3", 0.02985), ("ex4", 0.02988), ("ey1", 0.11665)]
        {
            misses.factor(&table, ("ey0 back", to), right, 0.01);
        }
    }
    misses.none();
}

/// A 2 cm device, 1 mm above a table in a hall of 10 m.
fn device_in_a_hall() -> Case {
    let mut case = Case::new(0.02);
    case.room(v(10.0, 10.0, 5.0));
    let z = 4.99;
    let lamp = case.panel("lamp", &[v(1., 1., z), v(1., 2., z), v(2., 2., z), v(2., 1., z)], false);
    (lamp.reflectance, lamp.exitance) = (0.0, 50.0 * PI);
    let table = case.cuboid("table", v(4.5, 4.5, 0.7), v(5.5, 5.5, 0.75), false);
    let sides = case.cuboid("device", v(5.0, 5.0, 0.751), v(5.02, 5.02, 0.771), false);
    case.panels[sides.clone()].iter_mut().for_each(|side| side.reflectance = 0.3);
    case.one_body(table);
    case.one_body(sides);
    let on_table = |x, y| (v(x, y, 0.7501), DVec3::Z);
    let sensors = [
        on_table(5.01, 5.022),
        on_table(5.01, 5.03),
        on_table(5.03, 5.01),
        on_table(5.01, 5.06),
        (v(5.01, 5.0201, 0.755), DVec3::Y),
        (v(5.01, 5.0201, 0.765), DVec3::Y),
    ];
    case.sensors = sensors.map(|(at, normal)| Sensor { at, normal }).to_vec();
    case
}

#[test]
fn light_beside_a_small_device_is_within_the_tolerance() {
    // Path tracing, +-0.15 %.
    let right = [0.12889, 0.45822, 0.45882, 0.78683, 0.20631, 0.25828];
    let case = device_in_a_hall();
    // As found, 1.9, 1.2 and 0.3 %.
    for tolerance in [0.1, 0.02, 0.005] {
        let rms = rms_off(&case, &right, tolerance);
        assert!(rms <= tolerance, "{rms} at {tolerance}");
    }
}

/// RMS of the relative errors of irradiance at a case's sensors.
fn rms_off(case: &Case, right: &[f64], tolerance: f64) -> f64 {
    let mut session = session(case, tolerance, true);
    session.step(0, 0.0).unwrap();
    let found = session.frame().unwrap().irradiances_at(&case.world_sensors());
    let off = |(found, right): (&[f64; 3], &f64)| (found[0] / right - 1.0).powi(2);
    let rms = (found.iter().zip(right).map(off).sum::<f64>() / right.len() as f64).sqrt();
    println!("{rms:.4} at {tolerance}");
    rms
}

/// Three houses in a row, 1.2 m apart, on a plain under a luminous ceiling of 80 m; y is up.
fn lanes_between_houses() -> Case {
    let mut case = Case::new(0.02);
    let square = |y: f64, x: f64, z: f64| [v(-x, y, -z), v(-x, y, z), v(x, y, z), v(x, y, -z)];
    case.panel("ground", &square(0.0, 20.0, 12.0), false);
    for (k, height) in [7.0, 11.0, 9.0].into_iter().enumerate() {
        let x = -9.6 + 7.2 * k as f64;
        for (side, corners) in cuboid_sides(v(x, 0.0, -4.0), v(x + 6.0, height, 4.0)) {
            if side != "y0" {
                case.panel(&format!("house {k} {side}"), &corners, false);
            }
        }
    }
    let mut above = square(30.0, 40.0, 40.0);
    above.reverse();
    let sky = case.panel("sky", &above, false);
    (sky.reflectance, sky.exitance) = (0.0, 3.0 * PI);
    for (x, normal) in [(-3.6, 1.0), (-2.4, -1.0), (3.6, 1.0), (4.8, -1.0)] {
        for (y, z) in [(1.5, 0.7), (4.0, -2.2), (6.2, 2.9)] {
            case.sensors.push(Sensor { at: v(x + 1e-5 * normal, y, z), normal: v(normal, 0., 0.) });
        }
    }
    case
}

#[test]
fn walls_of_narrow_lanes_are_within_the_tolerance() {
    // Path tracing, +-0.18 %.
    let right = [
        0.375_71, 0.692_83, 1.331_3, 0.394_57, 0.785_56, 2.354_6, 0.338_29, 0.580_09, 1.056_0,
        0.334_13, 0.561_38, 0.972_94,
    ];
    let case = lanes_between_houses();
    // As found, 4.9, 3.7 and 1.5 %; 13 and 6.1 % at the last two where no links count as hidden alike.
    for tolerance in [0.1, 0.05, 0.02] {
        let rms = rms_off(&case, &right, tolerance);
        assert!(rms <= tolerance, "{rms} at {tolerance}");
    }
}

/// The louvre under a lamp of 1 m2.
fn lit_egg_crate() -> Case {
    let mut case = egg_crate(2.2);
    let z = 2.35;
    let lamp = case.panel("lamp", &[v(1., 1., z), v(1., 2., z), v(2., 2., z), v(2., 1., z)], false);
    (lamp.reflectance, lamp.exitance) = (0.0, 100.0 * PI);
    let sensors = [
        (v(1.5, 1.5, 0.0), DVec3::Z),
        (v(3.0, 0.5, 0.0), DVec3::Z),
        (v(1.5, 1.3, 2.25), DVec3::Y),
        (v(0.0, 1.5, 1.2), DVec3::X),
    ];
    case.sensors = sensors.map(|(at, normal)| Sensor { at, normal }).to_vec();
    case
}

#[test]
fn f2_egg_crate_light() {
    // Path tracing, 6e6 paths a sensor, +-0.3 %.
    light(&lit_egg_crate(), &[18.83, 6.76, 107.98, 9.722], 0.025);
}

#[test]
fn f2_egg_crate_energy() {
    let e = energy(&lit_egg_crate());
    assert!((e.emitted_w - e.absorbed_w - e.escaped_w).abs() <= 0.01 * e.emitted_w, "{e:?}");
}

#[test]
fn f2_three_blades() {
    // sparrowpy 35: b crosses a and c, c is 5 cm beside a. 6e7 rays, +-1e-5.
    let mut case = Case::new(0.002);
    for (name, y) in [("a", 0.0), ("c", 0.05)] {
        case.panel(name, &[v(0., y, 0.), v(4., y, 0.), v(4., y, 0.1), v(0., y, 0.1)], true);
    }
    case.panel("b", &[v(2.4, 0., 0.), v(2.4, 4., 0.), v(2.4, 4., 0.1), v(2.4, 0., 0.1)], true);
    let table = table(&case, 0.002);
    let mut misses = Misses::default();
    misses.factor(&table, ("a back", "b"), 0.00405, 0.002);
    misses.factor(&table, ("b", "a back"), 0.00405, 0.002);
    misses.none();
}

#[test]
fn f3_narrow_gap_slab() {
    // COMSOL 80681, MOOSE 13918. Closed form: bottom to floor 0.99999.
    let mut misses = Misses::default();
    let slabs = [
        room_with(v(1.0, 0.7, 0.00075), v(2.06, 1.32, 0.08075)),
        room_with(v(1.0, 0.7, 0.0001), v(2.4, 1.9, 0.0801)),
    ];
    for case in slabs {
        let table = table(&case, 0.02);
        misses.rows(&table, None, 0.02);
        misses.factor(&table, ("b-z0", "r-z0"), 1.0, 0.02);
    }
    misses.none();
}

/// A crate of 1 m that stands on the floor (EnergyPlus 8700, 7080).
fn crate_on_floor() -> Case {
    room_with(v(1.0, 1.0, 0.0), v(2.0, 2.0, 1.0))
}

#[test]
fn f4_crate_on_floor_environment() {
    // What is covered and the bottom see each other (1 and 1/12), or nothing; not the environment.
    let table = table(&crate_on_floor(), 0.02);
    let mut see_each_other = Misses::default();
    see_each_other.factor(&table, ("b-z0", "r-z0"), 1.0, 0.02);
    see_each_other.factor(&table, ("r-z0", "b-z0"), 1.0 / 12.0, 0.003);
    see_each_other.near("floor -> environment", table.environment("r-z0"), 0.0, 0.005);
    let mut are_left_out = Misses::default();
    are_left_out.near("bottom -> environment", table.environment("b-z0"), 0.0, 0.005);
    are_left_out.near("floor -> environment", table.environment("r-z0"), 0.0, 0.005);
    let neither = !see_each_other.0.is_empty() && !are_left_out.0.is_empty();
    assert!(!neither, "{}", see_each_other.0.join("\n"));
}

#[test]
fn f4_crate_on_floor_closure() {
    let mut session = session(&crate_on_floor(), 0.02, false);
    session.step(0, 0.0).unwrap();
    let grouping = Grouping::by_surface(session.scene());
    let closed =
        session.frame().unwrap().factors(&grouping).expect("it fits").close(Closure::Reciprocal);
    assert!(closed.is_ok(), "{closed:?}");
}

#[test]
fn f4_landing() {
    // MOOSE 13918: F(bottom to floor) tends to 1, and does not jump to the environment at contact.
    let mut case = room();
    let sides = case.cuboid("c", v(-0.5, -0.5, 0.0), v(0.5, 0.5, 1.0), false);
    case.panels[sides].iter_mut().for_each(|p| p.mover = Some(0));
    let place = [v(2.0, 1.5, 0.12), v(2.0, 1.5, 0.0)];
    case.movers.push(Mover { place, turn: DQuat::IDENTITY });
    let mut session = session(&case, 0.02, false);
    let mut misses = Misses::default();
    for frame in [20, 23, 24_u32] {
        session.step(frame, f64::from(frame) / 24.0).unwrap();
        let table = table_of(&session);
        match frame {
            23 => misses.factor(&table, ("c-z0", "r-z0"), 0.9998, 0.02),
            24 => misses.near("bottom -> environment", table.environment("c-z0"), 0.0, 0.02),
            _ => {}
        }
    }
    misses.none();
}

#[test]
fn f4_rug() {
    // View3D base surfaces, POV-Ray 209: rows sum to 1, or the overlap is said.
    let mut case = room();
    case.panel("rug", &[v(1., 1., 0.), v(3., 1., 0.), v(3., 2., 0.), v(1., 2., 0.)], false);
    let mut misses = Misses::default();
    misses.rows(&table(&case, 0.02), None, 0.02);
    if !overlap_is_said(&case.scene()) {
        misses.none();
    }
}

#[test]
fn the_judge_finds_what_the_reports_say() {
    let mut misses = Misses::default();
    let (world, names) = egg_crate(1.2).world(0.0);
    let of =
        |name: &str| -> Vec<usize> { (0..names.len()).filter(|&k| names[k] == name).collect() };
    let row = rows::row(&world, &of("ey0 back"), 1 << 19, 1);
    for (to, right) in [("ex2", 0.02988), ("ex3", 0.02985), ("ex4", 0.02988), ("ey1", 0.11665)] {
        let (found, error) = row.to(&of(to));
        misses.near(&format!("ey0 back -> {to}"), found, right, 4.0 * error + 1e-4);
    }
    let lit = [
        (cove(), [0.08094, 0.05212, 0.03796].to_vec(), 0.015),
        (lit_egg_crate(), [18.83, 6.76, 107.98, 9.722].to_vec(), 0.003),
    ];
    for (case, right, off) in lit {
        let site = |s: &Sensor| Site::point(s.at, s.normal);
        let sites: Vec<Site> = case.world_sensors().iter().map(site).collect();
        let (world, _) = case.world(0.0);
        let found = path::irradiance_by_particles(&world, &sites, 4000, 3);
        for (k, (found, right)) in found.iter().zip(right).enumerate() {
            let allowed = off * right + 4.0 * found.standard_error[0];
            misses.near(&format!("sensor {k}"), found.irradiance[0], right, allowed);
        }
    }
    misses.none();
}
