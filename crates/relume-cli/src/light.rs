//! Scenes in which nothing shines, or little of what is looked at: nothing is solved for a black picture.

use glam::DVec3;
use relume::scene::Scene;
use relume_picture::picture::{Sketch, View};

use crate::clip::Clip;
use crate::failure::Failure;
use crate::output;
use crate::outside::{self, Unlit};
use crate::tuning::{LIT_MIN, SHOWN_MIN};
use crate::viewing::{ViewFlags, Viewing};

/// Most materials that are named.
const NAMED: usize = 5;

/// How far a default sun is to the left of where the view is from, degrees.
const BESIDE: f64 = 50.0;

/// Instants of a clip at which that is looked at.
const INSTANTS: usize = 3;

/// A clip of which pictures are to be made, with its views if they are known: with light, that of a default sky too where
/// nothing was said of light and what emits lights little of what is seen, and where that does not get in a lamp where the
/// view is from.
pub(crate) fn for_pictures(
    clip: Clip,
    flags: &ViewFlags,
) -> Result<(Clip, Option<Viewing>), Failure> {
    let seen_whole = instead_of_a_speck(&clip, flags)?;
    let flags = seen_whole.as_ref().unwrap_or(flags);
    if clip.light_is_chosen() {
        required(&clip.scene)?;
        let views = seen_whole.map(|flags| Viewing::new(&clip.scene, &flags)).transpose()?;
        return Ok((clip, views));
    }
    let why = if clip.scene.emits() {
        let views = Viewing::new(&clip.scene, flags)?;
        match share_lit(&clip, &views) {
            Some(lit) if lit < LIT_MIN => Unlit::Dim(lit),
            // Where a view sees no surface it is no matter of light.
            _ => return Ok((clip, Some(views))),
        }
    } else {
        Unlit::Dark
    };
    let under_sky = clip.under_sky(None)?;
    let views = Viewing::new(&under_sky.scene, flags)?;
    let first = clip.frames.first().copied().unwrap_or_default();
    let view = views.at(&under_sky.scene, first, clip.fps());
    // A sky lights no closed room.
    if share_lit(&under_sky, &views).is_some_and(|lit| lit < LIT_MIN) {
        return lit_from_within(&clip, flags, views, view?.world_from_camera.translation);
    }
    // Where a camera is absent at first any side is as good.
    let azimuth = view.map_or(0.0, |view| azimuth_beside(&view));
    clip.say(&outside::said_of_default(&clip.scene.name, azimuth, &why));
    Ok((clip.under_sky(Some(azimuth))?, Some(views)))
}

/// An overview where nothing was said of the view and the file's camera shows next to nothing of the scene, or looks past it.
fn instead_of_a_speck(clip: &Clip, flags: &ViewFlags) -> Result<Option<ViewFlags>, Failure> {
    let is_chosen = flags.camera.is_some() || flags.eye.is_some() || flags.overview;
    let Some(camera) = clip.scene.cameras.first().filter(|_| !is_chosen) else { return Ok(None) };
    let views = Viewing::new(&clip.scene, flags)?;
    let mut most: Option<f64> = None;
    for frame in instants(&clip.frames) {
        // Where a camera is absent its frames fail by themselves, after those before them.
        let Ok(view) = views.at(&clip.scene, frame, clip.fps()) else { continue };
        let shown = Sketch::shown(&clip.scene, clip.time_of(frame), &view);
        most = Some(most.map_or(shown, |most| most.max(shown)));
    }
    let Some(shown) = most.filter(|&shown| shown < SHOWN_MIN) else { return Ok(None) };
    clip.say(&format!(
        "note: the file's camera {} shows the scene on {:.1} % of the picture: an overview is shown instead; --camera {} keeps it",
        output::name(&camera.name),
        100.0 * shown,
        output::name(&camera.name)
    ));
    Ok(Some(ViewFlags { overview: true, ..flags.clone() }))
}

/// A clip with a lamp where its view is from; if that is outside of what is closed, in the middle, with views chosen anew.
fn lit_from_within(
    clip: &Clip,
    flags: &ViewFlags,
    views: Viewing,
    eye: DVec3,
) -> Result<(Clip, Option<Viewing>), Failure> {
    let beside = clip.with_lamp(eye);
    let lit = share_lit(&beside, &views).unwrap_or(0.0);
    if lit < LIT_MIN
        && let Some(bounds) = clip.scene.bounds(clip.time_of(clip.frames[0]))
    {
        let within = clip.with_lamp(bounds.centre());
        let anew = Viewing::new(&within.scene, flags)?;
        if share_lit(&within, &anew).is_some_and(|more| more > lit) {
            clip.say(&outside::said_of_lamp(&clip.scene.name, "in the middle of the scene"));
            return Ok((within, Some(anew)));
        }
    }
    clip.say(&outside::said_of_lamp(&clip.scene.name, "where the view is from"));
    Ok((beside, Some(views)))
}

/// Azimuth of a sun that shines over the left shoulder of a view, whole degrees from north (-Z) by east: it tells sides apart,
/// and shadows fall where they are seen.
fn azimuth_beside(view: &View) -> f64 {
    let back = view.world_from_camera.direction(DVec3::Z);
    let of_back = libm::atan2(back.x, -back.z).to_degrees();
    (of_back + BESIDE).round().rem_euclid(360.0)
}

/// The largest share of what is seen of surfaces that is lit at some of a clip's instants; `None` where none is seen.
fn share_lit(clip: &Clip, views: &Viewing) -> Option<f64> {
    let mut most = None;
    for frame in instants(&clip.frames) {
        // Where a camera is absent its frames fail by themselves, after those before them.
        let Ok(view) = views.at(&clip.scene, frame, clip.fps()) else { continue };
        let lit = Sketch::new(&clip.scene, clip.time_of(frame)).lit(&view);
        most = [most, lit].into_iter().flatten().reduce(f64::max);
    }
    if let (Some(lit), true) = (most, clip.is_verbose()) {
        let percent = 100.0 * lit;
        clip.say(&format!("note: light reaches {percent:.0} % of what the view shows"));
    }
    most
}

/// Some of the frames, the first among them.
fn instants(frames: &[u32]) -> impl Iterator<Item = u32> + '_ {
    let count = frames.len().min(INSTANTS);
    (0..count).map(move |k| frames[k * frames.len() / count])
}

/// An error if nothing in a scene ever emits.
pub(crate) fn required(scene: &Scene) -> Result<(), Failure> {
    match how_to_light(scene) {
        None => Ok(()),
        Some(help) => {
            let what = format!("{}, so there is nothing to solve", nothing_emits(scene));
            Err(Failure::new(what).help(help))
        }
    }
}

/// A warning that all readings are 0 if nothing in a scene ever emits.
pub(crate) fn warning(scene: &Scene) -> Option<String> {
    let help = how_to_light(scene)?;
    Some(format!("warning: {}, so every irradiance is 0: {help}", nothing_emits(scene)))
}

/// That nothing emits, with a material that would if polygons of it were not left out.
fn nothing_emits(scene: &Scene) -> String {
    let what = format!("nothing in {} emits light", output::name(&scene.name));
    match scene.materials.iter().find(|material| material.emits()) {
        Some(material) => format!(
            "{what} (`{}` would, but there are no polygons of it, or they are too small or thin and were left out)",
            output::name(&material.name)
        ),
        None => what,
    }
}

/// What to do where nothing in a scene ever emits.
fn how_to_light(scene: &Scene) -> Option<String> {
    if scene.emits() {
        return None;
    }
    let mut used: Vec<usize> = scene.patches.iter().map(|p| p.material.0 as usize).collect();
    used.sort_unstable();
    used.dedup();
    let quoted = |&m: &usize| format!("`{}`", output::name(&scene.materials[m].name));
    let mut names: Vec<String> = used.iter().take(NAMED).map(quoted).collect();
    if used.len() > NAMED {
        names.push("... (`relume info` lists all)".to_owned());
    }
    Some(format!(
        "light it with --sky uniform=1, or make a material shine with --emit MATERIAL=RADIANCE (W/m2/sr), such as one \
         of {}; or add a light or an emitting material to the file",
        names.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use relume::SceneBuilder;

    use super::*;
    use crate::args::DemoScene;
    use crate::demo;

    /// The camera looks north, and so back is south and left is west.
    #[test]
    fn a_default_sun_is_behind_the_view_and_to_its_left() {
        let from = |eye| View::look_at(eye, DVec3::ZERO, 0.7);
        assert_eq!(azimuth_beside(&from(DVec3::new(0.0, 1.0, 5.0))), 230.0);
        assert_eq!(azimuth_beside(&from(DVec3::new(5.0, 1.0, 0.0))), 140.0);
        assert_eq!(azimuth_beside(&from(DVec3::new(0.0, -3.0, -5.0))), 50.0);
    }

    #[test]
    fn a_lamp_that_was_left_out_as_too_small_is_named() {
        let mut b = SceneBuilder::new("speck");
        let (grey, lamp) =
            (b.material("grey", [0.5; 3], [0.0; 3]), b.material("lamp", [0.5; 3], [9.0; 3]));
        let node = b.node("all", None, DVec3::ZERO, DQuat::IDENTITY);
        let square = |half: f64, z: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| DVec3::new(half * x, half * y, z))
        };
        b.polygon(node, "floor", grey, &square(1.0, 0.0));
        b.polygon(node, "speck", lamp, &square(1e-9, 0.5));
        let text = required(&b.build().unwrap()).unwrap_err().to_string();
        assert!(text.contains("(`lamp` would, but there are no polygons of it"), "{text}");
    }

    #[test]
    fn a_scene_without_light_is_refused_with_its_materials() {
        let mut scene = (demo::demo(DemoScene::Room).build)().unwrap();
        assert_eq!(required(&scene), Ok(()));
        for material in &mut scene.materials {
            (material.exitance, material.glow) = ([0.0; 3], None);
        }
        let text = required(&scene).unwrap_err().to_string();
        assert!(text.contains("nothing in room emits light, so"), "{text}");
        assert!(text.contains("--emit MATERIAL=RADIANCE (W/m2/sr), such as one of `"), "{text}");
    }
}
