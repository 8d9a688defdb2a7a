//! Scenes in which nothing shines: nothing is solved for a black picture.

use relume::scene::Scene;

use crate::clip::Clip;
use crate::failure::Failure;
use crate::output;

/// Most materials that are named.
const NAMED: usize = 5;

/// A clip of which pictures are to be made: with light, if need be that of a default sky.
pub(crate) fn for_pictures(clip: Clip) -> Result<Clip, Failure> {
    let clip = clip.lit()?;
    required(&clip.scene)?;
    Ok(clip)
}

/// An error if nothing in a scene ever emits.
pub(crate) fn required(scene: &Scene) -> Result<(), Failure> {
    if scene.emits() {
        return Ok(());
    }
    let mut used: Vec<usize> = scene.patches.iter().map(|p| p.material.0 as usize).collect();
    used.sort_unstable();
    used.dedup();
    let quoted = |&m: &usize| format!("`{}`", output::name(&scene.materials[m].name));
    let mut names: Vec<String> = used.iter().take(NAMED).map(quoted).collect();
    if used.len() > NAMED {
        names.push("... (`relume info` lists all)".to_owned());
    }
    let what = format!(
        "nothing in {} emits light, so there is nothing to solve",
        output::name(&scene.name)
    );
    Err(Failure::new(what).help(format_args!(
        "light it with --sky uniform=1, or make a material shine with --emit MATERIAL=RADIANCE (W/m2/sr), such as one \
         of {}; or add a light or an emitting material to the file",
        names.join(", ")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::DemoScene;
    use crate::demo;

    #[test]
    fn a_scene_without_light_is_refused_with_its_materials() {
        let mut scene = (demo::demo(DemoScene::Room).build)().unwrap();
        assert_eq!(required(&scene), Ok(()));
        for material in &mut scene.materials {
            (material.exitance, material.glow) = ([0.0; 3], None);
        }
        let text = required(&scene).unwrap_err().to_string();
        assert!(text.contains("nothing in room emits light"), "{text}");
        assert!(text.contains("--emit MATERIAL=RADIANCE (W/m2/sr), such as one of `"), "{text}");
    }
}
