//! `relume export`: a solved clip as one file that other programs show, with the light in it.
//!
//! Frames are solved one after the other and kept on one mesh; the file is written when all are there.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use indicatif::HumanBytes;
use relume::Pose;
use relume::export::{self, Lit, LitPart, PageView, write_atomically};
use relume::scene::Projection;
use relume::session::{Session, Snapshot};
use relume_picture::picture::{Exposure, Recorder, Recording, Tone};
use serde_json::{Value, json};

mod numbers;

use crate::args::{ExportArgs, ExposureFlag};
use crate::clip::{Clip, PICTURE_TOLERANCE, solved, step_failure};
use crate::clock::now;
use crate::exposure::{brightest_of, stops};
use crate::failure::Failure;
use crate::frames;
use crate::interrupt;
use crate::light;
use crate::lock::Lock;
use crate::output::{self, count, counted};
use crate::progress::Progress;
use crate::size::Size;
use crate::tuning::{MORPH_BYTES_MAX, TARGETS_MAX};
use crate::viewing::Viewing;

/// Cosine from which on a view's upright direction is taken for the world's.
const UPRIGHT: f64 = 0.1;

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// glTF whose light plays.
    Glb,
    /// A page that plays the clip.
    Html,
    /// USD whose light plays.
    Usda,
    /// A solution for VTK.
    Vtp,
    /// Solutions for VTK by time.
    Pvd,
}

/// What can be written.
const FORMS: &str =
    "the name says what is written: lit.glb, lit.html, lit.usda, lit.vtp (one frame) or lit.pvd";

impl Form {
    /// By the ending of a name.
    fn of(path: &Path) -> Result<Form, Failure> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        match ending.to_ascii_lowercase().as_str() {
            "glb" => Ok(Form::Glb),
            "html" | "htm" => Ok(Form::Html),
            "usda" => Ok(Form::Usda),
            "vtp" => Ok(Form::Vtp),
            "pvd" => Ok(Form::Pvd),
            "" => Err(Failure::usage(format_args!("{} has no ending", path.display())).help(FORMS)),
            other => Err(Failure::usage(format_args!(
                "there is no way to write .{other} files with light"
            ))
            .help(FORMS)),
        }
    }
}

/// Runs the command.
pub(crate) fn export(args: &ExportArgs) -> Result<(), Failure> {
    let form = Form::of(&args.output)?;
    if args.view.turntable.is_some() {
        return Err(
            Failure::usage("a viewer turns the scene by itself").help("leave out --turntable")
        );
    }
    let _lock = Lock::of_file(&args.output)?;
    match form {
        Form::Vtp | Form::Pvd => return numbers::export(args, form == Form::Pvd),
        Form::Glb | Form::Html | Form::Usda => {}
    }
    let started = now();
    let read = Clip::for_pictures(&args.scene, &args.clip, PICTURE_TOLERANCE, 1)?;
    let (clip, views) = light::for_pictures(read, &args.view)?;
    clip.warn();
    clip.warn_of(args.update);
    let clip = clip.without_dark_sides();
    let views = match views {
        Some(views) => views,
        None => Viewing::new(&clip.scene, &args.view)?,
    };
    let keys = keys(&clip, args, form);
    let (recording, ev) = record(&clip, &views, &keys, args)?;
    let lit = lit(recording, ev.exp2());
    let (lit, bytes) = match form {
        Form::Html => {
            let view = page_view(&clip, &views, &lit)?;
            let page = export::page(&lit, view, ev).map_err(Failure::new)?;
            (lit, page.into_bytes())
        }
        Form::Usda => {
            let text = export::usda(&lit, clip.fps());
            (lit, text.into_bytes())
        }
        _ => glb(&clip, lit, ev)?,
    };
    {
        let _guard = interrupt::writing();
        write_atomically(&args.output, &bytes)
            .map_err(|error| Failure::write(&args.output, &error))?;
    }
    if args.clip.quiet {
        return Ok(());
    }
    output::print(&format!(
        "{}, {} points, {} in {}, exposure {ev} EV, {:.1} s\n",
        counted(lit.times_s.len(), "frame"),
        count(lit.points() as u64),
        HumanBytes(bytes.len() as u64),
        args.output.display(),
        started.elapsed().as_secs_f64()
    ))
}

/// The frames that are solved and stored: every so many of those asked for, and the last.
fn keys(clip: &Clip, args: &ExportArgs, form: Form) -> Vec<u32> {
    let frames = &clip.frames;
    let least = match form {
        Form::Glb => (frames.len() - 1).div_ceil(TARGETS_MAX).max(1),
        _ => 1,
    };
    if args.keys.is_none() && least > 1 {
        clip.say(&format!(
            "note: viewers play some {TARGETS_MAX} stored frames, so light is stored at every {least}th of {}; --keys N chooses \
             otherwise, and a .html page plays all",
            counted(frames.len(), "frame")
        ));
    }
    frames::every(frames, args.keys.map_or(least, |step| step as usize))
}

/// Solves the frames; the light on one mesh, and the exposure in stops.
fn record(
    clip: &Clip,
    views: &Viewing,
    frames: &[u32],
    args: &ExportArgs,
) -> Result<(Recording, f64), Failure> {
    let mut session = clip.session(args.update, false)?;
    let size = Size::of(clip, session.options());
    if !args.clip.quiet {
        size.warn(clip, frames.len(), "");
    }
    let progress = Progress::new(frames.len(), 0, args.clip.quiet);
    progress.watch(session.watch(), size.pairs());
    let outcome = solve(clip, views, (frames, args), &progress, &mut session);
    progress.clear();
    outcome
}

fn solve(
    clip: &Clip,
    views: &Viewing,
    (frames, args): (&[u32], &ExportArgs),
    progress: &Progress,
    session: &mut Session,
) -> Result<(Recording, f64), Failure> {
    let metered = brightest_of(&clip.scene, clip.fps(), frames.iter().copied());
    let metered = metered.unwrap_or(frames[0]);
    let mut recorder = Recorder::default();
    let mut ev = 0.0;
    let mut links = 0;
    for (done, &frame) in frames.iter().enumerate() {
        if interrupt::requested() {
            return Err(Failure::interrupted(format_args!(
                "stopped: {done} of {} solved, nothing is written",
                counted(frames.len(), "frame")
            )));
        }
        progress.start(frame, links, session.memory_bytes());
        let time_s = clip.time_of(frame);
        links = session.step(frame, time_s).map_err(|error| step_failure(error, ""))?.links;
        let snapshot = snapshot(session, args.reconstruct);
        match args.exposure {
            ExposureFlag::Stops(stops) => ev = stops,
            ExposureFlag::Auto if frame == metered => {
                let view = views.at(&clip.scene, frame, clip.fps())?;
                if let Exposure::Fixed(scale) = Exposure::automatic(&snapshot, &view) {
                    ev = stops(scale);
                }
            }
            ExposureFlag::Auto => {}
        }
        recorder.add(&snapshot);
        progress.finish_frame();
    }
    let recording = recorder.finish().expect("there is a frame");
    Ok((recording, ev))
}

fn snapshot(session: &Session, reconstruct: bool) -> Snapshot {
    let frame = solved(session);
    if reconstruct { frame.reconstruction() } else { frame.solution() }
}

/// A recording surface by surface, patches together that reflect and emit alike.
fn lit(recording: Recording, exposure: f64) -> Lit {
    let Recording { scene, times_s, worlds, mut patches } = recording;
    patches.sort_by_key(|of| scene.patches[of.patch.0 as usize].surface);
    let mut parts: Vec<LitPart> = Vec::new();
    for of in patches {
        let patch = &scene.patches[of.patch.0 as usize];
        let exitance: Vec<[f64; 3]> =
            worlds.iter().map(|now| now.exitance(&scene, patch)).collect();
        let reflectance = worlds[0].reflectance(&scene, patch);
        let is_like = |part: &LitPart| part.reflectance == reflectance && part.exitance == exitance;
        let of_surface = parts.iter().rev().take_while(|part| part.surface == patch.surface);
        let at = match of_surface.enumerate().find(|(_, part)| is_like(part)) {
            Some((back, _)) => parts.len() - 1 - back,
            None => {
                parts.push(LitPart {
                    surface: patch.surface,
                    points: Vec::new(),
                    triangles: Vec::new(),
                    irradiance: vec![Vec::new(); times_s.len()],
                    exitance,
                    reflectance,
                });
                parts.len() - 1
            }
        };
        let part = &mut parts[at];
        let first = part.points.len() as u32;
        part.points.extend(of.points.iter().map(|p| p.as_vec3().to_array()));
        part.triangles.extend(of.triangles.iter().map(|t| t.map(|k| first + k)));
        for (to, from) in part.irradiance.iter_mut().zip(&of.irradiance) {
            to.extend_from_slice(from);
        }
    }
    Lit { scene: Arc::clone(&scene), times_s, parts, exposure }
}

/// Where a page looks from at first: as the view of the first frame does, about what is nearest to the middle of the scene.
fn page_view(clip: &Clip, views: &Viewing, lit: &Lit) -> Result<PageView, Failure> {
    let time_s = lit.times_s[0];
    let view = views.at_time(&clip.scene, time_s)?;
    let (middle, size_m) = clip
        .scene
        .bounds(time_s)
        .map_or((DVec3::ZERO, 0.0), |bounds| (bounds.centre(), bounds.diagonal()));
    let Pose { rotation, translation: eye } = view.world_from_camera;
    let ahead = (middle - eye).dot(-rotation.z_axis).max(0.1 * size_m);
    let target = eye - ahead * rotation.z_axis;
    let up = if rotation.y_axis.y > UPRIGHT { DVec3::Y } else { rotation.y_axis };
    let (eye, yfov) = match view.projection {
        Projection::Perspective { yfov, .. } => (eye, yfov),
        // From as far away as shows as much.
        Projection::Orthographic { ymag, .. } => {
            let yfov = std::f64::consts::FRAC_PI_4;
            (target + rotation.z_axis * (ymag / libm::tan(yfov / 2.0)), yfov)
        }
    };
    Ok(PageView { eye, target, up, yfov })
}

/// The file as glTF, at fewer instants where viewers could not play it otherwise.
fn glb(clip: &Clip, lit: Lit, ev: f64) -> Result<(Lit, Vec<u8>), Failure> {
    let step = export::morph_bytes(&lit).div_ceil(MORPH_BYTES_MAX).max(1);
    let lit = match step {
        1 => lit,
        _ => {
            clip.say(&format!(
                "note: viewers would need {} for {}, so light is stored at every {step}th; a .html page plays all",
                HumanBytes(export::morph_bytes(&lit)),
                counted(lit.times_s.len(), "stored frame")
            ));
            lit.every(step as usize)
        }
    };
    let display = |x: f64| Tone::Shoulder.display(x);
    let bytes = export::lit_glb(&lit, &display, note(&lit, ev)).map_err(|error| {
        Failure::new(error).help("export fewer frames, or with a larger --tolerance")
    })?;
    Ok((lit, bytes))
}

/// How colours were made, for whoever reads the file.
fn note(lit: &Lit, ev: f64) -> Value {
    json!({
        "colours": "linear display values of radiance (W/m2/sr) times 2^exposure_ev, above 0.6 with a shoulder: 0.6 + 0.4 t/(1+t), \
                    t = (x - 0.6)/0.4",
        "exposure_ev": ev,
        "times_s": lit.times_s
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_says_the_form() {
        assert_eq!(Form::of(Path::new("a/lit.GLB")), Ok(Form::Glb));
        assert_eq!(Form::of(Path::new("out.pvd")), Ok(Form::Pvd));
        for wrong in ["lit", "lit.fbx", "lit.glb.txt"] {
            assert!(Form::of(Path::new(wrong)).is_err(), "{wrong}");
        }
    }
}
