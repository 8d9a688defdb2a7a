//! What a motion costs, in exact counters, with brute force as the judge of what it changed.
//!
//! Brute force: two cold builds, before and after, compared pair by pair.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::common::pairs::{Difference, Is, Name, difference, first_differences, pairs_of};
use crate::common::{
    at_tolerance, facing_up, flipped, form_factor_oracle, lit_room, sliding, still, v,
};
use glam::{DQuat, DVec3};
use relume_core::element::ElementId;
use relume_core::pair::PairId;
use relume_core::scene::{BodyId, Interpolation, LightKind, Scene, SceneBuilder, Track};
use relume_core::session::{FrameReport, Options, Session};

fn cold(scene: &Arc<Scene>, options: &Options, time_s: f64) -> Session {
    let mut session = Session::new(Arc::clone(scene), options.clone()).unwrap();
    session.step(0, time_s).unwrap();
    session
}

/// Moves from one time to another; the counters, and what brute force says that changed.
fn moved(scene: &Arc<Scene>, options: &Options, [from, to]: [f64; 2]) -> (FrameReport, Difference) {
    let mut session = cold(scene, options, from);
    let before = pairs_of(&session);
    let report = session.step(1, to).unwrap();
    let after = cold(scene, options, to);
    let (warm, wanted) = (pairs_of(&session), pairs_of(&after));
    assert!(warm == wanted, "{}", first_differences(&session, &after));
    (report, difference(&before, &after))
}

/// Asserts that the counters say what brute force found.
fn counts_exactly(name: &str, report: &FrameReport, found: &Difference) {
    println!(
        "{name}: visited {} examined {} (moved {}, occlusion {}, brightness {}) changed {} of {} pairs; {found:?}",
        report.work.visited,
        report.work.examined,
        report.work.reevaluated,
        report.work.visibility_only,
        report.work.brightness_only,
        report.work.changed,
        report.pairs.active + report.pairs.refined + report.pairs.culled,
    );
    assert_eq!(report.work.changed, found.other + found.new, "{name}: changed");
    assert_eq!(report.work.promoted, found.promoted, "{name}: promoted");
    assert_eq!(report.work.demoted, found.demoted, "{name}: demoted");
    assert_eq!(report.work.occlusion_changed, found.occluded, "{name}: occluded");
    assert!(report.work.examined <= report.work.visited, "{name}");
    let reasons =
        report.work.reevaluated + report.work.visibility_only + report.work.brightness_only;
    assert_eq!(report.work.examined, reasons, "{name}: every look has a reason");
}

fn both_oracles() -> [(&'static str, Options); 2] {
    [("error", at_tolerance(0.1)), ("form factor", form_factor_oracle(0.05, 1e-3))]
}

/// A room of two by two by one with a resting lamp and, at `pillars`, pillars from floor to ceiling.
fn hall(b: &mut SceneBuilder, pillars: &[[f64; 2]]) {
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [10.0; 3]);
    let room = still(b, "hall");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, v(2.0, 2.0, 1.0));
    for (k, [x, y]) in pillars.iter().enumerate() {
        let name = format!("pillar {k}");
        let node = still(b, &name);
        b.cuboid(node, &name, grey, v(x - 0.2, y - 0.2, 0.0), v(x + 0.2, y + 0.2, 1.0));
    }
    let node = still(b, "lamp");
    b.polygon(node, "lamp", lamp, &flipped(facing_up([0.3, 0.7], [0.3, 0.7], 0.95)));
}

/// Adds a small box that slides.
fn slider(b: &mut SceneBuilder, size: f64, from: DVec3, to: DVec3) {
    let red = b.material("red", [0.6, 0.2, 0.2], [0.0; 3]);
    let node = sliding(b, "slider", from, to);
    b.cuboid(node, "slider", red, DVec3::splat(-size), DVec3::splat(size));
}

#[test]
fn a_body_that_rests_costs_nothing() {
    let scene = Arc::new(lit_room());
    for (name, options) in both_oracles() {
        let mut session = cold(&scene, &options, 1.0);
        let before = session.step(1, 1.0).unwrap();
        // The tracks end at 1 s.
        for time_s in [1.0, 1.5, 90.0] {
            let report = session.step(2, time_s).unwrap();
            let work = [
                report.work.visited,
                report.work.examined,
                report.work.changed,
                report.work.segments,
                report.gathers,
                u64::from(report.sweeps),
                report.work.elements_made + report.elements_reaped,
            ];
            assert_eq!(work, [0; 7], "{name} at {time_s}");
            assert_eq!((&report.hash, report.links), (&before.hash, before.links), "{name}");
        }
    }
}

#[test]
fn counters_say_what_brute_force_finds() {
    let scene = Arc::new(lit_room());
    for (name, options) in both_oracles() {
        for times in [[0.0, 0.05], [0.5, 0.25], [1.0, 0.0]] {
            let (report, found) = moved(&scene, &options, times);
            counts_exactly(&format!("lit room, {name}, {times:?}"), &report, &found);
        }
    }
}

/// Pairs without an end on the body of which state, X or V differ between two tables.
fn changed_elsewhere(session: &Session, body: &str, [one, two]: [&Table; 2]) -> usize {
    let (scene, (_, forest)) = (session.scene(), session.frame().unwrap().pairs());
    let on_it = |end: &(u32, u32)| {
        let id = ElementId(end.0);
        let patch = forest.patch(id).map(|p| scene.patches[p.0 as usize].body);
        let on = patch.or(forest.cluster_body(id));
        on.is_some_and(|b| scene.bodies[b.0 as usize].name == body)
    };
    let still = |name: &Name| !on_it(&name.0) && !on_it(&name.1);
    let names: BTreeSet<&Name> = one.keys().chain(two.keys()).filter(|n| still(n)).collect();
    assert!(names.len() > 100, "nothing to compare");
    // Gradients of partly hidden pairs come from pieces: a polygon hidden behind another cuts
    // them in other places.
    let is = |table: &Table, n: &Name| {
        let (state, carried) = table.get(n)?;
        Some((*state, carried.map(|c| (c.exchange_area_m2, c.visibility))))
    };
    names.into_iter().filter(|n| is(one, n) != is(two, n)).count()
}

type Table = BTreeMap<Name, Is>;

#[test]
fn a_box_within_a_pillar_changes_nothing_but_its_own_pairs() {
    // No lamp: with it more than twelve polygons would stand in some shafts, and their V would come
    // from segments, with noise.
    let mut b = SceneBuilder::new("pillar");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, v(2.0, 2.0, 1.0));
    let node = still(&mut b, "pillar");
    b.cuboid(node, "pillar", grey, v(1.0, 1.0, 0.0), v(1.4, 1.4, 1.0));
    slider(&mut b, 0.1, v(1.15, 1.15, 0.4), v(1.25, 1.25, 0.6));
    let scene = Arc::new(b.build().unwrap());
    let options = form_factor_oracle(0.05, 1e-3);
    let (report, found) = moved(&scene, &options, [0.0, 1.0]);
    counts_exactly("within a pillar", &report, &found);
    let [one, two] = [0.0, 1.0].map(|t| cold(&scene, &options, t));
    assert_eq!(changed_elsewhere(&one, "slider", [&pairs_of(&one), &pairs_of(&two)]), 0);
}

#[test]
fn a_box_behind_a_pillar_is_not_news_to_the_lamp() {
    // Seen from the lamp, all of the slider's way lies behind the pillar.
    let mut b = SceneBuilder::new("pillar");
    hall(&mut b, &[[1.0, 1.0]]);
    slider(&mut b, 0.05, v(1.3, 1.3, 0.5), v(1.35, 1.35, 0.5));
    let scene = Arc::new(b.build().unwrap());
    for (name, options) in both_oracles() {
        let (report, found) = moved(&scene, &options, [0.0, 1.0]);
        counts_exactly(&format!("behind a pillar, {name}"), &report, &found);
        let all = report.pairs.active + report.pairs.refined + report.pairs.culled;
        assert!(report.work.examined < all / 2, "{name}: {} of {all}", report.work.examined);
    }
}

/// The hall with a slider in its corner; with a second room, closed and out of the way, if wanted.
fn with_second_room(wanted: bool) -> Arc<Scene> {
    let mut b = SceneBuilder::new("two rooms");
    hall(&mut b, &[]);
    slider(&mut b, 0.05, v(0.1, 0.1, 0.1), v(0.15, 0.1, 0.1));
    if wanted {
        let wall = b.material("far wall", [0.4; 3], [0.1; 3]);
        let room = still(&mut b, "far room");
        b.cuboid_inward(room, "far walls", wall, v(30.0, 0.0, 0.0), v(31.0, 1.0, 1.0));
        let node = still(&mut b, "far box");
        b.cuboid(node, "far box", wall, v(30.3, 0.3, 0.3), v(30.6, 0.6, 0.6));
    }
    Arc::new(b.build().unwrap())
}

#[test]
fn a_second_room_is_left_alone() {
    let options = form_factor_oracle(0.03, 1e-4);
    let alone = moved(&with_second_room(false), &options, [0.0, 1.0]);
    let both = moved(&with_second_room(true), &options, [0.0, 1.0]);
    counts_exactly("one room", &alone.0, &alone.1);
    counts_exactly("two rooms", &both.0, &both.1);
    let far = cold(&with_second_room(true), &options, 0.0);
    let (tree, forest) = far.frame().unwrap().pairs();
    let scene = far.scene();
    let is_far = |e: ElementId| {
        let patch = forest.patch(e).map(|p| scene.patches[p.0 as usize].body);
        patch.is_some_and(|b| scene.bodies[b.0 as usize].name.starts_with("far"))
    };
    let inner = tree.links().filter(|l| is_far(l.a) && is_far(l.b)).count() as u64;
    let across = tree.links().filter(|l| is_far(l.a) != is_far(l.b)).count() as u64;
    let extra = both.0.work.examined - alone.0.work.examined;
    println!("far room: {inner} links within, {across} into it, {extra} pairs more examined");
    assert!(inner > 20 * across, "the far room is not the larger part: {inner} {across}");
    // Those across are the slider's own, and what the hall sees of the far room past the slider.
    assert!(extra <= 2 * across + 20, "{extra} pairs of a far room examined");
}

#[test]
fn a_body_that_leaves_restores_every_visibility() {
    let mut b = SceneBuilder::new("visitor");
    hall(&mut b, &[[1.2, 1.2]]);
    let red = b.material("red", [0.6, 0.2, 0.2], [0.0; 3]);
    let node = b.node("slider", None, v(900.0, 40.0, 7.0), DQuat::IDENTITY);
    let values = vec![v(900.0, 40.0, 7.0), v(0.6, 0.6, 0.5), v(900.0, 47.0, -3.0)];
    let track = Track { times_s: vec![0.0, 1.0, 2.0], values, interpolation: Interpolation::Step };
    b.animate_translation(node, track);
    b.cuboid(node, "slider", red, DVec3::splat(-0.2), DVec3::splat(0.2));
    comes_and_goes(&Arc::new(b.build().unwrap()));
}

#[test]
fn a_body_that_appears_and_disappears_leaves_no_trace() {
    let mut b = SceneBuilder::new("ghost");
    hall(&mut b, &[[1.2, 1.2]]);
    let red = b.material("red", [0.6, 0.2, 0.2], [0.0; 3]);
    let node = b.node("slider", None, v(0.6, 0.6, 0.5), DQuat::IDENTITY);
    b.animate_presence(node, vec![(0.0, false), (1.0, true), (2.0, false)]);
    b.cuboid(node, "slider", red, DVec3::splat(-0.2), DVec3::splat(0.2));
    comes_and_goes(&Arc::new(b.build().unwrap()));
}

/// A body named `slider` is away at 0 s and 2 s, and in the light at 1 s.
fn comes_and_goes(scene: &Arc<Scene>) {
    for (name, options) in both_oracles() {
        let mut session = cold(scene, &options, 0.0);
        let (empty, elements) = (pairs_of(&session), session.frame().unwrap().pairs().1.counts());
        session.step(1, 1.0).unwrap();
        let there = pairs_of(&session);
        let report = session.step(2, 2.0).unwrap();
        let after = pairs_of(&session);
        let hidden = changed_elsewhere(&session, "slider", [&empty, &there]);
        println!("{name}: {hidden} pairs felt it, {} changed as it left", report.work.changed);
        assert!(hidden > 20, "{name}: it blocks nothing");
        assert_eq!(changed_elsewhere(&session, "slider", [&empty, &after]), 0, "{name}");
        let slider = scene.bodies.iter().position(|b| b.name == "slider").unwrap();
        if scene.pose(BodyId(slider as u32), 2.0).is_none() {
            assert!(
                empty == after && session.frame().unwrap().pairs().1.counts() == elements,
                "{name}"
            );
        }
    }
}

#[test]
fn a_small_box_in_a_corner_concerns_few_pairs() {
    for (name, options) in
        [("error", at_tolerance(0.05)), ("form factor", form_factor_oracle(0.02, 1e-4))]
    {
        let (report, found) = moved(&with_second_room(false), &options, [0.0, 1.0]);
        counts_exactly(&format!("small box, {name}"), &report, &found);
        let all = report.pairs.active + report.pairs.refined + report.pairs.culled;
        assert!(
            report.work.examined * 3 < all,
            "{name}: {} of {all} examined",
            report.work.examined
        );
    }
}

#[test]
fn a_light_that_moves_concerns_its_own_pairs() {
    let mut b = SceneBuilder::new("light");
    hall(&mut b, &[[1.2, 1.2]]);
    let node = sliding(&mut b, "light", v(0.5, 1.5, 0.5), v(0.6, 1.5, 0.5));
    b.light("light", node, LightKind::Point, [1.0; 3]);
    let scene = Arc::new(b.build().unwrap());
    let options = form_factor_oracle(0.05, 1e-3);
    let (report, found) = moved(&scene, &options, [0.0, 1.0]);
    counts_exactly("point light", &report, &found);
    let session = cold(&scene, &options, 1.0);
    let (tree, forest) = session.frame().unwrap().pairs();
    let lit = (0..)
        .map(PairId)
        .take(tree.len())
        .filter(|&id| {
            let (a, b) = tree.ends(id);
            forest.light(a).is_some() || forest.light(b).is_some()
        })
        .count() as u64;
    // A light blocks nothing: pairs of surfaces feel nothing of it.
    assert!(
        report.work.examined <= lit + 3,
        "{} examined, {lit} of the light",
        report.work.examined
    );
    assert_eq!(report.work.visibility_only, 0);
}
