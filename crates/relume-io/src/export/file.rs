//! Files that appear whole or not at all.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Writes `bytes` to `path`: to a temporary file in the same directory first, which then takes the
/// place of `path` in one step.
///
/// A reader sees the old content or the new one, never a part. On failure the temporary file is
/// removed and whatever stood at `path` stays. A symbolic link is followed; what is neither a file
/// nor a directory (a device, a pipe) is written to as it is.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = WholeFile::create(path)?;
    file.write_all(bytes)?;
    file.finish()
}

/// Temporary files that are not in their places yet: where that is, and how many of their bytes are
/// to appear there should the process end before they are finished.
static UNFINISHED: Mutex<BTreeMap<PathBuf, (PathBuf, Option<u64>)>> = Mutex::new(BTreeMap::new());

fn unfinished() -> MutexGuard<'static, BTreeMap<PathBuf, (PathBuf, Option<u64>)>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Before a process ends in the middle of its work: puts what [`WholeFile::keep_so_far`] has kept into
/// its place and takes other temporary files away. Files written afterwards are lost.
pub fn settle_unfinished() {
    for (temporary, (path, kept)) in std::mem::take(&mut *unfinished()) {
        let keep = |length: u64| {
            fs::OpenOptions::new().write(true).open(&temporary)?.set_len(length)?;
            fs::rename(&temporary, &path)
        };
        // Best effort: nobody is left to be told.
        if kept.is_none_or(|length| keep(length).is_err()) {
            let _ = fs::remove_file(&temporary);
        }
    }
}

/// A file that is written piece by piece and appears when it is finished, as
/// [`write_atomically`] has it; one that is dropped before leaves nothing behind.
#[derive(Debug)]
pub struct WholeFile {
    file: BufWriter<fs::File>,
    /// The temporary file, and the place it is to take; `None` for devices and when done.
    places: Option<(PathBuf, PathBuf)>,
}

impl WholeFile {
    /// Starts a file that will stand at `path`.
    pub fn create(path: &Path) -> io::Result<WholeFile> {
        let target = fs::canonicalize(path);
        let path = target.as_deref().unwrap_or(path);
        if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let file = BufWriter::new(fs::OpenOptions::new().write(true).open(path)?);
            return Ok(WholeFile { file, places: None });
        }
        let temporary = temporary_beside(path)?;
        // Held, so that no file is there that a process that ends does not know of.
        let mut unfinished = unfinished();
        let file = BufWriter::new(fs::File::create_new(&temporary)?);
        unfinished.insert(temporary.clone(), (path.to_owned(), None));
        Ok(WholeFile { file, places: Some((temporary, path.to_owned())) })
    }

    /// What is written so far is of use by itself: it appears also if the process ends before the file
    /// is finished, by way of [`settle_unfinished`].
    pub fn keep_so_far(&mut self) -> io::Result<()> {
        self.file.flush()?;
        let length = self.file.stream_position()?;
        if let Some((temporary, _)) = &self.places
            && let Some((_, kept)) = unfinished().get_mut(temporary)
        {
            *kept = Some(length);
        }
        Ok(())
    }

    /// Puts the file into its place.
    pub fn finish(mut self) -> io::Result<()> {
        self.file.flush()?;
        if let Some((temporary, path)) = &self.places {
            let mut unfinished = unfinished();
            fs::rename(temporary, path)?;
            unfinished.remove(temporary);
            drop(unfinished);
            self.places = None;
        }
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if let Some((temporary, _)) = &self.places {
            // Best effort: the error that matters is the one that kept it from being finished.
            let mut unfinished = unfinished();
            if unfinished.remove(temporary).is_some() {
                let _ = fs::remove_file(temporary);
            }
        }
    }
}

/// Takes away temporary files that processes left in a folder when they were killed, of files whose names `is_of` says. Nobody else
/// may be writing these there.
pub fn remove_remains(dir: &Path, is_of: &dyn Fn(&str) -> bool) {
    let Ok(entries) = fs::read_dir(dir) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        if name.to_str().and_then(place_of).is_some_and(is_of) {
            // Best effort: what is left does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Name of the file that a temporary one was to become, from the name that [`temporary_beside`] gave it.
fn place_of(temporary: &str) -> Option<&str> {
    let (name, numbers) = temporary.strip_prefix('.')?.strip_suffix(".tmp")?.rsplit_once('.')?;
    let (process, count) = numbers.split_once('-')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    (is_number(process) && is_number(count)).then_some(name)
}

/// Whether [`write_atomically`] could write to `path` now: makes a temporary file beside it and
/// takes it away again.
pub fn probe(path: &Path) -> io::Result<()> {
    let target = fs::canonicalize(path);
    let path = target.as_deref().unwrap_or(path);
    match fs::metadata(path) {
        Ok(m) if m.is_dir() => return Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(m) if !m.is_file() => return Ok(()),
        _ => {}
    }
    let temporary = temporary_beside(path)?;
    fs::File::create_new(&temporary)?;
    fs::remove_file(&temporary)
}

/// A name in the directory of `path` that no other write uses: hidden, with the process's id and a
/// counter.
fn temporary_beside(path: &Path) -> io::Result<PathBuf> {
    static COUNTER: AtomicU32 = AtomicU32::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "this is not a file name"))?;
    let count = COUNTER.fetch_add(1, Ordering::Relaxed);
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}-{count}.tmp", std::process::id()));
    Ok(path.with_file_name(hidden))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(dir)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn what_killed_processes_left_is_taken_away_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let all = [
            ".a.txt.12-0.tmp",
            ".a.txt.tmp",
            ".a.txt.x-0.tmp",
            ".b.txt.12-0.tmp",
            "a.txt",
            "a.txt.12-0.tmp",
        ];
        all.iter().for_each(|name| fs::write(dir.path().join(name), "x").unwrap());
        remove_remains(dir.path(), &|name| name == "a.txt");
        assert_eq!(names(dir.path()), all[1..]);
    }

    #[test]
    fn replaces_and_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_atomically(&path, b"one").unwrap();
        write_atomically(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn a_file_that_is_not_finished_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let mut half = WholeFile::create(&path).unwrap();
        half.write_all(b"half of the ").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        drop(half);
        assert_eq!(
            (fs::read(&path).unwrap().as_slice(), names(dir.path())),
            (&b"old"[..], vec!["a.txt".into()])
        );
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_stay_devices() {
        let dir = tempfile::tempdir().unwrap();
        let (file, link) = (dir.path().join("file"), dir.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let null = Path::new("/dev/null");
        write_atomically(null, b"x").unwrap();
        assert!(!fs::metadata(null).unwrap().is_file());
        assert!(probe(null).is_ok() && probe(&file).is_ok() && probe(dir.path()).is_err());
        assert_eq!(names(dir.path()), ["file", "link"]);
    }

    #[test]
    fn failure_leaves_the_target_alone() {
        let dir = tempfile::tempdir().unwrap();
        // A directory cannot be replaced by a file.
        let path = dir.path().join("taken");
        fs::create_dir(&path).unwrap();
        assert!(write_atomically(&path, b"x").is_err());
        assert_eq!(names(dir.path()), ["taken"]);
        assert!(write_atomically(&dir.path().join("no/where"), b"x").is_err());
        assert!(write_atomically(Path::new("/"), b"x").is_err());
    }
}
