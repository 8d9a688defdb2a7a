//! A scene from a file, or the message that says why not.

use std::path::Path;

use indicatif::HumanBytes;
use relume::scene::{ImportOptions, Note, Scene, SceneError, Severity, check, import};

use crate::args::AnimationFlag;
use crate::failure::Failure;
use crate::memory;
use crate::output;

/// Reads a scene.
pub(crate) fn load(path: &Path, animation: &AnimationFlag) -> Result<Scene, Failure> {
    let AnimationFlag { name, allow_outside, edits } = animation.clone();
    memory::at(format_args!("reading {}", path.display()));
    let max_memory_bytes = memory::limit_bytes();
    let edits = edits.edits();
    let options = ImportOptions { animation: name, allow_outside, max_memory_bytes, edits };
    let scene = import(path, &options).map_err(failure)?;
    memory::at(format_args!("preparing {}", path.display()));
    Ok(scene)
}

/// The message of a scene error, its remedy on a line of its own.
pub(crate) fn failure(error: SceneError) -> Failure {
    if let SceneError::TooLarge { file, what, needs_bytes, .. } = &error {
        let needs = HumanBytes(*needs_bytes);
        return memory::exceeded(&format!("`{file}`: {what} ({needs})"));
    }
    let text = error.to_string();
    let remedy = match &error {
        SceneError::Read { remedy, .. }
        | SceneError::Format { remedy, .. }
        | SceneError::Outside { remedy, .. }
        | SceneError::TooLarge { remedy, .. }
        | SceneError::View3d { remedy, .. }
        | SceneError::Extension { remedy, .. }
        | SceneError::Geometry { remedy, .. }
        | SceneError::Material { remedy, .. }
        | SceneError::Hierarchy { remedy, .. }
        | SceneError::NotRigid { remedy, .. }
        | SceneError::Animation { remedy, .. }
        | SceneError::Edit { remedy, .. }
        | SceneError::Empty { remedy, .. } => remedy,
    };
    match text.strip_suffix(remedy.as_str()) {
        Some(what) if !remedy.is_empty() => {
            Failure::new(what.trim_end_matches([' ', ';', ':'])).help(remedy)
        }
        _ => Failure::new(text),
    }
}

/// Says on stderr, before a scene is solved, what was noticed while reading, unless it is merely
/// worth knowing, and what `relume check` would call an error, an overlap or a
/// light that lights nothing.
pub(crate) fn warn(scene: &Scene) {
    warn_but_for(scene, &[]);
}

/// What `relume check` finds that is said before a scene is solved, errors aside.
const SAID_BEFORE: [&str; 2] = ["overlap", "light-lost"];

/// The same but for some codes that do not matter for what is to be done.
pub(crate) fn warn_but_for(scene: &Scene, codes: &[&str]) {
    let read = scene.notes.iter().filter(|note| note.severity > Severity::Info).cloned();
    let found = check(scene)
        .into_iter()
        .filter(|note| note.severity > Severity::Info)
        .filter(|note| note.severity == Severity::Error || SAID_BEFORE.contains(&note.code));
    for note in read.chain(found).filter(|note| !codes.contains(&note.code)) {
        // The run goes on, so it is no more than a warning here.
        output::complain(&line(&Note { severity: Severity::Warning, ..note }));
    }
}

/// One line about a note: severity, subject, message.
pub(crate) fn line(note: &Note) -> String {
    let severity = match note.severity {
        Severity::Info => "note",
        Severity::Warning => "warning",
        Severity::Error => "error",
    };
    let count = if note.count > 1 { format!(" ({} x)", note.count) } else { String::new() };
    let subject = if note.subject.is_empty() {
        String::new()
    } else {
        format!("{}: ", output::name(&note.subject))
    };
    output::one_line(&format!("{severity}[{}]: {subject}{}{count}", note.code, note.message))
}
