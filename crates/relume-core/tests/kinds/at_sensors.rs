//! Links and errors of solutions that are made for given sensors, beside those that are made for points anywhere.
//!
//!     cargo test --release -p relume-core --test tests for_given_sensors -- --ignored --nocapture
//!
//! with, if wanted, `RELUME_KINDS=pillar,street` and `RELUME_TOLERANCES=0.1,0.02` in the environment.

use std::sync::Arc;

use relume_core::scene::Scene;
use relume_core::session::{Aim, MountedSensor, PointError, Sensor, Session};

use super::{FINE, Maker, POINTS, SCENES, solved};

/// Sensors of a set.
const FEW: usize = 8;

fn all(e: [f64; 3]) -> f64 {
    e.iter().sum()
}

/// Named sets of sensors on surfaces: a few in all of the scene, a few close to each other in two places, and many.
fn sets(scene: &Scene, fine: &Session) -> Vec<(&'static str, Vec<Sensor>)> {
    let frame = fine.frame().expect("a frame");
    let on = |point: &PointError| {
        let patch = &scene.patches[point.patch.0 as usize];
        let pose = scene.pose(patch.body, 0.0).expect("every body is present");
        Sensor { at: point.at, normal: pose.direction(patch.frame.normal) }
    };
    let points: Vec<Sensor> = frame.errors(POINTS).iter().map(on).collect();
    let right = frame.irradiances_at(&points);
    let mean = right.iter().map(|&e| all(e)).sum::<f64>() / points.len() as f64;
    let lit = points.iter().zip(&right).filter(|(_, e)| all(**e) > 1e-3 * mean);
    let points: Vec<Sensor> = lit.map(|(p, _)| *p).collect();
    let spread = points.iter().step_by(points.len().div_ceil(FEW)).copied().collect();
    let near = |k: usize| {
        let middle = points[k % points.len()].at;
        let mut sorted = points.clone();
        sorted.sort_by(|a, b| a.at.distance(middle).total_cmp(&b.at.distance(middle)));
        sorted.truncate(FEW);
        sorted
    };
    vec![("a few", spread), ("one place", near(37)), ("another place", near(113)), ("many", points)]
}

#[test]
#[ignore = "minutes; prints a table"]
fn for_given_sensors() {
    let listed = |name: &str| std::env::var(name).ok();
    let kinds = listed("RELUME_KINDS");
    let tolerances: Vec<f64> = listed("RELUME_TOLERANCES")
        .unwrap_or_else(|| "0.1,0.02".into())
        .split(',')
        .map(|t| t.parse().expect("a tolerance"))
        .collect();
    println!(
        "| scene | tolerance | sensors | links for points | error, of the tolerance | links for these | error |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, _) in SCENES {
        if kinds.as_ref().is_some_and(|kinds| !kinds.split(',').any(|kind| kind == *name)) {
            continue;
        }
        let scene = Arc::new(Maker::scene(name));
        let fine = solved(&scene, FINE, Aim::Mesh);
        let sets = sets(&scene, &fine);
        for &tolerance in &tolerances {
            let anywhere = solved(&scene, tolerance, Aim::Points);
            for (set, sensors) in &sets {
                let right = fine.frame().expect("a frame").irradiances_at(sensors);
                let error = |session: &Session| {
                    let read = session.frame().expect("a frame").irradiances_at(sensors);
                    let square = |(&is, &right): (&[f64; 3], &[f64; 3])| {
                        let (is, right) = (all(is), all(right));
                        ((is - right) / is.max(right)).powi(2)
                    };
                    let sum = read.iter().zip(&right).map(square).sum::<f64>();
                    (sum / sensors.len() as f64).sqrt() / tolerance
                };
                let mounted: Arc<[MountedSensor]> =
                    sensors.iter().map(|&sensor| MountedSensor { body: None, sensor }).collect();
                let here = solved(&scene, tolerance, Aim::Sensors(mounted));
                let links = |session: &Session| session.frame().expect("a frame").report().links;
                println!(
                    "| {name} | {tolerance} | {set} | {} | {:.3} | {} | {:.3} |",
                    links(&anywhere),
                    error(&anywhere),
                    links(&here),
                    error(&here),
                );
            }
        }
    }
}
