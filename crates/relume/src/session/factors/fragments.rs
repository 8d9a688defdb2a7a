//! Elements cut along the things that lie in them, and how what a link carries falls on the pieces.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::element::{ElementId, Forest, Kind, Shape, WorldElement, WorldPatch, WorldView};
use crate::geometry::{ConvexPolygon, Plane, split_convex};
use crate::pair::Link;
use crate::scene::{BodyId, Part, PatchId};
use crate::transport::{Looker, Meeting, Shaft, Simd, exact_visibility, exchange, meeting};

use super::{Grouping, Solved};

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
            _ => stack.extend(<[_; 2]>::from(split_convex(&corners))),
        }
    }
    out
}

/// How what links carry falls on fragments.
pub(super) struct Spread<'a> {
    pub(super) forest: &'a Forest,
    pub(super) view: &'a WorldView,
    pub(super) simd: Simd,
    pub(super) fragments: &'a Fragments,
    /// Bodies that are looked through, if any.
    pub(super) through: &'a [bool],
}

impl<'a> Spread<'a> {
    pub(super) fn new(solved: &'a Solved, simd: Simd, fragments: &'a Fragments) -> Spread<'a> {
        Spread { forest: &solved.forest, view: &solved.view, simd, fragments, through: &[] }
    }
}

/// A link's end, or a piece of one, with its place for light within one body and in the world.
#[derive(Clone, Copy)]
struct Place {
    own: WorldElement,
    world: WorldElement,
}

/// A link whose ends are cut.
struct Cut {
    ends: (End, End),
    /// The body that both ends ride on.
    body: Option<BodyId>,
    patches: (PatchId, PatchId),
}

struct End {
    whole: Place,
    /// Group and place of each piece; one if the end lies in one group.
    pieces: Vec<(u32, Place)>,
}

/// What a piece sees of the other end.
struct Look {
    value: f64,
    /// Middle and radius of the piece, metres.
    from: (DVec3, f64),
    is_near: bool,
    is_clear: bool,
}

/// (sum of the radii / distance)^2 above which two fragments are not points.
const POINTS: f64 = 0.01;

/// Occluding polygons up to which pieces of partly hidden links are looked at by clipping.
const CLIPPED_MAX: usize = 96;

/// Form factor of a piece to the other end times the spread of visibility over the piece above
/// which it is looked at from more points.
const CLOSER: f64 = 5e-5;

/// Pieces are side by side if their middles are closer than this share of their radii.
const BESIDE: f64 = 1.01;

/// Spread of visibility that four points which agree may have overlooked.
const UNSEEN: f64 = 0.05;

/// The same where what blocks is nearer than this many radii of the piece.
const NEAR: f64 = 2.0;

/// See [`NEAR`].
const UNSEEN_NEAR: f64 = 0.25;

/// Steps in which shares are fitted to what every piece sees.
const FITS: usize = 8;

/// Visibility of a pair of pieces relative to that of the link from which fitting starts, at least:
/// what seems hidden may have to take what others cannot.
const SEEN_MIN: f64 = 1e-3;

impl Spread<'_> {
    /// Calls `add` with two groups and the exchange area between them past occluders, m2, for what
    /// a link carries between any two groups.
    pub(super) fn spread(&self, link: &Link, add: &mut dyn FnMut(u32, u32, f64)) {
        let x = f64::from(link.carried.exchange_area_m2);
        let v = f64::from(link.carried.visibility) / 65_535.0;
        let (a, b) = (self.fragments.of[link.a.0 as usize], self.fragments.of[link.b.0 as usize]);
        if let (Lies::Within(a), Lies::Within(b)) = (a, b) {
            if a != NONE && b != NONE && v > 0.0 {
                add(a, b, x * v);
            }
            return;
        }
        let cut = self.cut(link, (a, b));
        let Some(mut shares) = self.unoccluded(&cut, x) else { return };
        // Where a link seems to be clear or hidden, some of its pieces may not be.
        let blockers = self.blockers(&cut);
        if !blockers.is_empty() {
            self.hide(&cut, v, &blockers, &mut shares);
        }
        let mut shares = shares.into_iter();
        for (p, _) in &cut.ends.0.pieces {
            for (q, _) in &cut.ends.1.pieces {
                let share = shares.next().expect("one for each pair of pieces");
                if *p != NONE && *q != NONE && share > 0.0 {
                    add(*p, *q, share);
                }
            }
        }
    }

    fn cut(&self, link: &Link, (a, b): (Lies, Lies)) -> Cut {
        let patch = |id| self.forest.patch(id).expect("elements have patches");
        let patches = (patch(link.a), patch(link.b));
        let (on_a, on_b) = (self.view.patch(patches.0), self.view.patch(patches.1));
        let body = (on_a.body == on_b.body).then_some(on_a.body);
        let end = |id, lies, on: &WorldPatch| {
            let place = |shape: &Shape| {
                let world = WorldElement::of_shape(on, shape, false);
                let own = match body {
                    Some(_) => WorldElement::of_shape(on, shape, true),
                    None => world,
                };
                Place { own, world }
            };
            let whole = place(&self.forest.shape(id));
            let pieces = match lies {
                Lies::Within(group) => vec![(group, whole)],
                Lies::Across { first, len } => {
                    let fragments = &self.fragments.fragments[first as usize..][..len as usize];
                    fragments.iter().map(|f| (f.group, place(&f.shape))).collect()
                }
            };
            End { whole, pieces }
        };
        Cut { ends: (end(link.a, a, on_a), end(link.b, b, on_b)), body, patches }
    }

    /// Exchange area of each pair of pieces without occlusion, m2: as the kernel falls on them, with
    /// the link's as the sum.
    fn unoccluded(&self, cut: &Cut, exchange_area_m2: f64) -> Option<Vec<f64>> {
        let (one, other) = (&cut.ends.0.pieces, &cut.ends.1.pieces);
        let pairs = one.iter().flat_map(|p| other.iter().map(move |q| (&p.1.own, &q.1.own)));
        let mut shares: Vec<f64> = pairs.map(|(p, q)| self.exchange(p, q)).collect();
        let sum: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share *= exchange_area_m2 / sum);
        (sum > 0.0).then_some(shares)
    }

    /// Takes away from the shares of pieces what occluders hide: each piece is looked at with the
    /// whole of the other end, and shares are fitted to what all of them see.
    fn hide(&self, cut: &Cut, v: f64, blockers: &[PatchId], shares: &mut [f64]) {
        let (one, other) = (&cut.ends.0, &cut.ends.1);
        let columns = other.pieces.len();
        let of_row = |k: usize| shares[k * columns..][..columns].iter().sum::<f64>();
        let of_column = |k: usize| shares.iter().skip(k).step_by(columns).sum::<f64>();
        let look = |ends: (&Place, &Place), looker: Looker, points: u32| {
            let shaft = self.shaft(cut, ends);
            let blockers = shaft.those_that_block(blockers);
            let v = exact_visibility(self.simd, &shaft, &blockers, (looker, points), CLIPPED_MAX)?;
            let from = match looker {
                Looker::B => &ends.1.world,
                _ => &ends.0.world,
            };
            let distance = |&patch: &PatchId| {
                self.view.fixed_box(self.forest.patch_root(patch)).distance(&from.bounds)
            };
            let is_near = blockers.iter().any(|patch| distance(patch) < NEAR * from.radius);
            let from = (from.centre, from.radius);
            Some(Look { value: v.value, from, is_near, is_clear: blockers.is_empty() })
        };
        let a_sees = self.seen_from(&one.pieces, &of_row, &|p, points| {
            look((p, &other.whole), Looker::A, points)
        });
        let b_sees = self.seen_from(&other.pieces, &of_column, &|q, points| {
            look((&one.whole, q), Looker::B, points)
        });
        let (Some(a_sees), Some(b_sees)) = (a_sees, b_sees) else {
            // Too many polygons to clip by.
            return shares.iter_mut().for_each(|share| *share *= v);
        };
        let wanted = |sees: &Vec<f64>, of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            sees.iter().enumerate().map(|(k, v)| v * of(k)).collect()
        };
        let mut rows = a_sees.as_ref().map(|sees| wanted(sees, &of_row));
        let mut down = b_sees.as_ref().map(|sees| wanted(sees, &of_column));
        let sum = |wanted: &Option<Vec<f64>>| wanted.as_ref().map_or(0.0, |w| w.iter().sum());
        match (sum(&rows), sum(&down)) {
            (0.0, 0.0) => return shares.fill(0.0),
            // What one end overlooks the other may see.
            (0.0, _) => rows = None,
            (_, 0.0) => down = None,
            (one, other) => {
                let scale = |wanted: &mut Option<Vec<f64>>, by: f64| {
                    wanted.iter_mut().flatten().for_each(|w| *w *= by);
                };
                scale(&mut rows, 0.5 * (one + other) / one);
                scale(&mut down, 0.5 * (one + other) / other);
            }
        }
        for (k, share) in shares.iter_mut().enumerate() {
            let a = a_sees.as_ref().map_or(v, |sees| sees[k / columns]);
            let b = b_sees.as_ref().map_or(v, |sees| sees[k % columns]);
            *share *= (a + b - v).clamp(SEEN_MIN, 1.0);
        }
        for _ in 0..FITS {
            if let Some(rows) = &rows {
                for (row, wanted) in shares.chunks_mut(columns).zip(rows) {
                    let sum: f64 = row.iter().sum();
                    if sum > 0.0 {
                        row.iter_mut().for_each(|share| *share *= wanted / sum);
                    }
                }
            }
            if let Some(down) = &down {
                for (k, wanted) in down.iter().enumerate() {
                    let column = || (k..shares.len()).step_by(columns);
                    let sum: f64 = column().map(|i| shares[i]).sum();
                    if sum > 0.0 {
                        column().for_each(|i| shares[i] *= wanted / sum);
                    }
                }
            }
        }
    }

    fn blockers(&self, cut: &Cut) -> Vec<PatchId> {
        let shaft = self.shaft(cut, (&cut.ends.0.whole, &cut.ends.1.whole));
        let mut narrowed = Vec::new();
        shaft.narrow(&[Forest::ROOT.0], &mut narrowed);
        let mut blockers = shaft.blockers(&narrowed);
        if !self.through.is_empty() {
            blockers.retain(|&patch| !self.through[self.view.patch(patch).body.0 as usize]);
        }
        blockers
    }

    /// Visibility of the other end from each piece of one; `Some(None)` where there is only one piece,
    /// `None` where it is not to be had.
    #[allow(clippy::option_option)]
    fn seen_from(
        &self,
        pieces: &[(u32, Place)],
        exchange_area_m2: &dyn Fn(usize) -> f64,
        look: &dyn Fn(&Place, u32) -> Option<Look>,
    ) -> Option<Option<Vec<f64>>> {
        if pieces.len() == 1 {
            return Some(None);
        }
        let looks: Vec<Look> =
            pieces.iter().map(|(_, place)| look(place, 0)).collect::<Option<_>>()?;
        let mut out = Vec::with_capacity(pieces.len());
        for (k, (first, (_, place))) in looks.iter().zip(pieces).enumerate() {
            let factor = exchange_area_m2(k) / place.own.area;
            let beside = |(other, _): &(&Look, &(u32, Place))| {
                let reach = BESIDE * (first.from.1 + other.from.1);
                first.from.0.distance_squared(other.from.0) < reach * reach
            };
            let differs = |(other, _): (&Look, &(u32, Place))| (first.value - other.value).abs();
            let spread = looks.iter().zip(pieces).filter(beside).map(differs).fold(0.0, f64::max);
            let unseen = if first.is_near { UNSEEN_NEAR } else { UNSEEN };
            // The error of n x n points on a function with kinks falls as 1 / n^2.
            out.push(match factor * spread.max(unseen) {
                _ if first.is_clear => first.value,
                s if s <= CLOSER => first.value,
                s if s <= 4.0 * CLOSER => look(place, 1)?.value,
                s if s <= 16.0 * CLOSER => look(place, 2)?.value,
                s if s <= 64.0 * CLOSER => look(place, 4)?.value,
                _ => look(place, 8)?.value,
            });
        }
        Some(Some(out))
    }

    fn shaft<'a>(&'a self, cut: &Cut, (a, b): (&'a Place, &'a Place)) -> Shaft<'a> {
        let own = cut.body.map(|body| (body, &a.own, &b.own));
        let (a, b) = (&a.world, &b.world);
        Shaft { forest: self.forest, view: self.view, a, b, own, patches: cut.patches }
    }

    /// Without occlusion, m2.
    fn exchange(&self, a: &WorldElement, b: &WorldElement) -> f64 {
        let d = b.centre - a.centre;
        let distance2 = d.length_squared();
        let reach = a.radius + b.radius;
        if reach * reach < POINTS * distance2 {
            let cosines = d.dot(a.plane.normal).max(0.0) * (-d.dot(b.plane.normal)).max(0.0);
            return a.area * b.area * cosines / (std::f64::consts::PI * distance2 * distance2);
        }
        match meeting(a, b) {
            Meeting::Away => 0.0,
            met => exchange(self.simd, a, b, met).area_m2,
        }
    }
}
