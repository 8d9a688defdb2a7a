//! `relume check`: what is wrong with a scene, and what to do about it.

use std::cmp::Reverse;

use relume::scene::{self, Instants, Note, Scene, Severity};

use crate::args::CheckArgs;
use crate::failure::Failure;
use crate::notes;
use crate::output::{self, counted};
use crate::scene_file;

/// Runs the command. An error among the findings is a failure; warnings are not.
pub(crate) fn check(args: &CheckArgs) -> Result<(), Failure> {
    let scene = scene_file::load(
        &args.scene,
        &args.animation,
        false,
        Instants { fps: 24.0, frames: Vec::new() },
    )?;
    let mut notes = findings(&scene);
    if args.scene.extension().is_some_and(|e| e.eq_ignore_ascii_case("vs3")) {
        // Files of View3D have no light; they are there for their form factors.
        notes.retain(|note| note.code != "nothing-emits");
    }
    output::print(&text(&scene.name, &notes, args.verbose))?;
    let errors = count_of(&notes, Severity::Error);
    if errors > 0 {
        return Err(Failure::new(format_args!(
            "{} in {}",
            counted(errors, "error"),
            args.scene.display()
        ))
        .help("mend what is listed above and check again"));
    }
    Ok(())
}

/// What the importer noticed and what a look at the scene shows, worst first, each once.
fn findings(scene: &Scene) -> Vec<Note> {
    let mut notes: Vec<Note> = Vec::new();
    for note in scene.notes.iter().cloned().chain(scene::check(scene)) {
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    // Stable: within a severity in the order they were found.
    notes.sort_by_key(|note| Reverse(note.severity));
    notes
}

fn count_of(notes: &[Note], severity: Severity) -> usize {
    notes.iter().filter(|note| note.severity == severity).count()
}

/// The findings as text, a line each or one for many of a kind, and the count of them.
fn text(name: &str, notes: &[Note], verbose: bool) -> String {
    let lines = notes::lines(notes, verbose);
    let mut text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    let name = output::name(name);
    let (errors, warnings) = (count_of(notes, Severity::Error), count_of(notes, Severity::Warning));
    text += &match (errors, warnings) {
        (0, 0) => format!("{name}: nothing wrong found\n"),
        _ => format!("{name}: {}, {}\n", counted(errors, "error"), counted(warnings, "warning")),
    };
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(severity: Severity, count: usize) -> Note {
        let (code, subject, message) = ("open", "wall".to_owned(), "it is open".to_owned());
        Note { severity, code, subject, count, message }
    }

    #[test]
    fn notes_alone_are_nothing_wrong() {
        assert_eq!(text("room", &[], false), "room: nothing wrong found\n");
        assert_eq!(
            text("room", &[note(Severity::Info, 1)], false),
            "note[open]: wall: it is open\nroom: nothing wrong found\n"
        );
    }

    #[test]
    fn findings_are_counted() {
        let notes = [note(Severity::Error, 1), note(Severity::Warning, 3)];
        assert_eq!(
            text("room", &notes, false),
            "error[open]: wall: it is open\nwarning[open]: wall: it is open (3 x)\n\
             room: 1 error, 1 warning\n"
        );
    }

    #[test]
    fn many_findings_of_one_kind_are_one_line() {
        let notes = vec![note(Severity::Warning, 1); 100];
        let folded = text("room", &notes, false);
        assert_eq!(folded.lines().count(), 2, "{folded}");
        assert!(folded.contains("warning[open] (100 of this kind"), "{folded}");
        assert_eq!(text("room", &notes, true).lines().count(), 101);
    }
}
