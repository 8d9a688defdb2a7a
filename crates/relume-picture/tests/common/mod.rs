//! Scenes and snapshots made by hand.
#![allow(dead_code)] // each test file uses its own part of it

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};
use relume_core::scene::{
    Body, BodyId, Camera, Frame, Material, MaterialId, Motion, Node, NodeId, Patch, PatchId, Scene,
    Surface, SurfaceId,
};
use relume_core::session::{Leaf, Snapshot};

pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The six sides of a box, to be left out of a room.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Side {
    Left,
    Right,
    Floor,
    Ceiling,
    Back,
    Front,
}

pub(crate) const SIDES: [Side; 6] =
    [Side::Left, Side::Right, Side::Floor, Side::Ceiling, Side::Back, Side::Front];

pub(crate) fn empty() -> Scene {
    Scene {
        name: "by hand".into(),
        bodies: Vec::new(),
        surfaces: Vec::new(),
        obstructions: Default::default(),
        patches: Vec::new(),
        materials: Vec::new(),
        tints: Vec::new(),
        lights: Vec::new(),
        cameras: Vec::new(),
        motion: Motion::default(),
        origin: DVec3::ZERO,
        outside: None,
        outside_m: 0.0,
        environment: None,
        notes: Vec::new(),
        edited: Default::default(),
    }
}

pub(crate) fn node(scene: &mut Scene, translation: DVec3, rotation: DQuat) -> NodeId {
    scene.motion.nodes.push(Node {
        name: format!("node {}", scene.motion.nodes.len()),
        parent: None,
        translation,
        rotation,
        translation_track: None,
        rotation_track: None,
        presence: Vec::new(),
    });
    NodeId(scene.motion.nodes.len() as u32 - 1)
}

pub(crate) fn camera(
    scene: &mut Scene,
    name: &str,
    at: DVec3,
    projection: relume_core::scene::Projection,
) {
    let node = node(scene, at, DQuat::IDENTITY);
    scene.cameras.push(Camera { name: name.into(), node, projection });
}

pub(crate) fn material(scene: &mut Scene, reflectance: [f64; 3], exitance: f64) -> MaterialId {
    let id = MaterialId(scene.materials.len() as u32);
    scene.materials.push(Material {
        glow: None,
        name: format!("material {}", id.0),
        reflectance,
        exitance: [exitance; 3],
        double_sided: false,
    });
    id
}

/// A body at the origin made of polygons, counter-clockwise seen from the front, with materials.
pub(crate) fn body(scene: &mut Scene, polygons: &[(Vec<DVec3>, MaterialId)]) -> BodyId {
    let node = node(scene, DVec3::ZERO, DQuat::IDENTITY);
    let body = BodyId(scene.bodies.len() as u32);
    let first = scene.patches.len() as u32;
    for (corners, material) in polygons {
        let surface = SurfaceId(scene.surfaces.len() as u32);
        let name = format!("surface {}", surface.0);
        scene.surfaces.push(Surface { object: name.clone(), name, body, material: *material });
        let u = (corners[1] - corners[0]).normalize();
        let normal = u.cross(corners[2] - corners[0]).normalize();
        let frame = Frame { origin: corners[0], u, v: normal.cross(u), normal };
        let flat =
            |p: &DVec3| DVec2::new((*p - corners[0]).dot(frame.u), (*p - corners[0]).dot(frame.v));
        let corners = corners.iter().map(flat).collect();
        scene.patches.push(Patch {
            body,
            surface,
            material: *material,
            tint: None,
            print: None,
            frame,
            corners,
            twin: None,
        });
    }
    let patches = first..scene.patches.len() as u32;
    scene.bodies.push(Body {
        name: format!("body {}", body.0),
        node,
        patches,
        distant: false,
        again: false,
    });
    body
}

/// The same scene with every polygon double-sided.
pub(crate) fn double_sided(scene: &Scene) -> Scene {
    let mut two = Scene { patches: Vec::new(), ..scene.clone() };
    for body in &mut two.bodies {
        let start = two.patches.len() as u32;
        for front in &scene.patches[body.patches.start as usize..body.patches.end as usize] {
            let id = two.patches.len() as u32;
            let Frame { origin, u, v, normal } = front.frame;
            let mirrored = front.corners.iter().rev().map(|c| DVec2::new(c.x, -c.y)).collect();
            let frame = Frame { origin, u, v: -v, normal: -normal };
            let twin = Some(PatchId(id));
            let back = Patch { frame, corners: mirrored, twin, ..front.clone() };
            two.patches.push(Patch { twin: Some(PatchId(id + 1)), ..front.clone() });
            two.patches.push(back);
        }
        body.patches = start..two.patches.len() as u32;
    }
    two
}

/// One side of the box from `a` to `b`, seen from outside.
pub(crate) fn side(a: DVec3, b: DVec3, side: Side) -> Vec<DVec3> {
    let at = |x: u8, y: u8, z: u8| {
        let pick = |i: u8, a: f64, b: f64| if i == 0 { a } else { b };
        v(pick(x, a.x, b.x), pick(y, a.y, b.y), pick(z, a.z, b.z))
    };
    match side {
        Side::Left => vec![at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)],
        Side::Right => vec![at(1, 0, 1), at(1, 0, 0), at(1, 1, 0), at(1, 1, 1)],
        Side::Floor => vec![at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)],
        Side::Ceiling => vec![at(0, 1, 1), at(1, 1, 1), at(1, 1, 0), at(0, 1, 0)],
        Side::Back => vec![at(1, 0, 0), at(0, 0, 0), at(0, 1, 0), at(1, 1, 0)],
        Side::Front => vec![at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)],
    }
}

/// A box seen from outside.
pub(crate) fn solid(scene: &mut Scene, a: DVec3, b: DVec3, material: MaterialId) -> BodyId {
    let polygons: Vec<_> = SIDES.iter().map(|&s| (side(a, b, s), material)).collect();
    body(scene, &polygons)
}

/// A room, 4 x 3 x 5 m, seen from inside, without some of its sides; red and green side walls and a
/// lamp below the ceiling.
pub(crate) fn room(without: &[Side]) -> Scene {
    let mut scene = empty();
    let white = material(&mut scene, [0.7; 3], 0.0);
    let red = material(&mut scene, [0.6, 0.1, 0.1], 0.0);
    let green = material(&mut scene, [0.1, 0.5, 0.1], 0.0);
    let lamp = material(&mut scene, [0.5; 3], 100.0);
    let walls: Vec<_> = SIDES
        .iter()
        .filter(|s| !without.contains(s))
        .map(|&s| {
            let mut corners = side(v(0.0, 0.0, 0.0), v(4.0, 3.0, 5.0), s);
            corners.reverse();
            (
                corners,
                match s {
                    Side::Left => red,
                    Side::Right => green,
                    _ => white,
                },
            )
        })
        .collect();
    body(&mut scene, &walls);
    solid(&mut scene, v(1.5, 2.9, 2.0), v(2.5, 2.95, 3.0), lamp);
    scene
}

/// A snapshot at time 0: leaves are split (in four, in the patch's frame) while `refine` says so
/// for (centre in the world, diagonal, level), and get the radiosity of (centre, normal, material).
pub(crate) fn snapshot(
    scene: &Scene,
    refine: impl Fn(DVec3, f64, u32) -> bool,
    radiosity: impl Fn(DVec3, DVec3, &Material) -> [f32; 3],
) -> Snapshot {
    let world = scene.at(0.0);
    let mut leaves = Vec::new();
    let mut leaf_offsets = vec![0];
    for patch in &scene.patches {
        let pose = world.pose(patch.body).expect("present");
        let mut stack: Vec<([DVec2; 4], u32, u32)> = match patch.corners[..] {
            [a, b, c, d] => vec![([a, b, c, d], 0, 1)],
            [a, b, c] => vec![([a, b, c, c], 0, 1)],
            _ => panic!("triangles and quadrilaterals only"),
        };
        while let Some((c, level, path)) = stack.pop() {
            let middle = (c[0] + c[1] + c[2] + c[3]) / 4.0;
            let centre = pose.point(patch.frame.point(middle));
            if c[2] != c[3] && refine(centre, c[0].distance(c[2]), level) {
                for i in 0..4 {
                    let (next, previous) = (c[(i + 1) % 4], c[(i + 3) % 4]);
                    let quarter = [c[i], c[i].midpoint(next), middle, previous.midpoint(c[i])];
                    stack.push((quarter, level + 1, 4 * path + i as u32));
                }
                continue;
            }
            let normal = pose.direction(patch.frame.normal);
            let material = &scene.materials[patch.material.0 as usize];
            let radiosity = radiosity(centre, normal, material);
            let (m, rho) = (material.exitance, material.reflectance);
            let arriving = |c: usize| (f64::from(radiosity[c]) - m[c]) / rho[c].max(1e-9);
            leaves.push(Leaf {
                facet: 0,
                path,
                corners: c,
                irradiance: [0, 1, 2].map(|c| arriving(c).max(0.0) as f32),
                irradiance_gradient: [[0.0; 3]; 2],
                radiosity,
            });
        }
        leaf_offsets.push(leaves.len() as u32);
    }
    let scene = Arc::new(scene.clone());
    Snapshot {
        scene,
        time_s: 0.0,
        error_w_m2: 0.0,
        world,
        leaves,
        leaf_offsets,
        indirect: Vec::new(),
        lamps: Vec::new(),
    }
}

/// Splits unevenly, so that there are T-vertices everywhere.
pub(crate) fn uneven(centre: DVec3, _diagonal: f64, level: u32) -> bool {
    level < 2 || (level < 6 && (centre.x * 7.0 + centre.y * 11.0 + centre.z * 13.0).sin() > 0.2)
}

/// Direct light from a square lamp at height 2.9 in the middle of [`room`] past a box, plus a constant.
pub(crate) fn lit(block: (DVec3, DVec3)) -> impl Fn(DVec3, DVec3, &Material) -> [f32; 3] {
    move |point, normal, material| {
        let mut irradiance = 8.0;
        for i in 0..16 {
            let lamp =
                v(1.5 + 0.0625 + 0.25 * f64::from(i % 4), 2.9, 2.125 + 0.25 * f64::from(i / 4));
            let d = lamp - point;
            let r2 = d.length_squared().max(1e-3);
            let cosines = normal.dot(d).max(0.0) * d.y.max(0.0) / r2;
            if cosines > 0.0 && !blocked(point + normal * 1e-6, lamp, block) {
                irradiance += 100.0 * 1.5 * cosines / (std::f64::consts::PI * r2 * 16.0) * 4.0;
            }
        }
        [0, 1, 2].map(|c| (material.exitance[c] + material.reflectance[c] * irradiance) as f32)
    }
}

/// Whether the segment meets the axis-aligned box.
fn blocked(from: DVec3, to: DVec3, (low, high): (DVec3, DVec3)) -> bool {
    let inverse = (to - from).recip();
    let (a, b) = ((low - from) * inverse, (high - from) * inverse);
    let enter = a.min(b).max_element().max(0.0);
    let leave = a.max(b).min_element().min(1.0);
    enter < leave
}
