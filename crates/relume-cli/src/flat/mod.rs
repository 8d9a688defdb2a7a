//! `relume flat`: scenes in the plane, and the paper's figures of it.

pub(crate) mod draw;
mod figures;

use std::fmt::Write;
use std::io;
use std::path::Path;
use std::sync::Arc;

use relume::export::write_atomically;
use relume::flat::{
    FlatFrame, FlatOptions, FlatScene, FlatSession, SvgError, Wall, parse, parse_svg,
};
use relume::session::FrameReport;
use relume_picture::drawing::Pen;
use serde::Serialize;

use crate::args::{FlatArgs, FlatCommand, FlatPrint, UpdateChoice};
use crate::bench;
use crate::events::EventTable;
use crate::failure::Failure;
use crate::frames::{resolve, time_of};
use crate::interrupt;
use crate::memory;
use crate::output;
use crate::paper::make;
use crate::plan::Plan;
use crate::scene_file;
use crate::sequence::{Sequence, Stepping};
use crate::verify;

/// Name of the report's format.
const SCHEMA: &str = "relume-flat/1";

#[derive(Serialize)]
struct Report<'a> {
    schema: &'a str,
    version: &'a str,
    scene: String,
    bodies: usize,
    segments: usize,
    options: Options,
    frames: &'a [FrameReport],
}

#[derive(Serialize)]
struct Options {
    epsilon: f64,
    min_length_m: f64,
    constant: bool,
    residual: f64,
    update: String,
    fps: f64,
}

/// Runs the command.
pub(crate) fn flat(args: &FlatArgs) -> Result<(), Failure> {
    if let Some(FlatCommand::Figure { figure, output }) = &args.command {
        make(output)?;
        let names = figures::draw(*figure, output)?;
        return output::print(&format!("{}\n", names.join("\n")));
    }
    let path = args.scene.as_deref().ok_or_else(|| {
        Failure::usage("which scene?").help("name a file: relume flat scene.flat")
    })?;
    let text = String::from_utf8(scene_file::read(path)?).map_err(|_| {
        let invalid =
            io::Error::new(io::ErrorKind::InvalidData, "stream did not contain valid UTF-8");
        Failure::read(path, &invalid)
    })?;
    let scene = match path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg")) {
        true => parse_svg(&text).map_err(|SvgError { element, what, remedy }| {
            Failure::new(format_args!("{}: {element}: {what}", path.display())).help(remedy)
        })?,
        false => parse(&text).map_err(|error| {
            Failure::new(format_args!("{}: {error}", path.display()))
                .help("`relume help flat` shows what a scene looks like")
        })?,
    };
    let bright = |wall: &&Wall| wall.material.reflectance.iter().any(|&r| r >= BRIGHT);
    if let Some(wall) = scene.walls().iter().find(bright) {
        output::complain(&format!(
            "warning: `{}` reflects {:.0} % or more: what links err by grows by 1 / (1 - reflectance); \
             lower --epsilon and see whether the energies agree",
            wall.name,
            100.0 * BRIGHT
        ));
    }
    let frames = resolve(args.time.frames.as_ref(), scene.duration_s(), args.time.fps, 1)
        .map_err(|error| Failure::new(error).help("choose other --frames"))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let run = Run { scene: Arc::new(scene), name, args, frames };
    let measure = &args.measure;
    if args.bench {
        return bench::measure(&Plan::new(measure, args.update, false), &run, None);
    }
    if measure.compare || measure.json.is_some() || measure.every != 1 {
        return Err(Failure::usage("--compare, --json and --every go with --bench")
            .help("add --bench, or leave them out"));
    }
    if args.verify { verify::frames(&run, args.update, false) } else { run.solve(path) }
}

/// Reflectance from which on a scene is doubtful.
const BRIGHT: f64 = 0.95;

struct Run<'a> {
    scene: Arc<FlatScene>,
    /// Of the file, without its ending.
    name: String,
    args: &'a FlatArgs,
    frames: Vec<u32>,
}

impl Run<'_> {
    fn options(&self, update: UpdateChoice) -> Result<FlatOptions, Failure> {
        let update = update.asked_for()?;
        Ok(FlatOptions {
            epsilon: self.args.epsilon,
            min_length_m: self.args.min_length,
            constant: self.args.constant,
            update,
            events: self.args.events.is_some()
                || self.args.output.is_some()
                || self.args.print == Some(FlatPrint::Events),
            ..FlatOptions::default()
        })
    }

    fn solve(&self, path: &Path) -> Result<(), Failure> {
        let options = self.options(self.args.update)?;
        let mut session = FlatSession::new(self.scene.clone(), options).map_err(Failure::usage)?;
        let times = self.frames.iter().map(|&frame| self.time_of(frame));
        let part = draw::extent(&self.scene, times);
        if let Some(dir) = &self.args.output {
            make(dir)?;
        }
        let (mut reports, mut events) = (Vec::new(), EventTable::new());
        for &frame in &self.frames {
            memory::at(format_args!("frame {frame}"));
            if interrupt::requested() {
                return Err(Failure::interrupted("interrupted; nothing more is written"));
            }
            reports.push(session.go(frame, self.time_of(frame), 0)?);
            let solved = session.frame().expect("a step leaves a solution");
            events.add(frame, &solved.events());
            if let Some(dir) = &self.args.output {
                write(&dir.join(format!("frame-{frame:04}.svg")), &picture(solved, part, frame))?;
            }
        }
        let report = Report {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            scene: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            bodies: self.scene.bodies().len(),
            segments: self.scene.walls().len(),
            options: Options {
                epsilon: self.args.epsilon,
                min_length_m: self.args.min_length,
                constant: self.args.constant,
                residual: FlatOptions::default().residual,
                update: self.args.update.name(),
                fps: self.args.time.fps,
            },
            frames: &reports,
        };
        let text = serde_json::to_string_pretty(&report).map_err(Failure::new)? + "\n";
        if let Some(path) = &self.args.events {
            write(path, events.text())?;
        }
        if let Some(dir) = &self.args.output {
            write(&dir.join("report.json"), &text)?;
        }
        match (self.args.print, &self.args.output) {
            (None, Some(_)) => Ok(()),
            (None | Some(FlatPrint::Report), _) => output::print(&text),
            (Some(FlatPrint::Frames), _) => output::print(&lines(&reports)),
            (Some(FlatPrint::Walls), _) => output::print(&walls(session.frame())),
            (Some(FlatPrint::Events), _) => output::print(events.text()),
        }
    }
}

impl Sequence for Run<'_> {
    type Session = FlatSession;

    fn name(&self) -> &str {
        &self.name
    }

    fn frames(&self) -> &[u32] {
        &self.frames
    }

    fn time_of(&self, frame: u32) -> f64 {
        time_of(frame, self.args.time.fps)
    }

    fn tolerance(&self) -> Option<f64> {
        None
    }

    fn oracle(&self) -> String {
        format!("form-factor={},{}", self.args.epsilon, self.args.min_length)
    }

    fn threads(&self) -> usize {
        rayon::current_num_threads()
    }

    fn begin(&self, update: UpdateChoice) -> Result<FlatSession, Failure> {
        let options = FlatOptions { balance: false, ..self.options(update)? };
        FlatSession::new(self.scene.clone(), options).map_err(Failure::usage)
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let _guard = interrupt::writing();
    write_atomically(path, text.as_bytes()).map_err(|error| Failure::write(path, &error))
}

/// A line for each frame.
fn lines(reports: &[FrameReport]) -> String {
    let mut out = String::from(
        "frame  links  elements  judged  followed  extrapolated  demoted  promoted  occluded  hash\n",
    );
    for r in reports {
        let _ = writeln!(
            out,
            "{:>5}  {:>5}  {:>8}  {:>6}  {:>8}  {:>12}  {:>7}  {:>8}  {:>8}  {}",
            r.frame,
            r.links,
            r.elements,
            r.work.examined,
            r.work.followed,
            r.work.extrapolated,
            r.work.demoted,
            r.work.promoted,
            r.work.occlusion_changed,
            &r.hash[..8]
        );
    }
    out
}

/// Mean radiosities, red, of undivided elements.
fn walls(frame: Option<FlatFrame<'_>>) -> String {
    let mut out = String::new();
    let Some(frame) = frame else { return out };
    let (_, forest) = frame.pairs();
    for &facet in forest.facets() {
        let [red, ..] = frame.radiosity(facet);
        let _ = writeln!(out, "{:<12} {red:.4}", frame.name(facet).short());
    }
    out
}

/// Widest side of a picture, pixels.
const SIDE: f64 = 720.0;

fn picture(solved: FlatFrame<'_>, part: (glam::DVec2, glam::DVec2), frame: u32) -> String {
    let scale = SIDE / (part.1 - part.0).max_element();
    let mut sheet = draw::Sheet::new(part, scale, 36.0);
    sheet.links(solved, &solved.links(), Pen { opacity: 0.7, ..Pen::new(0.9, draw::PINK) });
    sheet.events(solved);
    sheet.walls(solved.view());
    sheet.ticks(&solved.elements());
    sheet.caption(&format!("frame {frame}"));
    sheet.drawing.to_svg()
}
