//! The iteration B = M + rho H over the hierarchy: sweeps over batches of facets until the residual is small.

use fearless_simd::dispatch;
use rayon::prelude::*;

use super::levels::Levels;
use super::scaling::{CLOSE, RowScaling, most, pull};
use super::{OverGroups, Radiosity};
use crate::element::ElementId;
use crate::solver::dirty_path::{Batch, DirtyPath};
use crate::solver::field::{Linear, grow};
use crate::solver::gather::gather_some;
use crate::solver::groups::Arriving;
use crate::solver::jump::Jump;
use crate::solver::links::Links;
use crate::solver::settle::{Below, IrradianceChange, Settled, reflected};
use crate::solver::surfaces::{FacetMaterial, Surfaces, for_each_below};
use crate::solver::trend::{Start, Trend};
use crate::solver::tuning::{
    ASTRAY_MAX, COARSE_MADE_MAX, FURTHER_MAX, GAIN_MAX, GAIN_SURE, LEVELLED_ASTRAY_MAX, LOST_MAX,
    PENDING_SHARE, SCALED_RESIDUAL, SKIPPED_MAX, SWEEPS_MAX, UNBALANCED_MAX, UNKNOWN_MAX, WHITE,
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

/// What a solution has to keep, for [`Radiosity::solve_bounded`].
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Residual of a solution that begins with the last one, relative to the mean radiosity.
    pub residual: f64,
    /// Residual of one that begins with nothing.
    pub from_nothing: f64,
    /// Mean radiosity that no solution reaches, W/m2.
    pub mean_w_m2: f64,
    /// Whether rows of leaves are off by errors of links alone; with the paper's oracle they are off by more.
    pub rows_are_close: bool,
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

/// The solution of a frame that keeps light best, of those that keep it well.
#[derive(Default)]
struct Best {
    /// Light made or lost, over what is emitted.
    share: f64,
    light: Option<Radiosity>,
}

impl Best {
    /// Takes a solution in, by the `share` of light that it makes or loses; whether none is needed beyond it.
    fn settles_for(&mut self, light: &Radiosity, share: f64) -> bool {
        let is_better = share <= ASTRAY_MAX && (self.light.is_none() || share < self.share);
        let is_enough = share <= LEVELLED_ASTRAY_MAX;
        if is_better && !is_enough {
            *self = Best { share, light: Some(light.clone()) };
        }
        is_enough
    }
}

/// Receivers gathered by one task.
pub(super) const CHUNK: usize = 256;

impl Radiosity {
    /// [`solve`](Radiosity::solve) within bounds, whatever the links. Among white surfaces leaves are levelled (`Levels`); where rows of leaves that sum to more than 1 might make light of
    /// nothing, from nothing; if it does not settle so or light is made, with symmetric levels; then with factors of leaves (`RowScaling`),
    /// with which no row does; and if lines grow even so, with constant elements and factors that lose light.
    pub fn solve_bounded(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        dirty: Dirty,
        bounds: Bounds,
    ) {
        let Bounds { residual, from_nothing, mean_w_m2, rows_are_close } = bounds;
        let stop = Stop::Bounded { residual, mean_w_m2 };
        if !self.has_settled() {
            self.start_anew(surfaces);
        }
        let was_scaled =
            !std::mem::take(&mut self.scaling).is_none() || self.levels.are_symmetric();
        self.constant = false;
        let rows = is_white(surfaces).then(|| RowScaling::none(surfaces, links, true));
        let dirty = self.level(surfaces, links, dirty, rows.as_ref().filter(|_| rows_are_close));
        let gain = if rows.is_some() { RowScaling::gain(surfaces, links) } else { 0.0 };
        let looked_at = rows.as_ref().filter(|_| rows_are_close || gain > GAIN_SURE);
        let (is_anew, mut grows) = (self.sweeps == 0, false);
        if gain <= GAIN_MAX {
            let dirty = if was_scaled { Dirty::All } else { dirty };
            self.solve(surfaces, links, dirty, stop);
            if self.astray(surfaces, links, looked_at) <= LEVELLED_ASTRAY_MAX {
                return;
            }
            // What grew from nothing would again.
            grows = is_anew && self.residual == f64::INFINITY;
        }
        // Light that hardly loses anything settles slowly: begun as a cold build does, it ends where that ends.
        let stop = Stop::Bounded { residual: SCALED_RESIDUAL * from_nothing, mean_w_m2 };
        let mut best = Best::default();
        if !grows {
            self.start_anew(surfaces);
            self.solve(surfaces, links, Dirty::All, stop);
            let share = self.astray(surfaces, links, looked_at);
            if best.settles_for(self, share) {
                return;
            }
        }
        if !self.levels.is_none() && self.solve_symmetric(surfaces, links, &mut best, stop) {
            return;
        }
        match best.light {
            Some(light) => *self = light,
            None => self.solve_with_factors(surfaces, links, stop),
        }
    }

    /// Solves with symmetric levels, and if too much light is lost or made so, with constant elements; whether that stands.
    fn solve_symmetric(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        best: &mut Best,
        stop: Stop,
    ) -> bool {
        for linear in [true, false] {
            if linear || best.light.is_none() {
                let share = self.solve_symmetric_once(surfaces, links, linear, stop);
                if best.settles_for(self, share) {
                    return true;
                }
            }
        }
        false
    }

    /// Solves with factors of leaves, and if lines reach below zero even so, with constant elements and factors that lose light.
    fn solve_with_factors(&mut self, surfaces: &impl Surfaces, links: &Links, stop: Stop) {
        self.levels = Levels::default();
        for (linear, strict) in [(true, false), (false, false), (false, true)] {
            self.constant = !linear;
            let rows = RowScaling::none(surfaces, links, linear);
            self.scaling = match strict {
                false => rows.found(surfaces, links),
                true => rows.strict(surfaces, links),
            };
            self.start_anew(surfaces);
            self.solve_scaled(surfaces, links, stop);
            if self.has_settled() && self.keeps_light(surfaces, links) {
                return;
            }
        }
    }

    /// Solves from nothing with symmetric levels: rows and columns are scaled by one line a leaf, so that no light is lost or made.
    /// Elements are constant unless `linear`. Light lost or made even so, over what is emitted, 1.
    fn solve_symmetric_once(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        linear: bool,
        stop: Stop,
    ) -> f64 {
        self.constant = !linear;
        let rows = RowScaling::none(surfaces, links, linear);
        let levels = Levels::new(surfaces, links, &rows, &self.radiosity);
        self.levels = levels.made_symmetric(surfaces, links, &rows);
        self.start_anew(surfaces);
        self.solve(surfaces, links, Dirty::All, stop);
        self.set_to_received(surfaces);
        self.astray(surfaces, links, Some(&rows))
    }

    /// Sets the radiosity of leaves to what they emit and reflect, whatever of that counted as sent.
    fn set_to_received(&mut self, surfaces: &impl Surfaces) {
        let moment = surfaces.source_moment();
        let mut own = vec![Linear::default(); surfaces.len()];
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let material = surfaces.material(facet.0);
            self.irradiances(surfaces, facet.0, &mut |leaf, h| {
                own[leaf as usize] = reflected(h, material, &surfaces.place(leaf), moment);
            });
            let leaf = |id: u32, _: &Linear| own[id as usize];
            pull(surfaces, facet.0, &leaf, &mut self.radiosity);
        }
        self.forget(surfaces);
    }

    /// Levels the leaves anew by their rows, or none of them; what is dirty with that.
    fn level(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        dirty: Dirty,
        rows: Option<&RowScaling>,
    ) -> Dirty {
        let levels = rows.map(|rows| Levels::new(surfaces, links, rows, &self.radiosity));
        let before = std::mem::replace(&mut self.levels, levels.unwrap_or_default());
        match (dirty, self.levels.changed_from(&before, surfaces)) {
            (Dirty::Some { receivers, mut parents }, Some(changed)) => {
                parents.extend(changed);
                Dirty::Some { receivers, parents }
            }
            _ => Dirty::All,
        }
    }

    /// Light made or lost over what is emitted, 1: by rows, 0 if none are `looked_at`. Infinite if the solve did not settle or, with the
    /// paper's oracle, if rows make much.
    fn astray(
        &self,
        surfaces: &impl Surfaces,
        links: &Links,
        looked_at: Option<&RowScaling>,
    ) -> f64 {
        match looked_at {
            _ if !self.has_settled() => f64::INFINITY,
            None => 0.0,
            Some(rows) if !self.levels.is_none() => self.astray_of_levels(surfaces, links, rows),
            Some(rows) if self.makes_little(surfaces, links, rows) => 0.0,
            Some(_) => f64::INFINITY,
        }
    }

    /// Whether facets whose rows sum to more than 1 in this light make little of nothing, and all facets together next to nothing.
    fn makes_little(&self, surfaces: &impl Surfaces, links: &Links, rows: &RowScaling) -> bool {
        let mut emitted = self.light_arriving_w(surfaces, links);
        let (mut made, mut of_all) = (0.0, 0.0);
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let exitance = surfaces.material(facet.0).exitance;
            let mut of_facet = 0.0;
            for_each_below(surfaces, facet.0, &mut |leaf| {
                if surfaces.children(leaf).is_empty() {
                    let area = surfaces.area_m2(leaf);
                    let excess = area * (f64::from(rows.rows[leaf as usize].mean) - 1.0);
                    let b = self.radiosity(leaf);
                    for c in 0..3 {
                        of_facet += excess * f64::from(b[c]);
                        emitted += area * f64::from(exitance[c]);
                    }
                }
            });
            made += of_facet.max(0.0);
            of_all += of_facet;
        }
        made.max(of_all) <= COARSE_MADE_MAX * emitted
    }

    /// Of levelled leaves, what escapes of them, and what arrives without being sent, or the other way round, over what is emitted.
    fn astray_of_levels(&self, surfaces: &impl Surfaces, links: &Links, rows: &RowScaling) -> f64 {
        let mut emitted = self.light_arriving_w(surfaces, links);
        let (mut closed, mut unaccounted) = (0.0, emitted);
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let FacetMaterial { exitance, reflectance } = surfaces.material(facet.0);
            self.irradiances(surfaces, facet.0, &mut |leaf, h| {
                let area = surfaces.area_m2(leaf);
                let b = self.radiosity(leaf);
                let carried = self.carried(surfaces, leaf, &rows.rows[leaf as usize]);
                for c in 0..3 {
                    let escapes = area * (f64::from(b[c]) - carried[c]);
                    let absorbed = (1.0 - reflectance[c]) * h.mean[c].max(0.0);
                    emitted += area * f64::from(exitance[c]);
                    unaccounted += area * f64::from(exitance[c] - absorbed) - escapes;
                    closed += if self.levels.is_closed(leaf) { escapes } else { 0.0 };
                }
            });
        }
        match emitted > 0.0 {
            true => closed.abs().max(unaccounted.abs()).max((closed + unaccounted).abs()) / emitted,
            false => 0.0,
        }
    }

    /// Whether surfaces receive of each other what they send, but for `LOST_MAX` of what is emitted: with factors, as lines may
    /// reach below zero.
    fn keeps_light(&self, surfaces: &impl Surfaces, links: &Links) -> bool {
        let (mut sent, mut arriving, mut emitted) = (0.0, 0.0, 0.0);
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let exitance = surfaces.material(facet.0).exitance;
            self.irradiances(surfaces, facet.0, &mut |leaf, h| {
                let area = surfaces.area_m2(leaf);
                let row = f64::from(self.scaling.rows[leaf as usize].mean);
                let b = self.radiosity(leaf);
                for c in 0..3 {
                    sent += area * row * f64::from(b[c]);
                    arriving += area * f64::from(h.mean[c].max(0.0));
                    emitted += area * f64::from(exitance[c]);
                }
            });
        }
        let lights = self.light_arriving_w(surfaces, links);
        (arriving - lights - sent).abs() <= LOST_MAX * (emitted + lights)
    }

    /// Flux that arrives from what is no surface, W.
    fn light_arriving_w(&self, surfaces: &impl Surfaces, links: &Links) -> f64 {
        let mut sum = 0.0;
        for facet in surfaces.facets() {
            for_each_below(surfaces, facet.0, &mut |id| {
                let lights = links.of(id).iter().filter(|link| !surfaces.is_surface(link.source));
                let each = lights.map(|link| {
                    let b = self.radiosity(link.source);
                    f64::from(link.coupling * (b[0] + b[1] + b[2]))
                });
                sum += surfaces.area_m2(id) * each.sum::<f64>();
            });
        }
        sum
    }

    /// Solves with factors, beginning with what surfaces send as it stands.
    fn solve_scaled(&mut self, surfaces: &impl Surfaces, links: &Links, stop: Stop) {
        self.scale_leaves(surfaces, |b, factor| b.times(factor));
        self.forget(surfaces);
        self.solve(surfaces, links, Dirty::All, stop);
        self.scale_leaves(surfaces, |b, factor| b.times(1.0 / factor));
        self.forget(surfaces);
    }

    /// The light that comes straight from what `surfaces` emit and from punctual lights, over the same links and with the same
    /// factors of leaves: what they would receive if they reflected nothing (their reflectance must be 0).
    pub fn of_emission(&self, surfaces: &impl Surfaces, links: &Links) -> Radiosity {
        let mut out = self.clone();
        // Levels leave direct light as it is.
        out.levels = Levels::default();
        out.start_anew(surfaces);
        match out.scaling.is_none() {
            true => out.solve(surfaces, links, Dirty::All, Stop::Sweeps(1)),
            false => out.solve_scaled(surfaces, links, Stop::Sweeps(1)),
        }
        out
    }

    /// Whether the last solve came to its end.
    pub fn has_settled(&self) -> bool {
        self.residual.is_finite() && self.sweeps < SWEEPS_MAX
    }

    /// Exitances alone; punctual lights stay as they are.
    fn start_anew(&mut self, surfaces: &impl Surfaces) {
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
    fn forget(&mut self, surfaces: &impl Surfaces) {
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

/// Whether some surface reflects so much that rows above 1 may make light of nothing, and none so much that no rows are known as
/// well as that.
fn is_white(surfaces: &impl Surfaces) -> bool {
    let all = surfaces.facets().iter().map(|facet| most(surfaces, facet.0));
    (WHITE..1.0 - CLOSE).contains(&all.fold(0.0, f32::max))
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
    use crate::solver::{FacetMaterial, GroupEnd, GroupLink, GroupLinks, Link, Place, PlacedLinks};

    use super::*;

    /// Two facets, the second of which is split in two, and perhaps the first half of it again.
    struct Toy {
        lit: [FacetMaterial; 2],
        facets: [ElementId; 2],
        /// Where elements lie along the first axis, and their areas; a lamp without area is no surface.
        at: Vec<(f32, f64)>,
        quarters: bool,
    }

    impl Surfaces for Toy {
        /// Room for many more, so that two receivers are few.
        fn len(&self) -> usize {
            64
        }
        fn facets(&self) -> &[ElementId] {
            &self.facets
        }
        fn facet_of(&self, id: u32) -> u32 {
            id.min(1)
        }
        fn parent(&self, id: u32) -> Option<u32> {
            (id >= 2).then_some(if id < 4 { 1 } else { 2 })
        }
        fn children(&self, id: u32) -> Range<u32> {
            match id {
                1 => 2..4,
                2 if self.quarters => 4..6,
                _ => 0..0,
            }
        }
        fn area_m2(&self, id: u32) -> f64 {
            self.at[id as usize].1
        }
        fn place(&self, id: u32) -> Place {
            // Strips: as long as their area says.
            let (x, area) = self.at[id as usize];
            let radius = 0.5 * area as f32;
            Place { centroid: [x, 0.0], radius, moment: [radius * radius / 3.0, 0.0, 0.05] }
        }
        fn material(&self, facet: u32) -> &FacetMaterial {
            &self.lit[facet as usize]
        }
    }

    fn set(links: &mut Links, receiver: u32, source: u32, coupling: f32) {
        set_sloping(links, receiver, source, coupling, 0);
    }

    /// `slope` says how much more arrives at the receiver's upper end.
    fn set_sloping(links: &mut Links, receiver: u32, source: u32, coupling: f32, slope: i8) {
        let over_receiver = [slope, 0];
        links.set(
            receiver,
            [Link { source, coupling, over_receiver, ..Link::default() }].into_iter(),
        );
    }

    const STOP: Stop = Stop::Residual(1e-7);

    /// Two plates, the second split in two, and a lamp; with given couplings.
    fn plates() -> (Toy, Links) {
        let lit = [FacetMaterial { reflectance: [0.5, 0.8, 0.0], exitance: [1.0, 2.0, 3.0] }; 2];
        let mut links = Links::default();
        links.extend(64);
        for (receiver, source, coupling) in [(0, 2, 0.5), (0, 3, 0.5), (2, 0, 1.0), (3, 0, 1.0)] {
            set(&mut links, receiver, source, coupling);
        }
        let at = vec![(0.0, 1.0), (0.0, 1.0), (-0.25, 0.5), (0.25, 0.5), (0.0, 0.0)];
        (Toy { lit, facets: [ElementId(0), ElementId(1)], at, quarters: false }, links)
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

    /// A leaf that gets, and sends, a quarter more than all, which its sibling lacks: with nearly white surfaces light would grow.
    #[test]
    fn rows_above_one_are_taken_back_and_facets_keep_their_sums() {
        let (mut plates, mut links) = plates();
        plates.lit = [FacetMaterial { reflectance: [0.99; 3], exitance: [1.0; 3] }; 2];
        for (receiver, source, coupling) in [(2, 0, 1.25), (3, 0, 0.75)] {
            set(&mut links, receiver, source, coupling);
        }
        let list = [(2, 0.625), (3, 0.375)];
        links.set(
            0,
            list.map(|(source, coupling)| Link { source, coupling, ..Link::default() }).into_iter(),
        );
        let rows = RowScaling::none(&plates, &links, true);
        let scaling = rows.found(&plates, &links);
        for leaf in [0, 2, 3] {
            assert!((scaling.rows[leaf].mean - 1.0).abs() < 1e-3, "{:?}", scaling.rows);
        }
        for rows_are_close in [true, false] {
            let mut b = Radiosity::new(&plates);
            let bounds =
                Bounds { residual: 1e-7, from_nothing: 1e-7, mean_w_m2: 2e2, rows_are_close };
            b.solve_bounded(&plates, &links, Dirty::All, bounds);
            assert!(b.has_settled() && b.scaling.is_none() == rows_are_close);
            assert_eq!(b.levels.are_symmetric(), rows_are_close);
            for id in 0..4 {
                assert!((b.radiosity(id)[0] - 100.0).abs() < 0.5, "{id}: {:?}", b.radiosity(id));
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
