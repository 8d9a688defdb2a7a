//! Text as a terminal may see it, counts in words, and messages to stderr. Must not know what is said.

use std::io::{self, Write};

/// Longest line printed, characters.
const LINE_LENGTH: usize = 1_000;
/// Longest name printed within a line, characters.
const NAME_LENGTH: usize = 80;

/// Text of several lines as a terminal may see it: each as [`one_line`] has it.
pub(crate) fn lines(text: &str) -> String {
    text.split('\n').map(one_line).collect::<Vec<_>>().join("\n")
}

/// Text as a terminal may see it, on one line: what would steer the terminal or turn the direction
/// of writing is escaped, and what is too long is cut, names in backticks and the whole.
///
/// Names in files are anybody's: they must not move the cursor, imitate a message or hide one.
pub(crate) fn one_line(text: &str) -> String {
    let short: Vec<String> = text
        .split('`')
        .enumerate()
        .map(|(k, part)| if k % 2 == 1 { cut(part, NAME_LENGTH) } else { part.to_owned() })
        .collect();
    escaped(&cut(&short.join("`"), LINE_LENGTH))
}

/// A name from a file as a terminal may see it: escaped and cut.
pub(crate) fn name(text: &str) -> String {
    escaped(&cut(text, NAME_LENGTH))
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        let turns = matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}');
        if c.is_control() || turns {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// The beginning of a text, with a mark where it was cut.
fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}\u{2026}", &text[..end]),
        None => text.to_owned(),
    }
}

/// Prints a line to stderr; a closed stderr is no error.
pub(crate) fn complain(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", lines(text));
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
    fn names_cannot_steer_the_terminal_or_fill_it() {
        assert_eq!(one_line("wall\u{1b}[2J\r\n\u{202e}x"), "wall\\u{1b}[2J\\r\\n\\u{202e}x");
        assert_eq!(one_line("W\u{e4}nde, \u{58c1}"), "W\u{e4}nde, \u{58c1}");
        let long = format!("the node `{}` is skewed", "x".repeat(5_000));
        assert_eq!(one_line(&long), format!("the node `{}\u{2026}` is skewed", "x".repeat(80)));
        assert_eq!(one_line(&"y".repeat(5_000)).chars().count(), 1_001);
        assert_eq!(name(&"z".repeat(81)), format!("{}\u{2026}", "z".repeat(80)));
        assert_eq!(lines("a\n\u{7}b\n"), "a\n\\u{7}b\n");
    }

    #[test]
    fn counts_read_as_words() {
        assert_eq!(counted(1, "patch"), "1 patch");
        assert_eq!(counted(12_345, "patch"), "12,345 patches");
        assert_eq!(counted(0, "body"), "0 bodies");
        assert_eq!(counted(2, "frame"), "2 frames");
    }
}
