//! What links bring to every leaf, in place of a line through the whole end that they have.
//!
//! A leaf below the end of a link inherits a straight line from it. Along edges between walls, and across the
//! edges of shadows, the truth is steep and bent. Here each link is shared out among the leaves below its ends,
//! as the kernel falls on them and past what hides it from each. The solution stays as it is: this is
//! how it is read.

use rayon::prelude::*;

use crate::element::{ElementId, Forest, Kind, Shape};
use crate::pair::{Gradients, Link};
use crate::solver::Surfaces;

use super::compare::mean_radiosity;
use super::pieces::Sharing;
use super::surfaces::LitForest;
use super::{Session, Solved};

/// Links whose line is off by less than this share of the tolerance times the mean radiosity are
/// left as they are.
const DIM: f64 = 0.001;

/// Links that one task looks at.
const LINKS_AT_ONCE: usize = 512;

/// Times that what corrections change is passed on to those who see it: reflected twice and more it is
/// below what links err by.
const PASSES: usize = 3;

/// What a leaf receives of a source beyond its line: irradiance for each unit of radiosity.
struct More {
    leaf: u32,
    source: u32,
    share: f32,
}

/// By how much the irradiance of every leaf differs from what it inherits, W/m2; by element, 0 for all
/// that are no leaves.
pub(super) fn corrections(session: &Session, solved: &Solved) -> Vec<[f32; 3]> {
    let forest = &solved.forest;
    let surfaces = LitForest::new(&session.scene, forest);
    let at = Reconstruction {
        solved,
        sharing: Sharing::new(session, solved),
        leaves: Leaves::of(forest),
        dim_w_m2: DIM * session.options.tolerance * mean_radiosity(session),
    };
    let links: Vec<Link> = solved.tree.links().collect();
    let of_links = |links: &[Link]| {
        let mut found = Vec::new();
        links.iter().for_each(|link| at.add_link(link, &mut found));
        found
    };
    let found: Vec<Vec<More>> = links.par_chunks(LINKS_AT_ONCE).map(of_links).collect();
    let mut out = vec![[0.0; 3]; forest.len()];
    let mut last: Vec<[f32; 3]> =
        (0..forest.len() as u32).map(|id| solved.radiosity.linear(id).mean).collect();
    for pass in 0..=PASSES {
        let mut arrives = vec![[0.0; 3]; forest.len()];
        if pass > 0 {
            at.along_lines(&links, &last, &mut arrives);
        }
        for more in found.iter().flatten() {
            add(&mut arrives[more.leaf as usize], last[more.source as usize], more.share);
        }
        // Only leaves count: what reached the others has been handed down.
        last = vec![[0.0; 3]; forest.len()];
        for &leaf in &at.leaves.ids {
            let rho = surfaces.lit(forest.fixed(ElementId(leaf)).0).reflectance;
            let more = arrives[leaf as usize];
            add(&mut out[leaf as usize], more, 1.0);
            last[leaf as usize] = std::array::from_fn(|c| rho[c] * more[c]);
        }
        forest.facets().iter().for_each(|&facet| pull(forest, facet, &mut last));
    }
    out
}

fn add(to: &mut [f32; 3], what: [f32; 3], times: f32) {
    (0..3).for_each(|c| to[c] += times * what[c]);
}

/// Gives every element the mean of the leaves below it.
fn pull(forest: &Forest, id: ElementId, values: &mut [[f32; 3]]) {
    let children = forest.children(id);
    if children.is_empty() {
        return;
    }
    let mut sum = [0.0; 3];
    for child in children {
        pull(forest, ElementId(child), values);
        add(&mut sum, values[child as usize], forest.area_m2(ElementId(child)) as f32);
    }
    let area = forest.area_m2(id) as f32;
    values[id.0 as usize] = sum.map(|v| v / area);
}

/// Hands down what every element receives to its leaves.
fn push(forest: &Forest, id: ElementId, values: &mut [[f32; 3]]) {
    let own = values[id.0 as usize];
    for child in forest.children(id) {
        add(&mut values[child as usize], own, 1.0);
        push(forest, ElementId(child), values);
    }
}

/// The leaves of a forest in depth-first order, so that those below an element are side by side.
struct Leaves {
    ids: Vec<u32>,
    shapes: Vec<Shape>,
    /// By element.
    below: Vec<(u32, u32)>,
}

impl Leaves {
    fn of(forest: &Forest) -> Leaves {
        let below = vec![(0, 0); forest.len()];
        let mut out = Leaves { ids: Vec::new(), shapes: Vec::new(), below };
        forest.facets().iter().for_each(|&facet| out.add(forest, facet));
        out
    }

    fn add(&mut self, forest: &Forest, id: ElementId) {
        let start = self.ids.len() as u32;
        let children = forest.children(id);
        if children.is_empty() {
            self.ids.push(id.0);
            self.shapes.push(forest.shape(id));
        }
        children.for_each(|child| self.add(forest, ElementId(child)));
        self.below[id.0 as usize] = (start, self.ids.len() as u32);
    }

    fn below(&self, id: ElementId) -> (&[u32], &[Shape]) {
        let (start, end) = self.below[id.0 as usize];
        let range = start as usize..end as usize;
        (&self.ids[range.clone()], &self.shapes[range])
    }
}

struct Reconstruction<'a> {
    solved: &'a Solved,
    sharing: Sharing<'a>,
    leaves: Leaves,
    dim_w_m2: f64,
}

impl Reconstruction<'_> {
    fn is_between_elements(&self, link: &Link) -> bool {
        let is_element = |id| self.solved.forest.kind(id) == Kind::Element;
        link.carried.visibility > 0 && is_element(link.a) && is_element(link.b)
    }

    /// What links carry of a radiosity by element, without gradients; at the leaves.
    fn along_lines(&self, links: &[Link], radiosity: &[[f32; 3]], arrives: &mut [[f32; 3]]) {
        let forest = &self.solved.forest;
        for link in links.iter().filter(|link| self.is_between_elements(link)) {
            let whole = link.carried.exchange_area_past_occluders_m2();
            for (receiver, source) in [(link.a, link.b), (link.b, link.a)] {
                let b = radiosity[source.0 as usize];
                add(&mut arrives[receiver.0 as usize], b, whole / forest.area_m2(receiver) as f32);
            }
        }
        forest.facets().iter().for_each(|&facet| push(forest, facet, arrives));
    }

    fn add_link(&self, link: &Link, found: &mut Vec<More>) {
        if self.is_between_elements(link) {
            let g = link.carried.gradients;
            self.add(link, (link.a, g.over_a), link.b, found);
            self.add(link, (link.b, g.over_b), link.a, found);
        }
    }

    /// What one end receives.
    fn add(
        &self,
        link: &Link,
        (receiver, over): (ElementId, [i8; 2]),
        source: ElementId,
        found: &mut Vec<More>,
    ) {
        let forest = &self.solved.forest;
        let (ids, shapes) = self.leaves.below(receiver);
        if ids.len() < 2 {
            return;
        }
        let sends = self.solved.radiosity.linear(source.0).mean;
        let brightest = f64::from(sends.iter().fold(0.0_f32, |m, b| m.max(*b)));
        let whole = f64::from(link.carried.exchange_area_past_occluders_m2());
        let (place, area) = (forest.extent(receiver), forest.area_m2(receiver));
        if brightest * whole / area * self.bend(link) <= self.dim_w_m2 {
            return;
        }
        let other = [forest.shape(source)];
        let ends = if receiver == link.a { (shapes, &other[..]) } else { (&other[..], shapes) };
        let Some(shares) = self.sharing.shares(link, ends) else { return };
        let slope = over.map(|step| f64::from(Gradients::value(step)) / place.radius);
        for ((leaf, shape), share) in ids.iter().zip(shapes).zip(shares) {
            let d = shape.centroid() - place.centroid;
            let line = whole / area * (1.0 + slope[0] * d.x + slope[1] * d.y);
            let share = (share / shape.area() - line) as f32;
            found.push(More { leaf: *leaf, source: source.0, share });
        }
    }

    /// How far a line may be off, relative to the mean: without occlusion the square of size over
    /// distance.
    fn bend(&self, link: &Link) -> f64 {
        if link.carried.visibility < u16::MAX {
            return 1.0;
        }
        let (a, b) = self.sharing.whole(link);
        let (size, distance2) = (a.radius.max(b.radius), (b.centre - a.centre).length_squared());
        (size * size / distance2).min(1.0)
    }
}
