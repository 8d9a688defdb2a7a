//! Options out of range and too little memory: a clear message, and a session that goes on.

use std::sync::Arc;

use crate::common;
use crate::common::{at_tolerance, form_factor_oracle, lit_room, v};
use glam::{DQuat, DVec3};
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{Options, Session, SessionError};

fn refusal(options: Options) -> String {
    let result = Session::new(Arc::new(lit_room()), options);
    match result.err().expect("out of range") {
        SessionError::Option(text) => text,
        other => panic!("{other}"),
    }
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    for tolerance in [0.0, -0.02, 1.0, 7.0, f64::NAN, f64::INFINITY] {
        let text = refusal(at_tolerance(tolerance));
        assert!(text.contains("tolerance") && text.contains(&tolerance.to_string()), "{text}");
    }
    for (epsilon, area) in [(0.0, 1e-3), (1.0, 1e-3), (0.1, -1.0), (f64::NAN, 0.0), (0.1, f64::NAN)]
    {
        let text = refusal(form_factor_oracle(epsilon, area));
        assert!(text.contains("form"), "{text}");
    }
}

#[test]
fn too_little_memory_is_an_error_that_names_the_remedy() {
    for (oracle, options) in
        [("error", at_tolerance(0.02)), ("form", form_factor_oracle(0.01, 1e-5))]
    {
        let options = Options { max_memory_bytes: Some(300_000), ..options };
        let mut session = Session::new(Arc::new(lit_room()), options).unwrap();
        for _ in 0..2 {
            let error = session.step(5, 0.5).unwrap_err();
            let text = error.to_string();
            assert!(
                matches!(error, SessionError::OutOfMemory { frame: 5, .. }),
                "{oracle}: {text}"
            );
            for word in ["frame 5", "300000", "Options::max_memory_bytes", "tolerance"] {
                assert!(text.contains(word), "{oracle}: `{word}` is not in `{text}`");
            }
        }
    }
}

#[test]
fn enough_memory_changes_nothing() {
    let scene = Arc::new(lit_room());
    let free = Session::new(Arc::clone(&scene), at_tolerance(0.3)).unwrap().step(0, 0.0).unwrap();
    let options = Options { max_memory_bytes: Some(1 << 32), ..at_tolerance(0.3) };
    let bound = Session::new(scene, options).unwrap().step(0, 0.0).unwrap();
    assert_eq!(free.hash, bound.hash);
}

/// A floor under a lamp; from 1 s on a crowd of boxes between them.
fn crowded_later() -> Arc<Scene> {
    let mut b = SceneBuilder::new("crowd");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.5; 3], [3.0; 3]);
    let node = common::still(&mut b, "room");
    b.cuboid_inward(node, "walls", grey, DVec3::ZERO, DVec3::ONE);
    b.polygon(node, "lamp", lamp, &common::flipped(common::facing_up([0.4, 0.6], [0.4, 0.6], 0.9)));
    let node = b.node("crowd", None, DVec3::ZERO, DQuat::IDENTITY);
    for k in 0..27 {
        let at = v(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) * 0.25 + 0.15;
        b.cuboid(node, &format!("box {k}"), grey, at, at + 0.1);
    }
    b.animate_presence(node, vec![(0.0, false), (1.0, true)]);
    Arc::new(b.build().unwrap())
}

/// What the crowd needs, and twice what the room needs without it: the limit.
fn tight(scene: &Arc<Scene>) -> Options {
    let held = |time_s: f64| {
        let mut s = Session::new(Arc::clone(scene), at_tolerance(0.2)).unwrap();
        s.step(0, time_s).unwrap();
        s.memory_bytes()
    };
    let (few, many) = (held(0.0), held(1.0));
    assert!(2 * many > 5 * few, "{few} {many}");
    Options { max_memory_bytes: Some(2 * few), ..at_tolerance(0.2) }
}

#[test]
fn a_session_that_ran_out_of_memory_goes_on() {
    let scene = crowded_later();
    let mut session = Session::new(Arc::clone(&scene), tight(&scene)).unwrap();
    let first = session.step(0, 0.0).unwrap();
    let error = session.step(1, 1.0).unwrap_err();
    assert!(matches!(error, SessionError::OutOfMemory { .. }), "{error}");
    let again = session.step(2, 0.0).unwrap();
    assert_eq!(again.hash, first.hash);
    common::audit::audit(&session).check(0.1);
}
