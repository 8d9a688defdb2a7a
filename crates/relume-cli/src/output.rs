//! What goes to stdout: the result, and nothing else. Tables go there or to a file.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use relume::export::WholeFile;

use crate::failure::Failure;
use crate::interrupt;
use crate::lock::Lock;
use crate::text::lines;

pub(crate) use crate::text::{complain, count, counted, name};

/// Prints a result.
///
/// A reader that has gone away (`relume info scene.glb | head -1`) is no error.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    print_bytes(lines(text).as_bytes())
}

/// Prints bytes as they are.
pub(crate) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::new(format_args!("cannot write to stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Where a table goes: a file, which appears when it is finished, or stdout, likewise at the end, so
/// that a run that fails has printed nothing.
pub(crate) enum Sink {
    /// A file, its path and its lock.
    File(WholeFile, PathBuf, Option<Lock>),
    /// What will be printed.
    Stdout(Vec<u8>),
}

impl Sink {
    /// A file at `path`, or stdout. That the file can be written is known from here on.
    pub(crate) fn open(path: Option<&Path>) -> Result<Sink, Failure> {
        let Some(path) = path else { return Ok(Sink::Stdout(Vec::new())) };
        if path.is_dir() {
            return Err(Failure::new(format_args!("{} is a directory", path.display()))
                .help("name a file with -o"));
        }
        let lock = Lock::of_file(path)?;
        let file = WholeFile::create(path).map_err(|error| Failure::write(path, &error))?;
        Ok(Sink::File(file, path.to_owned(), lock))
    }

    /// The message of a write that failed.
    pub(crate) fn failure(&self, error: &io::Error) -> Failure {
        match self {
            Sink::File(_, path, _) => Failure::write(path, error),
            Sink::Stdout(_) => Failure::new(format_args!("cannot write to stdout: {error}")),
        }
    }

    /// The rows so far are of use by themselves: a file holds them also if the run is ended.
    pub(crate) fn keep_so_far(&mut self) -> Result<(), Failure> {
        let kept = match self {
            Sink::File(file, ..) => file.keep_so_far(),
            Sink::Stdout(_) => Ok(()),
        };
        kept.map_err(|error| self.failure(&error))
    }

    /// Puts the file into its place, or prints.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let _guard = interrupt::writing();
        match self {
            Sink::File(file, path, _lock) => {
                file.finish().map_err(|error| Failure::write(&path, &error))
            }
            Sink::Stdout(bytes) => print_bytes(&bytes),
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Sink::File(file, ..) => file.write(bytes),
            Sink::Stdout(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
