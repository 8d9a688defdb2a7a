//! Form factors between the parts that patches were joined from, frame after frame: what stands still
//! is summed once.

use std::sync::Arc;

use rayon::prelude::*;

use crate::element::{ElementId, ElementKey, Forest, WorldElement};
use crate::geometry::shaft_meets_box;
use crate::pair::Link;
use crate::scene::{BodyId, Joined, Part, Scene};

use crate::read::frame::Frame;
use crate::read::pieces::Sharing;
use crate::space::{Solved, SpaceState};

use super::fragments::{Fragments, Spread};
use super::sum::{Buffers, Fixed, Sign, Upper, add, mirrored, plus};
use super::{Factors, Grouping, areas};

/// Form factors between groups of the patches of a scene, from solutions of the scene of
/// joined patches made of it ([`Scene::joined`]).
///
/// Where a link ends on an element that lies in several groups, what it carries is shared among them:
/// without occlusion as the kernel falls on the pieces; past occluders each piece is looked at with the
/// whole of the other end, and shares are fitted to what all of them see. Links between what never
/// moves, past nothing that does, are summed once and only their changes later.
pub struct PartFactors {
    scene: Arc<Scene>,
    parts: Vec<Vec<Part>>,
    grouping: Grouping,
    resting: Option<Resting>,
    room: Buffers,
}

/// Sums over links that nothing moving has to do with.
struct Resting {
    sums: Upper,
    links: Vec<Rests>,
    /// The forest that they end in, and how its elements lie.
    forest: Forest,
    fragments: Fragments,
}

/// A resting link with what tells it from others.
#[derive(Clone, Copy)]
struct Rests {
    name: (ElementKey, ElementKey, u32, u16),
    link: Link,
}

impl PartFactors {
    /// For the groups of a scene and what was made of it; the session has to solve `joined.scene`.
    ///
    /// # Panics
    /// If the grouping is of another scene.
    pub fn new(scene: &Arc<Scene>, joined: &Joined, grouping: Grouping) -> PartFactors {
        assert_eq!(grouping.of_patch.len(), scene.patches.len());
        let (scene, parts) = (Arc::clone(scene), joined.parts.clone());
        PartFactors { scene, parts, grouping, resting: None, room: Buffers::default() }
    }

    /// Form factors of a solution; the same, bit for bit, whatever came before.
    ///
    /// Cost: that of the links between what moves and of those that changed, and a pass over the table.
    ///
    /// # Panics
    /// If the solution is of another scene.
    pub fn factors(&mut self, frame: Frame<'_>) -> Factors {
        let solved = frame.solved();
        assert_eq!(self.parts.len(), solved.space.scene.patches.len());
        let fixed = Fixed::of(solved.space.scene.area_m2());
        let fragments = Fragments::of_parts(&solved.space.forest, &self.parts, &self.grouping);
        let spread = Spread { sharing: Sharing::new(solved), fragments: &fragments };
        let movers = Movers::of(&solved.space.scene, solved);
        let (rest, moving): (Vec<Link>, Vec<Link>) = {
            let links: Vec<Link> = solved.tree.links().collect();
            links.into_par_iter().partition(|link| !movers.meet(solved, link))
        };
        let rest = named(&solved.space.forest, &rest);
        let mut sums = vec![Vec::new(); self.grouping.names.len()];
        match self.resting.take() {
            None => add(&mut sums, &links_of(&rest), &spread, (&fixed, Sign::Plus)),
            Some(before) => {
                let (gone, new) = differences(&before.links, &rest);
                // Where a link rested there was no mover, but there may be one now.
                let sharing = spread.sharing.of_forest(&before.forest, &movers.moves);
                let of_old = Spread { sharing, fragments: &before.fragments };
                sums = before.sums;
                add(&mut sums, &gone, &of_old, (&fixed, Sign::Minus));
                add(&mut sums, &new, &spread, (&fixed, Sign::Plus));
            }
        }
        let all = plus(&sums, &moving, &spread, (&fixed, Sign::Plus));
        let room = std::mem::take(&mut self.room);
        let factors = mirrored(areas(solved, &self.scene, &self.grouping), &all, &fixed, room);
        let forest = solved.space.forest.clone();
        self.resting = Some(Resting { sums, links: rest, forest, fragments });
        factors
    }

    /// Takes back a table that is not needed any more, whose room the next one may have.
    pub fn recycle(&mut self, factors: Factors) {
        self.room = factors.into();
    }
}

/// The bodies that ever move.
struct Movers {
    moves: Vec<bool>,
    roots: Vec<ElementId>,
}

impl Movers {
    fn of(scene: &Scene, solved: &Solved) -> Movers {
        let bodies = || (0..scene.bodies.len() as u32).map(BodyId);
        let is_there = |body: &BodyId| {
            scene.moves(*body)
                && solved.space.view.is_present(*body)
                && !scene.bodies[body.0 as usize].patches.is_empty()
        };
        Movers {
            moves: bodies().map(|body| scene.moves(body)).collect(),
            roots: bodies()
                .filter(is_there)
                .map(|body| solved.space.forest.body_root(body))
                .collect(),
        }
    }

    /// Whether a link ends on a mover or one may stand in its shaft.
    fn meet(&self, solved: &Solved, link: &Link) -> bool {
        let SpaceState { forest, view, .. } = &solved.space;
        let ends =
            [link.a, link.b].map(|id| forest.patch(id).map(|patch| (id, view.patch(patch).body)));
        let [Some((a, on_a)), Some((b, on_b))] = ends else { return true };
        if self.moves[on_a.0 as usize] || self.moves[on_b.0 as usize] {
            return true;
        }
        let slack_m = [a, b].map(|id| view.patch(forest.patch(id).expect("it has one")).rounding_m);
        let bounds = [a, b].map(|id| WorldElement::new(view, forest, id, false).bounds);
        let meets = |root: &ElementId| {
            let mover = view.fixed_box(*root).grown(2.0 * (slack_m[0] + slack_m[1]));
            shaft_meets_box(&bounds[0], &bounds[1], &mover)
        };
        self.roots.iter().any(meets)
    }
}

fn named(forest: &Forest, links: &[Link]) -> Vec<Rests> {
    let name = |link: &Link| {
        let carried = &link.carried;
        let bits = (carried.exchange_area_m2.to_bits(), carried.visibility);
        Rests { name: (forest.key(link.a), forest.key(link.b), bits.0, bits.1), link: *link }
    };
    let mut out: Vec<Rests> = links.par_iter().map(name).collect();
    out.par_sort_unstable_by_key(|rests| rests.name);
    out
}

fn links_of(rests: &[Rests]) -> Vec<Link> {
    rests.iter().map(|rests| rests.link).collect()
}

/// Links of the first list alone, and of the second alone; both are sorted by name.
fn differences(before: &[Rests], now: &[Rests]) -> (Vec<Link>, Vec<Link>) {
    let (mut gone, mut new) = (Vec::new(), Vec::new());
    let (mut old, mut fresh) = (before.iter().peekable(), now.iter().peekable());
    loop {
        match (old.peek(), fresh.peek()) {
            (None, None) => return (gone, new),
            (Some(o), Some(f)) if o.name == f.name => {
                old.next();
                fresh.next();
            }
            (Some(o), f) if f.is_none_or(|f| o.name < f.name) => {
                gone.push(o.link);
                old.next();
            }
            _ => new.extend(fresh.next().map(|f| f.link)),
        }
    }
}
