//! docs/tuning.md: the calibration constants, made of the files `tuning.rs` of the engine's rooms, of readers, of pictures and of the command.
//!
//! `RELUME_DOCS=1 cargo test -p relume tuning::` writes the page anew.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Fields of each constant, in the order of the page's columns.
const FIELDS: [&str; 4] = ["Unit", "Tried", "Larger", "Smaller"];

/// A constant as its file describes it.
#[derive(Debug, PartialEq)]
struct Constant {
    name: String,
    value: String,
    quantity: String,
    /// By [`FIELDS`].
    fields: [String; 4],
}

fn engine() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../relume-core/src")
}

/// The constants of one file; flaws in its form as errors.
fn constants(text: &str) -> Result<Vec<Constant>, String> {
    let mut found = Vec::new();
    let mut doc: Vec<String> = Vec::new();
    for line in joined(text) {
        if let Some(words) = line.strip_prefix("///") {
            // What is further in continues the item above.
            match doc.last_mut().filter(|last| last.starts_with("- ") && words.starts_with("   ")) {
                Some(item) => *item = format!("{item} {}", words.trim()),
                None => doc.push(words.trim().to_owned()),
            }
            continue;
        }
        let Some((_, declared)) = line.split_once("const ") else {
            doc.clear();
            continue;
        };
        found.push(constant(declared, &std::mem::take(&mut doc))?);
    }
    Ok(found)
}

/// Lines of a file, declarations in one line each.
fn joined(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for line in text.lines() {
        match out.last_mut() {
            Some(last) if last.contains("const ") && !last.ends_with(';') => {
                last.push(' ');
                last.push_str(line.trim());
            }
            _ => out.push(line.to_owned()),
        }
    }
    out
}

fn constant(declared: &str, doc: &[String]) -> Result<Constant, String> {
    let (name, rest) = declared.split_once(':').ok_or("a constant has a type")?;
    let (_, value) = rest.split_once('=').ok_or("a constant has a value")?;
    let of = |field: &str| {
        let start = format!("- {field}: ");
        let line = doc.iter().find_map(|line| line.strip_prefix(&start));
        line.map(str::to_owned).ok_or_else(|| format!("{name}: no `- {field}: ...`"))
    };
    let is_quantity = |line: &&str| !line.is_empty() && !line.starts_with("- ");
    let quantity: Vec<&str> = doc.iter().map(String::as_str).filter(is_quantity).collect();
    if quantity.is_empty() {
        return Err(format!("{name}: no quantity"));
    }
    let [unit, tried, larger, smaller] = FIELDS.map(of);
    Ok(Constant {
        name: name.to_owned(),
        value: value.trim().trim_end_matches(';').to_owned(),
        quantity: quantity.join(" "),
        fields: [unit?, tried?, larger?, smaller?],
    })
}

/// The rooms with calibration constants, by name.
fn rooms() -> Vec<(String, Vec<Constant>)> {
    let mut dirs: Vec<PathBuf> =
        fs::read_dir(engine()).unwrap().map(|entry| entry.unwrap().path()).collect();
    dirs.sort();
    let name = |dir: &PathBuf| dir.file_name().unwrap().to_str().unwrap().to_owned();
    let mut rooms: Vec<(String, PathBuf)> = dirs.into_iter().map(|dir| (name(&dir), dir)).collect();
    rooms.push(("files".into(), engine().join("../../relume-io/src")));
    rooms.push(("pictures".into(), engine().join("../../relume-picture/src/picture")));
    rooms.push(("the command".into(), engine().join("../../relume-cli/src")));
    let mut found = Vec::new();
    for (room, dir) in rooms {
        let Ok(text) = fs::read_to_string(dir.join("tuning.rs")) else { continue };
        let constants = constants(&text).unwrap_or_else(|flaw| panic!("{room}: {flaw}"));
        found.push((room, constants));
    }
    found
}

const HEAD: &str = "# Calibration constants\n\n\
    Numbers that were chosen, not derived: each trades accuracy against time or memory. The page is made of the files\n\
    `tuning.rs` of the engine's rooms, of readers of files, of pictures and of the command; a test holds the two equal (`RELUME_DOCS=1 cargo test -p relume tuning::` writes it).\n\
    \"Not varied\": no other value is on record. What was measured is in [tolerance.md](tolerance.md), [exchange.md](exchange.md)\n\
    and [decisions](decisions).\n";

fn page() -> String {
    let mut page = HEAD.to_owned();
    for (room, constants) in rooms() {
        let columns = "| constant | value | unit | quantity | tried | larger | smaller |\n|---|---|---|---|---|---|---|";
        write!(page, "\n## {room}\n\n{columns}\n").unwrap();
        for c in constants {
            let [unit, tried, larger, smaller] = &c.fields;
            let quantity = c.quantity.trim_end_matches('.');
            writeln!(
                page,
                "| `{}` | {} | {unit} | {quantity} | {tried} | {larger} | {smaller} |",
                c.name, c.value
            )
            .unwrap();
        }
    }
    page
}

#[test]
fn the_page_of_constants_is_that_of_the_source() {
    let path = engine().join("../../../docs/tuning.md");
    let page = page();
    if std::env::var_os("RELUME_DOCS").is_some() {
        fs::write(&path, &page).unwrap();
    }
    let there = fs::read_to_string(&path).unwrap_or_default();
    assert!(page == there, "docs/tuning.md differs from the source: RELUME_DOCS=1 writes it");
    assert!(page.lines().filter(|line| line.starts_with("| `")).count() > 80);
}

#[test]
fn a_constant_without_its_range_is_refused() {
    let whole = "/// Weight of noise.\n///\n/// - Unit: 1\n/// - Tried: not varied\n/// - Larger: a\n///   and c\n/// - Smaller: b\n";
    let declared = "pub(super) const NOISE: f64 =\n    0.2;\n";
    let found = constants(&format!("{whole}{declared}")).unwrap();
    assert_eq!((found.len(), &*found[0].name, &*found[0].value), (1, "NOISE", "0.2"));
    assert_eq!(found[0].fields[2..], ["a and c", "b"]);
    for field in FIELDS {
        let start = format!("/// - {field}");
        let without: Vec<&str> = whole.lines().filter(|line| !line.starts_with(&start)).collect();
        let text = format!("{}\n{declared}", without.join("\n"));
        assert!(constants(&text).unwrap_err().contains(field), "{field}");
    }
}
