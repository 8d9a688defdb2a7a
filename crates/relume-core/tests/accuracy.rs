//! What a solution says of its own errors, beside the judge's path tracer.

use crate::common::{at_tolerance, facing_up, flipped, judged, lit_room, v};
use glam::{DQuat, DVec3};
use relume_core::scene::{MaterialId, Scene, SceneBuilder};
use relume_core::session::{Aim, MountedSensor, Options, PointError, Sensor, Session};
use relume_judge::path::{self, Site};
use relume_judge::{Random, World};

use std::sync::Arc;

/// Two rooms of 4 x 3 m, 2.5 m high, with a wall between them that leaves 0.4 m open; the lamp is in the first.
fn behind_a_slit() -> Scene {
    let mut b = SceneBuilder::new("slit");
    let grey = b.material("grey", [0.6; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [100.0; 3]);
    let node = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(node, "room", grey, DVec3::ZERO, v(8.0, 3.0, 2.5));
    b.cuboid(node, "wall", grey, v(3.95, 0.0, 0.0), v(4.05, 2.6, 2.5));
    b.polygon(node, "lamp", glow, &flipped(facing_up([1.0, 1.8], [1.0, 1.8], 2.4)));
    b.build().unwrap()
}

/// A room with a row of narrow blocks along it, 0.3 m apart, lit from one end.
fn between_blocks() -> Scene {
    let mut b = SceneBuilder::new("blocks");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [60.0; 3]);
    let node = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(node, "room", grey, DVec3::ZERO, v(5.0, 4.0, 3.0));
    let add = |b: &mut SceneBuilder, k: u32, grey: MaterialId| {
        let x = 0.8 + 0.7 * f64::from(k);
        b.cuboid(node, &format!("block {k}"), grey, v(x, 1.0, 0.0), v(x + 0.4, 3.0, 2.0));
    };
    (0..5).for_each(|k| add(&mut b, k, grey));
    b.polygon(node, "lamp", glow, &flipped(facing_up([0.5, 4.5], [0.2, 0.7], 2.9)));
    b.build().unwrap()
}

/// Places on the surfaces of a scene, drawn evenly by patch, a little off them.
fn places(scene: &Scene, count: usize, random: &mut Random) -> Vec<Sensor> {
    let polygons = judged::polygons(scene, 0.0);
    let lit: Vec<_> = polygons.iter().filter(|p| p.exitance == [0.0; 3]).collect();
    (0..count)
        .map(|k| {
            let corners = &lit[k * lit.len() / count].corners;
            let [a, b, d] = [corners[0], corners[1], corners[corners.len() - 1]];
            let (s, t) = (random.unit(), random.unit());
            let normal = (b - a).cross(d - a).normalize();
            Sensor { at: a + (b - a) * s + (d - a) * t * 0.999 + normal * 1e-6, normal }
        })
        .collect()
}

#[test]
fn a_solution_knows_its_own_error() {
    let scenes = [(lit_room(), 0.9), (behind_a_slit(), 0.5), (between_blocks(), 0.5)];
    let all = |e: [f64; 3]| e.iter().sum::<f64>();
    let mut found_alike = Vec::new();
    for (scene, tolerance) in scenes {
        let scene = Arc::new(scene);
        let sensors = places(&scene, 128, &mut Random::of_part(5, 0));
        let world = World::new(judged::polygons(&scene, 0.0));
        let sites: Vec<Site> = sensors.iter().map(|s| Site::point(s.at, s.normal)).collect();
        let truth = path::irradiance(&world, &sites, 400, 1);
        // Not in the dark of gaps, where the error of a few would be all that is seen.
        let mean = truth.iter().map(|t| all(t.irradiance)).sum::<f64>() / truth.len() as f64;
        let lit = |k: &usize| all(truth[*k].irradiance) > 0.1 * mean;
        let chosen: Vec<usize> = (0..sensors.len()).filter(lit).collect();
        let sensors: Vec<Sensor> = chosen.iter().map(|&k| sensors[k]).collect();
        let mut session = Session::new(Arc::clone(&scene), at_tolerance(tolerance)).unwrap();
        session.step(0, 0.0).unwrap();
        let said = session.frame().unwrap().accuracy_at(&sensors);
        let said_of_mesh = session.frame().unwrap().accuracy(64);
        let found: Vec<[f64; 3]> = session.frame().unwrap().irradiances_at(&sensors);
        let mesh = session.frame().unwrap().solution();
        let of_mesh: Vec<[f64; 3]> =
            sensors.iter().map(|s| mesh.irradiance_at(s.at, s.normal).unwrap()).collect();
        let square = |(e, &k): (&[f64; 3], &usize)| {
            let right = all(truth[k].irradiance);
            let noise: f64 = truth[k].standard_error.iter().map(|s| s * s).sum();
            (all(*e) / right - 1.0).powi(2) - 3.0 * noise / (right * right)
        };
        let rms_of = |found: &[[f64; 3]]| {
            let squares: f64 = found.iter().zip(&chosen).map(square).sum();
            (squares / found.len() as f64).max(0.0).sqrt()
        };
        for (what, found, said) in [("sensors", &found, said), ("mesh", &of_mesh, said_of_mesh)] {
            let rms = rms_of(found);
            println!(
                "{} at {tolerance}, {what}: RMS {:.2} %, said {:.2} % (resolved {:.2} %, mean {:+.2} %, largest {:+.1} %)",
                scene.name,
                100.0 * rms,
                100.0 * said.rms,
                100.0 * said.resolved,
                100.0 * said.mean,
                100.0 * said.largest,
            );
            let most = said.rms.max(said.resolved);
            found_alike.push(said.rms < 2.0 * rms + said.resolved && rms < 2.0 * most);
        }
    }
    assert!(found_alike.iter().all(|alike| *alike), "{found_alike:?}");
}

#[test]
fn a_solution_made_for_points_has_few_links_and_reads_within_the_tolerance() {
    let all = |e: [f64; 3]| e.iter().sum::<f64>();
    for scene in [lit_room(), behind_a_slit(), between_blocks()] {
        let scene = Arc::new(scene);
        let solved = |tolerance: f64, aim: Aim| {
            let options = Options { aim, ..at_tolerance(tolerance) };
            let mut session = Session::new(Arc::clone(&scene), options).unwrap();
            session.step(0, 0.0).unwrap();
            session
        };
        let sensors = places(&scene, 96, &mut Random::of_part(7, 0));
        let fine = solved(0.01, Aim::Mesh).frame().unwrap().irradiances_at(&sensors);
        let mean = fine.iter().map(|&e| all(e)).sum::<f64>() / fine.len() as f64;
        let links = |session: &Session| session.frame().unwrap().report().links;
        for tolerance in [0.1, 0.02] {
            let session = solved(tolerance, Aim::Points);
            let found = session.frame().unwrap().irradiances_at(&sensors);
            let lit = found.iter().zip(&fine).filter(|(_, right)| all(**right) > 1e-3 * mean);
            let squares: Vec<f64> =
                lit.map(|(&e, &right)| (all(e) / all(right) - 1.0).powi(2)).collect();
            let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
            let (made, of_mesh) = (links(&session), links(&solved(tolerance, Aim::Mesh)));
            println!(
                "{} at {tolerance}: {made} links of {of_mesh}, RMS {:.2} %",
                scene.name,
                100.0 * rms
            );
            assert!(rms < tolerance, "{} at {tolerance}: {rms}", scene.name);
            assert!(5 * made < 4 * of_mesh, "{}: {made} links of {of_mesh}", scene.name);
        }
    }
}

#[test]
fn a_solution_made_for_given_sensors_has_fewer_links_and_reads_within_the_tolerance() {
    let all = |e: [f64; 3]| e.iter().sum::<f64>();
    let mut sums = [0, 0];
    for scene in [lit_room(), behind_a_slit(), between_blocks()] {
        let scene = Arc::new(scene);
        let solved = |tolerance: f64, aim: Aim| {
            let options = Options { aim, ..at_tolerance(tolerance) };
            let mut session = Session::new(Arc::clone(&scene), options).unwrap();
            session.step(0, 0.0).unwrap();
            session
        };
        // In one place, as on a desk, that some light reaches.
        let mut sensors = places(&scene, 48, &mut Random::of_part(8, 0));
        let judge = solved(0.01, Aim::Mesh);
        let reaches = |sensor: &Sensor| all(judge.frame().unwrap().irradiances_at(&[*sensor])[0]);
        sensors.retain(|sensor| reaches(sensor) > 1e-3);
        let middle = sensors[0].at;
        sensors.sort_by(|a, b| a.at.distance(middle).total_cmp(&b.at.distance(middle)));
        sensors.truncate(8);
        let mounted = sensors.iter().map(|&sensor| MountedSensor { body: None, sensor });
        let here = Aim::Sensors(mounted.collect());
        let fine = judge.frame().unwrap().irradiances_at(&sensors);
        let links = |session: &Session| session.frame().unwrap().report().links;
        for tolerance in [0.1, 0.02] {
            let session = solved(tolerance, here.clone());
            let found = session.frame().unwrap().irradiances_at(&sensors);
            let errors = found.iter().zip(&fine).map(|(&e, &right)| all(e) / all(right) - 1.0);
            let rms = (errors.map(|e| e * e).sum::<f64>() / fine.len() as f64).sqrt();
            let (made, of_points) = (links(&session), links(&solved(tolerance, Aim::Points)));
            println!(
                "{} at {tolerance}: {made} links of {of_points}, RMS {:.2} %",
                scene.name,
                100.0 * rms
            );
            assert!(rms < tolerance, "{} at {tolerance}: {rms}", scene.name);
            assert!(made < of_points, "{}: {made} links of {of_points}", scene.name);
            if tolerance < 0.1 {
                sums = [sums[0] + made, sums[1] + of_points];
            }
        }
    }
    // A small room has few links anyway.
    assert!(5 * sums[0] < 4 * sums[1], "{sums:?}");
}

#[test]
fn every_solution_is_told_how_good_it_is_in_little_time() {
    for (scene, tolerance) in [(lit_room(), 0.1), (behind_a_slit(), 0.2), (between_blocks(), 0.1)] {
        let scene = Arc::new(scene);
        let said = [0, 1].map(|_| {
            let mut session = Session::new(Arc::clone(&scene), at_tolerance(tolerance)).unwrap();
            let report = session.step(0, 0.0).unwrap();
            let frame = session.frame().unwrap();
            (frame.estimate(), report, frame.errors(1024))
        });
        let (few, report, many) = &said[0];
        assert_eq!(*few, said[1].0);
        let links = f64::from(few.points) * (report.leaves as f64).sqrt();
        assert!(few.points >= 4 && links <= 0.1 * report.links as f64, "{few:?}");
        let share = many.iter().map(|point| point.share).sum::<f64>();
        assert!((share - 1.0).abs() < 0.1, "{share}");
        let square = many.iter().map(|p| p.share * p.relative().powi(2)).sum::<f64>() / share;
        println!("{}: {few:?}, {:.2} % at many", scene.name, 100.0 * square.sqrt());
        let ratio = few.rms / square.sqrt();
        assert!((0.5..2.0).contains(&ratio), "{}: {few:?}, {ratio} of many", scene.name);
    }
}

#[test]
fn what_is_gathered_to_check_a_solution_is_right() {
    let scene = Arc::new(between_blocks());
    let mut session = Session::new(Arc::clone(&scene), at_tolerance(0.1)).unwrap();
    session.step(0, 0.0).unwrap();
    let points = session.frame().unwrap().errors(96);
    let patch = |k: usize| &scene.patches[points[k].patch.0 as usize];
    let sites: Vec<Site> =
        (0..points.len()).map(|k| Site::point(points[k].at, patch(k).frame.normal)).collect();
    let world = World::new(judged::polygons(&scene, 0.0));
    let truth = path::irradiance(&world, &sites, 400, 1);
    let all = |e: [f64; 3]| e.iter().sum::<f64>();
    // Not where it is dark: what elements send there is wrong already.
    let mean = truth.iter().map(|t| all(t.irradiance)).sum::<f64>() / truth.len() as f64;
    let lit = || points.iter().zip(&truth).filter(|(_, t)| all(t.irradiance) > 0.2 * mean);
    let rms = |of: &dyn Fn(&PointError) -> f64| {
        let square = |(p, t): (&PointError, &path::Estimate)| {
            let right = all(t.irradiance);
            let noise: f64 = t.standard_error.iter().map(|s| s * s).sum();
            p.share * ((of(p) - right).powi(2) - 3.0 * noise) / of(p).max(right).powi(2)
        };
        let (sum, share) = (lit().map(square).sum::<f64>(), lit().map(|l| l.0.share).sum::<f64>());
        (sum / share).max(0.0).sqrt()
    };
    let (mesh, gathered) = (rms(&|p| p.said), rms(&|p| p.arrives));
    println!("mesh {:.2} %, gathered {:.2} %", 100.0 * mesh, 100.0 * gathered);
    assert!(gathered < 0.4 * mesh, "{gathered} of {mesh}");
}

/// A closed room of 5 x 4 x 3 m in which every surface emits 1 W/m2 and reflects 0.8: with blocks that stand 0.3 m apart, all
/// of it has irradiance 5.
fn furnace() -> Scene {
    let mut b = SceneBuilder::new("furnace");
    let all = b.material("all", [0.8; 3], [1.0; 3]);
    let node = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(node, "room", all, DVec3::ZERO, v(5.0, 4.0, 3.0));
    for k in 0..5 {
        let x = 0.8 + 0.7 * f64::from(k);
        b.cuboid(node, &format!("block {k}"), all, v(x, 1.0, 0.5), v(x + 0.4, 3.0, 2.0));
    }
    b.build().unwrap()
}

#[test]
fn what_is_reflected_again_and_again_is_followed() {
    let scene = Arc::new(furnace());
    let mut random = Random::of_part(9, 0);
    let walls = |_: usize| Sensor {
        at: v(random.between(0.1, 4.9), random.between(0.1, 3.9), 0.0),
        normal: DVec3::Z,
    };
    let sensors: Vec<Sensor> = (0..256).map(walls).collect();
    for tolerance in [0.9, 0.3] {
        let mut session = Session::new(Arc::clone(&scene), at_tolerance(tolerance)).unwrap();
        session.step(0, 0.0).unwrap();
        let count = sensors.len() as f64;
        let off = session
            .frame()
            .unwrap()
            .irradiances_at(&sensors)
            .iter()
            .map(|e| e[0] / 5.0 - 1.0)
            .sum::<f64>()
            / count;
        let said = session.frame().unwrap().accuracy_at(&sensors).mean;
        println!("furnace at {tolerance}: {:+.2} % off, said {:+.2} %", 100.0 * off, 100.0 * said);
        assert!((said - off).abs() < 0.007, "{said} of {off}");
    }
}

#[test]
fn accuracy_at_sensors_asks_for_directions_not_for_unit_vectors() {
    let mut session = Session::new(lit_room(), at_tolerance(0.9)).unwrap();
    session.step(0, 0.0).unwrap();
    let frame = session.frame().unwrap();
    let at = v(0.3, 0.1, 0.2);
    let facing = |normal| Sensor { at, normal };
    let unit = frame.accuracy_at(&[facing(v(0.0, 0.6, 0.8))]);
    assert_eq!(unit.points, 1);
    for long in [1e-3, 20.0] {
        let said = frame.accuracy_at(&[facing(v(0.0, 0.6, 0.8) * long)]);
        let off = (said.mean - unit.mean).abs();
        assert!(off < 1e-9 && said.points == 1, "{said:?} at length {long}, {unit:?} at 1");
    }
    // The mesh too is asked along a direction.
    let mesh = frame.solution();
    let floor = |length: f64| mesh.irradiance_at(v(0.3, 0.0, 0.2), DVec3::Y * length);
    assert!(floor(1.0).is_some() && floor(1e-3) == floor(1.0) && floor(0.0).is_none());
    // What has no direction or no place is left out.
    let nowhere = Sensor { at: DVec3::NAN, normal: DVec3::Z };
    let said = frame.accuracy_at(&[facing(DVec3::ZERO), nowhere, facing(v(0.0, 0.6, 0.8))]);
    assert_eq!(said.points, 1);
}
