//! How irradiance bends over elements: the second order of what links bring, which they do not carry.
//!
//! Seen from one element, what all its sources send bends in one sense, and what each link leaves out adds up. It is
//! found when a solution is read, from the links and the poses; it does not change the mean over any
//! receiver. A pure query; must not know what is read.

use rayon::prelude::*;

use crate::element::{ElementId, Kind, WorldElement};
use crate::solver::{Linear, Links, Radiosity, Surfaces};
use crate::transport::{Bend, Receiver, Sender, Simd};

use super::Solved;
use super::surfaces::LitForest;

/// Coefficients of x^2, x y and y^2 about the centroid of an element, W/m4, linear RGB.
type Parabola = [[f32; 3]; 3];

/// The bends over all elements that have children: over leaves, irradiance is read as linear.
pub(super) struct Bends(Vec<Parabola>);

impl Bends {
    /// Of what links bring. Cost: a pass over all of them.
    pub(super) fn new(
        simd: Simd,
        solved: &Solved,
        (links, radiosity): (&Links, &Radiosity),
    ) -> Bends {
        let forest = &solved.forest;
        let ids = || (0..forest.len() as u32).into_par_iter().map(ElementId);
        let place = |id| {
            let is_element = forest.kind(id) == Kind::Element;
            is_element.then(|| WorldElement::new(&solved.view, forest, id, false))
        };
        let sender = |id| place(id).map(|e| Sender::new(&e));
        let senders: Vec<Option<Sender>> = ids().map(sender).collect();
        let of = |id: ElementId| {
            let mut sum = Parabola::default();
            if links.of(id.0).is_empty() || forest.children(id).is_empty() {
                return sum;
            }
            let Some(element) = place(id) else { return sum };
            let receiver = Receiver::new(&element, forest.extent(id).second_moment);
            for link in links.of(id.0) {
                let bend = match forest.light(ElementId(link.source)) {
                    None => receiver
                        .bend(simd, senders[link.source as usize].as_ref().expect("an element")),
                    Some(light) => {
                        let light = solved.view.light(light);
                        light.map_or(Bend::default(), |l| receiver.light_bend(l))
                    }
                };
                let sent = radiosity.radiosity(link.source);
                for (sum, bend) in sum.iter_mut().zip(bend) {
                    for (sum, b) in sum.iter_mut().zip(sent) {
                        *sum += bend as f32 * link.coupling * b;
                    }
                }
            }
            sum
        };
        Bends(ids().map(of).collect())
    }

    /// Adds what a leaf's ancestors bring to its irradiance.
    pub(super) fn add(&self, surfaces: &LitForest<'_>, leaf: u32, h: &mut Linear) {
        let at = surfaces.place(leaf);
        let mut above = surfaces.parent(leaf);
        while let Some(id) = above {
            let own = surfaces.place(id);
            let [x, y] = [0, 1].map(|k| at.centroid[k] - own.centroid[k]);
            // The mean over the leaf, less that over the receiver, which its links bring.
            let [xx, xy, yy] = [0, 1, 2].map(|k| at.moment[k] - own.moment[k]);
            let [p, q, r] = &self.0[id as usize];
            for c in 0..3 {
                h.mean[c] += p[c] * (x * x + xx) + q[c] * (x * y + xy) + r[c] * (y * y + yy);
                h.gradient[0][c] += 2.0 * p[c] * x + q[c] * y;
                h.gradient[1][c] += 2.0 * r[c] * y + q[c] * x;
            }
            above = surfaces.parent(id);
        }
    }
}
