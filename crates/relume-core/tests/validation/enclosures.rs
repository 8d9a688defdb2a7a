//! Whole enclosures: against a dense matrix of the same leaves, and against path tracing at any pose,
//! with the standard errors of the references as the measure.

use std::sync::Arc;

use glam::DVec3;
use relume_core::scene::PatchId;
use relume_core::session::{Session, Snapshot};
use relume_judge::dense::{Element, exchange_areas, radiosities};
use relume_judge::path::{self, Estimate, Site};
use relume_judge::{Polygon, World};

use crate::common::{self, at_tolerance, judged, leaf_area, rms};

/// The leaves of a solution as elements of the judge's, with their radiosities and patches.
fn leaves(snapshot: &Snapshot) -> (Vec<Element>, Vec<[f32; 3]>) {
    let (mut elements, mut radiosities) = (Vec::new(), Vec::new());
    for polygon in 0..snapshot.scene.patches.len() {
        let patch = PatchId(polygon as u32);
        for leaf in snapshot.leaves_of(patch) {
            assert!(leaf_area(leaf) > 0.0);
            let place = |&p: &glam::DVec2| common::world_point(snapshot, patch, p);
            let mut corners: Vec<DVec3> = leaf.corners.iter().map(place).collect();
            corners.dedup();
            elements.push(Element { polygon, corners });
            radiosities.push(leaf.radiosity);
        }
    }
    (elements, radiosities)
}

/// Area-weighted mean of a channel of some radiosities over each polygon.
fn means(polygons: &[Polygon], elements: &[Element], radiosity: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); polygons.len()];
    for (k, e) in elements.iter().enumerate() {
        let sum = &mut sums[e.polygon];
        *sum = (sum.0 + e.area_m2(), sum.1 + e.area_m2() * radiosity(k));
    }
    sums.into_iter().map(|(area, sum)| sum / area).collect()
}

#[test]
fn dense_solve_on_the_same_leaves() {
    let scene = Arc::new(common::lit_room());
    let mut session = Session::new(Arc::clone(&scene), at_tolerance(0.2)).unwrap();
    // By motion, not from scratch: it is the links of a later frame that count.
    session.step(0, 0.0).unwrap();
    session.step(1, 0.6).unwrap();
    let (elements, found) = leaves(&session.frame().unwrap().solution());
    let polygons = judged::polygons(&scene, 0.6);
    let areas = exchange_areas(&polygons, &elements, 1e-4);
    let dense = radiosities(&polygons, &elements, &areas);
    for c in 0..3 {
        let wanted = means(&polygons, &elements, |k| dense[k][c]);
        let got = means(&polygons, &elements, |k| f64::from(found[k][c]));
        let off: Vec<f64> = got.iter().zip(&wanted).map(|(g, w)| g / w - 1.0).collect();
        let worst = off.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        println!(
            "| dense solve of the same {} leaves, channel {c} | patch means RMS {:.1e} | worst {worst:.1e} |",
            elements.len(),
            rms(&off)
        );
        // Most of it is the dense solve's own: one value a leaf, where a link carries a gradient.
        assert!(rms(&off) < 0.01 && worst < 0.03, "channel {c}: {off:?}");
    }
}

/// Rows of numbers of a file in `tests/data`.
fn rows(name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(common::data(name)).unwrap();
    let numbers = |line: &str| line.split([',', ' ']).map(|x| x.parse().ok()).collect();
    text.lines().filter_map(numbers).collect()
}

/// How values agree with references, in standard errors of their difference: root mean square (1 where
/// the standard errors are right and nothing else errs), mean, and largest.
struct Z {
    rms: f64,
    mean: f64,
    most: f64,
}

/// One value an estimate and channel; `own` is the relative standard error of the values themselves.
fn z_test<'a>(found: &[[f64; 3]], reference: impl Iterator<Item = &'a Estimate>, own: f64) -> Z {
    let mut all = Vec::new();
    for (found, r) in found.iter().zip(reference) {
        for c in 0..3 {
            let se = (r.standard_error[c].powi(2) + (own * r.irradiance[c]).powi(2)).sqrt();
            all.push((found[c] - r.irradiance[c]) / se);
        }
    }
    Z {
        rms: rms(&all),
        mean: all.iter().sum::<f64>() / all.len() as f64,
        most: all.iter().fold(0.0, |m, z| m.max(z.abs())),
    }
}

/// Sensors of the animated room, those in the gap of 1 cm between lamp and ceiling left out: every
/// `step`th of the rest.
fn sensors(step: usize) -> Vec<(usize, Site)> {
    let site = |(k, r): (usize, &Vec<f64>)| {
        let three = |k: usize| DVec3::new(r[k], r[k + 1], r[k + 2]);
        (k, Site::point(three(0), three(3)))
    };
    let listed = rows("box_room.pts");
    let first = rows("box_room.csv");
    let open = |s: &(usize, Site)| (0..4).all(|f| first[f * listed.len() + s.0][8] > 0.05);
    listed.iter().enumerate().map(site).filter(open).step_by(step).collect()
}

#[test]
fn the_path_tracer_agrees_with_another_renderer() {
    let scene = common::shipped("box_room.glb");
    let published = rows("box_room.csv");
    for (k, frame) in [0_u32, 24].into_iter().enumerate() {
        let world = World::new(judged::polygons(&scene, f64::from(frame) / 24.0));
        let sites = sensors(3);
        let places: Vec<Site> = sites.iter().map(|s| s.1).collect();
        let traced = path::irradiance(&world, &places, 60, 3 + u64::from(frame));
        let shipped = sites.iter().map(|(n, _)| {
            let r = &published[3 * k * (published.len() / 4) + n];
            assert_eq!((r[0] as u32, r[1] as usize), (frame, *n));
            ([r[8], r[9], r[10]], [r[11], r[12], r[13]])
        });
        let (values, errors): (Vec<_>, Vec<_>) = shipped.unzip();
        let both: Vec<Estimate> = traced
            .iter()
            .zip(&errors)
            .map(|(t, e)| Estimate {
                irradiance: t.irradiance,
                standard_error: [0, 1, 2]
                    .map(|c| (t.standard_error[c].powi(2) + e[c] * e[c]).sqrt()),
            })
            .collect();
        let z = z_test(&values, both.iter(), 0.0);
        println!(
            "| path tracer against another, frame {frame} | {} sensors | z RMS {:.2}, mean {:+.2}, most {:.1} |",
            sites.len(),
            z.rms,
            z.mean,
            z.most
        );
        assert!((0.75..1.25).contains(&z.rms) && z.mean.abs() < 0.3 && z.most < 5.0);
    }
}

#[test]
fn path_traced_at_other_poses() {
    // Frames that no file holds a reference for.
    let scene = Arc::new(common::shipped("box_room.glb"));
    let mut session = Session::new(Arc::clone(&scene), at_tolerance(0.02)).unwrap();
    for frame in [4_u32, 13] {
        let time = f64::from(frame) / 24.0;
        session.step(frame, time).unwrap();
        let places: Vec<Site> = sensors(5).iter().map(|s| s.1).collect();
        let found: Vec<[f64; 3]> = places
            .iter()
            .map(|s| session.frame().unwrap().irradiance_at(s.origin, s.normal))
            .collect();
        let world = World::new(judged::polygons(&scene, time));
        let traced = path::irradiance(&world, &places, 400, u64::from(frame));
        let z = z_test(&found, traced.iter(), 0.002);
        let pure = z_test(&found, traced.iter(), 0.0);
        let se: Vec<f64> = traced.iter().map(|t| t.standard_error[0] / t.irradiance[0]).collect();
        println!(
            "| sensors of `box_room` at frame {frame} | {} sensors, SE {:.2} % | z RMS {:.2} (without 0.2 %: {:.2}), mean {:+.2}, most {:.1} |",
            places.len(),
            100.0 * rms(&se),
            z.rms,
            pure.rms,
            z.mean,
            z.most
        );
        assert!(z.rms < 1.25 && z.mean.abs() < 0.4 && z.most < 5.0);
    }
}
