//! Furnished rooms of all sorts, in which things stand, hang, stick in or through each other and through walls, at rest or in motion:
//! what arrives at each surface.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use relume_judge::Random;

use crate::outside::case::{Case, Mover, chance, log_between, v, whole};

/// A thing, of faces about its own origin.
struct Thing {
    word: &'static str,
    faces: Vec<Vec<DVec3>>,
    half: DVec3,
    both_sides: bool,
}

impl Thing {
    /// Whether its lowest face is seen from above: in the very plane of the floor no ray could tell which of them it meets.
    fn is_open(&self) -> bool {
        ["panel", "open box"].contains(&self.word)
    }
}

/// Panels of a box.
fn box_faces(lo: DVec3, hi: DVec3) -> Vec<Vec<DVec3>> {
    crate::outside::case::cuboid_sides(lo, hi).into_iter().map(|side| side.1).collect()
}

/// A prism of a regular polygon, its sides and ends.
fn prism(corners: usize, radius: f64, half: f64) -> Vec<Vec<DVec3>> {
    let ring = |z: f64| -> Vec<DVec3> {
        let at = |k: usize| TAU * k as f64 / corners as f64;
        (0..corners).map(|k| v(radius * at(k).cos(), radius * at(k).sin(), z)).collect()
    };
    let (low, high) = (ring(-half), ring(half));
    let side = |k: usize| {
        let next = (k + 1) % corners;
        vec![low[k], low[next], high[next], high[k]]
    };
    let mut faces: Vec<Vec<DVec3>> = (0..corners).map(side).collect();
    faces.push(high.clone());
    faces.push(low.into_iter().rev().collect());
    faces
}

fn thing(r: &mut Random, size: f64) -> Thing {
    let both_sides = chance(r, 0.3);
    let half = r.point(DVec3::splat(0.06), DVec3::splat(0.22)) * size;
    match whole(r, 0, 6) {
        0 | 1 => Thing { word: "box", faces: box_faces(-half, half), half, both_sides },
        2 => {
            let half = v(half.x, half.y, log_between(r, 0.004, 0.03) * size);
            Thing { word: "board", faces: box_faces(-half, half), half, both_sides }
        }
        3 => {
            let flat = [
                v(-half.x, -half.y, 0.),
                v(half.x, -half.y, 0.),
                v(half.x, half.y, 0.),
                v(-half.x, half.y, 0.),
            ];
            Thing {
                word: "panel",
                faces: vec![flat.to_vec()],
                half: half.with_z(0.0),
                both_sides: true,
            }
        }
        4 => {
            let corners = whole(r, 3, 12);
            let half = v(half.x, half.x, half.z);
            Thing { word: "prism", faces: prism(corners, half.x, half.z), half, both_sides }
        }
        5 => {
            // A table: its legs stand under the top, or go through it.
            let thick = log_between(r, 0.01, 0.04) * size;
            let top = v(half.x, half.y, half.z);
            let mut faces = box_faces(v(-top.x, -top.y, top.z - thick), top);
            let leg = r.between(0.02, 0.05) * size;
            let end =
                top.z - thick + if chance(r, 0.5) { 0.0 } else { thick * r.between(0.3, 2.0) };
            for k in 0..4_usize {
                let x = if k & 1 == 0 { -top.x } else { top.x - leg };
                let y = if k & 2 == 0 { -top.y } else { top.y - leg };
                faces.extend(box_faces(v(x, y, -half.z), v(x + leg, y + leg, end)));
            }
            Thing { word: "table", faces, half, both_sides }
        }
        _ => {
            // Without a lid.
            let mut faces = box_faces(-half, half);
            faces.pop();
            Thing { word: "open box", faces, half, both_sides: true }
        }
    }
}

/// Where a thing is put: its middle and its turn, and a word for it.
fn place(r: &mut Random, room: DVec3, thing: &Thing) -> (DVec3, DQuat, &'static str) {
    let half = thing.half;
    let at = room * r.point(DVec3::splat(0.08), DVec3::splat(0.92));
    let turned = if chance(r, 0.5) { r.between(0.0, TAU) } else { 0.0 };
    let upright = DQuat::from_rotation_z(turned);
    match whole(r, 0, 5) {
        0 | 1 if thing.is_open() => (at.with_z(half.z + 0.05), upright, "above the floor"),
        0 | 1 => (at.with_z(half.z), upright, "standing"),
        2 if half.z > 0.0 => (at.with_z(half.z * r.between(0.2, 0.98)), upright, "sunk"),
        2 | 3 => (at, upright, "hanging"),
        4 => (at, r.rotation(), "turned"),
        _ => (at.with_z(half.z + log_between(r, 1e-3, 5e-2)), upright, "just above the floor"),
    }
}

/// A furnished room.
// Over 60 lines: one draw; the order of random numbers is its meaning.
pub(crate) fn interior(r: &mut Random, case: &mut Case) {
    let size = r.point(v(1.5, 1.5, 1.5), v(6.0, 6.0, 3.5));
    case.room(size);
    let two_sided_room = chance(r, 0.25);
    let white = *[0.3, 0.5, 0.7, 0.85, 0.95].get(whole(r, 0, 4)).expect("one of five");
    for p in &mut case.panels {
        (p.reflectance, p.both_sides) = (white, two_sided_room);
    }
    let mut words = String::new();
    // A panel under the ceiling, a box that glows, or a hanging ball of few faces.
    let start = case.panels.len();
    let lamp = match whole(r, 0, 2) {
        0 => {
            let (a, b) = (size * r.between(0.2, 0.45), size * r.between(0.55, 0.8));
            let z = size.z - log_between(r, 2e-3, 0.3);
            let corners = [v(a.x, a.y, z), v(a.x, b.y, z), v(b.x, b.y, z), v(b.x, a.y, z)];
            case.panel("lamp", &corners, false);
            "panel"
        }
        1 => {
            let half = r.point(DVec3::splat(0.03), DVec3::splat(0.1)) * size;
            let at = (size * r.point(DVec3::splat(0.2), DVec3::splat(0.8))).max(half * 1.1);
            case.cuboid("lamp", at - half, at + half, false);
            "box"
        }
        _ => {
            let radius = r.between(0.03, 0.08) * size.min_element();
            let at = size * r.point(DVec3::splat(0.2), DVec3::splat(0.8));
            for (k, face) in prism(8, radius, radius).into_iter().enumerate() {
                let face: Vec<DVec3> = face.into_iter().map(|c| at + c).collect();
                case.panel(&format!("lamp {k}"), &face, false);
            }
            "prism"
        }
    };
    let area: f64 = case.panels[start..].len() as f64;
    for p in &mut case.panels[start..] {
        (p.exitance, p.reflectance) = (60.0 / area, 0.5);
    }
    let moves = chance(r, 0.5);
    for k in 0..whole(r, 2, 6) {
        let thing = thing(r, size.min_element());
        let (at, turn, how) = place(r, size, &thing);
        let Thing { word, faces, both_sides, .. } = thing;
        let start = case.panels.len();
        for (face, corners) in faces.iter().enumerate() {
            case.panel(&format!("{word} {k}.{face}"), corners, both_sides);
        }
        let reflectance = if chance(r, 0.5) { white } else { r.between(0.2, 0.9) };
        let last = if moves && chance(r, 0.4) {
            at + size
                * r.point(DVec3::splat(-0.15), DVec3::splat(0.15))
                * v(1.0, 1.0, f64::from(u8::from(how != "standing")))
        } else {
            at
        };
        for p in &mut case.panels[start..] {
            (p.reflectance, p.mover) = (reflectance, Some(case.movers.len()));
        }
        // Of things that stay as they are no mover remains but their pose.
        for p in &mut case.panels[start..] {
            p.corners.iter_mut().for_each(|c| *c = turn * *c);
        }
        case.movers.push(Mover { place: [at, last], turn: DQuat::IDENTITY });
        words += &format!(
            " {word} {how}{}{},",
            if both_sides { " of two sides" } else { "" },
            if last != at { " moving" } else { "" }
        );
    }
    case.times_s = if moves { vec![0.0, 0.3, 0.8] } else { vec![0.0] };
    (case.lit, case.factors, case.sealed) = (true, false, false);
    (case.fluxes, case.cold) = (true, moves);
    case.story = format!(
        "room {size:.2} of {} sides, reflectance {white}, lamp a {lamp}:{words}",
        1 + u8::from(two_sided_room)
    );
}
