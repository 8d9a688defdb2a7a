//! Changes to a scene that somebody else made, between reading and building: what shines, what is left out.
//!
//! Names are those that the scene has in the end (and `relume info` lists), so that files and code are
//! edited alike. Must not know file formats.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use super::SceneError;
use super::draft::{Draft, Edits};
use super::limits::EMISSION_MAX;
use super::{Tint, TintId};

/// Most names that are listed where one is not found.
const NEAR: usize = 5;

/// Applies edits to a draft whose names are unique already.
///
/// # Errors
/// [`SceneError::Edit`] if a name fits nothing, or nothing is left; [`SceneError::Material`] for a radiance
/// that is negative or not finite, or a reflectance outside [0, 1).
pub(super) fn apply(draft: &mut Draft, edits: &Edits) -> Result<(), SceneError> {
    for pattern in &edits.hide {
        hide(draft, pattern)?;
    }
    if !edits.hide.is_empty() && draft.nodes.iter().all(|node| node.surfaces.is_empty()) {
        let what = "everything that could be lit is hidden".to_owned();
        return Err(SceneError::Edit { what, remedy: "hide less".into() });
    }
    for (pattern, radiance) in &edits.emit {
        let most = EMISSION_MAX / PI;
        if let Some(bad) = radiance.iter().find(|l| !(0.0..=most).contains(*l)) {
            let what = format!("its radiance is to be {bad} W/m2/sr");
            return Err(material_error(pattern, what, &format!("choose from 0 to {most:.1e}")));
        }
        for index in materials(draft, pattern)? {
            let material = &mut draft.materials[index];
            (material.exitance, material.glow) = (radiance.map(|l| PI * l), None);
            retint(draft, index, |tint| tint.emission = [1.0; 3]);
        }
    }
    for (pattern, reflectance) in &edits.reflect {
        if let Some(bad) = reflectance.iter().find(|r| !(**r >= 0.0 && (**r as f32) < 1.0)) {
            let what = format!("its reflectance is to be {bad}");
            let remedy = "choose each channel from 0 up to, but not including, 1";
            return Err(material_error(pattern, what, remedy));
        }
        for material in materials(draft, pattern)? {
            draft.materials[material].reflectance = *reflectance;
            retint(draft, material, |tint| tint.reflectance = *reflectance);
        }
    }
    Ok(())
}

/// Changes how the polygons of a material differ from it: those of others that look alike stay as they are.
fn retint(draft: &mut Draft, material: usize, change: impl Fn(&mut Tint)) {
    let mut changed: BTreeMap<TintId, TintId> = BTreeMap::new();
    let surfaces = draft.nodes.iter_mut().flat_map(|node| &mut node.surfaces);
    for surface in surfaces.filter(|surface| surface.material.0 as usize == material) {
        for tint in surface.tints.iter_mut().flatten() {
            *tint = *changed.entry(*tint).or_insert_with(|| {
                let mut new = draft.tints[tint.0 as usize];
                change(&mut new);
                draft.tints.push(new);
                TintId(draft.tints.len() as u32 - 1)
            });
        }
    }
}

fn material_error(name: &str, what: String, remedy: &str) -> SceneError {
    SceneError::Material { material: name.to_owned(), what, remedy: remedy.to_owned() }
}

/// Takes everything from the nodes that fit and those below them, or the surfaces that fit.
fn hide(draft: &mut Draft, pattern: &str) -> Result<(), SceneError> {
    let nodes: Vec<String> = draft.nodes.iter().map(|n| n.name.clone()).collect();
    let surfaces = draft.nodes.iter().flat_map(|n| &n.surfaces).filter_map(|s| s.name.clone());
    let surfaces: Vec<String> = surfaces.collect();
    let fitting_surfaces = fitting(&surfaces, pattern);
    let mut fits = fitting(&nodes, pattern);
    if fits.is_empty() && fitting_surfaces.is_empty() {
        // What hangs on joints is called by its mesh's node and the joint.
        fits = fitting(&nodes, &format!("{pattern}/*"));
    }
    if fits.is_empty() && fitting_surfaces.is_empty() {
        return Err(unknown("node", pattern, nodes.iter().chain(&surfaces)));
    }
    let mut hidden = vec![false; nodes.len()];
    fits.iter().for_each(|&node| hidden[node] = true);
    for (index, node) in draft.nodes.iter_mut().enumerate() {
        // Parents come before their children.
        hidden[index] |= node.parent.is_some_and(|parent| hidden[parent]);
        if hidden[index] {
            node.surfaces.clear();
        }
        let is_named = |name: &Option<String>| {
            name.as_ref().is_some_and(|n| fitting_surfaces.iter().any(|&k| surfaces[k] == *n))
        };
        node.surfaces.retain(|surface| !is_named(&surface.name));
    }
    draft.lights.retain(|light| !hidden[light.node.0 as usize]);
    draft.cameras.retain(|camera| !hidden[camera.node.0 as usize]);
    Ok(())
}

/// The materials that fit, by number.
fn materials(draft: &Draft, pattern: &str) -> Result<Vec<usize>, SceneError> {
    let names: Vec<String> = draft.materials.iter().map(|m| m.name.clone()).collect();
    match fitting(&names, pattern) {
        none if none.is_empty() => Err(unknown("material", pattern, names.iter())),
        some => Ok(some),
    }
}

/// Which of the names fit a pattern: the one that is the same, or all that its stars allow.
fn fitting(names: &[String], pattern: &str) -> Vec<usize> {
    match names.iter().position(|name| name == pattern) {
        Some(same) => vec![same],
        None => (0..names.len()).filter(|&k| fits(&names[k], pattern)).collect(),
    }
}

/// Whether a name is what a pattern says, `*` standing for any number of characters.
fn fits(name: &str, pattern: &str) -> bool {
    let mut pieces = pattern.split('*');
    let Some(mut rest) = pieces.next().and_then(|first| name.strip_prefix(first)) else {
        return false;
    };
    let Some(last) = pieces.next_back() else { return rest.is_empty() };
    for piece in pieces {
        match rest.find(piece) {
            Some(at) => rest = &rest[at + piece.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

/// Nothing has the name that was asked for.
fn unknown<'a>(kind: &str, pattern: &str, names: impl Iterator<Item = &'a String>) -> SceneError {
    let wanted = pattern.to_lowercase();
    let mut near: Vec<(f64, &String)> =
        names.map(|name| (strsim::jaro_winkler(&wanted, &name.to_lowercase()), name)).collect();
    // Stable: of names as near the one that comes first in the scene.
    near.sort_by(|one, other| other.0.total_cmp(&one.0));
    let listed: Vec<String> = near.iter().take(NEAR).map(|(_, name)| format!("`{name}`")).collect();
    let what = match near.len() {
        0 => format!("no {kind} is called `{pattern}`; the scene has none"),
        n if n <= NEAR => {
            format!("no {kind} is called `{pattern}`; there are {}", listed.join(", "))
        }
        n => format!("no {kind} of {n} is called `{pattern}`; near it are {}", listed.join(", ")),
    };
    let remedy = "use a name that `relume info` lists, with * for any characters".into();
    SceneError::Edit { what, remedy }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_characters() {
        for (name, pattern) in
            [("lamp", "lamp"), ("lamp", "*"), ("lamp 2", "lamp*"), ("a lamp", "*lamp")]
        {
            assert!(fits(name, pattern), "{name} {pattern}");
        }
        assert!(fits("ceiling lamp 12", "c*lamp*2") && fits("aba", "a*a") && fits("a", "a*"));
        for (name, pattern) in [("lamp", "lam"), ("lamp", "amp"), ("a", "a*a"), ("lamp", "l*q*p")] {
            assert!(!fits(name, pattern), "{name} {pattern}");
        }
    }

    #[test]
    fn a_name_with_a_star_in_it_is_itself() {
        let names = ["a*", "ab", "ac"].map(str::to_owned);
        assert_eq!(fitting(&names, "a*"), [0]);
        assert_eq!(fitting(&names, "a**"), [0, 1, 2]);
    }

    #[test]
    fn names_that_are_not_there_bring_those_that_are_near() {
        let names: Vec<String> =
            ["Wall_Red", "floor", "ceiling", "lamp", "door", "window"].map(str::to_owned).into();
        let text = unknown("material", "wall red", names.iter()).to_string();
        assert!(
            text.starts_with("no material of 6 is called `wall red`; near it are `Wall_Red`, "),
            "{text}"
        );
        assert!(text.ends_with("`relume info` lists, with * for any characters"), "{text}");
    }
}
