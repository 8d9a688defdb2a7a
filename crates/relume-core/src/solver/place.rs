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

    /// The gradient (per radius) that makes these first moments.
    pub(crate) fn gradient(&self, [x, y]: [f32; 2], moment: f32) -> [f32; 2] {
        let [xx, xy, yy] = self.moment.map(f64::from);
        let scale = f64::from(self.radius * self.radius * moment)
            / (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        let (x, y) = (f64::from(x), f64::from(y));
        [((x * yy - y * xy) * scale) as f32, ((y * xx - x * xy) * scale) as f32]
    }
}
