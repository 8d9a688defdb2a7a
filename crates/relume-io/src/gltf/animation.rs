//! Animations: keyframes of translation, rotation and presence for each node of the file, and of what
//! materials and lights emit.
//!
//! All animations play together unless one is chosen by name: exporters such as Blender's write
//! one for each object. Of those that move the same properties (a figure's walk and run) the first plays in which anything
//! moves (not a pose of one key, as figures at rest have), and the others are listed. Scale keys that only switch between nothing and one size become presence; what changes its size otherwise
//! is held at its first size, because it would not move rigidly.

use std::collections::BTreeSet;

use glam::{DQuat, DVec3};

use super::clock::Keys;
use super::document::Document;
use super::sizes::sizes;
use super::{json, node_name, note};
use relume_core::scene::check_track;
use relume_core::scene::{Glow, Interpolation, Note, RotationTrack, SceneError, Severity, Track};

/// Keyframes of one node of the file.
#[derive(Default)]
pub(super) struct Moves {
    pub(super) translation: Option<Track>,
    pub(super) rotation: Option<RotationTrack>,
    /// The one scale of all keys, or the one that is held, which replaces the node's.
    pub(super) scale: Option<DVec3>,
    /// How its scale changes, if it does, and what becomes of it.
    pub(super) growth: Option<String>,
    /// The weights of its mesh's morph targets, where keys say that they never change.
    pub(super) weights: Option<Vec<f64>>,
    /// The weights of its mesh's morph targets one by one, where they do change.
    pub(super) morphs: Vec<Track>,
    pub(super) presence: Vec<(f64, bool)>,
    pub(super) visibility: Vec<(f64, bool)>,
}

/// Keyframes of what a material or a light of the file emits.
#[derive(Clone, Default)]
pub(super) struct GlowKeys {
    pub(super) colour: Option<Track>,
    pub(super) strength: Option<Track>,
}

impl GlowKeys {
    /// With what does not change as a factor: of the colour, of the strength, and besides.
    pub(super) fn glow(
        &self,
        (colour, strength): ([f64; 3], f64),
        besides: [f64; 3],
    ) -> Option<Glow> {
        let tracks: Vec<Track> = self.colour.iter().chain(&self.strength).cloned().collect();
        let strength = if self.strength.is_some() { 1.0 } else { strength };
        let colour = if self.colour.is_some() { [1.0; 3] } else { colour };
        let scale = [0, 1, 2].map(|c| colour[c] * strength * besides[c]);
        (!tracks.is_empty()).then_some(Glow { scale, tracks })
    }
}

/// All that is animated.
pub(super) struct Played {
    /// Of each node.
    pub(super) moves: Vec<Moves>,
    /// Of each material.
    pub(super) materials: Vec<GlowKeys>,
    /// Of each light.
    pub(super) lights: Vec<GlowKeys>,
    /// The names of the animations that play.
    pub(super) names: Option<String>,
    /// The time of the last key of whatever plays, whether it changes anything or not.
    pub(super) end_s: f64,
}

/// What the animations of a file do, or the chosen one.
pub(super) fn played(
    document: &Document,
    chosen: Option<&str>,
    notes: &mut Vec<Note>,
) -> Result<Played, SceneError> {
    let names: Vec<String> =
        document.root.animations.iter().enumerate().map(|(i, a)| name_of(i, a)).collect();
    if let Some(wanted) = chosen
        && !names.iter().any(|n| n == wanted)
    {
        let there = if names.is_empty() {
            "it has none".to_owned()
        } else {
            format!("it has {}", names.join(", "))
        };
        return Err(SceneError::Animation {
            animation: wanted.to_owned(),
            what: format!("`{}` has no animation of this name", document.file),
            remedy: format!("choose one that is there ({there}), or none to play all together"),
        });
    }
    let lights = document.root.extensions.lights.as_ref().map_or(0, |l| l.lights.len());
    let mut played = Played {
        moves: document.root.nodes.iter().map(|_| Moves::default()).collect(),
        materials: vec![GlowKeys::default(); document.root.materials.len()],
        lights: vec![GlowKeys::default(); lights],
        names: None,
        end_s: 0.0,
    };
    let playing: Vec<usize> = match chosen {
        Some(wanted) => names.iter().position(|n| n == wanted).into_iter().collect(),
        None => first_of_each_kind(document, &names, notes),
    };
    for &index in &playing {
        let (animation, name) = (&document.root.animations[index], &names[index]);
        for channel in &animation.channels {
            Reader { document, animation, name }.channel(channel, &mut played, notes)?;
        }
    }
    let playing: Vec<&str> = playing.iter().map(|&index| names[index].as_str()).collect();
    played.names = (!playing.is_empty()).then(|| playing.join(", "));
    Ok(played)
}

/// Of each set of animations that have nothing to do with the others the first in which anything moves, or the first, with
/// a note that lists the rest.
fn first_of_each_kind(document: &Document, names: &[String], notes: &mut Vec<Note>) -> Vec<usize> {
    let mut kinds: Vec<(Vec<usize>, BTreeSet<String>)> = Vec::new();
    for (index, animation) in document.root.animations.iter().enumerate() {
        let mut members = vec![index];
        let mut moved: BTreeSet<String> =
            animation.channels.iter().filter_map(moved_property).collect();
        kinds.retain(|(others, of_others)| {
            let alike = !of_others.is_disjoint(&moved);
            if alike {
                members.extend(others);
                moved.extend(of_others.iter().cloned());
            }
            !alike
        });
        members.sort_unstable();
        kinds.push((members, moved));
    }
    let moves = |&&index: &&usize| anything_moves(document, &document.root.animations[index]);
    let first = |(members, _): &(Vec<usize>, _)| match members.len() {
        1 => members[0],
        _ => *members.iter().find(moves).unwrap_or(&members[0]),
    };
    let mut playing: Vec<usize> = kinds.iter().map(first).collect();
    playing.sort_unstable();
    let others: Vec<&str> = (0..names.len())
        .filter(|index| !playing.contains(index))
        .map(|index| names[index].as_str())
        .collect();
    if let (Some(&first), false) = (playing.first(), others.is_empty()) {
        let message = format!(
            "of the animations that move the same objects the first that changes anything plays; {} others do not: {}; choose \
             one by name",
            others.len(),
            others.join(", ")
        );
        notes.push(note(Severity::Info, "other-animations", &names[first], 1, message));
    }
    playing
}

/// Whether any value of an animation changes from key to key. What cannot be read counts as moving: whoever plays it says
/// why.
fn anything_moves(document: &Document, animation: &json::Animation) -> bool {
    animation.channels.iter().any(|channel| {
        let Some(sampler) = animation.samplers.get(channel.sampler) else { return true };
        let values = match channel.target.path.as_str() {
            "rotation" => document.numbers::<4>(sampler.output, "").map(|v| v.into_flattened()),
            "translation" | "scale" => {
                document.numbers::<3>(sampler.output, "").map(|v| v.into_flattened())
            }
            // Of other properties any number of values belongs to a key.
            _ => return true,
        };
        let keys = document.root.accessors.get(sampler.input).map_or(0, |times| times.count);
        let Ok(values) = values else { return true };
        let cubic = sampler.interpolation.as_deref() == Some("CUBICSPLINE");
        keys == 0 || !is_constant(&values, keys, cubic)
    })
}

/// Whether keys are all the same, up to rounding; of cubic ones tangents are 0.
fn is_constant(values: &[f64], keys: usize, cubic: bool) -> bool {
    let per_key = values.len() / keys;
    let part = if cubic { per_key / 3 } else { per_key };
    if part == 0 {
        return false;
    }
    let most = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let same = |a: f64, b: f64| (a - b).abs() <= SAME_VALUE * most;
    let value_of = |key: &'_ [f64]| if cubic { key[part..2 * part].to_vec() } else { key.to_vec() };
    let first = value_of(&values[..per_key]);
    values.chunks_exact(per_key).all(|key| {
        let tangents = if cubic { [&key[..part], &key[2 * part..]] } else { [&key[..0]; 2] };
        value_of(key).iter().zip(&first).all(|(&a, &b)| same(a, b))
            && tangents.into_iter().flatten().all(|&t| t == 0.0)
    })
}

/// Values of keys that differ by less than this share of the largest are the same.
const SAME_VALUE: f64 = 1e-6;

/// What a channel changes, as a pointer.
fn moved_property(channel: &json::Channel) -> Option<String> {
    let target = &channel.target;
    match (target.path.as_str(), &target.extensions.pointer) {
        ("pointer", pointer) => pointer.as_ref().map(|p| p.pointer.clone()),
        (path, _) => target.node.map(|node| format!("/nodes/{node}/{path}")),
    }
}

fn name_of(index: usize, animation: &json::Animation) -> String {
    animation.name.clone().filter(|n| !n.is_empty()).unwrap_or_else(|| format!("animation {index}"))
}

/// Reads the channels of one animation.
struct Reader<'a> {
    document: &'a Document,
    animation: &'a json::Animation,
    name: &'a str,
}

impl Reader<'_> {
    fn channel(
        &self,
        channel: &json::Channel,
        played: &mut Played,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        if channel.target.path == "pointer" {
            return self.pointer(channel, played, notes);
        }
        let Some(node) = channel.target.node else { return Ok(()) };
        self.of_node(channel, (node, channel.target.path.as_str()), played, notes)
    }

    /// Reads what a channel does with a property of a node.
    fn of_node(
        &self,
        channel: &json::Channel,
        (node, path): (usize, &str),
        played: &mut Played,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        let name = node_name(self.document, node);
        let of_node =
            played.moves.get_mut(node).ok_or_else(|| self.document.out_of_range("node", node))?;
        let taken = match path {
            "translation" => of_node.translation.is_some(),
            "rotation" => of_node.rotation.is_some(),
            "scale" => of_node.scale.is_some(),
            "weights" => of_node.weights.is_some() || !of_node.morphs.is_empty(),
            other => {
                let what = format!("node `{name}` has an unknown animated property `{other}`");
                return Err(self.malformed(&what));
            }
        };
        if taken {
            notes.push(self.conflict(&name, path));
            return Ok(());
        }
        let keys = self.keys(channel, &name)?;
        played.end_s = played.end_s.max(keys.end_s());
        self.property(self.sampler(channel)?.output, path, &name, keys, of_node, notes)
    }

    /// Reads the keys of a translation, rotation or scale.
    fn property(
        &self,
        output: usize,
        path: &str,
        name: &str,
        keys: Keys,
        of_node: &mut Moves,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        let interpolation = keys.interpolation;
        match path {
            "translation" => {
                let values = self.vectors(output, name)?;
                let times_s = keys.into_times_s();
                of_node.translation = Some(Track { times_s, values, interpolation });
            }
            "rotation" => {
                let read = self.document.numbers::<4>(output, &self.owner(name))?;
                let values = read.into_iter().map(DQuat::from_array).collect();
                let times_s = keys.into_times_s();
                of_node.rotation = Some(RotationTrack { times_s, values, interpolation });
            }
            "weights" => {
                let read = self.document.numbers::<1>(output, &self.owner(name))?;
                let values: Vec<f64> = read.into_iter().map(|[v]| v).collect();
                of_node.weights = constant_weights(&keys, &values);
                if of_node.weights.is_none() {
                    of_node.morphs = weight_tracks(name, &keys, &values)?;
                }
            }
            _ => {
                let values = self.vectors(output, name)?;
                check_track(name, &keys.times_s, values.len(), interpolation)?;
                let sizes = sizes(&keys, &values);
                of_node.scale = Some(sizes.scale);
                of_node.growth = sizes.growth;
                if sizes.presence.iter().any(|k| !k.1) {
                    let message = "its scale of 0 is taken as absence".to_owned();
                    notes.push(note(Severity::Info, "presence", name, 1, message));
                    of_node.presence = sizes.presence;
                }
            }
        }
        Ok(())
    }

    fn conflict(&self, name: &str, property: &str) -> Note {
        let message = format!(
            "animation `{}` moves its {property} too; the first animation wins: choose one by name",
            self.name
        );
        note(Severity::Warning, "animation-conflict", name, 1, message)
    }

    /// KHR_animation_pointer: placement, weights and visibility of nodes and emission are read, anything
    /// else is noted.
    fn pointer(
        &self,
        channel: &json::Channel,
        played: &mut Played,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        let pointer = channel.target.extensions.pointer.as_ref().map_or("", |p| p.pointer.as_str());
        if let Some((of, property)) = emission(pointer) {
            return self.emission(channel, pointer, of, property, played, notes);
        }
        let of_node = pointer
            .strip_prefix("/nodes/")
            .and_then(|rest| rest.split_once('/'))
            .and_then(|(index, rest)| Some((index.parse::<usize>().ok()?, rest)));
        if let Some((node, path @ ("translation" | "rotation" | "scale" | "weights"))) = of_node {
            return self.of_node(channel, (node, path), played, notes);
        }
        let moves = &mut played.moves;
        let Some((node, "extensions/KHR_node_visibility/visible")) = of_node else {
            let message =
                format!("animation `{}` changes this over time, which is ignored", self.name);
            notes.push(note(Severity::Warning, "animation-pointer", pointer, 1, message));
            return Ok(());
        };
        let name = node_name(self.document, node);
        let of_node =
            moves.get_mut(node).ok_or_else(|| self.document.out_of_range("node", node))?;
        if of_node.visibility.is_empty() {
            let keys = self.keys(channel, &name)?;
            let shown =
                self.document.numbers::<1>(self.sampler(channel)?.output, &self.owner(&name))?;
            of_node.visibility =
                keys.onsets_s().into_iter().zip(shown.into_iter().map(|[v]| v != 0.0)).collect();
            played.end_s = played.end_s.max(keys.end_s());
        }
        Ok(())
    }

    /// Keys of what a material or a light emits.
    fn emission(
        &self,
        channel: &json::Channel,
        pointer: &str,
        of: Emitter,
        property: Property,
        played: &mut Played,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        let missing = |kind, index| self.document.out_of_range(kind, index);
        let keys = match of {
            Emitter::Material(k) => {
                played.materials.get_mut(k).ok_or_else(|| missing("material", k))
            }
            Emitter::Light(k) => played.lights.get_mut(k).ok_or_else(|| missing("light", k)),
        }?;
        let when = self.keys(channel, pointer)?;
        let output = self.sampler(channel)?.output;
        let owner = format!("animation `{}` of {pointer}", self.name);
        let (values, place) = match property {
            Property::Colour => {
                let read = self.document.numbers::<3>(output, &owner)?;
                (read.into_iter().map(DVec3::from_array).collect(), &mut keys.colour)
            }
            Property::Strength => {
                let read = self.document.numbers::<1>(output, &owner)?;
                (read.into_iter().map(|[v]| DVec3::splat(v)).collect(), &mut keys.strength)
            }
        };
        match place {
            Some(_) => notes.push(self.conflict(pointer, "emission")),
            None => {
                played.end_s = played.end_s.max(when.end_s());
                let interpolation = when.interpolation;
                *place = Some(Track { times_s: when.into_times_s(), values, interpolation });
            }
        }
        Ok(())
    }

    fn sampler(&self, channel: &json::Channel) -> Result<&json::Sampler, SceneError> {
        let sampler = self.animation.samplers.get(channel.sampler);
        sampler
            .ok_or_else(|| self.malformed(&format!("sampler {} does not exist", channel.sampler)))
    }

    fn keys(&self, channel: &json::Channel, of: &str) -> Result<Keys, SceneError> {
        let sampler = self.sampler(channel)?;
        let times = self.document.numbers::<1>(sampler.input, &self.owner(of))?;
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            Some(other) => {
                return Err(self.malformed(&format!("the interpolation `{other}` does not exist")));
            }
        };
        Keys::new(of, times.into_iter().map(|[t]| t).collect(), interpolation)
    }

    fn vectors(&self, accessor: usize, node: &str) -> Result<Vec<DVec3>, SceneError> {
        let read = self.document.numbers::<3>(accessor, &self.owner(node))?;
        Ok(read.into_iter().map(DVec3::from_array).collect())
    }

    fn owner(&self, of: &str) -> String {
        format!("animation `{}` of `{of}`", self.name)
    }

    fn malformed(&self, what: &str) -> SceneError {
        self.document.malformed(format!("animation `{}`: {what}", self.name))
    }
}

/// What emits, by its index in the file.
#[derive(Clone, Copy)]
enum Emitter {
    Material(usize),
    Light(usize),
}

/// What of its emission changes.
#[derive(Clone, Copy)]
enum Property {
    Colour,
    Strength,
}

/// The emission that a pointer points to.
fn emission(pointer: &str) -> Option<(Emitter, Property)> {
    let index_and_rest = |prefix: &str| {
        let (index, rest) = pointer.strip_prefix(prefix)?.split_once('/')?;
        Some((index.parse::<usize>().ok()?, rest))
    };
    if let Some((index, rest)) = index_and_rest("/materials/") {
        let property = match rest {
            "emissiveFactor" => Property::Colour,
            "extensions/KHR_materials_emissive_strength/emissiveStrength" => Property::Strength,
            _ => return None,
        };
        return Some((Emitter::Material(index), property));
    }
    let (index, rest) = index_and_rest("/extensions/KHR_lights_punctual/lights/")?;
    let property = match rest {
        "color" => Property::Colour,
        "intensity" => Property::Strength,
        _ => return None,
    };
    Some((Emitter::Light(index), property))
}

/// Keys of each weight by itself, in each of the three coordinates.
fn weight_tracks(name: &str, keys: &Keys, values: &[f64]) -> Result<Vec<Track>, SceneError> {
    let (times_s, interpolation) = (&keys.times_s, keys.interpolation);
    let rows = if interpolation == Interpolation::CubicSpline { 3 } else { 1 } * times_s.len();
    let count = values.len() / rows.max(1);
    // Of each key one value of every target, or so many rows of them.
    let of_target = |target: usize| -> Vec<DVec3> {
        values.chunks_exact(count).map(|row| DVec3::splat(row[target])).collect()
    };
    let track = |target: usize| {
        let values = of_target(target);
        check_track(name, times_s, values.len(), interpolation)?;
        Ok(Track { times_s: times_s.clone(), values, interpolation })
    };
    (0..count).map(track).collect()
}

/// The one set of weights of all keys, if it is one.
fn constant_weights(when: &Keys, values: &[f64]) -> Option<Vec<f64>> {
    let keys = when.times_s.len();
    let per_key = values.len() / keys.max(1);
    if values.is_empty() || !values.len().is_multiple_of(keys) {
        return None;
    }
    let mut sets = values.chunks(per_key);
    match when.interpolation {
        Interpolation::CubicSpline => {
            // In-tangents, values and out-tangents, each of all targets.
            let third = per_key / 3;
            let first = &values[third..2 * third];
            let still = |k: &[f64]| {
                k[third..2 * third] == *first
                    && k[..third].iter().chain(&k[2 * third..]).all(|&tangent| tangent == 0.0)
            };
            (per_key.is_multiple_of(3) && sets.all(still)).then(|| first.to_vec())
        }
        _ => sets.all(|k| *k == values[..per_key]).then(|| values[..per_key].to_vec()),
    }
}
