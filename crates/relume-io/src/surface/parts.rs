//! Polygons cut where an image on them changes most.
//!
//! A part is cut along a line of constant texture coordinate, at a border of texels, where that tells most: where the
//! squares of the means of the parts, weighed with their areas, grow most. The best cut of all goes first, as long as
//! it gains [`CUT_GAIN`](crate::tuning::CUT_GAIN) of the squares of all that the image shows. Must not know what the image is of.

use glam::DVec2;

use crate::tuning::{CUT_PARTS_MAX, CUT_PLACES, CUT_ROUNDS, CUT_SHARE_MIN};
use relume_core::geometry::part_in_front;

/// A part: its texture coordinates, their area and what the image sums to over it, both in texels.
pub(crate) struct Part {
    pub(crate) corners: Vec<DVec2>,
    pub(crate) area: f64,
    sum: f64,
}

/// An image on a plane of texture coordinates.
pub(crate) trait Field {
    /// Area and integral over a convex polygon, in texels.
    fn integral(&self, corners: &[DVec2]) -> (f64, f64);

    /// Texels along each axis for a unit of texture coordinates.
    fn texels(&self) -> [f64; 2];
}

struct Cut {
    axis: usize,
    at: f64,
    gain: f64,
}

/// The parts of a convex polygon of texture coordinates, of cuts that gain at least `least`; one where none does.
pub(crate) fn parts(field: &dyn Field, corners: Vec<DVec2>, least: f64) -> Vec<Part> {
    let whole = Part::of(field, corners);
    let smallest = whole.area * CUT_SHARE_MIN;
    let first = best_cut(field, &whole, smallest);
    let mut parts = vec![(whole, first)];
    while parts.len() < CUT_PARTS_MAX {
        let gain = |k: usize| parts[k].1.as_ref().map_or(0.0, |cut| cut.gain);
        let next = (0..parts.len()).fold(0, |best, k| if gain(k) > gain(best) { k } else { best });
        if gain(next) < least || gain(next) <= 0.0 {
            break;
        }
        let (part, cut) = parts.swap_remove(next);
        let cut = cut.expect("it gains");
        for corners in [half(&part.corners, &cut, 1.0), half(&part.corners, &cut, -1.0)] {
            let part = Part::of(field, corners);
            let cut = best_cut(field, &part, smallest);
            parts.push((part, cut));
        }
    }
    parts.into_iter().map(|part| part.0).collect()
}

impl Part {
    fn of(field: &dyn Field, corners: Vec<DVec2>) -> Part {
        let (area, sum) = field.integral(&corners);
        Part { corners, area, sum }
    }
}

fn best_cut(field: &dyn Field, part: &Part, smallest: f64) -> Option<Cut> {
    let cuts = [0, 1].into_iter().filter_map(|axis| Search { field, part, axis, smallest }.best());
    cuts.fold(None, |best: Option<Cut>, cut| match best {
        Some(best) if best.gain >= cut.gain => Some(best),
        _ => Some(cut),
    })
}

/// The search for the best cut along one axis.
struct Search<'a> {
    field: &'a dyn Field,
    part: &'a Part,
    axis: usize,
    smallest: f64,
}

impl Search<'_> {
    fn best(&self) -> Option<Cut> {
        let texels = self.field.texels()[self.axis];
        let along = || self.part.corners.iter().map(|p| p[self.axis] * texels);
        let (low, high) = along().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        let (mut from, mut to) = ((low.floor(), (0.0, 0.0)), high.ceil());
        let mut best = None;
        for _ in 0..CUT_ROUNDS {
            let step = ((to - from.0) / CUT_PLACES as f64).ceil().max(1.0);
            let places = self.places(from, to, step, texels);
            let gain = |k: usize| self.gain(places[k].1);
            let k = (1..places.len()).reduce(|a, b| if gain(b) > gain(a) { b } else { a })?;
            best = Some(Cut { axis: self.axis, at: places[k].0 / texels, gain: gain(k) });
            if step <= 1.0 {
                break;
            }
            // On with the slabs on both sides of the best place.
            (from, to) = (places[k - 1], (places[k].0 + step).min(to));
        }
        best
    }

    /// Borders of texels from one whose left side is known to less than another, each with area and sum of what lies to
    /// its left.
    fn places(
        &self,
        from: (f64, (f64, f64)),
        to: f64,
        step: f64,
        texels: f64,
    ) -> Vec<(f64, (f64, f64))> {
        let mut places = vec![from];
        let (mut at, mut left) = from;
        while at + step < to {
            let slab = self.slab(at / texels, (at + step) / texels);
            (at, left) = (at + step, (left.0 + slab.0, left.1 + slab.1));
            places.push((at, left));
        }
        places
    }

    /// Area and sum between two places.
    fn slab(&self, from: f64, to: f64) -> (f64, f64) {
        let cut = |at| Cut { axis: self.axis, at, gain: 0.0 };
        let corners = half(&half(&self.part.corners, &cut(to), 1.0), &cut(from), -1.0);
        if corners.len() < 3 { (0.0, 0.0) } else { self.field.integral(&corners) }
    }

    /// What the squares of the means grow by where the part is cut so that this is on one side.
    fn gain(&self, left: (f64, f64)) -> f64 {
        let right = (self.part.area - left.0, self.part.sum - left.1);
        if left.0 < self.smallest || right.0 < self.smallest {
            return 0.0;
        }
        let square = |(area, sum): (f64, f64)| sum * sum / area;
        square(left) + square(right) - square((self.part.area, self.part.sum))
    }
}

/// The half of a polygon below a cut (`side` 1) or above it (-1); its new corners lie on the cut, bit for bit.
fn half(corners: &[DVec2], cut: &Cut, side: f64) -> Vec<DVec2> {
    let mut out = part_in_front(corners, |p| (cut.at - p[cut.axis]) * side);
    for p in out.iter_mut().filter(|p| !corners.contains(p)) {
        p[cut.axis] = cut.at;
    }
    out
}
