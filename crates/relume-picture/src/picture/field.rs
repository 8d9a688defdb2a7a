//! Light over surfaces as one continuous function, from the lines of the leaves.
//!
//! Every leaf has a say up to some way beyond its edges, which falls smoothly to nothing: at each point the lines of those that have
//! are blended by their say, small leaves before large ones. There are no triangles, so that nothing depends on how they are
//! chosen; where neighbours have one line, so has the blend; and a leaf that is split into leaves with its line leaves it as it is.
//! Leaves of one surface in one plane are blended whatever patches they are on.
//!
//! Must not know the view, materials, or what the numbers are.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::{DVec2, DVec3};
use relume_core::scene::{PatchId, SurfaceId};
use relume_core::session::{Gathered, Snapshot};

/// Patches in planes no further apart than this are in one, in parts of the extent of the scene; and cosines this close to 1.
const SAME: f64 = 1e-6;

/// Weight of a leaf that no light arrives at, beside its neighbours: something rests on it, or it would be no brighter beside them.
const DARK: f64 = 1e-3;

/// Square of the sum of the inward normals of two edges that meet at 60 degrees: sharper corners have a say no further than edges.
const SHARP: f64 = 1.0;

/// How far a leaf may lead outside the range of its neighbours' means, in parts of that range.
const BEYOND: f64 = 1.0;

/// Light over all patches of a snapshot.
pub(super) struct Field {
    sheets: Vec<Sheet>,
    /// By patch: its sheet, and its place in it.
    of_patch: Vec<Option<OnSheet>>,
    /// By leaf: its number in its sheet.
    of_leaf: Vec<u32>,
}

/// Where a patch lies in its sheet: `origin + u x + v y` in the sheet's coordinates.
#[derive(Clone, Copy)]
struct OnSheet {
    sheet: u32,
    origin: DVec2,
    u: DVec2,
    v: DVec2,
}

impl OnSheet {
    fn place(&self, p: DVec2) -> DVec2 {
        self.origin + self.turn(p)
    }

    fn turn(&self, d: DVec2) -> DVec2 {
        self.u * d.x + self.v * d.y
    }
}

/// Leaves of one surface in one plane.
#[derive(Default)]
struct Sheet {
    leaves: Vec<Blended>,
    /// Boxes of what leaves have a say in: a heap-shaped tree over the leaves in their order.
    tree: Vec<[DVec2; 2]>,
    /// By leaf: those that have a say somewhere in it.
    beside: Vec<OnceLock<Vec<u32>>>,
    /// By leaf: its gradients as far as its neighbours bear them out.
    borne_out: Vec<OnceLock<[DVec2; 3]>>,
}

/// A leaf as it takes part in the blend.
struct Blended {
    corners: [DVec2; 4],
    centroid: DVec2,
    irradiance: [f64; 3],
    gradient: [DVec2; 3],
    /// `(a, b, c)` for each edge and sharp corner: `a x + b y + c` is 0 where its say ends beyond it and 1 where it is whole.
    edges: [DVec3; 8],
    edge_count: usize,
    weight: f64,
    /// The box around it.
    own: [DVec2; 2],
    /// The box around what it has a say in.
    heard: [DVec2; 2],
}

impl Blended {
    fn new(corners: [DVec2; 4], line: &Gathered, gradient: [DVec2; 3]) -> Blended {
        let shape = relume_core::element::Shape { corners, len: 4 };
        let (centroid, area) = (shape.centroid(), shape.area().abs());
        let mut edges = [DVec3::ZERO; 8];
        let mut edge_count = 0;
        let mut reach = f64::INFINITY;
        for k in 0..4 {
            let (from, to) = (corners[k], corners[(k + 1) % 4]);
            let Some(inward) = (to - from).perp().try_normalize() else { continue };
            edges[edge_count] = inward.extend(-inward.dot(from));
            reach = reach.min(inward.dot(centroid - from));
            edge_count += 1;
        }
        let reach = reach.max(f64::MIN_POSITIVE);
        let own = box_of(&corners, 0.0);
        let mut heard = own;
        let count = edge_count;
        for k in 0..count {
            let (before, after) = (edges[(k + count - 1) % count], edges[k]);
            let Some(corner) = meet(before, after) else { continue };
            let inward = before.truncate() + after.truncate();
            let end = if inward.length_squared() >= SHARP {
                // Where its say ends beyond both.
                box_of(&[corner - inward * (2.0 * reach / inward.length_squared())], 0.0)
            } else {
                let inward = inward.normalize_or_zero();
                edges[edge_count] = inward.extend(-inward.dot(corner));
                edge_count += 1;
                box_of(&[corner], 2.0 * reach)
            };
            heard = [heard[0].min(end[0]), heard[1].max(end[1])];
        }
        for edge in &mut edges[..edge_count] {
            edge.z += reach;
            *edge /= 2.0 * reach;
        }
        let is_dark = line.irradiance == [0.0; 3];
        Blended {
            corners,
            centroid,
            irradiance: line.irradiance.map(f64::from),
            gradient,
            edges,
            edge_count,
            weight: if is_dark { DARK } else { 1.0 } / area.max(f64::MIN_POSITIVE),
            own,
            heard,
        }
    }

    /// Its say at a point: 0 beyond its reach.
    #[inline]
    fn say(&self, p: DVec2) -> f64 {
        let mut say = self.weight;
        for edge in &self.edges[..self.edge_count] {
            let t = edge.dot(p.extend(1.0));
            if t <= 0.0 {
                return 0.0;
            }
            if t < 1.0 {
                say *= t * t * (3.0 - 2.0 * t);
            }
        }
        say
    }
}

/// Where two lines cross; lines as edges are kept.
fn meet(one: DVec3, other: DVec3) -> Option<DVec2> {
    let across = one.cross(other);
    (across.z != 0.0).then(|| across.truncate() / across.z)
}

/// The box around some points, and so much more on every side.
fn box_of(points: &[DVec2], more: f64) -> [DVec2; 2] {
    let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    [low - more, high + more]
}

impl Field {
    /// The light of all leaves: `lines` in the order of [`Snapshot::leaves`].
    ///
    /// Cost: proportional to the leaves.
    pub(super) fn new(snapshot: &Snapshot, lines: &[Gathered]) -> Field {
        let scene = &snapshot.scene;
        let step_m = SAME * scene.bounds_in(&snapshot.world).map_or(1.0, |b| b.diagonal());
        let mut known: BTreeMap<SurfaceId, Vec<(u32, PatchId)>> = BTreeMap::new();
        let mut field = Field {
            sheets: Vec::new(),
            of_patch: vec![None; scene.patches.len()],
            of_leaf: vec![0; snapshot.leaves.len()],
        };
        for (k, patch) in scene.patches.iter().enumerate() {
            let range = snapshot.leaf_offsets[k] as usize..snapshot.leaf_offsets[k + 1] as usize;
            if range.is_empty() {
                continue;
            }
            let of_surface = known.entry(patch.surface).or_default();
            let is_its = |(_, first): &&(u32, PatchId)| {
                let base = &scene.patches[first.0 as usize].frame;
                let off = (patch.frame.origin - base.origin).dot(base.normal);
                base.normal.dot(patch.frame.normal) > 1.0 - SAME && off.abs() <= step_m
            };
            let found = of_surface.iter().find(is_its).copied();
            let (sheet, first) = found.unwrap_or_else(|| {
                let fresh = (field.sheets.len() as u32, PatchId(k as u32));
                field.sheets.push(Sheet { ..Sheet::default() });
                of_surface.push(fresh);
                fresh
            });
            let base = &scene.patches[first.0 as usize].frame;
            let flat = |d: DVec3| DVec2::new(d.dot(base.u), d.dot(base.v));
            let on = OnSheet {
                sheet,
                origin: flat(patch.frame.origin - base.origin),
                u: flat(patch.frame.u),
                v: flat(patch.frame.v),
            };
            field.of_patch[k] = Some(on);
            let sheet = &mut field.sheets[sheet as usize];
            for index in range {
                field.of_leaf[index] = sheet.leaves.len() as u32;
                let line = &lines[index];
                let corners = snapshot.leaves[index].corners.map(|c| on.place(c));
                let [gu, gv] = line.gradient;
                let slope = |c: usize| on.turn(DVec2::new(f64::from(gu[c]), f64::from(gv[c])));
                sheet.leaves.push(Blended::new(corners, line, [slope(0), slope(1), slope(2)]));
            }
        }
        field.sheets.iter_mut().for_each(Sheet::finish);
        field
    }

    /// Whether two patches lie in one plane of one surface, so that light is continuous over both.
    pub(super) fn is_one(&self, patch: PatchId, other: PatchId) -> bool {
        let sheet = |id: PatchId| self.of_patch[id.0 as usize].as_ref().map(|on| on.sheet);
        sheet(patch) == sheet(other)
    }

    /// The light at a point of a patch's frame, in or right beside one of its leaves, never negative.
    pub(super) fn at(&self, patch: PatchId, leaf: usize, p: DVec2) -> [f64; 3] {
        let Some(on) = &self.of_patch[patch.0 as usize] else { return [0.0; 3] };
        self.sheets[on.sheet as usize].at(self.of_leaf[leaf], on.place(p))
    }
}

impl Sheet {
    fn finish(&mut self) {
        let n = self.leaves.len().next_power_of_two();
        let none = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        self.tree = vec![none; 2 * n];
        for (k, leaf) in self.leaves.iter().enumerate() {
            self.tree[n + k] = leaf.heard;
        }
        for k in (1..n).rev() {
            let [a, b] = [self.tree[2 * k], self.tree[2 * k + 1]];
            self.tree[k] = [a[0].min(b[0]), a[1].max(b[1])];
        }
        self.beside = (0..self.leaves.len()).map(|_| OnceLock::new()).collect();
        self.borne_out = (0..self.leaves.len()).map(|_| OnceLock::new()).collect();
    }

    fn at(&self, leaf: u32, p: DVec2) -> [f64; 3] {
        let (mut sum, mut whole) = ([0.0; 3], 0.0);
        for &other in self.beside(leaf) {
            let say = self.leaves[other as usize].say(p);
            if say > 0.0 {
                let value = self.line(other, p);
                (0..3).for_each(|c| sum[c] += say * value[c]);
                whole += say;
            }
        }
        if whole > 0.0 { sum.map(|s| s / whole) } else { self.line(leaf, p) }
    }

    /// What the line of a leaf has at a point, never negative.
    fn line(&self, leaf: u32, p: DVec2) -> [f64; 3] {
        let own = &self.leaves[leaf as usize];
        let gradient = self.borne_out[leaf as usize].get_or_init(|| self.borne_out(leaf));
        let d = p - own.centroid;
        [0, 1, 2].map(|c| (own.irradiance[c] + gradient[c].dot(d)).max(0.0))
    }

    /// The gradients of a leaf, less steep where its corners would be further outside the range of it and its neighbours than
    /// [`BEYOND`] (after Barth and Jespersen 1989): lines of leaves within which light has an edge lead astray.
    fn borne_out(&self, leaf: u32) -> [DVec2; 3] {
        let own = &self.leaves[leaf as usize];
        let beside = self.beside(leaf);
        let of_channel = |c: usize| {
            let mean = own.irradiance[c];
            let means = beside.iter().map(|&k| self.leaves[k as usize].irradiance[c]);
            let (low, high) = means.fold((mean, mean), |(l, h), m| (l.min(m), h.max(m)));
            let more = BEYOND * (high - low);
            let share = |rise: f64| match rise {
                r if r > 0.0 => (high + more - mean) / r,
                r if r < 0.0 => (low - more - mean) / r,
                _ => 1.0,
            };
            let rises = own.corners.iter().map(|&p| own.gradient[c].dot(p - own.centroid));
            let least = rises.map(share).fold(1.0, f64::min);
            own.gradient[c] * if beside.len() > 1 { least } else { 1.0 }
        };
        [of_channel(0), of_channel(1), of_channel(2)]
    }

    /// Leaves that have a say in or right beside a leaf, ascending.
    fn beside(&self, leaf: u32) -> &[u32] {
        self.beside[leaf as usize].get_or_init(|| self.find_beside(leaf))
    }

    fn find_beside(&self, leaf: u32) -> Vec<u32> {
        let own = &self.leaves[leaf as usize];
        let [low, high] = own.own;
        let beyond = (high - low) * 0.05;
        let (low, high) = (low - beyond, high + beyond);
        let n = self.tree.len() / 2;
        let mut found = Vec::new();
        let mut stack = vec![1];
        while let Some(k) = stack.pop() {
            let [l, h] = self.tree[k];
            if !(l.cmplt(high).all() && low.cmplt(h).all()) {
                continue;
            }
            if k >= n {
                found.push((k - n) as u32);
            } else {
                stack.extend([2 * k + 1, 2 * k]);
            }
        }
        found
    }
}
