//! Hashes of what the engine computes, pinned: a change that means to change no result changes none.
//!
//! `data/pinned.txt` holds one line a frame: links by the engine's own hash, and radiosities. A commit that changes
//! results on purpose writes the file anew (`RELUME_PIN=1 cargo test --test tests random_motion::pinned`) and says why.

use std::fmt::Write as _;
use std::sync::Arc;

use relume_core::flat::{FlatOptions, FlatSession};
use relume_core::scene::Scene;
use relume_core::session::{Options, Session};
use relume_io::flat::parse;

use crate::common::{at_tolerance, data, form_factor_oracle, shipped};
use crate::random_motion::recipe::{Flavour, Recipe};

/// A scene as it is solved.
struct Pin {
    name: String,
    scene: Arc<Scene>,
    options: Options,
    times_s: Vec<f64>,
}

/// FNV-1a over 32-bit words.
fn fold(words: impl Iterator<Item = u32>) -> u64 {
    let bytes = words.flat_map(u32::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

fn pins() -> Vec<Pin> {
    let mut out = Vec::new();
    let files = [
        ("box_room.glb", 0.2, (0.1, 0.01)),
        ("cornell_moving_box_and_lamp.glb", 0.2, (0.1, 0.01)),
        ("room_box_static.glb", 0.2, (0.1, 0.01)),
        ("satellite_rotating_arrays.glb", 0.3, (0.2, 0.02)),
        ("../../benches/data/corridor.glb", 0.3, (0.2, 0.05)),
        ("../../benches/data/room.glb", 0.2, (0.1, 0.05)),
    ];
    for (file, tolerance, (epsilon, area_m2)) in files {
        let scene = Arc::new(shipped(file));
        let end_s = scene.motion.duration_s;
        let times_s: Vec<f64> = [0.0, 0.2, 0.23, 0.6].map(|share| share * end_s).to_vec();
        for (kind, options) in [
            ("error", at_tolerance(tolerance)),
            ("form-factor", form_factor_oracle(epsilon, area_m2)),
        ] {
            let (name, scene) = (format!("{} {kind}", scene.name), Arc::clone(&scene));
            out.push(Pin { name, scene, options, times_s: times_s.clone() });
        }
    }
    use Flavour::{Contact, Families, Free, Glows, Jumps, Lights};
    for flavour in [Free, Contact, Jumps, Lights, Families, Glows] {
        let recipe = Recipe::draw(flavour, 11, 4);
        for (kind, solve) in [("error", Ok(0.3)), ("form-factor", Err((0.2, 0.05)))] {
            let recipe = Recipe { solve, dark: false, ..recipe.clone() };
            let (scene, options) = (recipe.scene(), recipe.options());
            let name = format!("{flavour:?} {kind}");
            out.push(Pin { name, scene, options, times_s: recipe.times_s.clone() });
        }
    }
    out
}

/// The frames of a scene, a line each.
fn frames_of(pin: &Pin) -> String {
    let mut session = Session::new(Arc::clone(&pin.scene), pin.options.clone()).unwrap();
    let mut out = String::new();
    for (frame, &time_s) in pin.times_s.iter().enumerate() {
        let report = session.step(frame as u32, time_s).unwrap();
        let snapshot = session.frame().unwrap().solution();
        let radiosity = fold(snapshot.leaves.iter().flat_map(|l| l.radiosity.map(f32::to_bits)));
        writeln!(out, "{} {frame} {} {} {radiosity:016x}", pin.name, report.links, report.hash)
            .unwrap();
    }
    out
}

const PLANE: &str = "\
segment floor 0 0 4 0 reflectance 0.6 emit 0.2
segment right 4 0 4 3 reflectance 0.5
segment ceiling 4 3 0 3 reflectance 0.7 emit 1
segment left 0 3 0 0 reflectance 0.3
body crate
at 0 1 1
at 2 3 1.5
polygon crate -0.4 -0.3 0.4 -0.3 0.4 0.3 -0.4 0.3 reflectance 0.4
body bar
at 0 3 2
at 2 1 2.2
polygon bar -0.2 -0.1 0.2 -0.1 0 0.2 reflectance 0.8 emit 0.1
";

/// The plane, which knows one oracle.
fn plane() -> String {
    let scene = Arc::new(parse(PLANE).unwrap());
    let mut session = FlatSession::new(scene, FlatOptions::default()).unwrap();
    let mut out = String::new();
    for (frame, time_s) in [0.0, 0.4, 0.45, 1.6].into_iter().enumerate() {
        let report = session.step(frame as u32, time_s);
        let elements = session.frame().unwrap().elements();
        let radiosity = fold(elements.iter().flat_map(|e| e.radiosity.map(f32::to_bits)));
        writeln!(out, "plane {frame} {} {} {radiosity:016x}", report.links, report.hash).unwrap();
    }
    out
}

#[test]
fn pinned_hashes_hold_for_any_number_of_threads() {
    let file = data("pinned.txt");
    let pins = pins();
    let on = |threads: usize| -> String {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| pins.iter().map(frames_of).collect::<String>() + &plane())
    };
    let one = on(1);
    if std::env::var_os("RELUME_PIN").is_some() {
        std::fs::write(&file, &one).unwrap();
    }
    let pinned = std::fs::read_to_string(&file).unwrap_or_default();
    for (threads, found) in [(1, one), (2, on(2)), (8, on(8))] {
        let differs = found.lines().zip(pinned.lines()).find(|(found, pinned)| found != pinned);
        assert_eq!(differs, None, "{threads} threads: found and pinned");
        assert_eq!(found.lines().count(), pinned.lines().count());
    }
}
