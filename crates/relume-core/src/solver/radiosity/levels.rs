//! Levels: reflected light of leaves in closed surroundings, set right by the sums of their rows.
//!
//! Nothing receives more than all that surrounds it sends: no row of form factors sums to more than 1. Where those over a part of a
//! surface sum to 1 in the mean, each of them does, and what a leaf's row differs from 1 by is what links of larger elements, handed
//! down as lines, err by. It errs in one sense with brightness, since a leaf with too high a row is too bright and sends by that same
//! row: in white rooms that makes light of nothing, 1 to 2 % at tolerance 0.1 with reflectance 0.95. So reflected light counts
//! as if the row were 1, and even. Direct light, of which each link errs little, stays as it is.

use fearless_simd::dispatch;
use rayon::prelude::*;

use super::scaling::RowScaling;
use super::solve::CHUNK;
use crate::element::Renumbering;
use crate::solver::field::{Field, Linear};
use crate::solver::gather::gather_some;
use crate::solver::level::Level;
use crate::solver::links::Links;
use crate::solver::push::push;
use crate::solver::surfaces::{Surfaces, for_each_below};
use crate::solver::tuning::{CLOSED, LEVEL_MOST};
use crate::transport;

/// Levels of leaves, by element; of no meaning for what is no leaf. None where nothing is white.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels(Vec<Level>);

impl Levels {
    /// Levels of all leaves; `sources` has what sources that are no surfaces send.
    pub(super) fn new(
        surfaces: &impl Surfaces,
        links: &Links,
        rows: &RowScaling,
        sources: &Field,
    ) -> Levels {
        let direct = direct(surfaces, links, sources);
        let mut leaves = vec![Level::NONE; surfaces.len()];
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let closed = Closed { surfaces, rows };
            closed.find(facet.0, &mut |leaf| {
                let row = &rows.rows[leaf as usize];
                let factor = (1.0 / row.mean).clamp(1.0 / LEVEL_MOST, LEVEL_MOST);
                let slope = row.gradient.map(|g| g / row.mean);
                let direct = direct[leaf as usize];
                leaves[leaf as usize] = Level { is_closed: true, direct, factor, slope };
            });
        }
        Levels(leaves)
    }

    /// Level of an element; none where nothing is levelled, and of elements that came since.
    pub(super) fn get(&self, id: u32) -> Option<&Level> {
        self.0.get(id as usize)
    }

    /// Whether nothing is levelled.
    pub(super) fn is_none(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a leaf is in closed surroundings, as far as is known.
    pub(super) fn is_closed(&self, leaf: u32) -> bool {
        self.get(leaf).is_some_and(|level| level.is_closed)
    }

    /// Levels by element.
    pub(super) fn all(&self) -> &[Level] {
        &self.0
    }

    /// The leaves that have another one than before; `None` where there were none before, or are none now.
    pub(super) fn changed_from(
        &self,
        before: &Levels,
        surfaces: &impl Surfaces,
    ) -> Option<Vec<u32>> {
        if self.is_none() != before.is_none() {
            return None;
        }
        let of = |levels: &Levels, id: u32| levels.get(id).copied().unwrap_or(Level::NONE);
        let mut changed = Vec::new();
        let facets = surfaces.facets().iter().filter(|_| !self.is_none());
        for facet in facets {
            for_each_below(surfaces, facet.0, &mut |id| {
                if surfaces.children(id).is_empty() && of(self, id) != of(before, id) {
                    changed.push(id);
                }
            });
        }
        Some(changed)
    }

    /// Follows elements to their new ids.
    pub(super) fn renumber(&mut self, to: &Renumbering) {
        if !self.0.is_empty() {
            let of = |&old: &u32| self.0.get(old as usize).copied().unwrap_or(Level::NONE);
            self.0 = to.old_of().iter().map(of).collect();
        }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (self.0.capacity() * size_of::<Level>()) as u64
    }
}

/// Finds leaves in closed surroundings.
struct Closed<'a, S> {
    surfaces: &'a S,
    rows: &'a RowScaling,
}

impl<S: Surfaces> Closed<'_, S> {
    /// Calls `visit` with the leaves of the largest parts of an element whose rows sum to 1 in the mean.
    fn find(&self, id: u32, visit: &mut dyn FnMut(u32)) {
        let (row_m2, area_m2) = self.sums(id);
        if area_m2 > 0.0 && row_m2 >= CLOSED * area_m2 {
            for_each_below(self.surfaces, id, &mut |id| {
                if self.is_exposed_leaf(id) && self.rows.rows[id as usize].mean > 0.0 {
                    visit(id);
                }
            });
        } else if area_m2 > 0.0 {
            self.surfaces.children(id).for_each(|child| self.find(child, visit));
        }
    }

    /// Sums of row times area, and of area, over the leaves of an element that light can reach; m2.
    fn sums(&self, id: u32) -> (f64, f64) {
        let (mut row_m2, mut area_m2) = (0.0, 0.0);
        for_each_below(self.surfaces, id, &mut |id| {
            if self.is_exposed_leaf(id) {
                let area = self.surfaces.area_m2(id);
                row_m2 += area * f64::from(self.rows.rows[id as usize].mean);
                area_m2 += area;
            }
        });
        (row_m2, area_m2)
    }

    fn is_exposed_leaf(&self, id: u32) -> bool {
        self.surfaces.children(id).is_empty() && !self.surfaces.is_covered(id)
    }
}

/// Direct irradiance of all leaves, by element.
fn direct(surfaces: &impl Surfaces, links: &Links, sources: &Field) -> Vec<Linear> {
    let mut sent = Field::default();
    sent.extend(surfaces.len());
    for facet in surfaces.facets() {
        if surfaces.is_surface(facet.0) {
            let mean = surfaces.material(facet.0).exitance;
            for_each_below(surfaces, facet.0, &mut |id| {
                sent.set(id, &Linear { mean, ..Linear::default() });
            });
        }
    }
    for id in (0..surfaces.len() as u32).filter(|&id| !surfaces.is_surface(id)) {
        sent.set(id, &sources.get(id));
    }
    let gathered = gathered_from(&sent, surfaces, links, true);
    let own = |id: u32| gathered[id as usize];
    let mut direct = vec![Linear::default(); surfaces.len()];
    for facet in surfaces.facets() {
        let at = surfaces.place(facet.0);
        push(surfaces, facet.0, &at, &Linear::default(), &own, &mut |leaf, h| {
            direct[leaf as usize] = *h;
        });
    }
    direct
}

/// What every element gathers over its own links and those of groups, from what all `sent`: as lines, or as means alone unless `linear`.
pub(super) fn gathered_from(
    sent: &Field,
    surfaces: &impl Surfaces,
    links: &Links,
    linear: bool,
) -> Vec<Linear> {
    let mut gathered = vec![Linear::default(); surfaces.len()];
    let level = transport::Simd::detect().level();
    gathered.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
        let first = (chunk * CHUNK) as u32;
        let ids: Vec<u32> = (first..first + out.len() as u32).collect();
        dispatch!(level, simd => gather_some(simd, sent, links, surfaces, &ids, linear, out));
    });
    if let Some(groups) = surfaces.groups() {
        let arriving = groups.arriving(&|id| sent.get(id), surfaces.source_moment());
        for (id, h) in (0..).zip(&mut gathered) {
            *h = h.plus(&groups.at(&arriving, id));
        }
    }
    gathered
}
