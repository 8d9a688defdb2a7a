//! Where an element lies, as the solver sees it.

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

impl Place {
    /// From a gradient (per radius) the first moments that it makes, relative to those over a square of this radius.
    ///
    /// Radiosities keep these in place of gradients: the mean of the product of two linear functions over a source
    /// is that of their means and `moment` times one's first moments times the other's gradient, for any shape.
    pub(super) fn first_moments(&self, [x, y]: [f32; 2], moment: f32) -> [f32; 2] {
        let scale = 1.0 / (self.radius * self.radius * moment);
        let [xx, xy, yy] = self.moment.map(|m| m * scale);
        [xx * x + xy * y, xy * x + yy * y]
    }

    /// The gradient (per radius) that makes these first moments; of what is a line but for rounding, along that line.
    pub(crate) fn gradient(&self, [x, y]: [f32; 2], moment: f32) -> [f32; 2] {
        let [xx, xy, yy] = self.moment.map(f64::from);
        let (square, determinant) =
            (f64::from(self.radius * self.radius * moment), xx * yy - xy * xy);
        let (x, y) = (f64::from(x), f64::from(y));
        if determinant <= DIGITS * xx * yy {
            let scale = square / (xx + yy).max(f64::MIN_POSITIVE);
            return [(x * scale) as f32, (y * scale) as f32];
        }
        let scale = square / determinant;
        [((x * yy - y * xy) * scale) as f32, ((y * xx - x * xy) * scale) as f32]
    }
}

/// Rounding of a determinant of second moments in single precision, over their product.
const DIGITS: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    /// A sliver aslant: what rounding leaves of the determinant of its moments has either sign, or is 0.
    #[test]
    fn gradients_of_slivers_aslant_run_along_them() {
        let along = [0.6_f32, 0.8];
        for off in [-1_i32, 0, 1] {
            let yy = f32::from_bits((0.64_f32.to_bits() as i32 + off) as u32);
            let place = Place { centroid: [0.0; 2], radius: 1.7, moment: [0.36, 0.48, yy] };
            let moments = place.first_moments(along.map(|a| 2.0 * a), 0.2);
            let found = place.gradient(moments, 0.2);
            let near = |k: usize| (found[k] - 2.0 * along[k]).abs() < 1e-4;
            assert!(near(0) && near(1), "{off}: {found:?}");
        }
    }

    #[test]
    fn gradients_and_first_moments_are_inverse() {
        let place = Place { centroid: [0.0; 2], radius: 1.7, moment: [0.36, 0.05, 0.02] };
        let back = place.gradient(place.first_moments([1.0, -3.0], 0.2), 0.2);
        assert!((back[0] - 1.0).abs() < 1e-4 && (back[1] + 3.0).abs() < 1e-3, "{back:?}");
    }
}
