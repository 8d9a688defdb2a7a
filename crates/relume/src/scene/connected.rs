//! Which patches hang together. Pure geometry in the bodies' own frames.

use super::weld::Weld;
use super::{BodyId, PatchId, Scene};

/// Corners closer together than this share of the coordinates are one.
const WELDED: f64 = 1e-6;

impl Scene {
    /// For each patch, the area of all patches that hang together with it by common corners, m2: of all bodies that never move, or
    /// of the one that moves.
    pub fn connected_areas_m2(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.patches.len()];
        let bodies = (0..self.bodies.len() as u32).map(BodyId);
        let (moving, at_rest): (Vec<BodyId>, Vec<BodyId>) =
            bodies.partition(|&body| self.moves(body));
        self.connect(&at_rest, &mut out);
        moving.into_iter().for_each(|body| self.connect(&[body], &mut out));
        out
    }

    /// Adds the areas of the patches of some bodies that share a frame.
    fn connect(&self, bodies: &[BodyId], out: &mut [f64]) {
        let patches = || bodies.iter().flat_map(|&body| self.patches_of(body));
        let corners = || patches().flat_map(|(_, patch)| patch.corners_in_body());
        let reach = corners().fold(0.0_f64, |reach, p| reach.max(p.abs().max_element()));
        let mut weld = Weld::new(WELDED * reach);
        let mut parent: Vec<u32> = Vec::new();
        let mut firsts: Vec<(PatchId, u32)> = Vec::new();
        for (id, patch) in patches() {
            let numbers: Vec<u32> = patch.corners_in_body().map(|c| weld.vertex(c)).collect();
            parent.extend(parent.len() as u32..weld.points.len() as u32);
            for pair in numbers.windows(2) {
                let (a, b) = (root(&mut parent, pair[0]), root(&mut parent, pair[1]));
                parent[a.max(b) as usize] = a.min(b);
            }
            firsts.push((id, numbers[0]));
        }
        let mut areas = vec![0.0; parent.len()];
        for &(id, first) in &firsts {
            areas[root(&mut parent, first) as usize] += self.patches[id.0 as usize].area_m2();
        }
        for (id, first) in firsts {
            out[id.0 as usize] = areas[root(&mut parent, first) as usize];
        }
    }
}

/// The representative of a set, with the way to it made shorter.
fn root(parent: &mut [u32], mut of: u32) -> u32 {
    while parent[of as usize] != of {
        parent[of as usize] = parent[parent[of as usize] as usize];
        of = parent[of as usize];
    }
    of
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use crate::scene::{Interpolation, SceneBuilder, Track};

    /// Three unit squares in a row, each with a body of its own; the first two touch, and the third touches the second
    /// but moves.
    #[test]
    fn what_moves_does_not_hang_together_with_what_rests() {
        let mut b = SceneBuilder::new("row");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        for k in 0..3 {
            let node = b.node(&format!("square {k}"), None, DVec3::ZERO, DQuat::IDENTITY);
            let x = f64::from(k);
            let corners = [(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 1.0), (x, 1.0)];
            b.polygon(node, "square", grey, &corners.map(|(x, y)| DVec3::new(x, y, 0.0)));
            if k == 2 {
                let values = vec![DVec3::ZERO, DVec3::Z];
                let interpolation = Interpolation::Linear;
                let track = Track { times_s: vec![0.0, 1.0], values, interpolation };
                b.animate_translation(node, track);
            }
        }
        assert_eq!(b.build().unwrap().connected_areas_m2(), [2.0, 2.0, 1.0]);
    }
}
