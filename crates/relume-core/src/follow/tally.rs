//! Row sums and the balance of a solution.

use crate::element::ElementId;
use crate::solver::{Links, Radiosity, Surfaces, row_sums};

use super::report::{Energy, RowSumError};

/// Row sums and energies of some facets.
pub(crate) fn balance_of(
    surfaces: &impl Surfaces,
    links: &Links,
    radiosity: &Radiosity,
    facets: impl Iterator<Item = ElementId>,
    is_surface: &(dyn Fn(u32) -> bool + Sync),
) -> (RowSumError, Energy) {
    let mut rows = RowSumError::default();
    let mut energy = Energy::default();
    let mut area = 0.0;
    let mut sums = Vec::new();
    let linear = radiosity.is_linear();
    for facet in facets {
        let material = surfaces.material(facet.0);
        sums.clear();
        row_sums(surfaces, links, linear, is_surface, facet.0, &mut |_, sum| sums.push(*sum));
        let mut next = sums.iter();
        radiosity.irradiances(surfaces, facet.0, &mut |id, h| {
            let a = surfaces.area_m2(id);
            let row = &radiosity.row(id, next.next().expect("the same leaves"));
            let off = f64::from(row.mean) - 1.0;
            rows.rms += a * off * off;
            if !surfaces.is_covered(id) {
                rows.max = rows.max.max(off.abs());
            }
            area += a;
            let b = radiosity.radiosity(id);
            let carried = radiosity.carried(surfaces, id, row);
            for c in 0..3 {
                energy.emitted_w += a * f64::from(material.exitance[c]);
                energy.absorbed_w +=
                    a * f64::from((1.0 - material.reflectance[c]) * h.mean[c].max(0.0));
                energy.escaped_w += a * (f64::from(b[c]) - carried[c]);
            }
        });
    }
    rows.rms = if area > 0.0 { (rows.rms / area).sqrt() } else { 0.0 };
    (rows, energy)
}
