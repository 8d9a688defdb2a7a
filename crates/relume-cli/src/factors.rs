//! `relume factors`: form factors between the user's own named things, frame by frame.

use std::io::{self, Write};
use std::path::Path;

use rayon::prelude::*;
use relume::export::{self, Npz, WholeFile, write_atomically};
use relume::scene::Scene;
use relume::session::{self, Closure, Factors, FrameReport, Grouping, PartFactors};
use serde::Serialize;

use crate::args::{By, ClosureFlag, FactorFormat, FactorsArgs};
use crate::clip::{Clip, TOLERANCE, solved, step_failure};
use crate::clock::now;
use crate::failure::Failure;
use crate::interrupt;
use crate::lock::Lock;
use crate::notes;
use crate::output::{self, Sink, count, counted};
use crate::progress::Progress;
use crate::scene_file;
use crate::size::Size;

/// What the report calls itself.
const SCHEMA: &str = "relume-factors/1";

/// The name of what escapes.
const ENVIRONMENT: &str = "environment";

/// Runs the command.
pub(crate) fn factors(args: &FactorsArgs) -> Result<(), Failure> {
    let started = now();
    let format = format_of(args)?;
    if !args.clip.outside.is_empty() {
        return Err(Failure::usage("form factors are of the scene alone, without light from outside")
            .help("leave out --sky, --sun and --environment; what escapes stands in the table as `environment`"));
    }
    let clip = Clip::of_file(&args.scene, &args.clip, TOLERANCE)?;
    judge(args, format, &clip)?;
    clip.warn_of(args.update);
    let clip = clip.without_light();
    let grouping = grouping(&clip.scene, args.by);
    let things = Things { environment: environment(&grouping), grouping };
    if !args.clip.quiet {
        say(&clip.scene, &things, args.by, args.clip.verbose);
    }
    let is_archive = matches!(format, FactorFormat::Npz | FactorFormat::NpzSparse);
    // Tables take their own.
    let archive = args.output.as_deref().filter(|_| is_archive);
    let files = archive.into_iter().chain(args.report.as_deref());
    let _locks = files.map(Lock::of_file).collect::<Result<Vec<_>, _>>()?;
    let mut table = Table::open(args, format, &clip, &things)?;
    let progress = Progress::new(clip.frames.len(), 0, args.clip.quiet);
    let outcome = frames(args, &clip, &things, &progress, &mut table);
    progress.clear();
    let frames = outcome.map_err(interrupt::keeping_rows)?;
    table.finish(&clip, &things)?;
    if let Some(path) = &args.report {
        write_report(path, args, &clip, &things, &frames)?;
    }
    if !args.clip.quiet {
        summary(args, &things, &frames, started.elapsed().as_secs_f64());
    }
    Ok(())
}

/// The groups, and what the rest is called.
struct Things {
    grouping: Grouping,
    environment: String,
}

impl Things {
    fn name(&self, group: u32) -> &str {
        &self.grouping.names[group as usize]
    }
}

fn grouping(scene: &Scene, by: By) -> Grouping {
    match by {
        By::Patch => Grouping::by_patch(scene),
        By::Surface => Grouping::by_surface(scene),
        By::Body => Grouping::by_body(scene),
    }
}

/// A name that no group has.
fn environment(grouping: &Grouping) -> String {
    let taken = |name: &String| grouping.names.contains(name);
    let numbered = (2..).map(|n| format!("{ENVIRONMENT} {n}"));
    std::iter::once(ENVIRONMENT.to_owned())
        .chain(numbered)
        .find(|name| !taken(name))
        .unwrap_or_else(|| unreachable!("there are more numbers than names"))
}

/// The format asked for, or the one that the file's name says.
fn format_of(args: &FactorsArgs) -> Result<FactorFormat, Failure> {
    if let Some(format) = args.format {
        return Ok(format);
    }
    let Some(path) = &args.output else { return Ok(FactorFormat::Csv) };
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        None | Some("csv" | "txt") => Ok(FactorFormat::Csv),
        Some("npz") => Ok(FactorFormat::Npz),
        Some("vf") => Ok(FactorFormat::View3d),
        Some("idf") => Ok(FactorFormat::Energyplus),
        Some(_) => Err(Failure::usage(format_args!(
            "the name of {} does not say which format it is to have",
            path.display()
        ))
        .help("end it in .csv, .npz, .vf (View3D) or .idf (EnergyPlus), or add --format")),
    }
}

/// Combinations of options that make no sense, and clips that a format has no room for.
fn judge(args: &FactorsArgs, format: FactorFormat, clip: &Clip) -> Result<(), Failure> {
    let name = format.name();
    if args.changed_only && format != FactorFormat::Csv {
        return Err(Failure::usage(format_args!("--changed-only does not go with format {name}"))
            .help("write CSV, or leave it out"));
    }
    let npz = matches!(format, FactorFormat::Npz | FactorFormat::NpzSparse);
    if npz && args.output.is_none() {
        return Err(
            Failure::usage(format_args!("format {name} is not text")).help("name a file with -o")
        );
    }
    let single = matches!(format, FactorFormat::View3d | FactorFormat::Energyplus);
    if single && clip.frames.len() > 1 {
        return Err(Failure::usage(format_args!(
            "format {name} holds one frame, not {}",
            clip.frames.len()
        ))
        .help("choose one with --frames, or write CSV or NPZ"));
    }
    if format == FactorFormat::Energyplus && args.by != By::Surface {
        return Err(
            Failure::usage("EnergyPlus wants view factors by surface").help("use --by surface")
        );
    }
    Ok(())
}

/// Warnings about the scene, and names that were made unique.
fn say(scene: &Scene, things: &Things, by: By, verbose: bool) {
    scene_file::warn_but_for(scene, verbose, &["nothing-emits", "light-lost"]);
    if by != By::Body || things.environment != ENVIRONMENT {
        let renamed = scene.notes.iter().filter(|note| note.code == "renamed").cloned();
        let renamed: Vec<_> = renamed.collect();
        notes::lines(&renamed, verbose).iter().for_each(|line| output::complain(line));
    }
    if things.environment != ENVIRONMENT {
        output::complain(&format!(
            "note: something is called `{ENVIRONMENT}`; what escapes is called `{}`",
            things.environment
        ));
    }
}

/// What the report says of a frame.
#[derive(Debug, Serialize)]
struct Frame {
    frame: u32,
    time_s: f64,
    links: u64,
    /// Factors above 0.
    entries: usize,
    /// Rows written, those of what escapes included.
    written: u64,
    /// Before any closure.
    row_sums: RowSums,
    /// Mean share that escapes, weighted by area; before any closure.
    escapes: f64,
    seconds: f64,
    seconds_summing: f64,
}

/// Row sums of the groups that are present.
#[derive(Clone, Debug, Default, Serialize)]
struct RowSums {
    min: f64,
    min_of: String,
    max: f64,
    max_of: String,
    /// Root mean square distance from 1.
    rms_off: f64,
}

fn row_sums(factors: &Factors, things: &Things) -> (RowSums, f64) {
    let mut out = RowSums { min: f64::INFINITY, max: f64::NEG_INFINITY, ..RowSums::default() };
    let (mut squares, mut rows, mut escaped, mut area) = (0.0, 0, 0.0, 0.0);
    let sums: Vec<f64> =
        (0..factors.len() as u32).into_par_iter().map(|group| factors.row_sum(group)).collect();
    for (group, sum) in sums.into_iter().enumerate() {
        let (a, group) = (factors.area_m2[group], group as u32);
        if a == 0.0 {
            continue;
        }
        if sum < out.min {
            (out.min, out.min_of) = (sum, things.name(group).to_owned());
        }
        if sum > out.max {
            (out.max, out.max_of) = (sum, things.name(group).to_owned());
        }
        squares += (sum - 1.0).powi(2);
        rows += 1;
        escaped += a * (1.0 - sum);
        area += a;
    }
    if rows == 0 {
        return (RowSums::default(), 0.0);
    }
    out.rms_off = (squares / f64::from(rows)).sqrt();
    (out, escaped / area)
}

fn frames(
    args: &FactorsArgs,
    clip: &Clip,
    things: &Things,
    progress: &Progress,
    table: &mut Table,
) -> Result<Vec<Frame>, Failure> {
    let joined = clip.scene.joined();
    let mut sums = PartFactors::new(&clip.scene, &joined, things.grouping.clone());
    let mut session = clip.session_of(joined.scene, args.update)?;
    let size = Size::of_scene(session.scene(), clip, session.options());
    if !args.clip.quiet {
        size.warn(clip, clip.frames.len(), "");
    }
    progress.watch(session.watch(), size.pairs());
    let mut before: Option<Factors> = None;
    let mut out: Vec<Frame> = Vec::new();
    for (done, &frame) in clip.frames.iter().enumerate() {
        if interrupt::requested() {
            // Keeps the rows of CSV; an archive is whole or not there.
            interrupt::end(&Failure::interrupted(format_args!(
                "stopped: {done} of {} done",
                counted(clip.frames.len(), "frame")
            )));
        }
        progress.start(frame, out.last().map_or(0, |f| f.links), session.memory_bytes());
        let report =
            session.step(frame, clip.time_of(frame)).map_err(|error| step_failure(error, ""))?;
        let summing = now();
        let mut factors = sums.factors(solved(&session));
        let (row_sums, escapes) = row_sums(&factors, things);
        factors.close(closure(args.closure)).map_err(|open| not_closed(frame, &open, things))?;
        let seconds_summing = summing.elapsed().as_secs_f64();
        let kept = before.as_ref().filter(|_| args.changed_only);
        let written = table.add(clip, &report, &factors, kept, things)?;
        out.push(Frame {
            frame,
            time_s: report.time_s,
            links: report.links,
            entries: factors.entries(),
            written,
            row_sums,
            escapes,
            seconds: report.seconds.total,
            seconds_summing,
        });
        if let Some(gone) = before.replace(factors) {
            sums.recycle(gone);
        }
        progress.finish_frame();
    }
    Ok(out)
}

fn closure(flag: ClosureFlag) -> Closure {
    match flag {
        ClosureFlag::None => Closure::None,
        ClosureFlag::Rows => Closure::Rows,
        ClosureFlag::Reciprocal => Closure::Reciprocal,
    }
}

fn not_closed(frame: u32, open: &session::Open, things: &Things) -> Failure {
    Failure::new(format_args!(
        "the scene is open in frame {frame}: the factors from `{}` sum to {:.4}",
        things.name(open.group),
        open.row_sum
    ))
    .help("leave out --closure: what escapes is no error, and stands in the table as `environment`")
}

/// The table being written.
enum Table {
    Csv(Sink),
    /// Dense: a matrix after the other.
    Dense(Npz<WholeFile>, Rest),
    /// CSR of all matrices one below the other.
    Sparse(Npz<WholeFile>, Box<Csr>, Rest),
    /// One matrix as text.
    Text(Sink, FactorFormat, bool),
}

/// What stands beside the factors in an archive.
#[derive(Default)]
struct Rest {
    frames: Vec<i64>,
    times_s: Vec<f64>,
    area_m2: Vec<f64>,
}

/// Compressed sparse rows.
struct Csr {
    data: Vec<f64>,
    indices: Vec<i64>,
    offsets: Vec<i64>,
}

impl Table {
    fn open(
        args: &FactorsArgs,
        format: FactorFormat,
        clip: &Clip,
        things: &Things,
    ) -> Result<Table, Failure> {
        let archive = || -> Result<Npz<WholeFile>, Failure> {
            let path = args.output.as_deref().unwrap_or(Path::new(""));
            WholeFile::create(path).map(Npz::new).map_err(|error| Failure::write(path, &error))
        };
        match format {
            FactorFormat::Csv => {
                let mut sink = Sink::open(args.output.as_deref())?;
                sink.write_all(b"frame,from,to,area_from_m2,factor\n")
                    .map_err(|error| sink.failure(&error))?;
                Ok(Table::Csv(sink))
            }
            FactorFormat::Npz => {
                let mut npz = archive()?;
                let n = things.grouping.names.len();
                npz.begin_floats("factors", &[clip.frames.len(), n, n + 1]).map_err(not_written)?;
                Ok(Table::Dense(npz, Rest::default()))
            }
            FactorFormat::NpzSparse => {
                let csr = Csr { data: Vec::new(), indices: Vec::new(), offsets: vec![0] };
                Ok(Table::Sparse(archive()?, Box::new(csr), Rest::default()))
            }
            FactorFormat::View3d | FactorFormat::Energyplus => {
                let closed = args.closure != ClosureFlag::None;
                Ok(Table::Text(Sink::open(args.output.as_deref())?, format, closed))
            }
        }
    }

    /// Adds a frame; the rows that were written.
    fn add(
        &mut self,
        clip: &Clip,
        report: &FrameReport,
        factors: &Factors,
        before: Option<&Factors>,
        things: &Things,
    ) -> Result<u64, Failure> {
        match self {
            Table::Csv(sink) => {
                let rows = csv_rows(sink, report.frame, factors, before, things);
                let rows = rows.map_err(|error| sink.failure(&error))?;
                sink.keep_so_far()?;
                Ok(rows)
            }
            Table::Dense(npz, rest) => {
                rest.add(report, factors);
                let mut row = vec![0.0; factors.len() + 1];
                for from in 0..factors.len() as u32 {
                    row.fill(0.0);
                    factors.row(from).for_each(|(to, f)| row[to as usize] = f);
                    row[factors.len()] = factors.escapes(from).unwrap_or(0.0);
                    npz.more_floats(&row).map_err(not_written)?;
                }
                Ok(factors.entries() as u64)
            }
            Table::Sparse(_, csr, rest) => {
                rest.add(report, factors);
                for from in 0..factors.len() as u32 {
                    let escapes = factors.escapes(from).map(|e| (factors.len() as u32, e));
                    for (to, f) in factors.row(from).chain(escapes) {
                        csr.data.push(f);
                        csr.indices.push(i64::from(to));
                    }
                    csr.offsets.push(csr.data.len() as i64);
                }
                Ok(factors.entries() as u64)
            }
            Table::Text(sink, format, closed) => {
                let text = match format {
                    FactorFormat::Energyplus => export::energyplus(
                        &clip.scene.name,
                        &things.grouping,
                        factors,
                    )
                    .map_err(|name| {
                        Failure::new(format_args!("EnergyPlus cannot read the name `{name}`"))
                            .help("rename it without commas, semicolons and exclamation marks")
                    })?,
                    _ => export::view3d(&clip.scene, &things.grouping, factors, *closed),
                };
                sink.write_all(text.as_bytes()).map_err(|error| sink.failure(&error))?;
                Ok(factors.entries() as u64)
            }
        }
    }

    fn finish(self, clip: &Clip, things: &Things) -> Result<(), Failure> {
        let n = things.grouping.names.len();
        let file = match self {
            Table::Csv(sink) | Table::Text(sink, ..) => return sink.finish(),
            Table::Dense(npz, rest) => rest.write(npz, things),
            Table::Sparse(mut npz, csr, rest) => {
                let entries = csr.data.len();
                let rows = clip.frames.len() * n;
                npz.floats("data", &[entries], &csr.data)
                    .and_then(|()| npz.ints("indices", &[entries], &csr.indices))
                    .and_then(|()| npz.ints("indptr", &[rows + 1], &csr.offsets))
                    .and_then(|()| npz.ints("shape", &[2], &[rows as i64, n as i64 + 1]))
                    .and_then(|()| npz.bytes("format", b"csr"))
                    .and_then(|()| rest.write(npz, things))
            }
        };
        let _guard = interrupt::writing();
        file.and_then(WholeFile::finish).map_err(not_written)
    }
}

impl Rest {
    fn add(&mut self, report: &FrameReport, factors: &Factors) {
        self.frames.push(i64::from(report.frame));
        self.times_s.push(report.time_s);
        self.area_m2.extend(&factors.area_m2);
    }

    fn write(self, mut npz: Npz<WholeFile>, things: &Things) -> io::Result<WholeFile> {
        let frames = self.frames.len();
        let n = things.grouping.names.len();
        let mut names = things.grouping.names.clone();
        names.push(things.environment.clone());
        npz.floats("area_m2", &[frames, n], &self.area_m2)?;
        npz.ints("frame", &[frames], &self.frames)?;
        npz.floats("time_s", &[frames], &self.times_s)?;
        npz.texts("name", &names)?;
        npz.finish()
    }
}

fn not_written(error: io::Error) -> Failure {
    Failure::new(format_args!("cannot write the archive: {error}"))
        .help("free some space or choose another place with -o")
}

/// Writes the rows of a frame as CSV; how many they are.
fn csv_rows(
    sink: &mut Sink,
    frame: u32,
    factors: &Factors,
    before: Option<&Factors>,
    things: &Things,
) -> io::Result<u64> {
    let mut table = csv::Writer::from_writer(sink);
    let mut rows = 0;
    let mut outcome = Ok(());
    let frame = frame.to_string();
    let areas: Vec<String> = factors.area_m2.iter().map(f64::to_string).collect();
    factors.changed_since(before, &mut |from, to, factor| {
        if outcome.is_ok() {
            let to = to.map_or(things.environment.as_str(), |to| things.name(to));
            let factor = factor.to_string();
            outcome =
                table.write_record([&frame, things.name(from), to, &areas[from as usize], &factor]);
            rows += 1;
        }
    });
    outcome.map_err(io::Error::other)?;
    table.flush()?;
    Ok(rows)
}

/// The report as JSON.
#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    scene: &'a str,
    by: &'static str,
    closure: &'static str,
    tolerance: f64,
    threads: usize,
    things: usize,
    environment: &'a str,
    frames: &'a [Frame],
}

fn write_report(
    path: &Path,
    args: &FactorsArgs,
    clip: &Clip,
    things: &Things,
    frames: &[Frame],
) -> Result<(), Failure> {
    let report = Report {
        schema: SCHEMA,
        scene: &clip.scene.name,
        by: args.by.name(),
        closure: args.closure.name(),
        tolerance: clip.tolerance,
        threads: clip.threads,
        things: things.grouping.names.len(),
        environment: &things.environment,
        frames,
    };
    let mut text = serde_json::to_string_pretty(&report).map_err(Failure::new)?;
    text.push('\n');
    let _guard = interrupt::writing();
    write_atomically(path, text.as_bytes()).map_err(|error| Failure::write(path, &error))
}

/// The lines at the end, on stderr: the table may be on stdout.
fn summary(args: &FactorsArgs, things: &Things, frames: &[Frame], seconds: f64) {
    let what = match args.by {
        By::Patch => "patch",
        By::Surface => "surface",
        By::Body => "body",
    };
    let rows: u64 = frames.iter().map(|f| f.written).sum();
    output::complain(&format!(
        "{}, {}: {} factors, {seconds:.1} s",
        counted(things.grouping.names.len(), what),
        counted(frames.len(), "frame"),
        count(rows)
    ));
    let lowest = frames.iter().min_by(|a, b| a.row_sums.min.total_cmp(&b.row_sums.min));
    let highest = frames.iter().max_by(|a, b| a.row_sums.max.total_cmp(&b.row_sums.max));
    if let (Some(low), Some(high)) = (lowest, highest) {
        let done = match args.closure {
            ClosureFlag::None => "never normalised",
            ClosureFlag::Rows => "before each row was divided by its sum",
            ClosureFlag::Reciprocal => "before exchange areas were scaled so that rows sum to 1",
        };
        output::complain(&format!(
            "row sums ({done}): from {:.5} (`{}`, frame {}) to {:.5} (`{}`, frame {})",
            low.row_sums.min,
            low.row_sums.min_of,
            low.frame,
            high.row_sums.max,
            high.row_sums.max_of,
            high.frame
        ));
    }
    let mean = frames.iter().map(|f| f.escapes).sum::<f64>() / frames.len() as f64;
    output::complain(&format!(
        "escapes: {} % of what leaves all, in the mean (as `{}` in the table)",
        // Adding 0 takes the sign from -0.
        (1e5 * mean).round() / 1e3 + 0.0,
        things.environment
    ));
}
