//! Unique names: the first keeps its name, later ones get " 2", " 3", and so on.

use std::collections::{BTreeMap, BTreeSet};

use super::{Note, Severity};

/// Gives out names that have not been given out before.
#[derive(Default)]
pub struct Names {
    taken: BTreeSet<String>,
    /// For each name that was wanted again the number to try next.
    next: BTreeMap<String, u32>,
    renamed: Vec<(String, String)>,
}

impl Names {
    /// `wanted`, or `wanted` with the first free number behind it.
    pub fn unique(&mut self, wanted: &str) -> String {
        if self.taken.insert(wanted.to_owned()) {
            return wanted.to_owned();
        }
        let next = self.next.entry(wanted.to_owned()).or_insert(2);
        let name = loop {
            let name = format!("{wanted} {next}");
            *next += 1;
            if !self.taken.contains(&name) {
                break name;
            }
        };
        self.taken.insert(name.clone());
        self.renamed.push((wanted.to_owned(), name.clone()));
        name
    }

    /// One note for each name that was wanted more than once; `kind` is what is named.
    pub fn notes(&self, kind: &str) -> Vec<Note> {
        let mut notes: Vec<Note> = Vec::new();
        let mut note_of: BTreeMap<&str, usize> = BTreeMap::new();
        for (wanted, name) in &self.renamed {
            match note_of.get(wanted.as_str()) {
                Some(&k) => {
                    let note = &mut notes[k];
                    note.count += 1;
                    note.message = format!(
                        "{} {kind}s share this name; they are numbered up to `{name}`",
                        note.count + 1
                    );
                }
                None => {
                    note_of.insert(wanted, notes.len());
                    notes.push(Note {
                        severity: Severity::Info,
                        code: "renamed",
                        subject: wanted.clone(),
                        count: 1,
                        message: format!(
                            "two {kind}s share this name; the second is called `{name}`"
                        ),
                    });
                }
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
