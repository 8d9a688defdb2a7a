//! Convex polygons: what the judge is told of a scene, and cutting them.

use glam::DVec3;

/// A quadrilateral, counter-clockwise seen from its front.
pub type Quad = [DVec3; 4];

/// A diffuse convex polygon in the world: reflects and emits on its front, black on its back, blocks
/// on both sides.
#[derive(Clone, Debug)]
pub struct Polygon {
    /// Corners, counter-clockwise seen from the front, m.
    pub corners: Vec<DVec3>,
    /// Diffuse reflectance, linear RGB.
    pub reflectance: [f64; 3],
    /// Exitance, W/m2, linear RGB.
    pub exitance: [f64; 3],
    /// The index of its own back, if that reflects too.
    pub twin: Option<usize>,
}

impl Polygon {
    /// A black one-sided polygon that does not emit.
    pub fn black(corners: Vec<DVec3>) -> Polygon {
        Polygon { corners, reflectance: [0.0; 3], exitance: [0.0; 3], twin: None }
    }

    /// Unit normal of the front.
    pub fn normal(&self) -> DVec3 {
        area_vector(&self.corners).normalize()
    }

    /// Area, m2.
    pub fn area_m2(&self) -> f64 {
        area_vector(&self.corners).length()
    }
}

/// Area of a planar polygon times its normal, m2.
pub(crate) fn area_vector(corners: &[DVec3]) -> DVec3 {
    let o = corners[0];
    let fans = corners[1..].windows(2);
    fans.map(|c| (c[0] - o).cross(c[1] - o)).sum::<DVec3>() / 2.0
}

/// A plane through a point; what is on the side of the normal is in front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    pub(crate) through: DVec3,
    /// Of unit length.
    pub(crate) normal: DVec3,
}

impl Side {
    pub(crate) fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p - self.through)
    }

    pub(crate) fn flipped(self) -> Side {
        Side { normal: -self.normal, ..self }
    }

    /// The part of a convex polygon higher than `least`; empty if nothing is left.
    pub(crate) fn cut(&self, corners: &[DVec3], least: f64) -> Vec<DVec3> {
        let mut out = Vec::with_capacity(corners.len() + 1);
        for (k, &p) in corners.iter().enumerate() {
            let q = corners[(k + 1) % corners.len()];
            let (a, b) = (self.height(p) - least, self.height(q) - least);
            if a >= 0.0 {
                out.push(p);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                out.push(p + (q - p) * (a / (a - b)));
            }
        }
        if out.len() < 3 {
            out.clear();
        }
        out
    }
}

/// A convex polygon as quadrilaterals: itself, or one for each corner around its middle.
pub(crate) fn quads_of(corners: &[DVec3]) -> Vec<Quad> {
    if let &[a, b, c, d] = corners {
        return vec![[a, b, c, d]];
    }
    let n = corners.len();
    let middle = corners.iter().sum::<DVec3>() / n as f64;
    let half = |k: usize| (corners[k % n] + corners[(k + 1) % n]) / 2.0;
    (0..n).map(|k| [corners[k], half(k), middle, half(k + n - 1)]).collect()
}

/// Point of a quadrilateral at (s, t) in the unit square, and the area it stands for, m2.
pub(crate) fn on_quad(q: &Quad, s: f64, t: f64) -> (DVec3, f64) {
    let (low, high) = (q[0].lerp(q[1], s), q[3].lerp(q[2], s));
    let along = (q[1] - q[0]).lerp(q[2] - q[3], t);
    (low.lerp(high, t), along.cross(high - low).length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quads_cover_a_polygon() {
        let corner = |k: u32| {
            let a = f64::from(k) * std::f64::consts::TAU / 5.0;
            DVec3::new(a.cos(), 2.0 * a.sin(), 0.5)
        };
        let pentagon: Vec<DVec3> = (0..5).map(corner).collect();
        let whole = area_vector(&pentagon).length();
        let parts: f64 = quads_of(&pentagon).iter().map(|q| area_vector(q).length()).sum();
        assert!((whole - parts).abs() < 1e-12);
        // Gauss points integrate the area of a bilinear quadrilateral exactly.
        let g = 0.5 / 3.0_f64.sqrt();
        let of = |q: &Quad| {
            let at = |s: f64, t: f64| on_quad(q, 0.5 + s, 0.5 + t).1 / 4.0;
            at(g, g) + at(g, -g) + at(-g, g) + at(-g, -g)
        };
        let sum: f64 = quads_of(&pentagon).iter().map(of).sum();
        assert!((sum - whole).abs() < 1e-12);
    }

    #[test]
    fn a_cut_and_its_rest_make_the_whole() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let normal = DVec3::new(1.0, 2.0, 0.0).normalize();
        let side = Side { through: DVec3::new(0.3, 0.2, 0.0), normal };
        let area = |c: &[DVec3]| area_vector(c).length();
        let (above, below) = (side.cut(&square, 0.0), side.flipped().cut(&square, 0.0));
        assert!((area(&above) + area(&below) - 1.0).abs() < 1e-12);
        assert!(side.cut(&square, 5.0).is_empty());
    }
}
