//! What a frame costs when something moves, against building it from scratch.
//!
//! `cargo bench -p relume-core --bench moving`, or one part of it with `-- lights` or `-- mover`:
//!
//! - *lights*: the two sequences of Forsyth, Yang and Teo 1995, in which the lamp moves. How finely
//!   the paper's form-factor oracle must divide to be as accurate as the error oracle, and what a
//!   cold build of that costs, in frames of the error oracle.
//! - *mover*: a small cube in the furnished room of the cold bench.
//! - *box*: the room of `room_box_static.glb` with its box sliding. What a frame costs, its reading included, at which error of the
//!   path-traced patch means (`tests/data/room_box_static.csv`, of the first frame).
//!
//! One thread. Frames and cold builds take turns, so that whatever else the machine does hits both:
//! compare ratios, not seconds. `benches/data` holds the sequences as `relume demo` writes them, and the moving box.

#![allow(missing_docs, clippy::disallowed_methods, clippy::disallowed_types)]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DQuat, DVec3};
use rayon::ThreadPool;
use relume_core::scene::{Interpolation, PatchId, Scene, Track};
use relume_core::session::{FrameReport, Options, Oracle, Session, Snapshot};
use relume_io::{ImportOptions, import};

mod common;

use common::cells::{Against, Cells};
use common::{form_factor, furnished_room, median, pool, quartiles};

const FPS: f64 = 24.0;

fn main() {
    let parts: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let asked = |part: &str| parts.is_empty() || parts.iter().any(|p| p == part);
    if asked("lights") {
        let room = Sequence { name: "room", tolerance: 0.036, frames: 20, sampled: 5 };
        let corridor = Sequence { name: "corridor", tolerance: 0.028, frames: 30, sampled: 8 };
        for sequence in [room, corridor] {
            moving_lamp(&sequence);
        }
    }
    if asked("mover") {
        small_mover("on the floor", 0.01);
        small_mover("in the air", 1.2);
    }
    if asked("box") {
        moving_box();
    }
}

// ---- A moving lamp.

/// One of the paper's sequences.
struct Sequence {
    name: &'static str,
    /// That of `relume demo`.
    tolerance: f64,
    frames: u32,
    /// Errors are measured in every so many frames.
    sampled: u32,
}

/// Tolerance of the solutions that others are compared with.
const REFERENCE: f64 = 0.002;

/// Largest form factors of the paper's oracle that are tried.
const EPSILONS: [f64; 10] = [0.1, 0.056, 0.03, 0.017, 0.01, 0.0056, 0.003, 0.0017, 0.001, 0.00056];

/// Smallest elements that are tried with each, as shares of the scene's area. The coarsest that
/// still reaches an error is the cheapest; the last is fine enough for the paper's pictures.
const SHARES: [f64; 4] = [1.0 / 250.0, 1.0 / 1000.0, 1.0 / 4000.0, 1.0 / 16000.0];

/// Frames that are compared at tolerances finer than the sequence's own.
const FINER_FRAMES: u32 = 9;

/// Links beyond which the paper's oracle is not refined further.
const LINKS_MAX: u64 = 1_000_000;

/// The norms in which two oracles are called equal: cells along a side of a patch, and what errors
/// are relative to. The first is the one that counts.
const NORMS: [(&str, usize, Against); 3] = [
    ("16 x 16 cells, to the cell", 16, Against::Cell),
    ("64 x 64 cells, to the cell", 64, Against::Cell),
    ("16 x 16 cells, to the scene", 16, Against::Scene),
];

fn moving_lamp(sequence: &Sequence) {
    let path = format!("benches/data/{}.glb", sequence.name);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let scene = Arc::new(import(&path, &ImportOptions::default()).expect("a valid scene"));
    println!("\n{}: {} frames, {:.1} m2", sequence.name, sequence.frames, scene.area_m2());
    println!("RMS error of irradiance, %, against tolerance {REFERENCE}, by norm");
    print!("{:<28} {:>9} {:>8}", "", "links", "leaves");
    print!("{}", NORMS.map(|(name, ..)| format!("{name:>30}")).concat());
    println!("  most of the squared error");

    let errors = Errors::new(&scene, sequence);
    let t = sequence.tolerance;
    errors.of(Oracle::Error, 3.0 * t);
    let tolerances = [t, t / 2.0, t / 4.0];
    let ours = tolerances.map(|tolerance| errors.of(Oracle::Error, tolerance).errors);
    let targets = [ours[2][0], ours[0][1], ours[0][2]];
    let families = SHARES.map(|share| Family::refine(share, &errors, targets));

    let mut rivals: Vec<(String, Rival)> = (0..NORMS.len())
        .map(|norm| (NORMS[norm].0.to_owned(), Rival::cheapest(ours[0][norm], &families, norm)))
        .collect();
    let pictures = &families[SHARES.len() - 1..];
    let fine = format!("{}, elements for pictures", NORMS[0].0);
    rivals.push((fine, Rival::cheapest(ours[0][0], pictures, 0)));
    frames_against_cold(&scene, t, sequence.frames, &rivals);
    for (tolerance, errors) in tolerances.into_iter().zip(ours).skip(1) {
        let rival = Rival::cheapest(errors[0], &families, 0);
        frames_against_cold(&scene, tolerance, FINER_FRAMES, &[(NORMS[0].0.to_owned(), rival)]);
    }
}

/// Reference irradiances of the sampled frames.
struct Errors<'a> {
    scene: &'a Arc<Scene>,
    pool: ThreadPool,
    references: Vec<(u32, [Cells; 3])>,
}

impl<'a> Errors<'a> {
    fn new(scene: &'a Arc<Scene>, sequence: &Sequence) -> Errors<'a> {
        let pool = pool(2);
        let frames = (0..sequence.frames).step_by(sequence.sampled as usize);
        let options = fixed(Oracle::Error, REFERENCE);
        let references = frames
            .map(|frame| {
                (
                    frame,
                    cells(&cold(scene, &options, frame, &pool).session.frame().unwrap().solution()),
                )
            })
            .collect();
        Errors { scene, pool, references }
    }

    /// Root mean square over the sampled frames of an oracle's error, by norm; printed too.
    fn of(&self, oracle: Oracle, tolerance: f64) -> Rung {
        let mut squares = [0.0; 3];
        let mut last = FrameReport::default();
        let mut worst = (PatchId(0), 0.0);
        for (frame, reference) in &self.references {
            let built = cold(self.scene, &fixed(oracle, tolerance), *frame, &self.pool);
            let found = cells(&built.session.frame().unwrap().solution());
            for (norm, (_, _, against)) in NORMS.iter().enumerate() {
                squares[norm] += found[norm].error(&reference[norm], *against).powi(2);
            }
            let (patch, share) = found[0].worst(&reference[0], NORMS[0].2);
            if share > worst.1 {
                worst = (patch, share);
            }
            last = built.report;
        }
        let errors = squares.map(|s| (s / self.references.len() as f64).sqrt());
        let label = name(oracle, tolerance);
        print!("{label:<28} {:>9} {:>8}", last.links, last.leaves);
        print!("{}", errors.map(|e| format!("{:>30.3}", 100.0 * e)).concat());
        let surface = self.scene.patches[worst.0.0 as usize].surface;
        let surface = &self.scene.surfaces[surface.0 as usize].name;
        println!("  {:.0} % of {surface}", 100.0 * worst.1);
        Rung { oracle, links: last.links, errors }
    }
}

fn cells(snapshot: &Snapshot) -> [Cells; 3] {
    NORMS.map(|(_, side, _)| Cells::of(snapshot, side))
}

/// An oracle with what it costs and how it errs, by norm.
struct Rung {
    oracle: Oracle,
    links: u64,
    errors: [f64; 3],
}

/// The paper's oracle with one smallest element, from coarse to fine.
struct Family {
    rungs: Vec<Rung>,
}

impl Family {
    /// Refines until the errors aimed at are reached, or there are too many links.
    fn refine(share: f64, errors: &Errors<'_>, targets: [f64; 3]) -> Family {
        let mut rungs: Vec<Rung> = Vec::new();
        let goes_on = |rung: &Rung| {
            rung.links < LINKS_MAX && rung.errors.iter().zip(targets).any(|(e, t)| *e > t)
        };
        for epsilon in EPSILONS {
            if rungs.last().is_none_or(goes_on) {
                let oracle = form_factor(epsilon, share * errors.scene.area_m2());
                rungs.push(errors.of(oracle, REFERENCE));
            }
        }
        Family { rungs }
    }

    /// The coarsest that errs no more than this: between rungs, linear in the logarithms.
    fn reaching(&self, error: f64, norm: usize) -> Option<Rival> {
        let fine = self.rungs.iter().position(|rung| rung.errors[norm] <= error)?;
        let coarse = fine.saturating_sub(1);
        let [coarse, fine] = [coarse, fine].map(|k| {
            let rung = &self.rungs[k];
            let Oracle::FormFactor { epsilon, min_area_m2 } = rung.oracle else { unreachable!() };
            (epsilon, min_area_m2, rung.links as f64, rung.errors[norm])
        });
        let step = (coarse.3 / fine.3).ln();
        let t = if step > 0.0 { (coarse.3 / error).ln() / step } else { 1.0 };
        let between = |a: f64, b: f64| a * (b / a).powf(t);
        let oracle = form_factor(between(coarse.0, fine.0), fine.1);
        Some(Rival { oracle, links: between(coarse.2, fine.2), reached: true })
    }
}

/// The paper's oracle where it errs as the error oracle does.
#[derive(Clone, Copy)]
struct Rival {
    oracle: Oracle,
    /// About.
    links: f64,
    /// Whether it was refined that far; if not, it is the best that was tried.
    reached: bool,
}

impl Rival {
    /// The one with the fewest links.
    fn cheapest(error: f64, families: &[Family], norm: usize) -> Rival {
        let reaching = families.iter().filter_map(|f| f.reaching(error, norm));
        reaching.min_by(|a, b| a.links.total_cmp(&b.links)).unwrap_or_else(|| {
            let rungs = families.iter().flat_map(|f| &f.rungs);
            let best = rungs.min_by(|a, b| a.errors[norm].total_cmp(&b.errors[norm]));
            let best = best.expect("rungs");
            Rival { oracle: best.oracle, links: best.links as f64, reached: false }
        })
    }
}

/// Follows the motion with the error oracle; beside every frame, in turns, cold builds of it.
fn frames_against_cold(
    scene: &Arc<Scene>,
    tolerance: f64,
    frame_count: u32,
    rivals: &[(String, Rival)],
) {
    let pool = pool(1);
    let own = fixed(Oracle::Error, tolerance);
    let mut built: Vec<(Options, Vec<f64>, u64)> = rivals
        .iter()
        .map(|(_, rival)| (fixed(rival.oracle, tolerance), Vec::new(), 0))
        .chain([(own.clone(), Vec::new(), 0)])
        .collect();
    let mut session = cold(scene, &own, 0, &pool).session;
    let mut frames = Vec::new();
    for frame in 1..frame_count {
        frames.push(step(&mut session, frame, &pool));
        for (options, seconds, links) in &mut built {
            let cold = cold(scene, options, frame, &pool);
            seconds.push(cold.seconds);
            *links = cold.report.links;
        }
    }
    println!("cold builds in frames of the error oracle {tolerance:.4}, one thread:");
    for ((norm, rival), (options, seconds, links)) in rivals.iter().zip(&built) {
        let least = if rival.reached { "" } else { "; NOT reached, so at least" };
        print!("  {} ({links} links; {norm}{least}):", name(options.oracle, tolerance));
        print_ratio(seconds, &frames);
    }
    let (_, seconds, links) = built.last().expect("its own");
    print!("  its own ({links} links):");
    print_ratio(seconds, &frames);
    print_frames(&frames);
    print_memory(&session, &frames.last().expect("a frame").1);
}

fn name(oracle: Oracle, tolerance: f64) -> String {
    match oracle {
        Oracle::FormFactor { epsilon, min_area_m2 } => {
            format!("form-factor {epsilon:.5},{min_area_m2:.1e}")
        }
        _ => format!("error {tolerance:.4}"),
    }
}

// ---- A small mover.

/// Side of the cube: 5 % of the room's.
const CUBE_M: f64 = 0.25;
const MOVES: u32 = 12;

/// The furnished room with a cube that moves by a quarter of its size a frame, `above_m` the floor,
/// along the middle of the room.
fn small_mover(place: &str, above_m: f64) {
    let mut b = furnished_room();
    let paint = b.material("cube", [0.6, 0.2, 0.2], [0.0; 3]);
    let from = DVec3::new(1.6, above_m, 2.0);
    let to = from + DVec3::X * (0.25 * CUBE_M * f64::from(MOVES));
    let node = b.node("cube", None, from, DQuat::IDENTITY);
    let h = CUBE_M / 2.0;
    b.cuboid(node, "cube", paint, DVec3::new(-h, 0.0, -h), DVec3::new(h, CUBE_M, h));
    let times_s = vec![0.0, f64::from(MOVES) / FPS];
    b.animate_translation(
        node,
        Track { times_s, values: vec![from, to], interpolation: Interpolation::Linear },
    );
    let scene = Arc::new(b.build().expect("a valid scene"));

    let pool = pool(1);
    let options = fixed(form_factor(0.017, 4e-4), 0.02);
    let mut session = cold(&scene, &options, 0, &pool).session;
    let (mut frames, mut colds) = (Vec::new(), Vec::new());
    for frame in 1..=MOVES {
        frames.push(step(&mut session, frame, &pool));
        colds.push(cold(&scene, &options, frame, &pool).seconds);
    }
    let last = &frames.last().expect("a frame").1;
    println!("\nsmall mover {place}: {} links, {} frames", last.links, frames.len());
    print!("  cold builds in frames:");
    print_ratio(&colds, &frames);
    print_frames(&frames);
    print_memory(&session, last);
    let still: Vec<_> = (0..9).map(|_| step(&mut session, MOVES, &pool).0).collect();
    println!("  nothing moved: {:.1} microseconds a frame", 1e6 * median(still));
}

// ---- A moving box.

/// Points along a side of a patch over which irradiance is averaged.
const POINTS: u32 = 32;

fn moving_box() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = here.join("benches/data/moving_box.glb");
    let scene = Arc::new(import(&path, &ImportOptions::default()).expect("a valid scene"));
    let rows = rows(&here.join("tests/data/room_box_static.csv"));
    let pool = pool(1);
    println!("\nmoving box: {} patch means, {BOX_FRAMES} frames, one thread", rows.len());
    println!(
        "tolerance     links   leaves   error   cold build   frame and its reading (quartiles)"
    );
    for tolerance in [0.15, 0.1, 0.05, 0.036, 0.02, 0.014, 0.01] {
        let own = fixed(Oracle::Error, tolerance);
        let cold = cold(&scene, &own, 0, &pool);
        let (mut session, report) = (cold.session, cold.report);
        let error = patch_means_error(&session.frame().unwrap().solution(), &rows);
        let frame = |frame| {
            let start = Instant::now();
            step(&mut session, frame, &pool);
            pool.install(|| session.frame().unwrap().solution());
            start.elapsed().as_secs_f64()
        };
        let [low, middle, high] = quartiles((1..BOX_FRAMES).map(frame)).map(|s| 1e3 * s);
        println!(
            "{tolerance:<9} {:>9} {:>8} {:>5.2} % {:>9.1} ms {middle:>9.1} ms ({low:.1} to {high:.1})",
            report.links,
            report.leaves,
            100.0 * error,
            1e3 * cold.seconds,
        );
    }
}

/// Frames of the moving box.
const BOX_FRAMES: u32 = 24;

fn rows(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).expect("a table");
    let numbers = |line: &str| line.split(',').map(|n| n.parse().ok()).collect();
    text.lines().filter_map(numbers).collect()
}

/// Root mean square of the relative errors of patch means.
fn patch_means_error(snapshot: &Snapshot, rows: &[Vec<f64>]) -> f64 {
    let off2 = |row: &Vec<f64>| {
        let three = |k: usize| DVec3::new(row[k], row[k + 1], row[k + 2]);
        let part = |k: u32| (f64::from(k) + 0.5) / f64::from(POINTS);
        let at = |k: u32| three(0) + three(3) * part(k % POINTS) + three(6) * part(k / POINTS);
        let found = |k| snapshot.irradiance_at(at(k), three(9)).expect("it lies on the room")[0];
        let mean = (0..POINTS * POINTS).map(found).sum::<f64>() / f64::from(POINTS * POINTS);
        (mean / row[12] - 1.0).powi(2)
    };
    (rows.iter().map(off2).sum::<f64>() / rows.len() as f64).sqrt()
}

// ---- All.

/// Options of all that is measured: row sums and energies, a pass over all links, are left out.
fn fixed(oracle: Oracle, tolerance: f64) -> Options {
    Options { oracle, tolerance, balance: false, ..Options::default() }
}

struct Built {
    session: Session,
    report: FrameReport,
    seconds: f64,
}

/// Sets up and solves one frame.
fn cold(scene: &Arc<Scene>, options: &Options, frame: u32, pool: &ThreadPool) -> Built {
    let start = Instant::now();
    let mut session = Session::new(Arc::clone(scene), options.clone()).expect("options");
    let (_, report) = step(&mut session, frame, pool);
    Built { session, report, seconds: start.elapsed().as_secs_f64() }
}

/// Brings a session to a frame; seconds and report.
fn step(session: &mut Session, frame: u32, pool: &ThreadPool) -> (f64, FrameReport) {
    let start = Instant::now();
    let report = pool.install(|| session.step(frame, f64::from(frame) / FPS)).expect("fits");
    (start.elapsed().as_secs_f64(), report)
}

fn print_ratio(colds: &[f64], frames: &[(f64, FrameReport)]) {
    let [low, middle, high] = quartiles(colds.iter().zip(frames).map(|(c, f)| c / f.0));
    let (cold, frame) = (median(colds.iter().copied()), median(frames.iter().map(|f| f.0)));
    println!(
        " median {middle:.1}, quartiles {low:.1} to {high:.1} ({:.1} ms and {:.1} ms)",
        1e3 * cold,
        1e3 * frame
    );
}

/// Medians over the frames: counters, and where the time goes.
fn print_frames(frames: &[(f64, FrameReport)]) {
    let of = |f: &dyn Fn(&FrameReport) -> f64| median(frames.iter().map(|(_, r)| f(r)));
    let pairs = |r: &FrameReport| (r.pairs.active + r.pairs.refined + r.pairs.culled) as f64;
    let share = |f: &dyn Fn(&FrameReport) -> u64| of(&|r| 100.0 * f(r) as f64 / pairs(r));
    println!(
        "  a frame: visited {:.2} % of {:.0} pairs, examined {:.2} %, changed {:.2} %, examined : changed {:.2}",
        share(&|r| r.work.visited),
        of(&pairs),
        share(&|r| r.work.examined),
        share(&|r| r.work.changed),
        of(&|r| r.work.examined as f64 / r.work.changed.max(1) as f64),
    );
    println!(
        "    with a moved end {:.0}, visibility only {:.0}, brightness only {:.0}, promoted {:.0}, demoted {:.0}, occlusion changed {:.0}; {:.0} sweeps, {:.0} gathers of {:.0} elements",
        of(&|r| r.work.reevaluated as f64),
        of(&|r| r.work.visibility_only as f64),
        of(&|r| r.work.brightness_only as f64),
        of(&|r| r.work.promoted as f64),
        of(&|r| r.work.demoted as f64),
        of(&|r| r.work.occlusion_changed as f64),
        of(&|r| f64::from(r.sweeps)),
        of(&|r| r.gathers as f64),
        of(&|r| r.elements as f64),
    );
    let part = |f: &dyn Fn(&FrameReport) -> f64| 1e3 * of(f);
    println!(
        "    milliseconds: poses {:.2}, pairs {:.2}, links and elements {:.2}, solve {:.2}, all {:.2}",
        part(&|r| r.seconds.moving),
        part(&|r| r.seconds.evaluate),
        part(&|r| r.seconds.edit),
        part(&|r| r.seconds.solve),
        part(&|r| r.seconds.total),
    );
}

fn print_memory(session: &Session, report: &FrameReport) {
    let memory = session.memory();
    let pairs = report.pairs.active + report.pairs.refined + report.pairs.culled;
    println!(
        "  memory: {:.1} bytes a pair ({pairs}), {:.1} bytes an element ({}), {:.2} MB fixed",
        memory.pairs as f64 / pairs as f64,
        memory.elements as f64 / report.elements as f64,
        report.elements,
        memory.fixed as f64 / 1e6,
    );
}
