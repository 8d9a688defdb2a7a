//! Crossed strings: formulas, obstruction, reciprocity, and rows of closed polygons.

use glam::DVec2;
use proptest::prelude::*;
use relume_core::flat::{Segment, exchange, visible_exchange};

fn segment(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
    Segment::new(DVec2::new(x0, y0), DVec2::new(x1, y1))
}

/// A floor of width 1 and a ceiling of width 1 at a height, facing each other.
fn plates(height: f64) -> (Segment, Segment) {
    (segment(-0.5, 0.0, 0.5, 0.0), segment(0.5, height, -0.5, height))
}

#[test]
fn open_factors_are_those_of_the_catalogue() {
    for h in [0.01, 0.3, 1.0, 7.0, 100.0_f64] {
        let (floor, ceiling) = plates(h);
        let formula = 1.0 / ((1.0 + h * h).sqrt() + h);
        assert!((exchange(&floor, &ceiling) - formula).abs() < 1e-12, "plates {h}");
        let wall = segment(0.5, 0.0, 0.5, h);
        let formula = h / (1.0 + h + (1.0 + h * h).sqrt());
        assert!((exchange(&floor, &wall) - formula).abs() < 1e-12, "corner {h}");
    }
    for degrees in [5.0, 45.0, 90.0, 160.0_f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (one, two) = (segment(0.0, 0.0, 1.0, 0.0), segment(cos, sin, 0.0, 0.0));
        let formula = 1.0 - (degrees.to_radians() / 2.0).sin();
        assert!((exchange(&one, &two) - formula).abs() < 1e-12, "wedge {degrees}");
    }
}

#[test]
fn only_what_faces_exchanges() {
    let (floor, ceiling) = plates(1.0);
    assert_eq!(exchange(&floor.reversed(), &ceiling), 0.0);
    assert_eq!(exchange(&floor, &floor), 0.0);
    // Of a wall through the floor's line only the upper half counts.
    let wall = segment(0.5, -1.0, 0.5, 1.0);
    let upper = exchange(&floor, &segment(0.5, 0.0, 0.5, 1.0));
    assert!((exchange(&floor, &wall) - upper).abs() < 1e-14);
}

#[test]
fn strings_bend_around_an_obstruction() {
    let (floor, ceiling) = plates(1.0);
    for w in [1e-6, 0.1, 0.5, 0.9, 1.0, 1.3_f64] {
        let blocker = segment(-0.5 * w, 0.5, 0.5 * w, 0.5);
        let gap = 0.5 - 0.5 * w;
        let formula = if w < 1.0 { 2.0 * (gap * gap + 0.25).sqrt() - 1.0 } else { 0.0 };
        let found = visible_exchange(&floor, &ceiling, &[blocker]);
        assert!((found - formula).abs() < 1e-12, "{w}: {found} {formula}");
        // The same in pieces that overlap, in any order, with one that hides nothing more.
        let pieces = [blocker.half(1), segment(-0.5 * w, 0.5, 0.1 * w, 0.5), blocker.half(0)];
        assert!((visible_exchange(&floor, &ceiling, &pieces) - formula).abs() < 1e-12, "{w}");
    }
    // A wall that stands on the floor and reaches the ceiling: each half sees its half.
    let middle = segment(0.0, 0.0, 0.0, 1.0);
    let half = exchange(&floor.half(0), &ceiling.half(1));
    assert!((visible_exchange(&floor, &ceiling, &[middle]) - 2.0 * half).abs() < 1e-12);
    // What is behind an end, or lies on it, does not block.
    let behind = [segment(-1.0, -0.1, 1.0, -0.1), floor.reversed(), segment(-1.0, 1.2, 1.0, 1.2)];
    let open = exchange(&floor, &ceiling);
    assert!((visible_exchange(&floor, &ceiling, &behind) - open).abs() < 1e-12);
}

/// Rows of a closed scene: `outline` counter-clockwise, `inside` closed polygons clockwise.
fn check_rows(outline: &[DVec2], inside: &[Vec<DVec2>]) {
    let edges = |corners: &[DVec2]| -> Vec<Segment> {
        (0..corners.len())
            .map(|k| Segment::new(corners[k], corners[(k + 1) % corners.len()]))
            .collect()
    };
    let walls: Vec<Segment> =
        edges(outline).into_iter().chain(inside.iter().flat_map(|p| edges(p))).collect();
    for (k, receiver) in walls.iter().enumerate() {
        let past = |s: usize| {
            let others = (0..walls.len()).filter(|&o| o != k && o != s);
            let blockers: Vec<Segment> = others.map(|o| walls[o]).collect();
            visible_exchange(receiver, &walls[s], &blockers)
        };
        let sum: f64 = (0..walls.len()).filter(|&s| s != k).map(past).sum();
        let row = sum / receiver.length();
        assert!((row - 1.0).abs() < 1e-10, "row {k}: {row}");
    }
}

fn ring(corners: usize, radius: f64, centre: DVec2, turn: f64) -> Vec<DVec2> {
    let angle = |k: usize| turn + std::f64::consts::TAU * k as f64 / corners as f64;
    (0..corners).map(|k| centre + DVec2::from_angle(angle(k)) * radius).collect()
}

#[test]
fn rows_of_closed_polygons_sum_to_one() {
    for corners in 3..9 {
        check_rows(&ring(corners, 1.7, DVec2::new(0.3, -0.2), 0.4), &[]);
    }
    // Walls that hide each other: an L and a comb.
    let l = [(0., 0.), (3., 0.), (3., 1.), (1., 1.), (1., 3.), (0., 3.)].map(DVec2::from);
    check_rows(&l, &[]);
    let star: Vec<DVec2> =
        (0..14).map(|k| ring(14, [2.0, 0.7][k % 2], DVec2::ZERO, 0.1)[k]).collect();
    check_rows(&star, &[]);
}

#[test]
fn rows_sum_to_one_with_bodies_inside() {
    let room = [(0., 0.), (4., 0.), (4., 3.), (0., 3.)].map(DVec2::from);
    let clockwise = |corners, radius, x, y, turn| {
        let mut body = ring(corners, radius, DVec2::new(x, y), turn);
        body.reverse();
        body
    };
    check_rows(&room, &[clockwise(4, 0.5, 1.0, 1.0, 0.2)]);
    let many = [
        clockwise(4, 0.5, 1.0, 1.0, 0.2),
        clockwise(3, 0.4, 2.5, 2.0, 1.0),
        clockwise(7, 0.3, 3.2, 0.8, 0.0),
        // It stands on the floor.
        [(1.8, 0.0), (1.8, 0.6), (2.2, 0.6), (2.2, 0.0)].map(DVec2::from).to_vec(),
    ];
    // The bottom of what stands on the floor is in the dark: its row is that of no room.
    check_rows(&room, &many[..3]);
    let tall = many[3].clone();
    let upper: Vec<Segment> = tall.windows(2).map(|w| Segment::new(w[0], w[1])).collect();
    let under = segment(1.8, 0.0, 2.2, 0.0);
    let ceiling = segment(4.0, 3.0, 0.0, 3.0);
    assert!(visible_exchange(&under, &ceiling, &upper) < 1e-12);
}

fn point() -> impl Strategy<Value = DVec2> {
    (-1.0..1.0_f64, -1.0..1.0_f64).prop_map(|(x, y)| DVec2::new(x, y))
}

fn any_segment() -> impl Strategy<Value = Segment> {
    (point(), point())
        .prop_filter("long", |(p, q)| (*p - *q).length() > 0.05)
        .prop_map(|(p, q)| Segment::new(p, q))
}

/// The exchange past blockers by adaptive nothing: many points of both ends, and a yes or no for each.
fn sampled(a: &Segment, b: &Segment, blockers: &[Segment], n: usize) -> f64 {
    let mut sum = 0.0;
    for i in 0..n {
        let x = a.at((i as f64 + 0.5) / n as f64);
        for j in 0..n {
            let y = b.at((j as f64 + 0.5) / n as f64);
            let d = y - x;
            let cosines = (a.normal().dot(d).max(0.0), (-b.normal().dot(d)).max(0.0));
            let hidden = blockers.iter().any(|s| {
                let side = |p: DVec2| d.perp_dot(p - x);
                let (u, v) = (s.distance(x), s.distance(y));
                side(s.start) * side(s.end) < 0.0 && u * v < 0.0
            });
            if !hidden {
                sum += cosines.0 * cosines.1 / (2.0 * d.length().powi(3));
            }
        }
    }
    sum * a.length() * b.length() / (n * n) as f64
}

proptest! {
    /// Seen from either side, in halves, and turned: the same.
    #[test]
    fn obstructed_exchange_is_one_number(
        a in any_segment(),
        b in any_segment(),
        blockers in prop::collection::vec(any_segment(), 0..7),
        turn in 0.0..6.0_f64,
    ) {
        let whole = visible_exchange(&a, &b, &blockers);
        prop_assert!(whole <= exchange(&a, &b) + 1e-12);
        prop_assert!((whole - visible_exchange(&b, &a, &blockers)).abs() < 1e-11);
        let halves: f64 =
            [0, 1].iter().map(|&k| visible_exchange(&a.half(k), &b, &blockers)).sum();
        prop_assert!((whole - halves).abs() < 1e-11, "{} {}", whole, halves);
        let turned = |s: &Segment| {
            let by = DVec2::from_angle(turn);
            Segment::new(by.rotate(s.start) + 3.0, by.rotate(s.end) + 3.0)
        };
        let there: Vec<Segment> = blockers.iter().map(turned).collect();
        let found = visible_exchange(&turned(&a), &turned(&b), &there);
        // A blocker that cuts an end is cut off at 1e-12 of the coordinates before it, which grow with the move:
        // seen from near by that is a hundred times as much.
        prop_assert!((whole - found).abs() < 1e-9, "{} {}", whole, found);
    }
}

#[test]
fn sampling_agrees() {
    let a = segment(-0.7, -1.0, 0.9, -0.8);
    let b = segment(0.8, 1.0, -0.9, 0.7);
    let blockers = [
        segment(-0.5, 0.0, 0.0, 0.2),
        segment(-0.2, -0.3, 0.3, 0.4),
        segment(0.5, 0.1, 0.6, -0.4),
        segment(-2.0, 0.3, -0.8, 0.2),
    ];
    let found = visible_exchange(&a, &b, &blockers);
    let reference = sampled(&a, &b, &blockers, 1500);
    assert!((found - reference).abs() < 1e-3 * reference, "{found} {reference}");
    assert!(found < 0.8 * exchange(&a, &b));
}
