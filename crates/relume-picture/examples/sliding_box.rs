//! Writes the scene that tables of form factors are measured with: a closed unit room of 20 x 20
//! cells a wall, in which a box of 8 x 8 cells a side slides from wall to wall in 120 frames; 2,784
//! cells, each a surface of its own.
//!
//!     cargo run --release -p relume-picture --example sliding_box -- sliding_box.glb
//!     relume factors sliding_box.glb --changed-only -o F.csv --report report.json

use std::path::Path;

use glam::{DQuat, DVec3};
use relume_core::scene::{Interpolation, MaterialId, NodeId, SceneBuilder, Track};
use relume_io::export::write_glb;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "sliding_box.glb".into());
    let mut b = SceneBuilder::new("sliding_box");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
    cells(&mut b, (room, "wall", grey), (DVec3::ZERO, DVec3::ONE), 20, true);
    let (from, to) = (DVec3::new(0.15, 0.3, 0.5), DVec3::new(0.85, 0.3, 0.5));
    let slider = b.node("box", None, from, DQuat::IDENTITY);
    let half = DVec3::splat(0.1);
    cells(&mut b, (slider, "box", grey), (-half, half), 8, false);
    let times_s = vec![0.0, 119.0 / 24.0];
    let interpolation = Interpolation::Linear;
    b.animate_translation(slider, Track { times_s, values: vec![from, to], interpolation });
    write_glb(&b.build()?, Path::new(&path))?;
    Ok(())
}

/// The sides of a cuboid in `n` x `n` cells each, every cell a surface.
fn cells(
    b: &mut SceneBuilder,
    (node, name, material): (NodeId, &str, MaterialId),
    (min, max): (DVec3, DVec3),
    n: usize,
    inward: bool,
) {
    for axis in 0..3 {
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        for (side, end) in [min, max].into_iter().enumerate() {
            for k in 0..n * n {
                let at = |i: usize, j: usize| {
                    let share = |k: usize| k as f64 / n as f64;
                    let mut p = min;
                    p[axis] = end[axis];
                    p[s] += (max[s] - min[s]) * share(i);
                    p[t] += (max[t] - min[t]) * share(j);
                    p
                };
                let (i, j) = (k % n, k / n);
                let mut cell = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                if (side == 0) != inward {
                    cell.reverse();
                }
                b.polygon(node, &format!("{name} {axis}{side} {i} {j}"), material, &cell);
            }
        }
    }
}
