//! The shaft of a pair: both ends placed, the frame in which a body is tested against it, and how a patch stands to it.

use glam::DVec3;

use crate::element::{ElementId, Forest, OccluderPolygon, WorldElement, WorldView};
use crate::geometry::{Aabb, Interval, Plane, ShaftOfBoxes};
use crate::scene::{BodyId, InPlane, Lying, PatchId};

use super::contact::{in_plane, lies_in, overlap_m2};
use super::exchange::{Meeting, meeting};

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

/// Distance from an end's plane, in slacks, within which a polygon lies on it. No less than 1: what is closer than a slack blocks
/// nothing by itself, so that the light between would count twice.
const COVER: f64 = 1.0;

/// How far a polygon that lies on an end is lifted off it, in slacks: more than anything that is
/// disregarded because it is close to an end.
pub(super) const LIFT: f64 = 8.0;

/// Distances from planes within which polygons count as on them, metres.
#[derive(Clone, Copy)]
struct Within {
    /// From that of a blocker, or of an end that it is behind.
    slack_m: f64,
    /// From that of an end that it covers.
    margin_m: f64,
}

/// Relation of a patch to a shaft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// It blocks neither this pair nor any below it.
    Out,
    /// It may be a blocker of a pair below this one.
    Beside,
    /// It counts as a blocker of this very pair.
    Between,
}

/// The frame in which a body is tested against a shaft, with the ends in it.
#[derive(Clone, Copy)]
pub(super) struct TestFrame<'a> {
    view: &'a WorldView,
    /// Whether it is that of the body which both ends ride on; else it is the world.
    pub(super) is_own: bool,
    pub(super) a: &'a WorldElement,
    pub(super) b: &'a WorldElement,
}

impl<'a> TestFrame<'a> {
    /// A patch as an occluder in this frame.
    #[inline]
    pub(super) fn occluder(&self, patch: PatchId) -> OccluderPolygon<'a> {
        match self.is_own {
            true => self.view.occluder_in_body(patch),
            false => self.view.occluder(patch),
        }
    }

    /// Box of a node of the fixed part in this frame.
    #[inline]
    pub(super) fn bounds(&self, id: ElementId) -> &'a Aabb {
        if self.is_own { self.view.box_in_body(id) } else { self.view.fixed_box(id) }
    }
}

/// Shafts of the ends' boxes: in the world, and in the frame of the body that both ride on.
pub(super) struct ShaftsOfBoxes {
    pub(super) world: ShaftOfBoxes,
    own: Option<ShaftOfBoxes>,
}

impl ShaftsOfBoxes {
    /// The shaft of the ends' boxes in a frame.
    #[inline]
    pub(super) fn seen_in(&self, frame: &TestFrame<'_>) -> &ShaftOfBoxes {
        self.own.as_ref().filter(|_| frame.is_own).unwrap_or(&self.world)
    }
}

/// A polygon, moved.
pub(super) struct Lifted<'a> {
    pub(super) polygon: OccluderPolygon<'a>,
    by: DVec3,
}

impl<'a> Lifted<'a> {
    pub(super) fn corners(&self) -> impl Iterator<Item = DVec3> + use<'a> {
        let by = self.by;
        self.polygon.corners.iter().map(move |&c| c + by)
    }

    /// For tests that use the planes; a move along the normal leaves those of the edges as they are.
    pub(super) fn polygon(&self) -> OccluderPolygon<'a> {
        let plane = self.polygon.plane;
        let offset = plane.offset + plane.normal.dot(self.by);
        OccluderPolygon { plane: Plane { offset, ..plane }, ..self.polygon }
    }
}

/// Distances of a polygon's corners from a plane, metres.
#[inline]
fn span(polygon: &OccluderPolygon<'_>, plane: &Plane) -> Interval {
    Interval::of(polygon.corners.iter().map(|&c| plane.distance(c)))
}

/// Of polygons that are known to lie in one plane.
fn in_contact(opposed: bool) -> Lying {
    Lying { opposed, height_m: Interval::ZERO }
}

/// Reach of two elements to either side of a plane, the smaller of both, metres; negative where they
/// stay away from it.
#[inline]
fn reach(plane: &Plane, a: &WorldElement, b: &WorldElement) -> f64 {
    let both = a.span(plane).union(b.span(plane));
    (-both.lo).min(both.hi)
}

impl<'a> Shaft<'a> {
    pub(super) fn slack(&self) -> f64 {
        self.a.rounding_m + self.b.rounding_m
    }

    /// The frame in which what rides on a body is tested: its own for the body that both ends ride on, so that the
    /// answer does not depend on where that is.
    #[inline]
    pub(super) fn frame_of_body(&self, body: Option<BodyId>) -> TestFrame<'a> {
        match self.own {
            Some((own, ..)) if body == Some(own) => self.own_frame(),
            _ => TestFrame { view: self.view, is_own: false, a: self.a, b: self.b },
        }
    }

    /// The frame in which a patch is tested.
    #[inline]
    pub(super) fn frame_of(&self, patch: PatchId) -> TestFrame<'a> {
        self.frame_of_body(self.own.map(|_| self.view.patch(patch).body))
    }

    /// The frame of the body that both ends ride on; the world where they ride on none.
    #[inline]
    pub(super) fn own_frame(&self) -> TestFrame<'a> {
        let (is_own, a, b) = self.own.map_or((false, self.a, self.b), |(_, a, b)| (true, a, b));
        TestFrame { view: self.view, is_own, a, b }
    }

    pub(super) fn shafts(&self) -> ShaftsOfBoxes {
        ShaftsOfBoxes {
            world: ShaftOfBoxes::new(&self.a.bounds, &self.b.bounds),
            own: self.own.map(|(_, a, b)| ShaftOfBoxes::new(&a.bounds, &b.bounds)),
        }
    }

    /// Relation of a patch to the shaft.
    pub(super) fn standing(&self, shafts: &ShaftsOfBoxes, patch: PatchId) -> Standing {
        if patch == self.patches.0 || patch == self.patches.1 || self.view.is_hidden_twin(patch) {
            return Standing::Out;
        }
        let root = self.forest.patch_root(patch);
        let frame = self.frame_of(patch);
        let (a, b, shaft, bounds) = (frame.a, frame.b, shafts.seen_in(&frame), frame.bounds(root));
        let slack = self.slack();
        // The margins: what covers an end may lie a little behind it.
        let (margin, wide_margin) = (COVER * slack, 1.5 * COVER * slack);
        if !shaft.meets(bounds, wide_margin) {
            return Standing::Out;
        }
        let occluder = frame.occluder(patch);
        // A lamp beside the ends lights the one unevenly, though it blocks nothing.
        let unseen = if self.forest.is_lamp(patch) { Standing::Beside } else { Standing::Out };
        let (above_a, above_b) = (span(&occluder, &a.plane), span(&occluder, &b.plane));
        let is_near = |above: Interval| above.lo >= -wide_margin && above.hi <= wide_margin;
        let (passes_wide, passes) = if is_near(above_a) || is_near(above_b) {
            let height_m = [above_a.hi, above_b.hi];
            let blocks = |within| self.blocks(patch, &occluder, [a, b], height_m, within);
            let wide = Within { slack_m: 0.5 * slack, margin_m: wide_margin };
            (blocks(wide), blocks(Within { slack_m: slack, margin_m: margin }))
        } else {
            // The same without a look at what covers an end.
            let height = above_a.hi.min(above_b.hi);
            if height <= 0.5 * slack {
                return unseen;
            }
            let reach = reach(&occluder.plane, a, b);
            (reach > 0.5 * slack, reach > slack && height > slack)
        };
        if !passes_wide {
            return unseen;
        }
        match passes && shaft.meets(bounds, margin) {
            true => Standing::Between,
            false => Standing::Beside,
        }
    }

    /// Whether a polygon that may cover an end could block any segment, its box aside; `height_m` is how far it reaches in front of
    /// each end, metres.
    fn blocks(
        &self,
        patch: PatchId,
        occluder: &OccluderPolygon<'_>,
        [a, b]: [&WorldElement; 2],
        height_m: [f64; 2],
        Within { slack_m, margin_m }: Within,
    ) -> bool {
        let behind = height_m.map(|height_m| height_m <= slack_m);
        let [on_a, on_b] = self.covered(patch, occluder, [a, b], margin_m);
        if on_a || on_b {
            // What two ends in contact exchange is found within their plane.
            return self.is_contact() || !(if on_a { behind[1] } else { behind[0] });
        }
        !behind.contains(&true) && reach(&occluder.plane, a, b) > slack_m
    }

    /// Which ends a polygon lies on and hides, in their plane.
    fn covered(
        &self,
        patch: PatchId,
        polygon: &OccluderPolygon<'_>,
        [a, b]: [&WorldElement; 2],
        within_m: f64,
    ) -> [bool; 2] {
        let on = |e: &WorldElement, of| {
            lies_in(polygon, &e.plane, within_m).is_some_and(|lying| {
                in_plane(self.forest, self.view, patch, of, lying) != InPlane::Apart
            })
        };
        [on(a, self.patches.0), on(b, self.patches.1)]
    }

    /// A blocker where it blocks, and whether that is in the frame of the pair's own body: polygons
    /// that cover an end are lifted clear of it.
    pub(super) fn lifted(&self, patch: PatchId) -> (bool, Lifted<'a>) {
        let frame = self.frame_of(patch);
        let (a, b, polygon) = (frame.a, frame.b, frame.occluder(patch));
        let up = |e: &WorldElement| e.plane.normal * (LIFT * self.slack());
        let by = match self.covered(patch, &polygon, [a, b], COVER * self.slack()) {
            [true, _] => up(a),
            [false, true] => up(b),
            [false, false] => DVec3::ZERO,
        };
        (frame.is_own, Lifted { polygon, by })
    }

    /// Whether both ends lie in one plane and touch.
    pub fn is_contact(&self) -> bool {
        let TestFrame { a, b, .. } = self.own_frame();
        let (of_a, of_b) = self.patches;
        meeting(a, b) == Meeting::Coplanar
            && in_plane(self.forest, self.view, of_a, of_b, in_contact(true)) == InPlane::Touches
    }

    /// Area in contact, without what other surfaces in the same plane show in place of the ends', m2.
    pub fn contact_m2(&self, blockers: &[PatchId]) -> f64 {
        let frame = self.own_frame();
        let rides = |patch| !frame.is_own || self.frame_of(patch).is_own;
        let shows = |patch: &PatchId| {
            let of = |end| {
                let normal = self.view.normal(end, frame.is_own);
                let opposed = frame.occluder(*patch).plane.normal.dot(normal) < 0.0;
                in_plane(self.forest, self.view, *patch, end, in_contact(opposed))
                    == InPlane::Covers
            };
            rides(*patch) && (of(self.patches.0) || of(self.patches.1))
        };
        overlap_m2(
            frame.a,
            frame.b,
            blockers.iter().copied().filter(shows).map(|p| frame.occluder(p)),
        )
    }
}
