//! Exchange areas with occlusion against a brute-force Monte Carlo integral that shares no code
//! with the engine.

// Reference values may use the platform's functions.
#![allow(clippy::disallowed_methods)]

mod common;

use std::f64::consts::PI;

use common::{Quad, Random, at_tolerance, exchange_area, facing_up, flipped, solved, v};
use glam::{DQuat, DVec3};
use relume::scene::SceneBuilder;

/// A box between the plates, which are rectangles.
#[derive(Clone, Copy)]
struct Block {
    centre: DVec3,
    half: DVec3,
    turn: DQuat,
}

impl Block {
    /// Whether the segment meets the box: slabs, in the box's own frame.
    fn blocks(&self, p: DVec3, q: DVec3) -> bool {
        let back = self.turn.conjugate();
        let (o, d) = (back * (p - self.centre), back * (q - p));
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (t0, t1) =
                ((-self.half[axis] - o[axis]) / d[axis], (self.half[axis] - o[axis]) / d[axis]);
            from = from.max(t0.min(t1));
            to = to.min(t0.max(t1));
        }
        from < to
    }
}

/// Exchange area of two parallelograms past the boxes and its standard error, m2: rays from the
/// first with a cosine distribution, as many as hit the second unblocked. 40^4 rays, stratified
/// in all four dimensions; the standard error is that of as many independent rays, and so too
/// large if anything.
fn monte_carlo(a: &Quad, b: &Quad, blocks: &[Block], seed: u64) -> (f64, f64) {
    const CELLS: u32 = 40;
    let mut random = Random(seed);
    let mut part = |k: u32| (f64::from(k) + random.unit()) / f64::from(CELLS);
    let (e, f, be, bf) = (a[1] - a[0], a[3] - a[0], b[1] - b[0], b[3] - b[0]);
    let (area, normal, bn) = (e.cross(f).length(), e.cross(f).normalize(), be.cross(bf));
    let (u, w) = (e.normalize(), normal.cross(e.normalize()));
    let mut hits = 0_u32;
    for index in 0..CELLS.pow(4) {
        let cell = |axis: u32| index / CELLS.pow(axis) % CELLS;
        let p = a[0] + e * part(cell(0)) + f * part(cell(1));
        let (square, turn) = (part(cell(2)), 2.0 * PI * part(cell(3)));
        let (r, up) = (square.sqrt(), (1.0 - square).sqrt());
        let d = u * (r * turn.cos()) + w * (r * turn.sin()) + normal * up;
        if bn.dot(d) >= 0.0 {
            continue;
        }
        let x = p + d * (bn.dot(b[0] - p) / bn.dot(d));
        let inside = |side: DVec3| (0.0..side.length_squared()).contains(&(x - b[0]).dot(side));
        let ahead = (x - p).dot(d) > 0.0;
        if ahead && inside(be) && inside(bf) && !blocks.iter().any(|o| o.blocks(p, x)) {
            hits += 1;
        }
    }
    let share = f64::from(hits) / f64::from(CELLS.pow(4));
    (area * share, area * (share * (1.0 - share) / f64::from(CELLS.pow(4))).sqrt())
}

fn check(name: &str, a: &Quad, b: &Quad, blocks: &[Block], error_max: f64) {
    let mut s = SceneBuilder::new(name);
    let grey = s.material("grey", [0.5; 3], [0.0; 3]);
    common::plates(&mut s, grey, &[("a", &[a.to_vec()]), ("b", &[b.to_vec()])]);
    for (k, block) in blocks.iter().enumerate() {
        let node = s.node(&format!("block {k}"), None, block.centre, block.turn);
        s.cuboid(node, "block", grey, -block.half, block.half);
    }
    let (x, se) = monte_carlo(a, b, blocks, 5);
    let (free, _) = monte_carlo(a, b, &[], 6);
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
fn the_integral_itself_is_right() {
    let (x, se) = monte_carlo(&unit(0.0), &flipped(unit(1.0)), &[], 1);
    assert!((x - 0.199_824_895_698).abs() < 4.0 * se && se < 3e-4, "{x} +- {se}");
    let plate = block(v(0.25, 0.25, 0.5), v(0.25, 0.25, 1e-9), 0.0);
    let (x, se) = monte_carlo(&unit(0.0), &flipped(unit(1.0)), &[plate], 2);
    assert!((x - 0.149_868_671_774).abs() < 4.0 * se && se < 3e-4, "{x} +- {se}");
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
