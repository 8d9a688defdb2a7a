//! A room full of small occluders: 64 turned boxes. Against path-traced means and points, and in time
//! against the path tracer itself.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;
use relume_core::element::{Forest, WorldElement, WorldView};
use relume_core::pair::Link;
use relume_core::scene::{PatchId, Scene, SceneBuilder};
use relume_core::session::{Options, Session};
use relume_core::transport::Shaft;
use relume_judge::path::{self, Estimate};
use relume_judge::{Polygon, Random, World, seen};

use crate::common::{self, at_tolerance, form_factor_oracle, judged, v};
use crate::validation::grid;

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
    let world = World::new(judged::polygons(&scene, 0.0));
    let sites = grid::sites(&scene, 0.0, sides);
    let reference = path::irradiance(&world, &sites, 30, 1);
    let off = show(&scene, "64 boxes at 0.05", at_tolerance(0.05), &reference);
    println!("    standard error of the reference {:.2} %", 100.0 * grid::own_error(&reference));
    assert!(off < 0.03, "{off}");
    // Closed and of uniform reflectance: the mean irradiance is flux / ((1 - rho) A).
    let (session, _) = common::solved(room_of_boxes(), at_tolerance(0.05));
    let leaves = session.frame().unwrap().solution().leaves;
    let flux: f64 = leaves.iter().map(|l| common::leaf_area(l) * f64::from(l.irradiance[0])).sum();
    let exact = 10.0 * 0.09 / 0.5;
    println!("| mean of 64 boxes | {:+.1e} |", flux / exact - 1.0);
    assert!((flux / exact - 1.0).abs() < 5e-3, "{flux} {exact}");
}

#[test]
#[ignore = "figures for docs/tolerance.md: minutes"]
fn error_against_time_among_64_boxes() {
    let scene = Arc::new(room_of_boxes());
    let world = World::new(judged::polygons(&scene, 0.0));
    let sites = grid::sites(&scene, 0.0, sides);
    let reference = path::irradiance(&world, &sites, 1500, 1);
    println!("{} cells, standard error {:.2} %", sites.len(), 100.0 * grid::own_error(&reference));
    for batches in [2, 4, 8, 16, 32, 64] {
        let start = Instant::now();
        let traced = grid::on_one_thread(|| path::irradiance(&world, &sites, batches, 7));
        let seconds = start.elapsed().as_secs_f64();
        let values: Vec<f64> = traced.iter().map(|e| grid::grey(e.irradiance)).collect();
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

/// What the visibilities of the links of one kind do to irradiance.
#[derive(Clone, Copy, Default)]
struct Kind {
    links: f64,
    /// Sum of the squared errors of V.
    v_squares: f64,
    /// Expected squared relative error of irradiance, times area.
    h_squares: f64,
    /// Flux that they carry both ways, W.
    flux_w: f64,
}

/// Kinds by the number of polygons in the way: the most of each.
const BLOCKERS: [usize; 5] = [0, 4, 12, 30, usize::MAX];

/// A solved scene with what the judge needs of it.
struct Looked<'a> {
    scene: &'a Scene,
    session: &'a Session,
    view: &'a WorldView,
    polygons: &'a [Polygon],
    /// Mean radiosity and irradiance of each patch, W/m2.
    means: Vec<[f64; 2]>,
}

impl Looked<'_> {
    fn is_lamp(&self, patch: PatchId) -> bool {
        self.polygons[patch.0 as usize].exitance[0] > 0.0
    }

    /// A link's kind: from the lamp or not, and what is in its way; and what it does, V by the judge's
    /// own integration.
    fn look(&self, link: &Link) -> (bool, usize, Kind) {
        let (_, forest) = self.session.frame().unwrap().pairs();
        let patches = [link.a, link.b].map(|id| forest.patch(id).expect("elements have patches"));
        let ends = [link.a, link.b].map(|id| WorldElement::new(self.view, forest, id, false));
        let [a, b] = ends.each_ref();
        let (view, own) = (self.view, None);
        let shaft = Shaft { forest, view, a, b, own, patches: (patches[0], patches[1]) };
        let blockers = shaft.blockers(&[Forest::ROOT.0]).len();
        let bin = BLOCKERS.iter().position(|&most| blockers <= most).expect("the last takes all");
        let corners = ends.map(|e| e.corners[..e.len].to_vec());
        let areas = corners.each_ref().map(|c| Polygon::black(c.clone()).area_m2());
        let small = usize::from(areas[1] < areas[0]);
        let others =
            (0..self.polygons.len()).filter(|k| patches.iter().all(|p| p.0 as usize != *k));
        let between: Vec<&[DVec3]> = others.map(|k| &self.polygons[k].corners[..]).collect();
        let x = f64::from(link.exchange_area_m2());
        let (from, to) = (&corners[small], &corners[1 - small]);
        let seen = areas[small] * seen::form_factor(from, to, &between, 2e-3 * x / areas[small]);
        let off = x * f64::from(link.visibility()) - seen;
        let mut kind = Kind { links: 1.0, v_squares: (off / x).powi(2), ..Kind::default() };
        for (r, s) in [(0, 1), (1, 0)] {
            let source = self.means[patches[s].0 as usize][0];
            let irradiance = self.means[patches[r].0 as usize][1];
            kind.h_squares += (source * off / irradiance).powi(2) / areas[r];
            kind.flux_w += source * seen;
        }
        (patches.iter().any(|&p| self.is_lamp(p)), bin, kind)
    }
}

/// Mean radiosity and irradiance of each patch, W/m2.
fn means(session: &Session) -> Vec<[f64; 2]> {
    let snapshot = session.frame().unwrap().solution();
    let mean = |k: usize| {
        let leaves = snapshot.leaves_of(PatchId(k as u32));
        let area: f64 = leaves.iter().map(common::leaf_area).sum();
        let sum = leaves.iter().fold([0.0; 2], |[b, h], l| {
            let a = common::leaf_area(l);
            [b + a * f64::from(l.radiosity[0]), h + a * f64::from(l.irradiance[0])]
        });
        sum.map(|s| s / area)
    };
    (0..snapshot.scene.patches.len()).map(mean).collect()
}

#[test]
#[ignore = "figures for docs/tolerance.md: a minute"]
fn where_the_error_sits_among_64_boxes() {
    let scene = room_of_boxes();
    let polygons = judged::polygons(&scene, 0.0);
    let (session, report) = common::solved(room_of_boxes(), at_tolerance(0.05));
    let (tree, forest) = session.frame().unwrap().pairs();
    let view = WorldView::new(&scene, forest, &scene.at(0.0));
    let (scene, session, view, polygons) = (&scene, &session, &view, &polygons[..]);
    let looked = Looked { scene, session, view, polygons, means: means(session) };
    // A sample: one in ten of the lamp's links, one in forty of the others.
    let lamp =
        |l: &Link| [l.a, l.b].iter().any(|&id| looked.is_lamp(forest.patch(id).expect("a patch")));
    let every = |l: &Link| if lamp(l) { 10 } else { 40 };
    let chosen: Vec<(f64, Link)> = tree
        .links()
        .enumerate()
        .filter(|(k, l)| k % every(l) == 0)
        .map(|(_, l)| (every(&l) as f64, l))
        .collect();
    let found: Vec<(f64, (bool, usize, Kind))> =
        chosen.par_iter().map(|(weight, l)| (*weight, looked.look(l))).collect();
    let mut kinds = [[Kind::default(); BLOCKERS.len()]; 2];
    for (weight, (lamp, bin, kind)) in found {
        let sum = &mut kinds[usize::from(lamp)][bin];
        sum.links += weight * kind.links;
        sum.v_squares += weight * kind.v_squares;
        sum.h_squares += weight * kind.h_squares;
        sum.flux_w += weight * kind.flux_w;
    }
    println!("{} links at tolerance 0.05; a sample of {}", report.links, chosen.len());
    for (who, row) in ["reflected", "lamp"].iter().zip(kinds) {
        for (most, k) in ["0", "1-4", "5-12", "13-30", "31-"].iter().zip(row) {
            println!(
                "| {who} | {most} | {:.0} | {:.2} | {:.3} | {:.2} % |",
                k.links,
                k.flux_w,
                (k.v_squares / k.links.max(1.0)).sqrt(),
                100.0 * (k.h_squares / looked.scene.area_m2()).sqrt()
            );
        }
    }
}
