//! Links that follow the motion of many bodies, against links built anew: bit for bit.

use std::sync::Arc;

use glam::DVec2;
use relume_core::flat::{FlatOptions, FlatScene, FlatSession, Key, Material, Motion, Segment};
use relume_core::pair::{EventKind, State};
use relume_core::session::{FrameReport, Missed, Update, missed, radiosity_gap};
use relume_io::flat::parse;

/// Numbers that look random; the same in every run (SplitMix64).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.next()
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

/// A room with bodies of all shapes that fly about, through each other and through the walls; some
/// rest for a while, some for good.
fn random_scene(dice: &mut Dice, bodies: usize, duration_s: f64) -> FlatScene {
    let mut scene = FlatScene::new();
    scene.body("room", Motion::default()).unwrap();
    let room = [(0., 0.), (4., 0.), (4., 3.), (0., 3.)].map(DVec2::from);
    scene.polygon("wall", &room, Material::grey(0.6)).unwrap();
    for k in 0..bodies {
        let keys = match dice.below(4) {
            0 => 1,
            n => 2 + 2 * n,
        };
        let mut place = DVec2::new(dice.within(0.3, 3.7), dice.within(0.3, 2.7));
        let mut angle = dice.within(0.0, 6.0);
        let mut key = |n: usize, dice: &mut Dice| {
            if n > 0 && dice.next() < 0.7 {
                place = DVec2::new(dice.within(-0.2, 4.2), dice.within(-0.2, 3.2));
                angle += dice.within(-2.0, 2.0) * f64::from(u8::from(dice.next() < 0.5));
            }
            Key { time_s: duration_s * n as f64 / keys as f64, place, angle }
        };
        let keys = (0..keys).map(|n| key(n, dice)).collect();
        scene.body(&format!("body{k}"), Motion::new(keys)).unwrap();
        let size = dice.within(0.1, 0.5);
        let mut material = Material::grey(dice.within(0.1, 0.8));
        if k % 4 == 0 {
            material = material.emitting(5.0);
        }
        let corners = 2 + dice.below(4);
        if corners == 2 {
            let ends = (DVec2::new(-size, 0.0), DVec2::new(size, 0.0));
            material.two_sided = dice.next() < 0.5;
            scene.wall("sheet", Segment::new(ends.0, ends.1), material).unwrap();
        } else {
            let corner =
                |k| DVec2::from_angle(-std::f64::consts::TAU * k as f64 / corners as f64) * size;
            let corners: Vec<DVec2> = (0..corners).map(corner).collect();
            scene.polygon("side", &corners, material).unwrap();
        }
    }
    scene
}

fn options(epsilon: f64, update: Update) -> FlatOptions {
    FlatOptions { epsilon, min_length_m: 0.1, update, events: true, ..FlatOptions::default() }
}

/// What a walk through random frames did, summed.
#[derive(Default)]
struct Walk {
    events: u64,
    reinspected: u64,
    examined: u64,
    /// Judged since an end moved.
    reevaluated: u64,
    followed: u64,
    certified: u64,
}

impl std::ops::AddAssign for Walk {
    fn add_assign(&mut self, other: Walk) {
        self.events += other.events;
        self.reinspected += other.reinspected;
        self.examined += other.examined;
        self.reevaluated += other.reevaluated;
        self.followed += other.followed;
        self.certified += other.certified;
    }
}

/// Goes through the frames of a scene, some of them there and back, `pace` of its frames at a time: with
/// certificates and without, and against cold builds. `coarse` makes threshold and elements larger.
fn check_frames(seed: u64, bodies: usize, frames: u32, (pace, coarse): (f64, f64)) -> Walk {
    let mut dice = Dice(seed);
    let scene = Arc::new(random_scene(&mut dice, bodies, f64::from(frames)));
    let epsilon = coarse * dice.within(0.05, 0.3);
    let session = |update| {
        let options = FlatOptions { min_length_m: 0.1 * coarse, ..options(epsilon, update) };
        FlatSession::new(scene.clone(), options).unwrap()
    };
    let [mut certain, mut warm, mut cold] =
        [Update::Certificate, Update::Reinspect, Update::Scratch].map(session);
    let mut walk = Walk::default();
    let begin_s = dice.within(0.0, f64::from(frames) * (1.0 - pace).max(0.0));
    for frame in 0..frames {
        // Now and then somewhere else, or on at another pace for one frame.
        let time_s = match dice.next() {
            d if d < 0.03 => dice.within(0.0, f64::from(frames)),
            d if d < 0.05 => begin_s + pace * (f64::from(frame) + dice.within(-0.5, 0.5)),
            _ => begin_s + pace * f64::from(frame),
        };
        let reports = [&mut certain, &mut warm, &mut cold].map(|s| s.step(frame, time_s));
        let of = |r: &FrameReport| {
            (r.hash.clone(), r.links, r.pairs.refined, r.pairs.culled, r.elements, r.leaves)
        };
        let [one, two, built] = &reports;
        let place = format!("seed {seed}, pace {pace}, frame {frame} at {time_s}");
        assert_eq!(of(two), of(built), "{place}");
        assert_eq!(of(one), of(built), "with certificates, {place}");
        // No event later than it is due.
        assert_eq!(
            missed(certain.solved().unwrap(), warm.solved().unwrap()),
            Missed::default(),
            "{place}"
        );
        assert_eq!(
            (one.work.changed, one.work.segments),
            (two.work.changed, two.work.segments),
            "{place}"
        );
        for followed in [&certain, &warm] {
            radiosity_gap(followed.solved().unwrap(), cold.solved().unwrap())
                .unwrap_or_else(|e| panic!("{place}: {e}"));
        }
        walk += Walk {
            events: warm.frame().unwrap().link_events().len() as u64,
            reinspected: two.work.examined,
            examined: one.work.examined,
            reevaluated: one.work.reevaluated,
            followed: one.work.followed,
            certified: one.work.certified,
        };
        if frame % 50 == 0 {
            audit(&certain);
        }
    }
    walk
}

/// Coverage of the pair tree, and the bounds of what links carry.
fn audit(session: &FlatSession) {
    let (tree, forest) = session.frame().unwrap().pairs();
    for link in session.frame().unwrap().links() {
        let x = f64::from(link.carried.exchange_area_m2);
        let shorter = forest.length(link.a).min(forest.length(link.b));
        assert!(x >= 0.0 && x <= shorter * (1.0 + 1e-6));
    }
    let all: f64 = forest.facets().iter().map(|&f| forest.length(f)).sum();
    let product = |a, b| forest.length(a) * forest.length(b);
    let mut covered = 0.0;
    let mut stack = vec![relume_core::pair::PairTree::ROOT];
    while let Some(pair) = stack.pop() {
        let (a, b) = tree.ends(pair);
        match tree.state(pair) {
            // A facet with itself counts once, all others in both orders.
            State::Active | State::Culled(_) => {
                covered += if a == b { product(a, b) } else { 2.0 * product(a, b) };
            }
            _ => stack.extend(tree.children(pair).map(relume_core::pair::PairId)),
        }
    }
    assert!((covered - all * all).abs() < 1e-9 * all * all, "{covered} {}", all * all);
    for id in forest.elements() {
        let children: f64 =
            forest.children(id).map(|c| forest.length(relume_core::element::ElementId(c))).sum();
        assert!(forest.children(id).is_empty() || (children - forest.length(id)).abs() < 1e-12);
    }
}

#[test]
fn links_that_follow_random_motion_are_those_of_a_cold_build() {
    let mut walk = Walk::default();
    for seed in 0..12 {
        walk += check_frames(seed, 2 + seed as usize % 9, 200, (1.0, 1.0));
    }
    assert!(walk.events > 100_000, "{}: too quiet to show anything", walk.events);
}

#[test]
fn certificates_spare_work_where_things_move_slowly() {
    let mut walk = Walk::default();
    for seed in 20..32 {
        walk += check_frames(seed, 2 + seed as usize % 9, 150, (0.02, 1.0));
    }
    let Walk { events, reinspected, examined, followed, certified, .. } = walk;
    println!("judged {examined} of {reinspected}; {followed} followed, {certified} passed over");
    assert!(events > 1000, "{events}");
    assert!(10 * examined < 7 * reinspected && followed > 1000 && certified > 1000);
}

/// Steps through times with certificates; links are those of cold builds. What the third step and those
/// after it did.
fn follow(text: &str, epsilon: f64, times_s: impl Iterator<Item = f64>) -> Walk {
    let scene = Arc::new(parse(text).unwrap());
    let session = |update| FlatSession::new(scene.clone(), options(epsilon, update)).unwrap();
    let (mut certain, mut cold) = (session(Update::Certificate), session(Update::Scratch));
    let mut walk = Walk::default();
    for (frame, time_s) in times_s.enumerate() {
        let (one, two) = (certain.step(frame as u32, time_s), cold.step(frame as u32, time_s));
        assert_eq!(one.hash, two.hash, "frame {frame} at {time_s}");
        // Before that nothing is foreseen.
        if frame < 2 {
            continue;
        }
        walk += Walk {
            events: certain.frame().unwrap().link_events().len() as u64,
            reevaluated: one.work.reevaluated,
            followed: one.work.followed,
            ..Walk::default()
        };
    }
    walk
}

/// Its wall stands beside the floor's shaft, and the lamp in front of where the wall gets; only the line of
/// the wall, which turns, passes the lamp.
#[test]
fn a_wall_that_turns_with_its_floor_leans_into_the_light() {
    let text = "segment lamp 0.9 10 0.8 10 emit 1\n\
        body corner\nat 0 0 0 0\nat 100 0 0 11.5\nsegment floor 0 0 1 0\nsegment wall 1 0 1 1\n";
    let walk = follow(text, 0.9, (0..40).map(f64::from));
    assert!(walk.events > 0);
}

/// Room walls touch the shafts from a lamp to the floor, in the corners; so do its own sides.
#[test]
fn what_touches_a_shaft_in_a_corner_does_not_stand_in_the_way() {
    let text = "polygon room 1 1 3 1 3 2 1 2\nbody lamp\nat 0 1.5 1.8\nat 100 2.5 1.8\n\
        polygon lamp 0 0 0 0.1 0.3 0.1 0.3 0 emit 1\n";
    let walk = follow(text, 0.1, (0..40).map(f64::from));
    assert!(walk.followed > 10 * walk.reevaluated, "{} judged", walk.reevaluated);
}

/// A box that slides on the floor, one on top of it that slides on it, a door that turns about the end of a
/// screen, a lamp along the ceiling: at every pace, near the origin and far from it, turned and not.
#[test]
fn bodies_that_touch_agree_with_cold_builds() {
    for (x, y, turned) in [(0.0, 0.0, 0.0), (0.3, 7.0, 0.0), (-800.0, 500.0, 0.0), (2.0, 1.0, 31.0)]
    {
        let turn = DVec2::from_angle(f64::to_radians(turned));
        let at = |time: f64, u: f64, v: f64, degrees: f64| {
            let p = turn.rotate(DVec2::new(u, v)) + DVec2::new(x, y);
            format!("at {time} {} {} {}\n", p.x, p.y, turned + degrees)
        };
        let text = [
            "body room\n",
            &at(0.0, 0.0, 0.0, 0.0),
            "polygon wall 0 0 4 0 4 3 0 3\nsegment screen 2 3 2 2 two-sided\n",
            "body box\n",
            &(at(0.0, 0.2, 0.0, 0.0) + &at(10.0, 3.0, 0.0, 0.0)),
            "polygon box 0 0 0 0.5 0.8 0.5 0.8 0\n",
            "body top\n",
            &(at(0.0, 0.3, 0.5, 0.0) + &at(10.0, 2.4, 0.5, 0.0)),
            "polygon top 0 0 0 0.3 0.4 0.3 0.4 0\n",
            "body door\n",
            &(at(0.0, 2.0, 2.0, 0.0) + &at(6.0, 2.0, 2.0, 120.0)),
            "segment door 0 0 0.7 0 two-sided\nbody lamp\n",
            &(at(0.0, 0.0, 3.0, 0.0) + &at(10.0, 1.5, 3.0, 0.0)),
            "segment lamp 0.3 0 0 0 emit 9\n",
        ];
        for (frames, pace) in [(40, 0.3), (60, 0.02)] {
            let walk = follow(&text.concat(), 0.2, (0..frames).map(|k| f64::from(k) * pace));
            assert!(walk.followed > 0, "{turned}, {pace}");
        }
    }
}

/// What was foreseen is not carried along where time goes back, also while nothing moves.
#[test]
fn certificates_do_not_outlast_a_rest_that_is_left_backwards() {
    let text = "segment floor 0 0 1 0 emit 1\nsegment top 1 1 0 1\n\
        body screen\nat 0 1.5 0.5\nat 1 0.5 0.5\nat 9 0.5 0.5\nat 10 1.5 0.5\nsegment screen 0.3 0 -0.3 0\n";
    let tenths = |from: i32, to: i32| (from..to).map(|k| f64::from(k) * 0.1);
    let back = |from: i32, to: i32| (from..to).rev().map(|k| f64::from(k) * 0.1);
    follow(
        text,
        0.1,
        tenths(0, 40).chain(back(0, 41)).chain(tenths(0, 120)).chain([0.5, 9.5, 0.5]),
    );
}

/// Scenes are small beside those above: what costs time is what stands between the walls of many bodies.
#[test]
#[ignore = "40,000 frames: some minutes"]
fn links_follow_random_motion_for_tens_of_thousands_of_frames() {
    let check = |seed: u64| {
        let pace = [1.0, 0.2, 0.02][seed as usize % 3];
        check_frames(seed, 3 + seed as usize % 8, 400, (pace, 3.0))
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let events: u64 = std::thread::scope(|scope| {
        let share = |k| {
            let seeds = (100 + k..200).step_by(threads as usize);
            scope.spawn(move || seeds.map(|seed| check(seed).events).sum::<u64>())
        };
        let shares: Vec<_> = (0..threads).map(share).collect();
        shares.into_iter().map(|share| share.join().expect("a frame differs")).sum()
    });
    assert!(events > 500_000, "{events}: too quiet to show anything");
}

/// A gutter and a patch that comes down on it.
const GUTTER: &str = "body gutter\nsegment floor 0 0 1 0 emit 1\nsegment wall 0 1 0 0\n\
    body patch\nat 0 0.9 0.9\nat 10 0.25 0.25\nsegment patch 0.15 -0.15 -0.15 0.15\n";

fn gutter(update: Update) -> FlatSession {
    let scene = Arc::new(parse(GUTTER).unwrap());
    FlatSession::new(scene, FlatOptions { epsilon: 0.1, ..options(0.1, update) }).unwrap()
}

#[test]
fn what_comes_nearer_is_demoted_and_promoted_on_the_way_back() {
    let mut session = gutter(Update::Reinspect);
    let count = |session: &FlatSession, kind| {
        session.frame().unwrap().link_events().iter().filter(|e| e.kind == kind).count() as u64
    };
    let there = session.step(0, 0.0);
    assert!(session.frame().unwrap().link_events().is_empty());
    let near = session.step(1, 10.0);
    assert!(near.work.demoted > 0 && near.elements > there.elements && near.links > there.links);
    assert!(count(&session, EventKind::Demoted) == near.work.demoted);
    assert!(near.work.occlusion_changed > 0 && near.work.visibility_only > 0);
    let back = session.step(2, 0.0);
    assert!(back.work.promoted > 0 && count(&session, EventKind::Promoted) > 0);
    assert_eq!((back.hash, back.elements), (there.hash, there.elements));
}

#[test]
fn a_hidden_link_is_kept_and_restored() {
    let text = "segment one 0 0 1 0\nsegment two 1 1 0 1 emit 1\n\
        body screen\nat 0 5 0.5\nat 1 0.5 0.5\nsegment screen -0.8 0 0.8 0\n";
    let scene = Arc::new(parse(text).unwrap());
    // One link between the two walls.
    let coarse = FlatOptions { epsilon: 0.9, ..options(0.9, Update::Reinspect) };
    let mut session = FlatSession::new(scene, coarse).unwrap();
    let visibility = |s: &FlatSession| {
        let (_, forest) = s.frame().unwrap().pairs();
        let of = |id| forest.wall(id).0.0;
        let link = s
            .frame()
            .unwrap()
            .links()
            .into_iter()
            .find(|l| of(l.a) + of(l.b) == 1)
            .expect("it is kept");
        link.carried.visibility()
    };
    session.step(0, 0.0);
    assert_eq!(visibility(&session), 1.0);
    let hidden = session.step(1, 1.0);
    assert_eq!(visibility(&session), 0.0);
    assert!(session.frame().unwrap().link_events().iter().any(|e| e.kind == EventKind::Occluded));
    assert_eq!(hidden.work.visibility_only, 1, "the pair of the two walls, and no other");
    session.step(2, 0.0);
    assert_eq!(visibility(&session), 1.0);
    assert!(session.frame().unwrap().link_events().iter().any(|e| e.kind == EventKind::Revealed));
}

#[test]
fn pairs_within_a_body_that_moves_alone_are_left_alone() {
    let text = "body gutter\nat 0 0 0\nat 1 3 1 70\nsegment floor 0 0 1 0 emit 1\n\
        segment wall 0 1 0 0\nsegment post 0.4 0 0.4 0.3 two-sided\n";
    let scene = Arc::new(parse(text).unwrap());
    let mut session = FlatSession::new(scene, options(0.1, Update::Reinspect)).unwrap();
    let before = session.step(0, 0.0);
    let after = session.step(1, 0.7);
    assert_eq!(after.moved, ["gutter"]);
    assert_eq!((after.work.examined, after.hash), (0, before.hash));
}

#[test]
fn extrapolated_links_stay_close() {
    let (mut followed, mut line) =
        (gutter(Update::Reinspect), gutter(Update::Extrapolate { frames: 7, error: None }));
    let mut extrapolated = 0;
    for frame in 0..60 {
        let time_s = f64::from(frame) / 6.0;
        followed.step(frame, time_s);
        extrapolated += line.step(frame, time_s).work.extrapolated;
        let sum = |s: &FlatSession| -> f64 {
            s.frame()
                .unwrap()
                .links()
                .iter()
                .map(|l| f64::from(l.carried.exchange_area_past_occluders_m2()))
                .sum()
        };
        let (exact, guess) = (sum(&followed), sum(&line));
        assert!((exact - guess).abs() < 0.05 * exact, "frame {frame}: {exact} {guess}");
    }
    assert!(extrapolated > 1000, "{extrapolated}");
}

#[test]
fn what_was_extrapolated_does_not_outlast_a_rest_or_a_jump() {
    let text = "body floor\nsegment floor 0 0 4 0 emit 1\n\
        body patch\nat 0 1 2\nat 1 3 0.6\nat 2 3 0.6\nsegment patch 0.5 0 0 0\n";
    let scene = Arc::new(parse(text).unwrap());
    let session = |update| FlatSession::new(scene.clone(), options(0.05, update)).unwrap();
    let cold = |time_s| session(Update::Scratch).step(0, time_s).hash;
    let goes = || {
        let mut session = session(Update::Extrapolate { frames: 7, error: None });
        let mut step = |frame: u32| session.step(frame, f64::from(frame) / 12.0);
        let extrapolated = (0..=11).map(|frame| step(frame).work.extrapolated).sum::<u64>();
        assert!(extrapolated > 100, "{extrapolated}");
        session
    };
    let mut rests = goes();
    // The last frame that moves, and frames enough for every link to be evaluated again.
    let hash = (12..24).map(|frame| rests.step(frame, f64::from(frame) / 12.0).hash).last();
    assert_eq!(hash.unwrap(), cold(23.0 / 12.0));
    for time_s in [0.0, 11.0 / 12.0, 0.5, 2.0] {
        assert_eq!(goes().step(12, time_s).hash, cold(time_s), "a jump to {time_s} s");
    }
}

#[test]
fn extrapolated_links_that_no_scene_can_have_are_built_anew() {
    let text = "polygon room 0 0 4 0 4 3 0 3 reflectance 0.95\nbody a\nat 0 .5 .5 0\nat .5 3.5 .5 180\n\
        at 1 3.5 2.5 0\nat 2 .5 2.5 720\n\
        polygon a -.4 -.4 -.4 .4 .4 .4 .4 -.4 reflectance 0.95 emit 1\n\
        body b\nat 0 3 2\nat 1 1 1 500\nat 2 3 2.9 0\n\
        segment b -.5 0 .5 0 two-sided reflectance 0.95\n";
    let scene = Arc::new(parse(text).unwrap());
    let update = Update::Extrapolate { frames: 60, error: None };
    let mut session = FlatSession::new(scene, options(0.1, update)).unwrap();
    for frame in 0..120 {
        let report = session.step(frame, f64::from(frame) / 60.0);
        assert!(report.residual < 1e-3, "frame {frame}: {}", report.residual);
        let energy = report.energy.unwrap();
        assert!(energy.absorbed_w < 12.0 * energy.emitted_w, "frame {frame}: {energy:?}");
    }
}

#[test]
fn a_room_that_reflects_all_but_everything_settles() {
    let text = "polygon room 0 0 2 0 2 1 0 1 reflectance 0.999999 emit 1\n";
    let scene = Arc::new(parse(text).unwrap());
    let mut session = FlatSession::new(scene, options(0.1, Update::Scratch)).unwrap();
    let report = session.step(0, 0.0);
    assert!(report.residual < 1e-5, "{} after {} sweeps", report.residual, report.sweeps);
    assert!(parse("segment a 0 0 1 0 reflectance 0.9999999999").is_err());
}

#[test]
fn energy_is_kept_in_a_closed_room() {
    let text = "polygon room 0 0 2 0 2 1 0 1 reflectance 0.7\n\
        body lamp\nat 0 0.5 0.8\nat 1 1.5 0.8\npolygon lamp 0 0 0 0.05 0.3 0.05 0.3 0 emit 10\n";
    let scene = Arc::new(parse(text).unwrap());
    let fine = FlatOptions { epsilon: 0.02, min_length_m: 0.01, ..FlatOptions::default() };
    let mut session = FlatSession::new(scene, fine).unwrap();
    for frame in 0..3 {
        let report = session.step(frame, 0.5 * f64::from(frame));
        let (energy, rows) = (report.energy.unwrap(), report.row_sum_error.unwrap());
        assert!(energy.emitted_w > 0.0);
        assert!(energy.escaped_w.abs() < 5e-3 * energy.emitted_w, "{energy:?}");
        // An exact patch row, shared out over leaves that inherit constants.
        assert!(rows.rms < 0.1, "{rows:?}");
    }
}
