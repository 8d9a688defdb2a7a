//! Tables of form factors as View3D and EnergyPlus read them. Each holds one instant.
//!
//! Must not know how factors are found. The formats: the manual of View3D 3.3, section 6; the
//! Input Output Reference of EnergyPlus, `ZoneProperty:UserViewFactors:BySurfaceName`.

use std::fmt::Write;

use relume_core::scene::Scene;
use relume_core::session::{Factors, Grouping};

/// Length of View3D's first line without its end.
const HEADING: usize = 30;

/// A row with its zeros.
fn full_row(factors: &Factors, from: u32) -> Vec<f64> {
    let mut row = vec![0.0; factors.len()];
    factors.row(from).for_each(|(to, factor)| row[to as usize] = factor);
    row
}

/// The text file that View3D writes (`out=0`): a heading, the areas, a line of factors for each
/// surface in six decimals, the emittances.
///
/// `closed` says that rows were made to sum to 1. A surface's emittance is 1 minus its mean
/// reflectance.
pub fn view3d(scene: &Scene, grouping: &Grouping, factors: &Factors, closed: bool) -> String {
    let program = concat!("Relume ", env!("CARGO_PKG_VERSION"));
    let n = factors.len();
    let mut out = format!("{:HEADING$}\n", format!("{program} 0 {} 0 {n}", i32::from(closed)));
    let line = |values: &[String]| values.join(" ") + "\n";
    let areas: Vec<String> = factors.area_m2.iter().map(|a| general(*a)).collect();
    out += &line(&areas);
    for from in 0..n as u32 {
        let row = full_row(factors, from);
        out += &line(&row.iter().map(|f| format!("{f:.6}")).collect::<Vec<_>>());
    }
    let emittances: Vec<String> =
        emittances(scene, grouping).iter().map(|e| format!("{e:.3}")).collect();
    out + &line(&emittances)
}

/// Six significant digits, as C's %g has them.
fn general(x: f64) -> String {
    let exponent: i32 = match format!("{x:.5e}").split_once('e') {
        Some((_, exponent)) => exponent.parse().unwrap_or(0),
        None => 0,
    };
    if x != 0.0 && !(-4..6).contains(&exponent) {
        let text = format!("{x:.5e}");
        let (digits, _) = text.split_once('e').unwrap_or((&text, ""));
        let sign = if exponent < 0 { '-' } else { '+' };
        return format!("{}e{sign}{:02}", trimmed(digits), exponent.abs());
    }
    trimmed(&format!("{x:.*}", (5 - exponent).max(0) as usize)).to_owned()
}

fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

/// 1 minus the reflectance of each group, mean of its patches and channels.
fn emittances(scene: &Scene, grouping: &Grouping) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); grouping.names.len()];
    for (patch, group) in scene.patches.iter().zip(&grouping.of_patch) {
        let Some(group) = group else { continue };
        let rho = scene.reflectance(patch);
        let (area, reflected) = &mut sums[*group as usize];
        *area += patch.area_m2();
        *reflected += patch.area_m2() * rho.iter().sum::<f64>() / 3.0;
    }
    sums.iter().map(|(area, reflected)| 1.0 - reflected / area).collect()
}

/// The object that gives EnergyPlus the view factors of a zone by surface name: all pairs, zeros
/// included.
///
/// # Errors
/// With the name of a surface, or the zone's, that an input file of EnergyPlus cannot hold.
pub fn energyplus(zone: &str, grouping: &Grouping, factors: &Factors) -> Result<String, String> {
    let holds = |name: &&String| name.contains([',', ';', '!', '\n', '\r']) || name.is_empty();
    if let Some(name) = grouping.names.iter().chain([&zone.to_owned()]).find(holds) {
        return Err(name.clone());
    }
    let mut out = format!(
        "! View factors from {}\nZoneProperty:UserViewFactors:BySurfaceName,\n  {zone}",
        concat!("Relume ", env!("CARGO_PKG_VERSION"))
    );
    for (from, name) in (0..).zip(&grouping.names) {
        for (to, factor) in grouping.names.iter().zip(full_row(factors, from)) {
            write!(out, ",\n  {name}, {to}, {factor:.9}").expect("text has room");
        }
    }
    Ok(out + ";\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_c_has_them() {
        for (x, text) in [
            (1.0, "1"),
            (0.25, "0.25"),
            (123_456.7, "123457"),
            (1_234_567.0, "1.23457e+06"),
            (0.000_012_345_67, "1.23457e-05"),
            (0.0001, "0.0001"),
            (0.0, "0"),
            (999_999.7, "1e+06"),
            (14.54545454, "14.5455"),
        ] {
            assert_eq!(general(x), text);
        }
    }
}
