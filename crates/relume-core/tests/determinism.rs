//! The state is a pure function of the instant: the same bits for any number of threads, in any
//! order of frames, from any first frame; and it does change when something moves.

use std::sync::Arc;

use crate::common;
use crate::common::{at_tolerance, form_factor_oracle, lit_room};
use relume_core::scene::Scene;
use relume_core::session::{FrameReport, Options, Session, Snapshot};

/// Times of the frames used here, seconds.
const TIMES: [f64; 4] = [0.0, 0.3, 0.65, 1.0];

fn session(scene: &Arc<Scene>, options: &Options) -> Session {
    Session::new(Arc::clone(scene), options.clone()).unwrap()
}

fn step(session: &mut Session, frame: usize) -> (String, Vec<u64>) {
    let report = session.step(frame as u32, TIMES[frame]).unwrap();
    (report.hash.clone(), bits(&session.frame().unwrap().solution(), &report))
}

/// Every number of a snapshot, and every counter and balance of a report but times and `moved`
/// with what follows from it, as bits.
fn bits(snapshot: &Snapshot, report: &FrameReport) -> Vec<u64> {
    let mut out: Vec<u64> = snapshot.leaf_offsets.iter().map(|&n| u64::from(n)).collect();
    for leaf in &snapshot.leaves {
        out.extend(leaf.corners.iter().flat_map(|c| [c.x.to_bits(), c.y.to_bits()]));
        let gradients = leaf.irradiance_gradient.as_flattened();
        let numbers = leaf.irradiance.iter().chain(&leaf.radiosity).chain(gradients);
        out.extend(numbers.map(|x| u64::from(x.to_bits())));
    }
    out.extend([report.links, report.elements, report.work.segments, u64::from(report.sweeps)]);
    let (rows, energy) = (report.row_sum_error.unwrap(), report.energy.unwrap());
    let numbers = [
        rows.rms,
        rows.max,
        energy.emitted_w,
        energy.absorbed_w,
        energy.escaped_w,
        report.residual,
    ];
    out.extend(numbers.map(f64::to_bits));
    out
}

fn kinds() -> [(&'static str, Options); 2] {
    [("error", at_tolerance(0.3)), ("form factor", form_factor_oracle(0.1, 2e-3))]
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let scene = Arc::new(lit_room());
    for (name, options) in kinds() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut s = session(&scene, &options);
                let frames = [step(&mut s, 1), step(&mut s, 3)];
                let probe =
                    s.frame().unwrap().irradiance_at(common::v(0.31, 0.0, 0.42), glam::DVec3::Y);
                (frames, probe.map(f64::to_bits))
            })
        };
        let one = run(1);
        println!("{name}: {} and {}", one.0[0].0, one.0[1].0);
        for threads in [2, 8] {
            let many = run(threads);
            assert!(many == one, "{name}: {threads} threads differ from one");
        }
    }
}

/// Asserts that two frames have the same links and elements, bit for bit, and radiosities that
/// agree within the bound of their residuals.
fn agree(one: &(FrameReport, Snapshot), two: &(FrameReport, Snapshot), what: &str) {
    assert_eq!(one.0.hash, two.0.hash, "{what}: hash");
    assert_eq!(one.0.elements, two.0.elements, "{what}: elements");
    assert_eq!(one.1.leaf_offsets, two.1.leaf_offsets, "{what}: leaves");
    let mean = two.1.leaves.iter().flat_map(|l| l.radiosity).fold(0.0, f32::max);
    // Reflectances of the lit room are below 0.7.
    let bound = (one.0.residual + two.0.residual) as f32 / 0.3 * mean + 1e-5 * mean;
    for (l, m) in one.1.leaves.iter().zip(&two.1.leaves) {
        assert_eq!(l.corners, m.corners, "{what}");
        for (b, c) in l.radiosity.iter().zip(m.radiosity) {
            assert!((b - c).abs() <= bound, "{what}: radiosity {b} against {c}, bound {bound}");
        }
    }
}

fn frame(session: &mut Session, k: usize) -> (FrameReport, Snapshot) {
    let report = session.step(k as u32, TIMES[k]).unwrap();
    (report, session.frame().unwrap().solution())
}

#[test]
fn there_and_back_again_is_where_it_was() {
    let scene = Arc::new(lit_room());
    for (name, options) in kinds() {
        let mut s = session(&scene, &options);
        let there: Vec<_> = (0..TIMES.len()).map(|k| frame(&mut s, k)).collect();
        for k in (0..TIMES.len()).rev() {
            agree(&frame(&mut s, k), &there[k], &format!("{name}, frame {k} on the way back"));
        }
        let before = bits(&s.frame().unwrap().solution(), &there[0].0);
        let again = s.step(0, TIMES[0]).unwrap();
        assert!(
            bits(&s.frame().unwrap().solution(), &there[0].0) == before,
            "{name}: standing still"
        );
        assert_eq!((again.work.examined, again.sweeps), (0, 0), "{name}: standing still is work");
    }
}

#[test]
fn a_clip_can_be_cut_anywhere() {
    let scene = Arc::new(lit_room());
    for (name, options) in kinds() {
        let mut s = session(&scene, &options);
        for k in 0..TIMES.len() {
            let cold = frame(&mut session(&scene, &options), k);
            agree(&frame(&mut s, k), &cold, &format!("{name}, frame {k}"));
        }
    }
}

#[test]
fn the_hash_changes_when_something_moves_and_with_the_tolerance() {
    let scene = Arc::new(lit_room());
    let mut hashes = Vec::new();
    let mut s = session(&scene, &at_tolerance(0.3));
    hashes.extend((0..TIMES.len()).map(|k| step(&mut s, k).0));
    hashes.push(step(&mut session(&scene, &at_tolerance(0.2)), 0).0);
    hashes.push(step(&mut session(&scene, &form_factor_oracle(0.1, 2e-3)), 0).0);
    // A move of a thousandth of the room is a move.
    let mut s = session(&scene, &at_tolerance(0.3));
    hashes.push(s.step(0, 0.0025).unwrap().hash);
    for (k, hash) in hashes.iter().enumerate() {
        assert_eq!(hash.len(), 32);
        assert!(!hashes[..k].contains(hash), "hash {k} is there twice: {hashes:?}");
    }
}

#[test]
fn moved_names_what_moved_and_nothing_else() {
    let scene = Arc::new(lit_room());
    let mut s = session(&scene, &at_tolerance(0.3));
    assert!(s.step(0, 0.0).unwrap().moved.is_empty());
    let mut moved = s.step(1, 0.5).unwrap().moved;
    moved.sort();
    assert_eq!(moved, ["lamp", "mover"]);
    assert!(s.step(2, 0.5).unwrap().moved.is_empty());
    // The tracks end at 1 s.
    assert_eq!(s.step(3, 1.0).unwrap().moved.len(), 2);
    assert!(s.step(4, 2.0).unwrap().moved.is_empty());
}
