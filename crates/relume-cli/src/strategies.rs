//! `relume bench --compare`: every update strategy on the same frames, in one run.

use std::fmt::Write;

use relume::export::write_atomically;
use relume::session::{missed, radiosity_error};
use serde::Serialize;

use crate::args::{UpdateChoice, UpdateFlag};
use crate::clock::now;
use crate::failure::Failure;
use crate::figures::{mean, ratio, standard_deviation, time, times, whole};
use crate::interrupt;
use crate::output;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::sequence::{Sequence, Stepping, solved};

/// Name of the format.
const SCHEMA: &str = "relume-strategies/1";

/// The strategies in the order of the table; everything is compared with the first two.
const STRATEGIES: [UpdateChoice; 6] = [
    UpdateChoice::of(UpdateFlag::Scratch),
    UpdateChoice::of(UpdateFlag::Reinspect),
    UpdateChoice::of(UpdateFlag::Certificate),
    UpdateChoice::of(UpdateFlag::Extrapolate { frames: Some(7) }),
    UpdateChoice { strategy: UpdateFlag::Extrapolate { frames: None }, error: Some(0.05) },
    UpdateChoice { strategy: UpdateFlag::Extrapolate { frames: None }, error: Some(0.005) },
];
const SCRATCH: usize = 0;
const REINSPECT: usize = 1;

/// Runs the comparison.
pub(crate) fn compare(plan: &Plan<'_>, sequence: &impl Sequence) -> Result<(), Failure> {
    let sessions = STRATEGIES.iter().map(|&s| sequence.begin(s)).collect::<Result<_, _>>()?;
    let progress = Progress::new(sequence.frames().len(), 0, plan.quiet);
    let mut comparison =
        Comparison { sequence, sessions, columns: Vec::new(), first_s: Vec::new() };
    comparison.columns = STRATEGIES.iter().map(|_| Vec::new()).collect();
    let outcome = comparison.frames(&progress);
    progress.clear();
    let finished = outcome?;
    if !comparison.columns[0].is_empty() {
        if !plan.quiet {
            output::print(&comparison.text())?;
        }
        if let Some(path) = plan.json {
            let _guard = interrupt::writing();
            write_atomically(path, comparison.json()?.as_bytes())
                .map_err(|error| Failure::write(path, &error))?;
        }
    }
    if finished {
        return Ok(());
    }
    Err(Failure::interrupted("stopped: the table is of the frames so far"))
}

/// What a strategy did in one frame.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Cell {
    seconds: f64,
    links_seconds: f64,
    visited: u64,
    examined: u64,
    followed: u64,
    segments: u64,
    changed: u64,
    missed_states: u64,
    missed_occlusions: u64,
    same_hash: bool,
    rms_error: f64,
    max_error: f64,
}

struct Comparison<'a, Q: Sequence> {
    sequence: &'a Q,
    sessions: Vec<Q::Session>,
    /// By strategy, by frame after the first.
    columns: Vec<Vec<Cell>>,
    /// Time of the first frame by strategy.
    first_s: Vec<f64>,
}

/// A strategy's means over the frames after the first.
#[derive(Debug, Serialize)]
struct Row {
    update: String,
    mean_s: f64,
    standard_deviation_s: f64,
    /// Of it, links alone: everything but the solver.
    links_mean_s: f64,
    visited: f64,
    /// Pairs judged.
    examined: f64,
    /// Pairs of which only the exchange area was evaluated.
    followed: f64,
    segments: f64,
    changed: f64,
    /// Pairs in another state than with `reinspect`, a frame.
    missed_states: f64,
    /// Links that should be clear, partly or wholly occluded and are not, a frame.
    missed_occlusions: f64,
    /// Frames whose links are those of `scratch`, bit for bit.
    equal_frames: usize,
    /// Against `scratch`, relative to the mean radiosity; the RMS over all frames, the largest of all.
    rms_error: f64,
    max_error: f64,
}

impl<Q: Sequence> Comparison<'_, Q> {
    /// Steps all sessions from frame to frame, each frame in another order; whether to the end.
    fn frames(&mut self, progress: &Progress) -> Result<bool, Failure> {
        let count = self.sessions.len();
        self.first_s = vec![0.0; count];
        for (k, &frame) in self.sequence.frames().iter().enumerate() {
            if interrupt::requested() {
                return Ok(false);
            }
            let bytes = self.sessions.iter().map(Stepping::held_bytes).sum();
            progress.start(frame, 0, bytes);
            let mut cells = vec![Cell::default(); count];
            let mut hashes = vec![String::new(); count];
            for turn in 0..count {
                let at = (turn + k) % count;
                let started = now();
                let others = self.sessions.iter().enumerate().filter(|(k, _)| *k != at);
                let beside = others.map(|(_, session)| session.held_bytes()).sum();
                let report = self.sequence.step(&mut self.sessions[at], frame, beside)?;
                let seconds = started.elapsed().as_secs_f64();
                cells[at] = Cell {
                    seconds,
                    links_seconds: report.seconds.total - report.seconds.solve,
                    visited: report.work.visited,
                    examined: report.work.examined,
                    followed: report.work.followed,
                    segments: report.work.segments,
                    changed: report.work.changed,
                    ..Cell::default()
                };
                hashes[at] = report.hash;
            }
            for at in 0..count {
                let missed = missed(solved(&self.sessions[at]), solved(&self.sessions[REINSPECT]));
                let error =
                    radiosity_error(solved(&self.sessions[at]), solved(&self.sessions[SCRATCH]));
                let cell = &mut cells[at];
                (cell.missed_states, cell.missed_occlusions) = (missed.states, missed.occlusions);
                (cell.rms_error, cell.max_error) = (error.rms, error.max);
                cell.same_hash = hashes[at] == hashes[SCRATCH];
            }
            for (at, cell) in cells.into_iter().enumerate() {
                match k {
                    0 => self.first_s[at] = cell.seconds,
                    _ => self.columns[at].push(cell),
                }
            }
            progress.finish_frame();
        }
        Ok(true)
    }

    fn rows(&self) -> Vec<Row> {
        STRATEGIES.iter().zip(&self.columns).map(|(s, cells)| row(s.name(), cells)).collect()
    }

    fn text(&self) -> String {
        let mut out = String::new();
        let (sequence, rows) = (self.sequence, self.rows());
        let _ = writeln!(
            out,
            "{}: {}, {} threads, {} frames after the first; means a frame",
            sequence.name(),
            sequence.settings(),
            sequence.threads(),
            self.columns[0].len()
        );
        let _ = writeln!(
            out,
            "\n{:<26}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>8}{:>10}{:>10}",
            "update",
            "time",
            "std dev",
            "links",
            "judged",
            "followed",
            "segments",
            "missed",
            "equal",
            "RMS error",
            "largest"
        );
        rows.iter().for_each(|row| out += &line(row));
        let _ = writeln!(
            out,
            "\nframe 1 took {} from scratch; changed pairs a frame: {}",
            time(self.first_s[SCRATCH]),
            whole(rows[REINSPECT].changed)
        );
        let by = &rows[REINSPECT];
        rows.iter().skip(REINSPECT + 1).for_each(|row| out += &against(row, by));
        out
    }

    fn json(&self) -> Result<String, Failure> {
        #[derive(Serialize)]
        struct Strategy<'a> {
            means: Row,
            first_s: f64,
            frames: &'a [Cell],
        }
        #[derive(Serialize)]
        struct File<'a> {
            schema: &'static str,
            version: &'static str,
            scene: &'a str,
            #[serde(skip_serializing_if = "Option::is_none")]
            tolerance: Option<f64>,
            oracle: String,
            threads: usize,
            strategies: Vec<Strategy<'a>>,
        }
        let strategies = self.rows().into_iter().zip(&self.columns).zip(&self.first_s);
        let file = File {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            scene: self.sequence.name(),
            tolerance: self.sequence.tolerance(),
            oracle: self.sequence.oracle(),
            threads: self.sequence.threads(),
            strategies: strategies
                .map(|((means, frames), &first_s)| Strategy { means, first_s, frames })
                .collect(),
        };
        serde_json::to_string_pretty(&file)
            .map(|text| text + "\n")
            .map_err(|error| Failure::new(format_args!("cannot write the figures: {error}")))
    }
}

fn row(update: String, cells: &[Cell]) -> Row {
    let of = |read: &dyn Fn(&Cell) -> f64| cells.iter().map(read).collect::<Vec<f64>>();
    let seconds = of(&|c| c.seconds);
    Row {
        update,
        mean_s: mean(&seconds),
        standard_deviation_s: standard_deviation(&seconds),
        links_mean_s: mean(&of(&|c| c.links_seconds)),
        visited: mean(&of(&|c| c.visited as f64)),
        examined: mean(&of(&|c| c.examined as f64)),
        followed: mean(&of(&|c| c.followed as f64)),
        segments: mean(&of(&|c| c.segments as f64)),
        changed: mean(&of(&|c| c.changed as f64)),
        missed_states: mean(&of(&|c| c.missed_states as f64)),
        missed_occlusions: mean(&of(&|c| c.missed_occlusions as f64)),
        equal_frames: cells.iter().filter(|c| c.same_hash).count(),
        rms_error: mean(&of(&|c| c.rms_error * c.rms_error)).sqrt(),
        max_error: cells.iter().map(|c| c.max_error).fold(0.0, f64::max),
    }
}

/// A row of the table.
fn line(r: &Row) -> String {
    format!(
        "{:<26}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>8}{:>9.3}%{:>9.2}%\n",
        r.update,
        time(r.mean_s),
        time(r.standard_deviation_s),
        time(r.links_mean_s),
        whole(r.examined),
        whole(r.followed),
        whole(r.segments),
        whole(r.missed_states + r.missed_occlusions),
        r.equal_frames,
        100.0 * r.rms_error,
        100.0 * r.max_error
    )
}

/// What a strategy spares against another.
fn against(r: &Row, by: &Row) -> String {
    let fewer = |one: f64, two: f64| match two > 0.0 {
        true => times(one / two),
        false => "-".into(),
    };
    format!(
        "{:<26}against reinspect: {} fewer judged, {} fewer segments, {} quicker links, {} quicker in all\n",
        r.update,
        fewer(by.examined, r.examined),
        fewer(by.segments, r.segments),
        times(ratio(by.links_mean_s, r.links_mean_s)),
        times(ratio(by.mean_s, r.mean_s))
    )
}
