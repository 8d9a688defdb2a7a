//! `relume probe`: irradiance at points, frame by frame, as a table.

use std::io::Write;
use std::path::Path;

use relume::scene::{BodyId, Scene};
use relume::session::{Aim, Frame, MountedSensor, Options, Sensor, Session};

use crate::accuracy::Estimates;
use crate::args::{AccuracyFlag, ProbeArgs};
use crate::clip::{Clip, TOLERANCE, solved, step_failure};
use crate::clock::now;
use crate::failure::Failure;
use crate::interrupt;
use crate::light;
use crate::output::{self, Sink, counted};
use crate::progress::Progress;
use crate::sensors::{self, Entry, Sensors};
use crate::size::Size;

/// Runs the command.
pub(crate) fn probe(args: &ProbeArgs) -> Result<(), Failure> {
    let started = now();
    let sensors = sensors::read(&args.sensors)?;
    let clip = Clip::of_file(&args.scene, &args.clip, TOLERANCE)?;
    // Readings in the dark are right: a lamp may be switched off in one file of many.
    light::warning(&clip.scene).iter().for_each(|line| clip.say(line));
    let riders = riders(&clip.scene, &args.sensors, &sensors)?;
    let hidden = inside(&clip, &riders, &args.sensors)?;
    clip.warn();
    clip.warn_of(args.update);
    if !args.clip.quiet {
        say_renamed(&sensors);
        hidden.iter().for_each(|line| output::complain(line));
    }
    // A sensor in a dark shell reads nothing, whether its walls are there or not; on the mesh it needs them.
    let clip = if args.interpolate { clip } else { clip.without_dark_sides() };
    let mut sink = Sink::open(args.output.as_deref())?;
    // Gathered readings need no more than the right light from what their sensors see.
    let aim = match args.interpolate {
        true => Aim::Mesh,
        false => Aim::Sensors(riders.iter().map(Rider::mounted).collect()),
    };
    let options = Options { aim, ..clip.options(args.update, false)? };
    let mut session = clip.session_with(options)?;
    let size = Size::of(&clip, session.options());
    if !args.clip.quiet {
        size.warn(&clip, clip.frames.len(), "");
    }
    let progress = Progress::new(clip.frames.len(), 0, args.clip.quiet);
    progress.watch(session.watch(), size.pairs());
    let mut estimates =
        Estimates::new(if args.clip.quiet { AccuracyFlag::Off } else { args.accuracy });
    let outcome =
        frames((&clip, &mut session), &riders, (args, &mut estimates), &progress, &mut sink);
    progress.clear();
    let done = outcome.map_err(interrupt::keeping_rows)?;
    sink.finish()?;
    if done < clip.frames.len() {
        return Err(Failure::interrupted(format_args!(
            "stopped: the rows of {done} of {} are written",
            counted(clip.frames.len(), "frame")
        )));
    }
    if !args.clip.quiet {
        output::complain(&format!(
            "{} at {}, {:.1} s{}{}",
            counted(riders.len(), "sensor"),
            counted(clip.frames.len(), "frame"),
            started.elapsed().as_secs_f64(),
            args.output.as_ref().map_or_else(String::new, |p| format!(", in {}", p.display())),
            estimates.line(clip.tolerance)
        ));
    }
    Ok(())
}

/// A sensor with the body that it rides on; place and normal in that body's frame, or the world's.
struct Rider<'a> {
    entry: &'a Entry,
    body: Option<BodyId>,
    local: Sensor,
}

impl Rider<'_> {
    fn mounted(&self) -> MountedSensor {
        MountedSensor { body: self.body, sensor: self.local }
    }

    /// Where it is in the world; `None` while its body is absent.
    fn at(&self, scene: &Scene, time_s: f64) -> Option<Sensor> {
        let Some(body) = self.body else { return Some(self.local) };
        let pose = scene.pose(body, time_s)?;
        Some(Sensor {
            at: pose.point(self.local.at),
            normal: pose.direction(self.local.normal).normalize(),
        })
    }
}

fn riders<'a>(scene: &Scene, path: &Path, sensors: &'a Sensors) -> Result<Vec<Rider<'a>>, Failure> {
    let rider = |entry: &'a Entry| {
        let world = Sensor { at: entry.at - scene.origin, normal: entry.normal };
        let Some(name) = &entry.body else { return Ok(Rider { entry, body: None, local: world }) };
        let Some(index) = scene.bodies.iter().position(|b| b.name == *name) else {
            let what = format!("there is no body `{name}` in the scene");
            return Err(sensors::failure(path, entry.line, &what).help(the_bodies(scene)));
        };
        let body = BodyId(index as u32);
        let Some(pose) = scene.pose(body, 0.0) else {
            let what = format!("body `{name}` is absent at the start of the animation");
            return Err(sensors::failure(path, entry.line, &what).help(
                "a sensor that rides is given where it is at time 0: let it ride on a body that is there then",
            ));
        };
        let local = Sensor {
            at: pose.inverse_point(world.at),
            normal: pose.inverse_direction(world.normal),
        };
        Ok(Rider { entry, body: Some(body), local })
    };
    sensors.entries.iter().map(rider).collect()
}

/// The names of the bodies, the first of them.
fn the_bodies(scene: &Scene) -> String {
    const SHOWN: usize = 8;
    let names: Vec<String> =
        scene.bodies.iter().take(SHOWN).map(|b| format!("`{}`", b.name)).collect();
    let more = scene.bodies.len().saturating_sub(SHOWN);
    let rest =
        if more > 0 { format!(" and {more} more (see `relume info`)") } else { String::new() };
    format!("leave body empty for a sensor that rests, or name one of {}{rest}", names.join(", "))
}

fn say_renamed(sensors: &Sensors) {
    for (wanted, name) in &sensors.renamed {
        output::complain(&format!(
            "note: there are several sensors `{wanted}`; one of them is called `{name}`"
        ));
    }
}

/// Sensors that are inside a body. In every frame: an error. In some: a line to be said for each
/// body, because things may well move over a sensor.
fn inside(clip: &Clip, riders: &[Rider<'_>], path: &Path) -> Result<Vec<String>, Failure> {
    let scene = &clip.scene;
    // For each sensor the frames it is there, and the first frame and body it is inside of.
    let mut there = vec![0_usize; riders.len()];
    let mut within: Vec<(usize, Option<(u32, BodyId)>)> = vec![(0, None); riders.len()];
    for &frame in &clip.frames {
        let time_s = clip.time_of(frame);
        let poses: Vec<_> =
            (0..scene.bodies.len()).map(|b| scene.pose(BodyId(b as u32), time_s)).collect();
        for (k, rider) in riders.iter().enumerate() {
            let Some(sensor) = rider.at(scene, time_s) else { continue };
            there[k] += 1;
            let holds = |b: &usize| {
                poses[*b].is_some_and(|pose| {
                    scene.is_inside(BodyId(*b as u32), pose.inverse_point(sensor.at))
                })
            };
            if let Some(body) = (0..poses.len()).find(holds) {
                within[k].0 += 1;
                within[k].1.get_or_insert((frame, BodyId(body as u32)));
            }
        }
    }
    let mut said = Vec::new();
    for (k, rider) in riders.iter().enumerate() {
        let (frames, Some((first, body))) = within[k] else { continue };
        let body = &scene.bodies[body.0 as usize].name;
        if frames == there[k] {
            let what = format!("sensor `{}` is inside body `{body}`", rider.entry.name);
            return Err(sensors::failure(path, rider.entry.line, &what)
                .help("no light gets there: move it out of the body, or onto its surface"));
        }
        said.push(format!(
            "warning: line {}: sensor `{}` is inside body `{body}` in {}, first in frame {first}: it \
             gets no light there",
            rider.entry.line,
            rider.entry.name,
            counted(frames, "frame")
        ));
    }
    Ok(said)
}

/// Solves frame after frame and adds their rows; how many were finished.
fn frames(
    (clip, session): (&Clip, &mut Session),
    riders: &[Rider<'_>],
    (args, estimates): (&ProbeArgs, &mut Estimates),
    progress: &Progress,
    sink: &mut Sink,
) -> Result<usize, Failure> {
    let mut table = csv::Writer::from_writer(Vec::new());
    let heading = ["frame", "sensor", "x", "y", "z", "nx", "ny", "nz", "E_r", "E_g", "E_b"];
    table.write_record(heading).map_err(Failure::new)?;
    let mut links = 0;
    for (done, &frame) in clip.frames.iter().enumerate() {
        if interrupt::requested() {
            return Ok(done);
        }
        progress.start(frame, links, session.memory_bytes());
        let time_s = clip.time_of(frame);
        links = session.step(frame, time_s).map_err(|error| step_failure(error, ""))?.links;
        let here: Vec<(&Rider<'_>, Sensor)> =
            riders.iter().filter_map(|r| Some((r, r.at(&clip.scene, time_s)?))).collect();
        let found = irradiances(solved(session), &here, args, frame)?;
        let sensors: Vec<Sensor> = here.iter().map(|(_, sensor)| *sensor).collect();
        estimates.of(solved(session), frame, Some(&sensors));
        for ((rider, sensor), e) in here.iter().zip(found) {
            let mut row = vec![frame.to_string(), rider.entry.name.clone()];
            let place = (clip.scene.origin + sensor.at)
                .to_array()
                .into_iter()
                .chain(sensor.normal.to_array());
            row.extend(place.map(short));
            row.extend(e.map(|e| (e as f32).to_string()));
            table.write_record(&row).map_err(Failure::new)?;
        }
        let bytes = std::mem::replace(&mut table, csv::Writer::from_writer(Vec::new()));
        let bytes = bytes.into_inner().map_err(|error| Failure::new(error.error()))?;
        sink.write_all(&bytes).map_err(|error| sink.failure(&error))?;
        sink.keep_so_far()?;
        progress.finish_frame();
    }
    Ok(clip.frames.len())
}

fn irradiances(
    solved: Frame<'_>,
    here: &[(&Rider<'_>, Sensor)],
    args: &ProbeArgs,
    frame: u32,
) -> Result<Vec<[f64; 3]>, Failure> {
    let sensors: Vec<Sensor> = here.iter().map(|(_, sensor)| *sensor).collect();
    if !args.interpolate {
        return Ok(solved.irradiances_at(&sensors));
    }
    let snapshot = solved.solution();
    let read = |(rider, sensor): &(&Rider<'_>, Sensor)| {
        snapshot.irradiance_at(sensor.at, sensor.normal).ok_or_else(|| {
            let what = format!(
                "sensor `{}` lies on no surface that faces as it does in frame {frame}",
                rider.entry.name
            );
            sensors::failure(&args.sensors, rider.entry.line, &what)
                .help("leave out --interpolate: irradiance is then gathered at the point itself")
        })
    };
    here.iter().map(read).collect()
}

/// Nine decimals at most: a nanometre.
fn short(x: f64) -> String {
    // Adding 0 takes the sign from -0.
    ((x * 1e9).round() / 1e9 + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_short() {
        for (x, text) in [(0.1 + 0.2, "0.3"), (-1e-12, "0"), (12.5, "12.5"), (1e6, "1000000")] {
            assert_eq!(short(x), text);
        }
    }
}
