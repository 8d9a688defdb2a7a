//! Notes about a scene as lines of text: many of one kind are one line, unless all are asked for.

use relume::scene::{Note, Severity};

use crate::in_flags::in_flags;
use crate::text;

/// As many of one kind are one line.
const MANY: usize = 3;
/// Names in such a line.
const NAMED: usize = 3;

/// The notes as lines, in the order in which the first of each kind stands.
pub(crate) fn lines(notes: &[Note], verbose: bool) -> Vec<String> {
    let mut kinds: Vec<((Severity, &str), Vec<&Note>)> = Vec::new();
    for note in notes {
        let kind = (note.severity, note.code);
        match kinds.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, alike)) => alike.push(note),
            None => kinds.push((kind, vec![note])),
        }
    }
    let of_kind = |alike: Vec<&Note>| match verbose || alike.len() < MANY {
        true => alike.iter().map(|note| line(note)).collect(),
        false => vec![folded(&alike)],
    };
    kinds.into_iter().flat_map(|(_, alike)| of_kind(alike)).collect()
}

/// One line about a note: severity, subject, message.
pub(crate) fn line(note: &Note) -> String {
    let count = if note.count > 1 { format!(" ({} x)", note.count) } else { String::new() };
    let subject = if note.subject.is_empty() {
        String::new()
    } else {
        format!("{}: ", text::name(&note.subject))
    };
    text::one_line(&format!("{}: {subject}{}{count}", head(note), in_flags(&note.message)))
}

/// One line about many notes of one kind: how many, whose they are, and what the first says.
fn folded(alike: &[&Note]) -> String {
    let first = alike[0];
    let mut names: Vec<String> = Vec::new();
    for note in alike {
        let name = text::name(&note.subject);
        if !name.is_empty() && !names.contains(&name) {
            names.push(name);
        }
    }
    let others = names.len().saturating_sub(NAMED);
    names.truncate(NAMED);
    let mut whose = names.join(", ");
    if others > 0 {
        whose += &format!(" and {others} more");
    }
    let same = alike.iter().all(|note| note.message == first.message);
    let of_first = if same { String::new() } else { format!(" ({})", text::name(&first.subject)) };
    let text = format!(
        "{} ({} of this kind, --verbose lists all): {whose}: {}{of_first}",
        head(first),
        alike.len(),
        in_flags(&first.message)
    );
    text::one_line(&text)
}

fn head(note: &Note) -> String {
    let severity = match note.severity {
        Severity::Info => "note",
        Severity::Warning => "warning",
        Severity::Error => "error",
    };
    format!("{severity}[{}]", note.code)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(code: &'static str, subject: &str, message: &str) -> Note {
        let (subject, message) = (subject.to_owned(), message.to_owned());
        Note { severity: Severity::Warning, code, subject, count: 1, message }
    }

    #[test]
    fn many_of_one_kind_are_one_line_with_the_first_names() {
        let walls: Vec<String> = (0..100).map(|k| format!("wall {k}")).collect();
        let mut notes: Vec<Note> = walls.iter().map(|w| note("open", w, "it is open")).collect();
        notes.insert(1, note("hidden", "door", "it is hidden"));
        assert_eq!(
            lines(&notes, false),
            [
                "warning[open] (100 of this kind, --verbose lists all): wall 0, wall 1, wall 2 and 97 more: it is open",
                "warning[hidden]: door: it is hidden"
            ]
        );
        assert_eq!(lines(&notes, true).len(), 101);
        assert_eq!(lines(&notes[..3], false).len(), 3, "two of a kind are two lines");
    }

    #[test]
    fn what_differs_is_said_of_the_first() {
        let notes = ["3 of 8", "1 of 9", "2 of 7"].map(|m| note("degenerate", "wall", m));
        assert!(lines(&notes, false)[0].ends_with(": wall: 3 of 8 (wall)"));
        let mut info = notes.to_vec();
        info[0].severity = Severity::Info;
        assert_eq!(lines(&info, false).len(), 3, "a kind has one severity");
    }
}
