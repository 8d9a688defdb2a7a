//! One run at a time in a folder, and at a file.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use relume::export::{probe, remove_remains};

use crate::failure::Failure;

/// How often the number of the run that holds a lock is looked for, at most.
const LOOKS: u32 = 100;

/// Time between two of these looks.
const BETWEEN_LOOKS: Duration = Duration::from_millis(10);

/// Files of the locks that are held.
static HELD: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Held while a run writes into a folder or a file. The system lets go of it when the process ends, however it
/// does; the file that is left behind then locks nothing.
pub(crate) struct Lock {
    _file: File,
    path: PathBuf,
}

impl Lock {
    /// Takes the lock of a folder, or says who has it.
    pub(crate) fn take(dir: &Path) -> Result<Lock, Failure> {
        let lock = Lock::at(dir.join(".relume.lock"), dir)?;
        remove_remains(dir, &is_named_by_runs);
        nothing_in_the_way(dir).map(|()| lock)
    }

    /// Takes the lock of a file that will be written, once it is known that it can be, or says who has it. A device has none,
    /// and neither has what only runs write into their folder, which has one itself.
    pub(crate) fn of_file(path: &Path) -> Result<Option<Lock>, Failure> {
        probe(path).map_err(|error| Failure::write(path, &error))?;
        let target = fs::canonicalize(path);
        let file = target.as_deref().unwrap_or(path);
        let is_other = fs::metadata(file).is_ok_and(|known| !known.is_file());
        let name = file.file_name().and_then(|name| name.to_str());
        let Some(name) = name.filter(|name| !is_other && !is_named_by_runs(name)) else {
            return Ok(None);
        };
        let lock = Lock::at(file.with_file_name(format!(".{name}.lock")), path)?;
        let dir = file.parent().filter(|dir| *dir != Path::new("")).unwrap_or(Path::new("."));
        remove_remains(dir, &|remains| remains == name);
        Ok(Some(lock))
    }

    /// Takes the lock at a path; `of` is what it is for.
    fn at(path: PathBuf, of: &Path) -> Result<Lock, Failure> {
        loop {
            let mut options = OpenOptions::new();
            options.read(true).write(true).create(true).truncate(false);
            let mut file = options.open(&path).map_err(|error| Failure::write(&path, &error))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(taken(of, &mut file)),
                // A file system without locks: nothing can be promised there.
                Err(TryLockError::Error(_)) => return Ok(Lock { _file: file, path }),
            }
            // The run before may have taken the file away since it was opened.
            if !is_at(&file, &path) {
                continue;
            }
            let number = std::process::id().to_string();
            let written = file.set_len(0).and_then(|()| file.write_all(number.as_bytes()));
            written.map_err(|error| Failure::write(&path, &error))?;
            held().push(path.clone());
            return Ok(Lock { _file: file, path });
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // While it is locked still, so that nobody can have locked it in the meantime.
        let _ = fs::remove_file(&self.path);
        held().retain(|path| *path != self.path);
    }
}

fn held() -> MutexGuard<'static, Vec<PathBuf>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes the files of all locks away, in a process that is about to end.
pub(crate) fn leave() {
    held().drain(..).for_each(|path| drop(fs::remove_file(path)));
}

fn taken(of: &Path, file: &mut File) -> Failure {
    let mut number = String::new();
    // Who has only just taken it may not have written its number yet.
    for _ in 0..LOOKS {
        if !matches!(file.read_to_string(&mut number), Ok(0)) {
            break;
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
    let who = match number.trim() {
        "" => "another process".to_owned(),
        number => format!("process {number}"),
    };
    let help = match of.is_dir() {
        true => {
            "wait for it to end, or name another directory with -o, or another file with --report"
        }
        false => "wait for it to end, or name another file",
    };
    Failure::new(format_args!("{who} is writing to {}", of.display())).help(help)
}

/// An error where something other than a file has a name that a run gives its files: a pipe would take a picture only
/// once somebody reads it.
fn nothing_in_the_way(dir: &Path) -> Result<(), Failure> {
    let Ok(entries) = fs::read_dir(dir) else { return Ok(()) };
    let in_the_way = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| is_of_a_run(path) && fs::metadata(path).is_ok_and(|known| !known.is_file()));
    match in_the_way.min() {
        None => Ok(()),
        Some(path) => Err(Failure::new(format_args!("{} is not a file", path.display()))
            .help("move it away, or name another directory with -o")),
    }
}

/// Whether a path is that of a file that only runs write into their folder, which have its lock.
pub(crate) fn is_of_a_run(path: &Path) -> bool {
    path.file_name().and_then(|name| name.to_str()).is_some_and(is_named_by_runs)
}

fn is_named_by_runs(name: &str) -> bool {
    name == "report.json"
        || name == "preview.png"
        || (name.starts_with("frame-") && (name.ends_with(".png") || name.ends_with(".exr")))
}

/// Whether an open file is the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let inode = |m: fs::Metadata| (m.dev(), m.ino());
    file.metadata().map(inode).ok() == fs::metadata(path).map(inode).ok()
}

/// Elsewhere an open file cannot be taken away.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_run_in_a_folder_is_told_the_number_of_the_first() {
        let dir = tempfile::tempdir().unwrap();
        let first = Lock::take(dir.path()).unwrap();
        let message = Lock::take(dir.path()).err().unwrap().to_string();
        assert!(message.contains(&format!("process {}", std::process::id())), "{message}");
        drop(first);
        drop(Lock::take(dir.path()).unwrap());
        assert!(!dir.path().join(".relume.lock").exists());
    }

    #[test]
    fn a_dead_run_leaves_no_lock_behind() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join(".relume.lock"), "12").unwrap();
        assert!(Lock::take(dir.path()).is_ok());
    }

    #[test]
    fn the_second_run_at_a_file_is_told_the_number_of_the_first() {
        let dir = tempfile::tempdir().unwrap();
        let table = dir.path().join("e.csv");
        let first = Lock::of_file(&table).unwrap();
        let message = Lock::of_file(&table).err().unwrap().to_string();
        assert!(message.contains(&format!("process {}", std::process::id())), "{message}");
        assert!(message.contains("e.csv"), "{message}");
        let _other = Lock::of_file(&dir.path().join("f.csv")).unwrap();
        drop(first);
        drop(Lock::of_file(&table).unwrap());
        assert!(!dir.path().join(".e.csv.lock").exists());
    }

    #[test]
    fn a_dead_run_leaves_no_lock_of_a_file_and_no_half_file_behind() {
        let dir = tempfile::tempdir().unwrap();
        let half = dir.path().join(".e.csv.12-3.tmp");
        fs::write(&half, "half").unwrap();
        fs::write(dir.path().join(".e.csv.lock"), "12").unwrap();
        let _lock = Lock::of_file(&dir.path().join("e.csv")).unwrap();
        assert!(!half.exists());
    }

    #[test]
    #[cfg(unix)]
    fn devices_are_anybodys() {
        let null = Path::new("/dev/null");
        let first = Lock::of_file(null).unwrap();
        assert!(first.is_none() && Lock::of_file(null).unwrap().is_none());
    }

    #[test]
    fn what_is_no_file_is_not_written_to() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("frame-0003.png")).unwrap();
        let message = Lock::take(dir.path()).err().unwrap().to_string();
        assert!(message.contains("frame-0003.png is not a file"), "{message}");
        assert!(!dir.path().join(".relume.lock").exists());
    }

    #[test]
    fn half_files_of_a_dead_run_are_taken_away() {
        let dir = tempfile::tempdir().unwrap();
        let names = [".report.json.12-3.tmp", ".frame-0007.png.12-4.tmp", ".notes.txt.12-5.tmp"];
        let paths = names.map(|name| dir.path().join(name));
        paths.iter().for_each(|path| fs::write(path, "half").unwrap());
        let _lock = Lock::take(dir.path()).unwrap();
        assert_eq!(paths.map(|path| path.exists()), [false, false, true]);
    }
}
