//! What is likely wrong with a scene: each finding with a name, a count and a remedy.
//!
//! Looks at the scene as it is at time 0 and changes nothing. What was noticed while reading (what
//! is degenerate, skinned, clamped, left out) is in [`Scene::notes`] and not repeated here. Must
//! not know light transport.

use std::collections::{BTreeMap, BTreeSet};

use super::{Material, MaterialId, Note, Patch, Scene, Severity};
use crate::scene::tuning::{DIAGONAL_M, EXITANCE_HIGH, REFLECTANCE_HIGH, SUN_HIGH};

mod blind;
#[cfg(test)]
mod draw;
mod enclosing;
mod outward;
mod shape;
mod world;

/// Finds what is likely wrong, the most serious first.
///
/// | code | severity | what |
/// |---|---|---|
/// | `nothing-emits` | error | no emitting surface and no light |
/// | `open-enclosure` | warning, info | gaps in what encloses the scene; nothing encloses it |
/// | `open-object` | info | an object within it that is not closed |
/// | `flipped-normals` | warning | neighbours that face opposite ways; an object that faces against all around it, a wall that faces out of its room; closed objects inside out; what shows only backs to the room it is in |
/// | `duplicate` | warning | polygons that coincide |
/// | `overlap` | warning | polygons that face the same way and overlap in one plane |
/// | `touching` | info | double-sided polygons back to back |
/// | `non-planar` | info | triangles that are nearly, but not quite, in one plane |
/// | `reflectance` | warning | a reflectance of 0.95 or more |
/// | `light-lost` | warning, info | lights and lamps that light nothing: something is in their way; only the inside of what is closed around them |
/// | `units` | warning | a size or a brightness that suggests a mistaken unit |
///
/// O(n log n) in the number of polygons, where sides are short beside the scene, and O(n) for each light:
/// a ray or a few, a few hundred for those that light nothing.
pub fn check(scene: &Scene) -> Vec<Note> {
    let mut notes = Vec::new();
    emission(scene, &mut notes);
    // What is outside is as it should be.
    let near = scene.outside.as_ref().map(|_| scene.without_outside());
    let scene = near.as_ref().unwrap_or(scene);
    reflectance(scene, &mut notes);
    units(scene, &mut notes);
    shape::shape(scene, &mut notes);
    outward::outward(scene, &mut notes);
    enclosing::enclosing(scene, &mut notes);
    blind::blind(scene, &mut notes);
    notes.sort_by_key(|n| std::cmp::Reverse(n.severity));
    notes
}

fn note(
    severity: Severity,
    code: &'static str,
    subject: &str,
    count: usize,
    message: String,
) -> Note {
    Note { severity, code, subject: subject.to_owned(), count, message }
}

/// The largest channel of each material in use over its patches, and how many patches it has.
fn highest(
    scene: &Scene,
    of: impl Fn(&Patch) -> [f64; 3],
) -> impl Iterator<Item = (&Material, (f64, usize))> {
    let mut highest: BTreeMap<MaterialId, (f64, usize)> = BTreeMap::new();
    for patch in &scene.patches {
        let (most, count) = highest.entry(patch.material).or_default();
        *most = of(patch).into_iter().fold(*most, f64::max);
        *count += 1;
    }
    highest.into_iter().map(|(m, found)| (&scene.materials[m.0 as usize], found))
}

fn emission(scene: &Scene, notes: &mut Vec<Note>) {
    let glows = scene.patches.iter().any(|p| scene.patch_emits(p));
    let shines = scene.lights.iter().any(|l| l.most_intensity().iter().any(|&i| i > 0.0));
    if !glows && !shines {
        let message = "nothing emits light, so every picture is black; give a material an emission \
                       (emissiveFactor) or add a point, spot or sun light (area lights are not exported to glTF: \
                       use an emitting polygon), or light it from outside (`Scene::with_outside`)";
        notes.push(note(Severity::Error, "nothing-emits", &scene.name, 0, message.to_owned()));
    }
}

fn reflectance(scene: &Scene, notes: &mut Vec<Note>) {
    let all = highest(scene, |patch| scene.reflectance(patch));
    let high: Vec<_> = all.filter(|(_, (most, _))| *most >= REFLECTANCE_HIGH).collect();
    let Some((first, _)) = high.first() else { return };
    let names: BTreeSet<&str> = high[1..].iter().map(|(m, _)| m.name.as_str()).collect();
    let (most, count) = high.iter().fold((0.0, 0), |(most, n), (_, of)| (of.0.max(most), n + of.1));
    let others = match names.is_empty() {
        true => String::new(),
        false => format!(" (so high, too: {})", listed(&names)),
    };
    let message = format!(
        "it reflects up to {most:.3} of the light{others}: the balance needs many sweeps and small errors grow; \
         real paints stay below 0.9, so lower the base colour"
    );
    notes.push(note(Severity::Warning, "reflectance", &first.name, count, message));
}

fn units(scene: &Scene, notes: &mut Vec<Note>) {
    if let Some(bounds) = scene.bounds(0.0) {
        let diagonal = bounds.diagonal();
        if !(DIAGONAL_M.0..=DIAGONAL_M.1).contains(&diagonal) {
            let message = format!(
                "the scene is {diagonal:.3e} m across; glTF is in metres, so check the unit scale of the export"
            );
            notes.push(note(Severity::Warning, "units", &scene.name, 1, message));
        }
    }
    for (material, (brightest, count)) in highest(scene, |patch| scene.most_exitance(patch)) {
        if brightest > EXITANCE_HIGH {
            let message = format!(
                "it emits {brightest:.3e} W/m2, more than a glowing filament; check the emission strength"
            );
            notes.push(note(Severity::Warning, "units", &material.name, count, message));
        }
    }
    for light in &scene.lights {
        let brightest = light.most_intensity().into_iter().fold(0.0, f64::max);
        if light.kind == super::LightKind::Directional && brightest > SUN_HIGH {
            let message =
                format!("it gives {brightest:.3e} W/m2, more than ten suns ({})", light.conversion);
            notes.push(note(Severity::Warning, "units", &light.name, 1, message));
        }
    }
}

/// Up to three names, for a sentence.
fn listed(names: &BTreeSet<&str>) -> String {
    let first: Vec<&str> = names.iter().take(3).copied().collect();
    match names.len().saturating_sub(3) {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

#[cfg(test)]
mod tests;
