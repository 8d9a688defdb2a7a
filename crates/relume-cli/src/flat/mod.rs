//! `relume flat`: scenes in the plane, and the paper's figures of it.

mod draw;
mod figures;

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use relume::flat::{FlatOptions, FlatScene, FlatSession, parse};
use relume::session::FrameReport;
use relume_picture::drawing::Pen;
use relume_picture::export::write_atomically;
use serde::Serialize;

use crate::args::{FlatArgs, FlatCommand, FlatPrint, UpdateChoice, UpdateFlag};
use crate::events::EventTable;
use crate::failure::Failure;
use crate::frames::{resolve, time_of};
use crate::interrupt;
use crate::output::{self, counted};

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
    let text = fs::read_to_string(path).map_err(|error| Failure::read(path, &error))?;
    let scene = parse(&text).map_err(|error| {
        Failure::new(format_args!("{}: {error}", path.display()))
            .help("`relume help flat` shows what a scene looks like")
    })?;
    let frames = resolve(args.frames.as_ref(), scene.duration_s(), args.fps)
        .map_err(|error| Failure::usage(error).help("choose other --frames"))?;
    let run = Run { scene: Arc::new(scene), args, frames };
    if args.verify { run.verify() } else { run.solve(path) }
}

fn make(dir: &Path) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|error| Failure::write(dir, &error))
}

struct Run<'a> {
    scene: Arc<FlatScene>,
    args: &'a FlatArgs,
    frames: Vec<u32>,
}

impl Run<'_> {
    fn options(&self, update: UpdateFlag) -> Result<FlatOptions, Failure> {
        let update = UpdateChoice::of(update).update().expect("no error is stated");
        Ok(FlatOptions {
            epsilon: self.args.epsilon,
            min_length_m: self.args.min_length,
            constant: self.args.constant,
            update,
            events: self.args.events.is_some() || self.args.print == Some(FlatPrint::Events),
            ..FlatOptions::default()
        })
    }

    fn session(&self, update: UpdateFlag) -> Result<FlatSession, Failure> {
        FlatSession::new(self.scene.clone(), self.options(update)?).map_err(Failure::usage)
    }

    fn time_of(&self, frame: u32) -> f64 {
        time_of(frame, self.args.fps)
    }

    fn solve(&self, path: &Path) -> Result<(), Failure> {
        let mut session = self.session(self.args.update)?;
        let times = self.frames.iter().map(|&frame| self.time_of(frame));
        let part = draw::extent(&self.scene, times);
        if let Some(dir) = &self.args.output {
            make(dir)?;
        }
        let (mut reports, mut events) = (Vec::new(), EventTable::new());
        for &frame in &self.frames {
            if interrupt::requested() {
                return Err(Failure::interrupted("interrupted; nothing more is written"));
            }
            reports.push(session.step(frame, self.time_of(frame)));
            events.add(frame, &session.events());
            if let Some(dir) = &self.args.output {
                write(&dir.join(format!("frame-{frame:04}.svg")), &picture(&session, part, frame))?;
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
                update: UpdateChoice::of(self.args.update).name(),
                fps: self.args.fps,
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
            (Some(FlatPrint::Walls), _) => output::print(&walls(&session)),
            (Some(FlatPrint::Events), _) => output::print(events.text()),
        }
    }

    /// Frame by frame against a cold build.
    fn verify(&self) -> Result<(), Failure> {
        let mut warm = self.session(self.args.update)?;
        let mut cold = self.session(UpdateFlag::Scratch)?;
        for &frame in &self.frames {
            let time_s = self.time_of(frame);
            let (one, two) = (warm.step(frame, time_s), cold.step(frame, time_s));
            let of = |r: &FrameReport| (r.hash.clone(), r.links, r.elements);
            if of(&one) != of(&two) {
                return Err(Failure::new(format_args!(
                    "frame {frame} differs: {} links and {} elements, {} and {} from scratch",
                    one.links, one.elements, two.links, two.elements
                )));
            }
            let gap = warm.radiosity_gap(&cold);
            if gap.largest > gap.allowed {
                return Err(Failure::new(format_args!(
                    "frame {frame}: a radiosity differs by {:.1e} W/m2, {:.1e} are allowed",
                    gap.largest, gap.allowed
                )));
            }
        }
        let frames = counted(self.frames.len(), "frame");
        output::print(&format!(
            "{frames} equal: links bit for bit, radiosities within their bound\n"
        ))
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    write_atomically(path, text.as_bytes()).map_err(|error| Failure::write(path, &error))
}

/// A line for each frame.
fn lines(reports: &[FrameReport]) -> String {
    let mut out = String::from(
        "frame  links  elements  examined  extrapolated  demoted  promoted  occluded  hash\n",
    );
    for r in reports {
        let _ = writeln!(
            out,
            "{:>5}  {:>5}  {:>8}  {:>8}  {:>12}  {:>7}  {:>8}  {:>8}  {}",
            r.frame,
            r.links,
            r.elements,
            r.examined,
            r.extrapolated,
            r.demoted,
            r.promoted,
            r.occlusion_changed,
            &r.hash[..8]
        );
    }
    out
}

/// Mean radiosities, red, of undivided elements.
fn walls(session: &FlatSession) -> String {
    let (_, forest) = session.pairs();
    let mut out = String::new();
    for &facet in forest.facets() {
        let [red, ..] = session.radiosity(facet);
        let _ = writeln!(out, "{:<12} {red:.4}", session.name(facet).short());
    }
    out
}

/// Widest side of a picture, pixels.
const SIDE: f64 = 720.0;

fn picture(session: &FlatSession, part: (glam::DVec2, glam::DVec2), frame: u32) -> String {
    let scale = SIDE / (part.1 - part.0).max_element();
    let mut sheet = draw::Sheet::new(part, scale, 36.0);
    sheet.links(session, &session.links(), Pen { opacity: 0.7, ..Pen::new(0.9, draw::PINK) });
    sheet.walls(session.view());
    sheet.ticks(&session.elements());
    sheet.caption(&format!("frame {frame}"));
    sheet.drawing.to_svg()
}
