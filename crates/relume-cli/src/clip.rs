//! A clip to be solved: its scene, its frames and the options, as every command that solves reads
//! them from the command line. Knows nothing of what becomes of the frames.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use indicatif::HumanBytes;
use relume::scene::{Instants, Scene};
use relume::session::{Aim, Frame, Options, Oracle, Session, SessionError, Snapshot};
use relume_picture::picture::{self, Exposure, Settings};

use crate::args::{
    ClipFlags, DemoScene, FrameFormat, OracleFlag, PictureFlags, Shading, SourceFlags,
    UpdateChoice, UpdateFlag,
};
use crate::demo;
use crate::failure::Failure;
use crate::frames::{self, FrameSpec};
use crate::memory;
use crate::output::{self, count, counted};
use crate::outside;
use crate::scene_file;
pub(crate) use crate::tuning::{MIN_AREA_SHARE, PICTURE_TOLERANCE, TOLERANCE};

/// A scene with the frames asked for.
pub(crate) struct Clip {
    /// The scene.
    pub(crate) scene: Arc<Scene>,
    /// Frames to solve, ascending, each once; never empty.
    pub(crate) frames: Vec<u32>,
    /// Threads in use.
    pub(crate) threads: usize,
    /// How finely it is solved.
    pub(crate) tolerance: f64,
    /// How its pictures are shaded, unless the user says.
    pub(crate) shading: Shading,
    /// What light it has beside the scene's own, as on the command line: asked for, or chosen for pictures.
    pub(crate) light: Option<String>,
    flags: ClipFlags,
}

impl Clip {
    /// The clip that a scene file and the flags describe; `tolerance` where the flags give none.
    ///
    /// Sets the threads of the process: before anything runs in parallel, as choosing a view does.
    pub(crate) fn of_file(path: &Path, flags: &ClipFlags, tolerance: f64) -> Result<Clip, Failure> {
        Clip::read(path, flags, (tolerance, 1), false)
    }

    /// The same with the images that pictures show, and with so many frames at least: what moves rests after its last.
    pub(crate) fn for_pictures(
        path: &Path,
        flags: &ClipFlags,
        tolerance: f64,
        at_least: u32,
    ) -> Result<Clip, Failure> {
        Clip::read(path, flags, (tolerance, at_least), true)
    }

    fn read(
        path: &Path,
        flags: &ClipFlags,
        tolerance_and_frames: (f64, u32),
        pictures: bool,
    ) -> Result<Clip, Failure> {
        let threads = use_threads(flags.threads)?;
        let scene = scene_file::load(path, &flags.animation, pictures, instants(flags))?;
        Clip::of_scene(scene, flags, threads, tolerance_and_frames)
    }

    /// The clip of a scene file or of a demonstration.
    pub(crate) fn open(source: &SourceFlags, flags: &ClipFlags) -> Result<Clip, Failure> {
        match (&source.scene, source.demo) {
            (Some(path), _) => Clip::of_file(path, flags, TOLERANCE),
            (None, Some(demo)) => Clip::of_demo(demo, flags),
            (None, None) => {
                Err(Failure::usage("there is no scene").help("name a .glb or .gltf file"))
            }
        }
    }

    /// The clip of a demonstration with the paper's oracle, at a threshold.
    pub(crate) fn of_the_paper(demo: DemoScene, epsilon: f64) -> Result<Clip, Failure> {
        let oracle = OracleFlag::FormFactor { epsilon, min_area_m2: None };
        Clip::of_demo(demo, &ClipFlags { oracle, ..ClipFlags::default() })
    }

    fn of_demo(name: DemoScene, flags: &ClipFlags) -> Result<Clip, Failure> {
        if flags.animation.name.is_some() {
            return Err(Failure::usage("the demonstrations have one animation, without a name")
                .help("leave out --animation"));
        }
        flags.animation.edits.refuse_for_a_demo()?;
        let threads = use_threads(flags.threads)?;
        let demo = demo::demo(name);
        let scene = (demo.build)().map_err(scene_file::failure)?;
        let clip = Clip::of_scene(scene, flags, threads, (demo.tolerance, 1))?;
        Ok(Clip { shading: demo.shading, ..clip })
    }

    fn of_scene(
        scene: Scene,
        flags: &ClipFlags,
        threads: usize,
        (tolerance, at_least): (f64, u32),
    ) -> Result<Clip, Failure> {
        let tolerance = flags.tolerance.unwrap_or(tolerance);
        let scene = flags.outside.light(scene, flags.time.fps, tolerance)?;
        let frames = frames::resolve(
            flags.time.frames.as_ref(),
            scene.motion.duration_s,
            flags.time.fps,
            at_least,
        )
        .map_err(|error| Failure::new(error).help("`relume info` lists the frames"))?;
        Ok(Clip {
            scene: Arc::new(scene),
            frames,
            threads,
            tolerance,
            shading: Shading::Smooth,
            light: flags.outside.describe(),
            flags: flags.clone(),
        })
    }

    /// Whether light was asked for: from outside, or of a material.
    pub(crate) fn light_is_chosen(&self) -> bool {
        !self.flags.outside.is_empty() || !self.flags.animation.edits.emit.is_empty()
    }

    /// The same clip in the light of a default sky too, and of a sun where its azimuth is known, degrees.
    pub(crate) fn under_sky(&self, azimuth: Option<f64>) -> Result<Clip, Failure> {
        let scene = Arc::new(outside::lit_by_default(&self.scene, azimuth, self.tolerance)?);
        let light = Some(outside::default_light(azimuth));
        Ok(Clip { light, ..self.with_scene(scene) })
    }

    /// The same clip with a lamp at a place in the world (metres): what is half the scene's extent away gets
    /// 1 W/m2 at most.
    pub(crate) fn with_lamp(&self, at: DVec3) -> Clip {
        let bounds = self.scene.bounds(self.time_of(self.frames[0]));
        let extent = bounds.map_or(1.0, |bounds| bounds.diagonal());
        let intensity = extent * extent / 4.0;
        let light = Some(format!("a lamp at {:.4},{:.4},{:.4}", at.x, at.y, at.z));
        let scene = Arc::new(self.scene.with_point_light(at, [intensity; 3]));
        Clip { light, ..self.with_scene(scene) }
    }

    fn with_scene(&self, scene: Arc<Scene>) -> Clip {
        let (frames, flags) = (self.frames.clone(), self.flags.clone());
        Clip { scene, frames, flags, light: self.light.clone(), ..*self }
    }

    /// Says a line on stderr, unless the user wants quiet.
    pub(crate) fn say(&self, line: &str) {
        if !self.flags.quiet {
            output::complain(line);
        }
    }

    /// The same clip with nothing that emits and without light from outside that the file carries, for form factors.
    pub(crate) fn without_light(self) -> Clip {
        Clip { scene: Arc::new(self.scene.without_outside().without_light()), ..self }
    }

    /// The same clip without the inner sides of closed double-sided surfaces in which it is dark: what is
    /// lit elsewhere is the same, at a fraction of the price.
    pub(crate) fn without_dark_sides(self) -> Clip {
        Clip { scene: Arc::new(self.scene.without_dark_sides()), ..self }
    }

    /// A session for another form of the clip's scene that has solved nothing yet.
    pub(crate) fn session_of(
        &self,
        scene: Scene,
        update: UpdateChoice,
    ) -> Result<Session, Failure> {
        // Rows of patches are asked for one by one.
        let options = Options { groups: false, ..self.options(update, false)? };
        Session::new(Arc::new(scene), options).map_err(Failure::new)
    }

    /// Says on stderr what is doubtful about the scene, unless the user wants quiet.
    pub(crate) fn warn(&self) {
        if !self.flags.quiet {
            scene_file::warn(&self.scene, self.flags.verbose);
        }
    }

    /// Says on stderr what a strategy may cost, unless the user wants quiet.
    pub(crate) fn warn_of(&self, update: UpdateChoice) {
        if !self.flags.quiet && matches!(update.strategy, UpdateFlag::Extrapolate { .. }) {
            output::complain(
                "warning: extrapolated links may be far off, above all where bodies touch; `relume bench --compare` \
                 says by how much",
            );
        }
    }

    /// The oracle, as on the command line.
    pub(crate) fn oracle(&self) -> String {
        self.flags.oracle.to_string()
    }

    /// Whether every note is wanted.
    pub(crate) fn is_verbose(&self) -> bool {
        self.flags.verbose && !self.flags.quiet
    }

    /// Frames a second.
    pub(crate) fn fps(&self) -> f64 {
        self.flags.time.fps
    }

    /// Time of a frame, seconds.
    pub(crate) fn time_of(&self, frame: u32) -> f64 {
        frames::time_of(frame, self.flags.time.fps)
    }

    /// What the engine is asked for; `balance` says whether its reports hold row sums and energies.
    pub(crate) fn options(&self, update: UpdateChoice, balance: bool) -> Result<Options, Failure> {
        let oracle = match self.flags.oracle {
            OracleFlag::Error => Oracle::Error,
            OracleFlag::FormFactor { epsilon, min_area_m2 } => Oracle::FormFactor {
                epsilon,
                min_area_m2: min_area_m2.unwrap_or(self.scene.area_m2() * MIN_AREA_SHARE),
            },
        };
        let update = update.asked_for()?;
        Ok(Options {
            tolerance: self.tolerance,
            aim: Aim::Mesh,
            oracle,
            update,
            groups: true,
            balance,
            events: false,
            max_memory_bytes: memory::limit_bytes(),
        })
    }

    /// A session that has solved nothing yet.
    pub(crate) fn session(&self, update: UpdateChoice, balance: bool) -> Result<Session, Failure> {
        self.session_with(self.options(update, balance)?)
    }

    /// The same, with options changed.
    pub(crate) fn session_with(&self, options: Options) -> Result<Session, Failure> {
        Session::new(Arc::clone(&self.scene), options).map_err(Failure::new)
    }
}

/// The frames that flags ask for.
fn instants(flags: &ClipFlags) -> Instants {
    let frames = flags.time.frames.as_ref().map_or(Vec::new(), FrameSpec::ranges);
    Instants { fps: flags.time.fps, frames }
}

/// The message of a step that failed; `kept` says what stays of the frames before it, if anything.
pub(crate) fn step_failure(error: SessionError, kept: &str) -> Failure {
    match error {
        SessionError::OutOfMemory { frame, tolerance, limit_bytes, pairs } => {
            let separator = if kept.is_empty() { "" } else { "; " };
            Failure::out_of_memory(format_args!(
                "frame {frame} at tolerance {tolerance} needs more than the {} of memory \
                 allowed ({} pairs so far)",
                HumanBytes(memory::limit_bytes().unwrap_or(limit_bytes)),
                count(pairs)
            ))
            .help(format_args!("raise --max-memory or the tolerance{separator}{kept}"))
        }
        other if kept.is_empty() => Failure::new(other),
        other => Failure::new(other).help(kept),
    }
}

/// The solution as pictures are to show it.
pub(crate) fn snapshot(session: &Session, flags: &PictureFlags, shading: Shading) -> Snapshot {
    let frame = solved(session);
    if !flags.cleans(shading) {
        return if flags.reconstruct { frame.reconstruction() } else { frame.solution() };
    }
    let lamps = picture::direct_lamps(session.scene(), &session.world());
    match flags.reconstruct {
        true => frame.reconstruction_beside(&lamps),
        false => frame.solution_beside(&lamps),
    }
}

/// What a session has solved last.
pub(crate) fn solved(session: &Session) -> Frame<'_> {
    session.frame().expect("a step leaves a solution")
}

/// Bytes a pixel while a picture is drawn: in tiles and whole.
const PIXEL_BYTES: u64 = 6;
/// The same of layers: in tiles, whole, as channels and packed.
const LAYERS_BYTES: u64 = 280;

/// An error if there is no room for a picture, or no way to draw it.
pub(crate) fn ask_for_picture(flags: &PictureFlags, format: FrameFormat) -> Result<(), Failure> {
    if flags.mesh && format == FrameFormat::Exr {
        return Err(Failure::usage("outlines are no light: they cannot be drawn into numbers")
            .help("leave out --mesh, or use --format png"));
    }
    let pixels = u64::from(flags.size.width) * u64::from(flags.size.height);
    let bytes = match format {
        FrameFormat::Png => PIXEL_BYTES,
        FrameFormat::Exr => LAYERS_BYTES,
    };
    memory::ask(pixels * bytes, format_args!("a picture of {}", flags.size))
}

/// How a picture is drawn.
pub(crate) fn picture_settings(
    flags: &PictureFlags,
    shading: Shading,
    exposure: Exposure,
) -> Settings {
    Settings {
        width: flags.size.width,
        height: flags.size.height,
        shading: match shading {
            Shading::Flat => picture::Shading::Flat,
            Shading::Gouraud => picture::Shading::Gouraud,
            Shading::Smooth => picture::Shading::Smooth,
        },
        exposure,
        mesh: flags.mesh,
        ..Settings::default()
    }
}

/// Display value = radiance (W/m2/sr) x 2^EV.
pub(crate) fn fixed(stops: f64) -> Exposure {
    Exposure::Fixed(stops.exp2())
}

/// Sets the number of threads of the process; the number in use.
fn use_threads(threads: Option<usize>) -> Result<usize, Failure> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(|error| {
            Failure::new(format_args!("cannot start {}: {error}", counted(threads, "thread")))
                .help("ask for fewer with --threads")
        })?;
    }
    Ok(rayon::current_num_threads())
}
