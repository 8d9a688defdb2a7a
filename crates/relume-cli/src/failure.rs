//! What ends a run early: one message, a remedy, an exit code.

use std::fmt;
use std::io;
use std::path::Path;

use crate::in_flags::in_flags;
use crate::text;

/// Exit code where `--max-memory` does not suffice.
const OUT_OF_MEMORY: u8 = 3;

/// An error as the user sees it.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Failure {
    message: String,
    help: Option<String>,
    exit_code: u8,
}

impl Failure {
    /// An error with exit code 1.
    pub(crate) fn new(message: impl fmt::Display) -> Failure {
        Failure { message: message.to_string(), help: None, exit_code: 1 }
    }

    /// A wrong command line: exit code 2, as for what the parser itself refuses.
    pub(crate) fn usage(message: impl fmt::Display) -> Failure {
        Failure { exit_code: 2, ..Failure::new(message) }
    }

    /// Ctrl-C: exit code 130, as shells expect.
    pub(crate) fn interrupted(message: impl fmt::Display) -> Failure {
        Failure { exit_code: 130, ..Failure::new(message) }
    }

    /// `--max-memory` is reached: exit code 3.
    pub(crate) fn out_of_memory(message: impl fmt::Display) -> Failure {
        Failure { exit_code: OUT_OF_MEMORY, ..Failure::new(message) }
    }

    /// Whether the memory allowed is what was missing.
    pub(crate) fn is_out_of_memory(&self) -> bool {
        self.exit_code == OUT_OF_MEMORY
    }

    /// Says what to do about it.
    pub(crate) fn help(self, help: impl fmt::Display) -> Failure {
        Failure { help: Some(help.to_string()), ..self }
    }

    /// A file or directory that could not be written.
    pub(crate) fn write(path: &Path, error: &io::Error) -> Failure {
        Failure::new(format_args!("cannot write {}: {}", path.display(), describe(error))).help(
            match error.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    "free some space, then run again with --resume"
                }
                _ => "choose another place, or check its permissions",
            },
        )
    }

    /// A file that could not be read.
    pub(crate) fn read(path: &Path, error: &io::Error) -> Failure {
        Failure::new(format_args!("cannot read `{}`: {}", path.display(), describe(error)))
            .help("check the path and its permissions")
    }

    /// The process's exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        self.exit_code
    }
}

/// The reason in words, without the number of the operating system.
fn describe(error: &io::Error) -> String {
    let text = error.to_string();
    let words = text.split(" (os error").next().unwrap_or(&text);
    let mut chars = words.chars();
    chars
        .next()
        .map_or_else(String::new, |first| first.to_lowercase().collect::<String>() + chars.as_str())
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let message = text::one_line(&in_flags(&self.message));
        if self.exit_code == 130 {
            write!(f, "{message}")?;
        } else {
            write!(f, "error: {message}")?;
        }
        match &self.help {
            Some(help) => write!(f, "\n  help: {}", text::one_line(&in_flags(help))),
            None => Ok(()),
        }
    }
}
