//! `relume verify`: frame by frame, the links that followed the motion against links built anew.

use relume::session::{Difference, FrameReport, RadiosityGap, Session, compare, radiosity_gap};

use crate::args::{UpdateChoice, UpdateFlag, VerifyArgs};
use crate::clip::{Clip, step_failure};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{self, count, counted};
use crate::progress::Progress;

/// What the two solutions are called in messages.
const ONE: &str = "incrementally";
const TWO: &str = "from scratch";

/// Runs the command. A difference is a failure.
pub(crate) fn verify(args: &VerifyArgs) -> Result<(), Failure> {
    let clip = Clip::open(&args.source, &args.clip)?;
    clip.warn();
    let mut sides = Sides {
        warm: clip.session(UpdateChoice::of(args.update.into()), false)?,
        cold: clip.session(UpdateChoice::of(UpdateFlag::Scratch), false)?,
    };
    let progress = Progress::new(clip.frames.len(), 0, args.clip.quiet);
    let outcome = sides.frames(&clip, &progress, args.clip.quiet);
    progress.clear();
    let tightest = outcome?;
    if args.clip.quiet {
        return Ok(());
    }
    output::print(&format!(
        "{} equal: links bit for bit, radiosities within {:.0} % of their bound\n",
        counted(clip.frames.len(), "frame"),
        100.0 * tightest
    ))
}

/// The two solutions side by side.
struct Sides {
    warm: Session,
    cold: Session,
}

impl Sides {
    /// Solves and compares; the largest share of its bound that a radiosity differed by.
    fn frames(&mut self, clip: &Clip, progress: &Progress, quiet: bool) -> Result<f64, Failure> {
        let (mut tightest, mut links) = (0.0, 0);
        for (done, &frame) in clip.frames.iter().enumerate() {
            if interrupt::requested() {
                return Err(interrupted(done, clip.frames.len()));
            }
            let memory = self.warm.memory_bytes() + self.cold.memory_bytes();
            progress.start(frame, links, memory);
            let time_s = clip.time_of(frame);
            let step = |session: &mut Session| {
                session.step(frame, time_s).map_err(|error| step_failure(error, ""))
            };
            let report = step(&mut self.warm)?;
            step(&mut self.cold)?;
            let gap = agree(&self.warm, &self.cold).map_err(|found| differs(frame, &found))?;
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
fn agree(warm: &Session, cold: &Session) -> Result<RadiosityGap, Difference> {
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
        count(report.changed),
        report.hash,
        gap.difference_w_m2,
        gap.bound_w_m2
    )
}

fn differs(frame: u32, difference: &Difference) -> Failure {
    Failure::new(format_args!(
        "frame {frame} solved incrementally differs from frame {frame} solved from scratch: {}",
        difference.in_words(ONE, TWO)
    ))
    .help("this is a defect of relume: please report it with the scene; --update scratch avoids it")
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

    use relume::session::{Options, Oracle};

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
        let failure = differs(7, &agree(&one, &two).unwrap_err());
        assert_eq!(failure.exit_code(), 1);
        let text = failure.to_string();
        for part in ["frame 7", "the link between surface `", "incrementally", "X = ", "V = "] {
            assert!(text.contains(part), "`{part}` is missing in: {text}");
        }
        assert!(agree(&one, &one).is_ok());
    }

    #[test]
    fn a_line_says_what_was_compared() {
        let report = FrameReport { frame: 3, links: 31_000, hash: "00ff".into(), ..<_>::default() };
        let gap = RadiosityGap { difference_w_m2: 1.21e-5, bound_w_m2: 3e-3 };
        assert_eq!(
            line(&report, &gap),
            "frame    3      31,000 links          0 changed  00ff  equal, \
             radiosities within 1.2e-5 of 3.0e-3 W/m2\n"
        );
    }
}
