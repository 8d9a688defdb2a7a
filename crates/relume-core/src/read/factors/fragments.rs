//! Elements cut along the things that lie in them, and how what a link carries falls on the pieces.

use glam::DVec2;
use rayon::prelude::*;

use crate::element::{ElementId, Forest, Kind, Shape};
use crate::geometry::{ConvexPolygon, Plane, split_convex};
use crate::pair::Link;
use crate::scene::{Part, PatchId};

use crate::read::pieces::Sharing;

use super::Grouping;

/// No group.
const NONE: u32 = u32::MAX;

/// Pieces below this share of an element's area are rounding.
const SLIVER: f64 = 1e-9;

/// A piece of an element that belongs to one group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment {
    /// `NONE` where it belongs to none.
    group: u32,
    /// In the patch's frame.
    shape: Shape,
}

/// The fragments of all elements.
pub(super) struct Fragments {
    /// By element: its group if that is all it lies in, else the range of its fragments.
    of: Vec<Lies>,
    fragments: Vec<Fragment>,
}

#[derive(Clone, Copy, Debug)]
enum Lies {
    Within(u32),
    Across { first: u32, len: u32 },
}

impl Fragments {
    /// Every element in the group of its patch.
    pub(super) fn whole(forest: &Forest, grouping: &Grouping) -> Fragments {
        let group = |patch: PatchId| grouping.of_patch[patch.0 as usize].unwrap_or(NONE);
        let of = |id| Lies::Within(forest.patch(ElementId(id)).map_or(NONE, group));
        Fragments { of: (0..forest.len() as u32).map(of).collect(), fragments: Vec::new() }
    }

    /// Elements cut along the parts of their patches, each of which is in a group.
    pub(super) fn of_parts(forest: &Forest, parts: &[Vec<Part>], grouping: &Grouping) -> Fragments {
        let mut out =
            Fragments { of: vec![Lies::Within(NONE); forest.len()], fragments: Vec::new() };
        let cut = |(patch, parts): (usize, &Vec<Part>)| {
            let root = forest.patch_root(PatchId(patch as u32));
            let group = |part: &Part| grouping.of_patch[part.patch.0 as usize].unwrap_or(NONE);
            let mut cutter = Cutter { forest, found: Vec::new() };
            let first = group(&parts[0]);
            if parts.iter().all(|part| group(part) == first) {
                cutter.give(root, first);
            } else {
                let pieces = parts.iter().flat_map(|part| {
                    let group = group(part);
                    shapes(&part.corners).into_iter().map(move |shape| (group, flat(&shape)))
                });
                cutter.cut(root, pieces.collect());
            }
            cutter.found
        };
        let found: Vec<_> = parts.par_iter().enumerate().map(cut).collect();
        for (id, group, fragments) in found.into_iter().flatten() {
            out.of[id as usize] = match group {
                Some(group) => Lies::Within(group),
                None => {
                    let first = out.fragments.len() as u32;
                    let len = fragments.len() as u32;
                    out.fragments.extend(fragments);
                    Lies::Across { first, len }
                }
            };
        }
        out
    }
}

/// A shape of a plane as a polygon of space, at height 0.
fn flat(shape: &Shape) -> ConvexPolygon {
    ConvexPolygon::new(&shape.corners.map(|c| c.extend(0.0))[..shape.len])
}

/// Goes down from a patch.
struct Cutter<'a> {
    forest: &'a Forest,
    /// Element, the group that it is in or `None`, its fragments.
    found: Vec<(u32, Option<u32>, Vec<Fragment>)>,
}

impl Cutter<'_> {
    fn give(&mut self, id: ElementId, group: u32) {
        self.found.push((id.0, Some(group), Vec::new()));
        self.forest.children(id).for_each(|child| self.give(ElementId(child), group));
    }

    fn cut(&mut self, id: ElementId, pieces: Vec<(u32, ConvexPolygon)>) {
        if let Some((group, _)) = pieces.first()
            && pieces.iter().all(|piece| piece.0 == *group)
        {
            return self.give(id, *group);
        }
        if self.forest.kind(id) == Kind::Element {
            let fragments = pieces.iter().flat_map(|(group, polygon)| {
                let corners: Vec<DVec2> = polygon.corners().iter().map(|c| c.truncate()).collect();
                shapes(&corners).into_iter().map(|shape| Fragment { group: *group, shape })
            });
            self.found.push((id.0, None, fragments.collect()));
        }
        for child in self.forest.children(id) {
            let child = ElementId(child);
            let pieces = match self.forest.kind(child) {
                Kind::Element => {
                    let shape = self.forest.shape(child);
                    let inside = |(group, polygon): &(u32, ConvexPolygon)| {
                        let polygon = within(polygon, &shape);
                        (area(&polygon) > SLIVER * shape.area()).then_some((*group, polygon))
                    };
                    pieces.iter().filter_map(inside).collect()
                }
                _ => pieces.clone(),
            };
            self.cut(child, pieces);
        }
    }
}

fn area(polygon: &ConvexPolygon) -> f64 {
    let c = polygon.corners();
    let side = |k: usize| c[k].truncate().perp_dot(c[(k + 1) % c.len()].truncate());
    (0..c.len()).map(side).sum::<f64>() * 0.5
}

/// The part of a polygon in an element.
fn within(polygon: &ConvexPolygon, shape: &Shape) -> ConvexPolygon {
    let mut out = *polygon;
    for k in 0..shape.len {
        let (from, to) = (shape.corners[k], shape.corners[(k + 1) % shape.len]);
        let inward = (to - from).perp().normalize_or_zero().extend(0.0);
        out = out.clipped(&Plane::through(from.extend(0.0), inward), 0.0);
    }
    out
}

/// A convex polygon in pieces of up to four corners.
fn shapes(corners: &[DVec2]) -> Vec<Shape> {
    let mut out = Vec::new();
    let mut stack = vec![corners.to_vec()];
    while let Some(corners) = stack.pop() {
        match corners.len() {
            0..3 => {}
            3 | 4 => out.push(Shape::new(&corners)),
            _ => stack.extend(split_convex(&corners)),
        }
    }
    out
}

/// How what links carry falls on fragments.
#[derive(Clone, Copy)]
pub(super) struct Spread<'a> {
    pub(super) sharing: Sharing<'a>,
    pub(super) fragments: &'a Fragments,
}

impl Spread<'_> {
    /// Calls `add` with two groups and the exchange area between them past occluders, m2, for what
    /// a link carries between any two groups.
    pub(super) fn spread(&self, link: &Link, add: &mut dyn FnMut(u32, u32, f64)) {
        let of = |id: ElementId| self.fragments.of[id.0 as usize];
        let counts = |id| !matches!(of(id), Lies::Within(NONE));
        if !counts(link.a) || !counts(link.b) {
            return;
        }
        if let (Lies::Within(a), Lies::Within(b)) = (of(link.a), of(link.b)) {
            if link.carried.visibility > 0 {
                let v = f64::from(link.carried.visibility) / 65_535.0;
                add(a, b, f64::from(link.carried.exchange_area_m2) * v);
            }
            return;
        }
        let (a, b) = (self.pieces(link.a), self.pieces(link.b));
        let Some(shares) = self.sharing.shares(link, (&a.1, &b.1)) else { return };
        let pairs = a.0.iter().flat_map(|p| b.0.iter().map(move |q| (*p, *q)));
        for ((p, q), share) in pairs.zip(shares) {
            if p != NONE && q != NONE && share > 0.0 {
                add(p, q, share);
            }
        }
    }

    fn pieces(&self, id: ElementId) -> (Vec<u32>, Vec<Shape>) {
        match self.fragments.of[id.0 as usize] {
            Lies::Within(group) => (vec![group], vec![self.sharing.shape(id)]),
            Lies::Across { first, len } => {
                let fragments = &self.fragments.fragments[first as usize..][..len as usize];
                fragments.iter().map(|f| (f.group, f.shape)).unzip()
            }
        }
    }
}
