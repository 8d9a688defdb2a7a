//! The inner sides of closed shells in which it is dark: a crate that was exported with double-sided
//! polygons has walls inside that nobody sees and no light reaches.
//!
//! What leaves a shell out decides from the scene and all of its motion at once: what is left is a scene
//! like any other, the same at every instant. Must not know elements or light transport.

use std::collections::BTreeSet;

use glam::DVec3;

use super::shell::{Effort, Lies, Shell};
use super::{BodyId, LightKind, Motion, NodeId, Note, Patch, PatchId, Scene, Severity};
use crate::geometry::{Aabb, Pose};
use crate::scene::tuning::SLICES;

/// Boxes that overlap by less than this share of their coordinates touch.
const TOUCHING: f64 = 1e-6;

/// What is inside a shell besides its own inner sides, at some time.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Guest {
    /// A surface: on the shell it is outside.
    Surface,
    /// A surface that emits, a light or a camera: on the shell it is inside.
    Light,
}

impl Scene {
    /// The same scene without the sides of double-sided polygons that look into a closed shell where it
    /// stays dark and nobody looks: their polygons are single-sided, and black on a side that no light
    /// reaches. A note says how many.
    ///
    /// A shell is a closed surface of one body, of polygons that meet along sides (corners within 1e-6 of
    /// the body's coordinates are one), are wound either way and do not pass through each other. It keeps
    /// its inner sides if one of them emits at any time, or if at any time of the animation another surface, a
    /// light or a camera is inside or passes through it; also what is absent at the time counts. Bounds of
    /// what moves against a shell are boxes over 1/64 of the animation each: a shell that something passes close by
    /// may keep sides that it could do without.
    ///
    /// Exact: light outside and in all other shells is the same, up to the error of its links. For form
    /// factors between sides use the scene as it is; one in which nothing emits is returned unchanged.
    pub fn without_dark_sides(&self) -> Scene {
        let mut scene = self.clone();
        if !self.emits() {
            return scene;
        }
        let mut effort = Effort::new();
        let moved = Moved::of(self);
        let mut is_left_out = vec![false; self.patches.len()];
        for body in (0..self.bodies.len() as u32).map(BodyId) {
            if self.patches_of(body).all(|(_, patch)| patch.twin.is_none()) {
                continue;
            }
            for shell in self.shells(body, &mut effort) {
                let inner = |f: &super::shell::Face| {
                    let twin = self.patches[f.patch.0 as usize].twin?;
                    Some(if f.outwards { twin } else { f.patch })
                };
                let inner: Vec<PatchId> = shell.faces.iter().filter_map(inner).collect();
                let is_dark = inner.iter().all(|&p| !self.glows(p));
                if !inner.is_empty()
                    && is_dark
                    && !self.is_visited(body, &shell, &moved, &mut effort)
                {
                    inner.iter().for_each(|p| is_left_out[p.0 as usize] = true);
                }
            }
        }
        scene.leave_out(&is_left_out);
        scene
    }

    /// Whether any surface or light emits at any time.
    pub fn emits(&self) -> bool {
        (0..self.patches.len() as u32).any(|p| self.glows(PatchId(p)))
            || self.lights.iter().any(|l| l.most_intensity().iter().any(|&i| i > 0.0))
    }

    fn glows(&self, patch: PatchId) -> bool {
        self.patch_emits(&self.patches[patch.0 as usize])
    }

    /// Whether anything but a shell's own faces is ever inside it.
    fn is_visited(&self, body: BodyId, shell: &Shell, moved: &Moved, effort: &mut Effort) -> bool {
        let rests = |other: BodyId| other == body || !(self.moves(body) || self.moves(other));
        let own: BTreeSet<PatchId> = shell.faces.iter().map(|f| f.patch).collect();
        let others = |other: BodyId| {
            let firsts = self.patches_of(other).filter(|(id, p)| p.twin.is_none_or(|t| t > *id));
            firsts.filter(|(id, _)| !own.contains(id))
        };
        let guest = |id: PatchId| if self.glows(id) { Guest::Light } else { Guest::Surface };
        let bodies = || (0..self.bodies.len() as u32).map(BodyId);
        for (id, patch) in bodies().filter(|&other| rests(other)).flat_map(others) {
            let corners: Vec<DVec3> = patch.corners_in_body().collect();
            if guest(id).is_in(shell.place_of_polygon(&corners, effort)) {
                return true;
            }
        }
        let way = moved.way(body, shell.faces.iter().flat_map(|f| f.corners.iter().copied()));
        for other in bodies().filter(|&other| !rests(other)) {
            let whole = moved.way(other, others(other).flat_map(|(_, p)| p.corners_in_body()));
            if way.meets(&whole, Guest::Light)
                && others(other).any(|(id, patch)| {
                    way.meets(&moved.way(other, patch.corners_in_body()), guest(id))
                })
            {
                return true;
            }
        }
        let shines = |l: &&super::Light| l.kind != LightKind::Directional;
        let lights = self.lights.iter().filter(shines).map(|l| l.node);
        let mut points = lights.chain(self.cameras.iter().map(|c| c.node));
        points.any(|node| match self.rides_on(node, body) {
            Some(at) => Guest::Light.is_in(shell.place_of(at, effort)),
            None => way.meets(&moved.way_of_node(&self.motion, node), Guest::Light),
        })
    }

    /// Where the origin of a node is in a body's frame, if it rests there.
    fn rides_on(&self, node: NodeId, body: BodyId) -> Option<DVec3> {
        let anchor = self.motion.anchor(self.bodies[body.0 as usize].node);
        (self.motion.anchor(node) == anchor).then(|| {
            let still = self.motion.upward(node).take_while(|n| !n.animated());
            still.fold(Pose::IDENTITY, |pose, n| n.local_pose(0.0) * pose).translation
        })
    }

    /// Leaves out patches whose twins stay.
    fn leave_out(&mut self, is_left_out: &[bool]) {
        let count = is_left_out.iter().filter(|&&out| out).count();
        if count == 0 {
            return;
        }
        let mut new_of_patch = vec![0];
        for &out in is_left_out {
            new_of_patch.push(new_of_patch[new_of_patch.len() - 1] + u32::from(!out));
        }
        let new = |k: u32| new_of_patch[k as usize];
        for body in &mut self.bodies {
            body.patches = new(body.patches.start)..new(body.patches.end);
        }
        let old = std::mem::take(&mut self.patches);
        let twin = |twin: PatchId| (!is_left_out[twin.0 as usize]).then(|| PatchId(new(twin.0)));
        let kept = old.into_iter().zip(is_left_out).filter(|(_, out)| !**out);
        self.patches = kept.map(|(p, _)| Patch { twin: p.twin.and_then(twin), ..p }).collect();
        self.notes.push(Note {
            severity: Severity::Info,
            code: "dark-sides",
            subject: self.name.clone(),
            count,
            message:
                "inner sides of closed double-sided surfaces, where no light gets, were left out"
                    .into(),
        });
    }
}

impl Guest {
    fn is_in(self, lies: Lies) -> bool {
        match self {
            Guest::Surface => lies == Lies::Inside,
            Guest::Light => lies >= Lies::On,
        }
    }
}

/// Where bodies are in each part of the animation, present or not.
struct Moved {
    times_s: Vec<f64>,
    /// By body: where it is at the start of each part, and the box of how far its points get from there.
    bodies: Vec<Vec<(Pose, Aabb)>>,
}

impl Moved {
    fn of(scene: &Scene) -> Moved {
        let [from_s, to_s] = scene.motion.span_s();
        let at = |k: u32| from_s + (to_s - from_s) * f64::from(k) / f64::from(SLICES);
        let times_s: Vec<f64> =
            if from_s < to_s { (0..=SLICES).map(at).collect() } else { vec![from_s, from_s] };
        let part = |body: BodyId, interval: &[f64]| {
            let node = scene.bodies[body.0 as usize].node;
            let moves = scene.moves(body);
            let pose = if moves { scene.motion.place(node, interval[0]) } else { Pose::IDENTITY };
            (pose, scene.drift(body, [interval[0], interval[1]]).reach())
        };
        let parts = |body: u32| times_s.windows(2).map(|i| part(BodyId(body), i)).collect();
        let bodies = (0..scene.bodies.len() as u32).map(parts).collect();
        Moved { times_s, bodies }
    }

    /// The way of some points of a body.
    fn way(&self, body: BodyId, points: impl Iterator<Item = DVec3>) -> Way {
        let points: Vec<DVec3> = points.collect();
        let around = |(pose, reach): &(Pose, Aabb)| {
            Aabb::of(points.iter().map(|&p| pose.point(p))).sum(reach)
        };
        Way { boxes: self.bodies[body.0 as usize].iter().map(around).collect() }
    }

    /// The way of a node's origin.
    fn way_of_node(&self, motion: &Motion, node: NodeId) -> Way {
        let at = |interval: &[f64]| {
            let from = motion.place(node, interval[0]).translation;
            Aabb::of([from]).sum(&motion.drift(node, 0.0, [interval[0], interval[1]]).reach())
        };
        Way { boxes: self.times_s.windows(2).map(at).collect() }
    }
}

/// Where something gets in each part of the animation, in the world.
struct Way {
    boxes: Vec<Aabb>,
}

impl Way {
    /// Whether the two ever overlap; `guest` says whether touching is enough.
    fn meets(&self, other: &Way, guest: Guest) -> bool {
        let overlap = |(a, b): (&Aabb, &Aabb)| {
            let reach = a.lo.abs().max(a.hi.abs()).max_element();
            let by = TOUCHING * if guest == Guest::Light { -reach } else { reach };
            a.lo.cmplt(b.hi - by).all() && b.lo.cmplt(a.hi - by).all()
        };
        self.boxes.iter().zip(&other.boxes).any(overlap)
    }
}

#[cfg(test)]
mod tests;
