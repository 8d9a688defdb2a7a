//! Visibility of pairs with a group as an end, over fixed segments and rays.

use crate::element::{ElementId, Forest, OccluderPolygon, WorldView, bilinear_area};
use crate::geometry::{Aabb, Pose, ShaftOfBoxes};
use crate::scene::{BodyId, PatchId};
use crate::transport::kernel::Simd;
use crate::transport::segments::{EDGE_OVERLAP, SEGMENTS, SegmentBundle};
use glam::DVec3;
use std::ops::Range;

use super::super::tuning::{FACET_RAYS, GROUP_SEGMENTS, RUNS_MAX};
use super::{Placing, Points, Spread, Towards, factor, scrambled};

/// Query for the occluders between two ends of which one is a group.
pub struct GroupSight<'a> {
    /// The forest.
    pub forest: &'a Forest,
    /// The poses.
    pub view: &'a WorldView,
    /// The body in whose frame both ends are, if that is not the world.
    pub common: Option<BodyId>,
    /// Candidate occluders.
    pub candidates: &'a [u32],
    /// Vector instructions.
    pub simd: Simd,
}

impl GroupSight<'_> {
    /// Visibility between two ends over sixteen fixed segments, and how many were traced: none where nothing may
    /// block, and then it is exactly 1. A pure function of the places and of `key`: candidates only say where to look.
    pub fn visibility(&self, a: &Spread<'_>, b: &Spread<'_>, key: u64) -> (f64, u32) {
        let candidates: Vec<u32> =
            self.candidates.iter().copied().filter(|&id| self.may_block(id, a, b)).collect();
        if candidates.is_empty() {
            return (1.0, 0);
        }
        let from = a.samples(self.forest, self.view, b, key);
        let to = b.samples(self.forest, self.view, a, key.rotate_left(32));
        let mut lines = Vec::with_capacity(SEGMENTS);
        let mut weights = Vec::with_capacity(SEGMENTS);
        for k in 0..GROUP_SEGMENTS as usize {
            let other = (k as u32).reverse_bits() as usize >> 28;
            // What is behind one of the planes is out of sight: candidates may leave out what would block it.
            let way = to.points[other] - from.points[k];
            let faces = from.normals[k].dot(way) > 0.0 && to.normals[other].dot(way) < 0.0;
            let weight = if faces { from.weights[k] * to.weights[other] } else { 0.0 };
            if weight > 0.0 {
                let (points, patches) =
                    ([from.points[k], to.points[other]], [from.patches[k], to.patches[other]]);
                lines.push(Line { points, patches });
                weights.push(weight);
            }
        }
        if lines.is_empty() {
            return (1.0, GROUP_SEGMENTS);
        }
        let blocked = self.blocked(&candidates, &lines, (a, b), &mut Vec::with_capacity(64));
        let (mut clear, mut all) = (0.0, 0.0);
        for (k, weight) in weights.into_iter().enumerate() {
            all += weight;
            clear += if blocked >> k & 1 == 1 { 0.0 } else { weight };
        }
        (clear / all, GROUP_SEGMENTS)
    }

    /// Whether what is at or below a node may be in the way of facets that see the other end: not what a convex group
    /// consists of.
    fn may_block(&self, id: u32, a: &Spread<'_>, b: &Spread<'_>) -> bool {
        let groups = self.forest.groups();
        ![a, b].iter().any(|end| {
            let own = self.forest.group(end.id).filter(|group| group.is_convex);
            own.is_some_and(|group| groups.is_within(ElementId(id), group))
        })
    }

    /// Which of at most sixteen lines of sight are blocked: a bit each.
    fn blocked(
        &self,
        candidates: &[u32],
        lines: &[Line],
        ends: (&Spread<'_>, &Spread<'_>),
        stack: &mut Vec<ElementId>,
    ) -> u16 {
        let (forest, view) = (self.forest, self.view);
        let pose = self.common.map(|body| view.poses()[body.0 as usize].unwrap_or(Pose::IDENTITY));
        let in_world = |line: &Line| match &pose {
            Some(pose) => line.points.map(|p| pose.point(p)),
            None => line.points,
        };
        let mut world = [[DVec3::ZERO; 2]; SEGMENTS];
        world.iter_mut().zip(lines).for_each(|(world, line)| *world = in_world(line));
        let bundle = SegmentBundle::of_ends(&world);
        let margin_m = lines.iter().map(|line| line.slack_m(view)).fold(0.0, f64::max);
        let all = u16::MAX >> (SEGMENTS - lines.len());
        let mut clear = all;
        stack.clear();
        stack.extend(candidates.iter().map(|&id| ElementId(id)));
        while let Some(id) = stack.pop().filter(|_| clear != 0) {
            let bounds = view.fixed_box(id);
            if bounds.is_empty() {
                continue;
            }
            let met = bundle.that_meet(self.simd, bounds, margin_m) & clear;
            if met == 0 || !self.may_block(id.0, ends.0, ends.1) {
                continue;
            }
            let Some(patch) = forest.patch(id) else {
                stack.extend(forest.children(id).map(ElementId));
                continue;
            };
            if view.is_hidden_twin(patch) {
                continue;
            }
            let rides = self.common.is_some() && Some(view.patch(patch).body) == self.common;
            let polygon = if rides { view.occluder_in_body(patch) } else { view.occluder(patch) };
            for k in (0..lines.len()).filter(|k| met >> k & 1 == 1) {
                let line = &lines[k];
                let ends = if rides { line.points } else { world[k] };
                let blocks =
                    !line.patches.contains(&patch.0) && crosses(&polygon, ends, line.slack_m(view));
                clear &= !(u16::from(blocks) << k);
            }
        }
        all & !clear
    }
}

/// A line of sight in the frame of a pair: its ends, and the patches that they are on.
#[derive(Clone, Copy)]
struct Line {
    points: [DVec3; 2],
    patches: [u32; 2],
}

impl Line {
    fn slack_m(&self, view: &WorldView) -> f64 {
        let rounding = |patch: u32| match patch {
            u32::MAX => 0.0,
            patch => view.patch(PatchId(patch)).rounding_m,
        };
        4.0 * (rounding(self.patches[0]) + rounding(self.patches[1]))
    }
}

/// Whether a segment crosses a polygon, and not only comes close to it.
fn crosses(polygon: &OccluderPolygon<'_>, [p, q]: [DVec3; 2], slack_m: f64) -> bool {
    let (s0, s1) = (polygon.plane.distance(p), polygon.plane.distance(q));
    if s0.min(s1) >= -slack_m || s0.max(s1) <= slack_m {
        return false;
    }
    let x = p + (q - p) * (s0 / (s0 - s1));
    polygon.edges.iter().all(|e| e.distance(x) >= -EDGE_OVERLAP * slack_m)
}

/// Visibilities between the facets of two ends.
#[derive(Clone, Debug, Default)]
pub struct FacetSight {
    /// Visibility of the pair: the mean over all rays, by what they carry.
    pub mean: f64,
    /// Visibility of each facet of both ends to the whole of the other; empty for an element.
    pub of_facets: [Vec<f32>; 2],
}

/// Rays of a pair at least, and at most.
const RAYS: (usize, usize) = (32, 4_096);

/// Share of the scene's size that is more than the slack of any segment.
const MARGIN: f64 = 5e-7;

/// One end as rays see it: facets that face the other end, with what they weigh.
struct Aims {
    /// Places among the facets of the end; one of no meaning for an element.
    facets: Vec<u32>,
    /// Running sum of their weights, from 0 to 1.
    sums: Vec<f64>,
    /// Weights, relative to the mean one.
    weights: Vec<f64>,
}

impl Aims {
    fn new(own: &Spread<'_>, other: &Spread<'_>) -> Option<Aims> {
        let Points::Group(leaves, pose) = &own.points else {
            return Some(Aims { facets: vec![0], sums: vec![1.0], weights: vec![1.0] });
        };
        let towards = Towards::new(pose, own, other);
        let (mut facets, mut weights, mut sums, mut sum) = (vec![], vec![], vec![], 0.0);
        for (k, leaf) in leaves.iter().enumerate() {
            let weight = leaf.area_m2 * towards.factor(leaf);
            if weight > 0.0 {
                sum += weight;
                facets.push(k as u32);
                weights.push(weight);
                sums.push(sum);
            }
        }
        let mean = sum / facets.len() as f64;
        sums.iter_mut().for_each(|s| *s /= sum);
        weights.iter_mut().for_each(|w| *w /= mean);
        (sum > 0.0).then_some(Aims { facets, sums, weights })
    }

    /// The facet at a share of the whole weight.
    fn at(&self, share: f64) -> usize {
        self.sums.partition_point(|&sum| sum <= share).min(self.facets.len() - 1)
    }

    /// How many runs the facets are seen in: of one facet each, or of neighbours where there are very many.
    fn runs(&self) -> usize {
        self.facets.len().min(RUNS_MAX)
    }

    /// Run that a facet is in.
    fn run_of(&self, facet: usize) -> usize {
        facet * self.runs() / self.facets.len()
    }

    /// The facets of a run.
    fn run(&self, k: usize) -> Range<usize> {
        let from = |k: usize| (k * self.facets.len()).div_ceil(self.runs());
        from(k)..from(k + 1)
    }

    /// What a run weighs, relative to the mean facet.
    fn run_weight(&self, k: usize) -> f64 {
        self.weights[self.run(k)].iter().sum()
    }
}

/// A point that a ray starts from or ends on.
struct Aim {
    at: DVec3,
    normal: DVec3,
    patch: u32,
    weight: f64,
}

/// Weighted counts of rays that reached each facet of an end.
struct Tally {
    clear: Vec<f64>,
    all: Vec<f64>,
}

impl Tally {
    fn new(len: usize) -> Tally {
        Tally { clear: vec![0.0; len], all: vec![0.0; len] }
    }

    fn add(&mut self, k: usize, weight: f64, clear: bool) {
        self.all[k] += weight;
        self.clear[k] += if clear { weight } else { 0.0 };
    }

    /// Visibility of each facet of an end, which is counted at the place that `place` says: the mean where little is known of it.
    fn by_facet(
        &self,
        (own, aims): (&Spread<'_>, &Aims),
        place: impl Fn(usize) -> usize,
        (mean, doubt): (f64, f64),
    ) -> Vec<f32> {
        let Points::Group(leaves, _) = &own.points else { return Vec::new() };
        let mut out = vec![mean as f32; leaves.len()];
        for (n, &facet) in aims.facets.iter().enumerate() {
            let k = place(n);
            let (clear, all) = (self.clear[k] + doubt * mean, self.all[k] + doubt);
            out[facet as usize] = if all > 0.0 { (clear / all) as f32 } else { mean as f32 };
        }
        out
    }
}

/// A line of sight between facets of two ends.
struct Ray {
    /// Which run of facets of the end that has more of them, and which facet of the other, by its place among those that face.
    facets: (usize, usize),
    from: Aim,
    to: Aim,
}

impl Ray {
    fn line(&self) -> Line {
        let Ray { from, to, .. } = self;
        Line { points: [from.at, to.at], patches: [from.patch, to.patch] }
    }
}

/// The rays of a pair.
struct Rays<'a> {
    /// The end that has more facets, and the other.
    ends: (&'a Spread<'a>, &'a Spread<'a>),
    aims: (Aims, Aims),
    /// Whether the end with more facets is the second of the pair.
    swapped: bool,
    key: u64,
}

impl<'a> Rays<'a> {
    /// `None` if one end shows the other nothing.
    fn new(a: &'a Spread<'a>, b: &'a Spread<'a>, key: u64) -> Option<Rays<'a>> {
        let (of_a, of_b) = (Aims::new(a, b)?, Aims::new(b, a)?);
        Some(match of_b.facets.len() > of_a.facets.len() {
            false => Rays { ends: (a, b), aims: (of_a, of_b), swapped: false, key },
            true => Rays { ends: (b, a), aims: (of_b, of_a), swapped: true, key },
        })
    }

    /// All of them that leave and arrive on the sides that face.
    fn all<'s>(&'s self, sight: &'s GroupSight<'_>) -> impl Iterator<Item = Ray> + 's {
        let count = self.aims.0.runs();
        let each = (RAYS.0.div_ceil(count)).max(FACET_RAYS).min((RAYS.1 / count).max(1));
        let (many, few) = self.ends;
        let ray = move |(round, k): (usize, usize)| {
            let turn = scrambled(self.key, 3 * round as u64 + 1);
            let within = unit((k as u32).reverse_bits() ^ turn);
            let share = (((round + k) % each) as f64 + within) / each as f64;
            let key = self.key.wrapping_add((round * count + k) as u64);
            let run = self.aims.0.run(k);
            let facet = run.start + scrambled(key, 1) as usize % run.len();
            let from = sight.aim((many, few), self.aims.0.facets[facet], key);
            let j = self.aims.1.at(share);
            let key = key.rotate_left(32) ^ self.key;
            let to = sight.aim((few, many), self.aims.1.facets[j], key);
            let way = to.at - from.at;
            let faces = from.normal.dot(way) > 0.0 && to.normal.dot(way) < 0.0;
            faces.then_some(Ray { facets: (k, j), from, to })
        };
        (0..each).flat_map(move |round| (0..count).map(move |k| (round, k))).filter_map(ray)
    }
}

impl GroupSight<'_> {
    /// Visibility of each facet to the other end, by rays from each facet of the end that has more of them, to points of the other by
    /// what they weigh. A pure function of the places and of `key`.
    pub fn by_facets(&self, a: &Spread<'_>, b: &Spread<'_>, key: u64) -> FacetSight {
        let Some(rays) = Rays::new(a, b, key) else { return FacetSight::default() };
        let (many, few) = rays.ends;
        let (of_many, of_few) = (&rays.aims.0, &rays.aims.1);
        let (mut seen_many, mut seen_few) =
            (Tally::new(of_many.runs()), Tally::new(of_few.facets.len()));
        let weights: Vec<f64> = (0..of_many.runs()).map(|k| of_many.run_weight(k)).collect();
        let (mut stack, mut clear_sum, mut sum) = (Vec::with_capacity(64), 0.0, 0.0);
        let mut all = rays.all(self).peekable();
        while all.peek().is_some() {
            let bundle: Vec<Ray> = all.by_ref().take(SEGMENTS).collect();
            let lines: Vec<Line> = bundle.iter().map(Ray::line).collect();
            let blocked = self.blocked(self.candidates, &lines, (many, few), &mut stack);
            for (n, Ray { facets: (k, j), from, to }) in bundle.into_iter().enumerate() {
                let clear = blocked >> n & 1 == 0;
                let weight = from.weight * to.weight;
                let of_ray = weight * weights[k];
                seen_many.add(k, weight, clear);
                seen_few.add(j, of_ray, clear);
                sum += of_ray;
                clear_sum += if clear { of_ray } else { 0.0 };
            }
        }
        if sum <= 0.0 {
            return FacetSight::default();
        }
        let mean = clear_sum / sum;
        let run_of = |n| of_many.run_of(n);
        let of_many = seen_many.by_facet((many, of_many), run_of, (mean, 0.0));
        let of_few = seen_few.by_facet((few, of_few), |n| n, (mean, 1.0));
        let of_facets = if rays.swapped { [of_few, of_many] } else { [of_many, of_few] };
        FacetSight { mean, of_facets }
    }

    /// Whether any ray of [`GroupSight::by_facets`] meets one of some boxes in the world: if not, nothing in them has a part in
    /// what facets see.
    pub fn rays_meet(&self, a: &Spread<'_>, b: &Spread<'_>, key: u64, boxes: &[Aabb]) -> bool {
        let Some(rays) = Rays::new(a, b, key) else { return false };
        let margin_m = MARGIN * self.view.far_m();
        let pose = self.common.and_then(|body| self.view.poses()[body.0 as usize]);
        let world = |p: DVec3| pose.map_or(p, |pose| pose.point(p));
        rays.all(self).any(|ray| {
            let [from, to] = [ray.from.at, ray.to.at].map(|p| Aabb::of([world(p)]));
            let segment = ShaftOfBoxes::new(&from, &to);
            boxes.iter().any(|bounds| segment.meets(bounds, margin_m))
        })
    }

    /// A point of a facet of an end, or of the element that it is.
    fn aim(&self, (own, other): (&Spread<'_>, &Spread<'_>), facet: u32, key: u64) -> Aim {
        let turn = scrambled(key, 0);
        let (s, t) = (unit(turn << 16), unit(turn & 0xffff_0000));
        match &own.points {
            Points::Element(e) => {
                let r2 = own.centre.distance_squared(other.centre);
                let at = e.point(s, t);
                let weight = bilinear_area(&e.corners, s, t).length() / own.area_m2
                    * factor(at, e.plane.normal, other.centre, r2);
                let patch = self.forest.patch(own.id).map_or(u32::MAX, |p| p.0);
                Aim { at, normal: e.plane.normal, patch, weight }
            }
            Points::Group(leaves, pose) => {
                let leaf = &leaves[facet as usize];
                let placing = Placing { forest: self.forest, view: self.view, pose };
                let (patch, at) = placing.point_of(leaf, (s, t));
                Aim { at, normal: pose.direction(leaf.normal), patch, weight: 1.0 }
            }
        }
    }

    /// Nodes that may hold what stands between two ends, wherever they are.
    pub fn between(forest: &Forest, view: &WorldView, a: ElementId, b: ElementId) -> Vec<u32> {
        let (one, other) = (view.end_box(forest.fixed(a)), view.end_box(forest.fixed(b)));
        let shaft = ShaftOfBoxes::new(one, other);
        let margin_m = MARGIN * view.far_m();
        let small_m = 0.5 * one.union(*other).diagonal();
        let mut out = Vec::new();
        let mut stack = vec![Forest::ROOT];
        while let Some(id) = stack.pop() {
            let bounds = view.fixed_box(id);
            if bounds.is_empty() || !shaft.meets(bounds, margin_m) {
                continue;
            }
            match forest.patch(id).is_some() || bounds.diagonal() <= small_m {
                true => out.push(id.0),
                false => stack.extend(forest.children(id).rev().map(ElementId)),
            }
        }
        out
    }
}

/// A number in (0, 1) from 32 bits.
fn unit(bits: u32) -> f64 {
    (f64::from(bits) + 0.5) / 4_294_967_296.0
}
