//! The iteration B = M + rho H over the hierarchy.

use std::ops::Range;

use rayon::prelude::*;

use crate::element::ElementId;

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
        /// Facets whose elements came or went.
        facets: Vec<u32>,
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

/// The solution: 72 bytes an element.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// Gradients are per radius of the element.
    radiosity: Vec<Linear>,
    /// What an element's own links bring, without those of its ancestors. Gradients are per metre.
    gathered: Vec<Linear>,
    /// Largest change that was not made of each facet when it was last settled, W/m2; by id.
    kept: Vec<f32>,
    /// Sweeps made by the last solve.
    pub sweeps: u32,
    /// Receivers gathered by the last solve, each time counted.
    pub gathers: u64,
    /// Largest change that was left undone, relative to the mean radiosity.
    pub residual: f64,
}

/// Sweeps after which a solve is given up as not converging (reflectances are below 1).
const SWEEPS_MAX: u32 = 10_000;

/// Receivers gathered by one task.
const CHUNK: usize = 256;

/// Share of the receivers above which all are gathered: to find out which is dearer then.
const MANY: usize = 4;

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
        if len > self.radiosity.len() {
            self.radiosity.resize(len, Linear::default());
            self.gathered.resize(len, Linear::default());
        }
    }

    /// Gives an element a constant radiosity to begin with.
    pub fn set(&mut self, id: u32, radiosity: [f32; 3]) {
        self.radiosity[id as usize] = Linear { mean: radiosity, ..Linear::default() };
    }

    /// Gives the new children of an element its radiosity to begin with.
    pub fn inherit(&mut self, surfaces: &impl Surfaces, parent: u32) {
        let own = surfaces.place(parent);
        let from = self.radiosity[parent as usize];
        for child in surfaces.children(parent) {
            let place = surfaces.place(child);
            let [x, y] = [0, 1].map(|k| (place.centroid[k] - own.centroid[k]) / own.radius);
            let scale = place.radius / own.radius;
            let gradient = from.gradient.map(|g| g.map(|v| v * scale));
            self.radiosity[child as usize] = Linear { mean: from.at(x, y), gradient };
            self.gathered[child as usize] = Linear::default();
        }
    }

    /// Gathers, pushes and pulls until the solution is settled, beginning with what is dirty.
    ///
    /// A radiosity that would change by no more than the residual stays as it is, so that whoever
    /// gathered it has gathered its present value: nothing drifts, however often this is called.
    pub fn solve(&mut self, surfaces: &impl Surfaces, links: &Links, dirty: Dirty, stop: Stop) {
        let mut work = Work::new(surfaces, dirty);
        let facets = surfaces.facets().iter().map(|f| f.0 as usize + 1).max().unwrap_or(0);
        self.kept.resize(facets, 0.0);
        (self.sweeps, self.gathers, self.residual) = (0, 0, 0.0);
        loop {
            let mean = self.mean(surfaces);
            let keep = match stop {
                Stop::Sweeps(_) => 0.0,
                Stop::Residual(limit) => (limit * mean) as f32,
            };
            // What was little beside a brighter scene may be too much beside this one.
            work.settle_too(
                surfaces.facets().iter().map(|f| f.0).filter(|&f| self.kept[f as usize] > keep),
            );
            self.gather(surfaces, links, &work);
            let settled = self.settle(surfaces, &work, keep);
            for (&facet, s) in work.facets.iter().zip(&settled) {
                self.kept[facet as usize] = s.kept;
            }
            // Of all facets, not only of those at work: the bound is one for the whole solution.
            let largest = self.kept.iter().copied().fold(0.0, f32::max);
            self.residual = if mean > 0.0 { f64::from(largest) / mean } else { 0.0 };
            self.sweeps += 1;
            let done = match stop {
                Stop::Sweeps(count) => self.sweeps >= count,
                Stop::Residual(_) => settled.iter().all(|s| s.changed.is_empty()),
            };
            for &(id, value) in settled.iter().flat_map(|s| &s.changed) {
                self.radiosity[id as usize] = value;
            }
            if done || self.sweeps >= SWEEPS_MAX {
                return;
            }
            work.follow(surfaces, links, &settled);
        }
    }

    /// Area-weighted mean radiosity of all surfaces and channels.
    fn mean(&self, surfaces: &impl Surfaces) -> f64 {
        let (mut flux, mut area) = (0.0, 0.0);
        for facet in surfaces.facets() {
            let a = surfaces.area_m2(facet.0);
            let b: f32 = self.radiosity[facet.0 as usize].mean.iter().sum();
            flux += a * f64::from(b) / 3.0;
            area += a;
        }
        if area > 0.0 { flux / area } else { 0.0 }
    }

    fn gather(&mut self, surfaces: &impl Surfaces, links: &Links, work: &Work) {
        let radiosity = &self.radiosity;
        let one = |id: u32| match links.of(id) {
            [] => Linear::default(),
            list => gather_one(radiosity, list, 1.0 / surfaces.place(id).radius),
        };
        match &work.receivers {
            None => {
                self.gathers += self.gathered.len() as u64;
                self.gathered.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
                    for (k, h) in out.iter_mut().enumerate() {
                        *h = one((chunk * CHUNK + k) as u32);
                    }
                });
            }
            Some(receivers) => {
                self.gathers += receivers.len() as u64;
                let gathered: Vec<Linear> =
                    receivers.par_iter().with_min_len(CHUNK).map(|&id| one(id)).collect();
                for (&id, h) in receivers.iter().zip(gathered) {
                    self.gathered[id as usize] = h;
                }
            }
        }
    }

    /// New radiosities of all elements of the facets concerned, as far as they differ.
    fn settle(&self, surfaces: &impl Surfaces, work: &Work, keep: f32) -> Vec<Settled> {
        let facet = |&facet: &u32| {
            let mut out = Settled { changed: Vec::new(), kept: 0.0 };
            let lit = surfaces.lit(facet);
            let place = surfaces.place(facet);
            let below = Below { solution: self, surfaces, lit, keep };
            below.settle(facet, &place, &Linear::default(), &mut out);
            out
        };
        work.facets.par_iter().map(facet).collect()
    }

    /// Radiosity of an element: mean, and gradient per radius, W/m2.
    #[inline]
    pub fn linear_radiosity(&self, id: u32) -> &Linear {
        &self.radiosity[id as usize]
    }

    /// Radiosity of an element, W/m2.
    #[inline]
    pub fn radiosity(&self, id: u32) -> [f32; 3] {
        self.radiosity[id as usize].mean
    }

    /// Calls `visit` with the irradiance (mean, and gradient per metre) of each leaf of a facet,
    /// children in order.
    pub fn irradiances(
        &self,
        surfaces: &impl Surfaces,
        facet: u32,
        visit: &mut dyn FnMut(u32, &Linear),
    ) {
        let own = |id: u32| self.gathered[id as usize];
        push(surfaces, (facet, &surfaces.place(facet)), &Linear::default(), &own, visit);
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> u64 {
        ((self.radiosity.capacity() + self.gathered.capacity()) * size_of::<Linear>()
            + self.kept.capacity() * size_of::<f32>()) as u64
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

/// What one sweep has to do.
struct Work {
    /// Receivers to be gathered; `None` for all.
    receivers: Option<Vec<u32>>,
    facets: Vec<u32>,
    /// Receivers marked for the next sweep, a bit each.
    marks: Vec<u64>,
}

impl Work {
    fn new(surfaces: &impl Surfaces, dirty: Dirty) -> Work {
        let mut work =
            Work { receivers: None, facets: Vec::new(), marks: vec![0; surfaces.len() / 64 + 1] };
        match dirty {
            Dirty::All => work.all(surfaces),
            Dirty::Some { receivers, facets } => work.some(surfaces, receivers, facets),
        }
        work
    }

    fn all(&mut self, surfaces: &impl Surfaces) {
        self.receivers = None;
        self.facets = surfaces.facets().iter().map(|f| f.0).collect();
    }

    /// Adds facets to be settled, though nothing new arrives there.
    fn settle_too(&mut self, facets: impl Iterator<Item = u32>) {
        if self.receivers.is_none() {
            return;
        }
        let before = self.facets.len();
        self.facets.extend(facets);
        if self.facets.len() > before {
            self.facets.sort_unstable();
            self.facets.dedup();
        }
    }

    fn some(&mut self, surfaces: &impl Surfaces, receivers: Vec<u32>, mut facets: Vec<u32>) {
        if receivers.len() > surfaces.len() / MANY {
            return self.all(surfaces);
        }
        facets.extend(receivers.iter().map(|&id| surfaces.facet_of(id)));
        facets.sort_unstable();
        facets.dedup();
        self.facets = facets;
        self.receivers = Some(receivers);
    }

    /// The next sweep gathers whoever has a link from an element that changed.
    fn follow(&mut self, surfaces: &impl Surfaces, links: &Links, settled: &[Settled]) {
        let changed: usize = settled.iter().map(|s| s.changed.len()).sum();
        if changed > surfaces.len() / MANY {
            return self.all(surfaces);
        }
        let mut receivers = Vec::new();
        // Whoever an element gathers from gathers from it.
        for &(id, _) in settled.iter().flat_map(|s| &s.changed) {
            for link in links.of(id) {
                let bit = 1 << (link.source % 64);
                let word = &mut self.marks[link.source as usize / 64];
                if *word & bit == 0 {
                    *word |= bit;
                    receivers.push(link.source);
                }
            }
        }
        receivers.sort_unstable();
        for &id in &receivers {
            self.marks[id as usize / 64] = 0;
        }
        // Sources that are no surfaces receive nothing: they have no links of their own.
        receivers.retain(|&id| !links.of(id).is_empty());
        self.some(surfaces, receivers, Vec::new());
    }
}

/// What pushing and pulling through one facet found.
struct Settled {
    /// Elements with their new radiosities.
    changed: Vec<(u32, Linear)>,
    /// Largest change that was not made.
    kept: f32,
}

/// One facet being settled.
struct Below<'a, S> {
    solution: &'a Radiosity,
    surfaces: &'a S,
    lit: &'a Lit,
    keep: f32,
}

impl<S: Surfaces> Below<'_, S> {
    /// Pushes irradiance down and pulls radiosity up; returns the new radiosity of `id`.
    fn settle(&self, id: u32, place: &Place, inherited: &Linear, out: &mut Settled) -> Linear {
        let h = self.solution.gathered[id as usize].plus(inherited);
        let children = self.surfaces.children(id);
        let b = if children.is_empty() {
            self.reflect(&h, place.radius)
        } else {
            let mut fit = Fit::default();
            for child in children {
                let at = self.surfaces.place(child);
                let b = self.settle(child, &at, &h.about(place, &at), out);
                fit.add(self.surfaces.area_m2(child), place, &at, &b);
            }
            fit.linear(place.radius)
        };
        let difference = b.difference(&self.solution.radiosity[id as usize]);
        if difference > self.keep {
            out.changed.push((id, b));
        } else {
            out.kept = out.kept.max(difference);
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

/// Everything one receiver gathers; in the order of its links.
#[inline]
fn gather_one(radiosity: &[Linear], list: &[Link], per_radius: f32) -> Linear {
    let mut out = Linear::default();
    let [mut gx, mut gy] = [[0.0_f32; 3]; 2];
    for link in list {
        let b = &radiosity[link.source as usize];
        let [su, sv] = link.source_gradient();
        let [ru, rv] = link.receiver_gradient();
        let moment = SOURCE_MOMENT * link.coupling;
        for c in 0..3 {
            let mean = link.coupling * b.mean[c];
            let sent = mean + moment * (su * b.gradient[0][c] + sv * b.gradient[1][c]);
            out.mean[c] += sent;
            gx[c] += ru * mean;
            gy[c] += rv * mean;
        }
    }
    out.gradient = [gx.map(|g| g * per_radius), gy.map(|g| g * per_radius)];
    out
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
        b.solve(&plates, &links, Dirty::All, Stop::Residual(1e-7));
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
        warm.solve(&plates, &links, Dirty::All, Stop::Residual(1e-7));
        links.set(2, Link { source: 0, coupling: 0.25, ..Link::default() });
        let dirty = Dirty::Some { receivers: vec![2], facets: vec![] };
        warm.solve(&plates, &links, dirty, Stop::Residual(1e-7));
        let mut cold = Radiosity::new(&plates);
        cold.solve(&plates, &links, Dirty::All, Stop::Residual(1e-7));
        for id in 0..4 {
            for (one, two) in warm.radiosity(id).iter().zip(cold.radiosity(id)) {
                assert!((one - two).abs() < 1e-4, "{id} {one} {two}");
            }
        }
        // And nothing is done where nothing changed.
        let dirty = Dirty::Some { receivers: vec![], facets: vec![] };
        warm.solve(&plates, &links, dirty, Stop::Residual(1e-7));
        assert_eq!((warm.sweeps, warm.gathers), (1, 0));
    }
}
