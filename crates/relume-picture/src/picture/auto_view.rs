//! A sensible view for a scene without a camera.
//!
//! Must not know light, apart from which surfaces emit. The view is a pure function of the scene,
//! fixed over its animation.
//!
//! First the kind of place: from points in its middle, the share of directions in which the front of
//! a patch is the first thing met tells a closed room (all), a room open somewhere (most) and
//! objects in open space (few). Each kind has its candidate views, and all candidates are scored in
//! one way, from tiny pictures of the scene at a few instants:
//!
//! `score = seen + 0.3 (front - back) + 0.1 lamps - close`
//!
//! where `seen` is the share of the scene's area that the picture shows from the front, `front` and
//! `back` are the shares of pixels that meet a front or a back first, `lamps` is the seen share of
//! the emitting area, and `close` the share of pixels that meet something right in front of the
//! camera. The first best candidate wins.

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use relume::geometry::Pose;
use relume::scene::{Patch, Scene};

use super::camera::View;
use super::project::{Projector, SeenPlane, clip_to_pixels};
use super::raster::{Fragment, Grid, Primitive, rasterise};

/// Vertical field of view from outside and from inside, radians.
const YFOV_OUTSIDE: f64 = 0.7;
const YFOV_INSIDE: f64 = 1.1;

/// Width : height that candidates are framed for.
const ASPECT: f64 = 4.0 / 3.0;

/// Rows of the pictures that are scored.
const ROWS: u32 = 36;

/// A middle that sees fronts in this share of directions is a room, and a closed one.
const ROOM: f64 = 0.45;
const CLOSED: f64 = 0.97;

/// A middle must also see points this far apart, relative to the diagonal of the bounds: the
/// inside of a double-sided object is no room.
const SPAN: f64 = 0.4;

/// Instants at which the swept bounds are taken.
const SWEEP_STEPS: u32 = 64;

/// See [`View::automatic`].
pub(crate) fn choose(scene: &Scene) -> View {
    let Some(bounds) = Bounds::swept(scene) else {
        return View::look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, YFOV_OUTSIDE);
    };
    let duration = scene.motion.duration_s;
    let stages: Vec<Stage> = (0..if duration > 0.0 { 3 } else { 1 })
        .map(|i| Stage::new(scene, duration * f64::from(i) / 3.0, bounds.diagonal()))
        .collect();
    let middle = Middle::new(&stages[0], &bounds);
    let mut candidates = Vec::new();
    if middle.enclosure < CLOSED {
        candidates.extend(outside(&bounds));
    }
    if middle.enclosure > ROOM {
        candidates.extend(inside(&bounds));
    }
    let scores: Vec<f64> = candidates
        .par_iter()
        .map(|view| stages.iter().map(|stage| stage.score(view)).sum())
        .collect();
    let mut best = 0;
    for (i, &score) in scores.iter().enumerate() {
        // Nearly equal candidates, as in a symmetric room, are not told apart by rounding.
        if score > scores[best] + 1e-9 {
            best = i;
        }
    }
    candidates[best]
}

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    /// Of everything, over the whole animation; `None` if there is nothing.
    fn swept(scene: &Scene) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        for body in &scene.bodies {
            let steps = if scene.motion.moves(body.node) { SWEEP_STEPS } else { 0 };
            for step in 0..=steps {
                let time = scene.motion.duration_s * f64::from(step) / f64::from(steps.max(1));
                let Some(pose) = scene.motion.pose(body.node, time) else { continue };
                for patch in &scene.patches[body.patches.start as usize..body.patches.end as usize]
                {
                    for p in patch.corners_in_body().map(|p| pose.point(p)) {
                        let b = bounds.unwrap_or(Bounds { low: p, high: p });
                        bounds = Some(Bounds { low: b.low.min(p), high: b.high.max(p) });
                    }
                }
            }
        }
        bounds
    }

    /// The point at the given shares of the three sides.
    fn at(&self, x: f64, y: f64, z: f64) -> DVec3 {
        self.low + (self.high - self.low) * DVec3::new(x, y, z)
    }

    fn diagonal(&self) -> f64 {
        self.low.distance(self.high)
    }

    fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        let side = |i: u32, bit: u32| f64::from(i >> bit & 1);
        (0..8).map(move |i| self.at(side(i, 0), side(i, 1), side(i, 2)))
    }
}

/// Sixteen directions around the vertical axis, (x, z), the four axes first; slopes rather than
/// angles, so that no transcendental function is needed.
fn azimuths() -> impl Iterator<Item = DVec2> {
    let quarter = [(0.0, 1.0), (1.0, 1.0), (0.5, 1.0), (1.0, 0.5)];
    quarter.into_iter().flat_map(|(x, z)| {
        let d = DVec2::new(x, z).normalize();
        [d, DVec2::new(d.y, -d.x), -d, DVec2::new(-d.y, d.x)]
    })
}

/// Views from outside that just hold the bounds, from the horizon to half-way up.
fn outside(bounds: &Bounds) -> Vec<View> {
    let mut views = Vec::new();
    for slope in [0.0, 0.12, 0.3, 0.5, 0.8] {
        for azimuth in azimuths() {
            views.push(framing(bounds, DVec3::new(azimuth.x, slope, azimuth.y)));
        }
    }
    views
}

/// The view from direction `towards_eye` at the least distance that holds the bounds, with a
/// margin of a twentieth.
fn framing(bounds: &Bounds, towards_eye: DVec3) -> View {
    let centre = bounds.at(0.5, 0.5, 0.5);
    let view = View::look_at(centre + towards_eye, centre, YFOV_OUTSIDE);
    let slope_y = libm::tan(YFOV_OUTSIDE / 2.0) * 0.95;
    let slope = DVec2::new(slope_y * ASPECT, slope_y);
    let axes = view.world_from_camera;
    let distance = bounds.corners().fold(0.0_f64, |distance, corner| {
        let local = axes.inverse_direction(corner - centre);
        distance.max(local.z + (local.truncate().abs() / slope).max_element())
    });
    let eye = centre + towards_eye.normalize() * distance.max(1e-6);
    View::look_at(eye, centre, YFOV_OUTSIDE)
}

/// Views from near the walls and corners of the bounds, at and above mid height, across the middle.
fn inside(bounds: &Bounds) -> Vec<View> {
    let mut views = Vec::new();
    for inset in [0.04, 0.15] {
        for height in [0.55, 0.7, 0.85] {
            for (x, z) in [(1, 2), (0, 2), (2, 2), (2, 1), (0, 1), (2, 0), (0, 0), (1, 0)] {
                let share = |i: i32| [inset, 0.5, 1.0 - inset][i as usize];
                let eye = bounds.at(share(x), height, share(z));
                let target = bounds.at(1.0 - share(x), 0.4, 1.0 - share(z));
                let target = target.midpoint(bounds.at(0.5, 0.4, 0.5));
                views.push(View::look_at(eye, target, YFOV_INSIDE));
            }
        }
    }
    views
}

/// What is met by looking around from points in the middle of the bounds.
struct Middle {
    /// Greatest share of directions in which a front is met first.
    enclosure: f64,
    /// Which patches are seen from points that are in a room.
    seen: Vec<bool>,
}

impl Middle {
    fn new(stage: &Stage, bounds: &Bounds) -> Middle {
        let mut middle = Middle { enclosure: 0.0, seen: vec![false; stage.areas.len()] };
        for (x, z) in [(0.5, 0.5), (0.3, 0.3), (0.7, 0.3), (0.3, 0.7), (0.7, 0.7)] {
            for y in [0.5, 0.75] {
                middle.look_around(stage, bounds.at(x, y, z));
            }
        }
        let emits = |index: usize| stage.emits(&stage.scene.patches[index]);
        let mut emitters =
            (0..stage.areas.len()).filter(|&i| stage.areas[i] > 0.0 && emits(i)).peekable();
        // A dark inside, while something shines outside: an object.
        if emitters.peek().is_some() && !emitters.any(|i| middle.seen[i]) {
            middle.enclosure = 0.0;
        }
        middle
    }

    fn look_around(&mut self, stage: &Stage, eye: DVec3) {
        let sides = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|d| [d, -d]);
        let met: Vec<Met> = sides
            .map(|side| View::look_at(eye, eye + side, std::f64::consts::FRAC_PI_2))
            .flat_map(|view| stage.look(&view, 16, 16))
            .collect();
        let fronts = || met.iter().filter(|m| m.front);
        let (low, high) = fronts().fold((eye, eye), |(l, h), m| (l.min(m.point), h.max(m.point)));
        let enclosure = fronts().count() as f64 / met.len() as f64;
        if enclosure > ROOM && low.distance(high) > SPAN * stage.diagonal {
            self.enclosure = self.enclosure.max(enclosure);
            fronts().filter_map(|m| m.patch).for_each(|patch| self.seen[patch] = true);
        }
    }
}

/// The scene at one instant.
struct Stage<'a> {
    scene: &'a Scene,
    poses: Vec<Option<Pose>>,
    diagonal: f64,
    /// Area of each patch, 0 while it is absent, m2; indexed by patch.
    areas: Vec<f64>,
}

/// What a pixel of a scored picture meets.
#[derive(Clone, Copy, Default)]
struct Met {
    patch: Option<usize>,
    front: bool,
    /// World point, metres.
    point: DVec3,
    /// Distance, metres.
    distance: f64,
    /// Area of the patch that the pixel shows, m2.
    area: f64,
}

impl<'a> Stage<'a> {
    fn new(scene: &'a Scene, time_s: f64, diagonal: f64) -> Self {
        let poses: Vec<_> =
            scene.bodies.iter().map(|b| scene.motion.pose(b.node, time_s)).collect();
        let area = |patch: &Patch| poses[patch.body.0 as usize].map_or(0.0, |_| patch.area_m2());
        let areas = scene.patches.iter().map(area).collect();
        Stage { scene, poses, diagonal, areas }
    }

    fn pose(&self, patch: &Patch) -> Option<&Pose> {
        self.poses[patch.body.0 as usize].as_ref()
    }

    fn emits(&self, patch: &Patch) -> bool {
        self.scene.patch_emits(patch)
    }

    fn score(&self, view: &View) -> f64 {
        let met = self.look(view, (f64::from(ROWS) * ASPECT) as u32, ROWS);
        let mut seen = vec![0.0; self.areas.len()];
        let (mut front, mut back, mut close) = (0.0, 0.0, 0.0);
        for m in &met {
            let Some(patch) = m.patch else { continue };
            if m.distance < 0.06 * self.diagonal {
                close += 1.0;
            }
            if m.front {
                front += 1.0;
                seen[patch] += m.area;
            } else {
                back += 1.0;
            }
        }
        // (seen, whole), of all patches and of those that emit.
        let (mut all, mut lamps) = ([0.0; 2], [0.0; 2]);
        for (index, patch) in self.scene.patches.iter().enumerate() {
            let whole = self.areas[index];
            for (sum, area) in [seen[index].min(whole), whole].into_iter().enumerate() {
                all[sum] += area;
                lamps[sum] += if self.emits(patch) { area } else { 0.0 };
            }
        }
        let share = |[part, whole]: [f64; 2]| if whole > 0.0 { part / whole } else { 0.0 };
        let pixels = met.len() as f64;
        share(all) + 0.1 * share(lamps) + (0.3 * (front - back) - close) / pixels
    }

    /// What each pixel meets first, be it the front or the back of a patch.
    fn look(&self, view: &View, width: u32, height: u32) -> Vec<Met> {
        let grid = Grid::new(width, height, 1);
        let projector = Projector::new(view, width, height);
        let mut drawn = Vec::new();
        let mut primitives = Vec::new();
        for (index, patch) in self.scene.patches.iter().enumerate() {
            let Some(pose) = self.pose(patch) else { continue };
            let origin = pose.point(patch.frame.origin);
            let [u, v, normal] =
                [patch.frame.u, patch.frame.v, patch.frame.normal].map(|d| pose.direction(d));
            let Some(plane) = SeenPlane::new(&projector, origin, u, v) else { continue };
            let front = projector.faces(origin, normal);
            // The back of a double-sided polygon is a patch of its own.
            if !front && patch.twin.is_some() {
                continue;
            }
            for piece in self.pieces(patch, &plane, &grid) {
                primitives.push(piece);
                drawn.push(Drawn { patch: index, plane, origin, u, v, front });
            }
        }
        rasterise(&grid, &primitives, |fragments| {
            let Some(primitive) = fragments[0].primitive else { return Met::default() };
            drawn[primitive].met(&projector, &fragments[0])
        })
    }

    /// The patch as primitives: a fan of triangles.
    fn pieces(&self, patch: &Patch, plane: &SeenPlane, grid: &Grid) -> Vec<Primitive> {
        let near = 1e-6 * self.diagonal;
        let corners: Vec<_> = patch.corners.iter().map(|&c| plane.project(c)).collect();
        let mut clipped = Vec::new();
        let triangles = corners[1..].windows(2).filter_map(|pair| {
            clip_to_pixels(&[corners[0], pair[0], pair[1]], near, &mut clipped);
            Primitive::new(grid, &clipped, plane.nearness)
        });
        triangles.collect()
    }
}

/// A patch on the screen.
struct Drawn {
    patch: usize,
    plane: SeenPlane,
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    front: bool,
}

impl Drawn {
    fn met(&self, projector: &Projector, fragment: &Fragment) -> Met {
        let p = self.plane.unproject(fragment.position);
        let point = self.origin + self.u * p.x + self.v * p.y;
        let towards_point = point - projector.eye();
        let distance = towards_point.length();
        let depth = towards_point.dot(projector.forward());
        // A pixel is the solid angle (depth / distance)^3 / scale^2; a surface at a slant shows more.
        let cosine = (towards_point.dot(self.u.cross(self.v)) / distance).abs().max(1e-3);
        let area =
            depth * depth * depth / (distance * cosine) / (projector.scale() * projector.scale());
        Met { patch: Some(self.patch), front: self.front, point, distance, area }
    }
}
