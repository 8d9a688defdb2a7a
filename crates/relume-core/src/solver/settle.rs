//! One facet: irradiance pushed down, reflected at the leaves, radiosity pulled up.
//!
//! Small changes of irradiance are not pushed down to every leaf each time: they are *deferred*, and delivered once the deferred
//! error of a subtree may exceed the limit, or another change leads there. Changes of the present sweep are known as linear
//! functions of place, so that gains and losses of different levels cancel, and a change waits wherever it is small.

use super::dirty_path::{DirtyPath, bit};
use super::field::{Field, Linear};
use super::level::Level;
use super::place::Place;
use super::surfaces::{FacetMaterial, Surfaces};

/// Result of pushing and pulling through one facet.
#[derive(Default)]
pub(super) struct Settled {
    /// Elements with their new radiosities, and by how much those differ.
    pub(super) changed: Vec<(u32, Linear, f32)>,
    /// Largest difference within the limit.
    pub(super) small: f32,
    /// Deferred error of elements, W/m2; empty where everything was settled.
    pub(super) deferred: Vec<(u32, f32)>,
}

/// Change of the irradiance that an element inherits.
#[derive(Clone, Copy, Default)]
pub(super) struct IrradianceChange {
    /// Change in this sweep, W/m2 and per metre.
    change: Linear,
    /// Bound of the change of radiosity by changes deferred before, W/m2.
    deferred: f32,
}

impl IrradianceChange {
    fn about(&self, own: &Place, other: &Place) -> IrradianceChange {
        IrradianceChange { change: self.change.about(own, other), ..*self }
    }
}

/// One facet being settled.
pub(super) struct Below<'a, S> {
    pub(super) radiosity: &'a Field,
    pub(super) gathered: &'a Field,
    /// Deferred error: bound of the error of radiosities at and below each element by irradiance not pushed down yet, W/m2.
    pub(super) deferred: &'a [f32],
    /// Factor of what each leaf receives and sends; empty where all are 1.
    pub(super) factors: &'a [f32],
    /// Level of each leaf; empty where there are none.
    pub(super) levels: &'a [Level],
    /// Whether levels count for what is sent as for what is received.
    pub(super) is_symmetric: bool,
    pub(super) surfaces: &'a S,
    pub(super) material: &'a FacetMaterial,
    pub(super) limit: f32,
    /// Paths to the changed elements; `None` where everything is settled, small changes too.
    pub(super) path: Option<&'a DirtyPath>,
}

impl<S: Surfaces> Below<'_, S> {
    /// Pushes irradiance down and pulls radiosity up; returns the new radiosity of `id`, and the deferred error at and below
    /// it. `change` is the change of the inherited irradiance.
    pub(super) fn settle(
        &self,
        id: u32,
        place: &Place,
        inherited: &Linear,
        change: &IrradianceChange,
        out: &mut Settled,
    ) -> (Linear, f32) {
        let h = self.gathered.get(id).plus(inherited);
        let children = self.surfaces.children(id);
        let mut deferred = 0.0_f32;
        let b = if children.is_empty() {
            match (self.factors.get(id as usize), self.levels.get(id as usize)) {
                (Some(&factor), _) => self.reflect(&h.times(factor), place).times(factor),
                (None, Some(level)) => self.reflect(&self.levelled(level, &h, place), place),
                (None, None) => self.reflect(&h, place),
            }
        } else {
            let change = match self.path {
                Some(path) => self.add_own(change, path, id),
                None => IrradianceChange::default(),
            };
            let mut fit = Fit::default();
            let moment = self.surfaces.source_moment();
            for child in children {
                let at = self.surfaces.place(child);
                let change = change.about(place, &at);
                let (b, below) =
                    match self.path.and_then(|path| self.may_wait(path, child, &at, &change)) {
                        Some(deferred) => {
                            if deferred > self.deferred[child as usize] {
                                out.deferred.push((child, deferred));
                            }
                            (self.radiosity.get(child), deferred)
                        }
                        None => self.settle(child, &at, &h.about(place, &at), &change, out),
                    };
                deferred = deferred.max(below);
                fit.add(self.surfaces.area_m2(child), (place, &at), moment, &b);
            }
            fit.linear(place, moment)
        };
        let before = self.radiosity.get(id);
        let difference = b.change_from(&before);
        if difference > self.limit || self.path.is_none() {
            out.changed.push((id, b, difference));
        }
        if difference <= self.limit {
            out.small = out.small.max(b.difference(&before));
        }
        if self.path.is_some() {
            out.deferred.push((id, deferred));
        }
        (b, deferred)
    }

    /// Deferred error of an element with the inherited change, if the change can wait.
    fn may_wait(
        &self,
        path: &DirtyPath,
        id: u32,
        place: &Place,
        change: &IrradianceChange,
    ) -> Option<f32> {
        let deferred = self.deferred[id as usize]
            + change.deferred
            + self.material.most(&change.change, place.radius);
        (!bit(&path.on, id) && deferred <= self.limit).then_some(deferred)
    }

    /// Inherited change with the change of an element itself.
    fn add_own(&self, above: &IrradianceChange, path: &DirtyPath, id: u32) -> IrradianceChange {
        let deferred = above.deferred + self.deferred_from(id);
        match path.changes(id) {
            Some(Some(own)) => IrradianceChange { change: above.change.plus(own), deferred },
            // Children came or went: everything below is affected.
            Some(None) => IrradianceChange { deferred: f32::INFINITY, ..*above },
            None => IrradianceChange { deferred, ..*above },
        }
    }

    /// Part of the deferred error that no child has inherited yet, W/m2.
    fn deferred_from(&self, id: u32) -> f32 {
        let below = self.surfaces.children(id).map(|child| self.deferred[child as usize]);
        (self.deferred[id as usize] - below.fold(0.0, f32::max)).max(0.0)
    }

    /// Irradiance of which a leaf sends what it reflects.
    fn levelled(&self, level: &Level, h: &Linear, place: &Place) -> Linear {
        if !self.is_symmetric {
            return level.evened(h);
        }
        let moment = self.surfaces.source_moment();
        let mut received = level.received(h, place, moment);
        received.mean = received.mean.map(|mean| mean.max(0.0));
        level.weighed(&received, place, moment)
    }

    /// Radiosity of a leaf, with first moments, from its irradiance, with a gradient per metre.
    fn reflect(&self, h: &Linear, place: &Place) -> Linear {
        reflected(h, self.material, place, self.surfaces.source_moment())
    }
}

/// Radiosity, with first moments, from irradiance, with a gradient per metre.
pub(super) fn reflected(
    h: &Linear,
    material: &FacetMaterial,
    place: &Place,
    moment: f32,
) -> Linear {
    let mut b = Linear::default();
    for c in 0..3 {
        let rho = material.reflectance[c];
        // A gradient pushed down a long way may reach below zero; light does not.
        b.mean[c] = material.exitance[c] + rho * h.mean[c].max(0.0);
        let slope = [0, 1].map(|axis| rho * h.gradient[axis][c] * place.radius);
        let moments = place.first_moments(slope, moment);
        (b.gradient[0][c], b.gradient[1][c]) = (moments[0], moments[1]);
    }
    b
}

/// Mean and first moments over an element from those over its children: exact.
#[derive(Default)]
pub(super) struct Fit {
    area: f64,
    mean: [f64; 3],
    first: [[f64; 3]; 2],
}

impl Fit {
    pub(super) fn add(
        &mut self,
        area: f64,
        (own, place): (&Place, &Place),
        moment: f32,
        b: &Linear,
    ) {
        let dx = f64::from(place.centroid[0] - own.centroid[0]);
        let dy = f64::from(place.centroid[1] - own.centroid[1]);
        let scale = f64::from(place.radius * moment);
        self.area += area;
        for c in 0..3 {
            let value = f64::from(b.mean[c]);
            self.mean[c] += area * value;
            self.first[0][c] += area * (dx * value + scale * f64::from(b.gradient[0][c]));
            self.first[1][c] += area * (dy * value + scale * f64::from(b.gradient[1][c]));
        }
    }

    pub(super) fn linear(&self, own: &Place, moment: f32) -> Linear {
        let per_area = 1.0 / self.area;
        let scale = per_area / f64::from(own.radius * moment);
        let mut out = Linear::default();
        for c in 0..3 {
            out.mean[c] = (self.mean[c] * per_area) as f32;
            out.gradient[0][c] = (self.first[0][c] * scale) as f32;
            out.gradient[1][c] = (self.first[1][c] * scale) as f32;
        }
        out
    }
}
