//! A living room in the evening: furniture, a door that opens into a lit hall, a lantern that is carried through the room, and blinds
//! before a window with a low sun. Metres, +Y up; the camera looks along -Z.
//!
//! Knows nothing of how scenes are solved or drawn.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use relume::scene::{
    Interpolation, LightKind, MaterialId, NodeId, Projection, RotationTrack, Scene, SceneBuilder,
    SceneError, Track,
};

/// Frames a second that the keys are made for.
const FPS: f64 = 24.0;
/// Frames of the clip.
pub(super) const FRAMES: u32 = 36;
/// Frames from the first in which the door moves to the last.
const DOOR_FRAMES: [u32; 2] = [6, 30];
/// How far it opens, radians.
const DOOR_OPEN: f64 = 1.25;

/// The room: from the left front corner of the floor to the right back one of the ceiling.
const LEFT: f64 = 0.0;
const RIGHT: f64 = 5.0;
const HEIGHT: f64 = 2.6;
const BACK: f64 = -4.0;
/// Thickness of the back wall, and the end of the hall beyond it.
const WALL: f64 = 0.12;
const HALL_END: f64 = -5.6;
/// The doorway in the back wall: left, right, height.
const DOORWAY: [f64; 3] = [3.5, 4.35, 2.05];
/// The window in the left wall: far and near end along Z, bottom, top.
const WINDOW: [f64; 4] = [-2.9, -1.1, 0.9, 2.1];
const SLATS: u32 = 13;
/// How thick the rug is.
const RUG: f64 = 0.012;
/// Where the sun is seen from the room: over the left, low.
const TO_SUN: DVec3 = DVec3::new(-0.78, 0.5, 0.12);

const NONE: [f64; 3] = [0.0; 3];

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The scene.
pub(super) fn living_room() -> Result<Scene, SceneError> {
    let mut b = SceneBuilder::new("living-room");
    shell(&mut b);
    hall(&mut b);
    door(&mut b);
    window(&mut b);
    seats(&mut b);
    tables(&mut b);
    books(&mut b);
    small_things(&mut b);
    lantern(&mut b);
    reading_lamp(&mut b);
    let eye = b.node("camera", None, v(2.35, 1.5, 1.35), DQuat::from_rotation_x(-0.09));
    b.camera("camera", eye, Projection::Perspective { yfov: 52f64.to_radians(), aspect: None });
    b.build()
}

fn still(b: &mut SceneBuilder, name: &str, at: DVec3) -> NodeId {
    b.node(name, None, at, DQuat::IDENTITY)
}

/// A rectangle from a corner along two sides; its front is where their cross product points.
fn rectangle(
    b: &mut SceneBuilder,
    (node, name): (NodeId, &str),
    material: MaterialId,
    corner: DVec3,
    [u, w]: [DVec3; 2],
) {
    b.polygon(node, name, material, &[corner, corner + u, corner + u + w, corner + w]);
}

/// Walls, floor and ceiling, with openings for door and window.
fn shell(b: &mut SceneBuilder) {
    let plaster = b.material("plaster", [0.72, 0.69, 0.64], NONE);
    let ochre = b.material("ochre wall", [0.66, 0.5, 0.3], NONE);
    let wood = b.material("floor boards", [0.42, 0.29, 0.18], NONE);
    let white = b.material("ceiling white", [0.78, 0.78, 0.76], NONE);
    let (depth, width) = (v(0.0, 0.0, -BACK), v(RIGHT, 0.0, 0.0));
    let room = still(b, "room", DVec3::ZERO);
    rectangle(b, (room, "floor"), wood, v(LEFT, 0.0, BACK), [depth, width]);
    rectangle(b, (room, "ceiling"), white, v(LEFT, HEIGHT, BACK), [width, depth]);
    rectangle(b, (room, "right wall"), ochre, v(RIGHT, 0.0, BACK), [depth, v(0.0, HEIGHT, 0.0)]);
    rectangle(b, (room, "front wall"), plaster, v(LEFT, 0.0, 0.0), [v(0.0, HEIGHT, 0.0), width]);
    let up = |from: f64, to: f64| v(0.0, to - from, 0.0);
    let [far, near, bottom, top] = WINDOW;
    // Around the window, from the floor up.
    let strips = [
        (BACK, 0.0, 0.0, bottom),
        (BACK, far, bottom, top),
        (near, 0.0, bottom, top),
        (BACK, 0.0, top, HEIGHT),
    ];
    for (from, to, low, high) in strips {
        let sides = [up(low, high), v(0.0, 0.0, to - from)];
        rectangle(b, (room, "window wall"), plaster, v(LEFT, low, from), sides);
    }
    let [left, right, head] = DOORWAY;
    for (from, to, low, high) in
        [(LEFT, left, 0.0, HEIGHT), (right, RIGHT, 0.0, HEIGHT), (left, right, head, HEIGHT)]
    {
        let sides = [v(to - from, 0.0, 0.0), up(low, high)];
        rectangle(b, (room, "back wall"), plaster, v(from, low, BACK), sides);
    }
}

/// The doorway, and a hall behind it with a lamp at its ceiling.
fn hall(b: &mut SceneBuilder) {
    let white = b.material("hall white", [0.76, 0.75, 0.72], NONE);
    let lamp = b.material("hall lamp", NONE, [30.0, 26.0, 20.0].map(|l| PI * l));
    let hall = still(b, "hall", DVec3::ZERO);
    let [left, right, head] = DOORWAY;
    let (begin, floor) = (BACK - WALL, 0.0);
    let through = v(0.0, 0.0, WALL);
    let across = v(right - left, 0.0, 0.0);
    let up = v(0.0, head, 0.0);
    rectangle(b, (hall, "doorway"), white, v(left, floor, begin), [up, through]);
    rectangle(b, (hall, "doorway"), white, v(right, floor, begin), [through, up]);
    rectangle(b, (hall, "doorway"), white, v(left, head, begin), [across, through]);
    rectangle(b, (hall, "doorway"), white, v(left, floor, begin), [through, across]);
    let (low, high) = (v(2.9, 0.0, HALL_END), v(RIGHT, HEIGHT, begin));
    let size = high - low;
    let (x, y, z) = (v(size.x, 0.0, 0.0), v(0.0, size.y, 0.0), v(0.0, 0.0, size.z));
    rectangle(b, (hall, "hall"), white, low, [x, y]);
    rectangle(b, (hall, "hall"), white, low, [y, z]);
    rectangle(b, (hall, "hall"), white, low + x, [z, y]);
    rectangle(b, (hall, "hall"), white, low, [z, x]);
    rectangle(b, (hall, "hall"), white, low + y, [x, z]);
    for (from, to, bottom, top) in
        [(low.x, left, 0.0, HEIGHT), (right, RIGHT, 0.0, HEIGHT), (left, right, head, HEIGHT)]
    {
        let sides = [v(0.0, top - bottom, 0.0), v(to - from, 0.0, 0.0)];
        rectangle(b, (hall, "hall"), white, v(from, bottom, begin), sides);
    }
    let corner = v(3.7, HEIGHT - 0.25, -5.1);
    rectangle(b, (hall, "hall lamp"), lamp, corner, [v(0.5, 0.0, 0.0), v(0.0, 0.0, 0.5)]);
}

/// A door that swings into the room.
fn door(b: &mut SceneBuilder) {
    let paint = b.material("door paint", [0.3, 0.42, 0.44], NONE);
    let brass = b.material("brass", [0.5, 0.4, 0.2], NONE);
    let [left, right, head] = DOORWAY;
    let gap = 0.006;
    let hinge = still(b, "door", v(right - gap, 0.0, BACK - 0.004));
    let wide = right - left - 2.0 * gap;
    b.cuboid(hinge, "door", paint, v(-wide, gap, -0.04), v(0.0, head - gap, 0.0));
    b.cuboid(hinge, "handle", brass, v(-wide + 0.06, 1.0, 0.001), v(-wide + 0.18, 1.03, 0.04));
    let [first, last] = DOOR_FRAMES;
    let at = |frame: u32| {
        let share = f64::from(frame.clamp(first, last) - first) / f64::from(last - first);
        // Starts and stops gently.
        DQuat::from_rotation_y(DOOR_OPEN * share * share * (3.0 - 2.0 * share))
    };
    b.animate_rotation(
        hinge,
        RotationTrack {
            times_s: times(),
            values: (0..FRAMES).map(at).collect(),
            interpolation: Interpolation::Linear,
        },
    );
}

/// Daylight, a sun, and blinds before the window.
fn window(b: &mut SceneBuilder) {
    let frame = b.material("window frame", [0.7, 0.7, 0.68], NONE);
    let slat = b.double_sided_material("slat", [0.68, 0.64, 0.56], NONE);
    let day = b.material("daylight", NONE, [1.4, 1.9, 2.6].map(|l| PI * l));
    let [far, near, bottom, top] = WINDOW;
    let node = still(b, "window", DVec3::ZERO);
    let (mid, half) = (0.5 * (far + near), 0.02);
    b.cuboid(node, "bars", frame, v(-0.07, bottom, mid - half), v(-0.03, top, mid + half));
    b.cuboid(
        node,
        "sill",
        frame,
        v(0.0, bottom - 0.05, far - 0.1),
        v(0.16, bottom - 0.01, near + 0.1),
    );
    let blinds = still(b, "blinds", DVec3::ZERO);
    let step = (top - bottom) / f64::from(SLATS);
    for k in 0..SLATS {
        let y = bottom + (f64::from(k) + 0.5) * step;
        // Tilted with the outer edge down.
        let (out, rise) = (0.03, 0.016);
        let middle = v(0.05, y, far);
        let across = v(2.0 * out, 2.0 * rise, 0.0);
        let along = v(0.0, 0.0, near - far);
        rectangle(b, (blinds, "slats"), slat, middle - 0.5 * across, [along, across]);
    }
    // A bright garden below the sun's way in.
    let beyond = still(b, "daylight", DVec3::ZERO);
    let sides = [v(0.0, 2.7, 0.0), v(0.0, 0.0, 4.4)];
    rectangle(b, (beyond, "daylight"), day, v(-1.5, -0.9, -4.2), sides);
    let turn = DQuat::from_rotation_arc(DVec3::Z, TO_SUN.normalize());
    let sun = b.node("sun", None, DVec3::ZERO, turn);
    b.light("sun", sun, LightKind::Directional, [46.0, 35.0, 22.0]);
}

/// A sofa with cushions, and a rug.
fn seats(b: &mut SceneBuilder) {
    let cloth = b.material("sofa cloth", [0.2, 0.27, 0.38], NONE);
    let red = b.material("cushion red", [0.6, 0.16, 0.11], NONE);
    let cream = b.material("cushion cream", [0.7, 0.64, 0.5], NONE);
    let wool = b.material("rug wool", [0.5, 0.2, 0.16], NONE);
    let sofa = still(b, "sofa", v(1.75, 0.0, -3.45));
    b.cuboid(sofa, "feet", cloth, v(-0.9, 0.0, -0.4), v(0.9, 0.12, 0.35));
    b.cuboid(sofa, "seat", cloth, v(-1.0, 0.121, -0.45), v(1.0, 0.4, 0.45));
    b.cuboid(sofa, "back", cloth, v(-1.0, 0.401, -0.45), v(1.0, 0.86, -0.22));
    for side in [-1.0, 0.8] {
        b.cuboid(sofa, "arm", cloth, v(side, 0.401, -0.219), v(side + 0.2, 0.62, 0.45));
    }
    for (k, material) in [(-0.55, red), (0.5, cream)] {
        let tilt = DQuat::from_rotation_z(0.3 * k) * DQuat::from_rotation_x(-0.3);
        let cushion = b.node("cushion", Some(sofa), v(k, 0.63, -0.08), tilt);
        pillow(b, cushion, material, v(0.21, 0.2, 0.07));
    }
    let rug = still(b, "rug", v(2.3, 0.0, -1.95));
    // The low table stands on it.
    b.cuboid(rug, "rug", wool, v(-0.9, 0.0, -0.65), v(1.1, RUG, 0.65));
}

/// A low table and chairs at a higher one.
fn tables(b: &mut SceneBuilder) {
    let oak = b.material("oak", [0.5, 0.35, 0.2], NONE);
    let low = still(b, "low table", v(2.3, RUG, -2.0));
    table(b, (low, oak), [0.55, 0.3, 0.42]);
    let high = still(b, "table", v(0.75, 0.0, -1.0));
    table(b, (high, oak), [0.45, 0.6, 0.74]);
    for (x, z, turn) in [(1.35, -0.75, -0.6), (0.75, -1.9, 0.1)] {
        let chair = b.node("chair", None, v(x, 0.0, z), DQuat::from_rotation_y(turn));
        table(b, (chair, oak), [0.2, 0.2, 0.45]);
        for bar in [0.55, 0.7, 0.85] {
            b.cuboid(chair, "back", oak, v(-0.17, bar, 0.17), v(0.17, bar + 0.07, 0.19));
        }
        for side in [-0.2, 0.17] {
            b.cuboid(chair, "post", oak, v(side, 0.451, 0.165), v(side + 0.03, 0.95, 0.195));
        }
    }
}

/// A top on four legs: half width, half depth, height.
fn table(b: &mut SceneBuilder, (node, material): (NodeId, MaterialId), [x, z, y]: [f64; 3]) {
    b.cuboid(node, "top", material, v(-x, y - 0.035, -z), v(x, y, z));
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = v(sx * (x - 0.03), 0.0, sz * (z - 0.03));
        let half = v(0.022, 0.0, 0.022);
        b.cuboid(node, "leg", material, foot - half, foot + half + v(0.0, y - 0.036, 0.0));
    }
}

/// Shelves at the right wall, full of books of many sizes.
fn books(b: &mut SceneBuilder) {
    let board = b.material("shelf board", [0.56, 0.42, 0.27], NONE);
    let covers = [
        [0.5, 0.12, 0.1],
        [0.12, 0.22, 0.4],
        [0.14, 0.34, 0.2],
        [0.62, 0.55, 0.38],
        [0.3, 0.2, 0.34],
        [0.62, 0.38, 0.12],
    ];
    let covers: Vec<MaterialId> =
        (1..).zip(covers).map(|(k, c)| b.material(&format!("cover {k}"), c, NONE)).collect();
    let shelf = still(b, "shelf", v(RIGHT - 0.001, 0.0, -2.1));
    let (deep, wide, tall) = (0.28, 0.75, 2.0);
    for z in [-wide - 0.02, wide] {
        b.cuboid(shelf, "side", board, v(-deep, 0.0, z), v(0.0, tall, z + 0.02));
    }
    let mut number = 0_u32;
    for row in 0..5 {
        let y = 0.08 + 0.38 * f64::from(row);
        b.cuboid(shelf, "board", board, v(-deep, y, -wide + 0.001), v(0.0, y + 0.02, wide - 0.001));
        let mut z = -wide + 0.02;
        loop {
            // Sizes that repeat seldom, by the golden section.
            number += 1;
            let share = (f64::from(number) * 0.618_034).fract();
            let (thick, high) = (0.025 + 0.035 * share, 0.2 + 0.11 * (5.0 * share).fract());
            if z + thick > wide - 0.05 {
                break;
            }
            if number % 11 != 7 {
                let cover = covers[number as usize * 7 % covers.len()];
                let (front, end) = (-0.16 - 0.08 * (3.0 * share).fract(), z + thick - 0.002);
                b.cuboid(
                    shelf,
                    "books",
                    cover,
                    v(front, y + 0.021, z),
                    v(-0.02, y + 0.021 + high, end),
                );
            }
            z += thick;
        }
    }
}

/// A vase, a bowl of fruit, a ball, a plant and pictures.
fn small_things(b: &mut SceneBuilder) {
    let clay = b.material("glaze", [0.24, 0.44, 0.5], NONE);
    let china = b.double_sided_material("china", [0.7, 0.7, 0.68], NONE);
    let orange = b.material("orange", [0.72, 0.34, 0.06], NONE);
    let apple = b.material("apple", [0.52, 0.5, 0.1], NONE);
    let rubber = b.material("ball red", [0.62, 0.1, 0.08], NONE);
    let pot = b.material("pot", [0.55, 0.27, 0.17], NONE);
    let leaf = b.double_sided_material("leaf", [0.13, 0.33, 0.1], NONE);
    let vase = still(b, "vase", v(0.75, 0.741, -1.1));
    let outline = [
        (0.05, 0.0),
        (0.085, 0.06),
        (0.1, 0.13),
        (0.08, 0.2),
        (0.045, 0.26),
        (0.04, 0.3),
        (0.06, 0.34),
    ];
    lathe(b, (vase, "vase"), clay, &outline, 20);
    let bowl = still(b, "bowl", v(2.2, 0.421 + RUG, -2.0));
    lathe(b, (bowl, "bowl"), china, &[(0.05, 0.0), (0.1, 0.025), (0.14, 0.06), (0.16, 0.1)], 20);
    for k in 0..4 {
        let angle = TAU * f64::from(k) / 4.0 + 0.3;
        let at = v(2.2 + 0.062 * libm::cos(angle), 0.496 + RUG, -2.0 + 0.062 * libm::sin(angle));
        let fruit = still(b, "fruit", at);
        ball(b, (fruit, "fruit"), [orange, apple][k as usize % 2], 0.042, [12, 8]);
    }
    let toy = still(b, "ball", v(3.6, 0.14, -1.3));
    ball(b, (toy, "ball"), rubber, 0.14, [24, 12]);
    let plant = still(b, "plant", v(0.4, 0.0, -3.55));
    lathe(
        b,
        (plant, "pot"),
        pot,
        &[(0.13, 0.0), (0.16, 0.15), (0.18, 0.3), (0.15, 0.3), (0.0, 0.28)],
        16,
    );
    for k in 0..36 {
        let share = f64::from(k) / 36.0;
        let (angle, rise) = (f64::from(k) * 2.399_963, 0.35 + 0.75 * share);
        let out = DQuat::from_rotation_y(angle);
        let (start, length) = (v(0.0, 0.3 + 0.5 * share, 0.0), 0.34 - 0.14 * share);
        let along = out * v(length * libm::cos(rise), length * libm::sin(rise), 0.0);
        let side = out * v(0.0, 0.0, 0.035);
        let middle = start + 0.55 * along;
        b.polygon(plant, "leaves", leaf, &[start, middle - side, start + along, middle + side]);
    }
    for (z, colour) in [(-3.4, [0.5, 0.42, 0.3]), (-0.75, [0.2, 0.3, 0.34])] {
        let paint = b.material("picture", colour, NONE);
        let node = still(b, "picture", v(RIGHT, 1.5, z));
        b.cuboid(node, "picture", paint, v(-0.03, -0.25, -0.2), v(-0.001, 0.25, 0.2));
    }
}

/// A lantern that somebody carries from the window to the door.
fn lantern(b: &mut SceneBuilder) {
    let glow = b.material("lantern glow", [0.3, 0.25, 0.2], [230.0, 150.0, 70.0].map(|l| PI * l));
    let iron = b.material("iron", [0.1, 0.1, 0.1], NONE);
    let at = |frame: u32| {
        let share = f64::from(frame) / f64::from(FRAMES - 1);
        let bob = 0.02 * libm::sin(TAU * 3.0 * share);
        v(1.35 + 2.35 * share, 1.15 + bob, -1.45 - 1.25 * share * share)
    };
    let node = still(b, "lantern", at(0));
    lathe(b, (node, "glass"), glow, &[(0.045, -0.07), (0.045, 0.07)], 6);
    lathe(
        b,
        (node, "foot"),
        iron,
        &[(0.0, -0.09), (0.06, -0.09), (0.06, -0.071), (0.0, -0.071)],
        8,
    );
    lathe(b, (node, "lid"), iron, &[(0.0, 0.071), (0.06, 0.071), (0.0, 0.13)], 8);
    let values = (0..FRAMES).map(at).collect();
    b.animate_translation(
        node,
        Track { times_s: times(), values, interpolation: Interpolation::Linear },
    );
}

/// A lamp with a shade beside the sofa.
fn reading_lamp(b: &mut SceneBuilder) {
    let paper = b.double_sided_material("shade paper", [0.7, 0.62, 0.48], NONE);
    let iron = b.material("stand", [0.12, 0.12, 0.13], NONE);
    let bulb = b.double_sided_material("bulb", NONE, [90.0, 72.0, 45.0].map(|l| PI * l));
    let node = still(b, "reading lamp", v(3.05, 0.0, -3.6));
    lathe(
        b,
        (node, "stand"),
        iron,
        &[(0.0, 0.0), (0.14, 0.0), (0.14, 0.02), (0.012, 0.03), (0.012, 1.35), (0.0, 1.35)],
        10,
    );
    lathe(b, (node, "shade"), paper, &[(0.22, 1.22), (0.13, 1.52)], 16);
    let corner = v(-0.04, 1.38, -0.04);
    rectangle(b, (node, "bulb"), bulb, corner, [v(0.08, 0.0, 0.0), v(0.0, 0.0, 0.08)]);
}

/// What an outline (distance from the axis, height), from the bottom up its outer side, sweeps around the vertical.
fn lathe(
    b: &mut SceneBuilder,
    (node, name): (NodeId, &str),
    material: MaterialId,
    outline: &[(f64, f64)],
    sides: u32,
) {
    let place = |(r, y): (f64, f64), k: u32| {
        let (sin, cos) = libm::sincos(TAU * f64::from(k % sides) / f64::from(sides));
        v(r * cos, y, r * sin)
    };
    for ring in outline.windows(2) {
        for k in 0..sides {
            let corners = [
                place(ring[0], k),
                place(ring[1], k),
                place(ring[1], k + 1),
                place(ring[0], k + 1),
            ];
            let mut polygon: Vec<DVec3> = Vec::new();
            for corner in corners {
                if polygon.last() != Some(&corner) && polygon.first() != Some(&corner) {
                    polygon.push(corner);
                }
            }
            b.polygon(node, name, material, &polygon);
        }
    }
}

fn ball(
    b: &mut SceneBuilder,
    on: (NodeId, &str),
    material: MaterialId,
    radius: f64,
    [sides, rings]: [u32; 2],
) {
    let at = |k: u32| {
        if k == 0 || k == rings {
            return (0.0, if k == 0 { -radius } else { radius });
        }
        let angle = PI * f64::from(k) / f64::from(rings);
        (radius * libm::sin(angle), -radius * libm::cos(angle))
    };
    let outline: Vec<(f64, f64)> = (0..=rings).map(at).collect();
    lathe(b, on, material, &outline, sides);
}

/// A ball that is squeezed to half axes.
fn pillow(b: &mut SceneBuilder, node: NodeId, material: MaterialId, half: DVec3) {
    let inner = b.node("filling", Some(node), DVec3::ZERO, DQuat::IDENTITY);
    b.scale(inner, half);
    ball(b, (inner, "cushion"), material, 1.0, [14, 8]);
}

/// One key a frame.
fn times() -> Vec<f64> {
    (0..FRAMES).map(|frame| f64::from(frame) / FPS).collect()
}
