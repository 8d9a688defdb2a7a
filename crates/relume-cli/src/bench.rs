//! `relume bench`: what a frame costs against building it from scratch.
//!
//! Measures only; `figures` makes tables of it. Every frame is measured in two sessions in turns:
//! one that follows the motion, and one set up for this frame alone. So whatever else the machine
//! does hits both alike, and ratios hold where seconds do not.

use relume::export::write_atomically;
use relume::session::Session;
use relume_picture::picture::{self, Exposure};

use crate::args::{BenchArgs, ExposureFlag, PictureFlags, Shading, UpdateChoice, UpdateFlag};
use crate::clip::{self, Clip, fixed};
use crate::clock::now;
use crate::failure::Failure;
use crate::figures::{Cold, Figures, Held, Measured};
use crate::interrupt;
use crate::lock::Lock;
use crate::memory;
use crate::output::{self, count, counted};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::sequence::{Sequence, Stepping};
use crate::strategies;
use crate::viewing::Viewing;

/// Draws the present frame of a session, at a time; the seconds that took.
pub(crate) type Draw<'a, S> = Box<dyn FnMut(&S, f64) -> Result<f64, Failure> + 'a>;

/// Runs the command.
pub(crate) fn bench(args: &BenchArgs) -> Result<(), Failure> {
    let clip = Clip::open(&args.source, &args.clip)?;
    clip.warn();
    let clip = clip.without_dark_sides();
    let plan = Plan::new(&args.measure, args.update, args.clip.quiet);
    let draw = match args.no_pictures || plan.compare {
        true => None,
        false => Some(draw_and_drop(&args.picture, &clip)?),
    };
    measure(&plan, &clip, draw)
}

/// Pictures that are drawn, timed and thrown away.
pub(crate) fn draw_and_drop<'a>(
    flags: &'a PictureFlags,
    clip: &'a Clip,
) -> Result<Draw<'a, Session>, Failure> {
    let mut drawing = Drawing::new(flags, clip)?;
    Ok(Box::new(move |session: &Session, time_s| drawing.draw(session, time_s)))
}

/// Measures a sequence, and prints and writes what was found.
pub(crate) fn measure<'a, Q: Sequence>(
    plan: &'a Plan<'a>,
    sequence: &'a Q,
    draw: Option<Draw<'a, Q::Session>>,
) -> Result<(), Failure> {
    let _lock = plan.json.map(Lock::of_file).transpose()?;
    if plan.compare {
        enough(sequence)?;
        return strategies::compare(plan, sequence);
    }
    let (figures, measured) = figures(plan, sequence, draw)?;
    // Also where the run was stopped: what was measured stays.
    if let Some(figures) = figures {
        if !plan.quiet {
            output::print(&figures.text())?;
        }
        if let Some(path) = plan.json {
            let _guard = interrupt::writing();
            write_atomically(path, figures.json()?.as_bytes())
                .map_err(|error| Failure::write(path, &error))?;
        }
    }
    if measured == sequence.frames().len() {
        return Ok(());
    }
    Err(stopped(measured, sequence))
}

/// What was measured of a sequence, nothing before its second frame; and how many frames were.
pub(crate) fn figures<'a, Q: Sequence>(
    plan: &'a Plan<'a>,
    sequence: &'a Q,
    draw: Option<Draw<'a, Q::Session>>,
) -> Result<(Option<Figures>, usize), Failure> {
    enough(sequence)?;
    let mut bench = Bench::new(plan, sequence, draw)?;
    let outcome = bench.frames();
    bench.progress.clear();
    outcome?;
    let measured = bench.frames.len() + usize::from(bench.first.is_some());
    Ok((bench.figures(), measured))
}

/// The message of a run that was interrupted.
pub(crate) fn stopped(measured: usize, sequence: &impl Sequence) -> Failure {
    Failure::interrupted(format_args!(
        "stopped: {} of {} measured",
        count(measured as u64),
        counted(sequence.frames().len(), "frame")
    ))
}

fn enough(sequence: &impl Sequence) -> Result<(), Failure> {
    if sequence.frames().len() < 2 {
        return Err(Failure::new(
            "a bench takes two frames or more: the first is built from scratch",
        )
        .help("ask for more with --frames; a scene in which nothing moves has frame 0 only"));
    }
    Ok(())
}

/// A bench under way.
struct Bench<'a, Q: Sequence> {
    plan: &'a Plan<'a>,
    sequence: &'a Q,
    session: Q::Session,
    draw: Option<Draw<'a, Q::Session>>,
    progress: Progress,
    first: Option<Measured>,
    frames: Vec<Measured>,
}

impl<'a, Q: Sequence> Bench<'a, Q> {
    fn new(
        plan: &'a Plan<'a>,
        sequence: &'a Q,
        draw: Option<Draw<'a, Q::Session>>,
    ) -> Result<Bench<'a, Q>, Failure> {
        Ok(Bench {
            plan,
            sequence,
            // Set up again, and timed, with the first frame.
            session: sequence.begin(plan.update)?,
            draw,
            progress: Progress::new(sequence.frames().len(), 0, plan.quiet),
            first: None,
            frames: Vec::new(),
        })
    }

    /// Measures frame after frame, until asked to stop.
    fn frames(&mut self) -> Result<(), Failure> {
        for (k, &frame) in self.sequence.frames().iter().enumerate() {
            if interrupt::requested() {
                return Ok(());
            }
            let links = self.frames.last().map_or(0, |m| m.report.links);
            self.progress.start(frame, links, self.session.held_bytes());
            if k == 0 {
                self.first = Some(self.first(frame)?);
            } else {
                let next = self.next(k, frame)?;
                self.frames.push(next);
            }
            self.progress.finish_frame();
        }
        Ok(())
    }

    /// Sets up and solves the first frame.
    fn first(&mut self, frame: u32) -> Result<Measured, Failure> {
        let (session, Cold { seconds, report }) = self.build(frame, None, self.plan.update)?;
        self.session = session;
        let picture_seconds = self.draw(frame)?;
        Ok(Measured { seconds, picture_seconds, report, cold: None })
    }

    /// Follows the motion to a frame, and builds it from scratch where that is asked for: the two in
    /// turns before and after each other.
    fn next(&mut self, k: usize, frame: u32) -> Result<Measured, Failure> {
        let asked = (k - 1).is_multiple_of(self.plan.every);
        let before = k.is_multiple_of(2);
        let from = self.sequence.frames()[k - 1];
        let mut cold = if asked && before { Some(self.cold(frame, from)?) } else { None };
        let started = now();
        let report = self.sequence.step(&mut self.session, frame, 0)?;
        let seconds = started.elapsed().as_secs_f64();
        let picture_seconds = self.draw(frame)?;
        if asked && !before {
            cold = Some(self.cold(frame, from)?);
        }
        Ok(Measured { seconds, picture_seconds, report, cold })
    }

    fn cold(&self, frame: u32, from: u32) -> Result<Cold, Failure> {
        Ok(self.build(frame, Some(from), UpdateChoice::of(UpdateFlag::Scratch))?.1)
    }

    /// A session set up for one frame, with the time that took; dynamic links are counted from
    /// another.
    fn build(
        &self,
        frame: u32,
        from: Option<u32>,
        update: UpdateChoice,
    ) -> Result<(Q::Session, Cold), Failure> {
        let started = now();
        let mut session = self.sequence.begin(update)?;
        session.count_from(from.map(|frame| self.sequence.time_of(frame)));
        let report = self.sequence.step(&mut session, frame, self.session.held_bytes())?;
        let seconds = started.elapsed().as_secs_f64();
        Ok((session, Cold { seconds, report }))
    }

    /// Draws the present frame, if pictures are drawn; the seconds that took.
    fn draw(&mut self, frame: u32) -> Result<Option<f64>, Failure> {
        let Some(draw) = &mut self.draw else { return Ok(None) };
        draw(&self.session, self.sequence.time_of(frame)).map(Some)
    }

    /// What was measured; `None` before the second frame.
    fn figures(self) -> Option<Figures> {
        let held = self.session.held();
        let peak = memory::peak_bytes().unwrap_or_else(|| self.session.held_bytes());
        let report = &self.frames.last()?.report;
        let held = Held {
            pair_bytes: held.pairs,
            element_bytes: held.elements,
            fixed_bytes: held.fixed,
            peak_bytes: peak,
            pairs: report.pairs.active + report.pairs.refined + report.pairs.culled,
            elements: report.elements,
            links: report.links,
        };
        Some(Figures {
            sequence: self.sequence.name().to_owned(),
            tolerance: self.sequence.tolerance(),
            oracle: self.sequence.oracle(),
            settings: self.sequence.settings(),
            update: self.plan.update.name(),
            threads: self.sequence.threads(),
            first: self.first?,
            frames: self.frames,
            held,
        })
    }
}

/// Pictures that are drawn and thrown away.
struct Drawing<'a> {
    flags: &'a PictureFlags,
    clip: &'a Clip,
    views: Viewing,
    /// Chosen at the first picture where the flags say `auto`.
    exposure: Option<Exposure>,
}

impl<'a> Drawing<'a> {
    fn new(flags: &'a PictureFlags, clip: &'a Clip) -> Result<Drawing<'a>, Failure> {
        let views = Viewing::new(&clip.scene, &flags.view)?;
        let exposure = match flags.exposure {
            ExposureFlag::Auto => None,
            ExposureFlag::Stops(stops) => Some(fixed(stops)),
        };
        Ok(Drawing { flags, clip, views, exposure })
    }

    /// Seconds from the solution to the pixels.
    fn draw(&mut self, session: &Session, time_s: f64) -> Result<f64, Failure> {
        let view = self.views.at_time(&self.clip.scene, time_s)?;
        let flags = self.flags;
        let automatic =
            || Exposure::automatic(&clip::snapshot(session, flags, Shading::Flat), &view);
        let exposure = *self.exposure.get_or_insert_with(automatic);
        let shading = self.flags.shading.unwrap_or(self.clip.shading);
        let settings = clip::picture_settings(self.flags, shading, exposure);
        let started = now();
        let image = picture::render(&clip::snapshot(session, flags, shading), &view, &settings);
        let seconds = started.elapsed().as_secs_f64();
        drop(image);
        Ok(seconds)
    }
}
