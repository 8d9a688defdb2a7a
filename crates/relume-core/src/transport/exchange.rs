//! Exchange area X = A F of two elements or of a punctual light and an element.
//!
//! Far apart: 2 x 2 Gauss points on each side; near: 4 x 4. Close, touching or cut by each other's plane: the
//! closed form from points of the smaller side to the whole of the larger, both clipped to where
//! they face each other. Derivation and measured errors: docs/exchange.md.

use std::f64::consts::FRAC_1_PI;

use fearless_simd::dispatch;
use glam::{DVec2, DVec3};

use super::contour::exchange_along_outlines;
use super::kernel::{GaussPoints, Simd, kernel_grid};
use super::point::{LANES, PointBundle, bundle_sums, sum_of_lanes};
use super::tuning::{
    AGREE, CURVATURE, EXCHANGE_BENT, EXCHANGE_CLOSE, EXCHANGE_NEAR, FORM_FACTOR_RANGE, FULL,
    OUTLINE_ERROR,
};
use crate::element::{WorldElement, WorldLight, bilinear, bilinear_area};
use crate::geometry::{ConvexPolygon, Plane, no_smaller};
use crate::scene::LightKind;
use crate::transport::tuning::{NEAR_HALVINGS, UNEVEN};

/// Rounding of places, as a share of the largest coordinate.
const ROUNDED: f64 = 1e-12;

/// Relation of two elements' planes: how they face each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// At least one is wholly behind the other's plane: they exchange nothing.
    BackFacing,
    /// Each is wholly in front of the other's plane.
    Facing,
    /// At least one is cut by the other's plane.
    Cut,
    /// They lie in one plane and face opposite ways. Whether that is contact the rule of
    /// [`in_plane`](super::in_plane) says.
    Coplanar,
}

/// Variation of the arriving light over one end, relative to its mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variation {
    /// Relative gradient in the patch's frame, 1/m.
    pub gradient: DVec2,
    /// Standard deviation of the linear part, relative to the mean.
    pub slope: f64,
    /// Standard deviation of what the linear part leaves over, relative to the mean: an estimate.
    pub bend: f64,
}

/// Exchange area of a pair, with the variation of the arriving light over both ends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    /// Exchange area without occlusion, m2.
    pub area_m2: f64,
    /// Variation over the first end.
    pub over_a: Variation,
    /// Variation over the second end.
    pub over_b: Variation,
    /// Whether the kernel varies more than a few points of either end can resolve.
    pub is_steep: bool,
}

/// Relation of two elements' planes; corners within rounding of a plane count as on it.
#[inline]
pub fn meeting(a: &WorldElement, b: &WorldElement) -> Meeting {
    let slack = a.rounding_m + b.rounding_m;
    let (of_a, of_b) = (a.span(&b.plane), b.span(&a.plane));
    if of_b.hi <= slack {
        let is_flat = of_b.lo >= -slack && of_a.lo >= -slack && of_a.hi <= slack;
        let opposed = is_flat && a.plane.normal.dot(b.plane.normal) < -0.5;
        return if opposed { Meeting::Coplanar } else { Meeting::BackFacing };
    }
    if of_a.hi <= slack {
        return Meeting::BackFacing;
    }
    if of_a.lo < -slack || of_b.lo < -slack { Meeting::Cut } else { Meeting::Facing }
}

/// Exchange of two elements in contact that have `overlap_m2` in common: all that leaves it arrives.
pub fn contact_exchange(a: &WorldElement, b: &WorldElement, overlap_m2: f64) -> Exchange {
    let over = |e: &WorldElement| {
        let share = (overlap_m2 / e.area).clamp(f64::MIN_POSITIVE, 1.0);
        Variation { bend: ((1.0 - share) / share).sqrt().min(UNEVEN), ..Variation::default() }
    };
    Exchange { area_m2: overlap_m2, over_a: over(a), over_b: over(b), is_steep: false }
}

/// Exchange area of two elements that meet as `meeting` says, not [`Meeting::BackFacing`].
///
/// Error: below 0.25 % of the exchange area at worst, 0.05 % typically (see the tests, which sweep
/// decades of distance and size). Symmetric: both directions of a pair use this one number.
pub fn exchange(simd: Simd, a: &WorldElement, b: &WorldElement, meeting: Meeting) -> Exchange {
    let x = exchange_by_points(simd, a, b, meeting);
    if x.is_steep { x.along_outlines(simd, a, b) } else { x }
}

/// Exchange area of two elements that meet as `meeting` says, m2, from points alone.
///
/// Error: that of [`exchange`] unless the pair is steep. Then it is the smaller of what points of each side find, of no
/// stated error: enough to refine the pair; else [`Exchange::along_outlines`] is to follow.
pub fn exchange_by_points(
    simd: Simd,
    a: &WorldElement,
    b: &WorldElement,
    meeting: Meeting,
) -> Exchange {
    let (reach, apart) = (a.radius + b.radius, (b.centre - a.centre).length_squared());
    let beyond = |nearness: f64| meeting == Meeting::Facing && reach * reach <= nearness * apart;
    if !beyond(EXCHANGE_CLOSE) {
        return close_exchange(simd, a, b);
    }
    if !beyond(EXCHANGE_NEAR) {
        return dispatch!(simd.level(), _simd => exchange_of_grids(a, b));
    }
    let grid = kernel_grid(simd, a, b);
    let area_m2 = a.area * b.area * grid.mean;
    let over = |e: &WorldElement, points: &GaussPoints, values: &[f64; 4]| {
        let mut fit = Fit::default();
        for k in 0..4 {
            fit.add(e.offset(points.point(k)), points.share[k], values[k]);
        }
        fit.variation()
    };
    Exchange {
        area_m2,
        over_a: over(a, &grid.points.0, &grid.from_a),
        over_b: over(b, &grid.points.1, &grid.from_b),
        is_steep: false,
    }
}

/// Exchange as if each element were a point, with the gradients that follow; no bends.
///
/// Error: the square of (sum of the radii / distance), relative.
pub fn exchange_of_points(a: &WorldElement, b: &WorldElement) -> Exchange {
    let d = b.centre - a.centre;
    let r2 = d.length_squared();
    let (up, down) = (d.dot(a.plane.normal), -d.dot(b.plane.normal));
    if up <= 0.0 || down <= 0.0 {
        return Exchange::default();
    }
    // K = up down / (pi r^4): its logarithm's gradient in the place of a; in that of b the opposite.
    let rise = d * (4.0 / r2) - a.plane.normal / up + b.plane.normal / down;
    let over = |e: &WorldElement, rise: DVec3| {
        let gradient = DVec2::new(rise.dot(e.axes[0]), rise.dot(e.axes[1]));
        Variation { gradient, ..Variation::default() }
    };
    let area_m2 = a.area * b.area * up * down / (std::f64::consts::PI * r2 * r2);
    Exchange { area_m2, over_a: over(a, rise), over_b: over(b, -rise), is_steep: false }
}

/// The sum of a term over lanes.
#[inline(always)]
fn sum_over(term: impl Fn(usize) -> f64) -> f64 {
    let mut terms = [0.0; LANES];
    for (k, to) in terms.iter_mut().enumerate() {
        *to = term(k);
    }
    sum_of_lanes(terms)
}

/// A weighted linear least-squares fit over points of an element.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    weight: f64,
    value: f64,
    value2: f64,
    at: DVec2,
    at_value: DVec2,
    xx: f64,
    xy: f64,
    yy: f64,
    /// Whether values at neighbouring points differ too much for a linear fit.
    is_steep: bool,
}

impl Fit {
    #[inline]
    fn add(&mut self, x: DVec2, weight: f64, value: f64) {
        self.weight += weight;
        self.value += weight * value;
        self.value2 += weight * value * value;
        self.at += x * weight;
        self.at_value += x * (weight * value);
        self.xx += weight * x.x * x.x;
        self.xy += weight * x.x * x.y;
        self.yy += weight * x.y * x.y;
    }

    /// Adds sixteen points at once, with their values.
    #[inline(always)]
    fn add_all(&mut self, grid: &Grid, value: &[f64; LANES]) {
        let Grid { offsets: [x, y], weights: weight, .. } = grid;
        self.weight += sum_of_lanes(*weight);
        self.value += sum_over(|k| weight[k] * value[k]);
        self.value2 += sum_over(|k| weight[k] * value[k] * value[k]);
        self.at += DVec2::new(sum_over(|k| weight[k] * x[k]), sum_over(|k| weight[k] * y[k]));
        self.at_value.x += sum_over(|k| weight[k] * x[k] * value[k]);
        self.at_value.y += sum_over(|k| weight[k] * y[k] * value[k]);
        self.xx += sum_over(|k| weight[k] * x[k] * x[k]);
        self.xy += sum_over(|k| weight[k] * x[k] * y[k]);
        self.yy += sum_over(|k| weight[k] * y[k] * y[k]);
    }

    fn variation(&self) -> Variation {
        if self.value <= 0.0 {
            // Nothing at the sample points, but something elsewhere: as uneven as can be.
            return Variation { gradient: DVec2::ZERO, slope: 0.0, bend: 1.0 };
        }
        let (w, mean, at) = (self.weight, self.value / self.weight, self.at / self.weight);
        let (xx, xy, yy) =
            (self.xx / w - at.x * at.x, self.xy / w - at.x * at.y, self.yy / w - at.y * at.y);
        let r = self.at_value / w - at * mean;
        let det = (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        let gradient = DVec2::new(r.x * yy - r.y * xy, r.y * xx - r.x * xy) / (det * mean);
        let explained = (gradient.dot(r) / mean).max(0.0);
        let total = (self.value2 / w / (mean * mean) - 1.0).max(0.0);
        let rest = (total - explained).max(0.0).sqrt();
        Variation { gradient, slope: explained.sqrt(), bend: rest + CURVATURE * explained }
    }
}

/// Points and weights of Gauss-Legendre on [0, 1] with four points.
const G4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// The same in two dimensions, point by point: both parameters, and the weight.
const S: [f64; LANES] = G16[0];
const T: [f64; LANES] = G16[1];
const W: [f64; LANES] = G16[2];
const G16: [[f64; LANES]; 3] = {
    let mut out = [[0.0; LANES]; 3];
    let mut k = 0;
    while k < LANES {
        let ((s, ws), (t, wt)) = (G4[k & 3], G4[k >> 2]);
        (out[0][k], out[1][k], out[2][k]) = (s, t, ws * wt);
        k += 1;
    }
    out
};

/// 4 x 4 Gauss points of a quadrilateral of an element.
struct Grid {
    points: PointBundle,
    /// Offsets from the element's centroid along its axes, metres.
    offsets: [[f64; LANES]; 2],
    /// Shares of the area, m2.
    weights: [f64; LANES],
}

impl Grid {
    #[inline(always)]
    fn over(&[c0, c1, c2, c3]: &[DVec3; 4], e: &WorldElement) -> Grid {
        // A point is c0 + s u + t v + s t w; the Jacobian is linear in s and t.
        let (u, v, w) = (c1 - c0, c3 - c0, (c0 - c1) + (c2 - c3));
        let n = e.plane.normal;
        let (even, along_s, along_t) = (u.cross(v).dot(n), u.cross(w).dot(n), w.cross(v).dot(n));
        let at = |c0: f64, u: f64, v: f64, w: f64| -> [f64; LANES] {
            std::array::from_fn(|k| c0 + S[k] * u + T[k] * v + S[k] * T[k] * w)
        };
        let points = PointBundle {
            x: at(c0.x, u.x, v.x, w.x),
            y: at(c0.y, u.y, v.y, w.y),
            z: at(c0.z, u.z, v.z, w.z),
        };
        let weights = std::array::from_fn(|k| W[k] * (even + S[k] * along_s + T[k] * along_t));
        let along = |a: DVec3| at((c0 - e.centre).dot(a), u.dot(a), v.dot(a), w.dot(a));
        let offsets = [along(e.axes[0]), along(e.axes[1])];
        Grid { points, offsets, weights }
    }
}

/// The kernel between 4 x 4 points of each side.
#[inline(always)]
fn exchange_of_grids(a: &WorldElement, b: &WorldElement) -> Exchange {
    let (of_a, of_b) = (Grid::over(&a.corners, a), Grid::over(&b.corners, b));
    let (na, nb) = (a.plane.normal, b.plane.normal);
    let (mut from_a, mut from_b) = ([0.0; LANES], [0.0; LANES]);
    let at = &of_b.points;
    for i in 0..LANES {
        let p = of_a.points.point(i);
        let mut row = [0.0; LANES];
        for k in 0..LANES {
            let (x, y, z) = (at.x[k] - p.x, at.y[k] - p.y, at.z[k] - p.z);
            let r2 = x * x + y * y + z * z;
            let up = (na.x * x + na.y * y + na.z * z).max(0.0);
            let down = (-(nb.x * x + nb.y * y + nb.z * z)).max(0.0);
            let kernel = up * down * FRAC_1_PI / (r2 * r2).max(f64::MIN_POSITIVE);
            row[k] = of_b.weights[k] * kernel;
            from_b[k] += of_a.weights[i] * kernel;
        }
        from_a[i] = sum_of_lanes(row);
    }
    let over = |grid: &Grid, values: &[f64; LANES]| {
        let mut fit = Fit::default();
        fit.add_all(grid, values);
        fit
    };
    let (over_a, over_b) = (over(&of_a, &from_a), over(&of_b, &from_b));
    Exchange {
        area_m2: over_a.value,
        over_a: over_a.variation(),
        over_b: over_b.variation(),
        is_steep: false,
    }
}

/// The closed form from points of each side to the whole of the other; the area from the smaller side, or where it
/// may be wrong the smaller area.
fn close_exchange(simd: Simd, a: &WorldElement, b: &WorldElement) -> Exchange {
    let [of_a, of_b] = facing_parts(a, b);
    if of_a.corners().len() < 3 || of_b.corners().len() < 3 {
        return Exchange::default();
    }
    let from_a = integrate_polygon(simd, a, &of_a, of_b.corners());
    let from_b = integrate_polygon(simd, b, &of_b, of_a.corners());
    let (large, small) = (from_a.area_m2.max(from_b.area_m2), from_a.area_m2.min(from_b.area_m2));
    let bend = from_a.over.bend.min(from_b.over.bend);
    let disagree = large - small > AGREE * large || small <= 0.0;
    // Where nearly all of the smaller end is seen, what its edges lose lies between the points.
    let is_full = large > FULL * a.area.min(b.area);
    let is_bent = bend > EXCHANGE_BENT || from_a.is_steep || from_b.is_steep;
    let is_steep = disagree || is_full || is_bent;
    let area_m2 = match is_steep {
        true => small,
        false if no_smaller(b.area, a.area) => from_a.area_m2,
        false => from_b.area_m2,
    };
    Exchange { area_m2, over_a: from_a.over, over_b: from_b.over, is_steep }
}

/// The parts of two elements that face each other.
fn facing_parts(a: &WorldElement, b: &WorldElement) -> [ConvexPolygon; 2] {
    let slack = a.rounding_m + b.rounding_m;
    let part = |e: &WorldElement, plane| ConvexPolygon::part(&e.corners[..e.len], plane, slack);
    [part(a, &b.plane), part(b, &a.plane)]
}

impl Exchange {
    /// With the exchange area as an integral along the outlines of both elements, whatever their distance and shape.
    ///
    /// Error: 1e-4 of the exchange area, or 1e-7 of the smaller element's area.
    pub fn along_outlines(self, simd: Simd, a: &WorldElement, b: &WorldElement) -> Exchange {
        let [of_a, of_b] = facing_parts(a, b);
        if of_a.corners().len() < 3 || of_b.corners().len() < 3 {
            return self;
        }
        // No more than either has room for.
        let most = of_a.area().min(of_b.area());
        let error_max = OUTLINE_ERROR * self.area_m2.max(1e-3 * most);
        let area_m2 = exchange_along_outlines(simd, of_a.corners(), of_b.corners(), error_max);
        let area_m2 = area_m2.min(most);
        Exchange { area_m2, ..self }
    }
}

/// Exchange area of two convex polygons with nothing between, m2; corners, counter-clockwise as seen from the front, and unit normals.
/// Polygons of more corners than a [`ConvexPolygon`] holds exchange nothing.
///
/// Error: 1e-4 of the smaller area.
pub fn exchange_of_polygons((a, of_a): (&[DVec3], DVec3), (b, of_b): (&[DVec3], DVec3)) -> f64 {
    // Clipping may add a corner.
    if a.len().max(b.len()) >= ConvexPolygon::CAPACITY {
        return 0.0;
    }
    let reach = a.iter().chain(b).map(|c| c.abs().max_element()).fold(0.0, f64::max);
    let part =
        |corners: &[DVec3], plane: Plane| ConvexPolygon::part(corners, &plane, ROUNDED * reach);
    let (one, two) = (part(a, Plane::through(b[0], of_b)), part(b, Plane::through(a[0], of_a)));
    if one.corners().len() < 3 || two.corners().len() < 3 {
        return 0.0;
    }
    let most = one.area().min(two.area());
    exchange_along_outlines(Simd::detect(), one.corners(), two.corners(), 1e-4 * most).min(most)
}

/// Integral of the form factor over an end of a pair.
struct Integral {
    /// Its value, m2.
    area_m2: f64,
    /// Variation of the form factor over the end.
    over: Variation,
    /// Whether points beside each other find too different ones for the integral to be right.
    is_steep: bool,
}

/// Integral over `part` of `e` of the form factor to `seen`.
fn integrate_polygon(
    simd: Simd,
    e: &WorldElement,
    part: &ConvexPolygon,
    seen: &[DVec3],
) -> Integral {
    let c = part.corners();
    let viewer = Viewer { simd, e, seen };
    let mut fit = Fit::default();
    let mut sum = 0.0;
    if c.len() == 4 {
        sum = viewer.integrate(&[c[0], c[1], c[2], c[3]], NEAR_HALVINGS, &mut fit);
    } else {
        for k in 1..c.len() - 1 {
            sum += viewer.integrate(&[c[0], c[k], c[k + 1], c[k + 1]], NEAR_HALVINGS, &mut fit);
        }
    }
    let variation = fit.variation();
    // Where the other's plane cuts the element, a straight line does not fit what arrives.
    let whole = part.area() >= 0.999 * e.area;
    let bend = if whole { variation.bend } else { variation.bend.max(1.0) };
    Integral { area_m2: sum, over: Variation { bend, ..variation }, is_steep: fit.is_steep }
}

/// The end of a near pair from whose points the other is seen.
struct Viewer<'a> {
    simd: Simd,
    e: &'a WorldElement,
    seen: &'a [DVec3],
}

impl Viewer<'_> {
    /// Integral over a quadrilateral of the form factor from its points, m2; in four parts
    /// where the two nearly touch. The values go into `fit`.
    fn integrate(&self, quad: &[DVec3; 4], depth: u32, fit: &mut Fit) -> f64 {
        let may_part = depth > 0;
        match dispatch!(self.simd.level(), _simd => self.look_from(quad, may_part, fit)) {
            Some(sum) => sum,
            None => {
                let parts = [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)];
                let part = |s, t| [(s, t), (s + 0.5, t), (s + 0.5, t + 0.5), (s, t + 0.5)];
                let place = |(s, t)| bilinear(quad, s, t);
                parts
                    .map(|(s, t)| self.integrate(&part(s, t).map(place), depth - 1, fit))
                    .iter()
                    .sum()
            }
        }
    }

    /// The integral from 4 x 4 points, or nothing where the form factors differ too much.
    #[inline(always)]
    fn look_from(&self, quad: &[DVec3; 4], may_part: bool, fit: &mut Fit) -> Option<f64> {
        let grid = Grid::over(quad, self.e);
        let factors = bundle_sums(&grid.points, self.e.plane.normal, self.seen);
        let (mut lo, mut hi) = (f64::INFINITY, 0.0_f64);
        for &f in &factors {
            (lo, hi) = (lo.min(f), hi.max(f));
        }
        if hi - lo > FORM_FACTOR_RANGE && may_part {
            return None;
        }
        fit.is_steep |= hi - lo > FORM_FACTOR_RANGE;
        let before = fit.value;
        fit.add_all(&grid, &factors);
        Some(fit.value - before)
    }
}

/// "Exchange area" of a punctual light and an element: the integral over the element of
/// cos / r^2 (point and spot, with the cone's falloff; sr) or of cos (directional; m2), so that
/// irradiance = intensity x exchange / area. `over_a` is the element's; the light's is nothing.
///
/// Error: 4 x 4 Gauss points; uneven elements are refined by the oracle.
pub fn light_exchange(light: &WorldLight, e: &WorldElement) -> Exchange {
    let mut fit = Fit::default();
    for (s, ws) in G4 {
        for (t, wt) in G4 {
            let weight = ws * wt * bilinear_area(&e.corners, s, t).dot(e.plane.normal);
            let point = e.point(s, t);
            fit.add(e.offset(point), weight, light_at(light, point, e.plane.normal));
        }
    }
    let over_a = if fit.value > 0.0 { fit.variation() } else { Variation::default() };
    Exchange { area_m2: fit.value, over_a, over_b: Variation::default(), is_steep: false }
}

/// Irradiance at a point with unit `normal` from a light of unit intensity, without occlusion.
pub fn light_at(light: &WorldLight, point: DVec3, normal: DVec3) -> f64 {
    if light.kind == LightKind::Directional {
        return (-normal.dot(light.direction)).max(0.0);
    }
    let d = light.position - point;
    let r2 = d.length_squared();
    if r2 == 0.0 {
        return 0.0;
    }
    let r = r2.sqrt();
    let cosine = (normal.dot(d) / r).max(0.0);
    let cone = match light.kind {
        LightKind::Spot { inner, outer } => falloff(-light.direction.dot(d) / r, inner, outer),
        LightKind::Point | LightKind::Directional => 1.0,
    };
    cosine * cone / r2
}

/// The falloff that KHR_lights_punctual recommends between the two cone angles.
fn falloff(cosine: f64, inner: f64, outer: f64) -> f64 {
    let (ci, co) = (libm::cos(inner), libm::cos(outer));
    let t = ((cosine - co) / (ci - co).max(1e-3)).clamp(0.0, 1.0);
    t * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Aabb, Plane};
    use glam::DMat3;

    fn quad(corners: [DVec3; 4]) -> WorldElement {
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let centre = (corners[0] + corners[1] + corners[2] + corners[3]) * 0.25;
        WorldElement {
            corners,
            len: 4,
            plane: Plane::through(corners[0], n.normalize()),
            axes: [
                (corners[1] - corners[0]).normalize(),
                n.normalize().cross((corners[1] - corners[0]).normalize()),
            ],
            centre,
            radius: corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max),
            area: ConvexPolygon::new(&corners).area(),
            bounds: Aabb::of(corners),
            rounding_m: 1e-12,
        }
    }

    fn rectangle(origin: DVec3, u: DVec3, v: DVec3) -> WorldElement {
        quad([origin, origin + u, origin + u + v, origin + v])
    }

    fn form_factor(a: &WorldElement, b: &WorldElement) -> f64 {
        exchange(Simd::detect(), a, b, meeting(a, b)).area_m2 / a.area
    }

    #[test]
    fn facing_and_adjacent_unit_squares_have_their_catalogue_values() {
        let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
        let ceiling = rectangle(DVec3::Z, DVec3::Y, DVec3::X);
        assert!((form_factor(&floor, &ceiling) - 0.199_824_895_698).abs() < 2e-6);
        let wall = rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z);
        let f = form_factor(&floor, &wall);
        assert!((f - 0.200_043_776_075).abs() < 3e-5, "{f}");
    }

    /// The exchange of `a` and `b` from 24 x 24 pieces of the closed form.
    fn reference(a: &WorldElement, b: &WorldElement) -> f64 {
        const N: usize = 24;
        let mut sum = 0.0;
        for i in 0..N {
            for j in 0..N {
                let at = |u: usize, v: usize| a.point(u as f64 / N as f64, v as f64 / N as f64);
                let piece = quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                if meeting(&piece, b) != Meeting::BackFacing {
                    let seen = ConvexPolygon::new(&b.corners).clipped(&a.plane, 0.0);
                    let face = ConvexPolygon::new(&piece.corners).clipped(&b.plane, 0.0);
                    let c = face.corners();
                    for k in 1..c.len() - 1 {
                        let tri = [c[0], c[k], c[k + 1], c[k + 1]];
                        let viewer = Viewer { simd: Simd::detect(), e: a, seen: seen.corners() };
                        sum += viewer.integrate(&tri, 0, &mut Fit::default());
                    }
                }
            }
        }
        sum
    }

    #[test]
    fn the_error_stays_below_its_bound_over_decades_of_distance_and_size() {
        let (mut worst, mut grids) = (0.0_f64, 0);
        for (k, tilt) in [0.0, 0.4, 0.9, 1.3].into_iter().enumerate() {
            for size in [0.05, 0.3, 1.0, 2.0] {
                for gap in [0.02, 0.1, 0.3, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0, 10.0] {
                    let a = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
                    let turn = DMat3::from_rotation_y(std::f64::consts::PI + tilt)
                        * DMat3::from_rotation_z(0.3 * k as f64);
                    let o = DVec3::new(0.9, 0.1, gap + size * tilt.sin());
                    let b = rectangle(o, turn * DVec3::X * size, turn * DVec3::Y * size);
                    let m = meeting(&a, &b);
                    if m == Meeting::BackFacing {
                        continue;
                    }
                    let exact = reference(&a, &b);
                    let error = (exchange(Simd::detect(), &a, &b, m).area_m2 / exact - 1.0).abs();
                    let reach = a.radius + b.radius;
                    let nearness = reach * reach / (b.centre - a.centre).length_squared();
                    let by_grid = m == Meeting::Facing
                        && (EXCHANGE_NEAR..=EXCHANGE_CLOSE).contains(&nearness);
                    let most = if by_grid { 2e-4 } else { 2.5e-3 };
                    grids += usize::from(by_grid);
                    worst = worst.max(error);
                    assert!(error < most, "tilt {tilt} size {size} gap {gap} {m:?}: {error:.2e}");
                }
            }
        }
        println!("largest relative error {worst:.2e}; {grids} pairs by 4 x 4 points");
        assert!(grids > 20);
    }

    #[test]
    fn slender_and_close_elements_have_their_closed_forms() {
        // A strip 4 mm high on a floor: all but its ends see half of it.
        let floor = rectangle(DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 3.0);
        let strip = |z: f64| rectangle(DVec3::new(1.0, 1.5, z), DVec3::X * 1.6, DVec3::Z * 4e-3);
        assert!((form_factor(&strip(0.0), &floor) - 0.499_357).abs() < 2e-4);
        // Over a piece of the floor far narrower than the spacing of points on the strip.
        let piece = rectangle(DVec3::new(1.75, 1.4, 0.0), DVec3::X * 0.05, DVec3::Y * 0.1);
        let exact = reference(&piece, &strip(1e-4)) / strip(0.0).area;
        let f = form_factor(&strip(1e-4), &piece);
        assert!((f / exact - 1.0).abs() < 0.03, "{f} {exact}");
        // Equal squares a thousandth and a hundred thousandth of their side apart, and shifted by half of it.
        for gap in [1e-3, 1e-5] {
            let lid = rectangle(DVec3::new(0.0, 0.0, gap), DVec3::Y, DVec3::X);
            let square = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
            let f = form_factor(&square, &lid);
            // Two of the four sides lose about gap / 2 each, for small gaps.
            assert!((f - (1.0 - 2.0 * gap)).abs() < 1e-2 * gap + 1e-9, "{gap} {f}");
            let aside = rectangle(DVec3::new(0.5, 0.0, gap), DVec3::Y, DVec3::X);
            assert!((form_factor(&square, &aside) - 0.5).abs() < 2.0 * gap, "{gap}");
            let turn = DMat3::from_rotation_z(0.7);
            let turned = rectangle(DVec3::new(0.5, -0.2, gap), turn * DVec3::Y, turn * DVec3::X);
            let other = rectangle(DVec3::new(0.5, -0.2, gap), turn * DVec3::X, turn * DVec3::Y);
            let both = form_factor(&square, &turned) - form_factor(&turned, &square);
            assert!(both.abs() < 4e-3, "{gap} {both}");
            assert_eq!(meeting(&square, &other), Meeting::BackFacing);
        }
    }

    #[test]
    fn cut_pairs_count_only_what_faces_each_other() {
        let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
        let through = rectangle(DVec3::new(0.5, 0.0, -1.0), DVec3::Y, DVec3::Z * 2.0);
        let above = rectangle(DVec3::new(0.5, 0.0, 0.0), DVec3::Y, DVec3::Z);
        let half = rectangle(DVec3::new(0.5, 0.0, 0.0), DVec3::X * 0.5, DVec3::Y);
        let m = meeting(&floor, &through);
        assert_eq!(m, Meeting::Cut);
        let x = exchange(Simd::detect(), &floor, &through, m).area_m2;
        let exact = reference(&half, &above);
        assert!((x / exact - 1.0).abs() < 2e-3, "{x} {exact}");
    }

    #[test]
    fn a_point_light_over_a_disc_gives_its_solid_angle_projected() {
        let light = WorldLight {
            position: DVec3::new(0.5, 0.5, 2.0),
            direction: DVec3::NEG_Z,
            kind: LightKind::Point,
        };
        let e = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
        let n = 200;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let p = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / f64::from(n);
                sum += light_at(&light, p.extend(0.0), DVec3::Z) / f64::from(n * n);
            }
        }
        assert!((light_exchange(&light, &e).area_m2 / sum - 1.0).abs() < 1e-5);
    }
}
