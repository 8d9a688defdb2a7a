//! What stands behind docs/validation.md: known answers, each found at two tolerances. Lines of the
//! tables are printed (`--nocapture`).

// Reference values may use the platform's functions.
#![allow(clippy::disallowed_methods)]

#[path = "../../benches/common/cells.rs"]
#[allow(dead_code)] // the benches use the rest
mod cells;
#[path = "../common/mod.rs"]
mod common;

mod boxes;
mod cie171;
mod curve;
mod enclosures;
mod factors;
mod grid;

/// The tolerances of the tables' columns.
const TOLERANCES: [f64; 2] = [0.02, 0.005];

/// Prints one line of a table of the page and holds the errors at both tolerances to a bound.
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
}
