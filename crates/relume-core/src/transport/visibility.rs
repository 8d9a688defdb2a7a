//! Visibility V of a pair over fixed segments ([`visibility`]), past blockers that are listed.

use glam::{DVec2, DVec3};

use crate::element::{ElementId, Forest, WorldView};
use crate::geometry::{Aabb, shaft_meets_box};
use crate::scene::PatchId;

use super::kernel::Simd;
use super::segments::{EDGE_OVERLAP, SEGMENTS, SegmentBundle};
use super::shaft::{Lifted, Shaft, TestFrame};
use super::share::Visibility;
use super::tally::Tally;

impl<'a> Shaft<'a> {
    /// The segments of `bundle` (in the world; `own` in the body's frame) that are blocked.
    fn blocked(
        &self,
        simd: Simd,
        blockers: &[(bool, Lifted<'_>)],
        world: &SegmentBundle,
        own: Option<&SegmentBundle>,
    ) -> u16 {
        let mut mask = 0_u16;
        let slack = 2.0 * self.slack();
        for (rides, lifted) in blockers {
            if mask == u16::MAX {
                break;
            }
            let bundle = own.filter(|_| *rides).unwrap_or(world);
            mask |= bundle.blocked_by(simd, &lifted.polygon(), slack);
        }
        mask
    }
}

/// Visibility of a pair over `2^log2_count` fixed segments; a pair without blockers is clear
/// and traces nothing. `key` names the pair and nothing else.
pub fn visibility(
    simd: Simd,
    shaft: &Shaft<'_>,
    blockers: &[PatchId],
    key: u64,
    log2_count: u32,
) -> Visibility {
    if blockers.is_empty() {
        return Visibility::CLEAR;
    }
    let TestFrame { a, b, .. } = shaft.own_frame();
    let mut tally = Tally::default();
    let lifted: Vec<_> = blockers.iter().map(|&patch| shaft.lifted(patch)).collect();
    for block in 0..(1_u32 << log2_count) / SEGMENTS as u32 {
        let world = SegmentBundle::new(shaft.a, shaft.b, key, log2_count, block);
        let own = shaft.own.map(|(_, a, b)| SegmentBundle::new(a, b, key, log2_count, block));
        let mask = shaft.blocked(simd, &lifted, &world, own.as_ref());
        // Weights from the body's frame where there is one: they must not follow its motion.
        tally.add(own.as_ref().unwrap_or(&world), mask, a, b);
    }
    tally.finish(1 << log2_count, a, b)
}

/// Visibility of a punctual light (the second end of the shaft) from an element; `segments` come
/// from [`SegmentBundle::to_light`]. Where none of them gets through it is found out whether anything does: `from` is
/// where the light is, or far enough towards it for its rays to be parallel.
pub fn light_visibility(
    simd: Simd,
    shaft: &Shaft<'_>,
    blockers: &[PatchId],
    (segments, from): (&SegmentBundle, DVec3),
) -> Visibility {
    if blockers.is_empty() {
        return Visibility::CLEAR;
    }
    let mut tally = Tally::default();
    let lifted: Vec<_> = blockers.iter().map(|&patch| shaft.lifted(patch)).collect();
    let blocked = shaft.blocked(simd, &lifted, segments, None);
    if blocked == u16::MAX && shaft.is_hidden_from(from, blockers) {
        return Visibility { value: 0.0, segments: 1, ..Visibility::CLEAR };
    }
    tally.add(segments, blocked, shaft.a, shaft.a);
    let both = tally.finish(SEGMENTS as u32, shaft.a, shaft.a);
    Visibility { gradient_b: DVec2::ZERO, spread_b: 0.0, ..both }
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
    occluder.edges.iter().all(|e| e.distance(x) >= -EDGE_OVERLAP * slack_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{Shape, WorldElement};
    use crate::scene::{Scene, SceneBuilder};
    use crate::transport::{CLIPPED_MAX, Candidates, Crowd, clipping};
    use glam::DQuat;

    /// Floor and ceiling, both double-sided if wanted, and what `fill` adds: V of their inner sides.
    fn floor_to_ceiling(double_sided: bool, fill: impl Fn(&mut SceneBuilder)) -> f64 {
        let mut b = SceneBuilder::new("floor and ceiling");
        let node = b.node("scratch", None, DVec3::ZERO, DQuat::IDENTITY);
        let grey = match double_sided {
            true => b.double_sided_material("grey", [0.5; 3], [0.0; 3]),
            false => b.material("grey", [0.5; 3], [0.0; 3]),
        };
        for (name, z) in [("floor", 0.0), ("ceiling", 1.0)] {
            let mut corners =
                [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z));
            if z > 0.0 {
                corners.reverse();
            }
            b.polygon(node, name, grey, &corners);
        }
        fill(&mut b);
        let scene = b.build().unwrap();
        let forest = Forest::new(&scene);
        let view = WorldView::new(&scene, &forest, &scene.at(0.0));
        let inner = |z: f64, up: f64| {
            let is = |p: &PatchId| {
                let frame = view.patch(*p).world;
                (frame.origin.z - z).abs() < 1e-9 && frame.normal.z * up > 0.5
            };
            (0..scene.patches.len() as u32).map(PatchId).find(is).unwrap()
        };
        let patches = (inner(0.0, 1.0), inner(1.0, -1.0));
        // Whole, whatever stands on them.
        let whole = |p: PatchId| Shape::new(&scene.patches[p.0 as usize].corners);
        let place = |p| WorldElement::of_shape(view.patch(p), &whole(p), false);
        let (a, b) = (place(patches.0), place(patches.1));
        let shaft = Shaft { forest: &forest, view: &view, a: &a, b: &b, own: None, patches };
        let blockers = shaft.blockers(&[Forest::ROOT.0]);
        // Segments are noisy: the mean over pairs of sixteen names.
        let key = |k: u64| k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let trace = |k| visibility(Simd::detect(), &shaft, &blockers, key(k), 6).value;
        let traced = (1..=16).map(trace).sum::<f64>() / 16.0;
        assert!(shaft.occluders(&blockers) <= CLIPPED_MAX);
        let clipped = clipping(Simd::detect(), &shaft, &blockers).visibility(8).value;
        assert!((traced - clipped).abs() < 0.04, "{traced} {clipped}");
        clipped
    }

    fn cuboid(b: &mut SceneBuilder, lo: f64, hi: f64, z: [f64; 2]) {
        let grey = b.material("body", [0.5; 3], [0.0; 3]);
        let node = b.node(&format!("body {lo}"), None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid(node, "body", grey, DVec3::new(lo, lo, z[0]), DVec3::new(hi, hi, z[1]));
    }

    #[test]
    fn a_pillar_hides_what_it_stands_on_whatever_is_in_it() {
        let pillar = |b: &mut SceneBuilder| cuboid(b, 0.2, 0.7, [0.0, 1.0]);
        let alone = floor_to_ceiling(false, pillar);
        let filled = floor_to_ceiling(false, |b| {
            pillar(b);
            cuboid(b, 0.3, 0.4, [0.3, 0.6]);
        });
        // 200,000 random segments give 0.327.
        assert!((alone - 0.327).abs() < 2e-3, "{alone}");
        assert!((alone - filled).abs() < 1e-9, "{alone} {filled}");
        assert!(floor_to_ceiling(false, |b| cuboid(b, 0.0, 1.0, [0.0, 1.0])) < 1e-4);
    }

    /// Two twisted tubes of slivers through each other.
    fn twisted_tubes() -> Scene {
        let mut b = SceneBuilder::new("slivers");
        let grey = b.double_sided_material("grey", [0.5; 3], [0.0; 3]);
        let node = b.node("slivers", None, DVec3::ZERO, DQuat::IDENTITY);
        let ring = |k: usize, x: f64, turned: bool| {
            let (sin, cos) = (k as f64 * std::f64::consts::TAU / 12.0 + x).sin_cos();
            let p = DVec3::new(x, 0.3 * sin, 0.3 * cos);
            if turned { DVec3::new(p.z, p.x, p.y) } else { p }
        };
        for k in 0..24 {
            let p = |by: usize, x| ring(k + by, x, k >= 12);
            b.polygon(node, &format!("{k} up"), grey, &[p(0, -1.0), p(1, -1.0), p(1, 1.0)]);
            b.polygon(node, &format!("{k} down"), grey, &[p(0, -1.0), p(1, 1.0), p(0, 1.0)]);
        }
        b.build().unwrap()
    }

    /// What blocks a pair is not listed where it is more than asked for, and segments find it all the same.
    fn past_a_crowd(pair: &Shaft<'_>, handed: &Candidates, blockers: &[PatchId]) {
        let Some(most) = blockers.len().checked_sub(1) else { return };
        let (simd, mut narrowed) = (Simd::detect(), Vec::new());
        let found = pair.narrow_to_blockers(handed, &mut narrowed, most);
        assert!(found.is_crowd && found.blockers.is_empty() && !found.is_clear());
        let crowd = Crowd { shaft: pair, candidates: &narrowed, simd };
        let listed = |log2_count| visibility(simd, pair, blockers, 7, log2_count);
        let (first, sample) = crowd.first_look(7);
        assert_eq!(first, listed(4));
        assert_eq!(crowd.visibility(7, 6), listed(6));
        let world = SegmentBundle::new(pair.a, pair.b, 7, 4, 0);
        let hits = |&patch: &PatchId| {
            let polygon = pair.lifted(patch).1.polygon();
            world.blocked_by(simd, &polygon, 2.0 * pair.slack()) != 0
        };
        let mut want: Vec<PatchId> = blockers.iter().copied().filter(hits).collect();
        want.sort_unstable();
        assert_eq!(sample, want);
    }

    /// What segments between two slivers cross is among their blockers, and among the candidates of every
    /// pair above them; and the walk for both at once finds what either finds alone.
    #[test]
    fn no_sliver_that_segments_cross_is_left_out() {
        let scene = twisted_tubes();
        let mut forest = Forest::new(&scene);
        let view = WorldView::new(&scene, &forest, &scene.at(0.0));
        let patches = || (0..scene.patches.len() as u32).map(PatchId);
        // Of every seventh facet its parts besides.
        let roots: Vec<ElementId> = forest.facets().to_vec();
        let mut ends: Vec<(ElementId, ElementId)> = roots.iter().map(|&id| (id, id)).collect();
        for &root in roots.iter().step_by(7) {
            ends.extend(forest.split(root).0.map(|part| (ElementId(part), root)));
        }
        let place = |id| WorldElement::new(&view, &forest, id, false);
        let patch = |id| forest.patch(id).unwrap();
        let (mut crossed, mut looked_at, mut found) = (0, 0, 0);
        for (k, &(one, one_above)) in ends.iter().enumerate() {
            for &(two, two_above) in ends[k + 1..].iter().step_by(5) {
                let patches_of = (patch(one), patch(two));
                let (a, b, above) = (place(one), place(two), (place(one_above), place(two_above)));
                let shaft = |a, b| Shaft {
                    forest: &forest,
                    view: &view,
                    a,
                    b,
                    own: None,
                    patches: patches_of,
                };
                let (mut handed, mut both) = (Vec::new(), Vec::new());
                shaft(&above.0, &above.1).narrow(&[Forest::ROOT.0], &mut handed);
                let pair = shaft(&a, &b);
                let blockers = pair.blockers(&[Forest::ROOT.0]);
                let listed = pair.narrow_to_blockers(&handed, &mut both, usize::MAX);
                assert_eq!(listed.blockers, blockers);
                past_a_crowd(&pair, &handed, &blockers);
                let mut alone = Vec::new();
                pair.narrow(&handed, &mut alone);
                assert_eq!(both, alone);
                let fronts = patches().filter(|&p| !view.is_hidden_twin(p)).count();
                (looked_at, found) = (looked_at + fronts, found + blockers.len());
                for block in 0..4 {
                    let segments = SegmentBundle::new(&a, &b, 7, 6, block);
                    // Those that leave one front and arrive at the other.
                    let faces = (0..SEGMENTS).filter(|&k| segments.weight[k] > 0.0);
                    let mask = faces.fold(0_u16, |mask, k| mask | 1 << k);
                    for by in patches().filter(|&p| !view.is_hidden_twin(p)) {
                        if by == patches_of.0 || by == patches_of.1 {
                            continue;
                        }
                        let slack = 8.0 * pair.slack();
                        let hits = segments.blocked_by(Simd::detect(), &view.occluder(by), slack);
                        if hits & mask != 0 {
                            crossed += 1;
                            assert!(blockers.contains(&by), "{patches_of:?} {by:?}");
                        }
                    }
                }
            }
        }
        assert!(crossed > 10_000, "{crossed}");
        assert!(5 * found < 4 * looked_at, "{found} of {looked_at}");
    }

    #[test]
    fn the_other_side_of_a_polygon_does_not_cover_it() {
        assert_eq!(floor_to_ceiling(true, |_| ()), 1.0);
    }
}
