//! The importer against real files: scenes that ship with the tests, and Debian's
//! assimp-testmodels where it is installed.

use std::path::{Path, PathBuf};

use relume::scene::{ImportOptions, Scene, SceneError, import};

fn read(path: &Path) -> Result<Scene, SceneError> {
    import(path, &ImportOptions::default())
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    for path in paths {
        match path.extension().and_then(|e| e.to_str()) {
            _ if path.is_dir() => files_below(&path, found),
            Some("gltf" | "glb") => found.push(path),
            _ => {}
        }
    }
}

#[test]
fn assimp_models_are_read_or_refused_in_words() {
    let folder = Path::new("/usr/share/assimp/models");
    let mut files = Vec::new();
    files_below(folder, &mut files);
    if files.is_empty() {
        println!("skipped: Debian's assimp-testmodels is not installed");
        return;
    }
    for file in &files {
        let name = file.strip_prefix(folder).unwrap_or(file).display();
        match read(file) {
            Ok(scene) => {
                println!("{name}: {} bodies, {} patches", scene.bodies.len(), scene.patches.len());
                for n in &scene.notes {
                    println!(
                        "    {:?} {} {} x{}: {}",
                        n.severity, n.code, n.subject, n.count, n.message
                    );
                }
            }
            Err(e) => println!("{name}:\n    {e}"),
        }
    }
}
