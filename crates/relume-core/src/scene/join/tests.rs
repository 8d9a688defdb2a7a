//! What joins, what does not, and that nothing is lost.

use glam::DQuat;

use super::super::{Interpolation, NodeId, SceneBuilder, Track};
use super::*;

/// The sides of a cuboid in `n` x `n` cells each, as polygons from outside.
fn cells(half: DVec3, n: usize) -> Vec<Vec<DVec3>> {
    let mut out = Vec::new();
    for axis in 0..3 {
        for end in [-1.0, 1.0] {
            for k in 0..n * n {
                let at = |i: usize, j: usize| {
                    let mut p = half * end;
                    p[(axis + 1) % 3] = half[(axis + 1) % 3] * (2.0 * i as f64 / n as f64 - 1.0);
                    p[(axis + 2) % 3] = half[(axis + 2) % 3] * (2.0 * j as f64 / n as f64 - 1.0);
                    p
                };
                let (i, j) = (k % n, k / n);
                let mut cell = vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                if end < 0.0 {
                    cell.reverse();
                }
                out.push(cell);
            }
        }
    }
    out
}

/// Cells as surfaces of their own on the nodes that `node_of` says.
fn add(b: &mut SceneBuilder, cells: &[Vec<DVec3>], node_of: impl Fn(usize) -> NodeId) {
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    for (k, cell) in cells.iter().enumerate() {
        b.polygon(node_of(k), &format!("cell {k}"), grey, cell);
    }
}

fn area(corners: &[DVec2]) -> f64 {
    let n = corners.len();
    (0..n).map(|k| corners[k].perp_dot(corners[(k + 1) % n])).sum::<f64>() / 2.0
}

/// Every patch of the first scene is a part of one joined patch, with its area and its place; parts
/// fill the joined patches.
fn check(scene: &Scene, joined: &Joined) {
    assert_eq!(joined.parts.len(), joined.scene.patches.len());
    let mut met = vec![0; scene.patches.len()];
    for (patch, parts) in joined.scene.patches.iter().zip(&joined.parts) {
        let sum: f64 = parts.iter().map(|part| area(&part.corners)).sum();
        assert!((sum / patch.area_m2() - 1.0).abs() < 1e-6, "{sum} of {}", patch.area_m2());
        for part in parts {
            let before = &scene.patches[part.patch.0 as usize];
            met[part.patch.0 as usize] += 1;
            assert!((area(&part.corners) / before.area_m2() - 1.0).abs() < 1e-6);
            for (p, q) in part.corners.iter().zip(before.corners_in_body()) {
                assert!((patch.frame.point(*p) - q).length() < 1e-6);
            }
            assert!(patch.frame.normal.dot(before.frame.normal) > 0.999_999);
        }
    }
    assert_eq!(met, vec![1; scene.patches.len()]);
    let bodies = joined.scene.bodies.iter();
    let ranges: Vec<u32> = bodies.flat_map(|b| [b.patches.start, b.patches.end]).collect();
    assert!(ranges.is_sorted() && *ranges.last().unwrap() as usize == joined.scene.patches.len());
    for (body, of) in (0..).map(BodyId).zip(&joined.scene.bodies) {
        let patches = &joined.scene.patches[of.patches.start as usize..of.patches.end as usize];
        assert!(patches.iter().all(|patch| patch.body == body || !scene.moves(patch.body)));
    }
}

#[test]
fn a_cube_of_cells_is_six_patches_whatever_nodes_its_cells_hang_on() {
    for apart in [false, true] {
        let mut b = SceneBuilder::new("cells");
        let all = cells(DVec3::new(0.5, 1.0, 2.0), 5);
        let turn = DQuat::from_rotation_x(0.3);
        let place = DVec3::new(0.1, 0.2, 0.3);
        let nodes: Vec<NodeId> = (0..if apart { all.len() } else { 1 })
            .map(|k| b.node(&format!("node {k}"), None, place, turn))
            .collect();
        add(&mut b, &all, |k| nodes[if apart { k } else { 0 }]);
        let scene = b.build().unwrap();
        let joined = scene.joined();
        assert_eq!(joined.scene.patches.len(), 6);
        assert!(joined.parts.iter().all(|parts| parts.len() == 25));
        check(&scene, &joined);
    }
}

#[test]
fn what_moves_joins_with_what_moves_with_it_alone() {
    let mut b = SceneBuilder::new("halves");
    let all = cells(DVec3::ONE, 2);
    let still = b.node("still", None, DVec3::ZERO, DQuat::IDENTITY);
    let moves = b.node("moves", None, DVec3::ZERO, DQuat::IDENTITY);
    let interpolation = Interpolation::Linear;
    let values = vec![DVec3::ZERO, DVec3::X];
    b.animate_translation(moves, Track { times_s: vec![0.0, 1.0], values, interpolation });
    add(&mut b, &all, |k| if k % 2 == 0 { still } else { moves });
    let scene = b.build().unwrap();
    let joined = scene.joined();
    // Each side is two strips of two cells.
    assert_eq!(joined.scene.patches.len(), 12);
    check(&scene, &joined);
}

#[test]
fn both_sides_of_thin_walls_join_and_neighbours_at_an_angle_do_not() {
    let mut b = SceneBuilder::new("thin");
    let node = b.node("wall", None, DVec3::ZERO, DQuat::IDENTITY);
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let rectangle = |x: f64, width: f64, rise: f64| {
        let (p, q) = (DVec3::new(x, 0.0, 0.0), DVec3::new(x + width, 0.0, rise));
        vec![p, q, q + DVec3::Y, p + DVec3::Y]
    };
    b.polygon(node, "left", thin, &rectangle(0.0, 1.0, 0.0));
    b.polygon(node, "right", thin, &rectangle(1.0, 0.5, 0.0));
    b.polygon(node, "bent", thin, &rectangle(1.5, 1.0, 0.01));
    b.polygon(node, "one-sided", grey, &rectangle(-1.0, 1.0, 0.0));
    let scene = b.build().unwrap();
    let joined = scene.joined();
    let counts: Vec<usize> = joined.parts.iter().map(Vec::len).collect();
    assert_eq!(counts, [2, 2, 1, 1, 1]);
    let twin = |k: usize| joined.scene.patches[k].twin;
    assert_eq!((twin(0), twin(1)), (Some(PatchId(1)), Some(PatchId(0))));
    check(&scene, &joined);
}

#[test]
fn patches_without_neighbours_stay_as_they_are() {
    let mut b = SceneBuilder::new("box");
    let node = b.node("box", None, DVec3::new(0.1, 0.7, 0.3), DQuat::from_rotation_y(1.0));
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    b.cuboid(node, "box", grey, DVec3::splat(-0.3), DVec3::splat(0.4));
    let scene = b.build().unwrap();
    let joined = scene.joined();
    for (before, after) in scene.patches.iter().zip(&joined.scene.patches) {
        assert_eq!((before.frame, &before.corners), (after.frame, &after.corners));
    }
    check(&scene, &joined);
}
