//! How much larger than its residuals the error of a solution may be.

use super::Radiosity;
use super::scaling::{RowScaling, for_each_leaf, most};
use crate::solver::links::Links;
use crate::solver::surfaces::Surfaces;
use crate::solver::tuning::GROWTH_SWEEPS;

/// Share of 1 that the weights of a bound exceed what they reflect by, from which they are close enough.
const WEIGHTS_CLOSE: f32 = 0.5;

impl Radiosity {
    /// Largest error of a radiosity over the largest residual of any: 1 / (1 - rho) where the form factors from every leaf sum to at
    /// most 1, with the largest reflectance rho. Of means; gradients of errors do not count.
    ///
    /// Errors e and residuals r of a solution satisfy e = r + rho K e. Where weights w > 0 exceed what they reflect by at least c,
    /// w - rho K w >= c > 0, no error is larger than w / c times the largest residual (Collatz-Wielandt). Weights begin with
    /// 1 / (1 - rho) and are replaced by 1 + rho K w until c is close to 1: leaves whose form factors sum to more than 1 get larger
    /// ones. Cost: one gather over all links where no row exceeds 1.
    pub fn growth(&self, surfaces: &impl Surfaces, links: &Links) -> f64 {
        let facets = surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0));
        let rho = facets.map(|facet| most(surfaces, facet.0)).fold(0.0, f32::max);
        let mut weights = vec![1.0 / (1.0 - rho); surfaces.len()];
        let (mut exceeds, mut largest) = (0.0, f32::INFINITY);
        for _ in 0..GROWTH_SWEEPS {
            let next = self.reflected_weights(surfaces, links, &weights);
            (exceeds, largest) = (f32::INFINITY, 1.0);
            for (leaf, weight) in next {
                let before = std::mem::replace(&mut weights[leaf as usize], weight);
                exceeds = exceeds.min(1.0 + before - weight);
                largest = largest.max(before);
            }
            if exceeds >= WEIGHTS_CLOSE {
                break;
            }
        }
        f64::from(largest / exceeds.clamp(WEIGHTS_CLOSE, 1.0))
    }

    /// 1 + rho K w of all leaves.
    fn reflected_weights(
        &self,
        surfaces: &impl Surfaces,
        links: &Links,
        weights: &[f32],
    ) -> Vec<(u32, f32)> {
        let sent = (0..).zip(weights).map(|(id, weight)| weight * self.factor_of_sent(id));
        // Sums of rows, each times what its own leaf sends.
        let scaled = RowScaling::of(surfaces, links, false, sent.collect());
        let mut out = Vec::new();
        for facet in surfaces.facets().iter().filter(|facet| surfaces.is_surface(facet.0)) {
            let rho = most(surfaces, facet.0);
            for_each_leaf(surfaces, facet.0, &mut |leaf| {
                let k = leaf as usize;
                let row = scaled.rows[k].mean / scaled.factors[k];
                out.push((leaf, 1.0 + rho * self.factor_of_received(leaf) * row));
            });
        }
        out
    }

    /// What counts of the reflected light that a leaf receives, 1.
    fn factor_of_received(&self, leaf: u32) -> f32 {
        let level = self.levels.get(leaf).filter(|level| level.is_closed);
        match self.scaling.factors.get(leaf as usize) {
            Some(&factor) => factor,
            None => level.map_or(1.0, |level| level.factor),
        }
    }

    /// What counts of the light that a leaf sends, 1.
    fn factor_of_sent(&self, leaf: u32) -> f32 {
        let both = self.levels.are_symmetric() || !self.scaling.is_none();
        if both { self.factor_of_received(leaf) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::toy::{plates, set};
    use super::*;

    #[test]
    fn rows_of_at_most_one_bound_errors_by_the_reflectance_alone() {
        let (surfaces, links) = plates();
        let light = Radiosity::new(&surfaces);
        assert!((light.growth(&surfaces, &links) - 5.0).abs() < 1e-5);
    }

    /// Plate 0 of row 1 sees halves of rows 1.4 and 0.6: errors grow with their means, here as with rows of 1.
    #[test]
    fn rows_above_one_let_errors_grow_by_what_the_means_of_rows_do() {
        let (mut surfaces, mut links) = plates();
        surfaces.lit.iter_mut().for_each(|lit| lit.reflectance = [0.8; 3]);
        set(&mut links, 2, 0, 1.4);
        set(&mut links, 3, 0, 0.6);
        let found = Radiosity::new(&surfaces).growth(&surfaces, &links);
        // w = 5 on the plate and 1 + 0.8 * 1.4 * 5 = 6.6 on the upper half.
        assert!((6.6..13.3).contains(&found), "{found}");
        // What grows without end has no bound; what is told is finite all the same.
        set(&mut links, 2, 0, 3.0);
        assert!(Radiosity::new(&surfaces).growth(&surfaces, &links) > 20.0);
    }
}
