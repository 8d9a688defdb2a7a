//! Which polygons meet along which sides, in the world at one instant.
//!
//! Corners are welded within a tolerance relative to the scene's size, and sides are cut where a
//! corner of another polygon lies on them, so that one long wall may meet several short ones. Must
//! not know what is wrong with anything.

use glam::DVec3;

use super::weld::{Sets, Weld};
use super::{BodyId, PatchId, Scene};

/// Share of the scene's diagonal below which two corners are one.
const WELD: f64 = 1e-6;

/// A polygon of the scene; of two twins only the first.
pub(super) struct Polygon {
    pub(super) patch: PatchId,
    pub(super) two_sided: bool,
    /// Welded corners, counter-clockwise from the front.
    pub(super) corners: Vec<u32>,
}

/// A piece of a polygon's side, run counter-clockwise.
#[derive(Clone, Copy)]
pub(super) struct Side {
    pub(super) polygon: u32,
    pub(super) start: u32,
    pub(super) end: u32,
}

/// All polygons present, and the sides on which they meet.
pub(super) struct Topology {
    pub(super) points: Vec<DVec3>,
    pub(super) polygons: Vec<Polygon>,
    /// Sides in groups that join the same two points, in the order of those.
    pub(super) sides: Vec<Vec<Side>>,
    /// Component of each polygon: what hangs together along sides.
    pub(super) component: Vec<u32>,
}

impl Topology {
    /// The polygons present at `time_s`.
    pub(super) fn of(scene: &Scene, time_s: f64) -> Topology {
        let diagonal = scene.bounds(time_s).map_or(0.0, |bounds| bounds.diagonal());
        let mut weld = Weld::new(WELD * diagonal);
        let mut polygons = Vec::new();
        for body in (0..scene.bodies.len() as u32).map(BodyId) {
            let Some(pose) = scene.pose(body, time_s) else { continue };
            for (patch, p) in scene.patches_of(body) {
                if p.twin.is_some_and(|twin| twin < patch) {
                    continue;
                }
                let mut corners: Vec<u32> =
                    p.corners_in_body().map(|c| weld.vertex(pose.point(c))).collect();
                corners.dedup();
                polygons.push(Polygon { patch, two_sided: p.twin.is_some(), corners });
            }
        }
        let sides = matched(&weld.points, weld.tolerance, sides_of(&polygons));
        let component = components(polygons.len(), &sides);
        Topology { points: weld.points, polygons, sides, component }
    }
}

pub(super) fn sides_of(polygons: &[Polygon]) -> Vec<Side> {
    let mut sides = Vec::new();
    for (number, polygon) in polygons.iter().enumerate() {
        let n = polygon.corners.len();
        for i in 0..n {
            let (start, end) = (polygon.corners[i], polygon.corners[(i + 1) % n]);
            if start != end {
                sides.push(Side { polygon: number as u32, start, end });
            }
        }
    }
    sides
}

/// Groups sides that join the same points in the order of those; what is left alone is cut where corners lie on it and
/// tried again.
pub(super) fn matched(points: &[DVec3], tolerance: f64, sides: Vec<Side>) -> Vec<Vec<Side>> {
    let (mut groups, alone): (Vec<_>, Vec<_>) =
        grouped(sides).into_iter().partition(|g| g.len() > 1);
    let alone: Vec<Side> = alone.into_iter().flatten().collect();
    groups.extend(grouped(cut(points, tolerance, &alone)));
    groups
}

pub(super) fn grouped(mut sides: Vec<Side>) -> Vec<Vec<Side>> {
    let key = |s: &Side| (s.start.min(s.end), s.start.max(s.end));
    sides.sort_by_key(|s| (key(s), s.polygon));
    sides.chunk_by(|a, b| key(a) == key(b)).map(<[Side]>::to_vec).collect()
}

/// The sides, cut at every one of their corners that lies inside another.
fn cut(points: &[DVec3], tolerance: f64, sides: &[Side]) -> Vec<Side> {
    let at = |v: u32| points[v as usize];
    let mut corners: Vec<u32> = sides.iter().flat_map(|s| [s.start, s.end]).collect();
    corners.sort_unstable();
    corners.dedup();
    let axis = widest_axis(corners.iter().map(|&v| at(v)));
    corners.sort_by(|&a, &b| at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(&b)));
    let mut pieces = Vec::with_capacity(sides.len());
    for side in sides {
        let (a, b) = (at(side.start), at(side.end));
        let (low, high) = (a[axis].min(b[axis]) - tolerance, a[axis].max(b[axis]) + tolerance);
        let first = corners.partition_point(|&v| at(v)[axis] < low);
        let length = a.distance(b);
        let along = (b - a) / length;
        let inside =
            corners[first..].iter().take_while(|&&v| at(v)[axis] <= high).filter_map(|&v| {
                let s = (at(v) - a).dot(along);
                let off = (at(v) - a - along * s).length();
                (s > tolerance && s < length - tolerance && off <= 2.0 * tolerance)
                    .then_some((s, v))
            });
        let mut stops: Vec<(f64, u32)> = inside.collect();
        stops.sort_by(|p, q| p.0.total_cmp(&q.0));
        let mut start = side.start;
        for (_, stop) in stops {
            pieces.push(Side { start, end: stop, ..*side });
            start = stop;
        }
        pieces.push(Side { start, end: side.end, ..*side });
    }
    pieces
}

fn widest_axis(points: impl Iterator<Item = DVec3>) -> usize {
    let (min, max) = points
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
    let spread = max - min;
    (0..3).fold(0, |best, k| if spread[k] > spread[best] { k } else { best })
}

/// Numbers what hangs together along sides, in the order of the first polygon.
pub(super) fn components(polygons: usize, sides: &[Vec<Side>]) -> Vec<u32> {
    let mut sets = Sets::default();
    sets.extend(polygons);
    for pair in sides.iter().flat_map(|group| group.windows(2)) {
        sets.join(pair[0].polygon, pair[1].polygon);
    }
    let roots: Vec<u32> = (0..polygons as u32).map(|p| sets.root(p)).collect();
    let mut numbers = vec![u32::MAX; polygons];
    let mut next = 0;
    for &r in &roots {
        if numbers[r as usize] == u32::MAX {
            numbers[r as usize] = next;
            next += 1;
        }
    }
    roots.into_iter().map(|r| numbers[r as usize]).collect()
}
