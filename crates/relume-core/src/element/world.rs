//! Where elements are at one instant: patch planes, boxes and occluders under the present poses.

use glam::{DVec2, DVec3};

use super::forest::Forest;
use super::ids::{ElementId, Kind};
use super::split::{Shape, bilinear};
use crate::geometry::{Aabb, Interval, Plane, Pose};
use crate::scene::{BodyId, Frame, Light, LightId, LightKind, PatchId, Scene, World};

/// A patch's plane, in its body's frame and in the world.
#[derive(Clone, Copy, Debug)]
pub struct WorldPatch {
    /// In the body's frame.
    pub local: Frame,
    /// In the world.
    pub world: Frame,
    /// The body it rides on.
    pub body: BodyId,
    /// The other side of the same polygon.
    pub twin: Option<PatchId>,
    /// How far a corner of this patch may be off its exact place, metres.
    pub rounding_m: f64,
    /// [`Scene::lying_m2`].
    pub lying_m2: f64,
}

/// A polygon that blocks light, with the planes that bound it.
#[derive(Clone, Copy, Debug)]
pub struct OccluderPolygon<'a> {
    /// The polygon's plane.
    pub plane: Plane,
    /// Planes through its edges, perpendicular to it; the inside is in front of all.
    pub edges: &'a [Plane],
    /// Its corners.
    pub corners: &'a [DVec3],
}

impl OccluderPolygon<'_> {
    /// Distance of a point from the polygon, m.
    pub fn distance(&self, p: DVec3) -> f64 {
        let height = self.plane.distance(p);
        let foot = p - self.plane.normal * height;
        if self.edges.iter().all(|edge| edge.distance(foot) >= 0.0) {
            return height.abs();
        }
        let mut least2 = f64::INFINITY;
        let mut from = self.corners[self.corners.len() - 1];
        for &to in self.corners {
            let along = to - from;
            let (share, whole) = ((p - from).dot(along), along.length_squared());
            // Most points are beyond the ends of most edges: no division there.
            let share = match share {
                _ if share <= 0.0 => 0.0,
                _ if share >= whole => 1.0,
                _ => share / whole.max(f64::MIN_POSITIVE),
            };
            least2 = least2.min((p - (from + along * share)).length_squared());
            from = to;
        }
        least2.sqrt()
    }
}

/// Everything about the present poses that pairs need: derived, and dropped at any time.
#[derive(Clone, Debug)]
pub struct WorldView {
    patches: Vec<WorldPatch>,
    poses: Vec<Option<Pose>>,
    boxes: Vec<Aabb>,
    /// Of what is distant, by node; empty if nothing is.
    distant_boxes: Vec<Aabb>,
    local_boxes: Vec<Aabb>,
    far_m: f64,
    world: Occluders,
    local: Occluders,
    lights: Vec<Option<WorldLight>>,
    present: Vec<bool>,
    hidden_twin: Vec<bool>,
}

/// A punctual light at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldLight {
    /// Where it is, metres.
    pub position: DVec3,
    /// Unit direction it shines along.
    pub direction: DVec3,
    /// What it is.
    pub kind: LightKind,
}

#[derive(Clone, Debug, Default)]
struct Occluders {
    offsets: Vec<u32>,
    planes: Vec<Plane>,
    corners: Vec<DVec3>,
    edges: Vec<Plane>,
}

impl Occluders {
    fn of(scene: &Scene, poses: &[Option<Pose>]) -> Occluders {
        let mut out = Occluders { offsets: vec![0], ..Occluders::default() };
        for patch in &scene.patches {
            let pose = poses[patch.body.0 as usize].unwrap_or(Pose::IDENTITY);
            let normal = pose.direction(patch.frame.normal);
            let start = out.corners.len();
            out.corners.extend(patch.corners_in_body().map(|c| pose.point(c)));
            let corners = &out.corners[start..];
            out.planes.push(Plane::through(corners[0], normal));
            for (k, &p) in corners.iter().enumerate() {
                let q = corners[(k + 1) % corners.len()];
                out.edges.push(Plane::through(p, normal.cross(q - p).normalize_or_zero()));
            }
            out.offsets.push(out.corners.len() as u32);
        }
        out
    }

    fn get(&self, patch: usize) -> OccluderPolygon<'_> {
        let range = self.offsets[patch] as usize..self.offsets[patch + 1] as usize;
        OccluderPolygon {
            plane: self.planes[patch],
            edges: &self.edges[range.clone()],
            corners: &self.corners[range],
        }
    }
}

impl WorldView {
    /// The scene as it is in a world. Cost: proportional to the patches.
    pub fn new(scene: &Scene, forest: &Forest, now: &World) -> WorldView {
        let poses = now.poses().to_vec();
        let patches = scene.patches.iter().map(|p| world_patch(scene, p, &poses)).collect();
        let still = vec![Some(Pose::IDENTITY); poses.len()];
        let world = Occluders::of(scene, &poses);
        let local = Occluders::of(scene, &still);
        let mut boxes = boxes(forest, &poses, &world, scene);
        let distant_boxes = take_distant(forest, &mut boxes);
        WorldView {
            patches,
            far_m: far(boxes[Forest::ROOT.0 as usize].diagonal()),
            boxes,
            distant_boxes,
            local_boxes: self::boxes(forest, &still, &local, scene),
            world,
            local,
            lights: (0..)
                .zip(&scene.lights)
                .map(|(k, l)| world_light(l, now.light_pose(LightId(k))))
                .collect(),
            present: poses.iter().map(Option::is_some).collect(),
            hidden_twin: hidden_twins(scene),
            poses,
        }
    }

    /// A punctual light in a world, `None` while absent.
    pub fn light_in(scene: &Scene, now: &World, light: LightId) -> Option<WorldLight> {
        world_light(&scene.lights[light.0 as usize], now.light_pose(light))
    }

    /// World pose of each body, `None` while absent.
    pub fn poses(&self) -> &[Option<Pose>] {
        &self.poses
    }

    /// A patch's plane.
    #[inline]
    pub fn patch(&self, patch: PatchId) -> &WorldPatch {
        &self.patches[patch.0 as usize]
    }

    /// A light, `None` while absent.
    #[inline]
    pub fn light(&self, index: usize) -> Option<&WorldLight> {
        self.lights[index].as_ref()
    }

    /// World box of a node of the forest's fixed part as something that may stand in the way; empty while absent, for
    /// lights, and for what is distant.
    #[inline]
    pub fn fixed_box(&self, id: ElementId) -> &Aabb {
        &self.boxes[id.0 as usize]
    }

    /// World box of a node of the fixed part as an end of pairs: of what is distant too; empty while absent and for
    /// lights.
    #[inline]
    pub fn end_box(&self, id: ElementId) -> &Aabb {
        match self.distant_boxes.get(id.0 as usize) {
            Some(distant) if !distant.is_empty() => distant,
            _ => self.fixed_box(id),
        }
    }

    /// Box of a node of the fixed part within one body, in that body's frame.
    #[inline]
    pub fn box_in_body(&self, id: ElementId) -> &Aabb {
        &self.local_boxes[id.0 as usize]
    }

    /// A distance that leads out of the scene from anywhere in it, metres: a power of two, so that
    /// it seldom changes.
    pub fn far_m(&self) -> f64 {
        self.far_m
    }

    /// Whether a body is there at all.
    #[inline]
    pub fn is_present(&self, body: BodyId) -> bool {
        self.present[body.0 as usize]
    }

    /// Unit normal of a patch: in its body's frame if `in_body`, else in the world.
    pub fn normal(&self, patch: PatchId, in_body: bool) -> DVec3 {
        let patch = self.patch(patch);
        if in_body { patch.local.normal } else { patch.world.normal }
    }

    /// A patch as a blocker in the world.
    #[inline]
    pub fn occluder(&self, patch: PatchId) -> OccluderPolygon<'_> {
        self.world.get(patch.0 as usize)
    }

    /// A patch as a blocker in its body's frame: for light between two elements of that body,
    /// which must not depend on where the body is.
    #[inline]
    pub fn occluder_in_body(&self, patch: PatchId) -> OccluderPolygon<'_> {
        self.local.get(patch.0 as usize)
    }

    /// Whether the patch is the back of a double-sided polygon, whose front blocks already.
    #[inline]
    pub fn is_hidden_twin(&self, patch: PatchId) -> bool {
        self.hidden_twin[patch.0 as usize]
    }
}

/// The power of two above 1.5 diagonals.
fn far(diagonal_m: f64) -> f64 {
    let mut far = 1.0;
    while far < 1.5 * diagonal_m {
        far *= 2.0;
    }
    while far >= 3.0 * diagonal_m && far > f64::MIN_POSITIVE {
        far *= 0.5;
    }
    far
}

fn hidden_twins(scene: &Scene) -> Vec<bool> {
    let twin_is_first =
        |(i, p): (usize, &crate::scene::Patch)| p.twin.is_some_and(|t| (t.0 as usize) < i);
    scene.patches.iter().enumerate().map(twin_is_first).collect()
}

/// Rounding of what is made here in double precision, as a share of that of files.
const FINER: f64 = 1.0 / (1 << 24) as f64;

fn world_patch(scene: &Scene, patch: &crate::scene::Patch, poses: &[Option<Pose>]) -> WorldPatch {
    let pose = poses[patch.body.0 as usize].unwrap_or(Pose::IDENTITY);
    let f = patch.frame;
    WorldPatch {
        local: f,
        world: Frame {
            origin: pose.point(f.origin),
            u: pose.direction(f.u),
            v: pose.direction(f.v),
            normal: pose.direction(f.normal),
        },
        body: patch.body,
        twin: patch.twin,
        rounding_m: patch.rounding_m() * if scene.is_distant(patch.body) { FINER } else { 1.0 },
        lying_m2: scene.lying_m2(patch),
    }
}

fn world_light(light: &Light, pose: Option<Pose>) -> Option<WorldLight> {
    let pose = pose?;
    Some(WorldLight {
        position: pose.translation,
        direction: pose.direction(DVec3::NEG_Z),
        kind: light.kind,
    })
}

fn boxes(forest: &Forest, poses: &[Option<Pose>], world: &Occluders, scene: &Scene) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; forest.fixed_len() as usize];
    for id in (0..forest.fixed_len()).rev() {
        let element = ElementId(id);
        // Facets and polygons take their patch's box: they are small parts of it at worst.
        if let Some(patch) = forest.patch(element) {
            let body = scene.patches[patch.0 as usize].body;
            if poses[body.0 as usize].is_some() {
                let corners = world.get(patch.0 as usize).corners;
                boxes[id as usize] = Aabb::of(corners.iter().copied());
            }
        }
        // The scene is no larger for what is outside it.
        let outside = |parent| forest.is_distant(element) && !forest.is_distant(parent);
        if let Some(parent) = forest.parent(element).filter(|&parent| !outside(parent)) {
            let own = boxes[id as usize];
            let parent_box = &mut boxes[parent.0 as usize];
            *parent_box = parent_box.union(own);
        }
    }
    boxes
}

/// Takes the boxes of what is distant out of those of all nodes; none if nothing is.
fn take_distant(forest: &Forest, boxes: &mut [Aabb]) -> Vec<Aabb> {
    let mut distant = Vec::new();
    for id in (0..forest.fixed_len()).filter(|&id| forest.is_distant(ElementId(id))) {
        distant.resize(boxes.len(), Aabb::EMPTY);
        distant[id as usize] = std::mem::replace(&mut boxes[id as usize], Aabb::EMPTY);
    }
    distant
}

/// An element placed in space for one query.
#[derive(Clone, Copy, Debug)]
pub struct WorldElement {
    /// Corners, counter-clockwise from the front, metres; a triangle repeats its last.
    pub corners: [DVec3; 4],
    /// Three or four.
    pub len: usize,
    /// Its plane.
    pub plane: Plane,
    /// Axes of the patch's frame in the plane.
    pub axes: [DVec3; 2],
    /// Centroid.
    pub centre: DVec3,
    /// Largest distance of a corner from the centre, metres.
    pub radius: f64,
    /// Area, m2.
    pub area: f64,
    /// Box around it.
    pub bounds: Aabb,
    /// How far its corners may be off their exact place, metres.
    pub rounding_m: f64,
}

impl WorldElement {
    /// Places an element: in its body's frame if `in_body`, else in the world.
    ///
    /// # Panics
    /// If `id` is not an element.
    #[inline]
    pub fn new(view: &WorldView, forest: &Forest, id: ElementId, in_body: bool) -> WorldElement {
        debug_assert_eq!(forest.kind(id), Kind::Element);
        let patch = view.patch(forest.patch(id).expect("an element has a patch"));
        WorldElement::of_shape(patch, &forest.shape(id), in_body)
    }

    /// Places a shape of a patch as if it were an element of it.
    #[inline]
    pub fn of_shape(patch: &WorldPatch, shape: &Shape, in_body: bool) -> WorldElement {
        let frame = if in_body { &patch.local } else { &patch.world };
        let place = |p: DVec2| frame.point(p);
        let [a, b, c, d] = shape.corners;
        let corners = [place(a), place(b), place(c), place(d)];
        let centre = place(shape.centroid());
        let reach2 = corners.iter().map(|c| (*c - centre).length_squared()).fold(0.0, f64::max);
        WorldElement {
            corners,
            len: shape.len,
            plane: Plane::through(frame.origin, frame.normal),
            axes: [frame.u, frame.v],
            centre,
            radius: reach2.sqrt(),
            area: shape.area(),
            bounds: Aabb::of(corners),
            rounding_m: patch.rounding_m,
        }
    }

    /// The point at parameters `(s, t)` of the unit square.
    #[inline]
    pub fn point(&self, s: f64, t: f64) -> DVec3 {
        bilinear(&self.corners, s, t)
    }

    /// Plane coordinates of a point relative to the centroid, metres.
    #[inline]
    pub fn offset(&self, p: DVec3) -> DVec2 {
        let d = p - self.centre;
        DVec2::new(d.dot(self.axes[0]), d.dot(self.axes[1]))
    }

    /// The relative gradient, 1/m, of a linear density over the element whose centre of mass is
    /// `shift` away from the centroid (plane coordinates, metres).
    pub fn gradient_of_shift(&self, shift: DVec2) -> DVec2 {
        let corners = self.corners.map(|c| self.offset(c));
        let [xx, xy, yy] = Shape { corners, len: self.len }.second_moment();
        let det = (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        DVec2::new(shift.x * yy - shift.y * xy, shift.y * xx - shift.x * xy) / det
    }

    /// Signed distances of the corners from a plane, metres.
    #[inline]
    pub fn span(&self, plane: &Plane) -> Interval {
        // Written out: as a map it is a call for each corner.
        let [p, q, r, s] = &self.corners;
        let d = [plane.distance(*p), plane.distance(*q), plane.distance(*r), plane.distance(*s)];
        Interval { lo: d[0].min(d[1]).min(d[2].min(d[3])), hi: d[0].max(d[1]).max(d[2].max(d[3])) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_as_far_from_a_polygon_as_from_its_face_edge_or_corner() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let edge = |k: usize| {
            let along = corners[(k + 1) % 4] - corners[k];
            Plane::through(corners[k], DVec3::Z.cross(along))
        };
        let edges = [edge(0), edge(1), edge(2), edge(3)];
        let plane = Plane::through(DVec3::ZERO, DVec3::Z);
        let square = OccluderPolygon { plane, edges: &edges, corners: &corners };
        let places = [
            (DVec3::new(0.3, 0.6, -2.0), 2.0),
            (DVec3::new(0.3, -3.0, 4.0), 5.0),
            (DVec3::new(3.0, 4.0, 6.0), 7.0),
            (DVec3::new(0.5, 0.5, 0.0), 0.0),
        ];
        for (p, distance) in places {
            assert!((square.distance(p) - distance).abs() < 1e-12, "{p}: {}", square.distance(p));
        }
    }
}
