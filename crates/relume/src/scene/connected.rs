//! Which patches hang together. Pure geometry in the bodies' own frames.

use super::weld::Weld;
use super::{BodyId, Scene};

/// Corners closer together than this share of a body's coordinates are one.
const WELDED: f64 = 1e-6;

impl Scene {
    /// For each patch, the area of all patches of its body that hang together with it by common corners, m2.
    pub fn connected_areas_m2(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.patches.len()];
        for body in (0..self.bodies.len() as u32).map(BodyId) {
            self.connect(body, &mut out);
        }
        out
    }

    fn connect(&self, body: BodyId, out: &mut [f64]) {
        let corners = || self.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
        let reach = corners().fold(0.0_f64, |reach, p| reach.max(p.abs().max_element()));
        let mut weld = Weld::new(WELDED * reach);
        let mut parent: Vec<u32> = Vec::new();
        let mut firsts = Vec::new();
        for (id, patch) in self.patches_of(body) {
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
