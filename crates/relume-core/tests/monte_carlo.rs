//! Exchange areas with occlusion against the judge's brute-force Monte Carlo integral.

use crate::common;
use crate::common::{Quad, Random, at_tolerance, exchange_area, facing_up, flipped, solved, v};
use glam::{DQuat, DVec3};
use relume_core::scene::SceneBuilder;
use relume_judge::monte_carlo::{self, Block};

fn check(name: &str, a: &Quad, b: &Quad, blocks: &[Block], error_max: f64) {
    let mut s = SceneBuilder::new(name);
    let grey = s.material("grey", [0.5; 3], [0.0; 3]);
    common::plates(&mut s, grey, &[("a", &[a.to_vec()]), ("b", &[b.to_vec()])]);
    for (k, block) in blocks.iter().enumerate() {
        let node = s.node(&format!("block {k}"), None, block.centre, block.turn);
        s.cuboid(node, "block", grey, -block.half, block.half);
    }
    let (x, se) = monte_carlo::exchange_area(a, b, blocks, 5);
    let (free, _) = monte_carlo::exchange_area(a, b, &[], 6);
    let scene = s.build().unwrap();
    for (tolerance, error_max) in [(0.1, 4.0 * error_max), (0.02, error_max)] {
        let (session, report) = solved(scene.clone(), at_tolerance(tolerance));
        let got = exchange_area(&session, "a", "b");
        println!(
            "{name} at {tolerance}: X {got:.6} against {x:.6} +- {se:.1e} ({:+.2} %, unblocked {free:.6}), {} links",
            (got / x - 1.0) * 100.0,
            report.links
        );
        let bound = 4.0 * se + error_max * x;
        assert!((got - x).abs() <= bound, "{name} at {tolerance}: {got} {x} +- {se}");
    }
}

fn unit(z: f64) -> Quad {
    facing_up([0.0, 1.0], [0.0, 1.0], z)
}

fn block(centre: DVec3, half: DVec3, angle: f64) -> Block {
    Block { centre, half, turn: DQuat::from_axis_angle(v(1.0, 2.0, 3.0).normalize(), angle) }
}

#[test]
fn a_box_between_two_squares() {
    let (a, b) = (unit(0.0), flipped(unit(1.0)));
    check("middle", &a, &b, &[block(v(0.5, 0.5, 0.5), DVec3::splat(0.2), 0.0)], 0.02);
    check("turned", &a, &b, &[block(v(0.4, 0.6, 0.45), v(0.3, 0.1, 0.2), 0.8)], 0.02);
    check("thin", &a, &b, &[block(v(0.5, 0.5, 0.7), v(0.45, 0.02, 0.2), 0.1)], 0.02);
    check("near the floor", &a, &b, &[block(v(0.3, 0.3, 0.06), v(0.2, 0.2, 0.05), 0.0)], 0.02);
}

#[test]
fn a_box_in_a_corner() {
    let wall = [v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)];
    check("corner", &unit(0.0), &wall, &[block(v(0.2, 0.5, 0.2), v(0.1, 0.3, 0.1), 0.3)], 0.02);
}

#[test]
fn several_small_boxes() {
    let mut random = Random(3);
    let mut blocks = Vec::new();
    for _ in 0..12 {
        let half = random.point(DVec3::splat(0.02), DVec3::splat(0.1));
        let at = random.point(v(0.0, 0.0, 0.2), v(1.0, 1.0, 0.8));
        blocks.push(block(at, half, random.between(0.0, 3.0)));
    }
    check("twelve", &unit(0.0), &flipped(unit(1.0)), &blocks, 0.02);
}
