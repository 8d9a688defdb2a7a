//! The iteration B = M + rho H over the hierarchy: sweeps over batches of facets until the residual is small.

use fearless_simd::dispatch;
use rayon::prelude::*;

use super::{OverGroups, Radiosity};
use crate::element::ElementId;
use crate::solver::dirty_path::{Batch, DirtyPath};
use crate::solver::field::{Linear, grow};
use crate::solver::gather::gather_some;
use crate::solver::groups::Arriving;
use crate::solver::jump::Jump;
use crate::solver::links::Links;
use crate::solver::settle::{Below, IrradianceChange, Settled};
use crate::solver::surfaces::{FacetMaterial, Surfaces, for_each_below};
use crate::solver::trend::{Start, Trend};
use crate::solver::tuning::{
    FURTHER_MAX, PENDING_SHARE, SKIPPED_MAX, SWEEPS_MAX, UNBALANCED_MAX, UNKNOWN_MAX,
};
use crate::solver::work::{Dirty, Work};
use crate::transport;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// As `Residual`, but given up, with an infinite residual, once the mean radiosity passes a bound
    /// that no scene can: for links that are not quite true to any.
    Bounded {
        /// The residual, relative to the mean radiosity.
        residual: f64,
        /// The bound, W/m2.
        mean_w_m2: f64,
    },
    /// After exactly this many sweeps.
    Sweeps(u32),
    /// When no element's radiosity would change by more than this, relative to the mean radiosity.
    Residual(f64),
}

impl Stop {
    /// Change of a radiosity that is too small to be followed, at a mean radiosity; W/m2.
    fn limit_w_m2(&self, mean_w_m2: f64) -> f32 {
        match *self {
            Stop::Sweeps(_) => 0.0,
            Stop::Residual(limit) | Stop::Bounded { residual: limit, .. } => {
                (limit * mean_w_m2) as f32
            }
        }
    }

    fn is_by_residual(&self) -> bool {
        !matches!(self, Stop::Sweeps(_))
    }
}

/// Fluxes of a solution, W.
struct Fluxes {
    /// A B.
    sent: f64,
    /// A M or A (1 - rho) H, whichever is larger.
    passed: f64,
}

/// A sweep that is done.
#[derive(Clone, Copy)]
struct Swept {
    /// Mean radiosity after it, W/m2.
    mean_w_m2: f64,
    /// Change that counted as little before it, and counts so now; W/m2.
    before: f32,
    limit: f32,
}

/// Receivers gathered by one task.
pub(super) const CHUNK: usize = 256;

impl Radiosity {
    /// Whether the last solve came to its end.
    pub fn has_settled(&self) -> bool {
        self.residual.is_finite() && self.sweeps < SWEEPS_MAX
    }

    /// Exitances alone; punctual lights stay as they are.
    pub(super) fn start_anew(&mut self, surfaces: &impl Surfaces) {
        for facet in surfaces.facets() {
            let mean = surfaces.material(facet.0).exitance;
            for_each_below(surfaces, facet.0, &mut |id| {
                self.radiosity.set(id, &Linear { mean, ..Linear::default() });
                self.gathered.set(id, &Linear::default());
            });
        }
        self.over_groups = OverGroups::default();
        self.forget(surfaces);
        self.sweeps = 0;
    }

    /// Forgets what was left out and how the solution changed: the next solve gathers everything.
    pub(super) fn forget(&mut self, surfaces: &impl Surfaces) {
        self.pending.fill(0.0);
        // A solve that changed most of the scene has given it back.
        self.deferred.clear();
        self.deferred.resize(self.pending.len().max(surfaces.len()), 0.0);
        self.trend = Trend::default();
        (self.skipped, self.skipped_in_full_sweep) = (0.0, 0.0);
    }

    /// Gathers, pushes and pulls until the solution is settled, beginning with what is dirty.
    ///
    /// Facets go in batches, each with what the batches before it have found in the same sweep
    /// (Gauss-Seidel), and in parallel within. Sweeps over everything go on until no radiosity
    /// changes by more than the residual. Sweeps over a part follow only larger changes: a radiosity
    /// that would change by less stays as it is, so that whoever gathered it has gathered its present
    /// value; a receiver gathers anew once the changes of its sources may have added up to half
    /// the residual since it last did; and what it gathers is pushed down once that, with what was not
    /// pushed down before, may change a radiosity by more than the residual. So nothing drifts, however
    /// often this is called.
    ///
    /// Where the last solve changed most of the scene, this one begins with all of it, as much further along as the last
    /// change suggests. Where residuals, small as they are, sum to more of the light than may be unaccounted for, as among white
    /// surfaces, everything is gathered until they no longer do.
    pub fn solve(&mut self, surfaces: &impl Surfaces, links: &Links, dirty: Dirty, stop: Stop) {
        let (is_first, mut further) = (self.sweeps == 0, 0);
        let mut work = Work::new(surfaces, dirty);
        let mut jump = Jump::default();
        (self.sweeps, self.gathers) = (0, 0);
        let mut last_mean = self.mean_w_m2(surfaces);
        let mut limit = stop.limit_w_m2(last_mean);
        if self.trend.is_wide {
            // Nothing is known of what is deferred.
            work.start_all(surfaces);
            grow(&mut self.deferred, self.pending.len());
        }
        let start = (stop.is_by_residual() && self.trend.is_wide)
            .then(|| self.trend.follow(surfaces, &mut self.radiosity));
        let mut is_wide = work.all && !is_first;
        let mut arriving = self.mark_over_groups(surfaces, &mut work, limit);
        loop {
            // What was little beside a brighter scene is too much beside this one.
            if self.skipped > SKIPPED_MAX * limit && !work.all && stop.is_by_residual() {
                work.start_all(surfaces);
            }
            let all = work.all;
            is_wide |= all && !is_first && further == 0;
            if all {
                jump.before(&self.radiosity);
            }
            let over_groups = arriving.take().or_else(|| self.arriving(surfaces));
            let small = self.sweep(surfaces, links, over_groups.as_ref(), &mut work, limit);
            self.sweeps += 1;
            (self.skipped_in_full_sweep, self.skipped) = match all {
                true => (small, 0.0),
                false => (self.skipped_in_full_sweep, self.skipped.max(limit)),
            };
            let mean = self.mean_w_m2(surfaces);
            let swept = Swept { mean_w_m2: mean, before: limit, limit: stop.limit_w_m2(mean) };
            limit = swept.limit;
            if self.is_done(surfaces, links, stop, &mut work, swept, &mut arriving) {
                let change = all.then_some(mean - last_mean);
                if further == FURTHER_MAX || !self.may_be_unbalanced(surfaces, stop, change) {
                    break;
                }
                further += 1;
                work.start_all(surfaces);
            }
            if self.sweeps >= SWEEPS_MAX {
                self.give_up((mean - last_mean).abs() / mean);
                break;
            }
            last_mean = mean;
            if all && work.all && stop.is_by_residual() {
                jump.after(&mut self.radiosity);
            }
        }
        self.learn(surfaces, start.as_ref(), is_wide, limit);
    }

    /// Remembers for the next solve how far this one led from its start, where it had one, or whether it changed most of the
    /// scene.
    fn learn(
        &mut self,
        surfaces: &impl Surfaces,
        start: Option<&Start>,
        is_wide: bool,
        limit: f32,
    ) {
        match start {
            Some(start) => self.trend.learn(surfaces, start, &self.radiosity, limit),
            None => self.trend.is_wide = is_wide,
        }
        if self.trend.is_wide {
            self.deferred = Vec::new();
        }
    }

    /// Ends a solve that did not settle; the relative change of the last sweep adds to the residual.
    fn give_up(&mut self, change: f64) {
        self.residual = if change.is_finite() { self.residual + change } else { f64::INFINITY };
    }

    /// Whether more of the light than `UNBALANCED_MAX` is, or may be, unaccounted for: by how much a sweep over everything
    /// changed the mean radiosity (W/m2), or, after one over a part, by what residuals may sum to.
    fn may_be_unbalanced(
        &self,
        surfaces: &impl Surfaces,
        stop: Stop,
        change_w_m2: Option<f64>,
    ) -> bool {
        if !stop.is_by_residual() || !self.residual.is_finite() {
            return false;
        }
        let Fluxes { sent, passed } = self.fluxes(surfaces);
        match change_w_m2 {
            Some(change) => {
                change.abs() * sent > UNBALANCED_MAX * passed * self.mean_w_m2(surfaces)
            }
            None => self.residual * sent > UNKNOWN_MAX * passed,
        }
    }

    /// Fluxes of a solution over all surfaces and channels, with irradiances as they were gathered.
    fn fluxes(&self, surfaces: &impl Surfaces) -> Fluxes {
        let of_facet = |facet: &ElementId| {
            let FacetMaterial { reflectance, exitance } = surfaces.material(facet.0);
            // Lines over an element add nothing to the flux on it.
            let mut arriving = [0.0; 3];
            for_each_below(surfaces, facet.0, &mut |id| {
                let (area, h) = (surfaces.area_m2(id), self.gathered.get(id).mean);
                (0..3).for_each(|c| arriving[c] += area * f64::from(h[c]));
            });
            let (area, b) = (surfaces.area_m2(facet.0), self.radiosity.get(facet.0).mean);
            let mut out = [0.0; 3];
            for c in 0..3 {
                let absorbed = (1.0 - f64::from(reflectance[c])) * arriving[c];
                let fluxes = [f64::from(b[c]) * area, f64::from(exitance[c]) * area, absorbed];
                (0..3).for_each(|k| out[k] += fluxes[k]);
            }
            out
        };
        let of_facets: Vec<[f64; 3]> = surfaces.facets().par_iter().map(of_facet).collect();
        let sum = |k: usize| of_facets.iter().map(|fluxes| fluxes[k]).sum::<f64>();
        Fluxes { sent: sum(0), passed: sum(1).max(sum(2)) }
    }

    /// Whether a sweep was the last one; if not, what is left is marked.
    fn is_done<S: Surfaces>(
        &mut self,
        surfaces: &S,
        links: &Links,
        stop: Stop,
        work: &mut Work,
        swept: Swept,
        arriving: &mut Option<Arriving>,
    ) -> bool {
        let Swept { mean_w_m2: mean, before, limit } = swept;
        // A radiosity stays, what its ancestors gathered is deferred for it, and they may gather other values.
        let gathered = if surfaces.groups().is_some() { 2.0 } else { 1.0 };
        let left =
            self.skipped_in_full_sweep + self.skipped * (1.0 + 1.0 + gathered * PENDING_SHARE);
        self.residual = if mean > 0.0 { f64::from(left) / mean } else { 0.0 };
        match stop {
            Stop::Sweeps(count) => self.sweeps >= count,
            Stop::Bounded { mean_w_m2, .. } if mean > mean_w_m2 || mean.is_nan() => {
                self.residual = f64::INFINITY;
                true
            }
            // Where the sweep itself made the scene much darker, what it left is no longer little.
            _ if before > SKIPPED_MAX * limit => {
                work.start_all(surfaces);
                false
            }
            _ => {
                let is_left = work.is_left(surfaces, links, limit, &mut self.pending);
                *arriving = self.mark_over_groups(surfaces, work, limit);
                !is_left && !work.waits()
            }
        }
    }

    /// One pass over all batches; returns the largest change that is too small to be followed.
    fn sweep(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        arriving: Option<&Arriving>,
        work: &mut Work,
        limit: f32,
    ) -> f32 {
        let mut small = 0.0_f32;
        work.changed.clear();
        let mut scratch = std::mem::take(&mut work.scratch);
        for batch in 0..work.batches.len() {
            let mut now = work.take(surfaces, batch);
            let most_deferred = if work.all { None } else { Some(limit) };
            let over_groups = |id: u32| Some(surfaces.groups()?.at(arriving?, id));
            let found = &mut scratch.gathered;
            self.gather(surfaces, links, &over_groups, &mut now, most_deferred, found);
            let path = if work.all { None } else { Some(work.path.mark(surfaces, &mut now)) };
            self.settle(surfaces, &now.facets, limit, path, &mut scratch.settled);
            for settled in &scratch.settled[..now.facets.len()] {
                small = small.max(settled.small);
                for &(id, deferred) in &settled.deferred {
                    self.deferred[id as usize] = deferred;
                }
                for (id, value, difference) in &settled.changed {
                    self.radiosity.set(*id, value);
                    if *difference > limit {
                        work.changed.push((*id, *difference));
                    }
                    if !work.all {
                        let pending = &mut self.pending;
                        work.mark_neighbours(surfaces, links, *id, *difference, limit, pending);
                    }
                }
            }
            if work.all {
                std::mem::swap(&mut work.batches[batch], &mut now);
            } else {
                work.path.clear(surfaces, &now);
            }
        }
        work.scratch = scratch;
        small
    }

    /// What arrives over groups as surfaces are now; `None` where there are none.
    fn arriving(&self, surfaces: &impl Surfaces) -> Option<Arriving> {
        let moment = surfaces.source_moment();
        Some(surfaces.groups()?.arriving(&|id| self.radiosity.get(id), moment))
    }

    /// Lets those wait to be gathered to whom something else arrives over groups than they gathered, as soon as the
    /// difference is as large as what may add up of other sources. What arrives; nothing where everything is gathered anyway.
    fn mark_over_groups(
        &mut self,
        surfaces: &impl Surfaces,
        work: &mut Work,
        limit: f32,
    ) -> Option<Arriving> {
        if work.all || (surfaces.groups().is_none() && self.over_groups.is_empty()) {
            return None;
        }
        let arriving = self.arriving(surfaces);
        let now = |id: u32| match (surfaces.groups(), &arriving) {
            (Some(groups), Some(arriving)) => groups.at(arriving, id),
            _ => Linear::default(),
        };
        let differs = |&id: &u32| {
            let change = now(id).minus(&self.over_groups.get(id));
            change != Linear::default()
                && surfaces.is_surface(id)
                && change.most(surfaces.place(id).radius) > limit * PENDING_SHARE
        };
        let ids = (0..surfaces.len() as u32).into_par_iter();
        let found: Vec<u32> = ids.with_min_len(CHUNK).filter(differs).collect();
        found.into_iter().for_each(|id| work.mark(surfaces, id));
        arriving
    }

    /// Gathers the receivers of a batch anew: over links, and what comes over groups. Those below which no more than
    /// `most_deferred` is deferred after that are left out of it.
    fn gather(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        over_groups: &dyn Fn(u32) -> Option<Linear>,
        batch: &mut Batch,
        most_deferred: Option<f32>,
        found: &mut Vec<Linear>,
    ) {
        let receivers = &mut batch.receivers;
        self.gathers += receivers.len() as u64;
        receivers.iter().for_each(|&id| self.pending[id as usize] = 0.0);
        let Radiosity { radiosity, gathered, over_groups: kept, deferred, constant, .. } = self;
        let linear = !*constant;
        found.resize(found.len().max(receivers.len()), Linear::default());
        let level = transport::Simd::detect().level();
        let gather = |ids: &[u32], out: &mut [Linear]| {
            dispatch!(level, simd => gather_some(simd, radiosity, links, surfaces, ids, linear, out));
        };
        if receivers.len() <= CHUNK {
            gather(receivers, found);
        } else {
            let chunks = receivers.par_chunks(CHUNK).zip(found.par_chunks_mut(CHUNK));
            chunks.for_each(|(ids, out)| gather(ids, out));
        }
        let mut next = found.iter();
        receivers.retain(|&id| {
            let own = next.next().expect("one for each receiver");
            let h = &match over_groups(id) {
                Some(groups) => {
                    kept.set(id, &groups);
                    own.plus(&groups)
                }
                None => {
                    kept.set(id, &Linear::default());
                    *own
                }
            };
            let Some(most) = most_deferred else {
                gathered.set(id, h);
                deferred[id as usize] = 0.0;
                return true;
            };
            let change = h.minus(&gathered.get(id));
            let material = surfaces.material(surfaces.facet_of(id));
            let news = material.most(&change, surfaces.place(id).radius);
            gathered.set(id, h);
            let waits = deferred[id as usize] + news <= most;
            if waits {
                defer(deferred, surfaces, id, news);
            } else {
                batch.changes.push(change);
            }
            !waits
        });
    }

    /// New radiosities of all elements of some facets, as far as they differ.
    fn settle(
        &self,
        surfaces: &impl Surfaces,
        facets: &[u32],
        limit: f32,
        path: Option<&DirtyPath>,
        settled: &mut Vec<Settled>,
    ) {
        settled.resize_with(settled.len().max(facets.len()), Settled::default);
        let facet = |(&facet, out): (&u32, &mut Settled)| {
            out.changed.clear();
            out.deferred.clear();
            out.small = 0.0;
            let material = surfaces.material(facet);
            let place = surfaces.place(facet);
            let below = Below {
                radiosity: &self.radiosity,
                gathered: &self.gathered,
                deferred: &self.deferred,
                factors: &self.scaling.factors,
                levels: self.levels.all(),
                is_symmetric: self.levels.are_symmetric(),
                surfaces,
                material,
                limit,
                path,
            };
            below.settle(facet, &place, &Linear::default(), &IrradianceChange::default(), out);
        };
        if facets.len() == 1 {
            facet((&facets[0], &mut settled[0]));
        } else {
            facets.par_iter().zip(settled).for_each(facet);
        }
    }
}

/// Adds `change` to the deferred error of an element and of those above it.
fn defer(deferred: &mut [f32], surfaces: &impl Surfaces, id: u32, change: f32) {
    let mut at = Some((id, deferred[id as usize] + change));
    while let Some((id, wanted)) = at {
        let before = std::mem::replace(&mut deferred[id as usize], wanted);
        at = surfaces.parent(id).and_then(|parent| {
            let siblings = surfaces.children(parent).filter(|&child| child != id);
            let others = siblings.map(|child| deferred[child as usize]).fold(0.0, f32::max);
            let own = (deferred[parent as usize] - others.max(before)).max(0.0);
            let wanted = own + others.max(wanted);
            (wanted > deferred[parent as usize]).then_some((parent, wanted))
        });
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use proptest::prelude::*;

    use crate::element::ElementId;
    use crate::solver::radiosity::toy::{Toy, plates, set, set_sloping};
    use crate::solver::{FacetMaterial, GroupEnd, GroupLink, GroupLinks, Place, PlacedLinks};

    use super::*;

    const STOP: Stop = Stop::Residual(1e-7);

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
    fn a_lamp_that_goes_out_leaves_no_glow_where_it_was_little() {
        let (plates, _) = plates();
        let mut links = Links::default();
        links.extend(64);
        for (receiver, source, coupling) in [(0, 4, 1.0), (2, 0, 1e-5), (3, 0, 1e-5)] {
            set(&mut links, receiver, source, coupling);
        }
        let mut b = Radiosity::new(&plates);
        b.set(4, [1e6; 3]);
        b.solve(&plates, &links, Dirty::All, Stop::Residual(1e-3));
        assert!(b.radiosity(2)[0] > 3.0);
        set(&mut links, 0, 4, 0.0);
        let dirty = Dirty::Some { receivers: vec![0], parents: vec![] };
        b.solve(&plates, &links, dirty, Stop::Residual(1e-3));
        for id in 0..4 {
            assert!((b.radiosity(id)[0] - 1.0).abs() < 0.01, "{id}: {:?}", b.radiosity(id));
        }
        assert!(b.residual <= 3e-3, "{}", b.residual);
    }

    proptest! {
        /// However little changes at a time, at whichever level, it does not add up to anything that was left out.
        #[test]
        fn little_changes_do_not_add_up(
            steps in prop::collection::vec((0..4_usize, -5e-4..1e-3_f32, -9..10_i8), 1..200)
        ) {
            let lamp = FacetMaterial { reflectance: [0.3; 3], exitance: [1.0, 1.0, 1.0] };
            let plate = FacetMaterial { reflectance: [0.5, 0.9, 0.1], exitance: [0.0; 3] };
            let at = [(0.0, 1.0), (0.0, 1.0), (-0.25, 0.5), (0.25, 0.5), (-0.375, 0.25), (-0.125, 0.25)];
            let (lit, facets) = ([lamp, plate], [ElementId(0), ElementId(1)]);
            let tree = Toy { lit, facets, at: at.to_vec(), quarters: true };
            let mut links = Links::default();
            links.extend(64);
            let receivers = [1, 2, 3, 4];
            let mut couplings = [(0.1_f32, 0_i8); 4];
            let both = |links: &mut Links, k: usize, (coupling, slope): (f32, i8)| {
                set_sloping(links, receivers[k], 0, coupling, slope);
                set(links, 0, receivers[k], coupling * tree.area_m2(receivers[k]) as f32);
            };
            (0..4).for_each(|k| both(&mut links, k, couplings[k]));
            let stop = Stop::Residual(2e-3);
            let mut warm = Radiosity::new(&tree);
            warm.solve(&tree, &links, Dirty::All, stop);
            for (k, step, lean) in steps {
                let (coupling, slope) = couplings[k];
                couplings[k] = ((coupling + step).max(1e-3), (slope + lean).clamp(-90, 90));
                both(&mut links, k, couplings[k]);
                let dirty = Dirty::Some { receivers: vec![0, receivers[k]], parents: vec![] };
                warm.solve(&tree, &links, dirty, stop);
                let mut cold = Radiosity::new(&tree);
                cold.solve(&tree, &links, Dirty::All, Stop::Residual(1e-7));
                let mean = cold.mean_w_m2(&tree);
                for id in 0..6 {
                    for (one, two) in warm.radiosity(id).iter().zip(cold.radiosity(id)) {
                        let off = f64::from((one - two).abs()) / mean;
                        prop_assert!(off <= 1.1 * warm.residual, "{id}: {off} {}", warm.residual);
                    }
                }
            }
        }
    }

    #[test]
    fn a_link_that_changes_is_followed_through_the_scene() {
        let (plates, mut links) = plates();
        let mut warm = Radiosity::new(&plates);
        warm.solve(&plates, &links, Dirty::All, STOP);
        set(&mut links, 2, 0, 0.25);
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

    /// A toy with links of groups.
    struct Grouped<'a>(&'a Toy, Option<GroupLinks>);

    impl Surfaces for Grouped<'_> {
        fn len(&self) -> usize {
            self.0.len()
        }
        fn facets(&self) -> &[ElementId] {
            self.0.facets()
        }
        fn facet_of(&self, id: u32) -> u32 {
            self.0.facet_of(id)
        }
        fn parent(&self, id: u32) -> Option<u32> {
            self.0.parent(id)
        }
        fn children(&self, id: u32) -> Range<u32> {
            self.0.children(id)
        }
        fn area_m2(&self, id: u32) -> f64 {
            self.0.area_m2(id)
        }
        fn place(&self, id: u32) -> Place {
            self.0.place(id)
        }
        fn material(&self, facet: u32) -> &FacetMaterial {
            self.0.material(facet)
        }
        fn groups(&self) -> Option<&GroupLinks> {
            self.1.as_ref()
        }
    }

    /// The first plate as a group of one facet, linked with the lower half of the second.
    fn one_group_link(coupling: f32) -> Option<GroupLinks> {
        let group = GroupEnd::Group { facets: 0..1, first: 0 };
        let (mean, gradient) = (1.0, [0.0; 2]);
        let half = GroupEnd::Element { id: 2, area_m2: 0.5, radius: 0.25, mean, gradient };
        let link = GroupLink { ends: [group, half], coupling, by_facets: false };
        let placed = PlacedLinks { links: vec![link], ids: vec![[6, 2]], factors: vec![1.0] };
        let roots = std::iter::once(0..1).collect();
        (coupling > 0.0).then(|| GroupLinks::new(vec![(0, 1.0)], roots, placed, 1.0 / 3.0))
    }

    #[test]
    fn what_comes_over_groups_is_followed_when_it_changes_and_when_it_ends() {
        let (plates, links) = plates();
        let mut warm = Radiosity::new(&plates);
        for (k, coupling) in [0.2, 0.1, 0.3, 0.0, 0.2].into_iter().enumerate() {
            let now = Grouped(&plates, one_group_link(coupling));
            let dirty = match k {
                0 => Dirty::All,
                _ => Dirty::Some { receivers: vec![], parents: vec![] },
            };
            warm.solve(&now, &links, dirty, STOP);
            let mut cold = Radiosity::new(&now);
            cold.solve(&now, &links, Dirty::All, STOP);
            for id in 0..4 {
                for (one, two) in warm.radiosity(id).iter().zip(cold.radiosity(id)) {
                    assert!((one - two).abs() < 1e-4 * two, "{coupling}: {id} {one} {two}");
                }
            }
        }
    }
}
