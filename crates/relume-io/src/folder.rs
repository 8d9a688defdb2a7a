//! Files beside a scene file: in its own folder and below, unless more is allowed.
//!
//! Must not know what is in them.

use std::io::Read;
use std::path::{Path, PathBuf};

use crate::regular::{IRREGULAR_MAX_BYTES, irregular, not_regular, read_file, unless_fits};
use relume_core::scene::SceneError;

/// Where a scene file's other files are, and what of them may be read.
pub(super) struct Folder {
    /// The scene file, as the user named it.
    pub(super) file: String,
    pub(super) directory: PathBuf,
    /// Whether files may be anywhere, and be devices or pipes.
    pub(super) allow_outside: bool,
    /// Bytes that a file may need by itself.
    pub(super) max_memory_bytes: Option<u64>,
}

/// The bytes of a scene file and its name without ending, if they fit into so many bytes.
pub(super) fn read_scene(
    path: &Path,
    max_memory_bytes: Option<u64>,
) -> Result<(Vec<u8>, String), SceneError> {
    let file = path.display().to_string();
    let bytes = read_file(path, max_memory_bytes)?;
    unless_placeholder(&file, &bytes)?;
    Ok((bytes, path.file_stem().map_or(file, |s| s.to_string_lossy().into_owned())))
}

impl Folder {
    /// The bytes of a file, no more than `at_most`; `owner` says whose it is.
    pub(super) fn read(
        &self,
        name: &str,
        owner: &str,
        at_most: usize,
    ) -> Result<Vec<u8>, SceneError> {
        self.check(name, owner)?;
        let path = self.directory.join(name);
        let failed = |source| SceneError::Read {
            file: name.to_owned(),
            source,
            remedy: format!("it is {owner} of `{}`: put it beside that file", self.file),
        };
        // Before it is opened: opening a pipe waits for whoever writes to it.
        let known = std::fs::metadata(&path).map_err(failed)?;
        let what = irregular(known.file_type());
        if known.is_dir() {
            return Err(failed(not_regular("a directory")));
        }
        if let Some(what) = what.filter(|_| !self.allow_outside) {
            return Err(self.outside(format!("{owner} ({name}) is {what}, not a regular file")));
        }
        let at_most = at_most as u64;
        let bytes = known.len().min(at_most);
        unless_fits(&self.file, format_args!("{owner} ({name})"), bytes, self.max_memory_bytes)?;
        let file = std::fs::File::open(&path).map_err(failed)?;
        let mut bytes = Vec::new();
        match what {
            None => file.take(at_most).read_to_end(&mut bytes).map_err(failed)?,
            // Some never end.
            Some(_) => {
                let most = at_most.min(IRREGULAR_MAX_BYTES);
                file.take(most).read_to_end(&mut bytes).map_err(failed)?
            }
        };
        unless_placeholder(name, &bytes)?;
        Ok(bytes)
    }

    /// An error if a file may not be opened.
    pub(super) fn check(&self, name: &str, owner: &str) -> Result<(), SceneError> {
        if name.is_empty() {
            return Err(SceneError::Format {
                file: self.file.clone(),
                what: format!("{owner} names no file: its URI is empty"),
                remedy: "export it again, or name the file that holds it".into(),
            });
        }
        if leaves_folder(name) && !self.allow_outside {
            let what = format!("{owner} is outside the folder of the file ({name})");
            return Err(self.outside(what));
        }
        Ok(())
    }

    /// The error of what may be read only where more is allowed.
    pub(super) fn outside(&self, what: String) -> SceneError {
        SceneError::Outside {
            file: self.file.clone(),
            what,
            remedy: "put it beside the scene file, or read it all the same with `ImportOptions::allow_outside`"
                .into(),
        }
    }
}

/// The first bytes of what Git LFS leaves in place of a file.
const PLACEHOLDER: &[u8] = b"version https://git-lfs";

/// An error if bytes are what Git LFS leaves in place of a file that it was not asked for.
fn unless_placeholder(file: &str, bytes: &[u8]) -> Result<(), SceneError> {
    if !bytes.starts_with(PLACEHOLDER) {
        return Ok(());
    }
    Err(SceneError::Read {
        file: file.to_owned(),
        source: std::io::Error::other("it is a placeholder of Git LFS, not the file itself"),
        remedy: "fetch it with `git lfs pull`".into(),
    })
}

/// Whether a path leads out of the folder that it starts from: on any system, whichever this one is.
fn leaves_folder(name: &str) -> bool {
    let drive = name.as_bytes().get(1) == Some(&b':');
    let mut depth = 0_i64;
    let escapes = name.split(['/', '\\']).any(|part| {
        depth += match part {
            ".." => -1,
            "" | "." => 0,
            _ => 1,
        };
        depth < 0
    });
    drive || escapes || name.starts_with(['/', '\\'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_of_git_lfs_are_told_from_damaged_files() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("part.stl");
        std::fs::write(&path, "version https://git-lfs.github.com/spec/v1\noid sha256:75e4\n")
            .unwrap();
        let said = read_scene(&path, None).unwrap_err().to_string();
        assert!(said.contains("git lfs pull"), "{said}");
        std::fs::write(&path, "solid part\nendsolid part\n").unwrap();
        assert!(read_scene(&path, None).is_ok());
    }

    #[test]
    fn ways_out_of_a_folder_are_known_in_every_spelling() {
        for out in
            ["../a", "b/../../a", "/etc/passwd", "\\\\host\\a", "c:\\a", "C:a", "..\\a", ".."]
        {
            assert!(leaves_folder(out), "{out}");
        }
        for inside in ["a.bin", "b/../a.bin", "./a", "b//a", "..a", "a..b/c", "b/c/../../a"] {
            assert!(!leaves_folder(inside), "{inside}");
        }
    }
}
