//! The session of the plane: a scene, and the last solution.

use std::sync::Arc;

use crate::follow::{Follower, FrameReport, Memory, Order};
use crate::pair::OutOfMemory;

use super::forest::FlatForest;
use super::frame::FlatFrame;
use super::options::{FlatOptions, OptionError};
use super::scene::FlatScene;
use super::state::{FlatGoal, FlatSolved};
use super::view::PlaneView;

/// One scene in the plane being solved, frame by frame.
pub struct FlatSession {
    scene: Arc<FlatScene>,
    options: FlatOptions,
    seed: FlatForest,
    solved: Option<FlatSolved>,
    /// Time that dynamic links of a cold build are counted from.
    count_motion_from: Option<f64>,
}

impl FlatSession {
    /// Prepares a scene for solving.
    ///
    /// # Errors
    /// If an option is out of its range or the scene has nothing to solve.
    pub fn new(scene: Arc<FlatScene>, options: FlatOptions) -> Result<FlatSession, OptionError> {
        options.check()?;
        scene.check()?;
        let seed = FlatForest::new(&scene);
        Ok(FlatSession { scene, options, seed, solved: None, count_motion_from: None })
    }

    /// The scene being solved.
    pub fn scene(&self) -> &FlatScene {
        &self.scene
    }

    /// Brings the solution to `time_s`; `frame` only labels the report. Any time may follow any other:
    /// the links are those of a cold build at `time_s`, bit for bit, unless they are extrapolated.
    pub fn step(&mut self, frame: u32, time_s: f64) -> FrameReport {
        self.step_within(frame, time_s, None).expect("there is no limit")
    }

    /// Brings the solution to `time_s` as [`FlatSession::step`] does, within a limit on memory, bytes.
    ///
    /// # Errors
    /// [`OutOfMemory`] if the links do not fit; [`FlatSession::frame`] is then that of the last solution as before.
    pub fn step_within(
        &mut self,
        frame: u32,
        time_s: f64,
        max_memory_bytes: Option<u64>,
    ) -> Result<FrameReport, OutOfMemory> {
        let last = self.solved.take();
        let back = last.as_ref().map(|last| (last.space.view.clone(), last.said()));
        let view = PlaneView::new(&self.scene, time_s);
        let count_motion_from =
            self.count_motion_from.take().map(|from_s| PlaneView::new(&self.scene, from_s));
        let last_view = back.as_ref().map(|(view, _)| view);
        let goal = self.goal(&view, count_motion_from.as_ref().or(last_view));
        let moved = last_view.map_or(Vec::new(), |last_view| self.moved(last_view, &view));
        let label = FrameReport { frame, time_s, moved, ..FrameReport::default() };
        match Follower::follow(last, &goal, &Order { max_memory_bytes, ..self.order(label) }) {
            Ok(solved) => Ok(self.solved.insert(solved).report.clone()),
            Err(failed) => {
                let back = back.and_then(|(view, said)| {
                    let order = self.order(FrameReport::default());
                    Follower::found_again(
                        failed.into_way_back(),
                        &self.goal(&view, None),
                        order,
                        said,
                    )
                });
                self.solved = back;
                Err(OutOfMemory)
            }
        }
    }

    /// A step to a view.
    fn goal<'a>(&'a self, view: &'a PlaneView, from: Option<&'a PlaneView>) -> FlatGoal<'a> {
        FlatGoal { scene: &self.scene, seed: &self.seed, view, from, options: &self.options }
    }

    /// A step as the options ask for.
    fn order(&self, label: FrameReport) -> Order<'static> {
        let FlatOptions { update, events, balance, .. } = self.options;
        Order { label, update, events, balance, max_memory_bytes: None, watch: None }
    }

    /// Names of the bodies that are elsewhere in one view than in another.
    fn moved(&self, from: &PlaneView, to: &PlaneView) -> Vec<String> {
        let poses = from.poses().iter().zip(to.poses());
        let moved = poses.zip(self.scene.bodies()).filter(|((one, two), _)| one != two);
        moved.map(|(_, body)| body.name.clone()).collect()
    }

    /// The last solution, if there is one.
    pub fn frame(&self) -> Option<FlatFrame<'_>> {
        self.solved.as_ref().map(FlatFrame::new)
    }

    /// The state that the last step left.
    #[doc(hidden)]
    pub fn solved(&self) -> Option<&FlatSolved> {
        self.solved.as_ref()
    }

    /// Sets the time of the frame before the next step, where that is not the last step:
    /// [`Work::dynamic_links`](crate::pair::Work::dynamic_links) of a cold build count from there. Nothing else depends on it.
    pub fn count_motion_from(&mut self, time_s: Option<f64>) {
        self.count_motion_from = time_s;
    }

    /// Bytes that the engine's structures hold now.
    pub fn memory(&self) -> Memory {
        let mut memory = self.solved.as_ref().map_or_else(Memory::default, FlatSolved::memory);
        memory.fixed += self.seed.memory_bytes();
        memory
    }
}
