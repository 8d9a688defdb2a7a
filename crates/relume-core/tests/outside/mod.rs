//! Numbers from outside: random scenes of the kinds that users and other programs found hard, each against exact
//! values, rays or paths of the judge, which knows nothing of the engine.
//!
//! A few of each kind run here. Five hundred of each, with how many passed, the worst of them and the slowest:
//!
//!     cargo test --release -p relume-core --test tests five_hundred -- --ignored --nocapture
//!
//! with, if wanted, `RELUME_KINDS=slab,strip`, `RELUME_SEEDS=0..100`, `RELUME_TOLERANCE=0.02`, `RELUME_LIMIT_S=60`
//! (a scene that takes longer is ended) and `RELUME_JOBS=2` in the environment. One alone, with all that was measured:
//! `RELUME_SCENE='slab 17' cargo test ... one_scene -- --ignored --nocapture`, and `RELUME_GLB=FILE` writes it as a file.
// Reference values may use the platform's functions: nothing that the engine decides rests on them.
#![allow(clippy::disallowed_methods)]

mod case;
mod interior;
mod many;
mod moving;
mod near;
mod reports;
mod survey;
mod thin;
mod verdict;

use self::case::Case;
use relume_judge::Random;

/// A kind of scene: its name, the draw, and tolerances that seeds take in turn.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    draw: fn(&mut Random, &mut Case),
    tolerances: &'static [f64],
}

const MOST: &[f64] = &[0.02, 0.1, 0.02, 0.005];
const COARSE: &[f64] = &[0.1, 0.1, 0.05];
const LIGHT: &[f64] = &[0.1, 0.02, 0.02];

pub(crate) const KINDS: &[Kind] = &[
    Kind { name: "pair", draw: near::pair, tolerances: MOST },
    Kind { name: "slab", draw: near::slab, tolerances: MOST },
    Kind { name: "partitions", draw: near::partitions, tolerances: MOST },
    Kind { name: "shelves", draw: near::shelves, tolerances: MOST },
    Kind { name: "crossing", draw: many::crossing, tolerances: MOST },
    Kind { name: "boxes", draw: near::boxes, tolerances: MOST },
    Kind { name: "strip", draw: thin::strip, tolerances: MOST },
    Kind { name: "strip-in-room", draw: thin::strip_in_room, tolerances: MOST },
    Kind { name: "pipe", draw: thin::pipe, tolerances: MOST },
    Kind { name: "edge", draw: thin::edge, tolerances: MOST },
    Kind { name: "skirting", draw: thin::skirting, tolerances: MOST },
    Kind { name: "cove", draw: thin::cove, tolerances: LIGHT },
    Kind { name: "louvre", draw: many::louvre, tolerances: LIGHT },
    Kind { name: "blades", draw: many::blades, tolerances: MOST },
    Kind { name: "standing", draw: near::standing, tolerances: MOST },
    Kind { name: "landing", draw: near::landing, tolerances: LIGHT },
    Kind { name: "rug", draw: near::rug, tolerances: MOST },
    Kind { name: "sensor-in-gap", draw: near::sensor_in_gap, tolerances: LIGHT },
    Kind { name: "furnace", draw: near::furnace, tolerances: MOST },
    Kind { name: "motion", draw: moving::motion, tolerances: COARSE },
    Kind { name: "closet", draw: moving::closet, tolerances: COARSE },
    Kind { name: "table", draw: moving::table, tolerances: COARSE },
    Kind { name: "interior", draw: interior::interior, tolerances: COARSE },
    Kind { name: "device", draw: near::device, tolerances: LIGHT },
    Kind { name: "downlight", draw: thin::downlight, tolerances: LIGHT },
];

impl Kind {
    /// The scene of a seed; the tolerance in place of that of the seed.
    pub(crate) fn case(&self, seed: u64, tolerance: Option<f64>) -> Case {
        let salt =
            self.name.bytes().fold(7_u64, |s, b| s.wrapping_mul(31).wrapping_add(u64::from(b)));
        let mut random = Random::of_part(salt, seed);
        let own = self.tolerances[seed as usize % self.tolerances.len()];
        let mut case = Case::new(tolerance.unwrap_or(own));
        (self.draw)(&mut random, &mut case);
        case.lay(&mut random);
        case
    }
}

/// The kind of a name.
pub(crate) fn kind(name: &str) -> &'static Kind {
    let found = KINDS.iter().find(|k| k.name == name);
    found.unwrap_or_else(|| {
        let names: Vec<&str> = KINDS.iter().map(|k| k.name).collect();
        panic!("no kind `{name}`: one of {}", names.join(", "))
    })
}

/// What a scene may take of time here, seconds.
const LIMIT_S: f64 = 60.0;

/// Judges a few scenes of a kind, each in a process of its own, and lists those that fail.
fn check(name: &str, seeds: std::ops::Range<u64>) {
    let mut failed = Vec::new();
    for seed in seeds {
        let outcome = survey::apart(name, seed, std::time::Duration::from_secs_f64(LIMIT_S));
        println!("{}", outcome.line);
        if !outcome.passes {
            failed.push(outcome.line);
        }
    }
    assert!(failed.is_empty(), "{} of {name} fail:\n{}", failed.len(), failed.join("\n"));
}

macro_rules! a_few {
    ($($test:ident: $kind:literal, $seeds:expr;)*) => {
        $(#[test]
        fn $test() {
            check($kind, $seeds);
        })*
    };
}

a_few! {
    pairs_at_a_gap: "pair", 1..8;
    slabs_at_a_gap: "slab", 0..3;
    partitions_with_slots: "partitions", 0..3;
    shelves_that_share_edges: "shelves", 0..3;
    panels_through_each_other: "crossing", 0..3;
    turned_boxes_side_by_side: "boxes", 0..3;
    strips_over_a_floor: "strip", 0..8;
    strips_in_a_room: "strip-in-room", 0..3;
    pipes_near_a_floor: "pipe", 0..3;
    edges_of_plates: "edge", 0..3;
    skirting_boards: "skirting", 0..3;
    lamps_under_a_ceiling: "cove", 0..4;
    egg_crate_louvres: "louvre", 0..2;
    blades_in_a_row: "blades", 0..3;
    crates_on_a_floor: "standing", 0..4;
    crates_that_land: "landing", 0..2;
    rugs_on_a_floor: "rug", 0..3;
    sensors_in_gaps: "sensor-in-gap", 0..8;
    furnaces_with_gaps: "furnace", 0..3;
    bodies_through_each_other_in_motion: "motion", 0..3;
    white_bodies_in_motion_keep_their_light: "motion", 100..101;
    white_bodies_that_pierce_keep_their_light: "motion", 21..22;
    a_panel_that_slides_off_what_touches_shows_it: "motion", 197..198;
    a_box_that_moves_into_another_that_a_third_sticks_in: "motion", 155..156;
    a_crate_that_slides_over_panels_in_the_floor_holds_no_light: "motion", 181..182;
    white_closets: "closet", 0..8;
    white_tables: "table", 0..2;
    small_devices: "device", 0..5;
    lamps_let_into_a_ceiling: "downlight", 0..2;
}

#[test]
fn furnished_rooms() {
    check("interior", 4..8);
}

#[test]
fn closed_forms_and_rays_agree_on_the_scenes_of_both() {
    for name in ["strip", "pair", "standing"] {
        for seed in 0..40 {
            let case = kind(name).case(seed, None);
            let (world, names) = case.world(0.0);
            let of = |name: &str| -> Vec<usize> {
                (0..names.len()).filter(|&k| names[k] == *name).collect()
            };
            for k in &case.known {
                let row = relume_judge::rows::row(&world, &of(&k.from), 1 << 15, seed);
                let (found, error) = row.to(&of(&k.to));
                // A factor that no ray finds, or none misses, has no spread.
                let off = (found - k.factor).abs();
                let bound = 5.0 * error + k.error + 1e-4;
                assert!(
                    off <= bound,
                    "{name} {seed}: {k:?}, {found} +- {error} by rays: {}",
                    case.story
                );
            }
        }
    }
}

#[test]
fn scenes_that_are_called_sealed_lose_nothing() {
    for kind in KINDS {
        for seed in 0..12 {
            let case = kind.case(seed, None);
            if !case.sealed || case.may_overlap {
                continue;
            }
            for &time_s in &case.times_s {
                if case.contact.as_ref().is_some_and(|c| time_s >= c.since_s) {
                    continue;
                }
                let (world, names) = case.world(time_s);
                for k in 0..names.len() {
                    let lost = relume_judge::rows::row(&world, &[k], 2000, seed).lost;
                    assert!(
                        lost == 0.0,
                        "{} {seed}: {} loses {lost}: {}",
                        kind.name,
                        names[k],
                        case.story
                    );
                }
            }
        }
    }
}
