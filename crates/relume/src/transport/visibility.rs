//! Partial visibility of a pair: which bodies stand in its shaft, and which of its fixed
//! segments they block.

use crate::element::{ElementId, Forest, Kind, WorldElement, WorldView};
use crate::geometry::{Aabb, shaft_meets_box};
use crate::scene::{BodyId, PatchId};

use super::kernel::Simd;
use super::segments::{SEGMENTS, SegmentBundle};
use glam::DVec3;

/// Nodes of the forest's fixed part that may stand between the two ends of a pair: clusters and
/// patch roots. Conservative: what is not below one of them blocks nothing.
pub type Candidates = [u32];

/// The visibility of a pair, kernel-weighted over its segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visibility {
    /// Unoccluded share, in [0, 1].
    pub value: f64,
    /// Standard deviation between the quadrants of the first end, absolute.
    pub spread_a: f64,
    /// Standard deviation between the quadrants of the second end, absolute.
    pub spread_b: f64,
    /// Segments traced; 0 where the shaft is empty, and then `value` is exactly 1.
    pub segments: u32,
}

impl Visibility {
    /// Nothing in the way.
    pub const CLEAR: Visibility =
        Visibility { value: 1.0, spread_a: 0.0, spread_b: 0.0, segments: 0 };
}

/// A pair placed for visibility queries.
#[derive(Clone, Copy, Debug)]
pub struct Shaft<'a> {
    /// The forest.
    pub forest: &'a Forest,
    /// The poses.
    pub view: &'a WorldView,
    /// First end in the world.
    pub a: &'a WorldElement,
    /// Second end in the world.
    pub b: &'a WorldElement,
    /// Both ends in their body's frame, where they ride on one body that may move.
    pub own: Option<(BodyId, &'a WorldElement, &'a WorldElement)>,
    /// Patches of the two ends: they do not block their own light.
    pub patches: (PatchId, PatchId),
}

impl Shaft<'_> {
    fn slack(&self) -> f64 {
        self.a.rounding_m + self.b.rounding_m
    }

    /// Whether a patch could block any segment.
    fn may_be_blocked_by(&self, patch: PatchId, bounds: &Aabb) -> bool {
        if patch == self.patches.0 || patch == self.patches.1 || self.view.is_hidden_twin(patch) {
            return false;
        }
        let slack = self.slack();
        let occluder = self.view.occluder(patch);
        let (a_lo, a_hi) = self.a.span(&occluder.plane);
        let (b_lo, b_hi) = self.b.span(&occluder.plane);
        if a_lo.min(b_lo) >= -slack || a_hi.max(b_hi) <= slack {
            return false;
        }
        let behind =
            |e: &WorldElement| occluder.corners.iter().all(|&c| e.plane.distance(c) <= slack);
        !behind(self.a)
            && !behind(self.b)
            && shaft_meets_box(&self.a.bounds, &self.b.bounds, bounds)
    }

    /// Which of `parents` (candidates of a pair above) remain candidates here, appended to `out`;
    /// clusters large against the shaft are opened.
    pub fn narrow(&self, parents: &Candidates, out: &mut Vec<u32>) {
        let reach = (self.b.centre - self.a.centre).length() + self.a.radius + self.b.radius;
        for &parent in parents {
            self.walk(ElementId(parent), 0.25 * reach, &mut |id| out.push(id.0));
        }
    }

    /// Visits the candidates at or below `id`: patches, and clusters no larger than `keep_m`.
    fn walk(&self, id: ElementId, keep_m: f64, visit: &mut dyn FnMut(ElementId)) {
        let bounds = self.view.fixed_box(id);
        if bounds.is_empty() {
            return;
        }
        if let Some(patch) = self.forest.patch(id) {
            if self.may_be_blocked_by(patch, bounds) {
                visit(id);
            }
            return;
        }
        if self.forest.kind(id) == Kind::Light
            || !shaft_meets_box(&self.a.bounds, &self.b.bounds, bounds)
        {
            return;
        }
        if bounds.diagonal() <= keep_m {
            visit(id);
            return;
        }
        for child in self.forest.children(id) {
            self.walk(ElementId(child), keep_m, visit);
        }
    }

    /// The segments of `bundle` (in the world; `own` in the body's frame) that are blocked.
    fn blocked(
        &self,
        simd: Simd,
        candidates: &Candidates,
        world: &SegmentBundle,
        own: Option<&SegmentBundle>,
    ) -> u16 {
        let mut mask = 0_u16;
        let slack = 2.0 * self.slack();
        for &candidate in candidates {
            self.walk(ElementId(candidate), -1.0, &mut |id| {
                if mask == u16::MAX {
                    return;
                }
                let patch = self.forest.patch(id).expect("walk ends at patches");
                let rides = self.own.filter(|o| o.0 == self.view.patch(patch).body);
                mask |= match (rides, own) {
                    (Some(_), Some(own)) => {
                        own.blocked_by(simd, &self.view.occluder_in_body(patch), slack)
                    }
                    _ => world.blocked_by(simd, &self.view.occluder(patch), slack),
                };
            });
            if mask == u16::MAX {
                break;
            }
        }
        mask
    }
}

/// Visibility of a pair over `2^log2_count` fixed segments; a pair without candidates is clear
/// and traces nothing. `key` names the pair and nothing else.
pub fn visibility(
    simd: Simd,
    shaft: &Shaft<'_>,
    candidates: &Candidates,
    key: u64,
    log2_count: u32,
) -> Visibility {
    if candidates.is_empty() {
        return Visibility::CLEAR;
    }
    let mut tally = Tally::default();
    for block in 0..(1_u32 << log2_count) / SEGMENTS as u32 {
        let world = SegmentBundle::new(shaft.a, shaft.b, key, log2_count, block);
        let own = shaft.own.map(|(_, a, b)| SegmentBundle::new(a, b, key, log2_count, block));
        let mask = shaft.blocked(simd, candidates, &world, own.as_ref());
        // Weights from the body's frame where there is one: they must not follow its motion.
        tally.add(own.as_ref().unwrap_or(&world), mask);
    }
    tally.finish(1 << log2_count)
}

/// Visibility of a punctual light from an element; `segments` come from
/// [`SegmentBundle::to_light`].
pub fn light_visibility(
    simd: Simd,
    shaft: &Shaft<'_>,
    candidates: &Candidates,
    segments: &SegmentBundle,
) -> Visibility {
    if candidates.is_empty() {
        return Visibility::CLEAR;
    }
    let mut tally = Tally::default();
    tally.add(segments, shaft.blocked(simd, candidates, segments, None));
    tally.finish(SEGMENTS as u32)
}

#[derive(Default)]
struct Tally {
    total_a: [f64; 4],
    clear_a: [f64; 4],
    total_b: [f64; 4],
    clear_b: [f64; 4],
}

impl Tally {
    fn add(&mut self, bundle: &SegmentBundle, mask: u16) {
        let dark = bundle.weight.iter().all(|&w| w <= 0.0);
        for k in 0..SEGMENTS {
            // A pair that hardly faces itself has no weights: all segments count alike.
            let weight = if dark { f64::MIN_POSITIVE } else { bundle.weight[k] };
            let clear = if mask >> k & 1 == 1 { 0.0 } else { weight };
            let (qa, qb) = (bundle.quadrant_a[k] as usize, bundle.quadrant_b[k] as usize);
            self.total_a[qa] += weight;
            self.clear_a[qa] += clear;
            self.total_b[qb] += weight;
            self.clear_b[qb] += clear;
        }
    }

    fn finish(&self, segments: u32) -> Visibility {
        let total: f64 = self.total_a.iter().sum();
        let value = (self.clear_a.iter().sum::<f64>() / total).clamp(0.0, 1.0);
        let spread = |clear: &[f64; 4], totals: &[f64; 4]| {
            let mut sum = 0.0;
            for q in 0..4 {
                if totals[q] > 0.0 {
                    let off = clear[q] / totals[q] - value;
                    sum += totals[q] / total * off * off;
                }
            }
            sum.sqrt()
        };
        Visibility {
            value,
            spread_a: spread(&self.clear_a, &self.total_a),
            spread_b: spread(&self.clear_b, &self.total_b),
            segments,
        }
    }
}

/// Whether the open segment from `p` to `q` meets no patch, ends excluded by `slack_m`.
pub fn segment_is_clear(
    view: &WorldView,
    forest: &Forest,
    p: DVec3,
    q: DVec3,
    slack_m: f64,
) -> bool {
    let mut stack = vec![Forest::ROOT];
    let (pb, qb) = (Aabb { lo: p, hi: p }, Aabb { lo: q, hi: q });
    while let Some(id) = stack.pop() {
        let bounds = view.fixed_box(id);
        if bounds.is_empty() || !shaft_meets_box(&pb, &qb, bounds) {
            continue;
        }
        match forest.patch(id) {
            Some(patch) if !view.is_hidden_twin(patch) => {
                if crosses(view, patch, p, q, slack_m) {
                    return false;
                }
            }
            Some(_) => {}
            None => stack.extend(forest.children(id).map(ElementId)),
        }
    }
    true
}

fn crosses(view: &WorldView, patch: PatchId, p: DVec3, q: DVec3, slack_m: f64) -> bool {
    let occluder = view.occluder(patch);
    let (s0, s1) = (occluder.plane.distance(p), occluder.plane.distance(q));
    if s0.min(s1) >= -slack_m || s0.max(s1) <= slack_m {
        return false;
    }
    let x = p + (q - p) * (s0 / (s0 - s1));
    occluder.edges.iter().all(|e| e.distance(x) >= -1e-12 * (e.offset.abs() + 1e-3))
}
