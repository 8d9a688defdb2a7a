//! Completions and manual pages: whatever the command takes stands in them.

use std::collections::BTreeSet;
use std::fs;

use crate::common::{relume, text};

/// The commands that the help lists.
fn commands() -> Vec<String> {
    let help = relume(&["--help"]).succeeds().out;
    let listed = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let of_line = |line: &str| {
        let name = line.strip_prefix("  ").filter(|rest| !rest.starts_with(' '))?;
        name.split_whitespace().next().map(str::to_owned)
    };
    let names: Vec<String> = listed.lines().filter_map(of_line).filter(|n| n != "help").collect();
    assert!(names.len() > 10, "{names:?}");
    names
}

/// The long options in a text.
fn options(text: &str) -> BTreeSet<String> {
    let is_part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let after = text.split("--").skip(1);
    let names = after.map(|rest| rest.chars().take_while(|&c| is_part(c)).collect::<String>());
    names.filter(|name| name.len() > 2 && !name.starts_with('-')).collect()
}

/// The long options that the help of a command lists.
fn options_of(command: &str) -> BTreeSet<String> {
    let help = relume(&[command, "--help"]).succeeds().out;
    let listed = help.split("Options:").nth(1).unwrap();
    let starts = |line: &&str| line.trim_start().starts_with('-');
    options(&listed.lines().filter(starts).collect::<Vec<_>>().join("\n"))
}

#[test]
fn every_shell_completes_every_command_and_option_of_render() {
    let wanted = options_of("render");
    assert!(wanted.contains("tolerance") && wanted.len() > 20, "{wanted:?}");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = relume(&["completions", shell]).succeeds().out;
        for command in commands() {
            assert!(script.contains(&command), "{shell}: {command}");
        }
        for option in &wanted {
            assert!(script.contains(option.as_str()), "{shell}: --{option}");
        }
    }
    relume(&["completions", "tcsh"]).fails(2, &["bash", "zsh"]);
}

#[test]
fn every_command_has_a_page_with_its_options() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man/man1");
    relume(&["man", text(&pages)]).succeeds();
    let page = |name: &str| fs::read_to_string(pages.join(name)).unwrap();
    let first = page("relume.1");
    assert!(first.contains(".TH relume 1"), "{first}");
    for command in commands() {
        let own = page(&format!("relume-{command}.1"));
        assert!(own.contains(&format!("relume-{command}")), "{own}");
        assert!(first.contains(&format!("relume\\-{command}(1)")), "{command}");
        for option in options_of(&command) {
            let written = format!("\\-\\-{}", option.replace('-', "\\-"));
            assert!(own.contains(&written), "{command}: --{option}");
        }
    }
    assert!(page("relume-flat-figure.1").contains("figure"));
    // A file in the place of the directory.
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    relume(&["man", text(&file)]).fails(1, &["file"]);
}
