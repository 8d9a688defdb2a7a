//! One facet: irradiance pushed down, reflected at the leaves, radiosity pulled up.

use super::field::{Field, Linear};
use super::surfaces::{Lit, Place, Surfaces};
use super::work::{Way, bit};

/// What pushing and pulling through one facet found.
#[derive(Default)]
pub(super) struct Settled {
    /// Elements with their new radiosities, and by how much those differ.
    pub(super) changed: Vec<(u32, Linear, f32)>,
    /// Largest difference within the limit.
    pub(super) small: f32,
}

/// One facet being settled.
pub(super) struct Below<'a, S> {
    pub(super) radiosity: &'a Field,
    pub(super) gathered: &'a Field,
    pub(super) surfaces: &'a S,
    pub(super) lit: &'a Lit,
    pub(super) limit: f32,
    /// The ways to what is concerned; `None` where everything is, small differences too.
    pub(super) way: Option<&'a Way>,
}

impl<S: Surfaces> Below<'_, S> {
    /// Pushes irradiance down and pulls radiosity up; returns the new radiosity of `id`.
    /// `concerned` says that something above has changed.
    pub(super) fn settle(
        &self,
        id: u32,
        place: &Place,
        inherited: &Linear,
        concerned: bool,
        out: &mut Settled,
    ) -> Linear {
        let concerned = concerned || self.way.is_some_and(|way| bit(&way.ends, id));
        if !concerned && self.way.is_some_and(|way| !bit(&way.on, id)) {
            return self.radiosity.get(id);
        }
        let h = self.gathered.get(id).plus(inherited);
        let children = self.surfaces.children(id);
        let b = if children.is_empty() {
            self.reflect(&h, place.radius)
        } else {
            let mut fit = Fit::default();
            for child in children {
                let at = self.surfaces.place(child);
                let b = self.settle(child, &at, &h.about(place, &at), concerned, out);
                fit.add(self.surfaces.area_m2(child), place, &at, &b);
            }
            fit.linear(place.radius)
        };
        let difference = b.difference(&self.radiosity.get(id));
        if difference > self.limit || self.way.is_none() {
            out.changed.push((id, b, difference));
        }
        if difference <= self.limit {
            out.small = out.small.max(difference);
        }
        b
    }

    fn reflect(&self, h: &Linear, radius: f32) -> Linear {
        let mut b = Linear::default();
        for c in 0..3 {
            let rho = self.lit.reflectance[c];
            // A gradient pushed down a long way may reach below zero; light does not.
            b.mean[c] = self.lit.exitance[c] + rho * h.mean[c].max(0.0);
            for axis in 0..2 {
                b.gradient[axis][c] = rho * h.gradient[axis][c] * radius;
            }
        }
        b
    }
}

/// The linear function over an element that fits those over its children best.
#[derive(Default)]
struct Fit {
    area: f64,
    mean: [f64; 3],
    first: [[f64; 3]; 2],
    moment: [f64; 3],
}

impl Fit {
    fn add(&mut self, area: f64, own: &Place, place: &Place, b: &Linear) {
        let dx = f64::from(place.centroid[0] - own.centroid[0]);
        let dy = f64::from(place.centroid[1] - own.centroid[1]);
        let [xx, xy, yy] = place.moment.map(f64::from);
        self.area += area;
        self.moment[0] += area * (dx * dx + xx);
        self.moment[1] += area * (dx * dy + xy);
        self.moment[2] += area * (dy * dy + yy);
        for c in 0..3 {
            let value = f64::from(b.mean[c]);
            let gx = f64::from(b.gradient[0][c] / place.radius);
            let gy = f64::from(b.gradient[1][c] / place.radius);
            self.mean[c] += area * value;
            self.first[0][c] += area * (dx * value + xx * gx + xy * gy);
            self.first[1][c] += area * (dy * value + xy * gx + yy * gy);
        }
    }

    fn linear(&self, radius: f32) -> Linear {
        let per_area = 1.0 / self.area;
        let [xx, xy, yy] = self.moment.map(|m| m * per_area);
        let scale = f64::from(radius) * per_area / (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
        let mut out = Linear::default();
        for c in 0..3 {
            let [x, y] = [self.first[0][c], self.first[1][c]];
            out.mean[c] = (self.mean[c] * per_area) as f32;
            out.gradient[0][c] = ((x * yy - y * xy) * scale) as f32;
            out.gradient[1][c] = ((y * xx - x * xy) * scale) as f32;
        }
        out
    }
}
