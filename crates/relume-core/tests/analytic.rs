//! Form factors with exact answers, as sums over the links of a session; and the irradiance at a
//! point. Figures are printed (`--nocapture`).

// Reference values may use the platform's functions.
#![allow(clippy::disallowed_methods)]

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::common;
use crate::common::{
    Quad, Random, at_tolerance, facing_up, flipped, form_factor, plate_scene, solved, v,
};
use glam::{DQuat, DVec3};
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{Options, Session};
use relume_judge::exact::{self, parallelogram_to_polygon};

const UNIT: [f64; 2] = [0.0, 1.0];

/// A floor and a second plate, nothing emits: all surfaces weigh the same.
fn two_plates(floor: &[DVec3], other: &[DVec3]) -> Scene {
    plate_scene(&[("floor", &[floor.to_vec()]), ("other", &[other.to_vec()])])
}

fn opposed(w: f64, l: f64, distance: f64) -> Scene {
    let floor = facing_up([0.0, w], [0.0, l], 0.0);
    two_plates(&floor, &flipped(facing_up([0.0, w], [0.0, l], distance)))
}

/// A unit-wide plate that rises from the edge x = 0 of the floor at `angle` to it, facing it.
fn hinged(depth: f64, height: f64, angle: f64) -> [Quad; 2] {
    let up = v(angle.cos(), 0.0, angle.sin()) * height;
    let y = v(0.0, 1.0, 0.0);
    [facing_up([0.0, depth], UNIT, 0.0), [DVec3::ZERO, y, y + up, up]]
}

/// F from floor to other at a tolerance, and the links it took.
fn measured(scene: Scene, options: Options) -> (f64, u64) {
    let (session, report) = solved(scene, options);
    (form_factor(&session, "floor", "other"), report.links)
}

fn check(name: &str, scene: Scene, exact: f64, error_max: f64) {
    let (f, links) = measured(scene, Options::default());
    println!("{name}: F {f:.9} exact {exact:.9} off {:+.1e}, {links} links", f - exact);
    assert!((f - exact).abs() <= error_max, "{name}: {f} is not {exact} within {error_max:e}");
}

#[test]
fn squares_face_to_face_and_sharing_an_edge() {
    check("distance 1", opposed(1.0, 1.0, 1.0), 0.199_824_895_698, 1e-4);
    check("distance 2", opposed(1.0, 1.0, 2.0), 0.068_590, 1e-4);
    let [floor, wall] = hinged(1.0, 1.0, FRAC_PI_2);
    check("right angle", two_plates(&floor, &wall), 0.200_043_776_075, 1e-4);
}

#[test]
fn squares_keep_their_factor_when_one_of_them_emits() {
    for lit in ["floor", "other"] {
        let mut b = SceneBuilder::new("lit");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let lamp = b.material("lamp", [0.0; 3], [1.0; 3]);
        let [floor, wall] = hinged(1.0, 1.0, FRAC_PI_2);
        for (name, corners) in [("floor", floor), ("other", wall)] {
            let material = if name == lit { lamp } else { grey };
            common::plates(&mut b, material, &[(name, &[corners.to_vec()])]);
        }
        check(&format!("lit {lit}"), b.build().unwrap(), 0.200_043_776_075, 1e-4);
    }
}

#[test]
fn rectangles_over_decades_of_distance_and_shape() {
    for distance in [0.01, 0.03, 0.1, 0.3, 3.0, 10.0, 100.0] {
        let f = exact::opposed_rectangles(1.0, 1.0, distance);
        check(&format!("squares {distance} apart"), opposed(1.0, 1.0, distance), f, 1e-3 * f);
    }
    for (w, l, c) in [(10.0, 0.1, 0.5), (0.1, 10.0, 0.5), (3.0, 0.3, 3.0)] {
        let f = exact::opposed_rectangles(w, l, c);
        check(&format!("{w} x {l} at {c}"), opposed(w, l, c), f, 2e-3 * f);
    }
    for (w, h) in [(0.1, 1.0), (1.0, 0.1), (10.0, 1.0), (0.01, 0.01)] {
        let f = exact::rectangles_at_right_angles(w, h, 1.0);
        let [floor, wall] = hinged(w, h, FRAC_PI_2);
        check(&format!("hinged {w}, {h}"), two_plates(&floor, &wall), f, 2e-3 * f);
    }
}

#[test]
fn plates_sharing_an_edge_at_other_angles() {
    for degrees in [15.0_f64, 30.0, 60.0, 120.0, 150.0] {
        let [floor, wall] = hinged(1.0, 1.0, degrees.to_radians());
        let f = parallelogram_to_polygon(&floor, &wall);
        // In a sharp wedge both plates carry more: relative to F, the bound is that of the others.
        check(&format!("{degrees} degrees"), two_plates(&floor, &wall), f, 5e-4 * f);
    }
}

#[test]
fn coaxial_discs() {
    // A regular polygon with the disc's area: it differs from the disc to second order only.
    const SIDES: u32 = 24;
    let disc = |radius: f64, z: f64| -> Vec<DVec3> {
        let step = TAU / f64::from(SIDES);
        let r = radius * (step / step.sin()).sqrt();
        let corner = |k: u32| {
            let (sine, cosine) = (f64::from(k) * step).sin_cos();
            v(r * cosine, r * sine, z)
        };
        (0..SIDES).map(corner).collect()
    };
    for (receiver, source, h) in
        [(1.0, 1.0, 1.0), (1.0, 2.0, 1.0), (2.0, 0.5, 0.7), (1.0, 1.0, 5.0)]
    {
        let mut lid = disc(source, h);
        lid.reverse();
        let f = exact::coaxial_discs(receiver, source, h);
        check(
            &format!("discs {receiver}, {source} at {h}"),
            two_plates(&disc(receiver, 0.0), &lid),
            f,
            2e-3 * f,
        );
    }
}

/// The triangles of a unit icosahedron, each split in four and put on the sphere.
fn sphere(radius: f64) -> Vec<Vec<DVec3>> {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for (a, b) in [(1.0, g), (1.0, -g), (-1.0, g), (-1.0, -g)] {
        corners.extend([v(0.0, a, b), v(a, b, 0.0), v(b, 0.0, a)]);
    }
    let mut faces = Vec::new();
    let edge = |p: DVec3, q: DVec3| (p.distance(q) - 2.0).abs() < 1e-9;
    for (i, &p) in corners.iter().enumerate() {
        for (j, &q) in corners.iter().enumerate().skip(i + 1) {
            for &r in &corners[j + 1..] {
                if edge(p, q) && edge(q, r) && edge(r, p) {
                    let out = (q - p).cross(r - p).dot(p) > 0.0;
                    faces.push(if out { [p, q, r] } else { [p, r, q] });
                }
            }
        }
    }
    assert_eq!(faces.len(), 20);
    let mut fine = Vec::new();
    for [p, q, r] in faces {
        let (a, b, c) = ((p + q) / 2.0, (q + r) / 2.0, (r + p) / 2.0);
        for t in [[p, a, c], [a, q, b], [c, b, r], [a, b, c]] {
            fine.push(t.map(|x| x.normalize() * radius).to_vec());
        }
    }
    fine
}

#[test]
fn sphere_in_sphere() {
    let inner = sphere(0.5);
    let mut outer = sphere(1.0);
    outer.iter_mut().for_each(|t| t.reverse());
    let scene = plate_scene(&[("inner", &inner), ("outer", &outer)]);
    // Exact for these polyhedra too: the inner one is convex and the outer one closed.
    let ratio = common::area_of(&scene, "inner") / common::area_of(&scene, "outer");
    let (session, report) = solved(scene, at_tolerance(0.05));
    let out = form_factor(&session, "inner", "outer");
    let back = form_factor(&session, "outer", "inner");
    // Pairs within one surface are unordered: the sum is half of the exchange both ways.
    let own = form_factor(&session, "outer", "outer");
    println!(
        "spheres: F12 {out:.6}, F21 {back:.6} against {ratio:.6}, F22 {own:.6} against {:.6}, {} links, {:.2} s",
        1.0 - ratio,
        report.links,
        report.seconds.total
    );
    assert!((out - 1.0).abs() < 2e-3, "{out}");
    assert!((back - ratio).abs() < 1e-3, "{back} {ratio}");
    assert!((own - (1.0 - ratio)).abs() < 5e-3, "{own} {}", 1.0 - ratio);
    assert_eq!(form_factor(&session, "inner", "inner"), 0.0);
}

#[test]
fn a_blocked_pair_and_its_error_falls_with_the_tolerance() {
    let exact = 0.149_868_671_774;
    let mut b = SceneBuilder::new("blocked");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let floor = facing_up(UNIT, UNIT, 0.0);
    let lid = flipped(facing_up(UNIT, UNIT, 1.0));
    common::plates(&mut b, grey, &[("floor", &[floor.to_vec()]), ("other", &[lid.to_vec()])]);
    let blocker = facing_up([0.0, 0.5], [0.0, 0.5], 0.5);
    common::plates(&mut b, thin, &[("blocker", &[blocker.to_vec()])]);
    let scene = b.build().unwrap();
    let error = |tolerance: f64| {
        let (f, links) = measured(scene.clone(), at_tolerance(tolerance));
        println!("blocked at {tolerance}: F {f:.6} off {:+.1e}, {links} links", f - exact);
        (f - exact).abs()
    };
    let errors = [0.1, 0.02, 0.005, 0.0025].map(error);
    assert!(errors.iter().all(|&e| e < 1e-3), "{errors:?}");
    // Not step by step: the fine two together against the coarse two, unless all are exact.
    let falls = errors[2] + errors[3] < errors[0] + errors[1];
    assert!(falls || errors.iter().all(|&e| e < 1e-4), "{errors:?}");
}

#[test]
fn free_pairs_are_good_at_every_tolerance() {
    let error = |tolerance: f64| {
        let mut sum = 0.0;
        for degrees in [30.0_f64, 90.0, 150.0] {
            let [floor, wall] = hinged(1.0, 1.0, degrees.to_radians());
            let exact = parallelogram_to_polygon(&floor, &wall);
            let (f, _) = measured(two_plates(&floor, &wall), at_tolerance(tolerance));
            sum += (f / exact - 1.0).abs();
        }
        sum
    };
    let errors = [0.5, 0.1, 0.02, 0.005].map(error);
    println!("sum of relative errors at 0.5, 0.1, 0.02, 0.005: {}", common::brief(&errors));
    // What is left is that of the quadrature of a single link, which no refinement mends.
    assert!(errors.iter().all(|&e| e < 7e-4), "{errors:?}");
}

/// F from floor to other and the number of links, with the scene turned, scaled and moved.
fn transformed(quads: &[Quad; 2], turn: DQuat, scale: f64, shift: DVec3) -> (f64, u64) {
    let place = |q: &Quad| q.map(|p| turn * p * scale + shift * scale);
    measured(two_plates(&place(&quads[0]), &place(&quads[1])), Options::default())
}

#[test]
fn scale_changes_nothing() {
    let [floor, wall] = hinged(1.0, 1.0, FRAC_PI_2);
    let apart = [floor, flipped(facing_up([0.2, 1.3], [-0.1, 0.6], 0.8))];
    for (name, quads) in [("right angle", [floor, wall]), ("apart", apart)] {
        let (f, links) = transformed(&quads, DQuat::IDENTITY, 1.0, DVec3::ZERO);
        let mut random = Random(7);
        let mut scales = vec![1e-3, 0.5, 4.0, 1e3];
        scales.extend((0..6).map(|_| 10_f64.powf(random.between(-3.0, 3.0))));
        for scale in scales {
            let (g, other) = transformed(&quads, DQuat::IDENTITY, scale, DVec3::ZERO);
            println!("{name} x {scale:.4}: off {:+.1e}, {other} links ({links})", g / f - 1.0);
            assert!((g / f - 1.0).abs() < 1e-6, "{name} x {scale}: {g} {f}");
            assert_eq!(other, links, "{name} x {scale}");
        }
    }
}

#[test]
fn rotation_changes_nothing() {
    let [floor, wall] = hinged(1.0, 0.8, FRAC_PI_2);
    let apart = [floor, flipped(facing_up([0.2, 1.3], [-0.1, 0.6], 0.8))];
    for (name, quads) in [("right angle", [floor, wall]), ("apart", apart)] {
        let (f, links) = transformed(&quads, DQuat::IDENTITY, 1.0, DVec3::ZERO);
        let mut random = Random(11);
        for k in 0..10 {
            let shift = random.point(DVec3::splat(-2.0), DVec3::splat(2.0));
            let scale = 10_f64.powf(random.between(-3.0, 3.0));
            let (g, other) = transformed(&quads, random.rotation(), scale, shift);
            println!("{name} turn {k}: off {:+.1e}, {other} links ({links})", g / f - 1.0);
            assert!((g / f - 1.0).abs() < 1e-6, "{name} {k}: {g} {f}");
            assert_eq!(other, links, "{name} {k}");
        }
    }
}

/// A session over one black emitter of exitance 1, at tolerance 0.1: F is the irradiance.
fn glowing(emitter: &[DVec3]) -> Session {
    let mut b = SceneBuilder::new("glow");
    let lamp = b.material("lamp", [0.0; 3], [1.0; 3]);
    common::plates(&mut b, lamp, &[("lamp", &[emitter.to_vec()])]);
    solved(b.build().unwrap(), at_tolerance(0.1)).0
}

#[test]
fn a_point_to_a_polygon() {
    for (a, b, c) in [(1.0, 1.0, 1.0), (0.1, 2.0, 0.3), (3.0, 3.0, 0.01), (1.0, 1.0, 30.0)] {
        let session = glowing(&flipped(facing_up([0.0, a], [0.0, b], c)));
        let e = session.frame().unwrap().irradiance_at(DVec3::ZERO, DVec3::Z)[0];
        let f = exact::point_to_parallel_rectangle(a, b, c);
        println!("parallel {a} {b} {c}: {e:.9} exact {f:.9}");
        assert!((e / f - 1.0).abs() < 1e-6, "{a} {b} {c}: {e} {f}");
        assert_eq!(session.frame().unwrap().irradiance_at(DVec3::ZERO, -DVec3::Z), [0.0; 3]);
        assert_eq!(
            session.frame().unwrap().irradiance_at(v(0.0, 0.0, c * 1.5), -DVec3::Z),
            [0.0; 3]
        );
    }
    for (a, b, c) in [(1.0, 1.0, 1.0), (2.0, 0.3, 0.1), (1.0, 4.0, 0.01)] {
        let upright = [v(c, 0.0, 0.0), v(c, 0.0, a), v(c, b, a), v(c, b, 0.0)];
        let e = glowing(&upright).frame().unwrap().irradiance_at(DVec3::ZERO, DVec3::Z)[0];
        let f = exact::point_to_upright_rectangle(a, b, c);
        println!("upright {a} {b} {c}: {e:.9} exact {f:.9}");
        assert!((e / f - 1.0).abs() < 1e-6, "{a} {b} {c}: {e} {f}");
    }
    // A large square at a slant, partly below the point's horizon: by Lambert's sum over the part
    // above it.
    let slanted = [v(-1.0, -1.0, 2.0), v(-1.0, 1.0, 2.0), v(3.0, 1.0, -2.0), v(3.0, -1.0, -2.0)];
    let above = [v(-1.0, -1.0, 2.0), v(-1.0, 1.0, 2.0), v(1.0, 1.0, 0.0), v(1.0, -1.0, 0.0)];
    let e = glowing(&slanted).frame().unwrap().irradiance_at(DVec3::ZERO, DVec3::Z)[0];
    let f = exact::lambert(DVec3::ZERO, DVec3::Z, &above);
    println!("slanted: {e:.9} exact {f:.9}");
    assert!((e / f - 1.0).abs() < 1e-6, "{e} {f}");
    assert!(f < 1.0 && f > 0.1 && PI > f);
}
