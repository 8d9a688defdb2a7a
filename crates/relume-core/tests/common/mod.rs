//! Scenes in a few lines and measurements on a solved session, shared by the integration tests.
//!
//! Everything here goes through the public API and knows no count that the engine chose. Exact
//! values are computed here by other means than the engine's own.
#![allow(dead_code)]
// Reference values may use the platform's functions: nothing that the engine decides rests on them.
#![allow(clippy::disallowed_methods)]

pub(crate) mod audit;
pub(crate) mod judged;
pub(crate) mod pairs;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};
use relume_core::scene::{
    Interpolation, MaterialId, NodeId, PatchId, RotationTrack, Scene, SceneBuilder, Track,
};
use relume_core::session::{FrameReport, Leaf, Options, Oracle, Session, Snapshot};
use relume_io::{ImportOptions, import};
#[allow(unused_imports)] // each test uses its part
pub(crate) use relume_judge::{Quad, Random, exact};

/// Short for [`DVec3::new`].
pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The rectangle at `z` over `[x0, x1] x [y0, y1]`, facing +z.
pub(crate) fn facing_up([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64) -> Quad {
    [v(x0, y0, z), v(x1, y0, z), v(x1, y1, z), v(x0, y1, z)]
}

/// The same polygon seen from the other side.
pub(crate) fn flipped(mut quad: Quad) -> Quad {
    quad.reverse();
    quad
}

/// A node where the world is.
pub(crate) fn still(b: &mut SceneBuilder, name: &str) -> NodeId {
    b.node(name, None, DVec3::ZERO, DQuat::IDENTITY)
}

/// A node that slides from `from` at 0 s to `to` at 1 s.
pub(crate) fn sliding(b: &mut SceneBuilder, name: &str, from: DVec3, to: DVec3) -> NodeId {
    let node = b.node(name, None, from, DQuat::IDENTITY);
    let interpolation = Interpolation::Linear;
    b.animate_translation(
        node,
        Track { times_s: vec![0.0, 1.0], values: vec![from, to], interpolation },
    );
    node
}

/// Turns a node by `angle` about `axis` from 0 s to 1 s.
pub(crate) fn turn(b: &mut SceneBuilder, node: NodeId, axis: DVec3, angle: f64) {
    b.animate_rotation(
        node,
        RotationTrack {
            times_s: vec![0.0, 1.0],
            values: vec![DQuat::IDENTITY, DQuat::from_axis_angle(axis.normalize(), angle)],
            interpolation: Interpolation::Linear,
        },
    );
}

/// The sides of a cuboid in `n` x `n` cells each, side by side.
pub(crate) fn cells_of_cuboid(lo: DVec3, hi: DVec3, n: usize, inward: bool) -> Vec<Vec<DVec3>> {
    let mut out = Vec::new();
    for axis in 0..3 {
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        for (side, end) in [lo, hi].into_iter().enumerate() {
            for k in 0..n * n {
                let at = |i: usize, j: usize| {
                    let share = |k: usize| k as f64 / n as f64;
                    let mut p = lo;
                    p[axis] = end[axis];
                    p[s] += (hi[s] - lo[s]) * share(i);
                    p[t] += (hi[t] - lo[t]) * share(j);
                    p
                };
                let (i, j) = (k % n, k / n);
                let mut cell = vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                if (side == 0) != inward {
                    cell.reverse();
                }
                out.push(cell);
            }
        }
    }
    out
}

/// Adds plates of one material that do not move; each name is a surface, its polygons in a list.
pub(crate) fn plates(b: &mut SceneBuilder, material: MaterialId, plates: &[(&str, &[Vec<DVec3>])]) {
    for (name, polygons) in plates {
        let node = still(b, name);
        for corners in *polygons {
            b.polygon(node, name, material, corners);
        }
    }
}

/// A scene of dark grey plates, each a named surface, in which nothing emits.
pub(crate) fn plate_scene(list: &[(&str, &[Vec<DVec3>])]) -> Scene {
    let mut b = SceneBuilder::new("plates");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    plates(&mut b, grey, list);
    b.build().unwrap()
}

/// A closed room of unit size with a lamp under the ceiling (it slides and is black) and two
/// bodies: a box that slides and turns, and a tilted one that rests. Different in every channel.
pub(crate) fn lit_room() -> Scene {
    let mut b = SceneBuilder::new("lit room");
    let wall = b.material("wall", [0.5, 0.4, 0.3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [30.0, 20.0, 10.0]);
    let red = b.material("red", [0.7, 0.2, 0.1], [0.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", wall, DVec3::ZERO, DVec3::ONE);
    let node = sliding(&mut b, "lamp", v(0.3, 0.95, 0.4), v(0.7, 0.95, 0.6));
    let down = [v(-0.1, 0.0, -0.1), v(0.1, 0.0, -0.1), v(0.1, 0.0, 0.1), v(-0.1, 0.0, 0.1)];
    b.polygon(node, "lamp", lamp, &down);
    let node = sliding(&mut b, "mover", v(0.3, 0.3, 0.3), v(0.7, 0.35, 0.5));
    turn(&mut b, node, v(1.0, 2.0, 0.5), 1.3);
    b.cuboid(node, "mover", red, DVec3::splat(-0.12), DVec3::splat(0.12));
    let tilt = DQuat::from_axis_angle(v(1.0, 0.0, 1.0).normalize(), 0.4);
    let node = b.node("rester", None, v(0.7, 0.5, 0.75), tilt);
    b.cuboid(node, "rester", wall, v(-0.1, -0.15, -0.05), v(0.1, 0.15, 0.05));
    b.build().unwrap()
}

/// Options with the default oracle at a tolerance.
pub(crate) fn at_tolerance(tolerance: f64) -> Options {
    Options { tolerance, ..Options::default() }
}

/// Options with the paper's form-factor oracle.
pub(crate) fn form_factor_oracle(epsilon: f64, min_area_m2: f64) -> Options {
    Options { oracle: Oracle::FormFactor { epsilon, min_area_m2 }, ..Options::default() }
}

/// A session over a scene that has stepped to time 0, with the report of that step.
pub(crate) fn solved(scene: Scene, options: Options) -> (Session, FrameReport) {
    let mut session = Session::new(Arc::new(scene), options).unwrap();
    let report = session.step(0, 0.0).unwrap();
    (session, report)
}

/// Ids of the patches of a named surface.
pub(crate) fn patches_of(scene: &Scene, surface: &str) -> Vec<PatchId> {
    let named = |k: &usize| scene.surfaces[scene.patches[*k].surface.0 as usize].name == surface;
    let ids: Vec<PatchId> =
        (0..scene.patches.len()).filter(named).map(|k| PatchId(k as u32)).collect();
    assert!(!ids.is_empty(), "no surface `{surface}`");
    ids
}

/// Area of a named surface, m2.
pub(crate) fn area_of(scene: &Scene, surface: &str) -> f64 {
    patches_of(scene, surface).iter().map(|p| scene.patches[p.0 as usize].area_m2()).sum()
}

/// Exchange area between two named surfaces, occlusion included, m2: the sum of X V over links.
pub(crate) fn exchange_area(session: &Session, one: &str, two: &str) -> f64 {
    let (tree, forest) = session.frame().unwrap().pairs();
    let scene = session.scene();
    let (ones, twos) = (patches_of(scene, one), patches_of(scene, two));
    let mut sum = 0.0;
    for pair in tree.links() {
        let (Some(a), Some(b)) = (forest.patch(pair.a), forest.patch(pair.b)) else { continue };
        let carried = f64::from(pair.exchange_area_m2()) * f64::from(pair.visibility());
        if ones.contains(&a) && twos.contains(&b) {
            sum += carried;
        }
        if ones.contains(&b) && twos.contains(&a) {
            sum += carried;
        }
    }
    sum
}

/// Form factor from one named surface to another, as a sum over links.
pub(crate) fn form_factor(session: &Session, receiver: &str, source: &str) -> f64 {
    exchange_area(session, receiver, source) / area_of(session.scene(), receiver)
}

/// Area of a leaf, m2.
pub(crate) fn leaf_area(leaf: &Leaf) -> f64 {
    let c = &leaf.corners;
    (c[2] - c[0]).perp_dot(c[3] - c[1]) / 2.0
}

/// World position of a point of a patch's plane in a snapshot.
pub(crate) fn world_point(snapshot: &Snapshot, patch: PatchId, p: DVec2) -> DVec3 {
    let patch = &snapshot.scene.patches[patch.0 as usize];
    snapshot.world.pose(patch.body).unwrap().point(patch.frame.point(p))
}

/// The leaf under a world point of a surface with this normal, and the point in its patch's frame.
pub(crate) fn leaf_at(snapshot: &Snapshot, p: DVec3, normal: DVec3) -> Option<(Leaf, DVec2)> {
    leaves_at(snapshot, &[p], normal).map(|found| found[0])
}

/// The same for several points of one patch; `None` unless one patch holds them all.
pub(crate) fn leaves_at(
    snapshot: &Snapshot,
    points: &[DVec3],
    normal: DVec3,
) -> Option<Vec<(Leaf, DVec2)>> {
    for (k, patch) in snapshot.scene.patches.iter().enumerate() {
        let Some(pose) = snapshot.world.pose(patch.body) else { continue };
        let local = |p: &DVec3| pose.inverse_point(*p) - patch.frame.origin;
        let faces = pose.direction(patch.frame.normal).dot(normal) > 0.99;
        if !faces || points.iter().any(|p| local(p).dot(patch.frame.normal).abs() > 1e-3) {
            continue;
        }
        let flat = |p: &DVec3| DVec2::new(local(p).dot(patch.frame.u), local(p).dot(patch.frame.v));
        let flat: Vec<DVec2> = points.iter().map(flat).collect();
        let far = DVec2::splat(f64::INFINITY);
        let lo = flat.iter().fold(far, |m, p| m.min(*p));
        let hi = flat.iter().fold(-far, |m, p| m.max(*p));
        let near = |leaf: &&Leaf| {
            let c = &leaf.corners;
            let (min, max) =
                (c.iter().fold(far, |m, p| m.min(*p)), c.iter().fold(-far, |m, p| m.max(*p)));
            min.cmple(hi + 1e-9).all() && max.cmpge(lo - 1e-9).all()
        };
        let near: Vec<&Leaf> = snapshot.leaves_of(PatchId(k as u32)).iter().filter(near).collect();
        let under = |p: &DVec2| {
            let inside = |c: &[DVec2; 4]| {
                (0..4).all(|i| (c[(i + 1) % 4] - c[i]).perp_dot(*p - c[i]) >= -1e-9)
            };
            near.iter().find(|leaf| inside(&leaf.corners)).map(|leaf| (**leaf, *p))
        };
        let found: Option<Vec<(Leaf, DVec2)>> = flat.iter().map(under).collect();
        if found.is_some() {
            return found;
        }
    }
    None
}

/// Root mean square of some numbers.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// Numbers for people: `[1.2e-3, ...]`.
pub(crate) fn brief(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|x| format!("{x:.1e}")).collect();
    format!("[{}]", words.join(", "))
}

/// A file of `tests/data`.
pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// A scene of `tests/data`.
pub(crate) fn shipped(name: &str) -> Scene {
    import(data(name), &ImportOptions::default()).unwrap()
}
