//! How much of what is lit a view shows.
//!
//! `score = seen + 0.3 pixels + 0.2 variety + 0.1 lamps - close`
//!
//! `seen` is the share of the scene's lit surface that the picture shows; `pixels` the mean over the
//! pixels: 1 where something lit is seen, -1/2 where something black is, 0 for nothing, -1 for what is seen
//! through the back of a single-sided polygon; `variety` the share of the scene's surfaces that are seen; `lamps`
//! the seen share of the emitting area, and `close` the share of pixels with something right in front of
//! the camera. Must not know which views there are.

use glam::{DVec3, Vec3};
use relume_core::geometry::Pose;
use relume_core::scene::outside::Outside;
use relume_core::scene::{BodyId, PatchId, Projection, Scene};

use super::super::camera::View;
use super::super::tuning::{BLACK, CLOSE, LIT, PIXELS, SURFACES};
use super::bounds::{ASPECT, Bounds};
use super::caster::{Caster, Hit};
use super::preview::Preview;

/// Pixels across and down of pictures that are scored.
#[derive(Clone, Copy)]
pub(super) struct Size(u32, u32);

impl Size {
    pub(super) const ROUGH: Size = Size(32, 24);
    pub(super) const FINE: Size = Size(96, 72);
}

/// The scene at one instant, with its light.
pub(super) struct Stage<'a> {
    scene: &'a Scene,
    caster: Caster,
    preview: Preview,
    /// Whether each point is where the view is to be.
    is_near: Vec<bool>,
    /// Sums over all points: of area weighed by light, and of area that emits, m2.
    whole_m2: [f64; 2],
}

/// What a pixel shows.
enum Pixel {
    /// Nothing.
    Open,
    /// A point of the preview, with what the ray met and the area that the pixel shows of it, m2.
    Front { point: usize, hit: Hit, area_m2: f64 },
    /// The same, behind the back of a single-sided polygon.
    Through { point: usize, hit: Hit, area_m2: f64 },
    /// The back of a single-sided polygon with nothing behind.
    Back,
}

impl<'a> Stage<'a> {
    /// Of a scene without what stands for light from outside, and that light.
    pub(super) fn new(
        (scene, outside): (&'a Scene, Option<&Outside>),
        time_s: f64,
        bounds: &Bounds,
    ) -> Stage<'a> {
        let bodies = (0..scene.bodies.len() as u32).map(BodyId);
        let poses: Vec<Option<Pose>> = bodies.map(|body| scene.pose(body, time_s)).collect();
        let caster = Caster::new(scene, &poses, bounds.unit());
        let sky = outside.and_then(|outside| outside.at(time_s).ok());
        let preview = Preview::new((scene, sky.as_ref()), time_s, &poses, &caster);
        let is_near =
            (0..preview.len()).map(|k| bounds.is_near(caster.world(preview.at(k)))).collect();
        let mut stage = Stage { scene, caster, preview, is_near, whole_m2: [0.0; 2] };
        stage.whole_m2 = stage.sums(|point| stage.preview.area_m2(point));
        stage
    }

    /// Areas of points weighed by light, and of those that emit.
    fn sums(&self, area_m2: impl Fn(usize) -> f64) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for point in (0..self.preview.len()).filter(|&point| self.is_near[point]) {
            let area = area_m2(point);
            sums[0] += area * (self.preview.brightness[point] + BLACK);
            sums[1] += if self.preview.emits(point) { area } else { 0.0 };
        }
        sums
    }

    /// How good a view is: of some 0 for nothing to some 1.5.
    pub(super) fn score(&self, view: &View, size: Size) -> f64 {
        let mut seen_m2 = vec![0.0; self.preview.len()];
        let mut pixels_of = vec![0_u32; self.scene.surfaces.len()];
        let (mut sum, mut close, mut count) = (0.0, 0.0, 0.0);
        self.look(view, size, |pixel| {
            count += 1.0;
            sum += match &pixel {
                Pixel::Open => 0.0,
                Pixel::Front { point, .. } => 1.5 * self.preview.brightness[*point] - 0.5,
                Pixel::Through { .. } | Pixel::Back => -1.0,
            };
            if let Pixel::Front { point, hit, area_m2 } | Pixel::Through { point, hit, area_m2 } =
                pixel
            {
                seen_m2[point] += area_m2;
                close += if hit.distance < CLOSE { 1.0 } else { 0.0 };
                if let Some(patch) = hit.front {
                    pixels_of[self.scene.patches[patch.0 as usize].surface.0 as usize] += 1;
                }
            }
        });
        let part_m2 = self.sums(|point| seen_m2[point].min(self.preview.area_m2(point)));
        let share =
            |k: usize| if self.whole_m2[k] > 0.0 { part_m2[k] / self.whole_m2[k] } else { 0.0 };
        let surfaces = pixels_of.iter().filter(|&&n| n >= PIXELS).count().min(SURFACES);
        let variety = surfaces as f64 / self.scene.surfaces.len().clamp(1, SURFACES) as f64;
        share(0) + 0.3 * sum / count + 0.2 * variety + 0.1 * share(1) - close / count
    }

    /// Share of what emits, lights aside, that is seen from some of these views.
    pub(super) fn lamps_seen<'v>(&self, views: impl Iterator<Item = &'v View>) -> f64 {
        let lamps: Vec<usize> =
            (0..self.preview.len()).filter(|&p| self.preview.emits(p)).collect();
        if lamps.is_empty() {
            return 0.0;
        }
        let mut seen_m2 = vec![0.0_f64; self.preview.len()];
        for view in views {
            let mut now_m2 = vec![0.0; self.preview.len()];
            self.look(view, Size::FINE, |pixel| {
                if let Pixel::Front { point, area_m2, .. } = pixel {
                    now_m2[point] += area_m2;
                }
            });
            lamps.iter().for_each(|&p| seen_m2[p] = seen_m2[p].max(now_m2[p]));
        }
        let part_m2 = self.sums(|point| seen_m2[point].min(self.preview.area_m2(point)))[1];
        if self.whole_m2[1] > 0.0 { part_m2 / self.whole_m2[1] } else { 0.0 }
    }

    /// Share of the picture that shows the reverse of what is double-sided.
    pub(super) fn reverse_share(&self, view: &View) -> f64 {
        let (mut reverse, mut count) = (0.0, 0.0);
        // Of two sides the first is the front.
        let is_reverse = |patch: PatchId| {
            self.scene.patches[patch.0 as usize].twin.is_some_and(|twin| twin < patch)
        };
        self.look(view, Size::ROUGH, |pixel| {
            count += 1.0;
            if let Pixel::Front { hit, .. } = pixel {
                reverse += if hit.front.is_some_and(is_reverse) { 1.0 } else { 0.0 };
            }
        });
        reverse / count
    }

    /// Share of the picture that shows something lit; `None` where nothing is.
    pub(super) fn lit_share(&self, view: &View) -> Option<f64> {
        let (mut lit, mut count) = (0.0, 0.0);
        self.look(view, Size::FINE, |pixel| {
            count += 1.0;
            if let Pixel::Front { point, .. } | Pixel::Through { point, .. } = pixel {
                lit += if self.preview.brightness[point] > LIT { 1.0 } else { 0.0 };
            }
        });
        self.preview.is_lit.then_some(lit / count)
    }

    /// Share of directions from a place (world, metres) in which a front is met first, and how far apart
    /// what is met lies, in units of the scene.
    pub(super) fn look_around(&self, place: DVec3) -> (f64, f32) {
        let from = self.caster.place(place);
        let directions =
            || sphere().map(|towards| (towards, self.caster.first(self.scene, from, towards)));
        let fronts = directions().filter_map(|(towards, hit)| {
            let hit = hit?;
            hit.front.map(|_| from + towards * hit.distance)
        });
        let (mut low, mut high, mut count) = (from, from, 0.0);
        for at in fronts {
            (low, high, count) = (low.min(at), high.max(at), count + 1.0);
        }
        (count / sphere().count() as f64, low.distance(high))
    }

    fn look(&self, view: &View, Size(width, height): Size, mut see: impl FnMut(Pixel)) {
        let Projection::Perspective { yfov, .. } = view.projection else { return };
        let slope = libm::tan(yfov / 2.0);
        let pose = &view.world_from_camera;
        let from = self.caster.place(pose.translation);
        // Solid angle of a pixel in the middle of the picture.
        let pixel_sr = 4.0 * slope * slope * ASPECT / f64::from(width * height);
        for y in 0..height {
            for x in 0..width {
                let across = 2.0 * (f64::from(x) + 0.5) / f64::from(width) - 1.0;
                let up = 1.0 - 2.0 * (f64::from(y) + 0.5) / f64::from(height);
                let local = DVec3::new(across * slope * ASPECT, up * slope, -1.0);
                let depth = 1.0 / local.length();
                let towards = pose.direction(local * depth).as_vec3();
                see(self.pixel(from, towards, pixel_sr * depth * depth * depth));
            }
        }
    }

    fn pixel(&self, from: Vec3, towards: Vec3, solid_angle_sr: f64) -> Pixel {
        let Some(first) = self.caster.first(self.scene, from, towards) else { return Pixel::Open };
        let through = first.front.is_none();
        let behind =
            if through { self.caster.first_front(self.scene, from, towards) } else { None };
        let hit = if through { behind } else { Some(first) };
        let Some((hit, patch)) = hit.and_then(|hit| Some((hit, hit.front?))) else {
            return Pixel::Back;
        };
        let point = self.preview.point_at(patch, from + towards * hit.distance);
        let distance_m = f64::from(hit.distance) * self.caster.unit_m();
        let area_m2 = solid_angle_sr * distance_m * distance_m / f64::from(hit.cosine).max(1e-3);
        if through {
            Pixel::Through { point, hit, area_m2 }
        } else {
            Pixel::Front { point, hit, area_m2 }
        }
    }
}

/// Directions spread evenly over the sphere (a spiral).
fn sphere() -> impl Iterator<Item = Vec3> {
    const COUNT: u32 = 192;
    (0..COUNT).map(|k| {
        let y = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(COUNT);
        let (sin, cos) = libm::sincos(f64::from(k) * 2.399_963_229_728_653);
        let out = (1.0 - y * y).sqrt();
        DVec3::new(out * cos, y, out * sin).as_vec3()
    })
}
