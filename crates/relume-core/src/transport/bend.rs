//! Second-order variation (bend) of the arriving light over a receiver, beyond the gradient that a link stores.

use fearless_simd::dispatch;
use glam::{DMat3, DVec2, DVec3};

use super::exchange::light_at;
use super::kernel::{GaussPoints, Simd};
use super::point::{LANES, PointBundle, form_factors_from_points};
use super::tuning::{BEND_CLOSE, BEND_FAR};
use crate::element::{WorldElement, WorldLight, bilinear_area};
use crate::geometry::ConvexPolygon;

/// Coefficients of three parabolas in the arriving light over an element, relative to its mean, with lengths in radii of the
/// element: see [`Receiver::polynomial`].
pub type Bend = [f64; 3];

/// Points of Gauss-Legendre on [0, 1] with three points, and their weights.
const G3: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Points of a receiver.
const POINTS: usize = 9;

/// An element prepared for computing the bend of the light that it receives.
pub struct Receiver<'a> {
    element: &'a WorldElement,
    /// Nine Gauss points; the other lanes are at the centre.
    points: PointBundle,
    /// Shares of the area.
    shares: [f64; POINTS],
    /// Weights by which values at the points give the coefficient of each parabola.
    fit: [[f64; POINTS]; 3],
    /// The mean of x x, x y and y y, and the line that fits each of them best; lengths in radii.
    lines: [[f64; 3]; 3],
}

/// x x, x y, y y.
fn squares(p: DVec2) -> [f64; 3] {
    [p.x * p.x, p.x * p.y, p.y * p.y]
}

impl<'a> Receiver<'a> {
    /// Receiver from any quadrilateral or triangle.
    pub fn new(element: &'a WorldElement) -> Receiver<'a> {
        let WorldElement { corners, plane, centre, radius, .. } = element;
        let mut points = PointBundle::default();
        let (mut shares, mut at) = ([0.0; POINTS], [DVec2::ZERO; POINTS]);
        for k in 0..LANES {
            let mut p = *centre;
            if k < POINTS {
                let ((s, ws), (t, wt)) = (G3[k % 3], G3[k / 3]);
                p = element.point(s, t);
                shares[k] = ws * wt * bilinear_area(corners, s, t).dot(plane.normal);
                at[k] = element.offset(p) / *radius;
            }
            (points.x[k], points.y[k], points.z[k]) = (p.x, p.y, p.z);
        }
        let whole: f64 = shares.iter().sum();
        shares = shares.map(|w| w / whole);
        let mean = |f: &dyn Fn(usize) -> f64| (0..POINTS).map(|k| shares[k] * f(k)).sum::<f64>();
        // About the centroid the mean of x and y is 0.
        let [xx, xy, yy] = [0, 1, 2].map(|m| mean(&|k| squares(at[k])[m]));
        let det = xx * yy - xy * xy;
        let lines = [0, 1, 2].map(|m| {
            let [x, y] = [0, 1].map(|axis| mean(&|k| squares(at[k])[m] * at[k][axis]));
            [[xx, xy, yy][m], (x * yy - y * xy) / det, (y * xx - x * xy) / det]
        });
        // The parabolas: what those lines leave of the squares.
        let parabola = |m: usize, k: usize| {
            let [mean, x, y] = lines[m];
            squares(at[k])[m] - mean - x * at[k].x - y * at[k].y
        };
        let column =
            |n: usize| DVec3::from([0, 1, 2].map(|m| mean(&|k| parabola(m, k) * parabola(n, k))));
        let inverse = DMat3::from_cols(column(0), column(1), column(2)).inverse();
        let mut fit = [[0.0; POINTS]; 3];
        if inverse.is_finite() {
            for k in 0..POINTS {
                let own = inverse * DVec3::from([0, 1, 2].map(|m| parabola(m, k)));
                (0..3).for_each(|m| fit[m][k] = shares[k] * own[m]);
            }
        }
        Receiver { element, points, shares, fit, lines }
    }

    /// Bend of the light from a source, without occlusion.
    ///
    /// Error: that of nine Gauss points, which find the parabola that fits best beside a line in anything up to third
    /// order. About 40 ns, near the source 0.2 microseconds.
    pub fn bend(&self, simd: Simd, from: &WorldElement) -> Bend {
        let near = self.nearness(from.centre, from.radius);
        if near >= BEND_CLOSE {
            return self.fitted(&self.receive_close(simd, from));
        }
        let mut values = [0.0; LANES];
        let normal = from.plane.normal;
        if near < BEND_FAR {
            let middle = [(from.centre, 1.0)];
            dispatch!(simd.level(), _simd => self.receive(&middle, normal, &mut values));
        } else {
            let of = GaussPoints::of(from);
            let points = [0, 1, 2, 3].map(|k| (of.point(k), of.share[k]));
            dispatch!(simd.level(), _simd => self.receive(&points, normal, &mut values));
        }
        self.fitted(&values)
    }

    /// Bend of the light from a punctual light.
    pub fn light_bend(&self, light: &WorldLight) -> Bend {
        let sent = |k: usize| light_at(light, self.points.point(k), self.element.plane.normal);
        self.fitted(&std::array::from_fn(sent))
    }

    /// Coefficients of 1, x, y (1/m), x x, x y and y y (1/m2), in the unit of what the bend is multiplied with, where x
    /// and y are offsets from the centroid along the axes of the patch, metres: of mean 0 and no slope over the element.
    pub fn polynomial(&self, bend: Bend) -> [f64; 6] {
        let per_m = 1.0 / self.element.radius;
        let line = |n: usize| -(0..3).map(|m| bend[m] * self.lines[m][n]).sum::<f64>();
        let [p, q, r] = bend.map(|b| b * per_m * per_m);
        [line(0), line(1) * per_m, line(2) * per_m, p, q, r]
    }

    fn nearness(&self, centre: DVec3, radius: f64) -> f64 {
        let reach = self.element.radius + radius;
        reach * reach / (centre - self.element.centre).length_squared().max(f64::MIN_POSITIVE)
    }

    /// Kernel sums at the points over source points with a normal and weights.
    #[inline(always)]
    fn receive(&self, from: &[(DVec3, f64)], m: DVec3, values: &mut [f64; LANES]) {
        let (n, at) = (self.element.plane.normal, &self.points);
        for (q, weight) in from {
            for (k, value) in values.iter_mut().enumerate() {
                let (x, y, z) = (q.x - at.x[k], q.y - at.y[k], q.z - at.z[k]);
                let up = (n.x * x + n.y * y + n.z * z).max(0.0);
                let down = (-(m.x * x + m.y * y + m.z * z)).max(0.0);
                let r2 = x * x + y * y + z * z;
                *value += weight * up * down / (r2 * r2).max(f64::MIN_POSITIVE);
            }
        }
    }

    /// The form factors from the points.
    fn receive_close(&self, simd: Simd, from: &WorldElement) -> [f64; LANES] {
        let plane = &self.element.plane;
        let slack = self.element.rounding_m + from.rounding_m;
        let seen = ConvexPolygon::part(&from.corners[..from.len], plane, slack);
        if seen.corners().len() < 3 {
            return [0.0; LANES];
        }
        let corners = seen.corners();
        let mut values = form_factors_from_points(simd, &self.points, plane.normal, corners);
        for (k, value) in values.iter_mut().enumerate() {
            if from.plane.distance(self.points.point(k)) <= 0.0 {
                *value = 0.0;
            }
        }
        values
    }

    /// Coefficients of the parabolas in values at the points, relative to their mean.
    fn fitted(&self, values: &[f64; LANES]) -> Bend {
        let over = |weights: &[f64; POINTS]| {
            weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>()
        };
        let mean = over(&self.shares);
        self.fit.map(|weights| if mean > 0.0 { over(&weights) / mean } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use glam::EulerRot;
    use proptest::prelude::*;

    use super::*;
    use crate::element::Shape;
    use crate::geometry::{Aabb, Plane};
    use crate::scene::LightKind;
    use crate::transport::form_factor_from_point;

    /// A shape in the plane through `at` whose axes are turned by `turn`.
    fn place(shape: &Shape, at: DVec3, turn: [f64; 3]) -> WorldElement {
        let turn = glam::DMat3::from_euler(EulerRot::XYZ, turn[0], turn[1], turn[2]);
        let [u, v, normal] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis);
        let point = |p: DVec2| at + u * p.x + v * p.y;
        let corners = shape.corners.map(point);
        let centre = point(shape.centroid());
        WorldElement {
            corners,
            len: shape.len,
            plane: Plane::through(at, normal),
            axes: [u, v],
            centre,
            radius: corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max),
            area: shape.area(),
            bounds: Aabb::of(corners),
            rounding_m: 1e-12,
        }
    }

    fn rectangle(half_u: f64, half_v: f64) -> Shape {
        let corner = |x: f64, y: f64| DVec2::new(x * half_u, y * half_v);
        Shape::new(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)])
    }

    /// Rectangles turned in their plane, skew ones, trapezoids and triangles, up to 0.7 m in radius.
    fn shape() -> impl Strategy<Value = Shape> {
        let turned = (0.2..0.5, 0.2..0.5, 0.0..PI, -0.5..0.5_f64, 0.3..1.0, 0..3);
        turned.prop_map(|(half_u, half_v, turn, skew, top, kind)| {
            let r = rectangle(half_u, half_v).corners;
            let by = DVec2::from_angle(turn);
            let lean = |p: DVec2| DVec2::new(p.x + skew * p.y, p.y);
            match kind {
                0 => Shape::new(&r.map(|p| by.rotate(lean(p)))),
                1 => {
                    let narrow = |p: DVec2| if p.y > 0.0 { DVec2::new(p.x * top, p.y) } else { p };
                    Shape::new(&r.map(|p| by.rotate(narrow(p))))
                }
                _ => Shape::new(&[r[0], r[1], r[2]].map(|p| by.rotate(lean(p)))),
            }
        })
    }

    /// What is left of a function over an element, relative to its mean, by the line that fits it best, by that
    /// with the parabolas that do, and by the line with a bend: root mean squares.
    fn left(e: &WorldElement, bend: [f64; 6], f: impl Fn(DVec3) -> f64) -> [f64; 3] {
        const SIDE: usize = 16;
        let at = |k: usize| (k as f64 + 0.5) / SIDE as f64;
        let basis = |p: DVec2| [1.0, p.x, p.y, p.x * p.x, p.x * p.y, p.y * p.y];
        let sample = |k: usize| {
            let (s, t) = (at(k % SIDE), at(k / SIDE));
            let p = e.point(s, t);
            (basis(e.offset(p)), f(p), bilinear_area(&e.corners, s, t).length())
        };
        let samples: Vec<([f64; 6], f64, f64)> = (0..SIDE * SIDE).map(sample).collect();
        let whole: f64 = samples.iter().map(|s| s.2).sum();
        let mean = samples.iter().map(|s| s.1 * s.2).sum::<f64>() / whole;
        let off = |coefficients: &[f64; 6]| {
            let one = |(basis, value, weight): &([f64; 6], f64, f64)| {
                let model: f64 = coefficients.iter().zip(basis).map(|(c, b)| c * b).sum();
                weight * (value / mean - model).powi(2)
            };
            (samples.iter().map(one).sum::<f64>() / whole).sqrt()
        };
        let fit = |terms: usize| {
            // Descent, one coefficient after the other.
            let mut c = [0.0; 6];
            for _ in 0..4000 {
                for n in 0..terms {
                    let (mut up, mut down) = (0.0, 0.0);
                    for (basis, value, weight) in &samples {
                        let model: f64 = c.iter().zip(basis).map(|(c, b)| c * b).sum();
                        up += weight * basis[n] * (value / mean - model);
                        down += weight * basis[n] * basis[n];
                    }
                    c[n] += up / down;
                }
            }
            c
        };
        let line = fit(3);
        let bent = std::array::from_fn(|n| line[n] + bend[n]);
        [off(&line), off(&fit(6)), off(&bent)]
    }

    fn angle() -> impl Strategy<Value = f64> {
        -0.6..0.6
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn a_bend_is_the_best_parabola_over_any_shape(
            receiver in shape(),
            source in shape(),
            distance in 1.5..8.0,
            away in prop::array::uniform2(-0.5..0.5),
            turn in prop::array::uniform3(angle()),
        ) {
            let receiver = place(&receiver, DVec3::ZERO, [0.0; 3]);
            let at = DVec3::new(away[0], away[1], 1.0).normalize() * distance;
            let source = place(&source, at, [turn[0] + PI, turn[1], turn[2]]);
            prop_assume!(receiver.span(&source.plane).lo > 0.0 && source.span(&receiver.plane).lo > 0.0);
            let ready = Receiver::new(&receiver);
            let bend = ready.polynomial(ready.bend(Simd::detect(), &source));
            let corners = &source.corners[..source.len];
            let seen = |p| form_factor_from_point(p, receiver.plane.normal, corners);
            let [line, best, bent] = left(&receiver, bend, seen);
            // What the best parabola leaves over, nine points may take for one.
            let bound = 1.5 * best + 0.2 * line + 1e-4;
            prop_assert!(bent < bound, "{line} {best} {bent} {bend:?}");
        }

        /// It shifts no light: its mean over the children is that over the whole, nothing.
        #[test]
        fn a_bend_brings_nothing(shape in shape(), bend in prop::array::uniform3(-1.0..1.0)) {
            let e = place(&shape, DVec3::ZERO, [0.0; 3]);
            let [one, x, y, xx, xy, yy] = Receiver::new(&e).polynomial(bend);
            let [mxx, mxy, myy] = shape.exact_second_moment();
            let mean = one + xx * mxx + xy * mxy + yy * myy;
            prop_assert!(mean.abs() < 1e-12 && (x.abs() + y.abs()).is_finite(), "{mean}");
        }
    }

    #[test]
    fn a_lamp_above_the_middle_bends_both_ways() {
        let receiver = place(&rectangle(0.3, 0.3), DVec3::ZERO, [0.0; 3]);
        let kind = LightKind::Point;
        let position = DVec3::new(0.1, 0.0, 1.0);
        let light = WorldLight { position, direction: DVec3::NEG_Z, kind };
        let ready = Receiver::new(&receiver);
        let bend = ready.polynomial(ready.light_bend(&light));
        let [line, _, bent] = left(&receiver, bend, |p| light_at(&light, p, DVec3::Z));
        assert!(bent < 0.1 * line, "{line} {bent} {bend:?}");
        // Its cosine over r^2 is 1/r^3 times the height: that falls by 1.5 x^2 / r^2.
        assert!((bend[3] + 1.5).abs() < 0.15 && (bend[5] + 1.5).abs() < 0.15, "{bend:?}");
    }

    #[test]
    fn beside_a_wall_what_arrives_bends_towards_it() {
        // Along the edge at x = -1/2, facing what lies there in three shapes.
        let wall = place(&rectangle(0.5, 0.5), DVec3::new(-0.5, 0.0, 0.5), [0.0, FRAC_PI_2, 0.0]);
        let c = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(DVec2::from);
        let turned = c.map(|p| DVec2::from_angle(-0.8).rotate(p));
        for (shape, turn) in [
            (Shape::new(&c), 0.0),
            // The same place, by axes that are turned.
            (Shape::new(&turned), 0.8),
            (Shape::new(&[c[0], c[1], c[3]]), 0.0),
        ] {
            let floor = place(&shape, DVec3::ZERO, [0.0, 0.0, turn]);
            let ready = Receiver::new(&floor);
            let bend = ready.polynomial(ready.bend(Simd::detect(), &wall));
            let seen = |p| form_factor_from_point(p, DVec3::Z, &wall.corners);
            let [line, best, bent] = left(&floor, bend, seen);
            assert!(bent < 0.5 * line, "{line} {best} {bent} {bend:?}");
        }
    }
}
