//! What is long and thin: strips, pipes, plates' edges, skirting boards, and a strip of lamps under a ceiling.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use relume_core::session::Sensor;
use relume_judge::{Random, exact};

use crate::outside::case::{Case, Known, chance, log_between, v, whole};
use crate::outside::near::{box_above, room};

/// A strip over a floor with nothing between: standing, leaning, facing it or lying the other way.
// Over 60 lines: one draw; the order of random numbers is its meaning.
pub(crate) fn strip(r: &mut Random, case: &mut Case) {
    let size = v(r.between(2.0, 5.0), r.between(2.0, 5.0), 0.0);
    let (length, slender) = (r.between(0.5, 1.8), log_between(r, 10.0, 1000.0));
    let width = length / slender;
    case.panel(
        "floor",
        &[v(0., 0., 0.), v(size.x, 0., 0.), v(size.x, size.y, 0.), v(0., size.y, 0.)],
        false,
    );
    let at = r.point(v(0.1, 0.1, 0.0), v(size.x - 0.1 - width, size.y - 0.1 - length, 0.0));
    let lift = if chance(r, 0.4) { 0.0 } else { log_between(r, 1e-2, 30.0) * width };
    let y = [at.y, at.y + length];
    let floor = [[0.0, size.x], [0.0, size.y]];
    let (words, corners, factor) = match whole(r, 0, 2) {
        0 => {
            // Faces +x: it sees the floor beyond it.
            let z = [lift, lift + width];
            let corners = [
                v(at.x, y[0], z[0]),
                v(at.x, y[1], z[0]),
                v(at.x, y[1], z[1]),
                v(at.x, y[0], z[1]),
            ];
            let beyond = [[0.0, size.x - at.x], floor[1]];
            let to_strip = exact::perpendicular_rectangles(beyond, [y, z]);
            ("stands", corners, to_strip * (size.x - at.x) * size.y / (length * width))
        }
        1 => {
            let x = [at.x, at.x + width];
            let lift = lift.max(0.01 * width);
            let corners = [
                v(x[0], y[0], lift),
                v(x[0], y[1], lift),
                v(x[1], y[1], lift),
                v(x[1], y[0], lift),
            ];
            ("faces", corners, exact::parallel_rectangles([x, y], floor, lift))
        }
        _ => {
            // Leans over, its lower edge at the lift; the side that looks down.
            let lean = r.between(0.05, 0.95) * PI / 2.0;
            let up = v(lean.cos(), 0.0, lean.sin()) * width;
            let (a, b) = (v(at.x, y[0], lift), v(at.x, y[1], lift));
            // The part of the floor in front of its plane.
            let behind = at.x - lift / lean.tan();
            let front = [
                v(behind, 0., 0.),
                v(size.x, 0., 0.),
                v(size.x, size.y, 0.),
                v(behind, size.y, 0.),
            ];
            let front = if behind > 0.0 {
                front
            } else {
                [v(0., 0., 0.), front[1], front[2], v(0., size.y, 0.)]
            };
            let corners = [a, b, b + up, a + up];
            ("leans", corners, exact::parallelogram_to_polygon(&corners, &front))
        }
    };
    case.panel("strip", &corners, false);
    let back = factor * length * width / (size.x * size.y);
    for (from, to, factor) in [("strip", "floor", factor), ("floor", "strip", back)] {
        case.known.push(Known { from: from.into(), to: to.into(), factor, error: 1e-7 });
    }
    case.story = format!("strip {length:.3} x {width:.5} m {words} at {lift:.5} m");
}

/// A strip of two sides in a closed room, near its floor or on it, at any angle.
pub(crate) fn strip_in_room(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let length = r.between(0.4, 1.6);
    let width = length / log_between(r, 10.0, 1000.0);
    let lean = match whole(r, 0, 2) {
        0 => PI / 2.0,
        1 => 0.0,
        _ => r.between(0.1, 3.0),
    };
    let lift = if lean != 0.0 && chance(r, 0.4) { 0.0 } else { log_between(r, 0.05, 20.0) * width };
    let turn = if chance(r, 0.5) { 0.0 } else { r.between(0.0, TAU) };
    let along = v(turn.cos(), turn.sin(), 0.0) * length;
    let across =
        v(-turn.sin(), turn.cos(), 0.0) * (lean.cos() * width) + DVec3::Z * (lean.sin() * width);
    let a = v(size.x / 2.0, size.y / 2.0, lift) - along / 2.0;
    case.panel("strip", &[a, a + along, a + along + across, a + across], true);
    case.look_at(&["strip", "strip back", "r-z0"]);
    case.story = format!("strip {length:.3} x {width:.5} m at {lift:.5} m, leaning {lean:.2}");
}

/// A pipe of some facets near the floor of a closed room.
pub(crate) fn pipe(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let sides = whole(r, 3, 24);
    let radius = log_between(r, 0.005, 0.1);
    let gap = log_between(r, 0.05, 5.0) * radius;
    let ends = [0.1 * size.x, r.between(0.5, 0.95) * size.x];
    let (y, z) = (size.y * r.between(0.2, 0.8), gap + radius);
    let at = |k: usize, x: f64| {
        let angle = (k % sides) as f64 / sides as f64 * TAU;
        v(x, y + radius * angle.cos(), z + radius * angle.sin())
    };
    for k in 0..sides {
        let [x0, x1] = ends;
        case.panel("pipe", &[at(k, x0), at(k + 1, x0), at(k + 1, x1), at(k, x1)], false);
    }
    let cap = |x: f64| (0..sides).map(|k| at(k, x)).collect::<Vec<DVec3>>();
    let first: Vec<DVec3> = cap(ends[0]).into_iter().rev().collect();
    case.panel("cap 0", &first, false);
    case.panel("cap 1", &cap(ends[1]), false);
    case.look_at(&["pipe", "cap 0", "r-z0"]);
    case.story = format!("pipe of {sides} facets, radius {radius:.4}, {gap:.4} m above the floor");
}

/// A thin plate above the floor: its edges are the point.
pub(crate) fn edge(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let half =
        v(size.x * r.between(0.1, 0.25), size.y * r.between(0.1, 0.25), log_between(r, 1e-3, 0.03));
    let gap = log_between(r, 0.1, 10.0) * half.z;
    let turn = if chance(r, 0.5) { 0.0 } else { r.between(0.0, TAU) };
    box_above(case, r, ("b", size), half, DQuat::from_rotation_z(turn), gap);
    case.look_at(&["b-x0", "b-y1", "b-z0", "r-z0"]);
    case.story = format!("plate {:.4?} at {gap:.4} m", half * 2.0);
}

/// A skirting board along a wall without the faces that are hidden.
pub(crate) fn skirting(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let (high, thick) = (r.between(0.03, 0.15), log_between(r, 1e-3, 0.03));
    let ends = if chance(r, 0.3) { [0.0, size.x] } else { [0.12 * size.x, 0.9 * size.x] };
    let start = case.cuboid("sk", v(ends[0], 0.0, 0.0), v(ends[1], thick, high), false).start;
    // Against the wall, on the floor, and in the corners.
    case.panels.remove(start + 4);
    case.panels.remove(start + 2);
    if ends[0] == 0.0 {
        case.panels.drain(start..start + 2);
    }
    case.sealed = false;
    case.look_at(&["sk-z1", "sk-y1", "r-y0", "r-z0", "r-x0"]);
    if ends[0] > 0.0 {
        case.look_at(&["sk-x0"]);
    }
    case.story = format!("board {high:.3} high, {thick:.4} thick, x {ends:.3?}");
}

/// A strip of lamps a little under a ceiling, shining up: the light of the room and its energy.
pub(crate) fn cove(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let (length, gap) = (r.between(0.6, 1.8), log_between(r, 1e-3, 0.05));
    let width = length / log_between(r, 10.0, 200.0);
    let (x, y, z) = (size.x / 2.0 - length / 2.0, r.between(0.2, 0.8) * size.y, size.z - gap);
    let housed = chance(r, 0.5);
    let corners =
        [v(x, y, z), v(x + length, y, z), v(x + length, y + width, z), v(x, y + width, z)];
    if housed {
        let lo = v(x, y, z - 0.5 * width);
        let sides = case.cuboid("lamp", lo, corners[2], false);
        let top = &mut case.panels[sides.end - 1];
        (top.exitance, top.reflectance) = (300.0, 0.0);
    } else {
        let lamp = case.panel("lamp", &corners, false);
        (lamp.exitance, lamp.reflectance) = (300.0, 0.0);
        case.sealed = false;
    }
    let sensor = |at: DVec3, normal: DVec3| Sensor { at, normal };
    case.sensors = vec![
        sensor(v(size.x / 2.0, y, 0.0), DVec3::Z),
        sensor(v(0.1 * size.x, 0.2 * size.y, 0.0), DVec3::Z),
        sensor(v(0.0, size.y / 2.0, r.between(0.3, 0.9) * size.z), DVec3::X),
    ];
    (case.lit, case.factors, case.by_particles) = (true, false, true);
    case.story =
        format!("lamp {length:.3} x {width:.4} m, {gap:.4} m under the ceiling, housed: {housed}");
}

/// A small lamp let into a ceiling: a box through it that shows by a little, or not at all.
pub(crate) fn downlight(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let half = log_between(r, 0.005, 0.1);
    let below = if chance(r, 0.2) { 0.0 } else { log_between(r, 0.02, 1.0) * half };
    let middle = r.point(size * 0.3, size * 0.7).with_z(size.z - below + half);
    let lamp = case.cuboid("lamp", middle - half, middle + half, false);
    for side in &mut case.panels[lamp] {
        (side.exitance, side.reflectance) = (1000.0, 0.3);
    }
    if chance(r, 0.5) {
        let x = size.x * r.between(0.4, 0.6);
        let corners =
            [v(x, 0., 0.), v(x, size.y * 0.6, 0.), v(x, size.y * 0.6, size.z), v(x, 0., size.z)];
        case.panel("partition", &corners, true);
    }
    if below > 0.0 {
        case.sensors.push(Sensor { at: middle.with_z(0.0), normal: DVec3::Z });
        let at = v(size.x * 0.15, size.y * 0.9, 0.0);
        case.sensors.push(Sensor { at, normal: DVec3::Z });
    }
    // What is above the ceiling shines into the open.
    (case.lit, case.factors, case.sealed) = (true, false, false);
    case.story = format!("lamp of {:.4} m, {below:.5} m below the ceiling", 2.0 * half);
}
