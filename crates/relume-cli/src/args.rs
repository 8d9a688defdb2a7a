//! The command line as a value: the commands with the options of each, and their defaults. Knows no scene and no engine
//! state.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::frames::FrameSpec;
use crate::outside::OutsideFlags;
use crate::scene_file::AnimationFlag;
use crate::show::ShowFlags;
use crate::viewing::ViewFlags;

mod values;

pub(crate) use values::{
    AccuracyFlag, By, ClosureFlag, ExactUpdate, ExposureFlag, FactorFormat, FrameFormat,
    MemorySize, OracleFlag, Shading, Size, UpdateChoice, UpdateFlag,
};
use values::{parse_every, parse_fps, parse_threads, parse_tolerance};

/// `relume ...`
#[derive(Debug, Parser)]
#[command(
    name = "relume",
    version,
    about = "Diffuse light of animated glTF scenes, frame by frame (hierarchical radiosity)",
    after_help = "Start with:  relume demo room\n\
                  Exit codes:  0 done, 1 an error (or one found by `check` or `verify`), 2 wrong usage, 3 more than \
                  --max-memory is needed, 130 interrupted",
    arg_required_else_help = true,
    max_term_width = 100
)]
pub(crate) struct Cli {
    /// Limit on all memory that the process holds, in bytes or with K, M, G or T (powers of 1024): 4G,
    /// 512M; what needs more ends with exit code 3 [default: no limit].
    #[arg(long, value_name = "SIZE", global = true, allow_negative_numbers = true)]
    pub(crate) max_memory: Option<MemorySize>,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write a scene that ships with relume as .glb and render it.
    ///
    /// Two scenes are the sequences of the paper: a corridor with a box under a light that
    /// moves in the plane of the ceiling (109 frames), and a closed room with a light that circles
    /// below the ceiling (20 frames). The third is a furnished living room (36 frames).
    Demo(DemoArgs),
    /// Solve a scene and write one PNG a frame: DIR/frame-0000.png ...
    Render(RenderArgs),
    /// Solve a scene without pictures.
    Solve(SolveArgs),
    /// Solve a scene and write it with its light as one file for other programs; the name says which.
    ///
    /// `.glb`: a glTF file whose light plays beside the scene's own motion in any viewer (unlit vertex colours that morph).
    /// `.html`: a page that plays the clip in any browser, without a network: one turns the scene, moves through time, and reads
    /// irradiance under the pointer. `.usda`: USD with colours and transforms over time, which Blender plays without an add-on.
    /// `.vtp`: the elements of one frame with irradiance, radiosity, level and names, for ParaView and PyVista; `.pvd`: those of a
    /// clip, in a folder beside it.
    #[command(
        after_help = "Example:  relume export room.glb -o lit.glb --frames 0-18\n          relume export room.glb -o lit.html\n          relume export room.glb -o room.pvd --tolerance 0.05"
    )]
    Export(ExportArgs),
    /// Irradiance at points, frame by frame, as a table (CSV).
    ///
    /// SENSORS is text, a line `x y z nx ny nz` for each sensor (metres, in the world; # begins a
    /// comment), or CSV with those columns and, if wanted, `name` and `body`: a sensor with a body
    /// rides on it, and is given where it is at the start of the animation. Sensors need not lie on
    /// a surface. Columns of the table: frame, sensor (its name, or its number from 0), place and
    /// normal in the world, and irradiance in W/m2, linear RGB.
    #[command(
        after_help = "Example:  relume probe room.glb sensors.txt -o irradiance.csv --frames 0-24x8"
    )]
    Probe(ProbeArgs),
    /// Form factors between named surfaces, bodies or patches, frame by frame.
    ///
    /// F(from -> to) is the share of what leaves `from` that reaches `to`; `area_from_m2` times it is
    /// the same number in both directions. What escapes stands in the table as going to
    /// `environment`: into the open, or onto the black back of a single-sided polygon. Nothing needs
    /// to emit: every surface weighs the same, and --tolerance bounds the error of a factor relative
    /// to the sum of its row. Rows are reported as they are and never normalised unless asked.
    #[command(
        after_help = "Example:  relume factors satellite.glb --by body -o factors.csv --tolerance 0.01"
    )]
    Factors(FactorsArgs),
    /// Say what was read: bodies, patches, materials, emitters, animations, cameras, lights.
    Info(InfoArgs),
    /// Say what is wrong with a scene, and what to do about it.
    ///
    /// Exit code 1 if an error is found; warnings alone leave it at 0.
    Check(CheckArgs),
    /// Solve a clip frame by frame and from scratch side by side, and say where they differ.
    ///
    /// Compares all links (which there are, exchange areas, visibilities, gradients: bit for bit),
    /// the numbers of elements, the coarse solution and groups (bit for bit), and the radiosities, which may
    /// differ by what the residuals allow.
    /// Stops at the first frame that differs, names the first link in question, and exits with 1.
    #[command(after_help = "Example:  relume verify scene.glb --frames 0-48x12 --tolerance 0.1")]
    Verify(VerifyArgs),
    /// Say where the error of a solution comes from: from which surfaces and places, from the light of lamps or from reflected light.
    ///
    /// What the mesh says at points is compared with what arrives there from the elements, with exact visibility. What the elements
    /// send is taken at its word.
    #[command(after_help = "Example:  relume errors scene.glb --frames 0 --tolerance 0.1")]
    Errors(ErrorsArgs),
    /// Do again what a log of commands says was done to a scene, and compare the hashes.
    ///
    /// LOG has a line of JSON for each step: `set_pose` (body, to: axes and translation), `set_presence`,
    /// `set_reflectance`, `set_exitance`, `set_intensity`, `set_time`, `insert`, `remove`, `undo`, `redo`, and `solve`, with
    /// the hash of the links if it is known. Bodies, materials and lights go by the names that `relume info` lists;
    /// `to` may be null: then the file has its say again. `insert` holds a name and meshes (surface, name of the
    /// material, positions, triangles). Programs that use relume as a library write such logs
    /// (`relume::Log`). Exits with 1 if a hash differs.
    #[command(
        after_help = "Example:  relume replay moves.jsonl scene.glb --tolerance 0.1 -o with-hashes.jsonl"
    )]
    Replay(ReplayArgs),
    /// Measure what a frame costs, against building it from scratch.
    ///
    /// Prints the paper's Table 0.1 for any scene: frames, average time a frame, standard deviation,
    /// time to set up and solve frame 1, and their ratio, without and with drawing the pictures
    /// (which are not kept); beside it what was done in a frame, how far a frame is from its bound,
    /// and the memory. Frames are built from scratch in turns with the frames measured, so that
    /// whatever else the machine does hits both alike: go by the ratios.
    #[command(after_help = "Example:  relume bench --demo room --frames 0-9 --json bench.json")]
    Bench(BenchArgs),
    /// Measure how much of what changes in pictures from frame to frame is not the light.
    ///
    /// Draws every frame in three ways, `gouraud`, `smooth`, and smooth and cleaned, and compares the change of each pixel that sees one
    /// place of an unmoved surface with the change in a finer, reconstructed solution. Surfaces whose elements keep their light are
    /// told apart: there the change is to be 0.
    #[command(after_help = "Example:  relume flicker --demo room --frames 0-4 --tolerance 0.1")]
    Flicker(FlickerArgs),
    /// Solve a scene in the plane: what does not change along one direction, that direction integrated
    /// out.
    ///
    /// SCENE is text, a line for each thing: `segment NAME X0 Y0 X1 Y1 [reflectance R] [emit M]
    /// [two-sided]`, its front on the left from start to end; `polygon NAME X Y X Y X Y ...`, closed,
    /// its fronts outside if its corners go clockwise; `body NAME`, to which the lines below
    /// belong, with lines `at TIME X Y [DEGREES]` for where it is when. Metres, seconds; # begins a
    /// comment. Or SVG: line, polyline, polygon, rect and path of straight parts, in groups that move by
    /// animateTransform, with data-reflectance, data-emit, data-two-sided, data-front=inside|outside, and
    /// data-units-per-metre at the root. Without -o the report goes to stdout.
    #[command(
        after_help = "Example:  relume flat gutter.flat -o out --epsilon 0.1\n          relume flat figure 0.4 -o docs/figures"
    )]
    Flat(FlatArgs),
    /// Draw a figure of the paper that is of space, from the scenes that ship, as SVG and PNG.
    ///
    /// Those of the plane are drawn by `relume flat figure`.
    #[command(after_help = "Example:  relume figure 0.5 -o docs/figures")]
    Figure(FigureArgs),
    /// Print what makes a shell complete the names of commands, options and files.
    #[command(
        after_help = "Example:  relume completions bash > ~/.local/share/bash-completion/completions/relume"
    )]
    Completions(CompletionsArgs),
    /// Write manual pages: relume.1 and one for each command, relume-render.1 ...
    #[command(after_help = "Example:  relume man ~/.local/share/man/man1")]
    Man(ManArgs),
}

/// `relume completions`
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// Which shell.
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// `relume man`
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// Directory for the pages; made if missing.
    #[arg(value_name = "DIR")]
    pub(crate) directory: PathBuf,
}

/// `relume figure`
#[derive(Debug, Args)]
pub(crate) struct FigureArgs {
    /// Which.
    #[arg(value_enum)]
    pub(crate) figure: Figure,
    /// Directory for the files; made if missing.
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    pub(crate) output: PathBuf,
}

/// The figures of space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Figure {
    /// Two sequences with a moving light: pictures, the elements that are linked to the light, and the
    /// same with links extrapolated.
    #[value(name = "0.5")]
    Sequences,
    /// Times a frame, measured here, beside the paper's.
    #[value(name = "table-0.1")]
    Times,
}

/// `relume flat`
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct FlatArgs {
    #[command(subcommand)]
    pub(crate) command: Option<FlatCommand>,
    /// The scene, a text file or an .svg.
    #[arg(value_name = "SCENE", required = true)]
    pub(crate) scene: Option<PathBuf>,
    /// Directory for report.json and a drawing of each frame (SVG); made if missing.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) time: FrameFlags,
    /// Largest form factor of a link.
    #[arg(long, value_name = "EPS", default_value = "0.05", allow_negative_numbers = true)]
    pub(crate) epsilon: f64,
    /// Elements up to this length are not refined, m.
    #[arg(long, value_name = "M", default_value = "0.02", allow_negative_numbers = true)]
    pub(crate) min_length: f64,
    /// Elements are constant, as in the paper; otherwise links carry gradients.
    #[arg(long)]
    pub(crate) constant: bool,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
    /// Compare every frame with one built from scratch instead, as `relume verify` does in space; exit
    /// with 1 where they differ.
    #[arg(long, conflicts_with_all = ["output", "events", "print"])]
    pub(crate) verify: bool,
    /// Measure what a frame costs instead, as `relume bench` does in space.
    #[arg(long, conflicts_with_all = ["output", "events", "print", "verify"])]
    pub(crate) bench: bool,
    #[command(flatten)]
    pub(crate) measure: MeasureFlags,
    /// Write every link event to this file (CSV).
    #[arg(long, value_name = "FILE")]
    pub(crate) events: Option<PathBuf>,
    /// What to print.
    #[arg(long, value_enum, value_name = "WHAT")]
    pub(crate) print: Option<FlatPrint>,
}

/// `relume flat --print`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FlatPrint {
    /// The report, JSON: what is printed if there is no -o.
    Report,
    /// A line for each frame: counts, and the first digits of the hash.
    Frames,
    /// Mean radiosity of each wall in the last frame, W/m2.
    Walls,
    /// The link events, CSV.
    Events,
}

/// `relume flat ...`
#[derive(Debug, Subcommand)]
pub(crate) enum FlatCommand {
    /// Draw one of the paper's figures, as SVG and PNG.
    Figure {
        /// Which.
        #[arg(value_enum)]
        figure: FlatFigure,
        /// Directory for the files; made if missing.
        #[arg(short, long, value_name = "DIR", default_value = ".")]
        output: PathBuf,
    },
}

/// `relume flat figure`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FlatFigure {
    /// Two walls at 45 degrees: the element hierarchy, and the links.
    #[value(name = "0.1")]
    Hierarchy,
    /// Links that something comes between are kept, and restored.
    #[value(name = "0.2")]
    Occlusion,
    /// Links are demoted as something approaches.
    #[value(name = "0.3")]
    Demotion,
    /// A gutter that a patch approaches; also in motion (APNG), links coloured by what happens.
    #[value(name = "0.4")]
    Gutter,
    /// Error against the number of links.
    Convergence,
}

/// `relume demo`
#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Which scene.
    #[arg(value_enum)]
    pub(crate) scene: DemoScene,
    /// Directory for the scene, the pictures and report.json; made if missing
    /// [default: relume-demo- and the name of the scene].
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) solve: SolveFlags,
    #[command(flatten)]
    pub(crate) picture: PictureFlags,
}

/// The scenes that ship with the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DemoScene {
    /// Three walls, a floor, no ceiling, a box, a light moving in the plane of the ceiling:
    /// 109 frames.
    Corridor,
    /// A closed cubical room, a light circling below the ceiling: 20 frames.
    Room,
    /// A living room: a door opens, a lantern is carried, and a sun stands behind blinds: 36 frames.
    LivingRoom,
}

/// `relume render`
#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// The scene, a .glb or .gltf file (or .obj, .stl, .ply, .vs3).
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// Directory for the pictures and report.json; made if missing. Give each task of a job array
    /// its own.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Draw rough pictures, DIR/preview-0000.png ..., within seconds a frame however much there is, and solve nothing: direct
    /// light, and grey light between surfaces from some thousand points.
    #[arg(long, conflicts_with_all = ["resume", "events", "report", "mesh", "reconstruct", "shading"])]
    pub(crate) preview: bool,
    /// What frames are: `png`, or `exr` for numbers and compositing (--exposure has no say there).
    #[arg(
        long,
        value_enum,
        value_name = "FORMAT",
        default_value = "png",
        conflicts_with = "preview"
    )]
    pub(crate) format: FrameFormat,
    #[command(flatten)]
    pub(crate) show: ShowFlags,
    #[command(flatten)]
    pub(crate) solve: SolveFlags,
    #[command(flatten)]
    pub(crate) picture: PictureFlags,
}

/// `relume solve`
#[derive(Debug, Args)]
pub(crate) struct SolveArgs {
    /// The scene, a .glb or .gltf file (or .obj, .stl, .ply, .vs3).
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// Directory for report.json; made if missing.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) solve: SolveFlags,
}

/// `relume export`
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The scene, a .glb or .gltf file (or .obj, .stl, .ply, .vs3).
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// The file to write; its ending says of which form.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Solve and store every N-th of the frames only, and the last one; light goes straight from one to the next [default: 1;
    /// more for a .glb that viewers could not play].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(crate) keys: Option<u32>,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
    #[command(flatten)]
    pub(crate) view: ViewFlags,
    /// Exposure in stops, fixed over the clip: at 0 a radiance of 1 W/m2/sr is full white, +1 is twice
    /// as bright. `auto` chooses it once, at the first of the frames in which most is emitted, by what the view shows.
    #[arg(long, value_name = "EV", default_value = "auto", allow_negative_numbers = true)]
    pub(crate) exposure: ExposureFlag,
    /// Find the light of every element anew from all links above it: cleaner corners and shadows, at
    /// several times the cost of a frame.
    #[arg(long)]
    pub(crate) reconstruct: bool,
}

/// `relume probe`
#[derive(Debug, Args)]
pub(crate) struct ProbeArgs {
    /// The scene, a .glb, .gltf or .vs3 file.
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// The sensors: text lines `x y z nx ny nz`, or CSV.
    #[arg(value_name = "SENSORS")]
    pub(crate) sensors: PathBuf,
    /// File for the table; it appears when all frames are done [default: stdout].
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Read the mesh under each sensor instead of gathering at the point itself: quicker for very
    /// many sensors, and wrong on either side of a shadow's edge. Sensors must lie on surfaces.
    #[arg(long)]
    pub(crate) interpolate: bool,
    /// Estimate the error of the rows of each frame at so many of the sensors, by walks along rays. Said at the end; `off` by default.
    #[arg(
        long,
        value_name = "SENSORS",
        default_value = "off",
        hide_default_value = true,
        conflicts_with = "interpolate"
    )]
    pub(crate) accuracy: AccuracyFlag,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
}

/// `relume factors`
#[derive(Debug, Args)]
pub(crate) struct FactorsArgs {
    /// The scene, a .glb, .gltf or .vs3 file.
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// Between what factors are summed.
    #[arg(long, value_enum, default_value = "surface")]
    pub(crate) by: By,
    /// File for the table; it appears when all frames are done [default: CSV on stdout].
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// What the file holds [default: what its name ends in says: .csv, .npz, .vf, .idf].
    #[arg(long, value_enum)]
    pub(crate) format: Option<FactorFormat>,
    /// CSV: after the first frame only the factors that differ from the frame before; 0 for those
    /// that are gone.
    #[arg(long)]
    pub(crate) changed_only: bool,
    /// Make the rows of a closed scene sum to 1.
    #[arg(long, value_enum, default_value = "none")]
    pub(crate) closure: ClosureFlag,
    /// Also write row sums, what escapes, and times to this file, frame by frame
    /// (`relume-factors/1`).
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
}

/// `relume info`
#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// The scene, a .glb or .gltf file (or .obj, .stl, .ply, .vs3).
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) animation: AnimationFlag,
    /// Frames a second at which the animation's frames are counted.
    #[arg(long, value_name = "FPS", default_value = "24", value_parser = parse_fps)]
    pub(crate) fps: f64,
    /// Print every note, also where many are of one kind.
    #[arg(long)]
    pub(crate) verbose: bool,
    #[command(flatten)]
    pub(crate) outside: OutsideFlags,
}

/// `relume check`
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// The scene, a .glb or .gltf file (or .obj, .stl, .ply, .vs3).
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) animation: AnimationFlag,
    /// Print every finding, also where many are of one kind.
    #[arg(long)]
    pub(crate) verbose: bool,
}

/// The frames of an animation, of space or of the plane.
#[derive(Clone, Debug, Args)]
pub(crate) struct FrameFlags {
    /// Frames to solve, inclusive: 0-24, every sixth 0-24x6, a list 3,7. Frame k is the time k / fps
    /// [default: the whole animation].
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    pub(crate) frames: Option<FrameSpec>,
    /// Frames a second.
    #[arg(long, value_name = "FPS", default_value = "24", value_parser = parse_fps, allow_negative_numbers = true)]
    pub(crate) fps: f64,
}

/// What is solved, and how finely: what every command that solves takes.
#[derive(Clone, Debug, Args)]
pub(crate) struct ClipFlags {
    #[command(flatten)]
    pub(crate) time: FrameFlags,
    #[command(flatten)]
    pub(crate) animation: AnimationFlag,
    /// Relative error of irradiance aimed at (root mean square), between 0 and 1: 0.1 is quick and enough for
    /// most pictures, 0.005 is fine [default: 0.1 for `render`, 0.02 for numbers].
    #[arg(long, value_name = "ERROR", value_parser = parse_tolerance, allow_negative_numbers = true)]
    pub(crate) tolerance: Option<f64>,
    /// What decides whether two elements are linked: `error`, the estimated error of irradiance, or
    /// `form-factor=EPS[,MINAREA]`, as in the paper: a link where the form factor is below EPS,
    /// elements not refined below MINAREA m2 (left out: 1/5000 of the scene's area). Example:
    /// form-factor=0.02,0.001.
    #[arg(long, value_name = "ORACLE", default_value = "error")]
    pub(crate) oracle: OracleFlag,
    /// Threads to use; the result has the same bits for any number [default: all cores].
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) outside: OutsideFlags,
    /// No progress bar, no warnings, no summary; errors only, and frames of which more than a hundredth of the light is unaccounted
    /// for.
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Print every warning, also where many are of one kind.
    #[arg(long)]
    pub(crate) verbose: bool,
}

impl Default for ClipFlags {
    fn default() -> ClipFlags {
        ClipFlags {
            time: FrameFlags { frames: None, fps: 24.0 },
            animation: AnimationFlag::default(),
            tolerance: None,
            oracle: OracleFlag::Error,
            threads: None,
            outside: OutsideFlags::default(),
            quiet: false,
            verbose: false,
        }
    }
}

/// What every command that solves a clip and keeps the numbers takes.
#[derive(Clone, Debug, Args)]
pub(crate) struct SolveFlags {
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
    /// Also write the report to this file.
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Skip the frames that an earlier run finished in DIR (or in the report file, where there is no
    /// DIR), after checking that scene and options are the same.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Write every link event of the frames that follow one another to this file, one line each (CSV):
    /// frame, kind, receiver, source, exchange area and visibility before and after.
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    pub(crate) events: Option<PathBuf>,
    /// Estimate the error of what the mesh says in each frame at so many points, by walks along rays, or `off`. The report and the
    /// last line say it; by default it is estimated at fewer, for a tenth of the time of a cold build.
    #[arg(long, value_name = "POINTS", default_value = "quick", hide_default_value = true)]
    pub(crate) accuracy: AccuracyFlag,
}

/// A scene file, or a demonstration instead.
#[derive(Clone, Debug, Args)]
pub(crate) struct SourceFlags {
    /// The scene, a .glb or .gltf file (or .obj, .stl, .ply, .vs3).
    #[arg(value_name = "SCENE", required_unless_present = "demo", conflicts_with = "demo")]
    pub(crate) scene: Option<PathBuf>,
    /// Instead of a file, a scene that ships with relume, at its own tolerance by default.
    #[arg(long, value_name = "DEMO", value_enum)]
    pub(crate) demo: Option<DemoScene>,
}

/// `relume errors`
#[derive(Debug, Args)]
pub(crate) struct ErrorsArgs {
    #[command(flatten)]
    pub(crate) source: SourceFlags,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    /// Points to compare at, most of them where light changes much over an element.
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) points: u32,
}

/// `relume verify`
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    #[command(flatten)]
    pub(crate) source: SourceFlags,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    /// How the links follow the motion.
    #[arg(long, value_name = "STRATEGY", value_enum, default_value = "certificate")]
    pub(crate) update: ExactUpdate,
}

/// `relume replay`
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// The log, a line of JSON for each step.
    #[arg(value_name = "LOG")]
    pub(crate) log: PathBuf,
    #[command(flatten)]
    pub(crate) source: SourceFlags,
    /// Where to write the log with the hashes that were found.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
}

/// `relume bench`
#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    #[command(flatten)]
    pub(crate) source: SourceFlags,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
    #[command(flatten)]
    pub(crate) measure: MeasureFlags,
    /// Draw no pictures; the row with them is left out.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    #[command(flatten)]
    pub(crate) picture: PictureFlags,
}

/// `relume flicker`
#[derive(Debug, Args)]
pub(crate) struct FlickerArgs {
    #[command(flatten)]
    pub(crate) source: SourceFlags,
    #[command(flatten)]
    pub(crate) clip: ClipFlags,
    #[command(flatten)]
    pub(crate) update: UpdateChoice,
    /// Tolerance of the reference [default: a fifth of the other].
    #[arg(long, value_name = "ERROR", value_parser = parse_tolerance, allow_negative_numbers = true)]
    pub(crate) reference: Option<f64>,
    /// Width x height of the pictures in pixels.
    #[arg(long, value_name = "WxH", default_value = "160x120")]
    pub(crate) size: Size,
    #[command(flatten)]
    pub(crate) view: ViewFlags,
}

/// What is measured against what, and where the numbers go.
#[derive(Clone, Debug, Args)]
pub(crate) struct MeasureFlags {
    /// Build only every K-th frame from scratch beside the others: quicker, less exact.
    #[arg(long, value_name = "K", default_value = "1", value_parser = parse_every, allow_negative_numbers = true)]
    pub(crate) every: usize,
    /// Follow the frames with every strategy side by side, and compare: time, evaluations, segments,
    /// missed events, error of radiosity. Takes the place of the other tables.
    #[arg(long, conflicts_with_all = ["every", "strategy", "error"])]
    pub(crate) compare: bool,
    /// Also write all numbers to this file, frame by frame (`relume-bench/1`).
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// What every command that renders takes.
#[derive(Clone, Debug, Args)]
pub(crate) struct PictureFlags {
    /// Width x height of the pictures in pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    pub(crate) size: Size,
    /// `flat`: one value an element. `gouraud`: interpolated over a Delaunay triangulation in each face's own frame. `smooth`: one
    /// continuous function over every surface, the same however elements lie [default: smooth].
    #[arg(long, value_enum)]
    pub(crate) shading: Option<Shading>,
    #[command(flatten)]
    pub(crate) view: ViewFlags,
    /// Exposure in stops, fixed over the clip: at 0 a radiance of 1 W/m2/sr is full white, +1 is twice
    /// as bright. `auto` chooses it once, at the first of the frames of the animation in which most is
    /// emitted, whichever frames are asked for; report.json says what it chose.
    #[arg(long, value_name = "EV", default_value = "auto", allow_negative_numbers = true)]
    pub(crate) exposure: ExposureFlag,
    /// Draw the outlines of the elements over the picture.
    #[arg(long)]
    pub(crate) mesh: bool,
    /// Find the light of every element anew from all links above it: cleaner corners and shadows, at
    /// several times the cost of a frame.
    #[arg(long)]
    pub(crate) reconstruct: bool,
    /// Find the light of lamps, the sun and bright parts of the sky exactly at every pixel, and take from the elements what comes from
    /// elsewhere: shadows are as sharp as they are, on any mesh [default: yes with smooth shading].
    #[arg(long, value_name = "yes|no", num_args = 0..=1, require_equals = true, default_missing_value = "yes", value_parser = clap::builder::BoolishValueParser::new())]
    pub(crate) cleanup: Option<bool>,
}

impl PictureFlags {
    /// Whether the light of lamps is found at every pixel.
    pub(crate) fn cleans(&self, shading: Shading) -> bool {
        shading == Shading::Smooth && self.cleanup.unwrap_or(true)
    }
}

impl Default for PictureFlags {
    fn default() -> PictureFlags {
        PictureFlags {
            size: Size { width: 640, height: 480 },
            shading: None,
            view: ViewFlags::default(),
            exposure: ExposureFlag::Auto,
            mesh: false,
            reconstruct: false,
            cleanup: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }
}
