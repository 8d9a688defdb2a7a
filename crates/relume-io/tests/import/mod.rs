//! The importer against files: scenes that ship with the tests, files written here, broken ones,
//! and Debian's assimp-testmodels where it is installed.

// Tests may use clocks and whatever the platform offers.
#![allow(clippy::disallowed_methods)]

mod broken;
mod edits;
mod environment;
mod files;
mod gltf;
mod meshes;
mod motion;
mod packed;
mod shipped;
mod surfaces;
mod textures;

use std::path::{Path, PathBuf};

use self::gltf::Gltf;
use relume_core::scene::{Note, Scene, SceneError};
use relume_io::{ImportOptions, import};

fn read(path: &Path) -> Result<Scene, SceneError> {
    import(path, &ImportOptions::default())
}

/// The scene of a file that is written to a folder of its own.
fn scene_of(gltf: &Gltf) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    read(&gltf.write(folder.path(), "scene"))
}

fn with_code<'a>(notes: &'a [Note], code: &str) -> Vec<&'a Note> {
    notes.iter().filter(|n| n.code == code).collect()
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// A scene that the engine is tested with.
fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../relume-core/tests/data").join(name)
}
