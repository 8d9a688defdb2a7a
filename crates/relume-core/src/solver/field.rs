//! Quantities that vary linearly over elements, and tables of them.

use crate::element::Renumbering;

use super::place::Place;

/// A quantity that varies linearly over an element, red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linear {
    /// Mean over the element.
    pub mean: [f32; 3],
    /// Gradient in the patch's frame, per metre. Of radiosities that are kept: first moments, relative to those of a
    /// gradient per radius over a square.
    pub gradient: [[f32; 3]; 2],
}

/// Difference that may be rounding, over the value: some units in the last place.
const ROUNDED: f32 = 4.0 * f32::EPSILON;

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
    pub(super) fn about(&self, own: &Place, other: &Place) -> Linear {
        let [dx, dy] = [0, 1].map(|k| other.centroid[k] - own.centroid[k]);
        Linear { mean: self.at(dx, dy), ..*self }
    }

    /// The same about another point than the centroid of a place, per metre.
    pub(crate) fn moved(&self, own: &Place, to: [f64; 2]) -> Linear {
        let [dx, dy] = [0, 1].map(|k| to[k] as f32 - own.centroid[k]);
        Linear { mean: self.at(dx, dy), ..*self }
    }

    /// Times a number.
    pub(super) fn times(&self, by: f32) -> Linear {
        let each = |numbers: [f32; 3]| numbers.map(|x| x * by);
        Linear { mean: each(self.mean), gradient: self.gradient.map(each) }
    }

    /// The sum, in the same units.
    pub fn plus(mut self, other: &Linear) -> Linear {
        for c in 0..3 {
            self.mean[c] += other.mean[c];
            self.gradient[0][c] += other.gradient[0][c];
            self.gradient[1][c] += other.gradient[1][c];
        }
        self
    }

    /// The difference, in the same units.
    pub(super) fn minus(mut self, other: &Linear) -> Linear {
        for c in 0..3 {
            self.mean[c] -= other.mean[c];
            self.gradient[0][c] -= other.gradient[0][c];
            self.gradient[1][c] -= other.gradient[1][c];
        }
        self
    }

    /// The largest value within a radius, of any sign and channel; gradients per unit of the radius.
    pub(super) fn most(&self, radius: f32) -> f32 {
        let [u, v] = self.gradient;
        let of = |c: usize| self.mean[c].abs() + radius * (u[c].abs() + v[c].abs());
        of(0).max(of(1)).max(of(2))
    }

    /// Largest difference from the value before; none where it is rounding: where an element is a million times as bright as the
    /// mean, its rounding exceeds the residual, and a solve that follows it never settles.
    pub(super) fn change_from(&self, before: &Linear) -> f32 {
        let difference = self.difference(before);
        if difference <= ROUNDED * self.most(1.0) { 0.0 } else { difference }
    }

    pub(super) fn difference(&self, other: &Linear) -> f32 {
        let mut out = 0.0_f32;
        for c in 0..3 {
            out = out.max((self.mean[c] - other.mean[c]).abs());
            out = out.max((self.gradient[0][c] - other.gradient[0][c]).abs());
            out = out.max((self.gradient[1][c] - other.gradient[1][c]).abs());
        }
        out
    }
}

/// A [`Linear`] for each element: nine numbers each, one after the other.
#[derive(Clone, Debug)]
pub(super) struct Field(pub(super) Vec<f32>);

/// Numbers of one element.
pub(super) const NINE: usize = 9;

/// Numbers beyond the last element that [`Field::with_next`] may read.
pub(super) const BEYOND: usize = 1;

impl Default for Field {
    fn default() -> Field {
        Field(vec![0.0; BEYOND])
    }
}

impl Field {
    pub(super) fn extend(&mut self, len: usize) {
        let wanted = len * NINE + BEYOND;
        if wanted > self.0.len() {
            grow(&mut self.0, wanted);
        }
    }

    pub(super) fn renumber(&mut self, to: &Renumbering) {
        let mut out = Vec::with_capacity(to.old_of().len() * NINE + BEYOND);
        for &old in to.old_of() {
            let at = old as usize * NINE;
            out.extend_from_slice(&self.0[at..at + NINE]);
        }
        out.resize(out.len() + BEYOND, 0.0);
        self.0 = out;
    }

    #[inline]
    pub(super) fn get(&self, id: u32) -> Linear {
        let at = id as usize * NINE;
        let [r, g, b, ur, ug, ub, vr, vg, vb] =
            *self.0[at..].first_chunk::<NINE>().expect("an element");
        Linear { mean: [r, g, b], gradient: [[ur, ug, ub], [vr, vg, vb]] }
    }

    #[inline]
    pub(super) fn set(&mut self, id: u32, value: &Linear) {
        let at = id as usize * NINE;
        let [[ur, ug, ub], [vr, vg, vb]] = value.gradient;
        let [r, g, b] = value.mean;
        self.0[at..at + NINE].copy_from_slice(&[r, g, b, ur, ug, ub, vr, vg, vb]);
    }

    /// The nine numbers of an element, and the one after them.
    #[inline(always)]
    pub(super) fn with_next(&self, id: u32) -> &[f32; NINE + BEYOND] {
        self.0[id as usize * NINE..].first_chunk().expect("an element")
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.0.capacity() * size_of::<f32>()) as u64
    }
}

/// Spare capacity that vectors get as they grow, as one part in this many of their length.
pub(super) const SPARE: usize = 32;

/// Appends zeros, in the room that there is or else in a little more than is needed.
pub(super) fn grow(values: &mut Vec<f32>, len: usize) {
    if len > values.capacity() {
        let slack = if values.is_empty() { 0 } else { len / SPARE };
        values.reserve_exact(len + slack - values.len());
    }
    values.resize(len, 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_by_roundings_is_none() {
        let of = |mean: f32| Linear { mean: [mean; 3], ..Linear::default() };
        let (before, next) = (of(569.577_9), of(f32::from_bits(569.577_9_f32.to_bits() + 2)));
        assert!(next.difference(&before) > 0.0);
        assert_eq!(next.change_from(&before), 0.0);
        assert_eq!(of(569.7).change_from(&before), of(569.7).difference(&before));
    }
}
