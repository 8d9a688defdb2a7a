//! A rough picture of a scene that is not solved: rays from the eye, and from what they meet to lamps, sky and the points
//! of the rough solution that overviews are chosen by.
//!
//! For what takes too long to solve, and to tell whether there is light where a view looks. Shadows are right up to noise,
//! light between surfaces is grey and good to some tenths. No number may rest on it. Must not know elements or links.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use relume_core::geometry::Pose;
use relume_core::scene::outside::OutsideNow;
use relume_core::scene::{BodyId, PatchId, Scene};

use super::camera::View;
use super::exposure::{Exposure, Metered};
use super::image::Image;
use super::overview::bounds::Bounds;
use super::overview::caster::{Caster, Hit, LIFT};
use super::overview::preview::Preview;
use super::project::Projector;
use super::render::Settings;
use super::tone::{SrgbEncoder, luminance};
use super::tuning::RAYS;

/// Places within a pixel that are looked at.
const WITHIN: [DVec2; 4] = [
    DVec2::new(0.375, 0.125),
    DVec2::new(0.875, 0.375),
    DVec2::new(0.125, 0.625),
    DVec2::new(0.625, 0.875),
];

/// Pixels across and down of the picture that light is metered by.
const METERED: (u32, u32) = (96, 72);

/// Steps of an even sequence in two dimensions (M. Roberts, 2018), and of one in one.
const PLASTIC: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
const GOLDEN: f64 = 0.618_033_988_749_895;

/// A scene at one instant, ready to be sketched from any view.
pub struct Sketch {
    /// Without what stands for light from outside.
    scene: Scene,
    outside: Option<OutsideNow>,
    poses: Vec<Option<Pose>>,
    time_s: f64,
    traced: Option<(Caster, Preview)>,
}

/// What is seen at one place of a pixel.
struct Seen {
    patch: PatchId,
    hit: Hit,
    /// In units of the scene, and in the world, metres.
    at: Vec3,
    place_m: DVec3,
    /// How far apart neighbouring pixels are on it, metres in the world.
    sides_m: [DVec3; 2],
}

impl Sketch {
    /// Of a scene at `time_s` seconds. Cost: a hierarchy of boxes over all patches and some hundred thousand rays.
    pub fn new(scene: &Scene, time_s: f64) -> Sketch {
        let outside = scene.outside.as_ref().and_then(|outside| outside.at(time_s).ok());
        let scene = match scene.outside {
            Some(_) => scene.without_outside(),
            None => scene.clone(),
        };
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let poses: Vec<Option<Pose>> = bodies.map(|body| scene.pose(body, time_s)).collect();
        let traced = Bounds::swept(&scene).map(|bounds| {
            let caster = Caster::new(&scene, &poses, bounds.unit());
            let preview = Preview::new((&scene, outside.as_ref()), time_s, &poses, &caster);
            (caster, preview)
        });
        Sketch { scene, outside, poses, time_s, traced }
    }

    /// Share of the picture that shows surfaces of a scene at `time_s` seconds, whether there is light or not. Cost: a hierarchy of
    /// boxes over all patches and some thousand rays.
    pub fn shown(scene: &Scene, time_s: f64, view: &View) -> f64 {
        let near = scene.outside.as_ref().map(|_| scene.without_outside());
        let scene = near.as_ref().unwrap_or(scene);
        let Some(bounds) = Bounds::swept(scene) else { return 0.0 };
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let poses: Vec<Option<Pose>> = bodies.map(|body| scene.pose(body, time_s)).collect();
        let caster = Caster::new(scene, &poses, bounds.unit());
        let projector = Projector::new(view, METERED.0, METERED.1);
        let sees = |pixel: &DVec2| {
            let at = *pixel + 0.5;
            let from = caster.place(projector.origin(at));
            caster.first_front(scene, from, projector.direction(at).as_vec3()).is_some()
        };
        let seen = pixels(METERED).filter(sees).count();
        seen as f64 / pixels(METERED).count() as f64
    }

    /// Share of what a view sees of surfaces on which light is to be expected: what is within six stops of the typical, or
    /// black and in the light. Lamps count too, unless they are most of what is seen: then they have no shape but their
    /// outline, and count where light arrives. `None` where it sees no surface.
    pub fn lit(&self, view: &View) -> Option<f64> {
        let (caster, preview) = self.traced.as_ref()?;
        let projector = Projector::new(view, METERED.0, METERED.1);
        let (mut lit, mut lamps, mut lit_lamps, mut all) = (0_u32, 0_u32, 0_u32, 0_u32);
        for pixel in pixels(METERED) {
            if let Some(seen) = self.seen(caster, &projector, pixel + 0.5) {
                let point = preview.point_at(seen.patch, seen.at);
                let is_lit = u32::from(preview.is_lit(point));
                all += 1;
                match preview.emits(point) {
                    true => (lamps, lit_lamps) = (lamps + 1, lit_lamps + is_lit),
                    false => lit += is_lit,
                }
            }
        }
        let counted = if 2 * lamps > all { lit_lamps } else { lamps };
        (all > 0).then(|| f64::from(lit + counted) / f64::from(all))
    }

    /// Draws what a view sees. Of the settings size, exposure, tone and background count.
    ///
    /// Patches hide what is behind them as in solved pictures. Cost: some 20 rays a pixel, 50 where there are lamps.
    /// Deterministic: the same bits for every number of threads.
    pub fn draw(&self, view: &View, settings: &Settings) -> Image {
        let (width, height) = (settings.width, settings.height);
        let projector = Projector::new(view, width, height);
        let exposure = match settings.exposure {
            Exposure::Fixed(exposure) => exposure,
            Exposure::Automatic => self.scale(view),
        };
        let encoder = SrgbEncoder::new();
        let display = |radiosity: Option<[f64; 3]>| match radiosity {
            Some(radiosity) => settings.tone.map(exposure, radiosity.map(|b| b as f32)),
            None => settings.background,
        };
        let shade = |k: usize| {
            let pixel = DVec2::new((k as u32 % width).into(), (k as u32 / width).into());
            let mut sum = [0.0; 3];
            for radiosity in self.pixel(&projector, pixel) {
                let display = display(radiosity);
                (0..3).for_each(|c| sum[c] += display[c] / WITHIN.len() as f64);
            }
            sum.map(|s| encoder.encode(s))
        };
        let count = width as usize * height as usize;
        Image { width, height, pixels: (0..count).into_par_iter().map(shade).collect() }
    }

    /// The exposure that suits a view, [`Exposure::Fixed`], as [`Exposure::automatic`] is chosen.
    pub fn exposure(&self, view: &View) -> Exposure {
        Exposure::Fixed(self.scale(view))
    }

    /// Display value per W/m2/sr that suits a view.
    fn scale(&self, view: &View) -> f64 {
        let projector = Projector::new(view, METERED.0, METERED.1);
        let all: Vec<DVec2> = pixels(METERED).collect();
        let of_pixel = |&pixel: &DVec2| {
            let (caster, preview) = self.traced.as_ref()?;
            let seen = self.seen(caster, &projector, pixel + 0.5)?;
            let irradiance = self.irradiance((caster, preview), &seen, pixel);
            let radiosity = self.radiosity(&seen, irradiance).map(|b| b as f32);
            let now =
                self.scene.exitance_at(&self.scene.patches[seen.patch.0 as usize], self.time_s);
            Some((luminance(radiosity) / PI, now.iter().any(|&m| m > 0.0)))
        };
        let seen: Vec<Option<(f64, bool)>> = all.par_iter().map(of_pixel).collect();
        match Metered::of(seen.into_iter(), 0.0).exposure {
            Exposure::Fixed(exposure) => exposure,
            Exposure::Automatic => 1.0,
        }
    }

    /// Radiosities at the places within a pixel, W/m2; `None` where nothing is, not even a sky. What arrives is found once
    /// for each patch.
    fn pixel(&self, projector: &Projector, pixel: DVec2) -> [Option<[f64; 3]>; WITHIN.len()] {
        let mut known: [Option<(PatchId, [f64; 3])>; WITHIN.len()] = [None; WITHIN.len()];
        let mut radiosities = [None; WITHIN.len()];
        for (k, place) in WITHIN.into_iter().enumerate() {
            let seen = self.traced.as_ref().and_then(|(caster, preview)| {
                Some((self.seen(caster, projector, pixel + place)?, caster, preview))
            });
            radiosities[k] = match seen {
                Some((seen, caster, preview)) => {
                    let found = known.iter().flatten().find(|(patch, _)| *patch == seen.patch);
                    let arrives = match found {
                        Some((_, arrives)) => *arrives,
                        None => self.irradiance((caster, preview), &seen, pixel),
                    };
                    known[k] = Some((seen.patch, arrives));
                    Some(self.radiosity(&seen, arrives))
                }
                None => self.outside.as_ref().map(|outside| {
                    outside.radiance(projector.direction(pixel + place)).map(|l| PI * l)
                }),
            };
        }
        radiosities
    }

    /// What is seen at a position in pixels, past the backs of single-sided patches.
    fn seen(&self, caster: &Caster, projector: &Projector, at: DVec2) -> Option<Seen> {
        let ray = |at: DVec2| (projector.origin(at), projector.direction(at));
        let (eye, direction) = ray(at);
        let (from, towards) = (caster.place(eye), direction.as_vec3());
        let hit = caster.first_front(&self.scene, from, towards)?;
        let distance_m = f64::from(hit.distance) * caster.unit_m();
        let patch = hit.front?;
        let place_m = eye + direction * distance_m;
        let sides_m = [DVec2::X, DVec2::Y].map(|step| {
            let (eye, direction) = ray(at + step);
            eye + direction * distance_m - place_m
        });
        Some(Seen { patch, hit, at: from + towards * hit.distance, place_m, sides_m })
    }

    /// What arrives at a place that is seen, W/m2: lamps by their points, the rest by rays spread by the cosine, which end
    /// in the sky or on surfaces.
    fn irradiance(
        &self,
        (caster, preview): (&Caster, &Preview),
        seen: &Seen,
        pixel: DVec2,
    ) -> [f64; 3] {
        let patch = &self.scene.patches[seen.patch.0 as usize];
        let Some(pose) = &self.poses[patch.body.0 as usize] else { return [0.0; 3] };
        let normal = pose.direction(patch.frame.normal).as_vec3();
        // Rays from far away end a little off the surface.
        let at = seen.at + normal * (seen.hit.distance * 4.0 * f32::EPSILON);
        let grey = preview.lamp_irradiance(at, normal, caster);
        let mut sum = [grey; 3];
        let turn = (pixel.x * PLASTIC[0] + pixel.y * PLASTIC[1]).fract();
        for towards in spread(normal, turn) {
            let share = 1.0 / f64::from(RAYS);
            let add = match caster.first(&self.scene, at + normal * LIFT, towards) {
                Some(hit) => {
                    let end = at + towards * hit.distance;
                    let of = |p: PatchId| preview.reflected[preview.point_at(p, end)];
                    [hit.front.map_or(0.0, of); 3]
                }
                None => self.outside.as_ref().map_or([0.0; 3], |outside| {
                    outside.sky_radiance(towards.as_dvec3()).map(|l| PI * l)
                }),
            };
            (0..3).for_each(|c| sum[c] += share * add[c]);
        }
        if let Some((towards, beam)) = self.outside.as_ref().and_then(OutsideNow::sun_beam) {
            let cosine = f64::from(normal.dot(towards.as_vec3()));
            let from = at + normal * LIFT;
            if cosine > 0.0 && caster.is_free(from, towards.as_vec3(), f32::INFINITY) {
                (0..3).for_each(|c| sum[c] += cosine * beam[c]);
            }
        }
        sum
    }

    /// What leaves a place that is seen where this arrives, W/m2, as its image has it.
    fn radiosity(&self, seen: &Seen, arrives: [f64; 3]) -> [f64; 3] {
        let patch = &self.scene.patches[seen.patch.0 as usize];
        let material = &self.scene.materials[patch.material.0 as usize];
        let (reflectance, exitance) = match (&patch.print, &self.poses[patch.body.0 as usize]) {
            (Some(print), Some(pose)) => {
                let sides = seen.sides_m.map(|side| pose.inverse_direction(side));
                let printed = print.at(pose.inverse_point(seen.place_m), sides);
                let white = material.exitance_at(self.time_s);
                (printed.reflectance, [0, 1, 2].map(|c| white[c] * printed.emission[c]))
            }
            _ => (self.scene.reflectance(patch), self.scene.exitance_at(patch, self.time_s)),
        };
        [0, 1, 2].map(|c| exitance[c] + reflectance[c].min(1.0) * arrives[c])
    }
}

/// Lower corners of the pixels of a picture.
fn pixels((width, height): (u32, u32)) -> impl Iterator<Item = DVec2> {
    (0..width * height).map(move |k| DVec2::new((k % width).into(), (k / width).into()))
}

/// Unit directions spread by the cosine about a normal, turned by a share of a whole turn.
fn spread(normal: Vec3, turn: f64) -> impl Iterator<Item = Vec3> {
    let (u, v) = normal.any_orthonormal_pair();
    (0..RAYS).map(move |j| {
        let share = (f64::from(j) + (turn * 7.0).fract()) / f64::from(RAYS);
        let (sin, cos) = libm::sincos(TAU * (f64::from(j) * GOLDEN + turn).fract());
        let (up, out) = ((1.0 - share).sqrt() as f32, share.sqrt() as f32);
        (u * (cos as f32 * out) + v * (sin as f32 * out) + normal * up).normalize()
    })
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use relume_core::scene::SceneBuilder;
    use relume_core::scene::outside::{Outside, Sky};

    use super::super::tone::Tone;
    use super::*;

    fn floor() -> Scene {
        floor_of(0.5)
    }

    /// A floor of 2 m that reflects this much, and a lamp far below it that shines on the floor's black back.
    fn floor_of(reflectance: f64) -> Scene {
        let mut b = SceneBuilder::new("floor");
        let grey = b.material("grey", [reflectance; 3], [0.0; 3]);
        let glow = b.material("glow", [0.5; 3], [1.0; 3]);
        let n = b.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
        let square =
            |y: f64| [(-1., 1.), (1., 1.), (1., -1.), (-1., -1.)].map(|(x, z)| DVec3::new(x, y, z));
        b.polygon(n, "floor", grey, &square(0.0));
        b.polygon(n, "lamp", glow, &square(-5.0));
        b.build().unwrap()
    }

    fn settings() -> Settings {
        let (exposure, tone) = (Exposure::Fixed(1.0), Tone::Clip);
        Settings {
            width: 32,
            height: 24,
            exposure,
            tone,
            background: [0.2; 3],
            ..Settings::default()
        }
    }

    #[test]
    fn an_open_floor_has_the_radiance_of_the_sky_times_its_reflectance() {
        let sky = Some(Sky::Uniform([1.0; 3]));
        let scene = floor().with_outside(Outside { sky, ..Outside::default() }).unwrap();
        let view = View::look_at(DVec3::new(0.0, 3.0, 0.5), DVec3::ZERO, 0.3);
        let sketch = Sketch::new(&scene, 0.0);
        let encoder = SrgbEncoder::new();
        let image = sketch.draw(&view, &settings());
        let half = encoder.encode(0.5);
        assert!(
            image.pixels.iter().all(|p| p.iter().all(|c| c.abs_diff(half) <= 1)),
            "{:?}",
            image.pixel(5, 5)
        );
        assert_eq!(sketch.lit(&view), Some(1.0));
        // Past the floor's edges is the sky, below the horizon nothing.
        let level = View::look_at(DVec3::new(0.0, 1.0, 9.0), DVec3::new(0.0, 1.0, 0.0), 0.5);
        let image = sketch.draw(&level, &settings());
        assert_eq!(image.pixel(16, 2), [255; 3]);
        assert_eq!(image.pixel(0, 23), [0; 3]);
    }

    #[test]
    fn what_is_black_is_lit_where_light_arrives() {
        let view = View::look_at(DVec3::new(0.0, 3.0, 0.5), DVec3::ZERO, 0.3);
        let black = floor_of(0.0);
        assert_eq!(Sketch::new(&black, 0.0).lit(&view), Some(0.0), "it turns its back to the lamp");
        let sky = Some(Sky::Uniform([1.0; 3]));
        let scene = black.with_outside(Outside { sky, ..Outside::default() }).unwrap();
        let sketch = Sketch::new(&scene, 0.0);
        assert_eq!(sketch.lit(&view), Some(1.0));
        let lamp_only = View::look_at(DVec3::new(0.0, -2.0, 0.5), DVec3::new(0.0, -5.0, 0.0), 0.3);
        assert_eq!(sketch.lit(&lamp_only), Some(1.0), "the sky shines on the lamp");
    }

    #[test]
    fn what_a_lamp_does_not_reach_is_not_lit() {
        let sketch = Sketch::new(&floor(), 0.0);
        let floor_only = View::look_at(DVec3::new(0.0, 3.0, 0.5), DVec3::ZERO, 0.3);
        assert_eq!(sketch.lit(&floor_only), Some(0.0));
        assert_eq!(sketch.draw(&floor_only, &settings()).pixel(16, 12), [0; 3]);
        let lamp_only = View::look_at(DVec3::new(0.0, -2.0, 0.5), DVec3::new(0.0, -5.0, 0.0), 0.3);
        assert_eq!(sketch.lit(&lamp_only), Some(0.0), "a lamp alone has no shape");
        let away = View::look_at(DVec3::new(0.0, 3.0, 0.5), DVec3::new(0.0, 9.0, 0.0), 0.5);
        assert_eq!(sketch.lit(&away), None);
        let background = SrgbEncoder::new().encode(0.2);
        assert_eq!(sketch.draw(&away, &settings()).pixel(3, 3), [background; 3]);
    }
}
