//! Known shapes give known polygons, and no area is lost or made.

use glam::{DQuat, DVec3};
use proptest::prelude::*;

use super::*;

/// A triangle soup with split vertices, as exporters write it.
fn soup(triangles: &[[DVec3; 3]]) -> Merged {
    let points: Vec<DVec3> = triangles.iter().flatten().copied().collect();
    let indices: Vec<[u32; 3]> =
        (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    merge(&points, &indices)
}

fn fan(outline: &[DVec3]) -> Vec<[DVec3; 3]> {
    (1..outline.len() - 1).map(|i| [outline[0], outline[i], outline[i + 1]]).collect()
}

/// Triangles of a grid of unit squares, those for which `keep` says so.
fn grid(nx: i32, ny: i32, keep: impl Fn(i32, i32) -> bool) -> Vec<[DVec3; 3]> {
    let p = |x: i32, y: i32| DVec3::new(f64::from(x), f64::from(y), 0.0);
    let cells = (0..ny).flat_map(|y| (0..nx).map(move |x| (x, y))).filter(|&(x, y)| keep(x, y));
    cells.flat_map(|(x, y)| fan(&[p(x, y), p(x + 1, y), p(x + 1, y + 1), p(x, y + 1)])).collect()
}

fn area(polygons: &[Vec<DVec3>]) -> f64 {
    polygons.iter().map(|p| area_vector(p).length() / 2.0).sum()
}

#[test]
fn a_cube_is_six_quads() {
    let p = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
    let sides =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[DVec3; 3]> = sides.iter().flat_map(|s| fan(&s.map(p))).collect();
    let merged = soup(&triangles);
    assert_eq!(merged.polygons.iter().map(Vec::len).collect::<Vec<_>>(), [4; 6]);
    assert_eq!(area(&merged.polygons), 6.0);
}

#[test]
fn flat_grids_and_discs_are_one_polygon() {
    let merged = soup(&grid(30, 20, |_, _| true));
    assert_eq!(merged.polygons.len(), 1);
    assert_eq!(area(&merged.polygons), 600.0);
    let rim: Vec<DVec3> = (0..64)
        .map(|i| {
            let a = std::f64::consts::TAU * f64::from(i) / 64.0;
            DVec3::new(a.cos(), 0.25, -a.sin())
        })
        .collect();
    let centre = DVec3::new(0.0, 0.25, 0.0);
    let pie: Vec<[DVec3; 3]> = (0..64).map(|i| [centre, rim[i], rim[(i + 1) % 64]]).collect();
    assert_eq!(soup(&pie).polygons.iter().map(Vec::len).collect::<Vec<_>>(), [64]);
}

#[test]
fn a_wall_with_a_window_is_a_few_convex_pieces() {
    let keep = |x: i32, y: i32| !((2..4).contains(&x) && (2..4).contains(&y));
    let merged = soup(&grid(6, 6, keep));
    assert!((4..=12).contains(&merged.polygons.len()), "{}", merged.polygons.len());
    assert_eq!(area(&merged.polygons), 32.0);
    assert!(merged.polygons.iter().all(|p| flatten(p).is_ok()));
}

#[test]
fn bent_folded_and_single_triangles_stay_apart() {
    let (o, x, y) = (DVec3::ZERO, DVec3::X, DVec3::Y);
    let bent = DVec3::new(1.0, 1.0, 1e-3);
    assert_eq!(soup(&[[o, x, y], [x, bent, y]]).polygons.len(), 2);
    // The same triangle from both sides.
    assert_eq!(soup(&[[o, x, y], [o, y, x]]).polygons.len(), 2);
    // One folded back over the other along a shared side.
    assert_eq!(soup(&[[o, x, y], [y, x, DVec3::new(0.1, 0.1, 0.0)]]).polygons.len(), 2);
    // Three on a side: nothing is merged there.
    let (beside, up) = (DVec3::new(1., 1., 0.), DVec3::Z);
    assert_eq!(soup(&[[o, x, y], [x, up, y], [x, beside, y]]).polygons.len(), 3);
}

#[test]
fn of_triangles_on_the_same_corners_the_first_counts() {
    let (o, x, y, beside) = (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1., 1., 0.));
    let merged = soup(&[[o, x, y], [x, y, o], [x, beside, y], [y, o, x]]);
    assert_eq!((merged.polygons.len(), merged.degenerate), (1, 2));
    assert_eq!(merged.polygon_of, [Some(0), None, Some(0), None]);
}

#[test]
fn triangles_without_area_are_counted_at_every_scale() {
    for s in [1e-5, 1.0, 1e5] {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0) * s;
        let merged = soup(&[
            [p(0., 0.), p(1., 0.), p(0., 1.)],
            [p(0., 0.), p(1., 0.), p(1., 0.)],
            [p(0., 0.), p(1., 0.), p(2., 0.)],
            [p(3., 3.); 3],
        ]);
        assert_eq!((merged.polygons.len(), merged.degenerate), (1, 3));
    }
}

#[test]
fn a_sphere_stays_a_sphere_and_a_large_mesh_is_quick() {
    let n = 220;
    let at = |i: i32, j: i32| {
        let (a, b) = (
            std::f64::consts::TAU * f64::from(i % n) / f64::from(n),
            std::f64::consts::PI * f64::from(j) / f64::from(n),
        );
        DVec3::new(a.cos() * b.sin(), a.sin() * b.sin(), b.cos())
    };
    let quads = (1..n - 1).flat_map(|j| (0..n).map(move |i| (i, j)));
    let triangles: Vec<[DVec3; 3]> = quads
        .flat_map(|(i, j)| fan(&[at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]))
        .collect();
    let started = std::time::Instant::now();
    let merged = soup(&triangles);
    assert_eq!(merged.polygons.len(), (n * (n - 2)) as usize);
    let flat = soup(&grid(220, 220, |x, y| (x, y) != (0, 0)));
    assert_eq!(area(&flat.polygons), 220.0 * 220.0 - 1.0);
    println!("{} triangles in {:?}", 4 * n * n, started.elapsed());
}

proptest! {
    #[test]
    fn area_is_kept_and_pieces_are_convex(
        cells in proptest::collection::vec(any::<bool>(), 36),
        (x, y, z) in (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64),
        scale in prop_oneof![Just(1e-4), Just(1.0), Just(1e4)],
        offset in -3.0..3.0f64,
    ) {
        let turn = DQuat::from_xyzw(x, y, z, 1.0).normalize();
        // Rounded to 32 bits, as files have them.
        let place = |p: DVec3| ((turn * p + offset) * scale).as_vec3().as_dvec3();
        let flat = grid(6, 6, |x, y| cells[(6 * y + x) as usize]);
        let wanted = flat.len() as f64 / 2.0 * scale * scale;
        let merged = soup(&flat.iter().map(|t| t.map(place)).collect::<Vec<_>>());
        prop_assert_eq!(merged.degenerate, 0);
        prop_assert!((area(&merged.polygons) - wanted).abs() <= 1e-5 * wanted);
        for polygon in &merged.polygons {
            prop_assert!(flatten(polygon).is_ok(), "{:?}", polygon);
        }
        let count = flat.len() / 2;
        prop_assert!(merged.polygons.len() <= count);
    }
}
