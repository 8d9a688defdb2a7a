//! A room full of small occluders: 64 turned boxes. Against path-traced means and points, and in time
//! against the path tracer itself.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use relume::scene::{Scene, SceneBuilder};
use relume::session::{Options, Session};
use relume_judge::path::{self, Estimate};
use relume_judge::{Random, World};

use crate::common::{self, at_tolerance, form_factor_oracle, judged, v};
use crate::grid;

/// A room of 1 m with a lamp set in its ceiling and 64 boxes of 4 to 9 cm in a jittered grid, each turned
/// at random; everything has reflectance 0.5. No two boxes touch.
pub(crate) fn room_of_boxes() -> Scene {
    let mut b = SceneBuilder::new("64 boxes");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.5; 3], [10.0; 3]);
    let node = common::still(&mut b, "room");
    let corner = |bits: usize| {
        let at = |axis: usize| (bits >> axis & 1) as f64;
        v(at(0), at(1), at(2))
    };
    for side in [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2]] {
        b.polygon(node, "walls", grey, &side.map(corner));
    }
    let down = |x: [f64; 2], y: [f64; 2]| common::flipped(common::facing_up(x, y, 1.0));
    let (whole, part) = ([0.0, 1.0], [0.35, 0.65]);
    for (x, y) in
        [(whole, [0.0, 0.35]), (whole, [0.65, 1.0]), ([0.0, 0.35], part), ([0.65, 1.0], part)]
    {
        b.polygon(node, "ceiling", grey, &down(x, y));
    }
    b.polygon(node, "lamp", lamp, &down(part, part));
    let mut random = Random(64);
    for k in 0..64 {
        let cell = v(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16));
        let jitter = random.point(DVec3::splat(-0.02), DVec3::splat(0.02));
        let centre = v(0.14, 0.14, 0.12) + cell * v(0.24, 0.24, 0.225) + jitter;
        let half = random.point(DVec3::splat(0.02), DVec3::splat(0.045));
        let node = b.node(&format!("box {k}"), None, centre, random.rotation());
        b.cuboid(node, "box", grey, -half, half);
    }
    b.build().unwrap()
}

/// Cells along each side of a patch: the boxes' faces are taken whole.
pub(crate) fn sides(surface: &str) -> usize {
    match surface {
        "walls" => 8,
        "ceiling" => 4,
        _ => 1,
    }
}

fn show(scene: &Arc<Scene>, name: &str, options: Options, reference: &[Estimate]) -> f64 {
    let mut session = Session::new(Arc::clone(scene), options).unwrap();
    let report = grid::on_one_thread(|| session.step(0, 0.0)).unwrap();
    let off = grid::error(&grid::found(&session, sides), reference);
    println!(
        "| {name} | {} | {} | {:.0} | {:.2} | {:.2} % |",
        report.links,
        report.elements,
        session.memory_bytes() as f64 / 1e6,
        report.seconds.total,
        100.0 * off
    );
    off
}

#[test]
fn a_room_of_64_boxes_keeps_its_mean_and_its_cells() {
    let scene = Arc::new(room_of_boxes());
    let world = World::new(judged::facets(&scene, 0.0));
    let sites = grid::sites(&scene, 0.0, sides);
    let reference = path::irradiance(&world, &sites, 30, 1);
    let off = show(&scene, "64 boxes at 0.05", at_tolerance(0.05), &reference);
    println!("    standard error of the reference {:.2} %", 100.0 * grid::own_error(&reference));
    assert!(off < 0.03, "{off}");
    // Closed and of uniform reflectance: the mean irradiance is flux / ((1 - rho) A).
    let (session, _) = common::solved(room_of_boxes(), at_tolerance(0.05));
    let leaves = session.snapshot().leaves;
    let flux: f64 = leaves.iter().map(|l| common::leaf_area(l) * f64::from(l.irradiance[0])).sum();
    let exact = 10.0 * 0.09 / 0.5;
    println!("| mean of 64 boxes | {:+.1e} |", flux / exact - 1.0);
    assert!((flux / exact - 1.0).abs() < 5e-3, "{flux} {exact}");
}

#[test]
#[ignore = "figures for docs/tolerance.md: minutes"]
fn error_against_time_among_64_boxes() {
    let scene = Arc::new(room_of_boxes());
    let world = World::new(judged::facets(&scene, 0.0));
    let sites = grid::sites(&scene, 0.0, sides);
    let reference = path::irradiance(&world, &sites, 1500, 1);
    println!("{} cells, standard error {:.2} %", sites.len(), 100.0 * grid::own_error(&reference));
    for batches in [2, 4, 8, 16, 32, 64] {
        let start = Instant::now();
        let traced = grid::on_one_thread(|| path::irradiance(&world, &sites, batches, 7));
        let seconds = start.elapsed().as_secs_f64();
        let values: Vec<f64> = traced.iter().map(|e| e.irradiance[0]).collect();
        let off = grid::error(&values, &reference);
        println!(
            "| path tracer, {} paths a cell | {seconds:.2} | {:.2} % |",
            batches * 64,
            100.0 * off
        );
    }
    for tolerance in [0.2, 0.1, 0.05, 0.02, 0.01, 0.005] {
        show(&scene, &format!("tolerance {tolerance}"), at_tolerance(tolerance), &reference);
    }
    for epsilon in [0.05, 0.02, 0.01, 0.005] {
        let options = form_factor_oracle(epsilon, 1e-4);
        show(&scene, &format!("form factor {epsilon}"), options, &reference);
    }
}
