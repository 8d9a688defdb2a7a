//! The iteration B = M + rho H over the hierarchy.

use std::ops::Range;

use fearless_simd::{Simd, dispatch, f32x4, prelude::*};
use rayon::prelude::*;

use crate::element::{ElementId, Renumbering};
use crate::transport;

use super::links::{Link, Links};

/// Reflectance and exitance of one material, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lit {
    /// Reflectance rho.
    pub reflectance: [f32; 3],
    /// Exitance M, W/m2.
    pub exitance: [f32; 3],
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

/// The hierarchy as the solver sees it: quadtrees over facets.
pub trait Surfaces: Sync {
    /// Room for elements: ids are below this.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The roots of the quadtrees.
    fn facets(&self) -> &[ElementId];
    /// Root of the quadtree that an element is in.
    fn facet_of(&self, id: u32) -> u32;
    /// Parent of an element within its quadtree; `None` for a facet.
    fn parent(&self, id: u32) -> Option<u32>;
    /// Children of an element within its quadtree.
    fn children(&self, id: u32) -> Range<u32>;
    /// Area, m2.
    fn area_m2(&self, id: u32) -> f64;
    /// Where an element lies.
    fn place(&self, id: u32) -> Place;
    /// What a facet is made of.
    fn lit(&self, facet: u32) -> &Lit;
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// After exactly this many sweeps.
    Sweeps(u32),
    /// When no element's radiosity would change by more than this, relative to the mean radiosity.
    Residual(f64),
}

/// Which receivers to gather anew to begin with.
#[derive(Clone, Debug)]
pub enum Dirty {
    /// All of them.
    All,
    /// Some of them, and all that depends on them.
    Some {
        /// Receivers whose links changed.
        receivers: Vec<u32>,
        /// Elements whose children came or went.
        parents: Vec<u32>,
    },
}

/// A quantity that varies linearly over an element, red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linear {
    /// Mean over the element.
    pub mean: [f32; 3],
    /// Gradient in the patch's frame, per metre (of radiosities: per radius).
    pub gradient: [[f32; 3]; 2],
}

/// A [`Linear`] for each element: nine numbers each, one after the other.
#[derive(Clone, Debug)]
struct Field(Vec<f32>);

/// Numbers of one element.
const NINE: usize = 9;

/// Numbers beyond the last element that [`Field::with_next`] may read.
const BEYOND: usize = 1;

impl Default for Field {
    fn default() -> Field {
        Field(vec![0.0; BEYOND])
    }
}

impl Field {
    fn extend(&mut self, len: usize) {
        let wanted = len * NINE + BEYOND;
        if wanted > self.0.len() {
            grow(&mut self.0, wanted);
        }
    }

    fn renumber(&mut self, to: &Renumbering) {
        let mut out = Vec::with_capacity(to.old_of().len() * NINE + BEYOND);
        for &old in to.old_of() {
            let at = old as usize * NINE;
            out.extend_from_slice(&self.0[at..at + NINE]);
        }
        out.resize(out.len() + BEYOND, 0.0);
        self.0 = out;
    }

    #[inline]
    fn get(&self, id: u32) -> Linear {
        let at = id as usize * NINE;
        let [r, g, b, ur, ug, ub, vr, vg, vb] =
            *self.0[at..].first_chunk::<NINE>().expect("an element");
        Linear { mean: [r, g, b], gradient: [[ur, ug, ub], [vr, vg, vb]] }
    }

    #[inline]
    fn set(&mut self, id: u32, value: &Linear) {
        let at = id as usize * NINE;
        let [[ur, ug, ub], [vr, vg, vb]] = value.gradient;
        let [r, g, b] = value.mean;
        self.0[at..at + NINE].copy_from_slice(&[r, g, b, ur, ug, ub, vr, vg, vb]);
    }

    /// The nine numbers of an element, and the one after them.
    #[inline(always)]
    fn with_next(&self, id: u32) -> &[f32; NINE + BEYOND] {
        self.0[id as usize * NINE..].first_chunk().expect("an element")
    }

    fn bytes(&self) -> u64 {
        (self.0.capacity() * size_of::<f32>()) as u64
    }
}

/// Vectors that grow are given room for this share more than they need.
const SLACK: usize = 32;

/// Appends zeros, in the room that there is or else in a little more than is needed.
fn grow(values: &mut Vec<f32>, len: usize) {
    if len > values.capacity() {
        let slack = if values.is_empty() { 0 } else { len / SLACK };
        values.reserve_exact(len + slack - values.len());
    }
    values.resize(len, 0.0);
}

/// The solution: 76 bytes an element.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// Gradients are per radius of the element.
    radiosity: Field,
    /// What an element's own links bring, without those of its ancestors. Gradients are per metre.
    gathered: Field,
    /// By how much the irradiance of an element may have changed since it was gathered, W/m2.
    pending: Vec<f32>,
    /// Sweeps made by the last solve.
    pub sweeps: u32,
    /// Receivers gathered by the last solve, each time counted.
    pub gathers: u64,
    /// Largest change that was not followed to who depends on it, relative to the mean radiosity.
    pub residual: f64,
    /// The same of the last sweep over everything alone, W/m2.
    passed_over: f32,
    /// Largest change that may have been left undone since, W/m2.
    held: f32,
}

/// Sweeps after which a solve is given up as not converging (reflectances are below 1).
const SWEEPS_MAX: u32 = 10_000;

/// Receivers gathered by one task.
const CHUNK: usize = 256;

/// Share of the receivers above which all are gathered: to find out which is dearer then.
const MANY: usize = 4;

/// Share of the elements that must change in a sweep over all for the next to be over all.
const FEW: usize = 16;

/// Share of the residual to which changes of sources may add up before a receiver gathers anew.
const PENDING_SHARE: f32 = 0.5;

/// What may be left undone, relative to what may be left undone now.
const HELD_MAX: f32 = 2.0;

impl Linear {
    /// Value at an offset from the centroid (in the unit of the gradient), unclamped.
    #[inline]
    pub fn at(&self, x: f32, y: f32) -> [f32; 3] {
        let mut out = self.mean;
        for (c, value) in out.iter_mut().enumerate() {
            *value += self.gradient[0][c] * x + self.gradient[1][c] * y;
        }
        out
    }

    /// The same about another centroid, per metre.
    fn about(&self, own: &Place, other: &Place) -> Linear {
        let [dx, dy] = [0, 1].map(|k| other.centroid[k] - own.centroid[k]);
        Linear { mean: self.at(dx, dy), ..*self }
    }

    fn plus(mut self, other: &Linear) -> Linear {
        for c in 0..3 {
            self.mean[c] += other.mean[c];
            self.gradient[0][c] += other.gradient[0][c];
            self.gradient[1][c] += other.gradient[1][c];
        }
        self
    }

    fn difference(&self, other: &Linear) -> f32 {
        let mut out = 0.0_f32;
        for c in 0..3 {
            out = out.max((self.mean[c] - other.mean[c]).abs());
            out = out.max((self.gradient[0][c] - other.gradient[0][c]).abs());
            out = out.max((self.gradient[1][c] - other.gradient[1][c]).abs());
        }
        out
    }
}

impl Radiosity {
    /// A solution to begin with: the exitance of surfaces. Sources other than surfaces are given by
    /// [`Radiosity::set`].
    pub fn new(surfaces: &impl Surfaces) -> Radiosity {
        let mut out = Radiosity::default();
        out.extend(surfaces.len());
        for &facet in surfaces.facets() {
            let exitance = surfaces.lit(facet.0).exitance;
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
        }
    }

    /// Follows elements to their new ids.
    pub fn renumber(&mut self, to: &Renumbering) {
        self.radiosity.renumber(to);
        self.gathered.renumber(to);
        self.pending = to.old_of().iter().map(|&old| self.pending[old as usize]).collect();
    }

    /// Gives back room beyond a small reserve.
    pub fn trim(&mut self) {
        for values in [&mut self.radiosity.0, &mut self.gathered.0, &mut self.pending] {
            values.shrink_to(values.len() + values.len() / SLACK);
        }
    }

    /// Gives an element a constant radiosity to begin with.
    pub fn set(&mut self, id: u32, radiosity: [f32; 3]) {
        self.radiosity.set(id, &Linear { mean: radiosity, ..Linear::default() });
    }

    /// Gives the new children of an element its radiosity to begin with.
    pub fn inherit(&mut self, surfaces: &impl Surfaces, parent: u32) {
        let own = surfaces.place(parent);
        let from = self.radiosity.get(parent);
        for child in surfaces.children(parent) {
            let place = surfaces.place(child);
            let [x, y] = [0, 1].map(|k| (place.centroid[k] - own.centroid[k]) / own.radius);
            let scale = place.radius / own.radius;
            let gradient = from.gradient.map(|g| g.map(|v| v * scale));
            self.radiosity.set(child, &Linear { mean: from.at(x, y), gradient });
            self.gathered.set(child, &Linear::default());
        }
    }

    /// Gathers, pushes and pulls until the solution is settled, beginning with what is dirty.
    ///
    /// Facets go in batches, each with what the batches before it have found in the same sweep
    /// (Gauss-Seidel), and in parallel within. Sweeps over everything go on until no radiosity
    /// changes by more than the residual. Sweeps over a part follow only larger changes: a radiosity
    /// that would change by less stays as it is, so that whoever gathered it has gathered its present
    /// value; and a receiver gathers anew once the changes of its sources may have added up to half
    /// the residual since it last did. So nothing drifts, however often this is called.
    pub fn solve(&mut self, surfaces: &impl Surfaces, links: &Links, dirty: Dirty, stop: Stop) {
        let mut work = Work::new(surfaces, dirty);
        let mut jump = Jump::default();
        (self.sweeps, self.gathers) = (0, 0);
        loop {
            let mean = self.mean(surfaces);
            let limit = match stop {
                Stop::Sweeps(_) => 0.0,
                Stop::Residual(limit) => (limit * mean) as f32,
            };
            if work.all {
                jump.before(&self.radiosity);
            }
            if !work.all && self.held > HELD_MAX * limit && matches!(stop, Stop::Residual(_)) {
                // What was little beside a brighter scene is too much beside this one.
                work.start_all(surfaces);
                continue;
            }
            let small = self.sweep(surfaces, links, &mut work, limit);
            if work.all {
                (self.passed_over, self.held) = (small, 0.0);
            } else {
                self.held = self.held.max(limit);
            }
            let left = self.passed_over + self.held * (1.0 + PENDING_SHARE);
            self.residual = if mean > 0.0 { f64::from(left) / mean } else { 0.0 };
            self.sweeps += 1;
            let done = match stop {
                Stop::Sweeps(count) => self.sweeps >= count,
                Stop::Residual(_) => !work.is_left(surfaces, links, limit, &mut self.pending),
            };
            if done || self.sweeps >= SWEEPS_MAX {
                return;
            }
            if work.all && matches!(stop, Stop::Residual(_)) {
                jump.after(&mut self.radiosity);
            }
        }
    }

    /// One pass over all batches; returns the largest change that is too small to be followed.
    fn sweep(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        work: &mut Work,
        limit: f32,
    ) -> f32 {
        let mut small = 0.0_f32;
        work.changed.clear();
        let mut scratch = std::mem::take(&mut work.scratch);
        for batch in 0..work.batches.len() {
            let mut now = work.take(surfaces, batch);
            self.gather(surfaces, links, &now.receivers, &mut scratch.gathered);
            let way = if work.all { None } else { Some(work.way.mark(surfaces, &now)) };
            self.settle(surfaces, &now.facets, (limit, way), &mut scratch.settled);
            for settled in &scratch.settled[..now.facets.len()] {
                small = small.max(settled.small);
                for (id, value, difference) in &settled.changed {
                    self.radiosity.set(*id, value);
                    if *difference > limit {
                        work.changed.push((*id, *difference));
                    }
                    if !work.all {
                        let change = (*id, *difference);
                        work.mark_neighbours((surfaces, links), change, limit, &mut self.pending);
                    }
                }
            }
            if work.all {
                std::mem::swap(&mut work.batches[batch], &mut now);
            } else {
                work.way.clear(surfaces, &now);
            }
        }
        work.scratch = scratch;
        small
    }

    /// Area-weighted mean radiosity of all surfaces and channels.
    fn mean(&self, surfaces: &impl Surfaces) -> f64 {
        let (mut flux, mut area) = (0.0, 0.0);
        for facet in surfaces.facets() {
            let a = surfaces.area_m2(facet.0);
            let b: f32 = self.radiosity.get(facet.0).mean.iter().sum();
            flux += a * f64::from(b) / 3.0;
            area += a;
        }
        if area > 0.0 { flux / area } else { 0.0 }
    }

    fn gather(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        receivers: &[u32],
        found: &mut Vec<Linear>,
    ) {
        self.gathers += receivers.len() as u64;
        receivers.iter().for_each(|&id| self.pending[id as usize] = 0.0);
        let Radiosity { radiosity, gathered, .. } = self;
        found.resize(found.len().max(receivers.len()), Linear::default());
        let level = transport::Simd::detect().level();
        let gather = |ids: &[u32], out: &mut [Linear]| {
            dispatch!(level, simd => gather_some(simd, (radiosity, links), surfaces, ids, out));
        };
        if receivers.len() <= CHUNK {
            gather(receivers, found);
        } else {
            let chunks = receivers.par_chunks(CHUNK).zip(found.par_chunks_mut(CHUNK));
            chunks.for_each(|(ids, out)| gather(ids, out));
        }
        for (&id, h) in receivers.iter().zip(found.iter()) {
            gathered.set(id, h);
        }
    }

    /// New radiosities of all elements of some facets, as far as they differ.
    fn settle(
        &self,
        surfaces: &impl Surfaces,
        facets: &[u32],
        (limit, way): (f32, Option<&Way>),
        settled: &mut Vec<Settled>,
    ) {
        settled.resize_with(settled.len().max(facets.len()), Settled::default);
        let facet = |(&facet, out): (&u32, &mut Settled)| {
            out.changed.clear();
            out.small = 0.0;
            let lit = surfaces.lit(facet);
            let place = surfaces.place(facet);
            let below = Below { solution: self, surfaces, lit, limit, way };
            below.settle(facet, &place, &Linear::default(), way.is_none(), out);
        };
        if facets.len() == 1 {
            facet((&facets[0], &mut settled[0]));
        } else {
            facets.par_iter().zip(settled).for_each(facet);
        }
    }

    /// Radiosity of an element: mean, and gradient per radius, W/m2.
    #[inline]
    pub fn linear_radiosity(&self, id: u32) -> Linear {
        self.radiosity.get(id)
    }

    /// Radiosity of an element, W/m2.
    #[inline]
    pub fn radiosity(&self, id: u32) -> [f32; 3] {
        self.radiosity.get(id).mean
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
        push(surfaces, (facet, &surfaces.place(facet)), &Linear::default(), &own, visit);
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        let pending = (self.pending.capacity() * size_of::<f32>()) as u64;
        self.radiosity.bytes() + self.gathered.bytes() + pending
    }
}

/// Calls `visit` with the sum of the form factors from each leaf of a facet, over its and its
/// ancestors' links.
pub fn row_sums(
    surfaces: &impl Surfaces,
    links: &Links,
    counts: &dyn Fn(u32) -> bool,
    facet: u32,
    visit: &mut dyn FnMut(u32, f32),
) {
    let own = |id: u32| {
        let mut sum = Linear::default();
        let list = links.of(id);
        for link in list.iter().filter(|l| counts(l.source)) {
            sum.mean[0] += link.coupling;
            let [u, v] = link.receiver_gradient();
            sum.gradient[0][0] += u * link.coupling;
            sum.gradient[1][0] += v * link.coupling;
        }
        if !list.is_empty() {
            let per_radius = 1.0 / surfaces.place(id).radius;
            sum.gradient.iter_mut().for_each(|g| g[0] *= per_radius);
        }
        sum
    };
    let place = surfaces.place(facet);
    push(surfaces, (facet, &place), &Linear::default(), &own, &mut |id, sum| {
        visit(id, sum.mean[0]);
    });
}

/// Adds `own` up from the root of a quadtree down to its leaves.
fn push(
    surfaces: &impl Surfaces,
    (id, place): (u32, &Place),
    inherited: &Linear,
    own: &dyn Fn(u32) -> Linear,
    visit: &mut dyn FnMut(u32, &Linear),
) {
    let whole = own(id).plus(inherited);
    let children = surfaces.children(id);
    if children.is_empty() {
        return visit(id, &whole);
    }
    for child in children {
        let at = surfaces.place(child);
        push(surfaces, (child, &at), &whole.about(place, &at), own, visit);
    }
}

fn for_each_below(surfaces: &impl Surfaces, id: u32, visit: &mut dyn FnMut(u32)) {
    visit(id);
    for child in surfaces.children(id) {
        for_each_below(surfaces, child, visit);
    }
}

/// Aitken's extrapolation: once successive changes are all but parallel, one mode is left, and its
/// geometric series is summed at once.
#[derive(Default)]
struct Jump {
    before: Vec<f32>,
    change: Vec<f32>,
    last: Vec<f32>,
}

/// Square of the cosine between successive changes above which they count as parallel.
const PARALLEL: f64 = 0.9;

impl Jump {
    fn before(&mut self, field: &Field) {
        self.before.clone_from(&field.0);
    }

    fn after(&mut self, field: &mut Field) {
        let change = field.0.iter().zip(&self.before).map(|(now, before)| now - before);
        self.change.clear();
        self.change.extend(change);
        if self.last.len() == self.change.len() {
            let dot = |x: &[f32], y: &[f32]| -> f64 {
                x.iter().zip(y).map(|(a, b)| f64::from(a * b)).sum()
            };
            let (along, now, last) = (
                dot(&self.change, &self.last),
                dot(&self.change, &self.change),
                dot(&self.last, &self.last),
            );
            let ratio = along / last.max(f64::MIN_POSITIVE);
            if along * along > PARALLEL * now * last && ratio > 0.0 && ratio < 0.95 {
                let step = (ratio / (1.0 - ratio)) as f32;
                field.0.iter_mut().zip(&self.change).for_each(|(b, d)| *b += d * step);
                self.last.clear();
                return;
            }
        }
        std::mem::swap(&mut self.last, &mut self.change);
    }
}

/// What is left to be done, batch by batch.
struct Work {
    batches: Vec<Batch>,
    /// Batch of each facet, by the facet's id.
    batch_of: Vec<u16>,
    /// Receivers that wait in some batch, a bit each.
    marks: Vec<u64>,
    /// Every sweep gathers everything.
    all: bool,
    /// Elements that the last sweep changed by more than the limit, and by how much.
    changed: Vec<(u32, f32)>,
    way: Way,
    scratch: Scratch,
}

/// Room that is used again and again.
#[derive(Default)]
struct Scratch {
    gathered: Vec<Linear>,
    settled: Vec<Settled>,
}

/// Facets that go together: consecutive ones.
#[derive(Default)]
struct Batch {
    facets: Vec<u32>,
    /// Receivers to be gathered, and settled with all that is below them.
    receivers: Vec<u32>,
    /// Further elements to be settled with all that is below them.
    parents: Vec<u32>,
}

/// Batches there are at most.
const BATCHES: usize = 16;

impl Work {
    fn new(surfaces: &impl Surfaces, dirty: Dirty) -> Work {
        let facets = surfaces.facets();
        let count = facets.len().min(BATCHES);
        let mut batches: Vec<Batch> = (0..count).map(|_| Batch::default()).collect();
        let mut batch_of = vec![0; facets.last().map_or(0, |f| f.0 as usize + 1)];
        for (k, facet) in facets.iter().enumerate() {
            let batch = k * count / facets.len();
            batches[batch].facets.push(facet.0);
            batch_of[facet.0 as usize] = batch as u16;
        }
        let marks = vec![0; surfaces.len() / 64 + 1];
        let mut work = Work {
            batches,
            batch_of,
            marks,
            all: false,
            changed: Vec::new(),
            way: Way::new(surfaces.len()),
            scratch: Scratch::default(),
        };
        match dirty {
            Dirty::Some { receivers, parents } if receivers.len() <= surfaces.len() / MANY => {
                for parent in parents {
                    let batch = work.batch_of(surfaces, parent);
                    work.batches[batch].parents.push(parent);
                }
                receivers.into_iter().for_each(|id| work.mark(surfaces, id));
            }
            _ => work.start_all(surfaces),
        }
        work
    }

    fn start_all(&mut self, surfaces: &impl Surfaces) {
        self.all = true;
        self.marks.fill(0);
        for batch in &mut self.batches {
            batch.receivers.clear();
            for &facet in &batch.facets {
                for_each_below(surfaces, facet, &mut |id| batch.receivers.push(id));
            }
        }
    }

    fn batch_of(&self, surfaces: &impl Surfaces, id: u32) -> usize {
        usize::from(self.batch_of[surfaces.facet_of(id) as usize])
    }

    fn mark(&mut self, surfaces: &impl Surfaces, id: u32) {
        if !set_bit(&mut self.marks, id) {
            let batch = self.batch_of(surfaces, id);
            self.batches[batch].receivers.push(id);
        }
    }

    /// Marks who gathers from an element that changed, as soon as the changes add up to something.
    fn mark_neighbours(
        &mut self,
        (surfaces, links): (&impl Surfaces, &Links),
        (id, change): (u32, f32),
        limit: f32,
        pending: &mut [f32],
    ) {
        let flux = change * surfaces.area_m2(id) as f32;
        // Whoever an element gathers from gathers from it.
        for link in links.of(id) {
            // Sources that are no surfaces receive nothing.
            let area = surfaces.area_m2(link.source) as f32;
            if area > 0.0 {
                let pending = &mut pending[link.source as usize];
                *pending += flux * link.coupling / area;
                if *pending > limit * PENDING_SHARE {
                    self.mark(surfaces, link.source);
                }
            }
        }
    }

    /// What a batch has to do now. Of a sweep over all it is to be put back.
    fn take(&mut self, surfaces: &impl Surfaces, batch: usize) -> Batch {
        if self.all {
            return std::mem::take(&mut self.batches[batch]);
        }
        let batch = &mut self.batches[batch];
        let mut receivers = std::mem::take(&mut batch.receivers);
        receivers.sort_unstable();
        receivers.iter().for_each(|&id| clear_bit(&mut self.marks, id));
        let parents = std::mem::take(&mut batch.parents);
        let concerned = receivers.iter().chain(&parents);
        let mut facets: Vec<u32> = concerned.map(|&id| surfaces.facet_of(id)).collect();
        facets.sort_unstable();
        facets.dedup();
        Batch { receivers, facets, parents }
    }

    /// Whether another sweep is needed.
    fn is_left(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        limit: f32,
        pending: &mut [f32],
    ) -> bool {
        let many = self.changed.len() > surfaces.len() / if self.all { FEW } else { MANY };
        if self.all && !many {
            // From now on only what depends on a change.
            self.all = false;
            self.batches.iter_mut().for_each(|b| b.receivers.clear());
            for change in std::mem::take(&mut self.changed) {
                self.mark_neighbours((surfaces, links), change, limit, pending);
            }
        } else if many && !self.all {
            self.start_all(surfaces);
        }
        self.all || self.batches.iter().any(|b| !b.receivers.is_empty())
    }
}

/// Sets a bit; whether it was set already.
fn set_bit(bits: &mut [u64], id: u32) -> bool {
    let (word, bit) = (&mut bits[id as usize / 64], 1 << (id % 64));
    let before = *word & bit != 0;
    *word |= bit;
    before
}

fn clear_bit(bits: &mut [u64], id: u32) {
    bits[id as usize / 64] &= !(1 << (id % 64));
}

fn bit(bits: &[u64], id: u32) -> bool {
    bits[id as usize / 64] >> (id % 64) & 1 == 1
}

/// The ways from facets to the elements that a batch concerns: nothing beside them is looked at.
struct Way {
    /// Elements on a way.
    on: Vec<u64>,
    /// Ends of the ways: everything below them is concerned.
    ends: Vec<u64>,
}

impl Way {
    fn new(len: usize) -> Way {
        Way { on: vec![0; len / 64 + 1], ends: vec![0; len / 64 + 1] }
    }

    fn mark(&mut self, surfaces: &impl Surfaces, batch: &Batch) -> &Way {
        for &id in batch.receivers.iter().chain(&batch.parents) {
            set_bit(&mut self.ends, id);
            let mut at = Some(id);
            while let Some(id) = at.filter(|&id| !set_bit(&mut self.on, id)) {
                at = surfaces.parent(id);
            }
        }
        self
    }

    fn clear(&mut self, surfaces: &impl Surfaces, batch: &Batch) {
        for &id in batch.receivers.iter().chain(&batch.parents) {
            clear_bit(&mut self.ends, id);
            let mut at = Some(id);
            while let Some(id) = at.filter(|&id| bit(&self.on, id)) {
                clear_bit(&mut self.on, id);
                at = surfaces.parent(id);
            }
        }
    }
}

/// What pushing and pulling through one facet found.
#[derive(Default)]
struct Settled {
    /// Elements with their new radiosities, and by how much those differ.
    changed: Vec<(u32, Linear, f32)>,
    /// Largest difference within the limit.
    small: f32,
}

/// One facet being settled.
struct Below<'a, S> {
    solution: &'a Radiosity,
    surfaces: &'a S,
    lit: &'a Lit,
    limit: f32,
    /// The ways to what is concerned; `None` where everything is, small differences too.
    way: Option<&'a Way>,
}

impl<S: Surfaces> Below<'_, S> {
    /// Pushes irradiance down and pulls radiosity up; returns the new radiosity of `id`.
    /// `concerned` says that something above has changed.
    fn settle(
        &self,
        id: u32,
        place: &Place,
        inherited: &Linear,
        concerned: bool,
        out: &mut Settled,
    ) -> Linear {
        let concerned = concerned || self.way.is_some_and(|way| bit(&way.ends, id));
        if !concerned && self.way.is_some_and(|way| !bit(&way.on, id)) {
            return self.solution.radiosity.get(id);
        }
        let h = self.solution.gathered.get(id).plus(inherited);
        let children = self.surfaces.children(id);
        let b = if children.is_empty() {
            self.reflect(&h, place.radius)
        } else {
            let mut fit = Fit::default();
            for child in children {
                let at = self.surfaces.place(child);
                let b = self.settle(child, &at, &h.about(place, &at), concerned, out);
                fit.add(self.surfaces.area_m2(child), place, &at, &b);
            }
            fit.linear(place.radius)
        };
        let difference = b.difference(&self.solution.radiosity.get(id));
        if difference > self.limit || self.way.is_none() {
            out.changed.push((id, b, difference));
        }
        if difference <= self.limit {
            out.small = out.small.max(difference);
        }
        b
    }

    fn reflect(&self, h: &Linear, radius: f32) -> Linear {
        let mut b = Linear::default();
        for c in 0..3 {
            let rho = self.lit.reflectance[c];
            // A gradient pushed down a long way may reach below zero; light does not.
            b.mean[c] = self.lit.exitance[c] + rho * h.mean[c].max(0.0);
            for axis in 0..2 {
                b.gradient[axis][c] = rho * h.gradient[axis][c] * radius;
            }
        }
        b
    }
}

/// The linear function over an element that fits those over its children best.
#[derive(Default)]
struct Fit {
    area: f64,
    mean: [f64; 3],
    first: [[f64; 3]; 2],
    moment: [f64; 3],
}

impl Fit {
    fn add(&mut self, area: f64, own: &Place, place: &Place, b: &Linear) {
        let dx = f64::from(place.centroid[0] - own.centroid[0]);
        let dy = f64::from(place.centroid[1] - own.centroid[1]);
        let [xx, xy, yy] = place.moment.map(f64::from);
        self.area += area;
        self.moment[0] += area * (dx * dx + xx);
        self.moment[1] += area * (dx * dy + xy);
        self.moment[2] += area * (dy * dy + yy);
        for c in 0..3 {
            let value = f64::from(b.mean[c]);
            let gx = f64::from(b.gradient[0][c] / place.radius);
            let gy = f64::from(b.gradient[1][c] / place.radius);
            self.mean[c] += area * value;
            self.first[0][c] += area * (dx * value + xx * gx + xy * gy);
            self.first[1][c] += area * (dy * value + xy * gx + yy * gy);
        }
    }

    fn linear(&self, radius: f32) -> Linear {
        let per_area = 1.0 / self.area;
        let [xx, xy, yy] = self.moment.map(|m| m * per_area);
        let scale = f64::from(radius) * per_area / (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        let mut out = Linear::default();
        for c in 0..3 {
            let [x, y] = [self.first[0][c], self.first[1][c]];
            out.mean[c] = (self.mean[c] * per_area) as f32;
            out.gradient[0][c] = ((x * yy - y * xy) * scale) as f32;
            out.gradient[1][c] = ((y * xx - x * xy) * scale) as f32;
        }
        out
    }
}

/// Everything some receivers gather; each in the order of its links.
#[inline(always)]
fn gather_some<S: Simd>(
    simd: S,
    (radiosity, links): (&Field, &Links),
    surfaces: &impl Surfaces,
    receivers: &[u32],
    out: &mut [Linear],
) {
    for (&id, h) in receivers.iter().zip(out) {
        *h = match links.of(id) {
            [] => Linear::default(),
            list => gather_one(simd, radiosity, list, 1.0 / surfaces.place(id).radius),
        };
    }
}

/// Everything one receiver gathers.
///
/// Four lanes at a time: red, green, blue and one of no meaning, the number next in memory.
#[inline(always)]
fn gather_one<S: Simd>(simd: S, radiosity: &Field, list: &[Link], per_radius: f32) -> Linear {
    let zero = f32x4::splat(simd, 0.0);
    let (mut mean, mut gx, mut gy) = (zero, zero, zero);
    for link in list {
        let near = radiosity.with_next(link.source);
        let lanes = |at: usize| f32x4::from_slice(simd, &near[at..at + 4]);
        let arriving = lanes(0) * link.coupling;
        let [su, sv] = link.source_gradient();
        let uneven = lanes(3) * su + lanes(6) * sv;
        mean += arriving + uneven * (link.coupling * SOURCE_MOMENT);
        let [ru, rv] = link.receiver_gradient();
        gx += arriving * ru;
        gy += arriving * rv;
    }
    let three = |lanes: f32x4<S>, scale: f32| {
        let mut all = [0.0; 4];
        (lanes * scale).store_slice(&mut all);
        [all[0], all[1], all[2]]
    };
    Linear { mean: three(mean, 1.0), gradient: [three(gx, per_radius), three(gy, per_radius)] }
}

/// Mean of x^2 / radius^2 over an element, for the product of two gradients: 1/6 for a square.
const SOURCE_MOMENT: f32 = 1.0 / 6.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// Two plates, the second split in two, with given couplings.
    struct Plates(Lit, [ElementId; 2]);

    impl Surfaces for Plates {
        fn len(&self) -> usize {
            4
        }
        fn facets(&self) -> &[ElementId] {
            &self.1
        }
        fn facet_of(&self, id: u32) -> u32 {
            id.min(1)
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
        fn lit(&self, _: u32) -> &Lit {
            &self.0
        }
    }

    const STOP: Stop = Stop::Residual(1e-7);

    fn plates() -> (Plates, Links) {
        let lit = Lit { reflectance: [0.5, 0.8, 0.0], exitance: [1.0, 2.0, 3.0] };
        let mut links = Links::default();
        links.extend(4);
        for (receiver, source, coupling) in [(0, 2, 0.5), (0, 3, 0.5), (2, 0, 1.0), (3, 0, 1.0)] {
            links.set(receiver, Link { source, coupling, ..Link::default() });
        }
        (Plates(lit, [ElementId(0), ElementId(1)]), links)
    }

    #[test]
    fn a_furnace_reaches_m_over_one_minus_rho_through_every_level() {
        let (plates, links) = plates();
        let mut b = Radiosity::new(&plates);
        b.solve(&plates, &links, Dirty::All, STOP);
        for id in 0..4 {
            for (value, want) in b.radiosity(id).iter().zip([2.0, 10.0, 3.0]) {
                assert!((value - want).abs() < 1e-4, "{id} {value} {want}");
            }
        }
    }

    #[test]
    fn a_link_that_changes_is_followed_through_the_scene() {
        let (plates, mut links) = plates();
        let mut warm = Radiosity::new(&plates);
        warm.solve(&plates, &links, Dirty::All, STOP);
        links.set(2, Link { source: 0, coupling: 0.25, ..Link::default() });
        let dirty = Dirty::Some { receivers: vec![2], parents: vec![] };
        warm.solve(&plates, &links, dirty, STOP);
        let mut cold = Radiosity::new(&plates);
        cold.solve(&plates, &links, Dirty::All, STOP);
        for id in 0..4 {
            for (one, two) in warm.radiosity(id).iter().zip(cold.radiosity(id)) {
                assert!((one - two).abs() < 1e-4, "{id} {one} {two}");
            }
        }
        // And nothing is done where nothing changed.
        let dirty = Dirty::Some { receivers: vec![], parents: vec![] };
        warm.solve(&plates, &links, dirty, STOP);
        assert_eq!((warm.sweeps, warm.gathers), (1, 0));
    }
}
