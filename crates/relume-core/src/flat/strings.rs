//! Hottel's crossed strings: what two segments exchange, and how much of it gets past others.
//!
//! H. Hottel, "Radiant heat transmission", in W. McAdams, Heat Transmission, 3rd edition, 1954. From a
//! point x of a, what lies between two directions at angles s < t from a's normal receives the share
//! (sin t - sin s) / 2; the sine of the direction to a fixed point u, integrated along a, is the
//! difference of two distances to u, which are the strings. See docs/flatland.md.

use glam::DVec2;

use super::plane::{Segment, rounding};
use super::tuning::WIDER;

/// The region between the parts of two segments that face each other: a convex quadrilateral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// The part of the first that is in front of the second.
    pub a: Segment,
    /// The part of the second that is in front of the first.
    pub b: Segment,
    /// What counts as rounding, m.
    rounding_m: f64,
}

impl Shaft {
    /// `None` if the segments do not face each other.
    pub fn new(a: &Segment, b: &Segment) -> Option<Shaft> {
        let rounding_m = rounding(a, b);
        // Which points of b are in front does not depend on the point of a, and the other way round.
        let facing_a = a.in_front_of(b, 0.0)?;
        let facing_b = b.in_front_of(a, 0.0)?;
        let clear = |of: &Segment, line: &Segment| {
            line.distance(of.start).max(line.distance(of.end)) > rounding_m
        };
        let faces = clear(&facing_a, b) && clear(&facing_b, a);
        faces.then_some(Shaft { a: facing_a, b: facing_b, rounding_m })
    }

    /// Whether a segment has a part inside, beyond rounding. Only such a segment blocks.
    pub fn is_entered_by(&self, other: &Segment) -> bool {
        self.inside(other, self.rounding_m)
    }

    /// Whether a segment may enter this shaft or any within it: true for all that
    /// [`Shaft::is_entered_by`] says so of, there too.
    pub fn may_be_entered_by(&self, other: &Segment) -> bool {
        self.inside(other, -WIDER * self.rounding_m)
    }

    fn inside(&self, other: &Segment, least: f64) -> bool {
        let Shaft { a, b, .. } = self;
        let edges = [
            *a,
            Segment { start: a.end, end: b.start },
            *b,
            Segment { start: b.end, end: a.start },
        ];
        let mut left = *other;
        for edge in edges.iter().filter(|e| e.length() > self.rounding_m) {
            match left.in_front_of(edge, least) {
                Some(part) => left = part,
                None => return false,
            }
        }
        true
    }

    /// Exchange area without occlusion, m: the crossed strings less the uncrossed ones, halved.
    /// Exact up to rounding relative to the shorter segment times the distance over the shorter one.
    pub fn exchange(&self) -> f64 {
        let Shaft { a, b, .. } = self;
        // Differences of two strings from one point, without cancellation.
        let (along, twice) = (b.along(), b.start + b.end);
        let strings = |x: DVec2| {
            let (to_start, to_end) = ((x - b.start).length(), (x - b.end).length());
            along.dot(2.0 * x - twice) / (to_start + to_end)
        };
        (0.5 * (strings(a.start) - strings(a.end))).max(0.0)
    }

    /// Exchange area past opaque segments, m, any number of them and overlapping as they like; and in
    /// how many pieces a was summed.
    ///
    /// a is cut where the order of the ends of b and of the blockers changes as seen from it. On each
    /// piece one set of gaps is seen, each between two fixed points: the strings of each are exact. Cost:
    /// with k blockers at most about 2 k^2 pieces of k log k.
    pub fn exchange_past(&self, blockers: &[Segment]) -> (f64, u32) {
        let Shaft { a, b, rounding_m } = self;
        let length = a.length();
        let along = a.along() / length;
        // Along a, and away from it.
        let seen = |p: DVec2| {
            let d = p - a.start;
            DVec2::new(d.dot(along), along.perp_dot(d).max(0.0))
        };
        let in_between = |blocker: &Segment| {
            let part = blocker.in_front_of(a, *rounding_m)?.in_front_of(b, *rounding_m)?;
            Some((seen(part.start), seen(part.end)))
        };
        let blockers: Vec<(DVec2, DVec2)> = blockers.iter().filter_map(in_between).collect();
        // b begins on the right and ends on the left.
        let window = (seen(b.end), seen(b.start));
        let cuts = cuts(length, &blockers, window);
        let mut sum = 0.0;
        let mut gaps = Vec::new();
        for piece in cuts.windows(2) {
            visible(0.5 * (piece[0] + piece[1]), &blockers, window, &mut gaps);
            let strings = |p: DVec2| sine(p, piece[0], piece[1]);
            sum += gaps.iter().map(|&(lo, hi)| strings(hi) - strings(lo)).sum::<f64>();
        }
        ((0.5 * sum).max(0.0), cuts.len() as u32 - 1)
    }
}

/// The sine of the direction from x to p, seen from the normal, integrated over x from `x0` to `x1`.
fn sine(p: DVec2, x0: f64, x1: f64) -> f64 {
    let distance = |x: f64| DVec2::new(p.x - x, p.y).length();
    let both = distance(x0) + distance(x1);
    if both > 0.0 { (x1 - x0) * (2.0 * p.x - x0 - x1) / both } else { 0.0 }
}

/// Where the order of any two of the points as seen from a changes, from 0 to the length, ascending.
fn cuts(length: f64, blockers: &[(DVec2, DVec2)], window: (DVec2, DVec2)) -> Vec<f64> {
    let ends = blockers.iter().flat_map(|&(p, q)| [p, q]);
    let points: Vec<DVec2> = ends.chain([window.0, window.1]).collect();
    let mut cuts = vec![0.0, length];
    for (k, u) in points.iter().enumerate() {
        for v in &points[k + 1..] {
            let rise = v.y - u.y;
            let x = u.x - u.y * (v.x - u.x) / rise;
            if rise != 0.0 && x > 0.0 && x < length {
                cuts.push(x);
            }
        }
    }
    cuts.sort_unstable_by(f64::total_cmp);
    cuts.dedup();
    cuts
}

/// The gaps that are left of a window as seen from a point of a, from left to right.
fn visible(
    x: f64,
    blockers: &[(DVec2, DVec2)],
    window: (DVec2, DVec2),
    gaps: &mut Vec<(DVec2, DVec2)>,
) {
    let slope = |p: DVec2| (p.x - x) / p.y;
    let mut hidden: Vec<(DVec2, DVec2)> =
        blockers.iter().map(|&(p, q)| if slope(p) <= slope(q) { (p, q) } else { (q, p) }).collect();
    hidden.sort_unstable_by(|one, two| slope(one.0).total_cmp(&slope(two.0)));
    gaps.clear();
    let mut from = window.0;
    for (lo, hi) in hidden {
        if slope(lo) > slope(from) {
            let to = if slope(lo) < slope(window.1) { lo } else { window.1 };
            if slope(from) < slope(to) {
                gaps.push((from, to));
            }
        }
        if slope(hi) > slope(from) {
            from = hi;
        }
    }
    if slope(from) < slope(window.1) {
        gaps.push((from, window.1));
    }
}

/// Exchange area of two segments by crossed strings, m: `a.length()` times the form factor from a to b. 0
/// if they do not face each other.
pub fn exchange(a: &Segment, b: &Segment) -> f64 {
    Shaft::new(a, b).map_or(0.0, |shaft| shaft.exchange())
}

/// The same past opaque segments, seen from either side.
pub fn visible_exchange(a: &Segment, b: &Segment, blockers: &[Segment]) -> f64 {
    Shaft::new(a, b).map_or(0.0, |shaft| shaft.exchange_past(blockers).0)
}
