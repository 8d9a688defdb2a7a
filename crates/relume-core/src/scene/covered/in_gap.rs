//! What two faces hide of each other in a narrow gap that holds no lamp. Pure geometry.

use crate::geometry::Aabb;
use crate::scene::gap::{Gap, between, gap_reach};
use crate::scene::placed::Placed;
use crate::scene::{BodyId, PatchId, Scene};

use super::parts::{Covered, Inside, add, around};

/// Part of a patch that lies in a narrow gap.
pub(in crate::scene) struct InGap {
    pub(in crate::scene) patch: PatchId,
    part: Inside,
}

impl InGap {
    /// Adds it to what is covered of its patch.
    pub(in crate::scene) fn add_to(self, scene: &Scene, covered: &mut Covered, left: &mut usize) {
        *left = left.saturating_sub(1);
        let outline = self.part.outline.clone();
        covered.inside.push(self.part);
        add(scene, self.patch, vec![outline], (covered, left));
    }
}

/// A face, and which of its sides are open, from the lowest bit up.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Face<'a> {
    pub(in crate::scene) placed: &'a Placed,
    pub(in crate::scene) open: u64,
}

/// Parts of a face and of others that lie in narrow gaps between it and them; none of gaps that may hold a lamp.
pub(in crate::scene) fn dark_in_gaps<'a>(
    face: Face<'a>,
    others: impl Iterator<Item = Face<'a>>,
    slack_m: f64,
    is_own: bool,
    mut may_hold_lamp: impl FnMut(&Aabb) -> bool,
) -> Vec<InGap> {
    let reach = gap_reach(&face.placed.bounds);
    let mut found = Vec::new();
    for other in others.filter(|other| reach.meets(&other.placed.bounds)) {
        let faces = [face.placed, other.placed];
        let Some(gap) = between(faces, [face.open, other.open], slack_m) else { continue };
        if !may_hold_lamp(&gap.bounds.grown(2.0 * slack_m)) {
            found.extend(hide_gap(faces, gap, is_own));
        }
    }
    found
}

/// What a gap hides of the two faces that it is between.
fn hide_gap(faces: [&Placed; 2], gap: Gap, is_own: bool) -> [InGap; 2] {
    // No body has such a number.
    let of = (BodyId(faces[0].id.0 | 1 << 31), faces[1].id.0);
    let [p, q] = gap.outlines;
    [(faces[0], p), (faces[1], q)].map(|(face, outline)| {
        let (bounds, [u, v]) = (around(&outline), face.axes);
        let plane = [face.origin, u, v];
        InGap { patch: face.id, part: Inside { of, is_own, outline, bounds, plane } }
    })
}
