//! Solutions as `.vtp`, one file a frame, each written when its frame is solved; `.pvd` lists them at the end.

use std::fs;
use std::path::{Path, PathBuf};

use relume::export::{pvd, vtp, write_atomically};
use relume::session::Session;

use crate::args::{ExportArgs, ExposureFlag};
use crate::clip::{Clip, TOLERANCE, solved, step_failure};
use crate::clock::now;
use crate::failure::Failure;
use crate::frames;
use crate::interrupt;
use crate::light;
use crate::output::{self, counted};
use crate::progress::Progress;
use crate::size::Size;

/// Writes a `.vtp` of one frame, or a `.pvd` with a folder of them.
pub(super) fn export(args: &ExportArgs, by_time: bool) -> Result<(), Failure> {
    let started = now();
    if args.exposure != ExposureFlag::Auto {
        return Err(
            Failure::usage("numbers have no exposure: they are W/m2").help("leave out --exposure")
        );
    }
    let clip = Clip::of_file(&args.scene, &args.clip, TOLERANCE)?;
    light::required(&clip.scene)?;
    let frames = frames::every(&clip.frames, args.keys.unwrap_or(1) as usize);
    if frames.len() > 1 && !by_time {
        let other = args.output.with_extension("pvd");
        return Err(Failure::usage(format_args!(
            "a .vtp holds one frame, and there are {}",
            frames.len()
        ))
        .help(format_args!("choose one with --frames, or write {}", other.display())));
    }
    clip.warn();
    clip.warn_of(args.update);
    let clip = clip.without_dark_sides();
    let files = Files::new(&args.output, by_time)?;
    let mut session = clip.session(args.update, false)?;
    let size = Size::of(&clip, session.options());
    if !args.clip.quiet {
        size.warn(&clip, frames.len(), "");
    }
    let progress = Progress::new(frames.len(), 0, args.clip.quiet);
    progress.watch(session.watch(), size.pairs());
    let outcome = solve((&clip, &mut session), &frames, args.reconstruct, &progress, &files);
    progress.clear();
    outcome?;
    if args.clip.quiet {
        return Ok(());
    }
    output::print(&format!(
        "{} in {}, {:.1} s\n",
        counted(frames.len(), "frame"),
        args.output.display(),
        started.elapsed().as_secs_f64()
    ))
}

/// Where files go.
struct Files<'a> {
    output: &'a Path,
    /// Folder of the frames beside the list, and its name there.
    folder: Option<(PathBuf, String)>,
}

impl Files<'_> {
    fn new(output: &Path, by_time: bool) -> Result<Files<'_>, Failure> {
        let folder = by_time.then(|| {
            let folder = output.with_extension("");
            let name = folder.file_name().map(|n| n.to_string_lossy().into_owned());
            (folder, name.unwrap_or_default())
        });
        if let Some((folder, _)) = &folder {
            fs::create_dir_all(folder).map_err(|error| Failure::write(folder, &error))?;
        }
        Ok(Files { output, folder })
    }

    /// The file of a frame, and what it is called in the list.
    fn of(&self, frame: u32) -> (PathBuf, String) {
        let file = format!("frame-{frame:04}.vtp");
        match &self.folder {
            Some((folder, name)) => (folder.join(&file), format!("{name}/{file}")),
            None => (self.output.to_owned(), file),
        }
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let _guard = interrupt::writing();
    write_atomically(path, bytes).map_err(|error| Failure::write(path, &error))
}

fn solve(
    (clip, session): (&Clip, &mut Session),
    frames: &[u32],
    reconstruct: bool,
    progress: &Progress,
    files: &Files<'_>,
) -> Result<(), Failure> {
    let mut listed = Vec::new();
    let mut links = 0;
    for (done, &frame) in frames.iter().enumerate() {
        if interrupt::requested() {
            let failure = Failure::interrupted(format_args!(
                "stopped: {done} of {} written",
                counted(frames.len(), "frame")
            ));
            return Err(failure.help("their list is not: export these frames with --frames"));
        }
        progress.start(frame, links, session.memory_bytes());
        let time_s = clip.time_of(frame);
        links = session.step(frame, time_s).map_err(|error| step_failure(error, ""))?.links;
        let solved = solved(session);
        let snapshot = if reconstruct { solved.reconstruction() } else { solved.solution() };
        let (path, name) = files.of(frame);
        write(&path, &vtp(&snapshot))?;
        listed.push((time_s, name));
        progress.finish_frame();
    }
    if files.folder.is_some() {
        write(files.output, pvd(&listed).as_bytes())?;
    }
    Ok(())
}
