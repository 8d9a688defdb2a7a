//! Bytes of the files that users name: of regular files alone, and no more than are allowed.
//!
//! Opening a pipe waits for whoever writes to it, and a device may never end. Must not know what is in files.

use std::fmt;
use std::fs::{File, FileType, Metadata};
use std::io::{self, Read};
use std::path::Path;

use relume_core::scene::SceneError;

/// Bytes of a file that are read at most where no limit is given: as many as a `.glb` file can have.
const FILE_MAX_BYTES: u64 = 1 << 32;

/// Bytes that are read of a device or a pipe at most, where those are allowed.
pub(crate) const IRREGULAR_MAX_BYTES: u64 = 1 << 28;

/// The bytes of a regular file; `max_memory_bytes` as [`ImportOptions::max_memory_bytes`](crate::ImportOptions::max_memory_bytes),
/// and 4 GiB without it.
///
/// # Errors
/// [`SceneError::Read`] where there is no such file, where it is a directory, a pipe, a socket or a device (which are not opened),
/// or larger than any that is read; [`SceneError::TooLarge`] where it needs more memory than is allowed.
pub fn read_file(path: &Path, max_memory_bytes: Option<u64>) -> Result<Vec<u8>, SceneError> {
    let file = path.display().to_string();
    let failed = |source| SceneError::Read {
        file: file.clone(),
        source,
        remedy: "check the path and its permissions".into(),
    };
    let known = std::fs::metadata(path).map_err(failed)?;
    if let Some(what) = irregular(known.file_type()) {
        return Err(SceneError::Read {
            file,
            source: not_regular(what),
            remedy: "give a file; what comes from elsewhere is written to one first".into(),
        });
    }
    unless_fits(&file, "the file", known.len(), max_memory_bytes)?;
    let at_most = max_memory_bytes.unwrap_or(FILE_MAX_BYTES);
    let opened = File::open(path).map_err(failed)?;
    read_up_to(opened, &known, at_most).map_err(failed)?.ok_or_else(|| SceneError::Read {
        file: file.clone(),
        source: io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("it has more than {at_most} bytes"),
        ),
        remedy: "split it, or export less".into(),
    })
}

/// An error if something of a file needs more bytes, by itself, than are allowed.
pub(super) fn unless_fits(
    file: &str,
    what: impl std::fmt::Display,
    needs_bytes: u64,
    limit_bytes: Option<u64>,
) -> Result<(), SceneError> {
    match limit_bytes {
        Some(limit_bytes) if needs_bytes > limit_bytes => Err(SceneError::TooLarge {
            file: file.to_owned(),
            what: what.to_string(),
            needs_bytes,
            limit_bytes,
            remedy: "raise `ImportOptions::max_memory_bytes`, or make the file smaller".into(),
        }),
        _ => Ok(()),
    }
}

/// What is no regular file, in words; `None` for what is one.
pub(crate) fn irregular(kind: FileType) -> Option<&'static str> {
    match kind {
        kind if kind.is_file() => None,
        kind if kind.is_dir() => Some("a directory"),
        kind => Some(special(kind)),
    }
}

#[cfg(unix)]
fn special(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match kind {
        kind if kind.is_fifo() => "a pipe",
        kind if kind.is_socket() => "a socket",
        kind if kind.is_char_device() || kind.is_block_device() => "a device",
        _ => "something else",
    }
}

#[cfg(not(unix))]
fn special(_: FileType) -> &'static str {
    "a device or a pipe"
}

/// The error of what is no regular file.
pub(crate) fn not_regular(what: impl fmt::Display) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, format!("it is {what}, not a regular file"))
}

/// All bytes of a file; `None` if there are more than so many.
pub(crate) fn read_up_to(
    file: File,
    known: &Metadata,
    at_most: u64,
) -> io::Result<Option<Vec<u8>>> {
    if known.is_file() && known.len() > at_most {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    // Some systems know no length of their own files.
    bytes.try_reserve_exact(known.len().min(at_most) as usize + 1)?;
    file.take(at_most.saturating_add(1)).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= at_most).then_some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_regular_file_is_refused_unopened() {
        let dir = tempfile::tempdir().unwrap();
        let said = |path: &Path| read_file(path, None).unwrap_err().to_string();
        assert!(said(dir.path()).contains("it is a directory, not a regular file"));
        assert!(said(&dir.path().join("none")).contains("check the path"));
        #[cfg(unix)]
        {
            let pipe = dir.path().join("pipe");
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            assert!(said(&pipe).contains("it is a pipe, not a regular file"));
            let socket = dir.path().join("socket");
            let _bound = std::os::unix::net::UnixListener::bind(&socket).unwrap();
            assert!(said(&socket).contains("it is a socket, not a regular file"));
            assert!(said(Path::new("/dev/zero")).contains("it is a device, not a regular file"));
            // Links are followed to what they name.
            let link = dir.path().join("link");
            std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
            assert!(said(&link).contains("a device"));
        }
    }

    #[test]
    fn no_more_is_read_than_is_allowed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        std::fs::write(&path, [7; 100]).unwrap();
        assert_eq!(read_file(&path, None).unwrap().len(), 100);
        assert_eq!(read_file(&path, Some(100)).unwrap().len(), 100);
        assert!(matches!(read_file(&path, Some(99)), Err(SceneError::TooLarge { .. })));
        let read = |at_most| {
            let file = File::open(&path).unwrap();
            let known = file.metadata().unwrap();
            read_up_to(file, &known, at_most).unwrap().map(|bytes| bytes.len())
        };
        assert_eq!((read(99), read(100), read(u64::MAX)), (None, Some(100), Some(100)));
        // A file with a hole in it takes no room, and would fill the memory.
        let hole = File::create(dir.path().join("hole")).unwrap();
        hole.set_len(FILE_MAX_BYTES + 1).unwrap();
        let said = read_file(&dir.path().join("hole"), None).unwrap_err().to_string();
        assert!(said.contains("more than 4294967296 bytes"), "{said}");
    }
}
