//! A sequence of frames to be followed, in space or in the plane: what `verify`, `bench` and its
//! comparison ask of it. Knows nothing of scenes.

use relume::element::ElementId;
use relume::flat::{FlatFrame, FlatOptions, FlatSession, PlaneState};
use relume::pair::OutOfMemory;
use relume::session::{Elements, Follower, FrameReport, Memory, Session};
use relume::space::SpaceState;

use crate::args::UpdateChoice;
use crate::clip::{Clip, step_failure};
use crate::failure::Failure;
use crate::memory;
use crate::tuning::UNBALANCED_MAX;

/// A session that goes from frame to frame.
pub(crate) trait Stepping {
    /// The space that it solves in.
    type Space: Elements;

    /// The last solution, if there is one.
    fn solved(&self) -> Option<&Follower<Self::Space>>;
    /// Brings the solution to a time; `frame` labels the report. `beside_bytes` are held by others under
    /// the same limit.
    fn go(&mut self, frame: u32, time_s: f64, beside_bytes: u64) -> Result<FrameReport, Failure>;
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

/// What a session has solved last.
pub(crate) fn solved<S: Stepping>(session: &S) -> &Follower<S::Space> {
    session.solved().expect("a step leaves a solution")
}

impl Stepping for Session {
    type Space = SpaceState;

    fn solved(&self) -> Option<&Follower<SpaceState>> {
        Session::solved(self)
    }

    fn go(&mut self, frame: u32, time_s: f64, beside_bytes: u64) -> Result<FrameReport, Failure> {
        self.set_max_memory_bytes(memory::left_beside(beside_bytes));
        self.step(frame, time_s).map_err(|error| step_failure(error, ""))
    }

    fn count_from(&mut self, time_s: Option<f64>) {
        self.count_motion_from(time_s);
    }

    fn held(&self) -> Memory {
        self.memory()
    }
}

impl Stepping for FlatSession {
    type Space = PlaneState;

    fn solved(&self) -> Option<&Follower<PlaneState>> {
        FlatSession::solved(self)
    }

    fn go(&mut self, frame: u32, time_s: f64, beside_bytes: u64) -> Result<FrameReport, Failure> {
        let limit = memory::left_beside(beside_bytes);
        let report = self
            .step_within(frame, time_s, limit)
            .map_err(|OutOfMemory| memory::exceeded(&format!("frame {frame}")))?;
        // What settles comes to a few times the residual asked for.
        let most = 10.0 * FlatOptions::default().residual;
        let unbalanced = report.energy.map_or(0.0, |energy| energy.unbalanced());
        let lost = unbalanced.is_nan() || unbalanced > UNBALANCED_MAX;
        if report.residual.is_nan() || report.residual > most || lost {
            return Err(unsettled(self.frame(), &report));
        }
        Ok(report)
    }

    fn count_from(&mut self, time_s: Option<f64>) {
        self.count_motion_from(time_s);
    }

    fn held(&self) -> Memory {
        self.memory()
    }
}

/// Light that grows from sweep to sweep: between bright walls that cross or lie on each other.
fn unsettled(frame: Option<FlatFrame<'_>>, report: &FrameReport) -> Failure {
    let brightest = |frame: FlatFrame<'_>| {
        let size = |facet: &ElementId| frame.radiosity(*facet).into_iter().fold(0.0, f32::max);
        let facets = frame.pairs().1.facets().iter();
        let found = facets.max_by(|a, b| size(a).total_cmp(&size(b)))?;
        Some(frame.name(*found).short())
    };
    let name = frame.and_then(brightest).unwrap_or_default();
    Failure::new(format_args!(
        "frame {}: the light does not settle (residual {:.1e} after {} sweeps, {:.0} % of what is emitted unaccounted for); it is brightest at `{name}`",
        report.frame, report.residual, report.sweeps, 100.0 * report.energy.map_or(0.0, |e| e.unbalanced())
    ))
    .help("part walls that cross or lie on each other, give them lower reflectances, or lower --epsilon")
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

    /// Brings a session to a frame, beside others that hold so many bytes.
    fn step(
        &self,
        session: &mut Self::Session,
        frame: u32,
        beside_bytes: u64,
    ) -> Result<FrameReport, Failure> {
        session.go(frame, self.time_of(frame), beside_bytes)
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
