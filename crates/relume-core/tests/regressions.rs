//! Every find of the random motions and of users, reduced to the smallest scene; numbered.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use crate::common;
use crate::common::pairs::{first_differences, pairs_of};
use crate::common::{at_tolerance, facing_up, flipped, form_factor_oracle, still, turn, v};
use glam::{DQuat, DVec3};
use relume_core::scene::{Interpolation, LightKind, NodeId, RotationTrack, SceneBuilder, Track};
use relume_core::session::{Options, Session};

/// A session that has been at all these times, and one that has been at the last only.
fn warm_and_cold(b: SceneBuilder, options: &Options, times: &[f64]) -> [Session; 2] {
    let scene = Arc::new(b.build().unwrap());
    let [mut warm, mut cold] =
        [0, 1].map(|_| Session::new(Arc::clone(&scene), options.clone()).unwrap());
    for &time_s in times {
        warm.step(0, time_s).unwrap();
    }
    cold.step(0, *times.last().unwrap()).unwrap();
    [warm, cold]
}

fn same_pairs([warm, cold]: [&Session; 2]) {
    assert!(pairs_of(warm) == pairs_of(cold), "{}", first_differences(warm, cold));
}

/// Largest radiosity of a named surface, first channel.
fn brightest(session: &Session, surface: &str) -> f64 {
    let snapshot = session.frame().unwrap().solution();
    let patches = common::patches_of(session.scene(), surface);
    let leaves = patches.iter().flat_map(|&p| snapshot.leaves_of(p));
    leaves.map(|l| f64::from(l.radiosity[0])).fold(0.0, f64::max)
}

/// Largest difference of radiosities over a named surface, first channel.
fn apart(one: &Session, two: &Session, surface: &str) -> f64 {
    let [one, two] =
        [one, two].map(|s| (s.frame().unwrap().solution(), common::patches_of(s.scene(), surface)));
    let leaves =
        |s: &(relume_core::session::Snapshot, Vec<relume_core::scene::PatchId>)| -> Vec<f64> {
            let of = s.1.iter().flat_map(|&p| s.0.leaves_of(p));
            of.map(|l| f64::from(l.radiosity[0])).collect()
        };
    let (a, b) = (leaves(&one), leaves(&two));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn r1_pairs_within_a_body_do_not_follow_its_turning() {
    // Pairs of clusters of one body were judged by world boxes when they were made, and not again.
    let mut b = SceneBuilder::new("turning prism");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let node = b.node("prism", None, DVec3::ZERO, DQuat::IDENTITY);
    turn(&mut b, node, v(1.0, 2.0, 0.5), 2.1);
    let base = [v(-1.0, -1.0, -1.0), v(1.0, -1.0, -1.0), v(0.0, 1.0, -1.0)];
    let top = base.map(|p| p + v(0.0, 0.0, 2.0));
    b.polygon(node, "prism", grey, &top);
    b.polygon(node, "prism", grey, &[base[0], base[2], base[1]]);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        b.polygon(node, "prism", grey, &[base[i], base[j], top[j], top[i]]);
    }
    let [warm, cold] = warm_and_cold(b, &form_factor_oracle(0.1, 0.01), &[0.0, 0.4, 1.0]);
    same_pairs([&warm, &cold]);
}

#[test]
fn r2_a_lamp_that_goes_out_leaves_no_coarse_solution_in_dim_rooms() {
    // What was little beside the bright room stayed unsettled in the dim one, and uncounted.
    let mut b = SceneBuilder::new("bright and dim");
    let grey = b.material("grey", [0.7; 3], [0.0; 3]);
    let down = flipped(facing_up([0.3, 0.7], [0.3, 0.7], 0.9));
    for (k, (name, exitance)) in [("bright", 1e4), ("dim", 1.0)].into_iter().enumerate() {
        let far = v(5.0 * k as f64, 0.0, 0.0);
        let node = still(&mut b, name);
        b.cuboid_inward(node, &format!("{name} walls"), grey, far, far + DVec3::ONE);
        let lamp = b.material(&format!("{name} lamp"), [0.0; 3], [exitance; 3]);
        let node = b.node(&format!("{name} lamp"), None, far, DQuat::IDENTITY);
        b.polygon(node, &format!("{name} lamp"), lamp, &down);
        if k == 0 {
            b.animate_presence(node, vec![(0.0, true), (1.0, false)]);
        }
    }
    let [warm, cold] = warm_and_cold(b, &form_factor_oracle(0.1, 0.01), &[0.0, 1.0]);
    same_pairs([&warm, &cold]);
    let (off, level) = (apart(&warm, &cold, "dim walls"), brightest(&cold, "dim walls"));
    println!("dim walls: off by {off:.1e} of {level:.1e}");
    assert!(level > 0.01 && off < 2e-3 * level, "off by {off} of {level}");
    assert!(brightest(&warm, "bright walls") < 1e-3 * level, "an afterglow");
}

#[test]
fn r3_an_absent_lamp_counts_nowhere() {
    // Its exitance was part of the mean that residuals are relative to.
    let mut b = SceneBuilder::new("ghost lamp");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.1; 3], [9.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, DVec3::ONE);
    let node = b.node("lamp", None, v(0.5, 0.5, 0.8), DQuat::IDENTITY);
    b.animate_presence(node, vec![(0.0, true), (1.0, false), (2.0, true)]);
    b.polygon(node, "lamp", lamp, &flipped(facing_up([-0.2, 0.2], [-0.2, 0.2], 0.0)));
    let [warm, cold] = warm_and_cold(b, &form_factor_oracle(0.1, 0.01), &[0.0, 1.0]);
    same_pairs([&warm, &cold]);
    assert_eq!((brightest(&warm, "walls"), brightest(&cold, "walls")), (0.0, 0.0));
}

#[test]
fn r4_pairs_made_anew_where_nothing_moves_are_judged() {
    // A group that holds a mover grew past the rest: the sides of its pairs were swapped, and pairs
    // below that are all at rest were made by the coarse walk and never met by the fine one.
    let mut b = SceneBuilder::new("swapped sides");
    let grey = b.material("grey", [0.5, 0.6, 0.3], [0.0; 3]);
    let both = b.double_sided_material("both", [0.3, 0.2, 0.7], [0.0; 3]);
    let lamp = b.material("lamp", [0.1; 3], [9.0, 6.0, 3.0]);
    let place = still(&mut b, "place");
    b.cuboid_inward(place, "walls", grey, DVec3::splat(-1.0), DVec3::ONE);
    b.cuboid_inward(place, "other", grey, v(3.0, -1.0, -1.0), v(4.0, 0.0, 1.0));
    b.polygon(place, "other lamp", lamp, &flipped(facing_up([3.4, 3.6], [-0.6, -0.4], 0.9)));
    let node = b.node("lamp", None, DVec3::ZERO, DQuat::IDENTITY);
    slide(
        &mut b,
        node,
        [v(0.54, -0.375, 0.346), v(-0.334, 0.602, -0.281), v(-0.334, 0.602, -0.281)],
    );
    let values = [[-0.619, 0.077, -0.776, -0.097], [-0.539, -0.711, -0.393, 0.208]];
    let [one, two] = values.map(|q| DQuat::from_array(q).normalize());
    let times_s = vec![0.0, 4.0, 5.0];
    let interpolation = Interpolation::Linear;
    let track = RotationTrack { times_s, values: vec![one, two, two], interpolation };
    b.animate_rotation(node, track);
    b.polygon(node, "lamp", lamp, &flipped(facing_up([-0.25, 0.25], [-0.25, 0.25], 0.0)));
    let tilt = DQuat::from_xyzw(0.217, -0.352, 0.91, -0.013).normalize();
    let node = b.node("sheet", None, DVec3::ZERO, tilt);
    slide(
        &mut b,
        node,
        [v(0.175, 0.697, 0.248), v(-0.634, 0.278, 0.572), v(0.236, -0.634, -0.553)],
    );
    b.polygon(node, "sheet", both, &facing_up([-0.125, 0.125], [-0.0625, 0.0625], 0.0));
    let [warm, cold] = warm_and_cold(b, &at_tolerance(0.1), &[4.279, 4.0]);
    same_pairs([&warm, &cold]);
}

/// Slides a node through three places, at 0 s, 4 s and 5 s.
fn slide(b: &mut SceneBuilder, node: NodeId, values: [DVec3; 3]) {
    let (times_s, values) = (vec![0.0, 4.0, 5.0], values.to_vec());
    b.animate_translation(node, Track { times_s, values, interpolation: Interpolation::Linear });
}

#[test]
fn r5_a_narrow_cone_is_not_lost_between_sample_points() {
    // A large wall was culled where no sample point of it was lit, though the coarse walk had held
    // parts of it: they stayed in the coarse solution when the wall vanished.
    let mut b = SceneBuilder::new("narrow spot");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let node = still(&mut b, "floor");
    b.polygon(node, "floor", grey, &facing_up([-1.0, 1.0], [-1.0, 1.0], 0.0));
    let node = b.node("wall", None, DVec3::ZERO, DQuat::IDENTITY);
    b.animate_presence(node, vec![(0.0, true), (1.0, false)]);
    b.polygon(
        node,
        "wall",
        grey,
        &[v(-1., -1., 0.), v(-1., 1., 0.), v(-1., 1., 2.), v(-1., -1., 2.)],
    );
    // Shines along -x at the middle of the wall.
    let node = b.node("spot", None, v(0.0, 0.0, 1.0), DQuat::from_rotation_y(FRAC_PI_2));
    b.light("spot", node, LightKind::Spot { inner: 0.25, outer: 0.3 }, [1.0; 3]);
    let [mut warm, cold] = warm_and_cold(b, &at_tolerance(0.1), &[0.0, 1.0]);
    same_pairs([&warm, &cold]);
    warm.step(0, 0.0).unwrap();
    let lit = brightest(&warm, "wall");
    // 1 W/m2 arrives in the middle, half of it is reflected.
    assert!((lit - 0.5).abs() < 0.1, "the wall sends {lit} W/m2");
}

/// A closed room with a box in it.
fn closed_room(name: &str) -> SceneBuilder {
    let mut b = SceneBuilder::new(name);
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let node = still(&mut b, "room");
    b.cuboid_inward(node, "walls", grey, DVec3::splat(-1.0), DVec3::ONE);
    let node = b.node("box", None, v(0.667, -0.526, 0.466), DQuat::IDENTITY);
    b.cuboid(node, "box", grey, DVec3::splat(-0.375), DVec3::splat(0.375));
    b
}

/// A rotation about no axis of anything.
fn askew() -> DQuat {
    DQuat::from_xyzw(-0.584, 0.535, 0.516, 0.327).normalize()
}

/// Solves a scene in which it is dark but for what is outside, with links for a few megabytes.
fn is_dark_and_small(b: SceneBuilder) {
    let scene = Arc::new(b.build().unwrap());
    for tolerance in [0.2, 0.02] {
        let max_memory_bytes = Some(40_000_000);
        let options = Options { max_memory_bytes, ..at_tolerance(tolerance) };
        let mut session = Session::new(Arc::clone(&scene), options).unwrap();
        let report = session.step(0, 0.0).unwrap();
        assert!(report.links < 300_000, "{} links", report.links);
        assert!(brightest(&session, "walls") < 1e-5, "{}", brightest(&session, "walls"));
    }
}

#[test]
fn r6_a_sun_outside_a_closed_room_refines_nothing_without_end() {
    // No segment gets through, but fewer than all were tried: with nothing else to measure errors against, every
    // element was refined for the little that sixteen segments may overlook.
    let mut b = closed_room("sun outside");
    let node = b.node("sun", None, DVec3::ZERO, askew());
    b.light("sun", node, LightKind::Directional, [3.0; 3]);
    is_dark_and_small(b);
}

#[test]
fn r7_a_lamp_outside_a_closed_room_refines_nothing_without_end() {
    // What rounding let through between two shadows was all the light there was.
    let mut b = closed_room("lamp outside");
    let lamp = b.material("lamp", [0.1; 3], [9.0; 3]);
    let node = b.node("lamp", None, v(0.563, -1.506, -1.19), askew());
    b.polygon(node, "lamp", lamp, &facing_up([-0.375, 0.375], [-0.375, 0.375], 0.0));
    is_dark_and_small(b);
}

#[test]
fn r8_no_light_leaks_under_a_wall() {
    // Elements across the wall's foot carried the mean of the bright and of the dark side, and sent it to both.
    let mut b = SceneBuilder::new("two rooms");
    let white = b.material("white", [0.7; 3], [0.0; 3]);
    let wall = b.double_sided_material("wall", [0.7; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [90.0; 3]);
    let node = b.node("rooms", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(node, "room", white, DVec3::ZERO, v(6.2, 3.0, 2.6));
    // A slot at the top lets a little light through.
    let corners = [v(3.0, 0.0, 0.0), v(3.0, 3.0, 0.0), v(3.0, 3.0, 2.5), v(3.0, 0.0, 2.5)];
    b.polygon(node, "wall", wall, &corners);
    let down = [v(1.0, 1.0, 2.0), v(1.0, 2.0, 2.0), v(2.0, 2.0, 2.0), v(2.0, 1.0, 2.0)];
    b.polygon(node, "lamp", lamp, &down);
    let scene = Arc::new(b.build().unwrap());
    let dark = |tolerance| {
        let mut session = Session::new(Arc::clone(&scene), at_tolerance(tolerance)).unwrap();
        session.step(0, 0.0).unwrap();
        let beside = session.frame().unwrap().irradiance_at(v(3.4, 1.5, 0.0), DVec3::Z)[0];
        [beside, session.frame().unwrap().irradiance_at(v(5.5, 1.5, 0.0), DVec3::Z)[0]]
    };
    let (coarse, fine) = (dark(0.1), dark(0.01));
    for (coarse, fine) in coarse.iter().zip(fine) {
        assert!((coarse / fine - 1.0).abs() < 0.1, "{coarse} at 0.1, {fine} at 0.01");
    }
}
