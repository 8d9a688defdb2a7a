//! A sequence of frames to be followed, in space or in the plane: what `verify`, `bench` and its
//! comparison ask of it. Knows nothing of scenes.

use relume::flat::FlatSession;
use relume::session::{FrameReport, Memory, Session, Solution};

use crate::args::UpdateChoice;
use crate::clip::{Clip, step_failure};
use crate::failure::Failure;

/// A session that goes from frame to frame.
pub(crate) trait Stepping: Solution {
    /// Brings the solution to a time; `frame` labels the report.
    fn go(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, Failure>;
    /// Says when the frame before a build from scratch was.
    fn count_from(&mut self, time_s: Option<f64>);
    /// Bytes held.
    fn held(&self) -> Memory;

    /// Bytes held, all together.
    fn held_bytes(&self) -> u64 {
        let Memory { pairs, elements, fixed } = self.held();
        pairs + elements + fixed
    }
}

impl Stepping for Session {
    fn go(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, Failure> {
        self.step(frame, time_s).map_err(|error| step_failure(error, ""))
    }

    fn count_from(&mut self, time_s: Option<f64>) {
        self.came_from(time_s);
    }

    fn held(&self) -> Memory {
        self.memory()
    }
}

impl Stepping for FlatSession {
    fn go(&mut self, frame: u32, time_s: f64) -> Result<FrameReport, Failure> {
        Ok(self.step(frame, time_s))
    }

    fn count_from(&mut self, time_s: Option<f64>) {
        self.came_from(time_s);
    }

    fn held(&self) -> Memory {
        self.memory()
    }
}

/// A scene with the frames asked for and how it is to be solved.
pub(crate) trait Sequence {
    /// What solves it.
    type Session: Stepping;

    /// What it is called in tables.
    fn name(&self) -> &str;
    /// Frames, ascending; never empty.
    fn frames(&self) -> &[u32];
    /// Time of a frame, seconds.
    fn time_of(&self, frame: u32) -> f64;
    /// Relative error of irradiance aimed at, where there is one.
    fn tolerance(&self) -> Option<f64>;
    /// The oracle, as on the command line.
    fn oracle(&self) -> String;
    /// Threads in use.
    fn threads(&self) -> usize;
    /// A session that has solved nothing yet and measures no balance.
    fn begin(&self, update: UpdateChoice) -> Result<Self::Session, Failure>;

    /// Brings a session to a frame.
    fn step(&self, session: &mut Self::Session, frame: u32) -> Result<FrameReport, Failure> {
        session.go(frame, self.time_of(frame))
    }

    /// How finely it is solved, and by how many threads, in words.
    fn settings(&self) -> String {
        let tolerance = self.tolerance().map(|t| format!("tolerance {t}, ")).unwrap_or_default();
        format!("{tolerance}oracle {}", self.oracle())
    }
}

impl Sequence for Clip {
    type Session = Session;

    fn name(&self) -> &str {
        &self.scene.name
    }

    fn frames(&self) -> &[u32] {
        &self.frames
    }

    fn time_of(&self, frame: u32) -> f64 {
        Clip::time_of(self, frame)
    }

    fn tolerance(&self) -> Option<f64> {
        Some(self.tolerance)
    }

    fn oracle(&self) -> String {
        Clip::oracle(self)
    }

    fn threads(&self) -> usize {
        self.threads
    }

    fn begin(&self, update: UpdateChoice) -> Result<Session, Failure> {
        self.session(update, false)
    }
}
