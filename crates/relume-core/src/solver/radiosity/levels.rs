//! Levels: reflected light of leaves in closed surroundings, set right by the sums of their rows.
//!
//! Nothing receives more than all that surrounds it sends: no row of form factors sums to more than 1. Where those over a part of a
//! surface sum to 1 in the mean, each of them does, and what a leaf's row differs from 1 by is what links of larger elements, handed
//! down as lines, err by. It errs in one sense with brightness, since a leaf with too high a row is too bright and sends by that same
//! row: in white rooms that makes light of nothing, 1 to 2 % at tolerance 0.1 with reflectance 0.95. So reflected light counts
//! as if the row were 1, and even. Direct light, of which each link errs little, stays as it is.
//!
//! What a leaf receives is divided by its row; what it sends goes by its row as it is, so that light is lost or made where leaves with
//! low rows are brighter than others. *Symmetric* levels multiply what is sent by the line that multiplies what is received: lines with which every row
//! sums to 1 are found by symmetric scaling (Sinkhorn and Knopp 1967), and light is neither made nor lost.

use fearless_simd::dispatch;
use rayon::prelude::*;

use super::scaling::{CLOSE, RowScaling, pull};
use super::solve::CHUNK;
use crate::element::Renumbering;
use crate::solver::field::{Field, Linear};
use crate::solver::gather::gather_some;
use crate::solver::level::Level;
use crate::solver::links::Links;
use crate::solver::push::push;
use crate::solver::settle::reflected;
use crate::solver::surfaces::{FacetMaterial, Surfaces, for_each_below};
use crate::solver::tuning::{CLOSED, DIVIDED_MOST, FACTOR_MOST, LEVEL_MOST, SCALING_ROUNDS};
use crate::transport;

/// Most by which the line of a symmetric level falls over the radius of its leaf: it stays above zero.
const SLOPE_MOST: f32 = 0.5;

/// Levels of leaves. None where nothing is white.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels {
    /// By element; of no meaning for what is no leaf.
    leaves: Vec<Level>,
    is_symmetric: bool,
}

impl Levels {
    /// Levels of all leaves; `sources` has what sources that are no surfaces send.
    pub(super) fn new(
        surfaces: &impl Surfaces,
        links: &Links,
        rows: &RowScaling,
        sources: &Field,
    ) -> Levels {
        let direct = direct(surfaces, links, sources, rows.is_linear());
        let of = |&direct: &Linear| Level { direct, ..Level::NONE };
        let mut leaves: Vec<Level> = direct.iter().map(of).collect();
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let closed = Closed { surfaces, rows };
            closed.find(facet.0, &mut |leaf| {
                let row = &rows.rows[leaf as usize];
                let factor = (1.0 / row.mean).clamp(DIVIDED_MOST.recip(), LEVEL_MOST);
                let slope = row.gradient.map(|g| g / row.mean);
                let level = &mut leaves[leaf as usize];
                *level = Level { is_closed: true, factor, slope, ..*level };
            });
        }
        Levels { leaves, is_symmetric: false }
    }

    /// Symmetric levels of these leaves, with which rows outside closed surroundings sum to as much as `rows`.
    pub(super) fn made_symmetric(
        mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        rows: &RowScaling,
    ) -> Levels {
        self.is_symmetric = true;
        for level in &mut self.leaves {
            (level.factor, level.slope) = (1.0, [0.0; 2]);
        }
        for _ in 0..SCALING_ROUNDS {
            if self.even_out(surfaces, links, rows) < CLOSE {
                break;
            }
        }
        self
    }

    /// A round of symmetric scaling: each leaf's line over the root of its row. By how much factors change, 1.
    fn even_out(&mut self, surfaces: &impl Surfaces, links: &Links, rows: &RowScaling) -> f32 {
        let moment = surfaces.source_moment();
        let gathered = self.gathered_of_one(surfaces, links, rows.is_linear());
        let own = |id: u32| gathered[id as usize];
        let mut change = 0.0_f32;
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let place = surfaces.place(facet.0);
            push(surfaces, facet.0, &place, &Linear::default(), &own, &mut |leaf, h| {
                let level = &mut self.leaves[leaf as usize];
                let place = surfaces.place(leaf);
                let row = level.weighed(h, &place, moment);
                let wanted = if level.is_closed { 1.0 } else { rows.rows[leaf as usize].mean };
                let sum = row.mean[0] / wanted;
                if wanted <= 0.0 || sum <= 0.0 {
                    return;
                }
                let before = level.factor;
                level.factor = (before / sum.sqrt()).clamp(DIVIDED_MOST.recip(), FACTOR_MOST);
                change = change.max((level.factor / before - 1.0).abs());
                if !level.is_closed {
                    return;
                }
                let most = SLOPE_MOST / place.radius;
                for (slope, gradient) in level.slope.iter_mut().zip(row.gradient) {
                    *slope = (*slope + 0.5 * gradient[0] / sum).clamp(-most, most);
                }
            });
        }
        change
    }

    /// What every element gathers where each leaf sends the line of its level.
    fn gathered_of_one(
        &self,
        surfaces: &impl Surfaces,
        links: &Links,
        linear: bool,
    ) -> Vec<Linear> {
        let one = Linear { mean: [1.0; 3], ..Linear::default() };
        let mirror = FacetMaterial { reflectance: [1.0; 3], exitance: [0.0; 3] };
        let moment = surfaces.source_moment();
        let mut sent = Field::default();
        sent.extend(surfaces.len());
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let leaf = |id: u32, _: &Linear| {
                let place = surfaces.place(id);
                let line = self.leaves[id as usize].weighed(&one, &place, moment);
                reflected(&line, &mirror, &place, moment)
            };
            pull(surfaces, facet.0, &leaf, &mut sent);
        }
        gathered_from(&sent, surfaces, links, linear)
    }

    /// Whether what leaves send is multiplied by the same lines as what they receive.
    pub(super) fn are_symmetric(&self) -> bool {
        self.is_symmetric
    }

    /// Level of an element; none where nothing is levelled, and of elements that came since.
    pub(super) fn get(&self, id: u32) -> Option<&Level> {
        self.leaves.get(id as usize)
    }

    /// Whether nothing is levelled.
    pub(super) fn is_none(&self) -> bool {
        self.leaves.is_empty()
    }

    /// Whether a leaf is in closed surroundings, as far as is known.
    pub(super) fn is_closed(&self, leaf: u32) -> bool {
        self.get(leaf).is_some_and(|level| level.is_closed)
    }

    /// Levels by element.
    pub(super) fn all(&self) -> &[Level] {
        &self.leaves
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
        // Where nothing is levelled, direct light is of no meaning.
        let of = |levels: &Levels, id: u32| levels.get(id).filter(|l| l.is_closed).copied();
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
        if !self.leaves.is_empty() {
            let of = |&old: &u32| self.leaves.get(old as usize).copied().unwrap_or(Level::NONE);
            self.leaves = to.old_of().iter().map(of).collect();
        }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (self.leaves.capacity() * size_of::<Level>()) as u64
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
fn direct(surfaces: &impl Surfaces, links: &Links, sources: &Field, linear: bool) -> Vec<Linear> {
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
    let gathered = gathered_from(&sent, surfaces, links, linear);
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
