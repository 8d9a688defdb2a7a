//! Random scenes in random motion: after every step the state equals one built from scratch.
//!
//! Every draw follows from a number. What fails is reduced and printed as a recipe, to be written
//! down among the named regressions in `regressions.rs`.

mod judge;
mod pinned;
mod recipe;

use std::ops::Range;
use std::sync::Arc;

use self::judge::{Seen, agree, follow, reduced};
use self::recipe::{Flavour, Recipe};
use crate::common::Random;
use crate::common::audit::{Audit, audit};
use glam::DVec3;
use relume_core::scene::BodyId;
use relume_core::session::{Aim, MountedSensor, Sensor, Session};

/// Steps of each draw.
const STEPS: usize = 16;

fn check(flavour: Flavour, draws: Range<u64>) -> Seen {
    check_recipes(flavour, draws, |seed| Recipe::draw(flavour, seed, STEPS))
}

fn check_steady(flavour: Flavour, draws: Range<u64>) {
    let seen = check_recipes(flavour, draws, |seed| Recipe::steady(flavour, seed, STEPS));
    // Pairs passed over by certificate, and pairs of which only X followed.
    assert!(seen.certified > seen.motions && seen.followed > seen.motions);
}

fn check_recipes(flavour: Flavour, draws: Range<u64>, draw: impl Fn(u64) -> Recipe) -> Seen {
    let mut seen = Seen::default();
    for seed in draws.clone() {
        let recipe = draw(seed);
        match follow(&recipe) {
            Ok(found) => seen += found,
            Err(why) => {
                let small = reduced(&recipe);
                let why_small = follow(&small).err();
                panic!("{flavour:?} {seed}: {why}\nreduced: {why_small:?}\n{small:?}");
            }
        }
    }
    println!("{flavour:?}: {seen:?}");
    assert_eq!(seen.motions, (draws.end - draws.start) * STEPS as u64);
    // A test that meets no event checks nothing.
    assert!(seen.promoted > 0 && seen.demoted > 0 && seen.occluded > 0 && seen.reaped > 0);
    seen
}

#[test]
fn bodies_that_go_anywhere() {
    check(Flavour::Free, 0..12);
}

#[test]
fn bodies_that_touch_and_cut_each_other() {
    check(Flavour::Contact, 0..12);
}

#[test]
fn bodies_that_come_and_go_and_jump_away() {
    check(Flavour::Jumps, 0..12);
}

#[test]
fn lights_that_move() {
    check(Flavour::Lights, 0..12);
}

#[test]
fn bodies_that_ride_on_others() {
    check(Flavour::Families, 0..12);
}

#[test]
fn lamps_that_change() {
    check(Flavour::Glows, 0..12);
}

#[test]
fn steady_motion() {
    use Flavour::{Contact, Families, Free, Glows, Jumps, Lights};
    for flavour in [Free, Contact, Jumps, Lights, Families, Glows] {
        check_steady(flavour, 0..8);
    }
}

#[test]
fn solutions_for_points() {
    use Flavour::{Contact, Families, Free, Glows, Jumps, Lights};
    for flavour in [Free, Contact, Jumps, Lights, Families, Glows] {
        check_recipes(flavour, 100..103, |seed| {
            let drawn = Recipe::draw(flavour, seed, STEPS);
            Recipe { aim: Aim::Points, solve: Ok([0.05, 0.1, 0.2][seed as usize % 3]), ..drawn }
        });
    }
}

#[test]
fn solutions_for_given_sensors() {
    use Flavour::{Contact, Families, Free, Glows, Jumps, Lights};
    for flavour in [Free, Contact, Jumps, Lights, Families, Glows] {
        check_recipes(flavour, 200..204, |seed| {
            let drawn = Recipe::draw(flavour, seed, STEPS);
            let riding = |k: u32| MountedSensor {
                body: k.checked_sub(1).map(BodyId),
                sensor: Sensor { at: DVec3::splat(0.3), normal: DVec3::Y },
            };
            let aim = Aim::Sensors((0..3).map(riding).collect());
            Recipe { aim, solve: Ok([0.05, 0.1][seed as usize % 2]), ..drawn }
        });
    }
}

#[test]
fn any_number_of_threads_follows_alike() {
    for (flavour, seed) in [(Flavour::Contact, 3), (Flavour::Jumps, 5), (Flavour::Lights, 7)] {
        let recipe = Recipe::draw(flavour, seed, 12);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut session = Session::new(recipe.scene(), recipe.options()).unwrap();
                let mut step = |&time_s: &f64| {
                    let mut report = session.step(0, time_s).unwrap();
                    report.seconds = relume_core::session::Seconds::default();
                    let radiosity = session
                        .frame()
                        .unwrap()
                        .solution()
                        .leaves
                        .iter()
                        .map(|l| l.radiosity)
                        .collect();
                    (format!("{report:?}"), radiosity)
                };
                recipe.times_s.iter().map(&mut step).collect::<Vec<(String, Vec<[f32; 3]>)>>()
            })
        };
        let one = run(1);
        for threads in [2, 8] {
            assert!(one == run(threads), "{flavour:?} {seed}: {threads} threads differ from one");
        }
    }
}

/// A frame of the long run: a random walk that is back at the same time every 500 frames.
const LAP: usize = 500;

#[test]
#[ignore = "minutes: ten thousand frames with each oracle"]
fn ten_thousand_frames_leave_no_trace() {
    for solve in [Ok(0.3), Err((0.1, 0.01))] {
        let recipe = Recipe { solve, dark: false, ..Recipe::draw(Flavour::Contact, 0, 1) };
        let scene = recipe.scene();
        let mut warm = Session::new(Arc::clone(&scene), recipe.options()).unwrap();
        let mut cold = Session::new(Arc::clone(&scene), recipe.options()).unwrap();
        let two = cold.step(0, 2.5).unwrap();
        let mut random = Random(1);
        let mut bytes = Vec::new();
        for frame in 0..=10_000 {
            let home = frame % LAP == 0;
            let time_s = if home { 2.5 } else { random.between(0.0, 6.0) };
            let one = warm.step(frame as u32, time_s).unwrap();
            if home {
                let used = agree(
                    &scene,
                    (&one, &warm.frame().unwrap().solution()),
                    (&two, &cold.frame().unwrap().solution()),
                );
                assert!(used.is_ok(), "frame {frame}: {used:?}");
                Audit { row_sum: [0.0; 2], row_excess: 0.0, ..audit(&warm) }.check(0.0);
                bytes.push(warm.memory_bytes());
            }
        }
        println!(
            "{solve:?}: {} links; {} bytes cold, every lap: {bytes:?}",
            two.links,
            cold.memory_bytes()
        );
        // The same state takes as much room whatever came before, but for what may be vacant.
        let (early, late) = (bytes[2] as f64, *bytes[2..].iter().max().unwrap() as f64);
        assert!(late < 1.05 * early, "{early} bytes after 1,000 frames, {late} later");
        assert!(late < 1.1 * cold.memory_bytes() as f64, "{late} bytes");
    }
}

#[test]
#[ignore = "minutes: the same, many more of them"]
fn many_more_of_each() {
    use Flavour::{Contact, Families, Free, Glows, Jumps, Lights};
    for flavour in [Glows, Lights, Families, Jumps, Contact, Free] {
        check_steady(flavour, 8..160);
        check(flavour, 16..160);
    }
}
