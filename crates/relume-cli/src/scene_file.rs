//! A scene from a file, or the message that says why not.

use std::fs;
use std::path::Path;

use clap::{Args, ValueEnum};
use indicatif::HumanBytes;
use relume::scene::{
    ImportOptions, Instants, Note, Scene, SceneError, Severity, check, import, read_file,
};

use crate::edits::EditFlags;
use crate::failure::Failure;
use crate::memory;
use crate::notes;
use crate::output;

/// `--deform`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum DeformFlag {
    /// One shape.
    #[default]
    Hold,
    /// A shape for each frame.
    Rebuild,
}

/// Which animation plays, what a scene may be read from, and what of it is changed.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct AnimationFlag {
    /// Name of the animation to play; if left out all of them together, but of those that move the same things the
    /// first alone.
    #[arg(long = "animation", value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Read buffers and images of a glTF file wherever they are: outside its folder, devices, pipes.
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// What becomes of meshes that change their shape (skins that bend, morph targets): `hold` keeps them in their shape at
    /// the start; `rebuild` makes each a body of its own at each of the frames, which costs as much memory, and most of a
    /// cold build of what it touches, a frame.
    #[arg(long, value_name = "HOW", value_enum, default_value_t = DeformFlag::Hold)]
    pub(crate) deform: DeformFlag,
    #[command(flatten)]
    pub(crate) edits: EditFlags,
}

impl AnimationFlag {
    /// What is changed of a scene, as on the command line, for reports.
    pub(crate) fn described(&self) -> Vec<String> {
        let rebuilt = (self.deform == DeformFlag::Rebuild).then(|| "--deform rebuild".to_owned());
        rebuilt.into_iter().chain(self.edits.described()).collect()
    }
}

/// Reads a scene; with its images, if it is for pictures. Meshes that change their shape are read at these instants, if they
/// are to be rebuilt.
pub(crate) fn load(
    path: &Path,
    animation: &AnimationFlag,
    pictures: bool,
    instants: Instants,
) -> Result<Scene, Failure> {
    let AnimationFlag { name, allow_outside, deform, edits } = animation.clone();
    let rebuild = (deform == DeformFlag::Rebuild).then_some(instants);
    memory::at(format_args!("reading {}", path.display()));
    let max_memory_bytes = memory::limit_bytes();
    let edits = edits.edits();
    let options = ImportOptions {
        animation: name,
        allow_outside,
        pictures,
        max_memory_bytes,
        rebuild,
        edits,
        near_origin: true,
    };
    let scene = import(path, &options).map_err(failure)?;
    memory::at(format_args!("preparing {}", path.display()));
    Ok(scene)
}

/// The bytes of a file, if there is room for them.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let reading = format_args!("reading {}", path.display());
    memory::at(reading);
    if let Ok(file) = fs::metadata(path) {
        memory::ask(file.len(), reading)?;
    }
    read_file(path, memory::limit_bytes()).map_err(|error| match error {
        SceneError::Read { source, remedy, .. } => Failure::read(path, &source).help(remedy),
        error => failure(error),
    })
}

/// The message of a scene error, its remedy on a line of its own.
pub(crate) fn failure(error: SceneError) -> Failure {
    if let SceneError::TooLarge { file, what, needs_bytes, .. } = &error {
        let needs = HumanBytes(*needs_bytes);
        return memory::exceeded(&format!("`{file}`: {what} ({needs})"));
    }
    let text = error.to_string();
    let remedy = error.remedy();
    match text.strip_suffix(remedy) {
        Some(what) if !remedy.is_empty() => {
            Failure::new(what.trim_end_matches([' ', ';', ':'])).help(remedy)
        }
        _ => Failure::new(text),
    }
}

/// Says on stderr, before a scene is solved, what was noticed while reading, unless it is merely
/// worth knowing, and what `relume check` would call an error, an overlap or a
/// light that lights nothing.
pub(crate) fn warn(scene: &Scene, verbose: bool) {
    warn_but_for(scene, verbose, &[]);
}

/// What `relume check` finds that is said before a scene is solved, errors aside.
const SAID_BEFORE: [&str; 2] = ["overlap", "light-lost"];

/// The same but for some codes that do not matter for what is to be done.
pub(crate) fn warn_but_for(scene: &Scene, verbose: bool, codes: &[&str]) {
    let read = scene.notes.iter().filter(|note| note.severity > Severity::Info).cloned();
    let found = check(scene)
        .into_iter()
        .filter(|note| note.severity > Severity::Info)
        .filter(|note| note.severity == Severity::Error || SAID_BEFORE.contains(&note.code));
    // The run goes on, so it is no more than a warning here.
    let said = read.chain(found).filter(|note| !codes.contains(&note.code));
    let said: Vec<Note> = said.map(|note| Note { severity: Severity::Warning, ..note }).collect();
    notes::lines(&said, verbose).iter().for_each(|line| output::complain(line));
}
