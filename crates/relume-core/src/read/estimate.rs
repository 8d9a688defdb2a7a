//! How good a solution is, said of every frame: what the mesh says at some points beside what arrives there, gathered anew.
//!
//! Most of the squared error of a mesh lies in few leaves, those over which light changes much: points are drawn in proportion
//! to what leaves may err by, and count the less for it. What leaves send is taken at its word here; [`super::accuracy`] follows
//! that too, along walks. Nothing is random: a solution always gets these numbers.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::element::{ElementId, Kind};
use crate::follow::Accuracy;
use crate::scene::PatchId;
use crate::solver::{Linear, Radiosity, Surfaces};
use crate::space::{Sensor, Solved};

use super::accuracy::{all, nine_tenths, point_of, sensor_on};
use super::bends::Bends;
use super::direct;
use super::gather::{Look, Purpose};
use super::tuning::{
    CHECK_COST_PER_PATCH, CHECK_LITTLE, CHECK_POINTS, CHECK_SHARE, DARK, DOUBT_MAX, DRAWN_EVENLY,
};
use crate::geometry::spread;

/// Irradiance that the mesh says at a point of a surface, beside what arrives there if all else is right.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PointError {
    /// The patch that it is on.
    pub patch: PatchId,
    /// Where, metres.
    pub at: DVec3,
    /// Share of the lit area that it stands for, 1; all points together: about 1.
    pub share: f64,
    /// Irradiance by the mesh ([`super::Leaf::irradiance_at`]), W/m2, sum of channels.
    pub said: f64,
    /// Irradiance gathered from the elements with exact visibility, W/m2, sum of channels.
    pub arrives: f64,
    /// By how much the mesh is above it in the light straight from lamps, W/m2, sum of channels; 0 unless asked for.
    pub direct: f64,
}

impl PointError {
    /// Error over the larger of the two, from -1 to 1: a dark place that is said to be bright is wholly wrong, and no more.
    pub fn relative(&self) -> f64 {
        (self.said - self.arrives) / self.said.max(self.arrives).max(f64::MIN_POSITIVE)
    }
}

/// Share of the way from the middle of a leaf to its edge that points keep to: one on an edge between walls sees neither well.
const WITHIN: f64 = 0.99;

/// A leaf with what it says, without bends.
struct Lit {
    patch: PatchId,
    facet: u32,
    leaf: u32,
    area_m2: f64,
    said: Linear,
}

/// Errors of the mesh's irradiance, at as many points as a tenth of a cold build has time for.
pub(super) fn estimate(solved: &Solved) -> Accuracy {
    of_points(&errors(solved, points(solved), false))
}

/// Number of points of which the cost is a tenth of that of a cold build, or less: both are counted, no clock is read.
fn points(solved: &Solved) -> usize {
    let patches = solved.space.scene.patches.len() as f64;
    let in_links = (solved.report.leaves as f64).sqrt() + CHECK_COST_PER_PATCH * patches;
    let points = CHECK_SHARE * solved.report.links as f64 / in_links.max(1.0);
    (points as usize).clamp(CHECK_POINTS.0, CHECK_POINTS.1)
}

/// Errors of what the mesh says at so many points; `by_cause`: with those of the light of lamps. Points that are dark are left out.
pub(super) fn errors(solved: &Solved, points: usize, by_cause: bool) -> Vec<PointError> {
    let (leaves, mean) = lit(solved, &solved.radiosity);
    let lit_leaves: Vec<usize> =
        (0..leaves.len()).filter(|&k| arriving(&leaves[k].said) > DARK * mean).collect();
    let lamps = by_cause.then(|| Lamps::new(solved));
    let shares = shares(&leaves, &lit_leaves);
    let lit_m2: f64 = lit_leaves.iter().map(|&k| leaves[k].area_m2).sum();
    let checker = Checker { solved, dark: DARK * mean, lamps };
    let check = |&(k, leaf): &(usize, usize)| {
        let stands_for = leaves[leaf].area_m2 / lit_m2 / shares[leaf] / points as f64;
        checker.check(k, (&leaves[leaf], leaf), stands_for)
    };
    draw(&lit_leaves, &shares, points).par_iter().filter_map(check).collect()
}

/// For each leaf the share of points that it gets.
fn shares(leaves: &[Lit], lit: &[usize]) -> Vec<f64> {
    let rise = |leaf: &Lit| {
        let slope = leaf.said.gradient.map(|g| all(g.map(f64::from)));
        leaf.area_m2 * (slope[0] * slope[0] + slope[1] * slope[1])
    };
    let doubt = |leaf: &Lit| {
        let h = arriving(&leaf.said);
        leaf.area_m2 * (rise(leaf) / (h * h).max(f64::MIN_POSITIVE)).min(DOUBT_MAX)
    };
    let whole = |of: &dyn Fn(&Lit) -> f64| -> f64 {
        lit.iter().map(|&k| of(&leaves[k])).sum::<f64>().max(f64::MIN_POSITIVE)
    };
    let (area_m2, doubts) = (whole(&|leaf| leaf.area_m2), whole(&doubt));
    let even = if doubts > f64::MIN_POSITIVE { DRAWN_EVENLY } else { 1.0 };
    let mut out = vec![0.0; leaves.len()];
    for &k in lit {
        let leaf = &leaves[k];
        out[k] = even * leaf.area_m2 / area_m2 + (1.0 - even) * doubt(leaf) / doubts;
    }
    out
}

/// Leaves of points by number, spread evenly over the shares.
fn draw(lit: &[usize], shares: &[f64], points: usize) -> Vec<(usize, usize)> {
    let mut out = Vec::with_capacity(points);
    let mut rest = lit.iter().copied().peekable();
    let mut before = 0.0;
    for k in 0..points {
        let target = (k as f64 + spread(k, 0)) / points as f64;
        while let Some(&leaf) = rest.peek()
            && before + shares[leaf] < target
        {
            before += shares[leaf];
            rest.next();
        }
        let Some(&leaf) = rest.peek().or(lit.last()) else { break };
        out.push((k, leaf));
    }
    out
}

/// The light straight from lamps, as leaves have it.
struct Lamps {
    patches: Vec<PatchId>,
    radiosity: Radiosity,
    leaves: Vec<Lit>,
}

impl Lamps {
    fn new(solved: &Solved) -> Lamps {
        let space = &solved.space;
        let of = |&PatchId(k): &PatchId| &space.scene.patches[k as usize];
        let patches: Vec<PatchId> = (0..space.scene.patches.len() as u32)
            .map(PatchId)
            .filter(|k| all(space.world.exitance(&space.scene, of(k))) > 0.0)
            .filter(|k| space.view.is_present(of(k).body))
            .collect();
        let lights = direct::lights(solved, &patches);
        let radiosity = direct::radiosity(solved, &solved.links, &solved.radiosity, &lights);
        let leaves = lit(solved, &radiosity).0;
        Lamps { patches, radiosity, leaves }
    }
}

struct Checker<'a> {
    solved: &'a Solved,
    /// Irradiance that counts as dark, W/m2.
    dark: f64,
    lamps: Option<Lamps>,
}

impl Checker<'_> {
    /// What point number `k` says, on a leaf.
    fn check(&self, k: usize, (leaf, number): (&Lit, usize), share: f64) -> Option<PointError> {
        let space = &self.solved.space;
        let corners = space.forest.shape(ElementId(leaf.leaf)).corners;
        let middle = space.forest.extent(ElementId(leaf.leaf)).centroid;
        let p = middle.lerp(point_of(corners, [spread(k, 1), spread(k, 2)]), WITHIN);
        let at = space.view.patch(leaf.patch).world.point(p);
        let sensor = sensor_on(self.solved, leaf.patch, at);
        let said = self.said(&self.solved.radiosity, leaf, p);
        let little = CHECK_LITTLE * space.tuning.tolerance * said;
        let look = Look::new(self.solved, &sensor, Purpose::Check).rougher_below(little);
        let arrives = all(look.gather().sum);
        (arrives > self.dark).then(|| {
            let direct = self.lamps.as_ref().map_or(0.0, |l| self.direct(l, number, &sensor, p));
            PointError { patch: leaf.patch, at, share, said, arrives, direct }
        })
    }

    /// By how much the light of lamps is too bright at a point, W/m2, sum of channels.
    fn direct(&self, lamps: &Lamps, leaf: usize, sensor: &Sensor, p: DVec2) -> f64 {
        let said = self.said(&lamps.radiosity, &lamps.leaves[leaf], p);
        said - all(Look::new(self.solved, sensor, Purpose::Beyond).direct(&lamps.patches))
    }

    /// What a leaf says at a point of its patch, W/m2, sum of channels: as [`super::snapshot`] reads it.
    fn said(&self, radiosity: &Radiosity, leaf: &Lit, p: DVec2) -> f64 {
        let space = &self.solved.space;
        let bends = Bends { solved: self.solved, links: &self.solved.links, radiosity };
        let h = leaf.said.plus(&bends.of_leaf(leaf.facet, leaf.leaf));
        let d = p - space.forest.extent(ElementId(leaf.leaf)).centroid;
        all(h.at(d.x as f32, d.y as f32).map(|h| f64::from(h.max(0.0))))
    }
}

fn of_points(found: &[PointError]) -> Accuracy {
    let whole = found.iter().map(|f| f.share).sum::<f64>().max(f64::MIN_POSITIVE);
    let mean_of = |of: &dyn Fn(&PointError) -> f64| {
        found.iter().map(|f| f.share * of(f)).sum::<f64>() / whole
    };
    let size = |f: &&PointError| f.relative().abs();
    let worst = found.iter().max_by(|a, b| size(a).total_cmp(&size(b)));
    Accuracy {
        points: found.len() as u32,
        rms: mean_of(&|f| f.relative().powi(2)).sqrt(),
        nine_tenths: nine_tenths(found.iter().map(|f| (f.relative().abs(), f.share)).collect()),
        // Nothing scatters.
        resolved: 0.0,
        mean: mean_of(&PointError::relative),
        largest: worst.map_or(0.0, PointError::relative),
        largest_at: worst.map_or([0.0; 3], |f| f.at.to_array()),
    }
}

fn arriving(h: &Linear) -> f64 {
    all(h.mean.map(|h| f64::from(h.max(0.0))))
}

/// All leaves with what a solution says of them, about their own centroids, and the mean irradiance, W/m2, sum of channels.
fn lit(solved: &Solved, radiosity: &Radiosity) -> (Vec<Lit>, f64) {
    let space = &solved.space;
    let surfaces = space.surfaces();
    let mut out = Vec::new();
    for k in 0..space.scene.patches.len() as u32 {
        let patch = PatchId(k);
        let body = space.scene.patches[k as usize].body;
        if !space.view.is_present(body) || space.scene.is_distant(body) {
            continue;
        }
        let mut stack = vec![space.forest.patch_root(patch)];
        while let Some(id) = stack.pop() {
            if space.forest.kind(id) == Kind::Polygon {
                stack.extend(space.forest.children(id).rev().map(ElementId));
                continue;
            }
            radiosity.irradiances(&surfaces, id.0, &mut |leaf, h| {
                let at = space.forest.extent(ElementId(leaf)).centroid;
                let said = h.moved(&surfaces.place(leaf), [at.x, at.y]);
                let area_m2 = space.forest.shape(ElementId(leaf)).area();
                out.push(Lit { patch, facet: id.0, leaf, area_m2, said });
            });
        }
    }
    let area_m2 = out.iter().map(|leaf| leaf.area_m2).sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = out.iter().map(|leaf| leaf.area_m2 * arriving(&leaf.said)).sum::<f64>() / area_m2;
    (out, mean)
}
