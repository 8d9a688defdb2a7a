//! Small convex polygons in space, clipped by planes.

use glam::{DVec2, DVec3};

/// An oriented plane: `normal . x = offset`; the front is where the left side is larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: DVec3,
    /// Signed distance of the origin's foot along the normal, metres.
    pub offset: f64,
}

impl Plane {
    /// The plane through `point` with unit `normal`.
    #[inline]
    pub fn through(point: DVec3, normal: DVec3) -> Plane {
        Plane { normal, offset: normal.dot(point) }
    }

    /// Signed distance of a point, metres; positive in front.
    #[inline]
    pub fn distance(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }
}

const CAPACITY: usize = 16;

/// A convex planar polygon in space with up to 16 corners, on the stack.
#[derive(Clone, Copy, Debug)]
pub struct ConvexPolygon {
    corners: [DVec3; CAPACITY],
    len: usize,
}

impl ConvexPolygon {
    /// Corners there is room for: a quadrilateral cut by a dozen planes.
    pub const CAPACITY: usize = CAPACITY;

    /// Corners a polygon may start with, so that it can still be cut.
    pub const START_MAX: usize = 12;

    /// A polygon from its corners in order.
    ///
    /// # Panics
    /// With more than 16 corners.
    pub fn new(corners: &[DVec3]) -> ConvexPolygon {
        let mut out = ConvexPolygon { corners: [DVec3::ZERO; CAPACITY], len: corners.len() };
        out.corners[..corners.len()].copy_from_slice(corners);
        out
    }

    /// Its corners in order; fewer than three where nothing is left.
    #[inline]
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..self.len]
    }

    /// The part in front of `plane`: [`ConvexPolygon::part`] of this polygon.
    pub fn clipped(&self, plane: &Plane, slack_m: f64) -> ConvexPolygon {
        ConvexPolygon::part(self.corners(), plane, slack_m)
    }

    /// The part in front of `plane` of a polygon with some corners (Sutherland & Hodgman 1974); corners within `slack_m` of the
    /// plane count as on it and are kept.
    pub fn part(corners: &[DVec3], plane: &Plane, slack_m: f64) -> ConvexPolygon {
        let mut out = ConvexPolygon { corners: [DVec3::ZERO; CAPACITY], len: 0 };
        let heights = corners.iter().map(|&c| (c, plane.distance(c)));
        let Some((mut p, mut dp)) = heights.clone().next() else { return out };
        for (q, dq) in heights.skip(1).chain([(p, dp)]) {
            if dp >= -slack_m {
                out.push(p);
            }
            if (dp > slack_m && dq < -slack_m) || (dp < -slack_m && dq > slack_m) {
                out.push(p + (q - p) * (dp / (dp - dq)));
            }
            (p, dp) = (q, dq);
        }
        out
    }

    /// The parts in front of and behind `plane`; either may be empty.
    pub fn split(&self, plane: &Plane) -> [ConvexPolygon; 2] {
        let none = ConvexPolygon { corners: [DVec3::ZERO; CAPACITY], len: 0 };
        let (mut front, mut back) = (none, none);
        if self.len < 3 {
            return [front, back];
        }
        let mut p = self.corners[self.len - 1];
        let mut dp = plane.distance(p);
        for &q in self.corners() {
            let dq = plane.distance(q);
            if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                let x = p + (q - p) * (dp / (dp - dq));
                front.push(x);
                back.push(x);
            }
            if dq >= 0.0 {
                front.push(q);
            }
            if dq <= 0.0 {
                back.push(q);
            }
            (p, dp) = (q, dq);
        }
        [front, back]
    }

    fn push(&mut self, p: DVec3) {
        if self.len < CAPACITY {
            self.corners[self.len] = p;
            self.len += 1;
        }
    }

    /// Twice the vector area (right-hand rule), m2.
    pub fn area_vector2(&self) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for i in 1..self.len.saturating_sub(1) {
            let e = self.corners[i] - self.corners[0];
            sum += e.cross(self.corners[i + 1] - self.corners[0]);
        }
        sum
    }

    /// Area, m2.
    pub fn area(&self) -> f64 {
        self.area_vector2().length() * 0.5
    }
}

/// Splits a convex polygon with more than four corners along the chord that makes the two parts
/// most alike in area and most compact; returns the corner ranges `[i..=j]` and `[j..=i]`.
///
/// # Panics
/// With fewer than five corners.
pub fn split_convex(corners: &[DVec2]) -> [Vec<DVec2>; 2] {
    let n = corners.len();
    assert!(n >= 5, "a polygon of {n} corners is not split by a chord");
    let mut best = (f64::INFINITY, 0, 2);
    for i in 0..n {
        for j in i + 2..n {
            if i == 0 && j == n - 1 {
                continue;
            }
            let [a, b] = parts(corners, i, j).map(|part| 2.0 * polygon_area(&part));
            // Uneven areas and long chords both cost.
            let cost = (a - b).abs() + (corners[i] - corners[j]).length_squared();
            if cost < best.0 {
                best = (cost, i, j);
            }
        }
    }
    parts(corners, best.1, best.2)
}

fn parts(corners: &[DVec2], i: usize, j: usize) -> [Vec<DVec2>; 2] {
    let two = corners[j..].iter().chain(&corners[..=i]).copied().collect();
    [corners[i..=j].to_vec(), two]
}

/// Area of a polygon by the shoelace formula, in the square of its unit; exact up to rounding.
pub fn polygon_area(corners: &[DVec2]) -> f64 {
    let n = corners.len();
    (0..n).map(|i| corners[i].perp_dot(corners[(i + 1) % n])).sum::<f64>() * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipping_a_square_keeps_the_part_in_front() {
        let square =
            ConvexPolygon::new(&[DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
        let plane = Plane::through(DVec3::new(0.25, 0.0, 0.0), DVec3::X);
        assert!((square.clipped(&plane, 0.0).area() - 0.75).abs() < 1e-15);
        let behind = Plane::through(DVec3::X * 2.0, DVec3::X);
        assert!(square.clipped(&behind, 0.0).corners().is_empty());
    }

    #[test]
    fn a_polygon_splits_into_parts_of_its_area() {
        let disc: Vec<DVec2> = (0..32)
            .map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 32.0))
            .collect();
        let [one, two] = split_convex(&disc);
        assert!((polygon_area(&one) + polygon_area(&two) - polygon_area(&disc)).abs() < 1e-14);
        assert!((polygon_area(&one) / polygon_area(&disc) - 0.5).abs() < 0.05);
    }
}
