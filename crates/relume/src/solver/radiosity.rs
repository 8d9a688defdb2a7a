//! The iteration B = M + rho H over the hierarchy.

use std::ops::Range;

use rayon::prelude::*;

use super::links::{Link, Links};

/// Reflectance and exitance of one material (or intensity of one light), linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lit {
    /// Reflectance rho.
    pub reflectance: [f32; 3],
    /// Exitance M, W/m2; for a punctual light its intensity.
    pub exitance: [f32; 3],
    /// Whether it takes part in row sums: surfaces do, punctual lights do not.
    pub counts: bool,
}

/// Where an element lies in its patch's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Centroid, metres.
    pub centroid: [f32; 2],
    /// Largest distance of a corner from the centroid, metres.
    pub radius: f32,
    /// Mean of (x x, x y, y y) about the centroid, m2.
    pub moment: [f32; 3],
}

/// The hierarchy as the solver sees it: parents come before children.
pub trait Surfaces: Sync {
    /// Elements.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Parent of an element within its quadtree.
    fn parent(&self, id: u32) -> Option<u32>;
    /// Children of an element within its quadtree.
    fn children(&self, id: u32) -> Range<u32>;
    /// Area, m2.
    fn area_m2(&self, id: u32) -> f64;
    /// Where it lies.
    fn place(&self, id: u32) -> Place;
    /// What it is made of; `None` for nodes that carry no radiosity (clusters).
    fn lit(&self, id: u32) -> Option<&Lit>;
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// After exactly this many sweeps.
    Sweeps(u32),
    /// When no element's radiosity changes by more than this, relative to the mean radiosity.
    Residual(f64),
}

/// A quantity that varies linearly over an element: red, green, blue and, last, what row sums
/// count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linear {
    /// Mean over the element.
    pub mean: [f32; 4],
    /// Gradient in the patch's frame, per metre (of radiosities in a solve: per radius).
    pub gradient: [[f32; 4]; 2],
}

/// The solution.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// Gradients are per radius of the element.
    radiosity: Vec<Linear>,
    /// Gradients are per metre.
    irradiance: Vec<Linear>,
    /// Sweeps made.
    pub sweeps: u32,
    /// Largest change of an element's radiosity in the last sweep, relative to the mean.
    pub residual: f64,
}

/// Sweeps after which a solve is given up as not converging (reflectances are below 1).
const SWEEPS_MAX: u32 = 10_000;

/// Receivers gathered by one task.
const CHUNK: usize = 256;

impl Linear {
    /// Value at an offset from the centroid (in the unit of the gradient), unclamped.
    #[inline]
    pub fn at(&self, x: f32, y: f32) -> [f32; 4] {
        let mut out = self.mean;
        for (c, value) in out.iter_mut().enumerate() {
            *value += self.gradient[0][c] * x + self.gradient[1][c] * y;
        }
        out
    }
}

impl Radiosity {
    /// Solves from `start`: the radiosity of each element to begin with, or exitance if `None`.
    pub fn solve(
        surfaces: &impl Surfaces,
        links: &Links,
        start: Option<&dyn Fn(u32) -> [f32; 3]>,
        stop: Stop,
    ) -> Radiosity {
        let n = surfaces.len();
        let mut out = Radiosity {
            radiosity: vec![Linear::default(); n],
            irradiance: vec![Linear::default(); n],
            ..Radiosity::default()
        };
        for id in 0..n as u32 {
            if let Some(lit) = surfaces.lit(id) {
                let [r, g, b] = start.map_or(lit.exitance, |s| s(id));
                out.radiosity[id as usize].mean = [r, g, b, f32::from(u8::from(lit.counts))];
            }
        }
        loop {
            out.gather(surfaces, links);
            out.push(surfaces);
            out.residual = out.reflect(surfaces);
            out.pull(surfaces);
            out.sweeps += 1;
            let done = match stop {
                Stop::Sweeps(count) => out.sweeps >= count,
                Stop::Residual(limit) => out.residual <= limit,
            };
            if done || out.sweeps >= SWEEPS_MAX {
                return out;
            }
        }
    }

    fn gather(&mut self, surfaces: &impl Surfaces, links: &Links) {
        let radiosity = &self.radiosity;
        self.irradiance.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (k, h) in out.iter_mut().enumerate() {
                let id = (chunk * CHUNK + k) as u32;
                let list = links.of(id);
                *h = Linear::default();
                if !list.is_empty() {
                    *h = gather_one(radiosity, list, 1.0 / surfaces.place(id).radius);
                }
            }
        });
    }

    fn push(&mut self, surfaces: &impl Surfaces) {
        for id in 0..surfaces.len() as u32 {
            if let Some(parent) = surfaces.parent(id) {
                let (p, q) = (surfaces.place(parent).centroid, surfaces.place(id).centroid);
                let from = self.irradiance[parent as usize];
                let mean = from.at(q[0] - p[0], q[1] - p[1]);
                let to = &mut self.irradiance[id as usize];
                for c in 0..4 {
                    to.mean[c] += mean[c];
                    to.gradient[0][c] += from.gradient[0][c];
                    to.gradient[1][c] += from.gradient[1][c];
                }
            }
        }
    }

    fn reflect(&mut self, surfaces: &impl Surfaces) -> f64 {
        let (mut change, mut flux, mut area) = (0.0_f32, 0.0_f64, 0.0_f64);
        for id in 0..surfaces.len() as u32 {
            let Some(lit) = surfaces.lit(id) else { continue };
            if !surfaces.children(id).is_empty() || !lit.counts {
                continue;
            }
            let h = &self.irradiance[id as usize];
            let b = &mut self.radiosity[id as usize];
            let radius = surfaces.place(id).radius;
            let mut sum = 0.0;
            for c in 0..3 {
                let rho = lit.reflectance[c];
                // A gradient pushed down a long way may reach below zero; light does not.
                let new = lit.exitance[c] + rho * h.mean[c].max(0.0);
                change = change.max((new - b.mean[c]).abs());
                b.mean[c] = new;
                for axis in 0..2 {
                    b.gradient[axis][c] = rho * h.gradient[axis][c] * radius;
                }
                sum += f64::from(new);
            }
            flux += surfaces.area_m2(id) * sum / 3.0;
            area += surfaces.area_m2(id);
        }
        if flux > 0.0 { f64::from(change) * area / flux } else { 0.0 }
    }

    fn pull(&mut self, surfaces: &impl Surfaces) {
        for id in (0..surfaces.len() as u32).rev() {
            let children = surfaces.children(id);
            if !children.is_empty() && surfaces.lit(id).is_some() {
                self.radiosity[id as usize] = self.pulled(surfaces, id, children);
            }
        }
    }

    /// The linear function over an element that fits those over its children best.
    fn pulled(&self, surfaces: &impl Surfaces, id: u32, children: Range<u32>) -> Linear {
        let own = surfaces.place(id);
        let area: f64 = children.clone().map(|c| surfaces.area_m2(c)).sum();
        let mut out = Linear { mean: self.radiosity[id as usize].mean, ..Linear::default() };
        let mut mean = [0.0_f64; 3];
        let mut first = [[0.0_f64; 3]; 2];
        let mut moment = [0.0_f64; 3];
        for child in children {
            let share = surfaces.area_m2(child) / area;
            let place = surfaces.place(child);
            let b = &self.radiosity[child as usize];
            let dx = f64::from(place.centroid[0] - own.centroid[0]);
            let dy = f64::from(place.centroid[1] - own.centroid[1]);
            let [xx, xy, yy] = place.moment.map(f64::from);
            moment[0] += share * (dx * dx + xx);
            moment[1] += share * (dx * dy + xy);
            moment[2] += share * (dy * dy + yy);
            for c in 0..3 {
                let value = f64::from(b.mean[c]);
                let gx = f64::from(b.gradient[0][c] / place.radius);
                let gy = f64::from(b.gradient[1][c] / place.radius);
                mean[c] += share * value;
                first[0][c] += share * (dx * value + xx * gx + xy * gy);
                first[1][c] += share * (dy * value + xy * gx + yy * gy);
            }
        }
        let [xx, xy, yy] = moment;
        let scale = f64::from(own.radius) / (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        for c in 0..3 {
            out.mean[c] = mean[c] as f32;
            out.gradient[0][c] = ((first[0][c] * yy - first[1][c] * xy) * scale) as f32;
            out.gradient[1][c] = ((first[1][c] * xx - first[0][c] * xy) * scale) as f32;
        }
        out
    }

    /// Radiosity of an element: mean, and gradient per radius, W/m2.
    #[inline]
    pub fn linear_radiosity(&self, id: u32) -> &Linear {
        &self.radiosity[id as usize]
    }

    /// Irradiance of an element with that of all its ancestors: mean, and gradient per metre.
    #[inline]
    pub fn linear_irradiance(&self, id: u32) -> &Linear {
        &self.irradiance[id as usize]
    }

    /// Radiosity of an element, W/m2.
    #[inline]
    pub fn radiosity(&self, id: u32) -> [f32; 3] {
        let [r, g, b, _] = self.radiosity[id as usize].mean;
        [r, g, b]
    }

    /// Irradiance of an element with that of all its ancestors, W/m2: the whole for a leaf.
    #[inline]
    pub fn irradiance(&self, id: u32) -> [f32; 3] {
        let [r, g, b, _] = self.irradiance[id as usize].mean;
        [r.max(0.0), g.max(0.0), b.max(0.0)]
    }

    /// Sum of the form factors from an element over its and its ancestors' links.
    #[inline]
    pub fn row_sum(&self, id: u32) -> f32 {
        self.irradiance[id as usize].mean[3]
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        ((self.radiosity.capacity() + self.irradiance.capacity()) * size_of::<Linear>()) as u64
    }
}

/// Everything one receiver gathers; in the order of its links.
#[inline]
fn gather_one(radiosity: &[Linear], list: &[Link], per_radius: f32) -> Linear {
    let mut out = Linear::default();
    let [mut gx, mut gy] = [[0.0_f32; 4]; 2];
    for link in list {
        let b = &radiosity[link.source as usize];
        let [su, sv] = link.over_source.map(|g| f32::from(g) * (1.0 / Link::STEPS));
        let [ru, rv] = link.over_receiver.map(f32::from);
        let moment = SOURCE_MOMENT * link.coupling;
        for c in 0..4 {
            let mean = link.coupling * b.mean[c];
            let sent = mean + moment * (su * b.gradient[0][c] + sv * b.gradient[1][c]);
            out.mean[c] += sent;
            gx[c] += ru * mean;
            gy[c] += rv * mean;
        }
    }
    let scale = per_radius / Link::STEPS;
    out.gradient = [gx.map(|g| g * scale), gy.map(|g| g * scale)];
    out
}

/// Mean of x^2 / radius^2 over an element, for the product of two gradients: 1/6 for a square.
const SOURCE_MOMENT: f32 = 1.0 / 6.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// Two plates, the second split in two, with given couplings.
    struct Plates(Lit);

    impl Surfaces for Plates {
        fn len(&self) -> usize {
            4
        }
        fn parent(&self, id: u32) -> Option<u32> {
            (id >= 2).then_some(1)
        }
        fn children(&self, id: u32) -> Range<u32> {
            if id == 1 { 2..4 } else { 0..0 }
        }
        fn area_m2(&self, id: u32) -> f64 {
            if id >= 2 { 0.5 } else { 1.0 }
        }
        fn place(&self, id: u32) -> Place {
            let x = [0.0, 0.0, -0.25, 0.25][id as usize];
            Place { centroid: [x, 0.0], radius: 0.5, moment: [0.05, 0.0, 0.05] }
        }
        fn lit(&self, _: u32) -> Option<&Lit> {
            Some(&self.0)
        }
    }

    #[test]
    fn a_furnace_reaches_m_over_one_minus_rho_through_every_level() {
        let lit = Lit { reflectance: [0.5, 0.8, 0.0], exitance: [1.0, 2.0, 3.0], counts: true };
        // Plate 0 sees half of itself through plate 1 whole and half through the two parts.
        let links =
            [(0, 1, 0.5), (0, 2, 0.25), (0, 3, 0.25), (1, 0, 0.5), (2, 0, 0.5), (3, 0, 0.5)];
        let mut builder = LinksBuilderHelper::default();
        builder.0.extend(links);
        let solved = Radiosity::solve(&Plates(lit), &builder.build(), None, Stop::Residual(1e-6));
        for id in 0..4 {
            for c in 0..3 {
                let exact = lit.exitance[c] / (1.0 - lit.reflectance[c]);
                assert!((solved.radiosity(id)[c] - exact).abs() < 1e-4 * exact);
            }
        }
        assert!((solved.row_sum(2) - 1.0).abs() < 1e-6);
    }

    #[derive(Default)]
    struct LinksBuilderHelper(Vec<(u32, u32, f32)>);

    impl LinksBuilderHelper {
        fn build(&self) -> Links {
            let mut builder = super::super::LinksBuilder::new(4);
            self.0.iter().for_each(|l| builder.count(l.0));
            let link = |l: &(u32, u32, f32)| Link { source: l.1, coupling: l.2, ..Link::default() };
            builder.fill(|add| self.0.iter().for_each(|l| add(l.0, link(l))))
        }
    }
}
