//! What the library advises, in flags of the command: its messages name options of functions. Knows names only.

/// Names in messages of the library, and what of the command they are.
const FLAGS: [(&str, &str); 12] = [
    ("`ImportOptions::max_memory_bytes`", "--max-memory"),
    ("`ImportOptions::allow_outside`", "--allow-outside"),
    ("`ImportOptions::animation`", "--animation"),
    ("`ImportOptions::edits`", "--reflect and --emit"),
    ("`ImportOptions::rebuild`", "--deform rebuild"),
    ("`Options::max_memory_bytes`", "--max-memory"),
    ("`Options::tolerance`", "--tolerance"),
    ("`Scene::with_outside`", "--sky uniform=1, --sun 135,40"),
    ("`Outside::sun`", "--sun AZIMUTH,ELEVATION or LATITUDE,LONGITUDE,TIME"),
    ("`SunPlace::Earth`", "--sun LATITUDE,LONGITUDE,TIME"),
    ("`Sky::Environment`", "--environment FILE"),
    ("`Factors::close`", "`relume factors --closure reciprocal`"),
];

/// A message of the library with the command's flags in it.
pub(crate) fn in_flags(text: &str) -> String {
    FLAGS.iter().fold(text.to_owned(), |text, (name, flag)| text.replace(name, flag))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::{Path, PathBuf};

    /// The text of all sources of a crate, comments left out.
    fn source(of: &str) -> String {
        let mut folders =
            vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(of).join("src")];
        let mut text = String::new();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path: PathBuf = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "rs") {
                    let all = fs::read_to_string(path).unwrap();
                    let code = all.lines().filter(|l| !l.trim_start().starts_with("//"));
                    text.extend(code.flat_map(|line| [line, "\n"]));
                }
            }
        }
        text
    }

    #[test]
    fn the_library_names_options_and_the_command_flags() {
        let libraries = ["relume-core", "relume-io", "relume-picture"].map(source).concat();
        for (name, flag) in FLAGS {
            assert!(libraries.contains(name), "{name} is in no message any more");
            assert_eq!(in_flags(&format!("raise {name}, or")), format!("raise {flag}, or"));
        }
        let is_flag = |word: &str| {
            let word = word.trim_start_matches(['"', '(', '`', '\'']);
            word.strip_prefix("--").is_some_and(|w| w.starts_with(|c: char| c.is_ascii_lowercase()))
        };
        // That of another program.
        let ours = libraries.replace("ktx extract --transcode", "");
        let found: Vec<&str> = ours.split_whitespace().filter(|word| is_flag(word)).collect();
        assert_eq!(found, [""; 0], "flags in messages of the library");
    }
}
