//! Panels in rows and through each other.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use relume_core::session::Sensor;
use relume_judge::Random;

use crate::outside::case::{Case, chance, log_between, v, whole};
use crate::outside::near::room;

/// An egg-crate louvre of blades that cross, under a lamp or in the dark.
pub(crate) fn louvre(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let (nx, ny) = (whole(r, 2, 6), whole(r, 2, 6));
    let cell = r.between(0.08, 0.25);
    let deep = cell * r.between(0.3, 1.5);
    let z = if chance(r, 0.5) { size.z - deep - log_between(r, 0.05, 0.4) } else { size.z / 2.0 };
    let (lo, long) = (v(0.5, 0.5, z), v(cell * (nx - 1) as f64, cell * (ny - 1) as f64, deep));
    // Blades end at the last they cross, or go on a little.
    let over = if chance(r, 0.5) { 0.0 } else { r.between(0.1, 0.5) * cell };
    for k in 0..nx {
        let x = lo.x + k as f64 * cell;
        let y = [lo.y - over, lo.y + long.y + over];
        let corners = [v(x, y[0], z), v(x, y[1], z), v(x, y[1], z + deep), v(x, y[0], z + deep)];
        case.panel(&format!("ex{k}"), &corners, true);
    }
    for k in 0..ny {
        let y = lo.y + k as f64 * cell;
        let x = [lo.x - over, lo.x + long.x + over];
        let corners = [v(x[0], y, z), v(x[1], y, z), v(x[1], y, z + deep), v(x[0], y, z + deep)];
        case.panel(&format!("ey{k}"), &corners, true);
    }
    case.look_at(&["ex0", "ey0 back", "ex1", "r-z1"]);
    if chance(r, 0.35) {
        let up = lo.z + deep + 0.5 * (size.z - lo.z - deep);
        let (a, b) = (lo, lo + long);
        let lamp = case.panel(
            "lamp",
            &[v(a.x, a.y, up), v(a.x, b.y, up), v(b.x, b.y, up), v(b.x, a.y, up)],
            true,
        );
        (lamp.exitance, lamp.reflectance) = (100.0, 0.0);
        let middle = (a + b) / 2.0;
        for at in [middle.with_z(0.0), v(0.8 * size.x, 0.2 * size.y, 0.0)] {
            case.sensors.push(Sensor { at, normal: DVec3::Z });
        }
        (case.lit, case.factors) = (true, false);
    }
    case.story = format!("louvre {nx} + {ny}, cells of {cell:.3}, {deep:.3} deep, over {over:.3}");
}

/// Close blades in a row, upright or tilted.
pub(crate) fn blades(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let (count, long, deep) = (whole(r, 3, 9), r.between(0.5, 1.8), r.between(0.04, 0.2));
    let apart = deep * log_between(r, 0.1, 1.0);
    let tilt = if chance(r, 0.5) { 0.0 } else { r.between(-1.0, 1.0) };
    let base = v(0.25 * size.x, 0.15 * size.y, r.between(0.02, 0.6) * size.z);
    let across = DQuat::from_rotation_y(tilt) * DVec3::Z * deep;
    for k in 0..count {
        let a = base + DVec3::X * (k as f64 * apart);
        let b = a + DVec3::Y * long;
        case.panel(&format!("b{k}"), &[a, b, b + across, a + across], true);
    }
    case.look_at(&["b0", "b1", "b1 back", "r-z0"]);
    case.story =
        format!("{count} blades {long:.3} x {deep:.3}, {apart:.4} apart, tilted {tilt:.2}");
}

/// Large triangles and panels through each other, with two sides or one.
pub(crate) fn crossing(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let count = whole(r, 2, 4);
    let mut words = String::new();
    for k in 0..count {
        let turn = match whole(r, 0, 2) {
            0 => DQuat::IDENTITY,
            1 => DQuat::from_rotation_y(TAU / 4.0),
            _ => r.rotation(),
        };
        let corners: Vec<DVec3> = if chance(r, 0.5) {
            (0..3).map(|c| f64::from(c) * TAU / 3.0).map(|a| v(a.cos(), a.sin(), 0.0)).collect()
        } else {
            let (a, b) = (r.between(0.4, 0.9), r.between(0.4, 0.9));
            vec![v(-a, -b, 0.), v(a, -b, 0.), v(a, b, 0.), v(-a, b, 0.)]
        };
        let at = size * r.point(DVec3::splat(0.35), DVec3::splat(0.65));
        let far = corners.iter().map(|&c| turn * c).collect::<Vec<DVec3>>();
        // As large as the room allows, but for gaps of a millimetre to a quarter.
        let room_for = |c: &DVec3| {
            let each = |axis: usize| match c[axis] {
                x if x > 1e-9 => (size[axis] - at[axis]) / x,
                x if x < -1e-9 => at[axis] / -x,
                _ => f64::INFINITY,
            };
            (0..3).map(each).fold(f64::INFINITY, f64::min)
        };
        let most = far.iter().map(room_for).fold(f64::INFINITY, f64::min);
        let scale = most * (1.0 - log_between(r, 1e-3, 0.3));
        let placed: Vec<DVec3> = far.iter().map(|&c| at + c * scale).collect();
        let both = chance(r, 0.75);
        case.panel(&format!("p{k}"), &placed, both);
        case.sealed &= both;
        words += &format!(
            " {} of {} sides;",
            if corners.len() == 3 { "triangle" } else { "panel" },
            1 + u8::from(both)
        );
    }
    case.look_at(&["p0", "p1", "r-x0", "r-z0"]);
    case.story = format!("room {size:.2?}:{words}");
}
