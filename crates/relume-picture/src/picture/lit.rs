//! Light at points of leaves as `smooth` pictures show it: one continuous function over every surface, exact for lamps where the
//! snapshot knows what comes beside them.
//!
//! Must not know the view or how pixels are made.

use glam::DVec2;
use relume_core::scene::PatchId;
use relume_core::session::{Gathered, Leaf, Snapshot};

use super::direct::Direct;
use super::field::Field;
use super::smooth::Smooth;
use super::weights::weights;

/// Light over the leaves of a snapshot.
pub(super) struct Lit<'a> {
    snapshot: &'a Snapshot,
    field: Field,
    direct: Option<Direct>,
    smooth: Smooth,
}

/// Irradiance at a point, W/m2.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Arriving {
    pub(super) irradiance: [f64; 3],
    /// The part of it that comes straight from lamps; 0 where that is not told apart.
    pub(super) direct: [f64; 3],
}

impl<'a> Lit<'a> {
    /// Direct light is found anew where the snapshot knows the rest ([`Snapshot::indirect`]).
    pub(super) fn new(snapshot: &'a Snapshot) -> Lit<'a> {
        let all = |leaf: &Leaf| Gathered {
            irradiance: leaf.irradiance,
            gradient: leaf.irradiance_gradient,
        };
        let (field, direct) = match snapshot.indirect.is_empty() {
            true => {
                let lines: Vec<Gathered> = snapshot.leaves.iter().map(all).collect();
                (Field::new(snapshot, &lines), None)
            }
            false => (Field::new(snapshot, &snapshot.indirect), Some(Direct::new(snapshot))),
        };
        let mut lit = Lit { snapshot, field, direct, smooth: Smooth::default() };
        let of_corner =
            |patch: PatchId, leaf: usize, at: DVec2| lit.flat(patch, leaf, at).irradiance;
        let is_one = |patch: PatchId, other: PatchId| lit.field.is_one(patch, other);
        lit.smooth = Smooth::lacking(snapshot, &of_corner, &is_one);
        lit
    }

    /// What arrives at a point of a patch's frame, in or right beside one of its leaves.
    pub(super) fn at(&self, patch: PatchId, leaf: usize, p: DVec2) -> Arriving {
        let mut out = self.flat(patch, leaf, p);
        if let Some(lacks) = self.smooth.of(patch) {
            let corners = &self.snapshot.scene.patches[patch.0 as usize].corners;
            for (weight, lack) in weights(corners, p).iter().zip(lacks) {
                (0..3).for_each(|c| out.irradiance[c] += weight * lack[c]);
            }
            out.irradiance = out.irradiance.map(|h| h.max(0.0));
        }
        out
    }

    /// Whether something stands between a lamp and a leaf that was asked about.
    pub(super) fn is_shaded(&self, leaf: usize) -> bool {
        self.direct.as_ref().is_some_and(|direct| direct.is_shaded(leaf))
    }

    /// The same of the flat polygon, whatever it stands for.
    fn flat(&self, patch: PatchId, leaf: usize, p: DVec2) -> Arriving {
        let mut out = Arriving { irradiance: self.field.at(patch, leaf, p), ..Arriving::default() };
        if let Some(direct) = &self.direct {
            out.direct = direct.at(self.snapshot, patch, leaf, p);
            (0..3).for_each(|c| out.irradiance[c] += out.direct[c]);
        }
        out
    }
}
