//! How irradiance bends over elements: the second order of what links bring, which they do not carry.
//!
//! Seen from one element, what all its sources send bends in one sense, and what each link leaves out adds up. It is
//! found when a solution is read, from the links and the poses; it changes neither the mean over a receiver nor the
//! line through it. A pure query; must not know what is read.

use crate::element::{ElementId, Forest, WorldElement};
use crate::solver::{Linear, Links, Radiosity};
use crate::transport::{Bend, Receiver};

use crate::space::{Solved, SpaceState};

/// A polynomial about a point of a patch: coefficients of 1, x, y, x x, x y and y y, W/m2 and metres,
/// linear RGB.
type Polynomial = [[f64; 3]; 6];

/// Bends of what some links bring.
pub(super) struct Bends<'a> {
    pub(super) solved: &'a Solved,
    pub(super) links: &'a Links,
    pub(super) radiosity: &'a Radiosity,
}

impl Bends<'_> {
    /// What the irradiance of each leaf of a facet is to be changed by, children in order (gradients per metre). Over
    /// a leaf it is read as linear, so the links of leaves themselves are left out.
    ///
    /// Cost: a pass over the links of all others, some 90 ns each.
    pub(super) fn of_leaves(&self, facet: u32) -> Vec<Linear> {
        let mut out = Vec::new();
        self.push(facet, Polynomial::default(), &mut out);
        out
    }

    /// The same of one leaf of a facet. Cost: a pass over the links of all elements above it.
    pub(super) fn of_leaf(&self, facet: u32, leaf: u32) -> Linear {
        let forest = &self.solved.space.forest;
        let mut above = vec![leaf];
        while let Some(&id) = above.last()
            && id != facet
            && let Some(ElementId(parent)) = forest.parent(ElementId(id))
        {
            above.push(parent);
        }
        let mut whole = Polynomial::default();
        for pair in above.windows(2).rev() {
            let [child, id] = [pair[0], pair[1]];
            self.add_own(id, &mut whole);
            let centroid = |id| forest.extent(ElementId(id)).centroid;
            let to = centroid(child) - centroid(id);
            whole = about(&whole, to.x, to.y);
        }
        over_leaf(forest, leaf, &whole)
    }

    fn push(&self, id: u32, inherited: Polynomial, out: &mut Vec<Linear>) {
        let forest = &self.solved.space.forest;
        let children = forest.children(ElementId(id));
        if children.is_empty() {
            return out.push(over_leaf(forest, id, &inherited));
        }
        let mut whole = inherited;
        self.add_own(id, &mut whole);
        let own = forest.extent(ElementId(id)).centroid;
        for child in children {
            let to = forest.extent(ElementId(child)).centroid - own;
            self.push(child, about(&whole, to.x, to.y), out);
        }
    }

    /// Adds what an element's own links bring.
    fn add_own(&self, id: u32, to: &mut Polynomial) {
        let SpaceState { forest, view, .. } = &self.solved.space;
        let links = self.links.of(id);
        if links.is_empty() {
            return;
        }
        let place = |id| WorldElement::new(view, forest, id, false);
        let element = place(ElementId(id));
        let receiver = Receiver::new(&element);
        let mut sums = [Bend::default(); 3];
        for link in links {
            let source = ElementId(link.source);
            let sent = self.radiosity.radiosity(link.source);
            if sent == [0.0; 3] {
                continue;
            }
            let bend = match forest.light(source) {
                Some(light) => match view.light(light) {
                    Some(light) => receiver.light_bend(light),
                    None => continue,
                },
                None => receiver.bend(self.solved.space.tuning.simd, &place(source)),
            };
            for (sum, sent) in sums.iter_mut().zip(sent) {
                let brings = f64::from(link.coupling) * f64::from(sent);
                sum.iter_mut().zip(bend).for_each(|(sum, bend)| *sum += brings * bend);
            }
        }
        for (channel, sum) in sums.into_iter().enumerate() {
            let terms = receiver.polynomial(sum);
            to.iter_mut().zip(terms).for_each(|(to, term)| to[channel] += term);
        }
    }
}

/// A polynomial about another point.
fn about([one, x, y, xx, xy, yy]: &Polynomial, dx: f64, dy: f64) -> Polynomial {
    let each = |f: &dyn Fn(usize) -> f64| [0, 1, 2].map(f);
    [
        each(&|c| {
            let line = one[c] + x[c] * dx + y[c] * dy;
            line + xx[c] * dx * dx + xy[c] * dx * dy + yy[c] * dy * dy
        }),
        each(&|c| x[c] + 2.0 * xx[c] * dx + xy[c] * dy),
        each(&|c| y[c] + 2.0 * yy[c] * dy + xy[c] * dx),
        *xx,
        *xy,
        *yy,
    ]
}

/// The mean of a polynomial over a leaf, about whose centroid it is, and its slope there.
fn over_leaf(forest: &Forest, leaf: u32, [one, x, y, xx, xy, yy]: &Polynomial) -> Linear {
    let [mxx, mxy, myy] = forest.shape(ElementId(leaf)).exact_second_moment();
    let mean = [0, 1, 2].map(|c| (one[c] + xx[c] * mxx + xy[c] * mxy + yy[c] * myy) as f32);
    Linear { mean, gradient: [x.map(|g| g as f32), y.map(|g| g as f32)] }
}
