//! Commands: any log and its inverses lead back, and the state after any log is that of a cold build.

use std::sync::Arc;

use crate::common::{Random, at_tolerance, form_factor_oracle, shipped, v};
use glam::{DQuat, DVec3};
use relume_core::geometry::Pose;
use relume_core::scene::{
    BodyId, LightId, LightKind, MaterialId, NewBody, Scene, SceneBuilder, World,
};
use relume_core::session::{Command, CommandError, Frame, Options, Session, compare};
use relume_io::Log;

mod costs;

/// A cube about the origin, seen from outside or from inside.
pub(crate) fn cube(half: f64, inward: bool) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { half } else { -half });
    let sides: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let turned = |[a, b, c]: [u32; 3]| if inward { [a, c, b] } else { [a, b, c] };
    let of_side = |[a, b, c, d]: [u32; 4]| [turned([a, b, c]), turned([a, c, d])];
    ((0..8).map(corner).collect(), sides.into_iter().flat_map(of_side).collect())
}

/// A room with a lamp, two crates and a bulb, all of them still.
pub(crate) fn room() -> Scene {
    let mut b = SceneBuilder::new("room");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let red = b.material("red", [0.7, 0.2, 0.1], [0.0; 3]);
    let glow = b.material("glow", [0.1; 3], [9.0, 8.0, 7.0]);
    let (walls, lamp) = (b.body("walls"), b.body("lamp"));
    let (one, two) = (b.body("one"), b.body("two"));
    let (corners, triangles) = cube(1.0, true);
    b.mesh(walls, "walls", grey, &corners, &triangles);
    let (corners, triangles) = cube(0.1, false);
    b.mesh(lamp, "lamp", glow, &corners, &triangles);
    b.mesh(one, "one", red, &corners, &triangles);
    b.mesh(two, "two", grey, &corners, &triangles);
    let hook = b.node("hook", None, v(-0.5, -0.5, 0.5), DQuat::IDENTITY);
    b.light("bulb", hook, LightKind::Point, [0.3; 3]);
    b.build().unwrap()
}

/// A room full of small crates: enough for groups of patches.
pub(crate) fn clutter() -> Scene {
    let mut b = SceneBuilder::new("clutter");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let red = b.material("red", [0.7, 0.2, 0.1], [0.0; 3]);
    let glow = b.material("glow", [0.1; 3], [9.0, 8.0, 7.0]);
    let walls = b.body("walls");
    let (corners, triangles) = cube(1.0, true);
    b.mesh(walls, "walls", grey, &corners, &triangles);
    let (corners, triangles) = cube(0.045, false);
    for k in 0..24 {
        let at = [k % 3, k / 3 % 3, k / 9].map(|n| 0.5 * f64::from(n) - 0.5);
        let corners: Vec<[f64; 3]> =
            corners.iter().map(|c| [0, 1, 2].map(|axis| c[axis] + at[axis])).collect();
        let body = b.body(&format!("crate {k}"));
        let material = if k == 13 { glow } else { red };
        b.mesh(body, "crate", material, &corners, &triangles);
    }
    b.build().unwrap()
}

/// A room with a row of small crates close to each other: groups of several of them.
fn row_of_crates() -> Scene {
    let mut b = SceneBuilder::new("row");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let red = b.material("red", [0.7, 0.2, 0.1], [0.0; 3]);
    let glow = b.material("glow", [0.1; 3], [9.0, 8.0, 7.0]);
    let (walls, lamp) = (b.body("walls"), b.body("lamp"));
    let (corners, triangles) = cube(1.0, true);
    b.mesh(walls, "walls", grey, &corners, &triangles);
    let at = |x: f64, half: f64| {
        let place = move |c: &[f64; 3]| [c[0] * half + x, c[1] * half, c[2] * half];
        cube(1.0, false).0.iter().map(place).collect::<Vec<_>>()
    };
    b.mesh(lamp, "lamp", glow, &at(0.8, 0.1), &cube(1.0, false).1);
    for k in 0..24 {
        let body = b.body(&format!("crate {k}"));
        let corners = at(0.034 * f64::from(k) - 0.6, 0.015);
        b.mesh(body, "crate", red, &corners, &cube(1.0, false).1);
    }
    b.build().unwrap()
}

/// A room with so many by so many tables, each with four chairs about it and cups on it: chairs of 72 patches, tables of large
/// patches and small ones, cups of 12 small ones.
fn furnished(rows: u32) -> Scene {
    let mut b = SceneBuilder::new("furnished");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let red = b.material("red", [0.7, 0.2, 0.1], [0.0; 3]);
    let glow = b.material("glow", [0.1; 3], [9.0, 8.0, 7.0]);
    let side = 2.0 * f64::from(rows) + 1.0;
    let boxed = |b: &mut SceneBuilder, body: BodyId, at: DVec3, half: DVec3, material| {
        let (corners, triangles) = cube(1.0, false);
        let placed = corners.iter().map(|&c| (DVec3::from_array(c) * half + at).to_array());
        b.mesh(body, "part", material, &placed.collect::<Vec<_>>(), &triangles);
    };
    let walls = b.body("walls");
    let (corners, triangles) = cube(1.0, true);
    let half = v(0.5 * side, 0.5 * side, 1.5);
    let placed = corners.iter().map(|&c| (DVec3::from_array(c) * half + half).to_array());
    b.mesh(walls, "walls", grey, &placed.collect::<Vec<_>>(), &triangles);
    boxed(&mut b, walls, v(0.5 * side, 0.5 * side, 2.9), v(0.4, 0.4, 0.02), glow);
    let mut r = Random(3);
    for (i, k) in (0..rows).flat_map(|i| (0..rows).map(move |k| (i, k))) {
        let middle = v(1.5 + 2.0 * f64::from(i), 1.5 + 2.0 * f64::from(k), 0.0);
        let table = b.body(&format!("table {i} {k}"));
        boxed(&mut b, table, middle + v(0.0, 0.0, 0.72), v(0.5, 0.4, 0.02), grey);
        for (x, y) in [(-0.45, -0.35), (0.45, -0.35), (0.45, 0.35), (-0.45, 0.35)] {
            boxed(&mut b, table, middle + v(x, y, 0.35), v(0.02, 0.02, 0.349), grey);
        }
        for (n, (x, y)) in (0..).zip([(-0.7, 0.0), (0.7, 0.0), (0.0, -0.6), (0.0, 0.6)]) {
            let chair = b.body(&format!("chair {i} {k} {n}"));
            let at = middle + v(x, y, 0.0);
            boxed(&mut b, chair, at + v(0.0, 0.0, 0.42), v(0.18, 0.18, 0.02), red);
            boxed(&mut b, chair, at + v(0.16, 0.0, 0.65), v(0.01, 0.16, 0.15), red);
            for (x, y) in [(-0.15, -0.15), (0.15, -0.15), (0.15, 0.15), (-0.15, 0.15)] {
                boxed(&mut b, chair, at + v(x, y, 0.2), v(0.015, 0.015, 0.199), red);
            }
        }
        for n in 0..4 * rows {
            let cup = b.body(&format!("cup {i} {k} {n}"));
            let at = v(0.4 * (2.0 * r.unit() - 1.0), 0.3 * (2.0 * r.unit() - 1.0), 0.79);
            boxed(&mut b, cup, middle + at, DVec3::splat(0.03), if n == 1 { glow } else { red });
        }
    }
    b.build().unwrap()
}

/// The first poses: nothing inside anything else.
pub(crate) fn start(session: &mut Session) {
    for (body, at) in [(1, v(0.0, 0.0, 0.8)), (2, v(-0.4, 0.3, -0.6)), (3, v(0.5, -0.3, 0.0))] {
        session.apply(Command::set_pose(BodyId(body), Pose::translation(at))).unwrap();
    }
}

/// A session that is given the world of another one at once.
pub(crate) fn cold(session: &Session) -> Session {
    let mut cold = Session::new(Arc::clone(session.scene()), session.options().clone()).unwrap();
    let held = session.held();
    let mut apply = |command| drop(cold.apply(command).unwrap());
    held.poses.iter().for_each(|(&b, &p)| apply(Command::SetPose(b, Some(p))));
    held.presence.iter().for_each(|(&b, &p)| apply(Command::SetPresence(b, Some(p))));
    held.reflectances.iter().for_each(|(&m, &r)| apply(Command::SetReflectance(m, Some(r))));
    held.exitances.iter().for_each(|(&m, &e)| apply(Command::SetExitance(m, Some(e))));
    held.intensities.iter().for_each(|(&l, &i)| apply(Command::SetIntensity(l, Some(i))));
    apply(Command::SetTime(session.time_s()));
    cold
}

/// Asserts that a session is where one is that starts from its world.
pub(crate) fn check(session: &mut Session, why: &str) {
    let mut other = cold(session);
    assert_eq!(session.world(), other.world(), "{why}");
    let (rho, options) = (0.95, session.options().clone());
    let (warm, cold) = (session.solve().unwrap(), other.solve().unwrap());
    let (one, two) = (warm.report(), cold.report());
    assert_eq!((warm.hash(), one.links), (cold.hash(), two.links), "{why}");
    assert_eq!(
        (one.elements, one.leaves, one.pairs.refined, one.pairs.culled),
        (two.elements, two.leaves, two.pairs.refined, two.pairs.culled),
        "{why}"
    );
    let (a, b) = (warm.snapshot(), cold.snapshot());
    assert_eq!(a.corners, b.corners, "{why}");
    let mean = b.radiosity.iter().flatten().sum::<f32>() / (3 * b.radiosity.len()) as f32;
    let bound = (options.tolerance / (1.0 - rho)) as f32 * mean.max(1e-3);
    for (x, y) in a.radiosity.iter().flatten().zip(b.radiosity.iter().flatten()) {
        assert!((x - y).abs() <= bound, "{why}: {x} {y}, mean {mean}");
    }
    let found = compare(session.solved().unwrap(), other.solved().unwrap());
    assert_eq!(found.map(|found| found.in_words("followed", "from scratch")), None, "{why}");
}

/// A command drawn at random, of any kind that does not change the scene.
pub(crate) fn draw(r: &mut Random, scene: &Scene) -> Command {
    let one_of = |r: &mut Random, n: usize| (r.unit() * n as f64) as u32 % n as u32;
    let body = BodyId(1 + one_of(r, scene.bodies.len() - 1));
    let material = MaterialId(one_of(r, scene.materials.len()));
    match one_of(r, 12) {
        0..5 => {
            let at = DVec3::from_array([0; 3].map(|_| r.between(-0.85, 0.85)));
            let axis = v(r.unit(), r.unit(), 1.0).normalize();
            let turn = if r.unit() < 0.5 { 0.0 } else { r.between(0.0, 3.0) };
            Command::set_pose(body, Pose::new(DQuat::from_axis_angle(axis, turn), at))
        }
        5 => Command::SetPose(body, None),
        6 => Command::hide(body),
        7 => Command::SetPresence(body, [None, Some(true)][one_of(r, 2) as usize]),
        8 => {
            let to = if r.unit() < 0.3 { None } else { Some([r.unit() * 0.9; 3]) };
            Command::SetReflectance(material, to)
        }
        9 => {
            let to = [None, Some([0.0; 3]), Some([r.unit(), 2.0, 3.0])][one_of(r, 3) as usize];
            Command::SetExitance(material, to)
        }
        10 if !scene.lights.is_empty() => {
            let to = [None, Some([0.0; 3]), Some([r.unit(); 3])][one_of(r, 3) as usize];
            Command::SetIntensity(LightId(0), to)
        }
        _ => Command::SetTime(r.between(0.0, 1.5)),
    }
}

pub(crate) fn insertion(r: &mut Random) -> Command {
    let (corners, triangles) = cube(0.02 + 0.1 * r.unit(), false);
    let shift = [0; 3].map(|_| r.between(-0.8, 0.8));
    let corners: Vec<[f64; 3]> =
        corners.iter().map(|c| [0, 1, 2].map(|k| c[k] + shift[k])).collect();
    let material = MaterialId((3.0 * r.unit()) as u32 % 3);
    Command::Insert(NewBody::new("new").with_mesh("new", material, &corners, &triangles))
}

pub(crate) fn kinds() -> [Options; 2] {
    [at_tolerance(0.4), form_factor_oracle(0.2, 0.02)]
}

/// Follows logs: each state against a cold build, and the way back.
fn follow(scene: &Scene, seeds: std::ops::Range<u64>, steps: usize, insert: f64) {
    for seed in seeds {
        let mut r = Random(seed);
        let options = kinds()[(seed % 2) as usize].clone();
        let mut session = Session::new(scene.clone(), options).unwrap();
        if scene.name == "room" {
            start(&mut session);
        }
        let first = session.solve().unwrap().hash();
        let mut inverses = Vec::new();
        for step in 0..steps {
            for _ in 0..=(2.0 * r.unit()) as usize {
                let command = match r.unit() < insert {
                    true if r.unit() < 0.5 => insertion(&mut r),
                    true => Command::Remove(BodyId(1 + (r.unit() * 6.0) as u32)),
                    false => draw(&mut r, session.scene()),
                };
                match session.apply(command) {
                    Ok(inverse) => inverses.push(inverse),
                    Err(CommandError::Unknown { .. } | CommandError::Removed { .. }) => {}
                    Err(error) => panic!("{seed}: {error}"),
                }
            }
            check(&mut session, &format!("{} {seed}, step {step}", scene.name));
        }
        while let Some(inverse) = inverses.pop() {
            session.apply(inverse).unwrap();
            if r.unit() < 0.2 {
                session.solve().unwrap();
            }
        }
        assert_eq!(session.solve().unwrap().hash(), first, "{} {seed}: back", scene.name);
    }
}

#[test]
fn any_log_equals_a_cold_build_and_leads_back() {
    follow(&room(), 0..6, 6, 0.0);
}

#[test]
fn bodies_leave_groups_of_patches_and_come_back() {
    follow(&clutter(), 400..403, 5, 0.1);
    follow(&furnished(2), 404..406, 5, 0.1);
}

#[test]
fn bodies_come_and_go() {
    follow(&room(), 100..104, 6, 0.4);
}

#[test]
fn a_lamp_behind_one_end_of_a_pair_lights_the_other_unevenly_however_it_was_found() {
    follow(&room(), 1_370..1_371, 4, 0.15);
    follow(&room(), 1_612..1_613, 8, 0.15);
}

#[test]
fn light_that_grows_changes_which_side_of_a_steep_pair_is_refined() {
    // A lamp that sticks in a wall; a crate comes into its light.
    follow(&room(), 1_122..1_123, 8, 0.15);
}

#[test]
fn hands_take_hold_of_a_clip_that_plays() {
    for name in ["box_room.glb", "cornell_moving_box_and_lamp.glb"] {
        follow(&shipped(name), 200..202, 5, 0.1);
    }
}

#[test]
fn a_promise_that_is_broken_while_time_goes_on_is_forgotten() {
    let scene = shipped("cornell_moving_box_and_lamp.glb");
    let mover = (0..scene.bodies.len() as u32).map(BodyId).find(|&b| scene.moves(b)).unwrap();
    let mut session = Session::new(scene, at_tolerance(0.3)).unwrap();
    let mut held = None;
    for frame in 0..12 {
        let time_s = f64::from(frame) / 24.0;
        if frame == 5 || frame == 8 {
            let aside = Pose { translation: v(0.3, 0.1, 0.2), ..Pose::IDENTITY };
            let command = if frame == 5 { Some(aside) } else { held.take() };
            session.apply(Command::SetPose(mover, command)).unwrap();
        }
        session.apply(Command::SetTime(time_s)).unwrap();
        check(&mut session, &format!("frame {frame}"));
    }
}

/// Frames of a clip that follow each other leave certificates, which foresee no body that comes or goes.
#[test]
fn bodies_come_and_go_while_a_clip_plays_on() {
    let scene = Arc::new(shipped("cornell_moving_box_and_lamp.glb"));
    let middle = scene.bounds(0.0).unwrap().centre();
    let (corners, triangles) = cube(0.1, false);
    // Where it comes to be, so that no hand holds it: that would void certificates too.
    let corners: Vec<_> = corners.iter().map(|c| (DVec3::from(*c) + middle).to_array()).collect();
    let new = NewBody::new("new").with_mesh("new", MaterialId(0), &corners, &triangles);
    let edits = (1..scene.bodies.len() as u32).map(|k| Command::Remove(BodyId(k)));
    for (k, edit) in edits.chain([Command::Insert(new)]).enumerate() {
        let mut session = Session::new(Arc::clone(&scene), at_tolerance(0.3)).unwrap();
        let mut next = Some(edit);
        for frame in 0..9 {
            if frame == 4 || frame == 6 {
                next = next.map(|command| session.apply(command).unwrap());
            }
            session.apply(Command::SetTime(f64::from(frame) / 24.0)).unwrap();
            match frame < 4 {
                true => drop(session.solve().unwrap()),
                false => check(&mut session, &format!("edit {k}, frame {frame}")),
            }
        }
    }
}

#[test]
fn a_light_moves_with_the_body_it_hangs_on() {
    let mut b = SceneBuilder::new("lantern");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let lantern = b.node("lantern", None, v(0.0, 0.0, 0.5), DQuat::IDENTITY);
    let bulb = b.node("bulb", Some(lantern), v(0.0, 0.0, 0.1), DQuat::IDENTITY);
    b.cuboid(lantern, "base", grey, v(-0.1, -0.1, -0.1), v(0.1, 0.1, 0.0));
    b.light("bulb", bulb, LightKind::Point, [1.0; 3]);
    let scene = b.build().unwrap();
    let body = scene.body_named("lantern").unwrap();
    let mut session = Session::new(scene, at_tolerance(0.4)).unwrap();
    session.solve().unwrap();
    let by = Pose::translation([0.2, 0.0, 0.0]);
    let undo = session.apply(Command::set_pose(body, by)).unwrap();
    let at = session.world().light_pose(LightId(0)).unwrap().translation;
    assert!(at.distance(v(0.2, 0.0, 0.6)) < 1e-12, "{at}");
    check(&mut session, "moved");
    session.apply(Command::hide(body)).unwrap();
    assert_eq!(session.world().light_pose(LightId(0)), None);
    check(&mut session, "hidden");
    session.apply(Command::SetPresence(body, None)).unwrap();
    session.apply(undo).unwrap();
    assert_eq!(session.world().light_pose(LightId(0)).unwrap().translation, v(0.0, 0.0, 0.6));
}

#[test]
fn a_move_by_hand_costs_as_a_move_of_the_clip() {
    let mut session = Session::new(room(), at_tolerance(0.2)).unwrap();
    start(&mut session);
    let all = session.solve().unwrap().report().work.examined;
    session.apply(Command::set_pose(BodyId(3), Pose::translation([0.5, -0.3, 0.02]))).unwrap();
    let report = session.solve().unwrap().report().clone();
    assert_eq!(report.moved, ["two"]);
    assert!(report.work.examined < all / 3, "{} of {all} pairs", report.work.examined);
    let still = session.solve().unwrap().report().clone();
    assert_eq!((still.work.examined, still.gathers), (0, 0));
}

#[test]
fn what_makes_no_sense_is_refused_and_changes_nothing() {
    let mut session = Session::new(room(), at_tolerance(0.4)).unwrap();
    start(&mut session);
    let before = session.world();
    let (points, triangles) = cube(0.1, false);
    let nan = Pose::translation([f64::NAN, 0.0, 0.0]);
    let large = Pose { rotation: 2.0 * Pose::IDENTITY.rotation, ..Pose::IDENTITY };
    let flat = NewBody::new("flat").with_mesh("flat", MaterialId(0), &points, &[[0, 0, 1]]);
    let other = NewBody::new("x").with_mesh("x", MaterialId(9), &points, &triangles);
    for (command, says) in [
        (Command::set_pose(BodyId(9), Pose::IDENTITY), "there is no body 9: the scene has 4"),
        (Command::set_pose(BodyId(1), nan), "pose of body `lamp`"),
        (Command::set_pose(BodyId(1), large), "without scale"),
        (Command::set_reflectance(MaterialId(0), [1.0; 3]), "material `grey`"),
        (Command::set_exitance(MaterialId(7), [1.0; 3]), "there is no material 7"),
        (Command::set_intensity(LightId(0), [-1.0; 3]), "light `bulb`"),
        (Command::SetTime(f64::INFINITY), "the time"),
        (Command::Insert(flat), "no triangle with an area"),
        (Command::Insert(other), "material 9 does not exist"),
        (Command::Insert(NewBody::new("bare")), "body `bare`: it has no mesh"),
    ] {
        let refused = session.apply(command).unwrap_err().to_string();
        assert!(refused.contains(says), "{refused}");
        assert_eq!(session.world(), before);
    }
    let (corners, triangles) = cube(0.1, false);
    let new = |name| NewBody::new(name).with_mesh(name, MaterialId(0), &corners, &triangles);
    session.apply(Command::Insert(new("x"))).unwrap();
    let back = session.apply(Command::Remove(BodyId(4))).unwrap();
    let refused = session.apply(Command::Remove(BodyId(4))).unwrap_err().to_string();
    assert!(refused.contains("there is no body 4"), "{refused}");
    let lamp = session.apply(Command::Remove(BodyId(1))).unwrap();
    let refused = session.apply(Command::hide(BodyId(1))).unwrap_err().to_string();
    assert!(refused.contains("body `lamp` was removed; put it back"), "{refused}");
    session.apply(lamp).unwrap();
    session.apply(Command::Insert(new("y"))).unwrap();
    let refused = session.apply(back).unwrap_err().to_string();
    assert!(refused.contains("reverse order"), "{refused}");
}

#[test]
fn times_that_are_no_numbers_are_refused_and_normals_need_not_be_unit() {
    let mut session = Session::new(room(), at_tolerance(0.4)).unwrap();
    for time_s in [f64::NAN, f64::INFINITY] {
        let refused = session.solve_at(time_s).err().unwrap().to_string();
        assert!(refused.contains("a number of seconds"), "{refused}");
    }
    let frame = session.solve().unwrap();
    let at = [0.5, 1.0, 0.2];
    let long = frame.irradiance_at(at, [0.0, 3.0, 4.0]);
    let unit = frame.irradiance_at(at, [0.0, 0.6, 0.8]);
    assert!(
        unit[0] > 0.0 && (0..3).all(|c| (long[c] / unit[c] - 1.0).abs() < 1e-9),
        "{long:?}, {unit:?}"
    );
    for (at, normal) in [([f64::NAN, 1.0, 0.2], [0.0, 1.0, 0.0]), (at, [0.0; 3])] {
        assert!(frame.irradiance_at(at, normal).iter().all(|e| e.is_nan()));
    }
}

#[test]
fn sessions_can_be_sent_and_shared() {
    fn both<T: Send + Sync>() {}
    both::<Session>();
    both::<Scene>();
    both::<Command>();
}

/// A log with the worlds that its commands led from, and those that were taken back.
#[derive(Default)]
struct Past {
    log: Log,
    before: Vec<World>,
    undone: Vec<World>,
}

impl Past {
    fn apply(&mut self, session: &mut Session, command: Command) {
        let world = session.world();
        // A body that was removed cannot be moved.
        if self.log.apply(session, command).is_ok() {
            self.before.push(world);
            self.undone.clear();
        }
    }

    /// Takes a command back, if there is one.
    fn undo(&mut self, session: &mut Session) -> bool {
        let world = session.world();
        let is_undone = self.log.undo(session).unwrap();
        if is_undone {
            assert_eq!(session.world(), self.before.pop().unwrap());
            self.undone.push(world);
        }
        is_undone
    }

    fn redo(&mut self, session: &mut Session) {
        let world = session.world();
        if self.log.redo(session).unwrap() {
            assert_eq!(session.world(), self.undone.pop().unwrap());
            self.before.push(world);
        }
    }
}

#[test]
fn logs_are_undone_redone_and_replayed() {
    for seed in 300..304 {
        let mut r = Random(seed);
        let scene = Arc::new(room());
        let options = kinds()[(seed % 2) as usize].clone();
        let mut session = Session::new(Arc::clone(&scene), options.clone()).unwrap();
        let mut past = Past::default();
        for (body, at) in [(1, v(0.0, 0.0, 0.8)), (2, v(-0.4, 0.3, -0.6))] {
            let command = Command::set_pose(BodyId(body), Pose::translation(at));
            past.apply(&mut session, command);
        }
        let mut hashes = vec![past.log.solve(&mut session).unwrap().hash().to_string()];
        for _ in 0..12 {
            match r.unit() {
                x if x < 0.2 => assert!(past.undo(&mut session) || past.before.is_empty()),
                x if x < 0.3 => past.redo(&mut session),
                x if x < 0.5 => past.apply(&mut session, insertion(&mut r)),
                x if x < 0.6 => past.apply(&mut session, Command::Remove(BodyId(4))),
                _ => {
                    let command = draw(&mut r, session.scene());
                    past.apply(&mut session, command);
                }
            }
            hashes.push(past.log.solve(&mut session).unwrap().hash().to_string());
        }
        let mut text = Vec::new();
        past.log.write(&mut text).unwrap();
        let mut other = Session::new(scene, options).unwrap();
        let mut again = Vec::new();
        let each = |frame: Frame<'_>, hash: Option<&str>| {
            assert_eq!(Some(frame.hash().to_string().as_str()), hash);
            again.push(frame.hash().to_string());
        };
        let replayed = Log::replay(&text[..], &mut other, each).unwrap();
        assert_eq!(again, hashes, "{seed}");
        let mut twice = Vec::new();
        replayed.write(&mut twice).unwrap();
        assert_eq!(String::from_utf8(twice), String::from_utf8(text), "{seed}");
        while past.undo(&mut session) {}
        let fresh = Session::new(Arc::clone(session.scene()), at_tolerance(0.4)).unwrap();
        assert_eq!(session.world(), fresh.world(), "{seed}");
    }
}

#[test]
fn lines_of_a_log_that_make_no_sense_are_named() {
    let mut session = Session::new(room(), at_tolerance(0.4)).unwrap();
    for (text, says) in [
        ("{\"undo\":{}}", "line 1: there is nothing to undo"),
        ("\n{\"set_time\":{\"to\":1}}\nx", "line 3: expected value"),
        ("{\"remove\":{\"body\":\"sofa\"}}", "line 1: the scene has no body `sofa`"),
        ("{\"set_exitance\":{\"material\":\"red\",\"to\":[-1,0,0]}}", "line 1: material `red`"),
    ] {
        let error = Log::replay(text.as_bytes(), &mut session, |_, _| {}).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn a_solve_is_called_off_and_the_next_one_is_not() {
    let mut session = Session::new(room(), at_tolerance(0.02)).unwrap();
    start(&mut session);
    session.watch().cancel();
    let error = session.solve().map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("called off"), "{error}");
    assert!(session.frame().is_none());
    let hash = session.solve().unwrap().hash();
    assert_eq!(hash, cold(&session).solve().unwrap().hash());
    assert_eq!(session.frame().map(|frame| frame.hash()), Some(hash));
    let mut r = Random(3);
    for _ in 0..2 {
        session.apply(insertion(&mut r)).unwrap();
    }
    session.solve().unwrap();
    for command in [Command::Remove(BodyId(4)), insertion(&mut r), Command::Remove(BodyId(2))] {
        session.apply(command).unwrap();
    }
    session.watch().cancel();
    assert!(session.solve().is_err());
    check(&mut session, "called off while bodies come and go");
}

/// All logs, or those of `RELUME_SEEDS=first..end`.
#[test]
#[ignore = "minutes: a thousand logs"]
fn a_thousand_logs() {
    let wanted = std::env::var("RELUME_SEEDS").map_or(0..u64::MAX, |seeds| {
        let (first, end) = seeds.split_once("..").expect("RELUME_SEEDS=first..end");
        first.parse().unwrap()..end.parse().unwrap()
    });
    let scenes = [
        (room(), 1_000..1_800, 0.15),
        (shipped("box_room.glb"), 2_000..2_100, 0.1),
        (shipped("cornell_moving_box_and_lamp.glb"), 3_000..3_100, 0.1),
        (clutter(), 4_000..4_100, 0.1),
        (furnished(2), 5_000..5_020, 0.1),
    ];
    let mut failed = Vec::new();
    for (scene, seeds, insert) in scenes {
        for seed in seeds.filter(|seed| wanted.contains(seed)) {
            let one = || follow(&scene, seed..seed + 1, 8, insert);
            failed.extend(std::panic::catch_unwind(one).is_err().then_some(seed));
        }
    }
    assert_eq!(failed, Vec::<u64>::new());
}

#[test]
#[ignore = "minutes: ten thousand commands"]
fn ten_thousand_commands_leave_no_trace() {
    let mut session = Session::new(room(), at_tolerance(0.4)).unwrap();
    start(&mut session);
    let hash = session.solve().unwrap().hash();
    let (mut r, mut bytes) = (Random(7), Vec::new());
    for _ in 0..100 {
        let mut inverses = Vec::new();
        for step in 0..100 {
            let command = match step % 25 {
                7 => insertion(&mut r),
                _ => draw(&mut r, session.scene()),
            };
            inverses.extend(session.apply(command).ok());
            if step % 50 == 10 {
                check(&mut session, &format!("step {step}"));
            } else if step % 5 == 0 {
                session.solve().unwrap();
            }
        }
        inverses.into_iter().rev().for_each(|back| drop(session.apply(back).unwrap()));
        check(&mut session, "back");
        assert_eq!(session.solve().unwrap().hash(), hash);
        bytes.push(session.memory_bytes());
    }
    println!("bytes {bytes:?}");
    let half = bytes.len() / 2;
    let most = |bytes: &[u64]| *bytes.iter().max().unwrap();
    assert!(most(&bytes[half..]) <= most(&bytes[..half]) + most(&bytes[..half]) / 20);
}

#[test]
fn the_floor_under_a_crate_that_is_taken_away_is_lit() {
    let scene = |crate_at: Option<f64>| {
        let mut b = SceneBuilder::new("cellar");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let glow = b.material("glow", [0.0; 3], [5.0; 3]);
        let place =
            |b: &mut SceneBuilder, name: &str| b.node(name, None, DVec3::ZERO, DQuat::IDENTITY);
        let walls = place(&mut b, "walls");
        b.cuboid_inward(walls, "walls", grey, v(0.0, 0.0, 0.0), v(4.0, 3.0, 4.0));
        let lamp = place(&mut b, "lamp");
        b.cuboid(lamp, "lamp", glow, v(1.0, 2.5, 1.0), v(3.0, 2.7, 3.0));
        if let Some(x) = crate_at {
            let one = place(&mut b, "crate");
            b.cuboid(one, "crate", grey, v(x, 0.0, 1.5), v(x + 1.0, 1.0, 2.5));
        }
        b.build().unwrap()
    };
    // At a sensor, and of the element there.
    let floor = |session: &mut Session, x: f64| {
        let frame = session.solve().unwrap();
        let (at, up) = (v(x, 0.0, 2.1), DVec3::Y);
        let element = frame.solution().irradiance_at(at, up).map_or(0.0, |e| e[0]);
        [frame.irradiance_at(at, up)[0], element]
    };
    let differ = |one: [f64; 2], two: [f64; 2]| {
        (one[0] / two[0] - 1.0).abs().max((one[1] / two[1] - 1.0).abs() / 3.0)
    };
    let mut session = Session::new(scene(Some(0.5)), at_tolerance(0.1)).unwrap();
    let beside = floor(&mut session, 3.0);
    let body = session.scene().body_named("crate").unwrap();
    session.apply(Command::set_pose(body, Pose::translation([2.0, 0.0, 0.0]))).unwrap();
    let uncovered = floor(&mut session, 1.0);
    check(&mut session, "moved");
    let mut there = Session::new(scene(Some(2.5)), at_tolerance(0.1)).unwrap();
    let expected = floor(&mut there, 1.0);
    assert!(differ(uncovered, expected) < 0.05, "{uncovered:?} {expected:?} {beside:?}");
    session.apply(Command::hide(body)).unwrap();
    let empty = floor(&mut Session::new(scene(None), at_tolerance(0.1)).unwrap(), 1.0);
    let hidden = floor(&mut session, 1.0);
    assert!(differ(hidden, empty) < 0.05, "{hidden:?} {empty:?}");
    check(&mut session, "hidden");
    session.apply(Command::SetPresence(body, None)).unwrap();
    session.apply(Command::SetPose(body, None)).unwrap();
    assert!(differ(floor(&mut session, 3.0), beside) < 1e-3);
}

/// What stands in a hall.
#[derive(Clone, Copy, PartialEq)]
enum Contents {
    Boxes,
    /// Every other one a ball of many patches, which are grouped.
    BallsToo,
}

/// A room with many boxes, a small one among them; its fifth body.
fn hall(boxes: u32, what: Contents) -> Scene {
    let mut b = SceneBuilder::new("hall");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.1; 3], [9.0, 8.0, 7.0]);
    let walls = b.body("walls");
    let (corners, triangles) = cube(1.0, true);
    b.mesh(walls, "walls", grey, &corners, &triangles);
    b.material("red", [0.7, 0.2, 0.1], [0.0; 3]);
    let mut r = Random(5);
    for k in 0..boxes {
        let half = if k == 3 { 0.02 } else { 0.04 + 0.04 * r.unit() };
        let at = [k % 4, k / 4 % 4, k / 16].map(|n| 0.42 * f64::from(n) - 0.63 + 0.1 * r.unit());
        let (corners, triangles) = match k % 2 == 0 && what == Contents::BallsToo {
            true => ball(DVec3::ZERO, half),
            false => cube(half, false),
        };
        let corners: Vec<[f64; 3]> =
            corners.iter().map(|c| [0, 1, 2].map(|axis| c[axis] + at[axis])).collect();
        let body = b.body(&format!("box {k}"));
        b.mesh(body, "box", if k == 7 { glow } else { grey }, &corners, &triangles);
    }
    b.build().unwrap()
}

fn place(session: &mut Session, body: BodyId, to: Option<DVec3>) {
    session.apply(Command::SetPose(body, to.map(Pose::translation))).unwrap();
}

#[test]
fn a_body_of_many_patches_is_taken_up_where_it_rests() {
    let mut b = SceneBuilder::new("shop");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.1; 3], [9.0, 8.0, 7.0]);
    let bodies = ["walls", "lamp", "ball", "other"].map(|name| b.body(name));
    let (corners, triangles) = cube(1.0, true);
    b.mesh(bodies[0], "walls", grey, &corners, &triangles);
    let (corners, triangles) = cube(0.1, false);
    b.mesh(bodies[1], "lamp", glow, &corners, &triangles);
    for (body, x) in [(bodies[2], -0.4), (bodies[3], 0.5)] {
        let (points, faces) = ball(v(x, 0.2, -0.8), 0.2);
        b.mesh(body, "ball", grey, &points, &faces);
    }
    let scene = b.build().unwrap();
    let mut session = Session::new(scene, at_tolerance(0.3)).unwrap();
    let first = session.solve().unwrap();
    let (all, hash) = (first.report().work.examined, first.hash());
    assert!(first.report().link_kinds.is_some(), "there are groups");
    let undo = Command::set_pose(bodies[2], Pose::translation([0.02, 0.01, 0.0]));
    let undo = session.apply(undo).unwrap();
    check(&mut session, "taken up");
    let taken = session.frame().unwrap().report().work.examined;
    let (points, faces) = ball(v(0.0, -0.5, 0.3), 0.1);
    let new = NewBody::new("new").with_mesh("new", MaterialId(0), &points, &faces);
    let out = session.apply(Command::Insert(new)).unwrap();
    check(&mut session, "another one comes");
    let mut anew = cold(&session);
    anew.solve().unwrap();
    let found = compare(session.solved().unwrap(), anew.solved().unwrap());
    assert_eq!(found, None, "links of groups are carried over as they are");
    session.apply(out).unwrap();
    session.apply(undo).unwrap();
    check(&mut session, "and leaves, and the first is put down");
    assert_eq!(session.solve().unwrap().hash(), hash);
    assert!(2 * taken < all, "{taken} of {all} pairs");
}

#[test]
fn groups_that_come_apart_leave_the_coarse_solution_of_a_cold_build() {
    let mut session = Session::new(row_of_crates(), at_tolerance(0.2)).unwrap();
    let report = session.solve().unwrap().report().clone();
    assert!(report.link_kinds.is_some_and(|kinds| kinds.group_group > 0), "{report:?}");
    // Out of the row, and from either end, so that others of their groups are seen past nothing that moved.
    let aside = v(0.0, 0.1, 0.0);
    let takes = [("crate 0", Some(aside)), ("crate 23", Some(aside)), ("crate 0", None)];
    for (name, to) in takes.into_iter().chain([("crate 12", Some(aside)), ("crate 23", None)]) {
        let body = session.scene().body_named(name).unwrap();
        place(&mut session, body, to);
        check(&mut session, &format!("{name} at {to:?}"));
    }
}

#[test]
fn a_body_that_comes_absent_leaves_the_coarse_solution_of_a_cold_build() {
    let mut session = Session::new(room(), at_tolerance(0.4)).unwrap();
    start(&mut session);
    session.solve().unwrap();
    let (corners, triangles) = cube(0.03, false);
    let new = NewBody::new("new").with_mesh("new", MaterialId(1), &corners, &triangles);
    let body = BodyId(session.scene().bodies.len() as u32);
    session.apply(Command::Insert(new)).unwrap();
    session.apply(Command::hide(body)).unwrap();
    check(&mut session, "one comes that is not there");
    session.apply(Command::SetPresence(body, None)).unwrap();
    check(&mut session, "and appears");
}

#[test]
fn taking_a_body_up_among_groups_is_called_off() {
    let mut session = Session::new(furnished(1), at_tolerance(0.3)).unwrap();
    let hash = session.solve().unwrap().hash();
    let body = session.scene().body_named("cup 0 0 0").unwrap();
    place(&mut session, body, Some(v(0.02, 0.01, 0.05)));
    session.watch().cancel();
    assert!(session.solve().is_err());
    assert_eq!(session.frame().unwrap().hash(), hash, "the links of before, of its groups");
    check(&mut session, "taken up after all");
    place(&mut session, body, None);
    session.watch().cancel();
    assert!(session.solve().is_err());
    check(&mut session, "put down");
    assert_eq!(session.solve().unwrap().hash(), hash);
}

/// A ball of 12 by 8 quadrilaterals, each of two triangles.
fn ball(at: DVec3, radius: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (around, up) = (12, 8);
    let point = |i: u32, k: u32| {
        let turn = 2.0 * std::f64::consts::PI * f64::from(i % around) / f64::from(around);
        let rise = std::f64::consts::PI * (f64::from(k) / f64::from(up) - 0.5);
        let out = libm::cos(rise);
        let d = v(out * libm::cos(turn), out * libm::sin(turn), libm::sin(rise));
        (at + radius * d).to_array()
    };
    let quads = (0..around).flat_map(|i| (0..up).map(move |k| (i, k)));
    let mut out = (Vec::new(), Vec::new());
    for (i, k) in quads {
        let first = out.0.len() as u32;
        out.0.extend([point(i, k), point(i + 1, k), point(i + 1, k + 1), point(i, k + 1)]);
        out.1.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    out
}

#[test]
fn edits_come_to_the_same_on_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut session = Session::new(hall(5, Contents::Boxes), at_tolerance(0.2)).unwrap();
            let mut r = Random(9);
            let mut hashes = vec![session.solve().unwrap().hash()];
            let mut inverses = Vec::new();
            for command in [insertion(&mut r), Command::Remove(BodyId(2)), insertion(&mut r)] {
                inverses.push(session.apply(command).unwrap());
                hashes.push(session.solve().unwrap().hash());
            }
            for inverse in inverses.into_iter().rev() {
                session.apply(inverse).unwrap();
                hashes.push(session.solve().unwrap().hash());
            }
            hashes
        })
    };
    let one = run(1);
    assert_eq!(one[0], one[6]);
    assert_eq!(one[1], one[5]);
    assert_eq!(one[2], one[4]);
    assert_eq!((run(2), run(8)), (one.clone(), one));
}
