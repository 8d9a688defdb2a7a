//! How the error falls with the number of links.

use std::sync::Arc;

use relume_core::flat::{FlatOptions, FlatSession};
use relume_io::flat::parse;

/// A closed room with a lamp and a box: everything a scene has.
const ROOM: &str = "polygon room 0 0 2 0 2 1 0 1 reflectance 0.6\n\
    segment left 1.2 0 1.2 0.3 reflectance 0.4\nsegment top 1.2 0.3 1.5 0.3 reflectance 0.4\n\
    segment right 1.5 0.3 1.5 0 reflectance 0.4\n\
    segment lamp 0.9 0.95 0.5 0.95 emit 10 reflectance 0\n";

/// A closed room of four walls, of which one emits: no shadows.
const EMPTY: &str = "segment floor 0 0 2 0 reflectance 0.6 emit 1\n\
    segment right 2 0 2 1 reflectance 0.6\nsegment top 2 1 0 1 reflectance 0.6\n\
    segment left 0 1 0 0 reflectance 0.6\n";

/// Mean radiosity of each wall, and the number of links.
fn solve(scene: &str, epsilon: f64, constant: bool) -> (Vec<f64>, u64) {
    let options = FlatOptions {
        epsilon,
        min_length_m: 0.2 * epsilon,
        constant,
        residual: 1e-7,
        ..FlatOptions::default()
    };
    let mut session = FlatSession::new(Arc::new(parse(scene).unwrap()), options).unwrap();
    let links = session.step(0, 0.0).links;
    let (_, forest) = session.frame().unwrap().pairs();
    let means = forest
        .facets()
        .iter()
        .map(|&f| f64::from(session.frame().unwrap().radiosity(f)[0]))
        .collect();
    (means, links)
}

/// By which power of the number of links the error of the means of walls falls.
fn order(scene: &str, constant: bool) -> f64 {
    let (reference, _) = solve(scene, 0.003, false);
    let mut runs = Vec::new();
    for epsilon in [0.2, 0.1, 0.05, 0.025, 0.0125] {
        let (means, links) = solve(scene, epsilon, constant);
        let squares = means.iter().zip(&reference).map(|(m, r)| ((m - r) / r.max(0.1)).powi(2));
        let error = (squares.sum::<f64>() / means.len() as f64).sqrt();
        println!("epsilon {epsilon}: {links} links, error {error:e}");
        runs.push(((links as f64).ln(), error.ln()));
    }
    let (first, last) = (runs[0], runs[runs.len() - 1]);
    let order = (first.1 - last.1) / (last.0 - first.0);
    println!("order {order}");
    order
}

/// Constant elements err by what the threshold e bounds, and it takes 1 / e^2 links.
#[test]
fn with_constant_elements_the_error_falls_as_the_root_of_the_number_of_links() {
    let order = order(ROOM, true);
    assert!((0.45..0.75).contains(&order), "{order}");
}

/// The threshold does not ask for shadows: across the edge of one no straight line fits.
#[test]
fn the_error_of_wall_means_falls_with_the_number_of_links() {
    let order = order(ROOM, false);
    assert!((0.5..0.9).contains(&order), "{order}");
}

/// Links with gradients err by the square of what the threshold e bounds, and it takes 1 / e^2 links.
#[test]
fn without_shadows_the_error_falls_faster() {
    let order = order(EMPTY, false);
    assert!(order > 0.95, "{order}");
}
