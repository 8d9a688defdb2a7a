//! Which patches are connected. Pure geometry in the bodies' own frames.

use super::weld::{Sets, Weld};
use super::{BodyId, PatchId, Scene};

impl Scene {
    /// Area of the patches that are connected with each patch by common corners, itself among them, m2. Bodies that never move
    /// are connected with each other, a body that moves or was inserted only within itself. Exact up to rounding; both sides of a double-sided
    /// polygon count.
    pub(crate) fn connected_areas_m2(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.patches.len()];
        let bodies = (0..self.bodies.len() as u32).map(BodyId);
        let (moving, at_rest): (Vec<BodyId>, Vec<BodyId>) =
            bodies.partition(|&body| self.moves(body) || self.is_inserted(body));
        self.connect(&at_rest, &mut out);
        moving.into_iter().for_each(|body| self.connect(&[body], &mut out));
        out
    }

    /// Adds the areas of the patches of some bodies that share a frame.
    fn connect(&self, bodies: &[BodyId], out: &mut [f64]) {
        let patches = || bodies.iter().flat_map(|&body| self.patches_of(body));
        let mut weld = Weld::of_corners(patches().flat_map(|(_, p)| p.corners_in_body()));
        let mut sets = Sets::default();
        let mut firsts: Vec<(PatchId, u32)> = Vec::new();
        for (id, patch) in patches() {
            let numbers: Vec<u32> = patch.corners_in_body().map(|c| weld.vertex(c)).collect();
            sets.extend(weld.points.len());
            numbers.windows(2).for_each(|pair| sets.join(pair[0], pair[1]));
            firsts.push((id, numbers[0]));
        }
        let mut areas = vec![0.0; weld.points.len()];
        for &(id, first) in &firsts {
            areas[sets.root(first) as usize] += self.patches[id.0 as usize].area_m2();
        }
        for (id, first) in firsts {
            out[id.0 as usize] = areas[sets.root(first) as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use crate::scene::{Interpolation, SceneBuilder, Track};

    /// Three unit squares in a row, each with a body of its own; the first two touch, and the third touches the second
    /// but moves.
    #[test]
    fn what_moves_is_not_connected_with_what_rests() {
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
