//! Unique names: the first keeps its name, later ones get " 2", " 3", and so on.

use std::collections::BTreeSet;

use super::{Note, Severity};

/// Gives out names that have not been given out before.
#[derive(Default)]
pub(super) struct Names {
    taken: BTreeSet<String>,
    renamed: Vec<(String, String)>,
}

impl Names {
    /// `wanted`, or `wanted` with the first free number behind it.
    pub(super) fn unique(&mut self, wanted: &str) -> String {
        if self.taken.insert(wanted.to_owned()) {
            return wanted.to_owned();
        }
        let free = (2u32..).map(|n| format!("{wanted} {n}")).find(|n| !self.taken.contains(n));
        let name = free.unwrap_or_else(|| unreachable!("there are more numbers than names"));
        self.taken.insert(name.clone());
        self.renamed.push((wanted.to_owned(), name.clone()));
        name
    }

    /// One note for each name that was wanted more than once; `kind` is what is named.
    pub(super) fn notes(&self, kind: &str) -> Vec<Note> {
        let mut notes: Vec<Note> = Vec::new();
        for (wanted, name) in &self.renamed {
            match notes.iter_mut().find(|n| n.subject == *wanted) {
                Some(note) => {
                    note.count += 1;
                    note.message = format!(
                        "{} {kind}s share this name; they are numbered up to `{name}`",
                        note.count + 1
                    );
                }
                None => notes.push(Note {
                    severity: Severity::Info,
                    code: "renamed",
                    subject: wanted.clone(),
                    count: 1,
                    message: format!("two {kind}s share this name; the second is called `{name}`"),
                }),
            }
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_ones_are_numbered_and_noted() {
        let mut names = Names::default();
        let got: Vec<String> =
            ["box", "box", "box 2", "box"].iter().map(|n| names.unique(n)).collect();
        assert_eq!(got, ["box", "box 2", "box 2 2", "box 3"]);
        let notes = names.notes("node");
        assert_eq!(notes.len(), 2);
        assert_eq!((notes[0].subject.as_str(), notes[0].count), ("box", 2));
    }
}
