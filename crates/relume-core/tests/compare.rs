//! Comparing sessions: what agrees is said to agree, and each difference is named in words.

use std::sync::Arc;

use crate::common::{at_tolerance, form_factor_oracle, lit_room, v};
use glam::DQuat;
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{
    Difference, ElementName, Options, Session, Update, Which, compare, radiosity_gap,
};

fn at(scene: &Arc<Scene>, options: &Options, times: &[f64]) -> Session {
    let mut session = Session::new(Arc::clone(scene), options.clone()).unwrap();
    for (frame, time_s) in times.iter().enumerate() {
        session.step(frame as u32, *time_s).unwrap();
    }
    session
}

/// Asserts that the words of a difference hold each of the texts.
#[track_caller]
fn says(difference: Option<Difference>, texts: &[&str]) -> Difference {
    let difference = difference.expect("the sessions differ");
    let words = difference.to_string();
    for text in texts {
        assert!(words.contains(text), "`{text}` is missing in: {words}");
    }
    difference
}

#[test]
fn equal_links_by_different_ways_are_equal() {
    let scene = Arc::new(lit_room());
    for options in [at_tolerance(0.2), form_factor_oracle(0.1, 5e-3)] {
        let scratch = Options { update: Update::Scratch, ..options.clone() };
        let warm = at(&scene, &options, &[0.0, 0.9, 0.4, 0.5]);
        let cold = at(&scene, &scratch, &[0.5]);
        assert_eq!(compare(warm.solved().unwrap(), cold.solved().unwrap()), None);
        let gap = radiosity_gap(warm.solved().unwrap(), cold.solved().unwrap()).unwrap();
        assert!(gap.bound_w_m2 > 0.0 && gap.share() <= 1.0, "{gap:?}");
        assert_eq!(
            radiosity_gap(cold.solved().unwrap(), cold.solved().unwrap()).unwrap().difference_w_m2,
            0.0
        );
    }
}

#[test]
fn another_time_is_another_exchange_area_of_a_link_with_a_moved_end() {
    let scene = Arc::new(lit_room());
    // So coarse that both times have the same links.
    let options = form_factor_oracle(0.9, 10.0);
    let found = compare(
        at(&scene, &options, &[0.0]).solved().unwrap(),
        at(&scene, &options, &[0.03]).solved().unwrap(),
    );
    let found = says(
        found,
        &[
            "the link between surface `",
            " of body `",
            "undivided has X = ",
            " m2, V = ",
            " in the first session, X = ",
            " in the second session",
        ],
    );
    let Difference::Carried { ends, one, two } = found else { panic!("{found}") };
    assert_ne!(one, two);
    let moves = |end: &ElementName| match end {
        ElementName::Element { body, .. } => body == "lamp" || body == "mover",
        ElementName::Light(_) | ElementName::Group { .. } => false,
    };
    // Whatever else differs is hidden or lit by what moved; the first pair may be either.
    assert!(moves(&ends.0) || moves(&ends.1) || one.visibility != two.visibility, "{ends:?}");
}

#[test]
fn another_tolerance_is_a_link_that_exists_in_one_only() {
    let scene = Arc::new(lit_room());
    let (fine, coarse) =
        (at(&scene, &at_tolerance(0.1), &[0.0]), at(&scene, &at_tolerance(0.3), &[0.0]));
    let found = says(
        compare(fine.solved().unwrap(), coarse.solved().unwrap()),
        &["exists in the ", "only, with X = "],
    );
    let back = compare(coarse.solved().unwrap(), fine.solved().unwrap())
        .expect("they differ that way round too");
    let (Difference::OneOnly { which, ends, .. }, Difference::OneOnly { which: other, .. }) =
        (&found, &back)
    else {
        panic!("{found} / {back}")
    };
    assert_ne!(which, other);
    let first = if *which == Which::One { "finely" } else { "coarsely" };
    let words = found.in_words("finely", "coarsely");
    assert!(words.contains(&format!("exists {first} only")), "{words}");
    assert!(words.contains(&ends.0.to_string()), "{words}");
}

#[test]
fn elements_are_named_by_patch_and_path() {
    let scene = Arc::new(lit_room());
    let options = form_factor_oracle(0.02, 1e-3);
    let found = compare(
        at(&scene, &options, &[0.0]).solved().unwrap(),
        at(&scene, &options, &[0.2]).solved().unwrap(),
    );
    // The rester has six sides.
    says(found, &["surface `rester` of body `rester`, patch ", " and surface `lamp`"]);
    let found = compare(
        at(&scene, &at_tolerance(0.1), &[0.0]).solved().unwrap(),
        at(&scene, &at_tolerance(0.3), &[0.0]).solved().unwrap(),
    );
    says(found, &[", element "]);
}

/// A plate of a reflectance under a lamp of 10 W/m2.
fn lamp_over_plate(reflectance: f64, corners: usize) -> Arc<Scene> {
    plate_under_lamp([reflectance, 10.0], corners)
}

fn plate_under_lamp([reflectance, exitance]: [f64; 2], corners: usize) -> Arc<Scene> {
    let mut b = SceneBuilder::new("plate");
    let grey = b.material("grey", [reflectance; 3], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [exitance; 3]);
    let node = b.node("plate", None, v(0.0, 0.0, 0.0), DQuat::IDENTITY);
    let turn = std::f64::consts::TAU / corners as f64;
    let rim = (0..corners).map(|k| libm::sincos(turn * k as f64)).map(|(s, c)| v(c, s, 0.0));
    let rim: Vec<_> = rim.collect();
    b.polygon(node, "plate", grey, &rim);
    let node = b.node("lamp", None, v(0.0, 0.0, 1.0), DQuat::IDENTITY);
    let down = [v(-0.2, 0.2, 0.0), v(0.2, 0.2, 0.0), v(0.2, -0.2, 0.0), v(-0.2, -0.2, 0.0)];
    b.polygon(node, "lamp", lamp, &down);
    Arc::new(b.build().unwrap())
}

#[test]
fn radiosities_are_compared_though_all_links_are_equal() {
    let options = form_factor_oracle(0.05, 1e-2);
    let (one, two) = (lamp_over_plate(0.5, 8), lamp_over_plate(0.51, 8));
    let (one, two) = (at(&one, &options, &[0.0]), at(&two, &options, &[0.0]));
    let words = ["the radiosity of surface `plate`", ", facet ", "W/m2", "the residuals allow"];
    let found = says(compare(one.solved().unwrap(), two.solved().unwrap()), &words);
    assert!(matches!(found, Difference::Radiosity { .. }));
    assert_eq!(radiosity_gap(one.solved().unwrap(), two.solved().unwrap()), Err(found));
}

/// Four times the light has the same links: verdicts weigh errors by ratios of brightness.
#[test]
fn coarse_solutions_are_compared_though_all_links_are_equal() {
    let lit = |exitance| at(&plate_under_lamp([0.5, exitance], 8), &at_tolerance(0.2), &[0.0]);
    let (one, two) = (lit(10.0), lit(40.0));
    assert_eq!(one.frame().unwrap().hash(), two.frame().unwrap().hash());
    let found = compare(one.solved().unwrap(), two.solved().unwrap());
    assert!(matches!(found, Some(Difference::Coarse { .. })), "{found:?}");
}

#[test]
fn other_scenes_are_not_compared() {
    let options = form_factor_oracle(0.5, 1.0);
    let one = at(&lamp_over_plate(0.5, 4), &options, &[0.0]);
    let two = at(&lamp_over_plate(0.5, 8), &options, &[0.0]);
    assert_eq!(compare(one.solved().unwrap(), two.solved().unwrap()), Some(Difference::Scene));
    assert_eq!(radiosity_gap(one.solved().unwrap(), two.solved().unwrap()), Err(Difference::Scene));
}
