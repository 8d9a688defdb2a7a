//! Row scaling: factors of leaves with which no row of form factors sums to more than 1.
//!
//! A link of an element counts for all of it: a leaf in a narrow gap inherits its part though it lies in the dark, and its row sums
//! to more than 1. Between white surfaces light grows there. With factors d the links between leaves i and j count d_i d_j times, in both
//! directions, and d is such that rows have the sums that they should: at most 1, and over each facet as much as before, since sums over
//! facets are good. That is the symmetric scaling of a matrix to given row sums (Sinkhorn and Knopp 1967).

use super::Radiosity;
use super::levels::gathered_from;
use crate::element::Renumbering;
use crate::solver::field::{Field, Linear};
use crate::solver::links::Links;
use crate::solver::place::Place;
use crate::solver::push::{RowSum, push};
use crate::solver::settle::Fit;
use crate::solver::surfaces::{Surfaces, for_each_below};
use crate::solver::tuning::{DIVIDED_MOST, FACTOR_MOST, RAISED_MOST, SCALING_ROUNDS};

/// Factors of leaves, and the sums of their rows with them; by id, of no meaning for what is no leaf.
#[derive(Clone, Debug, Default)]
pub(super) struct RowScaling {
    /// Factor of what a leaf receives and of what it sends, 1.
    pub(super) factors: Vec<f32>,
    /// Sums of rows, 1 and 1/m.
    pub(super) rows: Vec<RowSum>,
    /// Sums that rows should have, 1; none unless factors were looked for.
    wanted: Vec<f32>,
    /// Whether rows are taken as lines.
    linear: bool,
}

/// Rows that are less off than this are as they should be, 1.
pub(super) const CLOSE: f32 = 1e-3;

/// What rows may be above 1 by rounding, and as their exchange is found: 1.
const ROUNDED: f64 = 1e-3;

/// Halvings of the interval in which [`raised`] looks.
const RAISED_BITS: u32 = 24;

impl RowScaling {
    /// Factors of 1, with the sums of rows as lines or as means alone unless `linear`.
    pub(super) fn none(surfaces: &impl Surfaces, links: &Links, linear: bool) -> RowScaling {
        RowScaling::of(surfaces, links, linear, vec![1.0; surfaces.len()])
    }

    /// Given factors, with the sums of rows.
    pub(super) fn of(
        surfaces: &impl Surfaces,
        links: &Links,
        linear: bool,
        factors: Vec<f32>,
    ) -> RowScaling {
        let rows = vec![RowSum::default(); factors.len()];
        let mut scaling = RowScaling { factors, rows, wanted: Vec::new(), linear };
        scaling.sum_rows(surfaces, links);
        scaling
    }

    /// Whether rows are taken as lines.
    pub(super) fn is_linear(&self) -> bool {
        self.linear
    }

    /// Whether there are none.
    pub(super) fn is_none(&self) -> bool {
        self.factors.is_empty()
    }

    /// Flux that leaves with rows above 1 would make of nothing, over what all surfaces absorb, in light that is even: 1.
    /// Rows are summed between surfaces weighed by the roots of their reflectances: light grows only where both ends reflect.
    /// Of links and materials alone, so that it is the same however links came about.
    pub(super) fn gain(surfaces: &impl Surfaces, links: &Links) -> f64 {
        let mut roots = vec![0.0; surfaces.len()];
        for facet in surfaces.facets() {
            let root = most(surfaces, facet.0).sqrt();
            for_each_below(surfaces, facet.0, &mut |id| roots[id as usize] = root);
        }
        let weighed = RowScaling::of(surfaces, links, true, roots);
        let (mut made, mut absorbed) = (0.0, 0.0);
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            absorbed += surfaces.area_m2(facet.0) * f64::from(1.0 - most(surfaces, facet.0));
            for_each_leaf(surfaces, facet.0, &mut |leaf| {
                let row = f64::from(weighed.rows[leaf as usize].mean);
                made += surfaces.area_m2(leaf) * (row - 1.0 - ROUNDED).max(0.0);
            });
        }
        made / absorbed
    }

    /// Factors with which these rows have the sums that they should. They are always looked for from 1, so that they are those of a
    /// cold build also where the rounds end before rows are close.
    pub(super) fn found(mut self, surfaces: &impl Surfaces, links: &Links) -> RowScaling {
        self.wanted = self.wanted(surfaces);
        for _ in 0..SCALING_ROUNDS {
            let mut off = 0.0_f32;
            for ((factor, row), &wanted) in
                self.factors.iter_mut().zip(&self.rows).zip(&self.wanted)
            {
                if row.mean > 0.0 && wanted > 0.0 {
                    off = off.max((row.mean - wanted).abs());
                    let better = *factor * (wanted / row.mean).sqrt();
                    *factor = better.clamp(DIVIDED_MOST.recip(), FACTOR_MOST);
                }
            }
            if off < CLOSE {
                break;
            }
            self.sum_rows(surfaces, links);
        }
        self
    }

    /// Factors with which none of these rows sums to more than 1, whatever is lost.
    pub(super) fn strict(mut self, surfaces: &impl Surfaces, links: &Links) -> RowScaling {
        self.wanted = self.wanted(surfaces);
        for (factor, row) in self.factors.iter_mut().zip(&self.rows) {
            *factor = 1.0 / row.mean.max(1.0);
        }
        self.sum_rows(surfaces, links);
        self
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        let single = (self.factors.capacity() + self.wanted.capacity()) * size_of::<f32>();
        (single + self.rows.capacity() * size_of::<RowSum>()) as u64
    }

    /// Follows elements to their new ids.
    pub(super) fn renumber(&mut self, to: &Renumbering) {
        if !self.factors.is_empty() {
            self.factors = to.old_of().iter().map(|&old| self.factors[old as usize]).collect();
            self.rows = to.old_of().iter().map(|&old| self.rows[old as usize]).collect();
            self.wanted = to.old_of().iter().map(|&old| self.wanted[old as usize]).collect();
        }
    }

    /// Sums that the rows of leaves should have: at most 1, and over each facet together as much as they have. What is taken from
    /// rows above 1 goes to the others in proportion to what they have, so that a leaf which sees next to nothing goes on to.
    fn wanted(&self, surfaces: &impl Surfaces) -> Vec<f32> {
        let mut wanted = vec![0.0; surfaces.len()];
        for facet in surfaces.facets() {
            let mut rows: Vec<LeafRow> = Vec::new();
            for_each_leaf(surfaces, facet.0, &mut |leaf| {
                let row = f64::from(self.rows[leaf as usize].mean.max(0.0));
                rows.push(LeafRow { leaf, area_m2: surfaces.area_m2(leaf), row });
            });
            let raised = raised(&rows);
            for LeafRow { leaf, row, .. } in rows {
                wanted[leaf as usize] = (raised * row).min(1.0) as f32;
            }
        }
        wanted
    }

    /// Finds the sums of rows with these factors.
    fn sum_rows(&mut self, surfaces: &impl Surfaces, links: &Links) {
        let mut sent = Field::default();
        sent.extend(surfaces.len());
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let leaf = |id: u32, _: &Linear| Linear {
                mean: [self.factors[id as usize]; 3],
                ..Linear::default()
            };
            pull(surfaces, facet.0, &leaf, &mut sent);
        }
        let gathered = gathered_from(&sent, surfaces, links, self.linear);
        let own = |id: u32| gathered[id as usize];
        for facet in surfaces.facets() {
            let at = surfaces.place(facet.0);
            push(surfaces, facet.0, &at, &Linear::default(), &own, &mut |leaf, h| {
                let factor = self.factors[leaf as usize];
                let gradient = h.gradient.map(|g| factor * g[0]);
                self.rows[leaf as usize] = RowSum { mean: factor * h.mean[0], gradient };
            });
        }
    }
}

impl Radiosity {
    /// Whether light varies linearly over elements, as it does unless it would grow.
    pub fn is_linear(&self) -> bool {
        !self.constant
    }

    /// Whether leaves have factors with constant elements: the last resort, which may lose light.
    pub fn loses_light(&self) -> bool {
        self.constant && !self.scaling.is_none()
    }

    /// Sum of the form factors from a leaf as it should be where rows are scaled, so that light that factors lose counts as
    /// unaccounted for; else what its links sum to.
    pub fn row(&self, leaf: u32, links: &RowSum) -> RowSum {
        match self.scaling.wanted.get(leaf as usize) {
            Some(&mean) => RowSum { mean, ..self.scaling.rows[leaf as usize] },
            None => *links,
        }
    }

    /// Changes what leaves send, by their factors, and what elements above them send with it.
    pub(super) fn scale_leaves(
        &mut self,
        surfaces: &impl Surfaces,
        scaled: impl Fn(&Linear, f32) -> Linear,
    ) {
        let Radiosity { radiosity, scaling, .. } = self;
        let leaf = |id: u32, b: &Linear| scaled(b, scaling.factors[id as usize]);
        for facet in surfaces.facets() {
            pull(surfaces, facet.0, &leaf, radiosity);
        }
    }
}

/// Row of a leaf.
struct LeafRow {
    leaf: u32,
    area_m2: f64,
    /// Sum of form factors, 1.
    row: f64,
}

/// By how much rows are to be multiplied for their sum over areas to stay while none is above 1: 1, at most `RAISED_MOST`.
fn raised(rows: &[LeafRow]) -> f64 {
    let off = |raised: f64| -> f64 {
        let more = |of: &LeafRow| of.area_m2 * ((raised * of.row).min(1.0) - of.row);
        rows.iter().map(more).sum()
    };
    let (mut low, mut high) = (1.0, f64::from(RAISED_MOST));
    if off(low) >= 0.0 {
        return low;
    }
    for _ in 0..RAISED_BITS {
        let middle = 0.5 * (low + high);
        *(if off(middle) < 0.0 { &mut low } else { &mut high }) = middle;
    }
    high
}

/// Sets what leaves send to what `leaf` makes of it, and what elements above them send, with first moments.
pub(super) fn pull(
    surfaces: &impl Surfaces,
    id: u32,
    leaf: &dyn Fn(u32, &Linear) -> Linear,
    sent: &mut Field,
) -> (Linear, Place) {
    let (place, moment) = (surfaces.place(id), surfaces.source_moment());
    let children = surfaces.children(id);
    let own = if children.is_empty() {
        leaf(id, &sent.get(id))
    } else {
        let mut fit = Fit::default();
        for child in children {
            let (own, at) = pull(surfaces, child, leaf, sent);
            fit.add(surfaces.area_m2(child), (&place, &at), moment, &own);
        }
        fit.linear(&place, moment)
    };
    sent.set(id, &own);
    (own, place)
}

/// Largest reflectance of a facet over all channels, 1.
pub(super) fn most(surfaces: &impl Surfaces, facet: u32) -> f32 {
    surfaces.material(facet).reflectance.into_iter().fold(0.0, f32::max)
}

pub(super) fn for_each_leaf(surfaces: &impl Surfaces, facet: u32, visit: &mut dyn FnMut(u32)) {
    for_each_below(surfaces, facet, &mut |id| {
        if surfaces.children(id).is_empty() {
            visit(id);
        }
    });
}
