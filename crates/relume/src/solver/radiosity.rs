//! The iteration B = M + rho H over the hierarchy.

use std::ops::Range;

use rayon::prelude::*;

use super::links::Links;

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

/// The solution: red, green, blue and, last, row sums.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    radiosity: Vec<[f32; 4]>,
    irradiance: Vec<[f32; 4]>,
    /// Sweeps made.
    pub sweeps: u32,
    /// Largest change of an element's radiosity in the last sweep, relative to the mean.
    pub residual: f64,
}

/// Sweeps after which a solve is given up as not converging (reflectances are below 1).
const SWEEPS_MAX: u32 = 10_000;

/// Receivers gathered by one task.
const CHUNK: usize = 256;

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
            radiosity: vec![[0.0; 4]; n],
            irradiance: vec![[0.0; 4]; n],
            ..Radiosity::default()
        };
        for id in 0..n as u32 {
            if let Some(lit) = surfaces.lit(id) {
                let [r, g, b] = start.map_or(lit.exitance, |s| s(id));
                out.radiosity[id as usize] = [r, g, b, f32::from(u8::from(lit.counts))];
            }
        }
        loop {
            out.gather(links);
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

    fn gather(&mut self, links: &Links) {
        let radiosity = &self.radiosity;
        self.irradiance.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (k, h) in out.iter_mut().enumerate() {
                let mut sum = [0.0_f32; 4];
                for &(source, coupling) in links.of((chunk * CHUNK + k) as u32) {
                    let b = &radiosity[source as usize];
                    for c in 0..4 {
                        sum[c] += coupling * b[c];
                    }
                }
                *h = sum;
            }
        });
    }

    fn push(&mut self, surfaces: &impl Surfaces) {
        for id in 0..surfaces.len() as u32 {
            if let Some(parent) = surfaces.parent(id) {
                let from = self.irradiance[parent as usize];
                let to = &mut self.irradiance[id as usize];
                for c in 0..4 {
                    to[c] += from[c];
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
            let h = self.irradiance[id as usize];
            let b = &mut self.radiosity[id as usize];
            let mut sum = 0.0;
            for c in 0..3 {
                let new = lit.exitance[c] + lit.reflectance[c] * h[c];
                change = change.max((new - b[c]).abs());
                b[c] = new;
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
            if children.is_empty() || surfaces.lit(id).is_none() {
                continue;
            }
            let (mut sum, mut area) = ([0.0_f64; 3], 0.0_f64);
            for child in children {
                let share = surfaces.area_m2(child);
                area += share;
                for (c, total) in sum.iter_mut().enumerate() {
                    *total += share * f64::from(self.radiosity[child as usize][c]);
                }
            }
            let b = &mut self.radiosity[id as usize];
            for c in 0..3 {
                b[c] = (sum[c] / area) as f32;
            }
        }
    }

    /// Radiosity of an element, W/m2.
    #[inline]
    pub fn radiosity(&self, id: u32) -> [f32; 3] {
        let [r, g, b, _] = self.radiosity[id as usize];
        [r, g, b]
    }

    /// Irradiance of an element with that of all its ancestors, W/m2: the whole for a leaf.
    #[inline]
    pub fn irradiance(&self, id: u32) -> [f32; 3] {
        let [r, g, b, _] = self.irradiance[id as usize];
        [r, g, b]
    }

    /// Sum of the form factors from an element over its and its ancestors' links.
    #[inline]
    pub fn row_sum(&self, id: u32) -> f32 {
        self.irradiance[id as usize][3]
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        ((self.radiosity.capacity() + self.irradiance.capacity()) * 16) as u64
    }
}

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
            builder.fill(|add| self.0.iter().for_each(|l| add(l.0, l.1, l.2)))
        }
    }
}
