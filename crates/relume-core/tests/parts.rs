//! Form factors between cells of joined walls: rows that sum to one, entries against the judge, and the
//! same bits whatever was summed before.

#![allow(clippy::disallowed_methods)]

use std::sync::Arc;

use crate::common;
use crate::common::v;
use glam::{DQuat, DVec3};
use relume_core::scene::{LightKind, Scene, SceneBuilder};
use relume_core::session::{Factors, Grouping, PartFactors, Session};
use relume_judge::{Random, seen};

/// Cells along the side of a wall and of a face of the box; neither is a power of two.
const CELLS: [usize; 2] = [10, 3];

/// Half the side of the box, metres; the room is a unit cube.
const HALF: f64 = 0.12;

/// A closed room of cells in which a box of cells slides from near one wall to near the other.
fn scene() -> Arc<Scene> {
    let mut b = SceneBuilder::new("cells");
    let room = common::still(&mut b, "room");
    let slider = common::sliding(&mut b, "box", v(0.15, 0.3, 0.45), v(0.83, 0.3, 0.55));
    common::turn(&mut b, slider, DVec3::Y, 0.3);
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    for (node, lo, hi, n, inward) in [
        (room, DVec3::ZERO, DVec3::ONE, CELLS[0], true),
        (slider, DVec3::splat(-HALF), DVec3::splat(HALF), CELLS[1], false),
    ] {
        for (k, cell) in common::cells_of_cuboid(lo, hi, n, inward).iter().enumerate() {
            b.polygon(node, &format!("cell {k}"), grey, cell);
        }
    }
    Arc::new(b.build().unwrap())
}

fn session(scene: &Scene) -> Session {
    Session::new(Arc::new(scene.clone()), common::at_tolerance(0.01)).unwrap()
}

fn reciprocity_error(f: &Factors) -> f64 {
    let mut worst = 0.0_f64;
    for from in 0..f.len() as u32 {
        for (to, factor) in f.row(from) {
            let back = f.row(to).find(|e| e.0 == from).map_or(0.0, |e| e.1);
            let (one, other) = (factor * f.area_m2[from as usize], back * f.area_m2[to as usize]);
            worst = worst.max((one - other).abs() / one.max(other));
        }
    }
    worst
}

#[test]
fn rows_sum_to_one_and_entries_are_right_at_every_place_of_the_box() {
    let scene = scene();
    let joined = scene.joined();
    assert_eq!(joined.scene.patches.len(), 12);
    let grouping = Grouping::by_patch(&scene);
    let mut sums = PartFactors::new(&scene, &joined, grouping.clone());
    let mut session = session(&joined.scene);
    let mut random = Random(1);
    for frame in 0..=4 {
        let time_s = f64::from(frame) / 4.0;
        session.step(frame, time_s).unwrap();
        let f = sums.factors(session.frame().unwrap());
        let offs = (0..f.len() as u32).map(|row| ((f.row_sum(row) - 1.0).abs(), row));
        let (worst, row) = offs.fold((0.0, 0), |m, o| if o.0 > m.0 { o } else { m });
        let name = &grouping.names[row as usize];
        println!("frame {frame}: rows within {worst:.1e} ({name})");
        assert!(worst < 1e-3, "frame {frame}, {name}: {worst}");
        assert!(reciprocity_error(&f) < 1e-12);
        let polygon = |k: usize| -> Vec<DVec3> {
            let patch = &scene.patches[k];
            let pose = scene.pose(patch.body, time_s).unwrap();
            patch.corners_in_body().map(|c| pose.point(c)).collect()
        };
        let all: Vec<Vec<DVec3>> = (0..scene.patches.len()).map(polygon).collect();
        for _ in 0..40 {
            let pick = |random: &mut Random| (random.unit() * all.len() as f64) as usize;
            let (from, to) = (pick(&mut random), pick(&mut random));
            let slider = &all[6 * CELLS[0] * CELLS[0]..];
            let between: Vec<&[DVec3]> = slider
                .iter()
                .filter(|p| **p != all[from] && **p != all[to])
                .map(|p| &p[..])
                .collect();
            let exact = seen::form_factor(&all[from], &all[to], &between, 1e-5);
            let found = f.row(from as u32).find(|e| e.0 == to as u32).map_or(0.0, |e| e.1);
            assert!(
                (found - exact).abs() < 3e-4,
                "frame {frame}: {from} to {to}: {found}, not {exact}"
            );
        }
    }
}

#[test]
fn what_was_summed_before_leaves_no_trace() {
    let scene = scene();
    let joined = scene.joined();
    let grouping = Grouping::by_patch(&scene);
    let mut kept = PartFactors::new(&scene, &joined, grouping.clone());
    let mut warm = session(&joined.scene);
    for (frame, time_s) in [0.0, 0.1, 0.11, 0.9, 0.3, 0.3, 0.0].into_iter().enumerate() {
        warm.step(frame as u32, time_s).unwrap();
        let found = kept.factors(warm.frame().unwrap());
        let mut cold = session(&joined.scene);
        cold.step(0, time_s).unwrap();
        let anew =
            PartFactors::new(&scene, &joined, grouping.clone()).factors(cold.frame().unwrap());
        assert!(found == anew, "at {time_s} s");
    }
}

#[test]
fn cells_in_one_group_are_as_the_whole_wall() {
    let scene = scene();
    let joined = scene.joined();
    let mut session = session(&joined.scene);
    session.step(0, 0.4).unwrap();
    let by_body = PartFactors::new(&scene, &joined, Grouping::by_body(&scene))
        .factors(session.frame().unwrap());
    let whole =
        session.frame().unwrap().factors(&Grouping::by_body(&joined.scene)).expect("it fits");
    for row in 0..2 {
        for ((to, one), (_, other)) in by_body.row(row).zip(whole.row(row)) {
            assert!((one - other).abs() < 1e-9, "{row} to {to}: {one} {other}");
        }
    }
    // Walls, each in a group of its own, past a box in the middle.
    let mut by_wall = Grouping::by_patch(&scene);
    let wall = |k: usize| (k / (CELLS[0] * CELLS[0])).min(6) as u32;
    by_wall.names = (0..7).map(|k| format!("{k}")).collect();
    by_wall.of_patch = (0..scene.patches.len()).map(|k| Some(wall(k))).collect();
    let walls = PartFactors::new(&scene, &joined, by_wall).factors(session.frame().unwrap());
    for row in 0..7 {
        assert!((walls.row_sum(row) - 1.0).abs() < 1e-3, "{row}: {}", walls.row_sum(row));
    }
}

#[test]
fn a_body_that_is_absent_leaves_room() {
    let mut b = SceneBuilder::new("comes");
    let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    let guest = b.node("guest", None, DVec3::splat(0.5), DQuat::IDENTITY);
    b.animate_presence(guest, vec![(0.0, false), (1.0, true)]);
    // Lights are in no group.
    b.light("bulb", room, LightKind::Point, [1.0; 3]);
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    for (node, half, inward) in [(room, DVec3::ZERO, true), (guest, DVec3::splat(0.1), false)] {
        let (lo, hi) = if inward { (half, DVec3::ONE) } else { (-half, half) };
        for (k, cell) in common::cells_of_cuboid(lo, hi, 4, inward).iter().enumerate() {
            b.polygon(node, &format!("cell {k}"), grey, cell);
        }
    }
    let scene = Arc::new(b.build().unwrap());
    let joined = scene.joined();
    let mut sums = PartFactors::new(&scene, &joined, Grouping::by_patch(&scene));
    let options = common::at_tolerance(0.02);
    let mut session = Session::new(Arc::new(joined.scene.clone()), options).unwrap();
    for time_s in [0.0, 1.0, 0.5] {
        session.step(0, time_s).unwrap();
        let f = sums.factors(session.frame().unwrap());
        let there = f.area_m2.iter().filter(|a| **a > 0.0).count();
        assert_eq!(there, if time_s < 1.0 { 96 } else { 192 });
        for row in (0..f.len() as u32).filter(|&g| f.area_m2[g as usize] > 0.0) {
            assert!((f.row_sum(row) - 1.0).abs() < 1e-3, "{time_s}: {row} {}", f.row_sum(row));
        }
    }
}
