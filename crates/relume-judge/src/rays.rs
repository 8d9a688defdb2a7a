//! Rays against the polygons of a scene: a bounding-volume hierarchy over parallelograms and triangles.

use glam::DVec3;

use crate::polygon::Polygon;

/// Polygons with a hierarchy for rays. Immutable.
pub struct World {
    polygons: Vec<Polygon>,
    normals: Vec<DVec3>,
    shapes: Vec<Shape>,
    nodes: Vec<Node>,
    size_m: f64,
}

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub distance: f64,
    /// The polygon.
    pub polygon: usize,
    /// Whether the ray comes from its front.
    pub front: bool,
}

/// A triangle, or a parallelogram: origin and two sides.
#[derive(Clone, Copy)]
struct Shape {
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    triangle: bool,
    polygon: u32,
}

#[derive(Clone, Copy)]
struct Node {
    min: DVec3,
    max: DVec3,
    /// Of a leaf the first shape; else the second child, the first being the next node.
    start: u32,
    /// Shapes of a leaf; 0 for an inner node.
    count: u32,
}

impl Shape {
    /// Distance at which a ray meets it.
    fn meets(&self, origin: DVec3, d: DVec3) -> Option<f64> {
        let across = d.cross(self.v);
        let determinant = self.u.dot(across);
        let inverse = 1.0 / determinant;
        let from = origin - self.origin;
        let s = from.dot(across) * inverse;
        if !(0.0..=1.0).contains(&s) {
            return None;
        }
        let up = from.cross(self.u);
        let t = d.dot(up) * inverse;
        let most = if self.triangle { 1.0 - s } else { 1.0 };
        ((0.0..=most).contains(&t)).then(|| self.v.dot(up) * inverse)
    }

    fn corners(&self) -> [DVec3; 4] {
        let last = if self.triangle { self.origin } else { self.origin + self.u + self.v };
        [self.origin, self.origin + self.u, self.origin + self.v, last]
    }
}

impl World {
    /// Sets the polygons up for rays.
    pub fn new(polygons: Vec<Polygon>) -> World {
        let mut shapes: Vec<Shape> = polygons
            .iter()
            .enumerate()
            .flat_map(|(k, f)| shapes_of(&f.corners, k as u32))
            .collect();
        let mut nodes = Vec::new();
        if !shapes.is_empty() {
            let count = shapes.len();
            build(&mut shapes, 0..count, &mut nodes);
        }
        let size_m = nodes.first().map_or(0.0, |n: &Node| (n.max - n.min).length());
        let normals = polygons.iter().map(Polygon::normal).collect();
        World { polygons, normals, shapes, nodes, size_m }
    }

    /// The polygons, in the order given.
    pub fn polygons(&self) -> &[Polygon] {
        &self.polygons
    }

    /// Unit normal of a polygon's front.
    pub fn normal(&self, polygon: usize) -> DVec3 {
        self.normals[polygon]
    }

    /// Diagonal of the box around everything, m.
    pub fn size_m(&self) -> f64 {
        self.size_m
    }

    /// The nearest polygon that a ray meets, `except` (where it starts) and its twin aside. Of the two
    /// sides of one polygon, the one that faces the ray.
    pub fn first_hit(&self, origin: DVec3, d: DVec3, except: Option<usize>) -> Option<Hit> {
        let mut best = (f64::INFINITY, u32::MAX);
        self.walk(origin, d, except, f64::INFINITY, |distance, polygon| {
            best = (distance, polygon);
            Some(distance)
        });
        if best.1 == u32::MAX {
            return None;
        }
        let polygon = best.1 as usize;
        let front = self.normals[polygon].dot(d) < 0.0;
        match self.polygons[polygon].twin {
            Some(twin) if !front => Some(Hit { distance: best.0, polygon: twin, front: true }),
            _ => Some(Hit { distance: best.0, polygon, front }),
        }
    }

    /// Whether nothing lies between two points, the polygons they lie on and their twins aside.
    pub fn clear(&self, p: DVec3, q: DVec3, except: [Option<usize>; 2]) -> bool {
        let other = except[1];
        let twin = other.and_then(|k| self.polygons[k].twin);
        let mut clear = true;
        self.walk(p, q - p, except[0], 1.0 - 1e-9, |_, polygon| {
            let own = [other, twin].contains(&Some(polygon as usize));
            clear &= own;
            (!own).then_some(0.0)
        });
        clear
    }

    /// Visits what a ray meets before `most`, in no order; `met` may shorten the ray.
    fn walk(
        &self,
        origin: DVec3,
        d: DVec3,
        except: Option<usize>,
        mut most: f64,
        mut met: impl FnMut(f64, u32) -> Option<f64>,
    ) {
        let twin = except.and_then(|k| self.polygons[k].twin);
        let own = [except, twin].map(|k| k.map_or(u32::MAX, |k| k as u32));
        let least = 1e-12 * self.size_m;
        let inverse = d.recip();
        let mut stack = [0_u32; 64];
        let (mut depth, mut at) = (0, 0_u32);
        if self.nodes.is_empty() || self.nodes[0].entered(origin, inverse, most).is_none() {
            return;
        }
        loop {
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                let range = node.start as usize..(node.start + node.count) as usize;
                for shape in &self.shapes[range] {
                    if own.contains(&shape.polygon) {
                        continue;
                    }
                    if let Some(t) = shape.meets(origin, d)
                        && t > least
                        && t < most
                        && let Some(nearer) = met(t, shape.polygon)
                    {
                        most = nearer;
                    }
                }
            } else {
                let (a, b) = (at + 1, node.start);
                let ta = self.nodes[a as usize].entered(origin, inverse, most);
                let tb = self.nodes[b as usize].entered(origin, inverse, most);
                let (near, far) =
                    if tb < ta && tb.is_some() || ta.is_none() { (b, a) } else { (a, b) };
                let both = ta.is_some() && tb.is_some();
                if both {
                    stack[depth] = far;
                    depth += 1;
                }
                if ta.is_some() || tb.is_some() {
                    at = near;
                    continue;
                }
            }
            if depth == 0 {
                return;
            }
            depth -= 1;
            at = stack[depth];
        }
    }
}

impl Node {
    /// Where a ray enters the box, if it does before `most`.
    #[inline]
    fn entered(&self, origin: DVec3, inverse: DVec3, most: f64) -> Option<f64> {
        let (a, b) = ((self.min - origin) * inverse, (self.max - origin) * inverse);
        let from = a.min(b).max_element().max(0.0);
        let to = a.max(b).min_element() * (1.0 + 1e-15);
        (from <= to && from < most).then_some(from)
    }
}

/// A polygon as one parallelogram where it is one, else as triangles.
fn shapes_of(corners: &[DVec3], polygon: u32) -> Vec<Shape> {
    let origin = corners[0];
    if let &[a, b, c, d] = corners
        && (a + c - b - d).length() <= 1e-9 * (c - a).length()
    {
        return vec![Shape { origin, u: b - a, v: d - a, triangle: false, polygon }];
    }
    let fan =
        |c: &[DVec3]| Shape { origin, u: c[0] - origin, v: c[1] - origin, triangle: true, polygon };
    corners[1..].windows(2).map(fan).collect()
}

fn bounds(shapes: &[Shape]) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let points = shapes.iter().flat_map(Shape::corners);
    points.fold(none, |(min, max), p| (min.min(p), max.max(p)))
}

/// Shapes of a leaf at most, where splitting does not pay.
const LEAF: usize = 4;

/// Builds the hierarchy over a range of shapes, which are put in order: sorted along each axis, split
/// where the surface-area heuristic is least.
fn build(shapes: &mut [Shape], range: std::ops::Range<usize>, nodes: &mut Vec<Node>) {
    let own = &mut shapes[range.clone()];
    let (min, max) = bounds(own);
    let at = nodes.len();
    nodes.push(Node { min, max, start: range.start as u32, count: range.len() as u32 });
    let Some((axis, split)) = best_split(own, area(min, max)) else { return };
    sort(own, axis);
    nodes[at].count = 0;
    build(shapes, range.start..range.start + split, nodes);
    nodes[at].start = nodes.len() as u32;
    build(shapes, range.start + split..range.end, nodes);
}

fn sort(shapes: &mut [Shape], axis: usize) {
    let middle = |s: &Shape| {
        let c = s.corners();
        let lo = c.iter().fold(f64::INFINITY, |m, p| m.min(p[axis]));
        lo + c.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[axis]))
    };
    shapes.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
}

fn area(min: DVec3, max: DVec3) -> f64 {
    let d = max - min;
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Areas of the boxes around the first shape, the first two, and so on.
fn growing_areas<'a>(shapes: impl Iterator<Item = &'a Shape>) -> Vec<f64> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let grown = |s: &Shape| {
        let (lo, hi) = bounds(std::slice::from_ref(s));
        (min, max) = (min.min(lo), max.max(hi));
        area(min, max)
    };
    shapes.map(grown).collect()
}

/// The axis and the number of shapes before the best split; none where a leaf is better.
fn best_split(shapes: &mut [Shape], whole: f64) -> Option<(usize, usize)> {
    let count = shapes.len();
    if count < 2 {
        return None;
    }
    let mut best = (f64::INFINITY, 0, 0);
    for axis in 0..3 {
        sort(shapes, axis);
        let before = growing_areas(shapes.iter());
        let after = growing_areas(shapes.iter().rev());
        for split in 1..count {
            let cost = before[split - 1] * split as f64
                + after[count - split - 1] * (count - split) as f64;
            if cost < best.0 {
                best = (cost, axis, split);
            }
        }
    }
    // A box test costs about as much as a shape.
    let pays = 2.0 * whole + best.0 < whole * count as f64;
    (pays || count > LEAF).then_some((best.1, best.2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;

    fn some_polygons(random: &mut Random) -> Vec<Polygon> {
        let polygon = |k: u32| {
            let at = random.point(DVec3::ZERO, DVec3::ONE);
            let mut side = || random.point(DVec3::splat(-0.2), DVec3::splat(0.2));
            let (u, v) = (side(), side());
            let mut corners = vec![at, at + u, at + u + v, at + v];
            match k % 3 {
                0 => drop(corners.pop()),
                1 => corners[2] -= (u + v) * 0.2,
                _ => {}
            }
            Polygon::black(corners)
        };
        (0..200).map(polygon).collect()
    }

    #[test]
    fn the_hierarchy_finds_what_a_look_at_every_shape_finds() {
        let mut random = Random(3);
        let world = World::new(some_polygons(&mut random));
        let mut hits = 0;
        for _ in 0..2000 {
            let origin = random.point(DVec3::splat(-0.5), DVec3::splat(1.5));
            let d = random.rotation() * DVec3::X;
            let each = world.shapes.iter().filter_map(|s| Some((s.meets(origin, d)?, s.polygon)));
            let nearest = each.filter(|h| h.0 > 0.0).min_by(|a, b| a.0.total_cmp(&b.0));
            let hit = world.first_hit(origin, d, None);
            assert_eq!(hit.map(|h| (h.distance, h.polygon as u32)), nearest);
            if let Some(h) = hit {
                hits += 1;
                let past = origin + d * (h.distance * 1.01);
                assert!(!world.clear(origin, past, [None, None]));
                assert!(world.clear(origin, past, [Some(h.polygon), None]) || nearest.is_some());
                assert!(world.clear(origin, origin + d * (h.distance * 0.99), [None, None]));
            }
        }
        assert!(hits > 200, "{hits}");
    }

    #[test]
    fn a_twin_is_met_on_the_side_that_faces_the_ray() {
        let v = DVec3::new;
        let up = vec![v(0., 0., 0.), v(1., 0., 0.), v(1., 1., 0.), v(0., 1., 0.)];
        let down: Vec<DVec3> = up.iter().rev().copied().collect();
        let mut polygons = vec![Polygon::black(up), Polygon::black(down)];
        (polygons[0].twin, polygons[1].twin) = (Some(1), Some(0));
        let world = World::new(polygons);
        for (z, polygon) in [(1.0, 0), (-1.0, 1)] {
            let hit = world.first_hit(v(0.4, 0.3, z), v(0., 0., -z), None).unwrap();
            assert_eq!((hit.polygon, hit.front), (polygon, true));
            let start = v(0.4, 0.3, 0.0);
            assert_eq!(world.first_hit(start, DVec3::Z * z, Some(0)), None);
            assert!(world.clear(start, v(0.4, 0.3, z), [Some(polygon), None]));
        }
    }
}
