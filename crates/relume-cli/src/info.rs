//! `relume info`: what was read from a scene file, as text.

use std::fmt::{self, Write};

use relume::scene::{
    BodyId, Instants, Light, LightKind, Material, MaterialId, Projection, Scene, Tint,
};

use crate::args::InfoArgs;
use crate::clip::TOLERANCE;
use crate::failure::Failure;
use crate::frames;
use crate::notes;
use crate::output::{self, counted};
use crate::scene_file;

/// Runs the command.
pub(crate) fn info(args: &InfoArgs) -> Result<(), Failure> {
    let scene = scene_file::load(
        &args.scene,
        &args.animation,
        false,
        Instants { fps: args.fps, frames: Vec::new() },
    )?;
    // Of what was read; light from outside is a section of its own.
    let lit = args.outside.light(scene.clone(), args.fps, TOLERANCE)?;
    let scene = Scene { motion: lit.motion.clone(), ..scene };
    let mut text = describe(&scene, args.fps, args.verbose)?;
    outside(&mut text, &lit).map_err(Failure::new)?;
    output::print(&text)
}

/// Light from outside at the start.
fn outside(out: &mut String, scene: &Scene) -> fmt::Result {
    let Some(outside) = &scene.outside else { return Ok(()) };
    let distant = scene.patches.iter().filter(|p| scene.is_distant(p.body)).count();
    writeln!(out, "\noutside (north is -Z, east +X, up +Y)")?;
    writeln!(out, "  {} stand for it", counted(distant, "polygon"))?;
    let times = if outside.day.is_some() { vec![0.0, scene.motion.duration_s] } else { vec![0.0] };
    for time_s in times {
        let Ok(now) = outside.at(time_s) else { continue };
        if outside.day.is_some() {
            writeln!(out, "  at {} s", number(time_s))?;
        }
        if let Some([azimuth, elevation]) = now.sun_angles() {
            writeln!(out, "  sun at azimuth {azimuth:.2}, elevation {elevation:.2} degrees")?;
        }
        let [sky, sun] = now.horizontal_w_m2();
        writeln!(
            out,
            "  onto a horizontal surface: sky {} W/m2, sun {} W/m2",
            triple(sky),
            triple(sun)
        )?;
    }
    Ok(())
}

/// The whole text.
fn describe(scene: &Scene, fps: f64, verbose: bool) -> Result<String, Failure> {
    let count = frames::frame_count(scene.motion.duration_s, fps).map_err(Failure::new)?;
    let mut text = String::new();
    let written = (|| -> fmt::Result {
        overview(&mut text, scene)?;
        animation(&mut text, scene, count, fps)?;
        bodies(&mut text, scene)?;
        materials(&mut text, scene)?;
        emitters(&mut text, scene)?;
        lights(&mut text, scene)?;
        cameras(&mut text, scene)?;
        notes(&mut text, scene, verbose)
    })();
    written.map_err(|error| Failure::new(format_args!("cannot describe the scene: {error}")))?;
    Ok(text)
}

fn overview(out: &mut String, scene: &Scene) -> fmt::Result {
    writeln!(out, "scene      {}", output::name(&scene.name))?;
    writeln!(
        out,
        "content    {}, {}, {}, {} m2",
        counted(scene.bodies.len(), "body"),
        counted(scene.surfaces.len(), "surface"),
        counted(scene.patches.len(), "patch"),
        number(scene.area_m2())
    )?;
    match scene.bounds(0.0) {
        Some(bounds) => writeln!(
            out,
            "bounds     {} to {} m at the start",
            triple((scene.origin + bounds.lo).to_array()),
            triple((scene.origin + bounds.hi).to_array())
        ),
        None => writeln!(out, "bounds     nothing is present at the start"),
    }
}

fn animation(out: &mut String, scene: &Scene, count: u32, fps: f64) -> fmt::Result {
    let moving = (0..scene.bodies.len()).filter(|b| scene.moves(BodyId(*b as u32))).count();
    if scene.motion.duration_s == 0.0 && moving == 0 {
        return writeln!(out, "animation  none: 1 frame");
    }
    writeln!(
        out,
        "animation  {}: {} s, frames 0-{} at {fps} fps ({count} in all), {} of {} moving",
        output::name(scene.motion.animation.as_deref().unwrap_or("unnamed")),
        number(scene.motion.duration_s),
        count - 1,
        moving,
        counted(scene.bodies.len(), "body"),
    )
}

fn bodies(out: &mut String, scene: &Scene) -> fmt::Result {
    writeln!(out, "\nbodies")?;
    let mut surfaces = vec![Vec::new(); scene.bodies.len()];
    scene.surfaces.iter().for_each(|surface| surfaces[surface.body.0 as usize].push(surface));
    for (index, body) in scene.bodies.iter().enumerate() {
        let id = BodyId(index as u32);
        let area: f64 = scene.patches_of(id).map(|(_, patch)| patch.area_m2()).sum();
        let patches = counted(body.patches.len(), "patch");
        let state = if scene.moves(id) { "moves" } else { "still" };
        writeln!(
            out,
            "  {:<24} {state}  {patches}, {} m2",
            output::name(&body.name),
            number(area)
        )?;
        for surface in &surfaces[index] {
            let material = output::name(&scene.materials[surface.material.0 as usize].name);
            writeln!(out, "    {:<22} material {material}", output::name(&surface.name))?;
        }
    }
    Ok(())
}

fn materials(out: &mut String, scene: &Scene) -> fmt::Result {
    writeln!(out, "\nmaterials (reflectance; exitance in W/m2; linear RGB)")?;
    for (id, material) in (0..).map(MaterialId).zip(&scene.materials) {
        let Material { name, glow, double_sided, .. } = material;
        let tint = scene.mean_tint(id);
        let plain = Tint { reflectance: material.reflectance, emission: [1.0; 3] };
        let Tint { reflectance, emission } = tint.unwrap_or(plain);
        let part = |exitance: [f64; 3]| triple([0, 1, 2].map(|c| exitance[c] * emission[c]));
        write!(out, "  {:<24} {}", output::name(name), triple(reflectance))?;
        if material.emits() {
            write!(out, "  emits {}", part(material.exitance))?;
        }
        if material.emits() && glow.is_some() {
            write!(out, " at first, never above {}", part(material.most_exitance()))?;
        }
        let varies =
            if tint.is_some() { "  in the mean of its texture or vertex colours" } else { "" };
        writeln!(out, "{varies}{}", if *double_sided { "  both sides" } else { "" })?;
    }
    Ok(())
}

/// Surfaces that emit, with their flux.
fn emitters(out: &mut String, scene: &Scene) -> fmt::Result {
    writeln!(out, "\nemitters (flux in W; linear RGB, and the sum)")?;
    let mut none = scene.lights.is_empty();
    let mut emitted = vec![([0.0; 3], 0.0); scene.surfaces.len()];
    for patch in scene.patches.iter().filter(|patch| scene.patch_emits(patch)) {
        let exitance = scene.most_exitance(patch);
        let (flux, area) = &mut emitted[patch.surface.0 as usize];
        *area += patch.area_m2();
        (0..3).for_each(|c| flux[c] += exitance[c] * patch.area_m2());
    }
    for (surface, (flux, area)) in scene.surfaces.iter().zip(emitted) {
        let material = &scene.materials[surface.material.0 as usize];
        if area == 0.0 {
            continue;
        }
        none = false;
        let most = if material.glow.is_some() { " at most" } else { "" };
        let sum = number(flux.iter().sum());
        writeln!(
            out,
            "  {:<24} {}  sum {sum}{most}, from {} m2",
            output::name(&surface.name),
            triple(flux),
            number(area)
        )?;
    }
    if none {
        let by = match scene.environment {
            Some(_) => "the environment that it carries",
            None => "an overcast sky and a sun",
        };
        writeln!(
            out,
            "  none: `render` lights it with {by}, unless it is told --sky, --sun, --environment or --emit"
        )?;
    }
    Ok(())
}

fn lights(out: &mut String, scene: &Scene) -> fmt::Result {
    if scene.lights.is_empty() {
        return Ok(());
    }
    writeln!(out, "\nlights without area")?;
    for Light { name, kind, intensity, conversion, .. } in &scene.lights {
        let (kind, unit) = match kind {
            LightKind::Point => ("point".to_owned(), "W/sr"),
            LightKind::Spot { inner, outer } => (
                format!("spot {:.1}-{:.1} degrees", inner.to_degrees(), outer.to_degrees()),
                "W/sr",
            ),
            LightKind::Directional => ("directional".to_owned(), "W/m2"),
        };
        writeln!(
            out,
            "  {:<24} {kind}, {} {unit}; {conversion}",
            output::name(name),
            triple(*intensity)
        )?;
    }
    Ok(())
}

fn cameras(out: &mut String, scene: &Scene) -> fmt::Result {
    writeln!(out, "\ncameras")?;
    for camera in &scene.cameras {
        let lens = match camera.projection {
            Projection::Perspective { yfov, aspect } => format!(
                "perspective, {:.1} degrees high{}",
                yfov.to_degrees(),
                aspect.map_or_else(String::new, |a| format!(", {a:.3} : 1"))
            ),
            Projection::Orthographic { xmag, ymag } => {
                format!("orthographic, {} x {} m", number(2.0 * xmag), number(2.0 * ymag))
            }
        };
        let state = if scene.motion.moves(camera.node) { "moves" } else { "still" };
        writeln!(out, "  {:<24} {state}  {lens}", output::name(&camera.name))?;
    }
    if scene.cameras.is_empty() {
        writeln!(out, "  none: pictures show an overview")?;
    }
    Ok(())
}

fn notes(out: &mut String, scene: &Scene, verbose: bool) -> fmt::Result {
    if scene.notes.is_empty() {
        return Ok(());
    }
    writeln!(out, "\nnotes")?;
    notes::lines(&scene.notes, verbose).iter().try_for_each(|line| writeln!(out, "  {line}"))
}

/// Four significant digits, no exponent for numbers of everyday size.
fn number(x: f64) -> String {
    let digits = match x.abs() {
        0.0 => return "0".into(),
        a if !(1e-4..1e7).contains(&a) => return format!("{x:.3e}"),
        a if a >= 1000.0 => 0,
        a if a >= 100.0 => 1,
        a if a >= 10.0 => 2,
        a if a >= 1.0 => 3,
        a if a >= 0.1 => 4,
        a if a >= 0.01 => 5,
        _ => 6,
    };
    let text = format!("{x:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

fn triple(values: [f64; 3]) -> String {
    let [a, b, c] = values.map(number);
    format!("({a}, {b}, {c})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::DemoScene;
    use crate::demo::demo;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (2.0, "2"),
            (0.75, "0.75"),
            (1234.5678, "1235"),
            (-0.012345, "-0.01235"),
            (1e-9, "1.000e-9"),
            (4.5, "4.5"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn the_room_is_described() {
        let scene = (demo(DemoScene::Room).build)().unwrap();
        let text = describe(&scene, 24.0, false).unwrap();
        for line in [
            "scene      room",
            "content    7 bodies, 7 surfaces, 7 patches, 54.49 m2",
            "frames 0-19 at 24 fps (20 in all), 1 of 7 bodies moving",
            "still  perspective",
            "sum 81.59, from 0.49 m2",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }
}
