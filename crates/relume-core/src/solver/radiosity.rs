//! The solution: radiosity and gathered irradiance of every element, as it is kept from frame to frame.

use std::collections::BTreeMap;

use crate::element::Renumbering;

use super::field::{Field, Linear, SPARE, grow};
use super::place::Place;
use super::push::{RowSum, push};
use super::surfaces::{Surfaces, for_each_below};
use super::trend::Trend;

mod bounded;
mod growth;
mod levels;
mod scaling;
mod solve;
#[cfg(test)]
mod toy;

pub use bounded::Bounds;
use levels::Levels;
use scaling::RowScaling;
pub use solve::Stop;

/// What came over links of groups to whom something did: few elements do, since groups are linked with large ones.
#[derive(Clone, Debug, Default)]
struct OverGroups(BTreeMap<u32, Linear>);

impl OverGroups {
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn get(&self, id: u32) -> Linear {
        self.0.get(&id).copied().unwrap_or_default()
    }

    fn set(&mut self, id: u32, value: &Linear) {
        if *value != Linear::default() {
            self.0.insert(id, *value);
        } else if !self.0.is_empty() {
            self.0.remove(&id);
        }
    }

    fn renumber(&mut self, to: &Renumbering) {
        if !self.0.is_empty() {
            let old_of = (0..).zip(to.old_of());
            self.0 = old_of.filter_map(|(id, old)| Some((id, *self.0.get(old)?))).collect();
        }
    }

    /// Bytes held, with the room that the tree leaves.
    fn bytes(&self) -> u64 {
        (self.0.len() * size_of::<(u32, Linear)>() * 3 / 2) as u64
    }
}

/// The solution: 80 bytes an element.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// With first moments ([`Place::first_moments`]).
    radiosity: Field,
    /// Irradiance over an element's own links, without those of its ancestors. Gradients are per metre.
    gathered: Field,
    /// Part of `gathered` that came over links of groups.
    over_groups: OverGroups,
    /// Bound of the change of an element's irradiance since it was gathered, W/m2.
    pending: Vec<f32>,
    /// Deferred error: bound of the error of radiosities at and below an element by irradiance not pushed down yet, W/m2.
    /// Empty where the next solve will gather everything.
    deferred: Vec<f32>,
    /// Last change of each mean radiosity; replaces `deferred` while the next solve will gather everything.
    trend: Trend,
    /// Elements are taken to be constant, as the solution would grow without end if lines were handed down.
    constant: bool,
    /// RowScaling of leaves; empty unless the solution would grow.
    scaling: RowScaling,
    /// Levels of leaves; none where nothing is white.
    levels: Levels,
    /// Sweeps made by the last solve.
    pub sweeps: u32,
    /// Receivers gathered by the last solve, each time counted.
    pub gathers: u64,
    /// Estimate of the largest residual of a radiosity, relative to the mean radiosity: skipped changes, deferred changes and
    /// pending changes of its sources, added up, but not over all levels.
    pub residual: f64,
    /// Largest change that the last sweep over all elements skipped, W/m2.
    skipped_in_full_sweep: f32,
    /// Largest change that may have been skipped since, W/m2.
    skipped: f32,
}

impl Radiosity {
    /// A solution to begin with: the exitance of surfaces. Sources other than surfaces are given by
    /// [`Radiosity::set`].
    pub fn new(surfaces: &impl Surfaces) -> Radiosity {
        let mut out = Radiosity::default();
        out.extend(surfaces.len());
        for &facet in surfaces.facets() {
            let exitance = surfaces.material(facet.0).exitance;
            for_each_below(surfaces, facet.0, &mut |id| out.set(id, exitance));
        }
        out
    }

    /// Makes room for elements with higher ids.
    pub fn extend(&mut self, len: usize) {
        self.radiosity.extend(len);
        self.gathered.extend(len);
        if len > self.pending.len() {
            grow(&mut self.pending, len);
            if !self.trend.is_wide {
                grow(&mut self.deferred, len);
            }
        }
        self.trend.extend(len);
    }

    /// Follows elements to their new ids.
    pub fn renumber(&mut self, to: &Renumbering) {
        self.radiosity.renumber(to);
        self.gathered.renumber(to);
        self.over_groups.renumber(to);
        self.trend.renumber(to);
        self.scaling.renumber(to);
        self.levels.renumber(to);
        let numbers = [&mut self.pending, &mut self.deferred];
        let kept = numbers.into_iter().filter(|v| !v.is_empty());
        for values in kept {
            *values = to.old_of().iter().map(|&old| values[old as usize]).collect();
        }
    }

    /// Gives back room beyond a small reserve.
    pub fn trim(&mut self) {
        let Radiosity { radiosity, gathered, pending, deferred, .. } = self;
        for values in [&mut radiosity.0, &mut gathered.0, pending, deferred] {
            values.shrink_to(values.len() + values.len() / SPARE);
        }
        self.trend.trim();
    }

    /// Gives an element a constant radiosity to begin with.
    pub fn set(&mut self, id: u32, radiosity: [f32; 3]) {
        self.radiosity.set(id, &Linear { mean: radiosity, ..Linear::default() });
    }

    /// Gives the new children of an element its radiosity to begin with.
    pub fn inherit(&mut self, surfaces: &impl Surfaces, parent: u32) {
        let own = surfaces.place(parent);
        let from = self.linear(parent, &own, surfaces.source_moment());
        let moment = surfaces.source_moment();
        for child in surfaces.children(parent) {
            let place = surfaces.place(child);
            let [x, y] = [0, 1].map(|k| (place.centroid[k] - own.centroid[k]) / own.radius);
            let scale = place.radius / own.radius;
            let mut own = Linear { mean: from.at(x, y), ..Linear::default() };
            for c in 0..3 {
                let slope = from.gradient.map(|g| g[c] * scale);
                let moments = place.first_moments(slope, moment);
                (own.gradient[0][c], own.gradient[1][c]) = (moments[0], moments[1]);
            }
            self.radiosity.set(child, &own);
            self.gathered.set(child, &Linear::default());
            self.over_groups.set(child, &Linear::default());
            if let Some(deferred) = self.deferred.get_mut(child as usize) {
                *deferred = 0.0;
            }
            self.trend.inherit(parent, child);
        }
    }

    /// Area-weighted mean radiosity of all surfaces and channels, W/m2.
    pub fn mean_w_m2(&self, surfaces: &impl Surfaces) -> f64 {
        let (mut flux, mut area) = (0.0, 0.0);
        for facet in surfaces.facets() {
            let a = surfaces.area_m2(facet.0);
            let b: f32 = self.radiosity.get(facet.0).mean.iter().sum();
            flux += a * f64::from(b) / 3.0;
            area += a;
        }
        if area > 0.0 { flux / area } else { 0.0 }
    }

    /// Radiosity of an element, W/m2.
    #[inline]
    pub fn radiosity(&self, id: u32) -> [f32; 3] {
        self.radiosity.get(id).mean
    }

    /// Radiosity of an element with its gradient per radius, W/m2.
    pub fn linear(&self, id: u32, place: &Place, moment: f32) -> Linear {
        let mut b = self.radiosity.get(id);
        for c in 0..3 {
            let slope = place.gradient([0, 1].map(|axis| b.gradient[axis][c]), moment);
            (b.gradient[0][c], b.gradient[1][c]) = (slope[0], slope[1]);
        }
        b
    }

    /// Mean over a leaf of its radiosity times the sum of the form factors from there, W/m2: what its links carry away,
    /// where both vary together too. Of a leaf with a symmetric level, all that it reflects.
    pub fn carried(&self, surfaces: &impl Surfaces, id: u32, row: &RowSum) -> [f64; 3] {
        let b = self.radiosity.get(id);
        if self.levels.are_symmetric() && self.levels.is_closed(id) {
            let emitted = surfaces.material(surfaces.facet_of(id)).exitance;
            let of = |c: usize| {
                let own = f64::from(emitted[c]);
                own * f64::from(row.mean) + f64::from(b.mean[c]) - own
            };
            return [of(0), of(1), of(2)];
        }
        let scale = surfaces.place(id).radius * surfaces.source_moment();
        let [x, y] = row.gradient.map(|g| f64::from(g * scale));
        let of = |c: usize| {
            let [u, v] = b.gradient.map(|g| f64::from(g[c]));
            f64::from(b.mean[c]) * f64::from(row.mean) + x * u + y * v
        };
        [of(0), of(1), of(2)]
    }

    /// Calls `visit` with the irradiance (mean, and gradient per metre) of each leaf of a facet,
    /// children in order.
    pub fn irradiances(
        &self,
        surfaces: &impl Surfaces,
        facet: u32,
        visit: &mut dyn FnMut(u32, &Linear),
    ) {
        let own = |id: u32| self.gathered.get(id);
        push(
            surfaces,
            facet,
            &surfaces.place(facet),
            &Linear::default(),
            &own,
            &mut |id, h| match (self.scaling.factors.get(id as usize), self.levels.get(id)) {
                (Some(&factor), _) => visit(id, &h.times(factor)),
                (None, Some(level)) if !self.levels.are_symmetric() => visit(id, &level.evened(h)),
                (None, Some(level)) => {
                    visit(id, &level.received(h, &surfaces.place(id), surfaces.source_moment()));
                }
                (None, None) => visit(id, h),
            },
        );
    }

    /// Bytes held, without [`Radiosity::group_bytes`].
    pub fn memory_bytes(&self) -> u64 {
        let single =
            ((self.pending.capacity() + self.deferred.capacity()) * size_of::<f32>()) as u64;
        let fields = self.radiosity.bytes() + self.gathered.bytes();
        fields + single + self.scaling.bytes() + self.levels.bytes() + self.trend.bytes()
    }

    /// Bytes held for what came over links of groups.
    pub fn group_bytes(&self) -> u64 {
        self.over_groups.bytes()
    }
}
