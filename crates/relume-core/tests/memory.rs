//! Bytes a pair and bytes an element keep within their budgets, in every frame.
//!
//! Scenes are large enough that what every scene needs once does not count.

use std::sync::Arc;

use crate::common;
use crate::common::{at_tolerance, form_factor_oracle, lit_room, sliding, still, turn, v};
use glam::{DQuat, DVec3};
use relume_core::scene::{MaterialId, NodeId, Scene, SceneBuilder};
use relume_core::session::{Options, Session};

/// Bytes a pair: pair tree, and links by receiver.
const PAIR_BYTES: f64 = 48.0;

/// Bytes a pair more where groups of patches are ends of links: what came over these is kept for each receiver, however few pairs
/// it has.
const GROUP_BYTES: f64 = 6.0;

/// Bytes an element: forest, radiosities, and where the links of each are.
const ELEMENT_BYTES: f64 = 128.0;

/// Most bytes a pair and an element met.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    pair: f64,
    element: f64,
    /// Allowance for groups.
    of_groups: f64,
}

impl Worst {
    fn see(&mut self, session: &Session) {
        let (memory, (tree, forest)) = (session.memory(), session.frame().unwrap().pairs());
        let links = tree.counts().active;
        assert!(links > 8_000, "{links} links: what a scene needs once would count");
        self.pair = self.pair.max(memory.pairs as f64 / tree.len() as f64);
        self.element = self.element.max(memory.elements as f64 / forest.counts().elements as f64);
    }

    fn check(&self, what: &str) {
        println!("{what}: at most {:.1} bytes a pair, {:.1} an element", self.pair, self.element);
        assert!(
            self.pair <= PAIR_BYTES + self.of_groups && self.element <= ELEMENT_BYTES,
            "{what}: {self:?}"
        );
    }
}

/// `frames` random times, and the first of them.
fn check(what: &str, scene: Scene, options: Options, frames: usize) {
    let mut session = Session::new(Arc::new(scene), options).unwrap();
    let mut worst = Worst::default();
    let report = session.step(0, 0.0).unwrap();
    worst.of_groups = if report.link_kinds.is_some() { GROUP_BYTES } else { 0.0 };
    worst.see(&session);
    worst.check(&format!("{what}, {} links, cold", report.links));
    let mut random = common::Random(1);
    for frame in 1..=frames {
        session.step(frame as u32, random.between(0.0, 1.0)).unwrap();
        worst.see(&session);
    }
    worst.check(&format!("{what}, {frames} frames"));
}

/// At a tolerance with some 40,000 links: bytes for each receiver count the more a pair, the fewer pairs there are.
#[test]
fn furnished_room_by_the_error_oracle() {
    check("furnished, error", furnished_room(), at_tolerance(0.08), 12);
}

#[test]
fn furnished_room_by_form_factors() {
    check("furnished, form factors", furnished_room(), form_factor_oracle(0.05, 4e-3), 12);
}

#[test]
fn lit_room_by_the_error_oracle() {
    check("lit room, error", lit_room(), at_tolerance(0.05), 200);
}

#[test]
fn lit_room_by_form_factors() {
    check("lit room, form factors", lit_room(), form_factor_oracle(0.03, 1e-3), 200);
}

/// A room of 5 x 4 x 2.7 m with four tables of five boxes each and two cabinets. A lamp slides, a
/// table turns.
fn furnished_room() -> Scene {
    let mut b = SceneBuilder::new("furnished room");
    let wall = b.material("wall", [0.7; 3], [0.0; 3]);
    let wood = b.material("wood", [0.5, 0.35, 0.2], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [60.0; 3]);
    let room = still(&mut b, "room");
    b.cuboid_inward(room, "room", wall, DVec3::ZERO, v(5.0, 2.7, 4.0));
    for k in 0..4 {
        let at = v(1.3 + 2.4 * f64::from(k % 2), 0.0, 1.0 + 1.9 * f64::from(k / 2));
        let node = b.node(&format!("table {k}"), None, at, DQuat::IDENTITY);
        table(&mut b, node, wood);
        if k == 0 {
            turn(&mut b, node, DVec3::Y, 1.0);
        }
    }
    for k in 0..2 {
        let at = v(0.35 + 4.3 * f64::from(k), 0.0, 2.0);
        let node = b.node(&format!("cabinet {k}"), None, at, DQuat::IDENTITY);
        b.cuboid(node, "cabinet", wall, v(-0.25, 0.01, -0.5), v(0.25, 1.8, 0.5));
    }
    let node = sliding(&mut b, "lamp", v(1.0, 2.6, 1.0), v(4.0, 1.6, 3.0));
    let corners = [v(-0.3, 0., -0.3), v(0.3, 0., -0.3), v(0.3, 0., 0.3), v(-0.3, 0., 0.3)];
    b.polygon(node, "lamp", lamp, &corners);
    b.build().unwrap()
}

fn table(b: &mut SceneBuilder, node: NodeId, wood: MaterialId) {
    b.cuboid(node, "top", wood, v(-0.7, 0.72, -0.4), v(0.7, 0.76, 0.4));
    for (x, z) in [(-0.65, -0.35), (0.65, -0.35), (0.65, 0.35), (-0.65, 0.35)] {
        let (half, foot) = (v(0.03, 0.0, 0.03), v(x, 0.01, z));
        b.cuboid(node, "leg", wood, foot - half, v(x, 0.72, z) + half);
    }
}
