//! Solutions that keep light, whatever the links: one after the other is tried, each with what it makes or loses of the light.

use super::Radiosity;
use super::levels::Levels;
use super::scaling::{CLOSE, RowScaling, most, pull};
use super::solve::Stop;
use crate::solver::field::Linear;
use crate::solver::links::Links;
use crate::solver::settle::reflected;
use crate::solver::surfaces::{FacetMaterial, Surfaces, for_each_below};
use crate::solver::tuning::{
    ASTRAY_MAX, COARSE_MADE_MAX, GAIN_MAX, GAIN_SURE, LEVELLED_ASTRAY_MAX, LOST_MAX,
    SCALED_RESIDUAL, WHITE,
};
use crate::solver::work::Dirty;

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
}

/// Whether some surface reflects so much that rows above 1 may make light of nothing, and none so much that no rows are known as
/// well as that.
fn is_white(surfaces: &impl Surfaces) -> bool {
    let all = surfaces.facets().iter().map(|facet| most(surfaces, facet.0));
    (WHITE..1.0 - CLOSE).contains(&all.fold(0.0, f32::max))
}

#[cfg(test)]
mod tests {
    use crate::solver::Link;
    use crate::solver::radiosity::toy::{plates, set};

    use super::*;

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
}
