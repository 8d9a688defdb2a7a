//! `relume verify`: frame by frame, the links that followed the motion against links built anew.

use relume::session::{Difference, FrameReport, RadiosityGap, compare, radiosity_gap};

use crate::args::{UpdateChoice, UpdateFlag, VerifyArgs};
use crate::clip::Clip;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{self, count, counted};
use crate::progress::Progress;
use crate::sequence::{Sequence, Stepping, solved};

/// What the two solutions are called in messages.
const ONE: &str = "incrementally";
const TWO: &str = "from scratch";

/// Runs the command. A difference is a failure.
pub(crate) fn verify(args: &VerifyArgs) -> Result<(), Failure> {
    let clip = Clip::open(&args.source, &args.clip)?;
    clip.warn();
    let clip = clip.without_dark_sides();
    frames(&clip, UpdateChoice::of(args.update.into()), args.clip.quiet)
}

/// Solves all frames twice and compares. A difference is a failure.
pub(crate) fn frames(
    sequence: &impl Sequence,
    update: UpdateChoice,
    quiet: bool,
) -> Result<(), Failure> {
    let mut sides = Sides {
        warm: sequence.begin(update)?,
        cold: sequence.begin(UpdateChoice::of(UpdateFlag::Scratch))?,
    };
    let progress = Progress::new(sequence.frames().len(), 0, quiet);
    let outcome = sides.frames(sequence, update, &progress, quiet);
    progress.clear();
    let tightest = outcome?;
    if quiet {
        return Ok(());
    }
    output::print(&format!(
        "{} equal: links bit for bit, radiosities within {:.0} % of their bound\n",
        counted(sequence.frames().len(), "frame"),
        100.0 * tightest
    ))
}

/// The two solutions side by side.
struct Sides<S> {
    warm: S,
    cold: S,
}

impl<S: Stepping> Sides<S> {
    /// Solves and compares; the largest share of its bound that a radiosity differed by.
    fn frames(
        &mut self,
        sequence: &impl Sequence<Session = S>,
        update: UpdateChoice,
        progress: &Progress,
        quiet: bool,
    ) -> Result<f64, Failure> {
        let (mut tightest, mut links) = (0.0, 0);
        let frames = sequence.frames();
        for (done, &frame) in frames.iter().enumerate() {
            if interrupt::requested() {
                return Err(interrupted(done, frames.len()));
            }
            progress.start(frame, links, self.warm.held_bytes() + self.cold.held_bytes());
            let report = sequence.step(&mut self.warm, frame, self.cold.held_bytes())?;
            sequence.step(&mut self.cold, frame, self.warm.held_bytes())?;
            let gap =
                agree(&self.warm, &self.cold).map_err(|found| differs(frame, update, &found))?;
            if !quiet {
                progress.suspend(|| output::print(&line(&report, &gap)))?;
            }
            tightest = gap.share().max(tightest);
            links = report.links;
            progress.finish_frame();
        }
        Ok(tightest)
    }
}

/// How near the radiosities of two solutions that agree come to their bound; else the first
/// difference.
fn agree<S: Stepping>(warm: &S, cold: &S) -> Result<RadiosityGap, Difference> {
    let (warm, cold) = (solved(warm), solved(cold));
    match compare(warm, cold) {
        Some(difference) => Err(difference),
        None => radiosity_gap(warm, cold),
    }
}

fn line(report: &FrameReport, gap: &RadiosityGap) -> String {
    format!(
        "frame {:>4}  {:>10} links  {:>9} changed  {}  equal, radiosities within {:.1e} of {:.1e} W/m2\n",
        report.frame,
        count(report.links),
        count(report.work.changed),
        report.hash,
        gap.difference_w_m2,
        gap.bound_w_m2
    )
}

fn differs(frame: u32, update: UpdateChoice, difference: &Difference) -> Failure {
    Failure::new(format_args!(
        "frame {frame} solved incrementally differs from frame {frame} solved from scratch: {}",
        difference.in_words(ONE, TWO)
    ))
    .help(match update.strategy {
        UpdateFlag::Extrapolate { .. } => "what is extrapolated is not what is there: leave out --update",
        _ => "this is a defect of relume: please report it with the scene; --update scratch avoids it",
    })
}

fn interrupted(done: usize, wanted: usize) -> Failure {
    Failure::interrupted(format_args!(
        "stopped: {} of {} compared, all equal",
        count(done as u64),
        counted(wanted, "frame")
    ))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use relume::session::{Options, Oracle, Session};

    use super::*;
    use crate::args::DemoScene;
    use crate::demo::demo;

    #[test]
    fn a_difference_ends_with_exit_code_1_and_names_the_pair() {
        let scene = Arc::new((demo(DemoScene::Room).build)().unwrap());
        let oracle = Oracle::FormFactor { epsilon: 0.2, min_area_m2: 0.5 };
        let options = Options { oracle, ..Options::default() };
        let at = |time_s| {
            let mut session = Session::new(Arc::clone(&scene), options.clone()).unwrap();
            session.step(7, time_s).unwrap();
            session
        };
        let (one, two) = (at(0.0), at(0.25));
        let certain = UpdateChoice::of(UpdateFlag::Certificate);
        let failure = differs(7, certain, &agree(&one, &two).unwrap_err());
        assert_eq!(failure.exit_code(), 1);
        let text = failure.to_string();
        for part in ["frame 7", "the link between surface `", "incrementally", "X = ", "V = "] {
            assert!(text.contains(part), "`{part}` is missing in: {text}");
        }
        assert!(agree(&one, &one).is_ok());
    }

    #[test]
    fn a_line_says_what_was_compared() {
        let mut report = FrameReport::default();
        (report.frame, report.links, report.hash) = (3, 31_000, "00ff".into());
        let gap = RadiosityGap { difference_w_m2: 1.21e-5, bound_w_m2: 3e-3 };
        assert_eq!(
            line(&report, &gap),
            "frame    3      31,000 links          0 changed  00ff  equal, \
             radiosities within 1.2e-5 of 3.0e-3 W/m2\n"
        );
    }
}
