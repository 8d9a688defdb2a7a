//! Where everything in the plane is.

use crate::element::ElementId;
use crate::geometry::Aabb;

use super::forest::FlatForest;
use super::plane::{PlanePose, Segment};
use super::scene::{BodyIndex, FlatScene};

/// Where everything is at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaneView {
    pub(super) poses: Vec<PlanePose>,
    /// All walls, in the world.
    pub(super) walls: Vec<Segment>,
    /// The body of each wall.
    pub(super) bodies: Vec<BodyIndex>,
    /// Of each body.
    bounds: Vec<Aabb>,
}

impl PlaneView {
    /// The scene at a time.
    pub fn new(scene: &FlatScene, time_s: f64) -> PlaneView {
        let poses: Vec<PlanePose> = scene.bodies().iter().map(|b| b.motion.pose(time_s)).collect();
        let walls: Vec<Segment> =
            scene.walls().iter().map(|w| poses[w.body.0 as usize].segment(&w.local)).collect();
        let of_body = |b: &super::scene::Body| {
            let of = &walls[b.walls.start as usize..b.walls.end as usize];
            of.iter().fold(Aabb::EMPTY, |all, wall| all.union(wall.bounds()))
        };
        let bounds = scene.bodies().iter().map(of_body).collect();
        PlaneView { bounds, bodies: scene.walls().iter().map(|w| w.body).collect(), poses, walls }
    }

    /// The pose of each body.
    pub fn poses(&self) -> &[PlanePose] {
        &self.poses
    }

    /// The walls in the world.
    pub fn walls(&self) -> &[Segment] {
        &self.walls
    }

    /// The box around a body, in the plane z = 0; empty if it has no walls.
    pub(super) fn bounds(&self, body: BodyIndex) -> &Aabb {
        &self.bounds[body.0 as usize]
    }

    /// Where an element is in the world.
    pub fn place(&self, forest: &FlatForest, id: ElementId) -> Segment {
        let body = forest.body(id).expect("elements have bodies");
        self.poses[body.0 as usize].segment(&forest.local(id))
    }

    /// Where a wall is, in the frame of a body or in the world.
    pub(super) fn wall(&self, wall: u32, frame: Option<(BodyIndex, &FlatScene)>) -> Segment {
        match frame {
            None => self.walls[wall as usize],
            Some((body, scene)) if self.bodies[wall as usize] == body => {
                scene.walls()[wall as usize].local
            }
            Some((body, _)) => self.poses[body.0 as usize].segment_back(&self.walls[wall as usize]),
        }
    }
}
