//! Functions over 60 lines, of which there are none but those with a reason beside them.

use std::fs;

use crate::layers::{crates_dir, sources};

/// Most lines of a function, its head and its last brace among them.
const LINES_MAX: usize = 60;

/// Begins the line above a longer one, or above its attributes and documentation, and says why it is in one piece.
const REASON: &str = "// Over 60 lines: ";

/// Names and lengths of the functions of a file that are too long and have no reason beside them. A formatted file is
/// assumed: a function ends at the line that is as far in as its head and begins with a brace, in a macro too (`})*`).
fn long(text: &str) -> Vec<(String, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let Some(name) = function(line) else { continue };
        let indent = &line[..line.len() - line.trim_start().len()];
        let is_end = |l: &&str| l.strip_prefix(indent).is_some_and(|l| l.starts_with('}'));
        let one_line = line.ends_with('}') || line.ends_with(';');
        let length = 1 + lines[at..].iter().take_while(|line| !is_end(line)).count();
        let above = lines[..at].iter().rev();
        let beside = above.take_while(|l| l.trim_start().starts_with(['#', '/']));
        let has_reason = beside.clone().any(|l| l.trim_start().starts_with(REASON));
        if !one_line && length > LINES_MAX && !has_reason {
            found.push((name.to_owned(), length));
        }
    }
    found
}

/// The name of the function that begins on a line.
fn function(line: &str) -> Option<&str> {
    let (before, rest) = line.split_once("fn ")?;
    let is_word = |w: &str| ["const", "unsafe", "async"].contains(&w) || w.starts_with("pub");
    let is_head = before.split_whitespace().all(|w| is_word(w) || w.ends_with(')'));
    let end = rest.find(['(', '<'])?;
    (is_head && end > 0).then_some(&rest[..end])
}

#[test]
fn functions_are_no_longer_than_sixty_lines() {
    let mut wrong = Vec::new();
    for file in sources(&crates_dir()) {
        let text = fs::read_to_string(&file).unwrap();
        let name = file.strip_prefix(crates_dir()).unwrap().display().to_string();
        wrong.extend(long(&text).iter().map(|(of, lines)| format!("{name}: {of}, {lines} lines")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_counter_finds_long_functions_and_reasons() {
    let function = |head: &str, lines: usize| {
        format!(
            "impl A {{\n{head}    pub(super) fn f(&self) {{\n{}    }}\n}}\n",
            "        x();\n".repeat(lines)
        )
    };
    assert_eq!(long(&function("", 58)), []);
    assert_eq!(long(&function("", 59)), [("f".to_owned(), 61)]);
    assert_eq!(
        long(&function("    /// Words.\n    // Over 60 lines: a list.\n    #[test]\n", 90)),
        []
    );
    let in_macro = format!(
        "macro_rules! m {{\n    ($($f:ident)*) => {{\n        $(#[test]\n        fn $f() {{\n{}        }})*\n    }};\n}}\n\nm! {{\n{}}}\n",
        "            x();\n".repeat(3),
        "    one\n".repeat(90)
    );
    assert_eq!(long(&in_macro), []);
}
