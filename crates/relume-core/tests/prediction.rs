//! The strategies of prediction: certificates miss nothing and spare work; extrapolation loses what it
//! says, and nothing once all is at rest.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::common;
use crate::common::{
    at_tolerance, facing_up, flipped, form_factor_oracle, lit_room, sliding, still, v,
};
use glam::{DQuat, DVec3};
use relume_core::scene::{Interpolation, Scene, SceneBuilder, Track};
use relume_core::session::{
    EventKind, FrameReport, Missed, Options, Session, Update, missed, radiosity_error,
};
use relume_io::{ImportOptions, import};

/// Small steps through the second that things move in, and beyond.
const STEP_S: f64 = 1.0 / 48.0;

fn session(scene: &Arc<Scene>, options: &Options, update: Update) -> Session {
    Session::new(Arc::clone(scene), Options { update, ..options.clone() }).unwrap()
}

fn oracles() -> [(&'static str, Options); 2] {
    [("error", at_tolerance(0.1)), ("form factor", form_factor_oracle(0.05, 1e-3))]
}

/// Follows frames 0 to `frames` with two strategies; what `look` makes of each frame after the first.
fn follow<T>(
    options: &Options,
    updates: [Update; 2],
    frames: u32,
    mut look: impl FnMut(u32, [(&FrameReport, &Session); 2]) -> T,
) -> Vec<T> {
    let scene = Arc::new(lit_room());
    let mut both = updates.map(|update| session(&scene, options, update));
    let mut out = Vec::new();
    for frame in 0..=frames {
        let reports = both.each_mut().map(|s| s.step(frame, f64::from(frame) * STEP_S).unwrap());
        if frame > 0 {
            let [one, two] = [0, 1].map(|k| (&reports[k], &both[k]));
            out.push(look(frame, [one, two]));
        }
    }
    out
}

#[test]
fn visibility_stays_for_as_long_as_is_certified() {
    for (name, options) in oracles() {
        let mut session = session(&Arc::new(lit_room()), &options, Update::Certificate);
        // Until when, and what was seen then.
        let mut claims: BTreeMap<(u64, u64), (f64, f32)> = BTreeMap::new();
        let (mut kept, mut without, mut longest_s) = (0, 0, 0.0_f64);
        for k in 0..48 {
            let now_s = f64::from(k) * STEP_S;
            session.step(k, now_s).unwrap();
            let frame = session.frame().unwrap();
            let (_, forest) = frame.pairs();
            let (links, horizon_s) = frame.certificates();
            for (link, left_s) in links {
                let key = |id| {
                    let key = forest.key(id);
                    u64::from(key.facet) << 32 | u64::from(key.path)
                };
                let (ends, seen) = ((key(link.a), key(link.b)), link.visibility());
                if let Some((until_s, v)) = claims.remove(&ends)
                    && now_s <= until_s
                {
                    assert_eq!(v, seen, "{name}, frame {k}: {ends:?} until {until_s}");
                    kept += 1;
                }
                match left_s {
                    Some(left_s) => {
                        assert!((0.0..=horizon_s * (1.0 + 1e-9)).contains(&left_s), "{left_s}");
                        longest_s = longest_s.max(left_s);
                        claims.insert(ends, (now_s + left_s - 1e-9, seen));
                    }
                    None => without += 1,
                }
            }
        }
        println!("{name}: {kept} kept, {without} without a claim, up to {longest_s} s");
        assert!(kept > 10_000 && without > 1_000 && longest_s > 8.0 * STEP_S);
    }
}

const SEVEN: Update = Update::Extrapolate { frames: 7, error: None };

#[test]
fn certificates_miss_nothing_and_spare_work() {
    for (name, options) in oracles() {
        let updates = [Update::Certificate, Update::Reinspect];
        let seen = follow(&options, updates, 47, |frame, [(one, a), (two, b)]| {
            assert_eq!(one.hash, two.hash, "{name}, frame {frame}");
            assert_eq!(
                missed(a.solved().unwrap(), b.solved().unwrap()),
                Missed::default(),
                "{name}, frame {frame}"
            );
            assert_eq!(
                (one.work.changed, one.work.segments),
                (two.work.changed, two.work.segments)
            );
            assert_eq!(two.work.followed + two.work.certified + two.work.extrapolated, 0);
            [
                one.work.examined,
                two.work.examined,
                one.work.followed,
                one.work.certified,
                one.work.changed,
            ]
        });
        let sum = |k: usize| seen.iter().map(|s| s[k]).sum::<u64>();
        println!(
            "{name}: judged {} with certificates, {} without; {} followed, {} passed over",
            sum(0),
            sum(1),
            sum(2),
            sum(3)
        );
        assert!(sum(0) * 10 < sum(1) * 9, "{name}");
        assert!(sum(2) > 0 && sum(3) > 0, "{name}");
    }
}

#[test]
fn extrapolation_of_one_frame_loses_nothing() {
    let options = form_factor_oracle(0.05, 1e-3);
    let one = Update::Extrapolate { frames: 1, error: None };
    follow(&options, [one, Update::Reinspect], 20, |frame, [(one, _), (two, _)]| {
        assert_eq!(one.work.extrapolated, 0);
        assert_eq!(one.hash, two.hash, "frame {frame}");
    });
}

#[test]
fn extrapolation_spares_work_and_says_what_it_loses() {
    for (name, options) in oracles() {
        let seen = follow(&options, [SEVEN, Update::Reinspect], 47, |_, [(one, a), (two, b)]| {
            let error = radiosity_error(a.solved().unwrap(), b.solved().unwrap());
            assert!(error.max >= error.rms);
            (one.work.examined, two.work.examined, one.work.extrapolated, error.rms)
        });
        let judged = seen.iter().map(|s| s.0).sum::<u64>();
        let reinspected = seen.iter().map(|s| s.1).sum::<u64>();
        let worst = seen.iter().map(|s| s.3).fold(0.0, f64::max);
        println!("{name}: judged {judged} of {reinspected}, RMS up to {:.2} %", 100.0 * worst);
        assert!(judged * 3 < reinspected * 2, "{name}");
        assert!(seen.iter().any(|s| s.2 > 0));
        assert!(worst > 0.0 && worst < 0.1, "{name}: {worst}");
    }
}

#[test]
fn a_smaller_error_asked_for_is_a_smaller_error() {
    let options = form_factor_oracle(0.05, 1e-3);
    let found = [0.1, 0.003].map(|error| {
        let update = Update::Extrapolate { frames: 64, error: Some(error) };
        let seen = follow(&options, [update, Update::Reinspect], 40, |_, [(one, a), (_, b)]| {
            (one.work.examined, radiosity_error(a.solved().unwrap(), b.solved().unwrap()).rms)
        });
        let judged = seen.iter().map(|s| s.0).sum::<u64>();
        (judged, seen.iter().map(|s| s.1).fold(0.0, f64::max))
    });
    println!("{found:?}");
    assert!(found[1].1 < found[0].1 && found[1].0 > found[0].0, "{found:?}");
}

/// The tracks of the room end at 1 s.
#[test]
fn once_all_is_at_rest_nothing_is_lost() {
    let options = form_factor_oracle(0.05, 1e-3);
    let last = follow(&options, [SEVEN, Update::Reinspect], 70, |_, [(one, a), (two, b)]| {
        (
            one.hash == two.hash,
            missed(a.solved().unwrap(), b.solved().unwrap()),
            one.work.extrapolated,
            one.work.examined,
        )
    });
    assert!(!last[30].0, "the test means nothing if nothing is extrapolated");
    let (same, missed, extrapolated, examined) = last[last.len() - 1];
    assert!(
        same && missed == Missed::default() && extrapolated + examined == 0,
        "{:?}",
        &last[45..]
    );
}

#[test]
fn a_jump_in_time_is_built_anew() {
    let scene = Arc::new(lit_room());
    let options = form_factor_oracle(0.05, 1e-3);
    let mut warm = session(&scene, &options, SEVEN);
    let mut cold = session(&scene, &options, Update::Scratch);
    for frame in 0..20 {
        warm.step(frame, f64::from(frame) * STEP_S).unwrap();
    }
    for time_s in [0.1, 0.1, 0.9, 0.05] {
        let (one, two) = (warm.step(0, time_s).unwrap(), cold.step(0, time_s).unwrap());
        assert_eq!(one.hash, two.hash, "at {time_s}");
        for k in 1..4 {
            warm.step(k, time_s + f64::from(k) * STEP_S).unwrap();
        }
    }
}

#[test]
fn events_are_those_that_are_counted() {
    for (name, options) in oracles() {
        let options = Options { events: true, ..options };
        let updates = [Update::Certificate, Update::Reinspect];
        let events = follow(&options, updates, 24, |frame, [(report, a), (_, b)]| {
            let (events, same) = (a.frame().unwrap().events(), b.frame().unwrap().events());
            assert_eq!(events, same, "{name}, frame {frame}");
            let count = |kinds: &[EventKind]| {
                events.iter().filter(|e| kinds.contains(&e.kind)).count() as u64
            };
            assert_eq!(
                count(&[EventKind::Promoted]),
                report.work.promoted,
                "{name}, frame {frame}"
            );
            assert_eq!(count(&[EventKind::Demoted]), report.work.demoted, "{name}, frame {frame}");
            let occluded = count(&[EventKind::Occluded, EventKind::Revealed]);
            assert_eq!(occluded, report.work.occlusion_changed, "{name}, frame {frame}");
            for event in &events {
                let linked = (event.before.is_some(), event.after.is_some());
                assert_eq!(
                    linked,
                    match event.kind {
                        EventKind::Promoted | EventKind::Woken => (false, true),
                        EventKind::Demoted | EventKind::Culled => (true, false),
                        EventKind::Occluded | EventKind::Revealed => (true, true),
                    }
                );
                if event.kind == EventKind::Occluded {
                    assert!(event.before.unwrap().1 > event.after.unwrap().1);
                }
            }
            events.len()
        });
        assert!(events.iter().sum::<usize>() > 100, "{name}: {events:?}");
    }
}

/// A box that slides over the floor it stands on: lines through exchange areas of a contact are far too steep, and
/// such links feed each other.
#[test]
fn extrapolated_light_does_not_grow_without_end() {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cornell_moving_box_and_lamp.glb");
    let scene = Arc::new(import(&path, &ImportOptions::default()).unwrap());
    let mean = |session: &Session| {
        let snapshot = session.frame().unwrap().solution();
        let (mut area, mut sum) = (0.0, 0.0);
        for leaf in &snapshot.leaves {
            let a = common::leaf_area(leaf);
            area += a;
            sum += a * f64::from(leaf.radiosity.iter().sum::<f32>());
        }
        sum / area
    };
    let options = form_factor_oracle(0.05, 1e-2);
    let mut exact = session(&scene, &options, Update::Certificate);
    let mut extrapolated = session(&scene, &options, SEVEN);
    for frame in 0..=60 {
        for session in [&mut exact, &mut extrapolated] {
            session.step(frame, f64::from(frame) / 24.0).unwrap();
        }
        let grown = mean(&extrapolated) / mean(&exact);
        assert!(grown < 1.4, "frame {frame}: {grown} times as bright");
    }
}

/// There and back in a second: the last pose is the first, so playing it again begins with a step back
/// in which nothing moves.
#[test]
fn a_loop_played_again_has_no_certificates_of_its_end() {
    let mut b = SceneBuilder::new("loop");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [10.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, DVec3::ONE);
    let at = [v(0.3, 0.3, 0.4), v(0.7, 0.5, 0.4), v(0.3, 0.3, 0.4)];
    let node = b.node("box", None, at[0], DQuat::IDENTITY);
    let interpolation = Interpolation::Linear;
    b.animate_translation(
        node,
        Track { times_s: vec![0.0, 0.5, 1.0], values: at.into(), interpolation },
    );
    b.cuboid(node, "box", grey, DVec3::splat(-0.1), DVec3::splat(0.1));
    let node = still(&mut b, "lamp");
    b.polygon(node, "lamp", lamp, &flipped(facing_up([0.4, 0.6], [0.4, 0.6], 0.95)));
    let scene = Arc::new(b.build().unwrap());
    for (name, options) in oracles() {
        let mut warm = session(&scene, &options, Update::Certificate);
        let mut cold = session(&scene, &options, Update::Scratch);
        for frame in 0..50 {
            let time_s = f64::from(frame % 17) / 16.0;
            let (one, two) = (warm.step(0, time_s).unwrap(), cold.step(0, time_s).unwrap());
            assert_eq!(one.hash, two.hash, "{name}, frame {frame}");
        }
    }
}

/// A body that leaves changes the extent of the scene while another, at rest by then, is still
/// extrapolated.
#[test]
fn a_scene_that_grows_forgets_no_extrapolated_link() {
    let options = form_factor_oracle(0.05, 1e-3);
    let mut judged = 0;
    for speed in [3.0, 5.0, 8.0] {
        let mut b = SceneBuilder::new("growing");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let lamp = b.material("lamp", [0.0; 3], [10.0; 3]);
        let room = still(&mut b, "room");
        b.cuboid_inward(room, "walls", grey, DVec3::ZERO, DVec3::ONE);
        let node = sliding(&mut b, "box", v(0.3, 0.3, 0.4), v(0.7, 0.5, 0.4));
        b.cuboid(node, "box", grey, DVec3::splat(-0.1), DVec3::splat(0.1));
        let from = v(2.0, 0.5, 0.5);
        let node = b.node("leaver", None, from, DQuat::IDENTITY);
        let (times_s, interpolation) = (vec![0.0, 1.4], Interpolation::Linear);
        let values = vec![from, from + DVec3::X * speed];
        b.animate_translation(node, Track { times_s, values, interpolation });
        b.cuboid(node, "leaver", grey, DVec3::splat(-0.1), DVec3::splat(0.1));
        let node = still(&mut b, "lamp");
        b.polygon(node, "lamp", lamp, &flipped(facing_up([0.4, 0.6], [0.4, 0.6], 0.95)));
        let scene = Arc::new(b.build().unwrap());
        let mut warm = session(&scene, &options, SEVEN);
        let mut last = String::new();
        for frame in 0..110 {
            let report = warm.step(frame, f64::from(frame) * STEP_S).unwrap();
            judged += report.work.extrapolated;
            last = report.hash;
        }
        let mut cold = session(&scene, &options, Update::Scratch);
        assert_eq!(last, cold.step(0, 109.0 * STEP_S).unwrap().hash, "{speed} m/s");
    }
    assert!(judged > 0);
}
