//! What nearly touches: slabs at a gap, partitions with slots, shelves, turned boxes, crates that land, rugs, and
//! sensors in gaps.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use relume_core::session::Sensor;
use relume_judge::{Random, exact, rows};

use crate::outside::case::{
    Case, Contact, Known, Mover, chance, cuboid_sides, log_between, v, whole,
};
use crate::outside::{many, thin};

/// The size of some room, m.
pub(crate) fn room(r: &mut Random) -> DVec3 {
    r.point(v(2.5, 2.5, 2.2), v(5.0, 5.0, 3.5))
}

/// Turns a box, moves it to a height above the floor, and to where it lies within a room. The sides' names are
/// `NAME-x0` to `NAME-z1`, in its own axes.
pub(crate) fn box_above(
    case: &mut Case,
    r: &mut Random,
    (name, room): (&str, DVec3),
    half: DVec3,
    turn: DQuat,
    gap: f64,
) -> DVec3 {
    let sides = cuboid_sides(-half, half);
    let reach = |axis: DVec3| (turn.conjugate() * axis).abs().dot(half);
    let reach = v(reach(DVec3::X), reach(DVec3::Y), reach(DVec3::Z));
    let margin = 0.03 * room.min_element();
    let lo = reach + margin;
    let at = r.point(lo, (room - lo).max(lo)).with_z(gap + reach.z);
    for (side, corners) in sides {
        let corners: Vec<DVec3> = corners.iter().map(|&c| at + turn * c).collect();
        case.panel(&format!("{name}-{side}"), &corners, false);
    }
    at
}

/// Two rectangles in parallel planes with nothing else, from a gap that is nearly none to one that is wide; or, as
/// often, at right angles and not quite touching.
pub(crate) fn pair(r: &mut Random, case: &mut Case) {
    let mut range = |long: f64| {
        let start = r.between(-0.6, 0.6);
        [start, start + long * r.between(0.3, 1.0)]
    };
    let (x, y, s, t) = (range(1.0), range(1.5), range(1.0), range(1.5));
    let gap = log_between(r, 1e-5, 0.3);
    let flat = |[x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64| {
        [v(x0, y0, z), v(x1, y0, z), v(x1, y1, z), v(x0, y1, z)]
    };
    let (lower, upper, factor, ratio);
    if chance(r, 0.6) {
        lower = flat(x, y, 0.0);
        upper = {
            let mut q = flat(s, t, gap);
            q.reverse();
            q
        };
        factor = exact::parallel_rectangles([x, y], [s, t], gap);
        ratio = (x[1] - x[0]) * (y[1] - y[0]) / ((s[1] - s[0]) * (t[1] - t[0]));
        case.story = format!("parallel rectangles {gap:.1e} apart");
    } else {
        // The wall stands at x = 0; floor and wall begin a little apart from the edge.
        let other = log_between(r, 1e-5, 0.3);
        let (x, z) = ([gap, gap + x[1] - x[0]], [other, other + s[1] - s[0]]);
        lower = flat(x, y, 0.0);
        upper = [v(0., t[0], z[0]), v(0., t[1], z[0]), v(0., t[1], z[1]), v(0., t[0], z[1])];
        factor = exact::perpendicular_rectangles([x, y], [t, z]);
        ratio = (x[1] - x[0]) * (y[1] - y[0]) / ((z[1] - z[0]) * (t[1] - t[0]));
        case.story = format!("rectangles at right angles {gap:.1e} and {other:.1e} from the edge");
    }
    case.panel("a", &lower, false);
    case.panel("b", &upper, false);
    for (from, to, factor) in [("a", "b", factor), ("b", "a", factor * ratio)] {
        case.known.push(Known { from: from.into(), to: to.into(), factor, error: 1e-7 });
    }
}

/// A slab at a gap from the floor of a closed room, turned a little or not.
pub(crate) fn slab(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let half = v(
        size.x * r.between(0.08, 0.3),
        size.y * r.between(0.08, 0.3),
        size.z * r.between(0.005, 0.06),
    );
    let long = 2.0 * half.x.max(half.y);
    let gap = log_between(r, 1e-5, 0.3) * long;
    let mut turn = DQuat::IDENTITY;
    if chance(r, 0.5) {
        turn = DQuat::from_rotation_z(r.between(0.0, TAU));
    }
    let mut tilt = 0.0;
    if chance(r, 0.33) {
        tilt = (gap / long).min(0.2) * r.between(0.2, 2.0);
        let about = r.between(0.0, TAU);
        turn = DQuat::from_axis_angle(v(about.cos(), about.sin(), 0.0), tilt) * turn;
    }
    box_above(case, r, ("b", size), half, turn, gap);
    case.look_at(&["b-z0", "b-x0", "b-z1", "r-z0"]);
    case.story = format!("slab {:.3?} at {gap:.2e} m, tilted {tilt:.1e}", half * 2.0);
}

/// Double-sided partitions parallel to a wall, with a slot or none along each edge.
pub(crate) fn partitions(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let mut x = 0.0;
    let mut words = String::new();
    for k in 0..whole(r, 1, 3) {
        x += log_between(r, 0.01, 0.6);
        let mut slot = || if chance(r, 0.3) { 0.0 } else { log_between(r, 1e-3, 0.3) };
        let [y0, y1, z0, z1] = [slot(), slot(), slot(), slot()];
        let (y1, z1) = (size.y - y1, size.z - z1);
        let corners = [v(x, y0, z0), v(x, y1, z0), v(x, y1, z1), v(x, y0, z1)];
        case.panel(&format!("p{k}"), &corners, true);
        words += &format!(" {x:.3} m: y {y0:.4}..{y1:.4}, z {z0:.4}..{z1:.4};");
    }
    case.look_at(&["p0", "p0 back", "r-x0", "r-z0"]);
    case.story = format!("room {size:.3?}, partitions at{words}");
}

/// Shelves from a wall, and fins between them, that share edges with walls and each other.
pub(crate) fn shelves(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let depth = r.between(0.15, 0.8);
    let (y0, y1) =
        if chance(r, 0.5) { (0.0, size.y) } else { (0.2 * size.y, r.between(0.5, 1.0) * size.y) };
    let (mut z, shelves) = (0.0, whole(r, 1, 3));
    for k in 0..shelves {
        let below = z;
        z += log_between(r, 0.03, 0.6);
        let corners = [v(0., y0, z), v(depth, y0, z), v(depth, y1, z), v(0., y1, z)];
        case.panel(&format!("s{k}"), &corners, true);
        if chance(r, 0.6) {
            let y = y0 + (y1 - y0) * r.between(0.1, 0.9);
            let deep = if chance(r, 0.5) { depth } else { depth * r.between(0.3, 1.5) };
            let corners = [v(0., y, below), v(deep, y, below), v(deep, y, z), v(0., y, z)];
            case.panel(&format!("f{k}"), &corners, true);
        }
    }
    case.look_at(&["s0", "s0 back", "r-x0", "r-z0"]);
    case.story =
        format!("room {size:.3?}, {shelves} shelves {depth:.3} deep, the highest at {z:.3} m");
}

/// Turned boxes side by side: the gap is that between two planes that part them.
pub(crate) fn boxes(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let mut placed: Vec<Vec<DVec3>> = Vec::new();
    let mut words = String::new();
    for k in 0..whole(r, 2, 4) {
        let half = r.point(DVec3::splat(0.06), DVec3::splat(0.3));
        let turn = r.rotation();
        let corners: Vec<DVec3> =
            (0..8).map(|b| turn * (half * v(sign(b), sign(b >> 1), sign(b >> 2)))).collect();
        // Beside the one before, along a direction; anywhere where that leaves the room.
        let mut at = size / 2.0;
        for _ in 0..100 {
            let gap = log_between(r, 1e-4, 0.3);
            let n = r.rotation() * DVec3::X;
            at = match placed.last() {
                None => r.point(size * 0.3, size * 0.7),
                Some(last) => {
                    let ahead = last.iter().map(|c| c.dot(n)).fold(f64::NEG_INFINITY, f64::max);
                    let behind = corners.iter().map(|c| c.dot(n)).fold(f64::INFINITY, f64::min);
                    let middle = last.iter().sum::<DVec3>() / 8.0;
                    let aside =
                        (r.point(DVec3::splat(-0.1), DVec3::splat(0.1))).reject_from_normalized(n);
                    let at = middle + aside;
                    at + n * (ahead + gap - behind - at.dot(n))
                }
            };
            let inside = |c: &DVec3| {
                let p = *c + at;
                p.cmpgt(DVec3::splat(1e-3)).all() && p.cmplt(size - 1e-3).all()
            };
            let apart = |other: &Vec<DVec3>| {
                let middle = other.iter().sum::<DVec3>() / 8.0;
                let reach =
                    |c: &[DVec3], m: DVec3| c.iter().map(|p| p.distance(m)).fold(0.0, f64::max);
                middle.distance(at) > reach(other, middle) + reach(&corners, DVec3::ZERO)
            };
            let others = placed.len().saturating_sub(1);
            if corners.iter().all(inside) && placed[..others].iter().all(apart) {
                words += &format!(" gap {gap:.1e}");
                break;
            }
        }
        placed.push(corners.iter().map(|&c| c + at).collect());
        for (side, corners) in cuboid_sides(-half, half) {
            let corners: Vec<DVec3> = corners.iter().map(|&c| at + turn * c).collect();
            case.panel(&format!("b{k}-{side}"), &corners, false);
        }
    }
    // Faces may run into each other where no place was found: the judge sees that as well.
    case.sealed = false;
    case.look_at(&["b0-x0", "b0-y1", "b1-x1", "b1-z0"]);
    case.story = format!("{} boxes{words}", placed.len());
}

fn sign(bit: usize) -> f64 {
    if bit & 1 == 1 { 1.0 } else { -1.0 }
}

/// A crate that stands on the floor or a little above it.
pub(crate) fn standing(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let half = r.point(DVec3::splat(0.08), v(0.6, 0.6, 0.5));
    let gap =
        if chance(r, 0.5) { 0.0 } else { log_between(r, 1e-6, 0.1) * 2.0 * half.min_element() };
    let turn =
        if chance(r, 0.5) { DQuat::IDENTITY } else { DQuat::from_rotation_z(r.between(0.0, PI)) };
    box_above(case, r, ("c", size), half, turn, gap);
    if gap == 0.0 {
        case.contact = Some(contact(half, size, 0.0));
    } else {
        let bottom = [[-half.x, half.x], [-half.y, half.y]];
        let factor = exact::parallel_rectangles(bottom, [[-9e3, 9e3], [-9e3, 9e3]], gap);
        // The floor ends where the room does, beyond what a bottom so near to it sees.
        let error = 2.0 * gap.powi(2) / half.min_element().powi(2) + 1e-6;
        case.known.push(Known { from: "c-z0".into(), to: "r-z0".into(), factor, error });
    }
    case.look_at(&["c-x0", "c-y1", "c-z1", "c-z0", "r-z0", "r-z1"]);
    case.story = format!("crate {:.3?} at {gap:.1e} m", half * 2.0);
}

fn contact(half: DVec3, size: DVec3, since_s: f64) -> Contact {
    let share = 4.0 * half.x * half.y / (size.x * size.y);
    Contact { bottom: "c-z0".into(), floor: "r-z0".into(), share, since_s }
}

/// A crate that comes down onto the floor and stays.
pub(crate) fn landing(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let half = r.point(DVec3::splat(0.1), v(0.6, 0.6, 0.5));
    let margin = half + 0.15 * DVec3::ONE;
    let at = r.point(margin, size - margin);
    let high = log_between(r, 0.01, 0.5);
    case.movers.push(Mover { place: [at.with_z(high), at.with_z(0.0)], turn: DQuat::IDENTITY });
    let sides = case.cuboid("c", v(-half.x, -half.y, 0.0), v(half.x, half.y, 2.0 * half.z), false);
    case.panels[sides].iter_mut().for_each(|p| p.mover = Some(0));
    case.contact = Some(contact(half, size, 1.0));
    case.times_s = vec![0.5, 0.97, 0.9995, 1.0, 1.0 + 1.0 / 24.0];
    case.look_at(&["c-z0", "c-x0", "r-z1"]);
    case.story = format!("crate {:.3?} from {high:.3} m", half * 2.0);
}

/// A rug in the plane of the floor, or just above it.
pub(crate) fn rug(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let z = if chance(r, 0.5) { 0.0 } else { log_between(r, 1e-6, 1e-2) };
    let both = z > 0.0 && chance(r, 0.5);
    let lo = r.point(size * 0.05, size * 0.4);
    let hi = r.point(size * 0.5, size * 0.95);
    let corners = [v(lo.x, lo.y, z), v(hi.x, lo.y, z), v(hi.x, hi.y, z), v(lo.x, hi.y, z)];
    case.panel("rug", &corners, both);
    case.may_overlap = z == 0.0;
    case.sealed = z == 0.0 || both;
    if z > 0.0 {
        case.look_at(&["rug", "r-z0", "r-z1"]);
    }
    case.story =
        format!("rug {z:.1e} m above the floor, {} sides", if both { "two" } else { "one" });
}

/// A sensor between two plates, lit by the walls of a closed room.
pub(crate) fn sensor_in_gap(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    case.panels[whole(r, 0, 3)].exitance = 10.0;
    if chance(r, 0.5) {
        case.panels[5].exitance = 4.0;
    }
    let half =
        v(size.x * r.between(0.1, 0.25), size.y * r.between(0.1, 0.25), r.between(0.005, 0.03));
    let gap = log_between(r, 2e-3, 0.1) * 2.0 * half.max_element();
    let at = size / 2.0;
    case.cuboid("lower", at - half, at + half, false);
    let up = DVec3::Z * (gap + 2.0 * half.z);
    case.cuboid("upper", at - half + up, at + half + up, false);
    for _ in 0..2 {
        let most = half.x.min(half.y);
        let deep = (log_between(r, 0.3, 8.0) * gap).min(most);
        let along = r.between(-0.8, 0.8) * half.y;
        let height = if chance(r, 0.5) { 0.0 } else { r.between(0.05, 0.6) * gap };
        let normal = if chance(r, 0.7) { DVec3::Z } else { DVec3::NEG_Z };
        let height = if normal.z < 0.0 { gap - height } else { height };
        let p = at + v(half.x - deep, along, half.z + height);
        case.sensors.push(Sensor { at: p, normal });
    }
    (case.lit, case.factors) = (true, false);
    case.story = format!("plates {:.3?} {gap:.4} m apart", half * 2.0);
}

/// A small device on (or just above) a table in a hall: light beside it and on its sides.
pub(crate) fn device(r: &mut Random, case: &mut Case) {
    let size = r.point(v(6.0, 6.0, 3.0), v(12.0, 12.0, 6.0));
    case.room(size);
    let z = size.z - 0.01;
    let at = r.point(size * 0.1, size * 0.3);
    let [a, b] = [at, at + r.between(0.5, 1.5)];
    let lamp = [v(a.x, a.y, z), v(a.x, b.y, z), v(b.x, b.y, z), v(b.x, a.y, z)];
    let lamp = case.panel("lamp", &lamp, false);
    (lamp.exitance, lamp.reflectance) = (150.0, 0.0);
    let table = v(size.x * 0.45, size.y * 0.45, 0.7);
    let top = case.cuboid("table", table, table + v(1.0, 1.0, 0.05), false);
    case.one_body(top);
    let half = DVec3::splat(log_between(r, 0.005, 0.05)) * r.point(DVec3::splat(0.6), DVec3::ONE);
    let gap = if chance(r, 0.5) { 0.0 } else { log_between(r, 0.01, 0.2) * half.z };
    let middle = table + v(0.5, 0.5, 0.05 + gap + half.z);
    let sides = case.cuboid("device", middle - half, middle + half, false);
    case.panels[sides.clone()].iter_mut().for_each(|p| p.reflectance = 0.3);
    case.one_body(sides);
    for _ in 0..2 {
        let beside = log_between(r, 0.05, 2.0) * half.x;
        let at =
            v(middle.x + half.x + beside, middle.y + r.between(-0.8, 0.8) * half.y, table.z + 0.05);
        case.sensors.push(Sensor { at, normal: DVec3::Z });
    }
    let height = r.between(-0.9, 0.9) * half.z;
    case.sensors.push(Sensor { at: middle + v(half.x, 0.0, height), normal: DVec3::X });
    (case.lit, case.factors, case.sealed) = (true, false, false);
    case.story = format!("device {:.4?} at {gap:.5} m in a hall of {size:.1?}", half * 2.0);
}

/// A scene of another kind in which every surface emits and reflects alike, without a way out: what arrives is the
/// same everywhere, in the narrowest gap too.
pub(crate) fn furnace(r: &mut Random, case: &mut Case) {
    let draws =
        [slab, partitions, shelves, boxes, standing, many::blades, many::crossing, thin::pipe];
    draws[whole(r, 0, draws.len() - 1)](r, case);
    for p in &mut case.panels {
        (p.reflectance, p.exitance) = (0.5, 1.0);
        // Black backs in view would make it darker.
        p.both_sides |= p.name.starts_with('p') && p.name != "pipe";
    }
    let (world, _) = case.world(0.0);
    let loses = |k: usize| rows::row(&world, &[k], 1024, 6).lost > 0.0;
    let pierced = case.contact.is_none() && (0..world.polygons().len()).any(loses);
    for _ in 0..if pierced { 0 } else { 200 } {
        let k = whole(r, 0, world.polygons().len() - 1);
        let corners = &world.polygons()[k].corners;
        let weights: Vec<f64> = corners.iter().map(|_| -r.between(1e-9, 1.0).ln()).collect();
        let sum: f64 = weights.iter().sum();
        let at: DVec3 = corners.iter().zip(&weights).map(|(&c, w)| c * (w / sum)).sum();
        let normal = world.normal(k);
        let Some(hit) = world.first_hit(at, normal, Some(k)) else { continue };
        let lift = [0.0, 0.1, 0.5][whole(r, 0, 2)] * hit.distance;
        let at = at + normal * lift;
        // Not where it looks onto black backs: under a crate, or inside another box.
        let row = rows::row_of_point(&world, at + normal * (1e-3 * hit.distance), normal, 4096, 5);
        if row.lost == 0.0 && case.sensors.len() < 6 {
            case.sensors.push(Sensor { at, normal });
        }
    }
    case.sealed &= case.contact.is_none();
    (case.lit, case.factors, case.irradiance) = (true, false, Some(2.0));
    case.story = format!("furnace: {}", case.story);
}
