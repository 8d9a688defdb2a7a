//! Regions of a plane as disjoint convex polygons: common parts, differences, moments, and outlines filled.

use std::ops::{Add, Mul, Sub};

use glam::DVec2;

use super::{Segment, polygon_area};

/// Area of a region, and its first and second moments about the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Area, m2.
    pub area: f64,
    /// Integral of (x, y), m3.
    pub first: DVec2,
    /// Integral of (x x, x y, y y), m4.
    pub second: [f64; 3],
}

impl Moments {
    /// Those of a convex polygon, counter-clockwise; exact up to rounding.
    pub fn of(polygon: &[DVec2]) -> Moments {
        let mut out = Moments::default();
        for k in 1..polygon.len().max(1) - 1 {
            let [a, b, c] = [polygon[0], polygon[k], polygon[k + 1]];
            let area = 0.5 * (b - a).perp_dot(c - a);
            let sum = a + b + c;
            let product = |f: fn(DVec2) -> f64| area / 12.0 * (f(a) + f(b) + f(c) + f(sum));
            out.area += area;
            out.first += sum * (area / 3.0);
            let second = [product(|p| p.x * p.x), product(|p| p.x * p.y), product(|p| p.y * p.y)];
            (0..3).for_each(|k| out.second[k] += second[k]);
        }
        out
    }

    /// Of a region without a part of it.
    pub fn without(mut self, part: &Moments) -> Moments {
        self.area -= part.area;
        self.first -= part.first;
        (0..3).for_each(|k| self.second[k] -= part.second[k]);
        self
    }

    /// Centroid, and the mean of (x x, x y, y y) about it, m2.
    pub fn about_centroid(&self) -> (DVec2, [f64; 3]) {
        let c = self.first / self.area;
        let [xx, xy, yy] = self.second.map(|s| s / self.area);
        (c, [xx - c.x * c.x, xy - c.x * c.y, yy - c.y * c.y])
    }
}

/// What two convex polygons, counter-clockwise, have in common; empty if nothing.
pub fn common(polygon: &[DVec2], other: &[DVec2]) -> Vec<DVec2> {
    let mut rest = polygon.to_vec();
    for (a, edge) in edges(other) {
        rest = left_of(&rest, a, edge);
        if rest.len() < 3 {
            return Vec::new();
        }
    }
    rest
}

/// Adds the convex parts of a polygon that are not in another to `out`. All are convex, counter-clockwise.
pub fn difference(polygon: &[DVec2], other: &[DVec2], out: &mut Vec<Vec<DVec2>>) {
    let mut rest = polygon.to_vec();
    let first = out.len();
    for (a, edge) in edges(other) {
        let outside = left_of(&rest, a, -edge);
        if outside.len() > 2 {
            out.push(outside);
        }
        rest = left_of(&rest, a, edge);
        if rest.len() < 3 {
            // They have nothing in common.
            out.truncate(first);
            return out.push(polygon.to_vec());
        }
    }
}

/// The region within outlines, as disjoint convex polygons, counter-clockwise: each piece of an outline has the inside on its
/// left, and what several go around is in the region once. Outlines that cross each other are taken as if they crossed at
/// the next corner. Points closer along x than `slack_m` are one. Cost: the square of the pieces.
pub fn within_outlines(outlines: &[Segment], slack_m: f64) -> Vec<Vec<DVec2>> {
    let hull = hull(outlines);
    let signed: f64 = outlines.iter().map(|[p, q]| 0.5 * p.perp_dot(*q)).sum();
    let whole = polygon_area(&hull);
    if hull.len() > 2 && (signed - whole).abs() <= 1e-6 * whole {
        return vec![hull];
    }
    let mut stops: Vec<f64> = outlines.iter().flatten().map(|p| p.x).collect();
    stops.sort_by(f64::total_cmp);
    stops.dedup_by(|x, y| (*x - *y).abs() <= slack_m);
    let mut out = Vec::new();
    for stop in stops.windows(2) {
        add_strip(outlines, [stop[0], stop[1]], &mut out);
    }
    out
}

/// Adds what is within outlines between two abscissae, at neither of which any piece begins or ends in between.
fn add_strip(outlines: &[Segment], [from, to]: [f64; 2], out: &mut Vec<Vec<DVec2>>) {
    let middle = 0.5 * (from + to);
    let at = |[p, q]: &Segment, x: f64| p.y + (q.y - p.y) * ((x - p.x) / (q.x - p.x));
    let spans = |s: &&Segment| s[0].x.min(s[1].x) < middle && s[0].x.max(s[1].x) > middle;
    let mut across: Vec<&Segment> = outlines.iter().filter(spans).collect();
    across.sort_by(|s, t| at(s, middle).total_cmp(&at(t, middle)));
    let (mut depth, mut floor) = (0_i32, None);
    for s in across {
        let before = depth;
        // What runs to the right has the inside above it.
        depth += if s[1].x > s[0].x { 1 } else { -1 };
        if before <= 0 && depth > 0 {
            floor = Some(s);
        } else if before > 0
            && depth <= 0
            && let Some(floor) = floor.take()
        {
            let point = |s: &Segment, x: f64| DVec2::new(x, at(s, x));
            out.push(vec![point(floor, from), point(floor, to), point(s, to), point(s, from)]);
        }
    }
}

/// Convex hull of the ends of some lines, counter-clockwise (monotone chain).
fn hull(lines: &[Segment]) -> Vec<DVec2> {
    let mut points: Vec<DVec2> = lines.iter().flatten().copied().collect();
    points.sort_by(|p, q| p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)));
    points.dedup();
    let chain = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut out: Vec<DVec2> = Vec::new();
        for &p in points {
            while let [.., a, b] = out[..]
                && (b - a).perp_dot(p - b) <= 0.0
            {
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    let mut out = chain(&mut points.iter());
    out.extend(chain(&mut points.iter().rev()));
    out
}

/// Start and direction of each edge; the inside is on the left.
fn edges(polygon: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    (0..polygon.len()).map(|k| (polygon[k], polygon[(k + 1) % polygon.len()] - polygon[k]))
}

/// The part of a convex polygon on the left of a line through `a`.
fn left_of(polygon: &[DVec2], a: DVec2, along: DVec2) -> Vec<DVec2> {
    part_in_front(polygon, |p| along.perp_dot(p - a))
}

/// The part of a convex polygon, in the plane or in space, where a linear function of the place is not negative; empty if it
/// is negative everywhere. Exact up to rounding.
pub fn part_in_front<P>(polygon: &[P], height: impl Fn(P) -> f64) -> Vec<P>
where
    P: Copy + Add<Output = P> + Sub<Output = P> + Mul<f64, Output = P>,
{
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (x, y) = (height(p), height(q));
        if x >= 0.0 {
            out.push(p);
        }
        if (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0) {
            out.push(p + (q - p) * (x / (x - y)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x: f64, y: f64, to_x: f64, to_y: f64) -> Vec<DVec2> {
        [(x, y), (to_x, y), (to_x, to_y), (x, to_y)].map(|(x, y)| DVec2::new(x, y)).to_vec()
    }

    fn outline(polygon: &[DVec2]) -> Vec<Segment> {
        (0..polygon.len()).map(|k| [polygon[k], polygon[(k + 1) % polygon.len()]]).collect()
    }

    fn area(parts: &[Vec<DVec2>]) -> f64 {
        parts.iter().map(|p| Moments::of(p).area).sum()
    }

    #[test]
    fn common_part_and_difference_make_up_the_whole() {
        let (one, other) = (rectangle(0.0, 0.0, 4.0, 3.0), rectangle(3.0, 1.0, 6.0, 2.0));
        assert!((Moments::of(&common(&one, &other)).area - 1.0).abs() < 1e-12);
        let mut rest = Vec::new();
        difference(&one, &other, &mut rest);
        assert!((area(&rest) - 11.0).abs() < 1e-12);
        let mut whole = Vec::new();
        difference(&one, &rectangle(5.0, 0.0, 6.0, 1.0), &mut whole);
        assert_eq!(whole, [one]);
    }

    #[test]
    fn moments_of_what_is_left_are_those_of_the_parts() {
        let whole = Moments::of(&rectangle(0.0, 0.0, 4.0, 2.0));
        let rest = whole.without(&Moments::of(&rectangle(2.0, 0.0, 4.0, 2.0)));
        let (centroid, [xx, xy, yy]) = rest.about_centroid();
        assert!(centroid.distance(DVec2::ONE) < 1e-12);
        assert!((xx - 1.0 / 3.0).abs() + xy.abs() + (yy - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn outlines_are_filled_without_their_holes_and_once() {
        let (outer, mut hole) = (rectangle(0.0, 0.0, 4.0, 3.0), rectangle(1.0, 1.0, 2.0, 2.0));
        assert_eq!(within_outlines(&outline(&outer), 1e-9).len(), 1);
        hole.reverse();
        let mut ring = outline(&outer);
        ring.extend(outline(&hole));
        assert!((area(&within_outlines(&ring, 1e-9)) - 11.0).abs() < 1e-12);
        // Inside out is nothing.
        let inverse: Vec<Segment> = outline(&outer).iter().map(|[p, q]| [*q, *p]).collect();
        assert!(within_outlines(&inverse, 1e-9).is_empty());
        let mut twice = outline(&outer);
        twice.extend(outline(&rectangle(0.5, 0.5, 2.0, 2.0)));
        assert!((area(&within_outlines(&twice, 1e-9)) - 12.0).abs() < 1e-12);
    }
}
