//! How what a link carries falls on pieces of its ends.
//!
//! Without occlusion as the kernel falls on them, past occluders as each piece sees the whole of the other
//! end. A pure query about links, elements and poses; must not know what the pieces are for.

use glam::DVec3;

use crate::element::{ElementId, Forest, Shape, WorldElement, WorldPatch, WorldView};
use crate::pair::Link;
use crate::scene::{BodyId, PatchId};
use crate::transport::{
    Exchange, Meeting, Shaft, Side, Simd, contact_exchange, exchange, exchange_of_points, meeting,
    overlap_m2, prepare_view,
};

use super::tuning::{
    AROUND, FITS, PIECES_APART, PIECES_CELLS_MAX, PIECES_CLIPPED_MAX, PIECES_CLOSER, PIECES_NEAR,
    PIECES_UNSEEN, PIECES_UNSEEN_NEAR, PIECES_UNSEEN_PARTLY, SEEN_MIN,
};
use crate::read::tuning::{BESIDE, OPPOSITE};
use crate::space::{Solved, SpaceState};

/// What is needed to share out what links carry.
#[derive(Clone, Copy)]
pub(super) struct Sharing<'a> {
    forest: &'a Forest,
    view: &'a WorldView,
    simd: Simd,
    /// See [`PIECES_CLOSER`].
    closer: f64,
    /// Bodies that are looked through, if any.
    through: &'a [bool],
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
    /// One if it is not cut.
    pieces: Vec<Place>,
}

/// What a piece sees of the other end.
struct Look {
    value: f64,
    /// Middle and radius of the piece, metres.
    from: (DVec3, f64),
    is_near: bool,
    is_clear: bool,
}

impl<'a> Sharing<'a> {
    pub(super) fn new(solved: &'a Solved) -> Sharing<'a> {
        let SpaceState { forest, view, tuning, .. } = &solved.space;
        let closer = PIECES_CLOSER * tuning.tolerance;
        Sharing { forest, view, simd: tuning.simd, closer, through: &[] }
    }

    /// The same for links that end in another forest of the scene, looking through some bodies.
    pub(super) fn of_forest(self, forest: &'a Forest, through: &'a [bool]) -> Sharing<'a> {
        Sharing { forest, through, ..self }
    }

    /// An element within its patch.
    pub(super) fn shape(&self, id: ElementId) -> Shape {
        self.forest.shape(id)
    }

    /// Both ends of a link in the world.
    pub(super) fn whole(&self, link: &Link) -> (WorldElement, WorldElement) {
        let place = |id| WorldElement::new(self.view, self.forest, id, false);
        (place(link.a), place(link.b))
    }

    /// Exchange area past occluders of each pair of pieces of both ends, m2, the pieces of the second
    /// end running fastest; an end in one piece is whole. `None` where they exchange nothing.
    pub(super) fn shares(&self, link: &Link, (a, b): (&[Shape], &[Shape])) -> Option<Vec<f64>> {
        self.shares_that_vary(link, (a, b)).map(|(shares, _)| shares)
    }

    /// The same, and how each varies over its two pieces without occlusion.
    pub(super) fn shares_that_vary(
        &self,
        link: &Link,
        (a, b): (&[Shape], &[Shape]),
    ) -> Option<(Vec<f64>, Vec<Exchange>)> {
        let cut = self.cut(link, (a, b));
        let exchanges = self.exchanges(&cut);
        let sum: f64 = exchanges.iter().map(|x| x.area_m2).sum();
        if sum <= 0.0 {
            return None;
        }
        let whole = f64::from(link.carried.exchange_area_m2);
        let mut shares: Vec<f64> = exchanges.iter().map(|x| x.area_m2 * whole / sum).collect();
        // Where a link seems to be clear or hidden, some of its pieces may not be.
        let blockers = self.blockers(&cut);
        if !blockers.is_empty() {
            let v = f64::from(link.carried.visibility) / 65_535.0;
            self.hide(&cut, v, &blockers, &mut shares);
        }
        Some((shares, exchanges))
    }

    /// Visibility of one end of a link from the whole of the other, looked at as closely as pieces are;
    /// `None` past too many occluders to clip by.
    pub(super) fn visibility_from(&self, link: &Link, observer: Side) -> Option<f64> {
        let whole = [link.a, link.b].map(|id| [self.forest.shape(id)]);
        let cut = self.cut(link, (&whole[0], &whole[1]));
        let blockers = self.blockers(&cut);
        let ends = (&cut.ends.0.whole, &cut.ends.1.whole);
        let from = if observer == Side::B { ends.1 } else { ends.0 };
        let all = |_| f64::from(link.carried.exchange_area_m2);
        let see = || self.seen_from(&cut, observer, std::slice::from_ref(from), &blockers, &all)[0];
        (self.shaft(&cut, ends).occluders(&blockers) <= PIECES_CLIPPED_MAX).then(see)
    }

    fn cut(&self, link: &Link, (a, b): (&[Shape], &[Shape])) -> Cut {
        let patch = |id| self.forest.patch(id).expect("elements have patches");
        let patches = (patch(link.a), patch(link.b));
        let (on_a, on_b) = (self.view.patch(patches.0), self.view.patch(patches.1));
        let body = (on_a.body == on_b.body).then_some(on_a.body);
        let end = |id, shapes: &[Shape], on: &WorldPatch| {
            let place = |shape: &Shape| {
                let world = WorldElement::of_shape(on, shape, false);
                let own = match body {
                    Some(_) => WorldElement::of_shape(on, shape, true),
                    None => world,
                };
                Place { own, world }
            };
            End { whole: place(&self.forest.shape(id)), pieces: shapes.iter().map(place).collect() }
        };
        Cut { ends: (end(link.a, a, on_a), end(link.b, b, on_b)), body, patches }
    }

    /// Exchange of each pair of pieces without occlusion.
    fn exchanges(&self, cut: &Cut) -> Vec<Exchange> {
        let (one, other) = (&cut.ends.0.pieces, &cut.ends.1.pieces);
        let pairs = one.iter().flat_map(|p| other.iter().map(move |q| (&p.own, &q.own)));
        pairs.map(|(p, q)| self.exchange(p, q)).collect()
    }

    /// Takes away from the shares of pieces what occluders hide: each piece is looked at with the
    /// whole of the other end, and shares are fitted to what all of them see.
    fn hide(&self, cut: &Cut, v: f64, blockers: &[PatchId], shares: &mut [f64]) {
        let (one, other) = (&cut.ends.0, &cut.ends.1);
        let columns = other.pieces.len();
        let of_row = |k: usize| shares[k * columns..][..columns].iter().sum::<f64>();
        let of_column = |k: usize| shares.iter().skip(k).step_by(columns).sum::<f64>();
        if self.shaft(cut, (&one.whole, &other.whole)).occluders(blockers) > PIECES_CLIPPED_MAX {
            return shares.iter_mut().for_each(|share| *share *= v);
        }
        // An end in one piece sees what the pieces of the other see together.
        let a_sees = (one.pieces.len() > 1)
            .then(|| self.seen_from(cut, Side::A, &one.pieces, blockers, &of_row));
        let b_sees = (other.pieces.len() > 1)
            .then(|| self.seen_from(cut, Side::B, &other.pieces, blockers, &of_column));
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
        // To one side alone they fit at once.
        let fits = if rows.is_some() && down.is_some() { FITS } else { 1 };
        for _ in 0..fits {
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

    /// Visibility of the other end from each piece of one.
    fn seen_from(
        &self,
        cut: &Cut,
        observer: Side,
        pieces: &[Place],
        blockers: &[PatchId],
        exchange_area_m2: &dyn Fn(usize) -> f64,
    ) -> Vec<f64> {
        let whole = (&cut.ends.0.whole, &cut.ends.1.whole);
        let mut from = prepare_view(self.simd, &self.shaft(cut, whole), blockers, observer);
        let values = from.from_middles(pieces.iter().map(|place| &place.own));
        let looks: Vec<Look> = pieces
            .iter()
            .zip(values)
            .map(|(place, value)| {
                let ends = if observer == Side::B { (whole.0, place) } else { (place, whole.1) };
                let blockers = self.shaft(cut, ends).those_that_block(blockers);
                // Within one body as it is in that body's frame.
                let distance = |&patch: &PatchId| {
                    let root = self.forest.patch_root(patch);
                    match cut.body == Some(self.view.patch(patch).body) {
                        true => self.view.box_in_body(root).distance(&place.own.bounds),
                        false => self.view.fixed_box(root).distance(&place.world.bounds),
                    }
                };
                let radius = place.own.radius;
                let is_near = blockers.iter().any(|patch| distance(patch) < PIECES_NEAR * radius);
                let is_clear = blockers.is_empty();
                let value = if is_clear { 1.0 } else { value };
                Look { value, from: (place.own.centre, radius), is_near, is_clear }
            })
            .collect();
        let look_closer = |(k, (first, place)): (usize, (&Look, &Place))| {
            let factor = exchange_area_m2(k) / place.own.area;
            if first.is_clear || factor <= self.closer {
                return first.value;
            }
            let (bend, is_partly) = bend(&looks, k);
            let unseen = if is_partly {
                PIECES_UNSEEN_PARTLY
            } else if first.is_near {
                PIECES_UNSEEN_NEAR
            } else {
                PIECES_UNSEEN
            };
            let error = factor * bend.max(unseen);
            if error <= self.closer {
                return first.value;
            }
            // The error of n x n points on a function with kinks falls as 1 / n^2.
            let cells = (0.5 * (error / self.closer).sqrt()).ceil().min(PIECES_CELLS_MAX);
            from.visibility(&place.own, cells as u32)
        };
        looks.iter().zip(pieces).enumerate().map(look_closer).collect()
    }

    fn shaft<'b>(&'b self, cut: &Cut, (a, b): (&'b Place, &'b Place)) -> Shaft<'b> {
        let own = cut.body.map(|body| (body, &a.own, &b.own));
        let (a, b) = (&a.world, &b.world);
        Shaft { forest: self.forest, view: self.view, a, b, own, patches: cut.patches }
    }

    /// Without occlusion.
    fn exchange(&self, a: &WorldElement, b: &WorldElement) -> Exchange {
        let d = b.centre - a.centre;
        let reach = a.radius + b.radius;
        if reach * reach < PIECES_APART * d.length_squared() {
            return exchange_of_points(a, b);
        }
        match meeting(a, b) {
            Meeting::BackFacing => Exchange::default(),
            Meeting::Coplanar => contact_exchange(a, b, overlap_m2(a, b, std::iter::empty())),
            met => exchange(self.simd, a, b, met),
        }
    }
}

/// How far visibility over a piece is from a straight line: between pieces on opposite sides of it, and
/// from those that have none opposite from one value. And whether all of them see a part of the other end.
fn bend(looks: &[Look], of: usize) -> (f64, bool) {
    let Look { value, from: (middle, radius), .. } = looks[of];
    let around = of.saturating_sub(AROUND)..(of + AROUND).min(looks.len());
    let way = |look: &Look| (look.from.0 - middle, look.value - value, look.from.1 + radius);
    let mut is_partly = value > 0.0 && value < 1.0;
    let beside: Vec<(DVec3, f64)> = looks[around]
        .iter()
        .map(way)
        .filter(|(way, _, reach)| way.length_squared() < (BESIDE * reach).powi(2))
        .map(|(way, rise, _)| {
            is_partly &= rise + value > 0.0 && rise + value < 1.0;
            (way, rise)
        })
        .collect();
    let off = |&(way, rise): &(DVec3, f64)| {
        let is_opposite = |(back, _): &&(DVec3, f64)| {
            (*back + way).length_squared() < (OPPOSITE * OPPOSITE) * way.length_squared()
        };
        (rise + beside.iter().find(is_opposite).map_or(0.0, |opposite| opposite.1)).abs()
    };
    // One piece alone has seen nothing but its own middle.
    (beside.iter().map(off).fold(0.0, f64::max), is_partly && beside.len() > 1)
}
