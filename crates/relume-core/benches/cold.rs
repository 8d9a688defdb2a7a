//! Cold builds: links a second on one thread and on all, and where the time goes.
//!
//! `cargo bench -p relume-core --bench cold`. The scene is a furnished room of the kind that Hanrahan,
//! Salzman and Aupperle 1991 and SPLASH used: a closed room with tables, cabinets and two lamps.
//! Times are wall-clock on whatever else runs beside: compare figures of one run only.

#![allow(missing_docs, clippy::disallowed_methods, clippy::disallowed_types)]

use std::sync::Arc;
use std::time::Instant;

use relume_core::scene::Scene;
use relume_core::session::{FrameReport, Options, Oracle, Session};

mod common;

use common::{form_factor, furnished_room, pool};

fn main() {
    let scene = Arc::new(furnished_room().build().expect("a valid scene"));
    println!(
        "furnished room: {} patches, {:.1} m2, times of the best of three",
        scene.patches.len(),
        scene.area_m2()
    );
    println!(
        "{:<24} {:>8} {:>10} {:>9} {:>8} {:>8} {:>9} {:>11} {:>8} {:>8} {:>9}",
        "oracle",
        "threads",
        "links",
        "pairs",
        "leaves",
        "seconds",
        "links/s",
        "segments",
        "build %",
        "solve %",
        "bytes/lnk"
    );
    for (name, oracle, tolerance) in [
        ("form-factor 0.05", form_factor(0.05, 4e-3), 0.02),
        ("form-factor 0.017", form_factor(0.017, 4e-4), 0.02),
        ("error 0.1", Oracle::Error, 0.1),
        ("error 0.02", Oracle::Error, 0.02),
        ("error 0.005", Oracle::Error, 0.005),
    ] {
        for threads in [1, 2] {
            let options = Options { oracle, tolerance, ..Options::default() };
            run(name, &scene, &options, threads);
        }
    }
}

fn run(name: &str, scene: &Arc<Scene>, options: &Options, threads: usize) {
    let pool = pool(threads);
    let mut best: Option<(f64, FrameReport, u64)> = None;
    for _ in 0..3 {
        let mut session = Session::new(Arc::clone(scene), options.clone()).expect("options");
        let start = Instant::now();
        let report = pool.install(|| session.step(0, 0.0)).expect("fits");
        let seconds = start.elapsed().as_secs_f64();
        if best.as_ref().is_none_or(|b| seconds < b.0) {
            best = Some((seconds, report, session.memory_bytes()));
        }
    }
    let (seconds, r, bytes) = best.expect("three runs");
    let share = |part: f64| 100.0 * part / seconds;
    println!(
        "{name:<24} {threads:>8} {:>10} {:>9} {:>8} {seconds:>8.3} {:>9.0} {:>11} {:>8.1} {:>8.1} {:>9.1}",
        r.links,
        r.pairs.active + r.pairs.refined + r.pairs.culled,
        r.leaves,
        r.links as f64 / seconds,
        r.work.segments,
        share(r.seconds.evaluate),
        share(r.seconds.solve),
        bytes as f64 / r.links as f64,
    );
}
