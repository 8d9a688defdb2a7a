//! Bodies that pierce each other, lie flush or coincide, in motion; and white things in narrow places.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use relume_judge::Random;

use crate::outside::case::{Case, Mover, chance, log_between, v, whole};
use crate::outside::near::room;

/// Double-sided, piercing, flush and coincident bodies in motion under a lamp.
// Over 60 lines: one draw; the order of random numbers is its meaning.
pub(crate) fn motion(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let white = *[0.5, 0.7, 0.9].get(whole(r, 0, 2)).expect("one of three");
    case.panels.iter_mut().for_each(|p| p.reflectance = white);
    let (a, b) = (size * 0.35, size * 0.65);
    let z = size.z - 0.02;
    let lamp = case.panel(
        "lamp",
        &[v(a.x, a.y, z), v(a.x, b.y, z), v(b.x, b.y, z), v(b.x, a.y, z)],
        false,
    );
    lamp.exitance = 10.0;
    let mut words = String::new();
    let count = whole(r, 2, 3);
    for k in 0..count {
        let mut place = [(); 2].map(|()| size * r.point(DVec3::splat(0.3), DVec3::splat(0.7)));
        let half = r.point(DVec3::splat(0.15), DVec3::splat(0.6));
        let mut turn = DQuat::IDENTITY;
        let both = chance(r, 0.7);
        let start = case.panels.len();
        let name = format!("m{k}");
        let flat = [
            v(-half.x, -half.y, 0.),
            v(half.x, -half.y, 0.),
            v(half.x, half.y, 0.),
            v(-half.x, half.y, 0.),
        ];
        let word = match whole(r, 0, 4) {
            0 => {
                if chance(r, 0.5) {
                    turn =
                        DQuat::from_axis_angle(r.rotation() * DVec3::X, r.between(0.0, TAU / 2.0));
                }
                case.cuboid(&name, -half, half, false);
                "box"
            }
            1 => {
                if chance(r, 0.5) {
                    turn = DQuat::from_rotation_x(r.between(0.0, TAU / 4.0));
                }
                case.panel(&name, &flat, both);
                "panel"
            }
            2 => {
                // Flush with the floor or a wall, sliding in its plane.
                place = place.map(|p| p.with_z(0.0));
                case.panel(&name, &flat, both);
                "flush panel"
            }
            3 => {
                // Stands on the floor, its bottom in the plane.
                place = place.map(|p| p.with_z(half.z));
                case.cuboid(&name, -half, half, false);
                "standing box"
            }
            _ => {
                // Twice the same, or one that shares a part of the other's plane.
                let shift =
                    if chance(r, 0.5) { DVec3::ZERO } else { v(0.3 * half.x, 0.2 * half.y, 0.0) };
                case.panel(&name, &flat, both);
                case.panel(&format!("{name} again"), &flat.map(|c| c + shift), both);
                "panel twice"
            }
        };
        if chance(r, 0.3) {
            place[1] = place[0];
        }
        for p in &mut case.panels[start..] {
            (p.mover, p.reflectance) = (Some(k), white);
            p.both_sides |= both;
        }
        case.movers.push(Mover { place, turn });
        words += &format!(" {word} of {} sides,", 1 + u8::from(both));
    }
    case.times_s = vec![0.0, 0.21, 0.4, 0.43, 0.9, 0.4];
    (case.lit, case.factors, case.sealed) = (true, false, false);
    case.cold = true;
    case.story = format!("reflectance {white}:{words}");
}

/// A white closet with drawers, all in narrow gaps, in a white room.
pub(crate) fn closet(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let (z, a, b) = (size.z - 0.05, size * 0.4, size * 0.6);
    let lamp = case.panel(
        "lamp",
        &[v(a.x, a.y, z), v(a.x, b.y, z), v(b.x, b.y, z), v(b.x, a.y, z)],
        false,
    );
    lamp.exitance = 20.0;
    let wide = v(r.between(0.4, 0.9), r.between(0.3, 0.6), r.between(0.5, 1.6));
    let lo = v(0.3, 0.3, 0.0);
    let hi = lo + wide;
    // The shell is open to +x, where the drawers' fronts close it but for gaps.
    let shell = [
        [v(lo.x, lo.y, lo.z), v(hi.x, lo.y, lo.z), v(hi.x, lo.y, hi.z), v(lo.x, lo.y, hi.z)],
        [v(lo.x, hi.y, lo.z), v(hi.x, hi.y, lo.z), v(hi.x, hi.y, hi.z), v(lo.x, hi.y, hi.z)],
        [v(lo.x, lo.y, hi.z), v(hi.x, lo.y, hi.z), v(hi.x, hi.y, hi.z), v(lo.x, hi.y, hi.z)],
        [v(lo.x, lo.y, lo.z), v(lo.x, hi.y, lo.z), v(lo.x, hi.y, hi.z), v(lo.x, lo.y, hi.z)],
    ];
    for (k, side) in shell.iter().enumerate() {
        case.panel(&format!("shell {k}"), side, true);
    }
    let (drawers, gap) = (whole(r, 1, 3), log_between(r, 1e-3, 2e-2));
    let each = wide.z / drawers as f64;
    for k in 0..drawers {
        let a = v(lo.x + gap, lo.y + gap, lo.z + k as f64 * each + gap);
        let b = v(hi.x, hi.y - gap, lo.z + (k + 1) as f64 * each - gap);
        if chance(r, 0.5) {
            case.cuboid(&format!("drawer {k}"), a, b, false);
        } else {
            case.panel(
                &format!("front {k}"),
                &[v(b.x, a.y, a.z), v(b.x, b.y, a.z), b, v(b.x, a.y, b.z)],
                true,
            );
        }
    }
    let white = if chance(r, 0.5) { 0.98 } else { 0.9 };
    case.panels.iter_mut().filter(|p| p.name != "lamp").for_each(|p| p.reflectance = white);
    (case.lit, case.factors, case.sealed) = (true, false, false);
    case.story =
        format!("closet {wide:.3?} with {drawers} drawers, gaps of {gap:.4}, reflectance {white}");
}

/// A white table whose legs go through its top, and a bar or two through that.
pub(crate) fn table(r: &mut Random, case: &mut Case) {
    let size = room(r);
    case.room(size);
    let (z, a, b) = (size.z - 0.05, size * 0.4, size * 0.6);
    let lamp = [v(a.x, a.y, z), v(a.x, b.y, z), v(b.x, b.y, z), v(b.x, a.y, z)];
    case.panel("lamp", &lamp, false).exitance = 20.0;
    let both = chance(r, 0.7);
    let start = case.panels.len();
    let lo = v(0.8, 0.8, r.between(0.4, 0.9));
    let hi = lo + v(r.between(0.6, 1.4), r.between(0.5, 1.0), log_between(r, 0.01, 0.08));
    case.cuboid("top", lo, hi, false);
    // Flush with the top, or through it.
    let end = hi.z + if chance(r, 0.25) { 0.0 } else { log_between(r, 1e-3, 0.2) };
    let (thick, inset) = (r.between(0.03, 0.08), r.between(-0.02, 0.1));
    for k in 0..4_usize {
        let x = if k & 1 == 0 { lo.x + inset } else { hi.x - inset - thick };
        let y = if k & 2 == 0 { lo.y + inset } else { hi.y - inset - thick };
        case.cuboid(&format!("leg {k}"), v(x, y, 0.0), v(x + thick, y + thick, end), false);
    }
    if chance(r, 0.5) {
        let (y, z) = ((lo.y + hi.y) / 2.0, r.between(0.2, 1.0));
        let bar = [v(lo.x - 0.2, y, z), v(hi.x + 0.2, y + 0.04, z + 0.05)];
        case.cuboid("bar", bar[0], bar[1], false);
    }
    let white = if chance(r, 0.5) { 0.98 } else { 0.9 };
    for p in &mut case.panels[start..] {
        (p.reflectance, p.both_sides) = (white, both);
    }
    (case.lit, case.factors, case.sealed) = (true, false, false);
    case.story = format!(
        "table {:.3?}, legs {:.4} m through it, two sides: {both}, {white}",
        hi - lo,
        end - hi.z
    );
}
