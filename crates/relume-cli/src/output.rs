//! What goes to stdout: the result, and nothing else.

use std::io::{self, Write};

use crate::failure::Failure;

/// Prints a result.
///
/// A reader that has gone away (`relume info scene.glb | head -1`) is no error.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::new(format_args!("cannot write to stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints a line to stderr; a closed stderr is no error.
pub(crate) fn complain(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// A count with thousands separated: 52,310.
pub(crate) fn count(n: u64) -> String {
    indicatif::HumanCount(n).to_string()
}

/// `1 frame`, `2 frames`.
pub(crate) fn counted(n: usize, one: &str) -> String {
    let plural = match one.strip_suffix("y") {
        _ if n == 1 => one.to_owned(),
        Some(stem) if one != "ray" => format!("{stem}ies"),
        _ if one.ends_with("ch") => format!("{one}es"),
        _ => format!("{one}s"),
    };
    format!("{} {plural}", count(n as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_read_as_words() {
        assert_eq!(counted(1, "patch"), "1 patch");
        assert_eq!(counted(12_345, "patch"), "12,345 patches");
        assert_eq!(counted(0, "body"), "0 bodies");
        assert_eq!(counted(2, "frame"), "2 frames");
    }
}
