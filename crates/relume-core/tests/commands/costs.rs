//! Costs of edits, in pairs that are looked at: at most twice those of moving a small body.

use std::time::Instant;

use super::{Contents, check, cold, cube, furnished, hall, place};
use crate::common::{at_tolerance, v};
use relume_core::scene::{BodyId, MaterialId, NewBody, Scene};
use relume_core::session::{Command, Options, Session, compare};

/// Cost of a frame.
#[derive(Clone, Copy, Debug)]
struct Cost {
    /// Pairs looked at.
    pairs: u64,
    /// Processor seconds where the system says them, else wall-clock seconds.
    seconds: f64,
}

/// Processor seconds that this process has taken, to a hundredth: of all its tests, if several run. `None` but on Linux.
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields = stat.rsplit_once(')')?.1.split_whitespace();
    let ticks: Vec<f64> = fields.skip(11).take(2).map_while(|t| t.parse().ok()).collect();
    (ticks.len() == 2).then(|| ticks.iter().sum::<f64>() / 100.0)
}

/// Solves, and says what it cost.
#[allow(clippy::disallowed_methods)] // seconds are printed, and decide nothing
fn cost(session: &mut Session, what: &str) -> Cost {
    let (start, before) = (Instant::now(), processor_seconds());
    let report = session.solve().unwrap().report().clone();
    let taken = processor_seconds().zip(before).map(|(now, before)| now - before);
    let cost = Cost {
        pairs: report.work.examined + report.work.coarse_examined,
        seconds: taken.unwrap_or_else(|| start.elapsed().as_secs_f64()),
    };
    let s = report.seconds;
    println!(
        "{what}: {} pairs looked at, {:.2} s of processor time (wall: move {:.2}, predict {:.2}, pairs {:.2}, edit {:.2}, solve {:.2}), {} links",
        cost.pairs, cost.seconds, s.moving, s.predict, s.evaluate, s.edit, s.solve, report.links
    );
    cost
}

/// Costs of edits of a scene.
struct Costs {
    cold: Cost,
    /// Of moving the box that comes and goes.
    moved: Cost,
    edits: Vec<Cost>,
}

/// Costs of a small box that comes, moves and leaves.
fn costs_of_a_new_box(session: &mut Session) -> Costs {
    let cold = cost(session, "cold");
    let (corners, triangles) = cube(0.02, false);
    let new = NewBody::new("new").with_mesh("new", MaterialId(0), &corners, &triangles);
    let body = BodyId(session.scene().bodies.len() as u32);
    let out = session.apply(Command::Insert(new)).unwrap();
    place(session, body, Some(v(0.05, 0.0, 0.0)));
    let inserted = cost(session, "insert a box");
    place(session, body, Some(v(0.08, 0.02, -0.01)));
    let moved = cost(session, "move it");
    let back = session.apply(out).unwrap();
    let removed = cost(session, "remove it");
    session.apply(back).unwrap();
    let returned = cost(session, "put it back");
    Costs { cold, moved, edits: vec![inserted, removed, returned] }
}

/// Costs of a small box of the scene that is taken up, moved, taken out, put back, and put down where it was.
fn costs_of_a_box_of_the_scene(session: &mut Session) -> Costs {
    let body = BodyId(4);
    let cold = cost(session, "cold");
    place(session, body, Some(v(0.03, 0.02, -0.01)));
    let hold = cost(session, "take hold of one");
    place(session, body, Some(v(0.06, 0.02, -0.01)));
    let moved = cost(session, "move it");
    let back = session.apply(Command::Remove(body)).unwrap();
    let removed = cost(session, "remove it");
    session.apply(back).unwrap();
    let returned = cost(session, "put it back");
    place(session, body, None);
    let release = cost(session, "let it go");
    Costs { cold, moved, edits: vec![hold, removed, returned, release] }
}

/// Asserts that no edit of a scene costs more than twice the pairs that moving its small body does; returns by how much more
/// time the dearest one takes.
fn edits_cost_as_moves(Costs { cold, moved, edits }: &Costs) -> f64 {
    assert!(4 * moved.pairs < cold.pairs, "{} of {} pairs", moved.pairs, cold.pairs);
    let is_cheap = |edit: &Cost| edit.pairs <= 2 * moved.pairs;
    assert!(edits.iter().all(is_cheap), "{edits:?}, and {moved:?} for a move");
    edits.iter().map(|edit| edit.seconds / moved.seconds).fold(0.0, f64::max)
}

#[test]
#[ignore = "minutes: two million links"]
fn edits_in_a_scene_of_two_million_links_cost_as_moves() {
    let session = |what: Contents, tolerance: f64, groups: bool| {
        let options = Options { groups, ..at_tolerance(tolerance) };
        Session::new(hall(60, what), options).unwrap()
    };
    for costs in [
        costs_of_a_new_box(&mut session(Contents::Boxes, 0.001, false)),
        costs_of_a_box_of_the_scene(&mut session(Contents::Boxes, 0.001, false)),
        costs_of_a_new_box(&mut session(Contents::Boxes, 0.001, true)),
        costs_of_a_box_of_the_scene(&mut session(Contents::Boxes, 0.001, true)),
        costs_of_a_new_box(&mut session(Contents::BallsToo, 0.02, true)),
    ] {
        let times = edits_cost_as_moves(&costs);
        println!("{times:.2} times the seconds of a move");
        assert!(times < 2.0);
    }
}

#[test]
fn a_body_that_comes_or_goes_costs_as_one_that_moves() {
    let session = || Session::new(hall(8, Contents::Boxes), at_tolerance(0.1)).unwrap();
    edits_cost_as_moves(&costs_of_a_new_box(&mut session()));
    edits_cost_as_moves(&costs_of_a_box_of_the_scene(&mut session()));
}

/// Costs of taking bodies of a furnished room up, beside those of moving them on.
fn costs_of_taking_up(scene: Scene, tolerance: f64, verify: bool) {
    let mut session = Session::new(scene, at_tolerance(tolerance)).unwrap();
    let all = cost(&mut session, "cold").pairs;
    let hash = session.frame().unwrap().hash();
    assert!(session.frame().unwrap().report().link_kinds.is_some(), "there are groups");
    for name in ["cup 0 1 0", "chair 1 0 2", "table 1 1"] {
        let body = session.scene().body_named(name).unwrap();
        let verified = |session: &mut Session, what: &str| {
            let cost = cost(session, &format!("{name}: {what}"));
            if verify {
                check(session, &format!("{name}: {what}"));
                let mut anew = cold(session);
                anew.solve().unwrap();
                assert_eq!(compare(session.solved().unwrap(), anew.solved().unwrap()), None);
            }
            cost
        };
        place(&mut session, body, Some(v(0.02, 0.01, 0.05)));
        let hold = verified(&mut session, "take hold");
        place(&mut session, body, Some(v(0.04, 0.02, 0.05)));
        let moved = verified(&mut session, "move");
        place(&mut session, body, None);
        let release = verified(&mut session, "let go");
        assert_eq!(session.frame().unwrap().hash(), hash, "{name}");
        for edit in [hold, release] {
            assert!(edit.pairs <= 2 * moved.pairs, "{name}: {edit:?}, and {moved:?} for a move");
            assert!(3 * edit.pairs < all, "{name}: {edit:?} of {all} pairs");
        }
    }
}

#[test]
fn a_body_that_rests_among_others_is_taken_up_at_the_cost_of_a_move() {
    costs_of_taking_up(furnished(2), 0.2, true);
}

#[test]
#[ignore = "a minute: nine thousand triangles"]
fn taking_up_in_a_room_of_nine_thousand_triangles() {
    costs_of_taking_up(furnished(4), 0.1, false);
}
