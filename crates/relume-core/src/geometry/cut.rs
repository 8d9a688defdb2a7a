//! Convex polygons cut along lines drawn on them.

use glam::DVec2;

use super::polygon_area;
use super::tuning::{CUT_LEAST, CUT_LINES_MAX};

/// A straight line on a plane, from one point to another, metres.
pub type Segment = [DVec2; 2];

/// The part of a line within a convex polygon; `None` where there is no more than rounding, or where it runs along an
/// edge of the polygon. `slack_m`, metres, is what rounding may amount to.
pub fn segment_within(polygon: &[DVec2], [p, q]: Segment, slack_m: f64) -> Option<Segment> {
    let mut range = (0.0_f64, 1.0_f64);
    for (a, edge) in edges(polygon) {
        let (from, to) = (edge.perp_dot(p - a), edge.perp_dot(q - a));
        let at = from / (from - to);
        match (from < 0.0, to < 0.0) {
            (true, true) => return None,
            (true, false) => range.0 = range.0.max(at),
            (false, true) => range.1 = range.1.min(at),
            (false, false) => {}
        }
    }
    let (start, end) = (p.lerp(q, range.0), p.lerp(q, range.1));
    let middle = (start + end) * 0.5;
    let is_inner = edges(polygon).all(|(a, edge)| edge.perp_dot(middle - a) > 2.0 * slack_m);
    let is_long = range.0 < range.1 && start.distance(end) > 2.0 * slack_m;
    (is_long && is_inner).then_some([start, end])
}

/// The two parts of a convex polygon on both sides of the line that most of `segments` lies on, if those cover at least
/// `share` of the polygon's chord along it; `None` if no line does, or if less than a ten-thousandth of the area would be
/// cut off. `slack_m`, metres, is what rounding may amount to. Cost: the square of the lines, of which the 256 longest count.
pub fn cut_along(
    polygon: &[DVec2],
    segments: &[Segment],
    share: f64,
    slack_m: f64,
) -> Option<[Vec<DVec2>; 2]> {
    let mut within: Vec<Segment> =
        segments.iter().filter_map(|&s| segment_within(polygon, s, slack_m)).collect();
    if within.len() > CUT_LINES_MAX {
        within.sort_by(|s, t| length(t).total_cmp(&length(s)));
        within.truncate(CUT_LINES_MAX);
    }
    let mut best: Option<(f64, Segment)> = None;
    for &line in &within {
        let covered = covered(line, &within, slack_m);
        if best.is_none_or(|(most, _)| covered > most * (1.0 + 1e-9))
            && covered >= share * chord(polygon, line)
        {
            best = Some((covered, line));
        }
    }
    let parts = halves(polygon, best?.1, slack_m);
    let least = CUT_LEAST * polygon_area(polygon);
    parts.iter().all(|part| polygon_area(part) > least).then_some(parts)
}

/// Start and unit direction of each edge; the inside is on the left.
fn edges(polygon: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    let next = |k: usize| polygon[(k + 1) % polygon.len()];
    polygon.iter().enumerate().map(move |(k, &a)| (a, (next(k) - a).normalize_or_zero()))
}

fn length([p, q]: &Segment) -> f64 {
    p.distance(*q)
}

/// How much of a line the segments on it cover together, metres.
fn covered([p, q]: Segment, segments: &[Segment], slack_m: f64) -> f64 {
    let along = (q - p).normalize_or_zero();
    let is_on = |r: DVec2| along.perp_dot(r - p).abs() <= 4.0 * slack_m;
    let mut ranges: Vec<(f64, f64)> = segments
        .iter()
        .filter(|s| s.iter().all(|&r| is_on(r)))
        .map(|s| s.map(|r| along.dot(r - p)))
        .map(|[x, y]| (x.min(y), x.max(y)))
        .collect();
    ranges.sort_by(|r, s| r.0.total_cmp(&s.0));
    let (mut sum, mut reached) = (0.0, f64::NEG_INFINITY);
    for (from, to) in ranges {
        sum += (to - from.max(reached)).max(0.0);
        reached = reached.max(to);
    }
    sum
}

/// Length of a line, prolonged, within a convex polygon, metres.
fn chord(polygon: &[DVec2], [p, q]: Segment) -> f64 {
    let along = (q - p).normalize_or_zero();
    let mut range = (f64::NEG_INFINITY, f64::INFINITY);
    for (a, edge) in edges(polygon) {
        let (from, grows) = (edge.perp_dot(p - a), edge.perp_dot(along));
        let at = -from / grows;
        if grows > 0.0 {
            range.0 = range.0.max(at);
        } else if grows < 0.0 {
            range.1 = range.1.min(at);
        }
    }
    (range.1 - range.0).max(0.0)
}

/// The parts of a polygon on the left and on the right of a line; corners within the slack of it belong to both.
fn halves(polygon: &[DVec2], [p, q]: Segment, slack_m: f64) -> [Vec<DVec2>; 2] {
    let along = (q - p).normalize_or_zero();
    let side = |r: DVec2| along.perp_dot(r - p);
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for (k, &a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let (x, y) = (side(a), side(b));
        if x >= -slack_m {
            left.push(a);
        }
        if x <= slack_m {
            right.push(a);
        }
        if (x > slack_m && y < -slack_m) || (x < -slack_m && y > slack_m) {
            let cut = a + (b - a) * (x / (x - y));
            left.push(cut);
            right.push(cut);
        }
    }
    [left, right]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLACK_M: f64 = 1e-6;

    fn rectangle() -> Vec<DVec2> {
        [(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)].map(|(x, y)| DVec2::new(x, y)).to_vec()
    }

    fn across(x: f64, from: f64, to: f64) -> Segment {
        [DVec2::new(x, from), DVec2::new(x, to)]
    }

    #[test]
    fn a_line_is_clipped_and_one_along_an_edge_is_none() {
        let found = segment_within(&rectangle(), across(2.0, -1.0, 9.0), SLACK_M).unwrap();
        assert_eq!(found, across(2.0, 0.0, 4.0));
        assert_eq!(segment_within(&rectangle(), across(6.0, 1.0, 3.0), SLACK_M), None);
        assert_eq!(segment_within(&rectangle(), across(7.0, 1.0, 3.0), SLACK_M), None);
    }

    /// A wall with a door: two segments on one line, neither of which covers half of the chord.
    #[test]
    fn segments_on_one_line_count_together() {
        let wall = [across(2.0, 0.0, 1.5), across(2.0, 2.4, 4.0), across(2.0, 2.4, 4.0)];
        let [one, two] = cut_along(&rectangle(), &wall, 0.6, SLACK_M).unwrap();
        assert!(
            (polygon_area(&one) - 8.0).abs() < 1e-12 && (polygon_area(&two) - 16.0).abs() < 1e-12
        );
        assert_eq!(cut_along(&rectangle(), &wall, 0.8, SLACK_M), None);
        assert_eq!(cut_along(&rectangle(), &wall[..1], 0.6, SLACK_M), None);
    }

    #[test]
    fn a_cut_through_corners_makes_triangles() {
        let diagonal = [[DVec2::ZERO, DVec2::new(6.0, 4.0)]];
        let [one, two] = cut_along(&rectangle(), &diagonal, 0.5, SLACK_M).unwrap();
        assert_eq!((one.len(), two.len()), (3, 3));
    }
}
