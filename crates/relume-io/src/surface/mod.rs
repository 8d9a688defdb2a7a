//! Reflectance and emission of surfaces of files: images and vertex colours on triangles, as means over polygons for the solver and
//! as texture coordinates for pictures.
//!
//! Must not know formats of scenes, or materials.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::tuning::{MEAN_STEPS, MEAN_STEPS_SHARED};
use relume_core::scene::{Tint, TintId};

mod chart;
pub(crate) mod facet;
pub(crate) mod image_file;
mod parts;
pub(crate) mod pieces;

/// Triangles, counter-clockwise from the front, by indices into their corners.
pub(crate) struct Mesh<'a> {
    pub(crate) points: &'a [DVec3],
    pub(crate) triangles: &'a [[u32; 3]],
}

/// The steps across each of so many triangles.
pub(crate) fn resolution(triangles: usize) -> f64 {
    (MEAN_STEPS_SHARED / triangles.max(1) as f64).clamp(MEAN_STEPS.0, MEAN_STEPS.1)
}

/// Tints of polygons, each once.
#[derive(Default)]
pub(crate) struct Tints {
    all: Vec<Tint>,
    numbers: BTreeMap<[u64; 6], TintId>,
}

impl Tints {
    /// The tint of these values, the same number for the same ones.
    pub(crate) fn number(&mut self, tint: Tint) -> TintId {
        let Tint { reflectance, emission } = tint;
        let bits = |k: usize| if k < 3 { reflectance[k] } else { emission[k - 3] }.to_bits();
        let key = [0, 1, 2, 3, 4, 5].map(bits);
        let next = TintId(self.all.len() as u32);
        let id = *self.numbers.entry(key).or_insert(next);
        if id == next {
            self.all.push(tint);
        }
        id
    }

    pub(crate) fn finish(self) -> Vec<Tint> {
        self.all
    }
}
