//! Visibility V of a pair: the occluders in its shaft ([`Shaft`]), and V past them, over fixed segments ([`visibility`]) or by
//! clipping ([`clipping`]).

use crate::element::{ElementId, Forest, Kind, OccluderPolygon, WorldElement, WorldView};
use crate::geometry::{
    Aabb, Interval, Plane, Pose, ShaftOfBoxes, is_outside_hull, shaft_meets_box,
};
use crate::scene::{BodyId, InPlane, Lying, PatchId};

use super::clip::keep_in_front;
use super::contact::{in_plane, lies_in, overlap_m2};
use super::exchange::{Meeting, meeting};
use super::kernel::Simd;
use super::prepared_view::{Between, Clipping, PlacedSolid, PreparedView, is_hidden};
use super::segments::{EDGE_OVERLAP, SEGMENTS, SegmentBundle};
use super::share::Visibility;
use super::side::Side;
use super::spot::spot;
use super::tuning::{BODY_SHARE, GRAZED};
use glam::{DVec2, DVec3};

/// Candidate occluders of a pair: nodes of the forest's fixed part (clusters and patch roots) that may stand between its ends.
/// Conservative: a patch below none of them blocks nothing.
pub type Candidates = [u32];

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

/// Patches in the shaft of a pair.
#[derive(Clone, Debug, Default)]
pub struct InShaft {
    /// Those that block; none where they are a crowd.
    pub blockers: Vec<PatchId>,
    /// Those that emit light at any time; they may block as well or not.
    pub lamps: Vec<PatchId>,
    /// Whether more block than were to be listed.
    pub is_crowd: bool,
}

impl InShaft {
    /// Whether nothing blocks.
    pub fn is_clear(&self) -> bool {
        self.blockers.is_empty() && !self.is_crowd
    }
}

/// Sizes of the blockers between two ends; infinite where there are none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockerSizes {
    /// For each end how unevenly lamps in the shaft light it (`spot`): 1.
    pub spots: [f64; 2],
    /// Area of the smallest blocker, m2.
    pub least_m2: f64,
    /// Area of all blockers, m2.
    pub all_m2: f64,
    /// For each end, how far an edge of a blocker moves over the other end, at most, in units of how far the point on
    /// this one moves that it is seen from: the ratio of the blocker's distances from the two centres.
    pub leverage: [f64; 2],
    /// For each end, how near a blocker is for its size: the square of its radius over the distance of its centre from the
    /// nearest blocker, at most 1. Where one stands on an end, light that arrives there stops at a line: 1.
    pub near: [f64; 2],
}

impl BlockerSizes {
    /// Nothing stands between the ends.
    pub const NOTHING: BlockerSizes = BlockerSizes {
        spots: [0.0; 2],
        least_m2: f64::INFINITY,
        all_m2: f64::INFINITY,
        leverage: [0.0; 2],
        near: [0.0; 2],
    };
}

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

/// The two ends in the frame in which a body is tested against their shaft, and their boxes' shaft.
#[derive(Clone, Copy)]
struct SeenEnds<'a> {
    own: bool,
    a: &'a WorldElement,
    b: &'a WorldElement,
    shaft: &'a ShaftOfBoxes,
}

/// Shafts of the ends' boxes: in the world, and in the frame of the body that both ride on.
pub(super) struct ShaftsOfBoxes {
    world: ShaftOfBoxes,
    own: Option<ShaftOfBoxes>,
}

/// A polygon, moved.
pub(super) struct Lifted<'a> {
    polygon: OccluderPolygon<'a>,
    by: DVec3,
}

impl<'a> Lifted<'a> {
    fn corners(&self) -> impl Iterator<Item = DVec3> + use<'a> {
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

/// The larger of two numbers, by end.
#[inline]
fn larger(one: [f64; 2], other: [f64; 2]) -> [f64; 2] {
    [one[0].max(other[0]), one[1].max(other[1])]
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

    /// The two ends in the frame in which a body is tested against their shaft: its own for the body that both ends
    /// ride on, so that the answer does not depend on where that is.
    fn seen_by(&self, body: Option<BodyId>) -> (bool, &'a WorldElement, &'a WorldElement) {
        match self.own {
            Some((own, a, b)) if body == Some(own) => (true, a, b),
            _ => (false, self.a, self.b),
        }
    }

    pub(super) fn shafts(&self) -> ShaftsOfBoxes {
        ShaftsOfBoxes {
            world: ShaftOfBoxes::new(&self.a.bounds, &self.b.bounds),
            own: self.own.map(|(_, a, b)| ShaftOfBoxes::new(&a.bounds, &b.bounds)),
        }
    }

    fn seen_ends<'s>(&'s self, shafts: &'s ShaftsOfBoxes, body: Option<BodyId>) -> SeenEnds<'s> {
        let (own, a, b) = self.seen_by(body);
        let shaft = if own { shafts.own.as_ref() } else { None }.unwrap_or(&shafts.world);
        SeenEnds { own, a, b, shaft }
    }

    /// Relation of a patch to the shaft.
    pub(super) fn standing(&self, shafts: &ShaftsOfBoxes, patch: PatchId) -> Standing {
        if patch == self.patches.0 || patch == self.patches.1 || self.view.is_hidden_twin(patch) {
            return Standing::Out;
        }
        let root = self.forest.patch_root(patch);
        let body = self.own.map(|_| self.view.patch(patch).body);
        let SeenEnds { own, a, b, shaft } = self.seen_ends(shafts, body);
        let bounds = if own { self.view.box_in_body(root) } else { self.view.fixed_box(root) };
        let slack = self.slack();
        // The margins: what covers an end may lie a little behind it.
        let (margin, wide_margin) = (COVER * slack, 1.5 * COVER * slack);
        if !shaft.meets(bounds, wide_margin) {
            return Standing::Out;
        }
        let occluder =
            if own { self.view.occluder_in_body(patch) } else { self.view.occluder(patch) };
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

    /// For each end the largest `spot` of some lamps that shine on it, 1; what surrounds the ends has the areas `around_m2`.
    fn spots(&self, lamps: &[PatchId], around_m2: [f64; 2]) -> [f64; 2] {
        let mut most = [0.0; 2];
        for &patch in lamps {
            let both = self.view.patch(patch).twin.is_some();
            let (own, a, b) = self.seen_by(Some(self.view.patch(patch).body));
            let lamp = match own {
                true => self.view.occluder_in_body(patch),
                false => self.view.occluder(patch),
            };
            let lamp_m2 = self.forest.area_m2(self.forest.patch_root(patch));
            let of = |e: &WorldElement, around_m2: f64| {
                let shines = both || lamp.plane.distance(e.centre) > 0.0;
                if shines { spot(e, around_m2, (&lamp, lamp_m2)) } else { 0.0 }
            };
            most = larger(most, [of(a, around_m2[0]), of(b, around_m2[1])]);
        }
        most
    }

    /// Sizes of some blockers and lamps; of a crowd the blockers are those that stand for it.
    pub fn sizes_of(
        &self,
        InShaft { blockers, lamps, .. }: &InShaft,
        around_m2: [f64; 2],
    ) -> BlockerSizes {
        let spots = self.spots(lamps, around_m2);
        if blockers.is_empty() {
            return BlockerSizes { spots, ..BlockerSizes::NOTHING };
        }
        let area = |&patch: &PatchId| {
            let root = self.forest.patch_root(patch);
            let own = self.forest.area_m2(root);
            // The shadow of a finely tessellated body has the size of the body.
            match self.forest.is_in_group(root) {
                true => own.max(BODY_SHARE * self.forest.connected_m2(patch)),
                false => own,
            }
        };
        let mut sizes = BlockerSizes {
            spots,
            least_m2: blockers.iter().map(area).fold(f64::INFINITY, f64::min),
            all_m2: blockers.iter().map(area).sum(),
            ..BlockerSizes::NOTHING
        };
        for &patch in blockers {
            self.place(patch, &mut sizes);
        }
        sizes
    }

    /// Adds where a blocker is: how far from each end.
    fn place(&self, blocker: PatchId, BlockerSizes { leverage, near, .. }: &mut BlockerSizes) {
        let (own, a, b) = self.seen_by(Some(self.view.patch(blocker).body));
        let polygon = match own {
            true => self.view.occluder_in_body(blocker),
            false => self.view.occluder(blocker),
        };
        let from = |e: &WorldElement| polygon.distance(e.centre).max(f64::MIN_POSITIVE);
        let (from_a, from_b) = (from(a), from(b));
        *leverage = larger(*leverage, [from_b / from_a, from_a / from_b]);
        let (by_a, by_b) = ((a.radius / from_a).min(1.0), (b.radius / from_b).min(1.0));
        *near = larger(*near, [by_a * by_a, by_b * by_b]);
    }

    /// Whether both ends lie in one plane and touch.
    pub fn is_contact(&self) -> bool {
        let (a, b) = self.own.map_or((self.a, self.b), |(_, a, b)| (a, b));
        let (of_a, of_b) = self.patches;
        meeting(a, b) == Meeting::Coplanar
            && in_plane(self.forest, self.view, of_a, of_b, in_contact(true)) == InPlane::Touches
    }

    /// Area in contact, without what other surfaces in the same plane show in place of the ends', m2.
    pub fn contact_m2(&self, blockers: &[PatchId]) -> f64 {
        let (own, a, b) = self.own.map_or((false, self.a, self.b), |(_, a, b)| (true, a, b));
        let polygon = |patch| match own {
            true => self.view.occluder_in_body(patch),
            false => self.view.occluder(patch),
        };
        let rides = |patch| !own || Some(self.view.patch(patch).body) == self.own.map(|own| own.0);
        let shows = |patch: &PatchId| {
            let of = |end| {
                let opposed = polygon(*patch).plane.normal.dot(self.view.normal(end, own)) < 0.0;
                in_plane(self.forest, self.view, *patch, end, in_contact(opposed))
                    == InPlane::Covers
            };
            rides(*patch) && (of(self.patches.0) || of(self.patches.1))
        };
        overlap_m2(a, b, blockers.iter().copied().filter(shows).map(polygon))
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
        let (own, a, b) = self.seen_by(Some(self.view.patch(patch).body));
        let polygon =
            if own { self.view.occluder_in_body(patch) } else { self.view.occluder(patch) };
        let up = |e: &WorldElement| e.plane.normal * (LIFT * self.slack());
        let by = match self.covered(patch, &polygon, [a, b], COVER * self.slack()) {
            [true, _] => up(a),
            [false, true] => up(b),
            [false, false] => DVec3::ZERO,
        };
        (own, Lifted { polygon, by })
    }

    /// Which of `parents` (candidates of a pair above) remain candidates here, appended to `out`;
    /// clusters large against the shaft are opened.
    pub fn narrow(&self, parents: &Candidates, out: &mut Vec<u32>) {
        let (shafts, keep_m) = (self.shafts(), self.keep_m());
        for &parent in parents {
            self.walk(&shafts, ElementId(parent), keep_m, &mut |id, _| {
                out.push(id.0);
                true
            });
        }
    }

    /// Clusters of this size are small against the shaft, metres.
    fn keep_m(&self) -> f64 {
        let length = (self.b.centre - self.a.centre).length() + self.a.radius + self.b.radius;
        0.25 * length.min(self.view.far_m())
    }

    /// The patches among and below `candidates` that may block segments of this very pair, in the
    /// forest's order. Which they are depends on the pair alone, not on how `candidates` were found.
    pub fn blockers(&self, candidates: &Candidates) -> Vec<PatchId> {
        let (shafts, mut out) = (self.shafts(), Vec::new());
        for &candidate in candidates {
            self.walk(&shafts, ElementId(candidate), -1.0, &mut |id, standing| {
                out.extend(self.forest.patch(id).filter(|_| standing == Standing::Between));
                true
            });
        }
        out
    }

    /// [`Shaft::narrow`] and [`Shaft::blockers`] in one walk; of more blockers than `listed_max` none are listed.
    pub fn narrow_to_blockers(
        &self,
        parents: &Candidates,
        out: &mut Vec<u32>,
        listed_max: usize,
    ) -> InShaft {
        let (shafts, keep_m) = (self.shafts(), self.keep_m());
        let mut found = InShaft::default();
        for &parent in parents {
            self.walk(&shafts, ElementId(parent), keep_m, &mut |id, standing| {
                out.push(id.0);
                match self.forest.patch(id) {
                    Some(patch) => self.meet((patch, standing), listed_max, &mut found),
                    None if found.is_crowd && !self.forest.may_hold_lamp(id) => {}
                    None => {
                        self.walk(&shafts, id, -1.0, &mut |below, standing| {
                            if let Some(patch) = self.forest.patch(below) {
                                self.meet((patch, standing), listed_max, &mut found);
                            }
                            !found.is_crowd || self.forest.may_hold_lamp(id)
                        });
                    }
                }
                true
            });
        }
        found
    }

    /// Lists a patch that is not out of the shaft.
    fn meet(&self, (patch, standing): (PatchId, Standing), listed_max: usize, found: &mut InShaft) {
        if standing == Standing::Between && !found.is_crowd {
            found.blockers.push(patch);
            if found.blockers.len() > listed_max {
                found.is_crowd = true;
                found.blockers.clear();
            }
        }
        if self.forest.is_lamp(patch) {
            found.lamps.push(patch);
        }
    }

    /// Blockers of this pair among those of a pair above.
    pub fn those_that_block(&self, blockers: &[PatchId]) -> Vec<PatchId> {
        let shafts = self.shafts();
        let blocks = |patch: &PatchId| self.standing(&shafts, *patch) == Standing::Between;
        blockers.iter().copied().filter(blocks).collect()
    }

    /// Whether none of some blockers of two elements reaches into the convex hull of the two, which holds all segments between
    /// them: boxes hold more.
    pub fn is_beside(&self, blockers: &[PatchId]) -> bool {
        let (slack, mut corners) = (self.slack(), Vec::new());
        blockers.iter().all(|&patch| {
            let (_, a, b) = self.seen_by(Some(self.view.patch(patch).body));
            corners.clear();
            corners.extend(self.lifted(patch).1.corners());
            let ends = (&a.corners[..a.len], &b.corners[..b.len]);
            is_outside_hull(ends, &corners, slack, GRAZED)
        })
    }

    /// Number of occluders that blockers make up: solids that hide with their silhouettes count as one for every
    /// eight of their faces, which may have to be clipped one by one after all.
    pub fn occluders(&self, blockers: &[PatchId]) -> usize {
        let whole = self.whole_solids(blockers);
        let faces: usize = whole.iter().map(|(_, faces)| faces).sum();
        blockers.len() - faces + whole.iter().map(|(_, faces)| 1 + faces / 8).sum::<usize>()
    }

    /// The solids that hide more cheaply with their silhouettes than with those of their faces that are
    /// among some blockers, and how many those are. Not an end's own, of which no face is in the way.
    fn whole_solids(&self, blockers: &[PatchId]) -> Vec<(u32, usize)> {
        // With how many faces there are, and corners of those.
        let mut solids: Vec<(u32, usize, usize)> = Vec::new();
        for &patch in blockers {
            let Some(solid) = self.forest.solid(patch) else { continue };
            let count = self.view.occluder(patch).corners.len();
            match solids.iter_mut().find(|found| found.0 == solid) {
                Some((_, faces, corners)) => (*faces, *corners) = (*faces + 1, *corners + count),
                None => solids.push((solid, 1, count)),
            }
        }
        let ends = [self.forest.solid(self.patches.0), self.forest.solid(self.patches.1)];
        let is_cheaper = |&(solid, faces, corners): &(u32, usize, usize)| {
            // A single face is as good, and a few of a ball are better.
            let edges = self.forest.solid_shape(solid).edges.len();
            faces >= 2 && edges <= 2 * corners && !ends.contains(&Some(solid))
        };
        solids.into_iter().filter(is_cheaper).map(|(solid, faces, _)| (solid, faces)).collect()
    }

    /// Whether anything at or below `id` may block segments of this pair or of one below it,
    /// what rides on `except` aside.
    pub fn is_entered_by(&self, id: ElementId, except: Option<BodyId>) -> bool {
        self.enters(&self.shafts(), id, except)
    }

    fn enters(&self, shafts: &ShaftsOfBoxes, id: ElementId, except: Option<BodyId>) -> bool {
        if except.is_some() && self.forest.cluster_body(id) == except {
            return false;
        }
        if except.is_some() && self.forest.patch(id).is_none() {
            // Groups of bodies are opened one by one, so that the excepted one is met.
            let bounds = self.view.fixed_box(id);
            return self.forest.kind(id) == Kind::Cluster
                && shafts.world.meets(bounds, self.slack())
                && self.forest.children(id).any(|c| self.enters(shafts, ElementId(c), except));
        }
        let mut entered = false;
        self.walk(shafts, id, -1.0, &mut |_, _| {
            entered = true;
            false
        });
        entered
    }

    /// Visits the candidates at or below `id`: patches that are not out, and clusters no larger than `keep_m`;
    /// ends and returns false as soon as `visit` does.
    fn walk(
        &self,
        shafts: &ShaftsOfBoxes,
        id: ElementId,
        keep_m: f64,
        visit: &mut dyn FnMut(ElementId, Standing) -> bool,
    ) -> bool {
        let world = self.view.fixed_box(id);
        if world.is_empty() || self.forest.kind(id) == Kind::Light {
            return true;
        }
        if let Some(patch) = self.forest.patch(id) {
            let standing = self.standing(shafts, patch);
            return standing == Standing::Out || visit(id, standing);
        }
        let body = self.forest.cluster_body(id);
        let SeenEnds { own, shaft, .. } = self.seen_ends(shafts, body);
        let bounds = if own { self.view.box_in_body(id) } else { world };
        if !shaft.meets(bounds, self.slack()) {
            return true;
        }
        // Groups of bodies are never kept: their boxes mix frames. Several at rest are in the world.
        let in_one_frame = body.is_some() || (self.own.is_none() && self.forest.is_of_stage(id));
        if in_one_frame && bounds.diagonal() <= keep_m {
            return visit(id, Standing::Beside);
        }
        self.forest.children(id).all(|c| self.walk(shafts, ElementId(c), keep_m, visit))
    }

    /// Blockers in one frame: that of the pair's body if it has one of its own.
    fn between(&self, blockers: &[PatchId]) -> Between<'a> {
        let mut out = Between::default();
        let own =
            self.own.map(|(own, _, _)| self.view.poses()[own.0 as usize].unwrap_or(Pose::IDENTITY));
        for &patch in blockers {
            let (rides, lifted) = self.lifted(patch);
            let (corners, normal) = (lifted.corners(), lifted.polygon.plane.normal);
            let solid = self.forest.solid(patch);
            match own {
                Some(pose) if !rides => {
                    let normal = pose.rotation.transpose() * normal;
                    out.push(corners.map(|c| pose.inverse_point(c)), normal, solid);
                }
                _ => out.push(corners, normal, solid),
            }
        }
        for (number, _) in self.whole_solids(blockers) {
            let solid = self.forest.solid_shape(number);
            let pose = self.view.poses()[solid.body.0 as usize].unwrap_or(Pose::IDENTITY);
            let pose = match (own, self.own) {
                (Some(_), Some((body, _, _))) if body == solid.body => Pose::IDENTITY,
                (Some(own), _) => own.inverse() * pose,
                _ => pose,
            };
            out.push_solid(PlacedSolid { number, solid, pose });
        }
        out
    }

    /// Whether the blockers hide all of the first end from a point in front of it.
    fn is_hidden_from(&self, from: DVec3, blockers: &[PatchId]) -> bool {
        let (plane, slack) = (&self.a.plane, self.slack());
        // Only what is between the end's plane and the point's hides anything.
        let height = plane.distance(from);
        let above = Plane { offset: plane.offset + slack, ..*plane };
        let below = Plane { normal: -plane.normal, offset: -(plane.offset + height - slack) };
        let between = |&patch: &PatchId| {
            let mut corners: Vec<DVec3> = self.lifted(patch).1.corners().collect();
            keep_in_front(&mut corners, &above);
            keep_in_front(&mut corners, &below);
            (corners.len() >= 3).then_some(corners)
        };
        let between: Vec<Vec<DVec3>> = blockers.iter().filter_map(between).collect();
        is_hidden(from, &self.a.corners[..self.a.len], between.iter().map(Vec::as_slice))
    }

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
    let (a, b) = shaft.own.map_or((shaft.a, shaft.b), |(_, a, b)| (a, b));
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

/// A pair made ready to be clipped past its blockers ([`Shaft::occluders`] says how many that are): in the
/// frame of the body that both ends ride on, if they do.
pub fn clipping<'a>(simd: Simd, shaft: &Shaft<'a>, blockers: &[PatchId]) -> Clipping<'a> {
    let ends = shaft.own.map_or((shaft.a, shaft.b), |(_, a, b)| (a, b));
    Clipping::new(simd, ends, &shaft.between(blockers))
}

/// View from one end of a pair to the other past blockers, prepared for many points; in the frame of the body that both
/// ride on, if they do.
pub fn prepare_view(
    simd: Simd,
    shaft: &Shaft<'_>,
    blockers: &[PatchId],
    observer: Side,
) -> PreparedView {
    let (a, b) = shaft.own.map_or((shaft.a, shaft.b), |(_, a, b)| (a, b));
    let (observer, other) = if observer == Side::B { (b, a) } else { (a, b) };
    PreparedView::new(simd, observer, other, &shaft.between(blockers))
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

/// Weighted sums over segments, of all and of the clear ones.
#[derive(Default)]
pub(super) struct Tally {
    a: SideTally,
    b: SideTally,
}

#[derive(Default)]
struct SideTally {
    total: [f64; 4],
    clear: [f64; 4],
    moment: DVec2,
    clear_moment: DVec2,
}

impl SideTally {
    fn add(&mut self, quadrant: u8, at: DVec2, weight: f64, clear: f64) {
        self.total[quadrant as usize] += weight;
        self.clear[quadrant as usize] += clear;
        self.moment += at * weight;
        self.clear_moment += at * clear;
    }

    /// Contribution of occlusion to the relative gradient: the shift of the centre of what arrives,
    /// against the element's own second moment.
    fn gradient(&self, e: &WorldElement) -> DVec2 {
        let (total, clear): (f64, f64) = (self.total.iter().sum(), self.clear.iter().sum());
        if clear <= 0.0 {
            return DVec2::ZERO;
        }
        e.gradient_of_shift(self.clear_moment / clear - self.moment / total)
    }

    fn spread(&self, value: f64) -> f64 {
        let total: f64 = self.total.iter().sum();
        let mut sum = 0.0;
        for q in 0..4 {
            if self.total[q] > 0.0 {
                let off = self.clear[q] / self.total[q] - value;
                sum += self.total[q] / total * off * off;
            }
        }
        sum.sqrt()
    }
}

impl Tally {
    pub(super) fn add(
        &mut self,
        bundle: &SegmentBundle,
        mask: u16,
        a: &WorldElement,
        b: &WorldElement,
    ) {
        let dark = bundle.weight.iter().all(|&w| w <= 0.0);
        for k in 0..SEGMENTS {
            // A pair that hardly faces itself has no weights: all segments count alike.
            let weight = if dark { f64::MIN_POSITIVE } else { bundle.weight[k] };
            let clear = if mask >> k & 1 == 1 { 0.0 } else { weight };
            let (p, q) = bundle.ends(k);
            self.a.add(bundle.quadrant_a[k], a.offset(p), weight, clear);
            self.b.add(bundle.quadrant_b[k], b.offset(q), weight, clear);
        }
    }

    pub(super) fn finish(&self, segments: u32, a: &WorldElement, b: &WorldElement) -> Visibility {
        let (total, clear): (f64, f64) = (self.a.total.iter().sum(), self.a.clear.iter().sum());
        let value = (clear / total).clamp(0.0, 1.0);
        Visibility {
            value,
            gradient_a: self.a.gradient(a),
            gradient_b: self.b.gradient(b),
            spread_a: self.a.spread(value),
            spread_b: self.b.spread(value),
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
    occluder.edges.iter().all(|e| e.distance(x) >= -EDGE_OVERLAP * slack_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Shape;
    use crate::scene::{Scene, SceneBuilder};
    use crate::transport::{CLIPPED_MAX, Crowd};
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
