//! A step that comes to nothing, or a command, leaves the last solution to be read, and a session that goes on.

use std::sync::Arc;

use glam::DVec3;
use relume_core::flat::{FlatOptions, FlatSession};
use relume_core::geometry::Pose;
use relume_core::scene::{BodyId, MaterialId, NewBody, Scene};
use relume_core::session::{Command, Frame, Hash, Options, Session, SessionError, Update, compare};
use relume_io::flat::parse;

use crate::commands::{check, clutter, cold, draw, insertion, kinds, room, start};
use crate::common::{Random, at_tolerance, audit, lit_room, shipped, v};

/// What is said and read of a solution.
fn seen(frame: Frame<'_>) -> (Hash, u64, [f64; 3]) {
    let at = frame.irradiance_at(v(0.3, -0.9, 0.2), DVec3::Y);
    (frame.hash(), frame.report().elements, at)
}

/// Asserts that a session has the solution that was seen.
fn keeps(session: &Session, was: (Hash, u64, [f64; 3]), why: &str) {
    let is = seen(session.frame().unwrap_or_else(|| panic!("{why}: nothing is left")));
    assert_eq!((is.0, is.1), (was.0, was.1), "{why}");
    let allowed = session.options().tolerance * (was.2.iter().sum::<f64>() / 3.0 + 1e-3);
    for (x, y) in is.2.into_iter().zip(was.2) {
        assert!((x - y).abs() <= allowed, "{why}: {x} {y}");
    }
}

/// Random steps with random limits on memory, so that steps come to nothing at any point; how many of those there were.
fn run_out_of_memory(scene: &Scene, seed: u64, update: Update, edits: f64) -> usize {
    let mut r = Random(seed);
    let options = Options { update, ..kinds()[(seed % 2) as usize].clone() };
    let mut session = Session::new(scene.clone(), options).unwrap();
    if scene.name == "room" {
        start(&mut session);
    }
    session.solve().unwrap();
    let mut other = cold(&session);
    other.solve().unwrap();
    let (mut failures, mut edited) = (0, false);
    for step in 0..8 {
        let why = format!("{} {seed}, step {step}", scene.name);
        let was = seen(session.frame().unwrap());
        let is_edit = r.unit() < edits;
        edited |= is_edit;
        let command = if is_edit { insertion(&mut r) } else { draw(&mut r, session.scene()) };
        session.apply(command).unwrap();
        keeps(&session, was, &why);
        let memory = session.memory();
        let held = (memory.pairs + memory.elements) as f64;
        session.set_max_memory_bytes(Some((held * r.between(0.4, 1.2)) as u64));
        let error = session.solve().map(drop).err();
        session.set_max_memory_bytes(None);
        match error {
            None => {}
            Some(SessionError::OutOfMemory { .. }) => {
                failures += 1;
                keeps(&session, was, &why);
                if !edited {
                    let [is, was] = [&session, &other].map(|s| s.solved().unwrap());
                    assert_eq!(compare(is, was), None, "{why}");
                }
                if r.unit() < 0.5 {
                    continue;
                }
            }
            Some(error) => panic!("{why}: {error}"),
        }
        check(&mut session, &why);
        audit::audit(&session).check(0.4);
        (other, edited) = (cold(&session), false);
        other.solve().unwrap();
    }
    check(&mut session, &format!("{} {seed}, in the end", scene.name));
    failures
}

#[test]
fn steps_without_memory_go_back_to_the_last_solution() {
    let mut failures = 0;
    for seed in 0..6 {
        failures += run_out_of_memory(&room(), seed, Update::Certificate, 0.0);
    }
    // Of 12 and 13 coarse links that a failed step had woken stayed.
    for seed in [0, 1, 12, 13] {
        let scene = shipped("cornell_moving_box_and_lamp.glb");
        failures += run_out_of_memory(&scene, seed, Update::Reinspect, 0.0);
    }
    assert!(failures > 20, "{failures}");
}

#[test]
fn so_do_those_in_edited_scenes() {
    let mut failures = 0;
    for seed in 10..14 {
        failures += run_out_of_memory(&room(), seed, Update::Certificate, 0.6);
    }
    for seed in [20, 22] {
        failures += run_out_of_memory(&clutter(), seed, Update::Certificate, 0.3);
    }
    assert!(failures > 10, "{failures}");
}

#[test]
fn those_that_start_from_nothing_go_back_too() {
    let failures: usize =
        (30..33).map(|seed| run_out_of_memory(&room(), seed, Update::Scratch, 0.3)).sum();
    assert!(failures > 5, "{failures}");
}

#[test]
fn one_that_is_called_off_goes_back() {
    let mut session = Session::new(room(), at_tolerance(0.1)).unwrap();
    start(&mut session);
    let was = seen(session.solve().unwrap());
    let commands = [
        Command::set_pose(BodyId(1), Pose::translation(v(0.2, 0.1, 0.5))),
        insertion(&mut Random(3)),
        Command::Remove(BodyId(2)),
        Command::Remove(BodyId(4)),
        Command::SetExitance(MaterialId(0), Some([1.0; 3])),
    ];
    let mut inverses = Vec::new();
    for (k, command) in commands.into_iter().enumerate() {
        inverses.push(session.apply(command).unwrap());
        session.watch().cancel();
        assert!(matches!(session.solve(), Err(SessionError::Cancelled { .. })), "{k}");
        keeps(&session, was, &format!("called off {k}"));
    }
    while let Some(inverse) = inverses.pop() {
        session.apply(inverse).unwrap();
    }
    assert_eq!(session.solve().unwrap().hash(), was.0);
    check(&mut session, "after all");
}

#[test]
fn extrapolated_links_are_evaluated_on_the_way_back() {
    let update = Update::Extrapolate { frames: 7, error: None };
    let scene = Arc::new(shipped("cornell_moving_box_and_lamp.glb"));
    let options = Options { update, ..at_tolerance(0.3) };
    let mut session = Session::new(Arc::clone(&scene), options.clone()).unwrap();
    for frame in 0..6 {
        session.solve_at(f64::from(frame) / 24.0).unwrap();
    }
    assert!(session.frame().unwrap().report().work.extrapolated > 0);
    let mut cold = Session::new(scene, options).unwrap();
    let hash = cold.solve_at(5.0 / 24.0).unwrap().hash();
    assert_ne!(session.frame().unwrap().hash(), hash, "extrapolated links are others");
    session.watch().cancel();
    assert!(session.solve_at(6.0 / 24.0).is_err());
    assert_eq!(session.frame().unwrap().hash(), hash);
    for frame in 6..9 {
        session.solve_at(f64::from(frame) / 24.0).unwrap();
    }
}

#[test]
fn commands_leave_the_last_solution() {
    let mut session = Session::new(room(), at_tolerance(0.3)).unwrap();
    start(&mut session);
    assert!(session.frame().is_none() && session.solved().is_none());
    let was = seen(session.solve().unwrap());
    let mesh = session.frame().unwrap().snapshot();
    let mut r = Random(5);
    let commands = [
        insertion(&mut r),
        Command::Remove(BodyId(4)),
        Command::Remove(BodyId(3)),
        insertion(&mut r),
    ];
    for command in commands {
        session.apply(command).unwrap();
        assert_eq!(seen(session.frame().unwrap()), was);
        assert_eq!(session.frame().unwrap().snapshot(), mesh);
    }
    let bad = NewBody::new("bad").with_mesh("bad", MaterialId(99), &[[0.0; 3]; 3], &[[0, 1, 2]]);
    assert!(session.apply(Command::Insert(bad)).is_err());
    assert!(session.apply(Command::hide(BodyId(77))).is_err());
    assert_eq!(seen(session.frame().unwrap()), was);
    check(&mut session, "after commands");
}

#[test]
fn in_the_plane_a_step_without_memory_goes_back_too() {
    let text = "body gutter\nsegment floor 0 0 1 0 reflectance 0.5 emit 1\nsegment wall 0 1 0 0\n\
        body patch\nat 0 0.9 0.9\nat 4 0.2 0.2\nsegment patch 0.15 -0.15 -0.15 0.15\n";
    let scene = Arc::new(parse(text).unwrap());
    let mut session = FlatSession::new(scene, FlatOptions::default()).unwrap();
    assert!(session.frame().is_none());
    assert!(session.step_within(0, 0.0, Some(1_000)).is_err());
    assert!(session.frame().is_none());
    session.step(0, 0.0);
    let links = session.frame().unwrap().links();
    assert!(session.step_within(1, 1.5, Some(1_000)).is_err());
    let frame = session.frame().unwrap();
    assert_eq!((frame.report().frame, frame.links()), (0, links));
    let hash = session.step(1, 1.5).hash;
    session.step(2, 3.0);
    assert_eq!(session.step(3, 1.5).hash, hash);
}

#[test]
fn nothing_panics_before_the_first_solve() {
    let session = Session::new(lit_room(), at_tolerance(0.3)).unwrap();
    assert!(session.frame().is_none() && session.solved().is_none());
    let memory = session.memory();
    assert!(memory.pairs == 0 && memory.fixed > 0);
}
