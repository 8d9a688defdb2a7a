//! Emission that changes over time: lamps and punctual lights that brighten, darken and go out.

use glam::{DQuat, DVec3};
use relume_core::scene::{Interpolation, LightKind, Scene, SceneBuilder, Track};
use relume_core::session::{Options, Oracle, Session, Update};

use crate::common::{at_tolerance, solved, still, v};
use std::sync::Arc;

fn track(values: &[f64], colour: [f64; 3], interpolation: Interpolation) -> Track {
    let times_s = (0..values.len()).map(|k| k as f64).collect();
    let values = values.iter().map(|&v| DVec3::from_array(colour) * v).collect();
    Track { times_s, values, interpolation }
}

/// A room with a box and a lamp below the ceiling; nothing moves.
fn room(lamp: &[f64]) -> SceneBuilder {
    let mut b = SceneBuilder::new("room");
    let grey = b.material("grey", [0.6, 0.5, 0.4], [0.0; 3]);
    let glow = b.material("lamp", [0.0; 3], [1.0; 3]);
    let node = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(node, "walls", grey, DVec3::ZERO, DVec3::splat(2.0));
    b.cuboid(node, "box", grey, DVec3::new(0.5, 0.0, 0.5), DVec3::new(1.0, 0.7, 1.2));
    let down = [(0.6, 0.6), (1.4, 0.6), (1.4, 1.4), (0.6, 1.4)];
    let corners: Vec<DVec3> = down.iter().map(|&(x, z)| DVec3::new(x, 1.95, z)).collect();
    b.polygon(node, "lamp", glow, &corners);
    b.animate_exitance(glow, track(lamp, [10.0, 8.0, 6.0], Interpolation::Linear));
    b
}

fn build(b: SceneBuilder) -> Arc<Scene> {
    Arc::new(b.build().unwrap())
}

fn options(oracle: Oracle) -> Options {
    Options { oracle, tolerance: 0.1, ..Options::default() }
}

const FORM_FACTOR: Oracle = Oracle::FormFactor { epsilon: 0.05, min_area_m2: 0.01 };

/// Mean radiosity of every patch.
fn means(session: &Session) -> Vec<[f64; 3]> {
    let snapshot = session.frame().unwrap().solution();
    let of_patch = |k: usize| {
        let leaves = snapshot.leaves_of(relume_core::scene::PatchId(k as u32));
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for leaf in leaves {
            let [a, b, c, d] = leaf.corners;
            let size = 0.5 * (c - a).perp_dot(d - b).abs();
            area += size;
            (0..3).for_each(|k| sum[k] += size * f64::from(leaf.radiosity[k]));
        }
        sum.map(|s| s / area)
    };
    (0..snapshot.scene.patches.len()).map(of_patch).collect()
}

#[test]
fn light_is_as_strong_as_the_lamp_at_every_time() {
    let scene = build(room(&[1.0, 2.0, 0.5, 0.0, 0.0, 3.0]));
    for oracle in [FORM_FACTOR, Oracle::Error] {
        let mut session = Session::new(scene.clone(), options(oracle)).unwrap();
        session.step(0, 0.0).unwrap();
        let first = means(&session);
        for (frame, (time_s, strength)) in
            [(0.5, 1.5), (1.0, 2.0), (2.0, 0.5), (3.0, 0.0), (4.0, 0.0), (5.0, 3.0), (0.0, 1.0)]
                .into_iter()
                .enumerate()
        {
            let report = session.step(frame as u32 + 1, time_s).unwrap();
            let mut cold = Session::new(scene.clone(), options(oracle)).unwrap();
            assert_eq!(report.hash, cold.step(0, time_s).unwrap().hash, "{oracle:?} at {time_s} s");
            for (now, first) in means(&session).iter().zip(&first) {
                for c in 0..3 {
                    let off = (now[c] - strength * first[c]).abs();
                    assert!(
                        off <= 4e-3 * strength * first[0].max(1.0),
                        "{oracle:?} {time_s}: {now:?} {first:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn what_does_not_change_costs_nothing_and_what_does_moves_no_link() {
    let scene = build(room(&[1.0, 2.0, 2.0, 4.0]));
    let mut session = Session::new(scene.clone(), options(FORM_FACTOR)).unwrap();
    session.step(0, 0.0).unwrap();
    let brighter = session.step(1, 1.0).unwrap();
    // Form factors do not depend on the light.
    assert_eq!((brighter.work.examined, brighter.work.changed), (0, 0));
    assert!(brighter.gathers > 0);
    let same = session.step(2, 1.5).unwrap();
    assert_eq!((same.work.visited, same.gathers, &same.hash), (0, 0, &brighter.hash));
    assert!(session.step(3, 2.5).unwrap().gathers > 0);
}

#[test]
fn punctual_lights_dim_and_go_out() {
    let mut b = SceneBuilder::new("lights");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let node = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(node, "walls", grey, DVec3::ZERO, DVec3::splat(2.0));
    let hook = b.node("hook", None, DVec3::new(1.0, 1.5, 1.0), DQuat::IDENTITY);
    b.light("bulb", hook, LightKind::Point, [2.0; 3]);
    b.animate_intensity("bulb", track(&[1.0, 4.0, 0.0], [2.0, 1.0, 0.5], Interpolation::Step));
    let scene = build(b);
    for oracle in [FORM_FACTOR, Oracle::Error] {
        let mut session = Session::new(scene.clone(), options(oracle)).unwrap();
        session.step(0, 0.0).unwrap();
        let first = means(&session);
        assert!(first.iter().all(|m| m[0] > 0.01 && m[2] < m[0]));
        for (time_s, strength) in [(1.0, 4.0), (1.9, 4.0), (2.0, 0.0), (0.5, 1.0)] {
            let report = session.step(1, time_s).unwrap();
            let mut cold = Session::new(scene.clone(), options(oracle)).unwrap();
            assert_eq!(report.hash, cold.step(0, time_s).unwrap().hash, "{oracle:?} at {time_s} s");
            for (now, first) in means(&session).iter().zip(&first) {
                assert!(
                    (now[0] - strength * first[0]).abs() <= 4e-3 * strength.max(1.0),
                    "{now:?} {first:?}"
                );
            }
        }
    }
}

#[test]
fn extrapolated_links_follow_a_lamp_that_changes() {
    let scene = build(room(&[1.0, 5.0, 0.2, 1.0]));
    let update = Update::Extrapolate { frames: 7, error: None };
    let mut session =
        Session::new(scene.clone(), Options { update, ..options(Oracle::Error) }).unwrap();
    for frame in 0..=12 {
        let time_s = f64::from(frame) * 0.25;
        session.step(frame, time_s).unwrap();
        let mut cold = Session::new(scene.clone(), options(Oracle::Error)).unwrap();
        cold.step(0, time_s).unwrap();
        for (one, two) in means(&session).iter().zip(means(&cold)) {
            // The bottom of the box is all but dark: there the residual is what is left.
            let allowed = 0.01 * two[0].max(1.0);
            assert!((one[0] - two[0]).abs() <= allowed, "frame {frame}: {one:?} {two:?}");
        }
    }
}

#[test]
fn bad_keys_are_refused_by_name() {
    let refused = |values: &[f64]| {
        let message = room(values).build().unwrap_err().to_string();
        assert!(message.contains("`of material lamp`"), "{message}");
        message
    };
    assert!(refused(&[1.0, -1.0]).contains("emission"));
    assert!(refused(&[1.0, f64::NAN]).contains("emission"));
    assert!(refused(&[]).contains("no keys"));
    assert!(refused(&[1.0, 1e38]).contains("beyond"));
    let mut b = room(&[1.0]);
    b.animate_intensity("nothing", track(&[1.0], [1.0; 3], Interpolation::Step));
    assert!(b.build().unwrap_err().to_string().contains("light `nothing`"));
}

#[test]
fn what_is_solved_after_a_lamp_changed_can_be_reconstructed() {
    let scene = build(room(&[1.0, 2.0, 3.0, 2.0]));
    let mut session = Session::new(scene.clone(), options(Oracle::Error)).unwrap();
    for frame in 0..4 {
        session.step(frame, f64::from(frame)).unwrap();
        let warm = session.frame().unwrap().reconstruction();
        let mut cold = Session::new(scene.clone(), options(Oracle::Error)).unwrap();
        cold.step(frame, f64::from(frame)).unwrap();
        let cold = cold.frame().unwrap().reconstruction();
        for (one, two) in warm.leaves.iter().zip(&cold.leaves) {
            assert!(
                (one.radiosity[0] - two.radiosity[0]).abs() <= 0.01 * two.radiosity[0].max(0.1)
            );
        }
    }
}

#[test]
fn a_lamp_that_brightens_is_no_reason_to_build_extrapolated_links_anew() {
    let scene = build(room(&[0.0, 1.0, 3.0, 9.0]));
    let update = Update::Extrapolate { frames: 7, error: None };
    let mut session = Session::new(scene, Options { update, ..options(Oracle::Error) }).unwrap();
    session.step(0, 0.5).unwrap();
    for frame in 1..5 {
        let report = session.step(frame, 0.5 + 0.5 * f64::from(frame)).unwrap();
        let pairs = report.pairs.active + report.pairs.refined;
        assert!(
            report.work.examined < pairs / 4,
            "frame {frame}: {} of {pairs}",
            report.work.examined
        );
    }
}

/// A plate with a box on it below a bulb, and another bulb that is not there yet.
fn plate(bulb: f64, away_m: f64, absent: f64) -> Arc<Scene> {
    let mut b = SceneBuilder::new("plate");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let node = b.node("plate", None, DVec3::ZERO, DQuat::IDENTITY);
    let corners = [(-1., -1.), (-1., 1.), (1., 1.), (1., -1.)].map(|(x, z)| DVec3::new(x, 0.0, z));
    b.polygon(node, "plate", grey, &corners);
    b.cuboid(node, "box", grey, DVec3::new(-0.2, 0.01, -0.3), DVec3::new(0.3, 0.5, 0.2));
    let hook = b.node("hook", None, DVec3::new(0.3, away_m, 0.2), DQuat::IDENTITY);
    b.light("bulb", hook, LightKind::Point, [bulb * away_m * away_m; 3]);
    let hook = b.node("later", None, DVec3::new(0.3, 2.0, 0.2), DQuat::IDENTITY);
    b.animate_presence(hook, vec![(0.0, false), (1.0, true)]);
    b.light("later", hook, LightKind::Point, [absent; 3]);
    build(b)
}

#[test]
fn links_depend_neither_on_the_unit_of_light_nor_on_what_is_absent() {
    let links = |scene: Arc<Scene>| {
        let mut session = Session::new(scene, options(Oracle::Error)).unwrap();
        session.step(0, 0.0).unwrap().hash
    };
    for away_m in [2.0, 400.0] {
        let hash = links(plate(1.0, away_m, 0.0));
        assert_eq!(hash, links(plate(1.0 / 1024.0, away_m, 0.0)), "{away_m} m");
        assert_eq!(hash, links(plate(1024.0, away_m, 0.0)), "{away_m} m");
        assert_eq!(hash, links(plate(1.0, away_m, 1e6)), "{away_m} m");
    }
}

#[test]
fn what_lies_wholly_under_another_lamp_emits_nothing_in_the_balance() {
    let mut b = SceneBuilder::new("two lamps");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let [one, two] = [20.0, 40.0].map(|m| b.material(&format!("glow {m}"), [0.3; 3], [m; 3]));
    let node = still(&mut b, "room");
    b.cuboid_inward(node, "room", grey, DVec3::ZERO, v(3.0, 2.5, 3.0));
    for (name, glow) in [("lamp", one), ("lamp 2", two)] {
        let node = still(&mut b, name);
        b.cuboid(node, name, glow, v(1.0, 2.2, 1.0), v(1.4, 2.3, 1.4));
    }
    let (_, report) = solved(b.build().unwrap(), at_tolerance(0.05));
    let energy = report.energy.unwrap();
    let emitted_w = 3.0 * 20.0 * (2.0 * 0.16 + 4.0 * 0.04);
    assert!((energy.emitted_w / emitted_w - 1.0).abs() < 1e-6, "{energy:?}");
    assert!((energy.absorbed_w / emitted_w - 1.0).abs() < 0.01, "{energy:?}");
    assert!(energy.unbalanced() < 0.01, "{energy:?}");
}

#[test]
fn lamps_too_dim_to_compute_with_count_as_none_and_dim_ones_are_solved() {
    for (exitance, counts) in [(3e-44, false), (1e-29, true)] {
        let mut b = SceneBuilder::new("dim");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let glow = b.material("glow", [0.3; 3], [exitance; 3]);
        let node = still(&mut b, "room");
        b.cuboid_inward(node, "room", grey, DVec3::ZERO, v(3.0, 2.5, 3.0));
        b.cuboid(node, "lamp", glow, v(1.0, 2.2, 1.0), v(1.4, 2.3, 1.4));
        let scene = b.build().unwrap();
        assert_eq!(scene.notes.iter().any(|n| n.code == "too-dim"), !counts);
        let energy = solved(scene, at_tolerance(0.05)).1.energy.unwrap();
        assert_eq!(energy.emitted_w > 0.0, counts);
        assert!(energy.unbalanced() < 0.01, "{exitance:e} {energy:?}");
    }
}
