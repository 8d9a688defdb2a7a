//! Coplanar neighbouring triangles become convex polygons: a cube is 6 quads, not 12 triangles.
//!
//! Pure geometry and topology; must not know nodes, materials or files. Deterministic: everything
//! is ordered by size, then by index.

use glam::DVec3;

use super::flatten::{FLATNESS, area_vector, flatten};

/// The polygons of a triangle mesh, and how many triangles were left out.
pub struct Merged {
    /// Convex loops, counter-clockwise from the front, in the order of their first triangles.
    pub polygons: Vec<Vec<DVec3>>,
    /// The polygon that each triangle is in; `None` for those left out.
    pub polygon_of: Vec<Option<u32>>,
    /// Triangles left out because they have no area relative to their longest side, or repeat an earlier one.
    pub degenerate: usize,
}

/// Merges the triangles (indices into `points`, counter-clockwise from the front).
///
/// Vertices are welded where their positions are equal, which is how exporters split them. A
/// coplanar region with a convex outline becomes one polygon; any other is cut into convex ones by
/// removing the longest sides first (Hertel and Mehlhorn 1983: at most four times the fewest). Of
/// triangles on the same corners that face the same way the first counts. O(n log n).
pub fn merge(points: &[DVec3], triangles: &[[u32; 3]]) -> Merged {
    merge_alike(points, triangles, &|_, _| true)
}

/// Merges only triangles that are alike: `alike(a, b)` of two of their numbers, of which the first is the larger one that
/// a region grows from.
pub fn merge_alike(
    points: &[DVec3],
    triangles: &[[u32; 3]],
    alike: &dyn Fn(usize, usize) -> bool,
) -> Merged {
    let welded = weld(points);
    let has_area = |k: &usize| has_area(triangles[*k].map(|v| points[v as usize]));
    let numbers: Vec<usize> = (0..triangles.len()).filter(has_area).collect();
    let numbers = firsts(numbers, &|k| triangles[k].map(|v| welded[v as usize]));
    let kept: Vec<[u32; 3]> =
        numbers.iter().map(|&k| triangles[k].map(|v| welded[v as usize])).collect();
    let degenerate = triangles.len() - kept.len();
    let mut mesh = Mesh::new(points, &kept);
    let regions =
        mesh.regions(&|seed, other| alike(numbers[seed as usize], numbers[other as usize]));
    let mut polygons: Vec<(u32, Vec<DVec3>)> = Vec::new();
    for (normal, region) in &regions {
        match mesh.convex_outline(region) {
            Some(outline) => {
                region.iter().for_each(|&t| mesh.join_triangles(region[0], t));
                polygons.push((region[0], outline));
            }
            None => mesh.cut_convex(*normal, region, &mut polygons),
        }
    }
    polygons.sort_by_key(|p| p.0);
    let firsts: Vec<u32> = polygons.iter().map(|p| mesh.joined_with(p.0)).collect();
    let mut number = vec![NONE; kept.len()];
    (0..).zip(&firsts).for_each(|(k, &first)| number[first as usize] = k);
    let mut polygon_of = vec![None; triangles.len()];
    for (t, &k) in numbers.iter().enumerate() {
        polygon_of[k] = Some(number[mesh.joined_with(t as u32) as usize]);
    }
    Merged { polygons: polygons.into_iter().map(|p| p.1).collect(), polygon_of, degenerate }
}

/// The first of those triangles, ascending, that have the same corners in the same order, whichever of them comes first.
fn firsts(mut triangles: Vec<usize>, corners: &dyn Fn(usize) -> [u32; 3]) -> Vec<usize> {
    let key = |&k: &usize| {
        let mut corners = corners(k);
        let least = (0..3).min_by_key(|&c| corners[c]).expect("it has three");
        corners.rotate_left(least);
        (corners, k)
    };
    triangles.sort_unstable_by_key(key);
    triangles.dedup_by_key(|k| key(k).0);
    triangles.sort_unstable();
    triangles
}

/// For each point the first index with the same position (0 and -0 are the same).
fn weld(points: &[DVec3]) -> Vec<u32> {
    let key = |i: u32| (points[i as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by_key(|&i| (key(i), i));
    let mut welded = vec![0; points.len()];
    let mut first = 0;
    for (n, &i) in order.iter().enumerate() {
        if n == 0 || key(i) != key(first) {
            first = i;
        }
        welded[i as usize] = first;
    }
    welded
}

/// Whether a triangle's height over its longest side is more than rounding.
fn has_area(corners: [DVec3; 3]) -> bool {
    let longest = longest_side(corners);
    let unit = corners.map(|c| (c - corners[0]) / longest);
    area_vector(&unit).length() > 0.2 * FLATNESS
}

fn longest_side(c: [DVec3; 3]) -> f64 {
    c[0].distance(c[1]).max(c[1].distance(c[2])).max(c[2].distance(c[0]))
}

const NONE: u32 = u32::MAX;

/// A triangle mesh as half-edges: `3 t + k` runs from corner k of triangle t to the next corner.
struct Mesh<'a> {
    points: &'a [DVec3],
    /// Vertex where a half-edge starts.
    start: Vec<u32>,
    /// The same side run the other way by the one neighbour, or `NONE`.
    twin: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Region of a triangle.
    region: Vec<u32>,
    /// A triangle of the same polygon, from which others may lead on; the last leads to itself.
    joined: Vec<u32>,
}

impl<'a> Mesh<'a> {
    fn new(points: &'a [DVec3], triangles: &[[u32; 3]]) -> Mesh<'a> {
        let start: Vec<u32> = triangles.iter().flatten().copied().collect();
        let n = start.len() as u32;
        let next: Vec<u32> = (0..n).map(|h| if h % 3 == 2 { h - 2 } else { h + 1 }).collect();
        let previous = (0..n).map(|h| if h % 3 == 0 { h + 2 } else { h - 1 }).collect();
        let twin = twins(&start, &next);
        let region = vec![NONE; triangles.len()];
        let joined = (0..triangles.len() as u32).collect();
        Mesh { points, start, twin, next, previous, region, joined }
    }

    /// The triangle that stands for all that are joined with this one.
    fn joined_with(&self, mut triangle: u32) -> u32 {
        while self.joined[triangle as usize] != triangle {
            triangle = self.joined[triangle as usize];
        }
        triangle
    }

    fn join_triangles(&mut self, one: u32, other: u32) {
        let (one, other) = (self.joined_with(one), self.joined_with(other));
        // Paths stay short: everything leads straight to a region's first where it can.
        let (first, last) = (one.min(other), one.max(other));
        self.joined[last as usize] = first;
    }

    fn from(&self, h: u32) -> DVec3 {
        self.points[self.start[h as usize] as usize]
    }

    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        [0, 1, 2].map(|k| self.from(3 * triangle + k))
    }

    fn area_vector(&self, triangle: u32) -> DVec3 {
        area_vector(&self.corners(triangle))
    }

    /// Coplanar connected triangles, grown from the largest ones; each with its normal and sorted.
    fn regions(&mut self, alike: &dyn Fn(u32, u32) -> bool) -> Vec<(DVec3, Vec<u32>)> {
        let area: Vec<f64> =
            (0..self.region.len() as u32).map(|t| self.area_vector(t).length()).collect();
        let mut order: Vec<u32> = (0..area.len() as u32).collect();
        order.sort_by(|&a, &b| area[b as usize].total_cmp(&area[a as usize]).then(a.cmp(&b)));
        let mut regions = Vec::new();
        for seed in order {
            if self.region[seed as usize] == NONE {
                let plane = Plane::of(self.corners(seed));
                let members = self.grow(seed, &plane, regions.len() as u32, alike);
                regions.push((plane.normal, members));
            }
        }
        regions
    }

    fn grow(
        &mut self,
        seed: u32,
        plane: &Plane,
        region: u32,
        alike: &dyn Fn(u32, u32) -> bool,
    ) -> Vec<u32> {
        let mut members = vec![seed];
        self.region[seed as usize] = region;
        let mut looked_at = 0;
        while looked_at < members.len() {
            let triangle = members[looked_at];
            looked_at += 1;
            for h in 3 * triangle..3 * triangle + 3 {
                let neighbour = self.twin[h as usize] / 3;
                let free = self.twin[h as usize] != NONE && self.region[neighbour as usize] == NONE;
                if free
                    && self.area_vector(neighbour).dot(plane.normal) > 0.0
                    && self.corners(neighbour).iter().all(|&p| plane.holds(p))
                    && alike(seed, neighbour)
                {
                    self.region[neighbour as usize] = region;
                    members.push(neighbour);
                }
            }
        }
        members.sort_unstable();
        members
    }

    /// Whether both sides of the half-edge belong to one region.
    fn inside(&self, h: u32) -> bool {
        let twin = self.twin[h as usize];
        twin != NONE && self.region[twin as usize / 3] == self.region[h as usize / 3]
    }

    /// The outline of a region, if it is one convex loop.
    fn convex_outline(&self, region: &[u32]) -> Option<Vec<DVec3>> {
        let sides = || region.iter().flat_map(|&t| 3 * t..3 * t + 3).filter(|&h| !self.inside(h));
        let first = sides().next()?;
        let mut outline = Vec::new();
        let mut h = first;
        loop {
            outline.push(self.from(h));
            h = self.next[h as usize];
            while self.inside(h) {
                h = self.next[self.twin[h as usize] as usize];
            }
            if h == first {
                break;
            }
        }
        (outline.len() == sides().count() && flatten(&outline).is_ok()).then_some(outline)
    }

    /// Cuts a region into convex polygons: sides between two are removed, the longest first, where
    /// what is left stays convex.
    fn cut_convex(&mut self, normal: DVec3, region: &[u32], polygons: &mut Vec<(u32, Vec<DVec3>)>) {
        let half_edges = || region.iter().flat_map(|&t| 3 * t..3 * t + 3);
        let mut inner: Vec<u32> =
            half_edges().filter(|&h| self.inside(h) && h < self.twin[h as usize]).collect();
        let length = |h: u32| self.from(h).distance(self.from(self.next[h as usize]));
        let lengths: Vec<f64> = inner.iter().map(|&h| length(h)).collect();
        let mut order: Vec<usize> = (0..inner.len()).collect();
        order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]).then(a.cmp(&b)));
        inner = order.into_iter().map(|i| inner[i]).collect();
        let mut removed: Vec<u32> = Vec::new();
        let mut gone = vec![false; 3 * region.len()];
        let slot = |h: u32| 3 * region.partition_point(|&t| t < h / 3) + (h % 3) as usize;
        for h in inner {
            if !gone[slot(h)] {
                removed.clear();
                self.remove(h, normal, &mut removed);
                removed.iter().for_each(|&r| gone[slot(r)] = true);
            }
        }
        for first in half_edges() {
            if gone[slot(first)] {
                continue;
            }
            let mut outline = Vec::new();
            let mut h = first;
            while !gone[slot(h)] {
                gone[slot(h)] = true;
                outline.push(self.from(h));
                h = self.next[h as usize];
            }
            polygons.push((first / 3, outline));
        }
    }

    /// Joins the polygons on both sides of `h` if the result is convex; lists what was removed.
    fn remove(&mut self, h: u32, normal: DVec3, removed: &mut Vec<u32>) {
        let t = self.twin[h as usize];
        // Two polygons may share several successive sides (collinear ones): all go at once.
        let (mut last, mut last_twin, mut first, mut first_twin) = (h, t, h, t);
        let mut run = vec![h, t];
        while self.twin[self.next[last as usize] as usize] == self.previous[last_twin as usize]
            && self.next[last as usize] != first
        {
            (last, last_twin) = (self.next[last as usize], self.previous[last_twin as usize]);
            run.extend([last, last_twin]);
        }
        while self.twin[self.previous[first as usize] as usize] == self.next[first_twin as usize]
            && self.previous[first as usize] != last
        {
            (first, first_twin) = (self.previous[first as usize], self.next[first_twin as usize]);
            run.extend([first, first_twin]);
        }
        let (into_a, out_of_a) = (self.previous[first as usize], self.next[first_twin as usize]);
        let (into_b, out_of_b) = (self.previous[last_twin as usize], self.next[last as usize]);
        let closed = run.contains(&into_a) || run.contains(&into_b);
        if closed
            || !self.turns_left(into_a, out_of_a, normal)
            || !self.turns_left(into_b, out_of_b, normal)
        {
            return;
        }
        self.join(into_a, out_of_a);
        self.join(into_b, out_of_b);
        self.join_triangles(h / 3, t / 3);
        removed.append(&mut run);
    }

    fn join(&mut self, before: u32, after: u32) {
        self.next[before as usize] = after;
        self.previous[after as usize] = before;
    }

    /// Whether the corner between two half-edges is convex or straight up to rounding.
    fn turns_left(&self, into: u32, out_of: u32, normal: DVec3) -> bool {
        let (a, b, c) = (self.from(into), self.from(out_of), self.from(self.next[out_of as usize]));
        let chord = c - a;
        (b - a).cross(c - b).dot(normal) >= -0.05 * FLATNESS * chord.length_squared()
    }
}

/// The plane of a region's largest triangle.
struct Plane {
    origin: DVec3,
    normal: DVec3,
    extent: f64,
}

impl Plane {
    fn of(corners: [DVec3; 3]) -> Plane {
        let extent = longest_side(corners);
        let unit = corners.map(|c| (c - corners[0]) / extent);
        Plane { origin: corners[0], normal: area_vector(&unit).normalize(), extent }
    }

    /// Whether a point lies in the plane up to the rounding of 32-bit coordinates.
    fn holds(&self, p: DVec3) -> bool {
        let reach = self.extent.max(p.distance(self.origin));
        let rounding = f64::from(f32::EPSILON) * p.abs().max_element();
        (p - self.origin).dot(self.normal).abs() <= 0.5 * FLATNESS * reach + rounding
    }
}

/// Pairs half-edges that run along one side in opposite directions, where exactly two do.
fn twins(start: &[u32], next: &[u32]) -> Vec<u32> {
    let end = |h: u32| start[next[h as usize] as usize];
    let key = |h: u32| {
        let (a, b) = (start[h as usize], end(h));
        (a.min(b), a.max(b))
    };
    let mut order: Vec<u32> = (0..start.len() as u32).collect();
    order.sort_by_key(|&h| (key(h), h));
    let mut twin = vec![NONE; start.len()];
    for side in order.chunk_by(|&g, &h| key(g) == key(h)) {
        if let [g, h] = *side
            && start[g as usize] == end(h)
        {
            twin[g as usize] = h;
            twin[h as usize] = g;
        }
    }
    twin
}

#[cfg(test)]
mod tests;
