//! How a quadrilateral or triangle is split into well-shaped children.

use super::tuning::{ELONGATED, SEAM_PART, SEAM_SHARE, SLENDER};
use crate::geometry::Segment;
use glam::{DVec2, DVec3};

/// Corners of an element in its patch's frame, metres, and whether there are three or four; a
/// triangle repeats its last corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Corners, counter-clockwise.
    pub corners: [DVec2; 4],
    /// Three or four.
    pub len: usize,
}

/// Whether two boxes in a plane, by lowest and highest coordinates, have an inner point in common.
#[inline]
pub(super) fn overlap([lo, hi]: &[DVec2; 2], [low, high]: &[DVec2; 2]) -> bool {
    low.cmplt(*hi).all() && lo.cmplt(*high).all()
}

impl Shape {
    /// A shape from three or four corners.
    pub fn new(corners: &[DVec2]) -> Shape {
        let last = corners[corners.len() - 1];
        let corner = |k: usize| corners.get(k).copied().unwrap_or(last);
        Shape { corners: [corner(0), corner(1), corner(2), corner(3)], len: corners.len() }
    }

    /// Lowest and highest coordinates, metres.
    pub fn bounds(&self) -> [DVec2; 2] {
        let with = |[lo, hi]: [DVec2; 2], &p: &DVec2| [lo.min(p), hi.max(p)];
        self.corners.iter().fold([DVec2::INFINITY, DVec2::NEG_INFINITY], with)
    }

    /// Whether the box around it and another have an inner point in common.
    pub fn meets(&self, other: &[DVec2; 2]) -> bool {
        overlap(&self.bounds(), other)
    }

    /// Area, m2: half the cross product of the diagonals, which holds for a triangle with its last
    /// corner repeated too.
    pub fn area(&self) -> f64 {
        let c = &self.corners;
        (c[2] - c[0]).perp_dot(c[3] - c[1]) * 0.5
    }

    /// Centroid, metres.
    pub fn centroid(&self) -> DVec2 {
        let [a, b, c, d] = self.corners;
        let (one, two) = ((b - a).perp_dot(c - a), (c - a).perp_dot(d - a));
        a + ((b - a) + (c - a)) * (one / (3.0 * (one + two)))
            + ((c - a) + (d - a)) * (two / (3.0 * (one + two)))
    }

    /// Mean of (x x, x y, y y) about the centroid, m2: exact for parallelograms and triangles.
    pub fn second_moment(&self) -> [f64; 3] {
        let [a, b, c, d] = self.corners;
        if self.len == 3 {
            let m = self.centroid();
            let sum = |f: fn(DVec2) -> f64| (f(a - m) + f(b - m) + f(c - m)) / 12.0;
            return [sum(|v| v.x * v.x), sum(|v| v.x * v.y), sum(|v| v.y * v.y)];
        }
        let (e, f) = ((b + c - a - d) * 0.5, (c + d - a - b) * 0.5);
        [e.x * e.x + f.x * f.x, e.x * e.y + f.x * f.y, e.y * e.y + f.y * f.y].map(|v| v / 12.0)
    }

    /// [`Shape::second_moment`], m2, exact for any quadrilateral: that of two triangles.
    pub fn exact_second_moment(&self) -> [f64; 3] {
        let [a, b, c, d] = self.corners.map(|c| c - self.centroid());
        let (one, two) = ((b - a).perp_dot(c - a), (c - a).perp_dot(d - a));
        let of = |f: fn(DVec2, DVec2) -> f64| {
            let mean = |p: DVec2, q: DVec2, r: DVec2| {
                let s = p + q + r;
                (f(p, p) + f(q, q) + f(r, r) + f(s, s)) / 12.0
            };
            (one * mean(a, b, c) + two * mean(a, c, d)) / (one + two)
        };
        [of(|p, q| p.x * q.x), of(|p, q| p.x * q.y), of(|p, q| p.y * q.y)]
    }

    /// Centroid, radius and second moment at once.
    pub fn extent(&self) -> Extent {
        let centroid = self.centroid();
        let reach2 = |c: &DVec2| (*c - centroid).length_squared();
        let radius = self.corners.iter().map(reach2).fold(0.0, f64::max).sqrt();
        Extent { centroid, radius, second_moment: self.second_moment() }
    }

    /// How this shape is cut so that its children are well shaped.
    pub(super) fn cut(&self) -> Cut {
        if self.len == 3 { self.triangle_cut() } else { self.quad_cut() }
    }

    fn quad_cut(&self) -> Cut {
        let [a, b, c, d] = self.corners;
        let (ab, bc, cd, da) = ((a + b) * 0.5, (b + c) * 0.5, (c + d) * 0.5, (d + a) * 0.5);
        let along = (bc - da).length();
        let across = (cd - ab).length();
        if along > ELONGATED * across {
            Cut::AcrossS
        } else if across > ELONGATED * along {
            Cut::AcrossT
        } else {
            Cut::Quarters
        }
    }

    fn triangle_cut(&self) -> Cut {
        let [a, b, c, _] = self.corners;
        let edges = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
        let longest = (0..3).fold(0, |m, k| if edges[k] > edges[m] { k } else { m });
        if edges[longest] > SLENDER * self.area() { Cut::Edge(longest) } else { Cut::Quarters }
    }
}

/// Where an element lies in its patch's frame, and how far it reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Centroid, metres.
    pub centroid: DVec2,
    /// Largest distance of a corner from the centroid, metres.
    pub radius: f64,
    /// Mean of (x x, x y, y y) about the centroid, m2.
    pub second_moment: [f64; 3],
}

/// Ways to cut an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// In four.
    Quarters,
    /// A quadrilateral in two, dividing its first parameter.
    AcrossS,
    /// A quadrilateral in two, dividing its second parameter.
    AcrossT,
    /// A triangle in two, from the middle of this edge.
    Edge(usize),
}

/// Where an element lies within its facet, in steps of 2^-15 of the facet's parameters: two
/// opposite corners (s0, t0, s1, t1) in a quadrilateral, all three in a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place([u16; 6]);

/// Steps in one.
const ONE: u16 = 1 << 15;

impl Place {
    /// The whole of a quadrilateral.
    pub(super) const WHOLE: Place = Place([0, 0, ONE, ONE, 0, 0]);

    /// The whole facet.
    pub(super) fn whole(corner_count: usize) -> Place {
        if corner_count == 3 { Place([0, 0, ONE, 0, 0, ONE]) } else { Place::WHOLE }
    }

    /// Parameters of the corners; a triangle repeats its last.
    #[inline]
    pub(super) fn corners(&self, corner_count: usize) -> [DVec2; 4] {
        let at = |k: usize| f64::from(self.0[k]) * (1.0 / ONE as f64);
        let [a, b, c, d, e, f] = [at(0), at(1), at(2), at(3), at(4), at(5)];
        let v = DVec2::new;
        if corner_count == 3 {
            [v(a, b), v(c, d), v(e, f), v(e, f)]
        } else {
            [v(a, b), v(c, b), v(c, d), v(a, d)]
        }
    }

    /// Whether an element here is wide enough to be divided either way.
    pub(super) fn is_divisible(&self, corner_count: usize) -> bool {
        let [s0, t0, s1, t1, ..] = self.0;
        corner_count == 3 || (s1 - s0 >= 2 && t1 - t0 >= 2)
    }

    /// Places of the children, in canonical order. A quadrilateral is divided along lines of contact where they suit, else in
    /// the middle.
    pub(super) fn children(
        &self,
        corner_count: usize,
        cut: Cut,
        seams: &[Seam],
    ) -> ([Place; 4], usize) {
        if corner_count == 3 { self.triangle_children(cut) } else { self.quad_children(cut, seams) }
    }

    /// Where one parameter (0, 1) of a quadrilateral is divided: along the seam that runs over most of it, near its middle.
    fn divide(&self, axis: usize, seams: &[Seam]) -> u16 {
        let [lo, hi] = [self.0[axis], self.0[axis + 2]];
        let [from, to] = [self.0[1 - axis], self.0[3 - axis]];
        let (width, across) = (f64::from(hi - lo), f64::from(to - from));
        let suits = |seam: &&Seam| {
            let part = seam.at.saturating_sub(lo).min(hi.saturating_sub(seam.at));
            seam.axis == axis
                && f64::from(part) >= SEAM_PART * width
                && f64::from(seam.overlap(from, to)) >= SEAM_SHARE * across
        };
        let score = |seam: &Seam| {
            u64::from(seam.overlap(from, to)) * u64::from((seam.at - lo).min(hi - seam.at))
        };
        // The first of several that are as good.
        let best = seams.iter().filter(suits).rev().max_by_key(|seam| score(seam));
        best.map_or(middle(lo, hi), |seam| seam.at)
    }

    fn quad_children(&self, cut: Cut, seams: &[Seam]) -> ([Place; 4], usize) {
        let [s0, t0, s1, t1, ..] = self.0;
        let (s, t) = (self.divide(0, seams), self.divide(1, seams));
        let place = |s0, t0, s1, t1| Place([s0, t0, s1, t1, 0, 0]);
        match cut {
            Cut::AcrossS => {
                let two = [place(s0, t0, s, t1), place(s, t0, s1, t1)];
                ([two[0], two[1], two[1], two[1]], 2)
            }
            Cut::AcrossT => {
                let two = [place(s0, t0, s1, t), place(s0, t, s1, t1)];
                ([two[0], two[1], two[1], two[1]], 2)
            }
            Cut::Quarters | Cut::Edge(_) => (
                [
                    place(s0, t0, s, t),
                    place(s, t0, s1, t),
                    place(s, t, s1, t1),
                    place(s0, t, s, t1),
                ],
                4,
            ),
        }
    }

    fn triangle_children(&self, cut: Cut) -> ([Place; 4], usize) {
        let [a0, a1, b0, b1, c0, c1] = self.0;
        let corners = [[a0, a1], [b0, b1], [c0, c1]];
        let half = |k: usize, l: usize| [0, 1].map(|x| middle(corners[k][x], corners[l][x]));
        let place =
            |p: [u16; 2], q: [u16; 2], r: [u16; 2]| Place([p[0], p[1], q[0], q[1], r[0], r[1]]);
        if let Cut::Edge(k) = cut {
            let (p, q, r) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            let m = half(k, (k + 1) % 3);
            let two = [place(p, m, r), place(m, q, r)];
            return ([two[0], two[1], two[1], two[1]], 2);
        }
        let [a, b, c] = corners;
        let (ab, bc, ca) = (half(0, 1), half(1, 2), half(2, 0));
        ([place(a, ab, ca), place(ab, b, bc), place(ca, bc, c), place(bc, ca, ab)], 4)
    }
}

/// Exact where nothing was divided along a seam: after n of at most 15 cuts all parameters are multiples of 2^(15 - n) steps.
fn middle(x: u16, y: u16) -> u16 {
    ((u32::from(x) + u32::from(y)) / 2) as u16
}

/// A line of contact along which one parameter of a facet is constant, in steps of 2^-15.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Seam {
    /// Which parameter: 0 or 1.
    axis: usize,
    /// Its value.
    at: u16,
    /// Where the line begins and ends, in the other parameter.
    from: u16,
    to: u16,
}

impl Seam {
    /// How much of a range of the other parameter it runs over, steps.
    fn overlap(&self, from: u16, to: u16) -> u16 {
        self.to.min(to).saturating_sub(self.from.max(from))
    }
}

/// The map from a facet's parameters to its patch's frame: `origin + e s + f t + g s t`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chart {
    origin: DVec2,
    e: DVec2,
    f: DVec2,
    g: DVec2,
    /// Corners of the facet.
    pub(super) len: usize,
}

impl Chart {
    /// The chart of a facet.
    pub(super) fn of(facet: &Shape) -> Chart {
        let [a, b, c, d] = facet.corners;
        let (e, f, g) = match facet.len {
            3 => (b - a, c - a, DVec2::ZERO),
            _ => (b - a, d - a, (a - b) + (c - d)),
        };
        // What is left of the twist of a parallelogram is rounding.
        let even = g.length_squared() <= 1e-24 * (e.length_squared() + f.length_squared());
        Chart { origin: a, e, f, g: if even { DVec2::ZERO } else { g }, len: facet.len }
    }

    /// Lines of contact along which elements of the facet can be divided: within it, parallel to its sides. None in triangles, and
    /// in quadrilaterals that are no parallelograms.
    pub(super) fn seams(&self, lines: &[Segment]) -> Vec<Seam> {
        let det = self.e.perp_dot(self.f);
        if self.len == 3 || self.g != DVec2::ZERO || det == 0.0 {
            return Vec::new();
        }
        let one = f64::from(ONE);
        let steps = |p: DVec2| {
            let d = p - self.origin;
            [d.perp_dot(self.f) / det * one, self.e.perp_dot(d) / det * one]
        };
        let inner = |x: f64| x.round().clamp(0.0, one) as u16;
        let of_axis = |[p, q]: [[f64; 2]; 2], axis: usize| {
            let at = inner(0.5 * (p[axis] + q[axis]));
            let [from, to] = [p, q].map(|end| end[1 - axis]);
            let is_parallel = (p[axis] - q[axis]).abs() <= 1.0;
            let seam = Seam { axis, at, from: inner(from.min(to)), to: inner(from.max(to)) };
            (is_parallel && (1..ONE).contains(&at) && seam.from < seam.to).then_some(seam)
        };
        let ends = lines.iter().map(|line| line.map(steps));
        let mut seams: Vec<Seam> =
            ends.flat_map(|ends| [0, 1].map(|axis| of_axis(ends, axis))).flatten().collect();
        seams.sort_unstable();
        seams.dedup();
        seams
    }

    /// Extent of the element at a place; quick for parallelograms.
    #[inline]
    pub(super) fn extent(&self, place: &Place) -> Extent {
        if self.len == 3 || self.g != DVec2::ZERO {
            return self.shape(place).extent();
        }
        let [a, _, c, _] = place.corners(4);
        let (middle, half) = ((a + c) * 0.5, (c - a) * 0.5);
        let (e, f) = (self.e * half.x, self.f * half.y);
        let reach2 = (e + f).length_squared().max((e - f).length_squared());
        let moment = |k: f64, l: f64| (k + l) / 3.0;
        Extent {
            centroid: self.origin + self.e * middle.x + self.f * middle.y,
            radius: reach2.sqrt(),
            second_moment: [
                moment(e.x * e.x, f.x * f.x),
                moment(e.x * e.y, f.x * f.y),
                moment(e.y * e.y, f.y * f.y),
            ],
        }
    }

    /// The element at a place. Neighbours get the same values at shared corners, bit for bit.
    #[inline]
    pub(super) fn shape(&self, place: &Place) -> Shape {
        let at = |p: DVec2| self.origin + self.e * p.x + self.f * p.y + self.g * (p.x * p.y);
        let [a, b, c, d] = place.corners(self.len);
        Shape { corners: [at(a), at(b), at(c), at(d)], len: self.len }
    }
}

/// The point of a quadrilateral at parameters `(s, t)` in the unit square.
#[inline]
pub fn bilinear(c: &[DVec3; 4], s: f64, t: f64) -> DVec3 {
    c[0] * ((1.0 - s) * (1.0 - t))
        + c[1] * (s * (1.0 - t))
        + c[2] * (s * t)
        + c[3] * ((1.0 - s) * t)
}

/// Area vector of a quadrilateral's surface element at `(s, t)`: its length is the Jacobian of
/// [`bilinear`], m2, and it points to the front.
#[inline]
pub fn bilinear_area(c: &[DVec3; 4], s: f64, t: f64) -> DVec3 {
    let ds = (c[1] - c[0]) * (1.0 - t) + (c[2] - c[3]) * t;
    let dt = (c[3] - c[0]) * (1.0 - s) + (c[2] - c[1]) * s;
    ds.cross(dt)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn children(shape: &Shape) -> Vec<Shape> {
        let chart = Chart::of(shape);
        let (places, count) = Place::whole(shape.len).children(shape.len, shape.cut(), &[]);
        places[..count].iter().map(|p| chart.shape(p)).collect()
    }

    fn check_tiling(shape: Shape, count: usize) {
        let children = children(&shape);
        assert_eq!(children.len(), count);
        let sum: f64 = children.iter().map(Shape::area).sum();
        assert!((sum - shape.area()).abs() < 1e-14 * shape.area());
        assert!(children.iter().all(|c| c.area() > 0.0));
    }

    #[test]
    fn children_tile_their_parent() {
        let v = DVec2::new;
        check_tiling(Shape::new(&[v(0., 0.), v(1., 0.), v(1.1, 1.), v(0., 0.9)]), 4);
        check_tiling(Shape::new(&[v(0., 0.), v(3., 0.), v(3., 1.), v(0., 1.)]), 2);
        check_tiling(Shape::new(&[v(0., 0.), v(1., 0.), v(1., 3.), v(0., 3.)]), 2);
        check_tiling(Shape::new(&[v(0., 0.), v(1., 0.), v(0., 1.)]), 4);
        check_tiling(Shape::new(&[v(0., 0.), v(5., 0.), v(0., 0.5)]), 2);
    }

    #[test]
    fn neighbours_share_corners_bit_for_bit_whatever_their_levels() {
        let v = DVec2::new;
        for corners in [
            vec![v(0.3, 0.1), v(1., 0.), v(1.1, 1.), v(0., 0.9)],
            vec![v(-1., 2.), v(3., 2.5), v(0.2, 4.)],
        ] {
            let facet = Shape::new(&corners);
            let chart = Chart::of(&facet);
            let below = |place: &Place| {
                let (places, n) = place.children(facet.len, chart.shape(place).cut(), &[]);
                places[..n].to_vec()
            };
            let halves = below(&Place::whole(facet.len));
            let quarters: Vec<Place> = halves.iter().flat_map(below).collect();
            let all: Vec<DVec2> =
                halves.iter().chain(&quarters).flat_map(|p| chart.shape(p).corners).collect();
            for p in &all {
                for q in all.iter().filter(|q| p.distance(**q) < 1e-9) {
                    assert_eq!(p.to_array().map(f64::to_bits), q.to_array().map(f64::to_bits));
                }
            }
        }
    }

    #[test]
    fn the_chart_meets_the_corners_of_its_facet() {
        let v = DVec2::new;
        for corners in [
            vec![v(0.3, 0.1), v(1., 0.), v(1.1, 1.), v(0., 0.9)],
            vec![v(-1., 2.), v(3., 2.5), v(0.2, 4.)],
        ] {
            let shape = Shape::new(&corners);
            let again = Chart::of(&shape).shape(&Place::whole(shape.len));
            for (p, q) in shape.corners.iter().zip(again.corners) {
                assert!((*p - q).length() < 1e-15, "{p} {q}");
            }
        }
    }

    #[test]
    fn the_quick_extent_is_the_extent() {
        let v = DVec2::new;
        let shape = Shape::new(&[v(0.2, 0.1), v(1.2, 0.3), v(1.5, 1.3), v(0.5, 1.1)]);
        let chart = Chart::of(&shape);
        let (places, _) = Place::whole(4).children(4, Cut::Quarters, &[]);
        for place in places {
            let (one, two) = (chart.extent(&place), chart.shape(&place).extent());
            assert!((one.centroid - two.centroid).length() < 1e-15);
            assert!((one.radius - two.radius).abs() < 1e-15);
            let moments = one.second_moment.iter().zip(two.second_moment);
            assert!(moments.into_iter().all(|(m, n)| (m - n).abs() < 1e-15), "{one:?} {two:?}");
        }
    }

    #[test]
    fn elements_are_divided_along_lines_of_contact_that_suit() {
        let v = DVec2::new;
        let shape = Shape::new(&[v(0., 0.), v(4., 0.), v(5., 2.), v(1., 2.)]);
        let chart = Chart::of(&shape);
        // A quarter of the way along the first side, over half of the second; one that is aslant; one of the facet's own sides.
        let [e, f] = [v(4., 0.), v(1., 2.)];
        let at = |s: f64, t: f64| e * s + f * t;
        let lines = [
            [at(0.25, 0.3), at(0.25, 0.8)],
            [at(0.6, 0.1), at(0.7, 0.9)],
            [at(0.0, 0.0), at(0.0, 1.0)],
        ];
        let seams = chart.seams(&lines);
        assert_eq!(seams.len(), 1, "{seams:?}");
        let (places, count) = Place::WHOLE.children(4, Cut::Quarters, &seams);
        assert_eq!(count, 4);
        let parts: Vec<Shape> = places.iter().map(|place| chart.shape(place)).collect();
        assert!((parts[0].corners[1] - at(0.25, 0.0)).length() < 1e-4, "{:?}", parts[0]);
        assert!((parts[0].corners[2] - at(0.25, 0.5)).length() < 1e-4, "{:?}", parts[0]);
        let sum: f64 = parts.iter().map(Shape::area).sum();
        assert!((sum - shape.area()).abs() < 1e-12);
        // The line is too near a side of this part, and beyond that.
        let (below, _) = places[0].children(4, Cut::Quarters, &seams);
        assert!((chart.shape(&below[0]).corners[1] - at(0.125, 0.0)).length() < 1e-4);
        assert!(!Place([0, 0, 1, 9, 0, 0]).is_divisible(4) && places[0].is_divisible(4));
    }

    #[test]
    fn slender_shapes_become_rounder() {
        let v = DVec2::new;
        let mut needle = Shape::new(&[v(0., 0.), v(20., 0.), v(20., 1.), v(0., 1.)]);
        for _ in 0..5 {
            needle = children(&needle)[0];
        }
        let [a, b, _, d] = needle.corners;
        assert!((b - a).length() / (d - a).length() < 2.0);
    }
}
