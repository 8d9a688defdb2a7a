//! Tests of what is stored compressed, with files that others' encoders wrote (`tests/data/packed`): a ring
//! whose colours say which vertex is which, so that positions, colours and triangles have to agree.

use std::f64::consts::TAU;
use std::path::PathBuf;

use glam::DVec3;

use super::document::Document;
use crate::ImportOptions;

fn open(file: &str) -> Document {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/packed");
    Document::open(&folder.join(file), &ImportOptions::default()).unwrap()
}

/// The ring's vertex `i` of `around` and `j` of `across`, as shares.
fn on_the_ring(along: f64, across: f64) -> DVec3 {
    let (a, b) = (TAU * along, TAU * across);
    let r = 2.0 + 0.5 * b.cos();
    DVec3::new(r * a.cos(), 0.5 * b.sin(), r * a.sin())
}

/// Quantised positions are a shift and a scale away from the true ones; both in units of the width of all.
fn in_widths(points: &[DVec3]) -> Vec<DVec3> {
    let min = points.iter().copied().reduce(DVec3::min).unwrap();
    let max = points.iter().copied().reduce(DVec3::max).unwrap();
    points.iter().map(|&p| (p - min) / (max.x - min.x)).collect()
}

/// Checks positions against colours, and that triangles hold neighbours only, each once.
fn holds_the_ring(file: &str, (around, across): (f64, f64), error: f64) {
    let document = open(file);
    let primitive = &document.root.meshes[0].primitives[0];
    let read = |name: &str| primitive.attributes[name];
    let points: Vec<DVec3> = document
        .numbers::<3>(read("POSITION"), file)
        .unwrap()
        .into_iter()
        .map(DVec3::from)
        .collect();
    let colours = document.numbers::<4>(read("COLOR_0"), file).unwrap();
    let places: Vec<(f64, f64)> = colours
        .iter()
        .map(|c| ((c[0] * around).round() / around, (c[1] * across).round() / across))
        .collect();
    assert!(colours.iter().all(|c| (c[2] - 0.5).abs() < 0.02 && c[3] > 0.99), "{file}");
    let meant: Vec<DVec3> = places.iter().map(|&(a, b)| on_the_ring(a, b)).collect();
    for (found, meant) in in_widths(&points).iter().zip(in_widths(&meant)) {
        assert!(found.distance(meant) < error, "{file}: {found} is not {meant}");
    }
    let corners = document.indices(primitive.indices.unwrap(), file).unwrap();
    assert_eq!(corners.len(), (6.0 * around * across) as usize, "{file}");
    let mut triangles: Vec<Vec<(i64, i64)>> = corners
        .chunks(3)
        .map(|t| {
            let place = |c: &u32| places[*c as usize];
            let mut t: Vec<(i64, i64)> = t
                .iter()
                .map(place)
                .map(|(a, b)| ((a * around).round() as i64, (b * across).round() as i64))
                .collect();
            t.sort_unstable();
            t
        })
        .collect();
    assert!(
        triangles
            .iter()
            .all(|t| t[2].0 - t[0].0 == 1 && t.iter().all(|c| (c.1 - t[0].1).abs() <= 1))
    );
    triangles.sort();
    triangles.dedup();
    assert_eq!(triangles.len(), (2.0 * around * across) as usize, "{file}");
}

#[test]
fn every_encoder_gives_the_same_vertices() {
    holds_the_ring("ring-draco-sequential.glb", (12.0, 5.0), 1e-4);
    holds_the_ring("ring-draco-standard.glb", (12.0, 5.0), 1e-4);
    holds_the_ring("ring-draco-valence.glb", (32.0, 16.0), 1e-4);
    holds_the_ring("ring-meshopt-ext.glb", (12.0, 5.0), 1e-4);
    holds_the_ring("ring-meshopt-khr.glb", (12.0, 5.0), 1e-4);
    holds_the_ring("ring-meshopt-float.glb", (12.0, 5.0), 1e-4);
}
