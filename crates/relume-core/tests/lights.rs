//! Punctual lights against closed forms: irradiance, flux, shadows, energy; and bodies that are
//! absent. Figures are printed (`--nocapture`).

// Reference values may use the platform's functions.
#![allow(clippy::disallowed_methods)]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common;
use crate::common::{
    Quad, area_of, at_tolerance, facing_up, leaf_area, patches_of, rms, solved, v,
};
use glam::{DQuat, DVec3};
use relume_core::scene::{LightKind, Scene, SceneBuilder};
use relume_core::session::{Options, Session};
use relume_judge::exact::quad_sr;

/// Intensities, W/sr or W/m2.
const I: [f64; 3] = [4.0, 2.0, 1.0];

const FLOOR: [f64; 2] = [-1.0, 1.0];

fn floor() -> Quad {
    facing_up(FLOOR, FLOOR, 0.0)
}

/// A black floor of 2 x 2 m at z = 0 with one light at `at` that shines along `along`; with a
/// plate of 0.6 x 0.6 m at z = 1 if `plate`.
fn lit_floor(kind: LightKind, at: DVec3, along: DVec3, plate: bool) -> Scene {
    let mut b = SceneBuilder::new("floor");
    let black = b.material("black", [0.0; 3], [0.0; 3]);
    let thin = b.double_sided_material("thin", [0.0; 3], [0.0; 3]);
    let node = common::still(&mut b, "floor");
    b.polygon(node, "floor", black, &floor());
    if plate {
        let node = common::still(&mut b, "plate");
        b.polygon(node, "plate", thin, &shade());
    }
    let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, along.normalize());
    let node = b.node("lamp", None, at, turn);
    b.light("lamp", node, kind, I);
    b.build().unwrap()
}

/// The plate that throws a shadow.
fn shade() -> Quad {
    facing_up([-0.3, 0.3], [-0.3, 0.3], 1.0)
}

/// Flux that arrives on a surface by its leaves, W, first channel.
fn flux(session: &Session, surface: &str) -> f64 {
    let snapshot = session.frame().unwrap().solution();
    let ids = patches_of(session.scene(), surface);
    let leaves = ids.iter().flat_map(|&p| snapshot.leaves_of(p));
    leaves.map(|l| leaf_area(l) * f64::from(l.irradiance[0])).sum()
}

/// Irradiance of the mesh against a closed form at the leaves' own points, relative to the mean:
/// area-weighted RMS.
fn mesh_error(session: &Session, exact: impl Fn(DVec3) -> f64) -> f64 {
    let snapshot = session.frame().unwrap().solution();
    let floor = patches_of(session.scene(), "floor")[0];
    let mean = flux(session, "floor") / area_of(session.scene(), "floor");
    let mut errors = Vec::new();
    for leaf in snapshot.leaves_of(floor) {
        let weight = (leaf_area(leaf) / area_of(session.scene(), "floor")).sqrt();
        for (s, t) in [(0.2, 0.3), (0.7, 0.2), (0.6, 0.8), (0.3, 0.7)] {
            let c = &leaf.corners;
            let p = c[0] * ((1.0 - s) * (1.0 - t))
                + c[1] * (s * (1.0 - t))
                + c[2] * (s * t)
                + c[3] * ((1.0 - s) * t);
            let e = f64::from(leaf.irradiance_at(p)[0]);
            let at = common::world_point(&snapshot, floor, p);
            errors.push((e - exact(at)) / mean * weight);
        }
    }
    rms(&errors) * (errors.len() as f64 / 4.0).sqrt()
}

/// Closed-form irradiance of a light on the floor, first channel, W/m2.
fn on_floor(kind: LightKind, at: DVec3, along: DVec3, p: DVec3) -> f64 {
    let along = along.normalize();
    if kind == LightKind::Directional {
        return I[0] * -along.z;
    }
    let d = p - at;
    let cone = match kind {
        LightKind::Spot { inner, outer } => {
            let (c, ci, co) = (d.normalize().dot(along), inner.cos(), outer.cos());
            ((c - co) / (ci - co)).clamp(0.0, 1.0).powi(2)
        }
        _ => 1.0,
    };
    I[0] * cone * -d.z / d.length().powi(3)
}

fn kinds() -> [(&'static str, LightKind, DVec3, DVec3); 4] {
    let spot = LightKind::Spot { inner: 0.2, outer: 0.6 };
    [
        ("point", LightKind::Point, v(0.3, -0.2, 1.5), DVec3::X),
        ("near point", LightKind::Point, v(-0.5, 0.4, 0.2), DVec3::X),
        ("spot", spot, v(0.3, -0.2, 1.5), v(-0.3, 0.2, -1.0)),
        ("sun", LightKind::Directional, v(9.0, 9.0, -9.0), v(0.5, 0.2, -1.0)),
    ]
}

#[test]
fn irradiance_on_a_plane_follows_the_closed_form() {
    for (name, kind, at, along) in kinds() {
        let exact = |p| on_floor(kind, at, along, p);
        let (session, report) = solved(lit_floor(kind, at, along, false), Options::default());
        for p in [v(0.0, 0.0, 0.0), v(0.9, 0.9, 0.0), v(-0.4, 0.3, 0.0), v(0.1, -0.8, 0.0)] {
            let e = session.frame().unwrap().irradiance_at(p, DVec3::Z);
            for c in 0..3 {
                let want = exact(p) * I[c] / I[0];
                assert!((e[c] - want).abs() <= 1e-9 * want, "{name} at {p}: {} {want}", e[c]);
            }
            assert_eq!(
                session.frame().unwrap().irradiance_at(p, -DVec3::Z),
                [0.0; 3],
                "{name} from below"
            );
        }
        let off = mesh_error(&session, exact);
        println!("{name}: mesh {off:.1e} RMS of the mean irradiance, {} links", report.links);
        assert!(off < 0.02, "{name}: {off}");
        // No shaft is blocked and nothing else is lit.
        assert_eq!(report.work.segments, 0, "{name}");
    }
}

#[test]
fn the_flux_of_a_point_light_is_its_solid_angle_less_the_shadow() {
    for at in [v(0.0, 0.0, 2.0), v(0.1, -0.1, 1.9)] {
        let (free, _) =
            solved(lit_floor(LightKind::Point, at, DVec3::X, false), Options::default());
        let exact = I[0] * quad_sr(at, &floor());
        println!("free flux {:.6} exact {exact:.6}", flux(&free, "floor"));
        assert!((flux(&free, "floor") / exact - 1.0).abs() < 1e-3);
        let scene = lit_floor(LightKind::Point, at, DVec3::X, true);
        let (shaded, report) = solved(scene, at_tolerance(0.05));
        let left = exact - I[0] * quad_sr(at, &shade());
        println!(
            "shaded flux {:.6} exact {left:.6}, {} links",
            flux(&shaded, "floor"),
            report.links
        );
        assert!((flux(&shaded, "floor") / left - 1.0).abs() < 5e-3);
        let plate = flux(&shaded, "plate") / (I[0] * quad_sr(at, &shade()));
        assert!((plate - 1.0).abs() < 1e-3, "{plate}");
        // What is emitted arrives on the floor or the plate, or escapes.
        let emitted = 4.0 * PI * I.iter().sum::<f64>();
        let e = report.energy.unwrap();
        assert!((e.emitted_w / emitted - 1.0).abs() < 1e-6, "{e:?}");
        assert!(((e.absorbed_w + e.escaped_w) / emitted - 1.0).abs() < 1e-4, "{e:?}");
    }
}

#[test]
fn a_shadow_has_its_edge_where_it_belongs() {
    for (name, kind, at, along) in kinds() {
        if name == "near point" {
            continue;
        }
        let (session, _) = solved(lit_floor(kind, at, along, true), at_tolerance(0.1));
        // Where the light sends a point of the plate's plane.
        let thrown = |p: DVec3| match kind {
            LightKind::Directional => p + along / -along.z * p.z,
            _ => at + (p - at) * (at.z / (at.z - p.z)),
        };
        let e = |p: DVec3| session.frame().unwrap().irradiance_at(thrown(p), DVec3::Z)[0];
        for edge in [v(0.3, 0.1, 1.0), v(-0.3, -0.1, 1.0), v(0.1, 0.3, 1.0), v(0.0, -0.3, 1.0)] {
            let out = (v(edge.x, edge.y, 0.0) / 0.3).trunc() * 1e-4;
            assert_eq!(e(edge - out), 0.0, "{name}: inside at {edge}");
            let want = on_floor(kind, at, along, thrown(edge + out));
            assert!((e(edge + out) - want).abs() <= 1e-9 * want, "{name}: outside at {edge}");
        }
        // The other way round: the point of the plate's plane that shades a point of the floor.
        let shading = |p: DVec3| match kind {
            LightKind::Directional => p - along / -along.z,
            _ => at + (p - at) * ((at.z - 1.0) / at.z),
        };
        let dark = |p: DVec3| shading(p).x.abs().max(shading(p).y.abs()) < 0.3;
        let exact = |p| if dark(p) { 0.0 } else { on_floor(kind, at, along, p) };
        let lit = mesh_error(&session, exact);
        println!("{name}: mesh with shadow {lit:.2} RMS of the mean irradiance at tolerance 0.1");
        // The spot lights a fifth of the floor: its own irradiance is far above the mean.
        assert!(lit < 0.5, "{name}: {lit}");
    }
}

#[test]
fn a_closed_room_takes_all_light_in() {
    for (name, kind, sr) in [
        ("point", LightKind::Point, 4.0 * PI),
        ("spot", LightKind::Spot { inner: 0.3, outer: 0.8 }, {
            let (ci, co) = (0.3_f64.cos(), 0.8_f64.cos());
            2.0 * PI * ((1.0 - ci) + (ci - co) / 3.0)
        }),
    ] {
        for rho in [0.0, 0.5] {
            let mut b = SceneBuilder::new("room");
            let wall = b.material("wall", [rho; 3], [0.0; 3]);
            let room = common::still(&mut b, "room");
            b.cuboid_inward(room, "walls", wall, -DVec3::ONE, DVec3::ONE);
            let object = b.node("box", None, v(0.1, 0.0, -0.6), DQuat::from_rotation_z(0.3));
            b.cuboid(object, "box", wall, DVec3::splat(-0.25), DVec3::splat(0.25));
            let node = b.node("lamp", None, v(0.2, 0.1, 0.6), DQuat::IDENTITY);
            b.light("lamp", node, kind, I);
            let (session, report) = solved(b.build().unwrap(), at_tolerance(0.05));
            let e = report.energy.unwrap();
            let emitted = sr * I.iter().sum::<f64>();
            println!("{name} rho {rho}: {e:?} emitted {emitted:.5}, {} links", report.links);
            assert!((e.emitted_w / emitted - 1.0).abs() < 1e-6);
            assert!((e.absorbed_w / emitted - 1.0).abs() < 2e-2, "{name}: {e:?}");
            let direct = flux(&session, "walls") + flux(&session, "box");
            // Exact for any closed scene of uniform reflectance.
            let want = sr * I[0] / (1.0 - rho);
            assert!((direct / want - 1.0).abs() < 2e-2, "{name}: {direct} {want}");
        }
    }
}

#[test]
fn a_shadow_at_default_tolerance_takes_few_links() {
    let scene = lit_floor(LightKind::Point, v(0.0, 0.0, 2.0), DVec3::X, true);
    let options = Options { max_memory_bytes: Some(64 << 20), ..Options::default() };
    let report = Session::new(Arc::new(scene), options).unwrap().step(0, 0.0).unwrap();
    println!("a shadow at default tolerance: {} links", report.links);
}

/// A floor, a lamp plate above it, a sun, and a box between that is there from 1 s to 2 s only; or
/// no box at all.
fn visited(with_box: bool) -> Arc<Scene> {
    let mut b = SceneBuilder::new("visit");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [3.0; 3]);
    let node = common::still(&mut b, "floor");
    b.polygon(node, "floor", grey, &floor());
    let node = common::still(&mut b, "lamp");
    b.polygon(node, "lamp", lamp, &common::flipped(facing_up([-0.5, 0.5], [-0.5, 0.5], 1.0)));
    let node = b.node("sun", None, DVec3::ZERO, DQuat::from_rotation_x(0.9));
    b.light("sun", node, LightKind::Directional, [0.5; 3]);
    if with_box {
        let node = b.node("visitor", None, v(0.1, 0.0, 0.5), DQuat::IDENTITY);
        b.cuboid(node, "visitor", grey, DVec3::splat(-0.2), DVec3::splat(0.2));
        b.animate_presence(node, vec![(0.0, false), (1.0, true), (2.0, false)]);
    }
    Arc::new(b.build().unwrap())
}

#[test]
fn a_body_that_is_absent_casts_no_shadow_and_carries_nothing() {
    let mut empty = Session::new(visited(false), at_tolerance(0.05)).unwrap();
    let bare = empty.step(0, 0.0).unwrap();
    let mut session = Session::new(visited(true), at_tolerance(0.05)).unwrap();
    let before = session.step(0, 0.0).unwrap();
    let points = [v(0.0, 0.0, 0.0), v(0.1, 0.3, 0.0), v(-0.7, 0.8, 0.0)];
    for p in points {
        let (e, want) = (
            session.frame().unwrap().irradiance_at(p, DVec3::Z),
            empty.frame().unwrap().irradiance_at(p, DVec3::Z),
        );
        assert!((e[0] / want[0] - 1.0).abs() < 1e-5, "{e:?} {want:?}");
    }
    let visitor = patches_of(session.scene(), "visitor");
    let leaves = |s: &Session| {
        let snapshot = s.frame().unwrap().solution();
        visitor.iter().map(|&p| snapshot.leaves_of(p).len()).sum::<usize>()
    };
    assert_eq!(leaves(&session), 0);
    // The area of the scene, which errors are weighed by, is another.
    assert!(before.links.abs_diff(bare.links) < bare.links / 5, "{} {}", before.links, bare.links);
    assert!((flux(&session, "floor") / flux(&empty, "floor") - 1.0).abs() < 1e-3);
    for end in session.frame().unwrap().pairs().0.links().flat_map(|l| [l.a, l.b]) {
        let patch = session.frame().unwrap().pairs().1.patch(end);
        assert!(patch.is_none_or(|p| !visitor.contains(&p)), "a link on an absent body");
    }

    let during = session.step(1, 1.5).unwrap();
    assert!(leaves(&session) >= 6);
    assert!(during.links > before.links);
    assert_eq!(during.moved, ["visitor"]);
    let shade = session.frame().unwrap().irradiance_at(points[0], DVec3::Z)[0];
    assert!(shade < 0.7 * empty.frame().unwrap().irradiance_at(points[0], DVec3::Z)[0], "{shade}");

    let after = session.step(2, 2.0).unwrap();
    assert_eq!(after.hash, before.hash);
    assert_eq!(leaves(&session), 0);
    let e = after.energy.unwrap();
    let left = (e.emitted_w - e.absorbed_w - e.escaped_w) / e.emitted_w;
    assert!(left.abs() < 1e-3, "{e:?}");
}

/// Past the edge of a shadow lines lead below 0. What they are below it there is not taken from the light of other lamps.
#[test]
fn light_below_zero_is_not_taken_from_the_rest() {
    let mut below = 0;
    for k in 0..6 {
        let mut b = SceneBuilder::new("two lamps");
        let black = b.material("black", [0.0; 3], [0.0; 3]);
        let (strong, weak) =
            (b.material("a", [0.0; 3], [90.0; 3]), b.material("b", [0.0; 3], [3.0; 3]));
        let node = common::still(&mut b, "room");
        let down = |x, y, z| common::flipped(facing_up(x, y, z));
        b.polygon(node, "floor", black, &floor());
        b.polygon(node, "a", strong, &down([-0.1, 0.1], [-0.1, 0.1], 1.2));
        b.polygon(node, "b", weak, &down([-2.0, 2.0], [-2.0, 2.0], 2.0));
        let node = b.node("crate", None, v(0.1 + 0.07 * f64::from(k), 0.2, 0.2), DQuat::IDENTITY);
        b.cuboid(node, "crate", black, DVec3::splat(-0.2), DVec3::splat(0.2));
        let (session, _) = solved(b.build().unwrap(), at_tolerance(0.1));
        let frame = session.frame().unwrap();
        let [of_a, of_b] = ["a", "b"].map(|name| patches_of(session.scene(), name));
        let all = frame.solution();
        let [without_a, without_b] = [of_a, of_b].map(|lamps| frame.solution_beside(&lamps));
        for (k, leaf) in all.leaves.iter().enumerate() {
            let [b, a] = [&without_a, &without_b].map(|rest| rest.indirect[k].irradiance[0]);
            let sum = leaf.irradiance[0];
            assert!(a + b > sum - 1e-4, "{a} + {b} is not {sum}");
            below += u32::from(a == 0.0 && sum < 0.98 * b);
        }
    }
    println!("{below} leaves");
    assert!(below > 0, "no line leads below 0 here");
}
