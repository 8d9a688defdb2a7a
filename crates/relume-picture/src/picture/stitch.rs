//! Points that neighbours have on the edges of a patch, put into its own triangulation, so that no cracks open between them where a graphics
//! processor draws both.
//!
//! Must not know light. Surfaces that rest are neighbours whatever bodies they belong to; of bodies that move, each keeps to itself.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;
use relume_core::geometry::Pose;
use relume_core::scene::{BodyId, Scene};

/// Places are one if they are no further apart than this, in extents of the scene.
const SAME: f64 = 1e-6;

/// Cells of the grid that finds neighbours, along the extent of the scene.
const CELLS: f64 = 128.0;

/// A triangulated patch.
pub(super) struct Piece {
    pub(super) body: BodyId,
    /// In the body's frame, metres.
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A point that was put in: between two of the others, at a share of the way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Between {
    pub(super) ends: [u32; 2],
    pub(super) share: f64,
}

/// Puts into the pieces the points that they lack; for each piece what was appended to its points, in their order.
pub(super) fn stitch(scene: &Scene, time_s: f64, pieces: &mut [Piece]) -> Vec<Vec<Between>> {
    let extent = scene.bounds(time_s).map_or(1.0, |bounds| bounds.diagonal());
    let mut grid = Grid { same: SAME * extent, cell: extent / CELLS, cells: BTreeMap::new() };
    if !extent.is_normal() {
        return vec![Vec::new(); pieces.len()];
    }
    let place = |body: BodyId| match scene.moves(body) {
        true => (Some(body), Pose::IDENTITY),
        false => (None, scene.pose(body, time_s).unwrap_or(Pose::IDENTITY)),
    };
    let rims: Vec<Vec<[u32; 2]>> = pieces.par_iter().map(|piece| rim(&piece.triangles)).collect();
    for (piece, rim) in pieces.iter_mut().zip(&rims) {
        let (group, pose) = place(piece.body);
        for [a, _] in rim {
            let point = &mut piece.points[*a as usize];
            // The same bits for all that meet there.
            *point = pose.inverse_point(grid.one(group, pose.point(*point)));
        }
    }
    let of_piece = |(piece, rim): (&mut Piece, &Vec<[u32; 2]>)| {
        let (group, pose) = place(piece.body);
        let mut added = Vec::new();
        let mut split: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for &ends in rim {
            let [a, b] = ends.map(|k| pose.point(piece.points[k as usize]));
            for (share, at) in grid.on(group, a, b) {
                split.entry(ends).or_default().push(piece.points.len() as u32);
                piece.points.push(pose.inverse_point(at));
                added.push(Between { ends, share });
            }
        }
        if !split.is_empty() {
            let mut out = Vec::with_capacity(piece.triangles.len() + added.len());
            piece.triangles.iter().for_each(|&triangle| cut(triangle, &split, &mut out));
            piece.triangles = out;
        }
        added
    };
    pieces.par_iter_mut().zip(&rims).map(of_piece).collect()
}

/// Edges with a triangle on one side only, from start to end as that triangle has them.
fn rim(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = triangles.iter().flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]]));
    let mut edges: Vec<[u32; 2]> = edges.collect();
    edges.sort_unstable();
    let has = |edge: &[u32; 2]| edges.binary_search(&[edge[1], edge[0]]).is_ok();
    edges.iter().copied().filter(|edge| !has(edge)).collect()
}

/// A triangle as the parts that points on its edges cut it into.
fn cut(triangle: [u32; 3], split: &BTreeMap<[u32; 2], Vec<u32>>, out: &mut Vec<[u32; 3]>) {
    for k in 0..3 {
        let [a, b, c] = [0, 1, 2].map(|i| triangle[(k + i) % 3]);
        if let Some(points) = split.get(&[a, b]) {
            let mut from = a;
            for &to in points.iter().chain([&b]) {
                // Its parts may be cut on the other edges; the new ones have no points.
                cut([from, to, c], split, out);
                from = to;
            }
            return;
        }
    }
    out.push(triangle);
}

/// Points by place, those that rest and those of each body that moves apart.
struct Grid {
    same: f64,
    cell: f64,
    cells: BTreeMap<(Option<BodyId>, [i64; 3]), Vec<DVec3>>,
}

impl Grid {
    fn cell_of(&self, at: DVec3) -> [i64; 3] {
        (at / self.cell).floor().to_array().map(|x| x as i64)
    }

    /// The point that stands for this place: the first that came, which may be this one.
    fn one(&mut self, group: Option<BodyId>, at: DVec3) -> DVec3 {
        let is_it = |point: &DVec3| point.distance(at) <= self.same;
        let found = self.between(group, at, at).find(is_it);
        found.unwrap_or_else(|| {
            self.cells.entry((group, self.cell_of(at))).or_default().push(at);
            at
        })
    }

    /// Points in the cells around the way from one to another.
    fn between(
        &self,
        group: Option<BodyId>,
        a: DVec3,
        b: DVec3,
    ) -> impl Iterator<Item = DVec3> + '_ {
        let [low, high] = [a.min(b) - self.same, a.max(b) + self.same].map(|p| self.cell_of(p));
        let columns = (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]));
        columns.flat_map(move |[x, y]| {
            // Side by side in the map.
            let row = (group, [x, y, low[2]])..=(group, [x, y, high[2]]);
            self.cells.range(row).flat_map(|(_, points)| points.iter().copied())
        })
    }

    /// Points on the way from one to another, each once, with their shares of the way, ascending.
    fn on(&self, group: Option<BodyId>, a: DVec3, b: DVec3) -> Vec<(f64, DVec3)> {
        let way = b - a;
        let length = way.length();
        let mut found = Vec::new();
        if length <= 2.0 * self.same {
            return found;
        }
        for point in self.between(group, a, b) {
            let share = (point - a).dot(way) / (length * length);
            let off = point.distance(a + share * way);
            let inside = share * length > self.same && (1.0 - share) * length > self.same;
            if off <= self.same && inside {
                found.push((share, point));
            }
        }
        found.sort_by(|one, other| one.0.total_cmp(&other.0));
        found.dedup_by(|next, kept| (next.0 - kept.0) * length <= self.same);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_with_points_on_all_edges_is_cut_without_gaps() {
        let split = BTreeMap::from([([0, 1], vec![3, 4]), ([1, 2], vec![5]), ([2, 0], vec![6])]);
        let mut out = Vec::new();
        cut([0, 1, 2], &split, &mut out);
        assert_eq!(out.len(), 5);
        // All rim edges are the parts of the triangle's own.
        let mut rim = rim(&out);
        rim.sort_unstable();
        assert_eq!(rim, [[0, 3], [1, 5], [2, 6], [3, 4], [4, 1], [5, 2], [6, 0]]);
    }
}
