//! Sample points of one patch, Delaunay-triangulated in the patch's own frame.
//!
//! Must not know the view: the triangulation is the same wherever the patch is seen from, so that
//! the radiosity does not slip across the surface as the camera or the body moves.
//!
//! Sample points are the centroids of the leaves, which carry the leaves' radiosity, and those
//! corners of leaves that lie on the patch's boundary, so that the triangles cover the whole patch.
//! The latter carry the linear extrapolate of the leaves that they belong to, not below zero and
//! not further from the leaf's radiosity than 1.5 times its largest step to a neighbour.

use glam::{DMat2, DVec2};
use relume_core::session::Leaf;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

use super::weights::weights;

/// Leaf corners closer to the boundary than this, relative to the patch's extent, lie on it.
const ON_BOUNDARY: f64 = 1e-7;

/// How far a boundary value may leave its leaf's, relative to the largest step to a neighbour.
const EXTRAPOLATION_MAX: f64 = 1.5;

type Rgb = [f64; 3];

/// A piece of a patch over which radiosity is linear.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Corners in the patch's frame, metres.
    pub(crate) corners: [DVec2; 3],
    /// Radiosity at the corners, W/m2.
    pub(crate) radiosity: [[f32; 3]; 3],
}

/// Triangles over points of one patch, with a value at each point.
#[derive(Clone, Debug, Default)]
pub(super) struct Net {
    /// Points in the patch's frame, metres.
    pub(super) points: Vec<DVec2>,
    /// Values at the points.
    pub(super) values: Vec<Rgb>,
    /// Numbers of points, counter-clockwise.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Triangles that cover the convex polygon `corners`, which `leaves` tile; metres.
///
/// `at_corners` is what the corners are to have, W/m2, where neighbours have their say: what is between changes along. Empty where
/// there is nothing to triangulate (fewer than two leaves and no say of neighbours, no finite extent): such a patch is drawn
/// flat. Where all leaves have one radiosity, so has every corner, exactly; a linear
/// field is reproduced up to the leaves' own error. Cost O(n log n) in the number of leaves.
pub(crate) fn triangulate(
    corners: &[DVec2],
    leaves: &[Leaf],
    at_corners: Option<&[Rgb]>,
) -> Vec<Triangle> {
    let radiosities: Vec<Rgb> = leaves.iter().map(|leaf| leaf.radiosity.map(f64::from)).collect();
    let Net { points, values, triangles } = net(corners, leaves, &radiosities, at_corners);
    let of = |index: [u32; 3]| Triangle {
        corners: index.map(|i| points[i as usize]),
        radiosity: index.map(|i| values[i as usize].map(|v| v as f32)),
    };
    triangles.into_iter().map(of).collect()
}

/// The same of any values of the leaves, with every point once. Points and triangles depend on `corners`, the leaves' shapes and
/// whether there are `at_corners`, and on no value.
pub(super) fn net(
    corners: &[DVec2],
    leaves: &[Leaf],
    of_leaves: &[Rgb],
    at_corners: Option<&[Rgb]>,
) -> Net {
    let (low, high) =
        corners.iter().fold((corners[0], corners[0]), |(l, h), &c| (l.min(c), h.max(c)));
    let extent = (high - low).max_element();
    if !extent.is_normal() {
        return Net::default();
    }
    if let ([of_leaf], Some(at_corners)) = (of_leaves, at_corners) {
        return fan(corners, *of_leaf, at_corners);
    }
    if leaves.len() < 2 {
        return Net::default();
    }
    let mut points: Vec<DVec2> = leaves.iter().map(|leaf| centroid(&leaf.corners)).collect();
    let boundary = boundary_points(corners, leaves, extent);
    points.extend(boundary.iter().map(|b| b.point));
    let sites = points.iter().enumerate().map(|(index, &p)| Site::new((p - low) / extent, index));
    let Ok(mesh) = DelaunayTriangulation::<Site>::bulk_load(sites.collect()) else {
        return Net::default();
    };
    let mut values = values(&mesh, &points, of_leaves, &boundary);
    if let Some(at_corners) = at_corners {
        bend(corners, at_corners, &points, &mut values);
    }
    let triangles = mesh.inner_faces().map(|face| face.vertices().map(|v| v.data().index));
    Net { triangles: triangles.collect(), points, values }
}

/// Triangles from the middle of a patch of one leaf to its corners; of a triangle itself.
fn fan(corners: &[DVec2], of_leaf: Rgb, at_corners: &[Rgb]) -> Net {
    let n = corners.len() as u32;
    let mut net = Net { points: corners.to_vec(), values: at_corners.to_vec(), triangles: vec![] };
    if n == 3 {
        net.triangles.push([0, 1, 2]);
        return net;
    }
    net.points.push(corners.iter().sum::<DVec2>() / f64::from(n));
    net.values.push(of_leaf);
    net.triangles.extend((0..n).map(|k| [n, k, (k + 1) % n]));
    net
}

/// Moves values at points of a convex polygon so that its corners have the values given: by what the corners lack, weighed
/// with coordinates that are linear along the edges (Wachspress 1975). Never below zero.
fn bend(corners: &[DVec2], at_corners: &[Rgb], points: &[DVec2], values: &mut [Rgb]) {
    let own = |corner: &DVec2| points.iter().position(|p| p == corner).map(|k| values[k]);
    let lack = |(corner, wanted): (&DVec2, &Rgb)| {
        own(corner).map_or([0.0; 3], |own| [0, 1, 2].map(|c| wanted[c] - own[c]))
    };
    let lacks: Vec<Rgb> = corners.iter().zip(at_corners).map(lack).collect();
    for (point, value) in points.iter().zip(values) {
        let weights = weights(corners, *point);
        for c in 0..3 {
            let moved: f64 = weights.iter().zip(&lacks).map(|(w, lack)| w * lack[c]).sum();
            value[c] = (value[c] + moved).max(0.0);
        }
    }
}

/// A sample point in coordinates scaled to the unit square.
struct Site {
    position: Point2<f64>,
    index: u32,
}

impl Site {
    fn new(p: DVec2, index: usize) -> Site {
        // The triangulation refuses values that are almost, but not quite, zero.
        let snapped = |x: f64| if x.abs() < 1e-30 { 0.0 } else { x };
        Site { position: Point2::new(snapped(p.x), snapped(p.y)), index: index as u32 }
    }
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Centroid of a convex quadrilateral or of a triangle whose last corner is repeated.
fn centroid(c: &[DVec2; 4]) -> DVec2 {
    let area = |a: DVec2, b: DVec2| (a - c[0]).perp_dot(b - c[0]);
    let (first, second) = (area(c[1], c[2]), area(c[2], c[3]));
    let total = first + second;
    if total.abs() < f64::MIN_POSITIVE {
        return (c[0] + c[1] + c[2] + c[3]) / 4.0;
    }
    c[0] + ((c[1] + c[2] - 2.0 * c[0]) * first + (c[2] + c[3] - 2.0 * c[0]) * second)
        / (3.0 * total)
}

/// A point of the patch's boundary with the leaves that have a corner there.
struct BoundaryPoint {
    point: DVec2,
    leaves: Vec<u32>,
}

/// The leaf corners on the boundary, each once.
fn boundary_points(corners: &[DVec2], leaves: &[Leaf], extent: f64) -> Vec<BoundaryPoint> {
    let n = corners.len();
    // Place along the boundary: number of the edge plus the share of it that lies behind.
    let mut places: Vec<(f64, u32)> = Vec::new();
    for (index, leaf) in leaves.iter().enumerate() {
        for &p in &leaf.corners {
            let edge = (0..n).find_map(|e| {
                let (a, along) = (corners[e], corners[(e + 1) % n] - corners[e]);
                let off = along.perp_dot(p - a).abs();
                let t = along.dot(p - a) / along.length_squared();
                let on = off <= ON_BOUNDARY * extent * along.length() && t < 1.0 - ON_BOUNDARY;
                (on && t > -ON_BOUNDARY).then(|| e as f64 + t.max(0.0))
            });
            places.extend(edge.map(|place| (place, index as u32)));
        }
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut points: Vec<BoundaryPoint> = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for (place, leaf) in places {
        if place - last > 10.0 * ON_BOUNDARY {
            let (e, t) = (place as usize, place.fract());
            let (a, b) = (corners[e], corners[(e + 1) % n]);
            let point = if t <= 10.0 * ON_BOUNDARY { a } else { a.lerp(b, t) };
            points.push(BoundaryPoint { point, leaves: Vec::new() });
            last = place;
        }
        if let Some(point) = points.last_mut().filter(|p| p.leaves.last() != Some(&leaf)) {
            point.leaves.push(leaf);
        }
    }
    points
}

/// Values at all sample points: the leaves' own, then the boundary's, extrapolated.
fn values(
    mesh: &DelaunayTriangulation<Site>,
    points: &[DVec2],
    of_leaves: &[Rgb],
    boundary: &[BoundaryPoint],
) -> Vec<Rgb> {
    let leaves = of_leaves;
    let mut values = of_leaves.to_vec();
    let mut slopes = vec![Slope::default(); leaves.len()];
    for vertex in mesh.vertices() {
        let i = vertex.data().index as usize;
        if i < leaves.len() {
            let neighbours = vertex.out_edges().map(|e| e.to().data().index as usize);
            let steps = neighbours
                .filter(|&j| j < leaves.len())
                .map(|j| (points[j] - points[i], [0, 1, 2].map(|c| values[j][c] - values[i][c])));
            slopes[i] = Slope::fit(steps);
        }
    }
    for b in boundary {
        let mut sum = [0.0; 3];
        for &leaf in &b.leaves {
            let i = leaf as usize;
            let delta = slopes[i].over(b.point - points[i]);
            (0..3).for_each(|c| sum[c] += (values[i][c] + delta[c]).max(0.0));
        }
        values.push(sum.map(|s| s / b.leaves.len() as f64));
    }
    values
}

/// How radiosity changes around a leaf: gradient, and a bound on the change.
#[derive(Clone, Copy, Default)]
struct Slope {
    gradient: [DVec2; 3],
    step_max: Rgb,
}

impl Slope {
    /// Least squares over steps (distance, change), weighted by 1/distance^2; the shortest
    /// gradient where the steps do not determine one.
    fn fit(steps: impl Iterator<Item = (DVec2, Rgb)>) -> Slope {
        let mut normal = DMat2::ZERO;
        let mut slope = Slope::default();
        for (d, change) in steps {
            let weighted = d / d.length_squared();
            normal += DMat2::from_cols(weighted * d.x, weighted * d.y);
            for (c, &change) in change.iter().enumerate() {
                slope.gradient[c] += weighted * change;
                slope.step_max[c] = slope.step_max[c].max(change.abs());
            }
        }
        // The trace of `normal` is the number of steps, so this is small beside it.
        let inverse = (normal + DMat2::from_diagonal(DVec2::splat(1e-9))).inverse();
        slope.gradient = slope.gradient.map(|g| inverse * g);
        slope
    }

    /// Bounded change over `d`.
    fn over(&self, d: DVec2) -> Rgb {
        [0, 1, 2].map(|c| {
            let bound = EXTRAPOLATION_MAX * self.step_max[c];
            self.gradient[c].dot(d).max(-bound).min(bound)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaf(x: f64, y: f64, w: f64, h: f64, b: impl Fn(DVec2) -> f32) -> Leaf {
        let at = |dx, dy| DVec2::new(x + dx, y + dy);
        let value = b(at(w / 2.0, h / 2.0));
        Leaf {
            facet: 0,
            path: 1,
            corners: [at(0.0, 0.0), at(w, 0.0), at(w, h), at(0.0, h)],
            irradiance: [0.0; 3],
            irradiance_gradient: [[0.0; 3]; 2],
            radiosity: [value; 3],
        }
    }

    /// A 2 x 1 rectangle whose left half is split more finely, so that it has T-vertices.
    fn mixed(b: impl Fn(DVec2) -> f32) -> (Vec<DVec2>, Vec<Leaf>) {
        let mut leaves = vec![leaf(1.0, 0.0, 1.0, 0.5, &b), leaf(1.0, 0.5, 1.0, 0.5, &b)];
        for i in 0..64 {
            let (x, y) = (f64::from(i % 8) / 8.0, f64::from(i / 8) / 8.0);
            leaves.push(leaf(x, y, 0.125, 0.125, &b));
        }
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)];
        (corners.map(|(x, y)| DVec2::new(x, y)).to_vec(), leaves)
    }

    fn area(t: &Triangle) -> f64 {
        (t.corners[1] - t.corners[0]).perp_dot(t.corners[2] - t.corners[0]) / 2.0
    }

    #[test]
    fn triangles_cover_the_patch_once() {
        let (corners, leaves) = mixed(|p| p.x as f32);
        let triangles = triangulate(&corners, &leaves, None);
        assert!(triangles.iter().all(|t| area(t) >= 0.0));
        assert!((triangles.iter().map(area).sum::<f64>() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_linear_field_is_reproduced_at_every_corner() {
        let field = |p: DVec2| (3.0 + p.x - 0.5 * p.y) as f32;
        let (corners, leaves) = mixed(field);
        for t in triangulate(&corners, &leaves, None) {
            for (p, b) in t.corners.iter().zip(t.radiosity) {
                assert!((b[0] - field(*p)).abs() < 1e-5, "{b:?} at {p}, not {}", field(*p));
            }
        }
    }

    #[test]
    fn a_constant_field_stays_exactly_constant() {
        let (corners, leaves) = mixed(|_| 0.7);
        let triangles = triangulate(&corners, &leaves, None);
        assert!(triangles.iter().all(|t| t.radiosity == [[0.7; 3]; 3]));
    }

    #[test]
    fn extrapolation_stays_nonnegative() {
        let (corners, leaves) = mixed(|p| if p.x < 0.2 { 0.0 } else { 10.0 });
        let triangles = triangulate(&corners, &leaves, None);
        assert!(triangles.iter().flat_map(|t| t.radiosity).flatten().all(|b| b >= 0.0));
    }

    #[test]
    fn triangular_leaves_of_a_triangle_far_from_the_origin() {
        let corners =
            [(1e6, 1e6), (1e6 + 1.0, 1e6), (1e6, 1e6 + 1.0)].map(|(x, y)| DVec2::new(x, y));
        let [a, b, c] = corners;
        let (ab, bc, ca) = (a.lerp(b, 0.5), b.lerp(c, 0.5), c.lerp(a, 0.5));
        let leaf = |a, b, c, value| Leaf {
            facet: 0,
            path: 1,
            corners: [a, b, c, c],
            irradiance: [0.0; 3],
            irradiance_gradient: [[0.0; 3]; 2],
            radiosity: [value; 3],
        };
        let leaves = [
            leaf(a, ab, ca, 1.0),
            leaf(ab, b, bc, 2.0),
            leaf(ca, bc, c, 3.0),
            leaf(ab, bc, ca, 2.0),
        ];
        let total: f64 = triangulate(&corners, &leaves, None).iter().map(area).sum();
        assert!((total - 0.5).abs() < 1e-6, "{total}");
    }

    /// What is between the corners moves along, linearly along the edges, of a patch of many leaves and of one.
    #[test]
    fn corners_have_what_neighbours_say() {
        let (corners, leaves) = mixed(|_| 1.0);
        let wanted = [[2.0; 3], [1.0; 3], [1.0; 3], [2.0; 3]];
        for leaves in [leaves, vec![leaf(0.0, 0.0, 2.0, 1.0, |_| 1.5)]] {
            let triangles = triangulate(&corners, &leaves, Some(&wanted));
            assert!((triangles.iter().map(area).sum::<f64>() - 2.0).abs() < 1e-12);
            for (p, b) in triangles.iter().flat_map(|t| t.corners.iter().zip(t.radiosity)) {
                let expected = 2.0 - 0.5 * p.x;
                assert!((f64::from(b[0]) - expected).abs() < 1e-5, "{b:?} at {p}");
            }
        }
    }
}
