//! Light from outside against closed forms, a path tracer of its own, and cold builds.
// Reference values may use the platform's functions: nothing that the engine decides rests on them.
#![allow(clippy::disallowed_methods)]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common;
use crate::common::{at_tolerance, still, v};
use glam::DVec3;
use rayon::prelude::*;
use relume_core::scene::outside::{
    Day, Environment, Outside, SUN_DIAMETER_DEG, Sky, Sun, SunPlace,
};
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{Sensor, Session, Update};
use relume_judge::{Random, World};

const UP: DVec3 = DVec3::Y;

/// A black floor of `size` m about the origin, with what `fill` adds.
fn floor(size: f64, fill: impl Fn(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::new("floor");
    let black = b.material("black", [0.0; 3], [0.0; 3]);
    let node = still(&mut b, "floor");
    let h = 0.5 * size;
    b.polygon(node, "floor", black, &[v(-h, 0.0, h), v(h, 0.0, h), v(h, 0.0, -h), v(-h, 0.0, -h)]);
    fill(&mut b);
    b.build().unwrap()
}

fn under(sky: Sky) -> Outside {
    Outside { sky: Some(sky), fineness: 0.002, ..Outside::default() }
}

fn sun_at(azimuth: f64, elevation: f64, irradiance: f64) -> Sun {
    Sun {
        place: SunPlace::Direction { azimuth, elevation },
        irradiance: Some([irradiance; 3]),
        diameter_deg: SUN_DIAMETER_DEG,
    }
}

fn solved(scene: Scene, outside: Outside, tolerance: f64) -> Session {
    let scene = Arc::new(scene.with_outside(outside).unwrap());
    let mut session = Session::new(scene, at_tolerance(tolerance)).unwrap();
    session.step(0, 0.0).unwrap();
    session
}

/// The mean irradiance of a surface, as elements have it.
fn mean_of(session: &Session, surface: &str) -> f64 {
    let snapshot = session.frame().unwrap().solution();
    let (mut sum, mut all) = (0.0, 0.0);
    for (k, patch) in (0..).zip(&snapshot.scene.patches) {
        if snapshot.scene.surfaces[patch.surface.0 as usize].name == surface {
            for leaf in snapshot.leaves_of(relume_core::scene::PatchId(k)) {
                let c = leaf.corners;
                let area = (0.5 * (c[2] - c[0]).perp_dot(c[3] - c[1])).abs();
                sum += area * f64::from(leaf.irradiance[0]);
                all += area;
            }
        }
    }
    sum / all
}

#[track_caller]
fn close(found: f64, exact: f64, share: f64) {
    assert!((found / exact - 1.0).abs() <= share, "{found} for {exact}");
}

#[test]
fn a_horizontal_surface_sees_the_whole_sky() {
    let sun = || Some(sun_at(120.0, 35.0, 0.0));
    let skies = [
        (Sky::Uniform([2.0; 3]), 2.0 * PI),
        (Sky::Overcast { irradiance: 100.0 }, 100.0),
        (Sky::Clear { irradiance: 70.0 }, 70.0),
        (Sky::AllWeather { direct: 600.0, diffuse: 90.0 }, 90.0),
        (Sky::AllWeather { direct: 10.0, diffuse: 150.0 }, 150.0),
    ];
    for (sky, exact) in skies {
        let outside = Outside { sun: sun(), ..under(sky.clone()) };
        let session = solved(floor(2.0, |_| ()), outside, 0.01);
        let share = if matches!(sky, Sky::AllWeather { .. }) { 2e-3 } else { 1e-3 };
        close(mean_of(&session, "floor"), exact, share);
        close(session.frame().unwrap().irradiance_at(v(0.3, 0.0, 0.1), UP)[0], exact, share);
    }
}

#[test]
fn a_wall_sees_half_of_a_uniform_sky_and_the_ground() {
    let wall = |b: &mut SceneBuilder| {
        let black = b.material("wall", [0.0; 3], [0.0; 3]);
        let node = still(b, "wall");
        let corners = [v(5.0, 0.0, -5.0), v(5.0, 0.0, -3.0), v(5.0, 2.0, -3.0), v(5.0, 2.0, -5.0)];
        b.polygon(node, "wall", black, &corners);
    };
    let scene = || floor(0.1, wall);
    let session = solved(scene(), under(Sky::Uniform([3.0; 3])), 0.01);
    close(mean_of(&session, "wall"), 1.5 * PI, 1e-3);
    // Under an overcast sky of zenith radiance 1: 1/3 (pi / 2 + 4 / 3) = 0.9680.
    let overcast = under(Sky::Overcast { irradiance: 7.0 * PI / 9.0 });
    close(mean_of(&solved(scene(), overcast, 0.01), "wall"), (PI / 2.0 + 4.0 / 3.0) / 3.0, 1e-3);
    // Ground of reflectance 0.4 under a sky of radiance 3.
    let grounded = Outside { ground: 0.4, ..under(Sky::Uniform([3.0; 3])) };
    close(mean_of(&solved(scene(), grounded, 0.01), "wall"), 1.5 * PI * 1.4, 1e-3);
}

#[test]
fn a_floor_between_two_long_walls_sees_a_strip_of_sky() {
    let (long, height, half) = (100.0, 1.5, 1.0);
    let walls = |b: &mut SceneBuilder| {
        let black = b.material("wall", [0.0; 3], [0.0; 3]);
        let node = still(b, "walls");
        for side in [-1.0, 1.0] {
            let x = side * half;
            let mut c =
                vec![v(x, 0.0, long), v(x, 0.0, -long), v(x, height, -long), v(x, height, long)];
            if side > 0.0 {
                c.reverse();
            }
            b.polygon(node, "walls", black, &c);
        }
    };
    let session = solved(floor(2.0, walls), under(Sky::Uniform([1.0; 3])), 0.005);
    // E = pi L (sin left + sin right) / 2, the angles from the zenith to the upper edges.
    let at = |x: f64| {
        let sine = |d: f64| d / d.hypot(height);
        0.5 * PI * (sine(half - x) + sine(half + x))
    };
    for x in [0.0, 0.3, -0.7, 0.95] {
        close(session.frame().unwrap().irradiance_at(v(x, 0.0, 0.2), UP)[0], at(x), 1e-3);
    }
    let mean = (0..1000).map(|k| at(-1.0 + (f64::from(k) + 0.5) / 500.0)).sum::<f64>() / 1000.0;
    close(mean_of(&session, "floor"), mean, 1e-3);
}

#[test]
fn the_sun_shines_aslant_and_its_shadows_are_soft() {
    let outside = || Outside { sun: Some(sun_at(90.0, 40.0, 500.0)), ..Outside::default() };
    let session = solved(floor(2.0, |_| ()), outside(), 0.01);
    close(mean_of(&session, "floor"), 500.0 * 40_f64.to_radians().sin(), 1e-3);

    // The upper edge of a wall throws a penumbra as wide as the disc is high over the sine squared of its elevation.
    let height = 2.0;
    let wall = |b: &mut SceneBuilder| {
        let black = b.double_sided_material("wall", [0.0; 3], [0.0; 3]);
        let node = still(b, "wall");
        b.polygon(
            node,
            "wall",
            black,
            &[v(3.0, 0.0, 30.0), v(3.0, 0.0, -30.0), v(3.0, height, -30.0), v(3.0, height, 30.0)],
        );
    };
    let session = solved(floor(10.0, wall), outside(), 0.02);
    let (elevation, radius) = (40_f64.to_radians(), 0.5 * SUN_DIAMETER_DEG.to_radians());
    let edge = 3.0 - height / elevation.tan();
    let width = height / (elevation - radius).tan() - height / (elevation + radius).tan();
    // In the east the sun: shadow is west of the wall, from x = 3 down to the edge.
    let at = |x: f64| {
        session.frame().unwrap().irradiance_at(v(x, 0.0, 0.0), UP)[0] / (500.0 * elevation.sin())
    };
    close(at(edge - 0.6 * width), 1.0, 2e-3);
    assert!(at(edge + 0.6 * width) < 1e-6);
    // Of a disc the share above a chord at height h of its radius.
    for share in [-0.3, -0.1, 0.0, 0.1, 0.3] {
        let x = edge - share * width;
        let height_deg = (height / (3.0 - x)).atan();
        let h = (height_deg - elevation) / radius;
        let seen = (h.clamp(-1.0, 1.0).acos() - h * (1.0 - h * h).max(0.0).sqrt()) / PI;
        assert!((at(x) - seen).abs() < 0.02, "{} for {seen}", at(x));
    }
}

/// A room of 4 m x 2.7 m x 3 m with a window of 1.2 m x 1 m in its eastern wall and nothing outside; `fill` adds to it.
fn room_with_a_window(fill: impl Fn(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::new("room");
    let wall = b.material("wall", [0.6; 3], [0.0; 3]);
    let node = still(&mut b, "room");
    let (x, y, z) = (4.0, 2.7, 3.0);
    let mut add = |name: &str, c: [DVec3; 4]| b.polygon(node, name, wall, &c);
    add("floor", [v(0.0, 0.0, z), v(x, 0.0, z), v(x, 0.0, 0.0), v(0.0, 0.0, 0.0)]);
    add("ceiling", [v(0.0, y, 0.0), v(x, y, 0.0), v(x, y, z), v(0.0, y, z)]);
    add("west", [v(0.0, 0.0, z), v(0.0, 0.0, 0.0), v(0.0, y, 0.0), v(0.0, y, z)]);
    add("north", [v(0.0, 0.0, 0.0), v(x, 0.0, 0.0), v(x, y, 0.0), v(0.0, y, 0.0)]);
    add("south", [v(x, 0.0, z), v(0.0, 0.0, z), v(0.0, y, z), v(x, y, z)]);
    // Around the window, z from 0.9 to 2.1, y from 1 to 2.
    let mut east = |y0: f64, y1: f64, z0: f64, z1: f64| {
        add("east", [v(x, y0, z0), v(x, y0, z1), v(x, y1, z1), v(x, y1, z0)]);
    };
    east(0.0, 1.0, 0.0, z);
    east(2.0, y, 0.0, z);
    east(1.0, 2.0, 0.0, 0.9);
    east(1.0, 2.0, 2.1, z);
    fill(&mut b);
    b.build().unwrap()
}

/// Irradiance by paths that end outside, or where nothing is reflected: what the sky sends there, and at every place what
/// the sun sends. With its standard error.
fn path_traced(scene: &Scene, outside: &Outside, sensor: &Sensor, paths: u32) -> (f64, f64) {
    let world = World::new(common::judged::polygons(scene, 0.0));
    let now = outside.at(0.0).unwrap();
    let lit = outside.sun.as_ref().map(|sun| {
        let SunPlace::Direction { azimuth, elevation } = sun.place else { panic!("a day") };
        let (a, e) = (azimuth.to_radians(), elevation.to_radians());
        (v(e.cos() * a.sin(), e.sin(), -e.cos() * a.cos()), sun.irradiance.unwrap()[0])
    });
    let radius = 0.5 * SUN_DIAMETER_DEG.to_radians();
    let batches = 64_u64;
    let batch = |k: u64| {
        let mut random = Random::of_part(7, k);
        let (mut sum, count) = (0.0, paths / batches as u32);
        let turned = random.unit();
        for n in 0..count {
            let (mut at, mut normal, mut weight, mut on) = (sensor.at, sensor.normal, 1.0, None);
            // The first directions are spread evenly: a window is a small part of what a place sees.
            let n = f64::from(n);
            let mut even =
                Some(((n + random.unit()) / f64::from(count), (n * GOLDEN + turned).fract()));
            loop {
                let from = at + normal * 1e-7;
                if let Some((towards, irradiance)) = lit {
                    let (side, up) = axes(towards);
                    let (r, turn) = (radius * random.unit().sqrt(), 2.0 * PI * random.unit());
                    let d = (towards + side * (r * turn.cos()) + up * (r * turn.sin())).normalize();
                    if d.dot(normal) > 0.0 && world.first_hit(from, d, on).is_none() {
                        sum += weight * irradiance * d.dot(normal);
                    }
                }
                let (side, up) = axes(normal);
                let (r2, turn) = even.take().unwrap_or_else(|| (random.unit(), random.unit()));
                let turn = 2.0 * PI * turn;
                let d =
                    normal * (1.0 - r2).sqrt() + (side * turn.cos() + up * turn.sin()) * r2.sqrt();
                let Some(hit) = world.first_hit(from, d, on) else {
                    // The sun's disc was counted.
                    let is_sun = lit.is_some_and(|(towards, _)| d.dot(towards) >= radius.cos());
                    sum += if is_sun { 0.0 } else { weight * PI * now.radiance(d)[0] };
                    break;
                };
                if !hit.front {
                    break;
                }
                weight *= world.polygons()[hit.polygon].reflectance[0];
                if weight < 0.05 {
                    if random.unit() < 0.5 {
                        break;
                    }
                    weight *= 2.0;
                }
                (at, normal, on) =
                    (from + d * hit.distance, world.normal(hit.polygon), Some(hit.polygon));
            }
        }
        sum / f64::from(count)
    };
    let found: Vec<f64> = (0..batches).into_par_iter().map(batch).collect();
    mean_and_error(&found)
}

/// Mean of independent estimates, with its standard error.
fn mean_and_error(found: &[f64]) -> (f64, f64) {
    let n = found.len() as f64;
    let mean = found.iter().sum::<f64>() / n;
    let spread = found.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
    (mean, (spread / (n * (n - 1.0))).sqrt())
}

/// The fractional part of the golden ratio: multiples of it are spread evenly over the unit interval.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Two unit vectors at right angles to another.
fn axes(normal: DVec3) -> (DVec3, DVec3) {
    let any = if normal.x.abs() < 0.7 { DVec3::X } else { DVec3::Y };
    let side = normal.cross(any).normalize();
    (side, normal.cross(side))
}

/// Places on the floor and on walls of the room.
fn places() -> Vec<Sensor> {
    let sensor = |at, normal| Sensor { at, normal };
    let mut out = Vec::new();
    for x in [0.3, 1.3, 2.3, 3.0, 3.7] {
        out.push(sensor(v(x, 0.0, 1.5), UP));
        out.push(sensor(v(x, 0.0, 0.5), UP));
        out.push(sensor(v(x, 2.7, 1.8), -UP));
    }
    out.extend([0.4, 1.2, 2.2].map(|y| sensor(v(0.0, y, 1.4), DVec3::X)));
    out.extend([0.4, 1.2, 2.2].map(|y| sensor(v(1.8, y, 0.0), DVec3::Z)));
    out
}

/// Paths from each place.
const PATHS: u32 = 240_000;

/// The root mean square of relative errors at some places, against path tracing.
fn error_of(name: &str, scene: &Scene, outside: &Outside, places: &[Sensor], tolerances: &[f64]) {
    let exact: Vec<(f64, f64)> =
        places.iter().map(|s| path_traced(scene, outside, s, PATHS)).collect();
    let noise = exact.iter().map(|(e, s)| (s / e).powi(2)).sum::<f64>() / exact.len() as f64;
    for &tolerance in tolerances {
        let outside = Outside { fineness: tolerance, ..outside.clone() };
        let session = solved(scene.clone(), outside, tolerance);
        let found = session.frame().unwrap().irradiances_at(places);
        let off = |(f, e): (&[f64; 3], &(f64, f64))| f[0] / e.0 - 1.0;
        let off: Vec<f64> = found.iter().zip(&exact).map(off).collect();
        let rms = (off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64).sqrt();
        let report = session.frame().unwrap().report();
        println!(
            "{name} at {tolerance}: {} facets, {} links, {:.2} s, off by {rms:.4} (noise {:.4}), {}",
            session.scene().patches.len() - scene.patches.len(),
            report.links,
            report.seconds.total,
            noise.sqrt(),
            common::brief(&off)
        );
        assert!(rms <= (tolerance * tolerance + noise).sqrt(), "{name}: {rms} at {tolerance}");
        let energy = report.energy.unwrap();
        assert!(energy.unbalanced() < tolerance, "{energy:?}");
    }
}

#[test]
fn light_comes_through_a_window() {
    let scene = room_with_a_window(|_| ());
    let outside = under(Sky::Uniform([10.0; 3]));
    error_of("window", &scene, &outside, &places(), &[0.05, 0.02, 0.01]);
    let sky = Sky::Clear { irradiance: 100.0 };
    let outside = Outside { sun: Some(sun_at(100.0, 30.0, 600.0)), ..under(sky) };
    error_of("sun patch", &scene, &outside, &places(), &[0.05, 0.02, 0.01]);
}

#[test]
fn a_street_of_boxes_stands_under_a_clear_sky() {
    let mut b = SceneBuilder::new("street");
    let (road, house) =
        (b.material("road", [0.3; 3], [0.0; 3]), b.material("house", [0.5; 3], [0.0; 3]));
    let node = still(&mut b, "road");
    b.polygon(
        node,
        "road",
        road,
        &[v(-15.0, 0.0, 40.0), v(15.0, 0.0, 40.0), v(15.0, 0.0, -40.0), v(-15.0, 0.0, -40.0)],
    );
    for k in 0..6 {
        for (side, x) in [(-1.0, -14.0), (1.0, 5.0)] {
            let (z, height) = (
                12.0 * f64::from(k) - 35.0,
                6.0 + 2.0 * f64::from((k * 7 + side as i32 * 3).rem_euclid(5)),
            );
            let node = still(&mut b, &format!("house {k} {side}"));
            b.cuboid(node, "house", house, v(x, 0.0, z), v(x + 9.0, height, z + 10.0));
        }
    }
    let scene = b.build().unwrap();
    let sensor = |at, normal| Sensor { at, normal };
    let mut places: Vec<Sensor> = [-4.0, -1.0, 2.0, 4.5]
        .into_iter()
        .flat_map(|x| [-20.3, 0.7, 13.2].map(|z| sensor(v(x, 0.0, z), UP)))
        .collect();
    places.extend([1.0, 3.0, 5.0].map(|y| sensor(v(-5.0, y, -6.0), DVec3::X)));
    places.extend([1.0, 3.0, 5.0].map(|y| sensor(v(5.0, y, 6.0), -DVec3::X)));
    let sun = Some(sun_at(150.0, 40.0, 600.0));
    let outside = Outside { sun, ..under(Sky::Clear { irradiance: 100.0 }) };
    error_of("street", &scene, &outside, &places, &[0.05, 0.02, 0.01]);
}

#[test]
fn a_day_with_blinds_before_the_window_equals_cold_builds() {
    let scene = room_with_a_window(|b| {
        let grey = b.double_sided_material("blind", [0.5; 3], [0.0; 3]);
        let blind = common::sliding(b, "blind", v(4.1, 1.0, 0.9), v(4.1, 2.0, 0.9));
        b.polygon(
            blind,
            "blind",
            grey,
            &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.2), v(0.0, 1.0, 1.2), v(0.0, 1.0, 0.0)],
        );
    });
    // 2026-06-21, from 5 to 13 o'clock at the meridian: the sun rises, and leaves the window.
    let place = SunPlace::Earth { latitude: 48.0, longitude: 0.0, unix_s: 1_781_995_200.0 };
    let sun = Sun { place, irradiance: None, diameter_deg: SUN_DIAMETER_DEG };
    let day = Day { from_s: 3.0 * 3600.0, to_s: 13.0 * 3600.0, over_s: 1.0 };
    let outside = Outside {
        sun: Some(sun),
        day: Some(day),
        fineness: 0.3,
        ..under(Sky::Turbid { turbidity: 3.0 })
    };
    let scene = Arc::new(scene.with_outside(outside).unwrap());
    for oracle in [at_tolerance(0.3), common::form_factor_oracle(0.3, 0.3)] {
        for update in [Update::Certificate, Update::Reinspect] {
            let options = relume_core::session::Options { update, ..oracle.clone() };
            let scratch =
                relume_core::session::Options { update: Update::Scratch, ..oracle.clone() };
            let mut warm = Session::new(Arc::clone(&scene), options).unwrap();
            let mut cold = Session::new(Arc::clone(&scene), scratch).unwrap();
            let mut emitted = Vec::new();
            for (k, time) in
                [0.0, 0.1, 0.25, 0.3, 0.35, 0.4, 0.6, 0.61, 1.0, 0.35].into_iter().enumerate()
            {
                let one = warm.step(k as u32, time).unwrap();
                let two = cold.step(k as u32, time).unwrap();
                println!(
                    "{time}: {} links, {} examined, {:.3} s of {:.3}",
                    one.links, one.work.examined, one.seconds.total, two.seconds.total
                );
                let differ = || common::pairs::first_differences(&warm, &cold);
                assert!(one.hash == two.hash, "at {time}: {}", differ());
                assert_eq!((one.elements, one.leaves), (two.elements, two.leaves), "at {time}");
                emitted.push(one.energy.unwrap().emitted_w);
            }
            // Night, morning with the sun in the room, and noon.
            assert!(
                emitted[0] < 1e-9 && emitted[6] > 2.0 * emitted[8] && emitted[8] > 1.0,
                "{emitted:?}"
            );
        }
    }
}

/// A picture of 64 x 32 pixels with one of them bright.
fn spotted(bright: (u32, u32), radiance: f32) -> Vec<[f32; 3]> {
    let at = (bright.1 * 64 + bright.0) as usize;
    (0..64 * 32).map(|k| if k == at { [radiance; 3] } else { [0.5, 1.0, 2.0] }).collect()
}

/// Direction of the middle of a pixel, and its solid angle.
fn pixel(x: u32, y: u32) -> (DVec3, f64) {
    let across = (f64::from(x) + 0.5) / 64.0 * 2.0 * PI - PI;
    let (top, bottom) = (f64::from(y) / 32.0 * PI, f64::from(y + 1) / 32.0 * PI);
    let down = 0.5 * (top + bottom);
    let d = v(down.sin() * across.sin(), down.cos(), -down.sin() * across.cos());
    (d, (top.cos() - bottom.cos()) * 2.0 * PI / 64.0)
}

#[test]
fn a_picture_lights_from_all_round_and_its_brightest_pixel_is_a_lamp() {
    let wall = |b: &mut SceneBuilder| {
        let black = b.material("wall", [0.0; 3], [0.0; 3]);
        let node = still(b, "wall");
        // It faces east.
        let c = [v(5.0, 0.0, 1.0), v(5.0, 0.0, -1.0), v(5.0, 2.0, -1.0), v(5.0, 2.0, 1.0)];
        b.polygon(node, "wall", black, &c);
    };
    // North-east and up.
    let (radiance, at) = (900.0, (40, 10));
    let picture = Environment::new("spot", (64, 32), spotted(at, radiance)).unwrap();
    let outside = |turn: f64| under(Sky::Environment(Arc::new(picture.clone().turned(turn))));
    let session = solved(floor(1.0, wall), outside(0.0), 0.01);
    let (towards, solid) = pixel(at.0, at.1);
    let lamp = (f64::from(radiance) - 0.5) * solid;
    assert!(towards.x > 0.5 && towards.z < -0.1, "{towards}");
    close(
        session.frame().unwrap().irradiance_at(DVec3::ZERO, UP)[0],
        0.5 * PI + lamp * towards.y,
        5e-3,
    );
    let east = session.frame().unwrap().irradiance_at(v(5.0, 1.0, 0.0), DVec3::X);
    close(east[0], 0.5 * PI + lamp * towards.x, 5e-3);
    close(mean_of(&session, "wall"), east[0], 5e-3);
    // Turned by a quarter to the left, what was in the north-east is in the north-west.
    let session = solved(floor(1.0, wall), outside(90.0), 0.01);
    close(session.frame().unwrap().irradiance_at(v(5.0, 1.0, 0.0), DVec3::X)[2], 2.0 * PI, 5e-3);
    close(
        session.frame().unwrap().irradiance_at(v(5.0, 1.0, 0.0), -DVec3::Z)[0],
        0.5 * PI + lamp * towards.x,
        5e-3,
    );
}

#[test]
fn environments_of_impossible_pixels_are_refused() {
    assert!(Environment::new("x", (2, 1), vec![[0.0, f32::NAN, 0.0]; 2]).is_err());
    assert!(Environment::new("x", (2, 1), vec![[0.0; 3]; 3]).is_err());
}

#[test]
fn what_makes_no_sense_is_refused_with_its_remedy() {
    let sun = |azimuth, elevation| Some(sun_at(azimuth, elevation, 1.0));
    let day = Some(Day { from_s: 0.0, to_s: 1.0, over_s: 1.0 });
    let outsides = [
        (under(Sky::Clear { irradiance: 1.0 }), "`Outside::sun`"),
        (under(Sky::Uniform([-1.0; 3])), "0 to 1e12"),
        (Outside { sun: sun(0.0, 91.0), ..Outside::default() }, "-90 to 90"),
        (Outside { sun: sun(0.0, 45.0), day, ..Outside::default() }, "`SunPlace::Earth`"),
        (Outside { ground: 1.0, ..under(Sky::Uniform([1.0; 3])) }, "less than 1"),
        (Outside { sun: sun(0.0, 45.0), ..under(Sky::Turbid { turbidity: 40.0 }) }, "hazy"),
    ];
    for (outside, remedy) in outsides {
        let error = floor(1.0, |_| ()).with_outside(outside).unwrap_err().to_string();
        assert!(error.contains(remedy), "{error}");
    }
    let error = floor(1e9, |_| ()).with_outside(under(Sky::Uniform([1.0; 3]))).unwrap_err();
    assert!(error.to_string().contains("scale it"), "{error}");
}

#[test]
fn what_is_outside_has_no_place_in_the_scene() {
    let scene = floor(2.0, |_| ());
    let sky = Outside {
        sun: Some(sun_at(10.0, 50.0, 1.0)),
        ground: 0.2,
        ..under(Sky::Uniform([1.0; 3]))
    };
    let lit = scene.clone().with_outside(sky).unwrap();
    assert_eq!((lit.area_m2(), lit.bounds(0.0)), (scene.area_m2(), scene.bounds(0.0)));
    let near = lit.without_outside();
    assert_eq!((near.bodies.len(), near.patches.len()), (scene.bodies.len(), scene.patches.len()));
    assert_eq!(near.surfaces.len(), scene.surfaces.len());
    let mut session = Session::new(Arc::new(lit), at_tolerance(0.1)).unwrap();
    let report = session.step(0, 0.0).unwrap();
    // What is sent to the sky escapes: of a black floor nothing, and all that arrives is absorbed.
    let energy = report.energy.unwrap();
    assert!((energy.absorbed_w / energy.emitted_w - 1.0).abs() < 1e-3, "{energy:?}");
    assert!(energy.escaped_w.abs() < 1e-3 * energy.emitted_w, "{energy:?}");
    let sky_leaves = |p: u32| {
        session.frame().unwrap().solution().leaves_of(relume_core::scene::PatchId(p)).len()
    };
    assert_eq!(sky_leaves(scene.patches.len() as u32), 0);
}
