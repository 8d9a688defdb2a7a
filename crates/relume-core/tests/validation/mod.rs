//! What stands behind docs/validation.md: known answers, each found at two tolerances. Lines of the
//! tables are printed (`--nocapture`).

// Reference values may use the platform's functions.
#![allow(clippy::disallowed_methods)]

#[path = "../../benches/common/cells.rs"]
#[allow(dead_code)] // the benches use the rest
mod cells;
use std::fs;
use std::path::Path;

mod boxes;
mod cie171;
mod curve;
mod enclosures;
mod factors;
mod grid;

/// The page.
const PAGE: &str = include_str!("../../../../docs/validation.md");

/// The tolerances of the tables' columns.
const TOLERANCES: [f64; 2] = [0.02, 0.005];

/// Prints one line of a table of the page, holds the errors at both tolerances to a bound, and the page's
/// line to what was found.
fn line(case: &str, exact: f64, error_max: f64, at: impl Fn(f64) -> f64) {
    let found = TOLERANCES.map(at);
    let off = found.map(|f| f - exact);
    println!(
        "| {case} | {exact:.7} | {:.7} | {:.7} | {:+.0e} | {:+.0e} |",
        found[0], found[1], off[0], off[1]
    );
    for (off, tolerance) in off.into_iter().zip(TOLERANCES) {
        assert!(
            off.abs() <= error_max,
            "{case} at {tolerance}: off {off:e}, allowed {error_max:e}"
        );
    }
    let row = PAGE.lines().find(|l| l.starts_with(&format!("| {case} |")));
    let row = row.unwrap_or_else(|| panic!("docs/validation.md has no line for `{case}`"));
    let numbers: Vec<f64> =
        row.split('|').skip(2).take(3).map(|x| x.trim().parse().unwrap()).collect();
    assert!((numbers[0] - exact).abs() <= 1e-7, "{case}: the page says {}", numbers[0]);
    for (written, found) in numbers[1..].iter().zip(found) {
        assert!(
            (written - found).abs() <= error_max,
            "{case}: the page says {written}, not {found}"
        );
    }
}

/// Names of the tests in a file of Rust text, without those that are ignored.
fn tests_in(text: &str) -> Vec<String> {
    let after = text.split("#[test]").skip(1).map(|t| t.trim_start());
    let names = after.filter(|t| !t.starts_with("#[ignore"));
    names.filter_map(|t| Some(t.strip_prefix("fn ")?.split_once('(')?.0.to_owned())).collect()
}

#[test]
fn the_page_names_every_test_and_no_other() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let read = |path: &Path| fs::read_to_string(path).unwrap_or_default();
    let named: Vec<(&str, &str)> =
        PAGE.split('`').filter_map(|word| word.split_once("::")).filter(|n| n.1 != "...").collect();
    assert!(named.len() > 20, "{named:?}");
    for &(file, test) in &named {
        let name = format!("{file}.rs");
        let text = read(&tests.join("validation").join(&name)) + &read(&tests.join(&name));
        assert!(tests_in(&text).iter().any(|t| t == test), "{file}::{test} is on the page only");
    }
    for entry in fs::read_dir(tests.join("validation")).unwrap() {
        let path = entry.unwrap().path();
        let file = path.file_stem().unwrap().to_str().unwrap();
        for test in tests_in(&read(&path)).iter().filter(|_| file != "mod") {
            assert!(named.contains(&(file, test)), "{file}::{test} is not on the page");
        }
    }
}
