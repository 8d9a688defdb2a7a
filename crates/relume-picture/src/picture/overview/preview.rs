//! A rough solution at one instant: what the light does on some thousand points, well enough to tell
//! what is lit from what is dark.
//!
//! Direct light from points on lamps and from punctual lights, by one shadow ray each; then bounces along
//! fixed rays from point to point. Luminance only. Good for choosing a view and for sketches; no number may rest on it.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use relume_core::geometry::Pose;
use relume_core::scene::outside::OutsideNow;
use relume_core::scene::{Light, LightKind, Patch, PatchId, Scene};

use super::super::tone::luminance;
use super::super::tuning::{
    BOUNCES, CELLS, LAMP_POINTS, LIGHTS, LIT, MANY, POINTS, POINTS_OF_PATCH, STOPS,
};
use super::caster::{Caster, LIFT};

/// Rays for bounces: from each point, and from all of them.
const RAYS: (usize, usize) = (16, 1 << 17);

/// Lamps are no nearer than this to what they light, in units of the scene.
const NEAREST: f32 = 1e-3;

/// Golden ratio's fraction, and the fractions of its plastic sister: sequences that spread evenly
/// (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
const GOLDEN: f64 = 0.618_033_988_749_895;
const PLASTIC: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];

/// A point on the front of a patch.
struct Point {
    at: Vec3,
    normal: Vec3,
    /// Share of its patch, m2.
    area_m2: f64,
    reflectance: f64,
    emits: bool,
}

/// The rough solution.
pub(in super::super) struct Preview {
    points: Vec<Point>,
    lamps: Lamps,
    /// For each patch the range of its points.
    ranges: Vec<Range<u32>>,
    /// How bright a point is in the eye of a picture exposed for what is lit: 1 at the typical radiosity, 0
    /// eight stops below it.
    pub(in super::super) brightness: Vec<f64>,
    /// Luminance of the reflected radiosity of each point after some bounces, W/m2.
    pub(in super::super) reflected: Vec<f64>,
    /// Whether light arrives at a point, on lamps too: so much that it is bright, or, where it reflects nothing, any.
    lit: Vec<bool>,
    /// Whether anything is lit at all.
    pub(in super::super) is_lit: bool,
}

/// Rays that look for the sky: from a point, at least and at most, and from all of them.
const SKY_RAYS: (usize, usize, usize) = (4, 16, 1 << 19);

impl Preview {
    /// Of a scene and the light from outside at `time_s`; `poses` by body.
    pub(in super::super) fn new(
        (scene, sky): (&Scene, Option<&OutsideNow>),
        time_s: f64,
        poses: &[Option<Pose>],
        caster: &Caster,
    ) -> Preview {
        let (points, ranges) = spread(scene, time_s, poses, caster);
        let (brightness, reflected) = (Vec::new(), vec![0.0; points.len()]);
        let lamps = Lamps::new(scene, time_s, poses, caster);
        let (lit, is_lit) = (vec![false; points.len()], false);
        let mut preview = Preview { points, lamps, ranges, brightness, reflected, lit, is_lit };
        let of_sky = |k: usize| sky.map_or(0.0, |sky| preview.sky_irradiance(sky, caster, k));
        let direct: Vec<f64> = (0..preview.points.len())
            .into_par_iter()
            .map(|k| {
                preview.lamp_irradiance(preview.points[k].at, preview.points[k].normal, caster)
                    + of_sky(k)
            })
            .collect();
        if direct.iter().all(|&e| e == 0.0) {
            preview.brightness = vec![1.0; preview.points.len()];
            return preview;
        }
        preview.is_lit = true;
        preview.reflected = preview.bounce(scene, caster, &direct);
        let typical = preview.typical();
        let of_point = |(point, &b): (&Point, &f64)| match point.emits {
            true => 1.0,
            false => beside_typical(b, typical),
        };
        preview.brightness = preview.points.iter().zip(&preview.reflected).map(of_point).collect();
        preview.lit = (0..preview.points.len())
            .map(|k| match preview.points[k].reflectance > 0.0 {
                true => beside_typical(preview.reflected[k], typical) > LIT,
                false => direct[k] > 0.0,
            })
            .collect();
        preview
    }

    /// Area that a point stands for, m2.
    pub(super) fn area_m2(&self, point: usize) -> f64 {
        self.points[point].area_m2
    }

    /// Where a point is, in units of the scene.
    pub(super) fn at(&self, point: usize) -> Vec3 {
        self.points[point].at
    }

    /// Points in all.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether a point is on a lamp.
    pub(in super::super) fn emits(&self, point: usize) -> bool {
        self.points[point].emits
    }

    /// Whether light arrives at a point, be it on a lamp or black.
    pub(in super::super) fn is_lit(&self, point: usize) -> bool {
        self.lit[point]
    }

    /// Irradiance that comes directly from lamps and lights to a place on a surface, in units of the scene, W/m2.
    pub(in super::super) fn lamp_irradiance(&self, at: Vec3, normal: Vec3, caster: &Caster) -> f64 {
        self.lamps.irradiance((at, normal), caster)
    }

    /// The point of a patch that is nearest to a place on it.
    pub(in super::super) fn point_at(&self, patch: PatchId, place: Vec3) -> usize {
        let Range { start, end } = self.ranges[patch.0 as usize];
        let off = |k: &usize| self.points[*k].at.distance_squared(place);
        (start as usize..end as usize)
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap_or(start as usize)
    }

    /// Reflected radiosity of each point after some bounces, W/m2.
    fn bounce(&self, scene: &Scene, caster: &Caster, direct: &[f64]) -> Vec<f64> {
        let rays = (RAYS.1 / self.points.len().max(1)).clamp(2, RAYS.0);
        let seen: Vec<Vec<usize>> = (0..self.points.len())
            .into_par_iter()
            .map(|k| self.in_sight(scene, caster, k, rays))
            .collect();
        let mut reflected = vec![0.0; self.points.len()];
        for _ in 0..=BOUNCES {
            let next = |k: usize| {
                let indirect = seen[k].iter().map(|&other| reflected[other]).sum::<f64>();
                self.points[k].reflectance * (direct[k] + indirect / rays as f64)
            };
            reflected = (0..self.points.len()).map(next).collect();
        }
        reflected
    }

    /// Irradiance at a point from the sky and the sun, W/m2: the sun's where its rays arrive, the sky's by what rays meet
    /// nothing.
    fn sky_irradiance(&self, sky: &OutsideNow, caster: &Caster, k: usize) -> f64 {
        let point = &self.points[k];
        let is_open = |towards: &Vec3| {
            caster.is_free(point.at + point.normal * LIFT, *towards, f32::INFINITY)
        };
        let grey = |l: [f64; 3]| luminance(l.map(|l| l as f32));
        let (least, most, all) = SKY_RAYS;
        let rays = (all / self.points.len().max(1)).clamp(least, most);
        let open = self.directions(k, rays).filter(is_open);
        let sum = open.map(|towards| grey(sky.sky_radiance(towards.as_dvec3()))).sum::<f64>();
        let sun = sky.sun_beam().map_or(0.0, |(towards, beam_w_m2)| {
            let towards = towards.as_vec3();
            let cosine = f64::from(point.normal.dot(towards)).max(0.0);
            if cosine > 0.0 && is_open(&towards) { grey(beam_w_m2) * cosine } else { 0.0 }
        });
        std::f64::consts::PI * sum / rays as f64 + sun
    }

    /// Directions from a point, spread by the cosine.
    fn directions(&self, k: usize, rays: usize) -> impl Iterator<Item = Vec3> + '_ {
        let normal = self.points[k].normal;
        let (u, v) = normal.any_orthonormal_pair();
        (0..rays).map(move |j| {
            let share = (j as f64 + 0.5) / rays as f64;
            let turns = j as f64 * GOLDEN + k as f64 * PLASTIC[0];
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * turns.fract());
            let (up, out) = ((1.0 - share).sqrt() as f32, share.sqrt() as f32);
            let towards = u * (cos as f32 * out) + v * (sin as f32 * out) + normal * up;
            towards.normalize()
        })
    }

    /// Points on what rays from a point meet, the rays spread by the cosine.
    fn in_sight(&self, scene: &Scene, caster: &Caster, k: usize, rays: usize) -> Vec<usize> {
        let point = &self.points[k];
        let met = |towards: Vec3| {
            let hit = caster.first(scene, point.at + point.normal * LIFT, towards)?;
            Some(self.point_at(hit.front?, point.at + towards * hit.distance))
        };
        self.directions(k, rays).filter_map(met).collect()
    }

    /// The logarithm of the typical reflected radiosity.
    fn typical(&self) -> f64 {
        // What is met where light is, not where surface is, as most of a scene may be dark; and its logarithm,
        // as there may be bright spots.
        let lit = || self.points.iter().zip(&self.reflected).filter(|(_, b)| **b > 0.0);
        let weight: f64 = lit().map(|(point, b)| point.area_m2 * b).sum();
        lit().map(|(point, b)| point.area_m2 * b * libm::log2(*b)).sum::<f64>() / weight
    }
}

/// How bright a reflected radiosity is beside the typical one, of which the logarithm is given.
fn beside_typical(reflected: f64, typical: f64) -> f64 {
    match reflected > 0.0 {
        true => (1.0 + (libm::log2(reflected) - typical) / STOPS).clamp(0.0, 1.0),
        false => 0.0,
    }
}

/// Points on all patches that are present, and which are those of each patch: of some thousand patches and more, small
/// neighbours that face alike share one, so that the cost is bounded.
fn spread(
    scene: &Scene,
    time_s: f64,
    poses: &[Option<Pose>],
    caster: &Caster,
) -> (Vec<Point>, Vec<Range<u32>>) {
    let mut points: Vec<Point> = Vec::new();
    let mut ranges = Vec::with_capacity(scene.patches.len());
    let mut shared: BTreeMap<Cell, u32> = BTreeMap::new();
    let are_many = scene.patches.len() > MANY;
    let whole_m2 = scene.area_m2();
    for patch in &scene.patches {
        let first = points.len() as u32;
        let Some(pose) = &poses[patch.body.0 as usize] else {
            ranges.push(first..first);
            continue;
        };
        let area_m2 = patch.area_m2();
        let count = (area_m2 / whole_m2 * POINTS).ceil() as usize;
        let count = count.clamp(1, POINTS_OF_PATCH);
        let point = |at| Point {
            at: caster.place(pose.point(patch.frame.point(at))),
            normal: pose.direction(patch.frame.normal).as_vec3(),
            area_m2: area_m2 / count as f64,
            reflectance: scene.reflectance(patch).iter().sum::<f64>() / 3.0,
            emits: scene.exitance_at(patch, time_s).iter().any(|&m| m > 0.0),
        };
        if are_many && count == 1 {
            let one = on_patch(patch, 1).map(point).next().expect("one point was asked for");
            let index = *shared.entry(one.cell()).or_insert(first);
            match points.get_mut(index as usize) {
                Some(point) => point.stand_for(&one),
                None => points.push(one),
            }
            ranges.push(index..index + 1);
        } else {
            points.extend(on_patch(patch, count).map(point));
            ranges.push(first..points.len() as u32);
        }
    }
    (points, ranges)
}

/// Where a point is and where it faces, roughly, and whether it emits.
type Cell = ([i32; 3], usize, bool);

impl Point {
    fn cell(&self) -> Cell {
        let at = (self.at * CELLS).floor().as_ivec3().to_array();
        let n = self.normal.to_array();
        let axis = (0..3).fold(0, |most, k| if n[k].abs() > n[most].abs() { k } else { most });
        (at, 2 * axis + usize::from(n[axis] < 0.0), self.emits)
    }

    /// Counts another point in, where this one is.
    fn stand_for(&mut self, other: &Point) {
        let area_m2 = self.area_m2 + other.area_m2;
        let reflected = self.reflectance * self.area_m2 + other.reflectance * other.area_m2;
        (self.reflectance, self.area_m2) = (reflected / area_m2, area_m2);
    }
}

/// Points spread evenly over a patch, in its frame.
fn on_patch(patch: &Patch, count: usize) -> impl Iterator<Item = DVec2> + '_ {
    let origin = patch.corners[0];
    let fan: Vec<(f64, DVec2, DVec2)> = patch.corners[1..]
        .windows(2)
        .map(|pair| (pair[0] - origin, pair[1] - origin))
        .map(|(b, c)| (b.perp_dot(c).abs(), b, c))
        .collect();
    let whole: f64 = fan.iter().map(|t| t.0).sum();
    (0..count).map(move |k| {
        let mut left = (k as f64 + 0.5) / count as f64 * whole;
        let mut at = 0;
        while at + 1 < fan.len() && left > fan[at].0 {
            left -= fan[at].0;
            at += 1;
        }
        let (_, b, c) = fan[at];
        // A parallelogram folded onto its half.
        let [u, v] = PLASTIC.map(|step| ((k + 1) as f64 * step).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let (u, v) = if count == 1 { (1.0 / 3.0, 1.0 / 3.0) } else { (u, v) };
        origin + b * u + c * v
    })
}

/// A place on a lamp, and what it stands for.
struct LampPoint {
    at: Vec3,
    normal: Vec3,
    exitance_w_m2: f64,
    area_m2: f64,
}

/// What shines at one instant.
struct Lamps {
    points: Vec<LampPoint>,
    /// Lights with where they are and which way they shine; intensity in W/sr or W/m2.
    lights: Vec<(Vec3, Vec3, LightKind, f64)>,
}

impl Lamps {
    fn new(scene: &Scene, time_s: f64, poses: &[Option<Pose>], caster: &Caster) -> Lamps {
        Lamps {
            points: lamp_points(scene, time_s, poses, caster),
            lights: lights(scene, time_s, caster),
        }
    }

    /// Irradiance that comes to a point directly, W/m2.
    fn irradiance(&self, (at, normal): (Vec3, Vec3), caster: &Caster) -> f64 {
        let unit_m2 = caster.unit_m() * caster.unit_m();
        let from = at + normal * LIFT;
        // Towards what shines: direction, cosine, distance squared, m2; nothing where it is behind or hidden.
        let in_sight = |at: Vec3| {
            let way = at - from;
            let (distance, towards) = (way.length().max(NEAREST), way.normalize_or_zero());
            let cosine = towards.dot(normal);
            let sees = cosine > 0.0 && caster.is_free(from, towards, way.length() - LIFT);
            sees.then(|| (towards, f64::from(cosine), f64::from(distance * distance) * unit_m2))
        };
        let of_lamp = |lamp: &LampPoint| {
            let facing = f64::from(-(lamp.at - from).normalize_or_zero().dot(lamp.normal));
            let seen = if facing > 0.0 { in_sight(lamp.at) } else { None };
            // As from a disc of its area: never more than it emits, however near.
            seen.map_or(0.0, |(_, cosine, distance_m2)| {
                let disc = std::f64::consts::PI * distance_m2 + lamp.area_m2;
                lamp.exitance_w_m2 * lamp.area_m2 * facing * cosine / disc
            })
        };
        let of_light = |&(at, axis, kind, strength): &(Vec3, Vec3, LightKind, f64)| match kind {
            LightKind::Directional => {
                let cosine = -axis.dot(normal);
                let lit = cosine > 0.0 && caster.is_free(from, -axis, f32::INFINITY);
                if lit { strength * f64::from(cosine) } else { 0.0 }
            }
            LightKind::Point => in_sight(at).map_or(0.0, |(_, cosine, r2)| strength * cosine / r2),
            LightKind::Spot { inner, outer } => {
                in_sight(at).map_or(0.0, |(towards, cosine, r2)| {
                    let along = f64::from(-towards.dot(axis));
                    let [full, none] = [inner, outer].map(libm::cos);
                    let share = ((along - none) / (full - none).max(1e-9)).clamp(0.0, 1.0);
                    strength * cosine / r2 * share * share
                })
            }
        };
        self.points.iter().map(of_lamp).sum::<f64>() + self.lights.iter().map(of_light).sum::<f64>()
    }
}

/// Points on lamps, as many on each as it has of the flux.
fn lamp_points(
    scene: &Scene,
    time_s: f64,
    poses: &[Option<Pose>],
    caster: &Caster,
) -> Vec<LampPoint> {
    let flux = |patch: &Patch| {
        let exitance = scene.exitance_at(patch, time_s);
        let there = poses[patch.body.0 as usize].is_some();
        if there { patch.area_m2() * luminance(exitance.map(|m| m as f32)) } else { 0.0 }
    };
    let whole_w: f64 = scene.patches.iter().map(flux).sum();
    let each_w = whole_w / LAMP_POINTS as f64;
    let mut points = Vec::new();
    let mut sum_w = 0.0;
    for patch in scene.patches.iter().filter(|patch| flux(patch) > 0.0) {
        let Some(pose) = &poses[patch.body.0 as usize] else { continue };
        let exitance_w_m2 = flux(patch) / patch.area_m2();
        let begun = (sum_w / each_w + 0.5).floor();
        sum_w += flux(patch);
        let count = ((sum_w / each_w + 0.5).floor() - begun) as usize;
        let normal = pose.direction(patch.frame.normal).as_vec3();
        for at in on_patch(patch, count.min(LAMP_POINTS)) {
            let at = caster.place(pose.point(patch.frame.point(at)));
            let at = at + normal * LIFT;
            points.push(LampPoint { at, normal, exitance_w_m2, area_m2: each_w / exitance_w_m2 });
        }
    }
    points
}

/// The strongest lights that are there.
fn lights(scene: &Scene, time_s: f64, caster: &Caster) -> Vec<(Vec3, Vec3, LightKind, f64)> {
    let of_light = |light: &Light| {
        let pose = scene.motion.pose(light.node, time_s)?;
        let strength = luminance(light.intensity_at(time_s).map(|i| i as f32));
        let axis = pose.direction(DVec3::NEG_Z).as_vec3();
        (strength > 0.0).then(|| (caster.place(pose.translation), axis, light.kind, strength))
    };
    let mut lights: Vec<_> = scene.lights.iter().filter_map(of_light).collect();
    lights.sort_by(|one, other| other.3.total_cmp(&one.3));
    lights.truncate(LIGHTS);
    lights
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use relume_core::scene::{BodyId, SceneBuilder};

    use super::*;

    /// A floor of many small tiles of two reflectances: points are far fewer than tiles, and stand for all of them.
    #[test]
    fn small_neighbours_share_a_point() {
        let mut b = SceneBuilder::new("tiles");
        let node = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
        let colours = [0.2, 0.6].map(|r| b.material(&format!("{r}"), [r; 3], [0.0; 3]));
        let side = 110;
        for k in 0..side * side {
            let (x, z) = (f64::from(k % side), f64::from(k / side));
            let corners = [(x, z), (x, z + 1.0), (x + 1.0, z + 1.0), (x + 1.0, z)];
            let corners = corners.map(|(x, z)| DVec3::new(x, 0.0, z));
            // A group each, so that they stay polygons of their own.
            b.polygon(node, &k.to_string(), colours[(k % 2) as usize], &corners);
        }
        let scene = b.build().unwrap();
        let patches = scene.patches.len();
        assert_eq!(patches, (side * side) as usize);
        let poses = [scene.pose(BodyId(0), 0.0)];
        let unit = (DVec3::new(55.0, 0.0, 55.0), 156.0);
        let caster = Caster::new(&scene, &poses, unit);
        let (points, ranges) = spread(&scene, 0.0, &poses, &caster);
        assert!(points.len() < patches / 8, "{}", points.len());
        let whole_m2: f64 = points.iter().map(|p| p.area_m2).sum();
        assert!((whole_m2 - scene.area_m2()).abs() < 1e-6 * whole_m2);
        let reflected: f64 = points.iter().map(|p| p.area_m2 * p.reflectance).sum();
        assert!((reflected / whole_m2 - 0.4).abs() < 1e-6);
        let is_near = |patch: usize| {
            let own = caster.place(scene.patches[patch].frame.origin);
            let range = &ranges[patch];
            range.len() == 1 && points[range.start as usize].at.distance(own) < 2.0 / CELLS
        };
        assert!((0..patches).all(is_near));
    }
}
