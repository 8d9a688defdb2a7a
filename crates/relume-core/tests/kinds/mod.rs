//! What one gets for a tolerance on scenes of many kinds, and what a solution says of its own error, beside the truth: the
//! tables of docs/tolerance.md.
//!
//!     cargo test --release -p relume-core --test tests on_many_kinds -- --ignored --nocapture
//!
//! with, if wanted, `RELUME_KINDS=pillar,street` and `RELUME_TOLERANCES=0.1,0.02` in the environment.

mod at_sensors;
mod scenes;

use std::sync::Arc;

use relume_core::scene::Scene;
use relume_core::session::{Aim, Options, PointError, Sensor, Session};

pub(crate) use self::scenes::{Maker, SCENES};

/// Points at which the truth is found; of each the share of the area that it stands for is known.
const POINTS: usize = 192;
/// Tolerance of the solution from which light is gathered as the truth. At points it errs by a tenth of a per cent or two.
const FINE: f64 = 0.01;

/// Errors of one solution, relative to the larger of what is said and what is right, 1; all but `rms_said` true.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) links: u64,
    /// Of the mesh.
    pub(crate) rms: f64,
    pub(crate) nine_tenths: f64,
    /// Of what is gathered at the same points, as sensors read it.
    pub(crate) at_points: f64,
    /// The same, of a solution that is made for points, and its links.
    pub(crate) for_points: f64,
    pub(crate) links_for_points: u64,
    /// By the solution itself.
    pub(crate) rms_said: f64,
    pub(crate) nine_tenths_said: f64,
    pub(crate) points_said: u32,
}

pub(crate) fn solved(scene: &Arc<Scene>, tolerance: f64, aim: Aim) -> Session {
    let options = Options { tolerance, aim, ..Options::default() };
    let mut session = Session::new(Arc::clone(scene), options).expect("a session");
    session.step(0, 0.0).expect("a frame");
    session
}

/// Measures a solution against a finer one.
pub(crate) fn row(scene: &Arc<Scene>, fine: &Session, tolerance: f64) -> Row {
    let session = solved(scene, tolerance, Aim::Mesh);
    let frame = session.frame().expect("a frame");
    let points = frame.errors(POINTS);
    let normal = |point: &PointError| {
        let patch = &scene.patches[point.patch.0 as usize];
        let pose = scene.pose(patch.body, 0.0).expect("every body is present");
        pose.direction(patch.frame.normal)
    };
    let sensors: Vec<Sensor> =
        points.iter().map(|point| Sensor { at: point.at, normal: normal(point) }).collect();
    let all = |e: [f64; 3]| e.iter().sum::<f64>();
    let right = fine.frame().expect("a frame").irradiances_at(&sensors);
    let read = frame.irradiances_at(&sensors);
    let made_for_points = solved(scene, tolerance, Aim::Points);
    let made_for_points = made_for_points.frame().expect("a frame");
    let read_there = made_for_points.irradiances_at(&sensors);
    // Where next to nothing arrives, and not by mistake, as in the coarse solution.
    let mean = points.iter().zip(&right).map(|(p, &r)| p.share * all(r)).sum::<f64>()
        / points.iter().map(|point| point.share).sum::<f64>();
    let relative = |is: f64, right: f64| (is - right) / is.max(right);
    let mut sizes = Vec::new();
    let (mut of_mesh, mut of_points, mut for_points, mut whole) = (0.0, 0.0, 0.0, 0.0);
    for (((point, &right), &read), &there) in points.iter().zip(&right).zip(&read).zip(&read_there)
    {
        if all(right) < 1e-3 * mean {
            continue;
        }
        let error = relative(point.said, all(right));
        whole += point.share;
        of_mesh += point.share * error * error;
        of_points += point.share * relative(all(read), all(right)).powi(2);
        for_points += point.share * relative(all(there), all(right)).powi(2);
        sizes.push((error.abs(), point.share));
    }
    sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = 0.9 * whole;
    let nine_tenths = sizes.iter().find(|(_, share)| {
        left -= share;
        left <= 0.0
    });
    let said = frame.estimate();
    Row {
        links: frame.report().links,
        rms: (of_mesh / whole).sqrt(),
        nine_tenths: nine_tenths.map_or(0.0, |size| size.0),
        at_points: (of_points / whole).sqrt(),
        for_points: (for_points / whole).sqrt(),
        links_for_points: made_for_points.report().links,
        rms_said: said.rms,
        nine_tenths_said: said.nine_tenths,
        points_said: said.points,
    }
}

/// Prints the table.
pub(crate) fn print_table() {
    let listed = |name: &str| std::env::var(name).ok();
    let kinds = listed("RELUME_KINDS");
    let tolerances: Vec<f64> = listed("RELUME_TOLERANCES")
        .unwrap_or_else(|| "0.1,0.05,0.02".into())
        .split(',')
        .map(|t| t.parse().expect("a tolerance"))
        .collect();
    println!(
        "| scene | tolerance | links | mesh, RMS % (over tolerance) | said % (over truth) | nine tenths % | said % | at points % (over tolerance) | made for points: links | at points % (over tolerance) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, _) in SCENES {
        if kinds.as_ref().is_some_and(|kinds| !kinds.split(',').any(|kind| kind == *name)) {
            continue;
        }
        let scene = Arc::new(Maker::scene(name));
        let fine = solved(&scene, FINE, Aim::Mesh);
        for &tolerance in &tolerances {
            let row = row(&scene, &fine, tolerance);
            println!(
                "| {name} | {tolerance} | {} | {:.2} ({:.2}) | {:.2} ({:.2}) at {} | {:.2} | {:.2} | {:.2} ({:.2}) | {} | {:.2} ({:.2}) |",
                row.links,
                100.0 * row.rms,
                row.rms / tolerance,
                100.0 * row.rms_said,
                row.rms_said / row.rms,
                row.points_said,
                100.0 * row.nine_tenths,
                100.0 * row.nine_tenths_said,
                100.0 * row.at_points,
                row.at_points / tolerance,
                row.links_for_points,
                100.0 * row.for_points,
                row.for_points / tolerance,
            );
        }
    }
}

#[test]
#[ignore = "minutes; prints the tables of docs/tolerance.md"]
fn on_many_kinds() {
    print_table();
}

/// Pairs that are steep over one end alone are divided there: slats were divided all over, and the pane behind them was not. The shadow
/// of a slat is as large as the slat: it counted as one of its edges of 4 mm.
#[test]
fn slats_before_a_window_are_not_divided_all_over() {
    let session = solved(&Arc::new(Maker::scene("blinds")), 0.1, Aim::Mesh);
    let links = session.frame().expect("a frame").report().links;
    assert!(links < 35_000, "{links} links");
}
