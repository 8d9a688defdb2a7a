//! Scenes and measures that the benches share. Public API only.

#![allow(dead_code)] // each bench uses its part

use glam::{DQuat, DVec3};
use relume_core::scene::{MaterialId, NodeId, SceneBuilder};
use relume_core::session::Oracle;

pub(crate) mod cells;

/// The paper's oracle.
pub(crate) fn form_factor(epsilon: f64, min_area_m2: f64) -> Oracle {
    Oracle::FormFactor { epsilon, min_area_m2 }
}

/// A pool of `threads` threads.
pub(crate) fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool")
}

/// The middle of the values; of an even number, the mean of the two.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    quartiles(values)[1]
}

/// Lower quartile, median and upper quartile, interpolated.
pub(crate) fn quartiles(values: impl IntoIterator<Item = f64>) -> [f64; 3] {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|share| {
        let place = share * (sorted.len() - 1) as f64;
        let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
        below + (above - below) * place.fract()
    })
}

/// A room of 5 x 4 x 2.7 m with four tables of five boxes each, two cabinets and two lamps: of the
/// kind that Hanrahan, Salzman and Aupperle 1991 and SPLASH used.
pub(crate) fn furnished_room() -> SceneBuilder {
    let mut b = SceneBuilder::new("furnished room");
    let wall = b.material("wall", [0.7; 3], [0.0; 3]);
    let wood = b.material("wood", [0.5, 0.35, 0.2], [0.0; 3]);
    let paint = b.material("paint", [0.3, 0.4, 0.6], [0.0; 3]);
    let lamp = b.material("lamp", [0.0; 3], [60.0; 3]);
    let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid_inward(room, "room", wall, DVec3::ZERO, DVec3::new(5.0, 2.7, 4.0));
    for k in 0..4 {
        let at = DVec3::new(1.3 + 2.4 * f64::from(k % 2), 0.0, 1.0 + 1.9 * f64::from(k / 2));
        let turn = DQuat::from_rotation_y(0.15 * f64::from(k));
        let node = b.node(&format!("table {k}"), None, at, turn);
        table(&mut b, node, wood);
    }
    for k in 0..2 {
        let at = DVec3::new(0.35 + 4.3 * f64::from(k), 0.0, 2.0);
        let node = b.node(&format!("cabinet {k}"), None, at, DQuat::IDENTITY);
        let (lo, hi) = (DVec3::new(-0.25, 0.01, -0.5), DVec3::new(0.25, 1.8, 0.5));
        b.cuboid(node, "cabinet", paint, lo, hi);
        let at = DVec3::new(1.5 + 2.0 * f64::from(k), 2.6, 2.0);
        let node = b.node(&format!("lamp {k}"), None, at, DQuat::IDENTITY);
        let c = |x: f64, z: f64| DVec3::new(x, 0.0, z);
        let corners = [c(-0.3, -0.3), c(0.3, -0.3), c(0.3, 0.3), c(-0.3, 0.3)];
        b.polygon(node, "lamp", lamp, &corners);
    }
    b
}

fn table(b: &mut SceneBuilder, node: NodeId, wood: MaterialId) {
    let (lo, hi) = (DVec3::new(-0.7, 0.72, -0.4), DVec3::new(0.7, 0.76, 0.4));
    b.cuboid(node, "top", wood, lo, hi);
    for (x, z) in [(-0.65, -0.35), (0.65, -0.35), (0.65, 0.35), (-0.65, 0.35)] {
        let half = DVec3::new(0.03, 0.0, 0.03);
        let foot = DVec3::new(x, 0.01, z);
        b.cuboid(node, "leg", wood, foot - half, DVec3::new(x, 0.72, z) + half);
    }
}
