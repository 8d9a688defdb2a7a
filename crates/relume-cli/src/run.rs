//! `relume render`, `solve` and `demo`: frame after frame, each finished before the next begins.
//!
//! A frame is finished when its picture is written and then its entry stands in the report, both
//! in one step each. Whatever ends a run, the directory holds finished frames and a report of
//! exactly those.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use relume::export::{glb, probe, write_atomically};
use relume::scene::Scene;
use relume::session::{Energy, Options, Session, SessionError, Snapshot};
use relume_picture::picture::{self, Exposure};

use crate::accuracy::Estimates;
use crate::args::{
    AccuracyFlag, DemoArgs, ExposureFlag, FrameFormat, PictureFlags, RenderArgs, Shading,
    SolveArgs, SolveFlags, UpdateFlag,
};
use crate::balance::{NO_LIGHT_GETS_IN, balance, gets_no_light, said_of_unbalanced};
use crate::clip::{self, Clip, PICTURE_TOLERANCE, TOLERANCE, fixed};
use crate::clock::now;
use crate::demo;
use crate::events::EventTable;
use crate::exposure::{brightest_frame, stops};
use crate::failure::Failure;
use crate::frames;
use crate::interrupt;
use crate::light;
use crate::lock::{self, Lock};
use crate::memory;
use crate::output::{self, count, counted};
use crate::preview::{self, Meanwhile, PATIENCE};
use crate::progress::Progress;
use crate::report::{PictureOptions, Report, RunOptions, SceneSummary};
use crate::resume;
use crate::scene_file;
use crate::show::ShowFlags;
use crate::size::Size;
use crate::viewing::Viewing;

/// `relume demo`
pub(crate) fn demo(args: DemoArgs) -> Result<(), Failure> {
    let demo = demo::demo(args.scene);
    let dir = args.output.unwrap_or_else(|| format!("relume-demo-{}", demo.name).into());
    let scene = (demo.build)().map_err(scene_file::failure)?;
    make_directory(&dir)?;
    let path = dir.join(format!("{}.glb", demo.name));
    write_demo(&scene, &dir, &path)?;
    let job = Job {
        scene: path,
        dir: Some(dir),
        tolerance: demo.tolerance,
        picture: Some((args.picture.shading.unwrap_or(Shading::Smooth), args.picture)),
        format: FrameFormat::Png,
        show: ShowFlags::default(),
        preview: false,
        solve: args.solve,
    };
    job.run()
}

/// Writes the scene of a demonstration into a folder where no other run writes, unless another file has its name.
fn write_demo(scene: &Scene, dir: &Path, path: &Path) -> Result<(), Failure> {
    let _lock = Lock::take(dir)?;
    let bytes = glb(scene).map_err(Failure::new)?;
    if fs::read(path).is_ok_and(|there| there != bytes) {
        return Err(Failure::new(format_args!("{} is another scene", path.display()))
            .help("move it away, or name another directory with -o"));
    }
    let _guard = interrupt::writing();
    write_atomically(path, &bytes).map_err(|error| Failure::write(path, &error))
}

/// `relume render`
pub(crate) fn render(args: RenderArgs) -> Result<(), Failure> {
    let job = Job {
        preview: args.preview,
        format: args.format,
        show: args.show,
        scene: args.scene,
        dir: Some(args.output),
        tolerance: PICTURE_TOLERANCE,
        picture: Some((args.picture.shading.unwrap_or(Shading::Smooth), args.picture)),
        solve: args.solve,
    };
    job.run()
}

/// `relume solve`
pub(crate) fn solve(args: SolveArgs) -> Result<(), Failure> {
    let job = Job {
        scene: args.scene,
        dir: args.output,
        tolerance: TOLERANCE,
        picture: None,
        format: FrameFormat::Png,
        show: ShowFlags::default(),
        preview: false,
        solve: args.solve,
    };
    job.run()
}

/// One run as asked for.
struct Job {
    scene: PathBuf,
    dir: Option<PathBuf>,
    /// Unless the flags give one.
    tolerance: f64,
    picture: Option<(Shading, PictureFlags)>,
    format: FrameFormat,
    /// What is shown in place of pictures.
    show: ShowFlags,
    /// Whether pictures are rough ones, and nothing is solved.
    preview: bool,
    solve: SolveFlags,
}

impl Job {
    fn run(self) -> Result<(), Failure> {
        let started = now();
        if self.solve.resume && self.report_paths().is_empty() {
            return Err(Failure::usage("there is nothing to resume from").help(
                "give the directory of the earlier run with -o, or its report with --report",
            ));
        }
        let (clip, views) = self.open_clip()?;
        if let Some((_, flags)) = &self.picture {
            // Not only after the first frame.
            clip::ask_for_picture(flags, self.format)?;
        }
        if let Some(dir) = &self.dir {
            make_directory(dir)?;
        }
        let _locks = self.locks()?;
        if let (true, Some(dir), Some(views), Some((_, flags))) =
            (self.preview, &self.dir, &views, &self.picture)
        {
            return preview::draw(&clip, views, flags, dir);
        }
        let report = self.open_report(&clip)?;
        let wanted = &clip.frames;
        let pending: Vec<u32> =
            wanted.iter().copied().filter(|frame| !report.frames.contains_key(frame)).collect();
        if !self.quiet() {
            self.warn_of_old_pictures(wanted, &report);
            self.warn_of_no_events();
        }
        let progress = Progress::new(wanted.len(), wanted.len() - pending.len(), self.quiet());
        // Before the session, which takes its time with many patches.
        let first = pending.first().filter(|_| report.frames.is_empty());
        let patience = PATIENCE.saturating_sub(started.elapsed());
        let mut meanwhile = match (first, &views) {
            (Some(&frame), Some(views)) => {
                self.meanwhile((&clip, views), frame, &progress, patience)?
            }
            _ => None,
        };
        let mut run = self.begin(&clip, views, report, progress, pending.len())?;
        let outcome = run.frames((wanted, &pending), &mut meanwhile);
        run.progress.clear();
        // Also where a frame failed: what was finished stays.
        let there = run.finished().report.frames.keys().copied().collect::<BTreeSet<u32>>();
        if !there.is_empty() {
            run.finished().write()?;
        }
        let outcome = outcome?;
        // Also where it is quiet: the numbers of these frames are in doubt.
        if let Some(line) = said_of_unbalanced(&run.finished().report, wanted) {
            output::complain(&line);
        }
        match outcome {
            Outcome::Interrupted => {
                let finished = wanted.iter().filter(|f| there.contains(f)).count();
                Err(self.interrupted(finished, wanted.len()))
            }
            Outcome::Done => self.summary(wanted, &pending, &run, started.elapsed()),
        }
    }

    /// The clip, without what shows nothing, and what pictures of it look at.
    fn open_clip(&self) -> Result<(Clip, Option<Viewing>), Failure> {
        let (clip, views) = match &self.picture {
            Some((_, flags)) => {
                let at_least = flags.view.frames_at_least();
                let read =
                    Clip::for_pictures(&self.scene, &self.solve.clip, self.tolerance, at_least)?;
                light::for_pictures(read, &flags.view)?
            }
            None => {
                let read = Clip::of_file(&self.scene, &self.solve.clip, self.tolerance)?;
                light::required(&read.scene).map(|()| (read, None))?
            }
        };
        self.check_shown(&clip)?;
        clip.warn();
        clip.warn_of(self.solve.update);
        let clip = clip.without_dark_sides();
        let views = match (views, &self.picture) {
            (None, Some((_, flags))) => Some(Viewing::new(&clip.scene, &flags.view)?),
            (views, _) => views,
        };
        Ok((clip, views))
    }

    /// A session that has solved nothing yet, with what a run needs besides; what it finishes is kept if it is interrupted.
    fn begin(
        &self,
        clip: &Clip,
        views: Option<Viewing>,
        report: Report,
        progress: Progress,
        pending: usize,
    ) -> Result<Run<'_>, Failure> {
        let events = self.solve.events.as_ref().map(|_| EventTable::new());
        let options = clip.options(self.solve.update, true)?;
        let session = clip.session_with(Options {
            events: events.is_some() || self.show.needs_events(),
            ..options
        })?;
        let size = Size::of(clip, session.options());
        if !self.quiet() {
            let rough = if self.picture.is_some() { ", or rough pictures: --preview" } else { "" };
            progress.suspend(|| size.warn(clip, pending, rough));
        }
        progress.watch(session.watch(), size.pairs());
        let paths = (self.report_paths(), self.solve.events.clone());
        let finished = Arc::new(Mutex::new(Finished { report, events, paths }));
        let keep = Arc::clone(&finished);
        interrupt::keep_with(move || interrupt::locked(&keep).write());
        Ok(Run {
            job: self,
            session,
            views,
            finished,
            progress,
            links: 0,
            energy: None,
            suspects: Vec::new(),
            estimates: Estimates::new(match self.quiet() && self.report_paths().is_empty() {
                // Nobody would read it.
                true => AccuracyFlag::Off,
                false => self.solve.accuracy,
            }),
        })
    }

    fn quiet(&self) -> bool {
        self.solve.clip.quiet
    }

    /// A rough picture of a frame, for as long as none is finished.
    fn meanwhile(
        &self,
        (clip, views): (&Clip, &Viewing),
        frame: u32,
        progress: &Progress,
        patience: Duration,
    ) -> Result<Option<(Meanwhile, PathBuf)>, Failure> {
        let (Some(dir), Some((_, flags))) = (&self.dir, &self.picture) else { return Ok(None) };
        let view = views.at(&clip.scene, frame, clip.fps())?;
        let aside = progress.aside();
        let quiet = self.quiet();
        let say = move |line: &str| {
            if !quiet {
                aside(line);
            }
        };
        let path = preview::path(dir);
        let of = (Arc::clone(&clip.scene), clip.time_of(frame));
        let picture =
            Meanwhile::new(of, (view, preview::settings(flags)), (path.clone(), patience), say);
        Ok(Some((picture, path)))
    }

    /// The locks of the folders and files that are this run's alone while it goes: the folders of the pictures and of a report by the
    /// name that runs give theirs, other reports and the events.
    fn locks(&self) -> Result<Vec<Lock>, Failure> {
        let beside = self.solve.report.as_deref().filter(|path| lock::is_of_a_run(path));
        let beside = beside.map(|path| match path.parent() {
            Some(dir) if dir != Path::new("") => dir,
            _ => Path::new("."),
        });
        let of = |dir: Option<&Path>| dir.and_then(|dir| fs::canonicalize(dir).ok());
        // A folder that is not there is said when the report is written.
        let beside = beside.filter(|dir| dir.is_dir() && of(Some(dir)) != of(self.dir.as_deref()));
        let folders = self.dir.as_deref().into_iter().chain(beside).map(Lock::take);
        let files = self.solve.report.as_deref().into_iter().chain(self.solve.events.as_deref());
        let files = files.filter_map(|path| Lock::of_file(path).transpose());
        folders.chain(files).collect()
    }

    /// Where the report goes.
    fn report_paths(&self) -> Vec<PathBuf> {
        let in_dir = self.dir.as_ref().map(|dir| dir.join("report.json"));
        in_dir.into_iter().chain(self.solve.report.clone()).collect()
    }

    /// The report of this run, with what an earlier one finished. An older report stays until a
    /// frame is finished; that it can be replaced is tried at once.
    fn open_report(&self, clip: &Clip) -> Result<Report, Failure> {
        let summary = SceneSummary::new(&clip.scene, {
            let environment = self.solve.clip.outside.environment.as_deref();
            resume::content_hash(&self.scene, environment)?
        });
        let mut report = Report::new(summary, self.run_options(clip));
        let paths = self.report_paths();
        if self.solve.resume
            && let Some(earlier) = Report::read(&paths[0])?
        {
            resume::take_over(&mut report, earlier, &paths[0], |frame, digest| {
                self.picture_is_whole(frame, digest)
            })?;
        }
        for path in &paths {
            probe(path).map_err(|error| Failure::write(path, &error))?;
        }
        Ok(report)
    }

    fn run_options(&self, clip: &Clip) -> RunOptions {
        let picture = self.picture.as_ref().map(|(shading, flags)| PictureOptions {
            size: flags.size.to_string(),
            shading: *shading,
            camera: flags.view.camera.clone(),
            view: [flags.view.described(), self.show.described()].concat(),
            exposure: flags.exposure.to_string(),
            exposure_ev: match flags.exposure {
                ExposureFlag::Auto => None,
                ExposureFlag::Stops(stops) => Some(stops),
            },
            mesh: flags.mesh,
            reconstruct: flags.reconstruct,
            cleanup: flags.cleans(*shading),
        });
        let flags = &self.solve.clip;
        RunOptions {
            frames: flags.time.frames.as_ref().map_or("all".into(), ToString::to_string),
            fps: flags.time.fps,
            animation: flags.animation.name.clone(),
            edits: flags.animation.described(),
            tolerance: clip.tolerance,
            oracle: flags.oracle.to_string(),
            update: self.solve.update.name(),
            threads: clip.threads,
            max_memory_bytes: memory::limit_bytes(),
            outside: clip.light.clone(),
            picture,
        }
    }

    /// An error where what is asked to be shown is not there.
    fn check_shown(&self, clip: &Clip) -> Result<(), Failure> {
        if self.show.show.is_some() && self.format == FrameFormat::Exr {
            return Err(Failure::usage("--show is for pictures: .exr files hold the numbers")
                .help("leave out --show, or use --format png"));
        }
        self.show.check(&clip.scene, clip.options(self.solve.update, true)?.update)
    }

    /// Path of a frame's picture, if this run makes pictures.
    fn picture_path(&self, frame: u32) -> Option<PathBuf> {
        self.picture.as_ref()?;
        Some(self.dir.as_ref()?.join(format!("frame-{frame:04}.{}", self.format.ending())))
    }

    /// Whether a frame's picture is there, undamaged and the one that was finished.
    fn picture_is_whole(&self, frame: u32, digest: Option<&str>) -> bool {
        let whole = |path: PathBuf| {
            path.is_file()
                && scene_file::read(&path).is_ok_and(|bytes| {
                    let is_whole = match self.format {
                        FrameFormat::Png => picture::is_whole_png(&bytes),
                        FrameFormat::Exr => picture::is_whole_exr(&bytes),
                    };
                    is_whole && digest.is_none_or(|digest| digest == resume::digest(&bytes))
                })
        };
        self.picture_path(frame).is_none_or(whole)
    }

    /// Events that will not come.
    fn warn_of_no_events(&self) {
        if self.solve.events.is_some() && self.solve.update.strategy == UpdateFlag::Scratch {
            output::complain(
                "warning: with `--update scratch` every frame is built anew: there are no events",
            );
        }
    }

    /// Pictures in the directory that no run described by the report has made.
    fn warn_of_old_pictures(&self, wanted: &[u32], report: &Report) {
        let (Some(dir), Some(_)) = (&self.dir, &self.picture) else { return };
        let Ok(entries) = fs::read_dir(dir) else { return };
        let number = |name: &str| -> Option<u32> {
            name.strip_prefix("frame-")?
                .strip_suffix(self.format.ending())?
                .strip_suffix('.')?
                .parse()
                .ok()
        };
        let mut old: Vec<u32> = entries
            .flatten()
            .filter_map(|entry| number(entry.file_name().to_str()?))
            .filter(|frame| wanted.binary_search(frame).is_err())
            .filter(|frame| !report.frames.contains_key(frame))
            .collect();
        old.sort_unstable();
        if !old.is_empty() {
            output::complain(&format!(
                "warning: {} also holds pictures of an earlier run: frames {}",
                dir.display(),
                frames::describe(&old)
            ));
        }
    }

    fn interrupted(&self, finished: usize, wanted: usize) -> Failure {
        let failure = Failure::interrupted(format_args!(
            "stopped: {} of {} finished",
            count(finished as u64),
            counted(wanted, "frame")
        ));
        if self.report_paths().is_empty() {
            failure.help("with -o DIR or --report FILE a stopped run can be resumed")
        } else {
            failure.help("the same command with --resume goes on from here")
        }
    }

    /// The line at the end, on stdout.
    fn summary(
        &self,
        wanted: &[u32],
        pending: &[u32],
        run: &Run<'_>,
        elapsed: Duration,
    ) -> Result<(), Failure> {
        if self.quiet() {
            return Ok(());
        }
        let mut line = counted(wanted.len(), "frame");
        let kept = wanted.len() - pending.len();
        if kept > 0 {
            line += &format!(" ({} finished before)", count(kept as u64));
        }
        if !pending.is_empty() {
            line += &format!(", {} links, {:.1} s", count(run.links), elapsed.as_secs_f64());
        }
        match (&self.dir, &self.picture) {
            (Some(dir), Some(_)) => line += &format!(", pictures in {}", dir.display()),
            (Some(dir), None) => line += &format!(", report in {}", dir.display()),
            (None, _) => {}
        }
        if let Some((frame, energy)) = &run.energy {
            line += &match gets_no_light(run.session.scene(), energy) {
                true => NO_LIGHT_GETS_IN.to_owned(),
                false => balance(*frame, energy, &run.suspects),
            };
        }
        line += &run.estimates.line(run.session.options().tolerance);
        output::print(&(line + "\n"))
    }
}

/// What a run has finished. Whatever ends the run, this is written.
struct Finished {
    report: Report,
    /// What is written to `--events`.
    events: Option<EventTable>,
    /// Where reports go, and events.
    paths: (Vec<PathBuf>, Option<PathBuf>),
}

impl Finished {
    /// Writes the report and the events, unless nothing is finished.
    fn write(&mut self) -> Result<(), Failure> {
        if self.report.frames.is_empty() {
            return Ok(());
        }
        self.write_report()?;
        let (Some(path), Some(table)) = (&self.paths.1, &self.events) else { return Ok(()) };
        let _guard = interrupt::writing();
        write_atomically(path, table.text().as_bytes())
            .map_err(|error| Failure::write(path, &error))
    }

    fn write_report(&mut self) -> Result<(), Failure> {
        let peak = memory::peak_bytes().unwrap_or(0);
        self.report.peak_memory_bytes = self.report.peak_memory_bytes.max(peak);
        self.paths.0.iter().try_for_each(|path| self.report.write(path))
    }
}

/// How a run ended.
enum Outcome {
    Done,
    Interrupted,
}

/// A run under way.
struct Run<'a> {
    job: &'a Job,
    session: Session,
    views: Option<Viewing>,
    /// Locked for as long as an entry takes, since whatever ends the run writes it.
    finished: Arc<Mutex<Finished>>,
    progress: Progress,
    /// Links of the last frame.
    links: u64,
    /// Number and energy balance of the frame that was solved last.
    energy: Option<(u32, Energy)>,
    /// Surfaces that receive more than they can.
    suspects: Vec<String>,
    estimates: Estimates,
}

impl Run<'_> {
    fn finished(&self) -> MutexGuard<'_, Finished> {
        interrupt::locked(&self.finished)
    }

    /// Solves and draws the frames that are not finished yet, in order.
    fn frames(
        &mut self,
        (wanted, pending): (&[u32], &[u32]),
        meanwhile: &mut Option<(Meanwhile, PathBuf)>,
    ) -> Result<Outcome, Failure> {
        for &frame in pending {
            if interrupt::requested() {
                return Ok(Outcome::Interrupted);
            }
            self.fix_exposure(frame)?;
            if interrupt::requested() {
                return Ok(Outcome::Interrupted);
            }
            let before = wanted.iter().rev().find(|&&earlier| earlier < frame);
            self.session.count_motion_from(
                before.map(|&f| frames::time_of(f, self.job.solve.clip.time.fps)),
            );
            self.lead_to(frame)?;
            self.frame(frame)?;
            if let Some((mut meanwhile, path)) = meanwhile.take() {
                meanwhile.end(&path);
            }
            self.progress.finish_frame();
            // Whatever ends the run from here on, the report has this frame.
            self.finished().write_report()?;
        }
        Ok(Outcome::Done)
    }

    /// Solves what has to be solved before a frame so that it can be shown.
    fn lead_to(&mut self, frame: u32) -> Result<(), Failure> {
        let last = self.session.frame().map(|solved| solved.report().frame);
        for before in self.job.show.frames_before(frame, last) {
            let time_s = frames::time_of(before, self.job.solve.clip.time.fps);
            self.session.step(before, time_s).map_err(|error| self.session_failure(error))?;
        }
        Ok(())
    }

    fn frame(&mut self, frame: u32) -> Result<(), Failure> {
        self.progress.start(frame, self.links, self.session.memory_bytes());
        let mut entry = self
            .session
            .step(frame, frames::time_of(frame, self.job.solve.clip.time.fps))
            .map_err(|error| self.session_failure(error))?;
        self.links = entry.links;
        self.energy = entry.energy.map(|energy| (frame, energy));
        self.suspects = entry.suspects.clone();
        entry.accuracy = self.estimates.of(clip::solved(&self.session), frame, None);
        let picture = match self.job.picture_path(frame) {
            Some(path) => self.draw(frame, &path)?,
            None => None,
        };
        let mut finished = self.finished();
        finished.report.add(&entry, picture.as_deref())?;
        if let Some(table) = &mut finished.events {
            table.add(frame, &clip::solved(&self.session).events());
        }
        Ok(())
    }

    /// Draws the picture of a frame; the digest of its bytes.
    fn draw(&mut self, frame: u32, path: &Path) -> Result<Option<String>, Failure> {
        let Some((shading, flags)) = &self.job.picture else { return Ok(None) };
        let snapshot = clip::snapshot(&self.session, flags, *shading);
        if self.exposure_is_open() {
            self.choose_exposure(frame, &snapshot)?;
        }
        let Some((view, options, flags)) = self.view(frame)? else { return Ok(None) };
        let exposure = options.exposure_ev.map_or(Exposure::Automatic, fixed);
        let settings = clip::picture_settings(flags, options.shading, exposure);
        clip::ask_for_picture(flags, self.job.format)?;
        let scale = options.exposure_ev.map_or(1.0, f64::exp2);
        let shown = self.job.show.draw(&self.session, &snapshot, (&view, &settings), scale)?;
        let bytes = match self.job.format {
            FrameFormat::Png => {
                shown.unwrap_or_else(|| picture::render(&snapshot, &view, &settings)).to_png()
            }
            FrameFormat::Exr => picture::layers(&snapshot, &view, &settings).to_exr(),
        };
        drop(snapshot);
        let bytes = bytes.map_err(Failure::new)?;
        // No longer than it takes: while this is held, nothing can end the run.
        let _guard = interrupt::writing();
        write_atomically(path, &bytes).map_err(|error| {
            Failure::write(path, &error)
                .help("free some space or check the permissions, then run again with --resume")
        })?;
        Ok(Some(resume::digest(&bytes)))
    }

    /// What pictures of a frame are made with, if any are made.
    fn view(
        &self,
        frame: u32,
    ) -> Result<Option<(picture::View, PictureOptions, &PictureFlags)>, Failure> {
        let options = self.finished().report.options.picture.clone();
        let parts = (&self.views, options, &self.job.picture);
        let (Some(views), Some(options), Some((_, flags))) = parts else { return Ok(None) };
        let view = views.at(self.session.scene(), frame, self.job.solve.clip.time.fps)?;
        Ok(Some((view, options, flags)))
    }

    /// Chooses the automatic exposure once, before the first picture.
    ///
    /// It is that of the first of the frames of the whole animation in which most is emitted, whichever
    /// frames were asked for: so that the parts of a clip that were made by different runs match.
    /// Where that frame is not the one that comes next it costs one more solution, in a session of
    /// its own, so that the counters of this one stay what they would be.
    fn fix_exposure(&mut self, next: u32) -> Result<(), Failure> {
        if !self.exposure_is_open() {
            return Ok(());
        }
        let fps = self.job.solve.clip.time.fps;
        let scene = Arc::clone(self.session.scene());
        let frame = brightest_frame(&scene, fps).unwrap_or(next);
        if frame == next {
            // Left to `draw`, which has the solution.
            return Ok(());
        }
        self.progress.start(frame, 0, 0);
        let options = self.session.options().clone();
        let mut session = Session::new(scene, options).map_err(Failure::new)?;
        session
            .step(frame, frames::time_of(frame, fps))
            .map_err(|error| self.session_failure(error))?;
        let Some((_, flags)) = &self.job.picture else { return Ok(()) };
        // Metered over flat elements, whatever the picture shows.
        let snapshot = clip::snapshot(&session, flags, Shading::Flat);
        self.choose_exposure(frame, &snapshot)
    }

    fn exposure_is_open(&self) -> bool {
        let picture = &self.finished().report.options.picture;
        picture.as_ref().is_some_and(|options| options.exposure_ev.is_none())
    }

    fn choose_exposure(&mut self, frame: u32, snapshot: &Snapshot) -> Result<(), Failure> {
        let Some((view, ..)) = self.view(frame)? else { return Ok(()) };
        let metered = Exposure::metered(snapshot, &view);
        if metered.lit < LIT_MIN && !self.job.quiet() {
            self.progress.suspend(|| output::complain(ALMOST_DARK));
        }
        if let (Exposure::Fixed(scale), Some(options)) =
            (metered.exposure, &mut self.finished().report.options.picture)
        {
            options.exposure_ev = Some(stops(scale));
        }
        Ok(())
    }

    fn session_failure(&self, error: SessionError) -> Failure {
        let kept = !self.finished().report.frames.is_empty() && !self.job.report_paths().is_empty();
        let kept = if kept { "the frames before it are finished and stay" } else { "" };
        clip::step_failure(error, kept)
    }
}

/// Share of a picture that shows light, below which that is said.
const LIT_MIN: f64 = 0.01;
const ALMOST_DARK: &str = "warning: the view sees almost no light: look from elsewhere (--overview, --camera NAME, --eye \
                           X,Y,Z), light what it sees (--emit MATERIAL=RADIANCE), or, if that is black, let it reflect \
                           (--reflect MATERIAL=R)";

fn make_directory(dir: &Path) -> Result<(), Failure> {
    if dir.exists() && !dir.is_dir() {
        return Err(Failure::new(format_args!("{} is a file, not a directory", dir.display()))
            .help("choose another directory with -o"));
    }
    // Without a dot at its end, which names nothing while the folder is not there.
    let to_make: PathBuf = dir.components().collect();
    fs::create_dir_all(to_make).map_err(|error| Failure::write(dir, &error))
}
